//! The hard cases, each by its name. Every frame must be whole: `drive` checks that.

mod drive;

use drive::{Owned, items, play, usual};
use volery_schedule::controllers::{Feedback, FixedLevels, FourSteps, Law, ResolutionScaling};
use volery_schedule::{Controller, Level, Order, Scheduler, Settings};

const BUDGET_SECS: f64 = 0.033;

fn scheduler() -> Scheduler {
    Scheduler::new(Settings { order: Order::LargestFirst, ..Settings::default() })
}

/// A scheduler that has seen 20 frames of these items.
fn trained(items: &[Owned]) -> Scheduler {
    let mut scheduler = scheduler();
    for frame in 0..20 {
        // Not quite at rest.
        let budget_secs = BUDGET_SECS * (1.0 + 0.01 * f64::from(frame % 2));
        play(&mut scheduler, items, budget_secs, |_, level| usual(level), |now| now);
    }
    scheduler
}

fn coarsest_secs(items: &[Owned]) -> f64 {
    items.iter().filter_map(|item| item.levels.last()).map(usual).sum()
}

#[test]
fn budget_of_nothing_is_the_floor() {
    let items = items(100);
    for budget_secs in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
        let played = play(&mut trained(&items), &items, budget_secs, |_, level| usual(level), |now| now);
        println!("budget {budget_secs}: {} parts, expected 100", played.parts.len());
        assert!(played.summary.is_at_floor && played.parts.len() == 100);
        assert!(!played.summary.signed_error().is_nan());
    }
}

#[test]
fn budget_below_the_floor_says_so() {
    let items = items(100);
    let budget_secs = 0.5 * coarsest_secs(&items);
    let mut scheduler = trained(&items);
    // The coarsest levels were never drawn yet: what they take is learned first.
    play(&mut scheduler, &items, budget_secs, |_, level| usual(level), |now| now);
    let played = play(&mut scheduler, &items, budget_secs, |_, level| usual(level), |now| now);
    assert!(played.summary.is_at_floor && !played.summary.is_at_ceiling);
    assert!(played.summary.signed_error() > 0.5, "{}", played.summary.signed_error());
}

#[test]
fn budget_without_end_is_the_ceiling() {
    let items = items(100);
    for budget_secs in [f64::INFINITY, f64::MAX, 1e6] {
        let played = play(&mut trained(&items), &items, budget_secs, |_, level| usual(level), |now| now);
        assert!(played.summary.is_at_ceiling, "{:?}", played.summary);
        assert_eq!(played.summary.num_refinements + 100, played.parts.len());
    }
}

#[test]
fn a_clock_that_stands_still_is_made_up_for_by_what_parts_took() {
    let items = items(100);
    let played = play(&mut trained(&items), &items, BUDGET_SECS, |_, level| usual(level), |_| 0.0);
    let error = played.summary.signed_error();
    println!("signed error {error:.4}, within 0.05");
    assert!(error.abs() <= 0.05);
}

#[test]
fn a_clock_and_costs_that_stand_still_end_the_frame() {
    let items = items(100);
    let played = play(&mut scheduler(), &items, BUDGET_SECS, |_, _| 0.0, |_| 0.0);
    assert_eq!(played.parts.len(), 100, "nothing is known of costs, so nothing is refined");
    let played = play(&mut trained(&items), &items, BUDGET_SECS, |_, _| 0.0, |_| 0.0);
    assert!(played.summary.is_at_ceiling, "nothing seems to cost anything");
}

#[test]
fn a_clock_that_jumps_forward_leaves_a_whole_frame() {
    let items = items(100);
    for jump_secs in [1.0, 1e9, f64::INFINITY, f64::NAN] {
        let mut scheduler = trained(&items);
        let clock = |now: f64| if now > 0.5 * BUDGET_SECS { now + jump_secs } else { now };
        let played = play(&mut scheduler, &items, BUDGET_SECS, |_, level| usual(level), clock);
        println!("jump {jump_secs}: signed error {:.3}, at most 0.05", played.summary.signed_error());
        assert!(played.summary.signed_error() <= 0.05);
        let next = play(&mut scheduler, &items, BUDGET_SECS, |_, level| usual(level), |now| now);
        assert!(next.summary.signed_error().abs() <= 0.05, "the next frame does not know of it");
    }
}

#[test]
fn a_clock_that_jumps_back_does_not_give_time() {
    let items = items(100);
    for back_secs in [0.25 * BUDGET_SECS, BUDGET_SECS, 1e9] {
        let clock = |now: f64| if now > 0.5 * BUDGET_SECS { now - back_secs } else { now };
        let played = play(&mut trained(&items), &items, BUDGET_SECS, |_, level| usual(level), clock);
        println!("back {back_secs}: signed error {:.3}, within 0.05", played.summary.signed_error());
        assert!(played.summary.signed_error().abs() <= 0.05);
    }
}

