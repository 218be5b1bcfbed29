//! How far a colour can be from the right one when the value is.
//!
//! # Method
//! Somewhere in a node the finest value is `f`, the one shown `f + d`, with `|d| <= e`, the node's data error, and
//! both in the range `[m, M]` of the node's samples (on a decimated pyramid: coarse samples are fine ones). The
//! colour there is wrong by at most
//!
//! `dc = max |c(f + d) - c(f)|` over `f`, `f + d` in `[m, M]`, `|d| <= e`.
//!
//! For a piecewise linear `c` the difference is linear on each piece of the strip of pairs `(f, f + d)`, so its
//! maximum is at a vertex: `f` or `f + d` at a control point or at an end, and the other one at a control point or
//! `e` away. [`ColorChange`] finds these maxima per bin of `f` and keeps them, for errors in geometric steps, in
//! trees of maxima; a node is a search and a walk of one of those. There are two trees, from a value to those above
//! and to those below: each pair of values is in both, pairs that leave the range at its upper end in the first
//! only, at its lower end in the second only, so that the smaller maximum bounds what stays inside. Bins end at the control points, and
//! beside them evenly over the range of values and over that of the control points; ranges are rounded outwards to bins,
//! errors up by at most a step of 2^(1/8). The change within `[m, M]`, whatever the error, is a second bound, which
//! is exact for noise; the smaller counts.
//!
//! # Opaque planes
//! A pixel shows the nearest plane that is not blank. Every brick agrees on what is blank, or its error is
//! infinite. So a pixel of an opaque picture is wrong by at most the largest `dc` of the nodes drawn, however many
//! planes there are.
//!
//! # Transparent planes
//! A plane of colour `c` and opacity `a` before light `B` shows `a c + (1 - a) B`. With `a'`, `c'` and `B'` in
//! place of those, the pixel changes by
//!
//! `[(a'c' - a c) - B (a' - a)] + (1 - a') (B' - B)`.
//!
//! The first part is linear in `B`, each channel of which is in [0, 1], so it is at most the larger of its values
//! at 0 and 1, `|a'c' - a c|` and `|a'(1 - c') - a (1 - c)|`: no background makes it larger, and one makes it that
//! large. The second is at most `|B' - B|`, what the planes behind do. By induction the bounds of the planes that a
//! ray meets add up: with `P` planes the pixel is wrong by at most `P` times the largest bound of a node. Since
//! `a c` and `a (1 - c)` are parabolas between control points, they are replaced by chords, and twice the largest
//! distance from the chords (at most 2^-13 in all) is added.
//!
//! # Guarantees
//! - Never below the true maximum, [`VALUE_SLACK`] and [`COLOR_SLACK`] of rounding in executors included. With
//!   them a node of error 0 has a bound just above 0; the finest level itself, where it does not blend, is what
//!   the picture is compared with, and needs none.
//! - Above it by more than a tenth only where the step of `e`, a bin of the range, the slacks or values just beyond
//!   both ends of the range make a difference.
//! - At a step of the transfer function the change is the whole step as soon as values get near it.
//!
//! # Costs
//! A bound costs some tens of nanoseconds; the first one of an error step costs one walk over bins and control
//! points, about a tenth of a millisecond for 256 points.

use std::ops::Range;
use std::sync::OnceLock;

use volery_pyramid::NodeStats;
use volery_scene::TransferFunction;

/// How far rounding in executors takes a value, in parts of the values that texels span.
pub const VALUE_SLACK: f64 = 1.0 / (1 << 20) as f64;
/// How far rounding in executors takes a colour.
pub const COLOR_SLACK: f64 = 2e-6;

/// Steps of the error per octave.
const STEPS_PER_OCTAVE: f64 = 8.0;
/// Even bins, over the range of values and again over that of the control points.
const EVEN_BINS: usize = 256;
/// Farthest that chords may be from the products of colour and opacity.
const CHORD_DISTANCE: f64 = 1.0 / (1 << 14) as f64;

/// The largest change of a pixel under one transfer function, for any node of a volume.
#[derive(Debug)]
pub struct ColorChange {
    curves: Curves,
    /// Where bins begin and end; at least two, rising.
    edges: Vec<f64>,
    /// In data units.
    value_slack: f64,
    color_slack: f64,
    /// Trees of maxima over the bins, of changes to values above and below, for errors `value_slack * 2^(step / 8)`.
    steps: Vec<OnceLock<[MaxTree; 2]>>,
}

