//! Vertices in 12 bytes: places and values of 16 bits, gradients of 8.
//!
//! # Method
//! As Benölken and Graf (2005, section 4.2) have it: numbers are taken from the least to the greatest of the mesh in
//! even steps, 65,535 of each coordinate and of the value (the paper has 255 of the value), 255 of the magnitude of
//! gradients from 0 on, and 127 of each part of a direction either way. So a device decodes by one multiplication and
//! one addition. Without gradients a vertex has 8 bytes.
//!
//! # Guarantees
//! A coordinate, value or magnitude is off by at most half a step, and what rounding to `f32` adds; a part of a
//! direction by 1/254. Vertices keep their numbers, so what was watertight is.
//!
//! # Limits
//! A value that is not a number counts as the least there is, an infinite one as the end it lies beyond.

use glam::DVec3;
use rayon::prelude::*;
pub use volery_scene::Quantization;

use crate::mesh::{MeshSheet, RUN, SliceMesh};

/// Steps of a coordinate and of the value.
pub(crate) const STEPS: f64 = 65535.0;

/// A [`SliceMesh`] in few bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuantizedMesh {
    /// The unit normal of all planes.
    pub normal: DVec3,
    /// World position that points are relative to.
    pub origin: DVec3,
    /// What the numbers of vertices mean.
    pub quantization: Quantization,
    /// `[x, y, z, value]` per vertex.
    pub points: Vec<[u16; 4]>,
    /// Direction: `max(i / 127, -1)`; magnitude in the bits of the last as an unsigned byte. One per vertex, or none
    /// at all.
    pub gradients: Vec<[i8; 4]>,
    /// Vertex numbers.
    pub triangles: Vec<[u32; 3]>,
    /// As those of a [`SliceMesh`].
    pub sheets: Vec<MeshSheet>,
}

/// Numbers that cannot be quantised.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// Places that have no bounds, or bounds beyond what `f32` holds.
    #[error("quantised mesh: places from {low} to {high}, expected finite bounds of 32-bit numbers")]
    Bounds {
        /// Least coordinates, relative to the origin.
        low: DVec3,
        /// Greatest coordinates.
        high: DVec3,
    },
    /// Values that have a range beyond what `f32` holds.
    #[error("quantised mesh: values from {low} to {high}, expected a range of 32-bit numbers")]
    Values {
        /// The least.
        low: f64,
        /// The greatest.
        high: f64,
    },
}

/// For places relative to the origin, finite values among `values`, and magnitudes of gradients.
pub(crate) fn quantization_over(
    places: impl IntoIterator<Item = DVec3>,
    values: impl IntoIterator<Item = f64>,
    magnitudes: impl IntoIterator<Item = f64>,
) -> Result<Quantization, Error> {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let join = |[low, high]: [f64; 2], x: f64| [low.min(x), high.max(x)];
    let mut ranges = [none; 4];
    for place in places {
        for (range, x) in ranges.iter_mut().zip(place.to_array()) {
            // A range that knows a place that is nowhere is not finite.
            *range = join(*range, if x.is_nan() { f64::INFINITY } else { x });
        }
    }
    ranges[3] = values.into_iter().filter(|value| value.is_finite()).fold(none, join);
    let mut found = Quantization::default();
    for (part, [low, high]) in ranges.into_iter().enumerate() {
        if low > high && high == f64::NEG_INFINITY {
            continue;
        }
        let scale = ((high - low) / STEPS) as f32;
        if !(low as f32).is_finite() || !(high as f32).is_finite() || !scale.is_finite() {
            let bounds = |end: usize| DVec3::from_array([0, 1, 2].map(|part: usize| ranges[part][end]));
            return Err(match part {
                3 => Error::Values { low, high },
                _ => Error::Bounds { low: bounds(0), high: bounds(1) },
            });
        }
        (found.low[part], found.scale[part]) = (low as f32, scale);
    }
    let finite = magnitudes.into_iter().filter(|magnitude| magnitude.is_finite());
    found.magnitude_scale = ((finite.fold(0.0, f64::max) / 255.0) as f32).min(f32::MAX);
    Ok(found)
}

impl QuantizedMesh {
    /// The vertices of a mesh in 12 bytes, or in 8 where it has no gradients.
    ///
    /// # Errors
    /// When a place is not finite, or the values have no range that `f32` holds.
    pub fn new(mesh: &SliceMesh) -> Result<Self, Error> {
        let split =
            |&[x, y, z, value]: &[f32; 4]| (DVec3::new(x.into(), y.into(), z.into()), f64::from(value));
        let quantization = quantization_over(
            mesh.points.iter().map(|point| split(point).0),
            mesh.points.iter().map(|point| split(point).1),
            mesh.gradients.iter().map(|gradient| f64::from(gradient[3])),
        )?;
        let point = |point: &[f32; 4]| {
            let (place, value) = split(point);
            quantization.point(place, value)
        };
        let gradient = |gradient: &[f32; 4]| {
            let (direction, magnitude) = split(gradient);
            quantization.gradient(direction, magnitude)
        };
        Ok(Self {
            normal: mesh.normal,
            origin: mesh.origin,
            quantization,
            points: mesh.points.par_iter().with_min_len(RUN).map(point).collect(),
            gradients: mesh.gradients.par_iter().with_min_len(RUN).map(gradient).collect(),
            triangles: mesh.triangles.clone(),
            sheets: mesh.sheets.clone(),
        })
    }

