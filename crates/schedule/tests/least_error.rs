//! The least error that a budget allows, while costs change: beside a plan that knows what each part will take.

mod drive;

use drive::{Owned, play};
use volery_schedule::{Level, PlanItem, Rule, Scheduler, Settings, plan};

const NUM_ITEMS: u64 = 64;
const NUM_FRAMES: u32 = 120;

/// Rays for 1, 4, 16, 64 pixels, which take more than their number says; what they lose, squared.
fn item(key: u64) -> Owned {
    let loss = 1e-3 * (1.0 + (key * 29 % 64) as f64);
    let levels = (0..4).map(|level| Level {
        work: 0.25_f64.powi(level) + 0.08,
        bytes: 0.0,
        error: if level == 0 { 0.0 } else { (loss * 2_f64.powi(level)).powi(2) },
    });
    Owned { key, importance: 1.0, levels: levels.collect() }
}

/// Seconds per work of an item: a third is empty; something passes through the rest, and what it covers takes four times as
/// long.
fn secs_per_work(key: u64, frame: u32) -> f64 {
    let place = f64::from(frame) / 10.0 - (key % 8) as f64;
    if key.is_multiple_of(3) { 2e-5 } else { 1e-3 * (1.0 + 3.0 * (-0.2 * place * place).exp()) }
}

#[test]
fn errors_are_near_the_least_while_costs_change() {
    let items: Vec<Owned> = (0..NUM_ITEMS).map(item).collect();
    let mut scheduler =
        Scheduler::new(Settings { rule: Rule::LeastError, is_proportional: true, ..Settings::default() });
    let full_secs = 1.08e-3 * NUM_ITEMS as f64;
    for share in [0.25, 0.5, 1.0] {
        let budget_secs = share * full_secs;
        let (mut drawn, mut least, mut late) = (0.0, 0.0, 0);
        for frame in 0..NUM_FRAMES {
            let secs = |key: u64, level: &Level| level.work * secs_per_work(key, frame);
            scheduler.disturb();
            let played = play(
                &mut scheduler,
                &items,
                budget_secs,
                |part, level| secs(items[part.item].key, level),
                |now| now,
            );
            late += u32::from(played.summary.signed_error() > 0.05);
            let costs: Vec<Vec<f64>> = items
                .iter()
                .map(|item| item.levels.iter().map(|level| secs(item.key, level)).collect())
                .collect();
            let errors: Vec<Vec<f64>> =
                items.iter().map(|item| item.levels.iter().map(|level| level.error).collect()).collect();
            let known: Vec<_> = costs
                .iter()
                .zip(&errors)
                .map(|(secs, errors)| PlanItem { importance: 1.0, secs, errors })
                .collect();
            if frame >= 10 {
                let sum = |levels: &[Option<usize>]| -> f64 {
                    levels.iter().zip(&errors).filter_map(|(level, errors)| Some(errors[(*level)?])).sum()
                };
                drawn += sum(&played.shown);
                least += sum(&plan(budget_secs, Rule::LeastError, &known));
            }
        }
        let ratio = drawn / least;
        println!(
            "{share} of full: squared error {ratio:.3} of the least (threshold 1.6), {late} of {NUM_FRAMES} frames late"
        );
        assert!(ratio < 1.6, "{share}: {ratio}");
        assert!(late <= NUM_FRAMES / 20, "{share}: {late} frames late");
    }
}
