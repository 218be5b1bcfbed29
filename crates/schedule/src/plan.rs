//! Levels for predicted costs: the paper's loop run on predictions, and refinement of what it leaves.
//!
//! # Method
//! In order, each item gets the share `left * importance / importance of those that remain` and the level whose cost is
//! nearest to it (Li and Shen 2001, sections 4.3 and 4.4), of those that leave the others their coarsest levels. What
//! an item leaves goes to the next. Levels are few, so something is left after the last one: items are then made finer,
//! one level at a time, where `importance * error removed / seconds` is largest, as long as it fits.
//!
//! Where errors are known ([`Rule::LeastError`]), all of the budget goes that way: from the coarsest levels on.
//!
//! # Guarantees
//! The sum of costs is within the budget, or all items are at their coarsest. O(n log n).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::item::{amount, secs as sane_secs, weights};

/// How a budget is shared out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rule {
    /// By importance; what is left goes where it removes most error.
    #[default]
    Shares,
    /// All of it goes where it removes most error times importance: greedily, from the coarsest levels on. Levels of the
    /// last frame are not kept, but at rest.
    LeastError,
}

/// An item whose costs are known.
#[derive(Clone, Copy, Debug)]
pub struct PlanItem<'a> {
    /// Its share of time among the others, in any unit.
    pub importance: f64,
    /// Cost of each level, from the finest to the coarsest.
    pub secs: &'a [f64],
    /// Error of each level; where it is missing, each level is worth as much as another.
    pub errors: &'a [f64],
}

/// Which level each item gets if costs are as predicted; none for an item without levels.
pub fn plan(budget_secs: f64, rule: Rule, items: &[PlanItem<'_>]) -> Vec<Option<usize>> {
    let mut table = Table::default();
    weights(items.iter().map(|item| item.importance), &mut table.weights);
    for item in items {
        for (level, &secs) in item.secs.iter().enumerate() {
            let error = item.errors.get(level).copied().unwrap_or((level + 1) as f64);
            table.push_level(secs, error);
        }
        table.end_item();
    }
    let limit = Limit { budget_secs: sane_secs(budget_secs), sigmas: 0.0 };
    let mut levels = Vec::new();
    table.plan(&limit, rule, &mut levels);
    levels.iter().enumerate().map(|(item, &level)| (table.num_levels(item) > 0).then_some(level)).collect()
}

/// What a plan may take: the sum of costs, plus `sigmas` times the root of the sum of their squares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    pub(crate) budget_secs: f64,
    pub(crate) sigmas: f64,
}

impl Limit {
    fn holds(&self, sum_secs: f64, sum_squares: f64) -> bool {
        sum_secs + self.sigmas * sum_squares.max(0.0).sqrt() <= self.budget_secs
    }
}

/// Costs and errors of all levels of all items, flat.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    pub(crate) weights: Vec<f64>,
    ends: Vec<usize>,
    pub(crate) secs: Vec<f64>,
    errors: Vec<f64>,
}

impl Table {
    pub(crate) fn clear(&mut self) {
        let Table { weights, ends, secs, errors } = self;
        weights.clear();
        ends.clear();
        secs.clear();
        errors.clear();
    }

    pub(crate) fn push_level(&mut self, secs: f64, error: f64) {
        self.secs.push(sane_secs(secs));
        self.errors.push(amount(error));
    }

    pub(crate) fn end_item(&mut self) {
        self.ends.push(self.secs.len());
    }

    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Index of the item's finest level.
    pub(crate) fn first(&self, item: usize) -> usize {
        if item == 0 { 0 } else { self.ends[item - 1] }
    }

    pub(crate) fn num_levels(&self, item: usize) -> usize {
        self.ends[item] - self.first(item)
    }

    pub(crate) fn secs_of(&self, item: usize, level: usize) -> f64 {
        self.secs[self.first(item) + level]
    }

    pub(crate) fn levels_of(&self, item: usize) -> &[f64] {
        &self.secs[self.first(item)..self.ends[item]]
    }

    /// Cost of the coarsest level, 0 for an item without levels.
    pub(crate) fn floor_secs(&self, item: usize) -> f64 {
        self.levels_of(item).last().copied().unwrap_or(0.0)
    }

    /// What the next finer level of an item brings per second; none at the finest.
    pub(crate) fn candidate(&self, item: usize, level: usize) -> Option<Candidate> {
        let finer = level.checked_sub(1)?;
        let first = self.first(item);
        let removed = self.errors[first + level] - self.errors[first + finer];
        let secs = self.secs[first + finer];
        let density = self.weights[item] * removed.max(0.0) / secs.max(1e-30);
        Some(Candidate { density: Total(density), secs: Reverse(Total(secs)), item: Reverse(item) })
    }

