//! A tolerance that follows the time of frames.
//!
//! The controlled number is the logarithm of the tolerance, since time falls about with a power of it. With the last
//! frame's signed error e, limited to +-1, and its change since the frame before, d:
//! - PI in velocity form: proportional * d + integral * e is added.
//! - Fuzzy: e and d each belong to five sets (very early, early, right, late, very late) by triangles that meet at
//!   half their height; 25 rules say what to add, and the rules that hold are averaged by how much they hold.

use crate::item::{Controller, Item, Step, Summary};

use super::fixed::level_within;
use super::script::Script;

/// How the tolerance follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// Proportional and integral control.
    Pi {
        /// Added per change of the error.
        proportional: f64,
        /// Added per error.
        integral: f64,
    },
    /// Rules over five sets.
    Fuzzy,
}

impl Law {
    /// PI control whose gains were found to settle within four frames in the simulator.
    pub const PI: Law = Law::Pi { proportional: 0.2, integral: 0.35 };

    /// What is added to the logarithm of the tolerance.
    fn step(self, error: f64, change: f64) -> f64 {
        match self {
            Law::Pi { proportional, integral } => proportional * change + integral * error,
            Law::Fuzzy => fuzzy_step(error, change),
        }
    }
}

/// The middles of the five sets.
const MIDDLES: [f64; 5] = [-0.5, -0.15, 0.0, 0.15, 0.5];
/// What to add, by set of the error (row) and of its change (column).
const RULES: [[f64; 5]; 5] = [
    [-0.6, -0.5, -0.4, -0.2, -0.1],
    [-0.3, -0.2, -0.1, 0.0, 0.1],
    [-0.1, -0.05, 0.0, 0.05, 0.1],
    [-0.1, 0.0, 0.1, 0.2, 0.3],
    [0.1, 0.2, 0.4, 0.5, 0.6],
];

/// How much a number belongs to each set; the sum is 1.
fn membership(number: f64) -> [f64; 5] {
    let mut parts = [0.0; 5];
    let number = number.clamp(MIDDLES[0], MIDDLES[4]);
    let above = MIDDLES.iter().position(|middle| number <= *middle).unwrap_or(4).max(1);
    let part = (number - MIDDLES[above - 1]) / (MIDDLES[above] - MIDDLES[above - 1]);
    parts[above - 1] = 1.0 - part;
    parts[above] = part;
    parts
}

fn fuzzy_step(error: f64, change: f64) -> f64 {
    let (errors, changes) = (membership(error), membership(change));
    let rows = errors.iter().zip(RULES);
    rows.map(|(held, row)| held * changes.iter().zip(row).map(|(held, step)| held * step).sum::<f64>()).sum()
}

/// A tolerance that follows the time of frames.
#[derive(Clone, Debug)]
pub struct Feedback {
    law: Law,
    log_tolerance: Option<f64>,
    /// Logarithms of the smallest and the largest positive error of any level.
    limits: [f64; 2],
    error_before: f64,
    script: Script,
}

impl Feedback {
    /// Feedback by a law; it begins in the middle between the smallest and the largest error.
    pub fn new(law: Law) -> Self {
        Feedback { law, log_tolerance: None, limits: [0.0; 2], error_before: 0.0, script: Script::default() }
    }
}

impl Controller for Feedback {
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]) {
        let errors = items.iter().flat_map(|item| item.levels).map(|level| level.error);
        let errors = errors.filter(|error| *error > 0.0 && error.is_finite());
        let (low, high) =
            errors.fold((f64::MAX, 0.0_f64), |(low, high), error| (low.min(error), high.max(error)));
        self.limits = if low <= high { [low.ln() - 0.1, high.ln() + 0.1] } else { [0.0; 2] };
        let log = self.log_tolerance.unwrap_or(f64::midpoint(self.limits[0], self.limits[1]));
        let tolerance = log.exp();
        self.log_tolerance = Some(log);
        self.script.begin(budget_secs, items, |item| level_within(item, tolerance));
    }

    fn next(&mut self, _elapsed_secs: f64) -> Step {
        self.script.next()
    }

    fn observe(&mut self, _part_id: u64, _secs: f64) {}

    fn finish(&mut self, actual_secs: f64) -> Summary {
        let Some(summary) = self.script.finish(actual_secs) else { return Summary::default() };
        let error = summary.signed_error().clamp(-1.0, 1.0);
        if actual_secs > 0.0 && error.is_finite() {
            let log = self.log_tolerance.unwrap_or(0.0) + self.law.step(error, error - self.error_before);
            self.log_tolerance = Some(log.clamp(self.limits[0], self.limits[1]));
            self.error_before = error;
        }
        summary
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_share_every_number_out() {
        for step in -30..=30 {
            let number = f64::from(step) / 20.0;
            let parts = membership(number);
            assert!((parts.iter().sum::<f64>() - 1.0).abs() < 1e-12 && parts.iter().all(|part| *part >= 0.0));
        }
        assert_eq!(membership(0.0), [0.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(membership(-9.0), [1.0, 0.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn late_frames_raise_the_tolerance_and_early_ones_lower_it() {
        for law in [Law::PI, Law::Fuzzy] {
            assert_eq!(law.step(0.0, 0.0), 0.0);
            for error in [0.05, 0.2, 0.6, 1.0] {
                assert!(law.step(error, 0.0) > 0.0 && law.step(-error, 0.0) < 0.0, "{law:?} {error}");
            }
        }
    }
}
