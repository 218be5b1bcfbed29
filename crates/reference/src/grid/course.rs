//! The field along a stretch of a ray inside one cell, as polynomials.

use glam::DVec3;
use volery_scene::CellType;

use super::fit::Septic;
use super::shape::Shape;
use super::surface::{Passage, SeenCell, Stretch};
use crate::cubic::Cubic;

/// How often a stretch is halved for the sake of a fit.
const MAX_HALVINGS: u32 = 12;

/// The field over a stretch, by how far it is above `base`.
pub(super) struct Course<'a> {
    shape: Option<Shape>,
    stretch: &'a Stretch,
    /// Of the cell's nodes.
    values: [f64; 8],
}

impl<'a> Course<'a> {
    pub(super) fn new(cell: &SeenCell, stretch: &'a Stretch, base: f64) -> Self {
        let is_linear = cell.cell_type == CellType::Tetrahedron;
        // Seen from where the ray enters, so that a small cell far away keeps its digits.
        let places = || cell.places.map(|place| place.with_z(place.z - stretch.enter.t));
        let values = cell.values.map(|value| value - base);
        Self { shape: (!is_linear).then(|| Shape::new(cell.cell_type, &places(), &values)), stretch, values }
    }

    /// How far along the stretch.
    fn share(&self, t: f64) -> f64 {
        let (enter, leave) = (self.stretch.enter.t, self.stretch.leave.t);
        ((t - enter) / (leave - enter)).clamp(0.0, 1.0)
    }

    fn value(&self, shape: &Shape, t: f64) -> Option<f64> {
        let guess = self.stretch.enter.local.lerp(self.stretch.leave.local, self.share(t));
        shape.value_at(DVec3::new(0.0, 0.0, t - self.stretch.enter.t), guess)
    }

    /// The part of the stretch between two ends as polynomials in order, each with its ends, that are within
    /// `tolerance` of the field; false where the field is not to be had.
    pub(super) fn fit(&self, ends: [f64; 2], tolerance: f64, fits: &mut Vec<(Septic, [f64; 2])>) -> bool {
        fits.clear();
        self.shape.as_ref().is_some_and(|shape| self.fit_part(shape, ends, tolerance, MAX_HALVINGS, fits))
    }

    fn fit_part(
        &self,
        shape: &Shape,
        [a, b]: [f64; 2],
        tolerance: f64,
        halvings_left: u32,
        fits: &mut Vec<(Septic, [f64; 2])>,
    ) -> bool {
        let Some((fit, error)) = Septic::of(|w| self.value(shape, a + (b - a) * w)) else { return false };
        if error <= tolerance || halvings_left == 0 {
            fits.push((fit, [a, b]));
            return true;
        }
        let middle = a + (b - a) / 2.0;
        self.fit_part(shape, [a, middle], tolerance, halvings_left - 1, fits)
            && self.fit_part(shape, [middle, b], tolerance, halvings_left - 1, fits)
    }

    /// The part between two ends of the line between the values where the stretch enters and leaves.
    pub(super) fn line(&self, ends: [f64; 2]) -> Cubic {
        let value = |passage: &Passage| passage.mix(|corner| self.values[corner]);
        let (from, to) = (value(&self.stretch.enter), value(&self.stretch.leave));
        let mix = |w: f64| from * (1.0 - w) + to * w;
        let [a, d] = ends.map(|t| mix(self.share(t)));
        Cubic::new([a, a * (2.0 / 3.0) + d / 3.0, a / 3.0 + d * (2.0 / 3.0), d])
    }
}
