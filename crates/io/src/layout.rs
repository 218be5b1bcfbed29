//! How samples lie in a file: dims, type, byte order; checked before a byte of them is read.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use serde::Serialize;
use volery_scene::SampleType;

use crate::error::{Problem, quoted};
use crate::volume::ReadOptions;

/// The order of the bytes of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl ByteOrder {
    /// The order of this machine.
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };

    /// Turns scalars of this order into the machine's, in place.
    pub(crate) fn to_native(self, bytes: &mut [u8], sample: SampleType) {
        self.scalars_to_native(bytes, swap_scalars(sample).unwrap_or(1));
    }

    /// The same for scalars of so many bytes.
    pub(crate) fn scalars_to_native(self, bytes: &mut [u8], scalar_bytes: usize) {
        match scalar_bytes {
            _ if self == Self::NATIVE => {}
            2 => reverse_each::<2>(bytes),
            4 => reverse_each::<4>(bytes),
            8 => reverse_each::<8>(bytes),
            _ => {}
        }
    }

    /// An unsigned number of up to eight bytes.
    pub(crate) fn unsigned(self, bytes: &[u8]) -> u64 {
        let add = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, add),
            Self::Big => bytes.iter().fold(0, add),
        }
    }
}

fn reverse_each<const N: usize>(bytes: &mut [u8]) {
    for scalar in bytes.as_chunks_mut::<N>().0 {
        scalar.reverse();
    }
}

/// Bytes of the scalars whose order matters; `None` where a scalar is one byte.
pub(crate) fn swap_scalars(sample: SampleType) -> Option<usize> {
    let scalar = sample.bytes() / sample.channels();
    (scalar > 1).then_some(scalar)
}

/// The type of a sample in a file and its byte order, by its numpy name: `uint8`, `<i2`, `>f4`,
/// `float32`; also `uint16be`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "String")]
pub struct Element {
    /// The type.
    pub sample: SampleType,
    /// The byte order; without meaning for types of one byte.
    pub order: ByteOrder,
}

/// A name that is no known type.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "dtype is {found}, expected one of uint8, int8, uint16, int16, uint32, int32, float32, float64 or >u2 and the like"
)]
pub struct ParseElementError {
    /// The name as given.
    pub found: String,
}

impl FromStr for Element {
    type Err = ParseElementError;

    fn from_str(name: &str) -> Result<Self, ParseElementError> {
        let (order, bare) = if let Some(bare) = name.strip_prefix('>') {
            (ByteOrder::Big, bare)
        } else if let Some(bare) = name.strip_prefix(['<', '|', '=']) {
            (if name.starts_with('=') { ByteOrder::NATIVE } else { ByteOrder::Little }, bare)
        } else if let Some(bare) = name.strip_suffix("be") {
            (ByteOrder::Big, bare)
        } else {
            (ByteOrder::Little, name.strip_suffix("le").unwrap_or(name))
        };
        let sample = match bare {
            "uint8" | "u1" | "uchar" => SampleType::U8,
            "int8" | "i1" => SampleType::I8,
            "uint16" | "u16" | "u2" | "ushort" => SampleType::U16,
            "int16" | "i16" | "i2" | "short" => SampleType::I16,
            "uint32" | "u32" | "u4" => SampleType::U32,
            "int32" | "i32" | "i4" => SampleType::I32,
            "float32" | "f32" | "f4" | "float" => SampleType::F32,
            "float64" | "f64" | "f8" | "double" => SampleType::F64,
            _ => return Err(ParseElementError { found: quoted(name) }),
        };
        Ok(Self { sample, order })
    }
}

impl From<Element> for String {
    fn from(element: Element) -> Self {
        element.to_string()
    }
}

/// The numpy name, `u1` or `>u2`, which [`Element::from_str`] reads.
impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = match (swap_scalars(self.sample), self.order) {
            (None, _) => "",
            (Some(_), ByteOrder::Little) => "<",
            (Some(_), ByteOrder::Big) => ">",
        };
        // Names of ours count bits, those of numpy bytes.
        let name = self.sample.name();
        match name.split_at_checked(1) {
            Some((letter, bits)) if bits.parse::<usize>().is_ok() => {
                write!(f, "{order}{letter}{}", self.sample.bytes())
            }
            _ => f.write_str(name),
        }
    }
}

