//! Along x: coarse rows interpolated at columns, finest samples summed in pairs.

use std::ops::Range;

use fearless_simd::{Level, dispatch};

use super::lane::{COLUMNS, Lane, Voxel, Widen};
use super::taps::{Axis, Tap};
use crate::layout::Kind;

/// Where the columns of a group lie along x in a coarser level.
pub(crate) enum Reach<L> {
    /// The finest samples from `first`, a multiple of [`COLUMNS`], of which coarse cells of `2^level`
    /// samples are a part each.
    Cells { first: usize, level: u32, kind: Kind },
    /// At the coarse samples from `first`.
    Samples { first: usize },
    /// Anywhere: per column, its cell, and how far on the way to the next.
    Anywhere(Box<[(usize, L); COLUMNS]>),
}

/// Room for the coarse samples that neighbouring columns span, at most one cell per column and both ends,
/// and for twice as many values.
const WINDOW: usize = 2 * COLUMNS;

impl<L: Lane> Reach<L> {
    /// The reach of the finest samples from `first`, at `taps`; as if there were [`COLUMNS`] of them.
    pub(crate) fn of_samples(first: usize, taps: &[Tap], axis: &Axis, log_steps: u32) -> Self {
        if 1 << axis.level <= COLUMNS {
            return Self::Cells { first, level: axis.level, kind: axis.kind };
        }
        Self::of_taps(taps, log_steps)
    }

    /// The reach of columns at `taps`, at most [`COLUMNS`]; missing ones repeat the last.
    pub(crate) fn of_taps(taps: &[Tap], log_steps: u32) -> Self {
        let tap = |column: usize| taps[column.min(taps.len() - 1)];
        let reach = |column: usize| (tap(column).cell, L::weight(tap(column).steps, log_steps));
        Self::Anywhere(Box::new(std::array::from_fn(reach)))
    }

    /// A coarse row interpolated at the columns.
    #[inline(always)]
    fn expand<T: Voxel>(&self, row: &[T], channel: usize, log_steps: u32) -> [L; COLUMNS]
    where
        T::Component: Widen<L>,
    {
        match self {
            // A level that is known when compiling makes for loops without counters.
            &Self::Cells { first, level: 1, kind } => cells::<T, L, 1>(row, channel, first, kind),
            &Self::Cells { first, level: 2, kind } => cells::<T, L, 2>(row, channel, first, kind),
            &Self::Cells { first, level: 3, kind } => cells::<T, L, 3>(row, channel, first, kind),
            &Self::Cells { first, level: 4, kind } => cells::<T, L, 4>(row, channel, first, kind),
            &Self::Cells { first, level: _, kind } => cells::<T, L, 5>(row, channel, first, kind),
            &Self::Samples { first } => {
                let values: [L; WINDOW] = read_window(row, channel, first, 0, COLUMNS);
                let mut out = [L::default(); COLUMNS];
                for c in 0..COLUMNS {
                    out[c] = values[c].whole(log_steps);
                }
                out
            }
            Self::Anywhere(reach) => {
                let mut out = [L::default(); COLUMNS];
                for (out, &(cell, weight)) in out.iter_mut().zip(&**reach) {
                    let low = row[cell].component(channel).widen();
                    let high = row[(cell + 1).min(row.len() - 1)].component(channel).widen();
                    *out = low.whole(log_steps).along(high.minus(low), weight);
                }
                out
            }
        }
    }
}

/// The finest samples from `first`, interpolated between the samples of `row` by halving `LEVEL` times (and
/// once more for the averaged kind).
#[inline(always)]
fn cells<T: Voxel, L: Lane, const LEVEL: u32>(
    row: &[T],
    channel: usize,
    first: usize,
    kind: Kind,
) -> [L; COLUMNS]
where
    T::Component: Widen<L>,
{
    let cells = COLUMNS >> LEVEL;
    match kind {
        Kind::Decimated => {
            let mut values = read_window(row, channel, first >> LEVEL, 0, cells + 1);
            for step in 0..LEVEL {
                values = double(&values, cells << step);
            }
            *values.first_chunk().expect("a window is wider than the columns")
        }
        Kind::Averaged => {
            // The first column lies half a sample after the middle of a coarse cell.
            let doubled = double(&read_window(row, channel, first >> LEVEL, 1, cells + 2), cells + 1);
            let mut values = [L::default(); WINDOW];
            values[..WINDOW - 1].copy_from_slice(&doubled[1..]);
            for step in 1..LEVEL {
                values = double(&values, cells << step);
            }
            let mut middles = [L::default(); COLUMNS];
            for c in 0..COLUMNS {
                middles[c] = values[c].middle(values[c + 1]);
            }
            middles
        }
    }
}

