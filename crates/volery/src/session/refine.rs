//! Pictures of one view, coarse at once and finer while the view rests (Schussman and Max 2001, section 8).
//!
//! Each picture allows half of the error of the one before, until the view's own tolerance is reached, or less than
//! [`LEAST_TOLERANCE`]: then the view itself is drawn. A view with a budget of memory is drawn at once: its pictures on
//! the way could take more.

use volery_frame::Backend;

use super::{RenderError, Session};
use crate::data::VolumeData;
use crate::technique::planes::Step;
use crate::view::{Dial, View};

/// What the first picture may miss, as a fraction of the value range: the paper's coarsest.
const FIRST_TOLERANCE: f64 = 0.48;

/// Below this the next picture is the last: most nodes are there already.
const LEAST_TOLERANCE: f64 = 1.0 / 256.0;

/// The pictures of one view, an iterator; see [`Session::refinements`].
pub struct Refinements<'a> {
    session: &'a mut Session<VolumeData>,
    backend: &'a mut dyn Backend,
    view: View,
    /// Of the next picture; `None` after the last.
    tolerance: Option<f64>,
}

impl Session<VolumeData> {
    /// Draws a view of matter again and again with ever smaller tolerances; the last picture is that of
    /// [`Session::render`], bit for bit. Whoever moves on drops the rest.
    ///
    /// # Errors
    /// When the view is not meaningful.
    pub fn refinements<'a>(
        &'a mut self,
        view: &View,
        backend: &'a mut dyn Backend,
    ) -> Result<Refinements<'a>, RenderError> {
        self.check(view)?;
        let is_bounded = matches!(view.dial, Dial::Memory(_));
        let first = if is_bounded { 0.0 } else { FIRST_TOLERANCE.max(own_tolerance(view)) };
        Ok(Refinements { session: self, backend, view: view.clone(), tolerance: Some(first) })
    }
}

impl Refinements<'_> {
    fn picture(&mut self, tolerance: f64) -> Result<Step, RenderError> {
        let own = own_tolerance(&self.view);
        let is_last = tolerance <= own.max(LEAST_TOLERANCE);
        let dial = if is_last { self.view.dial } else { Dial::Tolerance(tolerance) };
        let picture = self.session.render(&View { dial, ..self.view.clone() }, self.backend)?;
        self.tolerance = (!is_last).then_some((tolerance / 2.0).max(own));
        Ok(Step { picture, is_last })
    }
}

/// What a view itself may miss.
fn own_tolerance(view: &View) -> f64 {
    if let Dial::Tolerance(tolerance) = view.dial { tolerance } else { 0.0 }
}

impl Iterator for Refinements<'_> {
    type Item = Result<Step, RenderError>;

    fn next(&mut self) -> Option<Self::Item> {
        let tolerance = self.tolerance.take()?;
        Some(self.picture(tolerance))
    }
}
