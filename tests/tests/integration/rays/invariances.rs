//! The same matter written down in another way is the same picture, to .001.
//!
//! Samples and control points are multiples of 2^-20, so that halves of sums and sums with 1e6 are exact.

use glam::DVec3;
use volery::{BackendChoice, Camera, ControlPoint, How, Projection, TransferFunction};
use volery_reference::Image;
use volery_scene::VoxelGrid;
use volery_tests::{Drawer, Shared, at_most, backend, distance, draw, exact, matter_view};

use super::{BACKGROUND, aslant, fill, noise, shell, transfer, wave};

by_both_backends! {
    the_unit_of_length_does_not_matter
    twice_as_many_samples_of_the_same_field
    values_may_be_shifted
    axes_may_be_exchanged
}

const SIZE: [u32; 2] = [40, 40];
const MAX: f64 = 1e-3;

/// A volume and how it is seen.
#[derive(Clone)]
struct Matter {
    name: &'static str,
    dims: [usize; 3],
    spacing: DVec3,
    values: Vec<f64>,
    transfer: TransferFunction,
    camera: Camera,
}

fn dyadic(value: f64) -> f64 {
    (value * 2_f64.powi(20)).round() / 2_f64.powi(20)
}

/// Smooth and rough, thin and opaque.
fn matters() -> Vec<Matter> {
    let dims = [13, 10, 12];
    let spacing = DVec3::new(1.0, 1.25, 0.75);
    let extent = DVec3::from_array(dims.map(|n| (n - 1) as f64)) * spacing;
    let inside = Camera {
        eye: extent * DVec3::new(0.31, 0.42, 0.57),
        target: extent * DVec3::new(0.9, 0.8, 0.1),
        up: DVec3::new(0.1, 0.2, 1.0),
        projection: Projection::Perspective { fov_y_deg: 70.0 },
        is_mirrored: false,
    };
    let parallel = Camera { projection: Projection::Orthographic { height: 12.0 }, ..aslant(extent) };
    let ramp = || transfer(&[(0.25, 0.0), (0.5, 0.125), (0.75, 0.5)], 1.0);
    let steps = transfer(&[(0.0, 0.0), (0.25, 0.0), (0.25, 0.5), (0.625, 0.25), (0.625, 0.0)], 1.0);
    let spike = transfer(&[(0.5, 0.0), (0.5 + 2_f64.powi(-9), 0.75), (0.5 + 2_f64.powi(-8), 0.0)], 0.25);
    let opaque = || shell(0.687_5, 0.687_5 + 2_f64.powi(-10), 1.0, 1.0);
    let smooth = || fill(dims, |p| dyadic(wave(p)));
    let rough = || fill(dims, |p| dyadic(noise(p)));
    let mask = fill(dims, |p| f64::from(u8::from(wave(p) > 0.5)));
    let outside = aslant(extent);
    let matter = |name, values, transfer, camera| Matter { name, dims, spacing, values, transfer, camera };
    vec![
        matter("smooth, ramp", smooth(), ramp(), outside),
        matter("smooth, opaque shell", smooth(), opaque(), outside),
        matter("smooth, spike", smooth(), spike, parallel),
        matter("rough, steps", rough(), steps, outside),
        matter("rough, ramp from inside", rough(), ramp(), inside),
        matter("mask, opaque shell", mask, opaque(), outside),
    ]
}

impl Matter {
    fn drawn(&self, backend: &Shared) -> Image {
        let grid = VoxelGrid::new(self.dims, self.spacing, self.values.clone()).unwrap();
        self.drawn_as(grid, backend)
    }

    /// The picture of a volume that stands for this one.
    fn drawn_as(&self, grid: VoxelGrid, backend: &Shared) -> Image {
        let mut session = Drawer::volume(grid, Box::new(backend.clone()), How::Raycast).unwrap();
        let view = matter_view(self.camera, self.transfer.clone(), BACKGROUND, SIZE);
        let drawn = exact(&draw(&mut session, &view).image);
        let shown = drawn.pixels().iter().filter(|pixel| (pixel[2] - BACKGROUND[2]).abs() > 1e-3).count();
        assert!(shown > drawn.pixels().len() / 10, "{}: matter in {shown} pixels only", self.name);
        drawn
    }

    /// With other control points and another distance that opacities refer to.
    fn with_transfer(self, point: impl Fn(ControlPoint) -> ControlPoint, unit: f64) -> Self {
        let points = self.transfer.points().iter().map(|&p| point(p)).collect();
        let transfer = TransferFunction::new(points, self.transfer.unit_distance() * unit).unwrap();
        Self { transfer, ..self }
    }

