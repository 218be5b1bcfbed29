//! 2:1 balance of the tree that p4est 2.2 was timed on: refined near a plane down to level 9 of the unit
//! cube, 514,998 leaves before and 900,313 after. The throughput counts the leaves after.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rayon::ThreadPoolBuilder;
use volery_octree::balance::{Leaf, balance_leaves};

/// Depth of the tree.
const LEVELS: u32 = 9;

/// The leaves of the tree over `[0, 1]^3` that is refined where it meets the plane, in canonical order.
fn refined_near_plane(node: Leaf<3>, leaves: &mut Vec<Leaf<3>>) {
    let h = 0.5_f64.powi((LEVELS - node.level) as i32);
    let [x, y, z] = node.index.map(|i| (f64::from(i) + 0.5) * h);
    let d = 0.3 * (x - 0.31) + 0.5 * (y - 0.47) + 0.81 * (z - 0.63);
    if node.level == 0 || d * d >= 0.25 * h * h {
        leaves.push(node);
        return;
    }
    for octant in 0..8 {
        let index = std::array::from_fn(|axis| 2 * node.index[axis] + (octant >> axis & 1));
        refined_near_plane(Leaf::new(node.level - 1, index), leaves);
    }
}

fn balance(criterion: &mut Criterion) {
    let mut leaves = Vec::new();
    refined_near_plane(Leaf::new(LEVELS, [0; 3]), &mut leaves);
    let extent = [1 << LEVELS; 3];
    let after = balance_leaves(extent, &leaves);
    assert_eq!((leaves.len(), after.len()), (514_998, 900_313));

    let mut group = criterion.benchmark_group("balance");
    group.throughput(Throughput::Elements(after.len() as u64));
    for threads in [1, 2] {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        group.bench_function(BenchmarkId::new("threads", threads), |bencher| {
            pool.install(|| bencher.iter(|| balance_leaves(extent, &leaves)));
        });
    }
    group.finish();
}

criterion_group!(benches, balance);
criterion_main!(benches);
