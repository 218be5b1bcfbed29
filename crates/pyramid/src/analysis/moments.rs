//! Count, mean and deviation: exact integers, or floats by pairwise updating.
//!
//! *Integers* keep count, sum and sum of squares exactly; mean and deviation are rounded once or twice at
//! the very end. *Floats* keep count, mean and sum of squared deviations from it, in `f64`, and merge by
//! Chan, Golub and LeVeque 1979: column to row, row to node, children to parent, always in the same order.
//! Within a column the sums run about one of its own samples, whose distance from the mean is at most
//! `sqrt(n)` deviations; so cancellation costs a factor of `n <= 2^10` at most, and the deviation is right
//! to about `1e-12` relative. Squares of deviations above `1e154` overflow to infinity.

use std::ops::Range;

use super::lane::COLUMNS;

/// What is known of a set of samples.
pub(crate) trait Moments: Copy + Send + Sync {
    const EMPTY: Self;
    fn merge(self, other: Self) -> Self;
    /// Finite and blank samples.
    fn counts(&self) -> (u64, u64);
    /// NaN without finite samples.
    fn mean(&self) -> f64;
    /// NaN without finite samples.
    fn std_dev(&self) -> f64;
}

/// Rows of a block, [`COLUMNS`] samples each, y fastest.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a, T> {
    pub rows: &'a [[T; COLUMNS]],
    /// Rows along y.
    pub along_y: usize,
}

impl<T> Rows<'_, T> {
    /// The rows `y` of one `z`.
    #[inline(always)]
    pub(crate) fn plane(&self, y: &Range<usize>, z: usize) -> &[[T; COLUMNS]] {
        &self.rows[z * self.along_y..][y.clone()]
    }
}

/// A component whose moments can be taken column by column.
pub(crate) trait ColumnMoments: Sized {
    type Moments: Moments;
    /// The moments of each column over the rows `y`, `z`.
    fn column_moments(rows: Rows<'_, Self>, y: Range<usize>, z: Range<usize>) -> [Self::Moments; COLUMNS];
}

/// Exact.
#[derive(Clone, Copy)]
pub(crate) struct IntegerMoments {
    count: u64,
    sum: i128,
    squares: i128,
}

impl Moments for IntegerMoments {
    const EMPTY: Self = Self { count: 0, sum: 0, squares: 0 };

    fn merge(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
        }
    }

    fn counts(&self) -> (u64, u64) {
        (self.count, 0)
    }

    fn mean(&self) -> f64 {
        self.sum as f64 / self.count as f64
    }

    /// About the integer `q` nearest to the mean nothing cancels: with `r = sum - n q`, `|r| <= n / 2`, the
    /// sum of `(x - q)^2` is at least `|r|`, and `r^2 / n` at most half of that.
    fn std_dev(&self) -> f64 {
        let n = i128::from(self.count);
        if n == 0 {
            return f64::NAN;
        }
        let q = (2 * self.sum + n).div_euclid(2 * n);
        let r = self.sum - n * q;
        let about_q = self.squares - q * (2 * self.sum - n * q);
        let (n, r) = (n as f64, r as f64);
        ((about_q as f64 - r * r / n) / n).sqrt()
    }
}

/// Sums of one plane of at most `MAX_PLANE` rows fit the narrow types; those of all planes are flushed to
/// 64 bits.
macro_rules! small_integer_moments {
    ($($type:ty: $square:ty),*) => {$(
        impl ColumnMoments for $type {
            type Moments = IntegerMoments;
            #[inline(always)]
            fn column_moments(
                rows: Rows<'_, Self>, y: Range<usize>, z: Range<usize>,
            ) -> [IntegerMoments; COLUMNS] {
                let count = (y.len() * z.len()) as u64;
                let mut sums = [0_i64; COLUMNS];
                let mut squares = [0_u64; COLUMNS];
                for z in z {
                    let mut plane_sums = [0_i32; COLUMNS];
                    let mut plane_squares: [$square; COLUMNS] = [0; COLUMNS];
                    for row in rows.plane(&y, z) {
                        for column in 0..COLUMNS {
                            let x = i32::from(row[column]);
                            plane_sums[column] += x;
                            let size = x.unsigned_abs();
                            plane_squares[column] += <$square>::from(size * size);
                        }
                    }
                    for column in 0..COLUMNS {
                        sums[column] += i64::from(plane_sums[column]);
                        squares[column] += u64::from(plane_squares[column]);
                    }
                }
                std::array::from_fn(|column| IntegerMoments {
                    count,
                    sum: sums[column].into(),
                    squares: squares[column].into(),
                })
            }
        }
    )*};
}
small_integer_moments!(u8: u32, i8: u32, u16: u64, i16: u64);

