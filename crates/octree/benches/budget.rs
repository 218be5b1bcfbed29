//! The best cut within a budget, of volumes of `512^3` in bricks of 32 and of 16 cells.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use volery_octree::{Price, Tradeoff};
use volery_pyramid::{Kind, Layout, Node};

/// The prices of a volume with a surface: every node differs.
fn shell(layout: &Layout, node: Node, resolution: u32) -> Price {
    let [low, high] = layout.bounds(node);
    let half = (high - low).length() / 2.0;
    let center = (low + high) / 2.0;
    let distance = ((center - DVec3::splat(255.5)).length() - 180.0).abs();
    let near =
        (-(distance - half).max(0.0) / 20.0).exp() * (1.5 + (center.dot(DVec3::new(0.37, 0.71, 1.13))).sin());
    let error = near * half * half.min(20.0) * (f64::from(1 << (2 * resolution)) - 1.0);
    Price { bytes: layout.block_shape(node, resolution).num_samples() as u64, error }
}

fn budget(criterion: &mut Criterion) {
    for brick_cells in [32, 16] {
        let layout = Layout::new([512; 3], DVec3::ONE, Kind::Averaged, brick_cells).expect("a valid layout");
        let mut prices = Vec::new();
        for node in (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level)) {
            prices.extend(layout.resolutions(node).map(|resolution| shell(&layout, node, resolution)));
        }
        let make = || {
            // In the order in which they are asked for.
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
