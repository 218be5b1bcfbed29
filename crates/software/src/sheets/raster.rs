//! Triangles to fragments: which pixels of a tile a triangle covers, and what is there.
//!
//! # Method
//! With vertices as homogeneous vectors `a, b, c`, the ray of pixel `(x, y)` meets the triangle at the weights
//! `(b x c) . (x, y, 1)`, and so on in turn, each over their sum; it does so before the eye where all have the sign of
//! `a . (b x c)`. That holds for triangles across the plane of the eye as for all others (Olano and Greer 1997).
//! Weights are exact in perspective: what is linear on the triangle is a ratio of what is linear on the screen.
//!
//! # Sides
//! `b x c` in f64 is minus `c x b` to the last bit, and so is what is made of it, relative to the middle of the tile
//! and in f32, at every pixel. So of two triangles at a shared side one has the pixel that the other has not. A pixel
//! on the side belongs to the triangle whose side rises to the right, or else downward.

use fearless_simd::{f32x16, i32x16, prelude::*};

use super::view::Vertex;
use crate::math::axes;
use crate::target::TILE;

/// Fragments that are shaded together.
const BATCH: usize = 512;

/// Which of a fragment's numbers is the thickness.
pub(super) const THICKNESS: usize = 1;

/// What the number of a pixel is greater by where a fragment is of a strip.
pub(super) const STRIP: i32 = (TILE * TILE) as i32;

/// Room for a batch and what one packet adds.
pub(super) const ROOM: usize = BATCH + 16;

/// Pixels from the first of a tile to its middle.
const MIDDLE: f32 = (TILE / 2) as f32;

/// Fragments in the order in which light meets them, each with `N` numbers: the value, the thickness of the sheet,
/// and of gradients the magnitude and the direction.
pub(super) struct Fragments<const N: usize> {
    pub(super) len: usize,
    /// Pixels in the tile; of strips plus [`STRIP`].
    pub(super) pixels: [i32; ROOM],
    pub(super) attributes: [[f32; ROOM]; N],
}

impl<const N: usize> Fragments<N> {
    pub(super) fn new() -> Self {
        Self { len: 0, pixels: [0; ROOM], attributes: [[0.0; ROOM]; N] }
    }

    #[inline(always)]
    pub(super) fn is_full(&self) -> bool {
        self.len >= BATCH
    }
}

/// What is not negative on the inner side of a side: `dx * x + dy * y + at_middle`, from the middle of the tile.
#[derive(Clone, Copy)]
struct Side {
    dx: f32,
    dy: f32,
    at_middle: f32,
    /// What it must reach: 0 where the triangle has what lies on the side, else the least number above.
    least: f32,
}

impl Side {
    #[inline(always)]
    fn new([dx, dy, at_origin]: [f64; 3], middle: [f64; 2]) -> Self {
        let at_middle = dx * middle[0] + dy * middle[1] + at_origin;
        // No branches: which way a side goes is as good as random.
        let is_upright = (dx == 0.0) & ((dy > 0.0) | ((dy == 0.0) & (at_middle >= 0.0)));
        let has_side = (dx > 0.0) | is_upright;
        let least = if has_side { 0.0 } else { f32::from_bits(1) };
        Self { dx: dx as f32, dy: dy as f32, at_middle: at_middle as f32, least }
    }
}

impl Side {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, [x, y]: [f32x16<S>; 2]) -> f32x16<S> {
        let at_row = y.mul_add(f32x16::splat(simd, self.dy), f32x16::splat(simd, self.at_middle));
        x.mul_add(f32x16::splat(simd, self.dx), at_row)
    }
}

/// How sixteen pixels lie together: as fits the width of a triangle.
pub(super) struct Packet {
    /// Pixels along x and y.
    pub(super) size: [u32; 2],
    /// From the first pixel along x and y.
    places: [[f32; 16]; 2],
    /// The same in numbers of pixels of a tile.
    pixels: [i32; 16],
}

impl Packet {
    const fn new(columns: usize) -> Self {
        let (mut places, mut pixels, mut lane) = ([[0.0; 16]; 2], [0; 16], 0);
        while lane < 16 {
            let (x, y) = (lane % columns, lane / columns);
            (places[0][lane], places[1][lane]) = (x as f32, y as f32);
            pixels[lane] = (y * TILE as usize + x) as i32;
            lane += 1;
        }
        Self { size: [columns as u32, 16 / columns as u32], places, pixels }
    }

    /// The one for a triangle of so many pixels along x.
    #[inline(always)]
    pub(super) fn of_width(width: u32) -> &'static Self {
        const PACKETS: [Packet; 3] = [Packet::new(4), Packet::new(8), Packet::new(16)];
        &PACKETS[usize::from(width > 4) + usize::from(width > 8)]
    }
}

