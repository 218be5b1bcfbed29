//! What a part will take, learned from what parts took.
//!
//! # Method
//! Li and Shen (2001, section 4.2) predict upload + time per slice * slices, with the mean of what is already drawn in
//! place of a profile. We predict
//!
//! `pace * (fixed + per_work * work * factor[item] + per_byte * bytes)`
//!
//! `factor` is the item's own, since the cost of a unit of work differs among items (empty space, cache), and is
//! remembered between frames. `pace` is the level of all costs: it follows a device that is busy or clocked down. With
//! `r` = actual / predicted,
//! - each factor is multiplied by `r^(gain * part)`, where `part` is the work's part of the prediction;
//! - `pace` is multiplied by `r^gain`; the gain is small where errors look like noise, and grows where the last ones
//!   all point one way;
//! - `fixed` and `per_work` are shared out anew once a frame, by least squares of predicted / actual over the last few
//!   hundred parts; the mean of predictions stays, so that this and `pace` do not work against each other;
//! - `per_byte` follows actual less what is predicted for the work, since uploads are rare and may be short.
//!
//! Where works are alike, what is fixed and what goes with work cannot be told apart, and a wrong answer keeps factors from
//! being learned. A caller whose works count all that parts take says so ([`CostModel::proportional`]).
//!
//! # Robustness
//! ln r is limited to +-0.5, so a part that took five times as long moves a prediction no more than one that took 1.65
//! times as long. Five parts in a row that are off by more than half in the same direction are no spikes: `pace`
//! takes it over at once. (With 5 % of spikes that is wrong once in 3 million parts, and put right five parts
//! later.)
//!
//! So a prediction is of the usual cost, near the median. The mean is [`CostModel::expected_secs`]; margins are
//! quantiles of [`CostModel::errors`].
//!
//! Deterministic: the same observations in the same order give the same bits. An item not seen for 1000 frames is
//! forgotten. A prediction is between 0 and 1e9 seconds.

use std::collections::BTreeMap;

use crate::balance::Balance;
use crate::errors::ErrorRecord;
use crate::item::{amount, secs as sane_secs};

const LOG_LIMIT: f64 = 0.5;
/// How fast the pace follows where errors look like noise, and where they all point one way.
const PACE_GAINS: [f64; 2] = [0.005, 0.1];
/// The mean of the last errors at which the pace begins to hurry, and at which it does so fully.
const TRENDS: [f64; 2] = [0.1, 0.3];
const TREND_GAIN: f64 = 0.1;
const MIN_UPLOAD_GAIN: f64 = 0.02;
/// Of an item's own factor, where costs are fixed in part, and where they go with the work alone: then nothing else can
/// follow what moves through an item.
const MIN_FACTOR_GAINS: [f64; 2] = [0.08, 0.3];
/// Parts in a row that say that the device's speed is another, and by how much each must.
const NUM_IN_A_ROW: usize = 5;
const JUMP_RATIO: f64 = 1.5;
/// Errors made before so many parts were seen say nothing of later ones.
const NUM_TO_LEARN: u64 = 64;
const FRAMES_KEPT: u64 = 1000;
const MAX_PREDICTION_SECS: f64 = 1e9;
/// 10 GB/s, until an upload was seen.
const FIRST_SECS_PER_BYTE: f64 = 1e-10;
/// Of the first part ever.
const FIRST_FIXED_PART: f64 = 0.1;

/// A coefficient that stays a positive number.
fn limited(number: f64) -> f64 {
    number.clamp(1e-18, 1e12)
}

/// Fixed cost and work as features: 1, and work times the item's factor.
fn work_terms(terms: [f64; 3], secs_per_work: f64) -> [f64; 2] {
    [1.0, terms[1] / secs_per_work]
}

#[derive(Clone, Copy, Debug)]
struct Factor {
    ratio: f64,
    num_seen: u32,
    last_frame: u64,
}

/// Learns what parts take, and predicts it.
#[derive(Clone, Debug)]
pub struct CostModel {
    is_proportional: bool,
    fixed_secs: f64,
    secs_per_work: f64,
    secs_per_byte: f64,
    pace: f64,
    factors: BTreeMap<u64, Factor>,
    recent_logs: Vec<f64>,
    balance: Balance,
    /// Mean of the last logarithms of errors.
    trend: f64,
    errors: ErrorRecord,
    num_observed: u64,
    num_uploads: u64,
    num_jumps: u64,
    frame: u64,
}

