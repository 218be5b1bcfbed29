//! Rest: while nothing moves, levels do not either.

use std::collections::BTreeMap;

use crate::plan::Limit;

use super::Scheduler;

/// How much what settled levels take may differ from what was predicted before they are chosen anew, and for how many
/// frames.
const MAX_DRIFT: f64 = 0.25;
const DRIFT_FRAMES: u32 = 8;
/// Of a frame, how much of earlier frames weighs against what is seen of this one.
const HABIT: f64 = 1.0;
/// How fast the time that settled frames take is learned.
const FRAME_GAIN: f64 = 0.2;
/// Frames of the last 16 that settled levels may fail before they are chosen anew.
const MAX_FAILED: u32 = 3;
/// How far off all predictions of a frame may be in common.
const DOUBT: f64 = 0.015;
/// Tolerances beyond the budget that the expected end may reach before settled levels are given up.
const PATIENCE: f64 = 2.0;

/// What a frame must resemble to be at rest.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    importance: f64,
    work: f64,
    /// The level settled on.
    level: Option<usize>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Rest {
    anchors: BTreeMap<u64, Anchor>,
    budget_secs: f64,
    num_frames: u32,
    has_settled: bool,
    /// What settled levels were predicted to take when they were chosen, and what they take.
    settled_secs: f64,
    expected_secs: f64,
    num_drifted: u32,
    /// One bit per frame.
    failed: u16,
    has_failed: bool,
}

fn has_moved(a: f64, b: f64, threshold: f64) -> bool {
    (a - b).abs() > threshold * a.abs().max(b.abs())
}

impl Scheduler {
    /// Compares the frame with the first one of the rest, and takes or makes settled levels.
    pub(super) fn begin_rest(&mut self) {
        let (frame, rest, threshold) = (&mut self.frame, &mut self.rest, self.settings.rest_threshold);
        let works = |item: usize| {
            let first = frame.table.first(item);
            frame.work[first..first + frame.table.num_levels(item)].iter().sum::<f64>()
        };
        let is_same = rest.anchors.len() == frame.slots.len()
            && !has_moved(rest.budget_secs, frame.budget_secs, threshold)
            && frame.slots.iter().enumerate().all(|(item, slot)| {
                rest.anchors.get(&slot.key).is_some_and(|anchor| {
                    !has_moved(anchor.importance, slot.importance, threshold)
                        && !has_moved(anchor.work, works(item), threshold)
                        && anchor.level.is_none_or(|level| level < frame.table.num_levels(item).max(1))
                })
            });
        if !is_same {
            let anchors = frame.slots.iter().enumerate().map(|(item, slot)| {
                (slot.key, Anchor { importance: slot.importance, work: works(item), level: None })
            });
            *rest = Rest { anchors: anchors.collect(), budget_secs: frame.budget_secs, ..Rest::default() };
            return;
        }
        rest.num_frames = rest.num_frames.saturating_add(1);
        rest.has_failed = false;
        if rest.num_frames == self.settings.settle_frames.max(1) {
            self.settle();
        }
        if self.rest.num_frames >= self.settings.settle_frames.max(1) {
            self.take_settled();
        }
    }

    /// Chooses the levels that stay: all that the budget allows, with room for noise. Uploads are needed once and then
    /// no more, so they do not count, unless levels were settled before and did not hold.
    fn settle(&mut self) {
        if self.rest.has_settled {
            self.choose_settled();
            return;
        }
        self.rest.has_settled = true;
        let no_bytes = vec![0.0; self.frame.bytes.len()];
        let bytes = std::mem::replace(&mut self.frame.bytes, no_bytes);
        self.frame.rebase(&self.model);
        self.choose_settled();
        self.frame.bytes = bytes;
        self.frame.rebase(&self.model);
    }

