//! The state of one frame: its items flat, its clock, what is in flight.

use std::collections::{BinaryHeap, VecDeque};

use crate::cost::CostModel;
use crate::item::{Item, Summary, amount, secs as sane_secs, weights};
use crate::plan::{Candidate, Table};

use super::refine::Parked;

/// An item of the frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slot {
    pub(super) key: u64,
    pub(super) num_levels: usize,
    /// As given, but a number.
    pub(super) importance: f64,
    /// The importance at which its level was chosen, in this frame or before.
    pub(super) chosen_importance: f64,
    /// Level of its last frame, and the importance at which that was chosen.
    pub(super) kept: Option<(usize, f64)>,
    /// Whether it is to be drawn coarsely first.
    pub(super) is_held: bool,
    /// The finest level drawn yet.
    pub(super) drawn: Option<usize>,
}

/// A part handed out whose cost is not known.
#[derive(Clone, Copy, Debug)]
pub(super) struct InFlight {
    pub(super) id: u64,
    pub(super) predicted_secs: f64,
}

/// What remains at one place of the order and after it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Remaining {
    /// Seconds of the coarsest levels, in the table's units.
    pub(super) floor_secs: f64,
    /// Sum of their squares.
    pub(super) floor_squares: f64,
    /// Seconds of the planned levels, or the coarser ones that those held back begin with.
    pub(super) planned_secs: f64,
    /// Seconds of the settled levels.
    pub(super) settled_secs: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Frame {
    pub(super) is_open: bool,
    pub(super) budget_secs: f64,
    /// When parts should end.
    pub(super) end_secs: f64,
    pub(super) table: Table,
    pub(super) work: Vec<f64>,
    pub(super) bytes: Vec<f64>,
    pub(super) slots: Vec<Slot>,
    /// The model's pace when the table was made.
    pub(super) base_pace: f64,

    /// Items in the order of the first pass, and how many of them are handed out.
    pub(super) order: Vec<usize>,
    pub(super) position: usize,
    pub(super) remaining: Vec<Remaining>,
    /// Levels planned, by item.
    pub(super) planned: Vec<usize>,
    /// Whether something was seen since.
    pub(super) is_plan_old: bool,
    /// What it takes to make those finer that are held back, in the table's units.
    pub(super) held_secs: f64,
    /// Levels that rest has settled on, by item; empty where it has not.
    pub(super) settled: Vec<usize>,
    pub(super) is_settled: bool,

    pub(super) now_secs: f64,
    observed_secs: f64,
    /// When the last part whose cost is known ended.
    pub(super) last_end_secs: f64,
    has_news: bool,
    pub(super) in_flight: VecDeque<InFlight>,

    pub(super) is_refining: bool,
    pub(super) has_waited: bool,
    pub(super) candidates: BinaryHeap<Candidate>,
    pub(super) parked: BinaryHeap<Parked>,

    pub(super) predicted_secs: f64,
    pub(super) num_parts: usize,
    pub(super) num_refinements: usize,
}

