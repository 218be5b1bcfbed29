//! Sheets of triangles: every tile finds the fragments of its own, front to back, and shades them in batches.
//!
//! # Method
//! Each vertex is taken to the screen once, in f64 (`view`). `bins` lists triangles by tile, from the front, and leaves
//! out those that cover no centre of a pixel or whose values have no extinction. A tile takes its list in order:
//! `raster` finds the pixels of a triangle, sixteen at a time, and appends them, with value and thickness, to a batch of
//! fragments; so lanes are full when `shade` looks up tables and computes opacity, however small the triangles are. Light is then summed one fragment after the other.
//!
//! # Error
//! Weights in a triangle are computed in f32 from the middle of the tile: a side is off by some 1e-5 of a pixel.
//! Sums are in f32, opacity by `expm1`.
//!
//! # Where a tile ends early
//! Negative thickness can make transmittance rise again. What the triangles of a block of pixels can add at most is
//! known before the first is drawn; a block ends when, with all of that, less than [`MIN_TRANSMITTANCE`] comes through.
//! A part of a picture does not know what later ones take away, and leaves room for one strip: so in parts a picture is
//! the same to the bit where it does not end early, and else to that rest.
//!
//! # Cost
//! Beside the sheets, 40 bytes per vertex and 12 per triangle and tile. What does not depend on the camera, tables and
//! quantised vertices as numbers, is kept for parts of the same revisions.

mod bins;
mod ends;
mod raster;
mod shade;
mod table;
mod view;

use fearless_simd::{Level, dispatch, prelude::*};
use rayon::prelude::*;
use volery_frame::sheets::MAX_STRIP_DEPTH;
use volery_frame::{Quantization, Revision, SheetVertices, Sheets};

use crate::MIN_TRANSMITTANCE;
use crate::math::axes;
use crate::surfaces::Surfaces;
use crate::target::{TILE, Target, Tile};
use bins::{Bins, Entry};
use ends::Placed;
use raster::{Fragments, Packet, Triangle};
use shade::Shading;
use table::Table;
use view::{Vertex, View};

const NUM_PIXELS: usize = (TILE * TILE) as usize;

/// Pixels of a block per axis; a tile's blocks are the bits of a `u16`.
const BLOCK: u32 = 8;

const BLOCKS: u32 = TILE / BLOCK;

const _: () = assert!(BLOCKS * BLOCKS == 16, "a tile's blocks fill the bits");

/// Batches of fragments between two looks at which blocks have ended.
const BATCHES_PER_LOOK: u32 = 4;

/// Thickness above this is this, so that no product of finite numbers is infinite.
const MAX_THICKNESS: f32 = 1e30;

/// A checked part of sheets.
struct Scene<'a> {
    content: &'a Sheets<'a>,
    points: &'a [[f32; 4]],
    gradients: &'a [[f32; 4]],
    vertices: Vec<Vertex>,
    view: View,
    table: &'a Table,
    /// Optical depth that later parts may take away.
    rise_behind: f32,
}

/// What of parts does not depend on the camera.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    table: Option<(Revision, bool, Table)>,
    vertices: Option<(Option<Revision>, Numbers)>,
}

/// Quantised vertices as numbers; gradients only where they count.
#[derive(Debug)]
struct Numbers {
    points: Vec<[f32; 4]>,
    gradients: Option<Vec<[f32; 4]>>,
}

impl Kept {
    /// The table of a part, and its points and gradients.
    fn of<'a>(&'a mut self, content: &Sheets<'a>) -> (&'a Table, &'a [[f32; 4]], &'a [[f32; 4]]) {
        let has_rows = content.transfer.rows() > 1;
        let is_needed = has_rows || content.light.is_some();
        let (points, gradients) = match content.vertices {
            SheetVertices::Exact { points, gradients } => (points, if is_needed { gradients } else { &[] }),
            SheetVertices::Quantized { points, gradients, quantization } => {
                let is_same = |(revision, numbers): &(Option<Revision>, Numbers)| {
                    let has_all = numbers.gradients.is_some() || !is_needed;
                    revision.is_some() && *revision == content.revision && has_all
                };
                let kept = self.vertices.take().filter(is_same);
                let numbers = || Numbers {
                    points: points_of(points, &quantization),
                    gradients: is_needed.then(|| gradients_of(gradients, &quantization)),
                };
                let (_, numbers) =
                    self.vertices.insert(kept.unwrap_or_else(|| (content.revision, numbers())));
                let gradients = numbers.gradients.as_deref().filter(|_| is_needed);
                (numbers.points.as_slice(), gradients.unwrap_or_default())
            }
        };
        let has_magnitudes = has_rows && !gradients.is_empty();
        let revision = content.transfer.revision();
        let is_same = |&(kept, magnitudes, _): &(Revision, bool, Table)| {
            (kept, magnitudes) == (revision, has_magnitudes)
        };
        let kept = self.table.take().filter(is_same);
        let table = || (revision, has_magnitudes, Table::new(content.transfer, has_magnitudes));
        (&self.table.insert(kept.unwrap_or_else(table)).2, points, gradients)
    }
}

