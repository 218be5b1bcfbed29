//! What the pyramid must be, by the definitions and nothing else: slow, in exact integers where samples are
//! integers (all positions in half samples), in plain f64 where they are not.

use glam::DVec3;
use volery_pyramid::{Kind, Layout, Node, NodeStats};
use volery_scene::{SampleType, Samples};

/// Size of a level along one axis.
pub(crate) fn level_len(kind: Kind, n: usize, level: u32) -> usize {
    match kind {
        Kind::Decimated => (n - 1).div_ceil(1 << level) + 1,
        Kind::Averaged => n.div_ceil(1 << level),
    }
}

/// All samples of all levels of one channel, as `f64` (exact for every type).
pub(crate) struct Levels {
    pub(crate) kind: Kind,
    pub(crate) dims: [usize; 3],
    pub(crate) integer: bool,
    pub(crate) values: Vec<Vec<f64>>,
}

fn rounded_to(sample_type: SampleType, mean: f64) -> f64 {
    match sample_type {
        SampleType::F64 => mean,
        SampleType::F32 => f64::from(mean as f32),
        _ => mean.round(),
    }
}

impl Levels {
    pub(crate) fn new(
        kind: Kind,
        dims: [usize; 3],
        samples: &Samples,
        channel: usize,
        num_levels: u32,
    ) -> Self {
        let sample_type = samples.sample_type();
        let integer = !matches!(sample_type, SampleType::F32 | SampleType::F64);
        let finest: Vec<f64> = (0..samples.len()).map(|i| samples.value(i, channel)).collect();
        let mut levels = Self { kind, dims, integer, values: vec![finest] };
        for level in 1..num_levels {
            let next = levels.coarser(level, sample_type);
            levels.values.push(next);
        }
        levels
    }

    fn coarser(&self, level: u32, sample_type: SampleType) -> Vec<f64> {
        let to = self.dims.map(|n| level_len(self.kind, n, level));
        let from = self.dims.map(|n| level_len(self.kind, n, level - 1));
        let mut out = Vec::new();
        for z in 0..to[2] {
            for y in 0..to[1] {
                for x in 0..to[0] {
                    out.push(match self.kind {
                        Kind::Decimated => {
                            let at = |i: usize, n: usize| (i << level).min(n - 1);
                            let [x, y, z] = [at(x, self.dims[0]), at(y, self.dims[1]), at(z, self.dims[2])];
                            self.values[0][(z * self.dims[1] + y) * self.dims[0] + x]
                        }
                        Kind::Averaged => {
                            let fine = &self.values[level as usize - 1];
                            // Sums along x, then y, then z.
                            let (mut sum_z, mut count) = (0.0, 0);
                            for z in (2 * z..2 * z + 2).filter(|&z| z < from[2]) {
                                let mut sum_y = 0.0;
                                for y in (2 * y..2 * y + 2).filter(|&y| y < from[1]) {
                                    let row = &fine[(z * from[1] + y) * from[0]..][..from[0]];
                                    let exist = row.iter().skip(2 * x).take(2).filter(|v| v.is_finite());
                                    count += exist.clone().count();
                                    sum_y += exist.sum::<f64>();
                                }
                                sum_z += sum_y;
                            }
                            rounded_to(sample_type, sum_z / count as f64)
                        }
                    });
                }
            }
        }
        out
    }

    /// Along one axis, where a level is read for the position `p / 2`: lower sample, upper sample, and the
    /// upper one's weight out of `2^(level + 1)`.
    fn taps(&self, level: u32, n: usize, p: usize) -> (usize, usize, u64) {
        let unit = 1i64 << (level + 1);
        let last = level_len(self.kind, n, level) as i64 - 1;
        let scaled = match self.kind {
            Kind::Decimated => p as i64,
            Kind::Averaged => (p as i64 + 1 - (1 << level)).clamp(0, last * unit),
        };
        let low = scaled / unit;
        (low as usize, (low + 1).min(last) as usize, (scaled % unit) as u64)
    }

    /// The eight samples around the position `p / 2` with their weights; samples of weight 0 are left out.
    fn corners(&self, level: u32, p: [usize; 3]) -> Vec<(f64, u64)> {
        let dims = self.dims.map(|n| level_len(self.kind, n, level));
        let taps: [_; 3] = std::array::from_fn(|a| self.taps(level, self.dims[a], p[a]));
        let mut corners = Vec::new();
        for octant in 0..8 {
            let mut weight = 1;
            let index: [usize; 3] = std::array::from_fn(|a| {
                let (low, high, w) = taps[a];
                weight *= if octant >> a & 1 == 1 { w } else { (1 << (level + 1)) - w };
                if octant >> a & 1 == 1 { high } else { low }
            });
            if weight > 0 {
                let value = self.values[level as usize][(index[2] * dims[1] + index[1]) * dims[0] + index[0]];
                corners.push((value, weight));
            }
        }
        corners
    }

    /// The field of a level at the position `p / 2`.
    pub(crate) fn field(&self, level: u32, p: [usize; 3]) -> f64 {
        let total = 2f64.powi(3 * (level as i32 + 1));
        self.corners(level, p).into_iter().map(|(v, w)| v * (w as f64 / total)).sum()
    }

