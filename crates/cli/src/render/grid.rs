//! `volery render` of grids: one picture, or one for each time step.

use std::path::{Path, PathBuf};
use std::time::Instant;

use volery::io::grid::{TimeStep, read_time_steps};
use volery::io::{GridFile, GridOptions};
use volery::{Backend, GridSession, Input, Picture, QuantizedMesh, StackSession, StepChange, View};

use super::{Done, Files, notes, of_file, source, view};
use crate::args::{RenderArgs, Technique, numbered};
use crate::progress::Progress;
use crate::{Failure, say};

pub(super) fn run(
    args: &RenderArgs,
    input: &Input,
    file: &GridFile,
    backend: Box<dyn Backend>,
) -> Result<(), Failure> {
    let technique = (!matches!(args.technique, Technique::Auto | Technique::Stack))
        .then(|| format!("--technique {}", args.technique.name()));
    if let Some(option) = technique.or(args.unread_by_stack().map(str::to_owned)) {
        let path = input.path.display();
        return Err(Failure(format!("{path}: is an unstructured grid, expected a volume for {option}")));
    }
    let mut session = {
        let _busy = Progress::spinner("numbering edges");
        let array = file.array.as_ref().map(|array| array.name.as_str());
        let opened = GridSession::open(file.grid.clone(), array, backend);
        opened.map_err(|error| of_file(&input.path, &error))?
    };
    let view = view(args, input, &session)?;
    if args.is_verified() {
        view.stack.check_verifiable()?;
    }
    if !args.stack.time_steps.is_empty() {
        return time_steps(args, &mut session, &view);
    }
    let mut picture = draw(&mut session, &view, args.frames, "drawing")?;
    (picture.report.input.path, picture.report.seconds.load) = source(&input.path, input.load_seconds);
    let files =
        Files { output: &args.output, error_map: args.error_map.as_deref(), report: args.report.as_deref() };
    let verify = |picture: &mut Picture, progress: &Done| session.verify(&view, picture, progress);
    files.write(picture, args.is_verified().then_some(&verify))?;
    notes(input.notes(), &session, &view)
}

/// Draws slices from a file.
pub(super) fn run_stack(
    args: &RenderArgs,
    input: &Input,
    mesh: &QuantizedMesh,
    backend: Box<dyn Backend>,
) -> Result<(), Failure> {
    let technique = (!matches!(args.technique, Technique::Auto | Technique::Stack)).then_some("--technique");
    let verified = args.is_verified().then_some("--verify and --error-map");
    let others = [technique, args.unread_by_stack(), args.stack.needs_cells(), verified];
    if let Some(option) = others.into_iter().flatten().next() {
        let path = input.path.display();
        return Err(Failure(format!(
            "{path}: is a stack of slices, expected what they are made of for {option}"
        )));
    }
    let opened = StackSession::open(mesh.clone(), backend);
    let mut session = opened.map_err(|error| of_file(&input.path, &error))?;
    let view = view(args, input, &session)?;
    let mut picture = {
        let _busy = Progress::spinner("drawing");
        session.render_frames(&view, args.frames as usize)?
    };
    (picture.report.input.path, picture.report.seconds.load) = source(&input.path, input.load_seconds);
    let files = Files { output: &args.output, error_map: None, report: args.report.as_deref() };
    files.write(picture, None)?;
    notes(input.notes(), &session, &view)
}

fn draw(session: &mut GridSession, view: &View, frames: u32, what: &str) -> Result<Picture, Failure> {
    let _busy = Progress::spinner(what);
    Ok(session.render_frames(view, frames as usize)?)
}

/// Draws every time step by one view.
fn time_steps(args: &RenderArgs, session: &mut GridSession, view: &View) -> Result<(), Failure> {
    let steps = steps(&args.stack.time_steps)?;
    let bar = Progress::bar("drawing time steps");
    for (number, step) in steps.iter().enumerate() {
        bar.set(number as f64 / steps.len() as f64);
        let start = Instant::now();
        let options = GridOptions { array: Some(session.array().to_owned()), ..GridOptions::default() };
        let file = step.read(&options)?;
        let load_seconds = start.elapsed().as_secs_f64();
        // A step has at least one file.
        let path = step.files.first().map_or(Path::new(""), PathBuf::as_path);
        let change = session.set_step(file.grid).map_err(|error| of_file(path, &error))?;
        let mut picture = session.render_frames(view, args.frames as usize)?;
        (picture.report.input.path, picture.report.seconds.load) = source(path, load_seconds);
        let name = |path: &Path| numbered(path, number).expect("the command line was checked");
        let error_map = args.error_map.as_deref().map(name);
        let report = args.report.as_deref().map(name);
        let output = name(&args.output);
        let files = Files { output: &output, error_map: error_map.as_deref(), report: report.as_deref() };
        let drawn = &*session;
        let verify = |picture: &mut Picture, progress: &Done| drawn.verify(view, picture, progress);
        files.write(picture, args.is_verified().then_some(&verify))?;
        if change == StepChange::Cells && number > 0 {
            say(format_args!("note: {}: has other points or cells than the step before", path.display()))?;
        }
        notes(&file.notes, drawn, view)?;
    }
    Ok(())
}

/// The steps of a collection, or one for each file.
fn steps(files: &[PathBuf]) -> Result<Vec<TimeStep>, Failure> {
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
