//! Memory against error, beside uniform subsampling, and what corrections of opacity are good for. Prints tables for
//! `docs/memory.md`. `memory_tables DATA software|wgpu engine|mri|heptane|mouse...` or `memory_tables DATA opacity`

mod opacity;

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use volery::{
    Backend, BackendChoice, Dial, How, InputData, InputOptions, Picture, RenderError, Session, View,
    ViewOptions, VolumeData, VoxelGrid, open_backend,
};
use volery_reference::metrics::{Comparison, compare};
use volery_tests::{exact, read_scene, view_of};

pub(crate) type Outcome<T> = Result<T, Box<dyn Error>>;

/// Budgets as shares of the bytes of all bricks in full resolution.
const SHARES: [f64; 8] = [1.0 / 64.0, 1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 0.3, 0.5, 0.75, 1.0];

fn main() -> Outcome<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let (data, choice, scenes) = match &arguments[..] {
        [data, name] if name == "opacity" => return opacity::tables(Path::new(data)),
        [data, name, scenes @ ..] if name == "software" => (data, BackendChoice::Software, scenes),
        [data, name, scenes @ ..] if name == "wgpu" => (data, BackendChoice::Wgpu, scenes),
        _ => {
            return Err(
                "usage: memory_tables DATA software|wgpu SCENE... or memory_tables DATA opacity".into()
            );
        }
    };
    let mut backend = open_backend(choice)?;
    println!("{}\n\n{HEAD}", backend.device().name);
    for name in scenes {
        let (grid, view) = scene(Path::new(data), name)?;
        of_scene(name, &grid, &view, backend.as_mut())?;
    }
    Ok(())
}

const HEAD: &str = "\
| scene | share | budget MiB | resident MiB | nodes by level | predicted rmse | rmse | max | plan ms | draw ms |
|---|---|---|---|---|---|---|---|---|---|";

/// A scene of the peers, or the mouse, which has none, as the program shows it.
fn scene(data: &Path, name: &str) -> Outcome<(VoxelGrid, View)> {
    if name != "mouse" {
        let input = read_scene(data, name);
        return Ok((input.volume()?.grid.clone(), view_of(&input)));
    }
    let mut options = InputOptions { data_dir: None, ..InputOptions::default() };
    options.input.dims = Some([512; 3]);
    options.input.dtype = Some("uint8".parse()?);
    let plan = options.find(&data.join("mouse_512x512x512_uint8.raw.zst"))?;
    let input = plan.read()?;
    let InputData::Volume(volume) = input.data else { return Err("the mouse is a volume".into()) };
    let session = Session::new(VolumeData::new(volume.grid.clone())?);
    let options = ViewOptions { width: 512, height: 512, how: Some(How::Raycast), ..ViewOptions::default() };
    Ok((volume.grid, session.view(&options)))
}

fn of_scene(name: &str, grid: &VoxelGrid, view: &View, backend: &mut dyn Backend) -> Outcome<()> {
    let mut session = Session::new(VolumeData::new(grid.clone())?);
    let full = session.render(view, backend)?;
    let start = Instant::now();
    session.render(view, backend)?;
    println!(
        "| {name} | visible, full | | {:.2} | {:?} | | 0 | 0 | | {:.0} |",
        mib(full.report.work.bytes_resident),
        full.report.work.nodes_by_level.clone().unwrap_or_default(),
        1e3 * start.elapsed().as_secs_f64(),
    );
    let all = all_bytes(grid);
    for share in SHARES {
        let budget = (share * all) as u64;
        let within = View { dial: Dial::Memory(budget), ..view.clone() };
        // The first picture of a transfer function looks at what is lost.
        let drawn = session.render(&within, backend).and_then(|_| session.render(&within, backend));
        match drawn {
            Ok(picture) => print(name, share, budget, &picture, &distance(&picture, &full)?),
            Err(RenderError::Memory { least, .. }) => {
                println!("| {name} | {share:.4} | {:.2} | at least {least} bytes | | | | | | |", mib(budget));
            }
            Err(error) => return Err(error.into()),
        }
    }
    for step in [2, 4] {
        let mut coarse = Session::new(VolumeData::new(subsampled(grid, step)?)?);
        let picture = coarse.render(view, backend)?;
        let found = distance(&picture, &full)?;
        println!(
            "| {name} | {:.4}, every {step}. sample | | {:.2} | | | {:.5} | {:.3} | | |",
            1.0 / (step * step * step) as f64,
            mib(picture.report.work.bytes_resident),
            found.rmse,
            found.max,
        );
        // And a brick on its way, which nobody counts there, and what samples take that stand for the ends of axes.
        let budget = (picture.report.work.bytes_resident as f64 * 1.05) as u64 + 40_000;
        let within = View { dial: Dial::Memory(budget), ..view.clone() };
        let picture = session.render(&within, backend)?;
        print(name, budget as f64 / all, budget, &picture, &distance(&picture, &full)?);
    }
    Ok(())
}

fn print(name: &str, share: f64, budget: u64, picture: &Picture, found: &Comparison) {
    let (work, seconds) = (&picture.report.work, &picture.report.seconds);
    let predicted = picture.report.error.as_ref().and_then(|error| error.predicted_rmse);
    println!(
        "| {name} | {share:.4} | {:.2} | {:.2} | {:?} | {:.5} | {:.5} | {:.3} | {:.1} | {:.0} |",
        mib(budget),
        mib(work.bytes_resident),
        work.nodes_by_level.clone().unwrap_or_default(),
        predicted.unwrap_or(f64::NAN),
        found.rmse,
        found.max,
        1e3 * seconds.select,
        1e3 * seconds.draw,
    );
}

fn distance(picture: &Picture, full: &Picture) -> Outcome<Comparison> {
    Ok(compare(&exact(&picture.image), &exact(&full.image))?)
}

fn mib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}

/// Of the samples, as a file holds them.
fn all_bytes(grid: &VoxelGrid) -> f64 {
    (grid.num_samples() * grid.sample_type().bytes()) as f64
}

/// Every second sample along each axis, or every fourth: as coarse levels are made.
fn subsampled(grid: &VoxelGrid, step: usize) -> Outcome<VoxelGrid> {
    let dims = grid.dims();
    let value = |place: [usize; 3]| {
        let at = std::array::from_fn(|axis| (place[axis] * step).min(dims[axis] - 1));
        grid.samples().value(grid.index(at), 0) as f32
    };
    let coarse = dims.map(|n| (n - 1).div_ceil(step) + 1);
    let samples = volery_data::fill(coarse, value);
    let as_bytes = || samples.iter().map(|&value| value as u8).collect::<Vec<u8>>();
    let spacing = grid.spacing() * step as f64;
    Ok(if grid.sample_type() == volery::SampleType::U8 {
        VoxelGrid::new(coarse, spacing, as_bytes())?
    } else {
        VoxelGrid::new(coarse, spacing, samples)?
    })
}