#[test]
fn one_part_that_takes_a_hundred_times_as_long_spoils_one_frame() {
    let items = items(100);
    for place in [0, 50, 99] {
        let mut scheduler = trained(&items);
        let mut num_parts = 0;
        let stalling = |_: &_, level: &Level| {
            num_parts += 1;
            usual(level) * if num_parts == place + 1 { 100.0 } else { 1.0 }
        };
        let stalled = play(&mut scheduler, &items, BUDGET_SECS, stalling, |now| now);
        let next = play(&mut scheduler, &items, BUDGET_SECS * 1.01, |_, level| usual(level), |now| now);
        println!(
            "stall of part {place}: signed error {:.3}, the next frame {:.3}, within 0.05",
            stalled.summary.signed_error(),
            next.summary.signed_error()
        );
        let after = stalled.parts.iter().skip(place + 3).filter(|part| part.level < 4).count();
        assert!(stalled.summary.signed_error() < 0.05 || after == 0, "{after} parts finer than need be");
        assert!(next.summary.signed_error().abs() <= 0.05);
    }
}

#[test]
fn one_item_gets_the_finest_level_that_fits() {
    let items = items(1);
    for (budget_secs, level) in [(1e-3, 1), (1.2e-3, 0), (1e-6, 4), (1.0, 0)] {
        let mut scheduler = scheduler();
        for frame in 0..200 {
            let budget_secs = budget_secs * (1.0 + 0.01 * f64::from(frame % 2));
            play(&mut scheduler, &items, budget_secs, |_, level| usual(level), |now| now);
        }
        let played = play(&mut scheduler, &items, budget_secs, |_, level| usual(level), |now| now);
        assert_eq!(played.shown, [Some(level)], "{budget_secs}");
    }
}

#[test]
fn no_item_is_no_part() {
    let mut scheduler = scheduler();
    for _ in 0..10 {
        let played = play(&mut scheduler, &[], BUDGET_SECS, |_, level| usual(level), |now| now);
        assert!(played.parts.is_empty());
    }
    let without_levels = [Owned { key: 1, importance: 1.0, levels: Vec::new() }];
    for _ in 0..10 {
        play(&mut scheduler, &without_levels, BUDGET_SECS, |_, level| usual(level), |now| now);
    }
}

#[test]
fn importance_that_says_nothing_is_equal_importance() {
    let levels = |importance: f64| {
        let mut items = items(100);
        items.iter_mut().for_each(|item| item.importance = importance);
        let played = play(&mut trained(&items), &items, BUDGET_SECS, |_, level| usual(level), |now| now);
        assert!(played.summary.signed_error().abs() <= 0.05, "{importance}");
        played.shown
    };
    let expected = levels(1.0);
    for importance in [0.0, f64::NAN, f64::INFINITY, -1.0, f64::NEG_INFINITY, f64::MAX, 1e-310] {
        assert_eq!(levels(importance), expected, "{importance}");
    }
}

#[test]
fn residency_lost_in_mid_frame_is_counted_in_the_same_frame() {
    let mut items = items(100);
    let bytes = |level: &Level| 0.5 * level.work;
    // Uploads cost 1 ns a byte and are needed in every fourth frame, so that their cost is known.
    let upload = |level: &Level| usual(level) + 1e-9 * bytes(level);
    let mut scheduler = scheduler();
    for frame in 0..40 {
        let is_upload = frame % 4 == 0;
        for level in items.iter_mut().flat_map(|item| &mut item.levels) {
            level.bytes = if is_upload { bytes(level) } else { 0.0 };
        }
        let cost = |_: &_, level: &Level| if is_upload { upload(level) } else { usual(level) };
        // Not quite at rest.
        let budget_secs = BUDGET_SECS * (1.0 + 0.01 * f64::from(frame % 2));
        play(&mut scheduler, &items, budget_secs, cost, |now| now);
    }
    let mut told = Loses { scheduler, items: &items, after: 50, bytes: &bytes };
    let mut num_parts = 0;
    let cost = |_: &_, level: &Level| {
        num_parts += 1;
        if num_parts > 50 { upload(level) } else { usual(level) }
    };
    let played = play(&mut told, &items, BUDGET_SECS, cost, |now| now);
    println!("signed error {:.3}, within 0.05", played.summary.signed_error());
    assert!(played.summary.signed_error().abs() <= 0.05);
}

/// A scheduler that is told after some parts that all others must be uploaded.
struct Loses<'a> {
    scheduler: Scheduler,
    items: &'a [Owned],
    after: usize,
    bytes: &'a dyn Fn(&Level) -> f64,
}

