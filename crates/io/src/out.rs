//! Files out: pictures and volumes, each written beside its place and then renamed.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use exr::prelude::{Encoding, Image, SpecificChannels, WritableImage};
use glam::{DAffine3, DMat3, DVec3};
use volery_scene::{SampleType, Samples, VoxelGrid, for_samples};

use crate::error::ReadError;
use crate::layout::ByteOrder;
use crate::orientation::World;
use crate::volume::read_png;

mod whole;

pub use whole::{Abandoned, WriteError, abandon_unfinished, check_writable, write_atomically};

/// A picture in linear RGB, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// All pixels, row by row.
    pub pixels: Vec<[f32; 3]>,
}

fn check_pixels(width: u32, height: u32, pixels: &[[f32; 3]]) -> io::Result<()> {
    let expected = u64::from(width) * u64::from(height);
    if width == 0 || height == 0 || pixels.len() as u64 != expected {
        let found = pixels.len();
        return Err(io::Error::other(format!("{found} pixels, expected {width} x {height}, at least 1 x 1")));
    }
    Ok(())
}

/// Writes a picture as PNG of 8 bits: linear values times 255, rounded, without gamma; values outside
/// [0, 1] are cut off, NaN is black.
///
/// # Errors
/// When the file cannot be written, or `pixels` are not `width` times `height`.
pub fn write_png(path: &Path, width: u32, height: u32, pixels: &[[f32; 3]]) -> Result<(), WriteError> {
    write_atomically(path, |file| {
        check_pixels(width, height, pixels)?;
        let mut encoder = png::Encoder::new(file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        // A cast of NaN to an integer is 0.
        let bytes: Vec<u8> =
            pixels.as_flattened().iter().map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&bytes)?;
        Ok(writer.finish()?)
    })
}

/// Writes a picture as OpenEXR of 32-bit floats, bit for bit.
///
/// # Errors
/// As [`write_png`].
pub fn write_exr(path: &Path, width: u32, height: u32, pixels: &[[f32; 3]]) -> Result<(), WriteError> {
    write_atomically(path, |file| {
        check_pixels(width, height, pixels)?;
        let row = width as usize;
        let channels = SpecificChannels::rgb(|at: exr::math::Vec2<usize>| {
            let [r, g, b] = pixels[at.y() * row + at.x()];
            (r, g, b)
        });
        let size = (row, height as usize);
        let image = Image::from_encoded_channels(size, Encoding::FAST_LOSSLESS, channels);
        image.write().non_parallel().to_buffered(file).map_err(io::Error::other)
    })
}

/// Reads a PNG as a picture: values over 255, without gamma; gray is repeated, opacity dropped.
///
/// # Errors
/// When the file cannot be read or is no PNG.
pub fn read_png_rgb(path: &Path) -> Result<Picture, ReadError> {
    let page = read_png(path).map_err(|problem| ReadError { path: path.to_owned(), problem })?;
    let unit = |byte: u8| f32::from(byte) / 255.0;
    let pixels = match page.sample {
        SampleType::Rgb8 | SampleType::Rgba8 => {
            let pixels = page.bytes.chunks_exact(page.sample.bytes());
            pixels.map(|pixel| [unit(pixel[0]), unit(pixel[1]), unit(pixel[2])]).collect()
        }
        SampleType::U16 => {
            let words = page.bytes.as_chunks::<2>().0.iter();
            words.map(|&word| [f32::from(u16::from_ne_bytes(word)) / 65535.0; 3]).collect()
        }
        _ => page.bytes.iter().map(|&byte| [unit(byte); 3]).collect(),
    };
    Ok(Picture { width: page.width, height: page.height, pixels })
}

/// Writes a volume as NRRD, uncompressed, in the machine's byte order, with the place of its samples in a world of this
/// kind. Where that is more than their distances, the lengths of the axes in the world stand for these.
///
/// # Errors
/// When the file cannot be written.
pub fn write_nrrd(path: &Path, grid: &VoxelGrid, world: World) -> Result<(), WriteError> {
    write_atomically(path, |file| {
        let (name, color) = match grid.sample_type() {
            SampleType::U8 => ("uint8", None),
            SampleType::I8 => ("int8", None),
            SampleType::U16 => ("uint16", None),
            SampleType::I16 => ("int16", None),
            SampleType::U32 => ("uint32", None),
            SampleType::I32 => ("int32", None),
            SampleType::F32 => ("float", None),
            SampleType::F64 => ("double", None),
            SampleType::Rgb8 => ("uint8", Some("3 RGB-color")),
            SampleType::Rgba8 => ("uint8", Some("4 RGBA-color")),
        };
        let (channels, kind) = color.and_then(|color| color.split_once(' ')).unwrap_or_default();
        let pad = |text: &str| if text.is_empty() { String::new() } else { format!("{text} ") };
        let [x, y, z] = grid.dims();
        writeln!(file, "NRRD0004\ntype: {name}\ndimension: {}", if color.is_some() { 4 } else { 3 })?;
        writeln!(file, "sizes: {}{x} {y} {z}", pad(channels))?;
        write_place(file, grid, world, color.is_some())?;
        writeln!(file, "kinds: {}domain domain domain", pad(kind))?;
        let order = if ByteOrder::NATIVE == ByteOrder::Little { "little" } else { "big" };
        writeln!(file, "endian: {order}\nencoding: raw\n")?;
        write_samples(file, grid.samples())
    })
}

/// Distances of samples, or where they say too little, directions and origin.
fn write_place(
    file: &mut BufWriter<File>,
    grid: &VoxelGrid,
    world: World,
    has_channels: bool,
) -> io::Result<()> {
    let (spacing, world_from_index) = (grid.spacing(), grid.world_from_index());
    if world == World::Plain && world_from_index == DAffine3::from_scale(spacing) {
        let of_channels = if has_channels { "nan " } else { "" };
        return writeln!(file, "spacings: {of_channels}{} {} {}", spacing.x, spacing.y, spacing.z);
    }
    match world {
        World::Anatomical => writeln!(file, "space: right-anterior-superior")?,
        World::Plain => writeln!(file, "space dimension: 3")?,
    }
    let vector = |DVec3 { x, y, z }: DVec3| format!("({x},{y},{z})");
    let DMat3 { x_axis, y_axis, z_axis } = world_from_index.matrix3;
    let of_channels = if has_channels { "none " } else { "" };
    let axes = [x_axis, y_axis, z_axis].map(vector).join(" ");
    writeln!(file, "space directions: {of_channels}{axes}")?;
    writeln!(file, "space origin: {}", vector(world_from_index.translation))
}

fn write_samples(file: &mut BufWriter<File>, samples: &Samples) -> io::Result<()> {
    for_samples!(samples, |values| file.write_all(bytemuck::cast_slice(values)))
}
