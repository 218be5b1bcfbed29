//! The brick pool: one texture of slots, and what is known of each brick.
//!
//! A brick's slices of equal z lie side by side, bricks one below the other and then in layers, so that in a
//! texture whose rows follow one another the texels of a cell are few cache lines apart. With z as layers rays
//! through 302^3 samples took up to half as long again on llvmpipe. A GPU's own tiling does not mind.
//!
//! Four 8-bit texels of successive z in one word, so that one gather reads a cell, were 11 % faster there, but a
//! third larger, with a second kind of atlas: not done.

mod shape;

use std::collections::HashMap;

use volery_frame::{Brick, BrickId, Texels, UploadError, VolumeLayout};
use volery_shaders::raycast::{BLANK, CELLS_MASK};

use crate::blocks::Summary;
use crate::gpu::{Failure, Gpu, Upload};
use crate::units::Resident;
pub(crate) use shape::Shape;

/// Bytes handed to the device before it is asked to take them: bounds the memory of copies under way where nobody
/// bounds all of it.
const BYTES_IN_FLIGHT: usize = 32 << 20;

/// The bricks of one volume.
pub(crate) struct Pool {
    layout: VolumeLayout,
    shape: Shape,
    atlas: Option<Atlas>,
    resident: HashMap<BrickId, Resident>,
    num_slots_used: u32,
    /// Of those used, which hold nothing any more.
    free_slots: Vec<u32>,
    /// Bytes of copies under way at one time; a brick's may be more.
    bytes_in_flight: usize,
    /// Grows with every change of what is resident, so that what was made of it can be told old.
    generation: u64,
}

/// The shape of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slot {
    /// Samples of a brick per axis.
    edge: u32,
    /// Slices side by side.
    pub(crate) slices_per_row: u32,
    /// Texels along x and y.
    pub(crate) size: [u32; 2],
}

struct Atlas {
    texture: wgpu::Texture,
    slots_per_layer: u32,
    capacity: u32,
}

impl Slot {
    /// As few rows of slices as textures of this width allow.
    fn new(edge: u32, max_width: u32) -> Self {
        let slices_per_row = (max_width / edge).clamp(1, edge);
        let size = [slices_per_row * edge, edge.div_ceil(slices_per_row).saturating_mul(edge)];
        Self { edge, slices_per_row, size }
    }
}

impl Atlas {
    /// Where a slot begins.
    fn place(&self, index: u32, slot: Slot) -> wgpu::TexelCopyTextureInfo<'_> {
        let (row, layer) = (index % self.slots_per_layer, index / self.slots_per_layer);
        wgpu::TexelCopyTextureInfo {
            texture: &self.texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: row * slot.size[1], z: layer },
            aspect: wgpu::TextureAspect::All,
        }
    }
}

impl Pool {
    /// An empty pool for bricks of a layout.
    pub(crate) fn new(gpu: &Gpu, layout: &VolumeLayout) -> Result<Self, UploadError> {
        let max_dimension = gpu.device.limits().max_texture_dimension_2d;
        let shape = Shape::of(gpu, layout);
        let slot = shape.slot;
        if !(1..=CELLS_MASK).contains(&layout.brick_cells) || slot.size.iter().any(|&n| n > max_dimension) {
            let found = layout.brick_cells;
            return Err(UploadError::Device(format!(
                "bricks of {found} cells, expected 1 to {CELLS_MASK} that fit a texture of {max_dimension} texels"
            )));
        }
        Ok(Self {
            layout: *layout,
            shape,
            atlas: None,
            resident: HashMap::new(),
            num_slots_used: 0,
            free_slots: Vec::new(),
            bytes_in_flight: BYTES_IN_FLIGHT,
            generation: 0,
        })
    }

    pub(crate) fn layout(&self) -> &VolumeLayout {
        &self.layout
    }

    pub(crate) fn resident(&self) -> &HashMap<BrickId, Resident> {
        &self.resident
    }

    pub(crate) fn texture(&self) -> Option<&wgpu::Texture> {
        self.atlas.as_ref().map(|atlas| &atlas.texture)
    }

    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    pub(crate) fn slot(&self) -> Slot {
        self.shape.slot
    }

