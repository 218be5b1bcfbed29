//! An array in memory, seen by 50 cameras and three techniques on one device: what goes to the device, and how long a
//! picture takes.

use std::error::Error;

use volery::fit::Direction;
use volery::glam::DVec3;
use volery::{
    BackendChoice, Dial, How, PlaneView, Session, Thickness, View, ViewOptions, VolumeData, VoxelGrid,
    open_backend,
};

const SIDE: usize = 96;

fn main() -> Result<(), Box<dyn Error>> {
    // A ball in haze.
    let place = |i: usize| DVec3::new((i % SIDE) as f64, (i / SIDE % SIDE) as f64, (i / SIDE / SIDE) as f64);
    let value = |i: usize| (-(place(i) / SIDE as f64 - 0.5).length_squared() * 16.0).exp() as f32;
    let samples: Vec<f32> = (0..SIDE.pow(3)).map(value).collect();
    let mut session = Session::new(VolumeData::new(VoxelGrid::new([SIDE; 3], DVec3::ONE, samples)?)?);
    let mut backend = open_backend(BackendChoice::Auto)?;
    println!("{}", backend.device().name);
    for number in 0..50 {
        let direction = Direction { azimuth_deg: 7.2 * f64::from(number), ..Direction::default() };
        let (how, dial) = match number % 3 {
            0 => (How::Raycast, Dial::Full),
            1 => (How::Planes(PlaneView::default()), Dial::Error(0.02)),
            _ => (How::Fans(Thickness::Exact), Dial::Tolerance(0.02)),
        };
        let options = ViewOptions { direction: Some(direction), how: Some(how), ..ViewOptions::default() };
        let view = View { dial, ..session.view(&options) };
        let report = session.render(&view, backend.as_mut())?.report;
        let (milliseconds, bytes) = (1e3 * report.seconds.frame, report.work.bytes_uploaded);
        println!("{number:>2} {:<8} {milliseconds:>7.1} ms {bytes:>10} bytes uploaded", report.technique);
    }
    Ok(())
}
