//! The values that are worth colours: without what stands for no data, and without outliers.
//!
//! # Method
//! - *Padding*: negative values at the lower end, apart from all others by a gap of empty bins. A CT reconstruction
//!   has -3024 or -2000 outside its circle and air at -1000 inside. Padding is left out if the gap is many times as
//!   long as the range of the rest, or if it is a tenth of it and the rest has an air of its own: a narrow peak below its
//!   threshold. Without that a background of -1000 around tissue would count as padding.
//! - *Fill*: values that programs write where they know nothing: 1e15 and more, or as far below 0, beside others that are
//!   not; and at the upper end 999, 9999 and the like.
//! - *Outliers*: as long as all but a thousandth of the samples are in an eighth of the bins, bins go over those
//!   alone. The values outside keep the colour of the nearer end.
//!
//! Labels and masks have whole numbers from 0 up, so none of them is taken for padding.

use volery_scene::{Sample, Samples, for_samples};

use super::{Histogram, MAX_BINS, Window};
use crate::transfer::threshold;

/// Gap below the rest, in ranges of the rest, from which padding needs no other sign.
const FAR: f64 = 10.0;
/// The same where the rest has an air of its own.
const NEAR: f64 = 0.1;
/// Share of the rest that air has, at least.
const AIR_SHARE: f64 = 0.2;
/// Half width of the peak of air, as a fraction of the range of the rest; half of the air is in it.
const AIR_WIDTH: f64 = 0.02;
/// Magnitudes that no measurement has.
const HUGE: f64 = 1e15;
/// Values that tables use for what is missing.
const MISSING: [f64; 4] = [999.0, 9999.0, 99999.0, 999_999.0];
/// Share of the samples that bins may leave out at either end.
const OUTLIERS: f64 = 0.0005;
/// Share of the bins that must be in use.
const LEAST_USE: f64 = 0.125;
/// More rounds than doubles have powers of eight.
const MAX_ROUNDS: usize = 700;

impl Histogram {
    /// As [`Histogram::of_samples`], of the values that are worth colours.
    ///
    /// # Panics
    /// When the samples have no such channel.
    pub fn of_matter(samples: &Samples, channel: usize) -> Option<Self> {
        let mut window = Window::of(samples.range(channel)?);
        let mut histogram = Self::of_window(samples, channel, window)?;
        for _ in 0..MAX_ROUNDS {
            let Some(next) = histogram.without_no_data(window).or_else(|| histogram.trimmed(window)) else {
                break;
            };
            // The edges of bins are no values: the rest may be narrower than they are.
            let Some(range) = used_range(samples, channel, next) else { break };
            let next = Window { range, ..next };
            if next == window {
                break;
            }
            let Some(found) = Self::of_window(samples, channel, next) else { break };
            (window, histogram) = (next, found);
        }
        Some(histogram)
    }

    /// A window without padding or fill, if there is any.
    fn without_no_data(&self, window: Window) -> Option<Window> {
        let used: Vec<usize> = (0..self.counts.len()).filter(|&bin| self.counts[bin] > 0).collect();
        let (&[first, second, ..], &[.., before, last]) = (&used[..], &used[..]) else { return None };
        let edge = |bin: usize| self.start + bin as f64 * self.bin_width;
        let [low, high] = self.range;
        let gap = |below: usize, above: usize| (above - below - 1) as f64;
        let is_fill = high >= HUGE && low < HUGE
            || MISSING.contains(&high)
                && used.len() > 2
                && gap(before, last) >= FAR * (before + 1 - first) as f64;
        if is_fill {
            let ceiling = edge(before + 1).min(high.next_down());
            return Some(Window { range: [low, ceiling], counted: [window.counted[0], ceiling] });
        }
        if low <= -HUGE && high > -HUGE {
            let floor = edge(second).max(low.next_up());
            return Some(Window { range: [floor, high], counted: [floor, window.counted[1]] });
        }
        // With two bins in use there is no saying which is the rest.
        if low >= 0.0 || used.len() == 2 {
            return None;
        }
        let top = self.quantile(1.0 - OUTLIERS).max(second + 1);
        let ratio = gap(first, second) / (top - second) as f64;
        let is_padding = ratio >= FAR || ratio >= NEAR && self.has_air(second, top);
        let floor = edge(second);
        is_padding.then_some(Window { range: [floor, high], counted: [floor, window.counted[1]] })
    }

    /// Whether the bins from `first` to `last` have a narrow peak below their threshold that holds much of them.
    fn has_air(&self, first: usize, last: usize) -> bool {
        let rest = &self.counts[first..=last.min(self.counts.len() - 1)];
        let Some(threshold) = threshold(rest) else { return false };
        let air = &rest[..threshold];
        let Some(peak) = (0..air.len()).max_by_key(|&bin| air[bin]) else { return false };
        let reach = (AIR_WIDTH * rest.len() as f64).ceil() as usize;
        let near = &air[peak.saturating_sub(reach)..(peak + reach + 1).min(air.len())];
        let sum = |counts: &[u64]| counts.iter().sum::<u64>() as f64;
        sum(air) >= AIR_SHARE * sum(rest) && sum(near) >= 0.5 * sum(air)
    }

