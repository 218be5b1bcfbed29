//! VTK's collection, `.pvd`: names the files of each time step, relative to its own folder.
//!
//! Steps come by ascending time, whatever their order in the file. A step of several files, its parts, is joined as
//! the pieces of a `.pvtu` are; what has no cells of volume is left out then.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::{GridFile, GridFormat, GridOptions, Part, format_of, join, pvtu, with_parts_of};
use crate::bytes::load;
use crate::choice::checked_step;
use crate::error::{Problem, ReadError, quoted};
use crate::vtk_xml::{Document, Element, XmlBytes};

/// One time of a series, and where its grid is.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeStep {
    /// As the collection says.
    pub time: f64,
    /// Its grid, or the parts of it; at least one.
    pub files: Vec<PathBuf>,
}

/// Reads which time steps a `.pvd` file names, by ascending time; at least one.
///
/// # Errors
/// When the file cannot be read, is no collection, or has an entry without a file or with a time that is no number.
pub fn read_time_steps(path: &Path) -> Result<Vec<TimeStep>, ReadError> {
    steps(path).map_err(|problem| ReadError { path: path.to_owned(), problem })
}

impl TimeStep {
    /// Reads the grid of this time.
    ///
    /// # Errors
    /// As [`read_grid`](super::read_grid).
    pub fn read(&self, options: &GridOptions) -> Result<GridFile, ReadError> {
        let joined = self.with_parts(|format, parts| join::join(format, parts, options));
        joined.map_err(|problem| match problem {
            Problem::Part { path, problem } => ReadError { path, problem: *problem },
            problem => ReadError { path: self.files.first().cloned().unwrap_or_default(), problem },
        })
    }

    fn with_parts<R>(
        &self,
        run: impl FnOnce(GridFormat, &[Part]) -> Result<R, Problem>,
    ) -> Result<R, Problem> {
        match &self.files[..] {
            [file] => {
                let read = format_of(file).and_then(|format| {
                    with_parts_of(file, format, None, |format, _, parts| run(format, parts))
                });
                read.map_err(|problem| problem.of_part(file))
            }
            files => pvtu::with_files(files, |parts| run(GridFormat::Pvtu, parts)),
        }
    }
}

/// Opens a time step of a collection, and runs something on its parts.
pub(super) fn with_step<R>(
    path: &Path,
    step: Option<usize>,
    run: impl FnOnce(u64, &[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    let mut steps = steps(path)?;
    let num_steps = steps.len() as u64;
    let step = checked_step(num_steps, step)?.unwrap_or(0) as usize;
    steps.swap_remove(step).with_parts(|_, parts| run(num_steps, parts))
}

fn steps(path: &Path) -> Result<Vec<TimeStep>, Problem> {
    let bytes = XmlBytes::new(load(path)?)?;
    let document = Document::parse(&bytes, "Collection")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut entries: Vec<(f64, PathBuf)> =
        document.all("DataSet").map(|entry| entry_of(entry, folder)).collect::<Result<_, _>>()?;
    entries.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut steps: Vec<TimeStep> = Vec::new();
    let mut seen = HashSet::new();
    for (time, file) in entries {
        if steps.last().is_none_or(|last| last.time != time) {
            seen.clear();
        }
        match steps.last_mut() {
            // A run that was restarted writes a step again.
            Some(last) if last.time == time && seen.contains(&file) => {}
            Some(last) if last.time == time => last.files.push(file),
            _ => steps.push(TimeStep { time, files: vec![file] }),
        }
        seen.extend(steps.last().and_then(|last| last.files.last()).cloned());
    }
    if steps.is_empty() { Err(Problem::missing("DataSet", "at least one")) } else { Ok(steps) }
}

fn entry_of(entry: &Element, folder: &Path) -> Result<(f64, PathBuf), Problem> {
    let file = entry.attribute("file")?.ok_or_else(|| Problem::missing("file", "one for each DataSet"))?;
    // VTK writes none where there is a single time.
    let time = entry.attribute("timestep")?.unwrap_or_else(|| "0".to_owned());
    let number: Option<f64> = time.trim().parse().ok();
    let number = number.filter(|time| time.is_finite());
    let number = number.ok_or_else(|| Problem::field("timestep", quoted(time), "a finite number"))?;
    let path = folder.join(&file);
    // Windows writes other separators.
    let path = if path.exists() { path } else { folder.join(file.replace('\\', "/")) };
    Ok((number, path))
}
