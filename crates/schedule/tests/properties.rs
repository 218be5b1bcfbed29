//! Whatever the numbers: every item is drawn, frames end, the same inputs give the same decisions.

mod drive;

use drive::{Owned, Played, borrow, play};
use proptest::prelude::*;
use volery_schedule::{Level, Order, PlanItem, Rule, Scheduler, Settings, plan};

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => 0.0..10.0,
        2 => 1e-9..1e9,
        1 => prop::sample::select(vec![
            0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, 1e-320, 1e300,
        ]),
    ]
}

fn any_item() -> impl Strategy<Value = Owned> {
    let level = (any_number(), any_number(), any_number());
    (0_u64..40, any_number(), prop::collection::vec(level, 0..6)).prop_map(|(key, importance, levels)| {
        Owned {
            key,
            importance,
            levels: levels.into_iter().map(|(work, bytes, error)| Level { work, bytes, error }).collect(),
        }
    })
}

/// Frames of a scheduler, with costs and clocks out of lists.
fn frames(items: &[Owned], budgets: &[f64], costs: &[f64], clocks: &[f64], order: Order) -> Vec<Played> {
    let mut scheduler = Scheduler::new(Settings { order, ..Settings::default() });
    let (mut at_cost, mut at_clock) = (0, 0);
    let frame = |&budget_secs: &f64| {
        let cost = |_: &_, _: &_| {
            at_cost += 1;
            costs[at_cost % costs.len()]
        };
        let clock = |now: f64| {
            at_clock += 1;
            now + clocks[at_clock % clocks.len()]
        };
        play(&mut scheduler, items, budget_secs, cost, clock)
    };
    budgets.iter().map(frame).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn every_item_is_drawn_and_decisions_are_the_same(
        items in prop::collection::vec(any_item(), 0..30),
        budgets in prop::collection::vec(any_number(), 1..9),
        costs in prop::collection::vec(any_number(), 1..20),
        clocks in prop::collection::vec(prop_oneof![3 => Just(0.0), 1 => any_number()], 1..9),
        is_free in any::<bool>(),
    ) {
        let order = if is_free { Order::LargestFirst } else { Order::Kept };
        // `play` checks that the frame is whole, that it ends, and that items only become finer.
        let first = frames(&items, &budgets, &costs, &clocks, order);
        let second = frames(&items, &budgets, &costs, &clocks, order);
        for (a, b) in first.iter().zip(&second) {
            prop_assert_eq!(&a.parts, &b.parts);
            if order == Order::Kept {
                let firsts: Vec<usize> = a.parts.iter().filter(|p| !p.is_refinement).map(|p| p.item).collect();
                prop_assert!(firsts.is_sorted());
            }
        }
    }

    #[test]
    fn results_in_any_order_in_any_frame(
        items in prop::collection::vec(any_item(), 0..12),
        told in prop::collection::vec((0_u64..200, any_number(), 0_usize..6), 0..80),
        budget_secs in any_number(),
    ) {
        let mut scheduler = Scheduler::new(Settings::default());
        for (id, secs, what) in told {
            match what {
                0 => scheduler.begin_frame_of(budget_secs, &items),
                1 => { scheduler.finish_at(secs); }
                2 => scheduler.set_bytes(id as usize % 20, id as usize % 6, secs),
                3 => { scheduler.next_at(secs); }
                _ => scheduler.observe_part(id, secs),
            }
        }
    }

    #[test]
    fn a_plan_fits_and_leaves_nothing_that_fits(
        costs in prop::collection::vec((any_number(), prop::collection::vec(0.0_f64..1.0, 0..6)), 0..30),
        budget_secs in 0.0_f64..10.0,
        rule in prop::sample::select(vec![Rule::Shares, Rule::LeastError]),
    ) {
        let errors = [0.0, 1.0, 3.0, 7.0, 15.0, 31.0];
        // Finer levels cost more.
        let mut costs = costs;
        costs.iter_mut().for_each(|(_, secs)| secs.sort_by(|a, b| b.total_cmp(a)));
        let items: Vec<PlanItem<'_>> = costs
            .iter()
            .map(|(importance, secs)| PlanItem { importance: *importance, secs, errors: &errors })
            .collect();
        let levels = plan(budget_secs, rule, &items);
        prop_assert_eq!(levels.len(), items.len());
        let mut sum = 0.0;
        let mut is_at_floor = true;
        for (item, level) in items.iter().zip(&levels) {
            prop_assert_eq!(level.is_none(), item.secs.is_empty());
            if let Some(level) = *level {
                sum += item.secs[level];
                is_at_floor &= level + 1 == item.secs.len();
            }
        }
        prop_assert!(sum <= budget_secs * (1.0 + 1e-9) || is_at_floor, "{} of {}", sum, budget_secs);
        for (item, level) in items.iter().zip(&levels) {
            if let Some(level) = level.filter(|level| *level > 0) {
                let finer = sum - item.secs[level] + item.secs[level - 1];
                prop_assert!(finer > budget_secs * (1.0 - 1e-9), "a finer level fits: {} of {}", finer, budget_secs);
            }
        }
    }
}

proptest! {
    /// Levels each four times dearer that remove ever less error: greedy is within one step of the least error there is, so
    /// no other plan is better by more.
    #[test]
    fn least_error_is_less_than_that_of_shares(
        scales in prop::collection::vec((0.1_f64..10.0, 0.01_f64..100.0), 1..40),
        budget in 0.0_f64..1.0,
    ) {
        let costs: Vec<[f64; 4]> = scales.iter().map(|(cost, _)| [64.0, 16.0, 4.0, 1.0].map(|times| times * cost)).collect();
        let errors: Vec<[f64; 4]> = scales.iter().map(|(_, error)| [0.0, 1.0, 3.0, 9.0].map(|times| times * error)).collect();
        let items: Vec<_> =
            costs.iter().zip(&errors).map(|(secs, errors)| PlanItem { importance: 1.0, secs, errors }).collect();
        let budget_secs = budget * costs.iter().map(|secs| secs[0]).sum::<f64>();
        let [shares, least] = [Rule::Shares, Rule::LeastError].map(|rule| {
            let levels = plan(budget_secs, rule, &items);
            levels.iter().zip(&errors).filter_map(|(level, errors)| Some(errors[(*level)?])).sum::<f64>()
        });
        let step = errors.iter().map(|errors| errors[3] - errors[2]).fold(0.0, f64::max);
        prop_assert!(least <= shares + step, "{} beside {} of shares", least, shares);
    }
}

/// Short names for calls in any order.
trait Calls {
    fn begin_frame_of(&mut self, budget_secs: f64, items: &[Owned]);
    fn finish_at(&mut self, secs: f64);
    fn next_at(&mut self, secs: f64);
    fn observe_part(&mut self, id: u64, secs: f64);
}

impl<C: volery_schedule::Controller> Calls for C {
    fn begin_frame_of(&mut self, budget_secs: f64, items: &[Owned]) {
        self.begin(budget_secs, &borrow(items));
    }

    fn finish_at(&mut self, secs: f64) {
        self.finish(secs);
    }

    fn next_at(&mut self, secs: f64) {
        self.next(secs);
    }

    fn observe_part(&mut self, id: u64, secs: f64) {
        self.observe(id, secs);
    }
}
