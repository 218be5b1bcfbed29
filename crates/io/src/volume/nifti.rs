//! NIfTI-1 and NIfTI-2 in a single file, `.nii` and `.nii.gz`, both byte orders.
//!
//! Whether a file is packed says its first bytes. The header is 348 or 540 bytes; samples start at `vox_offset`.
//! Where `scl_slope` and `scl_inter` say so, values become `slope * stored + inter`: in `f32`, or in `f64` where
//! `f32` would not hold the stored type. The fifth dimension holds the components of a vector, the fourth volumes.
//! Orientation is `sform`, else `qform`; the distance of samples is `pixdim`.

use std::io::{self, Read};
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};
use volery_scene::{Sample, SampleType, Samples, for_samples};

use super::Decoded;
use crate::bytes::{Compression, has_more, load, open_stream, read_full, reserve, starts_with};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing};
use crate::numbers::Scalar;
use crate::orientation::Placement;
use crate::raster::{Array, Meaning, Raster, Role};
use crate::volume::ReadOptions;

/// Sizes of the two headers.
const HEADER_BYTES: [usize; 2] = [348, 540];

/// The fields of the header that say how to read the samples, and where they lie.
struct Header {
    order: ByteOrder,
    dims: Vec<u64>,
    datatype: i16,
    intent: i32,
    pixdim: [f64; 4],
    vox_offset: u64,
    /// Slope and intercept, unless they are the identity.
    scaling: Option<[f64; 2]>,
    /// The values to show from black to white, if the header says.
    display_range: Option<[f64; 2]>,
    placement: Option<Placement>,
    num_bytes: usize,
}

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    if starts_with(path, &[0x1f, 0x8b])? {
        return read_gzip(path, options);
    }
    let bytes = load(path)?;
    let mut notes = Vec::new();
    let header = Header::parse(&bytes, &mut notes)?;
    let mut plan = header.plan(options, notes)?;
    let samples = plan.raster.in_file(bytes, header.vox_offset, &mut plan.notes)?;
    plan.finish(samples, &header)
}

fn read_gzip(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let what = Compression::Gzip.stream_name();
    let mut stream = open_stream(path, Compression::Gzip)?;
    let mut head = [0; HEADER_BYTES[1]];
    let damaged = |error| Problem::damaged(what, error);
    let mut came = read_full(&mut *stream, &mut head[..HEADER_BYTES[0]]).map_err(damaged)?;
    if is_second(&head) {
        came += read_full(&mut *stream, &mut head[HEADER_BYTES[0]..]).map_err(damaged)?;
    }
    let mut notes = Vec::new();
    let header = Header::parse(&head[..came], &mut notes)?;
    let mut plan = header.plan(options, notes)?;
    let gap = header.vox_offset - header.num_bytes as u64;
    io::copy(&mut (&mut *stream).take(gap), &mut io::sink()).map_err(damaged)?;
    let samples = plan.raster.in_stream(&mut *stream, what, &mut plan.notes)?;
    has_more(&mut *stream, what)?;
    plan.finish(samples, &header)
}

/// Whether a header starts like one of the second version.
fn is_second(head: &[u8]) -> bool {
    head.starts_with(&[28, 2, 0, 0]) || head.starts_with(&[0, 0, 2, 28])
}

/// Whether these first bytes of a file are a header of either version.
pub(super) fn is_nifti(head: &[u8]) -> bool {
    let magic = if is_second(head) { head.get(4..8) } else { head.get(344..348) };
    matches!(magic, Some(b"n+1\0" | b"n+2\0"))
}

/// What is known before the samples are read.
struct Plan {
    raster: Raster,
    spacing: DVec3,
    scaling: Option<[f64; 2]>,
    notes: Vec<String>,
}

/// Numbers of a header, in its version and byte order.
struct Fields<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
    is_second: bool,
}

