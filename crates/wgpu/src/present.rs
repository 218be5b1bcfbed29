//! The end of pictures that stay on the device: drawn into a texture of somebody else's.

use std::collections::HashMap;

use volery_shaders::{finish, present};

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::Picture;

// The two shaders import one part.
const _: () = assert!(size_of::<finish::Tile>() == size_of::<present::Tile>());

/// Pipelines by the format that they draw to, compiled when first needed.
pub(crate) struct Present {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    pipelines: HashMap<wgpu::TextureFormat, wgpu::RenderPipeline>,
}

impl Present {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery present", present::BINDINGS),
            module: shader_module(gpu, present::LABEL, present::SOURCE),
            pipelines: HashMap::new(),
        })
    }

    /// Ends a picture in the upper left corner of a target of this format; the rest of it stays as it is.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        jobs: &mut Jobs,
        picture: &Picture,
        (target, format): (&wgpu::TextureView, wgpu::TextureFormat),
    ) -> Result<(), Failure> {
        let found = [target.texture().width(), target.texture().height()];
        let expected = [picture.view.width, picture.view.height];
        if found[0] < expected[0] || found[1] < expected[1] {
            let [found, expected] = [found, expected].map(|[width, height]| format!("{width}x{height}"));
            return Err(Failure::Other(format!("target of {found} pixels, expected at least {expected}")));
        }
        let pipeline = self.pipeline(gpu, format)?;
        jobs.begin(None);
        gpu.checked(|| {
            for (place, tile) in picture.tiles.iter().enumerate() {
                let ended = [picture.ended(tile, tile.tile.first)];
                let ended =
                    buffer(gpu, Upload::Views, "volery present tile", &ended, wgpu::BufferUsages::UNIFORM);
                let bound = bind_group(gpu, &self.layout, present::BINDINGS, |name| match name {
                    "tile" => ended.as_entire_binding(),
                    "surfaces" => wgpu::BindingResource::TextureView(picture.surfaces.of_tile(place)),
                    // A binding that the shader gains and this does not know fails as one of the wrong kind.
                    _ => tile.gathered.as_entire_binding(),
                });
                jobs.submit(gpu, |encoder, clock, _| {
                    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                        label: Some("volery present"),
                        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                            view: target,
                            depth_slice: None,
                            resolve_target: None,
                            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                        })],
                        timestamp_writes: clock.render(true, true),
                        ..Default::default()
                    });
                    let ([x, y], [width, height]) = (tile.tile.first, tile.tile.size);
                    pass.set_viewport(x as f32, y as f32, width as f32, height as f32, 0.0, 1.0);
                    pass.set_scissor_rect(x, y, width, height);
                    pass.set_pipeline(&pipeline);
                    pass.set_bind_group(0, &bound, &[]);
                    pass.draw(0..3, 0..1);
                });
            }
        })
    }

    fn pipeline(&mut self, gpu: &Gpu, format: wgpu::TextureFormat) -> Result<wgpu::RenderPipeline, Failure> {
        if let Some(pipeline) = self.pipelines.get(&format) {
            return Ok(pipeline.clone());
        }
        let stage = wgpu::PipelineCompilationOptions::default;
        let pipeline = gpu.checked(|| {
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(&format!("volery present {format:?}")),
                layout: Some(&pipeline_layout(gpu, &self.layout)),
                vertex: wgpu::VertexState {
                    module: &self.module,
                    entry_point: Some(present::CORNER),
                    compilation_options: stage(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &self.module,
                    entry_point: Some(present::PIXEL),
                    compilation_options: stage(),
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        })?;
        Ok(self.pipelines.entry(format).or_insert(pipeline).clone())
    }
}
