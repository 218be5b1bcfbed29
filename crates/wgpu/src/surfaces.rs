//! The pass that draws opaque surfaces before all else, into a texture of colours and depths.
//!
//! # Method
//! Triangles go to the device as nine numbers each, relative to the middle of all meshes. They stay there while pictures
//! have the same meshes, told by their revisions. What is nearest is left to the
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
use volery_frame::{PictureView, Revision};
use volery_scene::TriangleMesh;
use volery_scene::mesh::AMBIENT;
use volery_shaders::surfaces;

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PictureTile, Tile};
use crate::tiles::{Affine, TileView};

// What the shader and the rest of the crates must mean alike.
const _: () = assert!(surfaces::AMBIENT as f64 == AMBIENT);

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
    /// Textures to draw to: of each tile, and the depths of the largest.
    targets: Option<(Vec<wgpu::Texture>, wgpu::TextureView)>,
}

/// Meshes on the device.
struct Held {
    meshes: Vec<Revision>,
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

impl Surfaces {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery surfaces", surfaces::BINDINGS),
            module: shader_module(gpu, surfaces::LABEL, surfaces::SOURCE),
            pipeline: None,
            none: view_of(&texture(gpu, [1, 1], COLOR)),
            held: None,
            targets: None,
        })
    }

    /// Draws the surfaces of a picture that begins.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        jobs: &mut Jobs,
        picture: &PictureView<'_>,
        tiles: &[PictureTile],
    ) -> Result<PictureSurfaces, Failure> {
        if picture.meshes.iter().all(|mesh| mesh.triangles().is_empty()) {
            return Ok(PictureSurfaces { views: vec![self.none.clone()], zero_depth: None });
        }
        let is_held =
            |held: &&Held| held.meshes.iter().copied().eq(picture.meshes.iter().map(TriangleMesh::revision));
        if self.held.as_ref().filter(is_held).is_none() {
            self.held = None;
            self.held = Some(gpu.checked(|| Held::new(gpu, picture.meshes))?);
        }
        // All as large as the first tile, which is as large as any, and as the depths.
        let size = tiles[0].tile.size;
        let fits = |(textures, _): &(Vec<wgpu::Texture>, _)| {
            let mut sizes = textures.iter().map(|texture| [texture.width(), texture.height()]);
            textures.len() == tiles.len() && sizes.all(|found| found == size)
        };
        let (textures, depth) = match self.targets.take().filter(fits) {
            Some(targets) => targets,
            None => gpu.checked(|| {
                let textures = tiles.iter().map(|_| texture(gpu, size, COLOR)).collect();
                (textures, view_of(&texture(gpu, size, DEPTH)))
            })?,
        };
        let pipeline = match self.pipeline.take() {
            Some(pipeline) => pipeline,
            None => gpu.checked(|| render_pipeline(gpu, &self.layout, &self.module))?,
        };
        let views: Vec<_> = textures.iter().map(view_of).collect();
        let mut zero_depth = None;
        if let Some(held) = &self.held {
            let zero = *zero_depth.insert(held.depths(picture)[0].max(0.0));
            jobs.begin(None);
            gpu.checked(|| {
                for (tile, view) in tiles.iter().zip(&views) {
                    let bound = self.bind(gpu, held, &shader_frame(picture, held, zero, tile.tile));
                    jobs.submit(gpu, |encoder, clock, _| {
                        let mut pass = begin_pass(
                            encoder,
                            [view, &depth],
                            tile.tile.size,
                            picture.background,
                            clock.render(true, true),
                        );
                        held.encode(&mut pass, &pipeline, &bound);
                    });
                }
            })?;
        }
        self.targets = Some((textures, depth));
        self.pipeline = Some(pipeline);
        Ok(PictureSurfaces { views, zero_depth })
    }

    /// What a tile binds with each chunk.
    fn bind(&self, gpu: &Gpu, held: &Held, frame: &surfaces::Frame) -> Vec<wgpu::BindGroup> {
        let uniform =
            buffer(gpu, Upload::Views, "volery surfaces frame", &[*frame], wgpu::BufferUsages::UNIFORM);
        // A binding that the shader gains and this does not know fails as one of the wrong kind.
        let bind = |chunk: &Chunk| {
            bind_group(gpu, &self.layout, surfaces::BINDINGS, |name| match name {
                "frame" => uniform.as_entire_binding(),
                "corners" => chunk.corners.as_entire_binding(),
                _ => held.colors.as_entire_binding(),
            })
        };
        held.chunks.iter().map(bind).collect()
    }
}

