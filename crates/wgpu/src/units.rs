//! The grid of units over the volume: for each, the brick that is there, or how far around it is empty.
//!
//! # Method
//! Units are as large as the blocks of the finest level in the frame (larger where there would be too many).
//! Each unit with matter under the transfer function holds its brick's slot and level; each other one its
//! chessboard distance to the nearest unit with matter, so that a ray can leave the whole empty cube around
//! it in one step (Deakin and Knoll 2019). The distance is made by two sweeps with the 26 neighbours, exact
//! for this metric.

use std::collections::HashMap;

use volery_frame::ray_transfer::BinSet;
use volery_frame::{BrickId, PlacedBrick, RayTransfer, VolumeLayout};
use volery_shaders::raycast::{CELLS_SHIFT, EXACT, LAYER_SHIFT, LEVEL_SHIFT, OCCUPIED};

use crate::blocks::{Summary, block_cells};

/// Most units; beyond, units grow.
const MAX_UNITS: u64 = 1 << 21;

/// Longest distance that is told apart.
const MAX_DISTANCE: u32 = 255;

/// The units of a frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Units {
    /// Finest cells per edge.
    pub(crate) unit_cells: u32,
    pub(crate) dims: [u32; 3],
    /// Two words per unit, x fastest; the shader says what they mean.
    pub(crate) words: Vec<[u32; 2]>,
}

/// Where a resident brick lies, and what is known of it.
#[derive(Clone, Debug)]
pub(crate) struct Resident {
    pub(crate) slot: u32,
    pub(crate) summary: Summary,
}

/// What it takes to tell empty space.
pub(crate) struct Matter<'a> {
    pub(crate) layout: &'a VolumeLayout,
    pub(crate) resident: &'a HashMap<BrickId, Resident>,
    pub(crate) transfer: &'a RayTransfer,
    /// Slots in a layer of the pool.
    pub(crate) slots_per_layer: u32,
}

impl Units {
    /// The units of bricks, all of which are resident and well placed.
    pub(crate) fn new(matter: &Matter<'_>, bricks: &[PlacedBrick]) -> Self {
        let layout = matter.layout;
        let unit_cells = unit_cells(layout, bricks);
        let dims = layout.cells.map(|cells| cells.div_ceil(unit_cells).max(1));
        let num_units = dims.iter().map(|&n| n as usize).product();
        let mut units = Self { unit_cells, dims, words: vec![[MAX_DISTANCE, 0]; num_units] };
        let exact: Vec<_> = (0..=bricks.iter().map(|brick| brick.level).max().unwrap_or(0))
            .map(|level| matter.transfer.exact_bins(layout, level))
            .collect();
        for brick in bricks {
            if let Some(resident) = matter.resident.get(&brick.id) {
                units.place(matter, &exact[brick.level as usize], brick, resident);
            }
        }
        units.measure_distances();
        units
    }

    /// Marks the units of a brick's blocks that hold matter.
    fn place(&mut self, matter: &Matter<'_>, exact: &BinSet, brick: &PlacedBrick, resident: &Resident) {
        let layout = matter.layout;
        let [x, y, z] = resident.summary.cells;
        let cells = x | y << CELLS_SHIFT | z << (2 * CELLS_SHIFT);
        let [row, layer] = [resident.slot % matter.slots_per_layer, resident.slot / matter.slots_per_layer];
        let words = [OCCUPIED | brick.level << LEVEL_SHIFT | layer << LAYER_SHIFT | row, cells];
        let edge = u64::from(block_cells(layout.brick_cells)) << brick.level;
        let blocks = resident.summary.num_blocks(layout.brick_cells);
        for (index, &[low, high]) in resident.summary.ranges.iter().enumerate() {
            let [first, last] = matter.transfer.bins_of(low, high);
            // Bins are rounded to nearest when a ray is classified, hence the half bin on either side.
            let meets = |bins: &BinSet| low <= high && bins.meets(first - 0.5, last + 0.5);
            if !meets(matter.transfer.visible_bins()) {
                continue;
            }
            let words = if meets(exact) { [words[0], words[1] | EXACT] } else { words };
            let index = index as u32;
            let at = [index % blocks[0], index / blocks[0] % blocks[1], index / blocks[0] / blocks[1]];
            let span: [std::ops::Range<u64>; 3] = std::array::from_fn(|axis| {
                let first = u64::from(brick.first_cell[axis]) + u64::from(at[axis]) * edge;
                let unit = u64::from(self.unit_cells);
                first / unit..(first + edge).div_ceil(unit).min(u64::from(self.dims[axis]))
            });
            for z in span[2].clone() {
                for y in span[1].clone() {
                    let row = (z * u64::from(self.dims[1]) + y) * u64::from(self.dims[0]);
                    let (first, end) = ((row + span[0].start) as usize, (row + span[0].end) as usize);
                    if first < end {
                        self.words[first..end].fill(words);
                    }
                }
            }
        }
    }

