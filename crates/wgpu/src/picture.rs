//! The picture under way: tiles, in each what its pixels have gathered; and its end.
//!
//! # Method
//! No buffer holds a large picture, so it lies in tiles of at most 64 MiB; the tiles of a picture in windows are these. A
//! part goes to the device tile by tile, and nobody waits for it. At the end each tile is put before surfaces or
//! background and read, or shown in a texture.

use std::ops::Range;

use volery_frame::{Drawn, Image, PictureView, Sheets, Window};
use volery_shaders::finish;

use crate::bindings::{bind_group, bind_group_layout, buffer, pipeline_layout, shader_module};
use crate::gpu::{Failure, Gpu, Upload};
use crate::jobs::{Clock, Jobs, Slip};
use crate::surfaces::PictureSurfaces;

/// Most pixels of a tile per axis.
const TILE: u32 = 2048;

/// Bytes of what a pixel has gathered, and of what is read of it.
const GATHERED_BYTES: u64 = 16;
const PIXEL_BYTES: u64 = 12;

/// Bindings may begin at multiples of so many bytes on every device.
const BINDING_STEP: u64 = 256;

/// Most bytes of tiles that are read at one time, if they are several.
const MAX_BATCH_BYTES: u64 = 3 << 22;

/// The least and the largest number of each channel that may be shown.
type Colors = [[f32; 3]; 2];

/// Whatever is shown.
const ANY_COLOR: Colors = [[f32::MIN; 3], [f32::MAX; 3]];

/// A part of the area of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    /// Column and row of its first pixel.
    pub(crate) first: [u32; 2],
    /// Pixels.
    pub(crate) size: [u32; 2],
}

impl Tile {
    /// The tiles of a picture, of at most `most` pixels per axis.
    fn of_picture([width, height]: [u32; 2], most: u32) -> impl Iterator<Item = Self> {
        (0..height).step_by(most as usize).flat_map(move |row| {
            let columns = (0..width).step_by(most as usize);
            columns.map(move |column| Self {
                first: [column, row],
                size: [most.min(width - column), most.min(height - row)],
            })
        })
    }

    fn num_pixels(self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }
}

/// A tile of a picture on the device.
pub(crate) struct PictureTile {
    pub(crate) tile: Tile,
    /// Colour and transmittance of each pixel.
    pub(crate) gathered: wgpu::Buffer,
    /// Whether a part went to the device, so that it holds something.
    has_light: bool,
    /// Pixels per axis that share a ray.
    pub(crate) stride: u32,
}

/// Tiles that the next picture of that size can take over.
pub(crate) struct Kept {
    size: [u32; 2],
    window_side: Option<u32>,
    tiles: Vec<PictureTile>,
}

/// A picture under way.
pub(crate) struct Picture {
    /// Without meshes, which are in `surfaces`.
    pub(crate) view: PictureView<'static>,
    pub(crate) surfaces: PictureSurfaces,
    pub(crate) tiles: Vec<PictureTile>,
    window_side: Option<u32>,
    /// The tile that is drawn alone, if one is.
    window: Option<usize>,
    shown: Shown,
}

/// What the parts so far were.
#[derive(Clone, Copy, Debug, Default)]
struct Shown {
    num_parts: u32,
    has_rays: bool,
    /// What the parts can show; any colour if one of them says nothing.
    colors: Option<Colors>,
}

/// What a part tells of itself.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PartKind {
    is_rays: bool,
    /// Of sheets: see [`Sheets::emitted`].
    colors: Option<Colors>,
}

impl PartKind {
    pub(crate) const RAYS: Self = Self { is_rays: true, colors: None };

    pub(crate) fn sheets(content: &Sheets<'_>) -> Self {
        Self { is_rays: false, colors: Some(content.emitted()) }
    }
}