    /// Slots that were ever used.
    pub(crate) fn num_slots(&self) -> u32 {
        self.num_slots_used
    }

    pub(crate) fn slots_per_layer(&self) -> u32 {
        self.atlas.as_ref().map_or(1, |atlas| atlas.slots_per_layer)
    }

    /// Texels of the atlas along x and y.
    pub(crate) fn texture_size(&self) -> [u32; 2] {
        self.texture().map_or([1, 1], |texture| [texture.width(), texture.height()])
    }

    /// How many steps of the uploaded texels make one of what the shader reads.
    pub(crate) fn texels_per_unit(&self) -> f64 {
        match self.shape.format {
            wgpu::TextureFormat::R8Unorm => 255.0,
            wgpu::TextureFormat::R16Unorm => 65535.0,
            _ => 1.0,
        }
    }

    pub(crate) fn resident_bytes(&self) -> u64 {
        let Self { layout: _, shape, atlas, resident, .. } = self;
        let texels = atlas.as_ref().map_or(0, |atlas| u64::from(atlas.capacity) * shape.slot_bytes());
        let ranges: usize = resident.values().map(|brick| size_of_val(brick.summary.ranges.as_slice())).sum();
        texels + ranges as u64
    }

    pub(crate) fn upload(&mut self, gpu: &Gpu, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        bricks.iter().try_for_each(|brick| check(brick, &self.layout))?;
        let mut slots = HashMap::new();
        let (mut num_slots, mut free) = (self.num_slots_used, self.free_slots.clone());
        for brick in bricks {
            slots.entry(brick.id).or_insert_with(|| {
                let held = self.resident.get(&brick.id).map(|resident| resident.slot);
                held.or_else(|| free.pop()).unwrap_or_else(|| {
                    num_slots += 1;
                    num_slots - 1
                })
            });
        }
        self.reserve(gpu, num_slots)?;
        let Some(atlas) = &self.atlas else { return Ok(()) };
        self.generation += 1;
        let written = gpu.checked(|| {
            let mut bytes = 0;
            for brick in bricks {
                if bytes + self.shape.slot_bytes() as usize > self.bytes_in_flight {
                    bytes = 0;
                    gpu.queue.submit([]);
                    gpu.wait()?;
                }
                bytes += self.write(gpu, atlas, slots[&brick.id], brick);
            }
            gpu.queue.submit([]);
            // Who bounds memory brings more soon.
            if self.bytes_in_flight < BYTES_IN_FLIGHT { gpu.wait() } else { Ok(()) }
        });
        (self.num_slots_used, self.free_slots) = (num_slots, free);
        if let Err(failure) = written.and_then(|result| result) {
            // Nothing says how far it came: none of these bricks can be trusted.
            bricks.iter().for_each(|brick| drop(self.resident.remove(&brick.id)));
            self.free_slots.extend(slots.into_values());
            return Err(UploadError::Device(failure.to_string()));
        }
        for brick in bricks {
            let summary = Summary::of(brick, self.layout.brick_cells);
            self.resident.insert(brick.id, Resident { slot: slots[&brick.id], summary });
        }
        Ok(())
    }

    /// Forgets bricks; their slots are for others.
    pub(crate) fn evict(&mut self, bricks: &[BrickId]) {
        self.free_slots.extend(bricks.iter().filter_map(|id| self.resident.remove(id)).map(|held| held.slot));
        self.generation += 1;
    }

    /// Makes room for so many bricks, and no more than that, without ever taking more than `max_bytes`.
    pub(crate) fn reserve_within(
        &mut self,
        gpu: &Gpu,
        num_bricks: usize,
        max_bytes: u64,
    ) -> Result<(), UploadError> {
        let num_slots = u32::try_from(num_bricks).unwrap_or(u32::MAX);
        let (capacity, wanted) = (self.capacity(), self.shape.texture_bytes(num_slots));
        let held = u64::from(capacity) * self.shape.slot_bytes();
        if capacity < num_slots || held > max_bytes {
            if self.resident_bytes().saturating_add(wanted) > max_bytes || capacity > num_slots {
                self.forget(gpu)?;
            }
            if num_slots > 0 {
                self.grow(gpu, num_slots)?;
            }
        }
        let left = max_bytes.saturating_sub(self.resident_bytes()) as usize;
        self.bytes_in_flight = left.min(BYTES_IN_FLIGHT - 1);
        Ok(())
    }

