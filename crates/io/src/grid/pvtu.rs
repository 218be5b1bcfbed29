//! VTK's parallel unstructured grid, `.pvtu`: names files of pieces, relative to its own folder.

use std::path::{Path, PathBuf};

use super::{Part, vtu};
use crate::bytes::load;
use crate::error::Problem;
use crate::volume::is_vtk_xml;
use crate::vtk_xml::{Document, XmlBytes};

/// A grid of more pieces is refused: all of them are in memory or mapped at once.
const MAX_PIECES: usize = 4096;

/// Types of VTK's XML that hold no unstructured cells.
const NO_CELLS: [&str; 8] = [
    "PolyData",
    "PPolyData",
    "StructuredGrid",
    "PStructuredGrid",
    "RectilinearGrid",
    "PRectilinearGrid",
    "ImageData",
    "PImageData",
];

/// Opens a file and those that it names, and runs something on all pieces.
pub(super) fn with_parts<R>(
    path: &Path,
    run: impl FnOnce(&[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    with_pieces(&piece_paths(path)?, &[], run)
}

/// Opens files of pieces, some of which may name others, and runs something on all of them. Surfaces and the like are
/// no pieces, and left out.
pub(super) fn with_files<R>(
    named: &[PathBuf],
    run: impl FnOnce(&[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    let (mut paths, mut left_out) = (Vec::new(), Vec::new());
    for path in named {
        let head = super::head_of(path);
        if is_vtk_xml(&head, "PUnstructuredGrid") {
            paths.extend(piece_paths(path).map_err(|problem| problem.of_part(path))?);
        } else if NO_CELLS.iter().any(|kind| is_vtk_xml(&head, kind)) {
            left_out.push(path);
        } else {
            paths.push(path.clone());
        }
        if paths.len() > MAX_PIECES {
            return Err(Problem::field("number of pieces", paths.len(), format!("at most {MAX_PIECES}")));
        }
    }
    with_pieces(&paths, &left_out, run)
}

/// Opens files of pieces, and runs something on all of them; others were left out.
fn with_pieces<R>(
    paths: &[PathBuf],
    left_out: &[&PathBuf],
    run: impl FnOnce(&[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    let of_part = |path: &PathBuf, problem: Problem| problem.of_part(path);
    let files: Vec<XmlBytes> = paths
        .iter()
        .map(|path| load(path).and_then(XmlBytes::new).map_err(|problem| of_part(path, problem)))
        .collect::<Result<_, _>>()?;
    let documents: Vec<Document> = paths
        .iter()
        .zip(&files)
        .map(|(path, file)| {
            Document::parse(file, "UnstructuredGrid").map_err(|problem| of_part(path, problem))
        })
        .collect::<Result<_, _>>()?;
    let mut parts = Vec::new();
    for (path, document) in paths.iter().zip(&documents) {
        let pieces = vtu::pieces(document).map_err(|problem| of_part(path, problem))?;
        parts.extend(pieces.into_iter().map(|piece| Part::new(Some(path), piece)));
    }
    if let Some(first) = parts.first_mut() {
        let note = |path: &&PathBuf| format!("{} has no cells of volume, and is left out", path.display());
        first.notes = left_out.iter().map(note).collect();
    } else if let Some(path) = left_out.first() {
        let found = Problem::field("type", "one without cells of volume", "UnstructuredGrid");
        return Err(found.of_part(path));
    }
    run(&parts)
}

fn piece_paths(path: &Path) -> Result<Vec<PathBuf>, Problem> {
    let bytes = XmlBytes::new(load(path)?)?;
    let document = Document::parse(&bytes, "PUnstructuredGrid")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let source = |piece: &crate::vtk_xml::Element| {
        let source = piece.attribute("Source")?;
        source.map(|name| folder.join(name)).ok_or_else(|| Problem::missing("Source", "one for each Piece"))
    };
    let paths: Vec<_> = document.all("Piece").map(source).collect::<Result<_, _>>()?;
    match paths.len() {
        0 => Err(Problem::missing("Piece", "at least one")),
        1..=MAX_PIECES => Ok(paths),
        found => Err(Problem::field("number of pieces", found, format!("at most {MAX_PIECES}"))),
    }
}
