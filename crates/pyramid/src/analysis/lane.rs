//! The numbers that the analysis computes in, and how samples become them.

use volery_scene::Sample;

use super::moments::ColumnMoments;

/// Columns that are worked on together: two AVX-512 registers of `i32`, one of `i16`.
pub(crate) const COLUMNS: usize = 32;

/// A number in which fields are interpolated and compared.
///
/// Integers are kept multiplied by the steps per coarse cell, once per axis interpolated along; `f64` is
/// not, so that it cannot overflow where the samples do not. Powers of two, both are exact while the bits
/// last.
pub(crate) trait Lane: Widen<Self> {
    /// Bits that a difference of two scaled samples may have.
    const BITS: u32;
    /// The weight `steps / 2^log_steps`.
    fn weight(steps: u32, log_steps: u32) -> Self;
    /// A value in the scale of interpolated ones.
    fn whole(self, log_steps: u32) -> Self;
    /// The value half way to another, in the scale of one more halving.
    fn middle(self, other: Self) -> Self;
    /// `self + slope * weight`.
    fn along(self, slope: Self, weight: Self) -> Self;
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
    /// A sum of `2^log_terms` fine samples as their mean, in the scale `2^log_scale`.
    fn mean_of_sum(self, log_terms: u32, log_scale: u32) -> Self;
    /// The larger of `self` and the size of `difference`; NaN loses.
    fn max_abs(self, difference: Self) -> Self;
    /// The value in data units, `2^log_scale` taken out.
    fn unscaled(self, log_scale: u32) -> f64;
}

macro_rules! integer_lane {
    ($($type:ty),*) => {$(
        impl Lane for $type {
            const BITS: u32 = <$type>::BITS - 1;
            #[inline(always)]
            fn weight(steps: u32, _log_steps: u32) -> Self {
                steps as Self
            }
            #[inline(always)]
            fn whole(self, log_steps: u32) -> Self {
                self << log_steps
            }
            #[inline(always)]
            fn middle(self, other: Self) -> Self {
                self + other
            }
            #[inline(always)]
            fn along(self, slope: Self, weight: Self) -> Self {
                self + slope * weight
            }
            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                self + other
            }
            #[inline(always)]
            fn minus(self, other: Self) -> Self {
                self - other
            }
            #[inline(always)]
            fn mean_of_sum(self, log_terms: u32, log_scale: u32) -> Self {
                self << (log_scale - log_terms)
            }
            #[inline(always)]
            fn max_abs(self, difference: Self) -> Self {
                self.max(difference.abs())
            }
            #[inline(always)]
            fn unscaled(self, log_scale: u32) -> f64 {
                f64::from(self) / (1_u64 << log_scale) as f64
            }
        }
    )*};
}
integer_lane!(i16, i32);

impl Lane for f64 {
    const BITS: u32 = u32::MAX;
    #[inline(always)]
    fn weight(steps: u32, log_steps: u32) -> Self {
        f64::from(steps) / (1_u64 << log_steps) as f64
    }
    #[inline(always)]
    fn whole(self, _log_steps: u32) -> Self {
        self
    }
    #[inline(always)]
    fn middle(self, other: Self) -> Self {
        0.5 * self + 0.5 * other
    }
    #[inline(always)]
    fn along(self, slope: Self, weight: Self) -> Self {
        self + slope * weight
    }
    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mean_of_sum(self, log_terms: u32, _log_scale: u32) -> Self {
        self * (1.0 / f64::from(1_u32 << log_terms))
    }
    #[inline(always)]
    fn max_abs(self, difference: Self) -> Self {
        let size = difference.abs();
        if size > self { size } else { self }
    }
    #[inline(always)]
    fn unscaled(self, _log_scale: u32) -> f64 {
        self
    }
}

/// One channel of a sample.
pub(crate) trait Component:
    PartialOrd + ColumnMoments + Widen<Self::Narrow> + Widen<Self::Wide> + Widen<f64>
{
    /// The lane to be tried first, then the next; `f64` is the last.
    type Narrow: Lane;
    type Wide: Lane;
    /// Bits of an integer; of a float, more than any integer lane holds.
    const BITS: u32;
    const MIN: Self;
    const MAX: Self;
    fn is_finite(self) -> bool;
    fn to_f64(self) -> f64;
}

macro_rules! integer_component {
    ($($type:ty: $narrow:ty, $wide:ty;)*) => {$(
        impl Component for $type {
            type Narrow = $narrow;
            type Wide = $wide;
            const BITS: u32 = <$type>::BITS;
            const MIN: Self = <$type>::MIN;
            const MAX: Self = <$type>::MAX;
            #[inline(always)]
            fn is_finite(self) -> bool {
                true
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    )*};
}
integer_component! {
    u8: i16, i32;
    i8: i16, i32;
    u16: i32, i32;
    i16: i32, i32;
    u32: f64, f64;
    i32: f64, f64;
}

macro_rules! float_component {
    ($($type:ty),*) => {$(
        impl Component for $type {
            type Narrow = f64;
            type Wide = f64;
            const BITS: u32 = 64;
            const MIN: Self = <$type>::NEG_INFINITY;
            const MAX: Self = <$type>::INFINITY;
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$type>::is_finite(self)
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    )*};
}
float_component!(f32, f64);

/// A component, or a sum of two, as a lane that holds all of its values.
pub(crate) trait Widen<L>: Copy + Default + Send + Sync + 'static {
    fn widen(self) -> L;
}

macro_rules! widen {
    ($($type:ty),* => $lane:ty) => {$(
        impl Widen<$lane> for $type {
            #[inline(always)]
            fn widen(self) -> $lane {
                <$lane>::from(self)
            }
        }
    )*};
}
widen!(u8, i8, i16 => i16);
widen!(u8, i8, u16, i16, i32 => i32);
widen!(u8, i8, u16, i16, u32, i32, f32, f64 => f64);

/// A sample as the sum of its channels.
pub(crate) trait Voxel: Sample {
    type Component: Component;
    fn component(self, channel: usize) -> Self::Component;
}

macro_rules! scalar_voxel {
    ($($type:ty),*) => {$(
        impl Voxel for $type {
            type Component = $type;
            #[inline(always)]
            fn component(self, _channel: usize) -> $type {
                self
            }
        }
    )*};
}
scalar_voxel!(u8, i8, u16, i16, u32, i32, f32, f64);

impl<const N: usize> Voxel for [u8; N]
where
    [u8; N]: Sample,
{
    type Component = u8;
    #[inline(always)]
    fn component(self, channel: usize) -> u8 {
        self[channel]
    }
}
