use proptest::prelude::*;
use volery_scene::{ControlPoint, TransferFunction};

use super::*;

/// SplitMix64: numbers in [0, 1).
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Random points over [0, 100] and a little beyond, every fifth a step.
fn random_transfer(noise: &mut Noise, count: usize) -> TransferFunction {
    let mut values: Vec<f64> = (0..count).map(|_| noise.unit() * 120.0 - 10.0).collect();
    values.sort_by(f64::total_cmp);
    for i in (5..count).step_by(5) {
        values[i] = values[i - 1];
    }
    let point = |value: f64| {
        let mut unit = || noise.unit();
        ControlPoint { value, color: [unit(), unit(), unit()], opacity: unit() }
    };
    TransferFunction::new(values.into_iter().map(point).collect(), 1.0).unwrap()
}

/// A colour map as they are in use: smooth, with even points.
fn smooth_transfer(count: usize) -> TransferFunction {
    let point = |i: usize| {
        let t = i as f64 / (count - 1) as f64;
        let wave = |phase: f64| 0.5 + 0.5 * (t * 7.0 + phase).sin();
        ControlPoint { value: t * 100.0, color: [wave(0.0), wave(1.0), wave(4.0)], opacity: t * t }
    };
    TransferFunction::new((0..count).map(point).collect(), 1.0).unwrap()
}

/// What a plane adds to a channel before a light.
fn shown(transfer: &TransferFunction, value: f64, channel: usize, light: Option<f64>) -> f64 {
    let (color, opacity) = transfer.classify(value);
    light.map_or(color[channel], |light| opacity * color[channel] + (1.0 - opacity) * light)
}

/// By trying many pairs of values, those at control points and just beside them among them.
fn slow_largest(
    transfer: &TransferFunction,
    [min, max]: [f64; 2],
    error: f64,
    lights: &[Option<f64>],
) -> f64 {
    let beside = |value: f64| [value, value.next_down(), value.next_up()];
    let points: Vec<f64> = transfer.points().iter().flat_map(|point| beside(point.value)).collect();
    let evenly = |low: f64, high: f64| (0..=24).map(move |i| low + (high - low) * f64::from(i) / 24.0);
    let inside = |value: &f64| (min..=max).contains(value);
    let around = points.iter().flat_map(|point| [point - error, point + error]);
    let firsts: Vec<f64> =
        evenly(min, max).chain(points.iter().copied()).chain(around).filter(inside).collect();
    let mut largest: f64 = 0.0;
    for first in firsts {
        let [low, high] = [(first - error).max(min), (first + error).min(max)];
        let near = points.iter().copied().filter(|point| (low..=high).contains(point));
        for second in evenly(low, high).chain(near) {
            for (channel, &light) in (0..3).flat_map(|c| lights.iter().map(move |light| (c, light))) {
                let change = shown(transfer, second, channel, light) - shown(transfer, first, channel, light);
                largest = largest.max(change.abs());
            }
        }
    }
    largest
}

const OPAQUE: [Option<f64>; 1] = [None];
const LIGHTS: [Option<f64>; 3] = [Some(0.0), Some(0.4), Some(1.0)];

