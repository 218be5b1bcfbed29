//! Pictures into files, whole or not at all.

use std::path::Path;

use volery_io::{WriteError, write_exr, write_png};

use crate::matter_bound::MatterBound;

/// Writes a picture as the ending of its name says: `.exr` in 32-bit floats, anything else as PNG of 8 bits.
///
/// # Errors
/// When the file cannot be written; nothing is left of it then.
pub fn write_image(path: &Path, image: &volery_frame::Image) -> Result<(), WriteError> {
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let write = if is_exr { write_exr } else { write_png };
    write(path, image.width, image.height, &image.pixels)
}

/// The map of errors of a picture, or of what bounds them, per channel, times a gain.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    /// The amplified differences, in [0, 1].
    pub image: volery_frame::Image,
    /// The power of two that they were multiplied with.
    pub gain: f64,
}

impl ErrorMap {
    /// Compares a picture with the truth; the gain is the largest power of two, up to 2^20, that keeps the
    /// largest difference within 1.
    ///
    /// # Errors
    /// When the two are of different size.
    pub fn new(
        drawn: &volery_frame::Image,
        truth: &volery_reference::Image,
    ) -> Result<Self, volery_reference::metrics::Error> {
        let drawn =
            volery_reference::Image::from_f32(drawn.width, drawn.height, &drawn.pixels).map_err(|size| {
                let left = [size.width, size.height];
                volery_reference::metrics::Error { left, right: [truth.width(), truth.height()] }
            })?;
        let gain = gain(volery_reference::metrics::compare(&drawn, truth)?.max);
        let map = volery_reference::metrics::difference(&drawn, truth, gain)?;
        let pixels = map.pixels().iter().map(|pixel| pixel.map(|channel| channel as f32)).collect();
        Ok(Self { image: volery_frame::Image { width: map.width(), height: map.height(), pixels }, gain })
    }

    /// Shows bounds; the gain as for differences.
    pub fn of_bound(bound: &MatterBound) -> Self {
        let gain = gain(bound.max());
        let pixels = bound.pixels.iter().map(|pixel| pixel.map(|bound| bound * gain as f32)).collect();
        Self { image: volery_frame::Image { width: bound.width, height: bound.height, pixels }, gain }
    }
}

/// The largest power of two, up to 2^20, that keeps an error within 1.
fn gain(largest: f64) -> f64 {
    if largest > 0.0 { (-largest.log2()).floor().clamp(0.0, 20.0).exp2() } else { 1.0 }
}