    fn capacity(&self) -> u32 {
        self.atlas.as_ref().map_or(0, |atlas| atlas.capacity)
    }

    /// Gives back all that bricks take.
    fn forget(&mut self, gpu: &Gpu) -> Result<(), UploadError> {
        self.resident.clear();
        self.free_slots.clear();
        self.num_slots_used = 0;
        self.generation += 1;
        if let Some(atlas) = self.atlas.take() {
            atlas.texture.destroy();
        }
        gpu.wait().map_err(|failure| UploadError::Device(failure.to_string()))
    }

    /// Makes room for so many slots, bounded by the device alone.
    fn reserve(&mut self, gpu: &Gpu, num_slots: u32) -> Result<(), UploadError> {
        let capacity = self.capacity();
        if num_slots <= capacity {
            return Ok(());
        }
        self.bytes_in_flight = BYTES_IN_FLIGHT;
        // Half as much again, so that bricks that come one by one are copied a bounded number of times.
        let generous = num_slots.max(capacity + capacity / 2);
        self.grow(gpu, generous).or_else(|_| self.grow(gpu, num_slots))
    }

    fn grow(&mut self, gpu: &Gpu, capacity: u32) -> Result<(), UploadError> {
        let Shape { format, slot, max_slots: [max_rows, max_layers] } = self.shape;
        let ([width, height], slot_bytes) = (slot.size, self.shape.slot_bytes());
        let [layers, slots_per_layer] = self.shape.layers(capacity);
        if layers > max_layers {
            let max = u64::from(max_rows) * u64::from(max_layers) * slot_bytes;
            return Err(UploadError::PoolFull { required: u64::from(capacity) * slot_bytes, max });
        }
        let descriptor = wgpu::TextureDescriptor {
            label: Some("volery brick pool"),
            size: wgpu::Extent3d { width, height: slots_per_layer * height, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_DST
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        };
        let grown = gpu.checked(|| {
            let texture = gpu.device.create_texture(&descriptor);
            let atlas = Atlas { texture, slots_per_layer, capacity: slots_per_layer * layers };
            if let Some(old) = &self.atlas {
                copy_slots(gpu, old, &atlas, self.num_slots_used, slot);
            }
            gpu.wait().map(|()| atlas)
        });
        match grown.and_then(|result| result) {
            Ok(atlas) => {
                self.atlas = Some(atlas);
                self.generation += 1;
                Ok(())
            }
            Err(Failure::OutOfMemory) => {
                let held = u64::from(self.capacity()) * slot_bytes;
                Err(UploadError::PoolFull { required: u64::from(capacity) * slot_bytes, max: held })
            }
            Err(Failure::Other(text)) => Err(UploadError::Device(text)),
        }
    }

    /// Hands a brick's texels to the device and returns their bytes.
    fn write(&self, gpu: &Gpu, atlas: &Atlas, index: u32, brick: &Brick<'_>) -> usize {
        let (samples, slot) = (brick.samples, self.shape.slot);
        let bytes = match brick.texels {
            Texels::U8(texels) => slot.fold(samples, texels, |texel| texel),
            Texels::U16(texels) if self.shape.format == wgpu::TextureFormat::R16Unorm => {
                slot.fold(samples, texels, |texel| texel)
            }
            Texels::U16(texels) => slot.fold(samples, texels, f32::from),
            Texels::F32(texels) => slot.fold(samples, texels, storable),
            Texels::Rgba8(texels) => slot.fold(samples, texels, |texel| texel),
        };
        let [width, height] = slot.size;
        gpu.count(Upload::Bricks, bytes.len());
        gpu.queue.write_texture(
            atlas.place(index, slot),
            &bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * self.shape.texel_bytes() as u32),
                rows_per_image: Some(height),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        bytes.len()
    }
}

impl Slot {
    /// A brick's texels as they lie in its slot; zero where the brick has none.
    fn fold<T: Copy, U: bytemuck::NoUninit + bytemuck::Zeroable>(
        self,
        samples: [u32; 3],
        texels: &[T],
        convert: impl Fn(T) -> U,
    ) -> Vec<u8> {
        let [width, height] = self.size.map(|n| n as usize);
        let mut folded = vec![U::zeroed(); width * height];
        let [row_length, num_rows, _] = samples.map(|n| n as usize);
        let (edge, slices_per_row) = (self.edge as usize, self.slices_per_row as usize);
        for (index, row) in texels.chunks_exact(row_length).enumerate() {
            let (y, z) = (index % num_rows, index / num_rows);
            let first = (z / slices_per_row * edge + y) * width + z % slices_per_row * edge;
            folded[first..first + row_length].iter_mut().zip(row).for_each(|(to, &from)| *to = convert(from));
        }
        bytemuck::cast_slice(&folded).to_vec()
    }
}

/// Blank texels as a number that the shader knows, since shaders may not tell NaN.
fn storable(texel: f32) -> f32 {
    // Between finite texels differences must stay finite.
    let largest = BLANK * 0.99;
    if texel.is_finite() { texel.clamp(-largest, largest) } else { 2.0 * BLANK }
}

fn copy_slots(gpu: &Gpu, old: &Atlas, new: &Atlas, num_slots: u32, slot: Slot) {
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("volery brick pool growth") };
    let mut encoder = gpu.device.create_command_encoder(&descriptor);
    let [width, height] = slot.size;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    for index in 0..num_slots {
        let [from, to] = [old, new].map(|atlas| atlas.place(index, slot));
        encoder.copy_texture_to_texture(from, to, size);
    }
    gpu.queue.submit([encoder.finish()]);
}

