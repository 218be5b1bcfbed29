//! Packets of 16 rays, and where they enter and leave bricks.

use fearless_simd::{f32x16, f64x8, mask32x16, prelude::*};
use volery_frame::VolumeLayout;
use volery_scene::RayGrid;

use crate::math::axes;
use crate::surfaces::Surfaces;
use crate::target::PACKET;

/// Finest cells per unit length below which a ray stands still along an axis: 1e-18 of a volume of 1e9 cells.
const STILL: f64 = 1e-30;

/// Sixteen f64, one per lane.
type Wide<S> = [f64x8<S>; 2];

/// Rays of four by four pixels, in finest cells: `origin + t * direction`, with `t` in unit lengths.
pub(crate) struct Packet<S: Simd> {
    origin: [Wide<S>; 3],
    direction: [Wide<S>; 3],
    inverse: [Wide<S>; 3],
    /// `direction` and `inverse` in f32, both finite and neither zero.
    narrow_direction: [f32x16<S>; 3],
    narrow_inverse: [f32x16<S>; 3],
    /// Where the rays end, in unit lengths.
    end: Wide<S>,
}

/// What a packet does in one brick.
pub(crate) struct Span<S: Simd> {
    /// Where the rays enter, in cells of the brick from its first sample.
    pub(crate) entry: [f32x16<S>; 3],
    /// Cells of the brick per unit length.
    pub(crate) direction: [f32x16<S>; 3],
    /// `1 / direction`, finite.
    pub(crate) inverse: [f32x16<S>; 3],
    /// Unit lengths from entry to exit; meaningful in `active` lanes.
    pub(crate) length: f32x16<S>,
    /// Lanes that meet the brick.
    pub(crate) active: mask32x16<S>,
}

impl<S: Simd> Packet<S> {
    /// The rays of the packet whose upper left pixel is `(column, row)`, to where surfaces are: of every pixel, or of the
    /// middle ones of squares of `stride` pixels. Pixels outside the picture are as good as others. Rays in the volume's faces run inside of it.
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        (rays, surfaces): (&RayGrid, &Surfaces),
        layout: &VolumeLayout,
        unit_length: f64,
        ([column, row], stride): ([u32; 2], u32),
    ) -> Self {
        let mut origin = [[0.0_f64; 16]; 3];
        let mut direction = [[0.0_f64; 16]; 3];
        let mut end = [f64::INFINITY; 16];
        for lane in 0..16 {
            let [x, y] = [lane % PACKET, lane / PACKET].map(|place| place * stride + stride / 2);
            let [column, row] = [column + x, row + y];
            let ray = rays.pixel(column, row);
            end[lane as usize] = surfaces.distance(column, row) / unit_length;
            let o = ray.origin / layout.spacing;
            let d = ray.direction * (unit_length / layout.spacing);
            for axis in 0..3 {
                let stands = d[axis].abs() < STILL;
                let (cells, spacing) = (f64::from(layout.cells[axis]), layout.spacing[axis]);
                let is_inside = (0.0..=cells * spacing).contains(&ray.origin[axis]);
                let clamped = o[axis].clamp(0.0, cells.next_down());
                origin[axis][lane as usize] = if stands && is_inside { clamped } else { o[axis] };
                // A ray that stands still along an axis creeps, so that 1 / d exists, in f32 too: away from the last
                // face, which rounding may take it to.
                let creep = if o[axis] < cells - 0.5 { STILL } else { -STILL };
                direction[axis][lane as usize] = if stands { creep } else { d[axis] };
            }
        }
        let wide = |values: &[f64; 16]| [0, 8].map(|half| f64x8::from_slice(simd, &values[half..half + 8]));
        let narrow = |values: &[f64; 16]| f32x16::from_slice(simd, &values.map(|x| x as f32));
        let inverse = direction.map(|d| d.map(f64::recip));
        Self {
            origin: [0, 1, 2].map(|axis| wide(&origin[axis])),
            direction: [0, 1, 2].map(|axis| wide(&direction[axis])),
            inverse: [0, 1, 2].map(|axis| wide(&inverse[axis])),
            narrow_direction: [0, 1, 2].map(|axis| narrow(&direction[axis])),
            narrow_inverse: [0, 1, 2].map(|axis| narrow(&inverse[axis])),
            end: wide(&end),
        }
    }

    /// Meets the packet with the box `low..high` in finest cells, whose samples are `2^level` apart. `None`
    /// if no lane among `wanted` has a piece of ray in it. Boxes that share a face share the depth of it, to
    /// the last bit.
    #[inline(always)]
    pub(crate) fn meet(
        &self,
        simd: S,
        [low, high]: [[f64; 3]; 2],
        level: u32,
        wanted: mask32x16<S>,
    ) -> Option<Span<S>> {
        let (near0, far0) = self.depths(simd, 0, low, high);
        let (near1, far1) = self.depths(simd, 1, low, high);
        let near = [near0, near1];
        let length: f32x16<S> = simd.narrow_f64x8(far0 - near0, far1 - near1);
        let active = length.simd_gt(0.0) & wanted;
        if active.all_false() {
            return None;
        }
        let scale = 0.5_f64.powi(level as i32);
        let entry = axes(
            #[inline(always)]
            |axis| {
                let first = self.position(axis, 0, near[0], low[axis]) * scale;
                simd.narrow_f64x8(first, self.position(axis, 1, near[1], low[axis]) * scale)
            },
        );
        let (shrink, grow) = (scale as f32, (1_u64 << level) as f32);
        Some(Span {
            entry,
            direction: axes(
                #[inline(always)]
                |axis| self.narrow_direction[axis] * shrink,
            ),
            inverse: axes(
                #[inline(always)]
                |axis| self.narrow_inverse[axis] * grow,
            ),
            length,
            active,
        })
    }

    /// Where half of the lanes enter and leave a box; they miss it if they enter behind where they leave.
    #[inline(always)]
    fn depths(&self, simd: S, half: usize, low: [f64; 3], high: [f64; 3]) -> (f64x8<S>, f64x8<S>) {
        let [x, y, z] = axes(
            #[inline(always)]
            |axis| {
                let (o, inverse) = (self.origin[axis][half], self.inverse[axis][half]);
                let (a, b) = ((low[axis] - o) * inverse, (high[axis] - o) * inverse);
                (a.min(b), a.max(b))
            },
        );
        (x.0.max(y.0).max(z.0).max(f64x8::splat(simd, 0.0)), x.1.min(y.1).min(z.1).min(self.end[half]))
    }

    /// Finest cells from the plane at `low` to half of the rays at `depth`.
    #[inline(always)]
    fn position(&self, axis: usize, half: usize, depth: f64x8<S>, low: f64) -> f64x8<S> {
        self.direction[axis][half].mul_add(depth, self.origin[axis][half] - low)
    }
}
