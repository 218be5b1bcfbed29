//! Near the optimum, in small trees whose optimum is known.

use volery_pyramid::Layout;

use crate::oracle::least_errors;
use crate::world::Noise;
use crate::{Prices, arbitrary, check, like_a_volume, tradeoff, tree};

const NUM_TREES: u64 = 500;

/// How far above the optimum an answer may be.
const NEAR: f64 = 0.05;

const SMALL: [[usize; 3]; 6] = [[3, 3, 3], [5, 5, 5], [9, 5, 3], [9, 9, 9], [17, 3, 2], [7, 9, 5]];

/// Errors of answers above the optimum, relative to it, over a number of trees and eight budgets each; sorted.
fn distances(num_trees: u64, dims: &[[usize; 3]], make: fn(&Layout, &mut Noise) -> Prices) -> Vec<f64> {
    let mut distances = Vec::new();
    for seed in 0..num_trees {
        let mut noise = Noise(seed);
        let layout = tree(dims[seed as usize % dims.len()]);
        let prices = make(&layout, &mut noise);
        let least = least_errors(&layout, &prices, layout.root());
        let tradeoff = tradeoff(&layout, &prices);
        let min_bytes = least.iter().position(|error| error.is_finite()).expect("some cut") as u64;
        assert_eq!(tradeoff.min_bytes(), min_bytes);
        for part in 0..8 {
            // More of the budgets near the smallest.
            let share = ((f64::from(part) + noise.unit()) / 8.0).powi(2);
            let max_bytes = min_bytes + (share * (least.len() as u64 - min_bytes) as f64) as u64;
            let found = tradeoff.cut(max_bytes).expect("a budget that is large enough");
            check(&layout, &prices, &found, max_bytes);
            let optimum = least[(max_bytes as usize).min(least.len() - 1)];
            assert!(found.error >= optimum * (1.0 - 1e-14), "{} is below the optimum {optimum}", found.error);
            assert!(found.lower_bound <= optimum * (1.0 + 1e-14), "{} of {optimum}", found.lower_bound);
            distances.push(if found.error == optimum { 0.0 } else { found.error / optimum - 1.0 });
        }
    }
    distances.sort_by(f64::total_cmp);
    distances
}

fn print(name: &str, distances: &[f64]) -> f64 {
    let is_optimal = distances.iter().filter(|&&distance| distance < 1e-12).count();
    let at = |share: f64| distances[((distances.len() - 1) as f64 * share) as usize] * 100.0;
    println!(
        "{name}: {is_optimal} of {} optimal; above the optimum by {:.3} % at the 90th percentile, {:.3} % at the 99th, {:.3} % at most (threshold {:.0} %)",
        distances.len(),
        at(0.9),
        at(0.99),
        at(1.0),
        NEAR * 100.0
    );
    at(1.0) / 100.0
}

#[test]
fn near_the_optimum_for_arbitrary_prices() {
    assert!(print("arbitrary prices", &distances(NUM_TREES, &SMALL, arbitrary)) <= NEAR);
}

#[test]
fn near_the_optimum_for_blocks_of_volumes() {
    assert!(print("blocks of volumes", &distances(NUM_TREES, &SMALL, like_a_volume)) <= NEAR);
}

/// Trees of 512 to 4096 finest nodes, too many for a whole search of every gap.
#[test]
fn near_the_optimum_where_searches_are_cut_off() {
    let larger = [[17, 17, 17], [33, 33, 17]];
    assert!(print("arbitrary prices, larger trees", &distances(12, &larger, arbitrary)) <= NEAR);
    assert!(print("blocks of volumes, larger trees", &distances(12, &larger, like_a_volume)) <= NEAR);
}
