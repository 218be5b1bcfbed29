//! Which of the bricks that were placed are of a part.
//!
//! # Method
//! A camera that moves asks for the bricks of before, in another order, for some of them, and now and then for one more;
//! so do the parts of a picture. What says where bricks are is therefore made for all that were placed, as long as they
//! are resident and nothing else stands in their place, and a bit for each says whether it is of the part at hand.

use std::collections::HashSet;

use volery_frame::{BrickId, PlacedBrick};

use crate::gpu::{Gpu, Upload};
use crate::pool::Pool;

/// A bit for each of some numbers, on the device.
pub(crate) struct Choice {
    pub(crate) buffer: wgpu::Buffer,
    /// Nothing before the first.
    sent: Vec<u32>,
}

impl Choice {
    pub(crate) fn of(gpu: &Gpu, num: usize) -> Self {
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("volery chosen bricks"),
            size: 4 * num.div_ceil(32).max(1) as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { buffer, sent: Vec::new() }
    }

    /// Chooses numbers, for the commands that come next.
    pub(crate) fn send(&mut self, gpu: &Gpu, numbers: impl Iterator<Item = u32>) {
        let mut words = vec![0_u32; (self.buffer.size() / 4) as usize];
        numbers.for_each(|number| words[number as usize / 32] |= 1 << (number % 32));
        if words != self.sent {
            let bytes: &[u8] = bytemuck::cast_slice(&words);
            gpu.count(Upload::Choices, bytes.len());
            gpu.queue.write_buffer(&self.buffer, 0, bytes);
            self.sent = words;
        }
    }
}

/// The bricks that can stay beside new ones: resident, by another name than any of these, and in none of their places.
pub(crate) fn beside<'a>(
    old: impl Iterator<Item = &'a PlacedBrick> + Clone,
    new: impl Iterator<Item = &'a PlacedBrick> + Clone,
    pool: &Pool,
) -> HashSet<PlacedBrick> {
    let brick_cells = u64::from(pool.layout().brick_cells);
    let place = |brick: &PlacedBrick, level: u32| {
        (level, brick.first_cell.map(|cell| u64::from(cell) / (brick_cells << level)))
    };
    let top = old.clone().chain(new.clone()).map(|brick| brick.level).max().unwrap_or(0);
    let names: HashSet<BrickId> = new.clone().map(|brick| brick.id).collect();
    let places: HashSet<_> = new.clone().map(|brick| place(brick, brick.level)).collect();
    let around: HashSet<_> =
        new.flat_map(|brick| (brick.level..=top).map(move |level| place(brick, level))).collect();
    old.filter(|brick| !names.contains(&brick.id) && pool.resident().contains_key(&brick.id))
        .filter(|brick| !around.contains(&place(brick, brick.level)))
        .filter(|brick| !(brick.level..=top).any(|level| places.contains(&place(brick, level))))
        .copied()
        .collect()
}