impl ColorChange {
    /// For the values in `range` of a volume whose texels span `texel_span` (both in data units), and for planes
    /// that are opaque or transparent.
    pub fn new(transfer: &TransferFunction, range: [f64; 2], texel_span: f64, is_transparent: bool) -> Self {
        let (curves, chords) = Curves::new(transfer, is_transparent);
        let value_slack = (texel_span.max(range[1] - range[0]) * VALUE_SLACK).max(f64::MIN_POSITIVE);
        let mut edges = edges(&curves.values, [range[0] - value_slack, range[1] + value_slack]);
        // Up to an error of the whole range, beyond which nothing new comes.
        let octaves = ((edges[edges.len() - 1] - edges[0]) / value_slack).log2();
        let mut num_steps = (octaves * STEPS_PER_OCTAVE).ceil() as usize + 2;
        if octaves.is_nan() || octaves >= 64.0 {
            // A range that is empty or overflows has no bins.
            (edges, num_steps) = (vec![0.0; 2], 0);
        }
        let steps = std::iter::repeat_with(OnceLock::new).take(num_steps).collect();
        Self { curves, edges, value_slack, color_slack: COLOR_SLACK + 2.0 * chords, steps }
    }

    /// The largest change of a pixel's channel by a node whose values lie in `range` and are wrong by `error` at
    /// most, for one plane. Never below it, little above it.
    ///
    /// 0 for an empty range, a node of blank samples; infinite for an error that is infinite or not a number.
    pub fn largest(&self, [min, max]: [f64; 2], error: f64) -> f64 {
        if min > max {
            return 0.0;
        }
        let is_known = error < f64::INFINITY && min.is_finite() && max.is_finite();
        if !is_known {
            return f64::INFINITY;
        }
        let range = [min - self.value_slack, max + self.value_slack];
        let within = self.curves.oscillation(range);
        // Twice, since the finest value is rounded too.
        let changed = self.trees(error + 2.0 * self.value_slack).zip(self.bins(range));
        let changed =
            changed.map_or(f64::INFINITY, |([up, down], bins)| up.max(bins.clone()).min(down.max(bins)));
        within.min(changed) + self.color_slack
    }

    /// The bins that cover a range; `None` if they do not.
    fn bins(&self, [low, high]: [f64; 2]) -> Option<Range<usize>> {
        let last_bin = self.edges.len() - 2;
        let is_covered = self.edges[0] <= low && high <= self.edges[last_bin + 1];
        let first = self.edges.partition_point(|&edge| edge <= low).saturating_sub(1).min(last_bin);
        let end = self.edges.partition_point(|&edge| edge < high).max(first + 1);
        is_covered.then_some(first..end)
    }

    /// The maxima for the least step that is not below an error; `None` beyond the last step.
    fn trees(&self, error: f64) -> Option<&[MaxTree; 2]> {
        let of_step = |step: usize| self.value_slack * (step as f64 / STEPS_PER_OCTAVE).exp2();
        let octaves = (error / self.value_slack).log2().max(0.0);
        let mut step = (octaves * STEPS_PER_OCTAVE).ceil() as usize;
        // Rounding may have gone down.
        step += usize::from(of_step(step) < error);
        let tree = self.steps.get(step)?;
        Some(tree.get_or_init(|| self.curves.changes(&self.edges, of_step(step))))
    }
}

/// The largest change of a pixel's channel by a node of a volume whose samples are colours, for one plane.
///
/// `stats` are those of red, green, blue, and opacity if there is one. The shown colour is a mix of samples, as the
/// right one is: wrong by the data error over 255. A transparent plane changes by
/// `a'(c' - c) + (a' - a)(c - B)`, at most the error of the colour, times the largest opacity, plus that of the
/// opacity times the largest distance of the colour from any light. Infinite where an error is, and where there
/// are no three channels.
pub fn largest_of_colors(stats: &[NodeStats], is_transparent: bool) -> f64 {
    let (Some(colors), opacity) = (stats.get(..3), stats.get(3)) else { return f64::INFINITY };
    let worst = colors.iter().map(|color| {
        let (error, farthest) = (color.error / 255.0, color.max.max(255.0 - color.min) / 255.0);
        match opacity.filter(|_| is_transparent) {
            Some(opacity) => opacity.max / 255.0 * error + opacity.error / 255.0 * farthest,
            None => error,
        }
    });
    worst.fold(0.0, f64::max) + COLOR_SLACK
}

