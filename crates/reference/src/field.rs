//! What a field along a ray has to offer to be integrated.

/// A smooth field on the unit interval.
pub(crate) trait Field {
    /// Its value.
    fn at(&self, t: f64) -> f64;

    /// Its derivative.
    fn slope_at(&self, t: f64) -> f64;

    /// A range that holds every value.
    fn range(&self) -> [f64; 2];

    /// At least the steepest slope.
    fn max_slope(&self) -> f64;

    /// Calls `found(t)` in order for every place in (0, 1) where the slope changes its sign.
    fn turns(&self, found: impl FnMut(f64));

    /// Calls `found(t)` for every place in (0, 1) where the field turns or crosses one of `edges(low, high)`,
    /// the interesting values strictly between two values; in no particular order.
    fn splits<'e>(&self, edges: impl Fn(f64, f64) -> &'e [f64], mut found: impl FnMut(f64)) {
        let mut section = |from: f64, to: f64| {
            let (a, b) = (self.at(from), self.at(to));
            for &value in edges(a.min(b), a.max(b)) {
                found(crossing(|t| self.at(t) - value, |t| self.slope_at(t), from, to));
            }
            if to < 1.0 {
                found(to);
            }
        };
        let mut from = 0.0;
        self.turns(|turn| {
            section(from, turn);
            from = turn;
        });
        section(from, 1.0);
    }
}

/// Where a function, monotone from `from` to `to` and of unlike signs there, is zero: Newton's method kept inside a
/// shrinking bracket, to the last bits of `t`.
pub(crate) fn crossing(at: impl Fn(f64) -> f64, slope_at: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let (mut below, mut above) = if at(from) < 0.0 { (from, to) } else { (to, from) };
    let mut t = (from + to) / 2.0;
    // A bisection ends within 60 steps; Newton's steps, where taken, at least do not widen the bracket.
    for _ in 0..120 {
        let residual = at(t);
        if residual == 0.0 {
            break;
        }
        if residual < 0.0 {
            below = t;
        } else {
            above = t;
        }
        let (low, high) = (below.min(above), below.max(above));
        let newton = t - residual / slope_at(t);
        let next = if newton > low && newton < high { newton } else { low + (high - low) / 2.0 };
        if (next - t).abs() <= f64::EPSILON * next.abs() {
            break;
        }
        t = next;
    }
    t
}
