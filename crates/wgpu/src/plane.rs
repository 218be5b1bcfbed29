//! The pipeline that shows cutting planes: its buffers from the frame, its commands.

use std::ops::Range;

use volery_frame::planes::{OUTLINE_PIXELS, outline_color};
use volery_frame::{
    BlendedBrick, BrickGrid, Drawn, Frame, PlaneTile, PlaneTiles, Planes, PointTransfer, Sampling, TexelType,
};
use volery_shaders::{Binding, plane};
use wgpu::util::DeviceExt as _;

use crate::bindings::bind_group_layout;
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, band_size, draw_in_bands};
use crate::pool::Pool;
use crate::surfaces::Surfaces;

// What the shader and the rest of the crates must mean alike.
const _: () = assert!(plane::TILE == volery_frame::plane_tiles::TILE);
const _: () = assert!(plane::BLANK == volery_shaders::raycast::BLANK);

/// The pipeline, and what the last frame can lend to the next.
pub(crate) struct Plane {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// For texels that are values, and for colours; each without and with surfaces. Compiled when first needed.
    pipelines: [[Option<wgpu::ComputePipeline>; 2]; 2],
    frame: wgpu::Buffer,
    prepared: Option<Prepared>,
}

/// What was made for the bricks and the transfer function of the last frame.
struct Prepared {
    generation: u64,
    placed: Vec<BlendedBrick>,
    transfer: PointTransfer,
    grid: BrickGrid,
    bricks: wgpu::Buffer,
    entries: wgpu::Buffer,
    points: wgpu::Buffer,
}

impl Plane {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery plane", plane::BINDINGS),
            module: gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(plane::LABEL),
                source: wgpu::ShaderSource::Wgsl(plane::SOURCE.into()),
            }),
            pipelines: [[None, None], [None, None]],
            frame: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("volery plane frame"),
                size: size_of::<plane::Frame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            prepared: None,
        })
    }

    /// Lets go of what belongs to the volume that was.
    pub(crate) fn forget(&mut self) {
        self.prepared = None;
    }

    /// Draws a checked frame with planes and bricks, all of which are resident.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        pool: &Pool,
        (band, surfaces): (&mut Option<Band>, &mut Surfaces),
        frame: &Frame<'_>,
        content: &Planes<'_>,
    ) -> Result<Drawn, Failure> {
        let size = [frame.width, frame.height];
        let surfaces = surfaces.of_frame(gpu, frame, band_size(gpu, size, plane::TILE))?;
        let prepared = match self.prepared.take().filter(|prepared| prepared.is_of(pool, content)) {
            Some(prepared) => prepared,
            None => gpu.checked(|| Prepared::new(gpu, pool, content))?,
        };
        let pipeline = self.pipeline(gpu, [pool.layout().texel == TexelType::Rgba8, !surfaces.is_empty()])?;
        let mut shader_frame = shader_frame(frame, content, pool, &prepared.grid);
        let view = PlaneTiles::new(frame, content.planes, pool.layout());
        let depths_per_length = pool.layout().spacing.max_element().recip();
        shader_frame.depths_per_length = depths_per_length.min(f64::from(f32::MAX)) as f32;
        let shader_tile = |tile: PlaneTile| {
            let offset = (surfaces.zero_depth() - tile.zero_depth) * depths_per_length;
            plane::PlaneTile { surface_offset: offset as f32, ..shader_tile(tile) }
        };
        let bind = |picture: &wgpu::Buffer, rows: Range<u32>| {
            let columns = (0..frame.width).step_by(plane::TILE as usize);
            let tiles: Vec<_> = rows
                .step_by(plane::TILE as usize)
                .flat_map(|row| columns.clone().map(move |column| (column, row)))
                .flat_map(|(column, row)| view.tile(column, row))
                .map(|tile| tile.map_or_else(bytemuck::Zeroable::zeroed, shader_tile))
                .collect();
            let tiles = buffer(gpu, "volery plane tiles", &tiles);
            self.bind(gpu, pool, &prepared, &tiles, (picture, surfaces.view()))
        };
        let passes = (plane::TILE, &surfaces);
        let drawn = draw_in_bands(gpu, band, size, passes, bind, |pass, bound, rows| {
            (shader_frame.first_row, shader_frame.end_row) = (rows.start, rows.end);
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&shader_frame));
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, bound, &[]);
            let groups = [frame.width, rows.end - rows.start].map(|n| n.div_ceil(plane::TILE));
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        });
        self.prepared = Some(prepared);
        drawn
    }

    fn bind(
        &self,
        gpu: &Gpu,
        pool: &Pool,
        prepared: &Prepared,
        tiles: &wgpu::Buffer,
        (picture, surfaces): (&wgpu::Buffer, &wgpu::TextureView),
    ) -> wgpu::BindGroup {
        let descriptor = wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        };
        let atlas = pool.texture().map(|texture| texture.create_view(&descriptor));
        let resource = |binding: &Binding| {
            Some(match binding.name {
                "frame" => self.frame.as_entire_binding(),
                "atlas" => wgpu::BindingResource::TextureView(atlas.as_ref()?),
                "tiles" => tiles.as_entire_binding(),
                "bricks" => prepared.bricks.as_entire_binding(),
                "entries" => prepared.entries.as_entire_binding(),
                "points" => prepared.points.as_entire_binding(),
                "surfaces" => wgpu::BindingResource::TextureView(surfaces),
                // A binding that the shader gains and this does not know fails as one of the wrong kind.
                _ => picture.as_entire_binding(),
            })
        };
        let entries: Vec<_> = plane::BINDINGS
            .iter()
            .filter_map(|binding| {
                Some(wgpu::BindGroupEntry { binding: binding.binding, resource: resource(binding)? })
            })
            .collect();
        gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("volery plane"),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// The pipeline for one kind of texels, and for surfaces or none, compiled if this is the first frame that needs it.
    fn pipeline(
        &mut self,
        gpu: &Gpu,
        [has_colors, has_surfaces]: [bool; 2],
    ) -> Result<wgpu::ComputePipeline, Failure> {
        let made = &mut self.pipelines[usize::from(has_colors)][usize::from(has_surfaces)];
        if let Some(pipeline) = made {
            return Ok(pipeline.clone());
        }
        let pipeline = gpu.checked(|| {
            let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("volery plane"),
                bind_group_layouts: &[Some(&self.layout)],
                immediate_size: 0,
            });
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(if has_colors { "volery plane, colours" } else { "volery plane" }),
                layout: Some(&layout),
                module: &self.module,
                entry_point: Some(plane::MAIN),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[
                        (plane::HAS_COLORS, f64::from(has_colors)),
                        (plane::HAS_SURFACES, f64::from(has_surfaces)),
                    ],
                    ..Default::default()
                },
                cache: None,
            })
        })?;
        Ok(made.insert(pipeline).clone())
    }
}

