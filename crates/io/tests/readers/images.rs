//! PNG, JPEG, TIFF and folders of slices.

use std::io::Cursor;

use tiff::encoder::{TiffEncoder, colortype, compression::DeflateLevel};
use volery_io::{Format, ReadOptions, read_volume};
use volery_scene::SampleType;

use crate::{Folder, assert_values, refuse};

/// A PNG of any colour type, so also of those that volery never writes.
pub(crate) fn png(
    width: u32,
    height: u32,
    color: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == png::ColorType::Indexed {
        encoder.set_palette(vec![1, 2, 3, 250, 251, 252]);
        encoder.set_trns(vec![255, 7]);
    }
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    file
}

pub(crate) fn tiff<C: colortype::ColorType>(
    width: u32,
    height: u32,
    pages: &[Vec<C::Inner>],
    deflate: bool,
) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    if deflate {
        encoder = encoder.with_compression(tiff::encoder::Compression::Deflate(DeflateLevel::Fast));
    }
    for page in pages {
        encoder.write_image::<C>(width, height, page).unwrap();
    }
    file.into_inner()
}

pub(crate) fn jpeg(width: u32, height: u32, color: bool) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let format = image::ImageFormat::Jpeg;
    if color {
        let image =
            image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x * 9) as u8, (y * 7) as u8, 90]));
        image.write_to(&mut file, format).unwrap();
    } else {
        let image = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x * 9 + y) as u8]));
        image.write_to(&mut file, format).unwrap();
    }
    file.into_inner()
}

#[test]
fn png_of_every_colour_type() {
    use png::{BitDepth::*, ColorType::*};
    let folder = Folder::new();
    let cases = [
        (Grayscale, Eight, vec![0, 128, 255, 3], SampleType::U8, vec![0.0, 128.0, 255.0, 3.0], 0),
        (
            Grayscale,
            Sixteen,
            vec![0, 1, 1, 0, 255, 255, 2, 0],
            SampleType::U16,
            vec![1.0, 256.0, 65535.0, 512.0],
            0,
        ),
        (Grayscale, One, vec![0b0100_0000, 0b1000_0000], SampleType::U8, vec![0.0, 255.0, 255.0, 0.0], 0),
        (Rgb, Eight, (0..12).collect(), SampleType::Rgb8, (0..12).map(f64::from).collect(), 0),
        (Rgba, Eight, (0..16).collect(), SampleType::Rgba8, (0..16).map(f64::from).collect(), 0),
        (GrayscaleAlpha, Eight, vec![9, 1, 8, 2, 7, 3, 6, 4], SampleType::U8, vec![9.0, 8.0, 7.0, 6.0], 1),
        (Indexed, Eight, vec![0, 1, 1, 0], SampleType::U8, vec![0.0, 1.0, 1.0, 0.0], 1),
        (
            GrayscaleAlpha,
            Sixteen,
            vec![1, 2, 9, 9, 3, 4, 9, 9, 0, 0, 9, 9, 0, 1, 9, 9],
            SampleType::U16,
            vec![258.0, 772.0, 0.0, 1.0],
            1,
        ),
        (Indexed, One, vec![0b0100_0000, 0b1000_0000], SampleType::U8, vec![0.0, 1.0, 1.0, 0.0], 1),
        (Rgb, Sixteen, (0..24).collect(), SampleType::Rgb8, (0..12).map(|i| f64::from(2 * i)).collect(), 1),
    ];
    for (color, depth, data, sample, expected, notes) in cases {
        let file = png(2, 2, color, depth, &data);
        let volume = folder.read("a.png", &file);
        assert_eq!((volume.format, volume.grid.dims()), (Format::Png, [2, 2, 1]));
        assert_eq!(volume.grid.sample_type(), sample);
        assert_values(&volume, &expected);
        assert_eq!(volume.notes.len(), notes);
        for cut in 0..file.len() {
            folder.refuse("a.png", &file[..cut]);
        }
    }
}

#[test]
fn jpeg_gray_and_colour() {
    let folder = Folder::new();
    for (color, sample) in [(false, SampleType::U8), (true, SampleType::Rgb8)] {
        let file = jpeg(20, 9, color);
        let volume = folder.read("a.jpeg", &file);
        assert_eq!((volume.format, volume.grid.dims()), (Format::Jpeg, [20, 9, 1]));
        assert_eq!(volume.grid.sample_type(), sample);
        let expected = if color { 90.0 } else { 6.0 * 9.0 + 4.0 };
        let found = volume.grid.samples().value(volume.grid.index([6, 4, 0]), sample.channels() - 1);
        assert!((found - expected).abs() < 12.0, "{found}, expected about {expected}");
        // A picture that lost its end must not come back half gray.
        for cut in 0..file.len() - 2 {
            folder.refuse("a.jpeg", &file[..cut]);
        }
    }
}

