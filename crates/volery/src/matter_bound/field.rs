//! The field that a cut shows, cell by cell, and how far it is from the exact one.
//!
//! Both fields are trilinear, on nested cells: in a drawn cell they differ most at a finest sample in it. So the difference
//! is known exactly, with its sign, seams included, from the finest samples of the nodes that are drawn.

use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;
use volery_frame::{JoinedBrick, TexelType};
use volery_pyramid::{Brick, BrickShape, Node as NodeName, NodeSource, ReadError};
use volery_scene::TransferFunction;

use crate::residency::Store;

/// Values relative to the store's offset, as far from 0 as `f32` can be taken.
const FARTHEST: f64 = 1e30;

/// A drawn node.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) level: u32,
    /// Finest cell at its lower corner.
    pub(super) first_cell: [i64; 3],
    /// Samples along x, y, z, x fastest; those at seams are what is drawn there.
    count: [usize; 3],
    samples: Vec<f32>,
    seams: u32,
    /// Of each cell, x fastest, how far the exact field is from the drawn one: least and largest difference. None where
    /// they are the same.
    errors: Vec<[f32; 2]>,
    /// Whether there is nothing to be seen in it, in the drawn field as in the exact one.
    pub(super) is_clear: bool,
}

/// Nodes that were read, by name and seams: most serve again when a cut changes in part.
pub(super) type Known = HashMap<(NodeName, u32), Arc<Node>>;

/// All drawn nodes.
#[derive(Debug)]
pub(super) struct Field {
    /// Finest cells along x, y, z.
    pub(super) cells: [i64; 3],
    /// World size of a finest cell.
    pub(super) spacing: [f64; 3],
    /// Finest cells of a finest brick along an axis: 2 to this.
    pub(super) log_brick: u32,
    bricks: [usize; 3],
    /// Of each finest brick, the node that shows it, and one more.
    owners: Vec<u32>,
    nodes: Vec<Arc<Node>>,
    /// How far texels may be from samples, relative to their distance from the store's offset.
    rounding: f64,
}

/// A cell that a ray goes through.
pub(super) struct Cell {
    /// Values at its corners, x fastest.
    pub(super) corners: [f64; 8],
    /// Least and largest difference of the exact field from the drawn one in it: not above 0, and not below.
    pub(super) error: [f64; 2],
    /// What both may be off by where texels are rounded otherwise than here.
    pub(super) margin: f64,
}

impl Field {
    pub(super) fn new(
        (source, store): (&dyn NodeSource, &Store),
        (names, bricks): (&[NodeName], &[JoinedBrick]),
        transfer: &TransferFunction,
        known: &mut Known,
    ) -> Result<Self, ReadError> {
        let layout = &store.layout;
        let per_brick = i64::from(layout.brick_cells);
        let cells = layout.cells.map(i64::from);
        let num = cells.map(|cells| (cells.div_euclid(per_brick) + 1) as usize);
        let mut owners = vec![0_u32; num.iter().product()];
        for (owner, joined) in (1..).zip(bricks) {
            let size = 1_i64 << joined.placed.level;
            let range = |axis: usize| {
                let first = i64::from(joined.placed.first_cell[axis]) / per_brick;
                first as usize..((first + size) as usize).min(num[axis])
            };
            for (z, y) in range(2).flat_map(|z| range(1).map(move |y| (z, y))) {
                let row = (z * num[1] + y) * num[0];
                owners[row..][range(0)].fill(owner);
            }
        }
        let node = |(&node, joined): (&NodeName, &JoinedBrick)| {
            if let Some(known) = known.get(&(node, joined.seams)) {
                return Ok(known.clone());
            }
            let stats = source.stats(node)[0];
            let is_clear = joined.seams == 0 && transfer.is_transparent(stats.min, stats.max);
            Node::read((source, store), (node, joined), is_clear).map(Arc::new)
        };
        let nodes = names.par_iter().zip(bricks).map(node).collect::<Result<Vec<_>, ReadError>>()?;
        let keys = names.iter().zip(bricks).map(|(&name, brick)| (name, brick.seams));
        *known = keys.zip(nodes.iter().cloned()).collect();
        let rounding = if layout.texel == TexelType::F32 { f64::from(f32::EPSILON) } else { 0.0 };
        let spacing = layout.spacing.to_array();
        let log_brick = layout.brick_cells.ilog2();
        Ok(Self { cells, spacing, log_brick, bricks: num, owners, nodes, rounding })
    }

