//! The pipelines that draw cubes as fans of triangles: their buffers from the frame, their commands.
//!
//! # Method
//! Cubes go to the device as they are in the frame, 24 bytes each; the vertex stage does the rest from the tables of
//! `volery-cubefan`, which are uploaded. An instance is a batch of cubes, not one: instances of ten vertices leave
//! most of a GPU idle. Blending adds cubes to the background from back to front, in the order of the frame.
//! A picture is rendered in tiles and copied to its band.
//!
//! # Guarantees
//! Devices that blend 32 bits do so. Others round what they have to 11 bits after each cube: a picture of values up
//! to 1 is wrong by up to 1/4096 for each cube that a ray meets.

use std::ops::Range;

use volery_cubefan::table::{ASPECTS, CORNERS, NUM_VERTICES, TRIANGLES};
use volery_frame::{Cube, Cubes, Drawn, Frame, Thickness, VolumeLayout};
use volery_shaders::{Binding, cubes, resolve};
use wgpu::util::DeviceExt as _;

use crate::bindings::bind_group_layout;
use crate::fan_view::{Tile, shader_frame};
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, Clock, draw_bands_in_passes};

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

/// Most pixels of a tile per axis.
const TILE: u32 = 2048;

/// Most batches of a buffer of cubes: 25 MB.
const CHUNK_BATCHES: u64 = 160;

/// Indices of a whole batch.
const BATCH_INDICES: u32 = cubes::BATCH * CUBE_INDICES;
const CUBE_INDICES: u32 = 3 * TRIANGLES.len() as u32;

/// The pipelines, and what the last frame can lend to the next.
pub(crate) struct CubeFans {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// For exact and for interpolated thickness; compiled when first needed.
    pipelines: [Option<wgpu::RenderPipeline>; 2],
    resolve_layout: wgpu::BindGroupLayout,
    resolve: wgpu::ComputePipeline,
    aspects: wgpu::Buffer,
    indices: wgpu::Buffer,
    chunks: Vec<wgpu::Buffer>,
    target: Option<wgpu::Texture>,
}

/// What a tile of the picture binds.
struct BoundTile {
    size: [u32; 2],
    /// With each chunk of cubes.
    fans: Vec<wgpu::BindGroup>,
    resolve: wgpu::BindGroup,
}

