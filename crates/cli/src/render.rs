//! `volery render`

use std::path::Path;

use volery::fit::{self, Direction};
use volery::glam::DVec3;
use volery::info::number;
use volery::io::transfer::{TransferError, TransferOptions, TransferProblem};
use volery::io::{read_transfer, read_transfer_2d, write_atomically};
use volery::output::{ErrorMap, write_image};
use volery::{
    Backend, Focus, GridSession, Input, InputData, InputOptions, Picture, PlaneView, Preset, RenderError,
    Report, Sampling, Session, StackSession, Step, TransferFunction, TransferFunction2d, VerifyError, View,
    ViewOptions, VoxelGrid, open_backend, reference,
};

mod grid;

use crate::args::{PlaneArgs, RenderArgs, Technique, Transfer};
use crate::progress::Progress;
use crate::{Failure, say};

/// Pictures that `--progressive` writes, about.
const PROGRESSIVE_STEPS: usize = 8;

/// Sessions, as far as they are alike.
trait Drawn {
    fn view(&self, options: &ViewOptions) -> View;
    fn preset(&self, preset: Preset) -> TransferFunction;
    fn value_range(&self) -> [f64; 2];
    fn extent(&self) -> DVec3;
    /// Whether values may be classified together with the magnitude of their gradient.
    fn knows_gradients(&self) -> bool;
}

macro_rules! drawn {
    ($session:ty, $knows_gradients:literal) => {
        impl Drawn for $session {
            fn view(&self, options: &ViewOptions) -> View {
                <$session>::view(self, options)
            }

            fn preset(&self, preset: Preset) -> TransferFunction {
                <$session>::preset(self, preset)
            }

            fn value_range(&self) -> [f64; 2] {
                <$session>::value_range(self)
            }

            fn extent(&self) -> DVec3 {
                <$session>::extent(self)
            }

            fn knows_gradients(&self) -> bool {
                $knows_gradients
            }
        }
    };
}

drawn!(Session, false);
drawn!(GridSession, true);
drawn!(StackSession, true);

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let backend = open_backend(args.backend.into())?;
    let input = {
        let _busy = Progress::spinner("reading");
        let options = InputOptions { data_dir: args.data.as_deref(), array: args.array.as_deref() };
        options.read(&args.input)?
    };
    match &input.data {
        InputData::Grid(file) => grid::run(args, &input, file, backend),
        InputData::Stack(mesh) => grid::run_stack(args, &input, mesh, backend),
        InputData::Volume(volume) => run_volume(args, &input, &volume.grid, backend),
    }
}

fn run_volume(
    args: &RenderArgs,
    input: &Input,
    grid: &VoxelGrid,
    backend: Box<dyn Backend>,
) -> Result<(), Failure> {
    let technique = match args.technique {
        Technique::Auto if args.planes.given().is_some() => volery::Technique::Plane,
        Technique::Auto => volery::Technique::suiting(grid),
        Technique::Raycast => volery::Technique::Raycast,
        Technique::Plane => volery::Technique::Plane,
        Technique::Fans => volery::Technique::Fans,
        Technique::Stack => return Err(needs_grid(input, "--technique stack")),
    };
    if let Some(option) = args.stack.given() {
        return Err(needs_grid(input, option));
    }
    let mut session = {
        let _busy = Progress::spinner("building the pyramid");
        Session::open(grid.clone(), backend, technique).map_err(|error| of_file(&input.path, &error))?
    };
    let view = view(args, input, &session)?;
    if let Some(folder) = &args.progressive {
        progressive(folder, &mut session, &view, input)?;
    }
    let mut picture = {
        let _busy = Progress::spinner("drawing");
        session.render_frames(&view, args.frames as usize)?
    };
    (picture.report.input.path, picture.report.seconds.load) = source(&input.path, input.load_seconds);
    let files =
        Files { output: &args.output, error_map: args.error_map.as_deref(), report: args.report.as_deref() };
    let verify = |picture: &mut Picture, progress: &Done| session.verify(&view, picture, progress);
    files.write(picture, args.is_verified().then_some(&verify))?;
    notes(input.notes(), &session, &view)
}

fn needs_grid(input: &Input, option: &str) -> Failure {
    Failure(format!("{}: is a volume, expected an unstructured grid for {option}", input.path.display()))
}

fn of_file(path: &Path, error: &dyn std::error::Error) -> Failure {
    Failure(format!("{}: {error}", path.display()))
}

/// Path and seconds of reading, for a report.
fn source(path: &Path, seconds: f64) -> (Option<String>, Option<f64>) {
    (Some(path.to_string_lossy().into_owned()), Some(seconds))
}

/// Where a picture and what is known of it go.
struct Files<'a> {
    output: &'a Path,
    error_map: Option<&'a Path>,
    report: Option<&'a Path>,
}

