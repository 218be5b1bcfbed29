//! Which brick of a frame holds a cell.
//!
//! # Method
//! Bricks are nodes of an octree: in Z order (Morton 1966) those inside any larger node stand side by side. A grid
//! as fine as the smallest brick, or coarser where that would have too many entries, names for each of its cells
//! the run of bricks in it: one as a rule, so that to find a brick takes one look; in longer runs, a binary search
//! by Z order. Coordinates are compared in that order without being interleaved (Chan 2002).

use crate::{BlendedBrick, VolumeLayout};

/// Most entries of a grid: 2 MiB.
const MAX_ENTRIES: u64 = 1 << 18;

/// The bricks of a frame, to be found by cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrickGrid {
    bricks: Vec<BlendedBrick>,
    brick_cells: u32,
    entry_cells: u32,
    dims: [u32; 3],
    entries: Vec<[u32; 2]>,
}

impl BrickGrid {
    /// The grid over a layout's volume of bricks that [`check_content`](crate::backend::check_content) let pass.
    pub fn new(layout: &VolumeLayout, bricks: &[BlendedBrick]) -> Self {
        let brick_cells = layout.brick_cells;
        let mut bricks = bricks.to_vec();
        let node = |brick: &BlendedBrick| brick.placed.first_cell.map(|cell| cell / brick_cells);
        bricks.sort_by(|a, b| z_order(node(a), node(b)).then(b.placed.level.cmp(&a.placed.level)));
        let mut level = bricks.iter().map(|brick| brick.placed.level).min().unwrap_or(0);
        let dims_at = |level: u32| {
            let edge = u64::from(brick_cells) << level;
            layout.cells.map(|cells| u64::from(cells).div_ceil(edge).max(1))
        };
        while dims_at(level).iter().product::<u64>() > MAX_ENTRIES {
            level += 1;
        }
        let dims = dims_at(level).map(|n| n as u32);
        let entry_cells = (u64::from(brick_cells) << level).min(u64::from(u32::MAX)) as u32;
        let num_entries = dims.iter().map(|&n| n as usize).product();
        let mut grid = Self { bricks, brick_cells, entry_cells, dims, entries: vec![[0, 0]; num_entries] };
        for index in 0..grid.bricks.len() {
            grid.place(index, level);
        }
        grid
    }

    fn place(&mut self, index: usize, level: u32) {
        let placed = self.bricks[index].placed;
        let first = placed.first_cell.map(|cell| cell / self.entry_cells);
        if placed.level <= level {
            let entry = &mut self.entries[row_major(self.dims, first)];
            *entry = if entry[1] == 0 { [index as u32, 1] } else { [entry[0], entry[1] + 1] };
            return;
        }
        let size = 1_u32.checked_shl(placed.level - level).unwrap_or(u32::MAX);
        let end: [u32; 3] = std::array::from_fn(|axis| first[axis].saturating_add(size).min(self.dims[axis]));
        for z in first[2]..end[2] {
            for y in first[1]..end[1] {
                let row = row_major(self.dims, [first[0], y, z]);
                self.entries[row..row + (end[0] - first[0]) as usize].fill([index as u32, 1]);
            }
        }
    }

    /// The bricks in Z order.
    pub fn bricks(&self) -> &[BlendedBrick] {
        &self.bricks
    }

    /// Finest cells per edge of an entry.
    pub fn entry_cells(&self) -> u32 {
        self.entry_cells
    }

    /// Entries along x, y, z.
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// `[first brick, number of bricks]` of each entry, x fastest.
    pub fn entries(&self) -> &[[u32; 2]] {
        &self.entries
    }

    /// The number in [`bricks`](Self::bricks) of the brick that holds a finest cell of the volume.
    #[inline]
    pub fn find(&self, cell: [u32; 3]) -> Option<usize> {
        let at = cell.map(|cell| cell / self.entry_cells);
        let [mut first, mut count] = *self.entries.get(row_major(self.dims, at))?;
        let node = cell.map(|cell| cell / self.brick_cells);
        while count > 1 {
            let half = count / 2;
            let middle = self.bricks[(first + half) as usize].placed.first_cell.map(|c| c / self.brick_cells);
            if z_order(middle, node).is_le() {
                first += half;
                count -= half;
            } else {
                count = half;
            }
        }
        let placed = &self.bricks.get(first as usize).filter(|_| count == 1)?.placed;
        let size = self.brick_cells << placed.level;
        let holds = |axis: usize| cell[axis].wrapping_sub(placed.first_cell[axis]) < size;
        (0..3).all(holds).then_some(first as usize)
    }
}

fn row_major(dims: [u32; 3], [x, y, z]: [u32; 3]) -> usize {
    (z as usize * dims[1] as usize + y as usize) * dims[0] as usize + x as usize
}

