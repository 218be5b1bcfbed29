//! Cutting planes through the bricks of a cut of several levels, without seams.
//!
//! # Method
//! A ray meets each plane at most once. There the finest brick's field would be the truth; a brick of the cut
//! shows its own samples, *high*, mixed with every second of them, *low*: `(1 - r) * high + r * low`, both
//! trilinear. On the decimated pyramid a parent's sample is its child's sample at the same place, so low is what
//! the parent would show: the *low tile* of LaMar and others (2000, section 3.1) without a copy, and both of the
//! paper's weighted passes in one.
//!
//! The *ratio* `r` is trilinear in the brick, from one bit per corner ([`BlendedBrick::low_corners`]): set where
//! a coarser brick touches that corner (section 4.3). In a cut whose neighbours differ by one level at most the
//! field so drawn is continuous across every boundary. The paper interpolates ratios over the polygon in which
//! the plane cuts the brick; on the brick's edges, where the polygon has its vertices, the two are the same, but
//! inside only the trilinear ratio depends on nothing else than the place.
//!
//! # What a pixel shows
//! - The ray of the pixel's centre, no triangle: so nothing can gape or be drawn twice, whatever is rounded. In
//!   perspective what lies before the eye counts, in orthographic views what lies from the plane through the eye on,
//!   as [`Ray`](volery_scene::Ray) has it.
//! - The volume is the closed box of its samples. A place on a face between bricks belongs to the upper one, at the
//!   end of the volume to the last one; a plane in such a face is seen once. Places are found by
//!   [`PlaneTiles`](crate::PlaneTiles), to less than 1e-6 of a tile of 16 pixels; bricks by
//!   [`BrickGrid`](crate::BrickGrid).
//! - Planes hide one another by their depth at that pixel, exactly also where they cross; at equal depth the plane
//!   listed first is in front.
//! - Blank is a place where a sample that counts is NaN: any corner of the cell of high where the ratio is below 1,
//!   of low where it is above 0. Nothing is there, and what is behind is seen. So is the rest of a brick that holds
//!   fewer samples than its place has.
//! - Texels that are colours are mixed channel by channel, straight.
//! - Bounds of bricks are lines [`OUTLINE_PIXELS`] wide, antialiased, half in either brick; opaque, also over blanks.
//!   In a plane that lies within a face of bricks that face is no line.
//!
//! # Place of low samples
//! Sample `i` of low is sample `min(2 i, n - 1)` of the `n` that a brick holds along an axis, at the place of
//! `2 i`: a volume that ends within a coarse cell repeats its last sample, as coarser levels do.

use volery_scene::{Plane, Revision, TransferFunction};

use crate::{DrawError, PlacedBrick, VolumeLayout};

/// Planes to see, and how.
#[derive(Clone, Copy, Debug)]
pub struct Planes<'a> {
    /// In world space, at most [`MAX_PLANES`]; none is degenerate.
    pub planes: &'a [Plane],
    /// What to draw of them, in any order. Bricks do not overlap; where none is, nothing is seen.
    pub bricks: &'a [BlendedBrick],
    /// Value to colour and opacity; not read for texels that are colours themselves.
    pub transfer: &'a PointTransfer,
    /// How samples become a field.
    pub sampling: Sampling,
    /// Whether opacity lets light through. Else every place that is not blank is opaque.
    pub is_transparent: bool,
    /// Whether the bounds of bricks are drawn, in the colour of their level: see [`outline_color`].
    pub shows_bricks: bool,
}

/// Most planes of a frame.
pub const MAX_PLANES: usize = 16;

/// Width of the lines along the bounds of bricks, in pixels.
pub const OUTLINE_PIXELS: f32 = 1.5;

/// How much of a pixel the line covers along a bound that is `pixels` away, on its own side: all at the bound, none
/// from half the line's width and half a pixel on.
#[inline(always)]
pub fn outline_coverage(pixels: f32) -> f32 {
    (0.5 * OUTLINE_PIXELS + 0.5 - pixels).clamp(0.0, 1.0)
}

/// Checks the planes of a frame.
pub(crate) fn check(planes: &[Plane]) -> Result<(), DrawError> {
    if planes.len() > MAX_PLANES {
        return Err(DrawError::TooManyPlanes { found: planes.len(), max: MAX_PLANES });
    }
    for (index, plane) in planes.iter().enumerate() {
        let defects = plane.defects();
        if !defects.is_empty() {
            let defects = defects.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            return Err(DrawError::Plane { index, defects });
        }
    }
    Ok(())
}

/// A brick and how it blends into its coarser neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BlendedBrick {
    /// Which brick, and where.
    pub placed: PlacedBrick,
    /// Bit `x + 2 y + 4 z`: whether that corner shows the low samples alone. A brick that the volume's end cuts
    /// short has its corners where it would have ended.
    pub low_corners: u8,
}

/// How samples become a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// The nearest sample counts: figure 6c of the paper.
    Nearest,
    /// Trilinear.
    #[default]
    Linear,
}

/// The colour of the bounds of bricks, linear RGB, from the finest level on: black, red, green, yellow as in
/// figure 6b of LaMar and others (2000), then others.
pub fn outline_color(level: u32) -> [f32; 3] {
    const COLORS: [[f32; 3]; 7] = [
        [0.0, 0.0, 0.0],
        [0.9, 0.05, 0.05],
        [0.05, 0.7, 0.1],
        [0.95, 0.85, 0.05],
        [0.1, 0.3, 0.95],
        [0.8, 0.1, 0.8],
        [0.05, 0.75, 0.8],
    ];
    COLORS[(level as usize).min(COLORS.len() - 1)]
}

/// The transfer function at a point: straight colour and opacity, piecewise linear in the texel.
///
/// Control points as they are, in f32, not a table: exact between them, and a step stays one.
#[derive(Clone, Debug)]
pub struct PointTransfer {
    revision: Revision,
    points: Vec<[f32; 5]>,
}

impl PointTransfer {
    /// Takes `transfer` from values to the texels of a layout, in f64 up to the last rounding.
    pub fn new(transfer: &TransferFunction, layout: &VolumeLayout) -> Self {
        let mut points: Vec<[f32; 5]> = transfer
            .points()
            .iter()
            .map(|point| {
                let [r, g, b] = point.color;
                let texel = (point.value - layout.value_offset) / layout.value_scale;
                [texel, r, g, b, point.opacity].map(|x| x as f32)
            })
            .collect();
        if layout.value_scale < 0.0 {
            points.reverse();
        }
        Self { revision: Revision::new(), points }
    }

    /// Names the points, which never change; that of clones is the same.
    pub fn revision(&self) -> Revision {
        self.revision
    }

    /// `[texel, r, g, b, opacity]`, texels not falling; at least one. At a texel where two stand the last counts.
    pub fn points(&self) -> &[[f32; 5]] {
        &self.points
    }

    /// Straight colour and opacity of a texel that is not blank.
    #[inline]
    pub fn classify(&self, texel: f32) -> [f32; 4] {
        let above = self.points.partition_point(|point| point[0] <= texel);
        if above == 0 || above == self.points.len() {
            let [_, r, g, b, opacity] = self.points[above.saturating_sub(1)];
            return [r, g, b, opacity];
        }
        let (a, b) = (self.points[above - 1], self.points[above]);
        let w = (texel - a[0]) / (b[0] - a[0]);
        std::array::from_fn(|i| a[i + 1] + (b[i + 1] - a[i + 1]) * w)
    }
}
