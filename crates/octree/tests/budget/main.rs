//! Cuts within a budget of bytes: against exact optima, against one another, and where prices are strange.

mod balanced;
mod hard_cases;
mod large;
mod monotone;
mod optimum;
mod oracle;
#[path = "../world/mod.rs"]
#[allow(dead_code, reason = "of what tests share these use a part")]
mod world;

use std::collections::BTreeMap;

use glam::DVec3;
use volery_octree::validate::defects;
use volery_octree::{Budgeted, Cut, Price, Tradeoff};
use volery_pyramid::{Kind, Layout, Node};
use world::Noise;

/// The price of everything that a tree can hold.
pub(crate) type Prices = BTreeMap<(Node, u32), Price>;

/// A tree of `2^depth` finest nodes along its longest axis.
pub(crate) fn tree(dims: [usize; 3]) -> Layout {
    Layout::new(dims, DVec3::ONE, Kind::Decimated, 2).expect("a valid layout")
}

pub(crate) fn every_choice(layout: &Layout) -> impl Iterator<Item = (Node, u32)> {
    let nodes = (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level));
    nodes.flat_map(|node| layout.resolutions(node).map(move |resolution| (node, resolution)))
}

/// Bytes and errors without any order: whole numbers, so that sums are exact.
pub(crate) fn arbitrary(layout: &Layout, noise: &mut Noise) -> Prices {
    every_choice(layout)
        .map(|choice| {
            let bytes = 1 + (noise.unit() * 12.0 * f64::from(1 + choice.0.level)) as u64;
            let error = (noise.unit().powi(3) * 1000.0 * f64::from(1 << (2 * choice.0.level))).floor();
            (choice, Price { bytes, error })
        })
        .collect()
}

/// Bytes of the blocks, one each texel; errors that grow with the distance of samples, and matter here and there.
pub(crate) fn like_a_volume(layout: &Layout, noise: &mut Noise) -> Prices {
    let weights: Vec<f64> = (0..layout.num_nodes(0)).map(|_| noise.unit().powi(4) * 1000.0).collect();
    every_choice(layout)
        .map(|(node, resolution)| {
            let bytes = layout.block_shape(node, resolution).num_samples() as u64;
            let finest = layout.level_nodes(0).zip(&weights);
            let weight: f64 =
                finest.filter(|(leaf, _)| leaf.ancestor(node.level) == node).map(|(_, w)| w).sum();
            let error = weight * f64::from((1 << (2 * resolution)) - 1);
            ((node, resolution), Price { bytes, error: error.floor() })
        })
        .collect()
}

pub(crate) fn tradeoff(layout: &Layout, prices: &Prices) -> Tradeoff {
    Tradeoff::new(layout, |node, resolution| prices.get(&(node, resolution)).copied())
        .expect("all is covered")
}

/// Checks all that an answer says of itself: that it is a cut, and its bytes and error those of what it holds.
#[track_caller]
pub(crate) fn check(layout: &Layout, prices: &Prices, found: &Budgeted, max_bytes: u64) {
    let cut = Cut { nodes: found.held.iter().map(|held| held.node).collect(), skipped: Vec::new() };
    assert_eq!(defects(layout, &cut), []);
    let taken: Vec<Price> = found.held.iter().map(|held| prices[&(held.node, held.resolution)]).collect();
    assert_eq!(found.bytes, taken.iter().map(|price| price.bytes).sum::<u64>());
    assert!(found.bytes <= max_bytes, "{} of {max_bytes} bytes", found.bytes);
    let error: f64 = taken.iter().map(|price| price.error.max(0.0)).sum();
    // Rounded up, by a unit for each node; whole numbers are exact as long as the unit is below 1.
    let all: f64 = prices.values().map(|price| price.error.max(0.0)).filter(|error| error.is_finite()).sum();
    let units = found.held.len() as f64 * all * 2f64.powi(-59);
    let is_exact = units < 1.0 && error.fract() == 0.0;
    let most = if is_exact { error } else { error * (1.0 + 1e-14) + units };
    let least = if is_exact { error } else { error * (1.0 - 1e-14) };
    assert!((least..=most).contains(&found.error), "{}, expected {least} to {most}", found.error);
    assert!(found.lower_bound <= found.error);
}