impl Frame {
    pub(super) fn begin(&mut self, budget_secs: f64, outside_secs: f64, items: &[Item<'_>]) {
        self.is_open = true;
        self.budget_secs = sane_secs(budget_secs);
        self.end_secs = self.budget_secs - outside_secs;
        self.table.clear();
        self.work.clear();
        self.bytes.clear();
        self.slots.clear();
        weights(items.iter().map(|item| item.importance), &mut self.table.weights);
        for item in items {
            for level in item.levels {
                self.work.push(amount(level.work));
                self.bytes.push(amount(level.bytes));
                self.table.push_level(0.0, level.error);
            }
            self.table.end_item();
            let importance = amount(item.importance);
            self.slots.push(Slot {
                key: item.key,
                num_levels: item.levels.len(),
                importance,
                chosen_importance: importance,
                ..Slot::default()
            });
        }
        self.order.clear();
        self.position = 0;
        self.planned.clear();
        self.is_plan_old = false;
        self.held_secs = 0.0;
        self.settled.clear();
        self.is_settled = false;
        (self.now_secs, self.observed_secs, self.last_end_secs) = (0.0, 0.0, 0.0);
        self.has_news = false;
        self.in_flight.clear();
        (self.is_refining, self.has_waited) = (false, false);
        self.candidates.clear();
        self.parked.clear();
        (self.predicted_secs, self.num_parts, self.num_refinements) = (0.0, 0, 0);
    }

    /// Predicts all levels anew.
    pub(super) fn rebase(&mut self, model: &CostModel) {
        for (item, slot) in self.slots.iter().enumerate() {
            let first = self.table.first(item);
            let range = first..first + self.table.num_levels(item);
            let levels =
                self.work[range.clone()].iter().copied().zip(self.bytes[range.clone()].iter().copied());
            for (secs, predicted) in
                self.table.secs[range].iter_mut().zip(model.predict_levels(slot.key, levels))
            {
                *secs = predicted;
            }
        }
        self.base_pace = model.pace();
        if !self.order.is_empty() {
            self.sum_remaining();
        }
        if self.is_refining {
            self.list_candidates();
        }
    }

    /// The level that an item should be drawn at first.
    pub(super) fn planned_first(&self, item: usize) -> usize {
        self.planned[item] + usize::from(self.slots[item].is_held)
    }

    /// Sums what remains, from the end of the order.
    pub(super) fn sum_remaining(&mut self) {
        let mut sum = Remaining::default();
        self.remaining.clear();
        self.remaining.resize(self.order.len() + 1, sum);
        for (place, &item) in self.order.iter().enumerate().rev() {
            let floor = self.table.floor_secs(item);
            sum.floor_secs += floor;
            sum.floor_squares += floor * floor;
            sum.planned_secs += self.table.secs_of(item, self.planned_first(item));
            if let Some(&level) = self.settled.get(item) {
                sum.settled_secs += self.table.secs_of(item, level);
            }
            self.remaining[place] = sum;
        }
    }

    /// Whether there is such a level.
    pub(super) fn set_bytes(&mut self, item: usize, level: usize, bytes: f64) -> bool {
        let is_there = item < self.table.len() && level < self.table.num_levels(item);
        if is_there {
            self.bytes[self.table.first(item) + level] = amount(bytes);
        }
        is_there
    }

    /// A clock that stands, jumps back or is no number is not believed: time does not run backwards, and at least as much
    /// has passed as parts are known to have taken.
    pub(super) fn set_clock(&mut self, elapsed_secs: f64) {
        let elapsed = if elapsed_secs.is_finite() { sane_secs(elapsed_secs) } else { 0.0 };
        self.now_secs = self.now_secs.max(elapsed).max(self.observed_secs);
        if std::mem::take(&mut self.has_news) {
            self.last_end_secs = self.now_secs;
        }
    }

    /// Takes the cost of a part of this frame.
    pub(super) fn take_result(&mut self, part_id: u64, secs: f64) {
        self.in_flight.retain(|part| part.id != part_id);
        let secs = if secs.is_finite() { sane_secs(secs) } else { 0.0 };
        self.observed_secs += secs;
        self.last_end_secs += secs;
        (self.has_news, self.is_plan_old) = (true, true);
        self.has_waited = false;
    }

    pub(super) fn summary(&self, actual_secs: f64, outside_secs: f64) -> Summary {
        let shown = || {
            let slots = self.slots.iter().enumerate().filter(|(item, _)| self.table.num_levels(*item) > 0);
            slots.map(|(item, slot)| (slot.drawn, self.table.num_levels(item) - 1))
        };
        Summary {
            budget_secs: self.budget_secs,
            actual_secs,
            predicted_secs: self.predicted_secs + outside_secs,
            num_parts: self.num_parts,
            num_refinements: self.num_refinements,
            is_at_floor: shown().all(|(drawn, coarsest)| drawn == Some(coarsest)),
            is_at_ceiling: shown().all(|(drawn, _)| drawn == Some(0)),
            is_settled: self.is_settled,
        }
    }
}
