//! How far a picture is from the truth.

use volery_reference::metrics;

use super::{Picture, VerifyError};
use crate::report;

impl Picture {
    /// Compares with the truth and writes the error into the report.
    pub(crate) fn measure(&mut self, truth: &volery_reference::Image) -> Result<(), VerifyError> {
        let image = &self.image;
        let drawn = volery_reference::Image::from_f32(image.width, image.height, &image.pixels)?;
        let found = metrics::compare(&drawn, truth)?;
        self.report.error.get_or_insert_default().measured = Some(report::Measured {
            measured_max: found.max,
            measured_rmse: found.rmse,
            measured_psnr_db: found.psnr_db.is_finite().then_some(found.psnr_db),
            against: "reference f64",
        });
        Ok(())
    }
}