impl Prepared {
    fn new(gpu: &Gpu, pool: &Pool, content: &Planes<'_>) -> Self {
        let grid = BrickGrid::new(pool.layout(), content.bricks);
        let bricks: Vec<_> = grid.bricks().iter().map(|brick| shader_brick(pool, brick)).collect();
        Self {
            generation: pool.generation(),
            placed: content.bricks.to_vec(),
            transfer: content.transfer.clone(),
            bricks: buffer(gpu, "volery plane bricks", &bricks),
            entries: buffer(gpu, "volery plane entries", grid.entries()),
            points: buffer(gpu, "volery plane points", content.transfer.points()),
            grid,
        }
    }

    fn is_of(&self, pool: &Pool, content: &Planes<'_>) -> bool {
        let Self { generation, placed, transfer, grid: _, bricks: _, entries: _, points: _ } = self;
        *generation == pool.generation() && *placed == content.bricks && transfer == content.transfer
    }
}

/// A storage buffer that the shader reads.
fn buffer<T: bytemuck::NoUninit>(gpu: &Gpu, label: &str, contents: &[T]) -> wgpu::Buffer {
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::cast_slice(contents),
        usage: wgpu::BufferUsages::STORAGE,
    })
}

/// The shader's frame; the band of rows is still open.
fn shader_frame(frame: &Frame<'_>, content: &Planes<'_>, pool: &Pool, grid: &BrickGrid) -> plane::Frame {
    let layout = pool.layout();
    let is_scaled = layout.texel != TexelType::Rgba8 && pool.texels_per_unit() != 1.0;
    plane::Frame {
        cells: layout.cells.map(|n| n as f32),
        width: frame.width,
        background: frame.background,
        end_row: 0,
        grid_dims: grid.dims(),
        first_row: 0,
        brick_cells: layout.brick_cells as f32,
        bricks_per_cell: 1.0 / layout.brick_cells as f32,
        entries_per_cell: 1.0 / grid.entry_cells() as f32,
        num_planes: content.planes.len() as u32,
        num_points: content.transfer.points().len() as u32,
        texels_per_unit: if is_scaled { pool.texels_per_unit() as f32 } else { 0.0 },
        outline_reach: 0.5 * OUTLINE_PIXELS + 0.5,
        slices_per_row: pool.slot().slices_per_row,
        slot_height: pool.slot().size[1],
        is_nearest: (content.sampling == Sampling::Nearest).into(),
        is_transparent: content.is_transparent.into(),
        shows_bricks: content.shows_bricks.into(),
        ..bytemuck::Zeroable::zeroed()
    }
}

fn shader_tile(tile: PlaneTile) -> plane::PlaneTile {
    let PlaneTile { base, anchor, seen, dx, dy, shrink, first_depth, zero_depth: _ } = tile;
    let rest = bytemuck::Zeroable::zeroed();
    plane::PlaneTile { base, is_seen: 1, seen, dx, dy, anchor, shrink, first_depth, ..rest }
}

fn shader_brick(pool: &Pool, brick: &BlendedBrick) -> plane::Brick {
    let placed = &brick.placed;
    let resident = pool.resident().get(&placed.id);
    let slot = resident.map_or(0, |resident| resident.slot);
    let (row, layer) = (slot % pool.slots_per_layer(), slot / pool.slots_per_layer());
    plane::Brick {
        first_cell: placed.first_cell.map(|cell| cell as f32),
        kind: placed.level | u32::from(brick.low_corners) << plane::LOW_CORNERS_SHIFT,
        outline: outline_color(placed.level),
        slot: layer << plane::LAYER_SHIFT | row,
        last_sample: resident.map_or([0.0; 3], |resident| resident.summary.cells.map(|n| n as f32)),
        ..bytemuck::Zeroable::zeroed()
    }
}
