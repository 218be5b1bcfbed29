//! Layouts of bind groups from the shaders' reflection, and what is bound.

use std::num::NonZeroU64;

use volery_shaders::{Binding, BindingKind, Dimension, Stages, TexelKind};
use wgpu::util::DeviceExt as _;

use crate::gpu::{Gpu, Upload};

/// The layout of a shader's only group.
pub(crate) fn bind_group_layout(
    device: &wgpu::Device,
    label: &str,
    bindings: &[Binding],
) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = bindings.iter().map(layout_entry).collect();
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
    device.create_bind_group_layout(&descriptor)
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
        visibility: stages(binding.stages),
        ty,
        count: None,
    }
}

fn stages(Stages { vertex, fragment, compute }: Stages) -> wgpu::ShaderStages {
    let of = |is_used: bool, stage| if is_used { stage } else { wgpu::ShaderStages::NONE };
    of(vertex, wgpu::ShaderStages::VERTEX)
        | of(fragment, wgpu::ShaderStages::FRAGMENT)
        | of(compute, wgpu::ShaderStages::COMPUTE)
}

/// A shader's only group, by the names of its resources.
pub(crate) fn bind_group<'a>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    bindings: &[Binding],
    resource: impl Fn(&str) -> wgpu::BindingResource<'a>,
) -> wgpu::BindGroup {
    let entry = |b: &Binding| wgpu::BindGroupEntry { binding: b.binding, resource: resource(b.name) };
    let entries: Vec<_> = bindings.iter().map(entry).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// The layout of a pipeline with one group.
pub(crate) fn pipeline_layout(gpu: &Gpu, layout: &wgpu::BindGroupLayout) -> wgpu::PipelineLayout {
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    })
}

pub(crate) fn shader_module(gpu: &Gpu, label: &str, source: &'static str) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
}

/// A buffer with contents, counted as one kind.
pub(crate) fn buffer<T: bytemuck::NoUninit>(
    gpu: &Gpu,
    kind: Upload,
    label: &str,
    contents: &[T],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let contents: &[u8] = bytemuck::cast_slice(contents);
    gpu.count(kind, contents.len());
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
}
