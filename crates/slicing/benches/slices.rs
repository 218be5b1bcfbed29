//! Slicing a curvilinear grid of the size of the blunt fin, 40 x 32 x 32 nodes, by 256 planes.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_scene::{CellType, Cells, UnstructuredGrid};
use volery_slicing::{Planes, Refinement, Slicer, node_gradients};

const NODES: [usize; 3] = [40, 32, 32];

/// A quarter of a thick shell, its cells thin at the inner wall; faces are warped where `twist` is not 0.
fn curvilinear(twist: f64) -> UnstructuredGrid {
    let [nx, ny, nz] = NODES;
    let mut points = Vec::with_capacity(nx * ny * nz);
    for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
        let [u, v, w] = [(x, nx), (y, ny), (z, nz)].map(|(i, n)| i as f64 / (n - 1) as f64);
        let radius = 1.0 + 6.0 * (v.exp() - 1.0) * v;
        let angle = std::f64::consts::FRAC_PI_2 * u + twist * v * w;
        points.push(DVec3::new(-radius * angle.cos(), radius * angle.sin(), 5.0 * w * w));
    }
    let node = |x: usize, y: usize, z: usize| ((z * ny + y) * nx + x) as u32;
    let mut nodes = Vec::new();
    for (z, y, x) in (1..nz).flat_map(|z| (1..ny).flat_map(move |y| (1..nx).map(move |x| (z, y, x)))) {
        for z in [z - 1, z] {
            nodes.extend([node(x - 1, y - 1, z), node(x, y - 1, z), node(x, y, z), node(x - 1, y, z)]);
        }
    }
    let cells = Cells::new(vec![CellType::Hexahedron; nodes.len() / 8], nodes).expect("eight nodes per cell");
    let heat: Vec<f32> = points.iter().map(|point| point.length() as f32).collect();
    let grid = UnstructuredGrid::new(points, cells).and_then(|grid| grid.with_array("heat", heat));
    grid.expect("nodes exist")
}

fn slices(criterion: &mut Criterion) {
    let normal = DVec3::new(0.3, 0.5, 0.81);
    for (name, twist) in [("planar faces", 0.0), ("warped faces", 0.5)] {
        let grid = curvilinear(twist);
        let slicer = Slicer::new(grid.clone()).expect("few edges");
        let planes = Planes::over(&grid, normal, 256).expect("a grid with extent");
        let stack = slicer.slice(&planes).expect("few polygons");
        let heat = &slicer.grid().arrays()[0].values;
        let count = stack.num_polygons() as u64;
        let mut group = criterion.benchmark_group(format!("{count} polygons, {name}"));
        group.throughput(Throughput::Elements(count));
        group.sample_size(20);
        group.bench_function("prepare", |bencher| bencher.iter(|| Slicer::new(slicer.grid().clone())));
        group.bench_function("gradients at nodes", |bencher| {
            bencher.iter(|| node_gradients(slicer.grid(), heat));
        });
        group.bench_function("slice", |bencher| bencher.iter(|| slicer.slice(&planes)));
        group.bench_function("positions and values", |bencher| {
            bencher.iter(|| {
                let sections = stack.sections();
                let made = sections.map(|(_, section)| {
                    section.positions(slicer.grid().points()).len() + section.values(heat).len()
                });
                made.sum::<usize>()
            });
        });
        group.bench_function("semi-adaptively from 32", |bencher| {
            let refinement = Refinement { first_planes: 32, share: 1.0 };
            bencher.iter(|| slicer.slice_adaptively(normal, refinement));
        });
        group.finish();
    }
}

criterion_group!(benches, slices);
criterion_main!(benches);
