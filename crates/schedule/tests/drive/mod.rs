//! A device by closures, for tests.

#![allow(dead_code, reason = "each test file uses its part")]

use std::collections::VecDeque;

use volery_schedule::{Controller, Item, Level, Part, Step, Summary};

/// An item by its key, importance and levels.
#[derive(Clone, Debug)]
pub(crate) struct Owned {
    pub(crate) key: u64,
    pub(crate) importance: f64,
    pub(crate) levels: Vec<Level>,
}

/// Items of five levels, each four times cheaper than the one before, with works from 1e6 to 2e6.
pub(crate) fn items(num: u64) -> Vec<Owned> {
    let work = |key: u64| 1e6 * (1.0 + (key * 7 % 10) as f64 / 10.0);
    let level = |key: u64, level: i32| Level {
        work: work(key) / 4_f64.powi(level),
        bytes: 0.0,
        error: 2_f64.powi(level) - 1.0,
    };
    let of = |key| Owned { key, importance: 1.0, levels: (0..5).map(|at| level(key, at)).collect() };
    (0..num).map(of).collect()
}

pub(crate) fn borrow(items: &[Owned]) -> Vec<Item<'_>> {
    items
        .iter()
        .map(|item| Item { key: item.key, importance: item.importance, levels: &item.levels })
        .collect()
}

/// What became of a frame.
#[derive(Debug, Default)]
pub(crate) struct Played {
    pub(crate) parts: Vec<Part>,
    /// The finest level drawn of each item.
    pub(crate) shown: Vec<Option<usize>>,
    pub(crate) summary: Summary,
    pub(crate) num_waits: usize,
}

/// Plays one frame with two parts in flight. `cost` says what a part takes, `clock` what the controller is told of the
/// time that passed.
pub(crate) fn play(
    controller: &mut dyn Controller,
    items: &[Owned],
    budget_secs: f64,
    mut cost: impl FnMut(&Part, &Level) -> f64,
    mut clock: impl FnMut(f64) -> f64,
) -> Played {
    let mut played = Played { shown: vec![None; items.len()], ..Played::default() };
    let mut in_flight: VecDeque<(u64, f64, f64)> = VecDeque::new();
    let (mut now, mut free_at) = (0.0_f64, 0.0_f64);
    controller.begin(budget_secs, &borrow(items));
    let limit = items.iter().map(|item| 4 * item.levels.len() + 4).sum::<usize>() + 4;
    for step in 0.. {
        assert!(step <= limit, "{step} steps, expected at most {limit}");
        if in_flight.len() == 2 {
            land(&mut in_flight, &mut now, controller);
        }
        match controller.next(clock(now)) {
            Step::Draw(part) => {
                let levels = &items[part.item].levels;
                let secs = cost(&part, &levels[part.level]);
                free_at = free_at.max(now) + if secs > 0.0 { secs } else { 0.0 };
                in_flight.push_back((part.id, free_at, secs));
                let shown = &mut played.shown[part.item];
                assert_eq!(part.is_refinement, shown.is_some());
                assert!(shown.is_none_or(|before| part.level < before), "only finer: {part:?}");
                *shown = Some(part.level);
                played.parts.push(part);
            }
            Step::Wait => {
                played.num_waits += 1;
                land(&mut in_flight, &mut now, controller);
            }
            Step::Done => break,
        }
    }
    while !in_flight.is_empty() {
        land(&mut in_flight, &mut now, controller);
    }
    played.summary = controller.finish(now);
    for (item, shown) in items.iter().zip(&played.shown) {
        assert_eq!(shown.is_some(), !item.levels.is_empty(), "every item is drawn");
    }
    played
}

fn land(in_flight: &mut VecDeque<(u64, f64, f64)>, now: &mut f64, controller: &mut dyn Controller) {
    if let Some((id, end, secs)) = in_flight.pop_front() {
        *now = now.max(end);
        controller.observe(id, secs);
    }
}

/// 1 ns per unit of work, 10 us per part.
pub(crate) fn usual(level: &Level) -> f64 {
    10e-6 + 1e-9 * level.work
}
