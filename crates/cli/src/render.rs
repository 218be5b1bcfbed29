//! `volery render`

use std::path::Path;

use volery::fit::{self, Direction};
use volery::info::number;
use volery::io::transfer::TransferOptions;
use volery::io::{read_transfer, write_atomically};
use volery::output::{ErrorMap, write_image};
use volery::{
    Focus, Input, Picture, PlaneView, RenderError, Report, Sampling, Session, Step, TransferFunction, View,
    ViewOptions, open_backend, read_input,
};

use crate::args::{PlaneArgs, RenderArgs, Technique, Transfer};
use crate::progress::Progress;
use crate::{Failure, say};

/// Pictures that `--progressive` writes, about.
const PROGRESSIVE_STEPS: usize = 8;

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let backend = open_backend(args.backend.into())?;
    let input = {
        let _busy = Progress::spinner("reading");
        read_input(&args.input, args.data.as_deref())?
    };
    let grid = &input.volume.grid;
    let technique = match args.technique {
        Technique::Auto if args.planes.is_given() => volery::Technique::Plane,
        Technique::Auto => volery::Technique::suiting(grid),
        Technique::Raycast => volery::Technique::Raycast,
        Technique::Plane => volery::Technique::Plane,
        Technique::Fans => volery::Technique::Fans,
    };
    let mut session = {
        let _busy = Progress::spinner("building the pyramid");
        let of_file = |error| Failure(format!("{}: {error}", input.path.display()));
        Session::open(grid.clone(), backend, technique).map_err(of_file)?
    };
    let view = view(args, &input, &session)?;
    if let Some(folder) = &args.progressive {
        progressive(folder, &mut session, &view, &input)?;
    }
    let mut picture = {
        let _busy = Progress::spinner("drawing");
        session.render_frames(&view, args.frames as usize)?
    };
    picture.report.input.path = Some(input.path.to_string_lossy().into_owned());
    picture.report.seconds.load = Some(input.load_seconds);
    write_image(&args.output, &picture.image)?;
    let error_map = verify(args, &session, &view, &mut picture)?;
    if let Some(path) = &args.report {
        write_report(path, &picture.report)?;
    }
    say(summary(&args.output, &picture.report))?;
    if let Some(line) = error_map {
        say(line)?;
    }
    notes(&input, &session, &view)
}

fn view(args: &RenderArgs, input: &Input, session: &Session) -> Result<View, Failure> {
    let transfer = args.transfer.as_ref().map(|transfer| load_transfer(transfer, session)).transpose()?;
    let scene = input.scene.as_ref();
    let defaults = ViewOptions::default();
    let [width, height] =
        args.size.or(scene.map(|scene| scene.size)).unwrap_or([defaults.width, defaults.height]);
    let options = |direction: Option<Direction>, transfer| ViewOptions {
        width,
        height,
        direction,
        orthographic: args.orthographic,
        transfer,
        planes: planes(&args.planes),
    };
    let mut view = match (scene, args.view) {
        (None, direction) => session.view(&options(direction, transfer)),
        (Some(scene), Some(direction)) => {
            let transfer = transfer.unwrap_or_else(|| scene.transfer.clone());
            let view = session.view(&options(Some(direction), Some(transfer)));
            View { background: scene.background, ..view }
        }
        (Some(scene), None) => {
            let transfer = transfer.unwrap_or_else(|| scene.transfer.clone());
            let view = session.view(&options(None, Some(transfer)));
            let camera = if args.orthographic { fit::orthographic(&scene.camera) } else { scene.camera };
            View { camera, background: scene.background, ..view }
        }
    };
    view.tolerance = args.tolerance;
    view.thickness = args.thickness.map(Into::into).unwrap_or_default();
    Ok(view)
}

fn planes(args: &PlaneArgs) -> PlaneView {
    PlaneView {
        planes: args.planes.clone(),
        focus: args.focus.map(|point| Focus { point, quality: args.quality }),
        max_error: args.error,
        sampling: if args.nearest { Sampling::Nearest } else { Sampling::Linear },
        is_transparent: args.transparent,
        shows_nodes: args.show_nodes,
    }
}

