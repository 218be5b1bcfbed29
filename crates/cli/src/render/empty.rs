//! Why a picture shows nothing.

use volery::glam::DVec3;
use volery::{Image, Input, InputData, View, VoxelGrid};

/// Rays along each side of the picture that look for the data.
const RAYS: u32 = 64;

/// Why a picture shows nothing but its background; `None` for one that shows something. `bounds` is the box around the
/// data in the world.
pub(super) fn reason(image: &Image, view: &View, input: &Input, bounds: [DVec3; 2]) -> Option<String> {
    let background = view.background.map(|channel| channel as f32);
    if image.pixels.iter().any(|pixel| *pixel != background) {
        return None;
    }
    let bounds = match &input.data {
        InputData::Volume(volume) if !has_whole_cell(&volume.grid) => {
            return Some("every cell of the volume has a blank sample at a corner".to_owned());
        }
        InputData::Volume(_) => Some(bounds),
        InputData::Grid(file) => file.grid.world_bounds(),
        InputData::Stack(_) => None,
    };
    match bounds {
        Some(bounds) if !is_looked_at(view, bounds) => {
            let [low, high] = bounds.map(|corner| corner.to_array().map(volery::info::number).join(", "));
            Some(format!("the camera does not look at the data, which lie from {low} to {high}"))
        }
        _ => Some("the transfer function lets all light through where the data are".to_owned()),
    }
}

/// Whether a cell has values at all of its corners; along axes of one sample cells are flat.
fn has_whole_cell(grid: &VoxelGrid) -> bool {
    let dims = grid.dims();
    if grid.sample_type().channels() > 1 {
        return true;
    }
    let [x, y, z] = dims.map(|n| n.saturating_sub(1).max(1));
    let reach = dims.map(|n| usize::from(n > 1));
    let is_finite = |place: [usize; 3]| {
        grid.samples().value((place[2] * dims[1] + place[1]) * dims[0] + place[0], 0).is_finite()
    };
    let is_whole = |first: [usize; 3]| {
        (0..8usize).all(|corner| {
            is_finite(std::array::from_fn(|axis| first[axis] + (corner >> axis & 1) * reach[axis]))
        })
    };
    (0..z).any(|k| (0..y).any(|j| (0..x).any(|i| is_whole([i, j, k]))))
}

/// Whether some ray of the picture meets a box.
fn is_looked_at(view: &View, [low, high]: [DVec3; 2]) -> bool {
    let rays = view.camera.rays(view.width.min(RAYS), view.height.min(RAYS));
    let meets = |column, row| {
        let ray = rays.pixel(column, row);
        let inverse = ray.direction.recip();
        let (a, b) = ((low - ray.origin) * inverse, (high - ray.origin) * inverse);
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        near <= far && far >= 0.0
    };
    (0..view.height.min(RAYS)).any(|row| (0..view.width.min(RAYS)).any(|column| meets(column, row)))
}