    fn choose_settled(&mut self) {
        let errors = self.model.errors();
        let mean = errors.mean_ratio();
        let limit = Limit {
            budget_secs: (1.0 - DOUBT) * self.frame.end_secs.max(0.0) / mean,
            sigmas: self.settings.rest_sigmas * errors.deviation() / mean,
        };
        let mut levels = Vec::new();
        self.frame.table.plan(&limit, self.settings.rule, &mut levels);
        for (slot, &level) in self.frame.slots.iter().zip(&levels) {
            if let Some(anchor) = self.rest.anchors.get_mut(&slot.key) {
                anchor.level = Some(level);
            }
        }
        self.frame.settled = levels;
        self.rest.settled_secs = self.settled_secs();
        self.rest.expected_secs = self.rest.settled_secs;
        self.rest.num_drifted = 0;
        self.rest.failed = 0;
    }

    fn take_settled(&mut self) {
        let (frame, rest) = (&mut self.frame, &mut self.rest);
        frame.settled.clear();
        frame.settled.extend(
            frame.slots.iter().map(|slot| {
                rest.anchors.get(&slot.key).and_then(|anchor| anchor.level).unwrap_or(usize::MAX)
            }),
        );
        let fits =
            frame.settled.iter().enumerate().all(|(item, &level)| {
                level < frame.table.num_levels(item) || frame.table.num_levels(item) == 0
            });
        if !fits {
            frame.settled.clear();
            rest.num_frames = 0;
            return;
        }
        frame.is_settled = true;
    }

    /// What settled levels are expected to take.
    fn settled_secs(&self) -> f64 {
        let table = &self.frame.table;
        let levels = self.frame.settled.iter().enumerate();
        let secs = levels.filter_map(|(item, &level)| table.levels_of(item).get(level));
        secs.sum::<f64>() * self.model.errors().mean_ratio()
    }

    /// The settled level of the next item, while the frame is not far too late for it.
    pub(super) fn settled_level(&mut self, item: usize) -> Option<usize> {
        if !self.frame.is_settled {
            return None;
        }
        let (remaining, all) = (self.frame.remaining[self.frame.position], self.frame.remaining[0]);
        let part = if all.settled_secs > 0.0 { remaining.settled_secs / all.settled_secs } else { 0.0 };
        // What settled frames took tells more than any prediction; a frame that runs slower so far will go on so.
        let expected_secs = self.rest.expected_secs;
        let known_secs = (1.0 - part + HABIT) * expected_secs;
        let elapsed_secs = self.frame.now_secs + self.in_flight_secs();
        let slower = ((elapsed_secs + HABIT * expected_secs) / known_secs.max(1e-300)).max(1.0);
        let patience_secs = PATIENCE * self.settings.tolerance * self.frame.budget_secs;
        if part * expected_secs * slower > self.left_secs() + patience_secs {
            self.frame.is_settled = false;
            self.rest.has_failed = true;
            return None;
        }
        self.frame.settled.get(item).copied()
    }

    /// Gives settled levels up where the device is not what it was.
    pub(super) fn end_rest(&mut self) {
        if self.frame.settled.is_empty() {
            return;
        }
        let (rest, frame) = (&mut self.rest, &self.frame);
        if frame.is_settled && frame.in_flight.is_empty() {
            let change =
                (frame.last_end_secs - rest.expected_secs).clamp(-rest.expected_secs, rest.expected_secs);
            rest.expected_secs += FRAME_GAIN * change;
        }
        let has_drifted = has_moved(rest.expected_secs, rest.settled_secs, MAX_DRIFT);
        rest.num_drifted = if has_drifted { rest.num_drifted + 1 } else { 0 };
        rest.failed = rest.failed << 1 | u16::from(rest.has_failed);
        if rest.num_drifted >= DRIFT_FRAMES || rest.failed.count_ones() > MAX_FAILED {
            rest.num_frames = 0;
            rest.anchors.values_mut().for_each(|anchor| anchor.level = None);
        }
    }
}
