//! Opaque surfaces: triangles of one colour, to see data beside what it belongs to.

use glam::DVec3;

use crate::Revision;

/// Triangles of one colour. Either side is seen.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    revision: Revision,
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    color: [f64; 3],
}

/// Whether the contents are the same.
impl PartialEq for TriangleMesh {
    fn eq(&self, other: &Self) -> bool {
        let Self { revision: _, points, triangles, color } = self;
        *points == other.points && *triangles == other.triangles && *color == other.color
    }
}

/// Why a mesh could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A triangle names a point that does not exist.
    #[error("mesh: triangle {triangle} has point {point}, expected below {num_points}")]
    PointOutOfRange {
        /// Number of the triangle.
        triangle: usize,
        /// The point it names.
        point: u32,
        /// Number of points.
        num_points: usize,
    },
    /// A point that is nowhere.
    #[error("mesh: point {index} is {found}, expected finite coordinates")]
    Point {
        /// Number of the point.
        index: usize,
        /// Its place.
        found: DVec3,
    },
    /// A colour that is none.
    #[error("mesh: colour {found:?}, expected three numbers in [0, 1]")]
    Color {
        /// As given.
        found: [f64; 3],
    },
}

impl TriangleMesh {
    /// Triangles over world positions, in one linear RGB colour.
    ///
    /// # Errors
    /// When a triangle names a point that does not exist, a point is not finite or the colour is none.
    pub fn new(points: Vec<DVec3>, triangles: Vec<[u32; 3]>, color: [f64; 3]) -> Result<Self, Error> {
        let num_points = points.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|&&point| point as usize >= num_points) {
                return Err(Error::PointOutOfRange { triangle, point, num_points });
            }
        }
        if let Some(index) = points.iter().position(|point| !point.is_finite()) {
            return Err(Error::Point { index, found: points[index] });
        }
        if !color.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(Error::Color { found: color });
        }
        Ok(Self { revision: Revision::new(), points, triangles, color })
    }

    /// The same triangles with their points elsewhere: other contents.
    pub(crate) fn moved(&self, to: impl Fn(DVec3) -> DVec3) -> Self {
        let Self { revision: _, points, triangles, color } = self;
        let points = points.iter().map(|&point| to(point)).collect();
        Self { revision: Revision::new(), points, triangles: triangles.clone(), color: *color }
    }

    /// Names the contents, which never change; those of clones are the same.
    pub fn revision(&self) -> Revision {
        self.revision
    }

    /// World positions.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Numbers of points.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Straight linear RGB.
    pub fn color(&self) -> [f64; 3] {
        self.color
    }
}

/// The least share of its colour that a surface shows, and lit matter.
pub const AMBIENT: f64 = 0.25;

/// How much of its colour an opaque surface shows where the cosine of the angle between its normal and the ray is
/// `cosine`: as a lamp at the eye lights it, never black.
pub fn shade(cosine: f64) -> f64 {
    AMBIENT + (1.0 - AMBIENT) * cosine.abs().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_mesh_is_an_error() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(TriangleMesh::new(points.clone(), vec![[0, 1, 2]], [1.0; 3]).is_ok());
        let error = TriangleMesh::new(points.clone(), vec![[0, 1, 2], [0, 1, 3]], [1.0; 3]).unwrap_err();
        assert_eq!(error, Error::PointOutOfRange { triangle: 1, point: 3, num_points: 3 });
        let error = TriangleMesh::new(points.clone(), vec![], [0.0, 2.0, 0.0]).unwrap_err();
        assert_eq!(error, Error::Color { found: [0.0, 2.0, 0.0] });
        let error = TriangleMesh::new(vec![DVec3::NAN], vec![], [0.0; 3]).unwrap_err();
        assert!(matches!(error, Error::Point { index: 0, .. }));
    }
}