impl Controller for Loses<'_> {
    fn begin(&mut self, budget_secs: f64, items: &[volery_schedule::Item<'_>]) {
        self.scheduler.begin(budget_secs, items);
    }

    fn next(&mut self, elapsed_secs: f64) -> volery_schedule::Step {
        if self.after == 0 {
            for (index, item) in self.items.iter().enumerate() {
                for (place, level) in item.levels.iter().enumerate() {
                    self.scheduler.set_bytes(index, place, (self.bytes)(level));
                }
            }
            self.scheduler.set_bytes(usize::MAX, usize::MAX, f64::NAN);
        }
        self.after = self.after.wrapping_sub(1);
        self.scheduler.next(elapsed_secs)
    }

    fn observe(&mut self, part_id: u64, secs: f64) {
        self.scheduler.observe(part_id, secs);
    }

    fn finish(&mut self, actual_secs: f64) -> volery_schedule::Summary {
        self.scheduler.finish(actual_secs)
    }
}

#[test]
fn one_level_only_is_floor_and_ceiling() {
    let mut items = items(100);
    items.iter_mut().for_each(|item| item.levels.truncate(1));
    let played = play(&mut trained(&items), &items, BUDGET_SECS, |_, level| usual(level), |now| now);
    assert!(played.summary.is_at_floor && played.summary.is_at_ceiling && played.parts.len() == 100);
}

#[test]
fn works_that_are_no_numbers_leave_the_others_in_time() {
    for work in [0.0, f64::NAN, f64::INFINITY, -1.0, f64::MAX, f64::NEG_INFINITY] {
        let mut items = items(150);
        for item in items.iter_mut().take(10) {
            item.levels[0].work = work;
        }
        let cost =
            |_: &_, level: &Level| usual(&Level { work: level.work.clamp(1e4, 1e6).max(1e4), ..*level });
        let mut scheduler = scheduler();
        let mut error = 0.0;
        for frame in 0..40 {
            let budget_secs = BUDGET_SECS * (1.0 + 0.01 * f64::from(frame % 2));
            error = play(&mut scheduler, &items, budget_secs, cost, |now| now).summary.signed_error();
        }
        println!("work {work}: signed error {error:.3}, within 0.05");
        assert!(error.abs() <= 0.05);
    }
}

#[test]
fn results_that_come_late_or_never_do_not_hold_a_frame_up() {
    let items = items(100);
    let mut scheduler = scheduler();
    let mut late = Vec::new();
    for frame in 0..100 {
        scheduler.begin(BUDGET_SECS, &drive::borrow(&items));
        for (id, secs) in late.drain(..) {
            scheduler.observe(id, secs);
        }
        let (mut now, mut num_steps) = (0.0, 0);
        loop {
            num_steps += 1;
            assert!(num_steps < 1000);
            match scheduler.next(now) {
                volery_schedule::Step::Draw(part) => {
                    let secs = usual(&items[part.item].levels[part.level]);
                    now += secs;
                    // In even frames all results come with the next, in odd ones none.
                    if frame % 2 == 0 {
                        late.push((part.id, secs));
                    }
                }
                volery_schedule::Step::Wait => {}
                volery_schedule::Step::Done => break,
            }
        }
        let error = scheduler.finish(now).signed_error();
        if frame > 20 {
            assert!(error <= 0.05, "frame {frame}: {error}");
        }
    }
    println!("100 frames, none late by more than 5 %");
}

#[test]
fn calls_in_another_order_do_nothing() {
    let items = items(3);
    let mut all: Vec<Box<dyn Controller>> = vec![
        Box::new(scheduler()),
        Box::new(FixedLevels::finest()),
        Box::new(FixedLevels::within(f64::NAN)),
        Box::new(Feedback::new(Law::PI)),
        Box::new(Feedback::new(Law::Fuzzy)),
        Box::new(FourSteps::new()),
        Box::new(ResolutionScaling::new()),
    ];
    for controller in &mut all {
        let controller = controller.as_mut();
        assert_eq!(controller.next(0.0), volery_schedule::Step::Done);
        controller.observe(17, 1.0);
        assert_eq!(controller.finish(1.0), volery_schedule::Summary::default());
        for secs in [f64::NAN, 0.0, -1.0, f64::INFINITY, 1e-300, 1.0] {
            controller.begin(BUDGET_SECS, &drive::borrow(&items));
            controller.begin(BUDGET_SECS, &drive::borrow(&items));
            controller.next(0.0);
            controller.finish(secs);
            controller.finish(secs);
            assert_eq!(controller.next(0.0), volery_schedule::Step::Done);
            play(controller, &items, BUDGET_SECS, |_, _| secs, |now| now);
        }
        play(controller, &[], f64::NAN, |_, _| 1.0, |now| now);
    }
}
