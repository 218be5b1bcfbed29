//! A transfer function cut at its control points, in texels.

use volery_scene::TransferFunction;

use crate::VolumeLayout;

/// A range of texels in which colour and opacity are linear; the first and the last of a transfer function are
/// constant and have no outer end.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segment {
    /// In texels; infinite at an outer end.
    pub(super) ends: [f64; 2],
    /// At both ends.
    pub(super) opacity: [f64; 2],
    /// At both ends.
    pub(super) color: [[f64; 3]; 2],
}

/// The segments of a transfer function, in order and without a gap; none is empty.
pub(super) fn segments(transfer: &TransferFunction, layout: &VolumeLayout) -> Vec<Segment> {
    let mut points: Vec<_> = transfer
        .points()
        .iter()
        .map(|point| ((point.value - layout.value_offset) / layout.value_scale, point.opacity, point.color))
        .collect();
    if layout.value_scale < 0.0 {
        points.reverse();
    }
    let outer = |ends, (_, opacity, color)| Segment { ends, opacity: [opacity; 2], color: [color; 2] };
    let first = outer([f64::NEG_INFINITY, points[0].0], points[0]);
    let last = points[points.len() - 1];
    let last = outer([last.0, f64::INFINITY], last);
    let between = points.windows(2).filter(|pair| pair[0].0 < pair[1].0).map(|pair| Segment {
        ends: [pair[0].0, pair[1].0],
        opacity: [pair[0].1, pair[1].1],
        color: [pair[0].2, pair[1].2],
    });
    std::iter::once(first).chain(between).chain([last]).collect()
}

impl Segment {
    pub(super) fn is_clear(&self) -> bool {
        self.opacity == [0.0; 2]
    }

    /// Where a texel stands between the ends.
    fn weight(&self, texel: f64) -> f64 {
        let weight = (texel - self.ends[0]) / (self.ends[1] - self.ends[0]);
        if weight.is_finite() { weight.clamp(0.0, 1.0) } else { 0.0 }
    }

    /// `[r s, g s, b s, s]` at a texel, with `s` the optical depth of a unit distance, at most `max_depth`.
    pub(super) fn light(&self, texel: f64, max_depth: f64) -> [f64; 4] {
        let weight = self.weight(texel);
        let mix = |[from, to]: [f64; 2]| from + (to - from) * weight;
        let depth = (-(-mix(self.opacity)).ln_1p()).min(max_depth);
        let [r, g, b] = [0, 1, 2].map(|i| mix([self.color[0][i], self.color[1][i]]));
        [r * depth, g * depth, b * depth, depth]
    }
}

/// From the lowest to the highest texel that is not transparent; `None` where all is. Infinite where matter has no end.
pub(super) fn visible(segments: &[Segment]) -> Option<[f64; 2]> {
    let first = segments.iter().find(|segment| !segment.is_clear())?;
    let last = segments.iter().rev().find(|segment| !segment.is_clear())?;
    Some([first.ends[0], last.ends[1]])
}
