//! Parts that are rendered, not traced: into a texture that blends, from back to front over nothing; what comes of it is
//! put behind what pixels have gathered.

use glam::DVec3;
use volery_frame::PictureView;
use volery_scene::Projection;
use volery_shaders::gather;

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PartKind, Picture, PictureTile, Tile};

/// How a tile's camera sees places relative to the eye, in f64. Depth in clip space is half of `w`: there is no near
/// plane but that of the eye, and nothing is too far.
pub(crate) struct TileView {
    /// What maps places to clip coordinates.
    pub(crate) clip_x: Affine,
    pub(crate) clip_y: Affine,
    pub(crate) clip_w: Affine,
    pub(crate) forward: DVec3,
    pub(crate) is_parallel: bool,
    /// The image point before the eye, in pixels of the tile.
    pub(crate) center: [f64; 2],
    /// Change per pixel to the right and down of a ray whose part along `forward` is 1; zero in parallel.
    pub(crate) ray_per_pixel: [DVec3; 2],
}

/// A number that is affine in the place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Affine {
    pub(crate) slope: DVec3,
    pub(crate) rest: f64,
}

impl Affine {
    /// As the shaders have it: for places relative to an anchor.
    pub(crate) fn relative_to(self, anchor_from_eye: DVec3) -> [f32; 4] {
        self.slope.extend(self.slope.dot(anchor_from_eye) + self.rest).as_vec4().to_array()
    }
}

impl TileView {
    /// The view of a tile, for places in units of `unit` world lengths.
    pub(crate) fn new(picture: &PictureView<'_>, tile: Tile, unit: f64) -> Self {
        let rays = picture.camera.rays(picture.width, picture.height);
        let [_, _, forward] = picture.camera.axes();
        let is_parallel = matches!(picture.camera.projection, Projection::Orthographic { .. });
        let (dx, dy) = if is_parallel {
            (rays.origin_dx / unit, rays.origin_dy / unit)
        } else {
            (rays.toward_dx, rays.toward_dy)
        };
        // Pixels from the middle of the picture, times depth in perspective.
        let (pixels_x, pixels_y) = (dx / dx.length_squared(), dy / dy.length_squared());
        let (depth, is_unit) = if is_parallel { (DVec3::ZERO, 1.0) } else { (forward, 0.0) };
        let [width, height] = tile.size.map(f64::from);
        let center_x = f64::from(picture.width) / 2.0 - f64::from(tile.first[0]);
        let center_y = f64::from(picture.height) / 2.0 - f64::from(tile.first[1]);
        let (shift_x, shift_y) = (2.0 * center_x / width - 1.0, 1.0 - 2.0 * center_y / height);
        let clip = |pixels, shift| Affine { slope: pixels + depth * shift, rest: is_unit * shift };
        Self {
            clip_x: clip(pixels_x * (2.0 / width), shift_x),
            clip_y: clip(pixels_y * (-2.0 / height), shift_y),
            clip_w: Affine { slope: depth, rest: is_unit },
            forward,
            is_parallel,
            center: [center_x, center_y],
            ray_per_pixel: [dx, dy].map(|d| d * (1.0 - is_unit)),
        }
    }
}

/// What gathers rendered tiles, and what the last part can lend to the next.
pub(crate) struct Tiles {
    layout: wgpu::BindGroupLayout,
    gather: wgpu::ComputePipeline,
    target: Option<wgpu::Texture>,
}

impl Tiles {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let layout = bind_group_layout(&gpu.device, "volery gather", gather::BINDINGS);
            let gather = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("volery gather"),
                layout: Some(&pipeline_layout(gpu, &layout)),
                module: &shader_module(gpu, gather::LABEL, gather::SOURCE),
                entry_point: Some(gather::MAIN),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
            Self { layout, gather, target: None }
        })
    }

    /// Adds a part to a picture, tile by tile: `bind` makes what a tile binds, given its place among them, `encode` adds
    /// the commands.
    pub(crate) fn add<B>(
        &mut self,
        gpu: &Gpu,
        (picture, jobs): (&mut Picture, &mut Jobs),
        kind: PartKind,
        mut bind: impl FnMut(&Picture, usize) -> B,
        mut encode: impl FnMut(&mut wgpu::RenderPass<'_>, &B),
    ) -> Result<u32, Failure> {
        // The first tile is as large as any.
        let target = gpu.checked(|| self.target(gpu, picture.tiles[0].tile.size))?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        picture.add(gpu, jobs, kind, |encoder, clock, _, (picture, place)| {
            let bound = bind(picture, place);
            let PictureTile { tile, gathered, .. } = &picture.tiles[place];
            let [width, height] = tile.size;
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("volery tile"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                timestamp_writes: clock.render(true, false),
                ..Default::default()
            });
            pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, 0, width, height);
            encode(&mut pass, &bound);
            drop(pass);
            let gathering = self.bind_gather(gpu, *tile, picture.is_first(place), (&view, gathered));
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("volery gather"),
                timestamp_writes: clock.compute(false, true),
            });
            pass.set_pipeline(&self.gather);
            pass.set_bind_group(0, &gathering, &[]);
            pass.dispatch_workgroups(width.div_ceil(gather::GROUP), height.div_ceil(gather::GROUP), 1);
        })
    }

    /// A texture for the largest tile of a picture.
    fn target(&mut self, gpu: &Gpu, [width, height]: [u32; 2]) -> wgpu::Texture {
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

    fn bind_gather(
        &self,
        gpu: &Gpu,
        tile: Tile,
        is_first: bool,
        (rendered, gathered): (&wgpu::TextureView, &wgpu::Buffer),
    ) -> wgpu::BindGroup {
        let tile =
            gather::Tile { size: tile.size, is_first: is_first.into(), ..bytemuck::Zeroable::zeroed() };
        let tile = buffer(gpu, Upload::Views, "volery gather tile", &[tile], wgpu::BufferUsages::UNIFORM);
        // A binding that the shader gains and this does not know fails as one of the wrong kind.
        bind_group(gpu, &self.layout, gather::BINDINGS, |name| match name {
            "tile" => tile.as_entire_binding(),
            "rendered" => wgpu::BindingResource::TextureView(rendered),
            _ => gathered.as_entire_binding(),
        })
    }
}

/// A pipeline that draws triangles of matter over what is there, both sides of them: stages `vertex` and `fragment` of
/// a module.
pub(crate) fn matter_pipeline(
    gpu: &Gpu,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
    [vertex, fragment]: [&str; 2],
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let options = wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&pipeline_layout(gpu, layout)),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: options.clone(),
            buffers: &[],
        },
        // Nothing is culled: on the grid of subpixels a sliver may turn over.
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
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
