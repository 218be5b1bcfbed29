//! How far a picture of matter can be from the exact one, because its field is drawn coarsely: a bound for each pixel.
//!
//! # Method
//! Let `f` be the exact field along a ray, `f~` the one that is drawn, `|f - f~| <= e`; `s` extinction, `q = s c`
//! emission, `T` the exact transmittance from the eye to `t`, `B~(t)` the colour that the drawn picture has behind `t`.
//! From `dB/dt = s B - q`, for the difference of both pictures,
//!
//! ```text
//! I - I~ = ∫ T(t) [ (q(f) - q(f~)) - (s(f) - s(f~)) B~(t) ] dt
//! ```
//!
//! (Novins, Arvo and Salesin 1992 bracketed the integral itself; as a difference against what lies behind, matter of the
//! colour of its background costs nothing.) With `h_B(v) = s(v) (c(v) - B)` the bracket is `h_B(f) - h_B(f~)`, `B = B~(t)`.
//! A ray goes from cell to cell of the cut, as the executors draw it, seams included. In a piece of a cell
//!
//! - `f~` is a cubic; its Bernstein coefficients bound it,
//! - `B~` is between the colours at both ends of the piece, intervals that a walk from back to front finds,
//! - `|h_B(f) - h_B(f~)|` is at most the range of `h_B` over all values within `e` of the piece's, and at most `e` times
//!   its steepest slope there. Both are convex in `B`: between the entries of a table, interpolated, they are bounds too,
//! - `T` is at most what the least extinction within `e` leaves.
//!
//! What lies behind a place can change a pixel by no more than what `T` leaves of the largest difference of two
//! colours: the bound is the least, over all places, of what was gathered up to there and that. So extinction may be
//! infinite.
//!
//! # What it is against
//! The exact picture of the drawn field against that of all texels. How far executors are from the exact picture of what
//! they are given, and what rounding to texels does, is the error budget of rays ([`crate::report`]), on top.
//!
//! # Limits
//! Arithmetic is f64, not directed: sums are widened by a billionth. With meshes the colour behind is any. Full of
//! matter, one ray costs as many pieces as it meets cells: some thirty times what drawing takes. Before opaque matter
//! (opacity 1 in a control point) that is coarse a pixel may be anything that light left there can make of it.

mod colors;
mod field;
mod ray;
#[cfg(test)]
mod tests;

use rayon::prelude::*;
use volery_frame::JoinedBrick;
use volery_pyramid::{Node, NodeSource, ReadError};
use volery_scene::TransferFunction;

use crate::residency::Store;
use crate::view::View;
use colors::Colors;
use field::{Field, Known};
use ray::Walker;

/// Of each pixel, how far red, green and blue can be from the exact picture.
#[derive(Clone, Debug, PartialEq)]
pub struct MatterBound {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Rows from the top, pixels from the left.
    pub pixels: Vec<[f32; 3]>,
}

impl MatterBound {
    /// The largest of any channel of any pixel.
    pub fn max(&self) -> f64 {
        self.pixels.iter().flatten().fold(0.0, |max, &bound| max.max(f64::from(bound)))
    }

    /// The root of the mean square over all channels of all pixels: no rmse is above it.
    pub fn rms(&self) -> f64 {
        let squares: f64 = self.pixels.iter().flatten().map(|&bound| f64::from(bound).powi(2)).sum();
        (squares / (3 * self.pixels.len()).max(1) as f64).sqrt()
    }
}

/// Bounds of one view with one cut or several.
pub(crate) struct Search<'a> {
    view: &'a View,
    transfer: &'a TransferFunction,
    source: &'a dyn NodeSource,
    store: &'a Store,
    colors: Colors,
    known: Known,
}

/// The largest bound so far, and pixels that may be near it: their bounds, and what nodes may change in them.
#[derive(Default)]
struct Worst {
    most: f64,
    pixels: Vec<(f64, Vec<(u32, f64)>)>,
}

impl Worst {
    /// Keeps what is above a share of the largest.
    fn keep(&mut self, share: f64) {
        self.pixels.retain(|(bound, _)| *bound > share * self.most);
    }
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        (view, transfer): (&'a View, &'a TransferFunction),
        (source, store): (&'a dyn NodeSource, &'a Store),
    ) -> Self {
        let colors = Colors::new(transfer, store.layout.value_offset);
        Self { view, transfer, source, store, colors, known: Known::new() }
    }

    fn field(&mut self, nodes: &[Node], bricks: &[JoinedBrick]) -> Result<Field, ReadError> {
        Field::new((self.source, self.store), (nodes, bricks), self.transfer, &mut self.known)
    }

    /// The bound of a picture of these nodes, whose bricks are drawn so.
    pub(crate) fn bound(&mut self, nodes: &[Node], bricks: &[JoinedBrick]) -> Result<MatterBound, ReadError> {
        let field = self.field(nodes, bricks)?;
        let (view, colors) = (self.view, &self.colors);
        let View { width, height, .. } = *view;
        let grid = view.camera.rays(width, height);
        let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
        pixels.par_chunks_mut(width as usize).zip(0..height).for_each_init(
            || Walker::new(&field, colors, view),
            |walker, (row, y)| {
                for (pixel, x) in row.iter_mut().zip(0..width) {
                    *pixel = walker.bound(&grid.pixel(x, y));
                }
            },
        );
        Ok(MatterBound { width, height, pixels })
    }

    /// Which nodes are too coarse for some pixels, one of so many along both axes, to differ by less than `share` of what
    /// they may differ by at most; and that.
    pub(crate) fn too_coarse(
        &mut self,
        (nodes, bricks): (&[Node], &[JoinedBrick]),
        (step, share): (u32, f64),
    ) -> Result<(Vec<bool>, f64), ReadError> {
        let field = self.field(nodes, bricks)?;
        let (view, colors) = (self.view, &self.colors);
        let grid = view.camera.rays(view.width, view.height);
        let rows: Vec<u32> = (step / 2..view.height).step_by(step as usize).collect();
        let columns: Vec<u32> = (step / 2..view.width).step_by(step as usize).collect();
        let row = |walker: &mut Walker<'_>, y: u32| {
            let mut worst = Worst::default();
            for &x in &columns {
                let (bound, causes) = walker.causes(&grid.pixel(x, y));
                worst.most = worst.most.max(bound);
                if bound > share * worst.most {
                    worst.pixels.push((bound, causes));
                }
            }
            worst.keep(share);
            worst
        };
        let Worst { most, pixels } = rows
            .into_par_iter()
            .map_init(|| Walker::new(&field, colors, view), |walker, y| row(walker, y))
            .reduce(Worst::default, |mut a, b| {
                a.most = a.most.max(b.most);
                a.pixels.extend(b.pixels);
                a.keep(share);
                a
            });
        let mut too_coarse = vec![false; nodes.len()];
        for (_, mut causes) in pixels {
            causes.sort_by(|(a, x), (b, y)| y.total_cmp(x).then(a.cmp(b)));
            let mut left: f64 = causes.iter().map(|(_, change)| change).sum();
            for (place, change) in causes {
                if left <= share * most {
                    break;
                }
                left -= change;
                field.each_cause(place as usize, |cause| too_coarse[cause] = true);
            }
        }
        Ok((too_coarse, most))
    }
}
