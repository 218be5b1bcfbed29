//! The pipelines that draw cubes as fans of triangles: their buffers from the frame, their commands.
//!
//! # Method
//! Cubes go to the device as they are in the frame, 24 bytes each; the vertex stage does the rest from the tables of
//! `volery-cubefan`, which are uploaded. An instance is a batch of cubes, not one: instances of ten vertices leave
//! most of a GPU idle. Blending adds cubes to the background from back to front, in the order of the frame.
//!
//! # Guarantees
//! Devices that blend 32 bits do so. Others round what they have to 11 bits after each cube: a picture of values up
//! to 1 is wrong by up to 1/4096 for each cube that a ray meets.

use volery_cubefan::table::{ASPECTS, CORNERS, NUM_VERTICES, TRIANGLES};
use volery_frame::{Cube, Cubes, Revision, Thickness, VolumeLayout};
use volery_shaders::cubes;

use crate::bindings::{bind_group, bind_group_layout, buffer, shader_module};
use crate::fan_view::shader_frame;
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PartKind, Picture};
use crate::tiles::{Tiles, matter_pipeline};

// What the shader and the rest of the crates must mean alike.
const _: () = assert!(cubes::NUM_VERTICES as usize == NUM_VERTICES);
const _: () = assert!(cubes::BATCH as usize * NUM_VERTICES <= u16::MAX as usize);
const _: () = assert!(cubes::CLASS_SHIFT >= cubes::CORNER_BITS * cubes::NUM_VERTICES);
const _: () = {
    use std::mem::offset_of;
    assert!(size_of::<Cube>() == size_of::<cubes::Cube>());
    assert!(offset_of!(Cube, index) == offset_of!(cubes::Cube, index_xy));
    assert!(offset_of!(Cube, level) == offset_of!(cubes::Cube, index_z_level) + 2);
    assert!(offset_of!(Cube, color) == offset_of!(cubes::Cube, red));
    assert!(offset_of!(Cube, extinction) == offset_of!(cubes::Cube, extinction));
};

/// Most batches of a buffer of cubes: 25 MB.
const CHUNK_BATCHES: u64 = 160;

/// Indices of a whole batch.
const BATCH_INDICES: u32 = cubes::BATCH * CUBE_INDICES;
const CUBE_INDICES: u32 = 3 * TRIANGLES.len() as u32;

/// The pipelines, and what the last frame can lend to the next.
pub(crate) struct CubeFans {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// For interpolated and for exact thickness; each without and with surfaces. Compiled when first needed.
    pipelines: [[Option<wgpu::RenderPipeline>; 2]; 2],
    aspects: wgpu::Buffer,
    indices: wgpu::Buffer,
    chunks: Vec<wgpu::Buffer>,
    /// What the chunks hold, if it has a name.
    held: Option<Revision>,
}

