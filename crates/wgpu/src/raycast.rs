//! The pipeline that casts rays: its layouts from the shader's reflection, its textures, its commands.

use std::collections::HashMap;

use volery_frame::{RayDoubt, RayTransfer, TexelType, VolumeLayout};
use volery_shaders::{Binding, raycast};

use crate::bindings::{bind_group_layout, buffer};
use crate::gpu::{Failure, Gpu};
use crate::units::Units;

/// Bytes of three numbers.
const WORST_BYTES: u64 = 12;

/// The pipeline in its forms.
pub(crate) struct Raycast {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Compiled when first needed.
    pipelines: HashMap<Form, wgpu::ComputePipeline>,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    /// The three numbers of a [`RayDoubt`], and where they are read.
    worst: [wgpu::Buffer; 2],
}

/// What a frame asks of the pipeline: a form does not pay for what it need not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Form {
    /// Texels may be blank.
    pub(crate) has_blanks: bool,
    /// Texels are whole numbers.
    pub(crate) is_whole: bool,
    /// There are cells for which the table is too coarse.
    pub(crate) has_exact: bool,
    /// Rays end at surfaces.
    pub(crate) has_surfaces: bool,
}

impl Form {
    pub(crate) fn new(layout: &VolumeLayout, units: &Units, has_blanks: bool) -> Self {
        let is_whole = matches!(layout.texel, TexelType::U8 | TexelType::U16);
        let is_marked =
            |words: &[u32; 2]| words[0] & raycast::OCCUPIED != 0 && words[1] & raycast::EXACT != 0;
        Self { has_blanks, is_whole, has_exact: units.words.iter().any(is_marked), has_surfaces: false }
    }
}

/// What one frame binds.
pub(crate) struct Resources<'a> {
    pub(crate) units: &'a wgpu::Texture,
    pub(crate) atlas: &'a wgpu::Texture,
    pub(crate) transfer: &'a wgpu::Texture,
    pub(crate) bands: &'a wgpu::Buffer,
    pub(crate) picture: &'a wgpu::Buffer,
    pub(crate) surfaces: &'a wgpu::TextureView,
}

