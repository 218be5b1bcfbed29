//! How often each value occurs: what `info` prints and what transfer functions without options are made of.
//!
//! # Method
//! Whole-numbered data of few values have one bin per value, the value in the middle of its bin; all other
//! data have [`MAX_BINS`] bins over the range of their finite values. Blank samples are counted apart.
//!
//! [`Histogram::of_matter`] is for automatic colours. It leaves out what stands for no data, and then makes bins over
//! most of the values alone, as often as outliers would leave few bins to the rest; see the module `matter`.

use rayon::prelude::*;
use volery_scene::{Sample, SampleType, Samples, VoxelGrid, for_samples};

mod cells;
mod matter;

pub(crate) use cells::by_volume;

/// Most bins of a histogram.
pub const MAX_BINS: usize = 1024;

/// Samples that one task counts.
const CHUNK: usize = 1 << 20;

/// Counts of the values of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Smallest and largest finite value; of [`Histogram::within`] the values that bins go over.
    pub range: [f64; 2],
    /// Value at the lower edge of the first bin.
    pub start: f64,
    /// Width of a bin in data units.
    pub bin_width: f64,
    /// Samples in each bin.
    pub counts: Vec<u64>,
    /// Samples that are NaN or infinite, in no bin; of [`Histogram::of_matter`] those too that stand for no data.
    pub blank: u64,
    /// Values below or above stand for no data.
    pub counted: [f64; 2],
}

/// Which values have which bins.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// The values that bins go over; those outside count in the end bins.
    range: [f64; 2],
    /// Values below or above are blank.
    counted: [f64; 2],
}

impl Histogram {
    /// Counts a channel; `None` if every sample is blank or the range is too wide for an `f64`.
    ///
    /// # Panics
    /// When the grid has no such channel.
    pub fn of(grid: &VoxelGrid, channel: usize) -> Option<Self> {
        Self::of_samples(grid.samples(), channel)
    }

    /// As [`Histogram::of`], of samples wherever they are.
    ///
    /// # Panics
    /// When the samples have no such channel.
    pub fn of_samples(samples: &Samples, channel: usize) -> Option<Self> {
        Self::of_window(samples, channel, Window::of(samples.range(channel)?))
    }

    /// As [`Histogram::of_samples`], with bins over a range of values; those outside count in the end bins.
    ///
    /// # Panics
    /// When the samples have no such channel.
    pub fn within(samples: &Samples, channel: usize, range: [f64; 2]) -> Option<Self> {
        samples.range(channel)?;
        Self::of_window(samples, channel, Window::of(range))
    }

    fn of_window(samples: &Samples, channel: usize, window: Window) -> Option<Self> {
        let [low, high] = window.range;
        let width = high - low;
        if !width.is_finite() {
            return None;
        }
        let whole = !matches!(samples.sample_type(), SampleType::F32 | SampleType::F64);
        let (start, bin_width, num_bins) = if whole {
            // Bins of a whole number of values each, so that none counts more values than its neighbours.
            let values_per_bin = ((width + 1.0) / MAX_BINS as f64).ceil().max(1.0);
            (low - 0.5, values_per_bin, ((width + 1.0) / values_per_bin).ceil() as usize)
        } else if width > 0.0 {
            (low, width / MAX_BINS as f64, MAX_BINS)
        } else {
            (low - 0.5, 1.0, 1)
        };
        let mut histogram = Self {
            range: [low, high],
            start,
            bin_width,
            counts: vec![0; num_bins],
            blank: 0,
            counted: window.counted,
        };
        let counted = for_samples!(samples, |values| histogram.count(values, channel));
        histogram.blank = counted.iter().map(|(_, blank)| blank).sum();
        for (counts, _) in counted {
            histogram.counts.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Some(histogram)
    }

    fn count<T: Sample>(&self, values: &[T], channel: usize) -> Vec<(Vec<u64>, u64)> {
        let [floor, ceiling] = self.counted;
        let threads = rayon::current_num_threads().max(1);
        let chunk = values.len().div_ceil(threads).max(CHUNK);
        let count_chunk = |chunk: &[T]| {
            let (mut counts, mut blank) = (vec![0; self.counts.len()], 0);
            for value in chunk {
                let value = value.channel(channel);
                match self.bin(value) {
                    Some(bin) if (floor..=ceiling).contains(&value) => counts[bin] += 1,
                    _ => blank += 1,
                }
            }
            (counts, blank)
        };
        values.par_chunks(chunk).map(count_chunk).collect()
    }

    /// The bin of a value, values outside the range in the end bins; `None` for a blank one.
    pub fn bin(&self, value: f64) -> Option<usize> {
        // `as` saturates, so below the range is bin 0.
        let bin = ((value - self.start) / self.bin_width) as usize;
        value.is_finite().then(|| bin.min(self.counts.len() - 1))
    }

    /// The value in the middle of a bin.
    pub fn center(&self, bin: usize) -> f64 {
        self.start + (bin as f64 + 0.5) * self.bin_width
    }

    /// Samples that are not blank.
    pub fn num_counted(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The counts over `num_bins` coarser bins of equal width, for people to look at; a bin that lies across
    /// an edge goes where its middle is.
    pub fn coarse_counts(&self, num_bins: usize) -> Vec<u64> {
        let num_bins = num_bins.min(self.counts.len());
        let mut coarse = vec![0; num_bins];
        for (bin, count) in self.counts.iter().enumerate() {
            coarse[(2 * bin + 1) * num_bins / (2 * self.counts.len())] += count;
        }
        coarse
    }
}

impl Window {
    fn of(range: [f64; 2]) -> Self {
        Self { range, counted: [f64::NEG_INFINITY, f64::INFINITY] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn every_whole_number_has_its_bin() {
        let grid = VoxelGrid::new([5, 1, 1], DVec3::ONE, vec![3i16, -2, 3, 4, -2]).unwrap();
        let histogram = Histogram::of(&grid, 0).unwrap();
        assert_eq!(histogram.counts, [2, 0, 0, 0, 0, 2, 1]);
        assert_eq!((histogram.center(0), histogram.center(6)), (-2.0, 4.0));
    }

    #[test]
    fn wide_whole_numbers_share_bins_evenly() {
        let all: Vec<u16> = (0..=u16::MAX).collect();
        let histogram = Histogram::of(&VoxelGrid::new([256, 256, 1], DVec3::ONE, all).unwrap(), 0).unwrap();
        assert!(histogram.counts.iter().all(|&count| count == 64), "{:?}", histogram.counts);
        assert_eq!(histogram.coarse_counts(16), [4096; 16]);
    }

    #[test]
    fn blanks_are_counted_apart_and_every_sample_once() {
        let grid = volery_data::holes([40, 30, 20], 7, 0.2);
        let histogram = Histogram::of(&grid, 0).unwrap();
        let blanks = (0..grid.num_samples()).filter(|&i| !grid.samples().value(i, 0).is_finite()).count();
        assert_eq!(histogram.blank, blanks as u64);
        assert_eq!(histogram.num_counted() + histogram.blank, 24_000);
        assert_eq!(histogram.coarse_counts(10).iter().sum::<u64>(), histogram.num_counted());
    }

    #[test]
    fn constant_and_blank_and_too_wide_data() {
        let of = |values: Vec<f64>| {
            Histogram::of(&VoxelGrid::new([values.len(), 1, 1], DVec3::ONE, values).unwrap(), 0)
        };
        assert_eq!(of(vec![7.5; 3]).unwrap().counts, [3]);
        assert_eq!(of(vec![f64::NAN; 3]), None);
        assert_eq!(of(vec![-1.5e308, 1.5e308]), None);
    }
}
