//! Cutting planes: tiles of the picture, packets of a tile, and what is in front of what.
//!
//! A packet is four by four pixels. Each lane takes the nearest plane that it has not yet seen; lanes whose places
//! lie in one brick are sampled together. A lane is done when an opaque place hides the rest.

use fearless_simd::{Level, dispatch, f32x16, i32x16, mask32x16, prelude::*};
use volery_frame::plane_tiles::TILE as PLANE_TILE;
use volery_frame::planes::{MAX_PLANES, outline_color, outline_coverage};
use volery_frame::{
    BlendedBrick, BrickGrid, DrawError, PlaneTile, PlaneTiles, Planes, Revision, VolumeLayout,
};

use crate::brick::StoredBrick;
use crate::math::axes;
use crate::plane_field::Field;
use crate::pool::Bricks;
use crate::surfaces::Surfaces;
use crate::target::{self, PACKET, TILE, TILE_PACKETS, Target, Tile};
use crate::texel::Texel;

/// Denominators below this are beyond a plane's horizon.
const HORIZON: f32 = 1e-12;

const _: () = assert!(TILE.is_multiple_of(PLANE_TILE), "tiles of planes fill a tile");

/// The grid of the last bricks that were placed, in the order in which they were.
#[derive(Debug, Default)]
pub(crate) struct Kept(Option<(Revision, Vec<BlendedBrick>, BrickGrid)>);

impl Kept {
    fn grid(&mut self, layout: &VolumeLayout, bricks: &[BlendedBrick]) -> &BrickGrid {
        let is_same = |(volume, placed, _): &(_, Vec<_>, _)| *volume == layout.revision && placed == bricks;
        let kept = self.0.take().filter(is_same);
        let grid = || (layout.revision, bricks.to_vec(), BrickGrid::new(layout, bricks));
        &self.0.insert(kept.unwrap_or_else(grid)).2
    }
}

/// All that tiles share.
struct Shared<'a, T> {
    /// Pixels of the picture.
    size: [u32; 2],
    surfaces: &'a Surfaces,
    content: &'a Planes<'a>,
    layout: &'a VolumeLayout,
    tiles: &'a PlaneTiles,
    grid: &'a BrickGrid,
    /// In the order of the grid's bricks.
    stored: &'a [&'a StoredBrick<T>],
}

/// Draws a checked part of texels of `C` channels.
pub(crate) fn draw<T: Texel, const C: usize>(
    level: Level,
    kept: &mut Kept,
    target: &mut Target,
    content: &Planes<'_>,
    (layout, bricks): (&VolumeLayout, &Bricks<T>),
) -> Result<(), DrawError> {
    let missing = content.bricks.iter().find(|brick| !bricks.contains_key(&brick.placed.id));
    if let Some(brick) = missing {
        return Err(DrawError::NotResident { id: brick.placed.id });
    }
    let grid = kept.grid(layout, content.bricks);
    let stored: Vec<_> = grid.bricks().iter().filter_map(|brick| bricks.get(&brick.placed.id)).collect();
    let tiles = PlaneTiles::new(&target.view, content.planes, layout);
    let size = [target.view.width, target.view.height];
    let (tiles, stored) = (&tiles, stored.as_slice());
    target.draw_tiles(|surfaces, _, first, tile| {
        let shared = Shared { size, surfaces, content, layout, tiles, grid, stored };
        dispatch!(level, simd => draw_tile::<_, T, C>(simd, &shared, first, tile));
    });
    Ok(())
}