    /// The numbers that a device would see: a mesh without edges and weights.
    pub fn to_mesh(&self) -> SliceMesh {
        let Self { normal, origin, quantization, points, gradients, triangles, sheets } = self;
        let point = |&point: &[u16; 4]| {
            let [x, y, z] = quantization.place(point).to_array();
            [x, y, z, quantization.value(point)].map(|part| part as f32)
        };
        let gradient = |&[x, y, z, magnitude]: &[i8; 4]| {
            let [x, y, z] = [x, y, z].map(|part| (f32::from(part) / 127.0).max(-1.0));
            [x, y, z, quantization.magnitude_scale * f32::from(magnitude.cast_unsigned())]
        };
        SliceMesh {
            normal: *normal,
            origin: *origin,
            points: points.par_iter().with_min_len(RUN).map(point).collect(),
            gradients: gradients.par_iter().with_min_len(RUN).map(gradient).collect(),
            edges: Vec::new(),
            weights: Vec::new(),
            planes: Vec::new(),
            num_polygons: None,
            triangles: triangles.clone(),
            sheets: sheets.clone(),
        }
    }

    /// Bytes of vertices and triangles.
    pub fn num_bytes(&self) -> usize {
        size_of_val(self.points.as_slice())
            + size_of_val(self.gradients.as_slice())
            + size_of_val(self.triangles.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(points: Vec<[f32; 4]>, gradients: Vec<[f32; 4]>) -> SliceMesh {
        let triangles = (2..points.len() as u32).map(|vertex| [0, vertex - 1, vertex]).collect();
        SliceMesh { normal: DVec3::Z, points, gradients, triangles, ..SliceMesh::default() }
    }

    #[test]
    fn numbers_are_off_by_half_a_step_at_most() {
        // Far apart in size, not centred, one axis flat.
        let number = |at: u32| (f64::from(at) * 0.618_033_988_75).fract() as f32;
        let points: Vec<[f32; 4]> = (0..5000)
            .map(|at| [1e-3 * number(at), 7.0, 1e5 + 3e4 * number(7 * at), -2e9 * number(3 * at)])
            .collect();
        let gradients: Vec<[f32; 4]> = (0..5000u32)
            .map(|at| {
                let direction = DVec3::new(number(at).into(), -0.3, number(5 * at).into()).normalize();
                let [x, y, z] = direction.to_array().map(|part| part as f32);
                [x, y, z, 40.0 * number(9 * at)]
            })
            .collect();
        let mesh = mesh(points, gradients);
        let quantized = QuantizedMesh::new(&mesh).unwrap();
        let decoded = quantized.to_mesh();
        let Quantization { scale, magnitude_scale, .. } = quantized.quantization;
        for part in 0..4 {
            // Two roundings to f32 beside half a step.
            let largest = mesh.points.iter().map(|point| point[part].abs()).fold(0.0, f32::max);
            let allowed = 0.5 * f64::from(scale[part]) * 1.001 + f64::from(largest) * f64::from(f32::EPSILON);
            let pairs = mesh.points.iter().zip(&decoded.points);
            let found =
                pairs.map(|(a, b)| (f64::from(a[part]) - f64::from(b[part])).abs()).fold(0.0, f64::max);
            println!("part {part}: off by {found:e}, at most {allowed:e}");
            assert!(found <= allowed);
        }
        for (a, b) in mesh.gradients.iter().zip(&decoded.gradients) {
            assert!((0..3).all(|part| (a[part] - b[part]).abs() <= 1.001 / 254.0), "{a:?} {b:?}");
            assert!((a[3] - b[3]).abs() <= 0.501 * magnitude_scale, "{a:?} {b:?}");
        }
        // Once quantised, nothing changes any more.
        assert_eq!(QuantizedMesh::new(&decoded).unwrap().points, quantized.points);
    }

    #[test]
    fn what_is_no_number_counts_as_said() {
        let values = [f32::NAN, f32::NEG_INFINITY, -1.0, 3.0, f32::INFINITY];
        let points = values.iter().map(|&value| [0.0, 0.0, 0.0, value]).collect();
        let found = QuantizedMesh::new(&mesh(points, vec![])).unwrap().points;
        assert_eq!(found.iter().map(|point| point[3]).collect::<Vec<_>>(), [0, 0, 0, 65535, 65535]);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let error = QuantizedMesh::new(&mesh(vec![[0.0; 4], [0.0, bad, 0.0, 0.0]], vec![])).unwrap_err();
            assert!(matches!(error, Error::Bounds { .. }), "{error}");
        }
        assert_eq!(QuantizedMesh::new(&SliceMesh::default()).unwrap(), QuantizedMesh::default());
    }
}
