//! The picture in tiles: which bricks a tile can meet, and the packets of a tile.

use fearless_simd::{Level, dispatch, mask32x16, prelude::*};
use glam::DVec3;
use rayon::prelude::*;
use volery_frame::ray_transfer::BinSet;
use volery_frame::{DrawError, Frame, PlacedBrick, RayDoubt, RayTransfer, Rays, VolumeLayout};
use volery_scene::{Projection, RayGrid};

use crate::MIN_TRANSMITTANCE;
use crate::brick::{Occupancy, StoredBrick, block_cells};
use crate::exact::Bands;
use crate::packet::{PACKET, Packet};
use crate::pool::Bricks;
use crate::surfaces::Surfaces;
use crate::texel::Texel;
use crate::walk::{Light, Matter, Table, walk};

/// Pixels of a tile per axis, a multiple of [`PACKET`].
pub(crate) const TILE: u32 = 32;

/// A brick of this frame that holds matter.
struct Drawable<'a, T> {
    brick: &'a StoredBrick<T>,
    occupancy: Occupancy,
    /// Blocks that are too much for the table.
    exact: Option<Occupancy>,
    level: u32,
    /// Lower and upper corner in finest cells.
    bounds: [[f64; 3]; 2],
    /// First and last tile along x and y that its picture touches.
    tiles: [[u32; 2]; 2],
}

/// All that tiles share.
struct Shared<'a, T> {
    layout: &'a VolumeLayout,
    /// World length that the table's extinction refers to.
    unit_length: f64,
    rays: RayGrid,
    surfaces: &'a Surfaces,
    table: Table<'a>,
    /// Front to back.
    drawables: Vec<Drawable<'a, T>>,
}

/// Draws a checked frame.
pub(crate) fn draw<T: Texel>(
    level: Level,
    (frame, surfaces): (&Frame<'_>, &Surfaces),
    content: &Rays<'_>,
    layout: &VolumeLayout,
    bricks: &Bricks<T>,
) -> Result<(Vec<[f32; 3]>, RayDoubt), DrawError> {
    let Rays { transfer, bricks: placed_bricks } = *content;
    let projector = Projector::new(frame, layout);
    let stored: Vec<_> = placed_bricks
        .iter()
        .map(|placed| {
            bricks.get(&placed.id).ok_or(DrawError::NotResident { id: placed.id }).map(|b| (placed, b))
        })
        .collect::<Result<_, _>>()?;
    let exact: Vec<_> = (0..=placed_bricks.iter().map(|placed| placed.level).max().unwrap_or(0))
        .map(|level| transfer.exact_bins(layout, level))
        .collect();
    let drawables = stored
        .into_par_iter()
        .filter_map(|(placed, brick)| drawable(transfer, &exact, layout, &projector, placed, brick))
        .collect();
    let table = Table {
        entries: transfer.entries(),
        texel_origin: transfer.texel_origin() as f32,
        bin_from_texel: transfer.bin_from_texel().map(|x| x as f32),
        slope: transfer.slope() as f32,
        bands: Bands {
            bands: transfer.bands(),
            depth_scale: transfer.depth_scale() as f32,
            huge: transfer.huge_range() as f32,
        },
    };
    let rays = frame.camera.rays(frame.width, frame.height);
    let shared = Shared { layout, unit_length: transfer.unit_length(), rays, surfaces, table, drawables };

    let columns = frame.width.div_ceil(TILE);
    let tiles: Vec<(Vec<[f32; 3]>, RayDoubt)> = (0..columns * frame.height.div_ceil(TILE))
        .into_par_iter()
        .map(|i| dispatch!(level, simd => draw_tile(simd, &shared, i % columns, i / columns)))
        .collect();
    let (tiles, doubts): (Vec<_>, Vec<_>) = tiles.into_iter().unzip();
    let doubt = doubts.into_iter().fold(RayDoubt::default(), RayDoubt::max);
    Ok((assembled(frame, &tiles), doubt))
}

/// The picture of its tiles, [`TILE`] pixels square each, row by row.
pub(crate) fn assembled(frame: &Frame<'_>, tiles: &[Vec<[f32; 3]>]) -> Vec<[f32; 3]> {
    let columns = frame.width.div_ceil(TILE);
    let mut pixels = Vec::with_capacity(frame.width as usize * frame.height as usize);
    for y in 0..frame.height {
        for x in (0..frame.width).step_by(TILE as usize) {
            let tile = &tiles[(y / TILE * columns + x / TILE) as usize];
            let start = (y % TILE * TILE) as usize;
            pixels.extend_from_slice(&tile[start..start + (frame.width - x).min(TILE) as usize]);
        }
    }
    pixels
}

fn drawable<'a, T: Texel>(
    transfer: &RayTransfer,
    exact: &[BinSet],
    layout: &VolumeLayout,
    projector: &Projector,
    placed: &PlacedBrick,
    brick: &'a StoredBrick<T>,
) -> Option<Drawable<'a, T>> {
    let [low, high] = placed.bounds(layout);
    // A short brick leaves the rest of its node empty.
    let held = |axis: usize| low[axis] + ((brick.samples[axis] - 1) << placed.level);
    let high = std::array::from_fn(|axis| f64::from(high[axis].min(held(axis))));
    let bounds = [low.map(f64::from), high];
    let tiles = projector.tiles(bounds)?;
    let occupancy = brick.blocks(transfer, transfer.visible_bins())?;
    let exact = brick.blocks(transfer, &exact[placed.level as usize]);
    Some(Drawable { brick, occupancy, exact, level: placed.level, bounds, tiles })
}

