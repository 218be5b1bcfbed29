//! Every statistic of every node against the slow oracle.

use glam::DVec3;
use proptest::prelude::*;
use volery_pyramid::{Cube, CubeTree, Kind, NodeSource, NodeStats, Pyramid};
use volery_scene::{Array, Samples, VoxelGrid};

use crate::oracle;

const KINDS: [Kind; 2] = [Kind::Decimated, Kind::Averaged];

fn grid(dims: [usize; 3], samples: impl Into<Samples>) -> VoxelGrid {
    VoxelGrid::new(dims, DVec3::ONE, samples).expect("a valid grid")
}

/// SplitMix64.
fn noise(seed: u64) -> impl FnMut() -> u64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

fn random<T>(dims: [usize; 3], seed: u64, make: impl Fn(u64) -> T) -> Vec<T> {
    let mut next = noise(seed);
    (0..dims.iter().product()).map(|_| make(next())).collect()
}

/// Random samples of every type, over the whole range of the type.
fn every_type(dims: [usize; 3], seed: u64) -> Vec<Samples> {
    vec![
        random(dims, seed, |r| r as u8).into(),
        random(dims, seed, |r| r as i8).into(),
        random(dims, seed, |r| r as u16).into(),
        random(dims, seed, |r| r as i16).into(),
        random(dims, seed, |r| r as u32).into(),
        random(dims, seed, |r| r as i32).into(),
        random(dims, seed, |r| (r as f64 / u64::MAX as f64 - 0.3) as f32).into(),
        random(dims, seed, |r| (r as f64 / u64::MAX as f64 - 0.3) * 1e9).into(),
        random(dims, seed, |r| [r as u8, (r >> 8) as u8, (r >> 16) as u8]).into(),
        random(dims, seed, |r| [r as u8, (r >> 8) as u8, (r >> 16) as u8, (r >> 24) as u8]).into(),
    ]
}

fn close(found: f64, expected: f64, slack: f64) -> bool {
    found == expected || (found - expected).abs() <= slack || (found.is_nan() && expected.is_nan())
}

/// Compares a whole pyramid with the oracle. Integers must agree in every bit of range and error.
fn check(grid: &VoxelGrid, kind: Kind, brick_cells: usize) {
    let pyramid = Pyramid::build(grid, kind, brick_cells).expect("a valid layout");
    let layout = pyramid.layout();
    for channel in 0..grid.sample_type().channels() {
        let levels = oracle::Levels::new(kind, grid.dims(), grid.samples(), channel, layout.num_levels());
        for level in 0..layout.num_levels() {
            let what = || {
                format!(
                    "{:?} {} {kind:?} bricks of {brick_cells}, channel {channel}",
                    grid.dims(),
                    grid.sample_type()
                )
            };
            let expected = &levels.values[level as usize];
            let found = pyramid.level(level);
            assert_eq!(found.len(), expected.len(), "{}", what());
            for (i, &expected) in expected.iter().enumerate() {
                assert!(close(found.value(i, channel), expected, 0.0), "{} sample {i} of {level}", what());
            }
            for node in layout.level_nodes(level) {
                let expected = oracle::stats(&levels, layout, node);
                let found = pyramid.stats(node)[channel];
                let size = if expected.is_blank() { 0.0 } else { expected.min.abs().max(expected.max.abs()) };
                // The bounds that the crate states.
                let rounding = if levels.integer { 0.0 } else { 2f64.powi(-48) * size };
                let NodeStats { min, max, mean, std_dev, error, count, blank } = found;
                assert!(
                    min == expected.min
                        && max == expected.max
                        && close(mean, expected.mean, 1e-14 * size)
                        && close(std_dev, expected.std_dev, 1e-12 * (expected.std_dev + 1e-3 * size))
                        && close(error, expected.error, rounding)
                        && [count, blank] == [expected.count, expected.blank],
                    "{} {node}: found {found:?}, expected {expected:?}",
                    what()
                );
            }
        }
    }
}

#[test]
fn every_sample_type() {
    for dims in [[9, 7, 5], [1, 6, 11], [17, 1, 1]] {
        for samples in every_type(dims, 1) {
            for kind in KINDS {
                check(&grid(dims, samples.clone()), kind, 2);
                check(&grid(dims, samples.clone()), kind, 4);
            }
        }
    }
}

#[test]
fn thin_odd_and_prime_dims() {
    let dims = [
        [1, 1, 1],
        [2, 1, 1],
        [1, 2, 1],
        [1, 1, 2],
        [2, 2, 2],
        [3, 3, 3],
        [5, 4, 3],
        [1, 1, 67],
        [67, 1, 1],
        [1, 31, 1],
        [13, 11, 7],
        [2, 37, 3],
        [33, 2, 5],
        [65, 3, 2],
    ];
    for dims in dims {
        for brick_cells in [2, 4, 6, 30, 32] {
            for kind in KINDS {
                check(&grid(dims, random(dims, 2, |r| r as u8)), kind, brick_cells);
            }
        }
    }
}

