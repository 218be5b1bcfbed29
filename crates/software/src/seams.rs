//! Seams: samples of a brick that take the values of a coarser neighbour.
//!
//! A cell at a seam's face has four corners in a cell of the coarser level, twice as large; they are interpolated between
//! that cell's corners, which are samples of the brick itself. A cell at a seam's edge has two corners between two
//! samples.

use fearless_simd::{f32x16, i32x16, mask32x16, prelude::*};

use crate::texel::Texel;
use crate::walk::Matter;

/// What of a brick's seams has to be looked at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seams {
    /// Bit `2 axis + side` of faces.
    faces: u32,
    /// Bit `4 axis + s + 2 t` of edges along an axis, at sides `s`, `t` of the next two, that are in no such face.
    edges: u32,
}

/// The two axes after an axis.
const fn next_axes(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

impl Seams {
    /// From a bit for each direction, as [`volery_frame::JoinedBrick`] has them.
    pub(crate) fn new(directions: u32) -> Self {
        let scale = [1, 3, 9];
        let is_seam = |side: [usize; 3]| {
            let direction: usize = (0..3).map(|axis| side[axis] * scale[axis]).sum();
            directions >> direction & 1 == 1
        };
        let (mut faces, mut edges) = (0, 0);
        for axis in 0..3 {
            for side in 0..2 {
                let mut direction = [1; 3];
                direction[axis] = 2 * side;
                faces |= u32::from(is_seam(direction)) << (2 * axis + side);
            }
        }
        for axis in 0..3 {
            let [b, c] = next_axes(axis);
            for sides in 0..4 {
                let [s, t] = [sides & 1, sides >> 1];
                let mut direction = [1; 3];
                (direction[b], direction[c]) = (2 * s, 2 * t);
                let is_in_face = faces >> (2 * b + s) & 1 == 1 || faces >> (2 * c + t) & 1 == 1;
                edges |= u32::from(is_seam(direction) && !is_in_face) << (4 * axis + sides);
            }
        }
        Self { faces, edges }
    }

    #[inline(always)]
    pub(crate) fn are_none(self) -> bool {
        self.faces == 0 && self.edges == 0
    }
}

/// Cells at seams, and the samples around them.
struct Place<'a, 'b, S: Simd, T> {
    simd: S,
    matter: &'a Matter<'b, T>,
    cell: &'a [f32x16<S>; 3],
}

/// The corners of cells, which at seams have other values than the brick's samples.
#[inline(never)]
pub(crate) fn join<S: Simd, T: Texel>(
    simd: S,
    matter: &Matter<'_, T>,
    at: (&[f32x16<S>; 3], mask32x16<S>),
    corners: &[f32x16<S>; 8],
) -> [f32x16<S>; 8] {
    let mut joined = *corners;
    simd.vectorize(
        #[inline(always)]
        || join_all(simd, matter, at, &mut joined),
    );
    joined
}

#[inline(always)]
fn join_all<S: Simd, T: Texel>(
    simd: S,
    matter: &Matter<'_, T>,
    (cell, active): (&[f32x16<S>; 3], mask32x16<S>),
    corners: &mut [f32x16<S>; 8],
) {
    let last = f32x16::splat(simd, (matter.brick_cells - 1) as f32);
    let zero = f32x16::splat(simd, 0.0);
    let place = Place { simd, matter, cell };
    for (axis, cell) in cell.iter().enumerate() {
        for side in 0..2 {
            if matter.seams.faces >> (2 * axis + side) & 1 == 1 {
                let lanes = active & cell.simd_eq(if side == 0 { zero } else { last });
                if lanes.any_true() {
                    place.join_face((axis, side), lanes, corners);
                }
            }
        }
    }
    if matter.seams.edges == 0 {
        return;
    }
    for axis in 0..3 {
        let [b, c] = next_axes(axis);
        for sides in 0..4 {
            if matter.seams.edges >> (4 * axis + sides) & 1 == 1 {
                let at = |axis: usize, side: usize| cell[axis].simd_eq(if side == 0 { zero } else { last });
                let lanes = active & at(b, sides & 1) & at(c, sides >> 1);
                if lanes.any_true() {
                    place.join_edge((axis, sides), lanes, corners);
                }
            }
        }
    }
}

impl<S: Simd, T: Texel> Place<'_, '_, S, T> {
    /// Samples from one to the next along an axis.
    #[inline(always)]
    fn stride(&self, axis: usize) -> f32 {
        let [nx, ny, _] = self.matter.samples;
        [1.0, nx as f32, (nx * ny) as f32][axis]
    }

    /// The even places below and above each cell along an axis, as they add to an address, and the share of the way from
    /// one to the other at which the cell begins.
    #[inline(always)]
    fn around(&self, axis: usize) -> ([f32x16<S>; 2], f32x16<S>) {
        let below = (self.cell[axis] * 0.5).floor() * 2.0;
        let last = f32x16::splat(self.simd, (self.matter.samples[axis] - 1) as f32);
        let above = (below + 2.0).min(last);
        let stride = self.stride(axis);
        ([below * stride, above * stride], (self.cell[axis] - below) * 0.5)
    }

    /// The address of the samples at a side of the brick.
    #[inline(always)]
    fn side(&self, axis: usize, side: usize) -> f32 {
        if side == 0 { 0.0 } else { self.matter.brick_cells as f32 * self.stride(axis) }
    }

    #[inline(always)]
    fn texels(&self, address: f32x16<S>) -> f32x16<S> {
        let at: i32x16<S> = address.to_int();
        let at: [i32; 16] = at.into();
        let mut values = [0.0_f32; 16];
        for (value, at) in values.iter_mut().zip(at) {
            // Lanes that are not at the seam may be anywhere.
            *value = self.matter.texels.get(at as usize).map_or(0.0, |texel| texel.to_f32());
        }
        f32x16::from_slice(self.simd, &values)
    }

    #[inline(always)]
    fn join_face(&self, (axis, side): (usize, usize), lanes: mask32x16<S>, corners: &mut [f32x16<S>; 8]) {
        let [b, c] = next_axes(axis);
        let ([b_low, b_high], b_share) = self.around(b);
        let ([c_low, c_high], c_share) = self.around(c);
        let b_low = b_low + self.side(axis, side);
        let b_high = b_high + self.side(axis, side);
        let near = [self.texels(b_low + c_low), self.texels(b_high + c_low)];
        let far = [self.texels(b_low + c_high), self.texels(b_high + c_high)];
        for step in 0..2 {
            let share = b_share + 0.5 * step as f32;
            let (near, far) = (mix(near, share), mix(far, share));
            for other in 0..2 {
                let value = mix([near, far], c_share + 0.5 * other as f32);
                let corner = side << axis | step << b | other << c;
                corners[corner] = lanes.select(value, corners[corner]);
            }
        }
    }

    #[inline(always)]
    fn join_edge(&self, (axis, sides): (usize, usize), lanes: mask32x16<S>, corners: &mut [f32x16<S>; 8]) {
        let [b, c] = next_axes(axis);
        let ([low, high], share) = self.around(axis);
        let line = self.side(b, sides & 1) + self.side(c, sides >> 1);
        let ends = [self.texels(low + line), self.texels(high + line)];
        for step in 0..2 {
            let corner = step << axis | (sides & 1) << b | (sides >> 1) << c;
            corners[corner] = lanes.select(mix(ends, share + 0.5 * step as f32), corners[corner]);
        }
    }
}

/// Exact at both ends and in the middle, however far apart they are.
#[inline(always)]
fn mix<S: Simd>([a, b]: [f32x16<S>; 2], share: f32x16<S>) -> f32x16<S> {
    b.mul_add(share, a * (1.0 - share))
}
