//! The triangles that may show in each tile, from the front.
//!
//! # Method
//! Triangles are taken in chunks, each by one thread. One before the eye shows in the rectangle of its vertices,
//! widened by the rounding of f32; where no centre of a pixel is in it, or its values have no extinction, it is done
//! with. One across the plane of the eye is tested against the sides of columns and rows of tiles, as planes through
//! the eye. A counting sort puts a chunk's triangles in order of tiles and leaves their own order alone, so lists do
//! not depend on threads.

use fearless_simd::{Level, dispatch, prelude::*};
use rayon::prelude::*;
use volery_frame::{Counted, Sheet};

use super::Scene;
use super::view::Vertex;
use crate::math::axes;
use crate::target::TILE;

/// A chunk has at least so many triangles unless it is the last, and at least as many as there are tiles, so that lists
/// of empty tiles do not outweigh the triangles.
const MIN_CHUNK: u32 = 1 << 14;

/// How far rounding may move a vertex on the screen, in pixels: f32 holds 65,536 to 1/256.
const MARGIN: f32 = 1.0 / 64.0;

/// A triangle in a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Entry {
    pub(super) triangle: u32,
    pub(super) sheet: u32,
    /// First and last pixel of the tile along x and y.
    pub(super) first: [u8; 2],
    pub(super) last: [u8; 2],
}

/// A chunk's triangles by tile.
struct Chunk {
    /// Those of one tile after those of another.
    entries: Vec<Entry>,
    /// Where each tile's begin, and the end.
    starts: Vec<u32>,
}

/// All triangles by tile.
pub(super) struct Bins {
    chunks: Vec<Chunk>,
}

/// Triangles of one sheet that one thread takes.
#[derive(Clone, Copy, Debug)]
struct Piece {
    sheet: u32,
    first: u32,
    count: u32,
}

impl Bins {
    pub(super) fn new(level: Level, scene: &Scene<'_>) -> Self {
        let [columns, rows] = scene.view.size.map(|n| n.div_ceil(TILE));
        let num_tiles = columns as usize * rows as usize;
        let chunks = pieces(scene.content.sheets, MIN_CHUNK.max(num_tiles as u32));
        let chunks = chunks
            .par_iter()
            .map(|pieces| {
                let footprints = dispatch!(level, simd => simd.vectorize(
                    #[inline(always)]
                    || footprints(scene, pieces)
                ));
                sorted(&footprints, columns, num_tiles)
            })
            .collect();
        Self { chunks }
    }

    /// The triangles of a tile from the front, in parts.
    #[inline(always)]
    pub(super) fn of_tile(&self, tile: u32) -> impl Iterator<Item = &[Entry]> {
        self.chunks.iter().map(move |chunk| {
            &chunk.entries[chunk.starts[tile as usize] as usize..chunk.starts[tile as usize + 1] as usize]
        })
    }
}

/// Chunks of about `len` triangles from the front: the last of the last sheet first.
fn pieces(sheets: &[Sheet], len: u32) -> Vec<Vec<Piece>> {
    let mut chunks = vec![Vec::new()];
    let mut room = len;
    for (index, sheet) in (0..sheets.len() as u32).zip(sheets).rev() {
        let mut count = sheet.count;
        while count > 0 {
            let part = count.min(room);
            count -= part;
            room -= part;
            if let Some(chunk) = chunks.last_mut() {
                chunk.push(Piece { sheet: index, first: sheet.first + count, count: part });
            }
            if room == 0 {
                chunks.push(Vec::new());
                room = len;
            }
        }
    }
    chunks
}

/// Where a triangle may show.
#[derive(Clone, Copy, Debug)]
struct Footprint {
    triangle: u32,
    sheet: u32,
    /// First and last pixel along x and y.
    first: [u16; 2],
    last: [u16; 2],
}

