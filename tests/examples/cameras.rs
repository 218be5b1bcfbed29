//! A hundred cameras around engine by rays, by fans and by a plane, and around bluntfin by slices: bytes that go to the
//! device after the first picture, by what they are, and the mean time of a frame. `cameras DATA [software|wgpu]`.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use volery::glam::{DQuat, DVec3};
use volery::{
    Backend, BackendChoice, Camera, Data, GridData, How, InputData, Plane, PlaneView, Session, Slicing,
    StackView, Thickness, View, VolumeData, open_backend,
};
use volery_frame::UploadedBytes;
use volery_tests::{read_scene, view_of};

const NUM_CAMERAS: u32 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (data, backends): (&str, &[BackendChoice]) = match &arguments[..] {
        [data] => (data, &[BackendChoice::Wgpu, BackendChoice::Software]),
        [data, name] if name == "software" => (data, &[BackendChoice::Software]),
        [data, name] if name == "wgpu" => (data, &[BackendChoice::Wgpu]),
        _ => return Err("usage: cameras DATA [software|wgpu]".into()),
    };
    let engine = read_scene(Path::new(data), "engine");
    let bluntfin = read_scene(Path::new(data), "bluntfin");
    let InputData::Grid(file) = &bluntfin.data else { return Err("bluntfin: expected a grid".into()) };
    let array = file.array.as_ref().map(|array| array.name.as_str());
    let plane = Plane::through(engine.volume()?.grid.extent() / 2.0, DVec3::new(1.0, 0.4, 0.3));
    let planes = PlaneView { planes: vec![plane], ..PlaneView::default() };
    for &choice in backends {
        let mut backend = open_backend(choice)?;
        let backend = backend.as_mut();
        println!("{}\n{HEAD}", backend.device().name);
        let mut volume = Session::new(VolumeData::new(engine.volume()?.grid.clone())?);
        for how in [How::Raycast, How::Planes(planes.clone()), How::Fans(Thickness::Exact)] {
            turn("engine", &mut volume, &View { how, ..view_of(&engine) }, backend)?;
        }
        let mut cells = Session::new(GridData::new(file.grid.clone(), array)?);
        for slicing in [Slicing::Axes, Slicing::Immediate] {
            let how = How::Stack(StackView { slicing, ..StackView::default() });
            turn(
                &format!("bluntfin, {slicing:?}"),
                &mut cells,
                &View { how, ..view_of(&bluntfin) },
                backend,
            )?;
        }
    }
    Ok(())
}

const HEAD: &str =
    "data                technique  ms a frame    bricks    places   choices transfers  geometry     views";

/// Goes around what the camera looks at.
fn turn<D: Data>(
    name: &str,
    session: &mut Session<D>,
    view: &View,
    backend: &mut dyn Backend,
) -> Result<(), Box<dyn Error>> {
    let (mut before, mut seconds) = (UploadedBytes::default(), 0.0);
    for number in 0..NUM_CAMERAS {
        let Camera { eye, target, up, .. } = view.camera;
        let angle = std::f64::consts::TAU * f64::from(number) / f64::from(NUM_CAMERAS);
        let eye = target + DQuat::from_axis_angle(up.normalize(), angle) * (eye - target);
        let start = Instant::now();
        session.render(&View { camera: Camera { eye, ..view.camera }, ..view.clone() }, backend)?;
        if number == 0 {
            before = backend.uploaded_bytes();
        } else {
            seconds += start.elapsed().as_secs_f64();
        }
    }
    let UploadedBytes { bricks, places, choices, transfers, geometry, views } = backend.uploaded_bytes();
    let milliseconds = 1e3 * seconds / f64::from(NUM_CAMERAS - 1);
    println!(
        "{name:<19} {:<10} {milliseconds:>10.1} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        view.how.name(),
        bricks - before.bricks,
        places - before.places,
        choices - before.choices,
        transfers - before.transfers,
        geometry - before.geometry,
        views - before.views
    );
    Ok(())
}