impl Default for CostModel {
    fn default() -> Self {
        CostModel {
            is_proportional: false,
            fixed_secs: 0.0,
            secs_per_work: 0.0,
            secs_per_byte: FIRST_SECS_PER_BYTE,
            pace: 1.0,
            factors: BTreeMap::new(),
            recent_logs: Vec::with_capacity(NUM_IN_A_ROW),
            balance: Balance::default(),
            trend: 0.0,
            errors: ErrorRecord::default(),
            num_observed: 0,
            num_uploads: 0,
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

    /// Of parts whose cost goes with their work alone, all that is the same in each included.
    #[must_use]
    pub fn proportional() -> Self {
        CostModel { is_proportional: true, ..CostModel::default() }
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
        self.rebalance();
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
        if self.num_observed == NUM_TO_LEARN {
            self.errors.forget();
        }
        if self.num_observed < NUM_TO_LEARN && self.num_observed.is_power_of_two() {
            self.errors.refresh();
            self.rebalance();
        }
        let mut terms = self.terms(self.factor(key), work, bytes);
        if terms[2] > 0.0 {
            self.learn_upload(terms, secs);
            terms = self.terms(self.factor(key), work, bytes);
        }
        let predicted = self.pace * terms.iter().sum::<f64>();
        // A clock too coarse to see the part says only that it was short.
        let log = (secs.max(predicted / 100.0) / predicted).ln();
        if !log.is_finite() {
            return;
        }
        let [_, work_part, upload_part] = terms.map(|term| term * self.pace / predicted);
        self.balance.push(work_terms(terms, self.secs_per_work), secs - self.pace * terms[2]);
        if let Some(jump) = self.follow_jump(log) {
            self.pace = limited(self.pace * jump.exp());
            self.num_jumps += 1;
            self.trend = 0.0;
            return;
        }
        // An upload says little of the work.
        let log = log.clamp(-LOG_LIMIT, LOG_LIMIT) * (1.0 - upload_part);
        self.trend += TREND_GAIN * (log - self.trend);
        let haste = ((self.trend.abs() - TRENDS[0]) / (TRENDS[1] - TRENDS[0])).clamp(0.0, 1.0);
        let gain = PACE_GAINS[0] + haste * (PACE_GAINS[1] - PACE_GAINS[0]);
        let gain = gain.max(4.0 / (self.num_observed + 10) as f64);
        self.pace = limited(self.pace * (gain * log).exp());
        if self.num_observed >= NUM_TO_LEARN {
            self.learn_factor(key, work_part, log);
        }
    }

    fn learn_factor(&mut self, key: u64, work_part: f64, log: f64) {
        let frame = self.frame;
        let factor = self.factors.entry(key).or_insert(Factor { ratio: 1.0, num_seen: 0, last_frame: frame });
        let gain =
            MIN_FACTOR_GAINS[usize::from(self.is_proportional)].max(0.6 / f64::from(factor.num_seen + 1));
        factor.ratio = (factor.ratio * (gain * work_part * log).exp()).clamp(1e-3, 1e3);
        factor.num_seen = (factor.num_seen + 1).min(1000);
        factor.last_frame = frame;
    }

    /// The first part ever gives all coefficients their first value.
    fn calibrate(&mut self, work: f64, bytes: f64, secs: f64) {
        let rest = secs - (bytes * self.secs_per_byte).min(secs / 2.0);
        self.secs_per_byte = self.secs_per_byte.min(secs / 2.0 / bytes.max(1e-300));
        let fixed_part = if self.is_proportional { 0.0 } else { FIRST_FIXED_PART };
        self.fixed_secs = rest * fixed_part;
        self.secs_per_work = rest * (1.0 - fixed_part) / if work > 0.0 { work } else { 1.0 };
    }

    /// Takes what the part took beyond its work for the upload. The logarithm is limited, so it is the median that is
    /// found, however little of the part the upload was.
    fn learn_upload(&mut self, terms: [f64; 3], secs: f64) {
        let rest = secs / self.pace - terms[0] - terms[1];
        let limit = LOG_LIMIT * (1.0 + 8.0 / (self.num_uploads + 1) as f64);
        let log = (rest.max(1e-30) / terms[2]).ln().clamp(-limit, limit);
        let gain = MIN_UPLOAD_GAIN.max(0.6 / (self.num_uploads + 1) as f64);
        self.secs_per_byte = (self.secs_per_byte * (gain * log).exp()).clamp(1e-18, 1e6);
        self.num_uploads += 1;
    }

    /// Shares costs out anew between fixed cost and work; what is predicted in the mean stays.
    fn rebalance(&mut self) {
        if self.is_proportional {
            return;
        }
        if let Some([fixed_secs, secs_per_work]) = self.balance.solve([self.fixed_secs, self.secs_per_work]) {
            self.fixed_secs = limited(fixed_secs);
            self.secs_per_work = limited(secs_per_work);
        }
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
