//! Opacity of samples that stand for many: the table of what each correction is off by, and its hard cases.
//!
//! The truth is light through a volume at full resolution, by [`Tracer`], which has none of these formulas.

use glam::DVec3;
use volery_data::head_u8;
use volery_reference::Tracer;
use volery_reference::opacity::{homogeneous, integral, ramp};
use volery_scene::{ControlPoint, Ray, TransferFunction, VoxelGrid};

const NUM_SAMPLES: [u32; 4] = [2, 4, 8, 16];
const OPACITIES: [f64; 9] = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 0.6, 0.9, 1.0];

/// Exact means so.
const EXACT: f64 = 1e-12;

/// White, with opacity the value.
fn identity() -> TransferFunction {
    white(&[(0.0, 0.0), (1.0, 1.0)])
}

fn white(points: &[(f64, f64)]) -> TransferFunction {
    let point = |&(value, opacity)| ControlPoint { value, color: [1.0; 3], opacity };
    TransferFunction::new(points.iter().map(point).collect(), 1.0).expect("a valid transfer function")
}

/// What a stretch hides whose samples along z are these, one unit apart: the white light of it, which keeps the digits of
/// small ones.
fn truth(transfer: &TransferFunction, values: &[f64]) -> f64 {
    light(transfer, values, 1.0)
}

fn light(transfer: &TransferFunction, values: &[f64], distance: f64) -> f64 {
    let samples: Vec<f64> = values.iter().flat_map(|&value| [value; 4]).collect();
    let grid =
        VoxelGrid::new([2, 2, values.len()], DVec3::new(1.0, 1.0, distance), samples).expect("a valid grid");
    let tracer = Tracer::new(&grid, transfer).expect("no colours");
    tracer.trace(&Ray { origin: DVec3::new(0.4, 0.6, 0.0), direction: DVec3::Z }).color[0]
}

/// What is said to hide a stretch between two samples that stand for `m`: nothing corrected, (i), (ii), the integral.
fn corrections(transfer: &TransferFunction, [first, last]: [f64; 2], m: u32) -> [f64; 4] {
    let [a, b] = [first, last].map(|value| transfer.classify(value).1);
    [a, homogeneous(a, m), ramp(a, b, m), integral(transfer, first, last, f64::from(m))]
}

fn print(what: &str, m: u32, opacity: f64, errors: [f64; 4]) {
    let [none, equal, ramp, exact] = errors;
    println!(
        "{what:<12} n {m:>2}  opacity {opacity:<5}  none {none:.2e}  (i) {equal:.2e}  (ii) {ramp:.2e}  exact {exact:.2e}"
    );
}

#[test]
fn table_for_homogeneous_stretches() {
    let transfer = identity();
    for m in NUM_SAMPLES {
        for opacity in OPACITIES {
            let truth = truth(&transfer, &vec![opacity; m as usize + 1]);
            let errors = corrections(&transfer, [opacity; 2], m).map(|found| (found - truth).abs());
            print("homogeneous", m, opacity, errors);
            // All but no correction are exact; that lacks all samples but one.
            assert!(errors[1..].iter().all(|&error| error < EXACT), "threshold {EXACT:e}");
            let missing = (1.0 - opacity) - (1.0 - opacity).powi(m as i32);
            assert!((errors[0] - missing).abs() < EXACT);
        }
    }
}

#[test]
fn table_for_ramps() {
    let transfer = identity();
    let extinction = |opacity: f64| -(-opacity).ln_1p();
    for m in NUM_SAMPLES {
        for opacity in OPACITIES {
            let mut greatest = [0.0f64; 4];
            for [first, last] in
                [[0.0, opacity], [opacity, 0.0], [opacity / 2.0, opacity], [opacity, 0.9 * opacity]]
            {
                let value = |i: u32| first + (last - first) * f64::from(i) / f64::from(m);
                let truth = truth(&transfer, &(0..=m).map(value).collect::<Vec<_>>());
                let errors = corrections(&transfer, [first, last], m).map(|found| (found - truth).abs());
                // A sum of m monotone terms, one end left out, is off by the difference of the ends at most.
                let most = -(-(extinction(last) - extinction(first)).abs()).exp_m1();
                assert!(errors[2] <= most + EXACT, "(ii) from {first} to {last}: {} of {most}", errors[2]);
                // The tracer is within 1e-9 where opacity reaches 1, a pole of the extinction, and 1e-12 elsewhere.
                assert!(
                    errors[3] < if opacity == 1.0 { 1e-9 } else { EXACT },
                    "{first} to {last}: {}",
                    errors[3]
                );
                greatest = std::array::from_fn(|i| greatest[i].max(errors[i]));
            }
            print("ramp", m, opacity, greatest);
        }
    }
}