/// Draws a checked part, which is the whole picture or one of several.
pub(crate) fn draw(level: Level, kept: &mut Kept, target: &mut Target, content: &Sheets<'_>, is_whole: bool) {
    let (table, points, gradients) = kept.of(content);
    let view = View::new(&target.view, content, points);
    let vertices = view.vertices(level, points);
    let num_attributes = match (gradients.is_empty(), content.light) {
        (true, _) => 2,
        (false, None) => 3,
        (false, Some(_)) => 6,
    };
    let rise_behind = if is_whole { 0.0 } else { MAX_STRIP_DEPTH };
    let scene = Scene { content, points, gradients, vertices, view, table, rise_behind };
    let bins = Bins::new(level, &scene);
    match num_attributes {
        2 => draw_tiles::<2>(level, target, &scene, &bins),
        3 => draw_tiles::<3>(level, target, &scene, &bins),
        _ => draw_tiles::<6>(level, target, &scene, &bins),
    }
    drop(scene);
    kept.vertices.take_if(|(revision, _)| revision.is_none());
}

fn draw_tiles<const N: usize>(level: Level, target: &mut Target, scene: &Scene<'_>, bins: &Bins) {
    target.draw_tiles(|surfaces, number, first, tile| {
        dispatch!(level, simd => simd.vectorize(
            #[inline(always)]
            || draw_tile::<_, N>(simd, (scene, surfaces), bins, (number, first), tile)
        ));
    });
}

/// Draws one tile, whole even where it reaches over the edge of the picture.
#[inline(always)]
fn draw_tile<S: Simd, const N: usize>(
    simd: S,
    (scene, surfaces): (&Scene<'_>, &Surfaces),
    bins: &Bins,
    (number, first): (u32, [u32; 2]),
    tile: &mut Tile,
) {
    if bins.of_tile(number).all(<[Entry]>::is_empty) {
        return;
    }
    let places = (0..TILE * TILE).map(|i| [i % TILE, i / TILE]);
    let mut obliquities = [0.0; NUM_PIXELS];
    for ([x, y], obliquity) in places.zip(&mut obliquities) {
        *obliquity = scene.view.obliquity(first[0] + x, first[1] + y);
    }
    let ends = scene.ends(bins, number, &obliquities);
    let mut pixels = tile.rows();
    let shading = Shading { table: scene.table, light: scene.content.light, obliquities: &obliquities };
    let mut fragments = Fragments::<N>::new();
    let mut open = open_blocks(u16::MAX, &pixels, &ends);
    let mut num_batches = 0;
    'tile: for entries in bins.of_tile(number) {
        for entry in entries {
            if blocks(entry) & open == 0 {
                continue;
            }
            let Some(triangle) = scene.triangle::<N>(entry, first) else { continue };
            let [left, top] = entry.first.map(u32::from);
            let packet = Packet::of_width(u32::from(entry.last[0]) - left + 1);
            for y in (top..=u32::from(entry.last[1])).step_by(packet.size[1] as usize) {
                for x in (left..=u32::from(entry.last[0])).step_by(packet.size[0] as usize) {
                    let start = fragments.len;
                    triangle.add(simd, packet, [x, y], entry.last, &mut fragments);
                    if !surfaces.is_empty() {
                        let placed = scene.placed(entry);
                        let tile = (first, obliquities.as_slice());
                        ends::cut(&scene.view, surfaces, &placed, tile, (&mut fragments, start));
                    }
                    if fragments.is_full() {
                        shading.composite(simd, &mut fragments, &mut pixels);
                        num_batches += 1;
                    }
                }
            }
            if num_batches >= BATCHES_PER_LOOK {
                num_batches = 0;
                open = open_blocks(open, &pixels, &ends);
                if open == 0 {
                    break 'tile;
                }
            }
        }
    }
    shading.composite(simd, &mut fragments, &mut pixels);
    tile.set_rows(&pixels);
}

/// The blocks that a triangle's pixels may be in.
#[inline(always)]
fn blocks(entry: &Entry) -> u16 {
    let ones = |first: u8, last: u8, stride: u32| {
        (u32::from(first) / BLOCK..=u32::from(last) / BLOCK).fold(0_u16, |bits, i| bits | 1 << (i * stride))
    };
    ones(entry.first[1], entry.last[1], BLOCKS) * ones(entry.first[0], entry.last[0], 1)
}

