//! The plan of a frame: levels for all items before the first is drawn.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::plan::{Limit, Rule, Total};

use super::{Order, Scheduler};

/// How far, relative to the budget, predictions of a plan that stays may be off it before levels change.
const DEAD_BAND: f64 = 0.01;
/// How many planned parts of mean length are held back.
const HELD_PARTS: f64 = 4.0;

impl Scheduler {
    /// Plans levels and puts items in order.
    pub(super) fn begin_plan(&mut self) {
        let frame = &mut self.frame;
        frame.order.extend((0..frame.slots.len()).filter(|&item| frame.table.num_levels(item) > 0));
        self.plan_levels();
        let frame = &mut self.frame;
        let (table, planned) = (&frame.table, &frame.planned);
        let mut by_cost = frame.order.clone();
        by_cost.sort_by_key(|&item| Total(table.secs_of(item, planned[item])));
        if self.settings.order == Order::LargestFirst {
            frame.order.clear();
            frame.order.extend(by_cost.iter().rev());
        }
        if !frame.is_settled && self.settings.rule == Rule::Shares {
            self.hold_back(&by_cost);
        }
        self.frame.sum_remaining();
    }

    /// Levels of the last frame where they may stay, others by the paper's loop, so that all take the budget.
    pub(super) fn plan_levels(&mut self) {
        let mean = self.model.errors().mean_ratio();
        let (frame, settings) = (&mut self.frame, &self.settings);
        let (table, levels) = (&frame.table, &mut frame.planned);
        if frame.is_settled {
            levels.clone_from(&frame.settled);
            return;
        }
        if !self.model.is_calibrated() {
            levels.clear();
            levels.extend((0..table.len()).map(|item| table.num_levels(item).saturating_sub(1)));
            return;
        }
        let limit = Limit { budget_secs: frame.end_secs.max(0.0) / mean, sigmas: 0.0 };
        table.plan(&limit, settings.rule, levels);
        let ideal = levels.clone();
        for (item, slot) in frame.slots.iter_mut().enumerate() {
            slot.chosen_importance = slot.importance;
            // Where errors are known a level beside the best one is worth less than rest.
            let kept = slot.kept.filter(|_| settings.rule == Rule::Shares);
            let Some((kept, importance)) = kept else { continue };
            let has_moved = (slot.importance - importance).abs() > settings.importance_threshold * importance;
            if !has_moved && kept < table.num_levels(item) && kept.abs_diff(ideal[item]) <= 1 {
                levels[item] = kept;
                slot.chosen_importance = importance;
            }
        }
        let cost = |item: usize, level: usize| table.levels_of(item).get(level).copied().unwrap_or(0.0);
        let mut sum: f64 = levels.iter().enumerate().map(|(item, &level)| cost(item, level)).sum();
        if sum > limit.budget_secs * (1.0 + DEAD_BAND) {
            // Those that lose least for each second go to the paper's level first; with all there, it fits.
            let mut heap: BinaryHeap<Reverse<_>> = (0..table.len())
                .filter(|&item| levels[item] < ideal[item])
                .filter_map(|item| table.candidate(item, levels[item] + 1).map(Reverse))
                .collect();
            while sum > limit.budget_secs
                && let Some(Reverse(candidate)) = heap.pop()
            {
                let Reverse(item) = candidate.item;
                sum += cost(item, ideal[item]) - cost(item, levels[item]);
                levels[item] = ideal[item];
            }
        } else if sum < limit.budget_secs * (1.0 - DEAD_BAND) {
            // Those that gain most for each second go to the paper's level first.
            let mut heap: BinaryHeap<_> = (0..table.len())
                .filter(|&item| levels[item] > ideal[item])
                .filter_map(|item| table.candidate(item, levels[item]))
                .collect();
            while let Some(candidate) = heap.pop() {
                let Reverse(item) = candidate.item;
                let more_secs = cost(item, ideal[item]) - cost(item, levels[item]);
                if sum + more_secs <= limit.budget_secs {
                    sum += more_secs;
                    levels[item] = ideal[item];
                }
            }
            table.refine(&limit, levels);
        }
    }

    /// Holds back the cheapest items: they are drawn one level coarser than planned first.
    fn hold_back(&mut self, by_cost: &[usize]) {
        let longest_secs = 2.0 * self.slack_secs() / self.spread() / self.model.errors().mean_ratio();
        let frame = &mut self.frame;
        let all: f64 = by_cost.iter().map(|&item| frame.table.secs_of(item, frame.planned[item])).sum();
        let wanted = HELD_PARTS * all / by_cost.len().max(1) as f64;
        for &item in by_cost {
            let level = frame.planned[item];
            let secs = frame.table.secs_of(item, level);
            if frame.held_secs >= wanted || secs > longest_secs {
                break;
            }
            if level + 1 < frame.table.num_levels(item) {
                frame.slots[item].is_held = true;
                frame.held_secs += secs;
            }
        }
    }
}