/// Where bins end: at control points, and evenly over the range and over that of the control points inside it.
fn edges(values: &[f64], [low, high]: [f64; 2]) -> Vec<f64> {
    let evenly = |low: f64, high: f64| {
        (0..=EVEN_BINS).map(move |i| low + (high - low) * (i as f64 / EVEN_BINS as f64))
    };
    let inside = |value: f64| value.max(low).min(high);
    let [first, last] = [values[0], values[values.len() - 1]].map(inside);
    let mut edges: Vec<f64> =
        evenly(low, high).chain(evenly(first, last)).chain(values.iter().copied()).map(inside).collect();
    edges.sort_by(f64::total_cmp);
    edges.dedup();
    if edges.len() < 2 {
        edges.push(edges[0]);
    }
    edges
}

/// Piecewise linear functions with common control points, constant beyond the ends.
#[derive(Debug)]
struct Curves {
    /// Not falling; at least one.
    values: Vec<f64>,
    /// What changes: colours, or products of colour and opacity.
    curves: Vec<Curve>,
}

#[derive(Debug)]
struct Curve {
    /// `extremes[k][i]`: least and greatest of the control points `i .. i + 2^k`.
    extremes: Vec<Vec<[f64; 2]>>,
}

/// Control points inside a closed window of values, `begin..end`, and the weights of those after its ends.
#[derive(Clone, Copy)]
struct Window {
    begin: usize,
    end: usize,
    weights: [f64; 2],
}

impl Curves {
    /// The curves, and how far they are from what they stand for.
    fn new(transfer: &TransferFunction, is_transparent: bool) -> (Self, f64) {
        let points = transfer.points();
        let mut values = vec![points[0].value];
        let mut places = vec![(0, 0.0)];
        let mut chords: f64 = 0.0;
        for (index, pair) in points.windows(2).enumerate() {
            let opacity = pair[1].opacity - pair[0].opacity;
            let bend = (0..3).map(|c| ((pair[1].color[c] - pair[0].color[c]) * opacity).abs() / 4.0);
            let bend = if is_transparent { bend.fold(0.0, f64::max) } else { 0.0 };
            // At most 64, since the bend is at most 1/4.
            let parts = (bend / CHORD_DISTANCE).sqrt().ceil().max(1.0);
            chords = chords.max(bend / (parts * parts));
            for part in 1..=parts as usize {
                let w = part as f64 / parts;
                values.push(pair[0].value + (pair[1].value - pair[0].value) * w);
                places.push((index, w));
            }
        }
        // The last part ends at its point, whatever the rounding, and no part begins beyond it.
        let mut next = f64::INFINITY;
        for (value, &(index, w)) in values.iter_mut().zip(&places).rev() {
            *value = if w == 1.0 { points[index + 1].value } else { value.min(next) };
            next = *value;
        }
        let at = |(index, w): (usize, f64)| {
            let (a, b) = (&points[index], &points[(index + 1).min(points.len() - 1)]);
            let mix = |from: f64, to: f64| if w == 1.0 { to } else { from + (to - from) * w };
            (std::array::from_fn::<f64, 3, _>(|c| mix(a.color[c], b.color[c])), mix(a.opacity, b.opacity))
        };
        let curve = |of: &dyn Fn(f64, f64) -> f64, channel: usize| {
            let at_point = |place: &(usize, f64)| {
                let (color, opacity) = at(*place);
                of(color[channel], opacity)
            };
            Curve::new(places.iter().map(at_point).collect())
        };
        let of: &[&dyn Fn(f64, f64) -> f64] =
            if is_transparent { &[&|c, a| a * c, &|c, a| a * (1.0 - c)] } else { &[&|c, _| c] };
        let curves = of.iter().flat_map(|of| (0..3).map(|channel| curve(of, channel))).collect();
        (Self { values, curves }, chords)
    }

    fn window(&self, [low, high]: [f64; 2]) -> Window {
        let begin = self.values.partition_point(|&value| value < low);
        let end = self.values.partition_point(|&value| value <= high);
        Window { begin, end, weights: [self.weight(begin, low), self.weight(end, high)] }
    }

    /// Of the control point `after` a value, against the one before.
    fn weight(&self, after: usize, value: f64) -> f64 {
        if after == 0 || after == self.values.len() {
            return 0.0;
        }
        (value - self.values[after - 1]) / (self.values[after] - self.values[after - 1])
    }

