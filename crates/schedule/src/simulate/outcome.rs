//! How frames ended.

use crate::item::Summary;

/// One frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameRecord {
    /// Time relative to the budget, less 1.
    pub signed_error: f64,
    /// What the controller said.
    pub summary: Summary,
    /// Items shown at another level than in the frame before.
    pub num_changed: usize,
    /// Items shown at each level; the last counts all coarser.
    pub levels: [u32; 8],
    /// Seconds that went to each third of items by importance, the least important first.
    pub class_secs: [f64; 3],
}

impl FrameRecord {
    /// Whether the frame could not have ended nearer to the budget: too long at the coarsest, too short at the finest.
    pub fn is_at_limit(&self) -> bool {
        (self.summary.is_at_floor && self.signed_error > 0.0)
            || (self.summary.is_at_ceiling && self.signed_error < 0.0)
    }
}

/// All frames of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// In order.
    pub frames: Vec<FrameRecord>,
}

impl Outcome {
    /// How the signed errors are distributed.
    pub fn distribution(&self) -> Distribution {
        Distribution::new(self.frames.iter().map(|frame| (frame.signed_error, frame.is_at_limit())))
    }

    /// Part of all time that went to each third of items by importance.
    pub fn class_shares(&self) -> [f64; 3] {
        let secs =
            [0, 1, 2].map(|class| self.frames.iter().map(|frame| frame.class_secs[class]).sum::<f64>());
        let all: f64 = secs.iter().sum();
        secs.map(|secs| if all > 0.0 { secs / all } else { 0.0 })
    }
}

/// A distribution of signed errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distribution {
    /// Frames.
    pub num_frames: usize,
    /// Quantiles 0, 1, 50, 95, 99 and 100 %.
    pub quantiles: [f64; 6],
    /// Part of frames within 5 % of the budget on both sides, or at a limit.
    pub within_5_percent: f64,
    /// Part of frames at most 5 % late, or at the floor.
    pub not_5_percent_late: f64,
    /// The latest that was not at the floor.
    pub max_not_at_limit: f64,
}

impl Distribution {
    /// From (signed error, whether it is at a limit).
    pub fn new(errors: impl Iterator<Item = (f64, bool)>) -> Self {
        let all: Vec<(f64, bool)> = errors.collect();
        if all.is_empty() {
            return Distribution::default();
        }
        let mut sorted: Vec<f64> = all.iter().map(|(error, _)| *error).collect();
        sorted.sort_by(f64::total_cmp);
        let num = all.len();
        let quantile = |part: f64| sorted[((part * num as f64).ceil() as usize).clamp(1, num) - 1];
        let part = |is_good: &dyn Fn(f64) -> bool| {
            all.iter().filter(|(error, is_at_limit)| *is_at_limit || is_good(*error)).count() as f64
                / num as f64
        };
        Distribution {
            num_frames: num,
            quantiles: [0.0, 0.01, 0.5, 0.95, 0.99, 1.0].map(quantile),
            within_5_percent: part(&|error| error.abs() <= 0.05),
            not_5_percent_late: part(&|error| error <= 0.05),
            max_not_at_limit: all.iter().filter(|at| !at.1).map(|at| at.0).fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

impl std::fmt::Display for Distribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [min, p1, p50, p95, p99, max] = self.quantiles.map(|quantile| 100.0 * quantile);
        write!(
            f,
            "min {min:6.1} p1 {p1:6.1} p50 {p50:6.1} p95 {p95:6.1} p99 {p99:6.1} max {max:6.1} % | within 5 %: \
             {:6.2} %, at most 5 % late: {:6.2} %",
            100.0 * self.within_5_percent,
            100.0 * self.not_5_percent_late
        )
    }
}
