//! VTK's XML image data, `.vti`: one piece; data ascii, base64 or appended (raw or base64), plain or in
//! zlib blocks; both byte orders.
//!
//! The array read is the one asked for, else the active scalars, else the first that can be read; point
//! data before cell data. Cell data become samples at the cell centres. Origin, direction and the start of
//! the extent are not used: the first sample lies at the world's origin.

use std::borrow::Cow;
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use volery_scene::SampleType;

use super::Decoded;
use crate::bytes::load;
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing};
use crate::volume::ReadOptions;

mod payload;

use payload::{Encoding, Payload};

/// What the XML says, data apart.
struct Document<'a> {
    order: ByteOrder,
    /// Bytes of the lengths that stand before binary data.
    header_bytes: usize,
    compressed: bool,
    extent: Option<[i64; 6]>,
    spacing: [f64; 3],
    arrays: Vec<DataArray<'a>>,
    /// Names of the active scalars of points and of cells.
    active: [Option<String>; 2],
    num_pieces: usize,
    /// The encoding of appended data and everything after the underscore that starts them.
    appended: Option<(Encoding, &'a [u8])>,
}

/// One `DataArray` of the piece.
struct DataArray<'a> {
    on_cells: bool,
    name: Option<String>,
    type_name: String,
    components: u64,
    format: String,
    offset: Option<u64>,
    text: &'a str,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let document = Document::parse(&bytes)?;
    let array = document.choose(options.array.as_deref())?;
    let mut notes = Vec::new();
    let dims = document.dims(array, &mut notes)?;
    let layout = Layout::new("Extent", dims, array.sample_type()?, document.order, options)?;
    let spacing = checked_spacing("Spacing", document.spacing, layout.dims, options, &mut notes)?;
    let samples = document.payload(array)?.read(&layout)?;
    Ok(Decoded { dims: layout.dims, spacing, samples, array: array.name.clone(), notes })
}

/// Where the walk through the XML is.
#[derive(Default)]
struct Place {
    root_seen: bool,
    /// Elements open.
    depth: usize,
    /// In `CellData` rather than `PointData`, while in one of them.
    on_cells: Option<bool>,
    /// Elements open inside the current array: text counts only directly in it.
    depth_in_array: Option<usize>,
}