proptest! {
    #[test]
    fn no_pair_of_values_changes_a_pixel_by_more_than_the_bound(
        seed: u64, count in 1..30_usize, min in 0.0..100.0_f64, width in 0.0..1.0_f64,
        error in -6.0..0.3_f64, is_transparent: bool,
    ) {
        let transfer = random_transfer(&mut Noise(seed), count);
        let change = ColorChange::new(&transfer, [0.0, 100.0], 100.0, is_transparent);
        let range = [min, min + (100.0 - min) * width];
        let error = 100.0 * 10_f64.powf(error);
        let lights: &[Option<f64>] = if is_transparent { &LIGHTS } else { &OPAQUE };
        let measured = slow_largest(&transfer, range, error, lights);
        let bound = change.largest(range, error);
        prop_assert!(measured <= bound, "measured {} > bound {}", measured, bound);
        // Rounding of values within the slack is covered too.
        let slack = 100.0 * VALUE_SLACK;
        let rounded = [(range[0] - slack).max(0.0), range[1] + slack];
        let measured = slow_largest(&transfer, rounded, error + slack, lights);
        prop_assert!(measured <= bound, "rounded: measured {} > bound {}", measured, bound);
    }

    #[test]
    fn bounds_of_transparent_planes_add_up(seed: u64, count in 2..12_usize, planes in 1..6_usize) {
        let noise = &mut Noise(seed);
        let transfer = random_transfer(noise, count);
        let change = ColorChange::new(&transfer, [0.0, 100.0], 100.0, true);
        let mut pixel = [noise.unit(); 2];
        let mut bound = 0.0;
        for _ in 0..planes {
            let error = 30.0 * noise.unit() * noise.unit();
            let truth = 100.0 * noise.unit();
            let wrong = (truth + error * (2.0 * noise.unit() - 1.0)).clamp(0.0, 100.0);
            bound += change.largest([truth.min(wrong), truth.max(wrong)], error);
            pixel = [shown(&transfer, truth, 0, Some(pixel[0])), shown(&transfer, wrong, 0, Some(pixel[1]))];
        }
        prop_assert!((pixel[0] - pixel[1]).abs() <= bound);
    }
}