/// Finds the tiles that a box can touch.
struct Projector {
    /// Eye, or the start of the ray of the top left corner in an orthographic view.
    origin: DVec3,
    right: DVec3,
    down: DVec3,
    forward: DVec3,
    /// Image plane coordinates of the top left corner, and of a pixel.
    corner: [f64; 2],
    pixel: f64,
    perspective: bool,
    spacing: DVec3,
    last_tile: [u32; 2],
}

impl Projector {
    fn new(frame: &Frame<'_>, layout: &VolumeLayout) -> Self {
        let [right, up, forward] = frame.camera.axes();
        let rays = frame.camera.rays(frame.width, frame.height);
        let perspective = matches!(frame.camera.projection, Projection::Perspective { .. });
        let (corner, step) =
            if perspective { (rays.toward, rays.toward_dx) } else { (DVec3::ZERO, rays.origin_dx) };
        Self {
            origin: rays.origin,
            right,
            down: -up,
            forward,
            corner: [corner.dot(right), corner.dot(-up)],
            pixel: step.length(),
            perspective,
            spacing: layout.spacing,
            last_tile: [frame.width, frame.height].map(|n| (n - 1) / TILE),
        }
    }

    /// First and last tile along x and y; `None` when the box is out of sight. Too many rather than too few.
    fn tiles(&self, bounds: [[f64; 3]; 2]) -> Option<[[u32; 2]; 2]> {
        let mut range = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let mut behind = 0;
        for corner in 0..8 {
            let cell = DVec3::from_array(std::array::from_fn(|axis| bounds[corner >> axis & 1][axis]));
            let point = cell * self.spacing - self.origin;
            let depth = point.dot(self.forward);
            // Too near to divide by, or behind the eye.
            let near = depth <= 1e-6 * point.length();
            behind += u32::from(near);
            let scale = if self.perspective { depth } else { 1.0 };
            let image = [point.dot(self.right), point.dot(self.down)];
            for axis in 0..2 {
                let pixel = (image[axis] / scale - self.corner[axis]) / self.pixel;
                range[0][axis] = range[0][axis].min(pixel);
                range[1][axis] = range[1][axis].max(pixel);
            }
        }
        match (self.perspective, behind) {
            (_, 8) => return None,
            (true, 1..) => return Some([[0, 0], self.last_tile]),
            _ => {}
        }
        // One pixel more on each side than the mathematics asks for.
        let tile = |pixel: f64| (pixel / f64::from(TILE)).floor();
        let first = [0, 1].map(|axis| tile(range[0][axis] - 1.0).max(0.0));
        let last = [0, 1].map(|axis| tile(range[1][axis] + 1.0).min(f64::from(self.last_tile[axis])));
        (0..2).all(|axis| first[axis] <= last[axis]).then(|| [first, last].map(|tile| tile.map(|x| x as u32)))
    }
}