impl<'a> Document<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Self, Problem> {
        let mut document = Self {
            order: ByteOrder::Little,
            header_bytes: 4,
            compressed: false,
            extent: None,
            spacing: [1.0; 3],
            arrays: Vec::new(),
            active: [None, None],
            num_pieces: 0,
            appended: None,
        };
        let mut place = Place::default();
        let mut reader = Reader::from_reader(bytes);
        loop {
            match reader.read_event().map_err(|error| Problem::damaged("the XML", error))? {
                Event::Start(element) if element.local_name().as_ref() == "AppendedData" => {
                    // What follows need not be XML.
                    let position = reader.buffer_position() as usize;
                    document.set_appended(&element, &bytes[position.min(bytes.len())..])?;
                    return Ok(document);
                }
                Event::Start(element) => document.open(&element, false, &mut place)?,
                Event::Empty(element) => document.open(&element, true, &mut place)?,
                Event::End(element) => place.close(element.local_name().as_ref()),
                Event::Text(text) if place.depth_in_array == Some(0) => {
                    // From a slice quick-xml borrows; anything else could not be kept.
                    if let (Cow::Borrowed(text), Some(array)) =
                        (text.into_inner(), document.arrays.last_mut())
                        && !text.trim_ascii().is_empty()
                    {
                        array.text = text.trim_ascii();
                    }
                }
                Event::Eof if place.depth > 0 => {
                    return Err(Problem::damaged("the XML", "it ends inside an element"));
                }
                Event::Eof => return Ok(document),
                _ => {}
            }
        }
    }

    fn open(&mut self, element: &BytesStart, is_empty: bool, place: &mut Place) -> Result<(), Problem> {
        let name = element.local_name();
        let name: &str = name.as_ref();
        if !place.root_seen && name != "VTKFile" {
            return Err(Problem::field("root element", quoted(name), "VTKFile"));
        }
        place.root_seen = true;
        place.depth += usize::from(!is_empty);
        match name {
            "DataArray" => {
                if let Some(on_cells) = place.on_cells {
                    self.arrays.push(DataArray::parse(element, on_cells)?);
                    place.depth_in_array = (!is_empty).then_some(0);
                }
            }
            "PointData" | "CellData" => {
                let on_cells = name == "CellData";
                place.on_cells = (!is_empty).then_some(on_cells);
                self.active[usize::from(on_cells)] = attribute(element, "Scalars")?;
            }
            _ => {
                self.element(name, element)?;
                if let Some(depth) = place.depth_in_array.as_mut().filter(|_| !is_empty) {
                    *depth += 1;
                }
            }
        }
        Ok(())
    }

    /// Takes the attributes of an element that is neither data nor a section.
    fn element(&mut self, name: &str, element: &BytesStart) -> Result<(), Problem> {
        match name {
            "VTKFile" => self.file_attributes(element)?,
            "ImageData" => {
                self.extent = self.extent.or(numbers(element, "WholeExtent")?);
                self.spacing = numbers(element, "Spacing")?.unwrap_or([1.0; 3]);
            }
            "Piece" => {
                self.num_pieces += 1;
                if let Some(extent) = numbers(element, "Extent")? {
                    self.extent = Some(extent);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn file_attributes(&mut self, element: &BytesStart) -> Result<(), Problem> {
        let of = |name: &str| attribute(element, name);
        match of("type")?.as_deref() {
            Some("ImageData") => {}
            found => return Err(Problem::field("type", shown(found), "ImageData")),
        }
        self.order = match of("byte_order")?.as_deref() {
            None | Some("LittleEndian") => ByteOrder::Little,
            Some("BigEndian") => ByteOrder::Big,
            found => return Err(Problem::field("byte_order", shown(found), "LittleEndian or BigEndian")),
        };
        self.header_bytes = match of("header_type")?.as_deref() {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            found => return Err(Problem::field("header_type", shown(found), "UInt32 or UInt64")),
        };
        self.compressed = match of("compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            found => return Err(Problem::field("compressor", shown(found), "vtkZLibDataCompressor or none")),
        };
        Ok(())
    }

    fn set_appended(&mut self, element: &BytesStart, rest: &'a [u8]) -> Result<(), Problem> {
        let encoding = match attribute(element, "encoding")?.as_deref() {
            Some("raw") => Encoding::Raw,
            Some("base64") => Encoding::Base64,
            found => return Err(Problem::field("encoding of AppendedData", shown(found), "raw or base64")),
        };
        let rest = rest.trim_ascii_start();
        let data = rest.strip_prefix(b"_");
        let data = data.ok_or_else(|| Problem::missing("underscore before the appended data", "it"))?;
        self.appended = Some((encoding, data));
        Ok(())
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
        if self.num_pieces != 1 {
            return Err(Problem::field("number of pieces", self.num_pieces, "1"));
        }
        let extent = self.extent.ok_or_else(|| Problem::missing("WholeExtent", "six whole numbers"))?;
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

    fn payload(&self, array: &DataArray<'a>) -> Result<Payload<'a>, Problem> {
        let binary = |encoding, bytes| Payload::Binary {
            encoding,
            bytes,
            header_bytes: self.header_bytes,
            compressed: self.compressed,
        };
        match array.format.as_str() {
            "ascii" => Ok(Payload::Ascii(array.text)),
            "binary" => Ok(binary(Encoding::Base64, array.text.as_bytes())),
            "appended" => {
                let appended = self.appended.as_ref();
                let (encoding, data) =
                    appended.ok_or_else(|| Problem::missing("AppendedData", "the element"))?;
                let offset = array.offset.ok_or_else(|| Problem::missing("offset", "one for each array"))?;
                let data = usize::try_from(offset).ok().and_then(|offset| data.get(offset..));
                let expected = "a place inside the appended data";
                Ok(binary(*encoding, data.ok_or_else(|| Problem::field("offset", offset, expected))?))
            }
            found => Err(Problem::field("format", quoted(found), "ascii, binary or appended")),
        }
    }
}

impl Place {
    fn close(&mut self, name: &str) {
        self.depth = self.depth.saturating_sub(1);
        match name {
            "PointData" | "CellData" => self.on_cells = None,
            "DataArray" => self.depth_in_array = None,
            _ => self.depth_in_array = self.depth_in_array.map(|depth| depth.saturating_sub(1)),
        }
    }
}

impl DataArray<'_> {
    fn parse(element: &BytesStart, on_cells: bool) -> Result<Self, Problem> {
        let of = |name: &str| attribute(element, name);
        let number = |name: &str| {
            let text = of(name)?;
            let parse = |text: String| text.trim().parse::<u64>().map_err(|_| (name, text));
            text.map(parse)
                .transpose()
                .map_err(|(name, text)| Problem::field(name, quoted(text), "a whole number"))
        };
        Ok(Self {
            on_cells,
            name: of("Name")?,
            type_name: of("type")?.unwrap_or_default(),
            components: number("NumberOfComponents")?.unwrap_or(1),
            format: of("format")?.unwrap_or_else(|| "ascii".to_owned()),
            offset: number("offset")?,
            text: "",
        })
    }

    fn sample_type(&self) -> Result<SampleType, Problem> {
        let scalar = match self.type_name.as_str() {
            "UInt8" => SampleType::U8,
            "Int8" => SampleType::I8,
            "UInt16" => SampleType::U16,
            "Int16" => SampleType::I16,
            "UInt32" => SampleType::U32,
            "Int32" => SampleType::I32,
            "Float32" => SampleType::F32,
            "Float64" => SampleType::F64,
            found => {
                return Err(Problem::field(
                    "type of DataArray",
                    quoted(found),
                    "an integer to 32 bits or a float",
                ));
            }
        };
        match (self.components, scalar) {
            (1, scalar) => Ok(scalar),
            (3, SampleType::U8) => Ok(SampleType::Rgb8),
            (4, SampleType::U8) => Ok(SampleType::Rgba8),
            (found, _) => {
                let found = format!("{found} of {}", self.type_name);
                Err(Problem::field("NumberOfComponents", found, "1, or 3 or 4 of UInt8"))
            }
        }
    }
}

fn attribute(element: &BytesStart, name: &str) -> Result<Option<String>, Problem> {
    let damaged = |error: &dyn std::fmt::Display| Problem::damaged("the XML", error);
    let Some(attribute) = element.try_get_attribute(name).map_err(|error| damaged(&error))? else {
        return Ok(None);
    };
    let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| damaged(&error))?;
    Ok(Some(value.into_owned()))
}

fn shown(value: Option<&str>) -> String {
    value.map_or_else(|| "missing".to_owned(), quoted)
}

/// An attribute of exactly `N` numbers.
fn numbers<T: std::str::FromStr, const N: usize>(
    element: &BytesStart,
    name: &str,
) -> Result<Option<[T; N]>, Problem> {
    let Some(text) = attribute(element, name)? else { return Ok(None) };
    let parsed: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let array = parsed.and_then(|numbers| numbers.try_into().ok());
    array.map(Some).ok_or_else(|| Problem::field(name, quoted(text), format!("{N} numbers")))
}
