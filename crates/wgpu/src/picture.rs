//! The picture on its way back: drawn in bands of rows, so that neither the size of a buffer nor the patience
//! of a driver limits it, and read as f32.

use std::ops::Range;
use std::sync::mpsc;

use volery_frame::{Drawn, Image};

use crate::gpu::{Failure, Gpu};
use crate::surfaces::FrameSurfaces;
use crate::tiles::Tile;

/// Bytes of a pixel: three f32.
const PIXEL_BYTES: u64 = 12;

/// Most bytes of a band.
const BAND_BYTES: u64 = 64 << 20;

/// Bytes of the two timestamps behind the pixels in the staging buffer.
const STAMP_BYTES: u64 = 16;

/// Buffers for one band, and the clock.
pub(crate) struct Band {
    pixels: wgpu::Buffer,
    staging: wgpu::Buffer,
    stamps: Option<Stamps>,
    bytes: u64,
}

struct Stamps {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

/// Pixels of the bands of a picture, the last of which may have fewer rows.
pub(crate) fn band_size(gpu: &Gpu, [width, height]: [u32; 2], tile: u32) -> [u32; 2] {
    [width, rows_per_band(gpu, width, height, tile).min(height)]
}

/// Rows of a band in pictures of this width: multiples of a tile.
fn rows_per_band(gpu: &Gpu, width: u32, height: u32, tile: u32) -> u32 {
    let limits = gpu.device.limits();
    let bytes = BAND_BYTES.min(limits.max_buffer_size).min(limits.max_storage_buffer_binding_size);
    let rows = bytes / (u64::from(width) * PIXEL_BYTES);
    let rows = u32::try_from(rows).unwrap_or(u32::MAX).min(height.next_multiple_of(tile));
    (rows / tile).max(1) * tile
}

/// Where the passes of a band write their times, if the device has a clock.
#[derive(Clone, Copy)]
pub(crate) struct Clock<'a>(Option<&'a wgpu::QuerySet>);

impl<'a> Clock<'a> {
    /// For the first pass of several.
    pub(crate) fn at_start(self) -> Option<wgpu::RenderPassTimestampWrites<'a>> {
        self.0.map(|query_set| wgpu::RenderPassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: None,
        })
    }

    /// For the last pass of several.
    pub(crate) fn at_end(self) -> Option<wgpu::ComputePassTimestampWrites<'a>> {
        self.0.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: None,
            end_of_pass_write_index: Some(1),
        })
    }
}