    /// The node that shows a finest cell.
    pub(super) fn node(&self, cell: [i64; 3]) -> Option<&Node> {
        self.place(cell).map(|place| &*self.nodes[place])
    }

    /// The cell of one of the nodes that holds a finest cell; none where there is no matter in it.
    pub(super) fn cell(&self, node: &Node, finest: [i64; 3]) -> Option<Cell> {
        let (corners, error) = node.cell(finest)?;
        let farthest = corners.iter().chain(&error).fold(0.0_f64, |most, value| most.max(value.abs()));
        // Where there may be anything a margin says nothing; of whole numbers it is what f64 may be off by.
        let margin = if farthest.is_finite() { self.rounding.max(1e-12) * farthest } else { 0.0 };
        Some(Cell { corners, error, margin })
    }

    /// The place among all of the node that shows a finest cell.
    pub(super) fn place(&self, cell: [i64; 3]) -> Option<usize> {
        let [x, y, z] = cell.map(|cell| (cell >> self.log_brick) as usize);
        let owner = self.owners[(z * self.bricks[1] + y) * self.bricks[0] + x];
        (owner as usize).checked_sub(1)
    }

    /// Calls with the places of the nodes that make the field of a node coarse: itself, and those that it joins.
    pub(super) fn each_cause(&self, place: usize, mut visit: impl FnMut(usize)) {
        let node = &self.nodes[place];
        if node.level > 0 {
            visit(place);
        }
        if node.seams == 0 {
            return;
        }
        let per_brick = 1_i64 << self.log_brick;
        let size = per_brick << node.level;
        // A finest cell just beyond each face and edge.
        for bit in (0..27_u32).filter(|bit| node.seams >> bit & 1 == 1) {
            let cell: [i64; 3] = std::array::from_fn(|axis| {
                let first = node.first_cell[axis];
                [first - 1, first, first + size][(bit / 3_u32.pow(axis as u32) % 3) as usize]
            });
            let is_inside = (0..3).all(|axis| (0..self.cells[axis]).contains(&cell[axis]));
            let beside = is_inside.then(|| self.place(cell)).flatten();
            if let Some(beside) = beside.filter(|&beside| self.nodes[beside].level > node.level) {
                visit(beside);
            }
        }
    }
}

/// The values of a node, relative to the store's offset; NaN where it is blank.
fn values(
    (source, store): (&dyn NodeSource, &Store),
    node: NodeName,
) -> Result<(Brick, Vec<f32>), ReadError> {
    let mut brick = Brick::empty(source.sample_type());
    source.read_brick(node, &mut brick)?;
    let value = |place: usize| {
        let value = brick.samples.value(place, 0);
        let value = (value - store.layout.value_offset).clamp(-FARTHEST, FARTHEST);
        if brick.samples.value(place, 0).is_finite() { value as f32 } else { f32::NAN }
    };
    let values = (0..brick.samples.len()).map(value).collect();
    Ok((brick, values))
}

impl Node {
    fn read(
        store: (&dyn NodeSource, &Store),
        (name, joined): (NodeName, &JoinedBrick),
        is_clear: bool,
    ) -> Result<Self, ReadError> {
        let mut node = Self {
            level: joined.placed.level,
            first_cell: joined.placed.first_cell.map(i64::from),
            count: [0; 3],
            samples: Vec::new(),
            seams: joined.seams,
            errors: Vec::new(),
            is_clear,
        };
        if is_clear {
            return Ok(node);
        }
        let (brick, values) = values(store, name)?;
        (node.count, node.samples) = (brick.shape.count, values);
        join(&mut node.samples, &brick.shape, (joined.seams, store.1.layout.brick_cells as usize));
        if node.level > 0 || joined.seams != 0 {
            node.compare(store, name)?;
        }
        Ok(node)
    }

