//! The field in one cell per lane: trilinear between its corners, along a ray a cubic, mostly nearly a parabola.

use fearless_simd::{f32x16, mask32x16, prelude::*};

use crate::math::{axes, four};

/// A cell's field.
pub(crate) struct Cell<S: Simd> {
    /// At x = 0: the corners (y, z) = (0, 0), (1, 0), (0, 1), (1, 1).
    low: [f32x16<S>; 4],
    /// What x = 1 adds.
    slope: [f32x16<S>; 4],
}

impl<S: Simd> Cell<S> {
    #[inline(always)]
    pub(crate) fn new(corners: [f32x16<S>; 8], texel_origin: f32) -> Self {
        let low = four(
            #[inline(always)]
            |i| corners[2 * i] - texel_origin,
        );
        let slope = four(
            #[inline(always)]
            |i| corners[2 * i + 1] - corners[2 * i],
        );
        Self { low, slope }
    }

    #[inline(always)]
    pub(crate) fn value(&self, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
        let [a, b, c, d] = four(
            #[inline(always)]
            |i| self.slope[i].mul_add(x, self.low[i]),
        );
        let near = (b - a).mul_add(y, a);
        let far = (d - c).mul_add(y, c);
        (far - near).mul_add(z, near)
    }

    /// The field on the straight way from one place in the cell to another, by powers of the share of the way.
    #[inline(always)]
    pub(crate) fn along(&self, from: [f32x16<S>; 3], to: [f32x16<S>; 3]) -> [f32x16<S>; 4] {
        let [dx, dy, dz] = axes(
            #[inline(always)]
            |axis| to[axis] - from[axis],
        );
        let [x, y, z] = from;
        let line = four(
            #[inline(always)]
            |i| [self.slope[i].mul_add(x, self.low[i]), self.slope[i] * dx],
        );
        // A line in y between two lines in x: a parabola; so once more in z.
        let [near, far] = [0, 2].map(
            #[inline(always)]
            |i| {
                let [a, b] = [line[i], line[i + 1]];
                let (start, slope) = (b[0] - a[0], b[1] - a[1]);
                [start.mul_add(y, a[0]), slope.mul_add(y, a[1]) + start * dy, slope * dy]
            },
        );
        let [a, b, c] = axes(
            #[inline(always)]
            |i| far[i] - near[i],
        );
        [a.mul_add(z, near[0]), b.mul_add(z, near[1]) + a * dz, c.mul_add(z, near[2]) + b * dz, c * dz]
    }

    /// The least and the greatest texel.
    #[inline(always)]
    pub(crate) fn range(&self) -> [f32x16<S>; 2] {
        let high = four(
            #[inline(always)]
            |i| self.low[i] + self.slope[i],
        );
        let [a, b, c, d] = four(
            #[inline(always)]
            |i| [self.low[i].min(high[i]), self.low[i].max(high[i])],
        );
        [a[0].min(b[0]).min(c[0].min(d[0])), a[1].max(b[1]).max(c[1].max(d[1]))]
    }

    /// Whether corners differ by more texels.
    #[inline(always)]
    pub(crate) fn is_wider_than(&self, texels: f32) -> mask32x16<S> {
        let [least, greatest] = self.range();
        (greatest - least).simd_gt(texels)
    }

    /// The part of the field that no parabola is: the coefficient of `x y z`.
    #[inline(always)]
    pub(crate) fn twist(&self) -> f32x16<S> {
        let [a, b, c, d] = self.slope;
        (a - b) - (c - d)
    }
}

/// The value for the middle of a cell, so that each of the straight lines to it from the cell's ends has the mean
/// of the field over its half, to second order: a parabola bulges from its chord by a third of what the middle
/// must give. Only where the field runs one way, and never past the ends: no value appears that is not there.
#[inline(always)]
pub(crate) fn balanced<S: Simd>(first: f32x16<S>, middle: f32x16<S>, last: f32x16<S>) -> f32x16<S> {
    let (low, high) = (first.min(last), first.max(last));
    let moved = (middle * 8.0 - first - last) * (1.0 / 6.0);
    let one_way = middle.simd_ge(low) & middle.simd_le(high);
    one_way.select(moved.max(low).min(high), middle)
}

/// How far the two straight lines over a cell's balanced middle are from the field, a parabola, in the mean.
#[inline(always)]
pub(crate) fn mean_distance<S: Simd>(
    simd: S,
    first: f32x16<S>,
    middle: f32x16<S>,
    last: f32x16<S>,
    balanced: f32x16<S>,
) -> f32x16<S> {
    let bend = middle + middle - first - last;
    // A sixth of the bend takes a middle where it is in balance.
    let is_balanced = ((balanced - middle) * 6.0 - bend).abs().simd_le(bend.abs() * 0.01);
    let share = is_balanced.select(f32x16::splat(simd, 4.0 / 81.0), f32x16::splat(simd, 1.0 / 12.0));
    bend.abs() * share
}
