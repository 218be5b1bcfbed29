//! What a transfer function can do over a range of values.
//!
//! Values are cut into bins, at control points and between them; of each bin extinction, colour and `s (c - B)` for some
//! `B` have bounds, rounded outwards to `f32`. Bounds over any run of bins are the largest of two rows: of the runs
//! of 2^k bins that begin at its first and end at its last.

use volery_scene::{ControlPoint, TransferFunction};

/// Colours behind for which there are tables: `B` of 0, 1/4 .. 1.
const NUM_BEHIND: usize = 5;

/// Bins in all, about, and of a band at least.
const NUM_BINS: usize = 1024;
const MIN_BINS: usize = 8;

/// Parts of equal width that control points are looked up in.
const NUM_PLACES: usize = 4096;

/// Bounds of what is seen at some values, each the larger the looser.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Largest extinction, and the negative of the least.
    extinction: [f32; 2],
    /// Largest colour, and the negative of the least.
    color: [[f32; 2]; 3],
}

impl Seen {
    fn join(&self, other: &Self) -> Self {
        let pair = |[a, b]: [f32; 2], [c, d]: [f32; 2]| [a.max(c), b.max(d)];
        Self {
            extinction: pair(self.extinction, other.extinction),
            color: std::array::from_fn(|i| pair(self.color[i], other.color[i])),
        }
    }

    /// Least and largest extinction per world length.
    pub(super) fn extinction(&self) -> [f64; 2] {
        [f64::from(-self.extinction[1]).max(0.0), f64::from(self.extinction[0])]
    }

    /// Least and largest colour of a channel.
    pub(super) fn color(&self, channel: usize) -> [f64; 2] {
        let [most, least] = self.color[channel];
        [f64::from(-least), f64::from(most)]
    }
}

/// By channel and `B`, over some values: the largest `s (c - B)`, the largest of its negative, and the steepest slope.
#[derive(Clone, Copy, Debug)]
struct Change([[[f32; NUM_BEHIND]; 3]; 3]);

impl Change {
    fn join(&self, other: &Self) -> Self {
        let max = |a: &[f32; NUM_BEHIND], b: &[f32; NUM_BEHIND]| std::array::from_fn(|k| a[k].max(b[k]));
        Self(std::array::from_fn(|i| std::array::from_fn(|j| max(&self.0[i][j], &other.0[i][j]))))
    }
}

/// A run of bins, as two that cover it: how long they are, as a power of two, and where they begin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    log_length: u32,
    begins: [u32; 2],
}

/// Of all values.
#[derive(Debug)]
pub(super) struct Colors {
    /// Values at which bins begin and end, relative to an offset; a step has a bin without width.
    ends: Vec<[f64; 2]>,
    /// For values from the first control point on, in parts of equal width, how many bins end below.
    places: Vec<u32>,
    places_per_value: f64,
    /// Entry `i` of `[k]` is of bins `i .. i + 2^k`.
    seen_runs: Vec<Vec<Seen>>,
    change_runs: Vec<Vec<Change>>,
    /// Least and largest colour of a channel of anything that can be seen.
    pub(super) seen: [[f64; 2]; 3],
}

/// A range of values in which colour and opacity are linear, or a step.
struct Band {
    low: ControlPoint,
    high: ControlPoint,
    unit_distance: f64,
}

impl Colors {
    /// Of values relative to `offset`.
    pub(super) fn new(transfer: &TransferFunction, offset: f64) -> Self {
        let points = transfer.points();
        let num = (NUM_BINS / points.len()).max(MIN_BINS);
        let unit_distance = transfer.unit_distance();
        let (first, last) = (points[0], points[points.len() - 1]);
        let outer =
            |point: ControlPoint| Band { low: point, high: point, unit_distance }.row([0.0, 1.0], 0.0);
        let mut ends = vec![[f64::NEG_INFINITY, first.value - offset]];
        let mut rows = vec![outer(first)];
        for pair in points.windows(2) {
            let band = Band { low: pair[0], high: pair[1], unit_distance };
            let width = band.high.value - band.low.value;
            let num = if width > 0.0 { num } else { 1 };
            let share = |k: usize| k as f64 / num as f64;
            for k in 0..num {
                let [from, to] = [share(k), share(k + 1)];
                ends.push([from, to].map(|at| band.low.value - offset + width * at));
                rows.push(band.row([from, to], width));
            }
        }
        ends.push([last.value - offset, f64::INFINITY]);
        rows.push(outer(last));
        let (seen, changes): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        let is_seen = |seen: &&Seen| seen.extinction[0] > 0.0;
        let all = seen.iter().filter(is_seen).copied().reduce(|a, b| a.join(&b));
        let begin = first.value - offset;
        let places_per_value = NUM_PLACES as f64 / (last.value - first.value);
        let below = |place: usize| {
            let value = begin + place as f64 / places_per_value;
            ends.partition_point(|[_, end]| *end < value) as u32
        };
        let places = (0..=NUM_PLACES).map(below).collect();
        Self {
            places,
            places_per_value,
            seen_runs: runs(seen, Seen::join),
            change_runs: runs(changes, Change::join),
            seen: [0, 1, 2].map(|channel| all.map_or([1.0, 0.0], |all| all.color(channel))),
            ends,
        }
    }

    /// How many bins end below a value.
    fn below(&self, value: f64) -> usize {
        let place = (value - self.ends[0][1]) * self.places_per_value;
        // One more to both sides: which part a value is in may be rounded. Not a number where there is one value.
        let [first, last] = if place >= 0.0 && place < NUM_PLACES as f64 {
            let place = place as usize;
            [self.places[place.saturating_sub(1)], self.places[(place + 2).min(NUM_PLACES)]]
                .map(|at| at as usize)
        } else {
            [0, self.ends.len()]
        };
        first + self.ends[first..last].partition_point(|[_, end]| *end < value)
    }

