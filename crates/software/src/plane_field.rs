//! The field of one brick at sixteen places: its samples, and every second of them.

use fearless_simd::{f32x16, i32x16, prelude::*};
use volery_frame::{BlendedBrick, Sampling};

use crate::brick::StoredBrick;
use crate::math::{axes, four};
use crate::texel::Texel;

/// A brick of the frame, ready to be sampled.
pub(crate) struct Field<'a, T> {
    pub(crate) brick: &'a StoredBrick<T>,
    pub(crate) blended: &'a BlendedBrick,
    pub(crate) brick_cells: u32,
    pub(crate) sampling: Sampling,
}

/// Between which two samples of a brick each lane stands along an axis.
struct Interval<S: Simd> {
    lower: f32x16<S>,
    upper: f32x16<S>,
    /// Of the upper one, in [0, 1].
    weight: f32x16<S>,
}

impl<S: Simd> Interval<S> {
    /// `at` is in samples, of which there are `num`, and of which every `step`-th counts, and the last one.
    #[inline(always)]
    fn new(simd: S, at: f32x16<S>, num: u32, step: f32, sampling: Sampling) -> Self {
        let (zero, last) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, (num - 1) as f32));
        let at = at * (1.0 / step);
        let num_cells = ((num - 1) as f32 / step).ceil();
        if sampling == Sampling::Nearest {
            let nearest = ((at + 0.5).floor() * step).max(zero).min(last);
            return Self { lower: nearest, upper: nearest, weight: zero };
        }
        let cell = at.floor().max(zero).min(f32x16::splat(simd, (num_cells - 1.0).max(0.0)));
        let lower = cell * step;
        let weight = (at - cell).max(zero).min(f32x16::splat(simd, 1.0));
        Self { lower, upper: (lower + step).min(last), weight }
    }
}

impl<T: Texel> Field<'_, T> {
    /// The values of `C` channels at places given in cells of the brick from its first sample; not finite where
    /// the field is blank. Places outside of the samples are as good as others.
    #[inline(always)]
    pub(crate) fn values<S: Simd, const C: usize>(&self, simd: S, place: &[f32x16<S>; 3]) -> [f32x16<S>; C] {
        let ratio = self.ratio(simd, place);
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let none = [zero; C];
        let needs_low = self.blended.low_corners != 0 && ratio.simd_gt(zero).any_true();
        let needs_high = !needs_low || ratio.simd_lt(one).any_true();
        let high = if needs_high { self.samples(simd, place, 1.0) } else { none };
        if !needs_low {
            return high;
        }
        let low: [f32x16<S>; C] = self.samples(simd, place, 2.0);
        let mut mixed = none;
        for channel in 0..C {
            let (high, low) = (high[channel], low[channel]);
            let mix = (low - high).mul_add(ratio, high);
            // Blanks of what does not count do not matter.
            mixed[channel] = ratio.simd_ge(one).select(low, ratio.simd_le(zero).select(high, mix));
        }
        mixed
    }

    /// How much of the low samples counts.
    #[expect(
        clippy::redundant_closure,
        reason = "only a closure that is written where it is passed can be inlined so"
    )]
    #[inline(always)]
    fn ratio<S: Simd>(&self, simd: S, place: &[f32x16<S>; 3]) -> f32x16<S> {
        let corner = |i: usize| f32x16::splat(simd, f32::from(self.blended.low_corners >> i & 1));
        if matches!(self.blended.low_corners, 0 | 255) {
            return corner(0);
        }
        let weights = axes(
            #[inline(always)]
            |axis| place[axis] * (1.0 / self.brick_cells as f32),
        );
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(
            #[inline(always)]
            |i| corner(i),
        );
        trilinear(corners, &weights)
    }

    /// Of every `step`-th sample.
    #[inline(always)]
    fn samples<S: Simd, const C: usize>(&self, simd: S, place: &[f32x16<S>; 3], step: f32) -> [f32x16<S>; C] {
        let samples = self.brick.samples;
        let intervals = axes(
            #[inline(always)]
            |axis| Interval::new(simd, place[axis], samples[axis], step, self.sampling),
        );
        let weights = axes(
            #[inline(always)]
            |axis| intervals[axis].weight,
        );
        let num_texels = self.brick.texels.len() / C;
        let is_plain = step == 1.0 && self.sampling == Sampling::Linear && !samples.contains(&1);
        let mut values = [f32x16::splat(simd, 0.0); C];
        for (channel, value) in values.iter_mut().enumerate() {
            let texels = &self.brick.texels[channel * num_texels..][..num_texels];
            let corners = if is_plain {
                cells(simd, texels, samples, &intervals)
            } else {
                gather(simd, texels, samples, &intervals)
            };
            *value = trilinear(corners, &weights);
        }
        values
    }
}

/// Corner `x + 2 y + 4 z` of each lane's cell, where cells lie between neighbouring samples.
#[inline(always)]
fn cells<S: Simd, T: Texel>(
    simd: S,
    texels: &[T],
    samples: [u32; 3],
    intervals: &[Interval<S>; 3],
) -> [f32x16<S>; 8] {
    let [nx, ny, nz] = samples.map(|n| n as usize);
    let (row, slice) = (nx, nx * ny);
    let reach = nz * slice - slice - row;
    let rows = [0, row, slice, slice + row].map(|offset| &texels[offset..offset + reach]);
    let (row, slice) = (f32x16::splat(simd, row as f32), f32x16::splat(simd, slice as f32));
    let [x, y, z] = intervals;
    let address: i32x16<S> = z.lower.mul_add(slice, y.lower.mul_add(row, x.lower)).to_int();
    T::corners(simd, rows, address)
}

/// Corner `x + 2 y + 4 z` of each lane's intervals.
#[inline(always)]
fn gather<S: Simd, T: Texel>(
    simd: S,
    texels: &[T],
    samples: [u32; 3],
    intervals: &[Interval<S>; 3],
) -> [f32x16<S>; 8] {
    let ends = axes(
        #[inline(always)]
        |axis| {
            let ends: [i32x16<S>; 2] = [intervals[axis].lower.to_int(), intervals[axis].upper.to_int()];
            ends.map(
                #[inline(always)]
                |end| -> [i32; 16] { end.into() },
            )
        },
    );
    let [row, slice] = [samples[0] as usize, samples[0] as usize * samples[1] as usize];
    let mut corners = [[0.0_f32; 16]; 8];
    for lane in 0..16 {
        for (corner, values) in corners.iter_mut().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|axis| ends[axis][corner >> axis & 1][lane] as usize);
            values[lane] = texels[z * slice + y * row + x].to_f32();
        }
    }
    corners.map(
        #[inline(always)]
        |values| f32x16::from_slice(simd, &values),
    )
}

#[inline(always)]
fn trilinear<S: Simd>(corners: [f32x16<S>; 8], [x, y, z]: &[f32x16<S>; 3]) -> f32x16<S> {
    let [a, b, c, d] = four(
        #[inline(always)]
        |i| (corners[2 * i + 1] - corners[2 * i]).mul_add(*x, corners[2 * i]),
    );
    let near = (b - a).mul_add(*y, a);
    let far = (d - c).mul_add(*y, c);
    (far - near).mul_add(*z, near)
}