/// What is behind the matter of a tile that begins at `(column, row)`.
pub(crate) fn tile_behind(surfaces: &Surfaces, column: u32, row: u32) -> Vec<[f32; 3]> {
    (0..TILE * TILE).map(|pixel| surfaces.color(column + pixel % TILE, row + pixel / TILE)).collect()
}

/// Draws one tile, whole even where it reaches over the edge of the picture.
#[inline(always)]
fn draw_tile<S: Simd, T: Texel>(
    simd: S,
    shared: &Shared<'_, T>,
    tile_x: u32,
    tile_y: u32,
) -> (Vec<[f32; 3]>, RayDoubt) {
    let mut doubt = RayDoubt::default();
    let [first_column, first_row] = [tile_x * TILE, tile_y * TILE];
    let mut pixels = tile_behind(shared.surfaces, first_column, first_row);
    let inside = |d: &Drawable<'_, T>| {
        let [[x0, y0], [x1, y1]] = d.tiles;
        (x0..=x1).contains(&tile_x) && (y0..=y1).contains(&tile_y)
    };
    let drawables: Vec<_> = shared.drawables.iter().filter(|d| inside(d)).collect();
    if drawables.is_empty() {
        return (pixels, doubt);
    }
    for y in (0..TILE).step_by(PACKET as usize) {
        for x in (0..TILE).step_by(PACKET as usize) {
            let light = draw_packet(simd, shared, &drawables, first_column + x, first_row + y);
            let [r, g, b]: [[f32; 16]; 3] = light.color.map(Into::into);
            let clear: [f32; 16] = light.transmittance.into();
            let worst = |lanes: [f32; 16]| lanes.into_iter().fold(0.0, f32::max);
            doubt = doubt.max(RayDoubt {
                cells: worst(light.doubt.into()),
                table_way: worst(light.table_way.into()),
                touching: worst(light.touching.into()),
            });
            for lane in 0..16 {
                let pixel = (y + lane as u32 / PACKET) * TILE + x + lane as u32 % PACKET;
                let background = pixels[pixel as usize];
                pixels[pixel as usize] = [
                    r[lane] + clear[lane] * background[0],
                    g[lane] + clear[lane] * background[1],
                    b[lane] + clear[lane] * background[2],
                ];
            }
        }
    }
    (pixels, doubt)
}

#[inline(always)]
fn draw_packet<S: Simd, T: Texel>(
    simd: S,
    shared: &Shared<'_, T>,
    drawables: &[&Drawable<'_, T>],
    column: u32,
    row: u32,
) -> Light<S> {
    let unit_length = shared.unit_length;
    let rays = (&shared.rays, shared.surfaces);
    let packet = Packet::new(simd, rays, shared.layout, unit_length, column, row);
    let mut light = Light::none(simd);
    let mut wanted = mask32x16::splat(simd, true);
    for drawable in drawables {
        let Some(span) = packet.meet(simd, drawable.bounds, drawable.level, wanted) else { continue };
        let matter = Matter {
            samples: drawable.brick.samples,
            texels: &drawable.brick.texels,
            occupancy: &drawable.occupancy,
            exact: drawable.exact.as_ref(),
            block: block_cells(shared.layout.brick_cells),
        };
        simd.vectorize(
            #[inline(always)]
            || walk(simd, &span, &matter, shared.table, &mut light),
        );
        wanted = light.transmittance.simd_gt(MIN_TRANSMITTANCE);
        if wanted.all_false() {
            break;
        }
    }
    light
}
