//! Reading an unstructured grid: which format a file has, and what every reader is asked and answers.
//!
//! # Method
//! A reader finds what a file offers without reading numbers, as one or several pieces. What is asked for is
//! then read piece by piece, checked and joined: cells of volume are kept, cells of higher order by their
//! corner nodes; every other cell, copies of cells in other pieces and hidden cells are counted in the notes.
//! Points that pieces share become one, so that the grid hangs together where it was cut into pieces.
//! Values on cells are averaged to the nodes, the mean of the cells around; an array of several components
//! becomes its magnitude, or the one of them that is asked for.

use std::fmt;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use volery_scene::UnstructuredGrid;

use crate::bytes::{self, load};
use crate::choice::{Choices, checked_step, first_note};
use crate::error::{Problem, ReadError, quoted};
use crate::volume::{is_vtk_xml, lower_name};
use crate::vtk_xml::XmlBytes;

mod exodus;
mod join;
mod kinds;
pub(crate) mod legacy;
mod pvd;
mod pvtu;
mod vtu;

pub use pvd::{TimeStep, read_time_steps};

/// What the caller wants of a grid.
#[derive(Clone, Debug)]
pub struct GridOptions {
    /// The array to read; else the active scalars, else the first scalar, points before cells, that is not the same
    /// everywhere.
    pub array: Option<String>,
    /// The component to read, from 0, where a value has several; else their magnitude.
    pub channel: Option<usize>,
    /// Which of the time steps of an Exodus file or a collection to read, from 0; else the first.
    pub time_step: Option<usize>,
    /// Limit of the grid in memory, in bytes.
    pub max_bytes: u64,
}

impl Default for GridOptions {
    /// The file's own array, at most 64 GiB.
    fn default() -> Self {
        Self { array: None, channel: None, time_step: None, max_bytes: 64 << 30 }
    }
}

/// A format of grid files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GridFormat {
    /// VTK's XML unstructured grid, `.vtu`.
    Vtu,
    /// The same in pieces, each a file of its own, `.pvtu`.
    Pvtu,
    /// VTK's legacy format, `.vtk`.
    LegacyVtk,
    /// VTK's collection of time steps, `.pvd`, each a grid in a file of its own.
    Pvd,
    /// Exodus II in netCDF-3, `.ex2`, `.exo`, `.e`.
    Exodus,
}

impl fmt::Display for GridFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Vtu => "VTK unstructured grid",
            Self::Pvtu => "VTK parallel unstructured grid",
            Self::Pvd => "VTK collection",
            Self::LegacyVtk => "legacy VTK unstructured grid",
            Self::Exodus => "Exodus II",
        })
    }
}

/// What the values of an array belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The nodes.
    Points,
    /// The cells.
    Cells,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Points => "points",
            Self::Cells => "cells",
        })
    }
}

/// An array that a file offers.
#[derive(Clone, Debug, PartialEq)]
pub struct GridArray {
    /// Its name.
    pub name: String,
    /// What its values belong to.
    pub place: Place,
    /// Numbers for each point or cell.
    pub components: usize,
    /// Type of a number as stored: `f32`, `i64`, ...
    pub scalar: &'static str,
}

/// A grid as read.
#[derive(Clone, Debug)]
pub struct GridFile {
    /// The cells, and the array that was read, at the nodes and under its own name.
    pub grid: UnstructuredGrid,
    /// The format of the file.
    pub format: GridFormat,
    /// The array that was read; `None` where the file has none.
    pub array: Option<GridArray>,
    /// What the file has of which this is one; the channels are those of the array.
    pub choices: Choices,
    /// What the reader decided for the user, a sentence each: cells left out, values averaged, and the like.
    pub notes: Vec<String>,
}

/// The values of an array, as a file has them: not averaged.
#[derive(Clone, Debug, PartialEq)]
pub struct ArrayRange {
    /// The array.
    pub array: GridArray,
    /// Which of several components the range is of; `None` for their magnitude, or where there is one.
    pub channel: Option<usize>,
    /// Smallest and largest finite value; `None` if there is none.
    pub range: Option<[f64; 2]>,
    /// Values that are NaN or infinite.
    pub blank: u64,
    /// Why the values cannot be read, if they cannot; then there is no range.
    pub problem: Option<String>,
}

/// Whether [`read_grid`] is the one to read a file: by the ending of its name, else by its first bytes.
pub fn is_grid(path: &Path) -> bool {
    let head = head_of(path);
    // Structured points have the ending and the first line of a grid, and are a volume.
    !is_structured_points(&head) && format_by_name(path).or_else(|| format_by_content(&head)).is_some()
}

