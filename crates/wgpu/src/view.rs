//! From a frame to the numbers that the shader reads: in f64 up to the last step.

use glam::DVec3;
use volery_frame::{PictureView, RayTransfer, VolumeLayout};
use volery_scene::RayGrid;
use volery_shaders::raycast;

use crate::picture::{Picture, PictureTile, Tile};
use crate::pool::Pool;
use crate::units::Units;

/// The depth at which rays start: where the volume begins, so that nothing of it lies before their start and f32 loses
/// nothing to a far eye.
fn start_depth(picture: &PictureView<'_>, layout: &VolumeLayout) -> f64 {
    let [_, _, forward] = picture.camera.axes();
    let extent = DVec3::from_array(layout.cells.map(f64::from)) * layout.spacing;
    // The nearest corner is the one that lies most against the view.
    let nearest = DVec3::select(forward.cmplt(DVec3::ZERO), extent, DVec3::ZERO);
    (nearest - picture.camera.eye).dot(forward).max(0.0)
}

/// The rays of a tile that start at a depth, one for squares of so many pixels.
fn rays_from(picture: &PictureView<'_>, tile: Tile, stride: u32, depth: f64) -> RayGrid {
    let rays = picture.camera.rays(picture.width, picture.height);
    let step = f64::from(stride);
    // The middle of the pixel `stride / 2`, in place of the middle of the square.
    let shift = f64::from(stride / 2) + 0.5 - 0.5 * step;
    let [column, row] = tile.first.map(|pixel| f64::from(pixel) + shift);
    let rays = RayGrid {
        origin: rays.origin + rays.origin_dx * column + rays.origin_dy * row,
        toward: rays.toward + rays.toward_dx * column + rays.toward_dy * row,
        origin_dx: rays.origin_dx * step,
        origin_dy: rays.origin_dy * step,
        toward_dx: rays.toward_dx * step,
        toward_dy: rays.toward_dy * step,
    };
    // The directions' part along `forward` is 1, so a depth is a factor.
    RayGrid {
        origin: rays.origin + rays.toward * depth,
        origin_dx: rays.origin_dx + rays.toward_dx * depth,
        origin_dy: rays.origin_dy + rays.toward_dy * depth,
        ..rays
    }
}

/// The shader's frame for a tile.
pub(crate) fn shader_frame(
    (picture, place): (&Picture, usize),
    transfer: &RayTransfer,
    (pool, units): (&Pool, &Units),
) -> raycast::Frame {
    let layout = pool.layout();
    let PictureTile { tile, stride, .. } = picture.tiles[place];
    let start_depth = start_depth(&picture.view, layout);
    let rays = rays_from(&picture.view, tile, stride, start_depth);
    let in_cells = |v: DVec3| (v / layout.spacing).as_vec3().to_array();
    // Directions are only directions: of any length, so of one that f32 holds.
    let longest = rays.toward.length().max(f64::MIN_POSITIVE);
    let spacing = layout.spacing.max_element();
    let direction = |v: DVec3| (v / longest * (spacing / layout.spacing)).as_vec3().to_array();
    let depth = layout.spacing / transfer.unit_length() * std::f64::consts::LOG2_E;
    let [bins_per_texel, first_bin] = transfer.bin_from_texel();
    let texels_per_step = pool.texels_per_unit();
    raycast::Frame {
        origin: in_cells(rays.origin),
        width: tile.size[0].div_ceil(stride),
        origin_dx: in_cells(rays.origin_dx),
        height: tile.size[1].div_ceil(stride),
        origin_dy: in_cells(rays.origin_dy),
        is_first: picture.is_first(place).into(),
        toward: direction(rays.toward),
        unit_cells: units.unit_cells as f32,
        toward_dx: direction(rays.toward_dx),
        units_per_cell: 1.0 / units.unit_cells as f32,
        toward_dy: direction(rays.toward_dy),
        brick_cells: layout.brick_cells as f32,
        cells: layout.cells.map(|n| n as f32),
        bricks_per_cell: 1.0 / layout.brick_cells as f32,
        depth_per_cell: depth.as_vec3().to_array(),
        texels_per_step: texels_per_step as f32,
        texel_origin: transfer.texel_origin() as f32,
        atlas_scale: pool.texture_size().map(|n| 1.0 / n as f32),
        last_entry: transfer.last_entry() as f32,
        slices_per_row: pool.slot().slices_per_row as f32,
        rows_per_slice: 1.0 / pool.slot().slices_per_row as f32,
        slot_height: pool.slot().size[1] as f32,
        slots_per_layer: pool.slots_per_layer(),
        bins_per_texel: bins_per_texel as f32,
        first_bin: first_bin as f32,
        // Depths of stretches are to the base 2.
        slope: (transfer.slope() / std::f64::consts::LOG2_E) as f32,
        depth_scale: transfer.depth_scale() as f32,
        num_bands: transfer.bands().len() as u32,
        huge_range: transfer.huge_range() as f32,
        flat_rounding: transfer.flat_rounding() as f32,
        surface_offset: (picture.surfaces.zero_depth() - start_depth) as f32,
        cells_per_depth: (longest / spacing) as f32,
        stride,
        last_pixel: tile.size.map(|pixels| pixels - 1),
        ..bytemuck::Zeroable::zeroed()
    }
}
