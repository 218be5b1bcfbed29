//! The range of texels in every block of a brick, so that blocks without matter are found without looking at
//! texels again, whatever the transfer function.

use volery_frame::{Brick, Texels};

/// Cells per edge of a block that suit: smaller ones follow the matter more closely. At 8 rays took a tenth
/// longer on llvmpipe; at 2 the ranges would take as much memory as 8-bit texels.
const GOOD_BLOCK: f64 = 4.0;

/// Cells per edge of a block: the divisor of a brick's that is nearest to the good size, above 1 where it can be. It is even
/// where the brick's is: what a seam makes of a sample stays within the range of its block.
pub(crate) fn block_cells(brick_cells: u32) -> u32 {
    let fits =
        |d: &u32| brick_cells.is_multiple_of(*d) && (d.is_multiple_of(2) || !brick_cells.is_multiple_of(2));
    let divisors = (brick_cells.min(2)..=brick_cells).filter(fits);
    let misfit = |divisor: &u32| (f64::from(*divisor) / GOOD_BLOCK).ln().abs();
    divisors.min_by(|a, b| misfit(a).total_cmp(&misfit(b))).unwrap_or(1)
}

/// What is known of a resident brick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Summary {
    /// Cells along each axis.
    pub(crate) cells: [u32; 3],
    /// `[min, max]` of the finite texels of each block, x fastest; `[inf, -inf]` where there is none.
    pub(crate) ranges: Vec<[f32; 2]>,
    pub(crate) has_blanks: bool,
}

impl Summary {
    pub(crate) fn of(brick: &Brick<'_>, brick_cells: u32) -> Self {
        let block = block_cells(brick_cells);
        let (ranges, has_blanks) = match brick.texels {
            Texels::U8(texels) => (ranges(brick.samples, texels, block, f32::from), false),
            Texels::U16(texels) => (ranges(brick.samples, texels, block, f32::from), false),
            // No ray is cast through colours.
            Texels::Rgba8(_) => (Vec::new(), false),
            Texels::F32(texels) => {
                let has_blanks = texels.iter().any(|texel| !texel.is_finite());
                (ranges(brick.samples, texels, block, |texel| texel), has_blanks)
            }
        };
        Self { cells: brick.samples.map(|n| n - 1), ranges, has_blanks }
    }

    /// Blocks along each axis.
    pub(crate) fn num_blocks(&self, brick_cells: u32) -> [u32; 3] {
        num_blocks(self.cells, brick_cells)
    }
}

/// Blocks along each axis of a brick of so many cells.
pub(crate) fn num_blocks(cells: [u32; 3], brick_cells: u32) -> [u32; 3] {
    cells.map(|cells| cells.div_ceil(block_cells(brick_cells)))
}

fn ranges<T: Copy>(samples: [u32; 3], texels: &[T], block: u32, to_f32: impl Fn(T) -> f32) -> Vec<[f32; 2]> {
    let cells = samples.map(|n| n - 1);
    let blocks = cells.map(|cells| cells.div_ceil(block) as usize);
    let mut ranges = vec![[f32::INFINITY, f32::NEG_INFINITY]; blocks.iter().product()];
    let width = samples[0] as usize;
    for (row_index, row) in texels.chunks_exact(width).enumerate() {
        let place = [row_index as u32 % samples[1], row_index as u32 / samples[1]];
        // A row on the plane between two blocks belongs to both.
        let [ys, zs] = [0, 1].map(|i| blocks_of_sample(place[i], cells[i + 1], block));
        for x in 0..blocks[0] {
            let first = x * block as usize;
            let last = (first + block as usize).min(width - 1);
            let mut range = [f32::INFINITY, f32::NEG_INFINITY];
            for &texel in &row[first..=last] {
                let texel = to_f32(texel);
                if texel.is_finite() {
                    range = [range[0].min(texel), range[1].max(texel)];
                }
            }
            for z in zs.clone() {
                for y in ys.clone() {
                    let old = &mut ranges[(z * blocks[1] + y) * blocks[0] + x];
                    *old = [old[0].min(range[0]), old[1].max(range[1])];
                }
            }
        }
    }
    ranges
}

/// The blocks that have a sample among their corners, along one axis.
fn blocks_of_sample(sample: u32, cells: u32, block: u32) -> std::ops::Range<usize> {
    let num_blocks = cells.div_ceil(block);
    let first =
        if sample.is_multiple_of(block) { (sample / block).saturating_sub(1) } else { sample / block };
    first as usize..(sample / block + 1).min(num_blocks) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use volery_frame::BrickId;

    #[test]
    fn blocks_divide_bricks() {
        assert_eq!([1, 2, 5, 7, 32, 64, 37, 255].map(block_cells), [1, 2, 5, 7, 4, 4, 37, 5]);
    }

    #[test]
    fn ranges_are_those_of_brute_force() {
        for (samples, brick_cells) in
            [([9, 33, 17], 32), ([2, 3, 33], 32), ([5, 6, 4], 5), ([1, 7, 7], 8), ([12, 9, 2], 16)]
        {
            let num: u32 = samples.iter().product();
            let texels: Vec<f32> =
                (0..num).map(|i| if i % 61 == 7 { f32::NAN } else { (i * 7919 % 1009) as f32 }).collect();
            let brick = Brick { id: BrickId(0), samples, texels: Texels::F32(&texels) };
            let summary = Summary::of(&brick, brick_cells);
            let (block, blocks) = (block_cells(brick_cells), summary.num_blocks(brick_cells));
            assert_eq!(summary.ranges.len() as u32, blocks.iter().product::<u32>());
            for (index, found) in summary.ranges.iter().enumerate() {
                let index = index as u32;
                let at = [index % blocks[0], index / blocks[0] % blocks[1], index / blocks[0] / blocks[1]];
                let mut expected = [f32::INFINITY, f32::NEG_INFINITY];
                for (i, &texel) in texels.iter().enumerate() {
                    let i = i as u32;
                    let p = [i % samples[0], i / samples[0] % samples[1], i / samples[0] / samples[1]];
                    let inside = (0..3).all(|a| (at[a] * block..=at[a] * block + block).contains(&p[a]));
                    if inside && texel.is_finite() {
                        expected = [expected[0].min(texel), expected[1].max(texel)];
                    }
                }
                assert_eq!(*found, expected, "block {at:?} of {samples:?} samples");
            }
        }
    }
}