/// The surfaces of a picture, drawn.
pub(crate) struct PictureSurfaces {
    /// Of each tile, or one for all where there is no surface.
    views: Vec<wgpu::TextureView>,
    zero_depth: Option<f64>,
}

impl PictureSurfaces {
    pub(crate) fn is_empty(&self) -> bool {
        self.zero_depth.is_none()
    }

    /// The texture to read in a tile: colours and depths. Something to be bound where there is none.
    pub(crate) fn of_tile(&self, place: usize) -> &wgpu::TextureView {
        &self.views[place % self.views.len()]
    }

    /// The depth, along the view direction from the plane of the eye on, that is 0 in the texture.
    pub(crate) fn zero_depth(&self) -> f64 {
        self.zero_depth.unwrap_or(0.0)
    }
}

/// A pass that draws colours and depths to the corner of two textures.
fn begin_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    [color, depth]: [&wgpu::TextureView; 2],
    [width, height]: [u32; 2],
    background: [f32; 3],
    timestamp_writes: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'a> {
    let [r, g, b] = background.map(f64::from);
    let nothing = wgpu::Color { r, g, b, a: FAR };
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("volery surfaces"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: color,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(nothing), store: wgpu::StoreOp::Store },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        timestamp_writes,
        ..Default::default()
    });
    pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
    pass.set_scissor_rect(0, 0, width, height);
    pass
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
                let corners = buffer(gpu, Upload::Geometry, "volery surface triangles", &corners, storage);
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
        let colors = buffer(gpu, Upload::Geometry, "volery surface colours", &colors, storage);
        let meshes = meshes.iter().map(TriangleMesh::revision).collect();
        Self { meshes, origin, bounds, colors, chunks }
    }

    fn encode(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        bound: &[wgpu::BindGroup],
    ) {
        pass.set_pipeline(pipeline);
        for (chunk, bound) in self.chunks.iter().zip(bound) {
            pass.set_bind_group(0, bound, &[]);
            for (triangles, mesh) in &chunk.runs {
                pass.draw(3 * triangles.start..3 * triangles.end, *mesh..*mesh + 1);
            }
        }
    }

    /// Least and greatest depth of the meshes' bounds.
    fn depths(&self, picture: &PictureView<'_>) -> [f64; 2] {
        let [_, _, forward] = picture.camera.axes();
        let [low, high] = self.bounds;
        let depth = |corner: DVec3| (corner - picture.camera.eye).dot(forward);
        let is_down = forward.cmplt(DVec3::ZERO);
        [depth(DVec3::select(is_down, high, low)), depth(DVec3::select(is_down, low, high))]
    }
}

/// The shader's frame for a tile.
fn shader_frame(picture: &PictureView<'_>, held: &Held, zero_depth: f64, tile: Tile) -> surfaces::Frame {
    let view = TileView::new(picture, tile, 1.0);
    let origin_from_eye = held.origin - picture.camera.eye;
    // A little wider, so that no point is clipped that is in front of the eye.
    let far = (held.depths(picture)[1] * (1.0 + 1e-6)).max(f64::MIN_POSITIVE);
    let near = (zero_depth * (1.0 - 1e-6)).max(if view.is_parallel { 0.0 } else { NEAR * far });
    // Over `w`: the nearest is 1, the farthest 0.
    let scale = if view.is_parallel { 1.0 } else { near } / (far - near);
    let reversed = Affine { slope: -view.forward * scale, rest: far * scale };
    let rays = picture.camera.rays(picture.width, picture.height);
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

fn texture(gpu: &Gpu, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("volery surfaces"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    })
}

fn view_of(texture: &wgpu::Texture) -> wgpu::TextureView {
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
