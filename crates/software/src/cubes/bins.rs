//! Which packets of pixels each cube can show in, and the cubes of each tile.
//!
//! # Method
//! Cubes are taken in chunks, each by one thread, and in a chunk sixteen at a time: the screen rectangle of a cube's
//! eight corners, widened by a bound on the rounding of f32, and by nothing else. A cube whose rectangle has no pixel's
//! centre in it is done with. Of cubes across the plane of the eye, which have no such rectangle, those beyond one of
//! the four sides of the picture's pyramid are left out, and what remains, a few around the eye, may show anywhere.
//!
//! A counting sort puts a chunk's cubes in order of tiles and leaves their own order alone, so lists do not depend on
//! threads.

use std::ops::Range;

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use rayon::prelude::*;
use volery_frame::{Cube, VolumeLayout};

use super::view::View;
use crate::math::axes;
use crate::target::{PACKET, TILE, TILE_PACKETS};

/// A chunk has at least so many cubes, and at least as many as there are tiles, so that lists of empty tiles do not
/// outweigh the cubes.
const MIN_CHUNK: usize = 1 << 15;

/// What a sum of coordinates may be off by in f32, relative to the largest of them.
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;

/// A cube in a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Entry {
    /// Its place in the chunk.
    pub(super) cube: u32,
    /// First and last packet of the tile along x and y.
    first: [u8; 2],
    last: [u8; 2],
}

impl Entry {
    /// The packets as bits, one row of packets after the other.
    #[inline(always)]
    pub(super) fn packets(&self) -> u64 {
        let ones = |first: u8, last: u8, stride: u32| {
            (first..=last).fold(0, |bits, i| bits | 1_u64 << (u32::from(i) * stride))
        };
        // No carry: rows are 8 bits apart and 8 bits long.
        ones(self.first[1], self.last[1], TILE_PACKETS) * ones(self.first[0], self.last[0], 1)
    }

    /// First and last pixel, of a tile that begins at the pixel `tile`.
    #[inline]
    pub(super) fn pixels(&self, tile: [i64; 2]) -> [[i64; 2]; 2] {
        let packet = i64::from(PACKET);
        [
            std::array::from_fn(|axis| tile[axis] + i64::from(self.first[axis]) * packet),
            std::array::from_fn(|axis| tile[axis] + (i64::from(self.last[axis]) + 1) * packet - 1),
        ]
    }
}

/// A chunk's cubes by tile.
struct Chunk {
    /// Those of one tile after those of another.
    entries: Vec<Entry>,
    /// Where each tile's begin, and the end.
    starts: Vec<u32>,
}

impl Chunk {
    fn of_tile(&self, tile: u32) -> &[Entry] {
        &self.entries[self.starts[tile as usize] as usize..self.starts[tile as usize + 1] as usize]
    }
}

/// All cubes by tile.
pub(super) struct Bins {
    chunks: Vec<Chunk>,
    chunk_len: usize,
}

impl Bins {
    pub(super) fn new(level: Level, cubes: &[Cube], layout: &VolumeLayout, view: &View) -> Self {
        let columns = view.size[0].div_ceil(TILE);
        let num_tiles = columns as usize * view.size[1].div_ceil(TILE) as usize;
        let chunk_len = MIN_CHUNK.max(num_tiles);
        let projector = Projector::new(view, layout);
        let chunks = cubes
            .par_chunks(chunk_len)
            .map(|cubes| {
                let footprints = dispatch!(level, simd => projector.footprints(simd, view, layout, cubes));
                sorted(&footprints, columns, num_tiles)
            })
            .collect();
        Self { chunks, chunk_len }
    }

    /// Whether nothing shows in a tile.
    pub(super) fn is_empty(&self, tile: u32) -> bool {
        self.chunks.iter().all(|chunk| chunk.of_tile(tile).is_empty())
    }

    /// The chunks from the front: their cubes, and their entries in a tile, which are back to front.
    #[inline(always)]
    pub(super) fn front_to_back<'a>(
        &'a self,
        cubes: &'a [Cube],
        tile: u32,
    ) -> impl Iterator<Item = (&'a [Cube], &'a [Entry])> {
        cubes
            .chunks(self.chunk_len)
            .zip(&self.chunks)
            .rev()
            .map(move |(cubes, chunk)| (cubes, chunk.of_tile(tile)))
    }
}

/// First and last pixel along x and y; none if the first is after the last.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    first: [u16; 2],
    last: [u16; 2],
}

impl Footprint {
    const NONE: Self = Self { first: [1; 2], last: [0; 2] };

    /// First and last along an axis, in pieces of so many pixels.
    #[inline]
    fn pieces(&self, axis: usize, pixels: u32) -> Range<u32> {
        if self.first[axis] > self.last[axis] {
            return 0..0;
        }
        u32::from(self.first[axis]) / pixels..u32::from(self.last[axis]) / pixels + 1
    }

