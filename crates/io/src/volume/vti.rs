//! VTK's XML image data: `.vti`, of one or several pieces, and `.pvti`, whose pieces are files of their own; data ascii,
//! base64 or appended (raw or base64), plain or in blocks of zlib, LZ4 or LZMA; both byte orders.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::Decoded;
use super::image_data::{ImageArray, ImageData, ImagePiece};
use crate::bytes::load;
use crate::error::Problem;
use crate::volume::ReadOptions;
use crate::vtk_xml::{Document, Element, XmlBytes};

/// The sections of data, and whether they lie on cells.
const SECTIONS: [(&str, bool); 2] = [("PointData", false), ("CellData", true)];

/// An image of more pieces in files is refused: all of them are in memory or mapped at once.
const MAX_FILES: usize = 4096;

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = XmlBytes::new(load(path)?)?;
    let document = Document::parse(&bytes, "ImageData")?;
    let pieces = pieces(&document, None)?;
    image(&document, "ImageData", pieces)?.read(options)
}

/// Reads an image whose pieces are files.
pub(super) fn read_parallel(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = XmlBytes::new(load(path)?)?;
    let document = Document::parse(&bytes, "PImageData")?;
    let paths = piece_paths(path, &document)?;
    let files: Vec<XmlBytes> = paths
        .iter()
        .map(|path| load(path).and_then(XmlBytes::new).map_err(|problem| problem.of_part(path)))
        .collect::<Result<_, _>>()?;
    let documents: Vec<Document> = paths
        .iter()
        .zip(&files)
        .map(|(path, file)| Document::parse(file, "ImageData").map_err(|problem| problem.of_part(path)))
        .collect::<Result<_, _>>()?;
    let mut parts = Vec::new();
    for (path, document) in paths.iter().zip(&documents) {
        parts.extend(pieces(document, Some(path)).map_err(|problem| problem.of_part(path))?);
    }
    image(&document, "PImageData", parts)?.read(options)
}

fn piece_paths(path: &Path, document: &Document) -> Result<Vec<PathBuf>, Problem> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let source = |piece: &Element| {
        let source = piece.attribute("Source")?;
        source.map(|name| folder.join(name)).ok_or_else(|| Problem::missing("Source", "one for each Piece"))
    };
    let paths: Vec<_> = document.all("Piece").map(source).collect::<Result<_, _>>()?;
    match paths.len() {
        0 => Err(Problem::missing("Piece", "at least one")),
        1..=MAX_FILES => Ok(paths),
        found => Err(Problem::field("number of pieces", found, format!("at most {MAX_FILES}"))),
    }
}

/// What the root of an image says of its lattice, with its pieces; those without a point are left out.
fn image<'a>(
    document: &Document,
    name: &str,
    mut pieces: Vec<ImagePiece<'a>>,
) -> Result<ImageData<'a>, Problem> {
    let is_empty = |piece: &ImagePiece| piece.extent.as_chunks::<2>().0.iter().any(|[low, high]| high < low);
    if !pieces.iter().all(is_empty) {
        pieces.retain(|piece| !is_empty(piece));
    }
    if pieces.is_empty() {
        return Err(Problem::missing("Piece", "at least one"));
    }
    let root = document.all(name).next();
    let triple = |name: &str| root.map_or(Ok(None), |root| root.numbers::<f64, 3>(name));
    let directions = root.map_or(Ok(None), |root| root.numbers::<f64, 9>("Direction"))?;
    // In the file row by row.
    let directions = directions.map_or(DMat3::IDENTITY, |rows| DMat3::from_cols_array(&rows).transpose());
    Ok(ImageData {
        spacing: triple("Spacing")?.unwrap_or([1.0; 3]),
        origin: triple("Origin")?.unwrap_or(DVec3::ZERO.to_array()),
        directions,
        pieces,
    })
}

/// The pieces of a file, at least one.
fn pieces<'a>(document: &'a Document<'a>, path: Option<&'a Path>) -> Result<Vec<ImagePiece<'a>>, Problem> {
    let whole = document.all("ImageData").next();
    let whole = whole.map_or(Ok(None), |image| image.numbers::<i64, 6>("WholeExtent"))?;
    let mut pieces = Vec::new();
    for element in document.all("Piece") {
        let extent = element.numbers("Extent")?.or(whole);
        let extent = extent.ok_or_else(|| Problem::missing("WholeExtent", "six whole numbers"))?;
        pieces.push(ImagePiece { extent, arrays: arrays(document, element)?, path });
    }
    if pieces.is_empty() {
        // A file that is none: the same as one without data.
        return Err(Problem::missing("DataArray", "one in PointData or CellData"));
    }
    Ok(pieces)
}

/// Every array of a piece, of numbers or not.
fn arrays<'a>(document: &'a Document<'a>, piece: &'a Element<'a>) -> Result<Vec<ImageArray<'a>>, Problem> {
    let mut arrays = Vec::new();
    for (name, on_cells) in SECTIONS {
        for section in document.children(piece, name) {
            let active = section.attribute("Scalars")?;
            for element in document.children(section, "DataArray") {
                let name = element.attribute("Name")?;
                let scalar = element.scalar();
                arrays.push(ImageArray {
                    on_cells,
                    is_active: active.is_some() && active == name,
                    name,
                    components: element.components()?,
                    scalar: scalar.or(Err(element.attribute("type")?.unwrap_or_default())),
                    order: document.order(),
                    open: Box::new(move |bytes| document.numbers(element, bytes)),
                });
            }
        }
    }
    Ok(arrays)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_read_row_by_row() {
        let text =
            br#"<VTKFile type="ImageData" byte_order="LittleEndian"><ImageData WholeExtent="0 0 0 0 0 0"
            Direction="0 1 0 -1 0 0 0 0 1"><Piece Extent="0 0 0 0 0 0"/></ImageData></VTKFile>"#;
        let document = Document::parse(text, "ImageData").unwrap();
        let image = image(&document, "ImageData", pieces(&document, None).unwrap()).unwrap();
        assert_eq!(image.directions * DVec3::X, DVec3::new(0.0, -1.0, 0.0));
    }
}