#[test]
fn several_bricks_of_usual_size() {
    for dims in [[67, 41, 35], [33, 65, 34]] {
        for brick_cells in [30, 32] {
            for kind in KINDS {
                check(&grid(dims, random(dims, 3, |r| r as u8)), kind, brick_cells);
                check(&grid(dims, random(dims, 3, |r| r as i16)), kind, brick_cells);
            }
        }
    }
}

/// Rows of many groups of columns, of many nodes.
#[test]
fn long_rows() {
    for (dims, brick_cells) in [([1500, 3, 3], 32), ([701, 2, 4], 4), ([1100, 2, 1], 30)] {
        for kind in KINDS {
            check(&grid(dims, random(dims, 8, |r| r as u8)), kind, brick_cells);
            check(&grid(dims, random(dims, 8, |r| [r as u8, 0, (r >> 8) as u8])), kind, brick_cells);
        }
    }
}

#[test]
fn bricks_of_several_blocks() {
    let dims = [5, 75, 81];
    for brick_cells in [34, 40, 70] {
        for kind in KINDS {
            check(&grid(dims, random(dims, 4, |r| r as u16)), kind, brick_cells);
        }
    }
}

#[test]
fn constant_data_have_no_error_and_no_deviation() {
    let dims = [19, 9, 5];
    for kind in KINDS {
        let volumes: [Samples; 4] = [
            vec![255u8; 855].into(),
            vec![-128i8; 855].into(),
            vec![0.1f32; 855].into(),
            vec![1e300f64; 855].into(),
        ];
        for samples in volumes {
            let grid = grid(dims, samples);
            check(&grid, kind, 4);
            let pyramid = Pyramid::build(&grid, kind, 4).unwrap();
            for level in 0..pyramid.layout().num_levels() {
                for node in pyramid.layout().level_nodes(level) {
                    let stats = pyramid.stats(node)[0];
                    assert_eq!([stats.error, stats.std_dev, stats.schussman_max_error()], [0.0; 3]);
                }
            }
        }
    }
}

#[test]
fn blank_samples() {
    let dims = [21, 13, 9];
    let blank_or = |r: u64, every: u64| match r % every {
        0 => f32::NAN,
        1 => f32::INFINITY,
        2 => f32::NEG_INFINITY,
        _ => (r >> 40) as f32,
    };
    for kind in KINDS {
        for brick_cells in [2, 4, 30] {
            for every in [3, 4, 50, 3000] {
                let samples = random(dims, every, |r| blank_or(r, every));
                check(&grid(dims, samples.clone()), kind, brick_cells);
                check(&grid(dims, samples.into_iter().map(f64::from).collect::<Vec<_>>()), kind, brick_cells);
            }
            // A blank half, with its boundary at and beside a node's.
            for first in 7..=9 {
                let half = |i: usize| if i % 21 < first { f32::NAN } else { 1.5 };
                check(&grid(dims, (0..21 * 13 * 9).map(half).collect::<Vec<_>>()), kind, brick_cells);
            }
        }
    }
}

#[test]
fn extreme_values_neither_overflow_nor_panic() {
    let dims = [17, 5, 5];
    let ends = |low, high| random(dims, 5, move |r| if r % 2 == 0 { low } else { high });
    for kind in KINDS {
        check(&grid(dims, random(dims, 5, |r| if r % 2 == 0 { u32::MAX } else { 0 })), kind, 2);
        check(&grid(dims, random(dims, 5, |r| if r % 2 == 0 { i32::MIN } else { i32::MAX })), kind, 2);
        check(&grid(dims, random(dims, 5, |r| if r % 2 == 0 { i16::MIN } else { i16::MAX })), kind, 2);
        check(&grid(dims, ends(0.0, f64::from(f32::MAX))), kind, 2);
        let huge = Pyramid::build(&grid(dims, ends(-f64::MAX, f64::MAX)), kind, 2).unwrap();
        let root = huge.stats(huge.layout().root())[0];
        assert_eq!([root.min, root.max], [-f64::MAX, f64::MAX]);
    }
}

#[test]
fn a_mean_is_there_even_where_its_sum_overflows() {
    let grid = grid([4; 3], vec![1.7e308; 64]);
    let pyramid = Pyramid::build(&grid, Kind::Averaged, 2).unwrap();
    let level = pyramid.level(1);
    assert!((0..level.len()).all(|i| level.value(i, 0) == 1.7e308), "{level:?}");
}

