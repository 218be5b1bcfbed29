//! The statistics of all nodes, in one pass over the finest samples.
//!
//! # Method
//! The finest level is cut into *blocks*: the rows (y, z) of one level-0 node (of a part of it where bricks
//! are large), for all x. A block is the unit of work of a thread, and each is visited once: its samples
//! are copied, [`COLUMNS`](lane::COLUMNS) columns at a time, to where they lie densely; extremes and sums
//! run down the columns; then, level by level, the difference from the coarser field runs down the same
//! columns. Everything is elementwise across columns, so it vectorises for any sample type, and no result
//! depends on the width of the machine's vectors. What a block finds is kept per column until the row is
//! done, then reduced to the nodes along x; blocks are merged into nodes serially, in order.
//!
//! *Error.* Along each axis both fields are linear between the positions of [`taps`]: the maximum of the
//! difference is at one of those. The coarser field is interpolated along x once per coarse row, along z
//! once per edge of a coarse cell, along y at each position: one multiplication and addition.
//!
//! *Arithmetic* ([`lane`]). With `T = 2^l` (decimated) or `2^(l + 1)` (averaged) steps per coarse cell, the
//! difference times `T^3` is an integer for integer samples. It is computed in `i16` or `i32` where that
//! many bits hold it, else in `f64`, which is exact to 53 bits.

mod block;
mod expand;
mod lane;
mod moments;
mod scan;
mod taps;

use fearless_simd::Level;
use rayon::prelude::*;
use volery_scene::Samples;

use crate::layout::Layout;
use crate::stats::NodeStats;
use block::{Block, Found, Plan, Scratch};
use lane::Voxel;
use moments::Moments;

/// Statistics per level, node and channel.
pub(crate) fn stats(layout: &Layout, levels: &[Samples]) -> Vec<Vec<NodeStats>> {
    fn of_type<T: Voxel>(layout: &Layout, levels: &[&[T]]) -> Vec<Vec<NodeStats>> {
        let channels = T::TYPE.channels();
        if channels == 1 {
            return channel(layout, levels, 0, Level::new());
        }
        let each: Vec<_> = (0..channels).map(|c| channel(layout, levels, c, Level::new())).collect();
        let interleave = |level: usize| {
            let nodes = 0..each[0][level].len();
            nodes.flat_map(|node| each.iter().map(move |channel| channel[level][node])).collect()
        };
        (0..levels.len()).map(interleave).collect()
    }
    macro_rules! dispatch {
        ($($name:ident),*) => {
            match &levels[0] {$(
                Samples::$name(_) => {
                    let slices: Vec<_> = levels.iter().filter_map(|level| match level {
                        Samples::$name(values) => Some(&**values),
                        _ => None,
                    }).collect();
                    of_type(layout, &slices)
                }
            )*}
        };
    }
    dispatch!(U8, I8, U16, I16, U32, I32, F32, F64, Rgb8, Rgba8)
}

/// What is known of a node while blocks and children are merged into it.
#[derive(Clone, Copy)]
struct Partial<M> {
    min: f64,
    max: f64,
    any_blank: bool,
    moments: M,
    error: f64,
}

impl<M: Moments> Partial<M> {
    const EMPTY: Self =
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, any_blank: false, moments: M::EMPTY, error: 0.0 };

    /// Takes in all of a part of the node but its error.
    fn merge(&mut self, part: &Self) {
        self.min = self.min.min(part.min);
        self.max = self.max.max(part.max);
        self.any_blank |= part.any_blank;
        self.moments = self.moments.merge(part.moments);
    }

    fn finish(&self, level: u32) -> NodeStats {
        let blank_error = if level == 0 || self.min > self.max { 0.0 } else { f64::INFINITY };
        let (count, blank) = self.moments.counts();
        NodeStats {
            min: self.min,
            max: self.max,
            mean: self.moments.mean(),
            std_dev: self.moments.std_dev(),
            error: if self.any_blank { blank_error } else { self.error },
            count,
            blank,
        }
    }
}