/// Of blocks that were open those that still want light: `ends` are transmittances.
#[inline(always)]
fn open_blocks(open: u16, pixels: &[[f32; 4]], ends: &[f32; 16]) -> u16 {
    let mut still = 0;
    for block in (0..16_u32).filter(|block| open >> block & 1 == 1) {
        let first = block / BLOCKS * BLOCK * TILE + block % BLOCKS * BLOCK;
        let is_open = (0..BLOCK).any(|row| {
            let start = (first + row * TILE) as usize;
            pixels[start..start + BLOCK as usize].iter().any(|pixel| pixel[3] > ends[block as usize])
        });
        still |= u16::from(is_open) << block;
    }
    still
}

impl Scene<'_> {
    /// The magnitudes of gradients at a triangle's vertices.
    #[inline(always)]
    fn magnitudes(&self, numbers: [u32; 3]) -> [f32; 3] {
        numbers.map(|vertex| self.gradients[vertex as usize][3])
    }

    /// The thickness of a sheet at a vertex.
    #[inline(always)]
    fn thickness(&self, sheet: u32, vertex: u32) -> f32 {
        let [constant, slope] = self.content.sheets[sheet as usize].thickness;
        let mut thickness = constant;
        if slope != 0.0 {
            let [x, y, z, _] = self.points[vertex as usize].map(f64::from);
            let along = self.content.normal.dot(glam::DVec3::new(x, y, z));
            thickness = (f64::from(constant) + f64::from(slope) * along) as f32;
        }
        if thickness.is_nan() { 0.0 } else { thickness.clamp(-MAX_THICKNESS, MAX_THICKNESS) }
    }

    /// The triangle of an entry, of a tile that begins at the pixel `first`.
    #[inline(always)]
    fn triangle<const N: usize>(&self, entry: &Entry, first: [u32; 2]) -> Option<Triangle<N>> {
        let numbers = self.content.triangles[entry.triangle as usize];
        let vertices = axes(
            #[inline(always)]
            |i| &self.vertices[numbers[i] as usize],
        );
        let mut attributes = [[0.0; N]; 3];
        for i in 0..3 {
            attributes[i][0] = vertices[i].value;
            attributes[i][1] = self.thickness(entry.sheet, numbers[i]);
            if N > 2 {
                let [x, y, z, magnitude] = self.gradients[numbers[i] as usize];
                for (to, from) in attributes[i][2..].iter_mut().zip([magnitude, x, y, z]) {
                    *to = from;
                }
            }
        }
        let is_strip = self.content.sheets[entry.sheet as usize].is_strip();
        Triangle::new(vertices, attributes, first, (self.view.is_perspective, is_strip))
    }

    /// A triangle in space, relative to the origin of the sheets.
    fn corners(&self, numbers: [u32; 3]) -> [glam::DVec3; 3] {
        numbers.map(|vertex| {
            let [x, y, z, _] = self.points[vertex as usize].map(f64::from);
            glam::DVec3::new(x, y, z)
        })
    }

    /// The triangle of an entry in space.
    fn placed(&self, entry: &Entry) -> Placed {
        let corners = self.corners(self.content.triangles[entry.triangle as usize]);
        Placed { corners, is_slab: !self.content.sheets[entry.sheet as usize].is_strip() }
    }

    /// The transmittance of each block at which nothing behind can show.
    fn ends(&self, bins: &Bins, tile: u32, obliquities: &[f32]) -> [f32; 16] {
        // Optical depth that may be taken away.
        let mut rises = [self.rise_behind; 16];
        let obliquity = obliquities.iter().copied().fold(1.0, f32::max);
        for entry in bins.of_tile(tile).flatten() {
            let [constant, slope] = self.content.sheets[entry.sheet as usize].thickness;
            if slope == 0.0 && constant >= 0.0 {
                continue;
            }
            let numbers = self.content.triangles[entry.triangle as usize];
            let least =
                numbers.map(|vertex| self.thickness(entry.sheet, vertex)).into_iter().fold(0.0, f32::min);
            let rise = (-least * obliquity * self.table.max_extinction).min(MAX_STRIP_DEPTH);
            let blocks = blocks(entry);
            (0..16).filter(|block| blocks >> block & 1 == 1).for_each(|block| rises[block] += rise);
        }
        rises.map(|rise| MIN_TRANSMITTANCE * (-1.001 * rise).exp())
    }
}

/// Quantised points as numbers.
fn points_of(points: &[[u16; 4]], Quantization { low, scale, .. }: &Quantization) -> Vec<[f32; 4]> {
    let point = |point: &[u16; 4]| std::array::from_fn(|i| low[i] + scale[i] * f32::from(point[i]));
    points.par_iter().map(point).collect()
}

/// Quantised directions and magnitudes of gradients as numbers.
fn gradients_of(gradients: &[[i8; 4]], quantization: &Quantization) -> Vec<[f32; 4]> {
    let gradient = |&[x, y, z, magnitude]: &[i8; 4]| {
        let [x, y, z] = [x, y, z].map(|i| (f32::from(i) / 127.0).max(-1.0));
        [x, y, z, quantization.magnitude_scale * f32::from(magnitude.cast_unsigned())]
    };
    gradients.par_iter().map(gradient).collect()
}
