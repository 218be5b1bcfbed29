//! Light along a piece of a ray in which colour and extinction are smooth.
//!
//! # Method
//! On an interval, extinction is sampled at four Gauss nodes; the integral of its interpolant gives the
//! optical depth at the nodes, and Gauss quadrature there the emission `∫ c s T dt`. This is the collocation
//! method of Gauss for the transfer equation, of order 8. The interval is halved until its result and that of
//! its two halves agree within the tolerance; the halves' is taken, whose error is `2^-8` of what was found.
//!
//! # Where the estimate alone would be fooled
//! - *Optically deep*: light comes from a layer at the front that no node sees. An interval deeper than
//!   [`DEEPEST`] is therefore halved whatever the estimate, unless colour is constant over it to within the
//!   tolerance; then its light is `c (1 - T)` whatever the extinction does.
//! - *Poles*: where opacity reaches 1 at a point, extinction has a logarithmic pole. Halving grades the
//!   intervals towards it; one of length `h` holds an optical depth of order `h ln h`, so it ends.
//!
//! It ends always, and soon: in a piece the field counts from its start, so that what is rounded is a part of the
//! band's width, and intervals agree to that. After [`MAX_HALVINGS`] one is shorter than the spacing of `f64`.

use std::ops::ControlFlow;

use crate::field::{Field, Piece};
use crate::transfer::{Bands, Place};

/// Largest estimated error of one interval of a ray, in colour or transmittance.
///
/// The light added is that of the halves, which is better by two orders, or about as good where a pole of the
/// extinction is near; so a ray that meets a pole in each of 2,000 cells is still within 1e-9.
pub const PIECE_TOLERANCE: f64 = 1e-13;

/// A ray ends where less than this part of the light behind could still come through.
pub(crate) const OPAQUE: f64 = 1e-12;

/// Optical depth above which an interval is halved unless its colour is constant.
const DEEPEST: f64 = 2.0;

const MAX_HALVINGS: u32 = 56;

/// Relative variation below which a field along a ray is constant but for rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Unit distances beyond which a stretch of a ray gets no longer.
pub(crate) const LONGEST: f64 = 1e300;

const NUM_NODES: usize = 4;

/// Gauss-Legendre quadrature on [0, 1] with its collocation matrix.
struct Rule {
    nodes: [f64; NUM_NODES],
    weights: [f64; NUM_NODES],
    /// `[i][j]`: the integral from 0 to node `i` of the polynomial that is 1 at node `j` and 0 at the others.
    to_node: [[f64; NUM_NODES]; NUM_NODES],
}

/// (1 ± √(3/7 ± 2/7 √(6/5))) / 2.
const NODES: [f64; NUM_NODES] =
    [0.069_431_844_202_973_71, 0.330_009_478_207_571_87, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];

static RULE: Rule = rule();

const fn rule() -> Rule {
    let mut rule = Rule { nodes: NODES, weights: [0.0; NUM_NODES], to_node: [[0.0; NUM_NODES]; NUM_NODES] };
    let mut j = 0;
    while j < NUM_NODES {
        // Coefficients of the Lagrange polynomial of node j about the middle, by multiplying out its factors.
        let mut power = [0.0; NUM_NODES];
        power[0] = 1.0;
        let mut k = 0;
        while k < NUM_NODES {
            if k != j {
                let scale = 1.0 / (NODES[j] - NODES[k]);
                let mut d = NUM_NODES - 1;
                while d > 0 {
                    power[d] = (power[d - 1] - (NODES[k] - 0.5) * power[d]) * scale;
                    d -= 1;
                }
                power[0] *= -(NODES[k] - 0.5) * scale;
            }
            k += 1;
        }
        let mut i = 0;
        while i < NUM_NODES {
            rule.to_node[i][j] = integral_from_zero(&power, NODES[i]);
            i += 1;
        }
        rule.weights[j] = integral_from_zero(&power, 1.0);
        j += 1;
    }
    rule
}

/// The integral from 0 to `x` of the polynomial with these coefficients about 0.5.
const fn integral_from_zero(power: &[f64; NUM_NODES], x: f64) -> f64 {
    let (mut upper, mut lower) = (0.0, 0.0);
    let mut d = NUM_NODES;
    while d > 0 {
        d -= 1;
        upper = (upper + power[d] / (d + 1) as f64) * (x - 0.5);
        lower = (lower + power[d] / (d + 1) as f64) * -0.5;
    }
    upper - lower
}

/// What a ray brings to the eye: light emitted on the way, and how much of what lies behind comes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Emission that reaches the eye, linear RGB.
    pub color: [f64; 3],
    /// The part of light from behind that reaches the eye, in [0, 1].
    pub transmittance: f64,
}

impl Light {
    /// No matter at all.
    pub const CLEAR: Self = Self { color: [0.0; 3], transmittance: 1.0 };

