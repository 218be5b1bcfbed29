//! The pipeline that casts rays: its layouts from the shader's reflection, its textures, its commands.

use std::num::NonZeroU64;

use volery_frame::IntegratedTransfer;
use volery_shaders::{Binding, BindingKind, Dimension, TexelKind, raycast};

use crate::gpu::{Failure, Gpu};
use crate::units::Units;

/// The pipeline in its two forms: without blank texels and with them.
pub(crate) struct Raycast {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Without and with blanks; compiled when first needed.
    pipelines: [Option<wgpu::ComputePipeline>; 2],
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
}

/// What one frame binds.
pub(crate) struct Resources<'a> {
    pub(crate) units: &'a wgpu::Texture,
    pub(crate) atlas: &'a wgpu::Texture,
    pub(crate) transfer: &'a wgpu::Texture,
    pub(crate) picture: &'a wgpu::Buffer,
}

impl Raycast {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let device = &gpu.device;
            let entries: Vec<_> = raycast::BINDINGS.iter().map(layout_entry).collect();
            let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("volery raycast"),
                entries: &entries,
            });
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(raycast::LABEL),
                source: wgpu::ShaderSource::Wgsl(raycast::SOURCE.into()),
            });
            Self {
                pipelines: [None, None],
                frame: device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("volery frame"),
                    size: size_of::<raycast::Frame>() as u64,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                }),
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

    /// The pipeline of one form, compiled if this is the first frame that needs it.
    pub(crate) fn pipeline(&mut self, gpu: &Gpu, has_blanks: bool) -> Result<wgpu::ComputePipeline, Failure> {
        let made = &mut self.pipelines[usize::from(has_blanks)];
        if let Some(pipeline) = made {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked(|| pipeline(&gpu.device, &self.layout, &self.module, has_blanks))?;
        Ok(made.insert(pipeline).clone())
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
    has_blanks: bool,
) -> wgpu::ComputePipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volery raycast"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(if has_blanks { "volery raycast, blanks" } else { "volery raycast" }),
        layout: Some(&layout),
        module,
        entry_point: Some(raycast::MAIN),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &[(raycast::HAS_BLANKS, f64::from(has_blanks))],
            ..Default::default()
        },
        cache: None,
    })
}

fn layout_entry(binding: &Binding) -> wgpu::BindGroupLayoutEntry {
    let buffer = |ty, bytes: u32| wgpu::BindingType::Buffer {
        ty,
        has_dynamic_offset: false,
        min_binding_size: NonZeroU64::new(bytes.into()),
    };
    let ty = match binding.kind {
        BindingKind::Uniform { bytes } => buffer(wgpu::BufferBindingType::Uniform, bytes),
        BindingKind::Storage { read_only } => buffer(wgpu::BufferBindingType::Storage { read_only }, 0),
        BindingKind::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering),
        BindingKind::Texture { dimension, texel } => wgpu::BindingType::Texture {
            sample_type: match texel {
                TexelKind::Float => wgpu::TextureSampleType::Float { filterable: false },
                TexelKind::Uint => wgpu::TextureSampleType::Uint,
            },
            view_dimension: match dimension {
                Dimension::D2 => wgpu::TextureViewDimension::D2,
                Dimension::D2Array => wgpu::TextureViewDimension::D2Array,
                Dimension::D3 => wgpu::TextureViewDimension::D3,
            },
            multisampled: false,
        },
    };
    wgpu::BindGroupLayoutEntry {
        binding: binding.binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty,
        count: None,
    }
}

/// The units as a texture.
pub(crate) fn units_texture(gpu: &Gpu, units: &Units) -> wgpu::Texture {
    let bytes = bytemuck::cast_slice(&units.words);
    texture(gpu, "volery units", wgpu::TextureDimension::D3, wgpu::TextureFormat::Rg32Uint, units.dims, bytes)
}

/// The transfer function's antiderivatives as a texture.
pub(crate) fn transfer_texture(gpu: &Gpu, transfer: &IntegratedTransfer) -> wgpu::Texture {
    let bytes = bytemuck::cast_slice(transfer.entries());
    let dims = [transfer.entries().len() as u32, 1, 1];
    texture(gpu, "volery transfer", wgpu::TextureDimension::D2, wgpu::TextureFormat::Rgba32Float, dims, bytes)
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
