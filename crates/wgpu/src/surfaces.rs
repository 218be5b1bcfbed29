//! The pass that draws opaque surfaces before all else, into a texture of colours and depths.
//!
//! # Method
//! Triangles go to the device as nine numbers each, relative to the middle of all meshes. They stay there while frames
//! have the same meshes, told by comparing them with a copy: no name of a mesh can be stale. What is nearest is left to the
//! depth buffer, in 32 bits and reversed, from 1 at the nearest point of all meshes to 0 at the farthest: so floats hold
//! it to the last digit, wherever the eye is. Of equals the first stays.
//!
//! Whoever draws matter, planes, cubes or sheets reads the texture per pixel and ends there. A frame without meshes
//! has no pass, and pipelines without the reading: a texture of one texel is bound and never read.
//!
//! # Limits
//! In perspective what is nearer to the eye than [`NEAR`] of the farthest depth is not seen. A device puts corners on
//! 1/256 of a pixel.

use std::ops::Range;

use glam::DVec3;
use volery_frame::Frame;
use volery_scene::TriangleMesh;
use volery_shaders::surfaces;

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu};
use crate::tiles::{Affine, Tile, TileView};

/// See the module's limits.
const NEAR: f64 = 1e-9;

/// Depth where there is no surface: farther than any, and of a square that f32 holds.
const FAR: f64 = 1e18;

/// Most triangles of a buffer: 38 MB.
const CHUNK_TRIANGLES: u64 = 1 << 20;

const TRIANGLE_BYTES: u64 = 36;

/// Of what is drawn.
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The pipeline, and what the last frame can lend to the next.
pub(crate) struct Surfaces {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Compiled when first needed.
    pipeline: Option<wgpu::RenderPipeline>,
    /// To be bound where there is no surface.
    none: wgpu::TextureView,
    held: Option<Held>,
    targets: Option<Targets>,
}

/// Meshes on the device.
struct Held {
    meshes: Vec<TriangleMesh>,
    origin: DVec3,
    /// Of all points.
    bounds: [DVec3; 2],
    colors: wgpu::Buffer,
    chunks: Vec<Chunk>,
}

struct Chunk {
    corners: wgpu::Buffer,
    /// Triangles of the chunk, and their mesh.
    runs: Vec<(Range<u32>, u32)>,
}

/// Textures to draw to.
#[derive(Clone)]
struct Targets {
    size: [u32; 2],
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl Surfaces {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery surfaces", surfaces::BINDINGS),
            module: shader_module(gpu, surfaces::LABEL, surfaces::SOURCE),
            pipeline: None,
            none: view(gpu, [1, 1], COLOR),
            held: None,
            targets: None,
        })
    }

    /// The surfaces of a checked frame, to be drawn in tiles of up to so many pixels.
    pub(crate) fn of_frame<'a>(
        &'a mut self,
        gpu: &'a Gpu,
        frame: &'a Frame<'a>,
        size: [u32; 2],
    ) -> Result<FrameSurfaces<'a>, Failure> {
        if !has_surfaces(frame) {
            return Ok(FrameSurfaces { gpu, none: &self.none, drawn: None });
        }
        if self.held.as_ref().is_none_or(|held| held.meshes != frame.meshes) {
            self.held = None;
            self.held = Some(gpu.checked(|| Held::new(gpu, frame.meshes))?);
        }
        if self.targets.as_ref().is_none_or(|targets| targets.size != size) {
            self.targets = None;
            self.targets = Some(gpu.checked(|| Targets {
                size,
                color: view(gpu, size, COLOR),
                depth: view(gpu, size, DEPTH),
            })?);
        }
        if self.pipeline.is_none() {
            self.pipeline = Some(gpu.checked(|| render_pipeline(gpu, &self.layout, &self.module))?);
        }
        let Self { layout, pipeline, none, held, targets, .. } = self;
        let drawn = match (held, targets, pipeline) {
            (Some(held), Some(targets), Some(pipeline)) => {
                let zero_depth = held.depths(frame)[0].max(0.0);
                Some(Drawing { frame, held, targets, pipeline, layout, zero_depth })
            }
            _ => None,
        };
        Ok(FrameSurfaces { gpu, none, drawn })
    }
}