    fn scaled(self, by: f64) -> Self {
        let projection = match self.camera.projection {
            Projection::Orthographic { height } => Projection::Orthographic { height: by * height },
            perspective => perspective,
        };
        let Camera { eye, target, .. } = self.camera;
        let camera = Camera { eye: by * eye, target: by * target, projection, ..self.camera };
        Self { camera, spacing: by * self.spacing, ..self }.with_transfer(|p| p, by)
    }

    /// The same trilinear field, sampled twice as finely.
    fn resampled(self) -> Self {
        let [nx, ny, _] = self.dims;
        let value = |[x, y, z]: [usize; 3]| {
            let ends = [x, y, z].map(|i| [i / 2, i.div_ceil(2)]);
            let corner = |bits: usize| {
                let [x, y, z] = [0, 1, 2].map(|axis| ends[axis][bits >> axis & 1]);
                self.values[(z * ny + y) * nx + x]
            };
            (0..8).map(corner).sum::<f64>() / 8.0
        };
        let dims = self.dims.map(|n| 2 * n - 1);
        let values = fill(dims, value);
        Self { dims, values, spacing: self.spacing / 2.0, ..self }
    }

    fn shifted(mut self, by: f64) -> Self {
        self.values.iter_mut().for_each(|value| *value += by);
        self.with_transfer(|p| ControlPoint { value: p.value + by, ..p }, 1.0)
    }

    /// Axis `i` of the new volume is axis `from[i]` of this one.
    fn exchanged(self, from: [usize; 3]) -> Self {
        let vector = |v: DVec3| DVec3::from_array(from.map(|axis| v[axis]));
        let dims = from.map(|axis| self.dims[axis]);
        let value = |new: [usize; 3]| {
            let mut old = [0; 3];
            (0..3).for_each(|axis| old[from[axis]] = new[axis]);
            self.values[(old[2] * self.dims[1] + old[1]) * self.dims[0] + old[0]]
        };
        let values = fill(dims, value);
        let Camera { eye, target, up, .. } = self.camera;
        let camera = Camera { eye: vector(eye), target: vector(target), up: vector(up), ..self.camera };
        Self { dims, spacing: vector(self.spacing), values, camera, ..self }
    }
}

fn mirrored(image: &Image) -> Image {
    let (width, height) = (image.width(), image.height());
    let pixels = (0..height).flat_map(|row| (0..width).rev().map(move |column| image.pixel(column, row)));
    Image::new(width, height, pixels.collect()).unwrap()
}

/// Compares pictures of the same matter.
fn same(what: &str, left: &Image, right: &Image) {
    at_most("largest difference", distance(what, left, right).max, MAX);
}

fn the_unit_of_length_does_not_matter(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    for matter in matters() {
        let drawn = matter.drawn(&backend);
        for by in [1e-6, 1e-3, 1e3, 1e6] {
            let scaled = matter.clone().scaled(by).drawn(&backend);
            same(&format!("{test}, {}, x {by:e}", matter.name), &scaled, &drawn);
        }
    }
}

fn twice_as_many_samples_of_the_same_field(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    for matter in matters() {
        let resampled = matter.clone().resampled();
        same(&format!("{test}, {}", matter.name), &resampled.drawn(&backend), &matter.drawn(&backend));
    }
}

fn values_may_be_shifted(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    for matter in matters() {
        let drawn = matter.drawn(&backend);
        for by in [-1e3, 1e6] {
            let shifted = matter.clone().shifted(by).drawn(&backend);
            same(&format!("{test}, {} {by:+e}", matter.name), &shifted, &drawn);
        }
        // 0 to 1000 in whole numbers, and the same from a million on.
        let whole = |by: f64| {
            let to_whole = |p: ControlPoint| ControlPoint { value: 1000.0 * p.value + by, ..p };
            let matter = matter.clone().with_transfer(to_whole, 1.0);
            let values: Vec<i32> = matter.values.iter().map(|v| (1000.0 * v + by).round() as i32).collect();
            matter.drawn_as(VoxelGrid::new(matter.dims, matter.spacing, values).unwrap(), &backend)
        };
        same(&format!("{test}, {}, i32", matter.name), &whole(1e6), &whole(0.0));
    }
}

fn axes_may_be_exchanged(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    for matter in matters() {
        let drawn = matter.drawn(&backend);
        for from in [[1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
            // Two axes exchanged are a mirror.
            let is_mirror = (0..3).any(|axis| from[axis] == axis);
            let exchanged = matter.clone().exchanged(from).drawn(&backend);
            let exchanged = if is_mirror { mirrored(&exchanged) } else { exchanged };
            same(&format!("{test}, {}, {from:?}", matter.name), &exchanged, &drawn);
        }
    }
}
