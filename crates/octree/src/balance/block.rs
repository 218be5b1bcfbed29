//! Sets of nodes of one level, 64 to a block, a bit each.
//!
//! A block is a square or cube of `2^BITS` nodes along each axis. Inside, nodes are numbered x fastest, so
//! a plane of nodes across an axis is a mask and the next plane a shift; blocks are named by Morton keys,
//! so that a sorted list of them follows the canonical order of the tree.

/// 64 neighbouring nodes of one level.
#[derive(Clone, Copy, Default)]
pub(super) struct Block {
    /// Morton code of the block's place among the blocks of its level.
    pub(super) key: u128,
    /// Which of its nodes are in the set.
    pub(super) bits: u64,
}

/// How `D` axes are laid out in blocks and keys.
pub(super) struct Grid<const D: usize>;

impl<const D: usize> Grid<D> {
    /// Bits of a node's index that say where in its block it lies, per axis.
    pub(super) const BITS: usize = {
        assert!(D >= 1 && D <= 3, "balance is made for one, two and three dimensions");
        6 / D
    };
    /// Nodes of a block along an axis.
    const SIDE: usize = 1 << Self::BITS;

    /// For each axis, the nodes of a block that come first along it.
    const FIRST_PLANE: [u64; D] = {
        let mut planes = [0; D];
        let mut axis = 0;
        while axis < D {
            let mut place = 0;
            while place < 64 {
                if (place >> (Self::BITS * axis)) & (Self::SIDE - 1) == 0 {
                    planes[axis] |= 1 << place;
                }
                place += 1;
            }
            axis += 1;
        }
        planes
    };

    /// For each axis, its bits in a key.
    const KEY_BITS: [u128; D] = {
        let mut masks = [0; D];
        let mut axis = 0;
        while axis < D {
            let mut bit = axis;
            while bit < 32 * D {
                masks[axis] |= 1 << bit;
                bit += D;
            }
            axis += 1;
        }
        masks
    };

    /// The bits of a byte, `D` apart.
    const SPREAD: [u32; 256] = {
        let mut table = [0; 256];
        let mut byte = 0;
        while byte < 256 {
            let mut bit = 0;
            while bit < 8 {
                table[byte] |= ((byte >> bit & 1) as u32) << (bit * D);
                bit += 1;
            }
            byte += 1;
        }
        table
    };

    /// The Morton code of a place, x in the lowest bit.
    pub(super) fn key(place: [u32; D]) -> u128 {
        let spread = |byte: u8| u128::from(Self::SPREAD[usize::from(byte)]);
        let one = |i: u32| i.to_le_bytes().iter().rev().fold(0, |key, &byte| key << (8 * D) | spread(byte));
        (0..D).fold(0, |key, axis| key | one(place[axis]) << axis)
    }

    /// The place of the block that holds a node.
    #[inline]
    pub(super) fn block_of(index: [u32; D]) -> [u32; D] {
        index.map(|i| i >> Self::BITS)
    }

    /// The number of a node inside its block.
    #[inline]
    pub(super) fn place_in_block(index: [u32; D]) -> usize {
        (0..D).fold(0, |place, axis| place | (index[axis] as usize & (Self::SIDE - 1)) << (Self::BITS * axis))
    }

    /// The key of the neighbour one step up or down an axis, if there is one up to `last`, the bits that
    /// the axis has in the key of the last block.
    fn neighbour(key: u128, axis: usize, is_up: bool, last: u128) -> Option<u128> {
        let mask = Self::KEY_BITS[axis];
        let here = key & mask;
        if here == if is_up { last } else { 0 } {
            return None;
        }
        // The bits of the other axes pass carries on, or stay clear of borrows.
        let there = if is_up { (key | !mask).wrapping_add(1) } else { here.wrapping_sub(1) };
        Some(there & mask | key & !mask)
    }

    /// The parents of all neighbours of the nodes of a block, as a window of the next level that begins
    /// one node before the block's own parents and ends one after them along each axis.
    ///
    /// The neighbours of a box are the product of those along each axis, so axes go one by one. Along an
    /// axis, `x` has neighbours in the parents of `x - 1` and `x + 1`; place `w` of the window, parent
    /// `w - 1`, is met by `2w - 3 ..= 2w`.
    fn parents_of_neighbours(nodes: u64) -> u64 {
        let mut bits = nodes;
        for axis in 0..D {
            let stride = Self::BITS * axis;
            let mut window = 0;
            for w in 0..Self::SIDE / 2 + 2 {
                let met = (2 * w).saturating_sub(3)..=(2 * w).min(Self::SIDE - 1);
                let plane = met.fold(0, |plane, x| plane | bits >> (x << stride));
                window |= (plane & Self::FIRST_PLANE[axis]) << (w << stride);
            }
            bits = window;
        }
        bits
    }

    /// Splits the window of [`Grid::parents_of_neighbours`] of `source` into the blocks of the next level:
    /// the first is the one that holds the block's own parents; those without a node, or past `last`, are
    /// empty. Only the first `2^D` are used.
    pub(super) fn scatter(source: Block, last: &[u128; D]) -> [Block; 8] {
        let half = Self::SIDE / 2;
        let mut parts = [Block::default(); 8];
        parts[0] = Block { key: source.key >> D, bits: Self::parents_of_neighbours(source.bits) };
        for axis in 0..D {
            let stride = Self::BITS * axis;
            // Parents fill the lower or the upper half of their block; one plane sticks out of it.
            let is_upper = source.key >> axis & 1 == 1;
            let out = if is_upper { half + 1 } else { 0 };
            let plane = Self::FIRST_PLANE[axis] << (out << stride);
            for i in 0..1 << axis {
                let Block { key, bits } = parts[i];
                let (home, beyond) = (bits & !plane, (bits & plane) >> (out << stride));
                parts[i].bits = if is_upper { home << ((half - 1) << stride) } else { home >> (1 << stride) };
                if let Some(key) = Self::neighbour(key, axis, is_upper, last[axis]) {
                    let entry = if is_upper { 0 } else { Self::SIDE - 1 };
                    parts[i + (1 << axis)] = Block { key, bits: beyond << (entry << stride) };
                }
            }
        }
        parts
    }

    /// For each axis, the bits it has in the key of the last of `blocks` blocks along it.
    pub(super) fn last_keys(last_block: [u32; D]) -> [u128; D] {
        let key = Self::key(last_block);
        Self::KEY_BITS.map(|mask| key & mask)
    }
}
