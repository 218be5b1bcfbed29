//! How well deadlines are kept on this machine, and what pictures they leave, beside resolution scaling and the four steps
//! of VTK's mappers: the paper's 200 frames. Prints tables for `docs/deadlines.md`.
//! `deadlines DATA software|wgpu SCENE...`

use std::error::Error;
use std::path::Path as FilePath;
use std::time::Instant;

use volery::{
    Backend, BackendChoice, Camera, Data, Deadline, Dial, GridData, Image, InputData, Path, Session, View,
    VolumeData, open_backend,
};
use volery_schedule::controllers::{FourSteps, ResolutionScaling};
use volery_schedule::{Controller, Item, Level, Step};
use volery_tests::{read_scene, view_of};

type Outcome<T> = Result<T, Box<dyn Error>>;

const NUM_FRAMES: usize = 200;
/// Frames whose pictures are compared with full resolution: every so many.
const COMPARED: usize = 10;
/// Frames from which costs are learned before those that count.
const WARM_UP: usize = 20;
const SHARES: [f64; 4] = [0.5, 0.25, 0.125, 0.0625];

fn main() -> Outcome<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (data, choice, scenes) = match &arguments[..] {
        [data, name, scenes @ ..] if name == "software" => (data, BackendChoice::Software, scenes),
        [data, name, scenes @ ..] if name == "wgpu" => (data, BackendChoice::Wgpu, scenes),
        _ => return Err("usage: deadlines DATA software|wgpu SCENE...".into()),
    };
    let mut backend = open_backend(choice)?;
    println!("{}\n\n{HEAD}", backend.device().name);
    for name in scenes {
        let input = read_scene(FilePath::new(data), name);
        let view = view_of(&input);
        match &input.data {
            InputData::Grid(file) => {
                let array = file.array.as_ref().map(|array| array.name.as_str());
                scene(name, Session::new(GridData::new(file.grid.clone(), array)?), &view, backend.as_mut())?;
            }
            _ => {
                let volume = VolumeData::new(input.volume()?.grid.clone())?;
                scene(name, Session::new(volume), &view, backend.as_mut())?;
            }
        }
    }
    Ok(())
}

const HEAD: &str = "\
| scene | budget ms | what | p1 | p50 | p95 | p99 | max | > 5 % | > 10 % | rays | control % | rmse |
|---|---|---|---|---|---|---|---|---|---|---|---|---|";

/// What a sequence of frames was.
#[derive(Default)]
struct Record {
    /// Relative to the budget.
    signed_errors: Vec<f64>,
    squares: f64,
    rays: f64,
    control: Option<f64>,
}

fn scene<D: Data>(
    name: &str,
    mut session: Session<D>,
    view: &View,
    backend: &mut dyn Backend,
) -> Outcome<()> {
    let camera = |frame: usize| Path::Paper.camera(&view.camera, frame, NUM_FRAMES);
    session.render(view, backend)?;
    let mut full = Vec::new();
    let start = Instant::now();
    for frame in (0..NUM_FRAMES).step_by(COMPARED) {
        full.push(session.render(&View { camera: camera(frame), ..view.clone() }, backend)?.image);
    }
    let full_secs = start.elapsed().as_secs_f64() / full.len() as f64;
    println!("| {name} | {:.1} | full resolution | | | | | | | | 1 | | 0 |", 1e3 * full_secs);
    for budget_secs in SHARES.map(|share| share * full_secs) {
        print(name, budget_secs, "the clock", jitter(budget_secs));
        let deadline = View { dial: Dial::Deadline(Deadline { budget_secs, gaze: None }), ..view.clone() };
        let mut paced = |camera: Camera| {
            let picture = session.render(&View { camera, ..deadline.clone() }, backend)?;
            let paced = picture.report.frames[0].paced;
            let rays = paced.map_or(1.0, |paced| paced.rays_per_pixel);
            Ok((picture.image, rays, paced.map(|paced| paced.control_seconds)))
        };
        print(name, budget_secs, "deadline", record(budget_secs, &full, camera, &mut paced)?);
        at_rest(name, budget_secs, || Ok(session.render(&deadline, backend)?.image))?;
        let others: [(&str, Box<dyn Controller>); 2] =
            [("scaling", Box::new(ResolutionScaling::new())), ("four steps", Box::new(FourSteps::new()))];
        for (what, mut controller) in others {
            let mut scaled = |camera: Camera| {
                scaled(
                    &mut session,
                    &View { camera, ..view.clone() },
                    budget_secs,
                    (controller.as_mut(), backend),
                )
            };
            print(name, budget_secs, what, record(budget_secs, &full, camera, &mut scaled)?);
        }
    }
    Ok(())
}

/// How many pictures of a camera that rests are the same as the one before.
fn at_rest(name: &str, budget_secs: f64, mut draw: impl FnMut() -> Outcome<Image>) -> Outcome<()> {
    let pictures = (0..60).map(|_| draw()).collect::<Outcome<Vec<_>>>()?;
    let same: Vec<bool> = pictures.windows(2).map(|pair| pair[0] == pair[1]).collect();
    let settled = same.iter().rposition(|same| !same).map_or(0, |last| last + 1);
    let num = same.iter().skip(8).filter(|same| **same).count();
    eprintln!(
        "{name} {:.1} ms: at rest {num} of {} pictures are that before, all from picture {settled} on",
        1e3 * budget_secs,
        same.len() - 8
    );
    Ok(())
}