/// Nodes of a head by code: what lies between two samples is not what they interpolate, so that the integral is off
/// as well, by the data error. By no more: it is what the field hides that is held.
#[test]
fn table_for_nodes_of_a_head() {
    let grid = head_u8([97; 3], DVec3::ONE);
    for m in NUM_SAMPLES {
        for opacity in OPACITIES {
            let transfer =
                white(&[(40.0, 0.0), (90.0, 0.2 * opacity), (130.0, 0.3 * opacity), (200.0, opacity)]);
            let tracer = Tracer::new(&grid, &transfer).expect("no colours");
            let (mut squares, mut count) = ([0.0f64; 4], 0.0);
            for column in 0..12 * 12 {
                let [x, y] = [column % 12, column / 12].map(|i| 8 * i);
                for z in (0..96).step_by(m as usize) {
                    let value = |z: usize| grid.samples().value(grid.index([x, y, z]), 0);
                    let ray = Ray { origin: DVec3::new(x as f64, y as f64, z as f64), direction: DVec3::Z };
                    let truth = tracer.trace_to(&ray, f64::from(m)).color[0];
                    let ends = [value(z), value(z + m as usize)];
                    let found = corrections(&transfer, ends, m);
                    let held = light(&transfer, &ends, f64::from(m));
                    assert!((found[3] - held).abs() < if opacity == 1.0 { 1e-9 } else { EXACT }, "{ends:?}");
                    // Where there is nothing, all are right.
                    if truth > 0.0 {
                        squares = std::array::from_fn(|i| squares[i] + (found[i] - truth).powi(2));
                        count += 1.0;
                    }
                }
            }
            assert!(count > 300.0, "{count} stretches hold matter");
            let rms = squares.map(|sum| (sum / count).sqrt());
            print("head, rms", m, opacity, rms);
            // Where samples are far apart in dense matter the data error is all there is, and chance has its say.
            let is_nearest = (0..3).all(|i| rms[3] < rms[i]);
            assert!(
                is_nearest || m == 16,
                "the integral is the nearest, as long as samples show what there is"
            );
        }
    }
}

/// What the paper's equations (2) and (3) say of one sample left out, by hand; and what its general forms would say.
#[test]
fn one_sample_left_out_is_composited_and_the_printed_forms_are_misprints() {
    assert!((homogeneous(0.5, 2) - 0.75).abs() < EXACT);
    assert!((ramp(0.0, 0.5, 2) - 0.25).abs() < EXACT, "alpha_0 (1 + alpha_2) would be 0");
    assert!((ramp(0.2, 0.6, 2) - (1.0 - 0.8 * 0.6)).abs() < EXACT);
    assert!((ramp(0.2, 0.6, 4) - (1.0 - 0.8 * 0.7 * 0.6 * 0.5)).abs() < EXACT);
    let printed = |a: f64, n: i32| a - (1.0 - a) * (1.0 - a).powi(n);
    assert!(printed(0.001, 2) < -0.99, "no opacity");
}

/// Values beyond the control points, across several of them and across steps, both ways.
#[test]
fn integrals_across_control_points_and_steps() {
    let transfers = [
        white(&[(0.2, 0.1), (0.4, 0.7), (0.5, 0.0), (0.8, 0.3)]),
        white(&[(0.3, 0.0), (0.3, 0.6), (0.3, 0.2), (0.7, 0.2), (0.7, 0.9)]),
        white(&[(0.5, 0.4)]),
    ];
    for transfer in transfers {
        for ends in [
            [0.0, 1.0],
            [1.0, 0.0],
            [0.25, 0.45],
            [0.3, 0.7],
            [0.7, 0.3],
            [-3.0, 0.1],
            [0.9, 0.95],
            [0.3, 0.3],
        ] {
            let [first, last] = ends;
            for length in [1, 3, 16] {
                let value = |i: usize| first + (last - first) * i as f64 / length as f64;
                let truth = truth(&transfer, &(0..=length).map(value).collect::<Vec<_>>());
                let found = integral(&transfer, first, last, length as f64);
                assert!((found - truth).abs() < EXACT, "{ends:?} over {length}: {found}, expected {truth}");
            }
        }
    }
}

