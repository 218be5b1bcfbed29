//! A head as a CT scanner sees it: nested ellipsoids with soft edges.
//!
//! In the manner of Shepp and Logan's phantom ("The Fourier reconstruction of a head section", IEEE Trans.
//! Nucl. Sci. 21, 1974), but ours: in three dimensions, in Hounsfield units, with a face, and with edges 1.5 %
//! of the head wide, since a scanner has a point spread and a picture without aliasing needs one.
//! Later ellipsoids cover earlier ones: `v <- v + w (material - v)`, `w` rising smoothly from 0 outside to 1
//! inside.

use glam::DVec3;
use volery_scene::VoxelGrid;

use crate::{centered, fill, grid};

/// Width of an edge when the head's box spans [-1, 1].
const EDGE: f64 = 0.03;

const AIR: f64 = -1000.0;
const SKIN: f64 = 20.0;
const FAT: f64 = -90.0;
const BONE: f64 = 1100.0;
const MARROW: f64 = 500.0;
const BRAIN: f64 = 38.0;
const WHITE_MATTER: f64 = 28.0;
const FLUID: f64 = 6.0;
const LENS: f64 = 90.0;

struct Ellipsoid {
    /// In a box of [-1, 1]: x to the left hand of the patient, y to the back, z up.
    center: [f64; 3],
    half_axes: [f64; 3],
    hounsfield: f64,
}

const fn part(center: [f64; 3], half_axes: [f64; 3], hounsfield: f64) -> Ellipsoid {
    Ellipsoid { center, half_axes, hounsfield }
}

/// From the outside in; the face looks to -y.
const PARTS: [Ellipsoid; 28] = [
    // Neck, nose, ears, chin, head: skin first, everywhere, so that no part cuts into another.
    part([0.0, 0.25, -0.85], [0.42, 0.45, 0.60], SKIN),
    part([0.0, -0.84, -0.22], [0.13, 0.14, 0.18], SKIN),
    part([0.73, 0.08, -0.15], [0.07, 0.14, 0.20], SKIN),
    part([-0.73, 0.08, -0.15], [0.07, 0.14, 0.20], SKIN),
    part([0.0, -0.42, -0.62], [0.42, 0.40, 0.32], SKIN),
    part([0.0, 0.0, 0.10], [0.74, 0.90, 0.82], SKIN),
    part([0.0, 0.0, 0.11], [0.70, 0.86, 0.78], FAT),
    // Spine and jaw.
    part([0.0, 0.30, -0.85], [0.15, 0.17, 0.60], BONE),
    part([0.0, 0.34, -0.85], [0.06, 0.06, 0.62], BRAIN),
    part([0.0, -0.43, -0.58], [0.34, 0.33, 0.20], BONE),
    part([0.0, -0.34, -0.62], [0.27, 0.32, 0.28], SKIN),
    part([0.0, -0.42, -0.44], [0.24, 0.26, 0.08], AIR),
    // Cheeks and skull, its marrow, the brain inside it.
    part([0.37, -0.57, -0.27], [0.14, 0.13, 0.09], BONE),
    part([-0.37, -0.57, -0.27], [0.14, 0.13, 0.09], BONE),
    part([0.0, 0.02, 0.13], [0.66, 0.81, 0.74], BONE),
    part([0.0, 0.02, 0.13], [0.635, 0.785, 0.715], MARROW),
    part([0.0, 0.02, 0.13], [0.615, 0.765, 0.695], BONE),
    part([0.0, 0.02, 0.13], [0.59, 0.74, 0.67], FLUID),
    part([0.0, 0.02, 0.13], [0.57, 0.72, 0.65], BRAIN),
    part([0.24, 0.02, 0.20], [0.24, 0.55, 0.42], WHITE_MATTER),
    part([-0.24, 0.02, 0.20], [0.24, 0.55, 0.42], WHITE_MATTER),
    // The ventricles.
    part([0.12, 0.0, 0.18], [0.07, 0.34, 0.13], FLUID),
    part([-0.12, 0.0, 0.18], [0.07, 0.34, 0.13], FLUID),
    part([0.0, 0.14, -0.02], [0.03, 0.12, 0.12], FLUID),
    // Orbits with their eyes, and the airways of the nose.
    part([0.27, -0.72, -0.02], [0.17, 0.20, 0.14], FLUID),
    part([-0.27, -0.72, -0.02], [0.17, 0.20, 0.14], FLUID),
    part([0.27, -0.86, -0.02], [0.06, 0.03, 0.06], LENS),
    part([0.0, -0.66, -0.24], [0.09, 0.24, 0.14], AIR),
];

fn hounsfield_at(point: DVec3) -> f64 {
    PARTS.iter().fold(AIR, |below, part| {
        let half_axes = DVec3::from_array(part.half_axes);
        let radius = ((point - DVec3::from_array(part.center)) / half_axes).length();
        // Near the surface this is the distance to it, up to the ellipsoid's flatness.
        let inward = (1.0 - radius) * half_axes.min_element();
        let w = (inward / EDGE + 0.5).clamp(0.0, 1.0);
        below + w * w * (3.0 - 2.0 * w) * (part.hounsfield - below)
    })
}

/// A head in Hounsfield units, i16: air -1000, fat -90, fluid 6, brain about 35, bone 1100. It fills the box
/// of the grid whatever its shape, face to -y, z up; `[n, n * 5 / 4, n * 5 / 4]` has good proportions.
///
/// # Panics
/// When an axis of `dims` is 0 or `spacing` is not positive.
pub fn head(dims: [usize; 3], spacing: DVec3) -> VoxelGrid {
    grid(dims, spacing, fill(dims, |index| hounsfield_at(centered(dims, index)).round() as i16))
}

/// [`head`] with the window -1000 to 1550 Hounsfield units mapped to 0 to 255, ten units a level.
///
/// # Panics
/// When an axis of `dims` is 0 or `spacing` is not positive.
pub fn head_u8(dims: [usize; 3], spacing: DVec3) -> VoxelGrid {
    let level = |index| ((hounsfield_at(centered(dims, index)) - AIR) / 10.0).round() as u8;
    grid(dims, spacing, fill(dims, level))
}