    /// Finds how far the exact field is from this node's.
    fn compare(&mut self, store: (&dyn NodeSource, &Store), name: NodeName) -> Result<(), ReadError> {
        let num_cells = self.count.map(|count| count.saturating_sub(1));
        self.errors = vec![[0.0; 2]; num_cells.iter().product()];
        let level = self.level;
        let (layout, per_brick) = (store.0.layout(), i64::from(store.1.layout.brick_cells));
        let finest = layout.nodes(0);
        let range =
            |axis: usize| name.index[axis] << level..((name.index[axis] + 1) << level).min(finest[axis]);
        let all: Vec<[u32; 3]> =
            range(2).flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z]))).collect();
        let found = all.into_par_iter().map(|index| {
            let (brick, values) = values(store, NodeName { level: 0, index })?;
            // From the node's first sample to the brick's, in finest cells.
            let first: [usize; 3] = std::array::from_fn(|axis| {
                (i64::from(index[axis]) * per_brick - self.first_cell[axis]) as usize
            });
            Ok(self.compare_brick(&brick.shape, &values, first))
        });
        for ([low, high], errors) in found.collect::<Result<Vec<_>, ReadError>>()? {
            let mut errors = errors.into_iter();
            for (z, y) in (low[2]..high[2]).flat_map(|z| (low[1]..high[1]).map(move |y| (z, y))) {
                let row = (z * num_cells[1] + y) * num_cells[0];
                for (known, error) in self.errors[row + low[0]..row + high[0]].iter_mut().zip(&mut errors) {
                    *known = [known[0].min(error[0]), known[1].max(error[1])];
                }
            }
        }
        Ok(())
    }

    /// How far the exact field is from this node's in the cells that a finest brick is in or at: those cells, and the least
    /// and largest difference in each.
    fn compare_brick(
        &self,
        shape: &BrickShape,
        values: &[f32],
        first: [usize; 3],
    ) -> ([[usize; 3]; 2], Vec<[f32; 2]>) {
        let size = 1_usize << self.level;
        let last = |axis: usize| first[axis] + shape.count[axis] - 1;
        let most = |axis: usize| self.count[axis].saturating_sub(2);
        // A sample on a face is in the cells on both sides of it.
        let low: [usize; 3] =
            std::array::from_fn(|axis| (first[axis].saturating_sub(1) / size).min(most(axis)));
        let high: [usize; 3] = std::array::from_fn(|axis| (last(axis) / size).min(most(axis)) + 1);
        let cells = (low[2]..high[2])
            .flat_map(|z| (low[1]..high[1]).flat_map(move |y| (low[0]..high[0]).map(move |x| [x, y, z])));
        let errors = cells.map(|cell| {
            let corners = self.corners(cell);
            let range = |axis: usize| {
                let begin = cell[axis] * size;
                begin.max(first[axis])..=(begin + size).min(last(axis))
            };
            let value = |[x, y, z]: [usize; 3]| {
                values[((z - first[2]) * shape.count[1] + y - first[1]) * shape.count[0] + x - first[0]]
            };
            if corners.iter().any(|corner| corner.is_nan()) {
                // Nothing is drawn: is there anything?
                let steps = |axis: usize| range(axis).zip(range(axis).skip(1));
                let mut finest =
                    steps(2).flat_map(|z| steps(1).flat_map(move |y| steps(0).map(move |x| [x, y, z])));
                let is_there = finest.any(|ends| {
                    let at = |axis: usize, corner: usize| [ends[axis].0, ends[axis].1][corner >> axis & 1];
                    (0..8).all(|corner| !value([0, 1, 2].map(|axis| at(axis, corner))).is_nan())
                });
                return if is_there { [f32::NEG_INFINITY, f32::INFINITY] } else { [0.0; 2] };
            }
            let share = |axis: usize, place: usize| (place - cell[axis] * size) as f64 / size as f64;
            let mut error = [0.0_f32; 2];
            for (z, y) in range(2).flat_map(|z| range(1).map(move |y| (z, y))) {
                let ends = [0.0, 1.0].map(|x| trilinear(&corners, [x, share(1, y), share(2, z)]));
                for x in range(0) {
                    let drawn = mix(ends[0], ends[1], share(0, x));
                    let [low, high] = difference(f64::from(value([x, y, z])), drawn);
                    error = [error[0].min(low), error[1].max(high)];
                }
            }
            error
        });
        let errors = errors.collect();
        ([low, high], errors)
    }

    /// The values at the corners of a cell.
    fn corners(&self, [x, y, z]: [usize; 3]) -> [f64; 8] {
        let [nx, ny, _] = self.count;
        std::array::from_fn(|corner| {
            let [i, j, k] = [x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)];
            self.samples.get((k * ny + j) * nx + i).map_or(f64::NAN, |&value| f64::from(value))
        })
    }

    /// The cell of the node that holds a finest cell; none where there is no matter in it.
    fn cell(&self, finest: [i64; 3]) -> Option<([f64; 8], [f64; 2])> {
        let [x, y, z] =
            std::array::from_fn(|axis| ((finest[axis] - self.first_cell[axis]) >> self.level) as usize);
        let corners = self.corners([x, y, z]);
        let place = (z * (self.count[1] - 1) + y) * (self.count[0] - 1) + x;
        let error = self.errors.get(place).map_or([0.0; 2], |error| error.map(f64::from));
        if corners.iter().any(|value| value.is_nan()) {
            // Nothing is drawn; there may be anything.
            return error[1].is_infinite().then_some(([0.0; 8], error));
        }
        Some((corners, error))
    }
}

