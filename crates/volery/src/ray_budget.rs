//! The error budget of rays: what each stage of a picture of matter may add to its distance from the truth.
//!
//! Each number is made for one picture: of the volume's texels, the transfer function, and what the rays met. It is the
//! largest difference of a colour channel in [0, 1] that the stage may cause in any pixel.
//!
//! - *Quadrature* and *classification* are sums over the cells that a ray met, taken where the picture is drawn
//!   ([`RayDoubt`]): the former of what straight pieces in place of the cubic field and mean colours in place of running
//!   ones may do, the latter of a bin at the steepest place of the transfer function. Neither counts on errors that
//!   cancel, though most do: both are far above what is measured.
//! - *Texels* and *arithmetic* are what rounding to `f32` does to the narrowest band of the transfer function: a shell is
//!   thicker or thinner by as much, and `x exp(-x)` is at most .37.
//! - *Touching*: where a field comes to rest at a step of the transfer function, as near as rounding, either side is right
//!   for one of two neighbouring fields. What the other side would change, up to 1 in front of an opaque band, is summed
//!   along each ray.
//! - *Early stop* is the light behind a ray that ends.

use volery_frame::{RayDoubt, RayTransfer, TexelType, VolumeLayout};

/// What a ray that ends leaves out: the transmittance at which both backends end.
const EARLY_STOP: f64 = 1.0 / 4096.0;

/// What each stage may add to the largest difference of a colour channel from the truth.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RayBudget {
    /// Samples stored as texels; 0 where that is exact.
    pub texels: f64,
    /// Texels rounded to bins of the transfer function's table.
    pub classification: f64,
    /// Integration along rays.
    pub quadrature: f64,
    /// The rest behind a ray that ended.
    pub early_stop: f64,
    /// Arithmetic in `f32`.
    pub arithmetic: f64,
    /// The side of a step of the transfer function that rounding chooses where a field comes to rest at it.
    pub touching: f64,
    /// The sum of all.
    pub max: f64,
}

impl RayBudget {
    pub(crate) fn new(transfer: &RayTransfer, layout: &VolumeLayout, doubt: RayDoubt) -> Self {
        let (bands, [bins_per_texel, _]) = (transfer.bands(), transfer.bin_from_texel());
        let inner = &bands[1..bands.len() - 1];
        let is_seen =
            |band: &&volery_frame::ray_transfer::Band| band.opacity > 0.0 || band.opacity_slope != 0.0;
        let narrowest =
            inner.iter().filter(is_seen).map(|band| f64::from(band.high)).fold(f64::INFINITY, f64::min);
        let window = (transfer.entries().len() as f64) / bins_per_texel;
        // What a rounding of the largest texels in the window is to the narrowest band.
        let rounding = 0.37 * f64::from(f32::EPSILON) / 2.0 * window / narrowest;
        let way = f64::from(doubt.table_way);
        let sums = transfer.entries().last().map_or(0.0, |sums| f64::from(sums[3]));
        let cells: f64 = layout.cells.iter().map(|&cells| f64::from(cells)).sum();
        let texels = if layout.texel == TexelType::F32 { rounding.min(1.0) } else { 0.0 };
        let classification = way * transfer.rounding();
        let quadrature = f64::from(doubt.cells);
        let arithmetic = (4.0 * rounding).min(1.0) + f64::from(f32::EPSILON) * (way * sums + 2.0 * cells);
        let touching = f64::from(doubt.touching).min(1.0);
        let max = texels + classification + quadrature + EARLY_STOP + arithmetic + touching;
        Self { texels, classification, quadrature, early_stop: EARLY_STOP, arithmetic, touching, max }
    }

    /// The stages that may add more than a limit, by name.
    pub fn above(&self, limit: f64) -> Vec<(&'static str, f64)> {
        let Self { texels, classification, quadrature, early_stop, arithmetic, touching, max: _ } = *self;
        [
            ("texels", texels),
            ("classification", classification),
            ("quadrature", quadrature),
            ("early stop", early_stop),
            ("arithmetic", arithmetic),
            ("a step of the transfer function that values touch", touching),
        ]
        .into_iter()
        .filter(|&(_, error)| error > limit)
        .collect()
    }
}