/// Draws one tile, by tiles as planes see them.
#[inline(always)]
fn draw_tile<S: Simd, T: Texel, const C: usize>(
    simd: S,
    shared: &Shared<'_, T>,
    [left, top]: [u32; 2],
    tile: &mut Tile,
) {
    let mut planes: Vec<PlaneTile> = Vec::with_capacity(MAX_PLANES);
    let [right, bottom] = [0, 1].map(|axis| ([left, top][axis] + TILE).min(shared.size[axis]));
    for first_row in (top..bottom).step_by(PLANE_TILE as usize) {
        for first_column in (left..right).step_by(PLANE_TILE as usize) {
            planes.clear();
            planes.extend(shared.tiles.tile(first_column, first_row).flatten());
            let Some(PlaneTile { zero_depth, .. }) = planes.first().copied() else { continue };
            let light = tile.light();
            for row in (first_row..bottom.min(first_row + PLANE_TILE)).step_by(PACKET as usize) {
                for column in (first_column..right.min(first_column + PLANE_TILE)).step_by(PACKET as usize) {
                    let ends = depths_of_ends(shared, zero_depth, [column, row]);
                    let ends = f32x16::from_slice(simd, &ends);
                    let packet = (row - top) / PACKET * TILE_PACKETS + (column - left) / PACKET;
                    let gathered = &mut light[packet as usize];
                    let place = [column - first_column, row - first_row];
                    draw_packet::<S, T, C>(simd, shared, &planes, place, (ends, gathered));
                }
            }
        }
    }
}

/// Where the rays of a packet end at surfaces, in the depths of its tile.
#[inline(always)]
fn depths_of_ends<T>(shared: &Shared<'_, T>, zero_depth: f64, [column, row]: [u32; 2]) -> [f32; 16] {
    let mut ends = [f32::INFINITY; 16];
    if !shared.surfaces.is_empty() {
        for (lane, end) in (0..).zip(&mut ends) {
            let depth = shared.surfaces.depth(column + lane % PACKET, row + lane / PACKET);
            *end = ((depth - zero_depth) / shared.layout.spacing.max_element()) as f32;
        }
    }
    ends
}

/// What a pixel has gathered, front to back.
#[derive(Clone, Copy)]
struct Light {
    color: [f32; 3],
    transmittance: f32,
}

impl Light {
    /// Adds a place behind what is there: straight colour and opacity.
    #[inline(always)]
    fn add(&mut self, color: [f32; 3], opacity: f32) {
        let share = self.transmittance * opacity;
        for (sum, color) in self.color.iter_mut().zip(color) {
            *sum += share * color;
        }
        self.transmittance *= 1.0 - opacity;
    }
}

/// Where a packet meets a plane.
struct Hit<S: Simd> {
    /// In finest cells from the tile's base.
    place: [f32x16<S>; 3],
    depth: f32x16<S>,
    inverse: f32x16<S>,
    /// Lanes that meet the plane within the volume.
    lanes: mask32x16<S>,
}

impl<S: Simd> Hit<S> {
    #[expect(
        clippy::redundant_closure,
        reason = "only a closure that is written where it is passed can be inlined so"
    )]
    #[inline(always)]
    fn new(simd: S, plane: &PlaneTile, layout: &VolumeLayout, x: f32x16<S>, y: f32x16<S>) -> Self {
        let (a, b) = (x - plane.anchor[0], y - plane.anchor[1]);
        let splat = |value: f32| f32x16::splat(simd, value);
        let denominator = a.mul_add(splat(plane.shrink[0]), b.mul_add(splat(plane.shrink[1]), splat(1.0)));
        let mut lanes = denominator.simd_gt(splat(HORIZON));
        let inverse = 1.0 / denominator.max(splat(HORIZON));
        let at = |i: usize| {
            (a * plane.dx[i]).mul_add(inverse, (b * plane.dy[i]).mul_add(inverse, splat(plane.seen[i])))
        };
        let place = axes(
            #[inline(always)]
            |axis| at(axis),
        );
        let depth = at(3);
        lanes &= depth.simd_ge(splat(plane.first_depth));
        for (axis, place) in place.iter().enumerate() {
            let [low, high] = [0.0, layout.cells[axis] as f32].map(|end| splat(end - plane.base[axis]));
            lanes &= place.simd_ge(low) & place.simd_le(high);
        }
        Self { place, depth, inverse, lanes }
    }

    /// Finest cells that the place along an axis changes by from pixel to pixel.
    #[inline(always)]
    fn slope(&self, plane: &PlaneTile, axis: usize) -> f32x16<S> {
        let moved = self.place[axis] - plane.seen[axis];
        let [x, y] = [(plane.dx[axis], plane.shrink[0]), (plane.dy[axis], plane.shrink[1])].map(
            #[inline(always)]
            |(change, shrink)| (change - moved * shrink) * self.inverse,
        );
        (x * x + y * y).sqrt()
    }
}

