//! Opacity from a histogram.
//!
//! # Method
//! 1. *Air* ends at the threshold of least cross entropy between the histogram and its two halves (Li, Lee,
//!    "Minimum cross entropy thresholding", 1993). Unlike Otsu's it also finds the faint part of long-tailed
//!    simulation data. Opacity begins a little below, on the way from the most frequent value of the air.
//! 2. Above, extinction goes with the inverse root of how often a value occurs, so that the bulk is quiet and
//!    what is rare stands out, and rises with the value.
//! 3. All is scaled so that matter, gathered in a ball, has a mean optical depth of [`MEAN_DEPTH`]: sparse and
//!    dense volumes come out equally clear, whatever their size in the world.
//! 4. Control points are spread evenly over the mean of a value's rank among matter and its place between the
//!    ends, so that neither a long tail nor a narrow peak swallows the colours.

use glam::DVec3;
use volery_scene::ControlPoint;

use crate::histogram::Histogram;

/// Mean optical depth of the matter.
const MEAN_DEPTH: f64 = 3.5;
/// The densest bin counts at most this many times more than the rarest.
const DENSITY_CONTRAST: f64 = 50.0;
/// Standard deviation of the smoothing of the histogram, as a fraction of its range.
const SMOOTHING: f64 = 3.0 / 256.0;
/// How far opacity rises before and behind the threshold, as a fraction of its distance from the air's peak.
const SOFTNESS: f64 = 0.35;
/// Share of matter above the value at which colours end.
const RARE: f64 = 0.0005;
/// Weight of a value's rank against its place.
const RANK_WEIGHT: f64 = 0.4;
/// Control points between the threshold and the end.
const NUM_POINTS: usize = 24;
/// Largest opacity of a control point: beyond it nothing looks different.
const MAX_OPACITY: f64 = 0.98;

/// Where a value stands among those of visible matter.
pub(super) struct Place {
    /// Linear in the value: 0 at the threshold, 1 at the end.
    pub(super) linear: f64,
    /// The mean of rank and linear place.
    pub(super) mixed: f64,
}

/// Control points for a volume of this histogram and extent, opacities per `unit_distance`.
pub(super) fn points(
    histogram: &Histogram,
    extent: DVec3,
    unit_distance: f64,
    color: impl Fn(&Place) -> [f64; 3],
) -> Vec<ControlPoint> {
    let Some(matter) = Matter::of(histogram) else {
        // One value, or no contrast: matter of one colour that lets some light through.
        let color = color(&Place { linear: 0.5, mixed: 0.5 });
        return vec![ControlPoint { value: histogram.range[0], color, opacity: 0.02 }];
    };
    let extinction = matter.extinction(histogram, extent);
    let opacity = |bin: usize| (-(-extinction[bin] * unit_distance).exp_m1()).min(MAX_OPACITY);
    let first = color(&Place { linear: 0.0, mixed: 0.0 });
    let start = matter.start.max(histogram.range[0]);
    let mut points = vec![ControlPoint { value: start, color: first, opacity: 0.0 }];
    let mut bin = matter.threshold_bin;
    for step in 0..=NUM_POINTS {
        let mixed = step as f64 / NUM_POINTS as f64;
        while bin < matter.end_bin && matter.mixed(bin) < mixed {
            bin += 1;
        }
        let value = histogram.center(bin).min(histogram.range[1]);
        if points.last().is_some_and(|last| value > last.value) {
            let place = Place { linear: matter.linear(bin), mixed: matter.mixed(bin) };
            points.push(ControlPoint { value, color: color(&place), opacity: opacity(bin) });
        }
    }
    points
}

/// The part of a histogram that is no air.
struct Matter {
    /// Value at which opacity begins.
    start: f64,
    /// The first bin above the threshold.
    threshold_bin: usize,
    /// Where colours end.
    end_bin: usize,
    /// Bins over which opacity rises to its own.
    soft_bins: f64,
    /// Share of matter up to each bin.
    rank: Vec<f64>,
}

impl Matter {
    fn of(histogram: &Histogram) -> Option<Self> {
        let counts = &histogram.counts;
        let threshold_bin = threshold(counts)?;
        let in_matter: u64 = counts[threshold_bin..].iter().sum();
        let mut sum = 0;
        let rank: Vec<f64> = counts
            .iter()
            .enumerate()
            .map(|(bin, count)| {
                sum += if bin < threshold_bin { 0 } else { *count };
                sum as f64 / in_matter as f64
            })
            .collect();
        let end_bin = rank.partition_point(|&rank| rank < 1.0 - RARE).min(counts.len() - 1);
        let air_peak = (0..threshold_bin).max_by_key(|&bin| (counts[bin], std::cmp::Reverse(bin)))?;
        let soft_bins = SOFTNESS * (threshold_bin - air_peak) as f64;
        let start = histogram.center(threshold_bin) - soft_bins * histogram.bin_width;
        (end_bin > threshold_bin).then_some(Self { start, threshold_bin, end_bin, soft_bins, rank })
    }

