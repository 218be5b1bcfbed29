//! Which level next.
//!
//! # Method
//! Li and Shen (2001, section 4) defer each decision until the part before is drawn: what is left of the budget is shared
//! out by importance among the parts that remain, and the level is taken whose predicted cost is nearest to the share. We
//! keep the rule and change where it is run.
//!
//! 1. *Plan* (`planning`). Before the first part, the loop is run on predictions ([`plan`](crate::plan())), so all levels
//!    are known and what remains afterwards makes items finer at once. An item whose importance moved by less than a
//!    threshold keeps the level that was planned in the last frame, if it is at most one level off; levels then
//!    change only where the plan is more than 1 % off the budget. (Paper, section 4.5; what noise made of a plan is not
//!    kept, so noise does not walk.)
//! 2. *First pass* (`first_pass`). Every item once. A frame that is ahead of its plan or behind it comes back by moving the
//!    next levels, at most by what they are planned to take; some cheap items are held back, drawn one level coarser, and
//!    made finer at the end, so that noise takes from them first. Before each part, the time that all others need at their
//!    coarsest is kept, with a margin. With [`Rule::LeastError`] none is held back: as costs become known, what is left is
//!    planned anew for the time that is left.
//! 3. *Refinement* (`refine`). While time is left, the item is drawn again whose next level removes most error * importance
//!    per second, as far as planned; finer than planned only if more than 2 % of the budget would be left.
//!
//! # Margins
//! A part starts only if it ends within the budget should it take what is expected; within 4 % beyond (`tolerance`)
//! should the longest in flight take what 99 % do not exceed; and within 10 % should all in flight take longer than the longest of
//! the last 512. Parts in flight count as predicted. Where their outcome would change a decision, the answer is
//! [`Step::Wait`].
//!
//! # Rest
//! The goal is two-sided, and rest is not: with the same levels in every frame, time varies by noise, and only moving levels
//! could fill it up. A frame that ends early harms nobody, one that ends late or flickers does. So when nothing moved for
//! four frames, levels are settled so that three standard deviations of the frame's time fit into the budget, and stay;
//! there is no refinement. They are given up for one frame where it would end more than 10 % late, and chosen anew if
//! that happens in 4 of 16 frames or if frames take a quarter more or less than predicted.
//!
//! # Guarantees
//! Every item with a level is drawn at least once in a frame, whatever the numbers. `next` ends after at most one part
//! per level and one wait per part. A clock that stands, jumps or runs back is limited by what parts are known to
//! have taken. The same calls give the same answers. O(n log n) per frame of n levels, O(log n) amortised per part.
//! Where even the coarsest levels do not fit, all is drawn so, and the summary says `is_at_floor`.
//!
//! # Limits
//! Accuracy is granularity: a part that stalls at the end of a frame makes it late by what it takes. With stalls of five
//! times in 5 % of parts, 99 % within 5 % needs about 100 items. Refinement draws an item again: what the coarse one took is
//! lost. Knows one device: for several, one scheduler each.

mod first_pass;
mod frame;
mod outside;
mod planning;
mod refine;
mod rest;

use std::collections::BTreeMap;

use crate::cost::CostModel;
use crate::item::{Controller, Item, Part, Step, Summary};
use crate::plan::Rule;
use frame::{Frame, InFlight};
use outside::Outside;
use rest::Rest;

/// Parts whose cost was never told, at most: the oldest are given up.
const MAX_PENDING: usize = 4096;
/// Of the tolerance, what one stall may take.
const SLACK: f64 = 0.8;
/// In tolerances, what stalls of all parts in flight may take.
const LIMIT: f64 = 2.0;
/// By how much the longest part of all will be more beyond its prediction than the second longest of 512.
const BEYOND_WORST: f64 = 1.6;
const FRAMES_KEPT: u64 = 1000;

/// Whether the scheduler may choose which item is next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Items in the order given, such as front to back; those made finer afterwards in any.
    #[default]
    Kept,
    /// The longest first, so that the last parts, which decide when the frame ends, are short.
    LargestFirst,
}

/// What the scheduler goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Whether the first pass may be in another order.
    pub order: Order,
    /// How the budget is shared out.
    pub rule: Rule,
    /// Whether works count all that parts take, so that no cost is the same for parts of any work.
    pub is_proportional: bool,
    /// How far from the budget a frame may end, relative to it. Parts that stall may take this much beyond the budget.
    pub tolerance: f64,
    /// A level stays while importance moved by less than this, relative to when it was chosen.
    pub importance_threshold: f64,
    /// A frame is at rest while importance and work of no item moved by more than this, relatively.
    pub rest_threshold: f64,
    /// Frames at rest after which levels are settled.
    pub settle_frames: u32,
    /// Standard deviations of the frame's time that settled levels leave below the budget.
    pub rest_sigmas: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            order: Order::Kept,
            rule: Rule::Shares,
            is_proportional: false,
            tolerance: 0.05,
            importance_threshold: 0.1,
            rest_threshold: 1e-3,
            settle_frames: 4,
            rest_sigmas: 3.0,
        }
    }
}