    /// The largest difference of any curve within a range.
    fn oscillation(&self, range: [f64; 2]) -> f64 {
        let window = self.window(range);
        let widths = self.curves.iter().map(|curve| {
            let [least, greatest] = curve.range(window);
            greatest - least
        });
        widths.fold(0.0, f64::max)
    }

    /// The largest change from a value to one between it and `value + reach`.
    fn change(&self, value: f64, reach: f64) -> f64 {
        let here = self.window([value, value]);
        // A control point that is `reach` away must not be lost to rounding, least of all a step.
        let rounding = 4.0 * f64::EPSILON * (value.abs() + reach.abs());
        let [low, high] = [value.min(value + reach), value.max(value + reach)];
        let around = self.window([low - rounding, high + rounding]);
        let changes = self.curves.iter().map(|curve| {
            let ([least_here, greatest_here], [least, greatest]) = (curve.range(here), curve.range(around));
            (greatest - least_here).max(greatest_here - least)
        });
        changes.fold(0.0, f64::max)
    }

    /// The largest changes from each bin to values above, and to values below.
    fn changes(&self, edges: &[f64], error: f64) -> [MaxTree; 2] {
        [error, -error].map(|reach| {
            let at_edges: Vec<f64> = edges.iter().map(|&edge| self.change(edge, reach)).collect();
            let mut bins: Vec<f64> = at_edges.windows(2).map(|pair| pair[0].max(pair[1])).collect();
            for value in self.values.iter().map(|value| value - reach) {
                let after = edges.partition_point(|&edge| edge <= value);
                if after > 0 && after < edges.len() {
                    bins[after - 1] = bins[after - 1].max(self.change(value, reach));
                }
            }
            MaxTree::new(&bins)
        })
    }
}

impl Curve {
    fn new(points: Vec<f64>) -> Self {
        let mut extremes = vec![points.into_iter().map(|y| [y, y]).collect::<Vec<_>>()];
        let mut width = 1;
        while 2 * width <= extremes[0].len() {
            let last = &extremes[extremes.len() - 1];
            let twice = last.iter().zip(&last[width..]);
            let twice = twice.map(|(a, b)| [a[0].min(b[0]), a[1].max(b[1])]).collect();
            extremes.push(twice);
            width *= 2;
        }
        Self { extremes }
    }

    /// The value `weight` of the way from the control point before `after` to it.
    fn at(&self, after: usize, weight: f64) -> f64 {
        let points = &self.extremes[0];
        let (a, b) = (points[after.saturating_sub(1)][0], points[after.min(points.len() - 1)][0]);
        if after == 0 { b } else { a + (b - a) * weight }
    }

    /// The least and the greatest value in a window, both sides of steps at its ends included.
    fn range(&self, window: Window) -> [f64; 2] {
        let Window { begin, end, weights } = window;
        let ends = [self.at(begin, weights[0]), self.at(end, weights[1])];
        let mut range = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        if begin < end {
            let row = (end - begin).ilog2() as usize;
            for part in [begin, end - (1 << row)] {
                let [least, greatest] = self.extremes[row][part];
                range = [range[0].min(least), range[1].max(greatest)];
            }
        }
        range
    }
}

/// Maxima over runs of bins.
#[derive(Debug)]
struct MaxTree {
    /// A heap: the parent of `i` is `i / 2`, the leaves are the second half.
    nodes: Vec<f64>,
}

impl MaxTree {
    fn new(bins: &[f64]) -> Self {
        let count = bins.len();
        let mut nodes = [vec![0.0; count], bins.to_vec()].concat();
        for i in (1..count).rev() {
            nodes[i] = f64::max(nodes[2 * i], nodes[2 * i + 1]);
        }
        Self { nodes }
    }

    /// The largest of some bins.
    fn max(&self, bins: Range<usize>) -> f64 {
        let count = self.nodes.len() / 2;
        let (mut first, mut end, mut max) = (bins.start + count, bins.end + count, 0.0);
        while first < end {
            if first % 2 == 1 {
                max = f64::max(max, self.nodes[first]);
                first += 1;
            }
            if end % 2 == 1 {
                end -= 1;
                max = f64::max(max, self.nodes[end]);
            }
            (first, end) = (first / 2, end / 2);
        }
        max
    }
}

#[cfg(test)]
mod tests;