impl Fields<'_> {
    fn whole(&self, at: usize, width: usize) -> i64 {
        let number = self.order.unsigned(&self.bytes[at..at + width]);
        // The sign of a shorter number moves to the top and comes back with its copies.
        let shift = 64 - 8 * width as u32;
        (number << shift) as i64 >> shift
    }

    /// A real number of the version's size: `first` and `second` say where it stands in each.
    fn real(&self, [first, second]: [usize; 2], index: usize) -> f64 {
        if self.is_second {
            f64::from_bits(self.whole(second + 8 * index, 8) as u64)
        } else {
            f64::from(f32::from_bits(self.whole(first + 4 * index, 4) as u32))
        }
    }

    /// A code of 2 or 4 bytes.
    fn code(&self, [first, second]: [usize; 2]) -> i32 {
        (if self.is_second { self.whole(second, 4) } else { self.whole(first, 2) }) as i32
    }

    /// By `sform`, or else by `qform`, if either is said to hold.
    fn placement(&self, pixdim: [f64; 4], notes: &mut Vec<String>) -> Option<Placement> {
        if self.code([254, 348]) > 0 {
            let row = |i: usize| [0, 1, 2, 3].map(|j| self.real([280 + 16 * i, 400 + 32 * i], j));
            let rows = [row(0), row(1), row(2)];
            let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
            let axes = DMat3::from_cols(column(0), column(1), column(2));
            note_lengths(axes, pixdim, notes);
            return Some(Placement::anatomical(axes, column(3), DVec3::ONE));
        }
        if self.code([252, 344]) <= 0 {
            return None;
        }
        let [b, c, d] = [0, 1, 2].map(|i| self.real([256, 352], i));
        let real_part = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
        let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, real_part).normalize());
        let hand = if pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let scale = DVec3::new(pixdim[1], pixdim[2], pixdim[3] * hand);
        let origin = DVec3::from_array([0, 1, 2].map(|i| self.real([268, 376], i)));
        Some(Placement::anatomical(rotation * DMat3::from_diagonal(scale), origin, DVec3::ONE))
    }
}

/// Says so where the distances by `pixdim`, which are those along the axes of the samples, are not those of `sform`.
fn note_lengths(axes: DMat3, pixdim: [f64; 4], notes: &mut Vec<String>) {
    let lengths = [0, 1, 2].map(|i| axes.col(i).length());
    let differs = |i: usize| (lengths[i] - pixdim[i + 1].abs()).abs() > 1e-3 * pixdim[i + 1].abs();
    if (0..3).any(differs) {
        let ([x, y, z], [_, i, j, k]) = (lengths, pixdim.map(f64::abs));
        notes.push(format!(
            "voxels are {x} x {y} x {z} by sform, as the world has them, and {i} x {j} x {k} by pixdim"
        ));
    }
}

impl Header {
    fn parse(bytes: &[u8], notes: &mut Vec<String>) -> Result<Self, Problem> {
        let is_second = is_second(bytes);
        let num_bytes = HEADER_BYTES[usize::from(is_second)];
        let Some(bytes) = bytes.get(..num_bytes) else {
            let (found, expected) = (bytes.len() as u64, num_bytes as u64);
            return Err(Problem::Size { what: "the header", found, expected });
        };
        let order = match [bytes[0], bytes[1], bytes[2], bytes[3]] {
            [92, 1, 0, 0] | [28, 2, 0, 0] => ByteOrder::Little,
            [0, 0, 1, 92] | [0, 0, 2, 28] => ByteOrder::Big,
            found => {
                let expected = "348 or 540 as bytes, so NIfTI-1 or NIfTI-2";
                return Err(Problem::field("sizeof_hdr", format!("{found:?}"), expected));
            }
        };
        let (magic, expected): (_, &[u8]) =
            if is_second { (&bytes[4..8], b"n+2\0") } else { (&bytes[344..], b"n+1\0") };
        if magic != expected {
            let (found, expected) = (String::from_utf8_lossy(magic), String::from_utf8_lossy(&expected[..3]));
            let expected = format!("'{expected}', header and samples in a single file");
            return Err(Problem::field("magic", quoted(found), expected));
        }
        let fields = Fields { bytes, order, is_second };
        let pixdim = [0, 1, 2, 3].map(|i| fields.real([76, 104], i));
        let [high, low] = [fields.real([124, 192], 0), fields.real([128, 200], 0)];
        let scaling = [fields.real([112, 176], 0), fields.real([116, 184], 0)];
        Ok(Self {
            order,
            dims: dims(&fields)?,
            datatype: fields.whole(if is_second { 12 } else { 70 }, 2) as i16,
            intent: fields.code([68, 504]),
            pixdim,
            vox_offset: vox_offset(&fields, num_bytes)?,
            scaling: scaling_of(scaling, notes),
            display_range: (low < high && low.is_finite() && high.is_finite()).then_some([low, high]),
            placement: fields.placement(pixdim, notes),
            num_bytes,
        })
    }