/// What is remembered of an item between frames.
#[derive(Clone, Copy, Debug)]
struct Memory {
    /// The level planned in its last frame: what noise then made of it is not kept.
    level: usize,
    /// Its importance when the level was chosen.
    importance: f64,
    last_frame: u64,
}

/// A part whose cost is not known yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    frame: u64,
    key: u64,
    work: f64,
    bytes: f64,
    predicted_secs: f64,
}

/// Chooses levels of detail so that frames end when they should.
#[derive(Clone, Debug, Default)]
pub struct Scheduler {
    settings: Settings,
    model: CostModel,
    outside: Outside,
    memory: BTreeMap<u64, Memory>,
    pending: BTreeMap<u64, Pending>,
    next_id: u64,
    frame_number: u64,
    frame: Frame,
    rest: Rest,
}

impl Scheduler {
    /// A scheduler that knows nothing yet.
    pub fn new(settings: Settings) -> Self {
        let model = if settings.is_proportional { CostModel::proportional() } else { CostModel::default() };
        Scheduler { settings, model, ..Scheduler::default() }
    }

    /// What was learned of costs.
    pub fn model(&self) -> &CostModel {
        &self.model
    }

    /// Says that the view moved, where neither importance nor work of items tells: levels that rest settled on are given
    /// up.
    pub fn disturb(&mut self) {
        self.rest = Rest::default();
    }

    /// What is expected outside of parts, such as reading the picture back.
    pub fn outside_secs(&self) -> f64 {
        self.outside.expected_secs()
    }

    /// The finest level drawn of each item of this frame, none where it is not drawn yet.
    pub fn levels(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.frame.slots.iter().map(|slot| slot.drawn)
    }

    /// Corrects in mid-frame what must be uploaded before a level is drawn: residency was lost, or came about. An item
    /// or level that is not there is ignored.
    pub fn set_bytes(&mut self, item: usize, level: usize, bytes: f64) {
        if self.frame.set_bytes(item, level, bytes) {
            self.frame.rebase(&self.model);
        }
    }

    /// Seconds that are left for parts not handed out yet, if those in flight take what is expected.
    fn left_secs(&self) -> f64 {
        self.frame.end_secs - self.frame.now_secs - self.in_flight_secs()
    }

    /// What parts in flight will still take.
    fn in_flight_secs(&self) -> f64 {
        let mean = self.model.errors().mean_ratio();
        let frame = &self.frame;
        let all: f64 = frame.in_flight.iter().map(|part| part.predicted_secs * mean).sum();
        let running = frame.in_flight.front().map_or(0.0, |part| part.predicted_secs * mean);
        let since = (frame.now_secs - frame.last_end_secs).max(0.0);
        all - since.min(0.9 * running)
    }

    /// Expected seconds per second in the frame's table.
    fn scale(&self) -> f64 {
        self.model.pace() / self.frame.base_pace * self.model.errors().mean_ratio()
    }

    /// How much longer than expected a part may take, once in a hundred.
    fn spread(&self) -> f64 {
        (self.model.errors().quantile_ratio(0.99) / self.model.errors().mean_ratio()).max(1.0)
    }

    /// How much longer than expected the longest of all may take. A single one is left out: that was a stall, not noise.
    fn worst_spread(&self) -> f64 {
        let errors = self.model.errors();
        1.0 + BEYOND_WORST * (errors.quantile_ratio(0.997) / errors.mean_ratio() - 1.0).max(0.0)
    }

    /// What one stall may take beyond the budget.
    fn slack_secs(&self) -> f64 {
        SLACK * self.settings.tolerance * self.frame.budget_secs
    }

    /// Whether a part of that many expected seconds may start, if others need `floor_secs` afterwards: one stall is
    /// within the tolerance, and stalls of all that is in flight within three of them.
    fn may_stall(&self, secs: f64, floor_secs: f64, in_flight_secs: f64) -> bool {
        let room_secs = self.frame.end_secs - self.frame.now_secs - in_flight_secs - floor_secs;
        let longest = if in_flight_secs > 0.0 { secs.max(self.longest_in_flight_secs()) } else { secs };
        let worst = self.worst_spread() - 1.0;
        let limit_secs = LIMIT * self.settings.tolerance * self.frame.budget_secs;
        secs + (self.spread() - 1.0) * longest <= room_secs + self.slack_secs()
            && secs + worst * (secs + in_flight_secs) <= room_secs + limit_secs
    }

