//! Rays in tiles: which bricks a tile can meet, and the packets of a tile.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use glam::DVec3;
use rayon::prelude::*;
use volery_frame::ray_transfer::BinSet;
use volery_frame::{DrawError, JoinedBrick, PictureView, RayTransfer, Rays, VolumeLayout};
use volery_scene::{Projection, RayGrid};

use crate::MIN_TRANSMITTANCE;
use crate::brick::{Marks, StoredBrick, block_cells};
use crate::exact::Bands;
use crate::math::axes;
use crate::packet::Packet;
use crate::pool::Bricks;
use crate::seams::Seams;
use crate::surfaces::Surfaces;
use crate::target::{self, PACKET, TILE, TILE_PACKETS, Target, Tile};
use crate::texel::Texel;
use crate::walk::{Light, Matter, Table, walk};

/// A brick of this part that holds matter.
struct Drawable<'a, T> {
    brick: &'a StoredBrick<T>,
    marks: Marks,
    level: u32,
    seams: Seams,
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
    drawables: &'a [Drawable<'a, T>],
}

/// Draws a checked part.
pub(crate) fn draw<T: Texel>(
    level: Level,
    target: &mut Target,
    content: &Rays<'_>,
    layout: &VolumeLayout,
    bricks: &Bricks<T>,
) -> Result<(), DrawError> {
    let Rays { transfer, bricks: placed_bricks } = *content;
    let projector = Projector::new(&target.view, layout, target.tile_range());
    let stored: Vec<_> = placed_bricks
        .iter()
        .map(|brick| {
            let id = brick.placed.id;
            bricks.get(&id).ok_or(DrawError::NotResident { id }).map(|stored| (brick, stored))
        })
        .collect::<Result<_, _>>()?;
    let exact: Vec<_> = (0..=placed_bricks.iter().map(|brick| brick.placed.level).max().unwrap_or(0))
        .map(|level| transfer.exact_bins(layout, level))
        .collect();
    let drawables: Vec<_> = stored
        .into_par_iter()
        .filter_map(|(joined, brick)| drawable(transfer, &exact, layout, &projector, joined, brick))
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
            flat_rounding: transfer.flat_rounding() as f32,
        },
    };
    let rays = target.view.camera.rays(target.view.width, target.view.height);
    let (unit_length, drawables) = (transfer.unit_length(), drawables.as_slice());
    target.draw_tiles(|surfaces, _, first, tile| {
        let shared = Shared { layout, unit_length, rays, surfaces, table, drawables };
        dispatch!(level, simd => draw_tile(simd, &shared, first, tile));
    });
    Ok(())
}

fn drawable<'a, T: Texel>(
    transfer: &RayTransfer,
    exact: &[BinSet],
    layout: &VolumeLayout,
    projector: &Projector,
    &JoinedBrick { placed, seams }: &JoinedBrick,
    brick: &'a StoredBrick<T>,
) -> Option<Drawable<'a, T>> {
    let [low, high] = placed.bounds(layout);
    // A short brick leaves the rest of its node empty.
    let held = |axis: usize| low[axis] + ((brick.samples[axis] - 1) << placed.level);
    let high = std::array::from_fn(|axis| f64::from(high[axis].min(held(axis))));
    let bounds = [low.map(f64::from), high];
    let tiles = projector.tiles(bounds)?;
    let marks = brick.marks(transfer, &exact[placed.level as usize], placed.level)?;
    Some(Drawable { brick, marks, level: placed.level, seams: Seams::new(seams), bounds, tiles })
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
    /// First and last tile that count.
    range: [[u32; 2]; 2],
}

impl Projector {
    fn new(picture: &PictureView<'_>, layout: &VolumeLayout, range: [[u32; 2]; 2]) -> Self {
        let [right, up, forward] = picture.camera.axes();
        let rays = picture.camera.rays(picture.width, picture.height);
        let perspective = matches!(picture.camera.projection, Projection::Perspective { .. });
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
            range,
        }
    }

    /// First and last tile along x and y among those that count; `None` when the box is in none of them. Too many rather than too few.
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
            (true, 1..) => return Some(self.range),
            _ => {}
        }
        // One pixel more on each side than the mathematics asks for.
        let tile = |pixel: f64| (pixel / f64::from(TILE)).floor();
        let first = [0, 1].map(|axis| tile(range[0][axis] - 1.0).max(f64::from(self.range[0][axis])));
        let last = [0, 1].map(|axis| tile(range[1][axis] + 1.0).min(f64::from(self.range[1][axis])));
        (0..2).all(|axis| first[axis] <= last[axis]).then(|| [first, last].map(|tile| tile.map(|x| x as u32)))
    }
}

/// Draws one tile, whole even where it reaches over the edge of the picture.
#[inline(always)]
fn draw_tile<S: Simd, T: Texel>(simd: S, shared: &Shared<'_, T>, first: [u32; 2], tile: &mut Tile) {
    let place = first.map(|pixel| pixel / TILE);
    let inside = |d: &Drawable<'_, T>| {
        let [[x0, y0], [x1, y1]] = d.tiles;
        (x0..=x1).contains(&place[0]) && (y0..=y1).contains(&place[1])
    };
    let drawables: Vec<_> = shared.drawables.iter().filter(|d| inside(d)).collect();
    if drawables.is_empty() {
        return;
    }
    let stride = tile.stride;
    let (light, doubts) = tile.light_and_doubts();
    for (packet, gathered) in (0..).zip(light.iter_mut().zip(doubts)) {
        let [x, y] = [packet % TILE_PACKETS, packet / TILE_PACKETS].map(|place| place * PACKET * stride);
        if x.max(y) < TILE {
            draw_packet(simd, shared, &drawables, ([first[0] + x, first[1] + y], stride), gathered);
        }
    }
}

#[inline(always)]
fn draw_packet<S: Simd, T: Texel>(
    simd: S,
    shared: &Shared<'_, T>,
    drawables: &[&Drawable<'_, T>],
    at: ([u32; 2], u32),
    (gathered, doubts): (&mut target::Light, &mut target::Doubt),
) {
    let unit_length = shared.unit_length;
    let rays = (&shared.rays, shared.surfaces);
    let packet = Packet::new(simd, rays, shared.layout, unit_length, at);
    let mut light = Light {
        color: axes(
            #[inline(always)]
            |i| f32x16::from_slice(simd, &gathered[i]),
        ),
        transmittance: f32x16::from_slice(simd, &gathered[3]),
        doubt: f32x16::from_slice(simd, &doubts[0]),
        table_way: f32x16::from_slice(simd, &doubts[1]),
        touching: f32x16::from_slice(simd, &doubts[2]),
    };
    let mut wanted = light.transmittance.simd_gt(MIN_TRANSMITTANCE);
    for drawable in drawables {
        let Some(span) = packet.meet(simd, drawable.bounds, drawable.level, wanted) else { continue };
        let matter = Matter {
            samples: drawable.brick.samples,
            texels: &drawable.brick.texels,
            seams: drawable.seams,
            brick_cells: shared.layout.brick_cells,
            occupancy: &drawable.marks.occupancy,
            exact: drawable.marks.exact.as_ref(),
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
    let [r, g, b] = light.color.map(Into::into);
    *gathered = [r, g, b, light.transmittance.into()];
    *doubts = [light.doubt.into(), light.table_way.into(), light.touching.into()];
}