/// A picture, the share of its pixels that have rays, and seconds of control if they are known.
type Drawn = (Image, f64, Option<f64>);

/// Draws the sequence.
fn record(
    budget_secs: f64,
    full: &[Image],
    camera: impl Fn(usize) -> Camera,
    draw: &mut dyn FnMut(Camera) -> Outcome<Drawn>,
) -> Outcome<Record> {
    for frame in 0..WARM_UP {
        draw(camera(frame))?;
    }
    let mut record = Record::default();
    for frame in 0..NUM_FRAMES {
        let start = Instant::now();
        let (image, rays, control) = draw(camera(frame))?;
        let secs = start.elapsed().as_secs_f64();
        record.signed_errors.push(secs / budget_secs - 1.0);
        record.rays += rays / NUM_FRAMES as f64;
        if let Some(control) = control {
            *record.control.get_or_insert(0.0) += control / secs / NUM_FRAMES as f64;
        }
        if frame.is_multiple_of(COMPARED) {
            record.squares += mean_square(&image, &full[frame / COMPARED]) / full.len() as f64;
        }
    }
    Ok(record)
}

/// Draws a picture of fewer pixels, as a controller says, and enlarges it.
fn scaled<D: Data>(
    session: &mut Session<D>,
    view: &View,
    budget_secs: f64,
    (controller, backend): (&mut dyn Controller, &mut dyn Backend),
) -> Outcome<Drawn> {
    let start = Instant::now();
    let levels = [Level { work: 1.0, bytes: 0.0, error: 0.0 }];
    controller.begin(budget_secs, &[Item { key: 0, importance: 1.0, levels: &levels }]);
    let mut rate = 1.0;
    while let Step::Draw(part) = controller.next(start.elapsed().as_secs_f64()) {
        rate = part.pixel_rate;
    }
    let [width, height] = [view.width, view.height].map(|n| ((f64::from(n) * rate).round() as u32).max(1));
    let picture = session.render(&View { width, height, ..view.clone() }, backend)?;
    let image = enlarged(&picture.image, [view.width, view.height]);
    controller.finish(start.elapsed().as_secs_f64());
    Ok((image, rate * rate, None))
}

/// Interpolated between the middles of pixels.
fn enlarged(image: &Image, [width, height]: [u32; 2]) -> Image {
    let place = |pixel: u32, size: u32, large: u32| {
        let at = ((f64::from(pixel) + 0.5) * f64::from(size) / f64::from(large) - 0.5).max(0.0);
        let first = (at as u32).min(size - 1);
        (first, (first + 1).min(size - 1), (at - f64::from(first)) as f32)
    };
    let mut pixels = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        let (above, below, v) = place(y, image.height, height);
        for x in 0..width {
            let (left, right, u) = place(x, image.width, width);
            let at = |x: u32, y: u32| image.pixels[(y * image.width + x) as usize];
            pixels.push([0, 1, 2].map(|i| {
                let upper = at(left, above)[i] + u * (at(right, above)[i] - at(left, above)[i]);
                let lower = at(left, below)[i] + u * (at(right, below)[i] - at(left, below)[i]);
                upper + v * (lower - upper)
            }));
        }
    }
    Image { width, height, pixels }
}

/// How late an empty loop of that length ends: what this machine does to any deadline.
fn jitter(budget_secs: f64) -> Record {
    let mut record = Record::default();
    for _ in 0..NUM_FRAMES {
        let start = Instant::now();
        while start.elapsed().as_secs_f64() < budget_secs {
            std::hint::spin_loop();
        }
        record.signed_errors.push(start.elapsed().as_secs_f64() / budget_secs - 1.0);
    }
    record
}

fn print(name: &str, budget_secs: f64, what: &str, mut record: Record) {
    let errors = &mut record.signed_errors;
    errors.sort_by(f64::total_cmp);
    let num = errors.len() as f64;
    let at = |share: f64| format!("{:+.1}", 100.0 * errors[((num - 1.0) * share).round() as usize]);
    let late = |limit: f64| {
        format!("{:.1}", 100.0 * errors.iter().filter(|&&error| error > limit).count() as f64 / num)
    };
    let quantiles = [0.01, 0.5, 0.95, 0.99, 1.0].map(at).join(" | ");
    let of_pictures = if record.rays > 0.0 {
        let control = record.control.map_or(String::new(), |control| format!("{:.2}", 100.0 * control));
        format!("{:.3} | {control} | {:.5}", record.rays, record.squares.sqrt())
    } else {
        " | | ".to_owned()
    };
    println!(
        "| {name} | {:.1} | {what} | {quantiles} | {} | {} | {of_pictures} |",
        1e3 * budget_secs,
        late(0.05),
        late(0.1)
    );
}

fn mean_square(a: &Image, b: &Image) -> f64 {
    let squares = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (3 * a.pixels.len()) as f64
}