/// Reads a grid from a file; of a series one time step.
///
/// Large files are mapped into memory while they are read: they must not be changed meanwhile.
///
/// # Errors
/// When the file cannot be read, is damaged, is larger than `options` allow, has no cell of volume, or is of a
/// kind that is not supported: one line that says what was found and what was expected.
pub fn read_grid(path: &Path, options: &GridOptions) -> Result<GridFile, ReadError> {
    with_parts(path, options.time_step, |format, time_steps, parts| {
        let mut file = join::join(format, parts, options)?;
        // Of an Exodus file its reader says the same.
        if format == GridFormat::Pvd {
            file.notes.extend(first_note("time steps", time_steps, options.time_step));
        }
        file.choices.time_steps = time_steps;
        Ok(file)
    })
}

/// Looks at the values of every array of a file, one after the other. One that cannot be read says why.
///
/// # Errors
/// As [`read_grid`], cells and values aside.
pub fn read_array_ranges(path: &Path, options: &GridOptions) -> Result<Vec<ArrayRange>, ReadError> {
    with_parts(path, options.time_step, |_, _, parts| join::ranges(parts, options))
}

/// A grid, or a part of one, whose numbers have not been read yet.
trait Piece {
    fn num_points(&self) -> u64;
    fn num_cells(&self) -> u64;
    fn arrays(&self) -> &[PieceArray];
    /// What the reader decided.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
    /// Why an array of the file is not among those that are offered, if it is in the file.
    fn check_left_out(&self, _name: &str) -> Result<(), Problem> {
        Ok(())
    }
    fn points(&self) -> Result<Vec<DVec3>, Problem>;
    /// All cells, which may have `max_nodes` nodes together.
    fn cells(&self, max_nodes: u64) -> Result<PieceCells, Problem>;
    /// The numbers of an array, the components of a value side by side.
    fn values(&self, array: usize) -> Result<Vec<f64>, Problem>;
    /// Whether an array has a value that differs from the first, which `seen` keeps from piece to piece.
    fn varies(&self, array: usize, seen: &mut Vec<f64>) -> Result<bool, Problem>;
}

/// An array of a piece.
pub(crate) struct PieceArray {
    pub(crate) array: GridArray,
    /// Whether the file names it as the one to show.
    pub(crate) is_active: bool,
}

/// Cells as files have them.
struct PieceCells {
    /// VTK's number of each cell's type.
    types: Vec<u8>,
    /// For each cell where its nodes end; rising, the last one at most the number of nodes.
    ends: Vec<usize>,
    /// The nodes of the cells, each below the number of points.
    nodes: Vec<u32>,
}

/// A count from a file, times the numbers for each, as a length in memory.
fn count(found: u64, each: usize) -> Result<usize, Problem> {
    let count = usize::try_from(found).ok().and_then(|found| found.checked_mul(each));
    count.ok_or_else(|| Problem::field("count", found, "one that can be addressed"))
}

/// Turns the ends of cells in the list of nodes, one after the other, into places.
fn rising_ends(max_nodes: u64) -> impl FnMut(i64) -> Result<usize, Problem> {
    let mut last = 0;
    move |end| match usize::try_from(end) {
        Ok(place) if place >= last && place as u64 <= max_nodes => {
            last = place;
            Ok(place)
        }
        _ => Err(Problem::field("end of a cell", end, format!("{last} to {max_nodes}"))),
    }
}

/// Turns nodes into indices of points.
fn node_below(num_points: u64) -> impl FnMut(i64) -> Result<u32, Problem> {
    move |node| match u32::try_from(node) {
        Ok(index) if u64::from(index) < num_points => Ok(index),
        _ => Err(Problem::field("node", node, format!("0 or more and below {num_points}"))),
    }
}

/// Turns a number into one of VTK's types of cell.
fn vtk_type(number: i64) -> Result<u8, Problem> {
    u8::try_from(number).map_err(|_| Problem::field("type of a cell", number, "0 to 255"))
}

/// A piece and, if it is not the file asked for, the file that it is in.
struct Part<'a> {
    path: Option<&'a Path>,
    piece: Box<dyn Piece + 'a>,
    /// What was decided about files beside it.
    notes: Vec<String>,
}

impl<'a> Part<'a> {
    fn new(path: Option<&'a Path>, piece: impl Piece + 'a) -> Self {
        Self { path, piece: Box::new(piece), notes: Vec::new() }
    }

    /// Runs something on the piece; what goes wrong names the file.
    fn run<R>(&self, run: impl FnOnce(&dyn Piece) -> Result<R, Problem>) -> Result<R, Problem> {
        let named = |problem: Problem| match self.path {
            Some(path) => problem.of_part(path),
            None => problem,
        };
        run(&*self.piece).map_err(named)
    }
}