impl CubeFans {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let shader = |label, source: &'static str| {
                let source = wgpu::ShaderSource::Wgsl(source.into());
                gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
            };
            let resolve_layout = bind_group_layout(&gpu.device, "volery resolve", resolve::BINDINGS);
            Self {
                layout: bind_group_layout(&gpu.device, "volery cubes", cubes::BINDINGS),
                module: shader(cubes::LABEL, cubes::SOURCE),
                pipelines: [None, None],
                resolve: gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some("volery resolve"),
                    layout: Some(&pipeline_layout(gpu, &resolve_layout)),
                    module: &shader(resolve::LABEL, resolve::SOURCE),
                    entry_point: Some(resolve::MAIN),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    cache: None,
                }),
                resolve_layout,
                aspects: buffer(gpu, "volery cube aspects", &aspects(), wgpu::BufferUsages::STORAGE),
                indices: buffer(gpu, "volery cube indices", &batch_indices(), wgpu::BufferUsages::INDEX),
                chunks: Vec::new(),
                target: None,
            }
        })
    }

    /// Draws a checked frame of cubes.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        layout: &VolumeLayout,
        band: &mut Option<Band>,
        frame: &Frame<'_>,
        content: &Cubes<'_>,
    ) -> Result<Drawn, Failure> {
        let pipeline = self.pipeline(gpu, content.thickness)?;
        let size = [frame.width, frame.height];
        let (chunks, target) = gpu.checked(|| (self.hold(gpu, content.cubes), self.target(gpu, size)))?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let bind = |picture: &wgpu::Buffer, rows: Range<u32>| {
            let bind =
                |tile| self.bind(gpu, &shader_frame(frame, layout, tile), tile, rows.start, &view, picture);
            Tile::of(frame.width, rows.clone(), TILE).map(bind).collect()
        };
        let [r, g, b] = frame.background.map(f64::from);
        let clear = wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 });
        let encode = |encoder: &mut wgpu::CommandEncoder, clock: Clock<'_>, tiles: &Vec<BoundTile>, _| {
            for (place, tile) in tiles.iter().enumerate() {
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("volery cubes"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations { load: clear, store: wgpu::StoreOp::Store },
                    })],
                    timestamp_writes: clock.at_start().filter(|_| place == 0),
                    ..Default::default()
                });
                let [width, height] = tile.size;
                pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
                pass.set_scissor_rect(0, 0, width, height);
                pass.set_pipeline(&pipeline);
                pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint16);
                for (bound, &num_cubes) in tile.fans.iter().zip(&chunks) {
                    pass.set_bind_group(0, bound, &[]);
                    draw_cubes(&mut pass, num_cubes);
                }
                drop(pass);
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("volery resolve"),
                    timestamp_writes: clock.at_end().filter(|_| place + 1 == tiles.len()),
                });
                pass.set_pipeline(&self.resolve);
                pass.set_bind_group(0, &tile.resolve, &[]);
                let [x, y] = tile.size.map(|pixels| pixels.div_ceil(resolve::GROUP));
                pass.dispatch_workgroups(x, y, 1);
            }
        };
        draw_bands_in_passes(gpu, band, size, resolve::GROUP, bind, encode)
    }

    /// Uploads cubes in chunks that bindings can hold; the numbers of cubes in each.
    fn hold(&mut self, gpu: &Gpu, cubes: &[Cube]) -> Vec<u32> {
        let batch_bytes = u64::from(cubes::BATCH) * size_of::<Cube>() as u64;
        let limits = gpu.device.limits();
        let most_bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let batches = CHUNK_BATCHES.min(most_bytes / batch_bytes).max(1);
        let chunks = cubes.chunks((batches * u64::from(cubes::BATCH)) as usize);
        self.chunks.truncate(chunks.len());
        for (place, chunk) in chunks.clone().enumerate() {
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
            gpu.queue.write_buffer(&self.chunks[place], 0, contents);
        }
        chunks.map(|chunk| chunk.len() as u32).collect()
    }

    /// A texture for the largest tile of a picture.
    fn target(&mut self, gpu: &Gpu, size: [u32; 2]) -> wgpu::Texture {
        let [width, height] = size.map(|pixels| pixels.min(TILE));
        let kept = self.target.take().filter(|held| [held.width(), held.height()] == [width, height]);
        let make = || {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("volery tile"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: format(gpu),
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            })
        };
        self.target.insert(kept.unwrap_or_else(make)).clone()
    }

    /// A tile of the band that begins with row `first_row`.
    fn bind(
        &self,
        gpu: &Gpu,
        frame: &cubes::Frame,
        tile: Tile,
        first_row: u32,
        rendered: &wgpu::TextureView,
        picture: &wgpu::Buffer,
    ) -> BoundTile {
        let uniform = wgpu::BufferUsages::UNIFORM;
        let frame = buffer(gpu, "volery cubes frame", &[*frame], uniform);
        let in_band = resolve::Tile {
            origin: [tile.first[0], tile.first[1] - first_row],
            size: tile.size,
            band_width: tile.picture_width,
            ..bytemuck::Zeroable::zeroed()
        };
        let in_band = buffer(gpu, "volery tile in its band", &[in_band], uniform);
        // A binding that a shader gains and this does not know fails as one of the wrong kind.
        let bind_fans = |held: &wgpu::Buffer| {
            bind_group(gpu, &self.layout, cubes::BINDINGS, |name| match name {
                "frame" => frame.as_entire_binding(),
                "aspects" => self.aspects.as_entire_binding(),
                _ => held.as_entire_binding(),
            })
        };
        BoundTile {
            size: tile.size,
            fans: self.chunks.iter().map(bind_fans).collect(),
            resolve: bind_group(gpu, &self.resolve_layout, resolve::BINDINGS, |name| match name {
                "tile" => in_band.as_entire_binding(),
                "rendered" => wgpu::BindingResource::TextureView(rendered),
                _ => picture.as_entire_binding(),
            }),
        }
    }

    /// The pipeline for a kind of thickness, compiled if this is the first frame that needs it.
    fn pipeline(&mut self, gpu: &Gpu, thickness: Thickness) -> Result<wgpu::RenderPipeline, Failure> {
        let is_exact = thickness == Thickness::Exact;
        let made = &mut self.pipelines[usize::from(is_exact)];
        if let Some(pipeline) = made {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked(|| render_pipeline(gpu, &self.layout, &self.module, is_exact))?;
        Ok(made.insert(pipeline).clone())
    }
}

fn render_pipeline(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
    is_exact: bool,
) -> wgpu::RenderPipeline {
    let constants = [(cubes::IS_EXACT, f64::from(is_exact))];
    let options = wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(if is_exact { "volery cubes" } else { "volery cubes, interpolated thickness" }),
        layout: Some(&pipeline_layout(gpu, layout)),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(cubes::FAN),
            compilation_options: options.clone(),
            buffers: &[],
        },
        // Nothing is culled: on the grid of subpixels a sliver may turn over.
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(cubes::MATTER),
            compilation_options: options,
            targets: &[Some(wgpu::ColorTargetState {
                format: format(gpu),
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// The widest format that blends.
fn format(gpu: &Gpu) -> wgpu::TextureFormat {
    if gpu.has(wgpu::Features::FLOAT32_BLENDABLE) {
        wgpu::TextureFormat::Rgba32Float
    } else {
        wgpu::TextureFormat::Rgba16Float
    }
}

/// Draws the cubes of a chunk: whole batches, then the rest.
fn draw_cubes(pass: &mut wgpu::RenderPass<'_>, num_cubes: u32) {
    let (batches, rest) = (num_cubes / cubes::BATCH, num_cubes % cubes::BATCH);
    pass.draw_indexed(0..BATCH_INDICES, 0, 0..batches);
    pass.draw_indexed(0..rest * CUBE_INDICES, 0, batches..batches + 1);
}

fn pipeline_layout(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    })
}

fn bind_group<'a>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    bindings: &[Binding],
    resource: impl Fn(&str) -> wgpu::BindingResource<'a>,
) -> wgpu::BindGroup {
    let entry = |b: &Binding| wgpu::BindGroupEntry { binding: b.binding, resource: resource(b.name) };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn buffer<T: bytemuck::NoUninit>(
    gpu: &Gpu,
    label: &str,
    contents: &[T],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let contents = bytemuck::cast_slice(contents);
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
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
