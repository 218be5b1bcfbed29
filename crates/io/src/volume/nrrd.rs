//! NRRD, attached (`.nrrd`) or with a detached header (`.nhdr`) and one or several data files; encodings raw, gzip,
//! text and hex.
//!
//! What an axis is say its kind, its direction, or, where neither does, the number of axes. Wherever the axis of
//! channels stands, the axes of space make the volume, in their order; three or four bytes of a sample are colours.
//! Spacing is `spacings`, or the lengths of `space directions`; these and `space origin` make the orientation.

use std::path::Path;

use glam::DVec3;

use super::Decoded;
use super::text::{self, Data, DataPlace, Encoding, Lines, number, numbers};
use crate::bytes::{Compression, load};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, checked_spacing};
use crate::numbers::Scalar;
use crate::orientation::{Placement, completed};
use crate::raster::{Array, Meaning, Role};
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
    space: Option<&'a str>,
    directions: Option<&'a str>,
    origin: Option<&'a str>,
    kinds: Option<&'a str>,
    data_file: Option<&'a str>,
    /// The names after `data file: LIST`.
    listed: Vec<&'a str>,
    byte_skip: Option<&'a str>,
    line_skip: Option<&'a str>,
}

/// One axis of the array.
struct Axis {
    size: u64,
    role: Role,
    /// Its kind in lower case, if it is said.
    kind: Option<String>,
    /// The step along it in space, or its length; NaN where it is not known.
    step: Step,
}