/// Adds to the light of the sixteen pixels from `(column, row)` of the planes' tile on, to the depths at which their
/// rays end.
#[inline(always)]
fn draw_packet<S: Simd, T: Texel, const C: usize>(
    simd: S,
    shared: &Shared<'_, T>,
    planes: &[PlaneTile],
    [column, row]: [u32; 2],
    (ends, gathered): (f32x16<S>, &mut target::Light),
) {
    let mut lights: [Light; 16] = std::array::from_fn(
        #[inline(always)]
        |lane| Light { color: axes(|i| gathered[i][lane]), transmittance: gathered[3][lane] },
    );
    let lane = |of: fn(usize) -> usize| std::array::from_fn(|i| of(i) as f32);
    let x: [f32; 16] = lane(|i| i % PACKET as usize);
    let y: [f32; 16] = lane(|i| i / PACKET as usize);
    let x = f32x16::from_slice(simd, &x) + column as f32;
    let y = f32x16::from_slice(simd, &y) + row as f32;
    // Planes that lanes have still to see.
    let mut open = [0_u64; MAX_PLANES];
    let mut wanted = still_wanted(&lights);
    for (open, plane) in open.iter_mut().zip(planes) {
        let hit = Hit::new(simd, plane, shared.layout, x, y);
        *open = (hit.lanes & hit.depth.simd_lt(ends)).to_bitmask();
    }
    while open.iter().any(|lanes| lanes & wanted != 0) {
        let mut nearest = f32x16::splat(simd, f32::INFINITY);
        let mut which = i32x16::splat(simd, -1);
        for (index, plane) in (0..).zip(planes) {
            let hit = Hit::new(simd, plane, shared.layout, x, y);
            let lanes = mask32x16::from_bitmask(simd, open[index as usize]) & hit.depth.simd_lt(nearest);
            nearest = lanes.select(hit.depth, nearest);
            which = lanes.select(i32x16::splat(simd, index), which);
        }
        for (index, plane) in (0..).zip(planes) {
            let lanes = which.simd_eq(index).to_bitmask();
            open[index as usize] &= !lanes;
            if lanes & wanted != 0 {
                let hit = Hit::new(simd, plane, shared.layout, x, y);
                shade::<S, T, C>(simd, shared, plane, &hit, lanes & wanted, &mut lights);
            }
        }
        wanted = still_wanted(&lights);
    }
    for (lane, light) in lights.iter().enumerate() {
        (0..3).for_each(|i| gathered[i][lane] = light.color[i]);
        gathered[3][lane] = light.transmittance;
    }
}

/// Lanes that something behind could still show in.
#[inline(always)]
fn still_wanted(lights: &[Light; 16]) -> u64 {
    let is_wanted = |light: &Light| u64::from(light.transmittance <= 0.0) ^ 1;
    lights.iter().enumerate().fold(0, |wanted, (lane, light)| wanted | is_wanted(light) << lane)
}

