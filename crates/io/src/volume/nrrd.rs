//! NRRD, attached (`.nrrd`) or with a detached header (`.nhdr`); encodings raw and gzip.
//!
//! A first axis of 3 or 4 bytes that is no axis of space makes RGB or RGBA. Of a fourth spatial axis the
//! first volume is read. Spacing is `spacings`, or the lengths of `space directions`; origin and
//! orientation are not used.

use std::path::Path;

use volery_scene::SampleType;

use super::Decoded;
use super::text::{Data, Lines, byte_order, number, numbers};
use crate::bytes::{Compression, load};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing, first_volume, swap_scalars};
use crate::volume::ReadOptions;

/// The fields of a header, as written.
#[derive(Default)]
struct Fields<'a> {
    sample: Option<&'a str>,
    dimension: Option<&'a str>,
    sizes: Option<&'a str>,
    encoding: Option<&'a str>,
    endian: Option<&'a str>,
    spacings: Option<&'a str>,
    directions: Option<&'a str>,
    kinds: Option<&'a str>,
    data_file: Option<&'a str>,
    byte_skip: Option<&'a str>,
    line_skip: Option<&'a str>,
}

/// What the fields mean.
struct Header {
    layout: Layout,
    spacing: glam::DVec3,
    data: Data,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let mut notes = Vec::new();
    let mut lines = Lines::new(&bytes);
    let fields = Fields::parse(&mut lines)?;
    let start = lines.position as u64;
    let Header { layout, spacing, data } = fields.header(path, start, options, &mut notes)?;
    let samples = data.read(bytes, &layout, &mut notes)?;
    Ok(Decoded { dims: layout.dims, spacing, samples, array: None, notes })
}

impl<'a> Fields<'a> {
    fn parse(lines: &mut Lines<'a>) -> Result<Self, Problem> {
        let magic = lines.next()?.unwrap_or_default();
        let version = magic.strip_prefix("NRRD000").and_then(|version| version.parse().ok());
        if !version.is_some_and(|version: u8| (1..=6).contains(&version)) {
            return Err(Problem::field("magic", quoted(magic), "NRRD0001 to NRRD0006"));
        }
        let mut fields = Self::default();
        // The header ends at an empty line, a detached one also with the file.
        while let Some(line) = lines.next()?.filter(|line| !line.is_empty()) {
            if line.starts_with('#') || line.contains(":=") {
                continue;
            }
            let Some((name, value)) = line.split_once(": ").or_else(|| line.split_once(':')) else {
                return Err(Problem::field("header line", quoted(line), "'field: value'"));
            };
            let field = match name.trim().to_ascii_lowercase().as_str() {
                "type" => &mut fields.sample,
                "dimension" => &mut fields.dimension,
                "sizes" => &mut fields.sizes,
                "encoding" => &mut fields.encoding,
                "endian" => &mut fields.endian,
                "spacings" => &mut fields.spacings,
                "space directions" => &mut fields.directions,
                "kinds" => &mut fields.kinds,
                "data file" | "datafile" => &mut fields.data_file,
                "byte skip" | "byteskip" => &mut fields.byte_skip,
                "line skip" | "lineskip" => &mut fields.line_skip,
                _ => continue,
            };
            *field = Some(value.trim());
        }
        Ok(fields)
    }