    #[inline]
    fn each_tile(&self, columns: u32, mut take: impl FnMut(usize, [u32; 2])) {
        for y in self.pieces(1, TILE) {
            for x in self.pieces(0, TILE) {
                take((y * columns + x) as usize, [x, y]);
            }
        }
    }
}

/// Footprints by tile.
fn sorted(footprints: &[Footprint], columns: u32, num_tiles: usize) -> Chunk {
    let mut starts = vec![0_u32; num_tiles + 1];
    for footprint in footprints {
        footprint.each_tile(columns, |tile, _| starts[tile + 1] += 1);
    }
    for tile in 0..num_tiles {
        starts[tile + 1] += starts[tile];
    }
    let mut entries = vec![Entry::default(); starts[num_tiles] as usize];
    let mut next = starts.clone();
    for (cube, footprint) in (0..).zip(footprints) {
        footprint.each_tile(columns, |tile, place| {
            let in_tile = |pixel: u16, axis: usize| {
                let packet = i64::from(u32::from(pixel) / PACKET) - i64::from(place[axis] * TILE_PACKETS);
                packet.clamp(0, i64::from(TILE_PACKETS) - 1) as u8
            };
            entries[next[tile] as usize] = Entry {
                cube,
                first: [in_tile(footprint.first[0], 0), in_tile(footprint.first[1], 1)],
                last: [in_tile(footprint.last[0], 0), in_tile(footprint.last[1], 1)],
            };
            next[tile] += 1;
        });
    }
    Chunk { entries, starts }
}

/// Takes cubes to the screen, in f32 relative to the middle of the domain.
struct Projector {
    /// Of the middle: pixels right and down of the picture's middle times depth, and depth; all in unit lengths.
    middle: [f32; 3],
    /// The same per half lattice step along each axis.
    per_half_step: [[f32; 3]; 3],
    /// Twice the middle of the domain, in lattice steps.
    twice_middle: [i32; 3],
    /// Bounds on the error of the three.
    error: [f32; 3],
}

impl Projector {
    fn new(view: &View, layout: &VolumeLayout) -> Self {
        let cells = layout.cells.map(|n| n as i32);
        let from_eye = view.toward(cells);
        let [right, down] = view.pixels_per_length;
        let rows = [right, down, view.forward];
        let middle = rows.map(|row| from_eye.dot(row));
        let per_half_step = rows.map(|row| (row * view.step * 0.5).to_array());
        let error = [0, 1, 2].map(|i| {
            let reach: f64 =
                (0..3).map(|axis| per_half_step[i][axis].abs() * 2.0 * f64::from(cells[axis])).sum();
            (ROUNDING * (middle[i].abs() + reach)) as f32
        });
        Self {
            middle: middle.map(|x| x as f32),
            per_half_step: per_half_step.map(|row| row.map(|x| x as f32)),
            twice_middle: cells.map(|n| n.saturating_mul(2)),
            error,
        }
    }

    #[inline(always)]
    fn footprints<S: Simd>(
        &self,
        simd: S,
        view: &View,
        layout: &VolumeLayout,
        cubes: &[Cube],
    ) -> Vec<Footprint> {
        let mut footprints = Vec::with_capacity(cubes.len());
        for cubes in cubes.chunks(16) {
            let mut sums = [[0.0_f32; 16]; 3];
            let mut sizes = [[0.0_f32; 16]; 3];
            let mut bounds = [[[0_i32; 3]; 2]; 16];
            for (lane, cube) in cubes.iter().enumerate() {
                bounds[lane] = cube.lattice_bounds(layout);
                let [low, high] = bounds[lane];
                for axis in 0..3 {
                    // Whole numbers below 2^24.
                    sums[axis][lane] = (low[axis] + high[axis] - self.twice_middle[axis]) as f32;
                    sizes[axis][lane] = (high[axis] - low[axis]) as f32;
                }
            }
            let ranges = self.ranges(simd, view, &sums, &sizes);
            for (lane, cube) in cubes.iter().enumerate() {
                let has_matter = cube.extinction > 0.0 && (0..3).all(|axis| sizes[axis][lane] > 0.0);
                let footprint =
                    if has_matter { ranges.footprint(lane, view, bounds[lane]) } else { Footprint::NONE };
                footprints.push(footprint);
            }
        }
        footprints
    }

