//! Building pyramids in memory, with all statistics. `SIZE` in the environment sets the samples per axis.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_pyramid::{Kind, Pyramid};
use volery_scene::{Samples, VoxelGrid};

/// A smooth field with fine texture: nothing is constant, nothing is noise alone.
fn field(size: usize) -> Vec<f32> {
    let wave = |i: usize, f: f32| (i as f32 * f / size as f32).sin();
    let mut values = Vec::with_capacity(size * size * size);
    for z in 0..size {
        for y in 0..size {
            for x in 0..size {
                let grain = (x * 7 + y * 13 + z * 29) % 16;
                values.push(100.0 + 60.0 * wave(x, 9.0) * wave(y, 7.0) * wave(z, 5.0) + grain as f32);
            }
        }
    }
    values
}

fn build(criterion: &mut Criterion) {
    let size: usize = std::env::var("SIZE").map_or(512, |size| size.parse().expect("SIZE is a number"));
    let field = field(size);
    let samples: [Samples; 3] = [
        field.iter().map(|&v| v as u8).collect::<Vec<_>>().into(),
        field.iter().map(|&v| (v * 100.0) as u16).collect::<Vec<_>>().into(),
        field.into(),
    ];
    let mut group = criterion.benchmark_group("build");
    group.throughput(Throughput::Elements(size.pow(3) as u64)).sample_size(10);
    for samples in samples {
        let sample_type = samples.sample_type();
        let grid = VoxelGrid::new([size; 3], DVec3::ONE, samples).expect("the field fills the grid");
        for kind in [Kind::Decimated, Kind::Averaged] {
            let id = BenchmarkId::new(format!("{kind:?}"), format!("{sample_type}, {size}^3"));
            group.bench_function(id, |bencher| bencher.iter(|| Pyramid::build(&grid, kind, 32)));
        }
    }
    group.finish();
}

criterion_group!(benches, build);
criterion_main!(benches);
