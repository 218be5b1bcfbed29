//! MetaImage: `.mha` with its data, `.mhd` with the data in one or several files beside it; raw, zlib and text.
//!
//! Fields mean what MetaIO makes of them: of two names for one thing the same one wins. Spacing is `ElementSpacing`,
//! else `ElementSize`; `TransformMatrix` and `Offset` are in LPS. Three or four channels of bytes are RGB or RGBA,
//! other channels the components of a vector. Of four dimensions one volume is read.

use std::path::Path;

use glam::DVec3;

use super::Decoded;
use super::text::{self, Data, DataPlace, Encoding, Lines, number, numbers};
use crate::bytes::{Compression, load};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing};
use crate::numbers::Scalar;
use crate::orientation::{Placement, completed};
use crate::raster::{Array, Meaning, Role};
use crate::volume::ReadOptions;

/// The fields of a header, as written.
#[derive(Default)]
struct Fields<'a> {
    rank: Option<&'a str>,
    dims: Option<&'a str>,
    sample: Option<&'a str>,
    channels: Option<&'a str>,
    spacing: Option<&'a str>,
    size: Option<&'a str>,
    binary: Option<&'a str>,
    /// By `BinaryDataByteOrderMSB`, which wins, and by `ElementByteOrderMSB`.
    big_endian: [Option<&'a str>; 2],
    compressed: Option<&'a str>,
    header_size: Option<&'a str>,
    /// By `TransformMatrix`, `Rotation` and `Orientation`: the first one that is there counts.
    matrix: [Option<&'a str>; 3],
    /// The same by `Origin`, `Offset` and `Position`.
    offset: [Option<&'a str>; 3],
    center: Option<&'a str>,
    anatomical: Option<&'a str>,
    data_file: Option<&'a str>,
    /// The names after `ElementDataFile = LIST`.
    listed: Vec<&'a str>,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let mut notes = Vec::new();
    let mut lines = Lines::new(&bytes);
    let fields = Fields::parse(&mut lines)?;
    let sizes = fields.sizes()?;
    let data = fields.data(path, lines.position as u64, &sizes)?;
    let raster = fields.array(&sizes)?.plan(options, &mut notes)?;
    let spacing = fields.spacing(&raster.layout, options, &mut notes)?;
    let placement = fields.placement(sizes.len(), spacing, &mut notes)?;
    let samples = data.read(bytes, &raster, &mut notes)?;
    let mut decoded = Decoded::new(raster.layout.dims, spacing, samples, notes);
    decoded.choices = raster.choices;
    decoded.placement = placement;
    Ok(decoded)
}

impl<'a> Fields<'a> {
    fn parse(lines: &mut Lines<'a>) -> Result<Self, Problem> {
        let mut fields = Self::default();
        while let Some(line) = lines.next()? {
            if line.trim().is_empty() || line.starts_with('#') {
                continue;
            }
            let Some((name, value)) = line.split_once('=').or_else(|| line.split_once(':')) else {
                return Err(Problem::field("header line", quoted(line), "'Field = value'"));
            };
            let field = match name.trim() {
                "NDims" => &mut fields.rank,
                "DimSize" => &mut fields.dims,
                "ElementType" => &mut fields.sample,
                "ElementNumberOfChannels" => &mut fields.channels,
                "ElementSpacing" => &mut fields.spacing,
                "ElementSize" => &mut fields.size,
                "BinaryData" => &mut fields.binary,
                "BinaryDataByteOrderMSB" => &mut fields.big_endian[0],
                "ElementByteOrderMSB" => &mut fields.big_endian[1],
                "CompressedData" => &mut fields.compressed,
                "HeaderSize" => &mut fields.header_size,
                "TransformMatrix" => &mut fields.matrix[0],
                "Rotation" => &mut fields.matrix[1],
                "Orientation" => &mut fields.matrix[2],
                "Origin" => &mut fields.offset[0],
                "Offset" => &mut fields.offset[1],
                "Position" => &mut fields.offset[2],
                "CenterOfRotation" => &mut fields.center,
                "AnatomicalOrientation" => &mut fields.anatomical,
                "ElementDataFile" => &mut fields.data_file,
                _ => continue,
            };
            *field = Some(value.trim());
            if let Some(name) = fields.data_file {
                if name.starts_with("LIST") {
                    fields.listed = lines.names()?;
                }
                return Ok(fields);
            }
        }
        Err(Problem::missing("ElementDataFile", "LOCAL or the name of the data file"))
    }

    fn sizes(&self) -> Result<Vec<u64>, Problem> {
        let rank: usize = number("NDims", required("NDims", self.rank)?, "1 to 10")?;
        let sizes: Vec<u64> = numbers("DimSize", required("DimSize", self.dims)?, "whole numbers")?;
        if sizes.len() != rank || !(1..=10).contains(&rank) {
            let expected = format!("{rank} of 1 to 10 numbers");
            return Err(Problem::field("DimSize", format!("{sizes:?}"), expected));
        }
        Ok(sizes)
    }

    fn array(&self, sizes: &[u64]) -> Result<Array<'_>, Problem> {
        let expected = "a whole number from 1 on";
        let channels: u64 =
            self.channels.map_or(Ok(1), |text| number("ElementNumberOfChannels", text, expected))?;
        if channels == 0 {
            return Err(Problem::field("ElementNumberOfChannels", channels, expected));
        }
        let scalar = scalar(required("ElementType", self.sample)?)?;
        let names = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];
        let stated = self.big_endian.iter().zip(names).find_map(|(text, name)| text.map(|text| (name, text)));
        // As in MetaIO, the machine's own where nothing is said.
        let order = match stated.map(|(name, text)| boolean(name, text)).transpose()? {
            None => ByteOrder::NATIVE,
            Some(true) => ByteOrder::Big,
            Some(false) => ByteOrder::Little,
        };
        let mut axes = vec![(channels, Role::Channel)];
        axes.retain(|&(channels, _)| channels > 1);
        axes.extend(sizes.iter().map(|&size| (size, Role::Space)));
        Ok(Array { field: "DimSize", axes, scalar, order, meaning: Meaning::Components })
    }

    fn spacing(
        &self,
        layout: &Layout,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<DVec3, Problem> {
        let field = if self.spacing.is_some() { "ElementSpacing" } else { "ElementSize" };
        let mut found = [1.0; 3];
        if let Some(text) = self.spacing.or(self.size) {
            let given: Vec<f64> = numbers(field, text, "numbers")?;
            for (slot, value) in found.iter_mut().zip(given) {
                *slot = value;
            }
        }
        checked_spacing(field, found, layout.dims, options, notes)
    }

    /// Directions and origin in LPS; `None` where no field tells of either.
    fn placement(
        &self,
        rank: usize,
        spacing: DVec3,
        notes: &mut Vec<String>,
    ) -> Result<Option<Placement>, Problem> {
        let matrix = self.matrix.into_iter().flatten().next();
        let offset = self.offset.into_iter().flatten().next();
        if matrix.or(offset).or(self.anatomical).is_none() {
            return Ok(None);
        }
        let list = |field: &str, text: Option<&str>, count: usize| -> Result<Option<Vec<f64>>, Problem> {
            let Some(text) = text else { return Ok(None) };
            let list: Vec<f64> = numbers(field, text, "numbers")?;
            if list.len() < count {
                return Err(Problem::field(field, quoted(text), format!("{count} numbers")));
            }
            Ok(Some(list))
        };
        // The numbers of an axis stand together.
        let vector = |list: &[f64]| DVec3::from_array([0, 1, 2].map(|i| list.get(i).copied().unwrap_or(0.0)));
        let directions: Vec<DVec3> = match list("TransformMatrix", matrix, rank * rank)? {
            Some(list) => {
                list.chunks(rank).take(rank.min(3)).map(|row| vector(&row[..rank.min(3)])).collect()
            }
            None => Vec::new(),
        };
        let axes = completed(&directions);
        let center = list("CenterOfRotation", self.center, rank)?.unwrap_or_default();
        if center.iter().any(|&coordinate| coordinate != 0.0) && axes != glam::DMat3::IDENTITY {
            notes.push(
                "CenterOfRotation is not used, as in ITK: samples are turned about the first".to_owned(),
            );
        }
        let origin = list("Offset", offset, rank)?.unwrap_or_default();
        let axes = axes * glam::DMat3::from_diagonal(spacing);
        Ok(Some(Placement::lps(axes, vector(&origin[..origin.len().min(rank)]))))
    }

    fn data(&self, path: &Path, start: u64, sizes: &[u64]) -> Result<Data, Problem> {
        let is_binary = self.binary.map_or(Ok(true), |text| boolean("BinaryData", text))?;
        let compressed = self.compressed.map_or(Ok(false), |text| boolean("CompressedData", text))?;
        let encoding = match (is_binary, compressed) {
            (false, _) => Encoding::Text,
            (true, true) => Encoding::Binary(Compression::Zlib),
            (true, false) => Encoding::Binary(Compression::None),
        };
        let name = self.data_file.unwrap_or_default();
        let place = match name {
            "LOCAL" | "Local" | "local" => DataPlace::Here(start),
            "" => return Err(Problem::field("ElementDataFile", quoted(name), "LOCAL or the name of a file")),
            _ => {
                let words: Vec<&str> = name.split_whitespace().collect();
                let stated = if name.starts_with("LIST") { words.get(1) } else { words.get(4) };
                let each = stated.and_then(|word| word.parse().ok()).unwrap_or(sizes.len() - 1);
                let num_parts =
                    sizes.iter().skip(each).fold(1, |parts: u64, &size| parts.saturating_mul(size));
                DataPlace::detached("ElementDataFile", path, name, &self.listed, num_parts)?
            }
        };
        let byte_skip = text::byte_skip("HeaderSize", self.header_size, encoding)?;
        Ok(Data { place, line_skip: 0, byte_skip, encoding })
    }
}

fn required<'a>(field: &str, value: Option<&'a str>) -> Result<&'a str, Problem> {
    value.ok_or_else(|| Problem::missing(field, "it in the header"))
}

