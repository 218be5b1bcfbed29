//! The pipelines that draw sheets of matter: their buffers from the frame, their commands.
//!
//! # Method
//! Vertices go to the device as they are in the frame, once per revision, and are decoded where they are used: floats,
//! or 12 bytes. A sheet is an indexed draw, whose number tells its thickness; neighbours of equal thickness are one.
//! The fragment stage knows the angle of its ray with the sheets, so how much matter it passes, looks colour and
//! extinction up, and blends over what is behind. Blending does not clamp: an opacity below zero takes matter away.
//! What is summed up is taken into the range of what can be emitted when the picture ends.
//!
//! # Precision
//! Places reach the eye by rows that f64 made, so a far origin loses nothing. Tables are buffers, interpolated in 32
//! bits: a texture's own filter rounds weights to 8.
//!
//! # Guarantees
//! Meshes that no buffer can hold are drawn in parts, sheet by sheet. Where devices do not blend 32 bits, see
//! `cubes`.

mod chunks;
mod held;

use std::collections::HashMap;
use std::ops::Range;

use volery_frame::{Counted, Quantization, Revision, Sheet, SheetVertices, Sheets};
use volery_scene::Projection;
use volery_shaders::sheets;

use crate::bindings::{bind_group, bind_group_layout, buffer, shader_module};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::Jobs;
use crate::picture::{PartKind, Picture, Tile};
use crate::tiles::{Affine, TileView, Tiles, matter_pipeline};
use held::{Held, Part, Store, uploaded};

// What the shader and the frame must mean alike.
const _: () = assert!(sheets::MAX_STRIP_DEPTH == volery_frame::sheets::MAX_STRIP_DEPTH);

/// The pipelines, and what the last frames can lend to the next.
pub(crate) struct SheetStacks {
    layout: wgpu::BindGroupLayout,
    module: wgpu::ShaderModule,
    /// Compiled when first needed.
    pipelines: HashMap<Form, wgpu::RenderPipeline>,
    store: Store,
    tables: Option<Tables>,
}

/// What a frame asks of the pipeline: a form does not pay for what it need not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Form {
    is_quantized: bool,
    has_gradients: bool,
    is_lit: bool,
    has_rows: bool,
    is_parallel: bool,
    has_surfaces: bool,
}

impl Form {
    fn new(picture: &Picture, content: &Sheets<'_>) -> Self {
        let (is_quantized, has_gradients) = match content.vertices {
            SheetVertices::Exact { gradients, .. } => (false, !gradients.is_empty()),
            SheetVertices::Quantized { gradients, .. } => (true, !gradients.is_empty()),
        };
        Self {
            is_quantized,
            has_gradients,
            is_lit: content.light.is_some(),
            has_rows: content.transfer.rows() > 1,
            is_parallel: matches!(picture.view.camera.projection, Projection::Orthographic { .. }),
            has_surfaces: !picture.surfaces.is_empty(),
        }
    }

    fn constants(self) -> [(&'static str, f64); 6] {
        let Self { is_quantized, has_gradients, is_lit, has_rows, is_parallel, has_surfaces } = self;
        [
            (sheets::IS_QUANTIZED, f64::from(is_quantized)),
            (sheets::HAS_GRADIENTS, f64::from(has_gradients)),
            (sheets::IS_LIT, f64::from(is_lit)),
            (sheets::HAS_ROWS, f64::from(has_rows)),
            (sheets::IS_PARALLEL, f64::from(is_parallel)),
            (sheets::HAS_SURFACES, f64::from(has_surfaces)),
        ]
    }
}

/// A draw: triangles of a part, of sheets that have the thickness of this one.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    part: usize,
    /// Numbers of triangles in the part.
    triangles: Range<u32>,
    sheet: u32,
}