/// `count` samples of a row from `start - before`; those beyond its ends repeat them.
#[inline(always)]
fn read_window<T: Voxel, L: Lane>(
    row: &[T],
    channel: usize,
    start: usize,
    before: usize,
    count: usize,
) -> [L; WINDOW]
where
    T::Component: Widen<L>,
{
    let mut window = [L::default(); WINDOW];
    let window_part = &mut window[..count];
    if start >= before && start - before + count <= row.len() {
        for (value, sample) in window_part.iter_mut().zip(&row[start - before..]) {
            *value = sample.component(channel).widen();
        }
    } else {
        for (i, value) in window_part.iter_mut().enumerate() {
            let at = (start + i).saturating_sub(before).min(row.len() - 1);
            *value = row[at].component(channel).widen();
        }
    }
    window
}

/// Twice as many values over `cells` cells, those between in the middle.
#[inline(always)]
fn double<L: Lane>(values: &[L; WINDOW], cells: usize) -> [L; WINDOW] {
    let mut out = [L::default(); WINDOW];
    let (pairs, _) = out.as_chunks_mut::<2>();
    for ((pair, &low), &high) in pairs[..cells].iter_mut().zip(&values[..cells]).zip(&values[1..=cells]) {
        *pair = [low.whole(1), low.middle(high)];
    }
    if cells < pairs.len() {
        pairs[cells][0] = values[cells].whole(1);
    }
    out
}

/// The coarse rows that a block reads at one level.
pub(crate) struct CoarseRows<'a, T> {
    pub samples: &'a [T],
    pub dims: [usize; 3],
    pub channel: usize,
    /// Rows along y and z, those beyond the level repeating its last.
    pub rows: [Range<usize>; 2],
}

impl<T: Voxel> CoarseRows<'_, T> {
    /// Interpolates each row at the columns of a group.
    pub(crate) fn expand<L: Lane>(
        &self,
        simd: Level,
        reach: &Reach<L>,
        log_steps: u32,
        out: &mut Vec<[L; COLUMNS]>,
    ) where
        T::Component: Widen<L>,
    {
        out.clear();
        let [nx, ny, nz] = self.dims;
        dispatch!(simd, _simd => for z in self.rows[1].clone() {
            for y in self.rows[0].clone() {
                let row = &self.samples[(z.min(nz - 1) * ny + y.min(ny - 1)) * nx..][..nx];
                out.push(reach.expand(row, self.channel, log_steps));
            }
        });
    }
}

/// Sums of neighbouring samples, at `taps` that are half way between them.
pub(crate) struct PairSums<'a, T> {
    pub samples: &'a [T],
    pub channel: usize,
    pub taps: &'a [Tap],
}

impl<T: Voxel> PairSums<'_, T> {
    /// The sums along each row of the grid in `rows`, which are `length` long.
    pub(crate) fn along<L: Lane>(
        &self,
        simd: Level,
        rows: impl Iterator<Item = usize>,
        length: usize,
        out: &mut Vec<[L; COLUMNS]>,
    ) where
        T::Component: Widen<L>,
    {
        out.clear();
        // Coarse samples are evenly spaced.
        let first = self.taps[0].fine();
        let spacing = self.taps.get(1).map_or(0, |tap| tap.fine() - first);
        let is_even = self.taps.len() == COLUMNS
            && self.taps.windows(2).all(|pair| pair[1].fine() - pair[0].fine() == spacing);
        dispatch!(simd, _simd => for row in rows {
            let row = &self.samples[row * length..][..length];
            out.push(match spacing {
                2 if is_even => self.evenly::<L, 2>(&row[first..]),
                4 if is_even => self.evenly::<L, 4>(&row[first..]),
                8 if is_even => self.evenly::<L, 8>(&row[first..]),
                _ => self.anywhere(row),
            });
        });
    }

    #[inline(always)]
    fn evenly<L: Lane, const SPACING: usize>(&self, row: &[T]) -> [L; COLUMNS]
    where
        T::Component: Widen<L>,
    {
        let row = &row[..SPACING * (COLUMNS - 1) + 2];
        let mut sums = [L::default(); COLUMNS];
        for c in 0..COLUMNS {
            let [low, high] = [row[SPACING * c], row[SPACING * c + 1]];
            sums[c] = low.component(self.channel).widen().plus(high.component(self.channel).widen());
        }
        sums
    }

    #[inline(always)]
    fn anywhere<L: Lane>(&self, row: &[T]) -> [L; COLUMNS]
    where
        T::Component: Widen<L>,
    {
        let mut sums = [L::default(); COLUMNS];
        for (sum, tap) in sums.iter_mut().zip(self.taps) {
            let [low, high] = [row[tap.fine()], row[tap.fine() + 1]];
            *sum = low.component(self.channel).widen().plus(high.component(self.channel).widen());
        }
        sums
    }
}