fn check(brick: &Brick<'_>, layout: &VolumeLayout) -> Result<(), UploadError> {
    let mismatch =
        |found: String, expected: String| Err(UploadError::Mismatch { id: brick.id, found, expected });
    let (found, expected) = (brick.texels.texel_type(), layout.texel);
    if found != expected {
        return mismatch(format!("{found:?} texels"), format!("{expected:?}"));
    }
    let max = layout.brick_cells + 1;
    if !brick.samples.iter().all(|n| (1..=max).contains(n)) {
        return mismatch(format!("{:?} samples", brick.samples), format!("1 to {max} along each axis"));
    }
    let expected: u64 = brick.samples.iter().map(|&n| u64::from(n)).product();
    if brick.texels.len() as u64 != expected {
        return mismatch(format!("{} texels", brick.texels.len()), format!("{expected}"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Devices with small textures, and large bricks on any, need more than one row of slices.
    #[test]
    fn every_texel_has_a_place_of_its_own() {
        for (edge, max_width, slices_per_row) in [(5, 100, 5), (5, 12, 2), (5, 5, 1), (4, 15, 3)] {
            let slot = Slot::new(edge, max_width);
            assert_eq!(slot.slices_per_row, slices_per_row);
            assert!(slot.size[0] <= max_width);
            for samples in [[edge; 3], [2, edge, 3], [1, 1, 1]] {
                let num: u32 = samples.iter().product();
                let texels: Vec<u16> = (1..=num as u16).collect();
                let bytes = slot.fold(samples, &texels, |texel| texel);
                let folded: &[u16] = bytemuck::cast_slice(&bytes);
                assert_eq!(folded.len() as u32, slot.size[0] * slot.size[1]);
                assert_eq!(folded.iter().filter(|&&texel| texel != 0).count() as u32, num);
                for (index, &texel) in (0..).zip(&texels) {
                    let [x, y] = [index % samples[0], index / samples[0] % samples[1]];
                    let z = index / samples[0] / samples[1];
                    let column = x + z % slices_per_row * edge;
                    let row = y + z / slices_per_row * edge;
                    assert_eq!(folded[(row * slot.size[0] + column) as usize], texel, "({x}, {y}, {z})");
                }
            }
        }
    }
}