    fn linear(&self, bin: usize) -> f64 {
        let length = (self.end_bin - self.threshold_bin) as f64;
        ((bin as f64 - self.threshold_bin as f64) / length).clamp(0.0, 1.0)
    }

    fn mixed(&self, bin: usize) -> f64 {
        RANK_WEIGHT * self.rank[bin] + (1.0 - RANK_WEIGHT) * self.linear(bin)
    }

    /// Extinction per world length of each bin.
    fn extinction(&self, histogram: &Histogram, extent: DVec3) -> Vec<f64> {
        let matter_counts: Vec<f64> = (0..histogram.counts.len())
            .map(|bin| if bin < self.threshold_bin { 0.0 } else { histogram.counts[bin] as f64 })
            .collect();
        let density = smoothed(&matter_counts, SMOOTHING * matter_counts.len() as f64);
        let peak = density.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let relative: Vec<f64> = density
            .iter()
            .enumerate()
            .map(|(bin, density)| {
                let rarity = (density / peak).max(1.0 / DENSITY_CONTRAST).sqrt().recip();
                let rise = 0.08 + self.linear(bin).powf(1.2);
                let from_threshold = bin as f64 - self.threshold_bin as f64;
                let onset =
                    ((from_threshold + self.soft_bins) / (2.0 * self.soft_bins + 1.0)).clamp(0.0, 1.0);
                rarity * rise * onset
            })
            .collect();
        // Mean extinction over the domain times the mean way through it, of as much volume as matter fills.
        let num_samples = (histogram.num_counted() + histogram.blank) as f64;
        let mean =
            relative.iter().zip(&histogram.counts).map(|(s, &n)| s * n as f64).sum::<f64>() / num_samples;
        let share = matter_counts.iter().sum::<f64>() / num_samples;
        let edge = extent.max(extent.max_element() * DVec3::splat(1e-3)).powf(1.0 / 3.0).element_product();
        let scale = MEAN_DEPTH * 1.5 * share.powf(2.0 / 3.0) / (mean * edge);
        relative.iter().map(|s| s * scale).collect()
    }
}

/// The first bin of matter: Li and Lee's threshold, by fixed-point iteration (Li, Tam 1998), over the place of
/// a bin in the histogram. `None` if there are not two kinds.
pub(crate) fn threshold(counts: &[u64]) -> Option<usize> {
    let mean_of = |bins: std::ops::Range<usize>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for bin in bins {
            sum += (bin as f64 + 0.5) * counts[bin] as f64;
            count += counts[bin] as f64;
        }
        (count > 0.0).then(|| sum / count)
    };
    let mut edge = mean_of(0..counts.len())?.ceil() as usize;
    for _ in 0..counts.len() {
        let edge_bin = edge.clamp(1, counts.len());
        let (low, high) = (mean_of(0..edge_bin)?, mean_of(edge_bin..counts.len())?);
        let next = ((high - low) / (high / low).ln()).round() as usize;
        if next == edge {
            break;
        }
        edge = next;
    }
    let edge = edge.clamp(1, counts.len());
    (mean_of(0..edge).is_some() && mean_of(edge..counts.len()).is_some()).then_some(edge)
}

/// Convolved with a Gaussian of this standard deviation in bins; nothing lies beyond the ends.
fn smoothed(counts: &[f64], deviation: f64) -> Vec<f64> {
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |distance: usize| (-0.5 * (distance as f64 / deviation).powi(2)).exp();
    let weights: Vec<f64> = (0..=reach).map(weight).collect();
    (0..counts.len())
        .map(|bin| {
            let near = bin.saturating_sub(reach)..=(bin + reach).min(counts.len() - 1);
            near.map(|other| counts[other] * weights[other.abs_diff(bin)]).sum()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_lies_between_two_peaks() {
        let mut counts = vec![0; 256];
        for bin in 0..20 {
            counts[bin] = 10_000;
            counts[140 + bin] = 500;
        }
        let edge = threshold(&counts).unwrap();
        assert!((20..=140).contains(&edge), "{edge}");
    }

    #[test]
    fn one_kind_has_no_threshold() {
        assert_eq!(threshold(&[7]), None);
        assert_eq!(threshold(&[0, 0, 7, 0]), None);
        assert_eq!(threshold(&[]), None);
    }

    #[test]
    fn smoothing_keeps_the_sum_inside() {
        let mut counts = vec![0.0; 64];
        counts[32] = 5.0;
        let smooth = smoothed(&counts, 2.0);
        assert!(smooth.windows(2).take(32).all(|w| w[0] <= w[1]));
        assert_eq!(smooth[30], smooth[34]);
    }
}
