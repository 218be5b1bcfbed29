//! Where a box is: its planes, and its planes as the eye sees them.
//!
//! # Neighbours agree
//! A face is toward the eye when the eye is strictly beyond its plane. For boxes along the axes that is a
//! comparison of two numbers, the eye's coordinate and the plane's; the paper's dot products have the same
//! sign but round. Everything a box computes begins with the differences `plane - eye`. A difference of two
//! floating-point numbers is a function of both that is monotone and has the exact sign (subnormal results
//! included), so two boxes that share a plane, of one size or of several, get the same bits for it and agree
//! whether the eye is before, on or behind it: as long as both are *given* the same plane coordinate. Get it
//! from one function of a lattice index, such as `index as f64 * spacing`, or from [`LatticeEye`]; never as
//! `low + size`.
//!
//! A difference below [`Real::TINY`] counts as zero, which is again a function of the plane alone.

use crate::real::Real;

/// A box along the axes, of unequal sides if need be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid<F> {
    /// The planes -x, -y, -z.
    pub low: [F; 3],
    /// The planes +x, +y, +z.
    pub high: [F; 3],
}

/// From where boxes are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint<F> {
    /// All rays start at this point.
    Eye([F; 3]),
    /// All rays come from infinity and go this way, of any length but zero.
    Direction([F; 3]),
}

/// The direction of parallel rays with its largest part at 1; none for no or no moderate direction.
pub(crate) fn way<F: Real>(direction: [F; 3]) -> Option<[F; 3]> {
    let longest = direction.iter().fold(F::ZERO, |longest, part| longest.most(part.abs()));
    let is_moderate = direction.iter().all(|part| part.abs() < F::HUGE);
    let part_of_way = |part: F| {
        let part = part / longest;
        if part.abs() < F::TINY { F::ZERO } else { part }
    };
    (is_moderate && longest >= F::TINY).then(|| direction.map(part_of_way))
}

/// A box whose planes are given relative to some origin, the eye as a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relative<F> {
    /// The planes -x, -y, -z minus the origin.
    pub low: [F; 3],
    /// The planes +x, +y, +z minus the origin.
    pub high: [F; 3],
    /// The sides. From far away they are known better than as a difference of rounded `high` and `low`.
    pub size: [F; 3],
}

impl<F: Real> Relative<F> {
    /// The box as seen from `origin`.
    #[inline]
    pub fn new(cuboid: &Cuboid<F>, origin: [F; 3]) -> Self {
        let Cuboid { low, high } = *cuboid;
        Self {
            low: std::array::from_fn(|axis| low[axis] - origin[axis]),
            high: std::array::from_fn(|axis| high[axis] - origin[axis]),
            size: std::array::from_fn(|axis| high[axis] - low[axis]),
        }
    }

    /// Whether it has sides above zero and only numbers below [`Real::HUGE`].
    #[inline]
    pub(crate) fn is_proper(&self) -> bool {
        let is_moderate = |number: F| number.abs() < F::HUGE;
        let is_proper_across = |axis: usize| {
            let (low, high, size) = (self.low[axis], self.high[axis], self.size[axis]);
            (size > F::ZERO) & is_moderate(size) & is_moderate(low) & is_moderate(high) & (low <= high)
        };
        is_proper_across(0) & is_proper_across(1) & is_proper_across(2)
    }

    /// With planes through the origin where they are all but through it.
    #[inline]
    pub(crate) fn without_tiny(&self) -> Self {
        let settle = |plane: F| if plane.abs() < F::TINY { F::ZERO } else { plane };
        Self { low: self.low.map(settle), high: self.high.map(settle), size: self.size }
    }
}

impl Relative<f64> {
    /// Rounded after the subtraction, which keeps small boxes far from the world's origin apart.
    #[inline]
    pub fn to_f32(self) -> Relative<f32> {
        let round = |numbers: [f64; 3]| numbers.map(|number| number as f32);
        Relative { low: round(self.low), high: round(self.high), size: round(self.size) }
    }
}

/// The eye in lattice coordinates, as whole steps and a fraction: exact signs with nothing but `i32` and
/// `f32`, for shaders.
///
/// A plane is `(f32(index - whole) - fraction) * spacing`. The difference of integers is exact, it is
/// converted by a monotone rounding, exact up to 2^24 steps, and the subtraction rounds once with the exact
/// sign. So planes keep their order, equal indices give equal bits, and a plane is before the eye exactly if
/// its index is below the eye's coordinate `whole + fraction`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeEye {
    /// The lattice plane at or below the eye.
    pub whole: [i32; 3],
    /// How far above it the eye is, in steps, 0 to 1.
    pub fraction: [f32; 3],
    /// World length of a step.
    pub spacing: [f32; 3],
}

impl LatticeEye {
    /// An eye in world coordinates over a lattice whose plane 0 goes through the world's origin. Eyes more than
    /// 2^30 steps away are moved there.
    pub fn new(eye: [f64; 3], spacing: [f64; 3]) -> Self {
        let limit = f64::from(1 << 30);
        let steps: [f64; 3] = std::array::from_fn(|axis| (eye[axis] / spacing[axis]).clamp(-limit, limit));
        Self {
            whole: steps.map(|steps| steps.floor() as i32),
            fraction: steps.map(|steps| (steps - steps.floor()) as f32),
            spacing: spacing.map(|step| step as f32),
        }
    }

    /// A lattice plane across `axis` (0, 1 or 2) relative to the eye.
    #[inline]
    pub fn plane(&self, axis: usize, index: i32) -> f32 {
        (index.saturating_sub(self.whole[axis]) as f32 - self.fraction[axis]) * self.spacing[axis]
    }

    /// The box between lattice planes.
    #[inline]
    pub fn relative(&self, low: [i32; 3], high: [i32; 3]) -> Relative<f32> {
        Relative {
            low: std::array::from_fn(|axis| self.plane(axis, low[axis])),
            high: std::array::from_fn(|axis| self.plane(axis, high[axis])),
            size: std::array::from_fn(|axis| {
                high[axis].saturating_sub(low[axis]) as f32 * self.spacing[axis]
            }),
        }
    }
}
