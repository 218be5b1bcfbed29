//! NIfTI-1 in a single file, `.nii` and `.nii.gz`, both byte orders.
//!
//! The header is 348 bytes; samples start at `vox_offset`. Where `scl_slope` and `scl_inter` say so, values
//! become `slope * stored + inter`: in `f32`, or in `f64` where `f32` would not hold the stored type. Of a
//! file of more than three dimensions the first volume is read. The affine is not used: a sample's place is
//! its index times `pixdim`.

use std::io::{self, Read};
use std::path::Path;

use volery_scene::{Sample, SampleType, Samples, for_samples};

use super::{Decoded, compression_of_name};
use crate::bytes::{Compression, has_more, load, open_stream, read_full, read_samples, reserve, samples_at};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing, first_volume};
use crate::volume::ReadOptions;

const HEADER_BYTES: usize = 348;

/// The fields of the header that say how to read the samples.
struct Header {
    order: ByteOrder,
    dims: Vec<u64>,
    sample: SampleType,
    pixdim: [f64; 3],
    vox_offset: u64,
    /// Slope and intercept, unless they are the identity.
    scaling: Option<[f64; 2]>,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    if compression_of_name(path) == Compression::Gzip {
        read_gzip(path, options)
    } else {
        let bytes = load(path)?;
        let mut notes = Vec::new();
        let header = Header::parse(&bytes, &mut notes)?;
        let plan = header.plan(options, notes)?;
        let samples = samples_at(bytes, header.vox_offset, &plan.layout)?;
        plan.finish(samples)
    }
}

fn read_gzip(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let what = Compression::Gzip.stream_name();
    let mut stream = open_stream(path, Compression::Gzip)?;
    let mut head = [0; HEADER_BYTES];
    let came = read_full(&mut *stream, &mut head).map_err(|error| Problem::damaged(what, error))?;
    let mut notes = Vec::new();
    let header = Header::parse(&head[..came], &mut notes)?;
    let plan = header.plan(options, notes)?;
    let gap = header.vox_offset - HEADER_BYTES as u64;
    io::copy(&mut (&mut *stream).take(gap), &mut io::sink())
        .map_err(|error| Problem::damaged(what, error))?;
    let samples = read_samples(&mut *stream, what, &plan.layout)?;
    has_more(&mut *stream, what)?;
    plan.finish(samples)
}

/// What is known before the samples are read.
struct Plan {
    layout: Layout,
    spacing: glam::DVec3,
    scaling: Option<[f64; 2]>,
    notes: Vec<String>,
}

impl Header {
    fn parse(bytes: &[u8], notes: &mut Vec<String>) -> Result<Self, Problem> {
        let Some(bytes) = bytes.first_chunk::<HEADER_BYTES>() else {
            let (found, expected) = (bytes.len() as u64, HEADER_BYTES as u64);
            return Err(Problem::Size { what: "the header", found, expected });
        };
        let order = match [bytes[0], bytes[1], bytes[2], bytes[3]] {
            [92, 1, 0, 0] => ByteOrder::Little,
            [0, 0, 1, 92] => ByteOrder::Big,
            found => {
                return Err(Problem::field("sizeof_hdr", format!("{found:?}"), "348 as bytes, so NIfTI-1"));
            }
        };
        let magic = &bytes[344..];
        if magic != b"n+1\0" {
            let found = quoted(String::from_utf8_lossy(magic));
            return Err(Problem::field("magic", found, "'n+1', header and samples in a single file"));
        }
        let short = |at: usize| order.unsigned(&bytes[at..at + 2]) as u16 as i16;
        let float = |at: usize| f64::from(f32::from_bits(order.unsigned(&bytes[at..at + 4]) as u32));
        let rank = short(40);
        if !(1..=7).contains(&rank) {
            return Err(Problem::field("dim[0]", rank, "1 to 7 dimensions"));
        }
        let mut dims = Vec::new();
        for axis in 1..=rank as usize {
            let n = short(40 + 2 * axis);
            let positive = u64::try_from(n).ok().filter(|&n| n > 0);
            dims.push(positive.ok_or_else(|| Problem::field(format!("dim[{axis}]"), n, "at least 1"))?);
        }
        let offset = float(108);
        if !(offset >= HEADER_BYTES as f64 && offset < 1e15 && offset.fract() == 0.0) {
            return Err(Problem::field("vox_offset", offset, "a whole number from 348 on"));
        }
        Ok(Self {
            order,
            dims,
            sample: sample_type(short(70))?,
            pixdim: [float(80), float(84), float(88)],
            vox_offset: offset as u64,
            scaling: scaling([float(112), float(116)], notes),
        })
    }

