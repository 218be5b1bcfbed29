//! What the cost model learns, and what does not mislead it.

use volery_schedule::CostModel;
use volery_schedule::simulate::Random;

/// Frames of 100 parts of works from 1e4 to 1e6 whose items cost differently, each a level of its own.
fn teach(model: &mut CostModel, random: &mut Random, num_frames: usize, speed: f64, spike_part: f64) {
    for _ in 0..num_frames {
        model.begin_frame();
        for key in 0..100 {
            let (work, bytes) = part(random, key);
            let mut secs = truth(key, work, bytes) * speed * random.log_normal(0.2);
            if random.uniform() < spike_part {
                secs *= 5.0;
            }
            let predicted = model.predict_secs(key, work, bytes);
            model.observe(key, work, bytes, predicted, secs);
        }
    }
}

fn part(random: &mut Random, key: u64) -> (f64, f64) {
    let work = 1e6 / 4_f64.powi((random.uniform() * 4.0) as i32) * (1.0 + (key % 7) as f64 / 7.0);
    (work, if random.uniform() < 0.1 { work / 2.0 } else { 0.0 })
}

fn truth(key: u64, work: f64, bytes: f64) -> f64 {
    20e-6 + 1e-9 * work * (0.7 + (key % 5) as f64 * 0.15) + 1e-9 * bytes
}

/// The mean of |expected / true mean - 1| over parts.
fn mean_error(model: &CostModel, speed: f64, spike_part: f64) -> f64 {
    let mut random = Random::new(99);
    let mut sum = 0.0;
    for key in 0..1000 {
        let (work, bytes) = part(&mut random, key % 100);
        let mean = truth(key % 100, work, bytes) * speed * (1.0 + 4.0 * spike_part);
        sum += (model.expected_secs(key % 100, work, bytes) / mean - 1.0).abs();
    }
    sum / 1000.0
}

#[test]
fn costs_are_learned_from_noisy_parts_with_and_without_spikes() {
    for (spike_part, limit) in [(0.0, 0.08), (0.05, 0.15)] {
        let mut model = CostModel::new();
        teach(&mut model, &mut Random::new(5), 50, 1.0, spike_part);
        let error = mean_error(&model, 1.0, spike_part);
        println!("spikes {spike_part}: mean error of what is expected {error:.3}, at most {limit}");
        assert!(error <= limit);
    }
}

#[test]
fn one_spike_does_not_poison_the_model() {
    let mut model = CostModel::new();
    teach(&mut model, &mut Random::new(5), 50, 1.0, 0.0);
    let before = model.predict_secs(3, 1e6, 0.0);
    for ratio in [5.0, 100.0, 1e9] {
        model.observe(3, 1e6, 0.0, before, ratio * before);
        let change = model.predict_secs(3, 1e6, 0.0) / before - 1.0;
        println!("after a part of {ratio} times its time: {:.1} % more, at most 15 %", 100.0 * change);
        assert!((0.0..0.15).contains(&change));
        teach(&mut model, &mut Random::new(6), 5, 1.0, 0.0);
    }
}

#[test]
fn another_speed_is_taken_over_within_six_parts() {
    for speed in [3.0, 1.0 / 3.0, 10.0] {
        let mut model = CostModel::new();
        teach(&mut model, &mut Random::new(5), 50, 1.0, 0.0);
        let mut num_parts = 0;
        while (model.predict_secs(50, 1e6, 0.0) / (speed * truth(50, 1e6, 0.0)) - 1.0).abs() > 0.2 {
            let secs = speed * truth(num_parts, 1e6, 0.0);
            model.observe(num_parts, 1e6, 0.0, model.predict_secs(num_parts, 1e6, 0.0), secs);
            num_parts += 1;
            assert!(num_parts <= 6, "{speed}");
        }
        println!("speed {speed}: {num_parts} parts, at most 6");
    }
}

#[test]
fn an_item_keeps_its_own_cost() {
    let mut model = CostModel::new();
    teach(&mut model, &mut Random::new(5), 100, 1.0, 0.05);
    let ratio = model.predict_secs(4, 1e6, 0.0) / model.predict_secs(0, 1e6, 0.0);
    let expected = truth(4, 1e6, 0.0) / truth(0, 1e6, 0.0);
    println!("dear item over cheap item {ratio:.2}, expected {expected:.2} within 15 %");
    assert!((ratio / expected - 1.0).abs() < 0.15);
}

#[test]
fn a_margin_covers_what_it_says() {
    let mut model = CostModel::new();
    let mut random = Random::new(5);
    teach(&mut model, &mut random, 50, 1.0, 0.05);
    model.begin_frame();
    for (part, slack) in [(0.5, 0.06), (0.9, 0.04), (0.99, 0.012)] {
        let margin = model.errors().quantile_ratio(part);
        let held = (0..20_000).filter(|key| {
            let key = key % 100;
            let spike = if random.uniform() < 0.05 { 5.0 } else { 1.0 };
            let secs = truth(key, 1e6, 0.0) * random.log_normal(0.2) * spike;
            secs <= margin * model.predict_secs(key, 1e6, 0.0)
        });
        let found = held.count() as f64 / 20_000.0;
        println!("margin of {part}: x{margin:.2}, holds for {found:.3}, within {slack}");
        assert!((found - part).abs() <= slack);
    }
}

#[test]
fn the_same_parts_give_the_same_bits() {
    let bits = || {
        let mut model = CostModel::new();
        teach(&mut model, &mut Random::new(5), 20, 1.0, 0.05);
        (0..100).map(|key| model.predict_secs(key, 1e6, 1e3).to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(), bits());
}

#[test]
fn no_number_makes_a_prediction_that_is_none() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, 1e-320, f64::MAX, 1.0];
    let mut model = CostModel::new();
    for (a, b) in odd.iter().flat_map(|a| odd.iter().map(move |b| (*a, *b))) {
        for c in odd {
            model.observe(1, a, b, c, a);
            model.observe(2, c, a, b, b);
            model.begin_frame();
            let secs = model.expected_secs(1, b, c);
            assert!((0.0..=3e9).contains(&secs), "{secs}");
        }
    }
}
