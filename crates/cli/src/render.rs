//! `volery render`

use std::ffi::OsStr;
use std::path::Path;

use volery::io::is_grid;
use volery::io::scene_file::{SceneBackend, SceneFile, SceneInput, SceneTechnique};
use volery::output::write_image;
use volery::report;
use volery::{
    Backend, BackendChoice, Data, How, Input, InputData, InputOptions, Picture, RenderError, Session, Step,
    View, VolumeData,
};

mod empty;
mod files;
mod grid;

use crate::args::{RenderArgs, Transfer, numbered};
use crate::outputs::Outputs;
use crate::progress::Progress;
use crate::wanted::{self, Given};
use crate::{Failure, open, say};

/// Pictures that `--progressive` writes, about.
const PROGRESSIVE_STEPS: usize = 8;

/// What is drawn, of what, and where it goes.
struct Run<'a> {
    args: &'a RenderArgs,
    wanted: SceneFile,
    input: Input,
    outputs: Outputs,
}

impl Run<'_> {
    /// Whether each of the frames is another picture.
    fn is_sequence(&self) -> bool {
        self.args.path.is_some() || self.wanted.budget_ms.is_some()
    }
}

pub(crate) fn run(args: &RenderArgs) -> Result<(), Failure> {
    let of_file = SceneInput { orientation: args.orientation.map(Into::into), ..args.file.of_scene() };
    let options = InputOptions { data_dir: args.data.clone(), input: of_file };
    let plan = options.find(&args.input)?;
    let mut wanted = wanted::over(args, plan.scene.as_ref(), plan.input.clone());
    wanted.meshes.clone_from(&plan.meshes);
    if let Some(problem) = wanted::conflict(&wanted, true) {
        return Err(Failure::of_file(&args.input, problem));
    }
    let file = &plan.input.file;
    if !args.stack.time_steps.is_empty() && file.is_file() && !is_grid(file) {
        return Err(Failure::of_file(file, "is no unstructured grid, expected one for --time-steps"));
    }
    if !args.stack.time_steps.is_empty() && plan.input.time_step.is_some() {
        let problem = "time_step is of one picture, expected a scene without it for --time-steps";
        return Err(Failure::of_file(&args.input, problem));
    }
    let steps = grid::steps(&args.stack.time_steps)?;
    let outputs = outputs(args, steps.len());
    let transfer = match &args.transfer {
        Some(Transfer::File(path)) => Some(path.as_path()),
        Some(Transfer::Preset(_)) | None => None,
    };
    let of_steps = steps.iter().flat_map(|step| &step.files).chain(&args.stack.time_steps);
    let of_steps = of_steps.map(std::path::PathBuf::as_path);
    outputs.check(plan.files().chain(transfer).chain(of_steps))?;
    let choice = match wanted.backend {
        None => BackendChoice::Auto,
        Some(SceneBackend::Software) => BackendChoice::Software,
        Some(SceneBackend::Wgpu) => BackendChoice::Wgpu,
    };
    let mut backend = open(choice)?;
    let backend = backend.as_mut();
    let input = {
        let _busy = Progress::spinner("reading");
        plan.read()?
    };
    outputs.check_inputs(input.files.iter().map(|file| file.path.as_path()))?;
    let run = Run { args, wanted, input, outputs };
    match &run.input.data {
        InputData::Grid(file) => grid::run(&run, file, &steps, backend),
        InputData::Stack(mesh) => grid::run_stack(&run, mesh, backend),
        InputData::Volume(_) => run_volume(&run, backend),
    }
}

/// Where everything goes, each file of a series too.
fn outputs(args: &RenderArgs, num_steps: usize) -> Outputs {
    let count = if num_steps > 0 { num_steps } else { args.frames as usize };
    let named = [
        ("-o", Some(args.output.as_path())),
        ("--error-map", args.error_map.as_deref()),
        ("--bound-map", args.bound_map.as_deref()),
        ("--report", args.report.as_deref()),
        ("--save-scene", args.save_scene.as_deref()),
    ];
    let mut outputs = Outputs::default();
    for (option, path) in named {
        let Some(path) = path else { continue };
        outputs = match numbered(path, 0) {
            None => outputs.file(option, path),
            Some(_) => {
                let names = (0..count).filter_map(|number| numbered(path, number));
                names.fold(outputs, |all, name| all.file(option, &name))
            }
        };
    }
    let is_step = |name: &OsStr| {
        let name = Path::new(name);
        let is_number = |stem: &OsStr| stem.as_encoded_bytes().iter().all(u8::is_ascii_digit);
        let ending = name.extension().is_some_and(|ending| ending == "png" || ending == "json");
        ending && name.file_stem().is_some_and(is_number)
    };
    match &args.progressive {
        None => outputs,
        Some(folder) => outputs.folder("--progressive", folder, is_step),
    }
}