#[test]
fn the_error_of_schussman_and_max_is_the_largest_distance_from_the_mean() {
    let stats = |min, max, mean| NodeStats { min, max, mean, std_dev: 1.0, error: 2.0, count: 3, blank: 0 };
    assert_eq!(stats(1.0, 10.0, 3.0).schussman_max_error(), 7.0);
    assert_eq!(stats(1.0, 10.0, 9.0).schussman_max_error(), 8.0);
    let blank = stats(f64::INFINITY, f64::NEG_INFINITY, f64::NAN);
    assert_eq!(blank.schussman_max_error(), 0.0);
    assert!(blank.is_blank() && !stats(2.0, 2.0, 2.0).is_blank() && !stats(1.0, 2.0, 1.5).is_blank());
}

#[test]
fn texels_of_cubes_are_values_less_offset_by_scale() {
    let tree = CubeTree::build(&grid([4, 2, 2], vec![14u8; 16]), 2.0, 10.0);
    assert_eq!((tree.texel(14.0), tree.texel(9.0)), (2.0, -0.5));
    assert_eq!(tree.level(1), [Cube { mean: 2.0, min: 2.0, max: 2.0 }; 2]);
    assert_eq!(tree.bytes(), (2 + 1) * size_of::<Cube>());
}

/// Deviations far below the values: sums of squares without care would lose them.
#[test]
fn deviations_of_offset_data() {
    let dims = [40, 9, 9];
    for kind in KINDS {
        check(&grid(dims, random(dims, 6, |r| 1e9 + (r % 1000) as f64)), kind, 4);
        check(&grid(dims, random(dims, 6, |r| 4_000_000_000 + (r % 3) as u32)), kind, 4);
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads() {
    let dims = [70, 50, 41];
    let bits = |pyramid: &Pyramid| -> Vec<u64> {
        let layout = pyramid.layout();
        let stats = (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level));
        let stats = stats.flat_map(|node| {
            let NodeStats { min, max, mean, std_dev, error, count, blank } = pyramid.stats(node)[0];
            [min, max, mean, std_dev, error].map(f64::to_bits).into_iter().chain([count, blank])
        });
        let levels = (0..layout.num_levels()).map(|level| pyramid.level(level));
        let samples = levels.flat_map(|level| (0..level.len()).map(|i| level.value(i, 0).to_bits()));
        stats.chain(samples).collect()
    };
    let floats: Vec<f32> = random(dims, 7, |r| if r % 99 == 0 { f32::NAN } else { (r as f32).sin() });
    for samples in [Samples::from(floats), random(dims, 7, |r| r as u8).into()] {
        for kind in KINDS {
            let on = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                bits(&pool.install(|| Pyramid::build(&grid(dims, samples.clone()), kind, 8).unwrap()))
            };
            let one = on(1);
            assert!(one == on(2) && one == on(7), "{kind:?}");
        }
    }
}

#[test]
fn level_zero_is_shared() {
    let samples = Array::from(vec![7u8; 64]);
    let pyramid = Pyramid::build(&grid([4; 3], samples.clone()), Kind::Averaged, 2).unwrap();
    let Samples::U8(level) = pyramid.level(0) else { panic!("the type changed") };
    assert_eq!(level.as_ptr(), samples.as_ptr());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn random_volumes(
        dims in [1..40usize, 1..14usize, 1..14usize], turn in 0..3usize, half_brick in 1..9usize,
        seed: u64, which in 0..10usize, averaged: bool,
    ) {
        let dims = std::array::from_fn(|a| dims[(a + turn) % 3]);
        let samples = every_type(dims, seed).swap_remove(which);
        check(&grid(dims, samples), KINDS[usize::from(averaged)], 2 * half_brick);
    }

    /// The certificate itself: no difference at any quarter position of a node is above its error.
    #[test]
    fn no_difference_exceeds_the_error(
        dims in [2..24usize, 2..12usize, 2..12usize], seed: u64, averaged: bool,
    ) {
        let grid = grid(dims, random(dims, seed, |r| r as u8));
        let kind = KINDS[usize::from(averaged)];
        let pyramid = Pyramid::build(&grid, kind, 2).unwrap();
        let layout = pyramid.layout();
        let levels = oracle::Levels::new(kind, dims, grid.samples(), 0, layout.num_levels());
        let mut next = noise(seed);
        for level in 0..layout.num_levels() {
            for node in layout.level_nodes(level) {
                let [low, high] = layout.bounds(node);
                for _ in 0..20 {
                    let share = DVec3::from_array([0; 3].map(|_: u8| (next() % 1025) as f64 / 1024.0));
                    let at = low + (high - low) * share;
                    let difference = (levels.field_at(level, at) - levels.field_at(0, at)).abs();
                    prop_assert!(difference <= pyramid.stats(node)[0].error + 1e-10, "{node} {at}");
                }
            }
        }
    }
}
