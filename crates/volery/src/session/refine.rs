//! A view coarse at once, and finer while it rests.
//!
//! Where all data are at hand, what takes time is drawing. So the first picture allows half of the value range, each
//! further one half of what the one before did, and the last is the view's own (Schussman and Max 2001, section 8,
//! navigate so). Stop taking pictures when the view changes.

use super::{RenderError, Session, Step, View};

/// The tolerance of the first picture.
const FIRST_TOLERANCE: f64 = 0.5;
/// The least tolerance but that of the last picture.
const LEAST_TOLERANCE: f64 = 1.0 / 128.0;

/// The pictures of one view from coarse to its own, an iterator; see [`Session::refinements`].
pub struct Refinements<'a> {
    session: &'a mut Session,
    view: View,
    tolerance: f64,
    is_done: bool,
}

impl Session {
    /// Draws a view with smaller and smaller tolerances, its own last: that picture is the one of
    /// [`Session::render`], bit for bit.
    ///
    /// # Errors
    /// When the view is not meaningful.
    pub fn refinements(&mut self, view: &View) -> Result<Refinements<'_>, RenderError> {
        self.check(view)?;
        Ok(Refinements { session: self, view: view.clone(), tolerance: FIRST_TOLERANCE, is_done: false })
    }
}

impl Iterator for Refinements<'_> {
    type Item = Result<Step, RenderError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let last = self.view.tolerance.unwrap_or(0.0);
        let is_last = self.tolerance <= last.max(LEAST_TOLERANCE / 2.0);
        let tolerance = if is_last { self.view.tolerance } else { Some(self.tolerance) };
        self.tolerance /= 2.0;
        let picture = self.session.render(&View { tolerance, ..self.view.clone() });
        self.is_done = is_last || picture.is_err();
        Some(picture.map(|picture| Step { picture, is_last }))
    }
}
