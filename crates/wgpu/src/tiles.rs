//! Pictures that are rendered, not traced: tile by tile into a texture that blends, each copied to its band.

use std::ops::Range;

use glam::DVec3;
use volery_frame::{Drawn, Frame};
use volery_scene::Projection;
use volery_shaders::resolve;

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, Clock, draw_bands_in_passes};
use crate::surfaces::{BoundSurfaces, FrameSurfaces};

/// Most pixels of a tile per axis.
const TILE: u32 = 2048;

/// The least and the largest number of each channel that may be drawn.
pub(crate) type Colors = [[f32; 3]; 2];

/// Whatever is drawn.
pub(crate) const ANY_COLOR: Colors = [[f32::MIN; 3], [f32::MAX; 3]];

/// A part of a picture that is drawn at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    /// Column and row of its first pixel.
    pub(crate) first: [u32; 2],
    /// Pixels.
    pub(crate) size: [u32; 2],
    pub(crate) picture_width: u32,
}

impl Tile {
    /// The tiles of a band of rows, of at most `most` pixels per axis.
    fn of(picture_width: u32, rows: Range<u32>, most: u32) -> impl Iterator<Item = Self> {
        let starts = rows.clone().step_by(most as usize);
        starts.flat_map(move |row| {
            let height = most.min(rows.end - row);
            (0..picture_width).step_by(most as usize).map(move |column| {
                let size = [most.min(picture_width - column), height];
                Self { first: [column, row], size, picture_width }
            })
        })
    }
}

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
    pub(crate) fn new(frame: &Frame<'_>, tile: Tile, unit: f64) -> Self {
        let rays = frame.camera.rays(frame.width, frame.height);
        let [_, _, forward] = frame.camera.axes();
        let is_parallel = matches!(frame.camera.projection, Projection::Orthographic { .. });
        let (dx, dy) = if is_parallel {
            (rays.origin_dx / unit, rays.origin_dy / unit)
        } else {
            (rays.toward_dx, rays.toward_dy)
        };
        // Pixels from the middle of the picture, times depth in perspective.
        let (pixels_x, pixels_y) = (dx / dx.length_squared(), dy / dy.length_squared());
        let (depth, is_unit) = if is_parallel { (DVec3::ZERO, 1.0) } else { (forward, 0.0) };
        let [width, height] = tile.size.map(f64::from);
        let center_x = f64::from(frame.width) / 2.0 - f64::from(tile.first[0]);
        let center_y = f64::from(frame.height) / 2.0 - f64::from(tile.first[1]);
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

/// What renders tiles, and what the last picture can lend to the next.
pub(crate) struct Tiles {
    resolve_layout: wgpu::BindGroupLayout,
    /// Without and with surfaces.
    resolve: [wgpu::ComputePipeline; 2],
    target: Option<wgpu::Texture>,
}

/// A tile with what it binds.
struct BoundTile<B> {
    size: [u32; 2],
    surfaces: Option<BoundSurfaces>,
    bound: B,
    resolve: wgpu::BindGroup,
}

impl Tiles {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let resolve_layout = bind_group_layout(&gpu.device, "volery resolve", resolve::BINDINGS);
            let module = shader_module(gpu, resolve::LABEL, resolve::SOURCE);
            let resolve = [0.0, 1.0].map(|has_surfaces| {
                gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some("volery resolve"),
                    layout: Some(&pipeline_layout(gpu, &resolve_layout)),
                    module: &module,
                    entry_point: Some(resolve::MAIN),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &[(resolve::HAS_SURFACES, has_surfaces)],
                        ..Default::default()
                    },
                    cache: None,
                })
            });
            Self { resolve_layout, resolve, target: None }
        })
    }

    /// The most pixels of a tile of a picture.
    pub(crate) fn size(frame: &Frame<'_>) -> [u32; 2] {
        [frame.width, frame.height].map(|pixels| pixels.min(TILE))
    }

    /// Draws a picture over its surfaces and background, tile by tile: `bind` makes what a tile binds, `encode` adds
    /// the commands. What comes out beyond `colors` and what is behind becomes the nearest between.
    pub(crate) fn draw<B>(
        &mut self,
        gpu: &Gpu,
        band: &mut Option<Band>,
        (frame, surfaces): (&Frame<'_>, &FrameSurfaces<'_>),
        colors: Colors,
        mut bind: impl FnMut(Tile) -> B,
        mut encode: impl FnMut(&mut wgpu::RenderPass<'_>, &B),
    ) -> Result<Drawn, Failure> {
        let size = [frame.width, frame.height];
        let target = gpu.checked(|| self.target(gpu, Self::size(frame)))?;
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let bind = |picture: &wgpu::Buffer, rows: Range<u32>| {
            let tiles = Tile::of(frame.width, rows.clone(), TILE).map(|tile| BoundTile {
                size: tile.size,
                surfaces: surfaces.bind(tile),
                bound: bind(tile),
                resolve: {
                    let in_band = in_band(tile, rows.start, colors, frame.background);
                    self.bind_resolve(gpu, in_band, [&view, surfaces.view()], picture)
                },
            });
            tiles.collect::<Vec<_>>()
        };
        let [r, g, b] = frame.background.map(f64::from);
        let background = wgpu::Color { r, g, b, a: 1.0 };
        let clear = if surfaces.is_empty() { background } else { wgpu::Color::TRANSPARENT };
        let encode = |encoder: &mut wgpu::CommandEncoder, clock: Clock<'_>, tiles: &Vec<BoundTile<B>>, _| {
            for (place, tile) in tiles.iter().enumerate() {
                let mut at_start = clock.at_start().filter(|_| place == 0);
                if let Some(behind) = &tile.surfaces {
                    surfaces.encode(encoder, at_start.take(), behind);
                }
                let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("volery tile"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(clear),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    timestamp_writes: at_start,
                    ..Default::default()
                });
                let [width, height] = tile.size;
                pass.set_viewport(0.0, 0.0, width as f32, height as f32, 0.0, 1.0);
                pass.set_scissor_rect(0, 0, width, height);
                encode(&mut pass, &tile.bound);
                drop(pass);
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("volery resolve"),
                    timestamp_writes: clock.at_end().filter(|_| place + 1 == tiles.len()),
                });
                pass.set_pipeline(&self.resolve[usize::from(!surfaces.is_empty())]);
                pass.set_bind_group(0, &tile.resolve, &[]);
                let [x, y] = tile.size.map(|pixels| pixels.div_ceil(resolve::GROUP));
                pass.dispatch_workgroups(x, y, 1);
            }
        };
        draw_bands_in_passes(gpu, band, size, resolve::GROUP, bind, encode)
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

    /// What copies a tile to its band.
    fn bind_resolve(
        &self,
        gpu: &Gpu,
        in_band: resolve::Tile,
        [rendered, surfaces]: [&wgpu::TextureView; 2],
        picture: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let in_band = buffer(gpu, "volery tile in its band", &[in_band], wgpu::BufferUsages::UNIFORM);
        // A binding that the shader gains and this does not know fails as one of the wrong kind.
        bind_group(gpu, &self.resolve_layout, resolve::BINDINGS, |name| match name {
            "tile" => in_band.as_entire_binding(),
            "rendered" => wgpu::BindingResource::TextureView(rendered),
            "surfaces" => wgpu::BindingResource::TextureView(surfaces),
            _ => picture.as_entire_binding(),
        })
    }
}

/// A tile in the band that begins with row `first_row`.
fn in_band(tile: Tile, first_row: u32, [low, high]: Colors, background: [f32; 3]) -> resolve::Tile {
    resolve::Tile {
        origin: [tile.first[0], tile.first[1] - first_row],
        size: tile.size,
        band_width: tile.picture_width,
        low,
        high,
        background,
        ..bytemuck::Zeroable::zeroed()
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
