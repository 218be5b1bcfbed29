//! The inner loops, elementwise down [`COLUMNS`] columns. Like those of [`expand`](super::expand) they are
//! plain loops over arrays, which the compiler vectorises for each SIMD level; `dispatch!` picks the one of
//! the machine.

use std::ops::Range;

use fearless_simd::{Level, dispatch};

use super::lane::{COLUMNS, Component, Lane, Widen};
use super::moments::{ColumnMoments, Rows};

/// What runs down the columns of the finest samples.
pub(crate) struct Columns<C: ColumnMoments> {
    /// Over all rows; `MAX` above `MIN` where all are blank.
    pub min: [C; COLUMNS],
    pub max: [C; COLUMNS],
    pub any_blank: [bool; COLUMNS],
    /// Over the owned rows.
    pub moments: [C::Moments; COLUMNS],
}

/// Extremes over all rows, moments over those of `owned` (y, z).
pub(crate) fn columns<C: Component>(simd: Level, rows: Rows<'_, C>, owned: &[Range<usize>; 2]) -> Columns<C> {
    #[inline(always)]
    fn run<C: Component>(rows: Rows<'_, C>, [y, z]: &[Range<usize>; 2]) -> Columns<C> {
        let (mut min, mut max) = ([C::MAX; COLUMNS], [C::MIN; COLUMNS]);
        let mut any_blank = [false; COLUMNS];
        for row in rows.rows {
            for column in 0..COLUMNS {
                let x = row[column];
                let finite = x.is_finite();
                any_blank[column] |= !finite;
                min[column] = if finite & (x < min[column]) { x } else { min[column] };
                max[column] = if finite & (x > max[column]) { x } else { max[column] };
            }
        }
        Columns { min, max, any_blank, moments: C::column_moments(rows, y.clone(), z.clone()) }
    }
    dispatch!(simd, _simd => run(rows, owned))
}

impl<C: Component> Columns<C> {
    /// Smallest and largest finite sample of a column; empty, with `+∞` first, where there is none.
    pub(crate) fn range(&self, column: usize) -> [f64; 2] {
        let [min, max] = [self.min[column], self.max[column]];
        if min > max { [f64::INFINITY, f64::NEG_INFINITY] } else { [min.to_f64(), max.to_f64()] }
    }
}

/// A position along y or z as the inner loop needs it.
#[derive(Clone, Copy)]
pub(crate) struct RowTap {
    /// The coarse row before it, counted from the first that the block reads.
    pub cell: usize,
    /// How far on the way to the next coarse row, in steps.
    pub steps: u32,
    /// The fine row before it, counted from the block's first.
    pub row: usize,
    /// 1 where it is half way to the next fine row.
    pub half: usize,
}

/// The two fields of a block, at one level and group of columns.
pub(crate) struct Fields<'a, S, L> {
    /// Finest samples; sums of two for columns that are half way.
    pub fine: Rows<'a, S>,
    /// The coarser field on its own rows, interpolated at the columns.
    pub coarse: Rows<'a, L>,
    /// How many finest samples are summed along x, as a power of two.
    pub log_terms: u32,
    pub log_steps: u32,
}

/// The largest difference of the two fields down each column, over all positions `y`, `z`.
pub(crate) fn worst<S: Widen<L>, L: Lane>(
    simd: Level,
    fields: &Fields<'_, S, L>,
    y: &[RowTap],
    z: &[RowTap],
) -> [L; COLUMNS] {
    #[inline(always)]
    fn run<S: Widen<L>, L: Lane>(fields: &Fields<'_, S, L>, y: &[RowTap], z: &[RowTap]) -> [L; COLUMNS] {
        let mut worst = [L::default(); COLUMNS];
        for z in z.chunk_by(|a, b| a.cell == b.cell) {
            for y in y.chunk_by(|a, b| a.cell == b.cell) {
                fields.worst_in_cell(y, z, &mut worst);
            }
        }
        worst
    }
    dispatch!(simd, _simd => run(fields, y, z))
}

/// The coarser field along y, down each column.
struct Line<L> {
    base: [L; COLUMNS],
    slope: [L; COLUMNS],
}

impl<S: Widen<L>, L: Lane> Fields<'_, S, L> {
    /// The positions `y`, `z` share their coarse cell.
    #[inline(always)]
    fn worst_in_cell(&self, y: &[RowTap], z: &[RowTap], worst: &mut [L; COLUMNS]) {
        let log_steps = self.log_steps;
        let corner = z[0].cell * self.coarse.along_y + y[0].cell;
        let near = self.coarse.rows[corner..].first_chunk::<2>().expect("a cell has an end along y");
        let far = &self.coarse.rows[corner + self.coarse.along_y..];
        let far = far.first_chunk::<2>().expect("a cell has an end along z");
        for z in z {
            let weight = L::weight(z.steps, log_steps);
            let mut line = Line { base: [L::default(); COLUMNS], slope: [L::default(); COLUMNS] };
            for c in 0..COLUMNS {
                let low = near[0][c].whole(log_steps).along(far[0][c].minus(near[0][c]), weight);
                let high = near[1][c].whole(log_steps).along(far[1][c].minus(near[1][c]), weight);
                line.base[c] = low.whole(log_steps);
                line.slope[c] = high.minus(low);
            }
            let front = &self.fine.rows[z.row * self.fine.along_y..];
            let back = &front[z.half * self.fine.along_y..];
            for y in y {
                let weight = L::weight(y.steps, log_steps);
                let above = y.row + y.half;
                match (y.half, z.half) {
                    (0, 0) => self.compare([&front[y.row]], &line, weight, worst),
                    (1, 0) => self.compare([&front[y.row], &front[above]], &line, weight, worst),
                    (0, _) => self.compare([&front[y.row], &back[y.row]], &line, weight, worst),
                    _ => {
                        let rows = [&front[y.row], &front[above], &back[y.row], &back[above]];
                        self.compare(rows, &line, weight, worst);
                    }
                }
            }
        }
    }

    /// The finer field is the mean of `N` rows, a power of two.
    #[inline(always)]
    fn compare<const N: usize>(
        &self,
        rows: [&[S; COLUMNS]; N],
        line: &Line<L>,
        weight: L,
        worst: &mut [L; COLUMNS],
    ) {
        let log_terms = N.ilog2() + self.log_terms;
        for c in 0..COLUMNS {
            let mut sum = rows[0][c].widen();
            for row in &rows[1..] {
                sum = sum.plus(row[c].widen());
            }
            let fine = sum.mean_of_sum(log_terms, 3 * self.log_steps);
            worst[c] = worst[c].max_abs(line.base[c].along(line.slope[c], weight).minus(fine));
        }
    }
}
