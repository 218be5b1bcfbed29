//! The second pass: what is left makes items finer.

use std::cmp::Reverse;

use crate::item::Step;
use crate::plan::{Candidate, Total};

use super::Scheduler;
use super::frame::Frame;

/// Of the budget, what may be left before levels become finer than planned: less is not worth the flicker.
const QUIET: f64 = 0.02;

/// A refinement that did not fit: the cheapest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Parked {
    secs: Reverse<Total>,
    candidate: Candidate,
}

impl Frame {
    /// The next finer level of every item.
    pub(super) fn list_candidates(&mut self) {
        self.candidates.clear();
        self.parked.clear();
        let (table, slots) = (&self.table, &self.slots);
        let all = slots.iter().enumerate().filter_map(|(item, slot)| table.candidate(item, slot.drawn?));
        self.candidates.extend(all);
    }
}

impl Scheduler {
    pub(super) fn next_refinement(&mut self) -> Step {
        if !self.model.is_calibrated() {
            return self.wait_or_done();
        }
        if !self.frame.is_refining {
            self.frame.is_refining = true;
            self.frame.rebase(&self.model);
        }
        if let Some(step) = self.refine_best() {
            return step;
        }
        // Time may have come free since these did not fit.
        while let Some(&Parked { secs: Reverse(Total(secs)), candidate }) = self.frame.parked.peek() {
            let Reverse(item) = candidate.item;
            if !self.may_start(item, secs) {
                break;
            }
            self.frame.parked.pop();
            self.frame.candidates.push(candidate);
        }
        self.refine_best()
            .unwrap_or_else(|| if self.frame.parked.is_empty() { Step::Done } else { self.wait_or_done() })
    }

    /// The candidate that gains most per second, of those that fit.
    fn refine_best(&mut self) -> Option<Step> {
        while let Some(candidate) = self.frame.candidates.pop() {
            let (Reverse(Total(secs)), Reverse(item)) = (candidate.secs, candidate.item);
            if !self.may_start(item, secs) {
                self.frame.parked.push(Parked { secs: candidate.secs, candidate });
                continue;
            }
            let level = self.frame.slots[item].drawn.unwrap_or(0).saturating_sub(1);
            self.frame.candidates.extend(self.frame.table.candidate(item, level));
            return Some(self.draw(item, level));
        }
        None
    }

    /// Whether a part of that many seconds in the table should end in time: within the budget if it takes what is
    /// expected, and within the slack if the longest part under way stalls.
    fn may_start(&self, item: usize, secs: f64) -> bool {
        let secs = secs * self.scale();
        let left_secs = self.left_secs();
        let is_planned = self.frame.slots[item].drawn.is_some_and(|level| level > self.frame.planned[item]);
        (is_planned || left_secs > QUIET * self.frame.budget_secs)
            && secs <= left_secs
            && self.may_stall(secs, 0.0, self.in_flight_secs())
    }

    /// While something is in flight, its outcome may leave room; the caller waits for it anyway.
    fn wait_or_done(&mut self) -> Step {
        if self.frame.in_flight.is_empty() || self.frame.has_waited {
            return Step::Done;
        }
        self.frame.has_waited = true;
        Step::Wait
    }
}