/// Statistics of one channel, per level and node.
fn channel<T: Voxel>(layout: &Layout, levels: &[&[T]], channel: usize, simd: Level) -> Vec<Vec<NodeStats>> {
    let plan = Plan::new(layout, levels, channel, simd);
    let parts = [1, 2].map(|axis| block::parts(layout, axis));
    let blocks: Vec<_> =
        parts[1].iter().flat_map(|z| parts[0].iter().map(|y| Block { plan: &plan, parts: [y, z] })).collect();
    let found: Vec<_> =
        blocks.par_iter().map_init(Scratch::new, |scratch, block| block.analyse(scratch)).collect();

    let mut partials = merge_blocks(layout, &blocks, &found);
    let mut stats = Vec::with_capacity(levels.len());
    for level in 0..layout.num_levels() {
        if level > 0 {
            partials = merge_children(layout, level, &partials);
            take_errors(level, &blocks, &found, &mut partials);
        }
        stats.push(partials.iter().map(|partial| partial.finish(level)).collect());
    }
    stats
}

/// The nodes of level 0, from the blocks inside them.
fn merge_blocks<M: Moments, T>(
    layout: &Layout,
    blocks: &[Block<'_, T>],
    found: &[Found<M>],
) -> Vec<Partial<M>> {
    let mut partials = vec![Partial::EMPTY; layout.num_nodes(0)];
    for (block, found) in blocks.iter().zip(found) {
        let row = &mut partials[block.first_node(0)..][..found.parts.len()];
        for (node, part) in row.iter_mut().zip(&found.parts) {
            node.merge(part);
        }
    }
    partials
}

/// All but the errors of the nodes of a level, from their children.
fn merge_children<M: Moments>(layout: &Layout, level: u32, children: &[Partial<M>]) -> Vec<Partial<M>> {
    let merge = |node| {
        let mut partial = Partial::EMPTY;
        for child in layout.children(node) {
            partial.merge(&children[layout.node_index(child)]);
        }
        partial
    };
    layout.level_nodes(level).map(merge).collect()
}

/// The errors of the nodes of a level, from the blocks inside them.
fn take_errors<M, T>(level: u32, blocks: &[Block<'_, T>], found: &[Found<M>], partials: &mut [Partial<M>]) {
    for (block, found) in blocks.iter().zip(found) {
        let errors = &found.errors[level as usize - 1];
        let row = &mut partials[block.first_node(level)..][..errors.len()];
        for (node, &error) in row.iter_mut().zip(errors) {
            node.error = node.error.max(error);
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use glam::DVec3;
    use volery_scene::VoxelGrid;

    use super::*;
    use crate::{Kind, Pyramid};

    #[test]
    fn the_same_bits_with_any_simd_instructions() {
        let best = Level::new();
        let levels: Vec<Level> = [
            best.as_sse2().map(Level::Sse2),
            best.as_sse4_2().map(Level::Sse4_2),
            best.as_avx2().map(Level::Avx2),
            Some(best),
        ]
        .into_iter()
        .flatten()
        .collect();
        let dims = [75, 40, 37];
        let values: Vec<f32> = (0..75 * 40 * 37).map(|i: i32| (i as f32 * 0.37).sin() * 1e3).collect();
        for kind in [Kind::Decimated, Kind::Averaged] {
            let grid = VoxelGrid::new(dims, DVec3::ONE, values.clone()).unwrap();
            let pyramid = Pyramid::build(&grid, kind, 8).unwrap();
            let layout = crate::NodeSource::layout(&pyramid);
            let samples: Vec<_> = (0..layout.num_levels())
                .map(|level| match pyramid.level(level) {
                    Samples::F32(values) => &**values,
                    _ => panic!("the type changed"),
                })
                .collect();
            let expected = channel(layout, &samples, 0, best);
            for &simd in &levels {
                assert_eq!(channel(layout, &samples, 0, simd), expected, "{simd:?}");
            }
        }
    }
}