    /// Where sixteen cubes show; `sums` and `sizes` are of their lower and upper planes.
    #[inline(always)]
    fn ranges<S: Simd>(&self, simd: S, view: &View, sums: &[[f32; 16]; 3], sizes: &[[f32; 16]; 3]) -> Ranges {
        let center = axes(
            #[inline(always)]
            |i| {
                let mut sum = f32x16::splat(simd, self.middle[i]);
                for (sums, &per_half_step) in sums.iter().zip(&self.per_half_step[i]) {
                    let sums = f32x16::from_slice(simd, sums);
                    sum = sums.mul_add(f32x16::splat(simd, per_half_step), sum);
                }
                sum
            },
        );
        let half = axes(
            #[inline(always)]
            |i| {
                axes(
                    #[inline(always)]
                    |axis| f32x16::from_slice(simd, &sizes[axis]) * self.per_half_step[i][axis],
                )
            },
        );
        let reach = half[2][0].abs() + half[2][1].abs() + half[2][2].abs();
        let [nearest, farthest] = [center[2] - reach, center[2] + reach];
        let mut low = [f32x16::splat(simd, f32::INFINITY); 2];
        let mut high = [f32x16::splat(simd, f32::NEG_INFINITY); 2];
        for corner in 0..8 {
            let depth = corner_of(center[2], half[2], corner);
            let scale = if view.is_perspective { 1.0 / depth } else { f32x16::splat(simd, 1.0) };
            for axis in 0..2 {
                let pixel = corner_of(center[axis], half[axis], corner) * scale;
                low[axis] = low[axis].min(pixel);
                high[axis] = high[axis].max(pixel);
            }
        }
        let [middle_x, middle_y] = view.middle().map(|x| x as f32);
        let scale = if view.is_perspective { 1.0 / nearest } else { f32x16::splat(simd, 1.0) };
        let margin = axes(
            #[inline(always)]
            |axis| {
                let half_size = if axis == 0 { middle_x } else { middle_y };
                let shift = if view.is_perspective { self.error[2] * half_size } else { 0.0 };
                scale.mul_add(
                    f32x16::splat(simd, self.error[axis.min(1)] + shift),
                    f32x16::splat(simd, 1.0 / 64.0),
                )
            },
        );
        let first = [low[0] - margin[0] + (middle_x - 0.5), low[1] - margin[1] + (middle_y - 0.5)];
        let last = [high[0] + margin[0] + (middle_x - 0.5), high[1] + margin[1] + (middle_y - 0.5)];
        Ranges {
            first: [first[0].ceil().into(), first[1].ceil().into()],
            last: [last[0].floor().into(), last[1].floor().into()],
            nearest: nearest.into(),
            farthest: farthest.into(),
            depth_error: self.error[2],
        }
    }
}

/// A sum of one number and three more, each added or taken away as the bits of `corner` say.
#[inline(always)]
fn corner_of<S: Simd>(center: f32x16<S>, half: [f32x16<S>; 3], corner: u32) -> f32x16<S> {
    let mut sum = center;
    for (axis, half) in half.into_iter().enumerate() {
        sum = if corner >> axis & 1 == 1 { sum + half } else { sum - half };
    }
    sum
}

/// Where sixteen cubes show.
struct Ranges {
    /// First and last pixel along x and y, of cubes that are all before the eye.
    first: [[f32; 16]; 2],
    last: [[f32; 16]; 2],
    nearest: [f32; 16],
    farthest: [f32; 16],
    depth_error: f32,
}

impl Ranges {
    #[inline]
    fn footprint(&self, lane: usize, view: &View, bounds: [[i32; 3]; 2]) -> Footprint {
        if self.farthest[lane] < -self.depth_error {
            return Footprint::NONE;
        }
        let whole = view.size.map(|n| (n - 1) as u16);
        // Twice the error: what is left is known to a factor of two, and so is the margin.
        if view.is_perspective && self.nearest[lane] <= 2.0 * self.depth_error {
            let may_show = is_in_pyramid(view, bounds);
            return if may_show { Footprint { first: [0; 2], last: whole } } else { Footprint::NONE };
        }
        let end = |axis: usize| f32::from(whole[axis]);
        let is_seen = (0..2).all(|axis| {
            let (first, last) = (self.first[axis][lane], self.last[axis][lane]);
            first <= last && last >= 0.0 && first <= end(axis)
        });
        if !is_seen {
            return Footprint::NONE;
        }
        Footprint {
            first: [0, 1].map(|axis| self.first[axis][lane].max(0.0) as u16),
            last: [0, 1].map(|axis| self.last[axis][lane].min(end(axis)) as u16),
        }
    }
}

/// Whether a box has points on the inner side of each side of the picture's pyramid, a pixel wider.
fn is_in_pyramid(view: &View, bounds: [[i32; 3]; 2]) -> bool {
    let corners: [_; 8] = std::array::from_fn(|corner| {
        view.toward(std::array::from_fn(|axis| bounds[corner >> axis & 1][axis]))
    });
    let middle = view.middle();
    (0..2).all(|axis| {
        [-1.0, 1.0].iter().all(|side| {
            let inward = view.forward * (middle[axis] + 1.0) - *side * view.pixels_per_length[axis];
            corners.iter().any(|corner| corner.dot(inward) >= 0.0)
        })
    })
}
