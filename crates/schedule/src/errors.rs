//! How far predictions were off: the last 512 ratios of actual to predicted seconds, their mean, spread and quantiles.
//!
//! The mean is of sums, so long parts count more. It is above 1 where parts stall at times, since a prediction is of the
//! usual cost. A margin is a quantile: what
//! it covers is what was seen, whatever the distribution. Until 32 parts are known, quantiles above the median are at
//! least 3. Reading costs nothing; [`ErrorRecord::refresh`] sorts, once a frame.

const CAPACITY: usize = 512;
/// A part that takes longer than this many times its prediction counts as this.
const MAX_RATIO: f64 = 20.0;
const NUM_TRUSTED: usize = 32;

/// Ratios of actual to predicted seconds of the parts seen last.
#[derive(Clone, Debug, Default)]
pub struct ErrorRecord {
    /// With the prediction, which is the weight.
    ratios: Vec<(f64, f64)>,
    oldest: usize,
    sorted: Vec<f64>,
    mean: f64,
    deviation: f64,
}

impl ErrorRecord {
    /// Takes one prediction and what came of it. One that predicted nothing is left out.
    pub fn push(&mut self, predicted_secs: f64, secs: f64) {
        if !(predicted_secs > 0.0 && predicted_secs.is_finite() && secs >= 0.0) {
            return;
        }
        let ratio = (secs / predicted_secs).min(MAX_RATIO);
        if self.ratios.len() < CAPACITY {
            self.ratios.push((ratio, predicted_secs));
        } else {
            self.ratios[self.oldest] = (ratio, predicted_secs);
            self.oldest = (self.oldest + 1) % CAPACITY;
        }
    }

    /// Forgets all ratios; mean, spread and quantiles stay until they are brought up to date.
    pub(crate) fn forget(&mut self) {
        self.ratios.clear();
        self.oldest = 0;
    }

    /// Brings mean, spread and quantiles up to date.
    pub fn refresh(&mut self) {
        self.sorted.clear();
        self.sorted.extend(self.ratios.iter().map(|(ratio, _)| ratio));
        self.sorted.sort_by(f64::total_cmp);
        let weights: f64 = self.ratios.iter().map(|(_, weight)| weight).sum();
        let mean = |of: &dyn Fn(f64) -> f64| {
            self.ratios.iter().map(|(ratio, weight)| of(*ratio) * weight).sum::<f64>() / weights.max(1e-300)
        };
        self.mean = mean(&|ratio| ratio);
        self.deviation = mean(&|ratio| (ratio - self.mean).powi(2)).sqrt();
    }

    /// Parts known.
    pub fn len(&self) -> usize {
        self.ratios.len()
    }

    /// Whether none is known.
    pub fn is_empty(&self) -> bool {
        self.ratios.is_empty()
    }

    /// Actual over predicted seconds, in the mean: what sums of many parts follow. From 1/2 to 3.
    pub fn mean_ratio(&self) -> f64 {
        if self.sorted.len() < NUM_TRUSTED { 1.0 } else { self.mean.clamp(0.5, 3.0) }
    }

    /// Standard deviation of actual over predicted seconds.
    pub fn deviation(&self) -> f64 {
        if self.sorted.len() < NUM_TRUSTED { self.deviation.max(0.5) } else { self.deviation }
    }

    /// Actual over predicted seconds that the given part of predictions, from 0 to 1, was at or below.
    pub fn quantile_ratio(&self, part: f64) -> f64 {
        let num = self.sorted.len();
        let index = (part.clamp(0.0, 1.0) * num as f64).ceil() as usize;
        let found = self.sorted.get(index.clamp(1, num.max(1)) - 1).copied().unwrap_or(1.0);
        if num < NUM_TRUSTED && part > 0.5 { found.max(3.0) } else { found }
    }

    /// Signed relative error of predictions at a quantile: positive where parts took longer than predicted.
    pub fn signed_error(&self, part: f64) -> f64 {
        self.quantile_ratio(part) - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_what_was_seen_last() {
        let mut record = ErrorRecord::default();
        for index in 0..2048_u32 {
            record.push(2.0, 2.0 * f64::from(index % 128 + 1) / 64.0);
        }
        record.push(f64::NAN, 1.0);
        record.push(0.0, 1.0);
        record.push(1.0, f64::NAN);
        record.refresh();
        assert_eq!(record.len(), CAPACITY);
        for (part, expected) in [(0.5, 1.0), (0.99, 1.98), (1.0, 2.0)] {
            let found = record.quantile_ratio(part);
            println!("quantile {part}: {found}, expected {expected} within 0.03");
            assert!((found - expected).abs() < 0.03);
        }
        assert!((record.mean_ratio() - 1.01).abs() < 0.03, "{}", record.mean_ratio());
        assert!((record.deviation() - 0.577).abs() < 0.02, "{}", record.deviation());
        assert!((record.signed_error(0.25) + 0.5).abs() < 0.03);
    }

    #[test]
    fn little_knowledge_has_a_wide_margin() {
        let mut record = ErrorRecord::default();
        record.refresh();
        assert_eq!(record.quantile_ratio(0.99), 3.0);
        record.push(1.0, 1.0);
        record.refresh();
        assert_eq!(record.quantile_ratio(0.99), 3.0);
        assert_eq!(record.quantile_ratio(0.5), 1.0);
    }
}
