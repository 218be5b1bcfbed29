//! Sample values: one flat array of any supported type, owned or mapped.

use std::fmt;
use std::sync::Arc;

/// The type of a sample as it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SampleType {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// IEEE 754, 32 bits.
    F32,
    /// IEEE 754, 64 bits.
    F64,
    /// Red, green, blue, 8 bits each.
    Rgb8,
    /// Red, green, blue, opacity, 8 bits each.
    Rgba8,
}

impl SampleType {
    /// Bytes of one sample, all channels together.
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::Rgb8 => 3,
            Self::U32 | Self::I32 | Self::F32 | Self::Rgba8 => 4,
            Self::F64 => 8,
        }
    }

    /// 1 for scalars, 3 for RGB, 4 for RGBA.
    pub const fn channels(self) -> usize {
        match self {
            Self::Rgb8 => 3,
            Self::Rgba8 => 4,
            _ => 1,
        }
    }

    /// The name used in reports and file headers: `u8`, `f32`, `rgb8`, ...
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::Rgb8 => "rgb8",
            Self::Rgba8 => "rgba8",
        }
    }
}

impl fmt::Display for SampleType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

mod sealed {
    pub trait Sealed {}
}

/// A type that samples can have.
pub trait Sample: sealed::Sealed + Copy + Default + PartialEq + Send + Sync + fmt::Debug + 'static {
    /// Its name at run time.
    const TYPE: SampleType;

    /// The value of one channel (0 for scalars), exactly.
    ///
    /// # Panics
    /// When `channel` is not below [`SampleType::channels`].
    fn channel(self, channel: usize) -> f64;
}

macro_rules! scalar_samples {
    ($($type:ty => $name:ident),*) => {$(
        impl sealed::Sealed for $type {}
        impl Sample for $type {
            const TYPE: SampleType = SampleType::$name;
            #[inline(always)]
            fn channel(self, channel: usize) -> f64 {
                debug_assert_eq!(channel, 0);
                f64::from(self)
            }
        }
    )*};
}
scalar_samples!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, f32 => F32, f64 => F64);

macro_rules! color_samples {
    ($($channels:literal => $name:ident),*) => {$(
        impl sealed::Sealed for [u8; $channels] {}
        impl Sample for [u8; $channels] {
            const TYPE: SampleType = SampleType::$name;
            #[inline(always)]
            fn channel(self, channel: usize) -> f64 {
                f64::from(self[channel])
            }
        }
    )*};
}
color_samples!(3 => Rgb8, 4 => Rgba8);

/// A shared, immutable array of samples: a `Vec`, or anything else that lends a slice, such as a memory
/// map. Clones share the data.
#[derive(Clone)]
pub struct Array<T>(Arc<dyn AsRef<[T]> + Send + Sync>);

impl<T> Array<T> {
    /// Shares `owner`, whose slice must stay the same for its whole life.
    pub fn new(owner: impl AsRef<[T]> + Send + Sync + 'static) -> Self {
        Self(Arc::new(owner))
    }
}

impl<T> std::ops::Deref for Array<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        (*self.0).as_ref()
    }
}

impl<T: Send + Sync + 'static> From<Vec<T>> for Array<T> {
    fn from(values: Vec<T>) -> Self {
        Self::new(values)
    }
}

impl<T> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Array({} samples)", self.len())
    }
}

/// Samples of one of the supported types, x fastest, then y, then z.
#[derive(Clone, Debug)]
pub enum Samples {
    /// Unsigned, 8 bits.
    U8(Array<u8>),
    /// Signed, 8 bits.
    I8(Array<i8>),
    /// Unsigned, 16 bits.
    U16(Array<u16>),
    /// Signed, 16 bits.
    I16(Array<i16>),
    /// Unsigned, 32 bits.
    U32(Array<u32>),
    /// Signed, 32 bits.
    I32(Array<i32>),
    /// IEEE 754, 32 bits.
    F32(Array<f32>),
    /// IEEE 754, 64 bits.
    F64(Array<f64>),
    /// Red, green, blue.
    Rgb8(Array<[u8; 3]>),
    /// Red, green, blue, opacity.
    Rgba8(Array<[u8; 4]>),
}

/// Runs one generic expression for whatever type [`Samples`] hold.
///
/// ```
/// use volery_scene::{Samples, for_samples};
/// let samples = Samples::from(vec![1u16, 2, 3]);
/// let sum: f64 = for_samples!(&samples, |values| values.iter().map(|&v| f64::from(v)).sum(); color _ => f64::NAN);
/// assert_eq!(sum, 6.0);
/// ```
///
/// The form without a `color` arm runs the same expression for RGB and RGBA.
#[macro_export]
macro_rules! for_samples {
    ($samples:expr, |$values:ident| $body:expr; color $other:pat => $color:expr) => {
        match $samples {
            $crate::Samples::U8($values) => $body,
            $crate::Samples::I8($values) => $body,
            $crate::Samples::U16($values) => $body,
            $crate::Samples::I16($values) => $body,
            $crate::Samples::U32($values) => $body,
            $crate::Samples::I32($values) => $body,
            $crate::Samples::F32($values) => $body,
            $crate::Samples::F64($values) => $body,
            $other => $color,
        }
    };
    ($samples:expr, |$values:ident| $body:expr) => {
        match $samples {
            $crate::Samples::U8($values) => $body,
            $crate::Samples::I8($values) => $body,
            $crate::Samples::U16($values) => $body,
            $crate::Samples::I16($values) => $body,
            $crate::Samples::U32($values) => $body,
            $crate::Samples::I32($values) => $body,
            $crate::Samples::F32($values) => $body,
            $crate::Samples::F64($values) => $body,
            $crate::Samples::Rgb8($values) => $body,
            $crate::Samples::Rgba8($values) => $body,
        }
    };
}

macro_rules! samples_from {
    ($($type:ty => $name:ident),*) => {$(
        impl From<Vec<$type>> for Samples {
            fn from(values: Vec<$type>) -> Self {
                Self::$name(values.into())
            }
        }
        impl From<Array<$type>> for Samples {
            fn from(values: Array<$type>) -> Self {
                Self::$name(values)
            }
        }
    )*};
}
samples_from!(u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, f32 => F32, f64 => F64,
    [u8; 3] => Rgb8, [u8; 4] => Rgba8);

impl Samples {
    /// How many samples there are.
    pub fn len(&self) -> usize {
        for_samples!(self, |values| values.len())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type of a sample.
    pub fn sample_type(&self) -> SampleType {
        fn of<T: Sample>(_: &Array<T>) -> SampleType {
            T::TYPE
        }
        for_samples!(self, |values| of(values))
    }

    /// The value of one channel of one sample, exactly.
    ///
    /// # Panics
    /// When `index` or `channel` is out of range.
    pub fn value(&self, index: usize, channel: usize) -> f64 {
        for_samples!(self, |values| values[index].channel(channel))
    }

    /// Smallest and largest finite value of one channel; `None` if there is none.
    ///
    /// # Panics
    /// When `channel` is out of range.
    pub fn range(&self, channel: usize) -> Option<[f64; 2]> {
        fn range<T: Sample>(values: &[T], channel: usize) -> Option<[f64; 2]> {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for value in values {
                let value = value.channel(channel);
                if value.is_finite() {
                    range = [range[0].min(value), range[1].max(value)];
                }
            }
            (range[0] <= range[1]).then_some(range)
        }
        for_samples!(self, |values| range(values, channel))
    }
}