    /// All values from `low` to `high`.
    pub(super) fn run(&self, low: f64, high: f64) -> Run {
        let last = self.ends.len() - 1;
        let first = self.below(low).min(last);
        // A bin that begins where another ends counts too.
        let mut end = self.below(high).min(last);
        while end < last && self.ends[end + 1][0] <= high {
            end += 1;
        }
        let log_length = (end + 1 - first).ilog2();
        Run { log_length, begins: [first as u32, (end + 1 - (1 << log_length)) as u32] }
    }

    pub(super) fn seen(&self, run: Run) -> Seen {
        let [a, b] = run.begins.map(|begin| &self.seen_runs[run.log_length as usize][begin as usize]);
        a.join(b)
    }

    /// Whether there is a step among the values.
    pub(super) fn has_step(&self, run: Run) -> bool {
        run.begins.iter().any(|&begin| {
            let Change([_, _, slopes]) = &self.change_runs[run.log_length as usize][begin as usize];
            slopes.iter().flatten().any(|slope| slope.is_infinite())
        })
    }

    /// The largest `|h_B(v + d) - h_B(v)|`, `|d| <= error`, of a channel, for `v` and `v + d` in the run and `B` in
    /// an interval of [0, 1].
    pub(super) fn change(&self, run: Run, channel: usize, behind: [f64; 2], error: f64) -> f64 {
        let [a, b] = run.begins.map(|begin| &self.change_runs[run.log_length as usize][begin as usize]);
        let at = |behind: f64| {
            let place = behind.clamp(0.0, 1.0) * (NUM_BEHIND - 1) as f64;
            let first = (place as usize).min(NUM_BEHIND - 2);
            let share = place - first as f64;
            let mix = |kind: usize| {
                let at = |k: usize| f64::from(a.0[kind][channel][k].max(b.0[kind][channel][k]));
                // Not a NaN where one of them is infinite and counts nothing.
                if share == 0.0 { at(first) } else { (1.0 - share) * at(first) + share * at(first + 1) }
            };
            let [most, least, steep] = [0, 1, 2].map(mix);
            (most + least).max(0.0).min(if steep == 0.0 { 0.0 } else { steep * error })
        };
        // Convex in `B`: largest at an end.
        at(behind[0]).max(at(behind[1]))
    }
}

/// Of all runs of bins.
fn runs<T: Copy>(bins: Vec<T>, join: impl Fn(&T, &T) -> T) -> Vec<Vec<T>> {
    let mut runs = vec![bins];
    for k in 0..runs[0].len().ilog2() {
        let shorter = &runs[k as usize];
        let longer = shorter.iter().zip(&shorter[1 << k..]).map(|(a, b)| join(a, b)).collect();
        runs.push(longer);
    }
    runs
}

/// Rounded up.
fn up(number: f64) -> f32 {
    if number == 0.0 { 0.0 } else { (number as f32).next_up() }
}

/// A product in which nothing of infinitely much is nothing.
fn times(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

impl Band {
    /// Between two shares of the way, of a width in values.
    fn row(&self, [from, to]: [f64; 2], width: f64) -> (Seen, Change) {
        let mix = |a: f64, b: f64, share: f64| if a == b { a } else { (1.0 - share) * a + share * b };
        let sorted = |[a, b]: [f64; 2]| [a.min(b), a.max(b)];
        let extinction = |opacity: f64| -(-opacity).ln_1p() / self.unit_distance;
        let opacities = sorted([from, to].map(|at| mix(self.low.opacity, self.high.opacity, at)));
        let [least, most] = opacities.map(extinction);
        let is_step =
            width <= 0.0 && (self.low.opacity, self.low.color) != (self.high.opacity, self.high.color);
        let slope = |a: f64, b: f64| {
            if a == b {
                0.0
            } else if width > 0.0 {
                (b - a).abs() / width
            } else {
                f64::INFINITY
            }
        };
        // ds/dv = da/dv / (1 - a) / u
        let steepest = times(
            slope(self.low.opacity, self.high.opacity),
            1.0 / (1.0 - opacities[1]) / self.unit_distance,
        );
        let mut seen = Seen { extinction: [up(most), up(-least)], color: [[0.0; 2]; 3] };
        let mut change = Change([[[0.0; NUM_BEHIND]; 3]; 3]);
        for channel in 0..3 {
            let ends = [self.low.color[channel], self.high.color[channel]];
            let [darkest, brightest] = sorted([from, to].map(|at| mix(ends[0], ends[1], at)));
            seen.color[channel] = [up(brightest), up(-darkest)];
            let color_slope = times(slope(ends[0], ends[1]), most);
            for k in 0..NUM_BEHIND {
                let behind = k as f64 / (NUM_BEHIND - 1) as f64;
                let products = [least, most].map(|s| [darkest, brightest].map(|c| times(s, c - behind)));
                let products = products.as_flattened().iter();
                change.0[0][channel][k] = up(products.clone().copied().fold(f64::NEG_INFINITY, f64::max));
                change.0[1][channel][k] = up(-products.copied().fold(f64::INFINITY, f64::min));
                let farthest = (darkest - behind).abs().max((brightest - behind).abs());
                let steep = times(steepest, farthest) + color_slope;
                change.0[2][channel][k] = if is_step && most > 0.0 { f32::INFINITY } else { up(steep) };
            }
        }
        (seen, change)
    }
}
