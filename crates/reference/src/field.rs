//! What a field along a ray has to offer to be integrated, and how it is cut into pieces.

use std::ops::ControlFlow;

use crate::transfer::{Bands, Place};

/// What the difference of two places where a field has given values may be off by, at most, unless the field is all but
/// flat at one of them: then it is no better known than it is.
const PLACE_ROUNDING: f64 = 1e-12;

/// A polynomial field of degree `N` on the unit interval, by how far it is above some base.
pub(crate) trait Field<const N: usize> {
    /// Its value.
    fn at(&self, t: f64) -> f64;

    /// Its derivative.
    fn slope_at(&self, t: f64) -> f64;

    /// A range that holds every value.
    fn range(&self) -> [f64; 2];

    /// The places in (0, 1) where the slope changes its sign, in order.
    fn turns(&self) -> impl Iterator<Item = f64>;

    /// By how much it rises from a place on.
    fn rise(&self, start: f64) -> Rise<N>;

    /// Calls `found` for its pieces between the places where it turns or crosses an edge of bands, in order, until
    /// told to stop.
    ///
    /// A place on the way is rounded, and far coarser than a thin band may be: so a piece that starts at an edge has
    /// the edge's own value there, and its width is solved for where both its ends have theirs.
    fn pieces<'a>(
        &self,
        bands: &'a Bands,
        base: f64,
        mut found: impl FnMut(Piece<'a, N>) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut start = 0.0;
        for end in self.turns().chain([1.0]) {
            let [mut from, to] = [start, end].map(|t| self.at(t));
            let edges = bands.edges_between(from.min(to), from.max(to), base);
            // What is met on the way, downwards too, and the bands before and behind it.
            let is_rising = from <= to;
            for met in 0..edges.len() {
                let (edge, band) = if is_rising {
                    (edges.start + met, edges.start + met)
                } else {
                    (edges.end - 1 - met, edges.end - met)
                };
                let value = bands.edge(edge, base);
                let stop = crossing(|t| self.at(t) - value, |t| self.slope_at(t), start, end);
                let rise = self.rise(start);
                let width = rise.width_of(value - from, stop - start);
                found(Piece { rise: rise.over(width), width, start: bands.in_band(band, from, base) })?;
                (start, from) = (stop, value);
            }
            let band = if is_rising { edges.end } else { edges.start };
            let (rise, width) = (self.rise(start), end - start);
            found(Piece { rise: rise.over(width), width, start: bands.in_band(band, from, base) })?;
            start = end;
        }
        ControlFlow::Continue(())
    }
}

/// Part of a field, in one band, as far as it is from its start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece<'a, const N: usize> {
    /// On the unit interval.
    pub(crate) rise: Rise<N>,
    /// Of the piece in the field's unit interval.
    pub(crate) width: f64,
    /// The value where it starts.
    pub(crate) start: Place<'a>,
}

/// A polynomial of degree `N` that is 0 at 0: by how much a field rises from some place on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rise<const N: usize> {
    /// Of the first power and those that follow.
    pub(crate) power: [f64; N],
}

impl<const N: usize> Rise<N> {
    #[inline]
    pub(crate) fn at(&self, t: f64) -> f64 {
        t * self.power.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
    }

    /// At least the steepest slope of the unit interval.
    pub(crate) fn max_slope(&self) -> f64 {
        self.power.iter().zip(1u32..).map(|(coefficient, k)| f64::from(k) * coefficient.abs()).sum()
    }

    /// The same with `width` as the unit interval.
    fn over(&self, width: f64) -> Self {
        let mut scale = 1.0;
        let power = self.power.map(|coefficient| {
            scale *= width;
            coefficient * scale
        });
        Self { power }
    }

    /// Where it has risen by `rise`, given the difference of two places on the unit interval that is right but for
    /// their rounding.
    fn width_of(&self, rise: f64, difference: f64) -> f64 {
        let mut width = difference;
        for _ in 0..2 {
            // The polynomial without its factor `width`, and the slope of that.
            let (value, slope) = self.power.iter().rev().fold((0.0, 0.0), |(value, slope), coefficient| {
                (value * width + coefficient, slope * width + value)
            });
            let step = (value * width - rise) / (value + slope * width);
            // More is not the rounding of places.
            if step.abs() <= PLACE_ROUNDING && width - step > 0.0 {
                width -= step;
            }
        }
        width
    }
}

/// Where a function, monotone from `from` to `to` and of unlike signs there, is zero: Newton's method kept inside a
/// shrinking bracket, to the last bits of `t`.
pub(crate) fn crossing(at: impl Fn(f64) -> f64, slope_at: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let (mut below, mut above) = if at(from) < 0.0 { (from, to) } else { (to, from) };
    let mut t = (from + to) / 2.0;
    // A bisection ends within 60 steps; Newton's steps, where taken, at least do not widen the bracket.
    for _ in 0..120 {
        let residual = at(t);
        if residual == 0.0 {
            break;
        }
        if residual < 0.0 {
            below = t;
        } else {
            above = t;
        }
        let (low, high) = (below.min(above), below.max(above));
        let newton = t - residual / slope_at(t);
        let next = if newton > low && newton < high { newton } else { low + (high - low) / 2.0 };
        if (next - t).abs() <= f64::EPSILON * next.abs() {
            break;
        }
        t = next;
    }
    t
}
