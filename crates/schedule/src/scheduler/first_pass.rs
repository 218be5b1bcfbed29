//! The first pass: every item once, near the plan.

use crate::plan::{Rule, nearest};

use super::Scheduler;
use crate::item::Step;

/// Standard deviations that the reserve for the coarsest levels has above its mean.
const RESERVE_SIGMAS: f64 = 2.0;
/// How many times faster than evenly over what remains a frame comes back to its plan.
const HASTE: f64 = 8.0;

impl Scheduler {
    /// Draws the next item, or waits for what is in flight where that would save its level.
    pub(super) fn next_in_first_pass(&mut self) -> Step {
        let item = self.frame.order[self.frame.position];
        let level = match (self.settled_level(item), self.settings.rule) {
            (Some(level), _) => level,
            (None, Rule::LeastError) => self.level_of_least_error(item),
            (None, Rule::Shares) => {
                let level = self.level_near_plan(item, self.in_flight_secs());
                let may_wait = !self.frame.in_flight.is_empty() && !self.frame.has_waited;
                if may_wait && self.level_near_plan(item, 0.0) < level {
                    self.frame.has_waited = true;
                    return Step::Wait;
                }
                level
            }
        };
        self.frame.position += 1;
        self.draw(item, level)
    }

    /// The level of least error for the time that is left, all other items that are left counted; a coarser one where a
    /// stall of this part would make the frame late.
    fn level_of_least_error(&mut self, item: usize) -> usize {
        let coarsest = self.frame.table.num_levels(item).saturating_sub(1);
        if !self.model.is_calibrated() {
            return coarsest;
        }
        let (scale, left_secs) = (self.scale(), self.left_secs());
        let frame = &mut self.frame;
        if std::mem::take(&mut frame.is_plan_old) {
            frame.table.plan_rest(left_secs / scale, &frame.order[frame.position..], &mut frame.planned);
        }
        let after_secs = scale * frame.remaining[frame.position + 1].floor_secs;
        let longest_secs = (left_secs - after_secs + self.slack_secs()) / (scale * self.spread());
        let costs = self.frame.table.levels_of(item);
        (self.frame.planned[item]..coarsest).find(|&level| costs[level] <= longest_secs).unwrap_or(coarsest)
    }

    /// The level that brings the frame back to its plan, if parts in flight stall no more than `in_flight_secs` can.
    fn level_near_plan(&self, item: usize, in_flight_secs: f64) -> usize {
        let frame = &self.frame;
        let costs = frame.table.levels_of(item);
        if !self.model.is_calibrated() {
            return costs.len().saturating_sub(1);
        }
        let (here, after) = (frame.remaining[frame.position], frame.remaining[frame.position + 1]);
        let (scale, left_secs) = (self.scale(), self.left_secs());
        let deviation = scale * self.model.errors().deviation() / self.model.errors().mean_ratio();
        let floor_secs = scale * after.floor_secs;
        let reserve_secs = floor_secs + RESERVE_SIGMAS * deviation * after.floor_squares.max(0.0).sqrt();
        let fits =
            |secs: f64| secs <= left_secs - reserve_secs && self.may_stall(secs, floor_secs, in_flight_secs);
        let planned = frame.planned_first(item);
        let planned_secs = costs.get(planned).map_or(0.0, |secs| secs * scale);
        let (remaining_secs, held_secs) = (scale * here.planned_secs, scale * frame.held_secs);
        let spare_secs = left_secs - remaining_secs;
        let off_secs = spare_secs.min(0.0) + (spare_secs - held_secs).max(0.0);
        let part = if remaining_secs > 0.0 { (HASTE * planned_secs / remaining_secs).min(1.0) } else { 1.0 };
        nearest(costs, scale, planned_secs + part * off_secs, fits)
    }
}