impl Kept {
    /// Tiles of a picture that is drawn whole, or in windows.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2], window_side: Option<u32>) -> Result<Self, Failure> {
        let limits = gpu.device.limits();
        let bytes = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        let fits = |most: &u32| u64::from(*most) * u64::from(*most) * GATHERED_BYTES <= bytes;
        let whole = || [TILE, TILE / 2, TILE / 4].into_iter().find(fits).unwrap_or(TILE / 8);
        let tiles = gpu.checked(|| {
            let tile = |tile: Tile| PictureTile {
                tile,
                gathered: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("volery tile, gathered"),
                    size: tile.num_pixels() * GATHERED_BYTES,
                    usage: wgpu::BufferUsages::STORAGE,
                    mapped_at_creation: false,
                }),
                has_light: false,
                stride: 1,
            };
            Tile::of_picture(size, window_side.unwrap_or_else(whole)).map(tile).collect()
        })?;
        Ok(Self { size, window_side, tiles })
    }

    pub(crate) fn fits(&self, view: &PictureView<'_>, window_side: Option<u32>) -> bool {
        self.size == [view.width, view.height] && self.window_side == window_side
    }

    pub(crate) fn tiles(&self) -> &[PictureTile] {
        &self.tiles
    }
}

impl Picture {
    pub(crate) fn new(view: &PictureView<'_>, kept: Kept, surfaces: PictureSurfaces) -> Self {
        let view = PictureView { meshes: &[], ..*view };
        let Kept { window_side, mut tiles, .. } = kept;
        for tile in &mut tiles {
            (tile.has_light, tile.stride) = (false, 1);
        }
        Self { view, surfaces, tiles, window_side, window: None, shown: Shown::default() }
    }

    /// Draws one window alone from now on, with a stride, or all.
    pub(crate) fn set_window(&mut self, window: Option<Window>) {
        self.window = window.map(|window| window.number as usize);
        if let Some(Window { number, stride }) = window {
            self.tiles[number as usize].stride = stride;
        }
    }

    /// Parts so far.
    pub(crate) fn num_parts(&self) -> u32 {
        self.shown.num_parts
    }

    /// Windows, if it is drawn in such.
    pub(crate) fn num_windows(&self) -> u32 {
        self.window_side.map_or(0, |_| self.tiles.len() as u32)
    }

    /// Whether nothing was gathered yet in a tile, or what was goes.
    pub(crate) fn is_first(&self, place: usize) -> bool {
        self.window.is_some() || !self.tiles[place].has_light
    }

    /// The tiles that a part is drawn in.
    fn places(&self) -> std::ops::Range<usize> {
        self.window.map_or(0..self.tiles.len(), |window| window..window + 1)
    }

    /// Counts a part that has nothing to show.
    pub(crate) fn add_nothing(&mut self, jobs: &mut Jobs, kind: PartKind) -> u32 {
        jobs.begin(Some(self.shown.num_parts));
        if let Some(window) = self.window {
            self.tiles[window].has_light = false;
        }
        self.shown.add(kind)
    }

    /// Adds a part: `encode` adds the passes of a tile, the first and the last of which must look at the clock.
    pub(crate) fn add(
        &mut self,
        gpu: &Gpu,
        jobs: &mut Jobs,
        kind: PartKind,
        mut encode: impl FnMut(&mut wgpu::CommandEncoder, Clock<'_>, &Slip, (&Self, usize)),
    ) -> Result<u32, Failure> {
        jobs.begin(Some(self.shown.num_parts));
        gpu.checked(|| {
            for place in self.places() {
                jobs.submit(gpu, |encoder, clock, slip| encode(encoder, clock, slip, (self, place)));
            }
        })?;
        for place in self.places() {
            self.tiles[place].has_light = true;
        }
        Ok(self.shown.add(kind))
    }

    /// What ends a tile, as the shaders have it.
    pub(crate) fn ended(&self, tile: &PictureTile, origin: [u32; 2]) -> finish::Tile {
        let [low, high] = self.shown.colors.unwrap_or(ANY_COLOR);
        finish::Tile {
            size: tile.tile.size,
            origin,
            low,
            has_light: tile.has_light.into(),
            high,
            has_surfaces: (!self.surfaces.is_empty()).into(),
            background: self.view.background,
            stride: tile.stride,
        }
    }

    /// Whether nothing shows but the background.
    pub(crate) fn is_bare(&self) -> bool {
        self.surfaces.is_empty() && !self.tiles.iter().any(|tile| tile.has_light)
    }

    pub(crate) fn into_kept(self) -> Kept {
        Kept { size: [self.view.width, self.view.height], window_side: self.window_side, tiles: self.tiles }
    }
}

impl Shown {
    /// Counts a part and returns its number.
    fn add(&mut self, kind: PartKind) -> u32 {
        let colors = kind.colors.unwrap_or(ANY_COLOR);
        let join = |i: usize, of: fn(f32, f32) -> f32| {
            let before = self.colors.map_or(colors[i], |before| before[i]);
            [0, 1, 2].map(|channel| of(before[channel], colors[i][channel]))
        };
        self.colors = Some([join(0, f32::min), join(1, f32::max)]);
        self.has_rays |= kind.is_rays;
        self.num_parts += 1;
        self.num_parts - 1
    }
}

/// What ends pictures that are read back.
pub(crate) struct Finish {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    /// For a tile's pixels, and where they are read.
    buffers: Option<[wgpu::Buffer; 2]>,
}

impl Finish {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Failure> {
        gpu.checked(|| {
            let layout = bind_group_layout(&gpu.device, "volery finish", finish::BINDINGS);
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("volery finish"),
                layout: Some(&pipeline_layout(gpu, &layout)),
                module: &shader_module(gpu, finish::LABEL, finish::SOURCE),
                entry_point: Some(finish::MAIN),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
            Self { layout, pipeline, buffers: None }
        })
    }