impl Raycast {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let device = &gpu.device;
            let empty = |label, size, usage| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage: usage | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            };
            let layout = bind_group_layout(device, "volery raycast", raycast::BINDINGS);
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(raycast::LABEL),
                source: wgpu::ShaderSource::Wgsl(raycast::SOURCE.into()),
            });
            Self {
                pipelines: HashMap::new(),
                frame: empty("volery frame", size_of::<raycast::Frame>() as u64, wgpu::BufferUsages::UNIFORM),
                worst: [
                    empty(
                        "volery doubt",
                        WORST_BYTES,
                        wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
                    ),
                    empty("volery doubt staging", WORST_BYTES, wgpu::BufferUsages::MAP_READ),
                ],
                sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                    label: Some("volery atlas"),
                    ..Default::default()
                }),
                module,
                layout,
            }
        })
    }

    pub(crate) fn bind(&self, gpu: &Gpu, resources: &Resources<'_>) -> wgpu::BindGroup {
        let view = |texture: &wgpu::Texture, dimension| {
            let descriptor = wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() };
            texture.create_view(&descriptor)
        };
        let units = view(resources.units, wgpu::TextureViewDimension::D3);
        let atlas = view(resources.atlas, wgpu::TextureViewDimension::D2Array);
        let transfer = view(resources.transfer, wgpu::TextureViewDimension::D2);
        let resource = |binding: &Binding| match binding.name {
            "frame" => self.frame.as_entire_binding(),
            "units" => wgpu::BindingResource::TextureView(&units),
            "atlas" => wgpu::BindingResource::TextureView(&atlas),
            "atlas_sampler" => wgpu::BindingResource::Sampler(&self.sampler),
            "transfer" => wgpu::BindingResource::TextureView(&transfer),
            "worst" => self.worst[0].as_entire_binding(),
            "bands" => resources.bands.as_entire_binding(),
            "surfaces" => wgpu::BindingResource::TextureView(resources.surfaces),
            // A binding that the shader gains and this does not know fails as one of the wrong kind.
            _ => resources.picture.as_entire_binding(),
        };
        let entries: Vec<_> = raycast::BINDINGS
            .iter()
            .map(|binding| wgpu::BindGroupEntry { binding: binding.binding, resource: resource(binding) })
            .collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("volery raycast"),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// Hands the frame to the device, for the commands that come next.
    pub(crate) fn set_frame(&self, gpu: &Gpu, frame: &raycast::Frame) {
        gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(frame));
    }

    /// Forgets the doubt of the picture before, for the commands that come next.
    pub(crate) fn reset_doubt(&self, gpu: &Gpu) {
        gpu.queue.write_buffer(&self.worst[0], 0, &[0; WORST_BYTES as usize]);
    }

    /// What the rays since [`Raycast::reset_doubt`] may be off by.
    pub(crate) fn doubt(&self, gpu: &Gpu) -> Result<RayDoubt, Failure> {
        let [worst, staging] = &self.worst;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("volery doubt") };
        gpu.checked(|| {
            let mut encoder = gpu.device.create_command_encoder(&descriptor);
            encoder.copy_buffer_to_buffer(worst, 0, staging, 0, WORST_BYTES);
            gpu.queue.submit([encoder.finish()]);
            staging.map_async(wgpu::MapMode::Read, .., |_| ());
            gpu.wait()
        })??;
        let view = staging.get_mapped_range(..).map_err(|e| Failure::Other(e.to_string()))?;
        let [cells, table_way, touching] =
            [0, 4, 8].map(|i| f32::from_le_bytes(std::array::from_fn(|byte| view[i + byte])));
        drop(view);
        staging.unmap();
        // Ways are depths to the base 2.
        Ok(RayDoubt { cells, table_way: table_way * std::f32::consts::LN_2, touching })
    }

    /// The pipeline of one form, compiled if this is the first frame that needs it.
    pub(crate) fn pipeline(&mut self, gpu: &Gpu, form: Form) -> Result<wgpu::ComputePipeline, Failure> {
        if let Some(pipeline) = self.pipelines.get(&form) {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked(|| pipeline(&gpu.device, &self.layout, &self.module, form))?;
        Ok(self.pipelines.entry(form).or_insert(pipeline).clone())
    }

    /// Casts the rays of `frame`'s band of rows.
    pub(crate) fn encode(
        pass: &mut wgpu::ComputePass<'_>,
        pipeline: &wgpu::ComputePipeline,
        bound: &wgpu::BindGroup,
        frame: &raycast::Frame,
    ) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, bound, &[]);
        let rows = frame.end_row - frame.first_row;
        pass.dispatch_workgroups(frame.width.div_ceil(raycast::TILE), rows.div_ceil(raycast::TILE), 1);
    }
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    module: &wgpu::ShaderModule,
    form: Form,
) -> wgpu::ComputePipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volery raycast"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(&format!("volery raycast {form:?}")),
        layout: Some(&layout),
        module,
        entry_point: Some(raycast::MAIN),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &[
                (raycast::HAS_BLANKS, f64::from(form.has_blanks)),
                (raycast::IS_WHOLE, f64::from(form.is_whole)),
                (raycast::HAS_EXACT, f64::from(form.has_exact)),
                (raycast::HAS_SURFACES, f64::from(form.has_surfaces)),
            ],
            ..Default::default()
        },
        cache: None,
    })
}

/// The units as a texture.
pub(crate) fn units_texture(gpu: &Gpu, units: &Units) -> wgpu::Texture {
    let bytes = bytemuck::cast_slice(&units.words);
    texture(gpu, "volery units", wgpu::TextureDimension::D3, wgpu::TextureFormat::Rg32Uint, units.dims, bytes)
}

/// The transfer function's antiderivatives as a texture.
pub(crate) fn transfer_texture(gpu: &Gpu, transfer: &RayTransfer) -> wgpu::Texture {
    let bytes = bytemuck::cast_slice(transfer.entries());
    let dims = [transfer.entries().len() as u32, 1, 1];
    texture(gpu, "volery transfer", wgpu::TextureDimension::D2, wgpu::TextureFormat::Rgba32Float, dims, bytes)
}

/// The transfer function's bands as a buffer.
pub(crate) fn bands_buffer(gpu: &Gpu, transfer: &RayTransfer) -> wgpu::Buffer {
    buffer(gpu, "volery bands", transfer.bands(), wgpu::BufferUsages::STORAGE)
}

fn texture(
    gpu: &Gpu,
    label: &str,
    dimension: wgpu::TextureDimension,
    format: wgpu::TextureFormat,
    [width, height, depth]: [u32; 3],
    bytes: &[u8],
) -> wgpu::Texture {
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let bytes_per_row = width * format.block_copy_size(None).unwrap_or(1);
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes_per_row),
            rows_per_image: Some(height),
        },
        size,
    );
    texture
}
