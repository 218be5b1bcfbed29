//! Slow, simple, independent ways to the same pictures.

use glam::DVec3;
use volery_reference::{Image, Light};
use volery_scene::{Camera, ControlPoint, Projection, Ray, TransferFunction, VoxelGrid};

/// A transfer function of `(value, colour, opacity)`.
pub(crate) fn transfer(points: &[(f64, [f64; 3], f64)], unit_distance: f64) -> TransferFunction {
    let point = |&(value, color, opacity)| ControlPoint { value, color, opacity };
    TransferFunction::new(points.iter().map(point).collect(), unit_distance)
        .expect("a valid transfer function")
}

pub(crate) fn perspective(eye: DVec3, target: DVec3, fov_y_deg: f64) -> Camera {
    let up = if (target - eye).normalize().z.abs() > 0.99 { DVec3::Y } else { DVec3::Z };
    Camera { eye, target, up, projection: Projection::Perspective { fov_y_deg }, is_mirrored: false }
}

pub(crate) fn orthographic(eye: DVec3, target: DVec3, height: f64) -> Camera {
    Camera { projection: Projection::Orthographic { height }, ..perspective(eye, target, 30.0) }
}

/// Where a ray is inside the box `[low, high]`, for `t >= 0`.
pub(crate) fn slab(ray: &Ray, low: DVec3, high: DVec3) -> Option<[f64; 2]> {
    let (mut start, mut end) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (from, along) = (ray.origin[axis], ray.direction[axis]);
        if along == 0.0 {
            if from < low[axis] || from > high[axis] {
                return None;
            }
        } else {
            let (a, b) = ((low[axis] - from) / along, (high[axis] - from) / along);
            start = start.max(a.min(b));
            end = end.min(a.max(b));
        }
    }
    (start < end).then_some([start, end])
}

/// Greatest difference of any channel of any pixel from what `expected` says of its ray. A ray from afar is
/// first brought near to the box `[0, extent]`, so that `expected` need not take care of digits.
pub(crate) fn greatest_error(
    image: &Image,
    camera: &Camera,
    extent: DVec3,
    expected: impl Fn(&Ray) -> [f64; 3],
) -> f64 {
    let rays = camera.rays(image.width(), image.height());
    let mut greatest = 0.0;
    for row in 0..image.height() {
        for column in 0..image.width() {
            let Ray { origin, direction } = rays.pixel(column, row);
            let way = ((extent / 2.0 - origin).dot(direction) - 2.0 * extent.length()).max(0.0);
            let moved = |axis: usize| direction[axis].mul_add(way, origin[axis]);
            let ray = Ray { origin: DVec3::new(moved(0), moved(1), moved(2)), direction };
            let (found, expected) = (image.pixel(column, row), expected(&ray));
            for channel in 0..3 {
                let error = (found[channel] - expected[channel]).abs();
                assert!(!error.is_nan(), "pixel ({column}, {row}): {found:?}, expected {expected:?}");
                greatest = f64::max(greatest, error);
            }
        }
    }
    greatest
}

/// The field at a point of one cell; `None` if the cell is blank.
pub(crate) fn field_in_cell(grid: &VoxelGrid, cell: [usize; 3], point: DVec3) -> Option<f64> {
    let p = point / grid.spacing() - DVec3::from_array(cell.map(|c| c as f64));
    let mut sum = 0.0;
    for corner in 0..8usize {
        let bit = |axis: usize| corner >> axis & 1;
        let index = grid.index([0, 1, 2].map(|axis| cell[axis] + bit(axis)));
        let value = grid.samples().value(index, 0);
        if !value.is_finite() {
            return None;
        }
        let side = |axis: usize| if bit(axis) == 1 { p[axis] } else { 1.0 - p[axis] };
        sum += value * side(0) * side(1) * side(2);
    }
    Some(sum)
}

/// The cell of a point of the domain; a cell owns its lower faces, the last ones also their upper.
pub(crate) fn cell_of(grid: &VoxelGrid, point: DVec3) -> [usize; 3] {
    let p = point / grid.spacing();
    [0, 1, 2].map(|axis| (p[axis].max(0.0) as usize).min(grid.dims()[axis] - 2))
}

fn behind(front: Light, back: Light) -> Light {
    Light { color: front.over(back.color), transmittance: front.transmittance * back.transmittance }
}

/// Homogeneous matter of this value.
fn slice(transfer: &TransferFunction, value: f64, length: f64) -> Light {
    let (color, _) = transfer.classify(value);
    let depth = transfer.extinction(value) * length;
    let opacity = -(-depth).exp_m1();
    Light { color: color.map(|c| c * opacity), transmittance: (-depth).exp() }
}