    /// A window of most values, if they have few of the bins.
    fn trimmed(&self, window: Window) -> Option<Window> {
        let (first, last) = (self.quantile(OUTLIERS), self.quantile(1.0 - OUTLIERS));
        let is_fine = (last + 1 - first) as f64 >= LEAST_USE * self.counts.len() as f64;
        if is_fine || self.counts.len() < MAX_BINS / 8 {
            return None;
        }
        let [low, high] = self.range;
        let edge = |bin: usize| (self.start + bin as f64 * self.bin_width).clamp(low, high);
        Some(Window { range: [edge(first), edge(last + 1)], counted: window.counted })
    }

    /// The first bin up to which at least this share of what is counted lies.
    fn quantile(&self, share: f64) -> usize {
        let wanted = share * self.num_counted() as f64;
        let mut sum = 0;
        let is_below = |count: &&u64| {
            sum += **count;
            (sum as f64) < wanted
        };
        self.counts.iter().take_while(is_below).count().min(self.counts.len() - 1)
    }
}

/// Smallest and largest value of a channel in a window.
fn used_range(samples: &Samples, channel: usize, window: Window) -> Option<[f64; 2]> {
    fn range<T: Sample>(values: &[T], channel: usize, [low, high]: [f64; 2]) -> [f64; 2] {
        let values = values.iter().map(|value| value.channel(channel));
        values
            .filter(|value| (low..=high).contains(value))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)])
    }
    let [low, high] = for_samples!(samples, |values| range(values, channel, window.range));
    (low <= high).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range_of(samples: impl Into<Samples>) -> [f64; 2] {
        Histogram::of_matter(&samples.into(), 0).unwrap().range
    }

    /// So many samples of each value, and the last again and again in between.
    fn samples(values: &[(f32, usize)]) -> Vec<f32> {
        values.iter().flat_map(|&(value, count)| std::iter::repeat_n(value, count)).collect()
    }

    fn ramp(low: i16, high: i16, count: usize) -> Vec<i16> {
        (0..count).map(|i| low + (i % usize::from(high.abs_diff(low) + 1)) as i16).collect()
    }

    #[test]
    fn padding_of_a_ct_is_left_out_and_air_is_not() {
        let mut ct = ramp(-20, 20, 50_000).into_iter().map(|noise| noise - 1000).collect::<Vec<_>>();
        ct.extend(ramp(-100, 1500, 20_000));
        let whole = range_of(ct.clone());
        assert_eq!(whole, [-1020.0, 1500.0]);
        for padding in [-3024, -2000, -32768] {
            let padded = [vec![padding; 30_000], ct.clone()].concat();
            assert_eq!(range_of(padded.clone()), whole, "{padding}");
            let counted = Histogram::of_matter(&padded.into(), 0).unwrap();
            assert_eq!(counted.blank, 30_000);
        }
        // Metal beside padding: eight samples of a hundred thousand.
        let metal = [vec![-3024; 30_000], ct, vec![32_000; 8]].concat();
        let range = range_of(metal);
        assert!(range[0] == -1020.0 && range[1] <= 1600.0, "{range:?}");
    }

    #[test]
    fn tissue_in_a_mask_keeps_its_background() {
        let masked = [vec![-1000; 60_000], ramp(-150, 250, 40_000)].concat();
        assert_eq!(range_of(masked), [-1000.0, 250.0]);
        let brain = [vec![0; 60_000], ramp(300, 1000, 40_000)].concat();
        assert_eq!(range_of(brain), [0.0, 1000.0]);
    }

    #[test]
    fn labels_are_all_kept() {
        for labels in [[0, 1, 50], [0, 100, 255], [0, 1, 30_000]] {
            let values = labels.map(|label| vec![label as u16; 5000]).concat();
            assert_eq!(range_of(values), [0, 2].map(|i| f64::from(labels[i])), "{labels:?}");
        }
    }

    #[test]
    fn fill_and_hot_samples_leave_the_range_of_the_rest() {
        let rest: Vec<f32> = (0..90_000).map(|i| i as f32 / 90_000.0 * 30.0).collect();
        let high = f64::from(*rest.last().unwrap());
        for fill in [1e20_f32, 9.969_21e36, f32::MAX, 9999.0, -9999.0, -1e30] {
            let filled = [rest.clone(), samples(&[(fill, 40_000)])].concat();
            assert_eq!(range_of(filled), [0.0, high], "{fill}");
        }
        for hot in [1e4_f32, 1e9, 3e38] {
            let with_hot = [rest.clone(), samples(&[(hot, 3), (hot / 2.0, 4)])].concat();
            let [low, found] = range_of(with_hot);
            assert!(low < 0.1 && found > 29.9 && found <= high, "{hot}: {low} to {found}");
        }
    }

    #[test]
    fn one_value_two_values_and_none_end() {
        assert_eq!(range_of(vec![7.5_f32; 10]), [7.5, 7.5]);
        assert_eq!(range_of(samples(&[(0.0, 10), (1.0, 5)])), [0.0, 1.0]);
        assert_eq!(range_of(samples(&[(3.0, 10), (1e20, 5)])), [3.0, 3.0]);
        assert_eq!(range_of(samples(&[(1e20, 5)])), [1e20_f32 as f64, 1e20_f32 as f64]);
        assert!(Histogram::of_matter(&vec![f32::NAN; 3].into(), 0).is_none());
        assert!(Histogram::of_matter(&vec![-1.7e308_f64, 1.7e308].into(), 0).is_none());
    }
}
