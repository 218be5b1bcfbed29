//! Trees of the size in use: how near the optimum is known to be, and that bytes are used.

use std::collections::BTreeMap;

use glam::DVec3;
use volery_octree::{Price, Tradeoff};
use volery_pyramid::{Kind, Layout, Node};

use crate::check;
use crate::world::Noise;

/// How far above the optimum an answer may be, from a 64th of the bytes.
const NEAR: f64 = 0.01;

/// The same with fewer bytes, where a step of the root is a large part of all that there is.
const NEAR_THE_ROOT: f64 = 0.05;

/// A volume with a surface: errors grow with the distance of samples and add up over the finest nodes inside a node, no
/// two of which are equal.
fn shell(layout: &Layout) -> crate::Prices {
    let mut noise = Noise(3);
    let mut weights: BTreeMap<Node, f64> = BTreeMap::new();
    for node in layout.level_nodes(0) {
        let [low, high] = layout.bounds(node);
        let distance = (((low + high) / 2.0 - DVec3::splat(255.5)).length() - 180.0).abs();
        let weight = (-distance / 20.0).exp() * (0.5 + noise.unit());
        for level in 0..layout.num_levels() {
            *weights.entry(node.ancestor(level)).or_default() += weight;
        }
    }
    let price = |(node, resolution): (Node, u32)| Price {
        bytes: layout.block_shape(node, resolution).num_samples() as u64,
        error: weights[&node] * (f64::from(1 << (2 * resolution)) - 1.0),
    };
    crate::every_choice(layout).map(|choice| (choice, price(choice))).collect()
}

#[test]
fn near_the_optimum_from_a_thousandth_of_the_bytes_to_all() {
    let layout = Layout::new([512; 3], DVec3::ONE, Kind::Averaged, 32).expect("a valid layout");
    assert_eq!(layout.num_nodes(0), 4096);
    let prices = shell(&layout);
    let ask = |node, resolution| prices.get(&(node, resolution)).copied();
    let tradeoff = Tradeoff::new(&layout, ask).expect("all is covered");
    println!("{} to {} bytes", tradeoff.min_bytes(), tradeoff.max_bytes());
    let mut last = f64::INFINITY;
    for sixteenths in -40..=0 {
        let share = 2f64.powf(f64::from(sixteenths) / 4.0);
        let max_bytes = (tradeoff.max_bytes() as f64 * share) as u64;
        let found = tradeoff.cut(max_bytes.max(tradeoff.min_bytes())).expect("enough");
        check(&layout, &prices, &found, max_bytes.max(tradeoff.min_bytes()));
        let above = if found.error > found.lower_bound { found.error / found.lower_bound - 1.0 } else { 0.0 };
        println!(
            "share {share:.4}: {} nodes, {:.3} of the bytes, error {:.4e}, at most {:.3} % above the optimum",
            found.held.len(),
            found.bytes as f64 / max_bytes as f64,
            found.error,
            above * 100.0
        );
        let threshold = if share < 1.0 / 64.0 { NEAR_THE_ROOT } else { NEAR };
        assert!(found.error <= last && above <= threshold, "threshold {threshold}");
        last = found.error;
    }
}
