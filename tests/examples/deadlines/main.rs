//! How well deadlines are kept, and what pictures they leave: the paper's 200 frames of engine, heptane, mouse by rays and
//! of bluntfin by slices. `deadlines DATA [software|wgpu] [SCENE]...`.

use std::error::Error;
use std::path::Path as FilePath;
use std::time::Instant;

use volery::{
    Backend, BackendChoice, Data, Deadline, Dial, GridData, Image, InputData, Path, Session, View,
    VolumeData, open_backend,
};
use volery_tests::{read_scene, view_of};

const NUM_FRAMES: usize = 200;
/// Frames whose pictures are compared with full resolution: every so many.
const COMPARED: usize = 10;
const SHARES: [f64; 4] = [0.5, 0.25, 0.125, 0.0625];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [data, backend, scenes @ ..] = &arguments[..] else {
        return Err("usage: deadlines DATA software|wgpu SCENE...".into());
    };
    let choice = match backend.as_str() {
        "software" => BackendChoice::Software,
        _ => BackendChoice::Wgpu,
    };
    let mut backend = open_backend(choice)?;
    println!("{}", backend.device().name);
    for name in scenes {
        let input = read_scene(FilePath::new(data), name);
        let view = view_of(&input);
        match &input.data {
            InputData::Grid(file) => {
                let array = file.array.as_ref().map(|array| array.name.as_str());
                scene(name, Session::new(GridData::new(file.grid.clone(), array)?), &view, backend.as_mut())?;
            }
            _ => scene(
                name,
                Session::new(VolumeData::new(input.volume()?.grid.clone())?),
                &view,
                backend.as_mut(),
            )?,
        }
    }
    Ok(())
}

fn scene<D: Data>(
    name: &str,
    mut session: Session<D>,
    view: &View,
    backend: &mut dyn Backend,
) -> Result<(), Box<dyn Error>> {
    let view_at = |frame: usize, dial: Dial| View {
        camera: Path::Paper.camera(&view.camera, frame, NUM_FRAMES),
        dial,
        ..view.clone()
    };
    let mut full = Vec::new();
    let mut full_secs = 0.0;
    session.render(&view_at(0, Dial::Full), backend)?;
    for frame in (0..NUM_FRAMES).step_by(COMPARED) {
        let start = Instant::now();
        let picture = session.render(&view_at(frame, Dial::Full), backend)?;
        full_secs += start.elapsed().as_secs_f64();
        full.push(picture.image);
    }
    full_secs /= full.len() as f64;
    println!("{name}: {:.1} ms in full", 1e3 * full_secs);
    let shares = std::env::var("SHARES")
        .map_or(SHARES.to_vec(), |text| text.split(',').map(|x| x.parse().unwrap()).collect());
    for share in shares {
        let budget_secs = share * full_secs;
        let dial = Dial::Deadline(Deadline { budget_secs, gaze: None });
        for frame in 0..20 {
            session.render(&view_at(frame, dial), backend)?;
        }
        let (mut errors, mut squares, mut control, mut floor, mut rays) = (Vec::new(), 0.0, 0.0, 0, 0.0);
        for frame in 0..NUM_FRAMES {
            let view = view_at(frame, dial);
            let start = Instant::now();
            let picture = session.render(&view, backend)?;
            let secs = start.elapsed().as_secs_f64();
            errors.push(secs / budget_secs - 1.0);
            if let Some(paced) = picture.report.frames[0].paced {
                if std::env::var("EACH").is_ok() && frame % 8 == 0 {
                    println!("{frame} {:.1} of {:.1} {paced:?}", secs * 1e3, budget_secs * 1e3);
                }
                control += paced.control_seconds / secs;
                rays += paced.rays_per_pixel;
                floor += usize::from(paced.is_at_floor);
            }
            if frame % COMPARED == 0 {
                squares += mean_square(&picture.image, &full[frame / COMPARED]);
            }
        }
        errors.sort_by(f64::total_cmp);
        let at = |share: f64| 100.0 * errors[((errors.len() - 1) as f64 * share).round() as usize];
        let late = |limit: f64| {
            100.0 * errors.iter().filter(|&&error| error > limit).count() as f64 / errors.len() as f64
        };
        println!(
            "  {:5.1} ms: p1 {:+.1} p50 {:+.1} p95 {:+.1} p99 {:+.1} max {:+.1} %; late >5%: {:.1} %, >10%: {:.1} %; floor {floor}; control {:.2} %; rays {:.3}; rmse {:.5}",
            1e3 * budget_secs,
            at(0.01),
            at(0.5),
            at(0.95),
            at(0.99),
            at(1.0),
            late(0.05),
            late(0.1),
            100.0 * control / NUM_FRAMES as f64,
            rays / NUM_FRAMES as f64,
            (squares / full.len() as f64).sqrt()
        );
    }
    Ok(())
}

fn mean_square(a: &Image, b: &Image) -> f64 {
    let squares =
        a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    squares.sum::<f64>() / (3 * a.pixels.len()) as f64
}