/// A triangle as a tile sees it.
pub(super) struct Triangle<const N: usize> {
    /// Opposite of each vertex.
    sides: [Side; 3],
    /// Of parallel rays, what lies before the plane of the eye, if the triangle crosses it.
    near: Option<Side>,
    /// At the first vertex, and what the others have more.
    attributes: [[f32; 3]; N],
    /// The number of the tile's first pixel.
    first_pixel: i32,
}

#[inline(always)]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

impl<const N: usize> Triangle<N> {
    /// `attributes` by vertex; `first` pixel of the tile. None if the eye sees it from its side.
    #[inline(always)]
    pub(super) fn new(
        [a, b, c]: [&Vertex; 3],
        attributes: [[f32; N]; 3],
        first: [u32; 2],
        (is_perspective, is_strip): (bool, bool),
    ) -> Option<Self> {
        let normals = [cross(b.place, c.place), cross(c.place, a.place), cross(a.place, b.place)];
        let facing = a.place[0] * normals[0][0] + a.place[1] * normals[0][1] + a.place[2] * normals[0][2];
        let sign = if facing > 0.0 { 1.0 } else { -1.0 };
        if facing == 0.0 || !facing.is_finite() {
            return None;
        }
        let normals = axes(
            #[inline(always)]
            |i| [sign * normals[i][0], sign * normals[i][1], sign * normals[i][2]],
        );
        let middle = f64::from(MIDDLE);
        let middle = [f64::from(first[0]) + middle, f64::from(first[1]) + middle];
        let depths = [a.depth, b.depth, c.depth];
        let is_cut = !is_perspective && depths.iter().any(|&depth| depth < 0.0);
        let near = is_cut.then(|| {
            let depth = [0, 1, 2].map(|i| (0..3).map(|k| f64::from(depths[k]) * normals[k][i]).sum());
            Side { least: 0.0, ..Side::new(depth, middle) }
        });
        let mut by_attribute = [[0.0; 3]; N];
        for (i, numbers) in by_attribute.iter_mut().enumerate() {
            let [a, b, c] = [attributes[0][i], attributes[1][i], attributes[2][i]];
            *numbers = [a, b - a, c - a];
        }
        let sides =
            [Side::new(normals[0], middle), Side::new(normals[1], middle), Side::new(normals[2], middle)];
        let first_pixel = if is_strip { STRIP } else { 0 };
        Some(Self { sides, near, attributes: by_attribute, first_pixel })
    }

    /// Adds the fragments of a packet that begins at a pixel of the tile, none of them beyond the pixel `last`.
    #[inline(always)]
    pub(super) fn add<S: Simd>(
        &self,
        simd: S,
        packet: &Packet,
        first: [u32; 2],
        last: [u8; 2],
        fragments: &mut Fragments<N>,
    ) {
        let x = f32x16::from_slice(simd, &packet.places[0]) + (first[0] as f32 - MIDDLE);
        let y = f32x16::from_slice(simd, &packet.places[1]) + (first[1] as f32 - MIDDLE);
        let [a, b, c] = axes(
            #[inline(always)]
            |i| self.sides[i].at(simd, [x, y]),
        );
        let mut inside = a.simd_ge(self.sides[0].least)
            & b.simd_ge(self.sides[1].least)
            & c.simd_ge(self.sides[2].least)
            & x.simd_le(f32::from(last[0]) - MIDDLE)
            & y.simd_le(f32::from(last[1]) - MIDDLE);
        if let Some(near) = self.near {
            inside &= near.at(simd, [x, y]).simd_ge(0.0);
        }
        let count = inside.to_bitmask().count_ones() as usize;
        if count == 0 {
            return;
        }
        let per_sum = 1.0 / (a + b + c).max(f32x16::splat(simd, f32::MIN_POSITIVE));
        let (b, c) = (b * per_sum, c * per_sum);
        let at = fragments.len;
        for (to, [first, second, third]) in fragments.attributes.iter_mut().zip(self.attributes) {
            let sum = b.mul_add(f32x16::splat(simd, second), f32x16::splat(simd, first));
            let sum = c.mul_add(f32x16::splat(simd, third), sum);
            sum.compress(inside).store_slice(&mut to[at..at + 16]);
        }
        let pixels = i32x16::from_slice(simd, &packet.pixels)
            + (self.first_pixel + (first[1] * TILE + first[0]) as i32);
        pixels.compress(inside).store_slice(&mut fragments.pixels[at..at + 16]);
        fragments.len += count;
    }
}