    /// Gives every unit without matter its distance to the nearest one with matter.
    fn measure_distances(&mut self) {
        let [width, height, depth] = self.dims.map(|n| n as usize);
        // A rim of one unit all around spares the sweeps every test for the ends.
        let (row, plane) = (width + 2, (width + 2) * (height + 2));
        let mut distances = vec![MAX_DISTANCE as u8; plane * (depth + 2)];
        let rows = || (0..depth).flat_map(|z| (0..height).map(move |y| (y, z)));
        let first_of = |y: usize, z: usize| (z + 1) * plane + (y + 1) * row + 1;
        for (words, (y, z)) in self.words.chunks_exact(width).zip(rows()) {
            let first = first_of(y, z);
            for (distance, word) in distances[first..first + width].iter_mut().zip(words) {
                *distance = if word[0] & OCCUPIED != 0 { 0 } else { MAX_DISTANCE as u8 };
            }
        }
        let mut nearest = vec![0_u8; row];
        let sweep = |distances: &mut [u8], nearest: &mut [u8], (y, z): (usize, usize), forward: bool| {
            let first = first_of(y, z);
            // The least of the four neighbouring rows that this sweep has done, then along the row.
            let done = if forward {
                [first - plane - row, first - plane, first - plane + row, first - row]
            } else {
                [first + plane + row, first + plane, first + plane - row, first + row]
            };
            for x in 0..row {
                let at = done.map(|start| distances[start - 1 + x]);
                nearest[x] = at[0].min(at[1]).min(at[2].min(at[3]));
            }
            let mut step = |x: usize, before: usize| {
                let around = nearest[x].min(nearest[x + 1]).min(nearest[x + 2]).min(distances[before]);
                let here = &mut distances[first + x];
                *here = (*here).min(around.saturating_add(1));
            };
            if forward {
                (0..width).for_each(|x| step(x, first + x - 1));
            } else {
                (0..width).rev().for_each(|x| step(x, first + x + 1));
            }
        };
        rows().for_each(|place| sweep(&mut distances, &mut nearest, place, true));
        let backward: Vec<_> = rows().collect();
        backward.into_iter().rev().for_each(|place| sweep(&mut distances, &mut nearest, place, false));
        for (words, (y, z)) in self.words.chunks_exact_mut(width).zip(rows()) {
            let first = first_of(y, z);
            for (word, &distance) in words.iter_mut().zip(&distances[first..first + width]) {
                if distance > 0 {
                    *word = [u32::from(distance), 0];
                }
            }
        }
    }
}

/// Finest cells per edge of a unit: a block of the frame's finest level, doubled while there are too many and
/// a unit still fits a brick evenly.
fn unit_cells(layout: &VolumeLayout, bricks: &[PlacedBrick]) -> u32 {
    let level = bricks.iter().map(|brick| brick.level).min().unwrap_or(0);
    let brick = layout.brick_cells << level;
    let mut unit = block_cells(layout.brick_cells) << level;
    let num_units = |unit: u32| layout.cells.iter().map(|n| u64::from(n.div_ceil(unit))).product::<u64>();
    while num_units(unit) > MAX_UNITS && unit < brick {
        // The next larger divisor of the brick.
        unit = (unit + 1..=brick).find(|size| brick.is_multiple_of(*size)).unwrap_or(brick);
    }
    unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use volery_shaders::raycast::SLOT_MASK;

    #[test]
    fn distances_are_those_of_brute_force() {
        for (dims, every) in
            [([7, 5, 9], 37), ([1, 1, 12], 5), ([16, 3, 1], 11), ([6, 6, 6], 1000), ([4, 4, 4], 1)]
        {
            let num: usize = dims.iter().map(|&n| n as usize).product();
            let words: Vec<_> = (0..num)
                .map(|i| if i % every == 2 % every { [OCCUPIED | 5, 9] } else { [MAX_DISTANCE, 0] })
                .collect();
            let mut units = Units { unit_cells: 1, dims, words: words.clone() };
            units.measure_distances();
            let place = |i: usize| {
                let i = i as u32;
                [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(i64::from)
            };
            for (i, found) in units.words.iter().enumerate() {
                if words[i][0] & OCCUPIED != 0 {
                    assert_eq!(*found, words[i]);
                    assert_eq!(found[0] & SLOT_MASK, 5);
                    continue;
                }
                let distance = |j: usize| {
                    let (a, b) = (place(i), place(j));
                    (0..3).map(|axis| (a[axis] - b[axis]).unsigned_abs()).max().unwrap_or(0)
                };
                let occupied = (0..num).filter(|&j| words[j][0] & OCCUPIED != 0);
                let nearest = occupied.map(distance).min().unwrap_or(u64::from(MAX_DISTANCE));
                assert_eq!(u64::from(found[0]), nearest, "unit {:?} of {dims:?}", place(i));
            }
        }
    }
}
