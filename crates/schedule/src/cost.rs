//! What a part will take, learned from what parts took.
//!
//! # Method
//! Li and Shen (2001, section 4.2) predict upload + time per slice * slices, with the mean of what is already drawn in
//! place of a profile. We predict
//!
//! `pace * (fixed + per_work * work * factor[item] + per_byte * bytes)`
//!
//! `factor` is the item's own, since the cost of a unit of work differs among items (empty space, cache), and is
//! remembered between frames. `pace` follows a device that is busy or clocked down. All are learned the same way: with
//! `r` = actual / predicted, each coefficient is multiplied by `r^(gain * part)`, where `part` is its part of the
//! prediction. So coefficients stay positive, units do not matter, and what cannot be seen is not changed.
//!
//! # Robustness
//! ln r is limited to +-0.5, so a part that took five times as long moves a prediction no more than one that took 1.65
//! times as long. Five parts in a row that are off by more than half in the same direction are no spikes: the
//! coefficients take it over at once. (With 5 % of spikes that is wrong once in 3 million parts, and put right five parts
//! later.)
//!
//! So a prediction is of the usual cost, near the median. The mean is [`CostModel::expected_secs`]; margins are
//! quantiles of [`CostModel::errors`].
//!
//! Deterministic: the same observations in the same order give the same bits. An item not seen for 1000 frames is
//! forgotten. A prediction is between 0 and 1e9 seconds.

use std::collections::BTreeMap;

use crate::errors::ErrorRecord;
use crate::item::{amount, secs as sane_secs};

const LOG_LIMIT: f64 = 0.5;
const PACE_GAIN: f64 = 0.03;
const COEFFICIENT_GAIN: f64 = 0.02;
const MIN_FACTOR_GAIN: f64 = 0.08;
/// Parts in a row that say that the device's speed is another, and by how much each must.
const NUM_IN_A_ROW: usize = 5;
const JUMP_RATIO: f64 = 1.5;
const FRAMES_KEPT: u64 = 1000;
const MAX_PREDICTION_SECS: f64 = 1e9;
/// 10 GB/s, until an upload was seen.
const FIRST_SECS_PER_BYTE: f64 = 1e-10;
/// Of the first part ever.
const FIRST_FIXED_PART: f64 = 0.1;

#[derive(Clone, Copy, Debug)]
struct Factor {
    ratio: f64,
    num_seen: u32,
    last_frame: u64,
}

/// Learns what parts take, and predicts it.
#[derive(Clone, Debug)]
pub struct CostModel {
    fixed_secs: f64,
    secs_per_work: f64,
    secs_per_byte: f64,
    pace: f64,
    factors: BTreeMap<u64, Factor>,
    recent_logs: Vec<f64>,
    errors: ErrorRecord,
    num_observed: u64,
    num_jumps: u64,
    frame: u64,
}

impl Default for CostModel {
    fn default() -> Self {
        CostModel {
            fixed_secs: 0.0,
            secs_per_work: 0.0,
            secs_per_byte: FIRST_SECS_PER_BYTE,
            pace: 1.0,
            factors: BTreeMap::new(),
            recent_logs: Vec::with_capacity(NUM_IN_A_ROW),
            errors: ErrorRecord::default(),
            num_observed: 0,
            num_jumps: 0,
            frame: 0,
        }
    }
}

impl CostModel {
    /// A model that knows nothing: it predicts little but uploads.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether a part was seen yet.
    pub fn is_calibrated(&self) -> bool {
        self.num_observed > 0
    }

    /// Parts seen.
    pub fn num_observed(&self) -> u64 {
        self.num_observed
    }

    /// How often costs were found to be others at once.
    pub fn num_jumps(&self) -> u64 {
        self.num_jumps
    }

    /// How the device is now, relative to what the other coefficients say.
    pub fn pace(&self) -> f64 {
        self.pace
    }

    /// How far predictions were off.
    pub fn errors(&self) -> &ErrorRecord {
        &self.errors
    }

    /// Begins a frame: brings quantiles up to date and forgets items that are long gone.
    pub fn begin_frame(&mut self) {
        self.frame += 1;
        self.errors.refresh();
        if self.frame.is_multiple_of(FRAMES_KEPT) {
            let frame = self.frame;
            self.factors.retain(|_, factor| factor.last_frame + FRAMES_KEPT > frame);
        }
    }

    /// What a unit of the item's work costs, relative to the others.
    fn factor(&self, key: u64) -> f64 {
        self.factors.get(&key).map_or(1.0, |factor| factor.ratio)
    }

    fn with_pace(&self, terms: [f64; 3]) -> f64 {
        (self.pace * terms.iter().sum::<f64>()).min(MAX_PREDICTION_SECS)
    }

    /// Seconds for fixed cost, work and upload, before the pace.
    fn terms(&self, factor: f64, work: f64, bytes: f64) -> [f64; 3] {
        [self.fixed_secs, self.secs_per_work * amount(work) * factor, self.secs_per_byte * amount(bytes)]
    }

