//! A brick as the executor keeps it: samples, and the range of every block of cells.

use std::sync::Mutex;

use volery_frame::ray_transfer::BinSet;
use volery_frame::{Brick, RayTransfer, Revision, UploadError, VolumeLayout};

use crate::texel::Texel;

/// Blocks of a brick per axis, at most: one bit each fills a SIMD register of 512 bits.
const BLOCKS: u32 = 8;

/// Some blocks of a brick: bit `x` of byte `y + 8 z`.
pub(crate) type Occupancy = [u8; 64];

/// Cells of a block per axis, for bricks of `brick_cells`: a power of two, so that what a seam makes of a sample stays
/// within the range of its block, above 1.
pub(crate) fn block_cells(brick_cells: u32) -> u32 {
    brick_cells.div_ceil(BLOCKS).next_power_of_two().max(2)
}

/// The samples of one octree node.
#[derive(Debug)]
pub(crate) struct StoredBrick<T> {
    /// Along x, y, z.
    pub(crate) samples: [u32; 3],
    /// X fastest; of colours first all reds, then all greens, blues and opacities.
    pub(crate) texels: Box<[T]>,
    /// Blocks along x, y, z.
    blocks: [u32; 3],
    /// Smallest and largest texel that is not blank, per block, x fastest; reversed when all are blank.
    ranges: Box<[[T; 2]]>,
    /// What was asked last.
    marked: Mutex<Option<(Marks, Revision, u32)>>,
}

/// The blocks of a brick that a ray needs to know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Marks {
    /// Those that may hold matter.
    pub(crate) occupancy: Occupancy,
    /// Those that are too much for the table, if there are any.
    pub(crate) exact: Option<Occupancy>,
}

/// Whether a brick fits a layout.
pub(crate) fn check(brick: &Brick<'_>, layout: &VolumeLayout) -> Result<(), UploadError> {
    let mismatch =
        |found: String, expected: String| Err(UploadError::Mismatch { id: brick.id, found, expected });
    let most = layout.brick_cells + 1;
    if brick.texels.texel_type() != layout.texel {
        return mismatch(format!("texels {:?}", brick.texels.texel_type()), format!("{:?}", layout.texel));
    }
    if !brick.samples.iter().all(|samples| (1..=most).contains(samples)) {
        return mismatch(format!("{:?} samples", brick.samples), format!("1 to {most} per axis"));
    }
    let count: usize = brick.samples.iter().map(|&n| n as usize).product();
    if brick.texels.len() != count {
        return mismatch(format!("{} texels", brick.texels.len()), format!("{count}"));
    }
    Ok(())
}

impl<T: Texel> StoredBrick<T> {
    /// `texels` are as many as `samples` say; blocks have `block` cells per axis.
    pub(crate) fn new(samples: [u32; 3], texels: &[T], block: u32) -> Self {
        let blocks = samples.map(|n| (n - 1).div_ceil(block));
        let mut ranges = Vec::with_capacity(blocks.iter().product::<u32>() as usize);
        for z in 0..blocks[2] {
            for y in 0..blocks[1] {
                for x in 0..blocks[0] {
                    ranges.push(range(samples, texels, [x, y, z].map(|i| i * block), block));
                }
            }
        }
        Self { samples, texels: texels.into(), blocks, ranges: ranges.into(), marked: Mutex::default() }
    }

    /// As [`StoredBrick::bytes`] of a brick of so many samples.
    pub(crate) fn bytes_of(samples: [u32; 3], block: u32) -> u64 {
        let product = |counts: [u32; 3]| counts.iter().map(|&n| u64::from(n)).product::<u64>();
        let blocks = samples.map(|n| n.saturating_sub(1).div_ceil(block));
        size_of::<Self>() as u64
            + product(samples) * size_of::<T>() as u64
            + product(blocks) * size_of::<[T; 2]>() as u64
    }

    pub(crate) fn bytes(&self) -> u64 {
        let Self { samples: _, texels, blocks: _, ranges, marked: _ } = self;
        (size_of::<Self>() + size_of_val::<[T]>(texels) + size_of_val::<[[T; 2]]>(ranges)) as u64
    }

    /// The blocks of a brick that lies at a level, of whose cells these bins are too much for the table; `None` when none
    /// holds matter. Kept until another transfer function or level asks.
    pub(crate) fn marks(&self, transfer: &RayTransfer, exact: &BinSet, level: u32) -> Option<Marks> {
        let find = || {
            let occupancy = self.blocks(transfer, transfer.visible_bins()).unwrap_or([0; 64]);
            Marks { occupancy, exact: self.blocks(transfer, exact) }
        };
        let marks = match self.marked.lock() {
            // Nobody panics with the lock.
            Err(_) => find(),
            Ok(mut marked) => match *marked {
                Some((marks, revision, at)) if (revision, at) == (transfer.revision(), level) => marks,
                _ => marked.insert((find(), transfer.revision(), level)).0,
            },
        };
        (marks.occupancy != [0; 64]).then_some(marks)
    }

    /// Marks the blocks whose texels meet a set of bins; `None` when there is none.
    fn blocks(&self, transfer: &RayTransfer, bins: &BinSet) -> Option<Occupancy> {
        if bins.is_empty() {
            return None;
        }
        let mut marks = [0; 64];
        let [nx, ny, _] = self.blocks;
        for (i, [low, high]) in (0_u32..).zip(&self.ranges) {
            let [first, last] = transfer.bins_of(low.to_f32(), high.to_f32());
            // Bins are rounded to nearest when a ray is classified, hence the half bin on either side.
            if low <= high && bins.meets(first - 0.5, last + 0.5) {
                let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny];
                marks[(y + BLOCKS * z) as usize] |= 1 << x;
            }
        }
        (marks != [0; 64]).then_some(marks)
    }
}

impl StoredBrick<u8> {
    /// Of colours, through which no ray is cast: without ranges.
    pub(crate) fn of_colors(samples: [u32; 3], texels: &[[u8; 4]]) -> Self {
        let texels = (0..4).flat_map(|channel| texels.iter().map(move |texel| texel[channel])).collect();
        Self { samples, texels, blocks: [0; 3], ranges: Box::new([]), marked: Mutex::default() }
    }
}

/// Smallest and largest texel of a block, its upper faces included.
fn range<T: Texel>(samples: [u32; 3], texels: &[T], first: [u32; 3], block: u32) -> [T; 2] {
    let end: [usize; 3] = std::array::from_fn(|axis| (first[axis] + block + 1).min(samples[axis]) as usize);
    let first = first.map(|x| x as usize);
    let [nx, ny, _] = samples.map(|n| n as usize);
    let mut range = T::EMPTY_RANGE;
    for z in first[2]..end[2] {
        for y in first[1]..end[1] {
            let row = (z * ny + y) * nx;
            for &texel in &texels[row + first[0]..row + end[0]] {
                range = T::include(range, texel);
            }
        }
    }
    range
}
