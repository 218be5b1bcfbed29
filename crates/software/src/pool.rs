//! The resident bricks, all of one texel type. Colours lie in four planes of bytes, so that what samples bytes
//! samples them.

use std::collections::HashMap;

use rayon::prelude::*;
use volery_frame::{Brick, BrickId, TexelType, Texels};

use crate::brick::StoredBrick;
use crate::texel::Texel;

/// Bricks by name.
pub(crate) type Bricks<T> = HashMap<BrickId, StoredBrick<T>>;

/// Resident bricks.
#[derive(Debug)]
pub(crate) enum Pool {
    U8(Bricks<u8>),
    U16(Bricks<u16>),
    F32(Bricks<f32>),
    Colors(Bricks<u8>),
}

/// Runs one generic expression for whatever type a pool holds.
macro_rules! for_bricks {
    ($pool:expr, |$bricks:ident| $body:expr) => {
        match $pool {
            $crate::pool::Pool::U8($bricks) | $crate::pool::Pool::Colors($bricks) => $body,
            $crate::pool::Pool::U16($bricks) => $body,
            $crate::pool::Pool::F32($bricks) => $body,
        }
    };
}
pub(crate) use for_bricks;

impl Pool {
    pub(crate) fn new(texel: TexelType) -> Self {
        match texel {
            TexelType::U8 => Self::U8(HashMap::new()),
            TexelType::U16 => Self::U16(HashMap::new()),
            TexelType::F32 => Self::F32(HashMap::new()),
            TexelType::Rgba8 => Self::Colors(HashMap::new()),
        }
    }

    pub(crate) fn contains(&self, id: BrickId) -> bool {
        for_bricks!(self, |bricks| bricks.contains_key(&id))
    }

    pub(crate) fn bytes(&self) -> u64 {
        for_bricks!(self, |bricks| bricks.values().map(StoredBrick::bytes).sum())
    }

    /// What a brick of so many samples takes in a pool of these texels; blocks have `block` cells per axis.
    pub(crate) fn brick_bytes(texel: TexelType, samples: [u32; 3], block: u32) -> u64 {
        match texel {
            TexelType::U8 => StoredBrick::<u8>::bytes_of(samples, block),
            TexelType::U16 => StoredBrick::<u16>::bytes_of(samples, block),
            TexelType::F32 => StoredBrick::<f32>::bytes_of(samples, block),
            // Four planes of bytes; the ranges that there are not are room to spare.
            TexelType::Rgba8 => 4 * StoredBrick::<u8>::bytes_of(samples, block),
        }
    }

    pub(crate) fn remove(&mut self, old: &[BrickId]) {
        for_bricks!(self, |bricks| old.iter().for_each(|id| drop(bricks.remove(id))));
    }

    /// Adds bricks that were checked against the layout; blocks have `block` cells per axis.
    pub(crate) fn insert(&mut self, new: &[Brick<'_>], block: u32) {
        fn stored<T: Texel>(new: &[Brick<'_>], block: u32) -> Vec<(BrickId, StoredBrick<T>)> {
            let store = |brick: &Brick<'_>| {
                T::of(brick.texels).map(|texels| (brick.id, StoredBrick::new(brick.samples, texels, block)))
            };
            new.par_iter().filter_map(store).collect()
        }
        if let Self::Colors(bricks) = self {
            let store = |brick: &Brick<'_>| match brick.texels {
                Texels::Rgba8(texels) => Some((brick.id, StoredBrick::of_colors(brick.samples, texels))),
                _ => None,
            };
            let stored: Vec<_> = new.par_iter().filter_map(store).collect();
            bricks.extend(stored);
            return;
        }
        for_bricks!(self, |bricks| bricks.extend(stored(new, block)));
    }
}