/// Opens a file and runs something on its parts, told how many time steps there are.
fn with_parts<R>(
    path: &Path,
    time_step: Option<usize>,
    run: impl FnOnce(GridFormat, u64, &[Part]) -> Result<R, Problem>,
) -> Result<R, ReadError> {
    let read = match format_of(path) {
        Ok(GridFormat::Pvd) => {
            pvd::with_step(path, time_step, |time_steps, parts| run(GridFormat::Pvd, time_steps, parts))
        }
        Ok(format) => with_parts_of(path, format, time_step, run),
        Err(problem) => Err(problem),
    };
    read.map_err(|problem| ReadError { path: path.to_owned(), problem })
}

/// Opens a file of one grid and runs something on its parts.
fn with_parts_of<R>(
    path: &Path,
    format: GridFormat,
    time_step: Option<usize>,
    run: impl FnOnce(GridFormat, u64, &[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    if format != GridFormat::Exodus {
        checked_step(1, time_step)?;
    }
    match format {
        GridFormat::Vtu => vtu::with_parts(&XmlBytes::new(load(path)?)?, |parts| run(format, 1, parts)),
        GridFormat::Pvtu => pvtu::with_parts(path, |parts| run(format, 1, parts)),
        GridFormat::LegacyVtk => legacy::with_parts(&load(path)?, |parts| run(format, 1, parts)),
        GridFormat::Exodus => {
            let run = |time_steps, parts: &[Part]| run(format, time_steps, parts);
            exodus::with_parts(&load(path)?, time_step, run)
        }
        GridFormat::Pvd => Err(Problem::field("file", "a collection", "a grid of one time")),
    }
}

/// The format of a file that is there.
fn format_of(path: &Path) -> Result<GridFormat, Problem> {
    // A file that cannot be opened is to say so, whatever its name is.
    bytes::open(path)?;
    let expected = "one that ends in .vtu, .pvtu, .pvd, .vtk, .ex2, .exo, .e or .g";
    let format = format_by_content(&head_of(path)).or_else(|| format_by_name(path));
    format.ok_or_else(|| Problem::field("file name", quoted(lower_name(path)), expected))
}

fn format_by_name(path: &Path) -> Option<GridFormat> {
    let name = lower_name(path);
    let endings = [
        (".vtu", GridFormat::Vtu),
        (".pvtu", GridFormat::Pvtu),
        (".pvd", GridFormat::Pvd),
        (".vtk", GridFormat::LegacyVtk),
        (".ex2", GridFormat::Exodus),
        (".exo", GridFormat::Exodus),
        (".exoii", GridFormat::Exodus),
        (".e", GridFormat::Exodus),
        (".g", GridFormat::Exodus),
        (".gen", GridFormat::Exodus),
    ];
    let by_ending = endings.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| format);
    // What follows numbers restarts and parts of a run: `run.e-s002`, `run.e.4.0`.
    let is_numbered = |(_, rest): (&str, &str)| {
        let rest = rest.strip_prefix("-s").or_else(|| rest.strip_prefix('.'));
        rest.is_some_and(|rest| {
            !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.')
        })
    };
    by_ending.or_else(|| name.rsplit_once(".e").is_some_and(is_numbered).then_some(GridFormat::Exodus))
}

/// The first bytes of a file; none if it cannot be read.
fn head_of(path: &Path) -> Vec<u8> {
    let mut head = Vec::new();
    if let Ok((file, _)) = bytes::open(path) {
        // What has come counts.
        let _ = file.take(1024).read_to_end(&mut head);
    }
    head
}

/// Whether the first bytes are those of a legacy file of structured points.
fn is_structured_points(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head).to_ascii_uppercase();
    // The title on the second line may be anything.
    let mut lines = head.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_legacy = lines.next().is_some_and(|line| line.starts_with("# VTK DATAFILE"));
    is_legacy && lines.any(|line| line.starts_with("DATASET") && line.ends_with(legacy::POINTS_DATASET))
}

/// The format that the first bytes of a file prove.
fn format_by_content(head: &[u8]) -> Option<GridFormat> {
    if is_vtk_xml(head, "UnstructuredGrid") {
        Some(GridFormat::Vtu)
    } else if is_vtk_xml(head, "PUnstructuredGrid") {
        Some(GridFormat::Pvtu)
    } else if is_vtk_xml(head, "Collection") {
        Some(GridFormat::Pvd)
    } else if head.starts_with(b"# vtk DataFile") {
        Some(GridFormat::LegacyVtk)
    } else if head.starts_with(b"CDF") || head.starts_with(b"\x89HDF") && contains(head, b"num_nodes") {
        Some(GridFormat::Exodus)
    } else {
        None
    }
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}