#[test]
fn the_content_counts_not_the_ending() {
    let folder = Folder::new();
    let file = png(1, 1, png::ColorType::Grayscale, png::BitDepth::Eight, &[7]);
    assert_eq!(folder.read("a.jpg", &file).format, Format::Png);
    assert_eq!(folder.read("without", &file).format, Format::Png);
    assert!(folder.refuse("a.png", "no picture").starts_with("the PNG image is damaged: its signature"));
    assert!(folder.refuse("a.tif", "no picture").starts_with("the TIFF file is damaged: "));
    assert!(folder.refuse("a.jpg", "no picture").starts_with("the JPEG image is damaged: "));
    assert!(
        folder.refuse("a.xyz", "no picture").starts_with("file name is 'a.xyz', expected one that ends in")
    );
}

#[test]
fn tiff_pages_are_a_stack_of_any_type() {
    let folder = Folder::new();
    for deflate in [false, true] {
        let check = |file: Vec<u8>, sample: SampleType, dims: [usize; 3], expected: &[f64]| {
            let volume = folder.read("a.tif", file);
            assert_eq!((volume.format, volume.grid.dims()), (Format::Tiff, dims));
            assert_eq!(volume.grid.sample_type(), sample);
            assert_values(&volume, expected);
        };
        let dims = [2, 1, 2];
        check(
            tiff::<colortype::Gray8>(2, 1, &[vec![1, 2], vec![3, 4]], deflate),
            SampleType::U8,
            dims,
            &[1.0, 2.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::Gray16>(2, 1, &[vec![1, 65535], vec![3, 4]], deflate),
            SampleType::U16,
            dims,
            &[1.0, 65535.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::GrayI16>(2, 1, &[vec![-1, 2], vec![3, 4]], deflate),
            SampleType::I16,
            dims,
            &[-1.0, 2.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::Gray32>(2, 1, &[vec![1, u32::MAX], vec![3, 4]], deflate),
            SampleType::U32,
            dims,
            &[1.0, 4_294_967_295.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::GrayI32>(2, 1, &[vec![-9, 2], vec![3, 4]], deflate),
            SampleType::I32,
            dims,
            &[-9.0, 2.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::Gray32Float>(2, 1, &[vec![0.5, 2.0], vec![3.0, 4.0]], deflate),
            SampleType::F32,
            dims,
            &[0.5, 2.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::Gray64Float>(2, 1, &[vec![0.1, 2.0], vec![3.0, 4.0]], deflate),
            SampleType::F64,
            dims,
            &[0.1, 2.0, 3.0, 4.0],
        );
        check(
            tiff::<colortype::RGB8>(1, 2, &[vec![1, 2, 3, 4, 5, 6]], deflate),
            SampleType::Rgb8,
            [1, 2, 1],
            &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        );
        check(
            tiff::<colortype::RGBA8>(1, 1, &[vec![1, 2, 3, 4]], deflate),
            SampleType::Rgba8,
            [1, 1, 1],
            &[1.0, 2.0, 3.0, 4.0],
        );
    }
    let volume = folder.read("a.tif", tiff::<colortype::RGB16>(1, 1, &[vec![256, 513, 65_535]], false));
    assert_values(&volume, &[1.0, 2.0, 255.0]);
    assert_eq!(volume.notes, ["the colours have 16 bits a channel; their upper 8 are used"]);
}

/// A big-endian TIFF of one strip, by hand: tag, type (3 short, 4 long), value.
fn big_endian_tiff(tags: &[(u16, u16, u32)], data: &[u8]) -> Vec<u8> {
    let mut file = b"MM\0*".to_vec();
    file.extend((8 + data.len() as u32).to_be_bytes());
    file.extend(data);
    file.extend((tags.len() as u16).to_be_bytes());
    for &(tag, kind, value) in tags {
        file.extend(tag.to_be_bytes());
        file.extend(kind.to_be_bytes());
        file.extend(1u32.to_be_bytes());
        file.extend(if kind == 3 { value << 16 } else { value }.to_be_bytes());
    }
    file.extend([0; 4]);
    file
}

fn sixteen_bits(width: u32, height: u32, strip_bytes: u32) -> Vec<(u16, u16, u32)> {
    vec![
        (256, 4, width),
        (257, 4, height),
        (258, 3, 16),
        (259, 3, 1),
        (262, 3, 1),
        (273, 4, 8),
        (277, 3, 1),
        (278, 4, height),
        (279, 4, strip_bytes),
    ]
}

#[test]
fn tiff_of_big_endian_and_with_sizes_that_lie() {
    let folder = Folder::new();
    let data = [0, 1, 1, 0, 255, 254];
    let volume = folder.read("a.tif", big_endian_tiff(&sixteen_bits(3, 1, 6), &data));
    assert_values(&volume, &[1.0, 256.0, 65534.0]);
    for (width, height) in [(u32::MAX, u32::MAX), (0, 1), (3, 0), (60_000, 60_000)] {
        let line = folder.refuse("a.tif", big_endian_tiff(&sixteen_bits(width, height, 6), &data));
        let expected = ["image size is", "the data of a page holds", "ImageWidth is", "ImageLength is"];
        assert!(expected.iter().any(|expected| line.starts_with(expected)), "{line}");
    }
    folder.refuse("a.tif", big_endian_tiff(&sixteen_bits(3, 2, 6), &data));
    folder.refuse("a.tif", big_endian_tiff(&sixteen_bits(3, 1, u32::MAX), &data));
}

#[test]
fn tiff_pages_of_one_row_in_each_strip() {
    let folder = Folder::new();
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    let pages: Vec<Vec<u8>> = (0..3).map(|page| (0..600).map(|i| (i * 7 + page) as u8).collect()).collect();
    for page in &pages {
        let mut image = encoder.new_image::<colortype::Gray8>(2, 300).unwrap();
        image.rows_per_strip(1).unwrap();
        image.write_data(page).unwrap();
    }
    let volume = folder.read("a.tif", file.into_inner());
    assert_eq!(volume.grid.dims(), [2, 300, 3]);
    assert_values(&volume, &pages.concat().into_iter().map(f64::from).collect::<Vec<_>>());
}

#[test]
fn slices_of_a_folder_come_in_natural_order() {
    let folder = Folder::new();
    let slice = |value: u8| png(1, 1, png::ColorType::Grayscale, png::BitDepth::Eight, &[value]);
    for (name, value) in [("s10.png", 3), ("s9.png", 2), ("s1.PNG", 1)] {
        folder.put(name, slice(value));
    }
    folder.put("s11.tif", tiff::<colortype::Gray8>(1, 1, &[vec![4], vec![5]], false));
    folder.put("notes.txt", "not a slice");
    folder.put(".s0.png", "hidden");
    let volume = read_volume(folder.0.path(), &ReadOptions::default()).unwrap();
    assert_eq!((volume.format, volume.grid.dims()), (Format::Folder, [1, 1, 5]));
    assert_values(&volume, &[1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(volume.notes, ["2 files of the folder are no PNG or TIFF and are not used"]);

    let options = ReadOptions { dims: Some([1, 1, 4]), ..ReadOptions::default() };
    assert_eq!(refuse(folder.0.path(), &options), "image size is 1 x 1 x 5, expected 1 x 1 x 4 as asked for");
    let options = ReadOptions { max_bytes: 4, ..ReadOptions::default() };
    assert!(refuse(folder.0.path(), &options).ends_with("the volume needs 5 bytes, expected at most 4"));

    folder.put("s12.png", png(2, 1, png::ColorType::Grayscale, png::BitDepth::Eight, &[1, 2]));
    let line = refuse(folder.0.path(), &ReadOptions::default());
    assert!(line.ends_with("s12.png: image 5 is 2 x 1 u8, expected 1 x 1 u8 as the first"), "{line}");
}

#[test]
fn pictures_larger_than_their_files_could_hold() {
    let folder = Folder::new();
    let mut file = png(2, 2, png::ColorType::Grayscale, png::BitDepth::Eight, &[0; 4]);
    file[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    let crc = crc32(&file[12..29]);
    file[29..33].copy_from_slice(&crc.to_be_bytes());
    let line = folder.refuse("a.png", &file);
    assert!(line.starts_with("image size is 2147483647 x 2147483647, expected"), "{line}");
    let mut file = jpeg(8, 8, false);
    let at = file.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
    file[at + 5..at + 9].copy_from_slice(&[0xff; 4]);
    let line = folder.refuse("a.jpg", &file);
    assert!(line.starts_with("image size is 65535 x 65535, expected"), "{line}");
}

#[test]
fn pictures_larger_than_the_limit_are_refused_before_they_are_decoded() {
    let folder = Folder::new();
    let gray = png(4, 4, png::ColorType::Grayscale, png::BitDepth::Sixteen, &[0; 32]);
    let tiff = tiff::<colortype::Gray16>(4, 4, &[vec![0; 16]], false);
    for (name, file, bytes) in [("a.png", gray, 32), ("a.jpg", jpeg(4, 4, true), 48), ("a.tif", tiff, 32)] {
        let path = folder.put(name, file);
        let limited = |max_bytes| ReadOptions { max_bytes, ..ReadOptions::default() };
        let line = refuse(&path, &limited(bytes - 1));
        assert_eq!(line, format!("the volume needs {bytes} bytes, expected at most {}", bytes - 1));
        assert!(read_volume(&path, &limited(bytes)).is_ok());
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}
