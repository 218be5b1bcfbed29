//! Small trees and random numbers for the tests.

use glam::DVec3;
use volery_octree::{Answer, Cut, select};
use volery_pyramid::{Kind, Layout, Node};

pub(crate) const KINDS: [Kind; 2] = [Kind::Decimated, Kind::Averaged];

/// Shapes that trees trip over.
pub(crate) const DIMS: [[usize; 3]; 10] = [
    [1, 1, 1],
    [2, 1, 1],
    [2, 2, 2],
    [1, 1, 67],
    [61, 1, 1],
    [1, 31, 17],
    [13, 11, 7],
    [16, 16, 16],
    [33, 5, 18],
    [17, 17, 17],
];

/// SplitMix64: numbers in [0, 1).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        low + (high - low) * DVec3::new(self.unit(), self.unit(), self.unit())
    }
}

pub(crate) fn layout(dims: [usize; 3], kind: Kind, brick_cells: usize) -> Layout {
    Layout::new(dims, DVec3::new(1.0, 1.0, 10.0), kind, brick_cells).expect("a valid layout")
}

/// A cut of random depth with some nodes skipped.
pub(crate) fn random_cut(layout: &Layout, seed: u64) -> Cut {
    let mut noise = Noise(seed);
    select(layout, |_: Node| match noise.unit() {
        x if x < 0.7 => Answer::Descend,
        x if x < 0.95 => Answer::Draw,
        _ => Answer::Skip,
    })
}