    fn longest_in_flight_secs(&self) -> f64 {
        let mean = self.model.errors().mean_ratio();
        self.frame.in_flight.iter().map(|part| part.predicted_secs * mean).fold(0.0, f64::max)
    }

    /// Predicts and plans the frame anew, since costs are not what they seemed when it began.
    fn rebase(&mut self) {
        self.frame.rebase(&self.model);
        self.plan_levels();
        for (slot, &level) in self.frame.slots.iter_mut().zip(&self.frame.planned) {
            slot.is_held &= level + 1 < slot.num_levels;
        }
        self.frame.sum_remaining();
    }

    /// Hands a part out.
    fn draw(&mut self, item: usize, level: usize) -> Step {
        let frame = &mut self.frame;
        let index = frame.table.first(item) + level;
        let slot = &mut frame.slots[item];
        let is_refinement = slot.drawn.is_some();
        slot.drawn = Some(slot.drawn.map_or(level, |drawn| drawn.min(level)));
        let (work, bytes) = (frame.work[index], frame.bytes[index]);
        let predicted_secs = frame.table.secs[index] * self.model.pace() / frame.base_pace;
        let (id, key) = (self.next_id, slot.key);
        self.next_id += 1;
        self.pending.insert(id, Pending { frame: self.frame_number, key, work, bytes, predicted_secs });
        if self.pending.len() > MAX_PENDING {
            self.pending.pop_first();
        }
        frame.in_flight.push_back(InFlight { id, predicted_secs });
        // Drawn once, it is resident.
        frame.bytes[index] = 0.0;
        let expected = predicted_secs * self.model.errors().mean_ratio();
        frame.predicted_secs += expected;
        frame.num_parts += 1;
        frame.num_refinements += usize::from(is_refinement);
        Step::Draw(Part { id, item, level, is_refinement, pixel_rate: 1.0, predicted_secs: expected })
    }

    /// Keeps what the frame showed.
    fn remember(&mut self) {
        for (item, slot) in self.frame.slots.iter().enumerate() {
            if slot.drawn.is_some() && self.model.is_calibrated() {
                let (level, importance) = (self.frame.planned[item], slot.chosen_importance);
                let memory = Memory { level, importance, last_frame: self.frame_number };
                self.memory.insert(slot.key, memory);
            }
        }
        if self.frame_number.is_multiple_of(FRAMES_KEPT) {
            let frame = self.frame_number;
            self.memory.retain(|_, memory| memory.last_frame + FRAMES_KEPT > frame);
        }
    }
}

impl Controller for Scheduler {
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]) {
        self.frame_number += 1;
        self.model.begin_frame();
        self.frame.begin(budget_secs, self.outside.expected_secs(), items);
        self.frame.rebase(&self.model);
        for slot in &mut self.frame.slots {
            slot.kept = self.memory.get(&slot.key).map(|memory| (memory.level, memory.importance));
        }
        self.begin_rest();
        self.begin_plan();
    }

    fn next(&mut self, elapsed_secs: f64) -> Step {
        if !self.frame.is_open {
            return Step::Done;
        }
        self.frame.set_clock(elapsed_secs);
        if self.frame.position < self.frame.order.len() {
            self.next_in_first_pass()
        } else if self.frame.is_settled {
            Step::Done
        } else {
            self.next_refinement()
        }
    }

    fn observe(&mut self, part_id: u64, secs: f64) {
        let Some(pending) = self.pending.remove(&part_id) else { return };
        let Pending { frame, key, work, bytes, predicted_secs } = pending;
        let num_jumps = self.model.num_jumps();
        self.model.observe(key, work, bytes, predicted_secs, secs);
        if frame != self.frame_number || !self.frame.is_open {
            return;
        }
        self.frame.take_result(part_id, secs);
        let num = self.model.num_observed();
        if (num <= 64 && num.is_power_of_two()) || self.model.num_jumps() > num_jumps {
            self.rebase();
        }
    }

    fn finish(&mut self, actual_secs: f64) -> Summary {
        if !self.frame.is_open {
            return Summary::default();
        }
        self.frame.is_open = false;
        self.remember();
        self.end_rest();
        if self.frame.in_flight.is_empty() && self.frame.num_parts > 0 {
            self.outside.push(actual_secs - self.frame.last_end_secs);
        }
        self.frame.summary(actual_secs, self.outside.expected_secs())
    }
}