    /// Ends a picture and reads it.
    pub(crate) fn read(&mut self, gpu: &Gpu, jobs: &mut Jobs, picture: &Picture) -> Result<Drawn, Failure> {
        let (width, height) = (picture.view.width, picture.view.height);
        let mut pixels: Vec<[f32; 3]> = Vec::new();
        let no_memory = |_| Failure::Other(format!("no memory for a picture of {width}x{height} pixels"));
        let num_pixels = width as usize * height as usize;
        pixels.try_reserve_exact(num_pixels).map_err(no_memory)?;
        if picture.is_bare() {
            pixels.resize(num_pixels, picture.view.background);
        } else {
            jobs.begin(None);
            let mut first = 0;
            while first < picture.tiles.len() {
                let batch = Batch::new(picture, first);
                self.read_batch(gpu, jobs, (picture, &batch), &mut pixels)?;
                first = batch.places.end;
            }
        }
        gpu.checked(|| gpu.wait())??;
        jobs.look(gpu)?;
        let totals = jobs.totals();
        Ok(Drawn {
            image: Image { width, height, pixels },
            device_seconds: totals.device_seconds,
            ray_doubt: picture.shown.has_rays.then_some(totals.doubt),
        })
    }

    fn read_batch(
        &mut self,
        gpu: &Gpu,
        jobs: &mut Jobs,
        (picture, batch): (&Picture, &Batch),
        pixels: &mut Vec<[f32; 3]>,
    ) -> Result<(), Failure> {
        let bytes = batch.bytes;
        let kept = self.buffers.take().filter(|[pixels, _]| pixels.size() >= bytes);
        let [shown, staging] = match kept {
            Some(buffers) => buffers,
            None => gpu.checked(|| {
                let (shown, read) = (wgpu::BufferUsages::STORAGE, wgpu::BufferUsages::MAP_READ);
                [shown | wgpu::BufferUsages::COPY_SRC, read | wgpu::BufferUsages::COPY_DST].map(|usage| {
                    let label = Some("volery picture");
                    let descriptor =
                        wgpu::BufferDescriptor { label, size: bytes, usage, mapped_at_creation: false };
                    gpu.device.create_buffer(&descriptor)
                })
            })?,
        };
        let (sender, receiver) = std::sync::mpsc::channel();
        gpu.checked(|| {
            let bound: Vec<_> =
                batch.tiles(picture).map(|tile| self.bind(gpu, picture, tile, &shown)).collect();
            jobs.submit(gpu, |encoder, clock, _| {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("volery finish"),
                    timestamp_writes: clock.compute(true, true),
                });
                pass.set_pipeline(&self.pipeline);
                for (bound, (_, PictureTile { tile, .. }, _)) in bound.iter().zip(batch.tiles(picture)) {
                    pass.set_bind_group(0, bound, &[]);
                    let [x, y] = tile.size.map(|pixels| pixels.div_ceil(finish::GROUP));
                    pass.dispatch_workgroups(x, y, 1);
                }
                drop(pass);
                encoder.copy_buffer_to_buffer(&shown, 0, &staging, 0, bytes);
            });
            staging.map_async(wgpu::MapMode::Read, ..bytes, move |result| drop(sender.send(result)));
            gpu.wait()
        })??;
        match receiver.recv() {
            Ok(Ok(())) => {}
            _ => return Err(Failure::Other("the picture could not be read back".to_owned())),
        }
        let view = staging.get_mapped_range(..bytes).map_err(|e| Failure::Other(e.to_string()))?;
        for (_, PictureTile { tile, .. }, read) in batch.tiles(picture) {
            let read = &view[read.start as usize..read.end as usize];
            place_tile(pixels, picture.view.width as usize, *tile, bytemuck::cast_slice(read));
        }
        drop(view);
        staging.unmap();
        self.buffers = Some([shown, staging]);
        Ok(())
    }

    /// What ends a tile binds.
    fn bind(
        &self,
        gpu: &Gpu,
        picture: &Picture,
        (place, tile, range): (usize, &PictureTile, Range<u64>),
        shown: &wgpu::Buffer,
    ) -> wgpu::BindGroup {
        let ended = [picture.ended(tile, [0, 0])];
        let ended = buffer(gpu, Upload::Views, "volery finish tile", &ended, wgpu::BufferUsages::UNIFORM);
        bind_group(gpu, &self.layout, finish::BINDINGS, |name| match name {
            "tile" => ended.as_entire_binding(),
            "gathered" => tile.gathered.as_entire_binding(),
            "surfaces" => wgpu::BindingResource::TextureView(picture.surfaces.of_tile(place)),
            // A binding that the shader gains and this does not know fails as one of the wrong kind.
            _ => wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: shown,
                offset: range.start,
                size: std::num::NonZero::new(range.end - range.start),
            }),
        })
    }
}

