//! Lists of numbers as files hold them, text or bytes, of which nothing is believed.
//!
//! What a list needs is stored as it comes: a count in a header allocates nothing.

use std::io::Read;
use std::str::FromStr;

use bytemuck::Pod;
use volery_scene::{SampleType, Samples};

use crate::bytes::{read_full, read_samples, reserve};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout};

/// Bytes that are decoded at once.
const PIECE_BYTES: usize = 1 << 16;

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Scalar {
    pub(crate) fn bytes(self) -> u64 {
        for_scalar!(self, T => size_of::<T>() as u64)
    }

    /// The name used in reports: `u8`, `f32`, ...
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    pub(crate) fn is_real(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
}

/// Runs an expression with a type alias for the Rust type of a scalar.
macro_rules! for_scalar {
    ($scalar:expr, $alias:ident => $body:expr) => {
        for_scalar!(@ $scalar, $alias => $body; U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, U64 u64,
            I64 i64, F32 f32, F64 f64)
    };
    (@ $scalar:expr, $alias:ident => $body:expr; $($variant:ident $type:ident),*) => {
        match $scalar {
            $(Scalar::$variant => {
                type $alias = $type;
                $body
            })*
        }
    };
}
use for_scalar;

/// A number of a file as the readers use it.
trait Number: Pod + FromStr {
    fn real(self) -> f64;
    /// `None` where the number does not fit.
    fn whole(self) -> Option<i64>;
}

macro_rules! whole_numbers {
    ($($type:ty),*) => {$(
        impl Number for $type {
            fn real(self) -> f64 {
                self as f64
            }
            fn whole(self) -> Option<i64> {
                i64::try_from(self).ok()
            }
        }
    )*};
}
whole_numbers!(u8, i8, u16, i16, u32, i32, u64, i64);

macro_rules! real_numbers {
    ($($type:ty),*) => {$(
        impl Number for $type {
            fn real(self) -> f64 {
                self.into()
            }
            fn whole(self) -> Option<i64> {
                None
            }
        }
    )*};
}
real_numbers!(f32, f64);

/// The numbers of one array, not read yet.
pub(crate) enum Numbers<'a> {
    /// Separated by white space.
    Text(&'a str),
    /// One after the other.
    Bytes(Box<dyn Read + 'a>, ByteOrder),
}

/// How errors call the numbers of an array.
pub(crate) const DATA: &str = "the data of the array";

impl Numbers<'_> {
    /// Exactly the samples of a layout.
    pub(crate) fn samples(self, layout: &Layout) -> Result<Samples, Problem> {
        let count = layout.num_samples();
        if let Self::Bytes(mut source, _) = self {
            return read_samples(&mut *source, DATA, layout);
        }
        Ok(match layout.sample {
            SampleType::U8 => self.each::<u8, u8>(count, Ok)?.into(),
            SampleType::I8 => self.each::<i8, i8>(count, Ok)?.into(),
            SampleType::U16 => self.each::<u16, u16>(count, Ok)?.into(),
            SampleType::I16 => self.each::<i16, i16>(count, Ok)?.into(),
            SampleType::U32 => self.each::<u32, u32>(count, Ok)?.into(),
            SampleType::I32 => self.each::<i32, i32>(count, Ok)?.into(),
            SampleType::F32 => self.each::<f32, f32>(count, Ok)?.into(),
            SampleType::F64 => self.each::<f64, f64>(count, Ok)?.into(),
            SampleType::Rgb8 => self.each::<u8, u8>(3 * count, Ok)?.as_chunks::<3>().0.to_vec().into(),
            SampleType::Rgba8 => self.each::<u8, u8>(4 * count, Ok)?.as_chunks::<4>().0.to_vec().into(),
        })
    }

    /// Exactly `count` numbers of any type.
    pub(crate) fn reals(self, scalar: Scalar, count: usize) -> Result<Vec<f64>, Problem> {
        for_scalar!(scalar, T => self.each(count, |value: T| Ok(value.real())))
    }

    /// Exactly `count` whole numbers, each by way of `convert`.
    pub(crate) fn wholes<U>(
        self,
        scalar: Scalar,
        count: usize,
        mut convert: impl FnMut(i64) -> Result<U, Problem>,
    ) -> Result<Vec<U>, Problem> {
        let mut values = Vec::new();
        self.visit_wholes(scalar, count, |value| {
            if values.len() == values.capacity() {
                grow(&mut values, count)?;
            }
            values.push(convert(value)?);
            Ok(())
        })?;
        Ok(values)
    }

    /// Exactly `count` whole numbers, one after the other.
    pub(crate) fn visit_wholes(
        self,
        scalar: Scalar,
        count: usize,
        mut visit: impl FnMut(i64) -> Result<(), Problem>,
    ) -> Result<(), Problem> {
        if scalar.is_real() {
            return Err(Problem::field("type of the array", scalar.name(), "whole numbers"));
        }
        let too_large = || Problem::field(DATA, "a number above 2^63", "whole numbers of 63 bits");
        for_scalar!(scalar, T => {
            self.visit(count, |value: T| visit(value.whole().ok_or_else(too_large)?))
        })
    }

    fn each<T: Number, U>(
        self,
        count: usize,
        mut convert: impl FnMut(T) -> Result<U, Problem>,
    ) -> Result<Vec<U>, Problem> {
        let mut values: Vec<U> = Vec::new();
        self.visit(count, |value| {
            if values.len() == values.capacity() {
                grow(&mut values, count)?;
            }
            values.push(convert(value)?);
            Ok(())
        })?;
        Ok(values)
    }

    fn visit<T: Number>(
        self,
        count: usize,
        visit: impl FnMut(T) -> Result<(), Problem>,
    ) -> Result<(), Problem> {
        match self {
            Self::Text(text) => parse_each(text, count, visit),
            Self::Bytes(mut source, order) => read_each(&mut *source, order, count, visit),
        }
    }
}

/// Doubles a list, but never past what is asked for.
fn grow<U>(values: &mut Vec<U>, count: usize) -> Result<(), Problem> {
    let more = values.len().max(PIECE_BYTES / size_of::<U>());
    reserve(values, more.min(count - values.len()))
}

fn read_each<T: Number>(
    source: &mut dyn Read,
    order: ByteOrder,
    count: usize,
    mut visit: impl FnMut(T) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let mut piece = vec![T::zeroed(); count.min(PIECE_BYTES / size_of::<T>())];
    let mut done = 0;
    while done < count {
        let length = piece.len().min(count - done);
        let bytes = bytemuck::cast_slice_mut(&mut piece[..length]);
        let came = read_full(source, bytes).map_err(|error| Problem::damaged(DATA, error))?;
        if came < bytes.len() {
            let bytes_of = |numbers: usize| numbers as u64 * size_of::<T>() as u64;
            let found = bytes_of(done) + came as u64;
            return Err(Problem::Size { what: DATA, found, expected: bytes_of(count) });
        }
        order.scalars_to_native(bytes, size_of::<T>());
        piece[..length].iter().try_for_each(|&value| visit(value))?;
        done += length;
    }
    Ok(())
}

fn parse_each<T: Number>(
    text: &str,
    count: usize,
    mut visit: impl FnMut(T) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let mut done = 0;
    for word in text.split_ascii_whitespace() {
        if done == count {
            return Err(Problem::field("count of numbers in the array", "more", count));
        }
        visit(word.parse().map_err(|_| Problem::field(DATA, quoted(word), "a number of its type"))?)?;
        done += 1;
    }
    if done < count {
        return Err(Problem::field("count of numbers in the array", done, count));
    }
    Ok(())
}
