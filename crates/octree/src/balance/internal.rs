//! The nodes that a balanced tree refines: found level by level, then read to refine leaves.

use rayon::iter::repeat_n;
use rayon::prelude::*;

use super::block::{Block, Grid};
use super::leaf::Leaf;

/// Leaves that one thread takes at a time.
const CHUNK: usize = 1 << 13;

/// Blocks that one thread takes at a time.
const BLOCK_CHUNK: usize = 1 << 9;

/// The coarsest level of a tree whose finest nodes are numbered in 32 bits.
const MAX_LEVEL: u32 = 31;

/// What stands for a leaf: [`Leaf`] itself, or a node of a cut.
pub(super) trait Named<const D: usize>: Copy + Send + Sync + From<Leaf<D>> + Into<Leaf<D>> {}

impl<const D: usize, T: Copy + Send + Sync + From<Leaf<D>> + Into<Leaf<D>>> Named<D> for T {}

/// The internal nodes of a tree over a box of `extent` finest nodes, as blocks sorted by key, per level.
///
/// Nodes past the end of the box may be among them. They change nothing inside: each has, level by level,
/// its nearest node of the box beside it in the set, which is as near or nearer to any other node there.
pub(super) struct Internal<const D: usize> {
    extent: [u32; D],
    levels: Vec<Vec<Block>>,
}

impl<const D: usize> Internal<D> {
    /// Of a tree without internal nodes.
    pub(super) fn none(extent: [u32; D]) -> Self {
        Self { extent, levels: vec![Vec::new(); MAX_LEVEL as usize + 1] }
    }

    /// Adds the parents of `leaves`, those of leaves outside the box left out. Returns whether the leaves
    /// are in canonical order.
    pub(super) fn add_parents<T: Named<D>>(&mut self, leaves: &[T]) -> bool {
        let chunks: Vec<_> = (0..leaves.len().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                // The last leaf of the chunk before comes along, to be compared with.
                let start = (chunk * CHUNK).saturating_sub(1);
                self.parents(&leaves[start..leaves.len().min((chunk + 1) * CHUNK)])
            })
            .collect();
        chunks.into_iter().fold(true, |are_sorted, (parents, is_sorted)| {
            for (level, blocks) in self.levels.iter_mut().zip(parents) {
                level.extend(blocks);
            }
            are_sorted && is_sorted
        })
    }

    fn parents<T: Named<D>>(&self, leaves: &[T]) -> (Vec<Vec<Block>>, bool) {
        let mut levels = vec![Vec::<Block>::new(); self.levels.len()];
        let mut open = [[u32::MAX; D]; MAX_LEVEL as usize + 1];
        let mut is_sorted = true;
        let mut before: Option<Leaf<D>> = None;
        let mut added = None;
        for &leaf in leaves {
            let leaf: Leaf<D> = leaf.into();
            is_sorted &= before.is_none_or(|before| before.may_precede(leaf));
            before = Some(leaf);
            if leaf.level >= MAX_LEVEL || added == Some(leaf.parent()) || !self.contains(leaf) {
                continue;
            }
            let parent = leaf.parent();
            added = Some(parent);
            let (level, block) = (parent.level as usize, Grid::<D>::block_of(parent.index));
            if open[level] != block {
                open[level] = block;
                levels[level].push(Block { key: Grid::<D>::key(block), bits: 0 });
            }
            if let Some(last) = levels[level].last_mut() {
                last.bits |= 1 << Grid::<D>::place_in_block(parent.index);
            }
        }
        (levels, is_sorted)
    }

    /// Adds the fewest nodes that make the tree balanced.
    pub(super) fn balance(&mut self) {
        for level in 1..=MAX_LEVEL {
            let (finer, coarser) = self.levels.split_at_mut(level as usize);
            let blocks = &mut coarser[0];
            let last_block = Grid::<D>::block_of(nodes(self.extent, level).map(|n| n.saturating_sub(1)));
            let last = Grid::<D>::last_keys(last_block);
            let chunks: Vec<_> = finer[level as usize - 1]
                .par_chunks(BLOCK_CHUNK)
                .map(|chunk| required(chunk, &last))
                .collect();
            blocks.extend(chunks.into_iter().flatten());
            blocks.par_sort_unstable_by_key(|block| block.key);
            blocks.dedup_by(|next, kept| {
                let is_same = next.key == kept.key;
                kept.bits |= if is_same { next.bits } else { 0 };
                is_same
            });
        }
    }

    /// Replaces each leaf by its part of the tree: itself, or the leaves inside it in canonical order.
    ///
    /// Counts first, so that every thread writes where its leaves belong: memory that is touched for the
    /// first time costs more than a second walk.
    pub(super) fn refine<T: Named<D>>(&self, leaves: &[T]) -> Vec<T> {
        let chunks = leaves.par_chunks(CHUNK);
        let count = |chunk: &[T]| {
            let mut count = 0;
            Walk::new(self, |_| count += 1).refine(chunk);
            count
        };
        let counts: Vec<usize> = chunks.clone().map(count).collect();
        let mut refined = Vec::new();
        refined.par_extend(repeat_n(T::from(Leaf::new(0, [0; D])), counts.iter().sum()));
        let mut rest = &mut refined[..];
        let parts: Vec<_> = counts.iter().filter_map(|&count| rest.split_off_mut(..count)).collect();
        chunks.zip(parts).for_each(|(chunk, part)| {
            let mut places = part.iter_mut();
            let write = |leaf| {
                if let Some(place) = places.next() {
                    *place = leaf;
                }
            };
            Walk::new(self, write).refine(chunk);
        });
        refined
    }

    /// Whether a node lies in the box.
    fn contains(&self, node: Leaf<D>) -> bool {
        let nodes = nodes(self.extent, node.level);
        node.level <= MAX_LEVEL && (0..D).all(|axis| node.index[axis] < nodes[axis])
    }
}

