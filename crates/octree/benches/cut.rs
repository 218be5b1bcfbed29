//! Selecting, validating and ordering a cut of about a hundred thousand nodes.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_octree::{Answer, Frustum, Viewpoint, front_to_back, select, validate};
use volery_pyramid::{Kind, Layout, Node};
use volery_scene::Camera;

/// Descends around a shell, as data with a surface make it.
fn near_shell(node: Node) -> Answer {
    let half = 1i64 << node.level;
    let distance: i64 = node.index.iter().map(|&i| (i64::from(2 * i + 1) * half - 128).pow(2)).sum();
    let distance = (distance as f64).sqrt() - 90.0;
    if distance.abs() < 1.8 * half as f64 { Answer::Descend } else { Answer::Draw }
}

fn cut(criterion: &mut Criterion) {
    let layout = Layout::new([1025; 3], DVec3::ONE, Kind::Decimated, 8).expect("a valid layout");
    let camera = Camera::fitted(layout.domain(), 30.0, 20.0, 1.0, false);
    let cut = select(&layout, near_shell);
    let viewpoint = Viewpoint::of(&camera, &layout);
    let mut group = criterion.benchmark_group(format!("cut of {} nodes", cut.nodes.len()));
    group.throughput(Throughput::Elements(cut.nodes.len() as u64));
    group.bench_function("select", |bencher| bencher.iter(|| select(&layout, near_shell)));
    group.bench_function("select inside a frustum", |bencher| {
        bencher.iter(|| select(&layout, (Frustum::new(&layout, &camera, 512, 512), near_shell)));
    });
    group.bench_function("order", |bencher| bencher.iter(|| front_to_back(&layout, &cut.nodes, viewpoint)));
    group.bench_function("validate", |bencher| bencher.iter(|| validate::defects(&layout, &cut)));
    group.finish();
}

criterion_group!(benches, cut);
criterion_main!(benches);