impl SheetStacks {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| Self {
            layout: bind_group_layout(&gpu.device, "volery sheets", sheets::BINDINGS),
            module: shader_module(gpu, sheets::LABEL, sheets::SOURCE),
            pipelines: HashMap::new(),
            store: Store::default(),
            tables: None,
        })
    }

    /// Adds a checked part of sheets to a picture, of which one has triangles.
    pub(crate) fn add(
        &mut self,
        gpu: &Gpu,
        tiles: &mut Tiles,
        (picture, jobs): (&mut Picture, &mut Jobs),
        content: &Sheets<'_>,
    ) -> Result<u32, Failure> {
        let pipeline = self.pipeline(gpu, Form::new(picture, content))?;
        let Held { parts, .. } = self.store.hold(gpu, content)?;
        let runs = runs(content.sheets, parts.iter().map(|part| part.triangles.clone()));
        let (listed, place_of) = listed(content.sheets);
        let tables = self.tables.take();
        let tables = gpu.checked(|| Tables::of(tables, gpu, content, listed))?;
        let layout = &self.layout;
        let bind = |picture: &Picture, place: usize| {
            let frame = shader_frame(picture, content, picture.tiles[place].tile);
            let frame =
                buffer(gpu, Upload::Views, "volery sheets frame", &[frame], wgpu::BufferUsages::UNIFORM);
            let surfaces = picture.surfaces.of_tile(place);
            parts.iter().map(|part| tables.bind(gpu, layout, (&frame, surfaces), part)).collect()
        };
        let encode = |pass: &mut wgpu::RenderPass<'_>, bound: &Vec<wgpu::BindGroup>| {
            pass.set_pipeline(&pipeline);
            let mut last_part = None;
            for Run { part, triangles, sheet } in &runs {
                if last_part.replace(*part) != Some(*part) {
                    pass.set_bind_group(0, &bound[*part], &[]);
                    pass.set_index_buffer(parts[*part].indices.slice(..), wgpu::IndexFormat::Uint32);
                }
                let place = place_of[*sheet as usize];
                pass.draw_indexed(3 * triangles.start..3 * triangles.end, 0, place..place + 1);
            }
        };
        let kind = PartKind::sheets(content);
        let number = tiles.add(gpu, (picture, jobs), kind, bind, encode);
        self.tables = Some(tables);
        self.store.forget_nameless();
        number
    }

    /// The pipeline of one form, compiled if this is the first frame that needs it.
    fn pipeline(&mut self, gpu: &Gpu, form: Form) -> Result<wgpu::RenderPipeline, Failure> {
        if let Some(pipeline) = self.pipelines.get(&form) {
            return Ok(pipeline.clone());
        }
        let (label, stages) = (format!("volery sheets {form:?}"), [sheets::CORNER, sheets::MATTER]);
        let make = || matter_pipeline(gpu, &label, &self.layout, &self.module, stages, &form.constants());
        let pipeline = gpu.checked(make)?;
        Ok(self.pipelines.entry(form).or_insert(pipeline).clone())
    }
}

/// What fragments and sheets are looked up in, on the device.
struct Tables {
    transfer: Revision,
    entries: wgpu::Buffer,
    /// In the order of the sheets' first triangles, so that turning the stack around changes nothing.
    listed: Vec<sheets::Sheet>,
    listing: wgpu::Buffer,
}

impl Tables {
    /// Those of a part: what there is, or new.
    fn of(kept: Option<Self>, gpu: &Gpu, content: &Sheets<'_>, listed: Vec<sheets::Sheet>) -> Self {
        let storage = wgpu::BufferUsages::STORAGE;
        let transfer = content.transfer.revision();
        let (kept_entries, kept_listing) = match kept {
            None => (None, None),
            Some(kept) => (
                (kept.transfer == transfer).then_some(kept.entries),
                (kept.listed == listed).then_some(kept.listing),
            ),
        };
        let entries = kept_entries.unwrap_or_else(|| {
            let entries = content.transfer.entries();
            uploaded(gpu, Upload::Transfers, "volery sheet transfer", entries, storage)
        });
        let listing = kept_listing
            .unwrap_or_else(|| uploaded(gpu, Upload::Geometry, "volery sheets", &listed, storage));
        Self { transfer, entries, listed, listing }
    }

    fn bind(
        &self,
        gpu: &Gpu,
        layout: &wgpu::BindGroupLayout,
        (frame, surfaces): (&wgpu::Buffer, &wgpu::TextureView),
        part: &Part,
    ) -> wgpu::BindGroup {
        bind_group(gpu, layout, sheets::BINDINGS, |name| match name {
            "frame" => frame.as_entire_binding(),
            "points" => part.points.as_entire_binding(),
            // Something must be bound where nothing is read.
            "gradients" => part.gradients.as_ref().unwrap_or(&part.points).as_entire_binding(),
            "listing" => self.listing.as_entire_binding(),
            "surfaces" => wgpu::BindingResource::TextureView(surfaces),
            // A binding that the shader gains and this does not know fails as one of the wrong kind.
            _ => self.entries.as_entire_binding(),
        })
    }
}