/// Draws a picture band by band, its surfaces and then the rest in one compute pass each: for a range of rows, `bind`
/// gets the buffer to fill, `encode` adds the commands. Buffers are taken from `kept` where they fit, and left there.
pub(crate) fn draw_in_bands(
    gpu: &Gpu,
    kept: &mut Option<Band>,
    size: [u32; 2],
    (tile, surfaces): (u32, &FrameSurfaces<'_>),
    mut bind: impl FnMut(&wgpu::Buffer, Range<u32>) -> wgpu::BindGroup,
    mut encode: impl FnMut(&mut wgpu::ComputePass<'_>, &wgpu::BindGroup, Range<u32>),
) -> Result<Drawn, Failure> {
    let bind = |picture: &wgpu::Buffer, rows: Range<u32>| {
        let band =
            Tile { first: [0, rows.start], size: [size[0], rows.end - rows.start], picture_width: size[0] };
        (bind(picture, rows), surfaces.bind(band))
    };
    draw_bands_in_passes(gpu, kept, size, tile, bind, |encoder, clock, (bound, behind), rows| {
        if let Some(behind) = behind {
            surfaces.encode(encoder, clock.at_start(), behind);
        }
        let timestamp_writes = clock.at_end().map(|writes| wgpu::ComputePassTimestampWrites {
            beginning_of_pass_write_index: behind.is_none().then_some(0),
            ..writes
        });
        let descriptor = wgpu::ComputePassDescriptor { label: Some("volery picture"), timestamp_writes };
        encode(&mut encoder.begin_compute_pass(&descriptor), bound, rows);
    })
}

/// As [`draw_in_bands`] in passes of any kind and number; the first and the last one must look at the clock.
pub(crate) fn draw_bands_in_passes<B>(
    gpu: &Gpu,
    kept: &mut Option<Band>,
    [width, height]: [u32; 2],
    tile: u32,
    mut bind: impl FnMut(&wgpu::Buffer, Range<u32>) -> B,
    mut encode: impl FnMut(&mut wgpu::CommandEncoder, Clock<'_>, &B, Range<u32>),
) -> Result<Drawn, Failure> {
    let mut pixels = Vec::new();
    let no_memory = |_| Failure::Other(format!("no memory for a picture of {width}x{height} pixels"));
    pixels.try_reserve_exact(width as usize * height as usize).map_err(no_memory)?;
    let rows = rows_per_band(gpu, width, height, tile);
    let band = match kept.take().filter(|band| band.fits(width, rows)) {
        Some(band) => band,
        None => gpu.checked(|| Band::new(gpu, width, rows))?,
    };
    let mut seconds = Some(0.0);
    for first_row in (0..height).step_by(rows as usize) {
        let end_row = (first_row + rows).min(height);
        let rows = first_row..end_row;
        let bound = gpu.checked(|| bind(&band.pixels, rows.clone()))?;
        let num_pixels = width as usize * rows.len();
        let run =
            band.run(gpu, num_pixels, &mut pixels, |encoder, clock| encode(encoder, clock, &bound, rows))?;
        seconds = seconds.zip(run).map(|(sum, run)| sum + run);
    }
    *kept = Some(band);
    Ok(Drawn { image: Image { width, height, pixels }, device_seconds: seconds, ray_doubt: None })
}

impl Band {
    fn new(gpu: &Gpu, width: u32, rows: u32) -> Self {
        let bytes = u64::from(width) * u64::from(rows) * PIXEL_BYTES;
        let buffer = |label, size, usage| {
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            gpu.device.create_buffer(&descriptor)
        };
        let stamps = gpu.has(wgpu::Features::TIMESTAMP_QUERY).then(|| Stamps {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("volery timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer(
                "volery timestamps",
                STAMP_BYTES,
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
        });
        Self {
            pixels: buffer(
                "volery picture",
                bytes,
                wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            ),
            // Timestamps lie behind the pixels, at a multiple of their 8 bytes: rows come in tiles of 8.
            staging: buffer(
                "volery picture staging",
                bytes + STAMP_BYTES,
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            ),
            stamps,
            bytes,
        }
    }

    /// Whether pictures of this width can be drawn in bands of these rows.
    fn fits(&self, width: u32, rows: u32) -> bool {
        self.bytes == u64::from(width) * u64::from(rows) * PIXEL_BYTES
    }

    /// Runs passes that fill [`Band::pixels`], appends the pixels of `num_pixels` to `picture`, and
    /// returns the device's own seconds.
    fn run(
        &self,
        gpu: &Gpu,
        num_pixels: usize,
        picture: &mut Vec<[f32; 3]>,
        encode: impl FnOnce(&mut wgpu::CommandEncoder, Clock<'_>),
    ) -> Result<Option<f64>, Failure> {
        let received = gpu.checked(|| {
            self.submit(gpu, encode);
            let (sender, receiver) = mpsc::channel();
            self.staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
            gpu.wait().map(|()| receiver)
        })??;
        match received.recv() {
            Ok(Ok(())) => {}
            _ => return Err(Failure::Other("the picture could not be read back".to_owned())),
        }
        let view = self.staging.get_mapped_range(..).map_err(|e| Failure::Other(e.to_string()))?;
        let (pixels, stamps) = view.split_at(self.bytes as usize);
        picture.extend_from_slice(&bytemuck::cast_slice(pixels)[..num_pixels]);
        let seconds = self.stamps.is_some().then(|| {
            let [from, to] = [0, 8].map(|i| u64::from_le_bytes(std::array::from_fn(|byte| stamps[i + byte])));
            to.saturating_sub(from) as f64 * f64::from(gpu.queue.get_timestamp_period()) * 1e-9
        });
        drop(view);
        self.staging.unmap();
        Ok(seconds)
    }

    fn submit(&self, gpu: &Gpu, encode: impl FnOnce(&mut wgpu::CommandEncoder, Clock<'_>)) {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("volery picture") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        encode(&mut encoder, Clock(self.stamps.as_ref().map(|stamps| &stamps.queries)));
        encoder.copy_buffer_to_buffer(&self.pixels, 0, &self.staging, 0, self.bytes);
        if let Some(stamps) = &self.stamps {
            encoder.resolve_query_set(&stamps.queries, 0..2, &stamps.resolved, 0);
            encoder.copy_buffer_to_buffer(&stamps.resolved, 0, &self.staging, self.bytes, STAMP_BYTES);
        }
        gpu.queue.submit([encoder.finish()]);
    }
}
