//! Oracles in f64 that share no code with the crate: chords from plane hits, projected hulls, pixel coverage.

#![allow(dead_code, reason = "each test file uses a part of it")]

use std::fmt::Debug;

use volery_cubefan::{Cuboid, Fans, Real, Relative, Vertex};

pub(crate) type Point = [f64; 3];

pub(crate) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn scale(a: Point, by: f64) -> Point {
    a.map(|part| part * by)
}

pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// A fixed sequence of numbers.
pub(crate) struct Sequence(u64);

impl Sequence {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 32) * limit) >> 32
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.below(1 << 31) as f64 + 0.5) / (1_u64 << 31) as f64
    }

    pub(crate) fn point(&mut self, low: f64, high: f64) -> Point {
        [(); 3].map(|()| self.between(low, high))
    }

    /// Positive numbers that sum to 1.
    pub(crate) fn weights(&mut self) -> Point {
        let weights = self.point(0.0, 1.0);
        scale(weights, 1.0 / weights.iter().sum::<f64>())
    }
}

/// A number as f64, whatever it is.
pub(crate) trait Wide: Real + Debug {
    fn wide(self) -> f64;
}

impl Wide for f32 {
    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Wide for f64 {
    fn wide(self) -> f64 {
        self
    }
}

pub(crate) fn wide<F: Wide>(point: [F; 3]) -> Point {
    point.map(Wide::wide)
}

pub(crate) fn wide_box<F: Wide>(relative: &Relative<F>) -> Relative<f64> {
    Relative { low: wide(relative.low), high: wide(relative.high), size: wide(relative.size) }
}

pub(crate) fn corners(low: Point, high: Point) -> [Point; 8] {
    std::array::from_fn(|number| {
        std::array::from_fn(|axis| if number >> axis & 1 == 1 { high[axis] } else { low[axis] })
    })
}

/// The longest distance between hits of the line through the origin and `toward` with the planes of the closed
/// box, at distances of at least 0. `slack` widens the box.
pub(crate) fn closed_chord(toward: Point, low: Point, high: Point, slack: f64) -> f64 {
    let mut hits = Vec::new();
    let is_inside = |point: Point, but: usize| {
        (0..3).all(|axis| {
            axis == but || (low[axis] - slack <= point[axis] && point[axis] <= high[axis] + slack)
        })
    };
    if is_inside([0.0; 3], 3) {
        hits.push(0.0);
    }
    for axis in 0..3 {
        for plane in [low[axis], high[axis]] {
            let t = plane / toward[axis];
            if t.is_finite() && t >= 0.0 && is_inside(scale(toward, t), axis) {
                hits.push(t);
            }
        }
    }
    let least = hits.iter().copied().fold(f64::INFINITY, f64::min);
    let most = hits.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if hits.is_empty() { 0.0 } else { (most - least) * norm(toward) }
}

/// A picture plane: right, up and forward, with everything seen from the origin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screen {
    pub(crate) axes: [Point; 3],
    pub(crate) is_parallel: bool,
}

impl Screen {
    pub(crate) fn looking(forward: Point, is_parallel: bool) -> Self {
        let forward = scale(forward, 1.0 / norm(forward));
        let other = if forward[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [0.0, 1.0, 0.0] };
        let right = cross(forward, other);
        let right = scale(right, 1.0 / norm(right));
        Self { axes: [right, cross(right, forward), forward], is_parallel }
    }

    /// A screen before which all of a box is that the origin is not in: it faces the nearest point.
    pub(crate) fn before(low: Point, high: Point) -> Self {
        Self::looking(std::array::from_fn(|axis| 0.0_f64.clamp(low[axis], high[axis])), false)
    }

    pub(crate) fn depth(&self, point: Point) -> f64 {
        if self.is_parallel { 1.0 } else { dot(self.axes[2], point) }
    }

    pub(crate) fn project(&self, point: Point) -> [f64; 2] {
        let depth = self.depth(point);
        [dot(self.axes[0], point) / depth, dot(self.axes[1], point) / depth]
    }
}

/// Twice the signed area, above 0 for counter-clockwise.
pub(crate) fn turn([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The convex hull, counter-clockwise.
pub(crate) fn hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.partial_cmp(b).expect("finite points"));
    sorted.dedup();
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while chain.len() > 1 && turn([chain[chain.len() - 2], chain[chain.len() - 1], point]) <= 0.0 {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Twice the area of a polygon.
pub(crate) fn doubled_area(polygon: &[[f64; 2]]) -> f64 {
    let origin = polygon.first().copied().unwrap_or_default();
    polygon.windows(2).map(|pair| turn([origin, pair[0], pair[1]])).sum()
}

/// The triangles of fans with their vertices.
pub(crate) fn triangles<F: Wide>(fans: &Fans<F>) -> Vec<[Vertex<F>; 3]> {
    let vertices = fans.vertices();
    fans.triangles().iter().map(|places| places.map(|place| vertices[usize::from(place)])).collect()
}

/// The largest defects of a cover: relative difference of the sum of areas from the hull's, and of the most
/// negative area.
pub(crate) fn cover_defect<F: Wide>(fans: &Fans<F>, screen: &Screen, corners: &[Point; 8]) -> (f64, f64) {
    let expected = doubled_area(&hull(&corners.map(|corner| screen.project(corner))));
    let areas: Vec<f64> = triangles(fans)
        .iter()
        .map(|triangle| turn(triangle.map(|vertex| screen.project(wide(vertex.point)))))
        .collect();
    let sum: f64 = areas.iter().sum();
    if expected == 0.0 {
        return (sum.abs(), 0.0);
    }
    let most_negative = areas.iter().copied().fold(0.0, f64::min);
    ((sum / expected - 1.0).abs(), -most_negative / expected)
}

/// Whether the centre of a pixel is inside a counter-clockwise triangle (y up), with the top-left rule on edges.
/// An edge gives the same number, with the sign changed, in both of its triangles.
pub(crate) fn is_covered(triangle: [[f64; 2]; 3], at: [f64; 2]) -> bool {
    (0..3).all(|place| {
        let (a, b) = (triangle[place], triangle[(place + 1) % 3]);
        let side = if a < b { turn([a, b, at]) } else { -turn([b, a, at]) };
        let is_top_left = b[1] < a[1] || (b[1] == a[1] && b[0] < a[0]);
        side > 0.0 || (side == 0.0 && is_top_left)
    })
}

/// Weights of the vertices of a triangle at a point of the picture; linear on the picture.
pub(crate) fn weights(triangle: [[f64; 2]; 3], at: [f64; 2]) -> Point {
    let whole = turn(triangle);
    let [a, b, c] = triangle;
    [turn([at, b, c]) / whole, turn([a, at, c]) / whole, turn([a, b, at]) / whole]
}

/// A neighbour of a number: `ulps` representable numbers away.
pub(crate) fn beside(number: f32, ulps: i32) -> f32 {
    (0..ulps.abs()).fold(number, |number, _| if ulps > 0 { number.next_up() } else { number.next_down() })
}

/// The same for f64.
pub(crate) fn beside_f64(number: f64, ulps: i32) -> f64 {
    (0..ulps.abs()).fold(number, |number, _| if ulps > 0 { number.next_up() } else { number.next_down() })
}

pub(crate) fn cuboid(low: Point, high: Point) -> Cuboid<f64> {
    Cuboid { low, high }
}