    /// The field of a level anywhere, in finest-sample coordinates.
    pub(crate) fn field_at(&self, level: u32, at: DVec3) -> f64 {
        let dims = self.dims.map(|n| level_len(self.kind, n, level));
        let step = 2f64.powi(level as i32);
        let mut sum = 0.0;
        for octant in 0..8 {
            let (mut weight, mut index) = (1.0, [0; 3]);
            for a in 0..3 {
                let u = match self.kind {
                    Kind::Decimated => at[a] / step,
                    Kind::Averaged => (at[a] + 0.5) / step - 0.5,
                };
                let u = u.clamp(0.0, (dims[a] - 1) as f64);
                let upper = octant >> a & 1 == 1;
                weight *= if upper { u.fract() } else { 1.0 - u.fract() };
                index[a] = (u as usize + usize::from(upper)).min(dims[a] - 1);
            }
            sum += weight * self.values[level as usize][(index[2] * dims[1] + index[1]) * dims[0] + index[0]];
        }
        sum
    }

    /// `|f~ - f|` at the position `p / 2`; exact for integers.
    pub(crate) fn difference(&self, level: u32, p: [usize; 3]) -> f64 {
        if self.integer {
            let sum = |level: u32| -> i128 {
                self.corners(level, p).into_iter().map(|(v, w)| v as i128 * i128::from(w)).sum()
            };
            let numerator = (sum(level) - (sum(0) << (3 * level))).unsigned_abs();
            // One rounding, of the last division.
            numerator as f64 / 2f64.powi(3 * (level as i32 + 1))
        } else {
            (self.field(level, p) - self.field(0, p)).abs()
        }
    }
}

/// The statistics of a node, by the definitions. Evaluates the error at every half sample of the closed
/// node, more often than it can have its maximum.
pub(crate) fn stats(levels: &Levels, layout: &Layout, node: Node) -> NodeStats {
    let n = levels.dims;
    let span = layout.brick_cells() << node.level;
    let (mut support, mut owned) = (Vec::new(), Vec::new());
    for z in 0..n[2] {
        for y in 0..n[1] {
            for x in 0..n[0] {
                let (mut is_owned, mut in_support) = (true, true);
                for (a, i) in [x, y, z].into_iter().enumerate() {
                    let low = node.index[a] as usize * span;
                    let is_last = low + span >= if levels.kind == Kind::Decimated { n[a] - 1 } else { n[a] };
                    is_owned &= i >= low && (i < low + span || is_last);
                    in_support &= i <= low + span && i + usize::from(levels.kind == Kind::Averaged) >= low;
                }
                let value = levels.values[0][(z * n[1] + y) * n[0] + x];
                if is_owned {
                    owned.push(value);
                }
                if in_support {
                    support.push(value);
                }
            }
        }
    }
    let finite: Vec<f64> = owned.iter().copied().filter(|v| v.is_finite()).collect();
    let (mean, std_dev) = moments(&finite, levels.integer);
    let any_blank = support.iter().any(|v| !v.is_finite());
    support.retain(|v| v.is_finite());
    let error = if node.level == 0 || support.is_empty() {
        0.0
    } else if any_blank {
        f64::INFINITY
    } else {
        error_at(levels, layout, node, node.level)
    };
    NodeStats {
        min: support.iter().copied().fold(f64::INFINITY, f64::min),
        max: support.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        mean,
        std_dev,
        error,
        count: finite.len() as u64,
        blank: (owned.len() - finite.len()) as u64,
    }
}

/// The largest difference of the fields of the level `resolution` and the finest in a closed node.
pub(crate) fn error_at(levels: &Levels, layout: &Layout, node: Node, resolution: u32) -> f64 {
    let span = layout.brick_cells() << node.level;
    // Bounds in half samples.
    let bounds: [[usize; 2]; 3] = std::array::from_fn(|a| {
        let offset = usize::from(levels.kind == Kind::Averaged);
        let low = (2 * node.index[a] as usize * span).saturating_sub(offset);
        let high = 2 * (node.index[a] as usize + 1) * span - offset;
        [low, high.min(2 * (levels.dims[a] - 1))]
    });
    let mut error = 0.0f64;
    for z in bounds[2][0]..=bounds[2][1] {
        for y in bounds[1][0]..=bounds[1][1] {
            for x in bounds[0][0]..=bounds[0][1] {
                error = error.max(levels.difference(resolution, [x, y, z]));
            }
        }
    }
    error
}

fn moments(values: &[f64], integer: bool) -> (f64, f64) {
    if values.is_empty() {
        return (f64::NAN, f64::NAN);
    }
    let n = values.len() as f64;
    if integer {
        let sum: i128 = values.iter().map(|&v| v as i128).sum();
        // n * sum((v - mean)^2) = n * sum(v^2) - sum(v)^2, in integers; small tests do not overflow.
        let squares: i128 = values.iter().map(|&v| v as i128 * v as i128).sum();
        let numerator = values.len() as i128 * squares - sum * sum;
        (sum as f64 / n, (numerator as f64).sqrt() / n)
    } else {
        let mean = compensated_sum(values) / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        (mean, variance.sqrt())
    }
}

/// Neumaier's sum: as if in twice the precision.
fn compensated_sum(values: &[f64]) -> f64 {
    let (mut sum, mut lost) = (0.0f64, 0.0f64);
    for &v in values {
        let next = sum + v;
        lost += if sum.abs() >= v.abs() { (sum - next) + v } else { (v - next) + sum };
        sum = next;
    }
    sum + lost
}
