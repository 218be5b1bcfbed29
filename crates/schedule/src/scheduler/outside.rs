//! What a frame takes outside of its parts.

use crate::item::secs;

const NUM_FRAMES: usize = 16;

/// The last 16 measured; their median is expected, so one frame that the system held up does not count.
#[derive(Clone, Debug, Default)]
pub(super) struct Outside {
    seen: Vec<f64>,
    oldest: usize,
    median_secs: f64,
}

impl Outside {
    pub(super) fn push(&mut self, outside_secs: f64) {
        if !outside_secs.is_finite() {
            return;
        }
        if self.seen.len() < NUM_FRAMES {
            self.seen.push(secs(outside_secs));
        } else {
            self.seen[self.oldest] = secs(outside_secs);
            self.oldest = (self.oldest + 1) % NUM_FRAMES;
        }
        let mut sorted = self.seen.clone();
        sorted.sort_by(f64::total_cmp);
        self.median_secs = sorted[sorted.len() / 2];
    }

    pub(super) fn expected_secs(&self) -> f64 {
        self.median_secs
    }
}
