//! The pipeline that shows cutting planes: its buffers from the frame, its commands.

use std::collections::{HashMap, HashSet};

use volery_frame::planes::{OUTLINE_PIXELS, outline_color};
use volery_frame::{BlendedBrick, BrickGrid, PlaneTile, PlaneTiles, Planes, Revision, Sampling, TexelType};
use volery_shaders::{Binding, plane};

use crate::bindings::{self, bind_group_layout};
use crate::choice::{Choice, beside};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PartKind, Picture, Tile};
use crate::pool::Pool;

// What the shader and the rest of the crates must mean alike.
const _: () = assert!(plane::TILE == volery_frame::plane_tiles::TILE);
const _: () = assert!(plane::BLANK == volery_shaders::raycast::BLANK);

/// The pipeline, and what the last frame can lend to the next.
pub(crate) struct Plane {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Compiled when first needed.
    pipelines: HashMap<Form, wgpu::ComputePipeline>,
    frame: wgpu::Buffer,
    prepared: Option<Prepared>,
    points: Option<Points>,
}

/// What a part asks of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Form {
    /// Texels are colours.
    has_colors: bool,
    /// The grid holds bricks that are not of this part.
    has_others: bool,
    has_surfaces: bool,
}

/// What was made for bricks that were placed.
struct Prepared {
    generation: u64,
    /// Each brick's number in the grid.
    numbers: HashMap<BlendedBrick, u32>,
    choice: Choice,
    grid: BrickGrid,
    bricks: wgpu::Buffer,
    entries: wgpu::Buffer,
}

/// A transfer function on the device.
struct Points {
    revision: Revision,
    buffer: wgpu::Buffer,
}

impl Plane {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery plane", plane::BINDINGS),
            module: gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(plane::LABEL),
                source: wgpu::ShaderSource::Wgsl(plane::SOURCE.into()),
            }),
            pipelines: HashMap::new(),
            frame: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("volery plane frame"),
                size: size_of::<plane::Frame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            prepared: None,
            points: None,
        })
    }

    /// Lets go of what belongs to the volume that was.
    pub(crate) fn forget(&mut self) {
        self.prepared = None;
    }

    /// Adds a checked part with planes and bricks, all of which are resident, to a picture.
    pub(crate) fn add(
        &mut self,
        gpu: &Gpu,
        pool: &Pool,
        (picture, jobs): (&mut Picture, &mut Jobs),
        content: &Planes<'_>,
    ) -> Result<u32, Failure> {
        let mut prepared = Prepared::serving(self.prepared.take(), gpu, pool, content)?;
        let revision = content.transfer.revision();
        let points = match self.points.take().filter(|points| points.revision == revision) {
            Some(points) => points,
            None => gpu.checked(|| {
                let points = content.transfer.points();
                let buffer = buffer(gpu, Upload::Transfers, "volery plane points", points);
                Points { revision, buffer }
            })?,
        };
        let form = Form {
            has_colors: pool.layout().texel == TexelType::Rgba8,
            has_others: prepared.choose(gpu, content),
            has_surfaces: !picture.surfaces.is_empty(),
        };
        let pipeline = self.pipeline(gpu, form)?;
        let view = PlaneTiles::new(&picture.view, content.planes, pool.layout());
        let depths_per_length = pool.layout().spacing.max_element().recip();
        let number = picture.add(gpu, jobs, PartKind::default(), |encoder, clock, _, (picture, place)| {
            let tile = picture.tiles[place].tile;
            let frame = shader_frame((picture, place), content, (pool, &prepared.grid));
            gpu.count(Upload::Views, size_of_val(&frame));
            gpu.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
            let tiles = buffer(
                gpu,
                Upload::Views,
                "volery plane tiles",
                &shader_tiles(picture, tile, &view, depths_per_length),
            );
            let bound = self.bind(gpu, pool, (&prepared, &points), &tiles, (picture, place));
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("volery planes"),
                timestamp_writes: clock.compute(true, true),
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bound, &[]);
            let [x, y] = tile.size.map(|n| n.div_ceil(plane::TILE));
            pass.dispatch_workgroups(x, y, 1);
        });
        (self.prepared, self.points) = (Some(prepared), Some(points));
        number
    }

    fn bind(
        &self,
        gpu: &Gpu,
        pool: &Pool,
        (prepared, points): (&Prepared, &Points),
        tiles: &wgpu::Buffer,
        (picture, place): (&Picture, usize),
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
                "chosen" => prepared.choice.buffer.as_entire_binding(),
                "entries" => prepared.entries.as_entire_binding(),
                "points" => points.buffer.as_entire_binding(),
                "surfaces" => wgpu::BindingResource::TextureView(picture.surfaces.of_tile(place)),
                // A binding that the shader gains and this does not know fails as one of the wrong kind.
                _ => picture.tiles[place].gathered.as_entire_binding(),
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

    /// The pipeline of one form, compiled if this is the first part that needs it.
    fn pipeline(&mut self, gpu: &Gpu, form: Form) -> Result<wgpu::ComputePipeline, Failure> {
        if let Some(pipeline) = self.pipelines.get(&form) {
            return Ok(pipeline.clone());
        }
        let Form { has_colors, has_others, has_surfaces } = form;
        let pipeline = gpu.checked(|| {
            let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("volery plane"),
                bind_group_layouts: &[Some(&self.layout)],
                immediate_size: 0,
            });
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&format!("volery plane {form:?}")),
                layout: Some(&layout),
                module: &self.module,
                entry_point: Some(plane::MAIN),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[
                        (plane::HAS_COLORS, f64::from(has_colors)),
                        (plane::HAS_OTHERS, f64::from(has_others)),
                        (plane::HAS_SURFACES, f64::from(has_surfaces)),
                    ],
                    ..Default::default()
                },
                cache: None,
            })
        })?;
        Ok(self.pipelines.entry(form).or_insert(pipeline).clone())
    }
}