/// The bound over what brute force finds, sorted, for nodes at random.
fn ratios(transfer: &TransferFunction, is_transparent: bool) -> Vec<f64> {
    let noise = &mut Noise(7);
    let change = ColorChange::new(transfer, [0.0, 100.0], 100.0, is_transparent);
    let lights: &[Option<f64>] = if is_transparent { &LIGHTS } else { &OPAQUE };
    let mut ratios: Vec<f64> = (0..120)
        .filter_map(|_| {
            let (a, b) = (100.0 * noise.unit(), 100.0 * noise.unit());
            let range = [a.min(b), a.max(b)];
            let error = (range[1] - range[0]) * noise.unit() * 0.7;
            let measured = slow_largest(transfer, range, error, lights);
            (measured > 0.01).then(|| change.largest(range, error) / measured)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios
}

#[test]
fn bounds_are_a_few_percent_above_the_true_maximum() {
    let transfers = [
        ("2 points", smooth_transfer(2)),
        ("8 points", smooth_transfer(8)),
        ("256 points", smooth_transfer(256)),
        ("random", random_transfer(&mut Noise(1), 12)),
    ];
    for (name, transfer) in transfers {
        for is_transparent in [false, true] {
            let ratios = ratios(&transfer, is_transparent);
            let [median, high] = [ratios[ratios.len() / 2], ratios[ratios.len() * 9 / 10]];
            println!(
                "{name}, transparent {is_transparent}: median {median:.3} <= 1.08, 90 % {high:.3} <= 1.15"
            );
            assert!(ratios.len() > 40 && ratios[0] >= 1.0 && median <= 1.08 && high <= 1.15);
        }
    }
}

#[test]
fn a_step_counts_whole_where_values_get_near_it_and_not_at_all_elsewhere() {
    let gray = |value: f64, gray: f64| ControlPoint { value, color: [gray; 3], opacity: 1.0 };
    let transfer = TransferFunction::new(vec![gray(50.0, 0.1), gray(50.0, 0.9)], 1.0).unwrap();
    let change = ColorChange::new(&transfer, [0.0, 100.0], 255.0, false);
    for (range, error, expected) in [
        ([40.0, 60.0], 0.1, 0.8),
        ([40.0, 60.0], 1e-9, 0.8),
        ([40.0, 49.0], 20.0, 0.0),
        ([51.0, 100.0], 1e9, 0.0),
        ([50.0, 50.0], 0.0, 0.8),
        ([0.0, 49.9], 0.0, 0.0),
    ] {
        let found = change.largest(range, error);
        assert!((0.0..=2.0 * COLOR_SLACK).contains(&(found - expected)), "{range:?} {error}: {found}");
    }
}

#[test]
fn blank_unknown_and_degenerate_nodes() {
    let transfer = smooth_transfer(8);
    let change = ColorChange::new(&transfer, [0.0, 100.0], 100.0, false);
    assert_eq!(change.largest([f64::INFINITY, f64::NEG_INFINITY], 0.0), 0.0, "all blank");
    assert_eq!(change.largest([0.0, 1.0], f64::INFINITY), f64::INFINITY, "some blank");
    assert_eq!(change.largest([0.0, 1.0], f64::NAN), f64::INFINITY);
    assert_eq!(change.largest([f64::NAN, 1.0], 1.0), f64::INFINITY);
    // Beyond the range there are no bins, and the whole change counts.
    assert!(change.largest([-500.0, 500.0], 1e-3) >= slow_largest(&transfer, [0.0, 100.0], 500.0, &OPAQUE));
    let constant = ColorChange::new(&transfer, [5.0, 5.0], 0.0, true);
    assert!(constant.largest([5.0, 5.0], 0.0) < 2e-4);
    for range in [[f64::NAN; 2], [f64::INFINITY, f64::NEG_INFINITY], [-1e308, 1e308], [3.0, -3.0]] {
        let odd = ColorChange::new(&transfer, range, range[1] - range[0], false);
        assert!(odd.largest([10.0, 90.0], 1.0) >= slow_largest(&transfer, [10.0, 90.0], 1.0, &OPAQUE));
    }
    let single = TransferFunction::new(vec![transfer.points()[3]], 1.0).unwrap();
    for is_transparent in [false, true] {
        let change = ColorChange::new(&single, [0.0, 1e-300], 0.0, is_transparent);
        assert_eq!(change.largest([0.0, 1e-300], 1.0), COLOR_SLACK, "one colour for all");
    }
}

#[test]
fn a_node_of_colours_changes_by_the_error_of_its_channels() {
    let stats = |min: f64, max: f64, error: f64| NodeStats {
        min,
        max,
        mean: 0.0,
        std_dev: 0.0,
        error,
        count: 8,
        blank: 0,
    };
    let colors = [stats(0.0, 100.0, 5.0), stats(50.0, 60.0, 10.0), stats(0.0, 255.0, 2.0)];
    assert!((largest_of_colors(&colors, true) - 10.0 / 255.0).abs() <= 1.01 * COLOR_SLACK);
    assert_eq!(largest_of_colors(&colors[..1], false), f64::INFINITY);
    let rgba = [colors[0], colors[1], colors[2], stats(10.0, 200.0, 40.0)];
    assert_eq!(largest_of_colors(&rgba, false), largest_of_colors(&colors, false));
    // Brute force over the corners of all that is possible.
    let bound = largest_of_colors(&rgba, true);
    let both = |stats: &NodeStats| {
        let ends = [[stats.min, stats.min + stats.error], [stats.max, stats.max - stats.error]];
        ends.into_iter().flat_map(|[a, b]| [[a, b], [b, a]]).map(|pair| pair.map(|x| x / 255.0))
    };
    for color in &colors {
        for [c, c2] in both(color) {
            for [a, a2] in both(&rgba[3]) {
                for light in [0.0, 1.0] {
                    let change = a2 * c2 + (1.0 - a2) * light - (a * c + (1.0 - a) * light);
                    assert!(change.abs() <= bound, "{change} > {bound}");
                }
            }
        }
    }
}

#[test]
fn ten_thousand_bounds_of_256_points_share_their_tables() {
    // The figure, not a limit: machines differ. What is asserted is that bounds share their tables.
    let transfer = smooth_transfer(256);
    let change = ColorChange::new(&transfer, [0.0, 100.0], 100.0, false);
    let noise = &mut Noise(3);
    let start = std::time::Instant::now();
    let mut sum = 0.0;
    for _ in 0..10_000 {
        let min = 90.0 * noise.unit();
        sum += change.largest([min, min + 10.0 * noise.unit()], 8.0 * noise.unit() * noise.unit());
    }
    let built = change.steps.iter().filter(|step| step.get().is_some()).count();
    println!("10,000 bounds in {:?}, {built} tables, sum {sum:.1}", start.elapsed());
    assert!(built <= 17 * STEPS_PER_OCTAVE as usize);
}
