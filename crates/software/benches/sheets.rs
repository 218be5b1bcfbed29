//! The slices of a curvilinear grid of 40 x 32 x 32 nodes, across the view: 512x512 pixels in perspective.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_frame::{
    Backend, Content, Counted, Frame, PictureView, Revision, Sheet, SheetTransfer, SheetVertices, Sheets,
};
use volery_scene::{Camera, CellType, Cells, ControlPoint, Projection, TransferFunction, UnstructuredGrid};
use volery_slicing::{Planes, Rays, SliceMesh, Slicer};
use volery_software::SoftwareBackend;

const NODES: [usize; 3] = [40, 32, 32];

/// A quarter of a thick shell, its cells thin at the inner wall, and the distance from its axis.
fn curvilinear() -> UnstructuredGrid {
    let [nx, ny, nz] = NODES;
    let mut points = Vec::with_capacity(nx * ny * nz);
    for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
        let [u, v, w] = [(x, nx), (y, ny), (z, nz)].map(|(i, n)| i as f64 / (n - 1) as f64);
        let radius = 1.0 + 6.0 * (v.exp() - 1.0) * v;
        let angle = std::f64::consts::FRAC_PI_2 * u;
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
    let heat: Vec<f32> = points.iter().map(|point| point.truncate().length() as f32).collect();
    let grid = UnstructuredGrid::new(points, cells).and_then(|grid| grid.with_array("heat", heat));
    grid.expect("nodes exist")
}

/// The mesh of so many planes across the view.
fn mesh(grid: UnstructuredGrid, camera: &Camera, count: usize) -> SliceMesh {
    let slicer = Slicer::new(grid).expect("few edges");
    let planes = Planes::over(slicer.grid(), camera.target - camera.eye, count).expect("a grid with extent");
    let heat = &slicer.grid().arrays()[0].values;
    let mut mesh = slicer.mesh(&planes, heat, None).expect("few triangles");
    mesh.orient_strips(Rays::From(camera.eye));
    mesh
}

fn sheets(criterion: &mut Criterion) {
    let camera = Camera {
        eye: DVec3::new(-16.0, -12.0, 14.0),
        target: DVec3::new(-5.0, 5.0, 2.5),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 30.0 },
        is_mirrored: false,
    };
    let points = [(1.0, 0.0), (4.0, 0.02), (8.0, 0.1), (11.4, 0.4)];
    let points =
        points.map(|(value, opacity)| ControlPoint { value, color: [value / 12.0, 0.5, 0.3], opacity });
    let transfer = TransferFunction::new(points.to_vec(), 0.5).expect("a right transfer function");
    let transfer = SheetTransfer::new(&transfer, [1.0, 11.4]);
    let mut group = criterion.benchmark_group("slices of 37,479 hexahedra");
    group.sample_size(20);
    for count in [64, 256] {
        let mesh = mesh(curvilinear(), &camera, count);
        let eye = (camera.eye - mesh.origin).dot(mesh.normal);
        let sheets: Vec<_> = mesh
            .back_to_front(eye)
            .map(|sheet| Sheet {
                first: sheet.triangles.start,
                count: sheet.triangles.end - sheet.triangles.start,
                thickness: sheet.thickness.map(|t| t as f32),
                counted: Counted::All,
            })
            .collect();
        let content = Content::Sheets(Sheets {
            revision: Some(Revision::new()),
            normal: mesh.normal,
            origin: mesh.origin,
            vertices: SheetVertices::Exact { points: &mesh.points, gradients: &[] },
            triangles: &mesh.triangles,
            sheets: &sheets,
            transfer: &transfer,
            light: None,
        });
        let frame = Frame {
            view: PictureView { width: 512, height: 512, camera, background: [0.0; 3], meshes: &[] },
            content,
        };
        let mut backend = SoftwareBackend::new();
        group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
        group.bench_function(BenchmarkId::new("draw", count), |bencher| {
            bencher.iter(|| backend.draw(&frame).expect("right sheets"));
        });
    }
    group.finish();
}

criterion_group!(benches, sheets);
criterion_main!(benches);