    /// The colour seen in front of an opaque background.
    pub fn over(&self, background: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.color[i] + self.transmittance * background[i])
    }

    /// This light with `behind` behind it.
    fn then(&self, behind: &Self) -> Self {
        Self { color: self.over(behind.color), transmittance: self.transmittance * behind.transmittance }
    }

    fn difference(&self, other: &Self) -> f64 {
        let color = |i: usize| (self.color[i] - other.color[i]).abs();
        color(0).max(color(1)).max(color(2)).max((self.transmittance - other.transmittance).abs())
    }
}

/// Light of matter of one colour and optical depth.
fn homogeneous(color: [f64; 3], depth: f64) -> Light {
    let opacity = -(-depth).exp_m1();
    Light { color: color.map(|c| c * opacity), transmittance: (-depth).exp() }
}

/// Puts matter of one value, `length` unit distances of it, behind `front`.
pub(crate) fn add_constant(front: &mut Light, place: &Place, length: f64) {
    let extinction = place.extinction();
    // Opaque is opaque, however short the way: it might have been rounded to nothing.
    let depth = if extinction.is_finite() { extinction * length.min(LONGEST) } else { extinction };
    *front = front.then(&homogeneous(place.color(), depth));
}

/// How matter along a ray is integrated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Integrator<'a> {
    pub(crate) bands: &'a Bands,
    /// Largest estimated error of one interval.
    pub(crate) tolerance: f64,
    /// Whether the way may be no more than rounding, as between two faces where a ray passes an edge of cells: a value
    /// of opacity 1 is then one that it is near to, not one that it keeps.
    pub(crate) is_sliver: bool,
}

impl Integrator<'_> {
    /// Puts the matter of a field, which counts from `base`, behind `front`. Its unit interval is `length` unit
    /// distances of the transfer function long.
    pub(crate) fn add<const N: usize>(
        &self,
        front: &mut Light,
        field: &impl Field<N>,
        base: f64,
        length: f64,
    ) {
        // Far more unit distances than any picture can tell apart, yet safe to multiply.
        let length = length.min(LONGEST);
        let [low, high] = field.range();
        if high - low <= ROUNDING * low.abs().max(high.abs()) {
            let place = self.bands.at(low, base);
            if self.is_sliver {
                let (color, extinction) = place.classify();
                *front = front.then(&homogeneous(color, extinction * length));
            } else {
                add_constant(front, &place, length);
            }
            return;
        }
        let _ = field.pieces(self.bands, base, |piece| {
            self.add_piece(front, &piece, length);
            if front.transmittance > OPAQUE { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
    }

    fn add_piece<const N: usize>(&self, front: &mut Light, piece: &Piece<N>, length: f64) {
        let (start, length) = (&piece.start, length * piece.width);
        if start.band.is_clear() || piece.width <= 0.0 {
            return;
        }
        if start.band.is_opaque() {
            *front = front.then(&Light { color: start.color(), transmittance: 0.0 });
        } else if start.band.is_uniform() {
            add_constant(front, start, length);
        } else {
            let part = Part { piece, length, tolerance: self.tolerance };
            part.refine(front, &part.interval(0.0, 1.0), 0);
        }
    }
}

/// A piece and how long it is, in unit distances of the transfer function.
struct Part<'a, const N: usize> {
    piece: &'a Piece<'a, N>,
    length: f64,
    tolerance: f64,
}

/// An interval of a piece, and what one application of the rule says of it.
#[derive(Clone, Copy)]
struct Interval {
    start: f64,
    width: f64,
    depth: f64,
    light: Light,
}

impl<const N: usize> Part<'_, N> {
    fn at(&self, t: f64) -> Place<'_> {
        self.piece.start.up(self.piece.rise.at(t))
    }

    fn refine(&self, front: &mut Light, whole: &Interval, halvings: u32) {
        let half = whole.width / 2.0;
        let first = self.interval(whole.start, half);
        let second = self.interval(whole.start + half, half);
        let halves = first.light.then(&second.light);
        let error = whole.light.difference(&halves) * front.transmittance;
        let shallow = whole.depth.max(first.depth + second.depth) <= DEEPEST;
        let color_change = self.piece.start.band.color_slope() * self.piece.rise.max_slope() * whole.width;
        let flat = color_change <= self.tolerance;
        if halvings == MAX_HALVINGS || (error <= self.tolerance && (shallow || flat)) {
            let light = if shallow {
                halves
            } else {
                homogeneous(self.at(whole.start + half).color(), first.depth + second.depth)
            };
            *front = front.then(&light);
            return;
        }
        self.refine(front, &first, halvings + 1);
        if front.transmittance > OPAQUE {
            self.refine(front, &second, halvings + 1);
        }
    }

    fn interval(&self, start: f64, width: f64) -> Interval {
        #[cfg(test)]
        NUM_INTERVALS.with(|count| count.set(count.get() + 1));
        let mut colors = [[0.0; 3]; NUM_NODES];
        let mut depths = [0.0; NUM_NODES];
        for i in 0..NUM_NODES {
            let (color, extinction) = self.at(start + width * RULE.nodes[i]).classify();
            colors[i] = color;
            depths[i] = extinction * self.length * width;
        }
        let dot = |row: &[f64; NUM_NODES]| (0..NUM_NODES).map(|j| row[j] * depths[j]).sum::<f64>();
        let mut color = [0.0; 3];
        for i in 0..NUM_NODES {
            // The interpolant of a steep extinction may dip below zero; such an interval is halved anyway.
            let in_front = dot(&RULE.to_node[i]).max(0.0);
            let emission = RULE.weights[i] * depths[i] * (-in_front).exp();
            for channel in 0..3 {
                color[channel] += emission * colors[i][channel];
            }
        }
        let depth = dot(&RULE.weights);
        Interval { start, width, depth, light: Light { color, transmittance: (-depth).exp() } }
    }
}