/// Sheets in the order of their first triangles, as the shader has them, and the place of each in that.
fn listed(stack: &[Sheet]) -> (Vec<sheets::Sheet>, Vec<u32>) {
    let mut order: Vec<usize> = (0..stack.len()).collect();
    order.sort_by_key(|&number| (stack[number].first, stack[number].count, stack[number].counted));
    let mut place_of = vec![0; stack.len()];
    (0..).zip(&order).for_each(|(place, &number)| place_of[number] = place);
    let shader_sheet = |&number: &usize| {
        let counted = match stack[number].counted {
            Counted::All => sheets::ALL,
            Counted::Rising => sheets::RISING,
            Counted::Falling => sheets::FALLING,
        };
        sheets::Sheet { thickness: stack[number].thickness, counted, ..bytemuck::Zeroable::zeroed() }
    };
    (order.iter().map(shader_sheet).collect(), place_of)
}

/// Sheets as draws of parts, in order; parts are consecutive triangles.
fn runs(sheets: &[Sheet], parts: impl Iterator<Item = Range<u32>> + Clone) -> Vec<Run> {
    let is_alike = |a: &Sheet, b: &Sheet| (a.thickness, a.counted) == (b.thickness, b.counted);
    let mut runs: Vec<Run> = Vec::new();
    for (number, sheet) in (0..).zip(sheets) {
        let whole = sheet.first..sheet.first + sheet.count;
        for (part, held) in parts.clone().enumerate() {
            let (first, end) = (whole.start.max(held.start), whole.end.min(held.end));
            if first >= end {
                continue;
            }
            let triangles = first - held.start..end - held.start;
            match runs.last_mut() {
                Some(last)
                    if (last.part, last.triangles.end) == (part, triangles.start)
                        && is_alike(&sheets[last.sheet as usize], sheet) =>
                {
                    last.triangles.end = triangles.end;
                }
                _ => runs.push(Run { part, triangles, sheet: number }),
            }
        }
    }
    runs
}

/// The shader's frame for a tile.
fn shader_frame(picture: &Picture, content: &Sheets<'_>, tile: Tile) -> sheets::Frame {
    let Picture { view: frame, surfaces, .. } = picture;
    let view = TileView::new(frame, tile, 1.0);
    let origin_from_eye = content.origin - frame.camera.eye;
    let quantization = match content.vertices {
        SheetVertices::Exact { .. } => Quantization { low: [0.0; 4], scale: [0.0; 4], magnitude_scale: 0.0 },
        SheetVertices::Quantized { quantization, .. } => quantization,
    };
    let Quantization { low, scale, magnitude_scale } = quantization;
    let (toward_light, ambient, diffuse) =
        content.light.map_or(([0.0; 3], 1.0, 0.0), |light| (light.toward, light.ambient, light.diffuse));
    sheets::Frame {
        clip_x: view.clip_x.relative_to(origin_from_eye),
        clip_y: view.clip_y.relative_to(origin_from_eye),
        clip_w: view.clip_w.relative_to(origin_from_eye),
        depth: Affine { slope: view.forward, rest: -surfaces.zero_depth() }.relative_to(origin_from_eye),
        low,
        scale,
        normal: content.normal.as_vec3().to_array(),
        magnitude_scale,
        toward_light,
        ambient,
        center: view.center.map(|pixels| pixels as f32),
        slope_per_pixel: view.ray_per_pixel.map(|d| d.length() as f32),
        normal_per_pixel: view.ray_per_pixel.map(|d| content.normal.dot(d) as f32),
        normal_ahead: content.normal.dot(view.forward) as f32,
        diffuse,
        column_from_value: content.transfer.column_from_value(),
        row_from_magnitude: content.transfer.row_from_magnitude(),
        columns: content.transfer.columns() as u32,
        rows: content.transfer.rows() as u32,
        eye_depth: -surfaces.zero_depth() as f32,
        ..bytemuck::Zeroable::zeroed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_triangles_of_the_sheets_in_order() {
        let sheet = |first, count, thickness| Sheet {
            first,
            count,
            thickness: [thickness, 0.0],
            counted: Counted::All,
        };
        let sheets =
            [sheet(4, 3, 1.0), sheet(7, 0, 2.0), sheet(7, 2, 1.0), sheet(9, 1, 2.0), sheet(0, 4, 2.0)];
        let run = |part, triangles, sheet| Run { part, triangles, sheet };
        assert_eq!(
            runs(&sheets, std::iter::once(0..10)),
            [run(0, 4..9, 0), run(0, 9..10, 3), run(0, 0..4, 4)],
            "one part: the first two that have triangles are one"
        );
        assert_eq!(
            runs(&sheets, [0..2, 2..5, 5..8, 8..10].into_iter()),
            [
                run(1, 2..3, 0),
                run(2, 0..3, 0),
                run(3, 0..1, 2),
                run(3, 1..2, 3),
                run(0, 0..2, 4),
                run(1, 0..2, 4)
            ]
        );
    }
}