/// Tiles that are read at one time.
struct Batch {
    places: Range<usize>,
    bytes: u64,
}

impl Batch {
    /// As many from a tile on as are no larger together than the largest tile may be; at least that one.
    fn new(picture: &Picture, first: usize) -> Self {
        let (mut end, mut bytes) = (first, 0);
        for tile in &picture.tiles[first..] {
            let more = bytes + Self::bytes_of(tile);
            if end > first && more > MAX_BATCH_BYTES {
                break;
            }
            (end, bytes) = (end + 1, more);
        }
        Self { places: first..end, bytes }
    }

    /// The tiles, with their place in the picture and that of their bytes.
    fn tiles<'a>(&self, picture: &'a Picture) -> impl Iterator<Item = (usize, &'a PictureTile, Range<u64>)> {
        let mut start = 0;
        self.places.clone().zip(&picture.tiles[self.places.clone()]).map(move |(place, tile)| {
            let begin = start;
            start += Self::bytes_of(tile);
            (place, tile, begin..begin + tile.tile.num_pixels() * PIXEL_BYTES)
        })
    }

    /// The bytes of a tile, up to where the next may begin.
    fn bytes_of(tile: &PictureTile) -> u64 {
        (tile.tile.num_pixels() * PIXEL_BYTES).next_multiple_of(BINDING_STEP)
    }
}

/// Puts a tile's pixels in their place; tiles come row by row, so that what is before it is there.
fn place_tile(pixels: &mut Vec<[f32; 3]>, width: usize, tile: Tile, read: &[[f32; 3]]) {
    let [first_column, first_row] = tile.first.map(|pixel| pixel as usize);
    let [columns, rows] = tile.size.map(|pixels| pixels as usize);
    if columns == width {
        pixels.extend_from_slice(read);
        return;
    }
    pixels.resize(pixels.len().max((first_row + rows) * width), [0.0; 3]);
    for (row, read) in read.chunks_exact(columns).enumerate() {
        let start = (first_row + row) * width + first_column;
        pixels[start..start + columns].copy_from_slice(read);
    }
}
