//! Cutting planes.

use glam::DVec3;

/// The points `x` with `normal · x = distance`, in world space.
///
/// The normal may have any length but zero, so that `distance` is the distance from the origin only for a normal
/// of unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Perpendicular to the plane.
    pub normal: DVec3,
    /// Of every point along the normal, times the normal's length.
    pub distance: f64,
}

/// What is wrong with a plane.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A normal that has no direction.
    #[error("normal {found} of length {}, expected one from 1e-150 to 1e150", .found.length())]
    Normal {
        /// As given.
        found: DVec3,
    },
    /// A distance that is not finite.
    #[error("distance {found}, expected a finite number")]
    Distance {
        /// As given.
        found: f64,
    },
}

impl Plane {
    /// The plane through a point.
    pub fn through(point: DVec3, normal: DVec3) -> Self {
        Self { normal, distance: normal.dot(point) }
    }

    /// The same plane with a normal of unit length.
    #[must_use]
    pub fn normalized(self) -> Self {
        let length = self.normal.length();
        Self { normal: self.normal / length, distance: self.distance / length }
    }

    /// How far a point lies from the plane, positive on the side that the normal points to, times the normal's
    /// length.
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.distance
    }

    /// What is wrong; nothing for a plane that can be drawn.
    pub fn defects(&self) -> Vec<Defect> {
        let mut defects = Vec::new();
        let length = self.normal.length();
        if !(length > 1e-150 && length < 1e150) {
            defects.push(Defect::Normal { found: self.normal });
        }
        if !self.distance.is_finite() {
            defects.push(Defect::Distance { found: self.distance });
        }
        defects
    }
}