macro_rules! large_integer_moments {
    ($($type:ty),*) => {$(
        impl ColumnMoments for $type {
            type Moments = IntegerMoments;
            #[inline(always)]
            fn column_moments(
                rows: Rows<'_, Self>, y: Range<usize>, z: Range<usize>,
            ) -> [IntegerMoments; COLUMNS] {
                let count = (y.len() * z.len()) as u64;
                let mut sums = [0_i64; COLUMNS];
                // Squares have up to 64 bits; their halves are summed apart.
                let (mut low, mut high) = ([0_u64; COLUMNS], [0_u64; COLUMNS]);
                for row in z.flat_map(|z| rows.plane(&y, z)) {
                    for column in 0..COLUMNS {
                        let x = i64::from(row[column]);
                        sums[column] += x;
                        let square = x.unsigned_abs() * x.unsigned_abs();
                        low[column] += square & 0xffff_ffff;
                        high[column] += square >> 32;
                    }
                }
                std::array::from_fn(|column| IntegerMoments {
                    count,
                    sum: sums[column].into(),
                    squares: i128::from(low[column]) + (i128::from(high[column]) << 32),
                })
            }
        }
    )*};
}
large_integer_moments!(u32, i32);

/// By updating.
#[derive(Clone, Copy)]
pub(crate) struct FloatMoments {
    count: u64,
    blank: u64,
    mean: f64,
    /// Sum of squared distances from the mean.
    squares: f64,
}

impl Moments for FloatMoments {
    const EMPTY: Self = Self { count: 0, blank: 0, mean: 0.0, squares: 0.0 };

    fn merge(self, other: Self) -> Self {
        let blank = self.blank + other.blank;
        if self.count == 0 || other.count == 0 {
            let one = if self.count == 0 { other } else { self };
            return Self { blank, ..one };
        }
        let count = self.count + other.count;
        let share = other.count as f64 / count as f64;
        let step = other.mean - self.mean;
        Self {
            count,
            blank,
            mean: self.mean + step * share,
            squares: self.squares + other.squares + step * step * share * self.count as f64,
        }
    }

    fn counts(&self) -> (u64, u64) {
        (self.count, self.blank)
    }

    fn mean(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { self.mean }
    }

    fn std_dev(&self) -> f64 {
        if self.count == 0 { f64::NAN } else { (self.squares / self.count as f64).sqrt() }
    }
}

macro_rules! float_moments {
    ($($type:ty),*) => {$(
        impl ColumnMoments for $type {
            type Moments = FloatMoments;
            #[inline(always)]
            fn column_moments(
                rows: Rows<'_, Self>, y: Range<usize>, z: Range<usize>,
            ) -> [FloatMoments; COLUMNS] {
                let origin = first_finite(rows, &y, &z).map(f64::from);
                let (mut sums, mut squares, mut counts) = ([0.0; COLUMNS], [0.0; COLUMNS], [0.0; COLUMNS]);
                for row in z.clone().flat_map(|z| rows.plane(&y, z)) {
                    for column in 0..COLUMNS {
                        let finite = row[column].is_finite();
                        let x = if finite { f64::from(row[column]) - origin[column] } else { 0.0 };
                        sums[column] += x;
                        squares[column] += x * x;
                        counts[column] += if finite { 1.0 } else { 0.0 };
                    }
                }
                let total = (y.len() * z.len()) as u64;
                std::array::from_fn(|column| {
                    let count = counts[column];
                    let mean: f64 = sums[column] / count;
                    let squares: f64 = squares[column] - sums[column] * mean;
                    FloatMoments {
                        count: count as u64,
                        blank: total - count as u64,
                        mean: origin[column] + mean,
                        squares: squares.max(0.0),
                    }
                })
            }
        }

        impl FirstFinite for $type {
            fn finite(self) -> bool {
                self.is_finite()
            }
        }
    )*};
}
float_moments!(f32, f64);

trait FirstFinite: Copy + Default {
    fn finite(self) -> bool;
}

/// The first finite sample of each column, 0 where there is none. Mostly ends after one row.
#[inline(always)]
fn first_finite<T: FirstFinite>(rows: Rows<'_, T>, y: &Range<usize>, z: &Range<usize>) -> [T; COLUMNS] {
    let (mut first, mut found) = ([T::default(); COLUMNS], [false; COLUMNS]);
    for row in z.clone().flat_map(|z| rows.plane(y, z)) {
        for column in 0..COLUMNS {
            if !found[column] && row[column].finite() {
                (first[column], found[column]) = (row[column], true);
            }
        }
        if found == [true; COLUMNS] {
            break;
        }
    }
    first
}