/// Hears how much is done, in [0, 1].
type Done<'a> = dyn Fn(f64) + Sync + 'a;

/// Measures the error of a picture, and returns the exact one.
type Verify<'a> = dyn Fn(&mut Picture, &Done) -> Result<reference::Image, VerifyError> + 'a;

impl Files<'_> {
    /// Writes the picture, measures its error where that was asked for, and says what a user wants to know.
    fn write(&self, mut picture: Picture, verify: Option<&Verify>) -> Result<(), Failure> {
        write_image(self.output, &picture.image)?;
        let mut error_map = None;
        if let Some(verify) = verify {
            let truth = {
                let bar = Progress::bar("computing the exact picture");
                verify(&mut picture, &|done| bar.set(done))?
            };
            if let Some(path) = self.error_map {
                let map = ErrorMap::new(&picture.image, &truth)?;
                write_image(path, &map.image)?;
                error_map = Some(format!("{}: |picture - reference| x {}", path.display(), map.gain));
            }
        }
        if let Some(path) = self.report {
            write_report(path, &picture.report)?;
        }
        say(summary(self.output, &picture.report))?;
        error_map.map_or(Ok(()), say)
    }
}

fn view(args: &RenderArgs, input: &Input, session: &dyn Drawn) -> Result<View, Failure> {
    let mut stack = args.stack.view();
    let transfer = match &args.transfer {
        None => None,
        Some(Transfer::Preset(preset)) => Some(session.preset(*preset)),
        Some(Transfer::File(path)) => match load_transfer(path, session)? {
            Loaded::Values(transfer) => Some(transfer),
            Loaded::WithMagnitudes(function) => {
                (stack.classification, stack.is_lit) = (Some(function.into()), true);
                None
            }
        },
    };
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
        stack: stack.clone(),
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
    view.meshes = input.meshes.clone();
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
        say(format_args!(
            "{}: {milliseconds:.1} ms, {} nodes{bound}",
            path.display(),
            report.work.nodes.unwrap_or_default()
        ))?;
    }
    Ok(())
}

fn write_report(path: &Path, report: &Report) -> Result<(), Failure> {
    let json = report.to_json();
    write_atomically(path, |file| std::io::Write::write_all(file, json.as_bytes()))?;
    Ok(())
}

/// What a file of a transfer function may hold.
enum Loaded {
    Values(TransferFunction),
    WithMagnitudes(TransferFunction2d),
}

fn load_transfer(path: &Path, session: &dyn Drawn) -> Result<Loaded, Failure> {
    let unit_distance = volery::transfer::unit_distance(session.extent());
    let range = Some(session.value_range());
    match read_transfer(path, &TransferOptions { map: None, range, unit_distance }) {
        Ok(named) => Ok(Loaded::Values(named.transfer)),
        Err(TransferError { problem: TransferProblem::HasMagnitudes, .. }) if session.knows_gradients() => {
            Ok(Loaded::WithMagnitudes(read_transfer_2d(path)?))
        }
        Err(error) => Err(error.into()),
    }
}

/// What a user wants to know about a picture, without the JSON.
pub(crate) fn summary(output: &Path, report: &Report) -> String {
    let Report { seconds, work, .. } = report;
    let parts = [
        ("select", Some(seconds.select)),
        ("slice", seconds.geometry),
        ("upload", seconds.upload),
        ("draw", Some(seconds.draw)),
    ];
    let parts = parts.iter().filter_map(|(name, seconds)| Some(format!("{name} {:.1}", 1e3 * (*seconds)?)));
    let parts = parts.collect::<Vec<_>>().join(", ");
    let amount = match (work.nodes, work.triangles) {
        (Some(nodes), _) => format!("{nodes} nodes"),
        (None, triangles) => format!("{} triangles", triangles.unwrap_or_default()),
    };
    let mut text = format!(
        "{}: {}x{}, {}, {} ({})\n{:.1} ms a frame: {}; {}, {} resident",
        output.display(),
        report.image.width,
        report.image.height,
        report.technique,
        report.backend.kind,
        report.backend.device,
        1e3 * seconds.frame,
        parts,
        amount,
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

/// Says what the reader decided, and why there may be nothing to see.
fn notes(of_file: &[String], session: &dyn Drawn, view: &View) -> Result<(), Failure> {
    for note in of_file {
        say(format_args!("note: {note}"))?;
    }
    let [low, high] = session.value_range();
    if view.stack.classification.is_none() && view.transfer.is_transparent(low, high) {
        let [low, high] = [low, high].map(number);
        say(format_args!(
            "note: the transfer function is transparent for all values of the file, {low} to {high}"
        ))?;
    }
    Ok(())
}
