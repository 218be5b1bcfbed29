//! The pipeline that casts rays: its layouts from the shader's reflection, its textures, its commands.

use std::collections::HashMap;

use volery_frame::{RayTransfer, Rays, Revision, TexelType, VolumeLayout};
use volery_shaders::{Binding, raycast};

use crate::bindings::{bind_group_layout, buffer};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PartKind, Picture};
use crate::placed::Placed;
use crate::pool::Pool;
use crate::units::Units;
use crate::view::shader_frame;

/// The pipeline in its forms.
pub(crate) struct Raycast {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Compiled when first needed.
    pipelines: HashMap<Form, wgpu::ComputePipeline>,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    table: Option<Table>,
    placed: Option<Placed>,
}

/// A transfer function on the device.
struct Table {
    revision: Revision,
    entries: wgpu::Texture,
    bands: wgpu::Buffer,
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
    /// Units hold bricks that are not of this part.
    pub(crate) has_others: bool,
    /// Bricks join coarser ones.
    pub(crate) has_seams: bool,
    /// Rays end at surfaces.
    pub(crate) has_surfaces: bool,
}

impl Form {
    /// Of texels that may be blank or not, in bricks of a layout; without the rest.
    pub(crate) fn new(layout: &VolumeLayout, has_blanks: bool) -> Self {
        let is_whole = matches!(layout.texel, TexelType::U8 | TexelType::U16);
        Self {
            has_blanks,
            is_whole,
            has_exact: false,
            has_others: false,
            has_seams: false,
            has_surfaces: false,
        }
    }
}

impl Raycast {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let device = &gpu.device;
            let layout = bind_group_layout(device, "volery raycast", raycast::BINDINGS);
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(raycast::LABEL),
                source: wgpu::ShaderSource::Wgsl(raycast::SOURCE.into()),
            });
            Self {
                pipelines: HashMap::new(),
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
                table: None,
                placed: None,
            }
        })
    }

    /// Lets go of what belongs to the volume that was.
    pub(crate) fn forget(&mut self) {
        self.placed = None;
    }

    /// Adds a checked part with bricks, all of which are resident, to a picture.
    pub(crate) fn add(
        &mut self,
        gpu: &Gpu,
        pool: &Pool,
        (picture, jobs): (&mut Picture, &mut Jobs),
        rays: &Rays<'_>,
    ) -> Result<u32, Failure> {
        let atlas = pool.texture().filter(|_| !pool.layout().cells.contains(&0));
        let Some(atlas) = atlas else { return Ok(picture.add_nothing(jobs, PartKind::RAYS)) };
        let revision = rays.transfer.revision();
        let table = match self.table.take().filter(|table| table.revision == revision) {
            Some(table) => table,
            None => gpu.checked(|| {
                let (entries, bands) =
                    (transfer_texture(gpu, rays.transfer), bands_buffer(gpu, rays.transfer));
                Table { revision, entries, bands }
            })?,
        };
        let mut placed = Placed::serving(self.placed.take(), gpu, pool, rays)?;
        let form = Form { has_surfaces: !picture.surfaces.is_empty(), ..placed.choose(gpu, pool, rays) };
        let pipeline = self.pipeline(gpu, form)?;
        let number = picture.add(gpu, jobs, PartKind::RAYS, |encoder, clock, slip, (picture, place)| {
            let frame = shader_frame((picture, place), rays.transfer, (pool, &placed.units));
            gpu.count(Upload::Views, size_of_val(&frame));
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
            let bound = self.bind(gpu, (&table, &placed, atlas), (picture, place), &slip.worst);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("volery rays"),
                timestamp_writes: clock.compute(true, true),
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bound, &[]);
            let [x, y] = [frame.width, frame.height].map(|n| n.div_ceil(raycast::TILE));
            pass.dispatch_workgroups(x, y, 1);
        });
        (self.table, self.placed) = (Some(table), Some(placed));
        number
    }

    fn bind(
        &self,
        gpu: &Gpu,
        (table, placed, atlas): (&Table, &Placed, &wgpu::Texture),
        (picture, place): (&Picture, usize),
        worst: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let view = |texture: &wgpu::Texture, dimension| {
            let descriptor = wgpu::TextureViewDescriptor { dimension: Some(dimension), ..Default::default() };
            texture.create_view(&descriptor)
        };
        let units = view(&placed.texture, wgpu::TextureViewDimension::D3);
        let atlas = view(atlas, wgpu::TextureViewDimension::D2Array);
        let transfer = view(&table.entries, wgpu::TextureViewDimension::D2);
        let resource = |binding: &Binding| match binding.name {
            "frame" => self.frame.as_entire_binding(),
            "units" => wgpu::BindingResource::TextureView(&units),
            "chosen" => placed.choice.buffer.as_entire_binding(),
            "seams" => placed.seams.as_entire_binding(),
            "atlas" => wgpu::BindingResource::TextureView(&atlas),
            "atlas_sampler" => wgpu::BindingResource::Sampler(&self.sampler),
            "transfer" => wgpu::BindingResource::TextureView(&transfer),
            "worst" => worst.as_entire_binding(),
            "bands" => table.bands.as_entire_binding(),
            "surfaces" => wgpu::BindingResource::TextureView(picture.surfaces.of_tile(place)),
            // A binding that the shader gains and this does not know fails as one of the wrong kind.
            _ => picture.tiles[place].gathered.as_entire_binding(),
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

    /// The pipeline of one form, compiled if this is the first frame that needs it.
    fn pipeline(&mut self, gpu: &Gpu, form: Form) -> Result<wgpu::ComputePipeline, Failure> {
        if let Some(pipeline) = self.pipelines.get(&form) {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked(|| pipeline(&gpu.device, &self.layout, &self.module, form))?;
        Ok(self.pipelines.entry(form).or_insert(pipeline).clone())
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
                (raycast::HAS_OTHERS, f64::from(form.has_others)),
                (raycast::HAS_SEAMS, f64::from(form.has_seams)),
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
    texture(
        gpu,
        Upload::Places,
        "volery units",
        wgpu::TextureDimension::D3,
        wgpu::TextureFormat::Rg32Uint,
        units.dims,
        bytes,
    )
}

/// The transfer function's antiderivatives as a texture.
pub(crate) fn transfer_texture(gpu: &Gpu, transfer: &RayTransfer) -> wgpu::Texture {
    let bytes = bytemuck::cast_slice(transfer.entries());
    let dims = [transfer.entries().len() as u32, 1, 1];
    texture(
        gpu,
        Upload::Transfers,
        "volery transfer",
        wgpu::TextureDimension::D2,
        wgpu::TextureFormat::Rgba32Float,
        dims,
        bytes,
    )
}

/// The transfer function's bands as a buffer.
pub(crate) fn bands_buffer(gpu: &Gpu, transfer: &RayTransfer) -> wgpu::Buffer {
    buffer(gpu, Upload::Transfers, "volery bands", transfer.bands(), wgpu::BufferUsages::STORAGE)
}

fn texture(
    gpu: &Gpu,
    kind: Upload,
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
    gpu.count(kind, bytes.len());
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
