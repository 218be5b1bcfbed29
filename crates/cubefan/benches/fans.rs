//! Classification with fans and thickness of random boxes on one core.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use volery_cubefan::{Fans, LatticeEye, Real, Relative};

const NUM_BOXES: usize = 4096;

/// Boxes of 1 to 32 steps anywhere around an eye, as an octree has them, from a fixed sequence.
fn boxes(eye: &LatticeEye) -> Vec<Relative<f32>> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = |limit: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (((state >> 32) * limit) >> 32) as i32
    };
    (0..NUM_BOXES)
        .map(|_| {
            let size = 1 << next(6);
            let low = [(); 3].map(|()| next(512) / size * size);
            eye.relative(low, low.map(|low| low + size))
        })
        .collect()
}

fn all<F: Real>(boxes: &[Relative<F>]) {
    for relative in boxes {
        if let Some(fans) = Fans::from_eye(black_box(relative)) {
            black_box(&fans.vertices());
        }
    }
}

fn fans(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("fans");
    group.throughput(Throughput::Elements(NUM_BOXES as u64));
    for (place, eye) in [("outside", [-300.0, -200.0, 900.0]), ("inside", [250.3, 260.7, 240.1])] {
        let boxes = boxes(&LatticeEye::new(eye, [1.0; 3]));
        group.bench_function(format!("f32, eye {place} the volume"), |bencher| bencher.iter(|| all(&boxes)));
        let wide = |numbers: [f32; 3]| numbers.map(f64::from);
        let boxes: Vec<Relative<f64>> = boxes
            .iter()
            .map(|&Relative { low, high, size }| Relative {
                low: wide(low),
                high: wide(high),
                size: wide(size),
            })
            .collect();
        group.bench_function(format!("f64, eye {place} the volume"), |bencher| bencher.iter(|| all(&boxes)));
    }
    let boxes = boxes(&LatticeEye::new([0.0; 3], [1.0; 3]));
    group.bench_function("f32, parallel rays", |bencher| {
        bencher.iter(|| {
            for relative in &boxes {
                if let Some(fans) = Fans::along(black_box([0.3, -0.5, 0.8]), black_box(relative)) {
                    black_box(&fans.vertices());
                }
            }
        });
    });
    group.finish();
}

criterion_group!(benches, fans);
criterion_main!(benches);
