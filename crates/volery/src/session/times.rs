//! What frames took, and what of it is reported.

use crate::report;

/// What one frame took, in seconds; `None` for what there is none of.
pub(crate) struct Times {
    pub(crate) select: f64,
    pub(crate) geometry: Option<f64>,
    pub(crate) upload: Option<f64>,
    pub(crate) draw: f64,
    pub(crate) paced: Option<report::PacedFrame>,
}

impl Times {
    fn frame(&self) -> f64 {
        self.select + self.geometry.unwrap_or(0.0) + self.upload.unwrap_or(0.0) + self.draw
    }

    /// Those of the median frame of at least one; of an even number of frames the faster of the two in the middle.
    pub(crate) fn median(times: &[Self], build: f64) -> report::Seconds {
        let mut sorted: Vec<&Self> = times.iter().collect();
        sorted.sort_by(|a, b| a.frame().total_cmp(&b.frame()));
        let median = sorted[(sorted.len() - 1) / 2];
        let &Self { select, geometry, upload, draw, .. } = median;
        report::Seconds { load: None, build, select, geometry, upload, draw, frame: median.frame() }
    }

    /// All of them, in order.
    pub(crate) fn frames(times: &[Self]) -> Vec<report::Frame> {
        times.iter().map(|times| report::Frame { seconds: times.frame(), paced: times.paced }).collect()
    }
}