/// Whether a frame has any surface.
pub(crate) fn has_surfaces(frame: &Frame<'_>) -> bool {
    frame.meshes.iter().any(|mesh| !mesh.triangles().is_empty())
}

/// The surfaces of one frame.
pub(crate) struct FrameSurfaces<'a> {
    gpu: &'a Gpu,
    none: &'a wgpu::TextureView,
    drawn: Option<Drawing<'a>>,
}

struct Drawing<'a> {
    frame: &'a Frame<'a>,
    held: &'a Held,
    targets: &'a Targets,
    pipeline: &'a wgpu::RenderPipeline,
    layout: &'a wgpu::BindGroupLayout,
    zero_depth: f64,
}

/// What the surfaces of a tile bind.
pub(crate) struct BoundSurfaces {
    size: [u32; 2],
    chunks: Vec<wgpu::BindGroup>,
}

impl FrameSurfaces<'_> {
    pub(crate) fn is_empty(&self) -> bool {
        self.drawn.is_none()
    }

    /// The texture to read: colours and depths of a tile that was drawn. Something to be bound where there is none.
    pub(crate) fn view(&self) -> &wgpu::TextureView {
        self.drawn.as_ref().map_or(self.none, |drawn| &drawn.targets.color)
    }

    /// The depth, along the view direction from the plane of the eye on, that is 0 in the texture.
    pub(crate) fn zero_depth(&self) -> f64 {
        self.drawn.as_ref().map_or(0.0, |drawn| drawn.zero_depth)
    }

    /// What a tile binds, if the frame has surfaces.
    pub(crate) fn bind(&self, tile: Tile) -> Option<BoundSurfaces> {
        let Drawing { frame, held, layout, zero_depth, .. } = self.drawn.as_ref()?;
        let shader_frame = shader_frame(frame, held, *zero_depth, tile);
        let uniform = buffer(self.gpu, "volery surfaces frame", &[shader_frame], wgpu::BufferUsages::UNIFORM);
        // A binding that the shader gains and this does not know fails as one of the wrong kind.
        let bind = |chunk: &Chunk| {
            bind_group(self.gpu, layout, surfaces::BINDINGS, |name| match name {
                "frame" => uniform.as_entire_binding(),
                "corners" => chunk.corners.as_entire_binding(),
                _ => held.colors.as_entire_binding(),
            })
        };
        Some(BoundSurfaces { size: tile.size, chunks: held.chunks.iter().map(bind).collect() })
    }

    /// Draws the surfaces of a tile.
    pub(crate) fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
        tile: &BoundSurfaces,
    ) {
        let Some(Drawing { frame, held, targets, pipeline, .. }) = &self.drawn else { return };
        let [r, g, b] = frame.background.map(f64::from);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("volery surfaces"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &targets.color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: FAR }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            timestamp_writes,
            ..Default::default()
        });
        let [width, height] = tile.size;
        pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
        pass.set_scissor_rect(0, 0, width, height);
        pass.set_pipeline(pipeline);
        for (chunk, bound) in held.chunks.iter().zip(&tile.chunks) {
            pass.set_bind_group(0, bound, &[]);
            for (triangles, mesh) in &chunk.runs {
                pass.draw(3 * triangles.start..3 * triangles.end, *mesh..*mesh + 1);
            }
        }
    }
}

