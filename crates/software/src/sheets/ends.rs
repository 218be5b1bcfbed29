//! What of sheets lies before opaque surfaces.
//!
//! A sheet stands for the slab around it, half before and half behind, along each ray: the part that is before the
//! surface counts. Triangles whose thickness has a slope are no slabs and count whole if they are before it.

use glam::DVec3;

use super::raster::{Fragments, STRIP, THICKNESS};
use super::view::View;
use crate::surfaces::Surfaces;
use crate::target::TILE;

/// A triangle of a sheet, as it lies in space.
pub(super) struct Placed {
    /// Relative to the origin of the sheets.
    pub(super) corners: [DVec3; 3],
    /// Whether it is a part of a slab.
    pub(super) is_slab: bool,
}

/// Shortens the thickness of fragments from number `start` on, all of them of one triangle and a tile that begins at
/// the pixel `first`. `obliquities` are lengths over thicknesses, by pixel.
pub(super) fn cut<const N: usize>(
    view: &View,
    surfaces: &Surfaces,
    triangle: &Placed,
    (first, obliquities): ([u32; 2], &[f32]),
    (fragments, start): (&mut Fragments<N>, usize),
) {
    for place in start..fragments.len {
        let pixel = (fragments.pixels[place] % STRIP) as u32;
        let [column, row] = [first[0] + pixel % TILE, first[1] + pixel / TILE];
        let end = surfaces.depth(column, row);
        if end == f64::INFINITY {
            continue;
        }
        let thickness = &mut fragments.attributes[THICKNESS][place];
        let (depth, length_per_depth) = view.meet(triangle.corners, column, row);
        let before = (end - depth) * length_per_depth;
        let length = f64::from(thickness.abs() * obliquities[pixel as usize]);
        let share = if triangle.is_slab && length > 0.0 {
            (before / length + 0.5).clamp(0.0, 1.0)
        } else {
            f64::from(u8::from(before > 0.0))
        };
        *thickness *= share as f32;
    }
}
