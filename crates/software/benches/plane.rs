//! An oblique cutting plane through 512^3 samples of 8 bits, all bricks resident at full resolution.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_frame::{
    Backend, BlendedBrick, Brick, BrickId, Content, Frame, PictureView, PlacedBrick, Planes, PointTransfer,
    Revision, Sampling, TexelType, Texels, VolumeLayout,
};
use volery_scene::{Camera, ControlPoint, Plane, Projection, TransferFunction};
use volery_software::SoftwareBackend;

const SAMPLES: u32 = 512;
const BRICK_CELLS: u32 = 32;

/// Rings with a fine texture, so that neighbouring samples differ.
fn sample(x: u32, y: u32, z: u32) -> u8 {
    let [a, b, c] = [x, y, z].map(|i| (i as f32 / SAMPLES as f32 - 0.5) * 20.0);
    let rings = ((a * a + b * b + c * c).sqrt() * 3.0).sin();
    let grain = (x.wrapping_mul(73) ^ y.wrapping_mul(151) ^ z.wrapping_mul(211)) & 31;
    (110.0 + 100.0 * rings + grain as f32) as u8
}

/// Uploads all bricks; returns their places.
fn fill(backend: &mut SoftwareBackend, layout: &VolumeLayout) -> Vec<BlendedBrick> {
    let num = layout.cells[0].div_ceil(BRICK_CELLS);
    let mut bricks = Vec::new();
    for index in 0..num.pow(3) {
        let first_cell = [index % num, index / num % num, index / num / num].map(|i| i * BRICK_CELLS);
        let samples = first_cell.map(|first| (SAMPLES - first).min(BRICK_CELLS + 1));
        let mut texels = Vec::new();
        for z in 0..samples[2] {
            for y in 0..samples[1] {
                let [x0, y, z] = [first_cell[0], first_cell[1] + y, first_cell[2] + z];
                texels.extend((0..samples[0]).map(|x| sample(x0 + x, y, z)));
            }
        }
        let id = BrickId(index.into());
        backend.upload(&[Brick { id, samples, texels: Texels::U8(&texels) }]).expect("the brick fits");
        bricks.push(BlendedBrick { placed: PlacedBrick { id, first_cell, level: 0 }, low_corners: 0 });
    }
    bricks
}

fn plane(criterion: &mut Criterion) {
    let layout = VolumeLayout {
        revision: Revision::new(),
        cells: [SAMPLES - 1; 3],
        spacing: DVec3::ONE,
        brick_cells: BRICK_CELLS,
        texel: TexelType::U8,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 255.0],
    };
    let mut backend = SoftwareBackend::new();
    backend.set_volume(&layout).expect("the layout is right");
    let mut bricks = fill(&mut backend, &layout);
    let gray = |value: f64| ControlPoint { value, color: [value / 255.0; 3], opacity: 1.0 };
    let transfer =
        TransferFunction::new(vec![gray(0.0), gray(255.0)], 1.0).expect("a right transfer function");
    let transfer = PointTransfer::new(&transfer, &layout);
    let normal = DVec3::new(0.3, 0.5, 0.81);
    let middle = DVec3::splat(f64::from(SAMPLES - 1) / 2.0);
    let planes = [Plane::through(middle, normal)];
    // A sample per pixel of the picture of 512 by 512.
    let camera = Camera {
        eye: middle - normal.normalize() * 1000.0,
        target: middle,
        up: DVec3::Y,
        projection: Projection::Orthographic { height: f64::from(SAMPLES) },
        is_mirrored: false,
    };
    let mut group = criterion.benchmark_group("oblique plane through 512^3 u8");
    for (name, low_corners) in [("full resolution", 0), ("blended", 0b0101_1010)] {
        bricks.iter_mut().for_each(|brick| brick.low_corners = low_corners);
        for size in [64, 512, 1024] {
            let content = Content::Planes(Planes {
                planes: &planes,
                bricks: &bricks,
                transfer: &transfer,
                sampling: Sampling::Linear,
                is_transparent: false,
                shows_bricks: false,
            });
            let frame = Frame {
                view: PictureView { width: size, height: size, camera, background: [0.0; 3], meshes: &[] },
                content,
            };
            group.throughput(Throughput::Elements(u64::from(size) * u64::from(size)));
            group.bench_function(BenchmarkId::new(name, size), |bencher| {
                bencher.iter(|| backend.draw(&frame).expect("every brick is resident"));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, plane);
criterion_main!(benches);
