//! What a cut shows, in f64 from its bricks: the definition, slowly.

use glam::DVec3;
use volery_octree::section::{local_position, ratio};
use volery_octree::{Cut, balance, low_corners};
use volery_pyramid::{Brick, Kind, Layout, Node, NodeSource, Pyramid};
use volery_scene::{Samples, VoxelGrid};

use crate::world::Noise;

/// A decimated pyramid over samples without any order.
pub(crate) fn pyramid(dims: [usize; 3], brick_cells: usize, samples: impl Into<Samples>) -> Pyramid {
    let grid = VoxelGrid::new(dims, DVec3::new(1.0, 1.0, 10.0), samples).expect("a valid grid");
    Pyramid::build(&grid, Kind::Decimated, brick_cells).expect("a valid layout")
}

pub(crate) fn noise_floats(dims: [usize; 3], noise: &mut Noise) -> Vec<f32> {
    (0..dims.iter().product()).map(|_| noise.unit() as f32).collect()
}

/// The samples of a node, or every second of them, and where they stand.
struct Samples3<'a> {
    brick: &'a Brick,
    /// 1 for all of them, 2 for every second.
    stride: usize,
}

impl Samples3<'_> {
    fn count(&self, axis: usize) -> usize {
        (self.brick.shape.count[axis] - 1).div_ceil(self.stride) + 1
    }

    fn sample(&self, place: [usize; 3], channel: usize) -> f64 {
        let count = self.brick.shape.count;
        let at = std::array::from_fn(|a| (place[a] * self.stride).min(count[a] - 1));
        self.brick.samples.value(self.brick.shape.index(at), channel)
    }

    /// Trilinear at a place in cells of the node's level from its low corner.
    fn trilinear(&self, place: DVec3, channel: usize) -> f64 {
        let mut first = [0; 3];
        let mut weight = [0.0; 3];
        for axis in 0..3 {
            let at = place[axis] / self.stride as f64;
            first[axis] = (at.floor() as usize).min(self.count(axis).saturating_sub(2));
            weight[axis] = at - first[axis] as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let bits = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let share: f64 = (0..3).map(|a| if bits[a] == 1 { weight[a] } else { 1.0 - weight[a] }).product();
            // A sample without weight may not be there: the axis of a single one.
            if share != 0.0 {
                sum += share * self.sample(std::array::from_fn(|a| first[a] + bits[a]), channel);
            }
        }
        sum
    }
}

/// A cut with all it needs to be looked at.
pub(crate) struct Field<'a> {
    pub(crate) source: &'a Pyramid,
    pub(crate) cut: Cut,
    pub(crate) low_corners: Vec<u8>,
    bricks: Vec<Brick>,
    bounds: Vec<[DVec3; 2]>,
}

impl<'a> Field<'a> {
    pub(crate) fn new(source: &'a Pyramid, cut: Cut, low_corners: Vec<u8>) -> Self {
        let read = |&node: &Node| read(source, node);
        let bricks = cut.nodes.iter().map(read).collect();
        let bounds = cut.nodes.iter().map(|&node| source.layout().bounds(node)).collect();
        Self { source, cut, low_corners, bricks, bounds }
    }

    /// Of a cut that is balanced first.
    pub(crate) fn balanced(source: &'a Pyramid, cut: &Cut) -> Self {
        let cut = balance(source.layout(), cut);
        let low_corners = low_corners(source.layout(), &cut);
        Self::new(source, cut, low_corners)
    }

    pub(crate) fn layout(&self) -> &Layout {
        self.source.layout()
    }

    /// What the drawn node `place` shows at a point in finest-sample coordinates.
    pub(crate) fn value(&self, place: usize, point: DVec3, channel: usize) -> f64 {
        let (node, brick) = (self.cut.nodes[place], &self.bricks[place]);
        let local = local_position(self.layout(), node, point);
        let cells = local * self.layout().brick_cells() as f64;
        let r = ratio(self.low_corners[place], local);
        let high = Samples3 { brick, stride: 1 }.trilinear(cells, channel);
        if r == 0.0 {
            return high;
        }
        (1.0 - r) * high + r * Samples3 { brick, stride: 2 }.trilinear(cells, channel)
    }

    /// The drawn nodes whose closed boxes hold a point.
    pub(crate) fn touching(&self, point: DVec3) -> impl Iterator<Item = usize> {
        let holds = move |[low, high]: [DVec3; 2]| point.cmpge(low).all() && point.cmple(high).all();
        (0..self.bounds.len()).filter(move |&place| holds(self.bounds[place]))
    }
}

pub(crate) fn read(source: &Pyramid, node: Node) -> Brick {
    let mut brick = Brick::empty(source.sample_type());
    source.read_brick(node, &mut brick).expect("in memory");
    brick
}

/// Low samples of a node, in the order of a brick.
pub(crate) fn low_samples(brick: &Brick, channel: usize) -> ([usize; 3], Vec<f64>) {
    let low = Samples3 { brick, stride: 2 };
    let [nx, ny, nz] = [0, 1, 2].map(|axis| low.count(axis));
    let places = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
    ([nx, ny, nz], places.map(|place| low.sample(place, channel)).collect())
}