/// Checked dims, type and byte order: the number of samples and of bytes fit into memory's address range
/// and the caller's limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) dims: [usize; 3],
    pub(crate) sample: SampleType,
    pub(crate) order: ByteOrder,
}

impl Layout {
    /// Checks dims against overflow, the caller's limit and the caller's expectation. `field` names the
    /// dims in errors.
    pub(crate) fn new(
        field: &str,
        dims: [u64; 3],
        sample: SampleType,
        order: ByteOrder,
        options: &ReadOptions,
    ) -> Result<Self, Problem> {
        let shown = || format!("{} x {} x {}", dims[0], dims[1], dims[2]);
        if dims.contains(&0) {
            return Err(Problem::field(field, shown(), "at least 1 sample along each axis"));
        }
        let samples = u128::from(dims[0])
            .checked_mul(dims[1].into())
            .and_then(|plane| plane.checked_mul(dims[2].into()));
        let required = samples.and_then(|samples| samples.checked_mul(sample.bytes() as u128));
        let limit = u128::from(options.max_bytes).min(isize::MAX as u128);
        let Some(required) = required.filter(|&required| required <= limit) else {
            let required = required.unwrap_or(u128::MAX);
            return Err(Problem::TooLarge { required, max: options.max_bytes });
        };
        debug_assert!(required > 0);
        // Each factor is at most the product, which fits.
        let dims = dims.map(|n| n as usize);
        if let Some(expected) = options.dims.filter(|&expected| expected != dims) {
            let [x, y, z] = expected;
            return Err(Problem::field(field, shown(), format!("{x} x {y} x {z} as asked for")));
        }
        if let Some(element) = options.element.filter(|element| element.sample != sample) {
            return Err(Problem::field("sample type", sample, format!("{} as asked for", element.sample)));
        }
        Ok(Self { dims, sample, order })
    }

    pub(crate) fn num_samples(&self) -> usize {
        self.dims.iter().product()
    }

    pub(crate) fn num_bytes(&self) -> u64 {
        (self.num_samples() * self.sample.bytes()) as u64
    }
}

/// The spacing to use: the caller's, else the file's if it is usable. A negative one loses its sign, with
/// a note; that of an axis of one sample does not matter and becomes 1 where it is unusable.
pub(crate) fn checked_spacing(
    field: &str,
    found: [f64; 3],
    dims: [usize; 3],
    options: &ReadOptions,
    notes: &mut Vec<String>,
) -> Result<DVec3, Problem> {
    if let Some(spacing) = options.spacing {
        return Ok(spacing);
    }
    let mut spacing = DVec3::ONE;
    for axis in 0..3 {
        let value = found[axis];
        if value.is_finite() && value != 0.0 {
            spacing[axis] = value.abs();
        } else if dims[axis] > 1 {
            return Err(Problem::field(
                format!("{field} of axis {axis}"),
                value,
                "a finite number other than 0",
            ));
        }
        if value < 0.0 && value.is_finite() {
            notes.push(format!(
                "{field} of axis {axis} is {value}; its size is used, the axis is not mirrored"
            ));
        }
    }
    Ok(spacing)
}

/// Runs an expression with a type alias for the Rust type of a sample type.
macro_rules! for_sample_type {
    ($sample:expr, $alias:ident => $body:expr) => {{
        use volery_scene::SampleType;
        match $sample {
            SampleType::U8 => {
                type $alias = u8;
                $body
            }
            SampleType::I8 => {
                type $alias = i8;
                $body
            }
            SampleType::U16 => {
                type $alias = u16;
                $body
            }
            SampleType::I16 => {
                type $alias = i16;
                $body
            }
            SampleType::U32 => {
                type $alias = u32;
                $body
            }
            SampleType::I32 => {
                type $alias = i32;
                $body
            }
            SampleType::F32 => {
                type $alias = f32;
                $body
            }
            SampleType::F64 => {
                type $alias = f64;
                $body
            }
            SampleType::Rgb8 => {
                type $alias = [u8; 3];
                $body
            }
            SampleType::Rgba8 => {
                type $alias = [u8; 4];
                $body
            }
        }
    }};
}
pub(crate) use for_sample_type;