impl CubeFans {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery cubes", cubes::BINDINGS),
            module: shader_module(gpu, cubes::LABEL, cubes::SOURCE),
            pipelines: [[None, None], [None, None]],
            aspects: buffer(
                gpu,
                Upload::Geometry,
                "volery cube aspects",
                &aspects(),
                wgpu::BufferUsages::STORAGE,
            ),
            indices: buffer(
                gpu,
                Upload::Geometry,
                "volery cube indices",
                &batch_indices(),
                wgpu::BufferUsages::INDEX,
            ),
            chunks: Vec::new(),
            held: None,
        })
    }

    /// Adds a checked part of cubes to a picture.
    pub(crate) fn add(
        &mut self,
        gpu: &Gpu,
        layout: &VolumeLayout,
        tiles: &mut Tiles,
        (picture, jobs): (&mut Picture, &mut Jobs),
        content: &Cubes<'_>,
    ) -> Result<u32, Failure> {
        let pipeline = self.pipeline(gpu, content.thickness, !picture.surfaces.is_empty())?;
        let chunks = gpu.checked(|| self.hold(gpu, content))?;
        let bind = |picture: &Picture, place: usize| {
            let frame = shader_frame(picture, layout, picture.tiles[place].tile);
            self.bind(gpu, &frame, picture.surfaces.of_tile(place))
        };
        tiles.add(gpu, (picture, jobs), PartKind::default(), bind, |pass, fans: &Vec<wgpu::BindGroup>| {
            pass.set_pipeline(&pipeline);
            pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
            for (bound, &num_cubes) in fans.iter().zip(&chunks) {
                pass.set_bind_group(0, bound, &[]);
                draw_cubes(pass, num_cubes);
            }
        })
    }

    /// Uploads cubes, unless they are there, in chunks that bindings can hold; the numbers of cubes in each.
    fn hold(&mut self, gpu: &Gpu, &Cubes { revision, cubes, .. }: &Cubes<'_>) -> Vec<u32> {
        let batch_bytes = u64::from(cubes::BATCH) * size_of::<Cube>() as u64;
        let limits = gpu.device.limits();
        let most_bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let batches = CHUNK_BATCHES.min(most_bytes / batch_bytes).max(1);
        let chunks = cubes.chunks((batches * u64::from(cubes::BATCH)) as usize);
        let num_cubes = chunks.clone().map(|chunk| chunk.len() as u32).collect();
        if revision.is_some() && std::mem::replace(&mut self.held, revision) == revision {
            return num_cubes;
        }
        self.held = revision;
        self.chunks.truncate(chunks.len());
        for (place, chunk) in chunks.enumerate() {
            let contents: &[u8] = bytemuck::cast_slice(chunk);
            let bytes = (contents.len() as u64).next_multiple_of(batch_bytes);
            if self.chunks.get(place).is_none_or(|held| held.size() < bytes) {
                let held = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("volery cubes"),
                    size: bytes,
                    usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                });
                self.chunks.truncate(place);
                self.chunks.push(held);
            }
            gpu.count(Upload::Geometry, contents.len());
            gpu.queue.write_buffer(&self.chunks[place], 0, contents);
        }
        num_cubes
    }

    /// What a tile binds with each chunk of cubes.
    fn bind(&self, gpu: &Gpu, frame: &cubes::Frame, surfaces: &wgpu::TextureView) -> Vec<wgpu::BindGroup> {
        let frame = buffer(gpu, Upload::Views, "volery cubes frame", &[*frame], wgpu::BufferUsages::UNIFORM);
        // A binding that the shader gains and this does not know fails as one of the wrong kind.
        let bind = |held: &wgpu::Buffer| {
            bind_group(gpu, &self.layout, cubes::BINDINGS, |name| match name {
                "frame" => frame.as_entire_binding(),
                "aspects" => self.aspects.as_entire_binding(),
                "surfaces" => wgpu::BindingResource::TextureView(surfaces),
                _ => held.as_entire_binding(),
            })
        };
        self.chunks.iter().map(bind).collect()
    }

    /// The pipeline for a kind of thickness, and for surfaces or none, compiled if this is the first frame that needs
    /// it.
    fn pipeline(
        &mut self,
        gpu: &Gpu,
        thickness: Thickness,
        has_surfaces: bool,
    ) -> Result<wgpu::RenderPipeline, Failure> {
        let is_exact = thickness == Thickness::Exact;
        let made = &mut self.pipelines[usize::from(is_exact)][usize::from(has_surfaces)];
        if let Some(pipeline) = made {
            return Ok(pipeline.clone());
        }
        let label = if is_exact { "volery cubes" } else { "volery cubes, interpolated thickness" };
        let stages = [cubes::FAN, cubes::MATTER];
        let constants =
            [(cubes::IS_EXACT, f64::from(is_exact)), (cubes::HAS_SURFACES, f64::from(has_surfaces))];
        let make = || matter_pipeline(gpu, label, &self.layout, &self.module, stages, &constants);
        Ok(made.insert(gpu.checked(make)?).clone())
    }
}

/// Draws the cubes of a chunk: whole batches, then the rest.
fn draw_cubes(pass: &mut wgpu::RenderPass<'_>, num_cubes: u32) {
    let (batches, rest) = (num_cubes / cubes::BATCH, num_cubes % cubes::BATCH);
    pass.draw_indexed(0..BATCH_INDICES, 0, 0..batches);
    pass.draw_indexed(0..rest * CUBE_INDICES, 0, batches..batches + 1);
}

/// Per sides and first axis one word: the corners of the ten vertices, and the class.
fn aspects() -> Vec<u32> {
    let word = |&aspect: &u8| {
        let class = u32::from(aspect % 4);
        let corners = CORNERS[usize::from(aspect)].iter().rev();
        corners.fold(class, |word, &corner| word << cubes::CORNER_BITS | u32::from(corner))
    };
    ASPECTS.as_flattened().iter().map(word).collect()
}

fn batch_indices() -> Vec<u16> {
    let of_cube =
        |cube| TRIANGLES.as_flattened().iter().map(move |&i| cube * NUM_VERTICES as u16 + u16::from(i));
    (0..cubes::BATCH as u16).flat_map(of_cube).collect()
}
