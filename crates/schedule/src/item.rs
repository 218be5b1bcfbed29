//! What a caller says of a frame, and what it gets back: items with levels, parts to draw, a summary.
//!
//! Numbers of a caller are believed only as far as they make sense. Work, bytes and errors that are NaN or negative
//! count as 0, and no number is larger than 1e15; importance that is NaN or negative counts as 0, and where one is
//! infinite all finite ones count as 0. Seconds that are NaN or negative count as 0.

/// The largest work, number of bytes or error that counts as a number.
const MAX_AMOUNT: f64 = 1e15;
/// The longest time that counts as one, 30,000 years: sums of it stay finite.
const MAX_SECS: f64 = 1e12;

/// One level of detail of an item.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// Work to draw it, in any unit that cost follows: visits of cells, samples, fragments.
    pub work: f64,
    /// Bytes to upload first: 0 if it is resident.
    pub bytes: f64,
    /// Error of the picture where this level is shown, in any unit, the same for all items.
    pub error: f64,
}

/// One part of the picture: a subvolume or a tile of the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item<'a> {
    /// Names the item in all frames: what its parts cost is remembered under it.
    pub key: u64,
    /// Its share of time among the others, in any unit.
    pub importance: f64,
    /// From the finest, 0, to the coarsest. An item without levels is not drawn.
    pub levels: &'a [Level],
}

/// Something to draw now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Names this part when its cost is told; never used twice by one controller.
    pub id: u64,
    /// Index of the item in the frame.
    pub item: usize,
    /// Its level.
    pub level: usize,
    /// Whether the item was drawn in this frame before, more coarsely.
    pub is_refinement: bool,
    /// Samples per pixel and axis: 1, or less where a controller makes pixels larger.
    pub pixel_rate: f64,
    /// What the controller expects it to take, 0 where it does not predict.
    pub predicted_secs: f64,
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Draw this part.
    Draw(Part),
    /// Nothing may start before the outcome of a part in flight is known: tell it, and ask again. Asking again
    /// without telling ends the frame.
    Wait,
    /// The frame is done, but for what is in flight.
    Done,
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// What was asked for.
    pub budget_secs: f64,
    /// What it took, as the caller measured.
    pub actual_secs: f64,
    /// Sum of what was expected of each part when it was handed out, and of what is outside of parts.
    pub predicted_secs: f64,
    /// Parts handed out.
    pub num_parts: usize,
    /// Those among them that drew an item again.
    pub num_refinements: usize,
    /// Every item is shown at its coarsest level.
    pub is_at_floor: bool,
    /// Every item is shown at its finest level.
    pub is_at_ceiling: bool,
    /// Nothing moved, and levels were those that rest has settled on.
    pub is_settled: bool,
}

impl Summary {
    /// Relative to the budget, positive when late. 0 where there is no budget to compare with.
    pub fn signed_error(&self) -> f64 {
        if self.budget_secs > 0.0 && self.budget_secs < MAX_SECS {
            self.actual_secs / self.budget_secs - 1.0
        } else {
            0.0
        }
    }
}

/// Whatever decides how a frame is drawn: the scheduler, and what it is compared with.
///
/// A frame is `begin`, then `next` until it says [`Step::Done`], then `finish`. `observe` may come at any time, in any
/// order, in a later frame or never. Calls in another order do nothing.
pub trait Controller {
    /// Begins a frame. One that was not finished is forgotten.
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]);
    /// The next step, `elapsed_secs` after the frame began. Comes to [`Step::Done`] after finitely many calls.
    fn next(&mut self, elapsed_secs: f64) -> Step;
    /// Tells what a part took: the seconds that it added to its frame, upload included. Where parts truly run `w` at
    /// once, that is its own time divided by `w`.
    fn observe(&mut self, part_id: u64, secs: f64);
    /// Ends the frame, which took `actual_secs` with all that is outside of parts.
    fn finish(&mut self, actual_secs: f64) -> Summary;
}

/// An amount that can be added and multiplied.
pub(crate) fn amount(number: f64) -> f64 {
    if number > 0.0 { number.min(MAX_AMOUNT) } else { 0.0 }
}

/// A time that can be added and multiplied.
pub(crate) fn secs(number: f64) -> f64 {
    if number > 0.0 { number.min(MAX_SECS) } else { 0.0 }
}

/// Importance as weights from 0 to 1, of which one at least is 1 unless there is none.
pub(crate) fn weights(importance: impl Iterator<Item = f64> + Clone, weights: &mut Vec<f64>) {
    let finite = |number: f64| if number > 0.0 { number } else { 0.0 };
    let largest = importance.clone().map(finite).fold(0.0, f64::max);
    weights.clear();
    weights.extend(importance.map(finite).map(|number| {
        if largest == 0.0 {
            1.0
        } else if largest.is_infinite() {
            f64::from(u8::from(number.is_infinite()))
        } else {
            number / largest
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_make_sense_whatever_importance_is() {
        let of = |importance: &[f64]| {
            let mut found = Vec::new();
            weights(importance.iter().copied(), &mut found);
            found
        };
        assert_eq!(of(&[2.0, 1.0, 0.0]), [1.0, 0.5, 0.0]);
        assert_eq!(of(&[f64::NAN, -1.0, 4.0]), [0.0, 0.0, 1.0]);
        assert_eq!(of(&[f64::INFINITY, 1e300]), [1.0, 0.0]);
        assert_eq!(of(&[f64::MAX, f64::MAX]), [1.0, 1.0]);
        for equal in [0.0, f64::NAN, f64::INFINITY, -3.0, f64::NEG_INFINITY] {
            assert_eq!(of(&[equal; 3]), [1.0; 3], "{equal}");
        }
    }
}
