//! The best cut within a budget, of volumes of `512^3` in bricks of 32 and of 16 cells.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use volery_octree::{Price, Tradeoff};
use volery_pyramid::{Kind, Layout, Node};

/// The prices of a volume with a surface, in the order in which they are asked for: errors grow with the distance of
/// samples, and add up over the finest nodes inside a node, no two of which are equal.
fn shell(layout: &Layout) -> Vec<Price> {
    let weight = |node: Node| {
        let [low, high] = layout.bounds(node);
        let center = (low + high) / 2.0;
        let distance = ((center - DVec3::splat(255.5)).length() - 180.0).abs();
        (-distance / 20.0).exp() * (1.5 + center.dot(DVec3::new(0.37, 0.71, 1.13)).sin())
    };
    let mut weights: Vec<f64> = layout.level_nodes(0).map(weight).collect();
    let mut prices = Vec::new();
    for level in 0..layout.num_levels() {
        if level > 0 {
            let sum = |node| layout.children(node).map(|child| weights[layout.node_index(child)]).sum();
            weights = layout.level_nodes(level).map(sum).collect();
        }
        for (node, weight) in layout.level_nodes(level).zip(&weights) {
            prices.extend(layout.resolutions(node).map(|resolution| Price {
                bytes: layout.block_shape(node, resolution).num_samples() as u64,
                error: weight * (f64::from(1 << (2 * resolution)) - 1.0),
            }));
        }
    }
    prices
}

fn budget(criterion: &mut Criterion) {
    for brick_cells in [32, 16] {
        let layout = Layout::new([512; 3], DVec3::ONE, Kind::Averaged, brick_cells).expect("a valid layout");
        let prices = shell(&layout);
        let make = || {
            let mut next = prices.iter();
            Tradeoff::new(&layout, |_, _| next.next().copied()).expect("all is covered")
        };
        let mut group = criterion.benchmark_group(format!("512^3 in {} finest nodes", layout.num_nodes(0)));
        group.sample_size(20);
        group.bench_function("trade-off", |bencher| bencher.iter(make));
        let tradeoff = make();
        for divisor in [256, 64, 16, 4, 2] {
            let max_bytes = tradeoff.max_bytes() / divisor;
            group.bench_function(format!("cut at 1/{divisor}"), |bencher| {
                bencher.iter(|| tradeoff.cut(black_box(max_bytes)));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, budget);
criterion_main!(benches);