/// Adds what `lanes` see of a plane.
#[inline(always)]
fn shade<S: Simd, T: Texel, const C: usize>(
    simd: S,
    shared: &Shared<'_, T>,
    plane: &PlaneTile,
    hit: &Hit<S>,
    lanes: u64,
    lights: &mut [Light; 16],
) {
    let cells: [[f32; 16]; 3] = axes(
        #[inline(always)]
        |axis| {
            let last = shared.layout.cells[axis].saturating_sub(1) as f32;
            let cell = hit.place[axis].floor() + plane.base[axis];
            cell.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last)).into()
        },
    );
    let mut rest = lanes;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize;
        let Some(index) = shared.grid.find(axes(|axis| cells[axis][lane] as u32)) else {
            rest &= rest - 1;
            continue;
        };
        let blended = &shared.grid.bricks()[index];
        let [low, high] = blended.placed.bounds(shared.layout);
        let scale = 0.5_f32.powi(blended.placed.level as i32);
        let mut inside = mask32x16::from_bitmask(simd, rest);
        let from_low = axes(
            #[inline(always)]
            |axis| hit.place[axis] - (low[axis] as f32 - plane.base[axis]),
        );
        let to_high = axes(
            #[inline(always)]
            |axis| (high[axis] as f32 - plane.base[axis]) - hit.place[axis],
        );
        for axis in 0..3 {
            inside &= from_low[axis].simd_ge(0.0);
            let is_end = high[axis] == shared.layout.cells[axis];
            inside &= if is_end { to_high[axis].simd_ge(0.0) } else { to_high[axis].simd_gt(0.0) };
        }
        rest &= !(inside.to_bitmask() | 1 << lane);
        let place = axes(
            #[inline(always)]
            |axis| from_low[axis] * scale,
        );
        let brick = shared.stored[index];
        for (axis, place) in place.iter().enumerate() {
            inside &= place.simd_le((brick.samples[axis] - 1) as f32);
        }
        let (brick_cells, sampling) = (shared.layout.brick_cells, shared.content.sampling);
        let values: [f32x16<S>; C] = Field { brick, blended, brick_cells, sampling }.values(simd, &place);
        let mut coverage = f32x16::splat(simd, 0.0);
        if shared.content.shows_bricks {
            coverage = outlines(simd, plane, hit, &from_low, &to_high);
        }
        let outline = (outline_color(blended.placed.level), coverage);
        classify(shared, &values, outline, inside.to_bitmask(), lights);
    }
}

/// How much of each pixel the bounds of a brick cover.
#[inline(always)]
fn outlines<S: Simd>(
    simd: S,
    plane: &PlaneTile,
    hit: &Hit<S>,
    from_low: &[f32x16<S>; 3],
    to_high: &[f32x16<S>; 3],
) -> f32x16<S> {
    let mut pixels = f32x16::splat(simd, f32::INFINITY);
    for axis in 0..3 {
        let slope = hit.slope(plane, axis);
        let distance = from_low[axis].min(to_high[axis]) / slope;
        pixels = slope.simd_gt(0.0).select(distance.min(pixels), pixels);
    }
    let coverage: [f32; 16] = pixels.into();
    f32x16::from_slice(simd, &coverage.map(outline_coverage))
}

/// Adds the places of `lanes`, each with its share of the outline's colour.
#[inline(always)]
fn classify<S: Simd, T, const C: usize>(
    shared: &Shared<'_, T>,
    values: &[f32x16<S>; C],
    (outline, coverage): ([f32; 3], f32x16<S>),
    mut lanes: u64,
    lights: &mut [Light; 16],
) {
    let values: [[f32; 16]; C] = values.map(
        #[inline(always)]
        |value| value.into(),
    );
    let coverage: [f32; 16] = coverage.into();
    let content = shared.content;
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        if coverage[lane] > 0.0 {
            lights[lane].add(outline, coverage[lane]);
        }
        let value = values[0][lane];
        if !value.is_finite() {
            continue;
        }
        let [r, g, b, opacity] = if C == 4 {
            std::array::from_fn(|channel| values[channel][lane] * (1.0 / 255.0))
        } else {
            content.transfer.classify(value)
        };
        lights[lane].add([r, g, b], if content.is_transparent { opacity } else { 1.0 });
    }
}