/// How far one sample of an axis is from the next.
#[derive(Clone, Copy, PartialEq)]
enum Step {
    Vector(DVec3),
    Length(f64),
    /// The axis has no place in space.
    None,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let mut notes = Vec::new();
    let mut lines = Lines::new(&bytes);
    let fields = Fields::parse(&mut lines)?;
    let start = lines.position as u64;
    let axes = fields.axes(&mut notes)?;
    let raster = fields.array(&axes)?.plan(options, &mut notes)?;
    let space: Vec<&Axis> = axes.iter().filter(|axis| axis.role == Role::Space).take(3).collect();
    let spacing =
        checked_spacing("spacings", lengths(&space, &mut notes), raster.layout.dims, options, &mut notes)?;
    let placement = fields.placement(&space)?;
    let samples = fields.data(path, start, &axes)?.read(bytes, &raster, &mut notes)?;
    let mut decoded = Decoded::new(raster.layout.dims, spacing, samples, notes);
    decoded.choices = raster.choices;
    decoded.placement = placement;
    Ok(decoded)
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
                "space" => &mut fields.space,
                "space directions" => &mut fields.directions,
                "space origin" => &mut fields.origin,
                "kinds" => &mut fields.kinds,
                "data file" | "datafile" => &mut fields.data_file,
                "byte skip" | "byteskip" => &mut fields.byte_skip,
                "line skip" | "lineskip" => &mut fields.line_skip,
                _ => continue,
            };
            *field = Some(value.trim());
            if fields.data_file.is_some_and(|name| name.starts_with("LIST")) {
                // The names are the rest of the header.
                fields.listed = lines.names()?;
                break;
            }
        }
        Ok(fields)
    }

    fn axes(&self, notes: &mut Vec<String>) -> Result<Vec<Axis>, Problem> {
        let dimension: usize = number("dimension", required("dimension", self.dimension)?, "1 to 16")?;
        let sizes: Vec<u64> = numbers("sizes", required("sizes", self.sizes)?, "whole numbers")?;
        if sizes.len() != dimension || !(1..=16).contains(&dimension) {
            let expected = format!("{dimension} of 1 to 16");
            return Err(Problem::field("sizes", quoted(format!("{sizes:?}")), expected));
        }
        let kinds = self.kinds.map(|kinds| kinds.split_whitespace().map(str::to_ascii_lowercase).collect());
        let kinds: Vec<String> = kinds.unwrap_or_default();
        let kind =
            |axis: usize| kinds.get(axis).filter(|kind| !matches!(kind.as_str(), "???" | "none")).cloned();
        let steps = self.steps(dimension)?;
        let axes = sizes.iter().zip(steps).enumerate();
        let mut axes: Vec<Axis> = axes
            .map(|(axis, (&size, step))| Axis { size, role: Role::Space, kind: kind(axis), step })
            .collect();
        let is_silent = kinds.is_empty() && self.directions.is_none();
        for axis in &mut axes {
            axis.role = match axis.kind.as_deref() {
                Some("time") if dimension > 3 => Role::Volume,
                None | Some("domain" | "space" | "time") if axis.step == Step::None => Role::Channel,
                None | Some("domain" | "space" | "time") => Role::Space,
                Some(_) => Role::Channel,
            };
        }
        if is_silent && dimension > 3 {
            let is_unknown = |axis: &Axis| matches!(axis.step, Step::Length(length) if length.is_nan());
            let mut unknown = (0..dimension).filter(|&axis| is_unknown(&axes[axis]));
            // Without kinds or directions only numbers can tell.
            match (unknown.next(), unknown.next()) {
                (Some(one), None) => axes[one].role = Role::Channel,
                _ if matches!(sizes[0], 3 | 4) => axes[0].role = Role::Channel,
                _ => {}
            }
        }
        if axes.iter().any(|axis| axis.role == Role::Space && axis.kind.as_deref() == Some("time")) {
            notes.push("an axis of times is drawn like one of space".to_owned());
        }
        Ok(axes)
    }

    /// One step for each axis; a length of 1 where nothing is said.
    fn steps(&self, dimension: usize) -> Result<Vec<Step>, Problem> {
        let (field, steps) = if let Some(text) = self.directions {
            ("space directions", directions("space directions", text)?)
        } else if let Some(text) = self.spacings {
            ("spacings", numbers("spacings", text, "numbers")?.into_iter().map(Step::Length).collect())
        } else {
            return Ok(vec![Step::Length(1.0); dimension]);
        };
        if steps.len() != dimension {
            return Err(Problem::field(field, format!("{} entries", steps.len()), format!("{dimension}")));
        }
        Ok(steps)
    }

    fn array(&self, axes: &[Axis]) -> Result<Array<'_>, Problem> {
        let scalar = scalar(required("type", self.sample)?)?;
        let order = match self.endian.map(str::to_ascii_lowercase).as_deref() {
            None => None,
            Some("little") => Some(ByteOrder::Little),
            Some("big") => Some(ByteOrder::Big),
            Some(found) => return Err(Problem::field("endian", quoted(found), "little or big")),
        };
        let order = match self.encoding()? {
            Encoding::Text => ByteOrder::NATIVE,
            _ => text::byte_order("endian", order, scalar.bytes())?,
        };
        let channels = axes.iter().find(|axis| axis.role == Role::Channel);
        let meaning = channels.map_or(Meaning::Channels, |axis| match axis.kind.as_deref() {
            Some("rgb-color" | "rgba-color" | "3-color" | "4-color") => Meaning::Color,
            Some("list" | "hsv-color" | "xyz-color" | "quaternion" | "scalar" | "stub") => Meaning::Channels,
            Some(_) => Meaning::Components,
            None if scalar == Scalar::U8 => Meaning::Color,
            None => Meaning::Channels,
        });
        let axes = axes.iter().map(|axis| (axis.size, axis.role)).collect();
        Ok(Array { field: "sizes", axes, scalar, order, meaning })
    }

    /// Where the axes of space lie; `None` where only their lengths are known, and none is negative.
    fn placement(&self, space: &[&Axis]) -> Result<Option<Placement>, Problem> {
        let origin = match self.origin {
            None => DVec3::ZERO,
            Some(text) => match directions("space origin", text)?[..] {
                [Step::Vector(origin)] => origin,
                _ => return Err(Problem::field("space origin", quoted(text), "a vector such as (0,0,0)")),
            },
        };
        let vector = |(index, axis): (usize, &&Axis)| match axis.step {
            Step::Vector(vector) => vector,
            Step::Length(length) if length.is_finite() => DVec3::AXES[index] * length,
            _ => DVec3::AXES[index],
        };
        let vectors: Vec<DVec3> = space.iter().enumerate().map(vector).collect();
        if self.directions.is_none() && vectors.iter().all(|vector| vector.min_element() >= 0.0) {
            return Ok(None);
        }
        let axes = completed(&vectors);
        let space = self.space.unwrap_or_default().to_ascii_lowercase();
        let space = space.strip_suffix("-time").unwrap_or(&space);
        let world_from_space = match space {
            "right-anterior-superior" | "ras" | "rast" => DVec3::ONE,
            "left-anterior-superior" | "las" | "last" => DVec3::new(-1.0, 1.0, 1.0),
            "left-posterior-superior" | "lps" | "lpst" => DVec3::new(-1.0, -1.0, 1.0),
            _ => return Ok(Some(Placement::plain(axes, origin))),
        };
        Ok(Some(Placement::anatomical(axes, origin, world_from_space)))
    }

    fn encoding(&self) -> Result<Encoding, Problem> {
        let encoding = required("encoding", self.encoding)?;
        Ok(match encoding.to_ascii_lowercase().as_str() {
            "raw" => Encoding::Binary(Compression::None),
            "gzip" | "gz" => Encoding::Binary(Compression::Gzip),
            "txt" | "text" | "ascii" => Encoding::Text,
            "hex" => Encoding::Hex,
            _ => return Err(Problem::field("encoding", quoted(encoding), "raw, gzip, text or hex")),
        })
    }

    fn data(&self, path: &Path, start: u64, axes: &[Axis]) -> Result<Data, Problem> {
        let encoding = self.encoding()?;
        let line_skip = self.line_skip.map_or(Ok(0), |lines| number("line skip", lines, "0 or more"))?;
        let place = match self.data_file {
            None => DataPlace::Here(start),
            Some(name) => {
                DataPlace::detached("data file", path, name, &self.listed, self.num_parts(name, axes))?
            }
        };
        Ok(Data {
            place,
            line_skip,
            byte_skip: text::byte_skip("byte skip", self.byte_skip, encoding)?,
            encoding,
        })
    }

    /// The files that a list or pattern must name: each holds the axes up to the one that its last number says, or
    /// all but the slowest.
    fn num_parts(&self, name: &str, axes: &[Axis]) -> u64 {
        let words: Vec<&str> = name.split_whitespace().collect();
        let stated = if name.starts_with("LIST") { words.get(1) } else { words.get(4) };
        let each = stated.and_then(|word| word.parse().ok()).unwrap_or(axes.len() - 1);
        axes.iter().skip(each).fold(1, |parts, axis| parts.saturating_mul(axis.size))
    }
}

