//! At rest levels do not move; in slow motion few do.

use volery_schedule::simulate::{Motion, Outcome, Scene, play};
use volery_schedule::{Order, Scheduler, Settings};

const ORDERS: [Order; 2] = [Order::Kept, Order::LargestFirst];

fn ours(order: Order) -> Scheduler {
    Scheduler::new(Settings { order, ..Settings::default() })
}

/// The frames of a rest that begins at `start`, without its first five.
fn rest(start: usize, num_items: usize, noise: f64, spike_part: f64, order: Order) -> Outcome {
    let motion = Motion::RestFrom { frame: start };
    let mut scene = Scene { num_frames: start + 1005, motion, ..Scene::default() };
    scene.world.num_items = num_items;
    (scene.device.noise, scene.device.spike_part) = (noise, spike_part);
    Outcome { frames: play(&scene, &mut ours(order)).frames.split_off(start + 5) }
}

fn num_changed(outcome: &Outcome) -> usize {
    outcome.frames.iter().map(|frame| frame.num_changed).sum()
}

#[test]
fn levels_do_not_move_by_noise() {
    for noise in [0.2, 0.05] {
        for order in ORDERS {
            for num_items in [64, 150, 300] {
                for start in [0, 70, 130, 180] {
                    let outcome = rest(start, num_items, noise, 0.0, order);
                    let (changed, distribution) = (num_changed(&outcome), outcome.distribution());
                    println!(
                        "noise {noise}, {order:?}, {num_items} items, from {start}: {changed} changes, expected 0; \
                         {distribution}"
                    );
                    assert_eq!(changed, 0);
                    assert!(distribution.not_5_percent_late >= 0.99);
                    assert!(outcome.frames.iter().all(|frame| frame.summary.is_settled));
                }
            }
        }
    }
}

/// With stalls too, a frame in a few hundred gives its levels up rather than be late.
#[test]
fn stalls_move_few_levels() {
    for order in ORDERS {
        for num_items in [64, 150, 300] {
            let outcomes = [0, 70, 130, 180].map(|start| rest(start, num_items, 0.2, 0.05, order));
            let changed: usize = outcomes.iter().map(num_changed).sum();
            let part = changed as f64 / (4000 * num_items) as f64;
            let late = outcomes.iter().map(|outcome| outcome.distribution().not_5_percent_late);
            let worst = late.fold(1.0, f64::min);
            let median = outcomes.each_ref().map(|outcome| outcome.distribution().quantiles[2]);
            println!(
                "{order:?}, {num_items} items: {:.3} % of levels change, at most 1 %; at most 5 % late {:.2} %, at \
                 least 98.5 %; medians {median:.3?}",
                100.0 * part,
                100.0 * worst
            );
            assert!(part <= 0.01 && worst >= 0.985);
        }
    }
}

#[test]
fn a_device_that_slows_down_at_rest_is_noticed() {
    let motion = Motion::RestFrom { frame: 0 };
    let scene = Scene { num_frames: 400, motion, speeds: vec![(200, 3.0)], ..Scene::default() };
    let outcome = play(&scene, &mut ours(Order::LargestFirst));
    let late = outcome.frames[220..].iter().filter(|frame| frame.signed_error > 0.05).count();
    println!("{late} of 180 late frames after 20, at most 5");
    assert!(late <= 5 && outcome.frames[399].summary.is_settled);
}

/// Half a degree a frame. How many levels change is a matter of noise, since what noise takes is taken from levels.
#[test]
fn in_a_slow_orbit_few_levels_change() {
    for (noise, spike_part, limit) in
        [(0.02, 0.0, 0.04), (0.05, 0.0, 0.05), (0.2, 0.0, 0.1), (0.2, 0.05, 0.25)]
    {
        for order in ORDERS {
            for num_items in [64, 150, 300] {
                let motion = Motion::Orbit { degrees_per_frame: 0.5 };
                let mut scene = Scene { num_frames: 1000, motion, ..Scene::default() };
                scene.world.num_items = num_items;
                (scene.device.noise, scene.device.spike_part) = (noise, spike_part);
                let outcome = play(&scene, &mut ours(order));
                let part = num_changed(&outcome) as f64 / (1000 * num_items) as f64;
                println!(
                    "noise {noise}, stalls {spike_part}, {order:?}, {num_items} items: {:.2} % of levels change a \
                     frame, at most {:.0} %",
                    100.0 * part,
                    100.0 * limit
                );
                assert!(part <= limit);
            }
        }
    }
}