    fn plan(&self, options: &ReadOptions, mut notes: Vec<String>) -> Result<Plan, Problem> {
        let dims = first_volume("dim", &self.dims, &mut notes)?;
        let layout = Layout::new("dim", dims, self.sample, self.order, options)?;
        let mut scaling = self.scaling;
        if scaling.is_some() && layout.sample.channels() > 1 {
            scaling = None;
            notes.push("scl_slope and scl_inter do not apply to colours and are not used".to_owned());
        }
        if scaling.is_some() {
            // The scaled samples count too; their type is not the caller's concern.
            let any_type = ReadOptions { element: None, ..options.clone() };
            Layout::new("dim", dims, scaled_type(self.sample), ByteOrder::NATIVE, &any_type)?;
        }
        let spacing = checked_spacing("pixdim", self.pixdim, layout.dims, options, &mut notes)?;
        Ok(Plan { layout, spacing, scaling, notes })
    }
}

impl Plan {
    fn finish(self, samples: Samples) -> Result<Decoded, Problem> {
        let samples = match self.scaling {
            None => samples,
            Some(scaling) => scaled(&samples, scaling)?,
        };
        let Self { layout, spacing, scaling: _, notes } = self;
        Ok(Decoded { dims: layout.dims, spacing, samples, array: None, notes })
    }
}

fn sample_type(datatype: i16) -> Result<SampleType, Problem> {
    Ok(match datatype {
        2 => SampleType::U8,
        4 => SampleType::I16,
        8 => SampleType::I32,
        16 => SampleType::F32,
        64 => SampleType::F64,
        128 => SampleType::Rgb8,
        256 => SampleType::I8,
        512 => SampleType::U16,
        768 => SampleType::U32,
        2304 => SampleType::Rgba8,
        _ => {
            let expected =
                "2, 4, 8, 16, 64, 128, 256, 512, 768 or 2304 (integers to 32 bits, floats, RGB, RGBA)";
            return Err(Problem::field("datatype", datatype, expected));
        }
    })
}

/// Slope and intercept where they change values. By the standard a slope of 0 means none.
fn scaling([slope, inter]: [f64; 2], notes: &mut Vec<String>) -> Option<[f64; 2]> {
    if !(slope.is_finite() && inter.is_finite()) {
        notes.push(format!("scl_slope {slope} and scl_inter {inter} are not finite and are not used"));
        return None;
    }
    (slope != 0.0 && [slope, inter] != [1.0, 0.0]).then_some([slope, inter])
}

fn scaled_type(stored: SampleType) -> SampleType {
    match stored {
        SampleType::U32 | SampleType::I32 | SampleType::F64 => SampleType::F64,
        _ => SampleType::F32,
    }
}

fn scaled(samples: &Samples, [slope, inter]: [f64; 2]) -> Result<Samples, Problem> {
    fn apply<S: Sample, T>(stored: &[S], map: impl Fn(f64) -> T) -> Result<Vec<T>, Problem> {
        let mut values = Vec::new();
        reserve(&mut values, stored.len())?;
        values.extend(stored.iter().map(|sample| map(sample.channel(0))));
        Ok(values)
    }
    let map = |stored: f64| slope * stored + inter;
    Ok(if scaled_type(samples.sample_type()) == SampleType::F64 {
        for_samples!(samples, |stored| apply(stored, map)?).into()
    } else {
        for_samples!(samples, |stored| apply(stored, |value| map(value) as f32)?).into()
    })
}