    /// What the samples lie in: three dimensions of space, the fourth of volumes, the fifth of components where it
    /// is said to be one, or nothing else is there.
    fn array(&self) -> Result<Array<'_>, Problem> {
        let (scalar, channels) = number_type(self.datatype)?;
        // Codes for vectors, matrices and the like; then those for colours.
        let is_vector = matches!(self.intent, 1002..=1011 | 2003 | 2004);
        let has_components = is_vector || self.dims.get(3) == Some(&1);
        let role = |axis| match axis {
            0..=2 => Role::Space,
            4 if has_components => Role::Channel,
            _ => Role::Volume,
        };
        let mut axes = vec![(channels, Role::Channel)];
        axes.retain(|&(channels, _)| channels > 1);
        axes.extend(self.dims.iter().enumerate().map(|(axis, &size)| (size, role(axis))));
        let is_color = channels > 1 || matches!(self.intent, 2003 | 2004);
        let meaning = if is_color { Meaning::Color } else { Meaning::Components };
        Ok(Array { field: "dim", axes, scalar, order: self.order, meaning })
    }

    fn plan(&self, options: &ReadOptions, mut notes: Vec<String>) -> Result<Plan, Problem> {
        let raster = self.array()?.plan(options, &mut notes)?;
        let layout = raster.layout;
        let mut scaling = self.scaling;
        if scaling.is_some() && layout.sample.channels() > 1 {
            scaling = None;
            notes.push("scl_slope and scl_inter do not apply to colours and are not used".to_owned());
        }
        if let Some([slope, inter]) = scaling.filter(|_| raster.is_magnitude()) {
            if inter != 0.0 {
                notes.push("scl_inter does not apply to a magnitude and is not used".to_owned());
            }
            scaling = Some([slope.abs(), 0.0]);
        }
        if scaling.is_some() {
            // The scaled samples count too; their type is not the caller's concern.
            let any_type = ReadOptions { element: None, ..options.clone() };
            let dims = layout.dims.map(|n| n as u64);
            Layout::new("dim", dims, scaled_type(layout.sample), ByteOrder::NATIVE, &any_type)?;
        }
        let [_, x, y, z] = self.pixdim;
        // The sign of a length says nothing where an orientation does.
        let sizes = if self.placement.is_some() { [x.abs(), y.abs(), z.abs()] } else { [x, y, z] };
        let spacing = checked_spacing("pixdim", sizes, layout.dims, options, &mut notes)?;
        Ok(Plan { raster, spacing, scaling, notes })
    }
}

fn dims(fields: &Fields) -> Result<Vec<u64>, Problem> {
    let dim = |axis: usize| {
        if fields.is_second { fields.whole(16 + 8 * axis, 8) } else { fields.whole(40 + 2 * axis, 2) }
    };
    let rank = dim(0);
    if !(1..=7).contains(&rank) {
        return Err(Problem::field("dim[0]", rank, "1 to 7 dimensions"));
    }
    let size = |axis: usize| match u64::try_from(dim(axis)) {
        // Beyond space many programs write 0 where there is nothing.
        Ok(0) if axis > 3 => Ok(1),
        Ok(size) if size > 0 => Ok(size),
        _ => Err(Problem::field(format!("dim[{axis}]"), dim(axis), "at least 1")),
    };
    (1..=rank as usize).map(size).collect()
}

fn vox_offset(fields: &Fields, header_bytes: usize) -> Result<u64, Problem> {
    let offset = if fields.is_second { fields.whole(168, 8) as f64 } else { fields.real([108, 0], 0) };
    if !(offset >= header_bytes as f64 && offset < 1e15 && offset.fract() == 0.0) {
        let expected = format!("a whole number from {header_bytes} on");
        return Err(Problem::field("vox_offset", offset, expected));
    }
    Ok(offset as u64)
}

impl Plan {
    fn finish(self, samples: Samples, header: &Header) -> Result<Decoded, Problem> {
        let samples = match self.scaling {
            None => samples,
            Some(scaling) => scaled(&samples, scaling)?,
        };
        let Self { raster, spacing, scaling: _, notes } = self;
        let mut decoded = Decoded::new(raster.layout.dims, spacing, samples, notes);
        decoded.choices = raster.choices;
        decoded.placement = header.placement;
        decoded.display_range = header.display_range;
        Ok(decoded)
    }
}

/// The type of a number, and how many make a sample.
fn number_type(datatype: i16) -> Result<(Scalar, u64), Problem> {
    Ok(match datatype {
        2 => (Scalar::U8, 1),
        4 => (Scalar::I16, 1),
        8 => (Scalar::I32, 1),
        16 => (Scalar::F32, 1),
        64 => (Scalar::F64, 1),
        128 => (Scalar::U8, 3),
        256 => (Scalar::I8, 1),
        512 => (Scalar::U16, 1),
        768 => (Scalar::U32, 1),
        1024 => (Scalar::I64, 1),
        1280 => (Scalar::U64, 1),
        2304 => (Scalar::U8, 4),
        _ => {
            let expected =
                "2, 4, 8, 16, 64, 128, 256, 512, 768, 1024, 1280 or 2304 (integers, floats, RGB, RGBA)";
            return Err(Problem::field("datatype", datatype, expected));
        }
    })
}

/// Slope and intercept where they change values. By the standard a slope of 0 means none.
fn scaling_of([slope, inter]: [f64; 2], notes: &mut Vec<String>) -> Option<[f64; 2]> {
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