    fn header(
        &self,
        path: &Path,
        start: u64,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Header, Problem> {
        let dimension: usize = number("dimension", required("dimension", self.dimension)?, "1 to 16")?;
        let mut sizes: Vec<u64> = numbers("sizes", required("sizes", self.sizes)?, "whole numbers")?;
        if sizes.len() != dimension || !(1..=16).contains(&dimension) {
            return Err(Problem::field(
                "sizes",
                quoted(format!("{sizes:?}")),
                format!("{dimension} of 1 to 16"),
            ));
        }
        let mut sample = sample_type(required("type", self.sample)?)?;
        let mut spacings = self.axis_spacings(dimension)?;
        if !self.first_axis_is_space(dimension) {
            sample = match (sizes[0], sample) {
                (3, SampleType::U8) => SampleType::Rgb8,
                (4, SampleType::U8) => SampleType::Rgba8,
                (found, _) => {
                    let expected = "3 or 4 of uint8, colours, where the first axis is not one of space";
                    return Err(Problem::field("sizes", format!("{found} of {sample}"), expected));
                }
            };
            sizes.remove(0);
            spacings.remove(0);
        }
        let order = match self.endian.map(str::to_ascii_lowercase).as_deref() {
            None => None,
            Some("little") => Some(ByteOrder::Little),
            Some("big") => Some(ByteOrder::Big),
            Some(found) => return Err(Problem::field("endian", quoted(found), "little or big")),
        };
        let order = byte_order("endian", order, swap_scalars(sample))?;
        let dims = first_volume("sizes", &sizes, notes)?;
        let layout = Layout::new("sizes", dims, sample, order, options)?;
        let first_three = std::array::from_fn(|axis| spacings.get(axis).copied().unwrap_or(1.0));
        let spacing = checked_spacing("spacings", first_three, layout.dims, options, notes)?;
        Ok(Header { layout, spacing, data: self.data(path, start)? })
    }

    /// Whether samples of this header start with an axis of space; otherwise with one of colour.
    fn first_axis_is_space(&self, dimension: usize) -> bool {
        if let Some(kind) = self.kinds.and_then(|kinds| kinds.split_whitespace().next()) {
            return matches!(kind, "domain" | "space" | "time" | "???" | "none")
                && !self.first_has_no_direction();
        }
        if self.directions.is_some() {
            return !self.first_has_no_direction();
        }
        // Without kinds or directions only the number of axes can tell.
        dimension < 4
            || !matches!(self.sizes.and_then(|sizes| sizes.split_whitespace().next()), Some("3" | "4"))
    }

    fn first_has_no_direction(&self) -> bool {
        self.directions.is_some_and(|directions| directions.trim_start().starts_with("none"))
    }

    /// One spacing for each axis; 1 where nothing is said.
    fn axis_spacings(&self, dimension: usize) -> Result<Vec<f64>, Problem> {
        let (field, spacings) = if let Some(text) = self.spacings {
            ("spacings", numbers("spacings", text, "numbers")?)
        } else if let Some(text) = self.directions {
            ("space directions", direction_lengths(text)?)
        } else {
            return Ok(vec![1.0; dimension]);
        };
        if spacings.len() != dimension {
            return Err(Problem::field(field, format!("{} entries", spacings.len()), format!("{dimension}")));
        }
        Ok(spacings)
    }

    fn data(&self, path: &Path, start: u64) -> Result<Data, Problem> {
        let encoding = required("encoding", self.encoding)?;
        let compression = match encoding.to_ascii_lowercase().as_str() {
            "raw" => Compression::None,
            "gzip" | "gz" => Compression::Gzip,
            _ => return Err(Problem::field("encoding", quoted(encoding), "raw or gzip")),
        };
        if let Some(lines) = self.line_skip.filter(|&lines| lines != "0") {
            return Err(Problem::field("line skip", quoted(lines), "0"));
        }
        let file = match self.data_file {
            None => None,
            Some(name) if name.starts_with("LIST") || name.contains('%') => {
                return Err(Problem::field("data file", quoted(name), "the name of one file"));
            }
            Some(name) => Some(Data::detached(path, name)),
        };
        let start = if file.is_some() { 0 } else { start };
        let skip = Data::skip("byte skip", self.byte_skip, start, compression)?;
        Ok(Data { file, skip, compression })
    }
}

fn required<'a>(field: &str, value: Option<&'a str>) -> Result<&'a str, Problem> {
    value.ok_or_else(|| Problem::missing(field, "it in the header"))
}

fn sample_type(name: &str) -> Result<SampleType, Problem> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
        "signed char" | "int8" | "int8_t" => SampleType::I8,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => SampleType::I16,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
        "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => {
            return Err(Problem::field(
                "type",
                quoted(name),
                "an integer of at most 32 bits, float or double",
            ));
        }
    })
}

/// The lengths of `(x,y,z)` vectors; `none` counts as 1.
fn direction_lengths(text: &str) -> Result<Vec<f64>, Problem> {
    let bad = || Problem::field("space directions", quoted(text), "vectors such as (1,0,0), or none");
    let mut lengths = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            lengths.push(1.0);
            rest = after.trim_start();
            continue;
        }
        let (vector, after) =
            rest.strip_prefix('(').and_then(|inner| inner.split_once(')')).ok_or_else(bad)?;
        let mut squares = 0.0;
        for part in vector.split(',') {
            squares += part.trim().parse::<f64>().map_err(|_| bad())?.powi(2);
        }
        lengths.push(squares.sqrt());
        rest = after.trim_start();
    }
    Ok(lengths)
}
