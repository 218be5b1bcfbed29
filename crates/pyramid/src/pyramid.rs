//! The pyramid in memory.

use volery_scene::{SampleType, Samples, VoxelGrid};

use crate::brick::{Brick, BrickSamples, BrickShape};
use crate::layout::{self, Kind, Layout};
use crate::levels;
use crate::node::Node;
use crate::source::{NodeSource, ReadError};
use crate::stats::NodeStats;

/// A pyramid in memory: the samples of every level and the statistics of every node.
///
/// Level 0 shares the samples of the grid it was built from. The others take 1/7 of that, the statistics
/// 56 bytes per node and channel.
#[derive(Clone, Debug)]
pub struct Pyramid {
    layout: Layout,
    levels: Vec<Samples>,
    /// Per level, per node, per channel.
    stats: Vec<Vec<NodeStats>>,
}

impl Pyramid {
    /// Builds levels and statistics, on all threads of the current rayon pool. The result is the same
    /// to the bit whatever their number.
    ///
    /// # Errors
    /// When `brick_cells` is odd or out of range, or an axis of the grid is too long.
    pub fn build(grid: &VoxelGrid, kind: Kind, brick_cells: usize) -> Result<Self, layout::Error> {
        let layout = Layout::new(grid.dims(), grid.spacing(), kind, brick_cells)?;
        let mut levels = vec![grid.samples().clone()];
        for level in 1..layout.num_levels() {
            let coarser = levels::coarsen(&layout, level, &levels[level as usize - 1]);
            levels.push(coarser);
        }
        let stats = crate::analysis::stats(&layout, &levels);
        Ok(Self { layout, levels, stats })
    }

    /// All samples of a level, x fastest; [`Layout::level_dims`] of them.
    ///
    /// # Panics
    /// When there is no such level.
    pub fn level(&self, level: u32) -> &Samples {
        &self.levels[level as usize]
    }

    /// Bytes that the pyramid takes beside the samples of the grid.
    pub fn extra_bytes(&self) -> usize {
        let Self { layout: _, levels, stats } = self;
        let samples: usize = levels[1..].iter().map(|level| level.len() * level.sample_type().bytes()).sum();
        samples + stats.iter().map(|level| size_of_val(level.as_slice())).sum::<usize>()
    }
}

impl NodeSource for Pyramid {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn sample_type(&self) -> SampleType {
        self.levels[0].sample_type()
    }

    fn stats(&self, node: Node) -> &[NodeStats] {
        assert!(self.layout.contains(node), "the pyramid has no {node}");
        let channels = self.sample_type().channels();
        &self.stats[node.level as usize][self.layout.node_index(node) * channels..][..channels]
    }

    fn read_brick(&self, node: Node, brick: &mut Brick) -> Result<(), ReadError> {
        assert!(self.layout.contains(node), "the pyramid has no {node}");
        let dims = self.layout.level_dims(node.level);
        brick.shape = self.layout.brick_shape(node);
        let shape = brick.shape;
        macro_rules! fill {
            ($($name:ident),*) => {
                match &self.levels[node.level as usize] {$(
                    Samples::$name(values) => {
                        if !matches!(brick.samples, BrickSamples::$name(_)) {
                            brick.samples = BrickSamples::$name(Vec::new());
                        }
                        if let BrickSamples::$name(out) = &mut brick.samples {
                            copy_brick(values, dims, shape, out);
                        }
                    }
                )*}
            };
        }
        fill!(U8, I8, U16, I16, U32, I32, F32, F64, Rgb8, Rgba8);
        Ok(())
    }
}

fn copy_brick<T: Copy>(level: &[T], dims: [usize; 3], shape: BrickShape, out: &mut Vec<T>) {
    out.clear();
    out.reserve(shape.num_samples());
    let clamped =
        |axis: usize, i: usize| (shape.first[axis] + i as i64).clamp(0, dims[axis] as i64 - 1) as usize;
    // Samples before the level's first and after its last repeat those.
    let (first, last) = (clamped(0, 0), clamped(0, shape.count[0] - 1));
    let before = (first as i64 - shape.first[0]) as usize;
    let after = shape.count[0] - before - (last + 1 - first);
    for z in 0..shape.count[2] {
        for y in 0..shape.count[1] {
            let row = &level[(clamped(2, z) * dims[1] + clamped(1, y)) * dims[0]..][..dims[0]];
            out.extend(std::iter::repeat_n(row[first], before));
            out.extend_from_slice(&row[first..=last]);
            out.extend(std::iter::repeat_n(row[last], after));
        }
    }
}