/// Least and largest difference of the exact value from one that is drawn.
fn difference(exact: f64, drawn: f64) -> [f32; 2] {
    let difference = exact - drawn;
    if difference.is_nan() {
        // Matter where there is none.
        return [f32::NEG_INFINITY, f32::INFINITY];
    }
    if difference == 0.0 {
        return [0.0; 2];
    }
    [(difference.min(0.0) as f32).next_down(), (difference.max(0.0) as f32).next_up()]
}

fn mix(a: f64, b: f64, share: f64) -> f64 {
    (1.0 - share) * a + share * b
}

/// A field between the corners of a cell.
pub(super) fn trilinear(corners: &[f64; 8], [x, y, z]: [f64; 3]) -> f64 {
    let along = |first: usize| mix(corners[first], corners[first + 1], x);
    mix(mix(along(0), along(2), y), mix(along(4), along(6), y), z)
}

/// Gives samples at seams the values of the coarser neighbour: see [`JoinedBrick::seams`].
fn join(samples: &mut [f32], shape: &BrickShape, (seams, brick_cells): (u32, usize)) {
    let own = samples.to_vec();
    for bit in (0..27_u32).filter(|bit| seams >> bit & 1 == 1) {
        let sides: [u32; 3] = std::array::from_fn(|axis| bit / 3_u32.pow(axis as u32) % 3);
        // Corners are samples of all levels; a brick that the domain cuts off has no upper side there.
        let is_there = |axis: usize| sides[axis] != 2 || shape.count[axis] == brick_cells + 1;
        if !sides.contains(&1) || !(0..3).all(is_there) {
            continue;
        }
        let range = |axis: usize| match sides[axis] {
            0 => 0..1,
            1 => 0..shape.count[axis],
            _ => shape.count[axis] - 1..shape.count[axis],
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let ends: [[usize; 2]; 3] = std::array::from_fn(|axis| {
                        let place = [x, y, z][axis];
                        let last = shape.count[axis] - 1;
                        let is_between = sides[axis] == 1 && place % 2 == 1;
                        if is_between { [place - 1, (place + 1).min(last)] } else { [place; 2] }
                    });
                    let mean: f64 = (0..8)
                        .map(|corner| {
                            let at = [0, 1, 2].map(|axis| ends[axis][corner >> axis & 1]);
                            f64::from(own[shape.index(at)])
                        })
                        .sum();
                    samples[shape.index([x, y, z])] = (mean / 8.0) as f32;
                }
            }
        }
    }
}
