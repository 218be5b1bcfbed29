//! What a pool takes of a device's memory, before there is one.

use volery_frame::{TexelType, VolumeLayout};
use volery_shaders::raycast::SLOT_MASK;

use super::Slot;
use crate::blocks::num_blocks;
use crate::gpu::Gpu;

/// The texture that a device has for the bricks of a layout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    pub(super) format: wgpu::TextureFormat,
    pub(super) slot: Slot,
    /// Slots of a layer, and layers, at most.
    pub(super) max_slots: [u32; 2],
}

impl Shape {
    pub(crate) fn of(gpu: &Gpu, layout: &VolumeLayout) -> Self {
        let limits = gpu.device.limits();
        let slot = Slot::new(layout.brick_cells.saturating_add(1), limits.max_texture_dimension_2d);
        let has_16_bits = gpu.has(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM);
        let format = match layout.texel {
            TexelType::U8 => wgpu::TextureFormat::R8Unorm,
            TexelType::U16 if has_16_bits => wgpu::TextureFormat::R16Unorm,
            TexelType::U16 | TexelType::F32 => wgpu::TextureFormat::R32Float,
            TexelType::Rgba8 => wgpu::TextureFormat::Rgba8Unorm,
        };
        let rows = (limits.max_texture_dimension_2d / slot.size[1].max(1)).clamp(1, SLOT_MASK + 1);
        Self { format, slot, max_slots: [rows, limits.max_texture_array_layers.min(SLOT_MASK + 1)] }
    }

    pub(super) fn texel_bytes(&self) -> u64 {
        match self.format {
            wgpu::TextureFormat::R8Unorm => 1,
            wgpu::TextureFormat::R16Unorm => 2,
            _ => 4,
        }
    }

    pub(super) fn slot_bytes(&self) -> u64 {
        self.slot.size.map(u64::from).iter().product::<u64>() * self.texel_bytes()
    }

    /// Layers for so many slots, and slots of each: layers of equal height waste least.
    pub(super) fn layers(&self, capacity: u32) -> [u32; 2] {
        let layers = capacity.div_ceil(self.max_slots[0]).max(1);
        [layers, capacity.div_ceil(layers).max(1)]
    }

    /// Of the texture for so many slots.
    pub(super) fn texture_bytes(&self, capacity: u32) -> u64 {
        let [layers, slots] = self.layers(capacity).map(u64::from);
        layers * slots * self.slot_bytes()
    }

    /// A slot and its ranges.
    pub(crate) fn brick_bytes(&self, layout: &VolumeLayout, samples: [u32; 3]) -> u64 {
        let cells = samples.map(|n| n.saturating_sub(1));
        let blocks: u64 = num_blocks(cells, layout.brick_cells).map(u64::from).iter().product();
        self.slot_bytes() + blocks * size_of::<[f32; 2]>() as u64
    }

    /// Without a slot for each layer, the last of which may stay empty, but one: that is a brick on its way.
    pub(crate) fn room(&self, max_bytes: u64) -> u64 {
        let slots = max_bytes / self.slot_bytes();
        max_bytes.saturating_sub(slots.div_ceil(u64::from(self.max_slots[0])).max(1) * self.slot_bytes())
    }
}
