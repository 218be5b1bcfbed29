//! Lists of numbers as files hold them, text or bytes, of which nothing is believed.
//!
//! What a list needs is stored as it comes: a count in a header allocates nothing.

use std::io::Read;
use std::str::FromStr;

use bytemuck::Pod;
use volery_scene::SampleType;

use crate::bytes::{read_full, reserve};
use crate::error::{Problem, quoted};
use crate::layout::ByteOrder;

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

    /// The type of a sample that holds such a number, whole ones of 64 bits up to 2^53 exactly.
    pub(crate) fn sample_type(self) -> SampleType {
        match self {
            Self::U8 => SampleType::U8,
            Self::I8 => SampleType::I8,
            Self::U16 => SampleType::U16,
            Self::I16 => SampleType::I16,
            Self::U32 => SampleType::U32,
            Self::I32 => SampleType::I32,
            Self::F32 => SampleType::F32,
            Self::F64 | Self::U64 | Self::I64 => SampleType::F64,
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
            $($crate::numbers::Scalar::$variant => {
                type $alias = $type;
                $body
            })*
        }
    };
}
pub(crate) use for_scalar;

/// A number of a file as the readers use it.
pub(crate) trait Number: Pod + FromStr {
    fn real(self) -> f64;
    /// `None` where the number does not fit.
    fn whole(self) -> Option<i64>;
    /// What a word stands for by which some programs write what is no number: `-nan(ind)`, `1.#QNAN`, `1.#INF`.
    fn blank(_word: &str) -> Option<Self> {
        None
    }
    /// The lowest byte of a whole number after a shift; 0 of a real one.
    fn byte(self, shift: u32) -> u8;
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
            fn byte(self, shift: u32) -> u8 {
                (self as u64 >> shift) as u8
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
            fn blank(word: &str) -> Option<Self> {
                let word = word.trim_start_matches(['+', '-']).to_ascii_lowercase();
                (word.starts_with("nan") || word.starts_with("1.#")).then_some(<$type>::NAN)
            }
            fn byte(self, _shift: u32) -> u8 {
                0
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

    /// Whether tuples of so many numbers differ from the first of them, which `seen` keeps from list to list; reads
    /// no further than it must.
    pub(crate) fn vary(
        self,
        scalar: Scalar,
        count: usize,
        components: usize,
        seen: &mut Vec<f64>,
    ) -> Result<bool, Problem> {
        // Text says only at its end how many numbers it holds; of bytes that is known.
        let is_text = matches!(self, Self::Text(_));
        let (mut differs, mut component) = (false, 0);
        let mut look = |value: f64| {
            if seen.len() == component {
                seen.push(value);
            }
            // A value that is blank differs from none.
            differs |= value.is_finite() && seen[component].is_finite() && value != seen[component];
            if value.is_finite() && !seen[component].is_finite() {
                seen[component] = value;
            }
            component = (component + 1) % components.max(1);
            // Ends the walk.
            if differs && !is_text { Err(Problem::missing("reason to read on", "none")) } else { Ok(()) }
        };
        let walked = for_scalar!(scalar, T => self.visit(count, |value: T| look(value.real())));
        if differs && !is_text { Ok(true) } else { walked.map(|()| differs) }
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

    /// Exactly `count` numbers of one type, one after the other.
    pub(crate) fn visit<T: Number>(
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
        let number = word.parse().ok().or_else(|| T::blank(word));
        visit(number.ok_or_else(|| Problem::field(DATA, quoted(word), "a number of its type"))?)?;
        done += 1;
    }
    if done < count {
        return Err(Problem::field("count of numbers in the array", done, count));
    }
    Ok(())
}