#[inline(always)]
fn footprints(scene: &Scene<'_>, pieces: &[Piece]) -> Vec<Footprint> {
    let mut footprints = Vec::with_capacity(pieces.iter().map(|piece| piece.count as usize).sum());
    for piece in pieces {
        let counted = scene.content.sheets[piece.sheet as usize].counted;
        for triangle in (piece.first..piece.first + piece.count).rev() {
            let numbers = &scene.content.triangles[triangle as usize];
            let vertices = axes(
                #[inline(always)]
                |i| &scene.vertices[numbers[i] as usize],
            );
            let is_before_eye = !vertices.iter().any(|vertex| vertex.screen[0].is_nan());
            let bounds = if is_before_eye {
                bounds_before_eye(scene, vertices)
            } else {
                bounds_across_eye(scene, vertices)
            };
            let Some([first, last]) = bounds else { continue };
            let values = [vertices[0].value, vertices[1].value, vertices[2].value];
            if scene.table.is_clear(values, || scene.magnitudes(*numbers)) {
                continue;
            }
            if counted != Counted::All && !scene.view.counts(counted, scene.corners(*numbers)) {
                continue;
            }
            footprints.push(Footprint { triangle, sheet: piece.sheet, first, last });
        }
    }
    footprints
}

/// First and last pixel along x and y; none if there is no centre of a pixel between.
#[inline(always)]
fn bounds_before_eye(scene: &Scene<'_>, vertices: [&Vertex; 3]) -> Option<[[u16; 2]; 2]> {
    let [a, b, c] = vertices;
    if !scene.view.is_perspective && a.depth < 0.0 && b.depth < 0.0 && c.depth < 0.0 {
        return None;
    }
    let (mut first, mut last) = ([0; 2], [0; 2]);
    for axis in 0..2 {
        let low = a.screen[axis].min(b.screen[axis]).min(c.screen[axis]) - MARGIN;
        let high = a.screen[axis].max(b.screen[axis]).max(c.screen[axis]) + MARGIN;
        let (low, high) = (low.max(0.0).ceil(), high.min((scene.view.size[axis] - 1) as f32).floor());
        if low > high {
            return None;
        }
        (first[axis], last[axis]) = (low as u16, high as u16);
    }
    Some([first, last])
}

/// All pixels of the tiles between whose sides the triangle may pass.
#[cold]
fn bounds_across_eye(scene: &Scene<'_>, vertices: [&Vertex; 3]) -> Option<[[u16; 2]; 2]> {
    let places = vertices.map(|vertex| vertex.place);
    if places.iter().flatten().any(|x| !x.is_finite()) || places.iter().all(|place| place[2] <= 0.0) {
        return None;
    }
    let (mut first, mut last) = ([0; 2], [0; 2]);
    for axis in 0..2 {
        let size = scene.view.size[axis];
        let may_show = |tile: &u32| {
            // A pixel more on each side than the mathematics asks for.
            let low = f64::from(tile * TILE) - 1.0;
            let high = low + f64::from(TILE) + 2.0;
            places.iter().any(|place| place[axis] >= low * place[2])
                && places.iter().any(|place| place[axis] <= high * place[2])
        };
        let mut tiles = (0..size.div_ceil(TILE)).filter(may_show);
        let low = tiles.next()?;
        let high = tiles.next_back().unwrap_or(low);
        first[axis] = (low * TILE) as u16;
        last[axis] = ((high + 1) * TILE - 1).min(size - 1) as u16;
    }
    Some([first, last])
}

impl Footprint {
    #[inline(always)]
    fn each_tile(&self, columns: u32, mut take: impl FnMut(usize, [u32; 2])) {
        let tiles = |axis: usize| u32::from(self.first[axis]) / TILE..=u32::from(self.last[axis]) / TILE;
        for y in tiles(1) {
            for x in tiles(0) {
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
    for footprint in footprints {
        footprint.each_tile(columns, |tile, place| {
            let in_tile = |pixel: [u16; 2]| {
                let in_tile = |axis: usize| {
                    (i64::from(pixel[axis]) - i64::from(place[axis] * TILE)).clamp(0, i64::from(TILE) - 1)
                        as u8
                };
                [in_tile(0), in_tile(1)]
            };
            entries[next[tile] as usize] = Entry {
                triangle: footprint.triangle,
                sheet: footprint.sheet,
                first: in_tile(footprint.first),
                last: in_tile(footprint.last),
            };
            next[tile] += 1;
        });
    }
    Chunk { entries, starts }
}
