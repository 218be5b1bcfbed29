//! VTK's XML image data, `.vti`: one piece; data ascii, base64 or appended (raw or base64), plain or in
//! blocks of zlib, LZ4 or LZMA; both byte orders.
//!
//! The array read is the one asked for, else the active scalars, else the first that can be read; point
//! data before cell data. Cell data become samples at the cell centres. Origin, direction and the start of
//! the extent are not used: the first sample lies at the world's origin.

use std::path::Path;

use volery_scene::SampleType;

use super::Decoded;
use crate::bytes::load;
use crate::error::{Problem, quoted};
use crate::layout::{Layout, checked_spacing};
use crate::numbers::Scalar;
use crate::volume::ReadOptions;
use crate::vtk_xml::{Document, Element};

/// The sections of data, and whether they lie on cells.
const SECTIONS: [(&str, bool); 2] = [("PointData", false), ("CellData", true)];

/// The image and its arrays.
struct Image<'a> {
    document: &'a Document<'a>,
    arrays: Vec<DataArray<'a>>,
    /// Names of the active scalars of points and of cells.
    active: [Option<String>; 2],
}

/// One `DataArray` of the piece.
struct DataArray<'a> {
    on_cells: bool,
    name: Option<String>,
    components: u64,
    element: &'a Element<'a>,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let document = Document::parse(&bytes, "ImageData")?;
    let image = Image::new(&document)?;
    let array = image.choose(options.array.as_deref())?;
    let mut notes = Vec::new();
    let dims = image.dims(array, &mut notes)?;
    let layout = Layout::new("Extent", dims, array.sample_type()?, document.order(), options)?;
    let spacing = checked_spacing("Spacing", image.spacing()?, layout.dims, options, &mut notes)?;
    let samples = document.numbers(array.element, layout.num_bytes())?.samples(&layout)?;
    Ok(Decoded { dims: layout.dims, spacing, samples, array: array.name.clone(), notes })
}

impl<'a> Image<'a> {
    fn new(document: &'a Document<'a>) -> Result<Self, Problem> {
        let mut image = Self { document, arrays: Vec::new(), active: [None, None] };
        for (name, on_cells) in SECTIONS {
            for section in document.all(name) {
                image.active[usize::from(on_cells)] = section.attribute("Scalars")?;
                for element in document.children(section, "DataArray") {
                    image.arrays.push(DataArray {
                        on_cells,
                        name: element.attribute("Name")?,
                        components: element.number("NumberOfComponents")?.unwrap_or(1),
                        element,
                    });
                }
            }
        }
        Ok(image)
    }

    fn choose(&self, wanted: Option<&str>) -> Result<&DataArray<'a>, Problem> {
        let named = |name: &str, on_cells: &[bool]| {
            let hit = |array: &&DataArray| array.name.as_deref() == Some(name);
            on_cells.iter().find_map(|side| self.arrays.iter().filter(|a| a.on_cells == *side).find(hit))
        };
        if let Some(name) = wanted {
            return named(name, &[false, true]).ok_or_else(|| {
                let names: Vec<_> = self.arrays.iter().filter_map(|array| array.name.as_deref()).collect();
                Problem::field("array", quoted(name), format!("one of {}", quoted(names.join(", "))))
            });
        }
        let active =
            |side: bool| self.active[usize::from(side)].as_deref().and_then(|name| named(name, &[side]));
        let first = |side: bool, readable: bool| {
            let fits =
                |array: &&DataArray| array.on_cells == side && (!readable || array.sample_type().is_ok());
            self.arrays.iter().find(fits)
        };
        let on = |side| active(side).or_else(|| first(side, true));
        on(false)
            .or_else(|| on(true))
            .or_else(|| first(false, false).or_else(|| first(true, false)))
            .ok_or_else(|| Problem::missing("DataArray", "one in PointData or CellData"))
    }

    fn dims(&self, array: &DataArray, notes: &mut Vec<String>) -> Result<[u64; 3], Problem> {
        let pieces = self.document.all("Piece").count();
        if pieces != 1 {
            return Err(Problem::field("number of pieces", pieces, "1"));
        }
        let whole = self.document.all("ImageData").next();
        let whole = whole.map_or(Ok(None), |image| image.numbers("WholeExtent"))?;
        let piece = self.document.all("Piece").next();
        let piece = piece.map_or(Ok(None), |piece| piece.numbers::<i64, 6>("Extent"))?;
        let extent = piece.or(whole);
        let extent = extent.ok_or_else(|| Problem::missing("WholeExtent", "six whole numbers"))?;
        let mut dims = [0; 3];
        for axis in 0..3 {
            let [low, high] = [extent[2 * axis], extent[2 * axis + 1]];
            let cells = high.checked_sub(low).and_then(|cells| u64::try_from(cells).ok());
            let Some(cells) = cells else {
                return Err(Problem::field("Extent", quoted(format!("{extent:?}")), "rising pairs"));
            };
            // A flat axis has one layer of cells.
            dims[axis] = if array.on_cells { cells.max(1) } else { cells + 1 };
        }
        if array.on_cells {
            notes.push("the array lies on cells; its values are samples at the cell centres".to_owned());
        }
        Ok(dims)
    }

    fn spacing(&self) -> Result<[f64; 3], Problem> {
        let image = self.document.all("ImageData").next();
        Ok(image.map_or(Ok(None), |image| image.numbers("Spacing"))?.unwrap_or([1.0; 3]))
    }
}

impl DataArray<'_> {
    fn sample_type(&self) -> Result<SampleType, Problem> {
        let scalar = match self.element.scalar()? {
            Scalar::U8 => SampleType::U8,
            Scalar::I8 => SampleType::I8,
            Scalar::U16 => SampleType::U16,
            Scalar::I16 => SampleType::I16,
            Scalar::U32 => SampleType::U32,
            Scalar::I32 => SampleType::I32,
            Scalar::F32 => SampleType::F32,
            Scalar::F64 => SampleType::F64,
            found @ (Scalar::U64 | Scalar::I64) => {
                let expected = "an integer to 32 bits or a float";
                return Err(Problem::field("type of DataArray", quoted(found.name()), expected));
            }
        };
        match (self.components, scalar) {
            (1, scalar) => Ok(scalar),
            (3, SampleType::U8) => Ok(SampleType::Rgb8),
            (4, SampleType::U8) => Ok(SampleType::Rgba8),
            (found, _) => {
                let type_name = self.element.attribute("type")?.unwrap_or_default();
                let found = format!("{found} of {type_name}");
                Err(Problem::field("NumberOfComponents", found, "1, or 3 or 4 of UInt8"))
            }
        }
    }
}
