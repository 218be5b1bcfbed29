//! A stack of 256 sheets of 600,000 triangles, from which 10 million fragments come.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use volery_frame::{
    Backend, Content, Counted, Frame, Light, PictureView, Quantization, Revision, Sheet, SheetTransfer,
    SheetVertices, Sheets,
};
use volery_scene::{Camera, Projection};
use volery_wgpu::WgpuBackend;

const NUM_SHEETS: u32 = 256;

/// Squares of a sheet per side.
const CELLS: u32 = 34;

/// Sheets across z in the cube from -1 to 1.
struct Stack {
    points: Vec<[f32; 4]>,
    gradients: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
    sheets: Vec<Sheet>,
}

impl Stack {
    fn new() -> Self {
        let place = |i: u32, num: u32| 2.0 * i as f32 / num as f32 - 1.0;
        let vertices = (0..NUM_SHEETS).flat_map(|sheet| {
            let row = move |y| (0..=CELLS).map(move |x| [x, y]);
            (0..=CELLS)
                .flat_map(row)
                .map(move |[x, y]| [place(x, CELLS), place(y, CELLS), place(2 * sheet + 1, 2 * NUM_SHEETS)])
        });
        let points: Vec<_> = vertices
            .map(|[x, y, z]| [x, y, z, (0.5 + 0.5 * (4.0 * x * y + z).sin()).clamp(0.0, 1.0)])
            .collect();
        let gradients = points.iter().map(|&[x, y, z, value]| {
            let length = x.hypot(y).hypot(z);
            [x / length, y / length, z / length, value]
        });
        let count = 2 * CELLS * CELLS;
        let triangles = (0..NUM_SHEETS).flat_map(|sheet| {
            (0..CELLS * CELLS).flat_map(move |i| {
                let a = sheet * (CELLS + 1) * (CELLS + 1) + i % CELLS + i / CELLS * (CELLS + 1);
                [[a, a + 1, a + CELLS + 1], [a + CELLS + 2, a + CELLS + 1, a + 1]]
            })
        });
        let thickness = [2.0 / NUM_SHEETS as f32, 0.0];
        let sheets = (0..NUM_SHEETS).map(|sheet| Sheet {
            first: sheet * count,
            count,
            thickness,
            counted: Counted::All,
        });
        Self {
            gradients: gradients.collect(),
            triangles: triangles.collect(),
            sheets: sheets.collect(),
            points,
        }
    }

    fn quantized(&self) -> (Vec<[u16; 4]>, Vec<[i8; 4]>, Quantization) {
        let of_place = |x: f32| ((x + 1.0) / 2.0 * 65535.0).round() as u16;
        let points = self.points.iter().map(|&[x, y, z, value]| {
            [of_place(x), of_place(y), of_place(z), (value * 65535.0).round() as u16]
        });
        let gradients = self.gradients.iter().map(|&[x, y, z, magnitude]| {
            let [x, y, z] = [x, y, z].map(|x| (x * 127.0).round() as i8);
            [x, y, z, ((magnitude * 255.0).round() as u8).cast_signed()]
        });
        let step = 2.0 / 65535.0;
        let quantization = Quantization {
            low: [-1.0, -1.0, -1.0, 0.0],
            scale: [step, step, step, 1.0 / 65535.0],
            magnitude_scale: 1.0 / 255.0,
        };
        (points.collect(), gradients.collect(), quantization)
    }
}

/// A table of as many rows, of smooth colours and extinctions.
fn table(columns: usize, rows: usize) -> SheetTransfer {
    let entries = (0..rows * columns).map(|i| {
        let [u, v] = [i % columns, i / columns].map(|i| i as f32 / 256.0);
        [u.sin().abs(), v.cos().abs(), (u + v).sin().abs(), 2.0 * u.fract()]
    });
    SheetTransfer::of_entries(entries.collect(), columns, [0.0, 1.0], [0.0, 1.0])
}

fn draw(criterion: &mut Criterion) {
    let mut backend = WgpuBackend::new().expect("a device");
    let stack = Stack::new();
    let exact = SheetVertices::Exact { points: &stack.points, gradients: &[] };
    let (points, gradients, quantization) = stack.quantized();
    let quantized = SheetVertices::Quantized { points: &points, gradients: &gradients, quantization };
    let light = Some(Light { toward: [0.0, 0.6, 0.8], ambient: 0.3, diffuse: 0.7 });
    let (values, magnitudes) = (table(4096, 1), table(256, 256));
    let [once, twice] = [Some(Revision::new()), Some(Revision::new())];
    // A picture of 10 million fragments, and one of hardly any: what triangles cost alone.
    let camera = Camera {
        eye: DVec3::new(0.3, -0.4, 5.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 30.0 },
        is_mirrored: false,
    };
    let mut group = criterion.benchmark_group("sheets");
    group.sample_size(10).throughput(Throughput::Elements(stack.triangles.len() as u64));
    for (name, revision, vertices, transfer, light, size) in [
        ("exact", once, exact, &values, None, 262),
        ("exact, uploaded", None, exact, &values, None, 262),
        ("quantized, rows, lit", twice, quantized, &magnitudes, light, 262),
        ("exact, hardly a fragment", once, exact, &values, None, 16),
    ] {
        let content = Content::Sheets(Sheets {
            revision,
            normal: DVec3::Z,
            origin: DVec3::ZERO,
            vertices,
            triangles: &stack.triangles,
            sheets: &stack.sheets,
            transfer,
            light,
        });
        let frame = Frame {
            view: PictureView { width: size, height: size, camera, background: [0.0; 3], meshes: &[] },
            content,
        };
        group.bench_function(BenchmarkId::new(name, size), |bencher| {
            bencher.iter(|| backend.draw(&frame).expect("right sheets"));
        });
    }
    group.finish();
}

criterion_group!(benches, draw);
criterion_main!(benches);