/// Writes each picture on the way to the last one, `00.png` first, with its report beside it.
fn progressive(folder: &Path, session: &mut Session, view: &View, input: &Input) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure(format!("{}: cannot be made: {error}", folder.display())))?;
    let steps: Box<dyn Iterator<Item = Result<Step, RenderError>>> = match session.technique() {
        volery::Technique::Plane => {
            let num_bricks = session.progressive(view, None, 1)?.num_bricks();
            Box::new(session.progressive(view, None, num_bricks.div_ceil(PROGRESSIVE_STEPS))?)
        }
        _ => Box::new(session.refinements(view)?),
    };
    for (number, step) in steps.enumerate() {
        let Picture { image, mut report } = step?.picture;
        report.input.path = Some(input.path.to_string_lossy().into_owned());
        let path = folder.join(format!("{number:02}.png"));
        write_image(&path, &image)?;
        write_report(&path.with_extension("json"), &report)?;
        let bound = report.error.and_then(|error| error.bound_max);
        let bound =
            bound.map_or_else(String::new, |bound| format!(", no colour off by more than {bound:.4}"));
        let milliseconds = 1e3 * report.seconds.frame;
        say(format_args!("{}: {milliseconds:.1} ms, {} nodes{bound}", path.display(), report.work.nodes))?;
    }
    Ok(())
}

fn write_report(path: &Path, report: &Report) -> Result<(), Failure> {
    let json = report.to_json();
    write_atomically(path, |file| std::io::Write::write_all(file, json.as_bytes()))?;
    Ok(())
}

fn load_transfer(transfer: &Transfer, session: &Session) -> Result<TransferFunction, Failure> {
    match transfer {
        Transfer::Preset(preset) => Ok(session.preset(*preset)),
        Transfer::File(path) => {
            let unit_distance = volery::transfer::unit_distance(session.grid().extent());
            let range = Some(session.value_range());
            Ok(read_transfer(path, &TransferOptions { map: None, range, unit_distance })?.transfer)
        }
    }
}

/// Measures the error where it was asked for; returns the line about the error map.
fn verify(
    args: &RenderArgs,
    session: &Session,
    view: &View,
    picture: &mut Picture,
) -> Result<Option<String>, Failure> {
    if !args.verify && args.error_map.is_none() {
        return Ok(None);
    }
    let truth = {
        let bar = Progress::bar("computing the exact picture");
        session.verify(view, picture, &|done| bar.set(done))?
    };
    let Some(path) = &args.error_map else { return Ok(None) };
    let map = ErrorMap::new(&picture.image, &truth)?;
    write_image(path, &map.image)?;
    Ok(Some(format!("{}: |picture - reference| x {}", path.display(), map.gain)))
}

/// What a user wants to know about a picture, without the JSON.
pub(crate) fn summary(output: &Path, report: &Report) -> String {
    let seconds = &report.seconds;
    let mut text = format!(
        "{}: {}x{}, {}, {} ({})\n{:.1} ms a frame: select {:.1}, upload {:.1}, draw {:.1}; {} nodes, {} resident",
        output.display(),
        report.image.width,
        report.image.height,
        report.technique,
        report.backend.kind,
        report.backend.device,
        1e3 * seconds.frame,
        1e3 * seconds.select,
        1e3 * seconds.upload,
        1e3 * seconds.draw,
        report.work.nodes,
        megabytes(report.work.bytes_resident),
    );
    let error = report.error.unwrap_or_default();
    if let Some(bound) = error.bound_max {
        text += &format!("\nbound: no colour differs by more than {bound:.5} from full resolution");
    }
    if let Some(found) = error.measured {
        let rmse = found.measured_rmse;
        text += &format!("\nerror: max {:.5}, rmse {rmse:.6} against {}", found.measured_max, found.against);
    }
    text
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

fn notes(input: &Input, session: &Session, view: &View) -> Result<(), Failure> {
    for note in &input.volume.notes {
        say(format_args!("note: {note}"))?;
    }
    let [low, high] = session.value_range();
    if view.transfer.is_transparent(low, high) {
        let [low, high] = [low, high].map(number);
        say(format_args!(
            "note: the transfer function is transparent for all values of the file, {low} to {high}"
        ))?;
    }
    Ok(())
}