    /// What each level of an item will usually take, in the order given as (work, bytes).
    pub fn predict_levels<'a>(
        &'a self,
        key: u64,
        levels: impl Iterator<Item = (f64, f64)> + 'a,
    ) -> impl Iterator<Item = f64> + 'a {
        let factor = self.factor(key);
        levels.map(move |(work, bytes)| self.with_pace(self.terms(factor, work, bytes)))
    }

    /// What the part will usually take.
    pub fn predict_secs(&self, key: u64, work: f64, bytes: f64) -> f64 {
        self.with_pace(self.terms(self.factor(key), work, bytes))
    }

    /// What the part will take in the mean, stalls included.
    pub fn expected_secs(&self, key: u64, work: f64, bytes: f64) -> f64 {
        self.predict_secs(key, work, bytes) * self.errors.mean_ratio()
    }

    /// Learns from a part: `predicted_secs` is what was predicted when it was decided, `secs` what it took. Seconds
    /// that are not a number teach nothing.
    pub fn observe(&mut self, key: u64, work: f64, bytes: f64, predicted_secs: f64, secs: f64) {
        if secs.is_nan() || secs < 0.0 {
            return;
        }
        let secs = sane_secs(secs);
        if self.num_observed == 0 {
            if secs == 0.0 {
                return;
            }
            self.calibrate(amount(work), amount(bytes), secs);
        } else {
            self.errors.push(predicted_secs, secs);
        }
        self.num_observed += 1;
        if self.num_observed <= 64 && self.num_observed.is_power_of_two() {
            self.errors.refresh();
        }
        let terms = self.terms(self.factor(key), work, bytes);
        let predicted = self.pace * terms.iter().sum::<f64>();
        // A clock too coarse to see the part says only that it was short.
        let log = (secs.max(predicted / 100.0) / predicted).ln();
        if !log.is_finite() {
            return;
        }
        let parts = terms.map(|term| term * self.pace / predicted);
        if let Some(jump) = self.follow_jump(log) {
            self.adjust(parts, jump);
            self.num_jumps += 1;
            return;
        }
        let log = log.clamp(-LOG_LIMIT, LOG_LIMIT);
        self.pace = (self.pace * (PACE_GAIN * log).exp()).clamp(1e-12, 1e12);
        self.adjust(parts, COEFFICIENT_GAIN * log);
        let work_part = parts[1];
        let frame = self.frame;
        let factor =
            self.factors.entry(key).or_insert(Factor { ratio: 1.0, num_seen: 0, last_frame: frame });
        let gain = MIN_FACTOR_GAIN.max(0.6 / f64::from(factor.num_seen + 1));
        factor.ratio = (factor.ratio * (gain * work_part * log).exp()).clamp(1e-3, 1e3);
        factor.num_seen = (factor.num_seen + 1).min(1000);
        factor.last_frame = frame;
    }

    /// The first part ever gives all coefficients their first value.
    fn calibrate(&mut self, work: f64, bytes: f64, secs: f64) {
        let rest = secs - (bytes * self.secs_per_byte).min(secs / 2.0);
        self.secs_per_byte = self.secs_per_byte.min(secs / 2.0 / bytes.max(1e-300));
        self.fixed_secs = rest * FIRST_FIXED_PART;
        self.secs_per_work = rest * (1.0 - FIRST_FIXED_PART) / if work > 0.0 { work } else { 1.0 };
    }

    /// Multiplies each coefficient by `e^(step * its part)`.
    fn adjust(&mut self, parts: [f64; 3], step: f64) {
        let [fixed, work, upload] = parts;
        let adjusted = |number: f64, part: f64| (number * (step * part).exp()).clamp(1e-18, 1e6);
        self.fixed_secs = adjusted(self.fixed_secs, fixed);
        self.secs_per_work = adjusted(self.secs_per_work, work);
        self.secs_per_byte = adjusted(self.secs_per_byte, upload);
    }

    /// Several parts in a row agree that costs are others: how much of the logarithm is to be taken over at once.
    fn follow_jump(&mut self, log: f64) -> Option<f64> {
        let limit = JUMP_RATIO.ln();
        let goes_on = self.recent_logs.last().is_none_or(|last| last.signum() == log.signum());
        if log.abs() < limit || !goes_on {
            self.recent_logs.clear();
        }
        if log.abs() < limit {
            return None;
        }
        self.recent_logs.push(log);
        if self.recent_logs.len() < NUM_IN_A_ROW {
            return None;
        }
        self.recent_logs.sort_by(f64::total_cmp);
        // The middle one: spikes among them do not count.
        let middle = NUM_IN_A_ROW / 2;
        let jump = self.recent_logs[middle];
        self.recent_logs.clear();
        Some(jump)
    }
}