#[cfg(test)]
thread_local! {
    /// Intervals that this thread has integrated: the work done.
    pub(crate) static NUM_INTERVALS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cubic::Cubic;
    use volery_scene::{ControlPoint, TransferFunction};

    #[test]
    fn the_rule_is_that_of_gauss() {
        let inner = (3.0f64 / 7.0 - 2.0 / 7.0 * 1.2f64.sqrt()).sqrt() / 2.0;
        let outer = (3.0f64 / 7.0 + 2.0 / 7.0 * 1.2f64.sqrt()).sqrt() / 2.0;
        for (found, expected) in NODES.iter().zip([0.5 - outer, 0.5 - inner, 0.5 + inner, 0.5 + outer]) {
            assert!((found - expected).abs() < 2e-16, "{found} {expected}");
        }
        for power in 0..8 {
            let integral: f64 = (0..4).map(|i| RULE.weights[i] * NODES[i].powi(power)).sum();
            assert!((integral - 1.0 / f64::from(power + 1)).abs() < 4e-16, "degree {power}: {integral}");
        }
        for (node, row) in NODES.iter().zip(RULE.to_node) {
            for power in 0..4 {
                let integral: f64 = (0..4).map(|j| row[j] * NODES[j].powi(power)).sum();
                let expected = node.powi(power + 1) / f64::from(power + 1);
                assert!((integral - expected).abs() < 4e-16, "node {node}, degree {power}");
            }
        }
    }

    /// Field 0 to 1 over a cell, opacity `low` to `high` over the same values, white.
    fn white(low: f64, high: f64, length: f64) -> Light {
        let points = [(0.0, low), (1.0, high)].map(|(value, opacity)| ControlPoint {
            value,
            color: [1.0; 3],
            opacity,
        });
        let bands = Bands::new(&TransferFunction::new(points.to_vec(), 1.0).unwrap());
        let field = Cubic::new([0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]);
        let mut light = Light::CLEAR;
        Integrator { bands: &bands, tolerance: PIECE_TOLERANCE, is_sliver: false }
            .add(&mut light, &field, 0.0, length);
        light
    }

    /// `∫ -ln(1 - a) da` from `low` to `high`.
    fn log_integral(low: f64, high: f64) -> f64 {
        let primitive = |clear: f64| if clear == 0.0 { 0.0 } else { clear * clear.ln() - clear };
        primitive(1.0 - high) - primitive(1.0 - low)
    }

    #[test]
    fn optical_depth_is_exact_up_to_and_at_the_pole() {
        for (low, high) in [(0.0, 0.5), (0.3, 0.1), (0.0, 1.0), (1.0, 0.0), (0.9, 1.0), (0.0, 1.0 - 1e-9)] {
            for length in [1e-3, 1.0, 10.0] {
                let depth = log_integral(low, high) / (high - low) * length;
                let light = white(low, high, length);
                let error = (light.transmittance - (-depth).exp()).abs();
                assert!(error < 1e-11, "{low}..{high} x {length}: {error:e}");
                // White matter in front of white is white.
                assert!((light.over([1.0; 3])[0] - 1.0).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn tiny_opacities_keep_their_digits() {
        let light = white(0.0, 1e-30, 1.0);
        assert!((light.color[0] / 0.5e-30 - 1.0).abs() < 1e-14, "{:e}", light.color[0]);
    }

    /// What one colour and opacity, or one colour and great depth, have as a closed form takes no halving.
    #[test]
    fn uniform_and_deep_matter_take_few_intervals() {
        let intervals = |low: f64, high: f64, length: f64| {
            NUM_INTERVALS.set(0);
            let light = white(low, high, length);
            assert!((light.over([1.0; 3])[0] - 1.0).abs() < 1e-11);
            NUM_INTERVALS.get()
        };
        assert_eq!(intervals(0.4, 0.4, 3.0), 0);
        assert_eq!(intervals(0.1, 0.3, 1e12), 3);
    }
}