/// As in MetaIO the first letter decides; what is neither is refused.
fn boolean(field: &str, text: &str) -> Result<bool, Problem> {
    match text.as_bytes().first().map(u8::to_ascii_lowercase) {
        Some(b't' | b'1') => Ok(true),
        Some(b'f' | b'0') => Ok(false),
        _ => Err(Problem::field(field, quoted(text), "True or False")),
    }
}

fn scalar(name: &str) -> Result<Scalar, Problem> {
    Ok(match name.strip_suffix("_ARRAY").unwrap_or(name) {
        "MET_UCHAR" => Scalar::U8,
        "MET_CHAR" => Scalar::I8,
        "MET_USHORT" => Scalar::U16,
        "MET_SHORT" => Scalar::I16,
        // A long has 4 bytes in MetaIO.
        "MET_UINT" | "MET_ULONG" => Scalar::U32,
        "MET_INT" | "MET_LONG" => Scalar::I32,
        "MET_ULONG_LONG" => Scalar::U64,
        "MET_LONG_LONG" => Scalar::I64,
        "MET_FLOAT" => Scalar::F32,
        "MET_DOUBLE" => Scalar::F64,
        _ => {
            let expected = "MET_UCHAR, MET_SHORT, MET_FLOAT or the like";
            return Err(Problem::field("ElementType", quoted(name), expected));
        }
    })
}