/// Compares by the highest bit in which any coordinate differs, z before y before x.
fn z_order(a: [u32; 3], b: [u32; 3]) -> std::cmp::Ordering {
    let mut axis = 2;
    for other in [1, 0] {
        let (high, low) = (a[axis] ^ b[axis], a[other] ^ b[other]);
        // Whether the highest bit of `low` is above that of `high`.
        if high < low && high < (high ^ low) {
            axis = other;
        }
    }
    a[axis].cmp(&b[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BrickId, PlacedBrick, Revision, TexelType};
    use glam::DVec3;

    fn layout(cells: [u32; 3], brick_cells: u32) -> VolumeLayout {
        VolumeLayout {
            revision: Revision::new(),
            cells,
            spacing: DVec3::ONE,
            brick_cells,
            texel: TexelType::U8,
            value_scale: 1.0,
            value_offset: 0.0,
            value_range: [0.0, 255.0],
        }
    }

    fn brick(first_cell: [u32; 3], level: u32) -> BlendedBrick {
        BlendedBrick { placed: PlacedBrick { id: BrickId(0), first_cell, level }, low_corners: 0 }
    }

    /// A cut by a rule: nodes for which `stops` holds, some left out.
    fn cut(
        layout: &VolumeLayout,
        top: u32,
        stops: &dyn Fn(u32, [u32; 3]) -> Option<bool>,
    ) -> Vec<BlendedBrick> {
        let mut bricks = Vec::new();
        let mut open = vec![(top, [0_u32; 3])];
        while let Some((level, first)) = open.pop() {
            if (0..3).any(|axis| first[axis] >= layout.cells[axis].max(1)) {
                continue;
            }
            match stops(level, first) {
                None => {}
                Some(is_leaf) if is_leaf || level == 0 => bricks.push(brick(first, level)),
                Some(_) => {
                    let half = layout.brick_cells << (level - 1);
                    let child =
                        |octant: u32| std::array::from_fn(|axis| first[axis] + half * (octant >> axis & 1));
                    open.extend((0..8).map(|octant| (level - 1, child(octant))));
                }
            }
        }
        bricks
    }

    #[test]
    fn finds_what_a_search_through_all_bricks_finds() {
        let hash = |level: u32, first: [u32; 3]| {
            first
                .iter()
                .fold(level.wrapping_mul(77), |h, &c| (h ^ c).wrapping_mul(0x9e37_79b1).rotate_left(13))
        };
        for (cells, brick_cells, top) in
            [([63, 40, 50], 4, 4), ([17, 1, 0], 3, 3), ([0, 0, 0], 8, 0), ([5000, 5000, 5000], 6, 10)]
        {
            let layout = layout(cells, brick_cells);
            let stops = |level: u32, first: [u32; 3]| {
                let h = hash(level, first) % 16;
                let is_diagonal = |[x, y, z]: [u32; 3]| x == y && y == z;
                if h == 0 && level < top && !is_diagonal(first) {
                    None
                } else {
                    Some(if cells[0] > 1000 { !is_diagonal(first) } else { h > 9 })
                }
            };
            let bricks = cut(&layout, top, &stops);
            let grid = BrickGrid::new(&layout, &bricks);
            let longest = grid.entries().iter().map(|entry| entry[1]).max();
            println!(
                "{cells:?}: {} bricks, {} entries, runs up to {longest:?}",
                bricks.len(),
                grid.entries().len()
            );
            let mut found = 0;
            for i in 0..4000_u32 {
                let cell =
                    std::array::from_fn(|axis| hash(i, [axis as u32, 5, 9]) % layout.cells[axis].max(1));
                let holds = |brick: &BlendedBrick| {
                    let size = brick_cells << brick.placed.level;
                    (0..3).all(|a| {
                        (brick.placed.first_cell[a]..brick.placed.first_cell[a] + size).contains(&cell[a])
                    })
                };
                let expected = bricks.iter().find(|brick| holds(brick));
                let got = grid.find(cell).map(|index| &grid.bricks()[index]);
                assert_eq!(got, expected, "cell {cell:?}");
                found += u32::from(got.is_some());
            }
            assert!(found > 100, "{found} of 4000 cells in a brick");
        }
    }

    #[test]
    fn z_order_is_that_of_interleaved_bits() {
        let interleaved = |[x, y, z]: [u32; 3]| {
            (0..8).fold(0_u32, |code, bit| {
                code | (x >> bit & 1) << (3 * bit)
                    | (y >> bit & 1) << (3 * bit + 1)
                    | (z >> bit & 1) << (3 * bit + 2)
            })
        };
        let points: Vec<_> =
            (0..216_u32).map(|i| [i % 6, i / 6 % 6, i / 36].map(|x| x * x * 7 % 251)).collect();
        for &a in &points {
            for &b in &points {
                assert_eq!(z_order(a, b), interleaved(a).cmp(&interleaved(b)), "{a:?} {b:?}");
            }
        }
    }
}
