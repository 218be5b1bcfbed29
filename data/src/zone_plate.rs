//! An image with detail of every size: where a reconstruction is coarse or torn, it shows.

use std::f64::consts::PI;

use glam::DVec3;
use volery_scene::VoxelGrid;

use crate::{fill, grid};

/// Linear RGB of the two kinds of tile, at the crests of the rings; the troughs are a quarter as bright.
const TILES: [[f64; 3]; 2] = [[0.95, 0.85, 0.60], [0.45, 0.75, 0.95]];

/// Tiles along the longer axis.
const NUM_TILES: usize = 16;

/// A zone plate on coloured tiles, RGB, one sample thick, spacing 1.
///
/// Rings `cos(π r² / (6 n))` around the middle, `r` in samples and `n` the longer axis, so that the distance of
/// two rings falls from the middle to twelve samples half an axis away; 16 tiles along the longer axis alternate
/// between sand and sky. `channel = 255 · tile · (5 + 3 cos) / 8`, rounded.
///
/// # Panics
/// When an axis is 0.
pub fn zone_plate([width, height]: [usize; 2]) -> VoxelGrid {
    let longer = width.max(height);
    let tile = longer.div_ceil(NUM_TILES).max(1);
    let color = |[x, y, _]: [usize; 3]| {
        let from_middle = |i: usize, n: usize| i as f64 - (n - 1) as f64 / 2.0;
        let squared = from_middle(x, width).powi(2) + from_middle(y, height).powi(2);
        let rings = (PI * squared / (6.0 * longer as f64)).cos();
        let colors = TILES[(x / tile + y / tile) % 2];
        colors.map(|channel| (255.0 * channel * (5.0 + 3.0 * rings) / 8.0).round() as u8)
    };
    grid([width, height, 1], DVec3::ONE, fill([width, height, 1], color))
}