/// The distances along the first three axes of space; where a header says that it does not know, 1.
fn lengths(space: &[&Axis], notes: &mut Vec<String>) -> [f64; 3] {
    let mut lengths = [1.0; 3];
    for (index, axis) in space.iter().enumerate() {
        lengths[index] = match axis.step {
            Step::Vector(vector) => vector.length(),
            Step::Length(length) if length.is_nan() => {
                notes.push(format!("spacings of axis {index} is NaN, not known; 1 is used"));
                1.0
            }
            // The sign is for the orientation.
            Step::Length(length) => length.abs(),
            Step::None => 1.0,
        };
    }
    lengths
}

fn required<'a>(field: &str, value: Option<&'a str>) -> Result<&'a str, Problem> {
    value.ok_or_else(|| Problem::missing(field, "it in the header"))
}

fn scalar(name: &str) -> Result<Scalar, Problem> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
        "signed char" | "int8" | "int8_t" => Scalar::I8,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Scalar::I16,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
        "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Scalar::U64,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Scalar::I64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => return Err(Problem::field("type", quoted(name), "an integer, float or double")),
    })
}

/// `(x,y,z)` vectors of up to three coordinates, the first three of more; `none` or one of NaN is no place in space.
fn directions(field: &str, text: &str) -> Result<Vec<Step>, Problem> {
    let bad = || Problem::field(field, quoted(text), "vectors such as (1,0,0), or none");
    let mut steps = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            steps.push(Step::None);
            rest = after.trim_start();
            continue;
        }
        let (vector, after) =
            rest.strip_prefix('(').and_then(|inner| inner.split_once(')')).ok_or_else(bad)?;
        let mut coordinates = [0.0; 3];
        for (index, part) in vector.split(',').enumerate() {
            let coordinate = part.trim().parse::<f64>().map_err(|_| bad())?;
            if let Some(slot) = coordinates.get_mut(index) {
                *slot = coordinate;
            }
        }
        let vector = DVec3::from_array(coordinates);
        steps.push(if vector.is_nan() { Step::None } else { Step::Vector(vector) });
        rest = after.trim_start();
    }
    Ok(steps)
}
