//! `volery render` of grids: one picture, or one for each time step.

use std::path::{Path, PathBuf};
use std::time::Instant;

use volery::io::grid::{TimeStep, read_time_steps};
use volery::io::scene_file::SceneTechnique;
use volery::io::{GridFile, GridOptions, recording_files};
use volery::report::InputFile;
use volery::{
    Backend, GridData, How, Picture, QuantizedMesh, Session, StackData, StackView, StepChange, View,
};

use super::files::{self, Done, Files};
use super::{Run, frames};
use crate::args::{RenderArgs, numbered};
use crate::progress::Progress;
use crate::{Failure, extent, say, wanted};

/// An option that only volumes read.
fn of_volumes(run: &Run) -> Option<String> {
    let Run { args, wanted, .. } = run;
    let other = |technique: &SceneTechnique| *technique != SceneTechnique::Stack;
    let technique = wanted.technique.filter(other);
    let technique = technique.map(|technique| format!("--technique {}", wanted::name_of(technique)));
    let given = wanted::given(wanted, false);
    let given = given.into_iter().find(|option| other(&option.technique)).map(|option| option.to_string());
    let tolerance = wanted.tolerance.map(|_| "--tolerance".to_owned());
    let error = wanted.error.map(|_| "--error".to_owned());
    technique.or(given).or(tolerance).or(error).or(args.unread_by_stack().map(str::to_owned))
}

pub(super) fn run(
    run: &Run,
    file: &GridFile,
    steps: &[TimeStep],
    backend: &mut dyn Backend,
) -> Result<(), Failure> {
    let Run { args, wanted, input, .. } = run;
    let of_file = |error: &dyn std::error::Error| Failure::of_file(&input.path, error);
    if let Some(option) = of_volumes(run) {
        let problem = format!("is an unstructured grid, expected a volume for {option}");
        return Err(Failure::of_file(&input.path, problem));
    }
    let num_slices = wanted.slices.map_or(StackView::default().num_slices, |slices| slices as usize);
    extent::check(&input.path, &file.grid, num_slices, None)?;
    let mut session = {
        let _busy = Progress::spinner("numbering edges");
        let array = file.array.as_ref().map(|array| array.name.as_str());
        Session::new(GridData::new(file.grid.clone(), array).map_err(|error| of_file(&error))?)
    };
    let how = wanted::how(wanted, SceneTechnique::Stack);
    let view = wanted::view(args, wanted, input, &session, how)?;
    if args.is_verified() {
        view.check_verifiable().map_err(|error| of_file(&error))?;
    }
    if !steps.is_empty() {
        return time_steps(run, steps, (&mut session, backend), &view);
    }
    let picture = {
        let _busy = Progress::spinner("drawing");
        frames(run, &mut session, &view, backend)?
    };
    files::finish(run, &view, picture, &mut session)
}

/// Draws slices from a file.
pub(super) fn run_stack(run: &Run, mesh: &QuantizedMesh, backend: &mut dyn Backend) -> Result<(), Failure> {
    let Run { args, wanted, input, .. } = run;
    let of_file = |error: &dyn std::error::Error| Failure::of_file(&input.path, error);
    let verified = args.is_verified().then(|| "--verify and --error-map".to_owned());
    // Light needs gradients, which slices have.
    let cells = wanted::given(wanted, false).into_iter().map(|option| option.to_string());
    let cells = cells.chain(args.stack.time_steps.first().map(|_| "--time-steps".to_owned()));
    let cells = cells.into_iter().find(|option| option != "--shade");
    if let Some(option) = of_volumes(run).or(cells).or(verified) {
        let problem = format!("is a stack of slices, expected what they are made of for {option}");
        return Err(Failure::of_file(&input.path, problem));
    }
    let mut session = Session::new(StackData::new(mesh.clone()).map_err(|error| of_file(&error))?);
    let how = How::Slices { is_lit: wanted.shade };
    let view = wanted::view(args, wanted, input, &session, how)?;
    let picture = {
        let _busy = Progress::spinner("drawing");
        frames(run, &mut session, &view, backend)?
    };
    files::finish(run, &view, picture, &mut session)
}

/// Draws every time step by one view.
fn time_steps(
    run: &Run,
    steps: &[TimeStep],
    (session, backend): (&mut Session<GridData>, &mut dyn Backend),
    view: &View,
) -> Result<(), Failure> {
    let args = run.args;
    let bar = Progress::bar("drawing time steps");
    for (number, step) in steps.iter().enumerate() {
        bar.set(number as f64 / steps.len() as f64);
        let start = Instant::now();
        let (array, channel) = (Some(session.data().array().to_owned()), run.wanted.input.channel);
        let options = GridOptions { array, channel, ..GridOptions::default() };
        let (file, opened) = recording_files(|| step.read(&options));
        let file = file?;
        run.outputs.check_inputs(opened.iter().map(|file| file.path.as_path()))?;
        let load_seconds = start.elapsed().as_secs_f64();
        // A step has at least one file.
        let path = step.files.first().map_or(Path::new(""), PathBuf::as_path);
        let change = session.data_mut().set_step(file.grid).map_err(|error| Failure::of_file(path, error))?;
        let drawn = session.render_frames(view, args.frames as usize, backend);
        let mut picture = drawn.map_err(|error| Failure::of_file(path, error))?;
        picture.report.input.path = Some(path.to_string_lossy().into_owned());
        picture.report.inputs = opened.iter().map(InputFile::from).collect();
        picture.report.seconds.load = Some(load_seconds);
        write_step(args, (number, path), session, view, &mut picture)?;
        if change == StepChange::Cells && number > 0 {
            say(format_args!("note: {}: has other points or cells than the step before", path.display()))?;
        }
        files::notes(&file.notes, session, view)?;
    }
    Ok(())
}

fn write_step(
    args: &RenderArgs,
    (number, path): (usize, &Path),
    session: &Session<GridData>,
    view: &View,
    picture: &mut Picture,
) -> Result<(), Failure> {
    let name = |path: &Path| numbered(path, number).expect("the command line was checked");
    let (error_map, report) = (args.error_map.as_deref().map(name), args.report.as_deref().map(name));
    let files = Files {
        input: path,
        outputs: vec![name(&args.output)],
        error_map: error_map.as_deref(),
        report: report.as_deref(),
    };
    let verify = |picture: &mut Picture, progress: &Done| session.verify(view, picture, progress);
    files.write(picture, if args.is_verified() { Some(&verify) } else { None })
}

/// The steps of a collection, or one for each file.
pub(super) fn steps(files: &[PathBuf]) -> Result<Vec<TimeStep>, Failure> {
    let is_collection =
        |path: &PathBuf| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("pvd"));
    if let [file] = files
        && is_collection(file)
    {
        return Ok(read_time_steps(file)?);
    }
    let step = |(time, file): (f64, &PathBuf)| TimeStep { time, files: vec![file.clone()] };
    Ok((0..).map(f64::from).zip(files).map(step).collect())
}
