//! The samples of the coarser levels, each made from the level below it.
//!
//! *Decimated*: sample `i` of level `l` is the finest sample `min(i * 2^l, n - 1)`; taken from the level
//! below it is sample `min(2 i, last)`, the same one.
//!
//! *Averaged*: the mean of the 2x2x2 samples below, of those that exist at odd ends, rounded to the type:
//! integers to the nearest, ties away from zero; floats are summed in
//! `f64` along x, then y, then z. Rounding happens at every level, so
//! a level is a function of the one below it, and a node's error counts what is stored. Blank samples do
//! not count in a mean; the mean of eight blank samples is NaN.

use fearless_simd::{Level, dispatch};
use rayon::prelude::*;
use volery_scene::{Array, Sample, Samples, for_samples};

use crate::layout::{Kind, Layout};

/// A sample that can be averaged.
trait Mean: Sample {
    /// The mean of 2x2x2, x fastest.
    fn mean(of: [Self; 8]) -> Self;
}

macro_rules! integer_mean {
    ($($type:ty as $wide:ty),*) => {$(
        impl Mean for $type {
            #[inline(always)]
            fn mean(of: [Self; 8]) -> Self {
                let mut sum: $wide = 0;
                for x in of {
                    sum += <$wide>::from(x);
                }
                // The shift rounds down; one less for negative sums takes their ties away from zero.
                ((sum + 4 - <$wide>::from(sum < 0)) >> 3) as Self
            }
        }
    )*};
}
integer_mean!(u8 as i16, i8 as i16, u16 as i32, i16 as i32, u32 as i64, i32 as i64);

/// Sums along x, then y, then z, so that a sample counted twice doubles its sum exactly.
#[inline(always)]
fn mean_of_finite(of: [f64; 8]) -> f64 {
    let sum = |[a, b, c, d, e, f, g, h]: [f64; 8]| ((a + b) + (c + d)) + ((e + f) + (g + h));
    let (mut finite, mut counts) = (of, [1.0; 8]);
    for (x, count) in finite.iter_mut().zip(&mut counts) {
        if !x.is_finite() {
            (*x, *count) = (0.0, 0.0);
        }
    }
    sum(finite) / sum(counts)
}

impl Mean for f32 {
    #[inline(always)]
    fn mean(of: [Self; 8]) -> Self {
        let mut wide = [0.0; 8];
        for (wide, x) in wide.iter_mut().zip(of) {
            *wide = f64::from(x);
        }
        mean_of_finite(wide) as Self
    }
}

impl Mean for f64 {
    #[inline(always)]
    fn mean(of: [Self; 8]) -> Self {
        let mean = mean_of_finite(of);
        // The sum may overflow where the mean does not.
        if mean.is_infinite() { mean_of_finite(of.map(|x| x / 8.0)) * 8.0 } else { mean }
    }
}

impl<const N: usize> Mean for [u8; N]
where
    [u8; N]: Sample,
{
    #[inline(always)]
    fn mean(of: [Self; 8]) -> Self {
        std::array::from_fn(|channel| u8::mean(of.map(|sample| sample[channel])))
    }
}

/// The samples of `level` (at least 1), from those of the level below.
pub(crate) fn coarsen(layout: &Layout, level: u32, finer: &Samples) -> Samples {
    fn make<T: Mean>(layout: &Layout, level: u32, finer: &[T]) -> Array<T> {
        let (from, to) = (layout.level_dims(level - 1), layout.level_dims(level));
        let mut coarse = vec![T::default(); to.iter().product()];
        let simd = Level::new();
        coarse.par_chunks_mut(to[0]).enumerate().for_each(|(row, out)| {
            let (y, z) = (2 * (row % to[1]), 2 * (row / to[1]));
            let fine_row = |y: usize, z: usize| {
                let (y, z) = (y.min(from[1] - 1), z.min(from[2] - 1));
                &finer[(z * from[1] + y) * from[0]..][..from[0]]
            };
            match layout.kind() {
                Kind::Decimated => decimate_row(fine_row(y, z), out),
                Kind::Averaged => {
                    let rows = [[y, z], [y + 1, z], [y, z + 1], [y + 1, z + 1]];
                    let rows = rows.map(|[y, z]| fine_row(y, z));
                    dispatch!(simd, _simd => average_row(rows, out));
                }
            }
        });
        coarse.into()
    }
    for_samples!(finer, |values| make(layout, level, values).into())
}

fn decimate_row<T: Copy>(fine: &[T], out: &mut [T]) {
    let (last, body) = out.split_last_mut().expect("a level has samples");
    for (out, pair) in body.iter_mut().zip(fine.chunks(2)) {
        *out = pair[0];
    }
    *last = fine[(2 * body.len()).min(fine.len() - 1)];
}

/// Where an odd end leaves a sample without its pair, the sample counts twice, which is the mean of what
/// exists.
#[inline(always)]
fn average_row<T: Mean>(rows: [&[T]; 4], out: &mut [T]) {
    let pairs = rows[0].len() / 2;
    let [a, b, c, d] = rows.map(|row| row[..2 * pairs].as_chunks::<2>().0);
    for ((((out, a), b), c), d) in out.iter_mut().zip(a).zip(b).zip(c).zip(d) {
        *out = T::mean([a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]]);
    }
    if rows[0].len() % 2 == 1 {
        let [a, b, c, d] = rows.map(|row| row[2 * pairs]);
        out[pairs] = T::mean([a, a, b, b, c, c, d, d]);
    }
}