impl Held {
    fn new(gpu: &Gpu, meshes: &[TriangleMesh]) -> Self {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let points = || meshes.iter().flat_map(TriangleMesh::points);
        let bounds = points().fold(none, |[low, high], &point| [low.min(point), high.max(point)]);
        let origin = 0.5 * bounds[0] + 0.5 * bounds[1];
        let limits = gpu.device.limits();
        let most_bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let most_triangles = CHUNK_TRIANGLES.min(most_bytes / TRIANGLE_BYTES).max(1) as usize;
        let storage = wgpu::BufferUsages::STORAGE;
        let mut chunks = Vec::new();
        let (mut corners, mut runs, mut num_triangles) = (Vec::<[[f32; 3]; 3]>::new(), Vec::new(), 0);
        let mut finish = |corners: &mut Vec<[[f32; 3]; 3]>, runs: &mut Vec<_>| {
            if !corners.is_empty() {
                let corners = std::mem::take(corners);
                let corners = buffer(gpu, "volery surface triangles", &corners, storage);
                chunks.push(Chunk { corners, runs: std::mem::take(runs) });
            }
        };
        for (number, mesh) in (0..).zip(meshes) {
            let mut rest = mesh.triangles();
            while !rest.is_empty() {
                let room = most_triangles - corners.len();
                let (now, later) = rest.split_at(room.min(rest.len()));
                rest = later;
                let place = |corner: u32| (mesh.points()[corner as usize] - origin).as_vec3().to_array();
                corners.extend(now.iter().map(|triangle| triangle.map(place)));
                runs.push((num_triangles..corners.len() as u32, number));
                num_triangles = corners.len() as u32;
                if corners.len() == most_triangles {
                    finish(&mut corners, &mut runs);
                    num_triangles = 0;
                }
            }
        }
        finish(&mut corners, &mut runs);
        let color = |mesh: &TriangleMesh| {
            let [r, g, b] = mesh.color();
            [r, g, b, 0.0].map(|channel| channel as f32)
        };
        let colors: Vec<[f32; 4]> = meshes.iter().map(color).collect();
        let colors = buffer(gpu, "volery surface colours", &colors, storage);
        Self { meshes: meshes.to_vec(), origin, bounds, colors, chunks }
    }

    /// Least and greatest depth of the meshes' bounds.
    fn depths(&self, frame: &Frame<'_>) -> [f64; 2] {
        let [_, _, forward] = frame.camera.axes();
        let [low, high] = self.bounds;
        let depth = |corner: DVec3| (corner - frame.camera.eye).dot(forward);
        let is_down = forward.cmplt(DVec3::ZERO);
        [depth(DVec3::select(is_down, high, low)), depth(DVec3::select(is_down, low, high))]
    }
}

/// The shader's frame for a tile.
fn shader_frame(frame: &Frame<'_>, held: &Held, zero_depth: f64, tile: Tile) -> surfaces::Frame {
    let view = TileView::new(frame, tile, 1.0);
    let origin_from_eye = held.origin - frame.camera.eye;
    // A little wider, so that no point is clipped that is in front of the eye.
    let far = (held.depths(frame)[1] * (1.0 + 1e-6)).max(f64::MIN_POSITIVE);
    let near = (zero_depth * (1.0 - 1e-6)).max(if view.is_parallel { 0.0 } else { NEAR * far });
    // Over `w`: the nearest is 1, the farthest 0.
    let scale = if view.is_parallel { 1.0 } else { near } / (far - near);
    let reversed = Affine { slope: -view.forward * scale, rest: far * scale };
    let rays = frame.camera.rays(frame.width, frame.height);
    let [first_x, first_y] = tile.first.map(f64::from);
    let at = |corner: DVec3, dx: DVec3, dy: DVec3| corner + dx * first_x + dy * first_y;
    let toward = at(rays.toward, rays.toward_dx, rays.toward_dy);
    let narrow = |v: DVec3| v.as_vec3().to_array();
    surfaces::Frame {
        clip_x: view.clip_x.relative_to(origin_from_eye),
        clip_y: view.clip_y.relative_to(origin_from_eye),
        clip_z: reversed.relative_to(origin_from_eye),
        clip_w: view.clip_w.relative_to(origin_from_eye),
        depth: Affine { slope: view.forward, rest: -zero_depth }.relative_to(origin_from_eye),
        start: narrow(at(rays.origin, rays.origin_dx, rays.origin_dy) + toward * zero_depth - held.origin),
        start_dx: narrow(rays.origin_dx + rays.toward_dx * zero_depth),
        start_dy: narrow(rays.origin_dy + rays.toward_dy * zero_depth),
        toward: narrow(toward),
        toward_dx: narrow(rays.toward_dx),
        toward_dy: narrow(rays.toward_dy),
        ..bytemuck::Zeroable::zeroed()
    }
}

fn view(gpu: &Gpu, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("volery surfaces"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

fn render_pipeline(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
) -> wgpu::RenderPipeline {
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("volery surfaces"),
        layout: Some(&pipeline_layout(gpu, layout)),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(surfaces::CORNER),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        // Either side is seen.
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(surfaces::SURFACE),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(COLOR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