impl Prepared {
    /// What serves a part, all of whose bricks are resident: what there is, or new.
    fn serving(kept: Option<Self>, gpu: &Gpu, pool: &Pool, content: &Planes<'_>) -> Result<Self, Failure> {
        let mut bricks = content.bricks.to_vec();
        if let Some(kept) = kept {
            let is_held = |brick: &BlendedBrick| kept.numbers.contains_key(brick);
            if kept.generation == pool.generation() && content.bricks.iter().all(is_held) {
                return Ok(kept);
            }
            let old = kept.grid.bricks();
            let placed = |brick: &'_ BlendedBrick| brick.placed;
            let (before, now): (Vec<_>, Vec<_>) =
                (old.iter().map(placed).collect(), content.bricks.iter().map(placed).collect());
            let others = beside(before.iter(), now.iter(), pool);
            bricks.extend(old.iter().filter(|brick| others.contains(&brick.placed)));
        }
        gpu.checked(|| Self::new(gpu, pool, &bricks))
    }

    fn new(gpu: &Gpu, pool: &Pool, bricks: &[BlendedBrick]) -> Self {
        let grid = BrickGrid::new(pool.layout(), bricks);
        let shader_bricks: Vec<_> = grid.bricks().iter().map(|brick| shader_brick(pool, brick)).collect();
        Self {
            generation: pool.generation(),
            numbers: grid.bricks().iter().copied().zip(0..).collect(),
            choice: Choice::of(gpu, bricks.len()),
            bricks: buffer(gpu, Upload::Places, "volery plane bricks", &shader_bricks),
            entries: buffer(gpu, Upload::Places, "volery plane entries", grid.entries()),
            grid,
        }
    }

    /// Tells the device which bricks are of a part, for the commands that come next; whether there are others.
    fn choose(&mut self, gpu: &Gpu, content: &Planes<'_>) -> bool {
        let chosen: HashSet<u32> =
            content.bricks.iter().filter_map(|brick| self.numbers.get(brick).copied()).collect();
        let has_others = chosen.len() < self.grid.bricks().len();
        if has_others {
            self.choice.send(gpu, chosen.into_iter());
        }
        has_others
    }
}

/// A storage buffer that the shader reads.
fn buffer<T: bytemuck::NoUninit>(gpu: &Gpu, kind: Upload, label: &str, contents: &[T]) -> wgpu::Buffer {
    bindings::buffer(gpu, kind, label, contents, wgpu::BufferUsages::STORAGE)
}

/// The shader's frame for a tile.
fn shader_frame(
    (picture, place): (&Picture, usize),
    content: &Planes<'_>,
    (pool, grid): (&Pool, &BrickGrid),
) -> plane::Frame {
    let (layout, tile) = (pool.layout(), picture.tiles[place].tile);
    let is_scaled = layout.texel != TexelType::Rgba8 && pool.texels_per_unit() != 1.0;
    plane::Frame {
        cells: layout.cells.map(|n| n as f32),
        width: tile.size[0],
        height: tile.size[1],
        is_first: picture.is_first(place).into(),
        grid_dims: grid.dims(),
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
        depths_per_length: layout.spacing.max_element().recip().min(f64::from(f32::MAX)) as f32,
        ..bytemuck::Zeroable::zeroed()
    }
}

/// How each tile of planes in a tile of the picture sees each plane.
fn shader_tiles(
    picture: &Picture,
    tile: Tile,
    view: &PlaneTiles,
    depths_per_length: f64,
) -> Vec<plane::PlaneTile> {
    let zero_depth = picture.surfaces.zero_depth();
    let shader_tile = |tile: PlaneTile| {
        let offset = (zero_depth - tile.zero_depth) * depths_per_length;
        plane::PlaneTile { surface_offset: offset as f32, ..shader_tile(tile) }
    };
    let along =
        |axis: usize| (tile.first[axis]..tile.first[axis] + tile.size[axis]).step_by(plane::TILE as usize);
    along(1)
        .flat_map(|row| along(0).map(move |column| (column, row)))
        .flat_map(|(column, row)| view.tile(column, row))
        .map(|tile| tile.map_or_else(bytemuck::Zeroable::zeroed, shader_tile))
        .collect()
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