/// The plain ray march: midpoints `step` apart (a little less, so that they fit), matter homogeneous around
/// each.
pub(crate) fn march(grid: &VoxelGrid, transfer: &TransferFunction, ray: &Ray, step: f64) -> Light {
    let Some([start, end]) = slab(ray, DVec3::ZERO, grid.extent()) else { return Light::CLEAR };
    let count = ((end - start) / step).ceil();
    let step = (end - start) / count;
    let mut light = Light::CLEAR;
    for i in 0..count as u64 {
        let point = ray.origin + ray.direction * (start + (i as f64 + 0.5) * step);
        if let Some(value) = field_in_cell(grid, cell_of(grid, point), point) {
            light = behind(light, slice(transfer, value, step));
        }
    }
    light
}

/// A march as good as it gets: split at every plane of samples, then halved until the midpoint rule and its
/// halves agree to `tolerance` and no control point lies between the values met, and extrapolated.
pub(crate) fn oracle(grid: &VoxelGrid, transfer: &TransferFunction, ray: &Ray, tolerance: f64) -> Light {
    let Some([start, end]) = slab(ray, DVec3::ZERO, grid.extent()) else { return Light::CLEAR };
    let mut planes = vec![start, end];
    for axis in 0..3 {
        let at = |i: usize| (i as f64 * grid.spacing()[axis] - ray.origin[axis]) / ray.direction[axis];
        planes.extend((0..grid.dims()[axis]).map(at).filter(|&t| t > start && t < end));
    }
    planes.sort_by(f64::total_cmp);
    let mut light = Light::CLEAR;
    for ends in planes.windows(2) {
        let at = |t: f64| ray.origin + ray.direction * t;
        let cell = cell_of(grid, at(middle(ends[0], ends[1])));
        let value = |t: f64| field_in_cell(grid, cell, at(t));
        if value(ends[0]).is_some() {
            let value = |t: f64| value(t).expect("the cell is not blank");
            Integrand { transfer, value, tolerance }.add_to(&mut light, [ends[0], ends[1]], 0);
        }
    }
    light
}

fn middle(a: f64, b: f64) -> f64 {
    a / 2.0 + b / 2.0
}

/// Matter along a ray, whose value at each distance is known.
pub(crate) struct Integrand<'a, V> {
    pub(crate) transfer: &'a TransferFunction,
    pub(crate) value: V,
    pub(crate) tolerance: f64,
}

impl<V: Fn(f64) -> f64> Integrand<'_, V> {
    /// The light of it between the first and the last of some ends, smooth between two of them.
    pub(crate) fn over(&self, ends: &[f64]) -> Light {
        let mut light = Light::CLEAR;
        for pair in ends.windows(2) {
            self.add_to(&mut light, [pair[0], pair[1]], 0);
        }
        light
    }

    fn slice(&self, a: f64, b: f64) -> Light {
        slice(self.transfer, (self.value)(middle(a, b)), b - a)
    }

    fn add_to(&self, light: &mut Light, [a, b]: [f64; 2], depth: u32) {
        if light.transmittance < 1e-15 {
            return;
        }
        let m = middle(a, b);
        let (whole, halves) = (self.slice(a, b), behind(self.slice(a, m), self.slice(m, b)));
        let band = |t: f64| self.transfer.points().partition_point(|point| point.value <= (self.value)(t));
        let smooth = band(a) == band(m) && band(m) == band(b);
        let agree = difference(&whole, &halves) < self.tolerance;
        if depth >= 7 && smooth && agree {
            let better = |whole: f64, halves: f64| halves + (halves - whole) / 3.0;
            let color = std::array::from_fn(|i| better(whole.color[i], halves.color[i]));
            let transmittance = better(whole.transmittance, halves.transmittance);
            *light = behind(*light, Light { color, transmittance });
        } else if depth == 30 {
            // Deeper, a midpoint might hit a pole of the extinction to the last bit.
            *light = behind(*light, halves);
        } else {
            self.add_to(light, [a, m], depth + 1);
            self.add_to(light, [m, b], depth + 1);
        }
    }
}

/// The greatest difference of a colour channel or the transmittance.
pub(crate) fn difference(a: &Light, b: &Light) -> f64 {
    (0..3).map(|i| (a.color[i] - b.color[i]).abs()).fold((a.transmittance - b.transmittance).abs(), f64::max)
}

/// Numbers in [0, 1), always the same.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(volery_data::hash(seed))
    }

    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(1);
        (volery_data::hash(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.unit() * end as f64) as usize
    }

    pub(crate) fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }
}

/// Prints and checks a measured error.
#[track_caller]
pub(crate) fn check(what: &str, error: f64, threshold: f64) {
    println!("{what}: {error:.2e}, threshold {threshold:.0e}");
    assert!(error <= threshold, "{what}: error {error:e}, expected at most {threshold:e}");
}
