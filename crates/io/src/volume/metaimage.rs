//! MetaImage: `.mha` with its data, `.mhd` with the data in a file beside it; raw and zlib.
//!
//! Spacing is `ElementSpacing`, else `ElementSize`; offset and orientation are not used. Three or four
//! channels of bytes are RGB or RGBA. Of four dimensions the first volume is read.

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
    rank: Option<&'a str>,
    dims: Option<&'a str>,
    sample: Option<&'a str>,
    channels: Option<&'a str>,
    spacing: Option<&'a str>,
    size: Option<&'a str>,
    binary: Option<&'a str>,
    big_endian: Option<&'a str>,
    compressed: Option<&'a str>,
    header_size: Option<&'a str>,
    data_file: Option<&'a str>,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let mut notes = Vec::new();
    let mut lines = Lines::new(&bytes);
    let fields = Fields::parse(&mut lines)?;
    let data = fields.data(path, lines.position as u64)?;
    let layout = fields.layout(options, &mut notes)?;
    let spacing = fields.spacing(&layout, options, &mut notes)?;
    let samples = data.read(bytes, &layout, &mut notes)?;
    Ok(Decoded { dims: layout.dims, spacing, samples, array: None, notes })
}

impl<'a> Fields<'a> {
    fn parse(lines: &mut Lines<'a>) -> Result<Self, Problem> {
        let mut fields = Self::default();
        while let Some(line) = lines.next()? {
            let Some((name, value)) = line.split_once('=') else {
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
                "BinaryDataByteOrderMSB" | "ElementByteOrderMSB" => &mut fields.big_endian,
                "CompressedData" => &mut fields.compressed,
                "HeaderSize" => &mut fields.header_size,
                "ElementDataFile" => &mut fields.data_file,
                _ => continue,
            };
            *field = Some(value.trim());
            if fields.data_file.is_some() {
                return Ok(fields);
            }
        }
        Err(Problem::missing("ElementDataFile", "LOCAL or the name of the data file"))
    }

    fn layout(&self, options: &ReadOptions, notes: &mut Vec<String>) -> Result<Layout, Problem> {
        let required = |field: &str, value: Option<&'a str>| {
            value.ok_or_else(|| Problem::missing(field, "it in the header"))
        };
        let rank: usize = number("NDims", required("NDims", self.rank)?, "1 to 10")?;
        let sizes: Vec<u64> = numbers("DimSize", required("DimSize", self.dims)?, "whole numbers")?;
        if sizes.len() != rank || !(1..=10).contains(&rank) {
            return Err(Problem::field(
                "DimSize",
                format!("{sizes:?}"),
                format!("{rank} of 1 to 10 numbers"),
            ));
        }
        let channels =
            self.channels.map_or(Ok(1), |text| number("ElementNumberOfChannels", text, "1, 3 or 4"))?;
        let sample = match (sample_type(required("ElementType", self.sample)?)?, channels) {
            (sample, 1_u32) => sample,
            (SampleType::U8, 3) => SampleType::Rgb8,
            (SampleType::U8, 4) => SampleType::Rgba8,
            (sample, found) => {
                let found = format!("{found} of {sample}");
                return Err(Problem::field("ElementNumberOfChannels", found, "1, or 3 or 4 of MET_UCHAR"));
            }
        };
        let big = self.big_endian.map(|text| boolean("BinaryDataByteOrderMSB", text)).transpose()?;
        let order = big.map(|big| if big { ByteOrder::Big } else { ByteOrder::Little });
        let order = byte_order("BinaryDataByteOrderMSB", order, swap_scalars(sample))?;
        Layout::new("DimSize", first_volume("DimSize", &sizes, notes)?, sample, order, options)
    }

    fn spacing(
        &self,
        layout: &Layout,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<glam::DVec3, Problem> {
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

    fn data(&self, path: &Path, start: u64) -> Result<Data, Problem> {
        if let Some(text) = self.binary
            && !boolean("BinaryData", text)?
        {
            return Err(Problem::field("BinaryData", quoted(text), "True"));
        }
        let compressed = self.compressed.map_or(Ok(false), |text| boolean("CompressedData", text))?;
        let name = self.data_file.unwrap_or_default();
        let file = match name {
            "LOCAL" | "Local" | "local" => None,
            _ if name.is_empty() || name.starts_with("LIST") || name.contains('%') => {
                return Err(Problem::field("ElementDataFile", quoted(name), "LOCAL or the name of one file"));
            }
            _ => Some(Data::detached(path, name)),
        };
        let compression = if compressed { Compression::Zlib } else { Compression::None };
        let start = if file.is_some() { 0 } else { start };
        let skip = Data::skip("HeaderSize", self.header_size, start, compression)?;
        Ok(Data { file, skip, compression })
    }
}

fn boolean(field: &str, text: &str) -> Result<bool, Problem> {
    match text.to_ascii_lowercase().as_str() {
        "true" | "1" => Ok(true),
        "false" | "0" => Ok(false),
        _ => Err(Problem::field(field, quoted(text), "True or False")),
    }
}

fn sample_type(name: &str) -> Result<SampleType, Problem> {
    Ok(match name {
        "MET_UCHAR" => SampleType::U8,
        "MET_CHAR" => SampleType::I8,
        "MET_USHORT" => SampleType::U16,
        "MET_SHORT" => SampleType::I16,
        "MET_UINT" => SampleType::U32,
        "MET_INT" => SampleType::I32,
        "MET_FLOAT" => SampleType::F32,
        "MET_DOUBLE" => SampleType::F64,
        _ => {
            return Err(Problem::field(
                "ElementType",
                quoted(name),
                "MET_UCHAR, MET_SHORT, MET_FLOAT or the like",
            ));
        }
    })
}