/// How many nodes a level has along each axis.
fn nodes<const D: usize>(extent: [u32; D], level: u32) -> [u32; D] {
    extent.map(|n| n.saturating_sub(1).checked_shr(level).unwrap_or(0) + u32::from(n > 0))
}

/// The nodes of the next coarser level that the nodes in `blocks` require: the parents of their neighbours
/// and their own.
fn required<const D: usize>(blocks: &[Block], last: &[u128; D]) -> Vec<Block> {
    let mut required = Vec::with_capacity(2 * blocks.len());
    let mut home = Block::default();
    for &block in blocks {
        let parts = Grid::<D>::scatter(block, last);
        if parts[0].key != home.key {
            required.extend((home.bits != 0).then_some(home));
            home = Block { key: parts[0].key, bits: 0 };
        }
        home.bits |= parts[0].bits;
        required.extend(parts[1..1 << D].iter().filter(|part| part.bits != 0));
    }
    required.extend((home.bits != 0).then_some(home));
    required
}

/// Reads a level's blocks in the order of their keys.
#[derive(Clone, Copy)]
struct Cursor<const D: usize> {
    /// The place of the block read last.
    place: [u32; D],
    key: u128,
    bits: u64,
    /// The first block of the level that is not before it.
    next: usize,
}

/// Refines leaves one after the other, quickest in canonical order.
struct Walk<'a, const D: usize, F> {
    internal: &'a Internal<D>,
    cursors: [Cursor<D>; MAX_LEVEL as usize + 1],
    emit: F,
}

impl<'a, const D: usize, F> Walk<'a, D, F> {
    fn new(internal: &'a Internal<D>, emit: F) -> Self {
        let unread = Cursor { place: [u32::MAX; D], key: u128::MAX, bits: 0, next: 0 };
        Self { internal, cursors: [unread; MAX_LEVEL as usize + 1], emit }
    }

    fn refine<T: Named<D>>(&mut self, leaves: &[T])
    where
        F: FnMut(T),
    {
        for &leaf in leaves {
            let node: Leaf<D> = leaf.into();
            if node.level == 0 || !self.internal.contains(node) || !self.is_internal(node) {
                (self.emit)(leaf);
            } else {
                self.split(node);
            }
        }
    }

    fn is_internal(&mut self, node: Leaf<D>) -> bool {
        let bits = self.block(node.level, Grid::<D>::block_of(node.index));
        bits >> Grid::<D>::place_in_block(node.index) & 1 == 1
    }

    /// Adds the leaves inside an internal node.
    fn split<T: Named<D>>(&mut self, node: Leaf<D>)
    where
        F: FnMut(T),
    {
        let level = node.level - 1;
        let first = node.index.map(|i| i << 1);
        let nodes = nodes(self.internal.extent, level);
        let is_whole = (0..D).all(|axis| (first[axis] | 1) < nodes[axis]);
        let bits = match level {
            0 => 0,
            _ => self.block(level, Grid::<D>::block_of(first)) >> Grid::<D>::place_in_block(first),
        };
        for octant in 0..1_u32 << D {
            let step: [u32; D] = std::array::from_fn(|axis| octant >> axis & 1);
            let child = Leaf::new(level, std::array::from_fn(|axis| first[axis] | step[axis]));
            if !is_whole && (0..D).any(|axis| child.index[axis] >= nodes[axis]) {
                continue;
            }
            if bits >> Grid::<D>::place_in_block(step) & 1 == 1 {
                self.split(child);
            } else {
                (self.emit)(child.into());
            }
        }
    }

    /// The internal nodes of a block of a level.
    #[inline]
    fn block(&mut self, level: u32, place: [u32; D]) -> u64 {
        let cursor = &mut self.cursors[level as usize];
        if cursor.place != place {
            let blocks = &self.internal.levels[level as usize];
            let key = Grid::<D>::key(place);
            if key < cursor.key {
                cursor.next = blocks.partition_point(|block| block.key < key);
            }
            let passed = blocks[cursor.next..].iter().take_while(|block| block.key < key).count();
            let next = cursor.next + passed;
            let found = blocks.get(next).filter(|block| block.key == key);
            *cursor = Cursor { place, key, bits: found.map_or(0, |block| block.bits), next };
        }
        cursor.bits
    }
}