/// How a volume is drawn, and the option that chose planes where nobody named a technique.
fn how(wanted: &SceneFile, volume: &VolumeData) -> (How, Option<Given>) {
    let suiting = wanted::technique_of(&volume.suiting());
    let for_planes = || {
        let given = wanted::given(wanted, false);
        given.into_iter().find(|option| option.technique == SceneTechnique::Plane)
    };
    let (technique, because) = match (wanted.technique, for_planes()) {
        (Some(technique), _) => (technique, None),
        (None, Some(option)) => (SceneTechnique::Plane, (suiting != SceneTechnique::Plane).then_some(option)),
        (None, None) => (suiting, None),
    };
    (wanted::how(wanted, technique), because)
}

fn run_volume(run: &Run, backend: &mut dyn Backend) -> Result<(), Failure> {
    let Run { args, wanted, input, .. } = run;
    if wanted.technique == Some(SceneTechnique::Stack) {
        return Err(needs_grid(input, "--technique stack"));
    }
    let of_stack =
        wanted::given(wanted, false).into_iter().find(|option| option.technique == SceneTechnique::Stack);
    let steps = (!args.stack.time_steps.is_empty()).then(|| "--time-steps".to_owned());
    if let Some(option) = of_stack.map(|option| option.to_string()).or(steps) {
        return Err(needs_grid(input, &option));
    }
    let mut session = {
        let _busy = Progress::spinner("building the pyramid");
        Session::new(input.volume_data()?)
    };
    let (mut how, because) = how(wanted, session.data());
    let place = (session.data().world(), session.data().middle());
    wanted::place_planes(args, &mut how, place).map_err(|problem| Failure::of_file(&input.path, problem))?;
    let view = wanted::view(args, wanted, input, &session, how)?;
    if let Some(folder) = &args.progressive {
        progressive(folder, (&mut session, backend), &view, input)?;
    }
    let picture = {
        let _busy = Progress::spinner("drawing");
        frames(run, &mut session, &view, backend)?
    };
    files::finish(run, &view, picture, &mut session)?;
    if let Some(option) = because {
        say(format_args!("note: drawn by --technique plane, which alone reads {option}"))?;
    }
    Ok(())
}

/// Draws all frames of a view, or of a camera's way from it. Where each is another picture, each is written as soon as it
/// is there, if it has a name of its own; returned is the last one, with the times of all.
fn frames<D: Data>(
    run: &Run,
    session: &mut Session<D>,
    view: &View,
    backend: &mut dyn Backend,
) -> Result<Picture, Failure> {
    let Run { args, input, .. } = run;
    let of_file = |error: RenderError| Failure::of_file(&input.path, error);
    let num = args.frames as usize;
    if !run.is_sequence() {
        return session.render_frames(view, num, backend).map_err(of_file);
    }
    let mut pictures: Vec<(report::Seconds, report::Frame)> = Vec::with_capacity(num);
    let mut last = None;
    for frame in 0..num {
        let picture = session.render(&args.view_at(view, frame), backend).map_err(of_file)?;
        if let Some(name) = numbered(&args.output, frame).filter(|_| frame + 1 < num) {
            write_image(&name, &picture.image)?;
        }
        pictures.extend(picture.report.frames.first().map(|&times| (picture.report.seconds, times)));
        last = Some(picture);
    }
    let mut last = last.ok_or_else(|| of_file(RenderError::NoFrame))?;
    last.report.frames = pictures.iter().map(|(_, frame)| *frame).collect();
    pictures.sort_by(|(a, _), (b, _)| a.frame.total_cmp(&b.frame));
    last.report.seconds = pictures[(pictures.len() - 1) / 2].0;
    Ok(last)
}

fn needs_grid(input: &Input, option: &str) -> Failure {
    Failure::of_file(&input.path, format_args!("is a volume, expected an unstructured grid for {option}"))
}

/// Writes each picture on the way to the last one, `00.png` first, with its report beside it.
fn progressive(
    folder: &Path,
    (session, backend): (&mut Session<VolumeData>, &mut dyn Backend),
    view: &View,
    input: &Input,
) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::of_file(folder, format_args!("cannot be made: {error}")))?;
    let of_file = |error| Failure::of_file(&input.path, error);
    let steps: Box<dyn Iterator<Item = Result<Step, RenderError>>> = match view.how {
        How::Planes(_) => {
            let num_bricks = session.progressive(view, None, 1, backend).map_err(of_file)?.num_bricks();
            let each = num_bricks.div_ceil(PROGRESSIVE_STEPS);
            Box::new(session.progressive(view, None, each, backend).map_err(of_file)?)
        }
        _ => Box::new(session.refinements(view, backend).map_err(of_file)?),
    };
    for (number, step) in steps.enumerate() {
        let step = step.map_err(of_file)?;
        let Picture { image, mut report } = step.picture;
        files::name_sources(&mut report, input);
        let path = folder.join(format!("{number:02}.png"));
        write_image(&path, &image)?;
        files::write_report(&path.with_extension("json"), &report)?;
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
