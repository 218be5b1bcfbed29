//! Where a picture and what is known of it go.

use std::path::{Path, PathBuf};

use volery::info::number;
use volery::io::write_atomically;
use volery::output::{ErrorMap, write_image};
use volery::report::{InputFile, Place};
use volery::{Data, Input, Picture, Report, Session, Transfer, VerifyError, View, reference};

use super::{Run, empty};
use crate::args::numbered;
use crate::progress::Progress;
use crate::{Failure, save, say, wanted};

/// What a stage of a picture may add to its error without a word.
const MAX_STAGE_ERROR: f64 = 0.01;

/// Hears how much is done, in [0, 1].
pub(super) type Done<'a> = dyn Fn(f64) + Sync + 'a;

/// Measures the error of a picture, and returns the exact one.
pub(super) type Verify<'a> = dyn Fn(&mut Picture, &Done) -> Result<reference::Image, VerifyError> + 'a;

/// The files of one picture.
pub(super) struct Files<'a> {
    /// What is drawn.
    pub(super) input: &'a Path,
    /// Several where each frame has its own.
    pub(super) outputs: Vec<PathBuf>,
    pub(super) error_map: Option<&'a Path>,
    pub(super) report: Option<&'a Path>,
}

impl Files<'_> {
    /// Writes the picture, measures its error where that was asked for, and says what a user wants to know.
    pub(super) fn write(&self, picture: &mut Picture, verify: Option<&Verify>) -> Result<(), Failure> {
        for output in &self.outputs {
            write_image(output, &picture.image)?;
        }
        let mut error_map = None;
        if let Some(verify) = verify {
            let truth = {
                let bar = Progress::bar("computing the exact picture");
                verify(picture, &|done| bar.set(done)).map_err(|error| Failure::of_file(self.input, error))?
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
        for output in &self.outputs {
            say(summary(output, &picture.report))?;
        }
        error_map.map_or(Ok(()), say)
    }
}

/// Writes all that a run of one view asks for, and says what a user wants to know.
pub(super) fn finish<D: Data>(
    run: &Run,
    view: &View,
    mut picture: Picture,
    session: &mut Session<D>,
) -> Result<(), Failure> {
    let Run { args, wanted, input, .. } = run;
    name_sources(&mut picture.report, input);
    let num = args.frames as usize;
    // Of a sequence the others are there.
    let first = if run.is_sequence() { num - 1 } else { 0 };
    let view = &args.view_at(view, num - 1);
    let mut outputs: Vec<PathBuf> = (first..num).map_while(|frame| numbered(&args.output, frame)).collect();
    if outputs.is_empty() {
        outputs.push(args.output.clone());
    }
    let mut bounds = None;
    if let Some(path) = &args.bound_map {
        let _busy = Progress::spinner("bounding the error");
        let bound = session.certify(view, &mut picture)?;
        let map = ErrorMap::of_bound(&bound);
        write_image(path, &map.image)?;
        bounds = Some(format!("{}: bound of |picture - exact picture| x {}", path.display(), map.gain));
    }
    let session = &*session;
    let (error_map, report) = (args.error_map.as_deref(), args.report.as_deref());
    let verify = |picture: &mut Picture, progress: &Done| session.verify(view, picture, progress);
    let verify: Option<&Verify> = if args.is_verified() { Some(&verify) } else { None };
    Files { input: &input.path, outputs, error_map, report }.write(&mut picture, verify)?;
    bounds.map_or(Ok(()), say)?;
    if let Some(path) = &args.save_scene {
        let orientation = Place::of(input).map(|_| input.orientation);
        save::save_scene(path, wanted, view, (orientation, session.data().has_colors()))?;
    }
    notes(&input.notes(), session, view)?;
    if let Some([low, high]) = wanted::window(args, wanted, input, session) {
        let [low, high] = [low, high].map(number);
        say(format_args!(
            "note: colours run over the values that the file asks to show, {low} to {high} (--range for others)"
        ))?;
    }
    match empty::reason(&picture.image, view, input, session.data().world_bounds()) {
        None => Ok(()),
        Some(reason) => say(format_args!("note: nothing is seen: {reason}")),
    }
}

/// Says in a report what was read.
pub(super) fn name_sources(report: &mut Report, input: &Input) {
    report.input.path = Some(input.path.to_string_lossy().into_owned());
    report.input.place = Place::of(input);
    report.inputs = input.files.iter().map(InputFile::from).collect();
    report.seconds.load = Some(input.load_seconds);
}

pub(super) fn write_report(path: &Path, report: &Report) -> Result<(), Failure> {
    let json = report.to_json();
    write_atomically(path, |file| std::io::Write::write_all(file, json.as_bytes()))?;
    Ok(())
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
        let against = error.bound_against.unwrap_or_default();
        text += &format!("\nbound: no colour differs by more than {bound:.5} from {against}");
    }
    if let Some(found) = error.measured {
        let rmse = found.measured_rmse;
        text += &format!("\nerror: max {:.5}, rmse {rmse:.6} against {}", found.measured_max, found.against);
        let stages = error.budget.map(|budget| budget.above(MAX_STAGE_ERROR)).unwrap_or_default();
        if !stages.is_empty() {
            let stages: Vec<_> = stages.iter().map(|(stage, most)| format!("{stage} {most:.3}")).collect();
            text +=
                &format!("\nnote: stages that could add more than {MAX_STAGE_ERROR}: {}", stages.join(", "));
        }
    }
    text
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Says what the reader decided, and why there may be nothing to see.
pub(super) fn notes<D: Data>(of_file: &[String], session: &Session<D>, view: &View) -> Result<(), Failure> {
    for note in of_file {
        say(format_args!("note: {note}"))?;
    }
    let [low, high] = session.value_range();
    if matches!(&view.transfer, Transfer::Values(transfer) if transfer.is_transparent(low, high)) {
        let [low, high] = [low, high].map(number);
        say(format_args!(
            "note: the transfer function is transparent for all values of the file, {low} to {high}"
        ))?;
    }
    Ok(())
}