    /// The paper's loop.
    fn share(&self, limit: &Limit, levels: &mut Vec<usize>) {
        let mut floor: f64 = (0..self.len()).map(|item| self.floor_secs(item)).sum();
        let mut squares: f64 = (0..self.len()).map(|item| self.floor_secs(item).powi(2)).sum();
        let mut weight: f64 = self.weights.iter().sum();
        let mut spent = 0.0;
        levels.clear();
        for item in 0..self.len() {
            let costs = self.levels_of(item);
            let coarsest = self.floor_secs(item);
            floor -= coarsest;
            let left = limit.budget_secs - limit.sigmas * squares.max(0.0).sqrt() - spent;
            let share = left * part_of(self.weights[item], weight);
            weight -= self.weights[item];
            let level = nearest(costs, 1.0, share, |secs| {
                limit.holds(spent + floor + secs, squares - coarsest.powi(2) + secs.powi(2))
            });
            if let Some(secs) = costs.get(level) {
                spent += secs;
                squares += secs.powi(2) - coarsest.powi(2);
            }
            levels.push(level);
        }
    }

    /// Items made finer while the limit holds, those that gain most per second first.
    pub(crate) fn refine(&self, limit: &Limit, levels: &mut [usize]) {
        let cost = |item: usize| self.levels_of(item).get(levels[item]).copied().unwrap_or(0.0);
        let sum = (0..self.len()).map(cost).sum();
        let squares = (0..self.len()).map(|item| cost(item).powi(2)).sum();
        self.refine_some(limit, (sum, squares), 0..self.len(), levels);
    }

    /// Some items made finer, where the sum of costs and of their squares are these.
    fn refine_some(
        &self,
        limit: &Limit,
        (mut sum, mut squares): (f64, f64),
        items: impl Iterator<Item = usize>,
        levels: &mut [usize],
    ) {
        let mut heap: BinaryHeap<Candidate> =
            items.filter_map(|item| self.candidate(item, levels[item])).collect();
        while let Some(Candidate { item: Reverse(item), secs: Reverse(Total(secs)), .. }) = heap.pop() {
            let old = self.levels_of(item).get(levels[item]).copied().unwrap_or(0.0);
            let (new_sum, new_squares) = (sum - old + secs, squares - old.powi(2) + secs.powi(2));
            if limit.holds(new_sum, new_squares) {
                (sum, squares) = (new_sum, new_squares);
                levels[item] -= 1;
                heap.extend(self.candidate(item, levels[item]));
            }
        }
    }

    /// The least error that a budget allows for some of the items, from their coarsest levels on.
    pub(crate) fn plan_rest(&self, budget_secs: f64, items: &[usize], levels: &mut [usize]) {
        let mut sum = 0.0;
        for &item in items {
            levels[item] = self.num_levels(item).saturating_sub(1);
            sum += self.floor_secs(item);
        }
        self.refine_some(&Limit { budget_secs, sigmas: 0.0 }, (sum, 0.0), items.iter().copied(), levels);
    }

    /// Levels within a limit.
    pub(crate) fn plan(&self, limit: &Limit, rule: Rule, levels: &mut Vec<usize>) {
        match rule {
            Rule::Shares => self.share(limit, levels),
            Rule::LeastError => {
                levels.clear();
                levels.extend((0..self.len()).map(|item| self.num_levels(item).saturating_sub(1)));
            }
        }
        self.refine(limit, levels);
    }
}

/// A number with a total order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Total(pub(crate) f64);

impl PartialEq for Total {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Total {}

impl PartialOrd for Total {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Total {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// A refinement: most gain per second first, then the cheaper, then the earlier item.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Candidate {
    density: Total,
    pub(crate) secs: Reverse<Total>,
    pub(crate) item: Reverse<usize>,
}

/// `weight / sum`, 0 where that is no number.
pub(crate) fn part_of(weight: f64, sum: f64) -> f64 {
    if weight > 0.0 && sum > 0.0 { (weight / sum).min(1.0) } else { 0.0 }
}

/// The level whose cost, times `scale`, is nearest to a share, of those that `fits` takes; the finer of two as near; the
/// coarsest where none fits.
pub(crate) fn nearest(costs: &[f64], scale: f64, share: f64, fits: impl Fn(f64) -> bool) -> usize {
    let coarsest = costs.len().saturating_sub(1);
    let mut best = coarsest;
    for (level, secs) in costs.iter().enumerate().rev().skip(1) {
        let distance = |secs: f64| (secs * scale - share).abs();
        if fits(secs * scale) && distance(*secs) <= distance(costs[best]) {
            best = level;
        }
    }
    best
}
