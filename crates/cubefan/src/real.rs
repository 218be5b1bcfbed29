//! The two number types that fans are made in.

use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// `f32`, the fast path, or `f64`, the reference path.
pub trait Real:
    sealed::Sealed
    + Copy
    + Debug
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Planes nearer to the eye than this go through it: 2^-60 or 2^-500. Squares of what is left are normal
    /// numbers, so that nothing depends on how a machine treats subnormal ones.
    const TINY: Self;
    /// Coordinates and sides are below this, 2^60 or 2^500, for the same reason.
    const HUGE: Self;

    /// Square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// The smaller of two numbers that are not NaN.
    #[inline]
    #[must_use]
    fn least(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
    /// The larger of two numbers that are not NaN.
    #[inline]
    #[must_use]
    fn most(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

macro_rules! real {
    ($type:ty, $tiny:expr) => {
        impl Real for $type {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const TINY: Self = $tiny;
            const HUGE: Self = 1.0 / $tiny;

            #[inline]
            fn sqrt(self) -> Self {
                self.sqrt()
            }

            #[inline]
            fn abs(self) -> Self {
                self.abs()
            }
        }
    };
}

real!(f32, f32::from_bits((127 - 60) << 23));
real!(f64, f64::from_bits((1023 - 500) << 52));

/// Length of a vector.
#[inline]
pub(crate) fn length<F: Real>(v: [F; 3]) -> F {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}