/// Cutting a stretch changes nothing: what is clear multiplies.
#[test]
fn stretches_join() {
    let transfer = white(&[(0.0, 0.0), (0.3, 0.9), (0.6, 0.1), (1.0, 1.0)]);
    for step in 1..20 {
        let middle = f64::from(step) / 20.0;
        let clear = |first: f64, last: f64, length: f64| 1.0 - integral(&transfer, first, last, length);
        let parts = clear(0.0, middle, 5.0 * middle) * clear(middle, 1.0, 5.0 * (1.0 - middle));
        assert!((parts - clear(0.0, 1.0, 5.0)).abs() < EXACT, "cut at {middle}");
        assert_eq!(clear(0.0, middle, 5.0), clear(middle, 0.0, 5.0), "there as back");
    }
}

#[test]
fn opacity_none_tiny_and_one() {
    for m in NUM_SAMPLES {
        assert_eq!([homogeneous(0.0, m), ramp(0.0, 0.0, m)].map(f64::to_bits), [0; 2]);
        assert_eq!([homogeneous(1.0, m), ramp(1.0, 0.0, m)], [1.0; 2]);
        let expected = f64::from(m) * 1e-30;
        assert!((homogeneous(1e-30, m) / expected - 1.0).abs() < EXACT);
        assert!((integral(&identity(), 1e-30, 1e-30, f64::from(m)) / expected - 1.0).abs() < EXACT);
        assert!((integral(&identity(), 0.0, 2e-30, f64::from(m)) / expected - 1.0).abs() < EXACT);
        assert!((integral(&identity(), 2e-30, 0.0, f64::from(m)) / expected - 1.0).abs() < EXACT);
    }
    // A stretch of opacity 1 hides all, a point of it only what is around it: 1 - exp(-1).
    assert_eq!(integral(&identity(), 1.0, 1.0, 1e-300), 1.0);
    assert_eq!(integral(&white(&[(0.5, 1.0), (0.6, 1.0), (0.6, 0.0)]), 0.0, 1.0, 1.0), 1.0);
    assert!((integral(&identity(), 0.0, 1.0, 1.0) - (1.0 - (-1f64).exp())).abs() < EXACT);
}

#[test]
fn lengths_none_and_extreme() {
    let transfer = identity();
    for value in [0.0, 0.5, 1.0] {
        assert_eq!(integral(&transfer, value, value, 0.0).to_bits(), 0, "no length hides nothing");
        assert_eq!(homogeneous(value, 0).to_bits(), 0, "no sample hides nothing");
    }
    assert_eq!(integral(&transfer, 0.0, 0.0, 1e30), 0.0);
    assert_eq!(integral(&transfer, 0.1, 0.2, 1e30), 1.0);
    assert!((integral(&transfer, 0.5, 0.5, 1e-30) / (2f64.ln() * 1e-30) - 1.0).abs() < EXACT);
    for blank in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!([integral(&transfer, blank, 0.5, 1.0), integral(&transfer, 0.5, blank, 1.0)], [0.0; 2]);
    }
}

/// A step sweep: a stretch in any number of steps hides the same, where one sample each would not.
#[test]
fn no_number_of_steps_changes_opacity() {
    let transfer = white(&[(0.0, 0.02), (0.5, 0.4), (1.0, 0.1)]);
    let whole = integral(&transfer, 0.1, 0.8, 8.0);
    for steps in [2, 4, 8, 16, 32] {
        let value = |i: i32| 0.1 + 0.7 * f64::from(i) / f64::from(steps);
        let length = 8.0 / f64::from(steps);
        let clear = (0..steps).map(|i| 1.0 - integral(&transfer, value(i), value(i + 1), length));
        let found = 1.0 - clear.product::<f64>();
        assert!((found - whole).abs() < EXACT, "{steps} steps: {found} for {whole}");
    }
}
