//! Coloured tissue without an edge: a volume of colours whose exact picture is known to be smooth.
//!
//! Two gyroids, `g(q) = sin x cos y + sin y cos z + sin z cos x` (`|g| <= 3/2`), of different wavelength stand
//! for muscle in fat and for what runs through both. Every channel is linear in them, so that no frequency is
//! above `2 * FINE` periods per half length of the longest axis: a field as band-limited as a grid can have, and
//! separable, which makes 60 million samples a matter of a second.

use std::array;
use std::f64::consts::PI;

use volery_scene::VoxelGrid;

use crate::grid;
use glam::DVec3;

/// Periods of the coarse and of the fine gyroid over half of the longest axis.
const COARSE: f64 = 2.0;
const FINE: f64 = 4.0;

/// Colour and opacity in the middle, and what the coarse and the fine gyroid add at their largest.
const MIDDLE: [f64; 4] = [0.64, 0.42, 0.34, 0.5];
const OF_COARSE: [f64; 4] = [0.24, 0.30, 0.16, -0.3];
const OF_FINE: [f64; 4] = [0.09, -0.06, -0.08, 0.15];

/// Sine and cosine of each sample's phase along an axis.
type Waves = Vec<[f64; 2]>;

/// Tissue of smooth colours, RGBA, spacing 1.
///
/// With `p` the sample's place from the middle of the grid in halves of its longest axis, channel `c` is
/// `255 (m + a g(2 · 2π p)/1.5 + b g(4 · 2π p + (1, 2, 3))/1.5)`, rounded; `m`, `a`, `b` are
/// (.64 .42 .34 .50), (.24 .30 .16 -.30), (.09 -.06 -.08 .15).
///
/// # Panics
/// When an axis of `dims` is 0.
pub fn tissue(dims: [usize; 3]) -> VoxelGrid {
    let half = (dims.iter().max().map_or(0, |&n| n.saturating_sub(1)).max(1)) as f64 / 2.0;
    let waves = |axis: usize, periods: f64, phase: f64| -> Waves {
        let middle = dims[axis].saturating_sub(1) as f64 / 2.0;
        let angle = |i: usize| 2.0 * PI * periods * (i as f64 - middle) / half + phase;
        (0..dims[axis]).map(|i| angle(i).sin_cos().into()).collect()
    };
    let coarse: [Waves; 3] = array::from_fn(|axis| waves(axis, COARSE, 0.0));
    let fine: [Waves; 3] = array::from_fn(|axis| waves(axis, FINE, (axis + 1) as f64));
    let color = |index: [usize; 3]| {
        let (coarse, fine) = (gyroid(&coarse, index), gyroid(&fine, index));
        array::from_fn::<u8, 4, _>(|c| {
            let channel = MIDDLE[c] + OF_COARSE[c] * coarse + OF_FINE[c] * fine;
            // A channel is at least .09 from both ends.
            (255.0 * channel).round() as u8
        })
    };
    grid(dims, DVec3::ONE, crate::fill(dims, color))
}

/// In [-1, 1].
fn gyroid(waves: &[Waves; 3], index: [usize; 3]) -> f64 {
    let [[sin_x, cos_x], [sin_y, cos_y], [sin_z, cos_z]] = array::from_fn(|axis| waves[axis][index[axis]]);
    (sin_x * cos_y + sin_y * cos_z + sin_z * cos_x) / 1.5
}
