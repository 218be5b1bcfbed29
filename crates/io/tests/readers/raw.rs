use std::ffi::OsStr;

use volery_io::{ByteOrder, Element, Format, ReadOptions, read_volume};
use volery_scene::SampleType;

use crate::make::{ORDERS, SCALARS, gzip, payload, values, zstd};
use crate::{Folder, assert_volume, refuse};

fn numpy_name(sample: SampleType) -> &'static str {
    match sample {
        SampleType::I8 => "int8",
        SampleType::U16 => "uint16",
        SampleType::I16 => "int16",
        SampleType::U32 => "uint32",
        SampleType::I32 => "int32",
        SampleType::F32 => "float32",
        SampleType::F64 => "float64",
        _ => "uint8",
    }
}

#[test]
fn every_type_and_order_by_name_and_by_options() {
    let folder = Folder::new();
    for sample in SCALARS {
        for order in ORDERS {
            let bytes = payload(sample, order);
            let suffix = if order == ByteOrder::Big { "be" } else { "" };
            let name = format!("some_thing_3x2x2_{}{suffix}.raw", numpy_name(sample));
            let volume = folder.read(&name, &bytes);
            assert_eq!(volume.format, Format::Raw);
            assert_volume(&volume, sample, [1.0; 3], &values(sample));

            let options = ReadOptions {
                dims: Some([3, 2, 2]),
                element: Some(Element { sample, order }),
                spacing: Some([1.0, 2.0, 3.0].into()),
                ..ReadOptions::default()
            };
            let volume = read_volume(&folder.put("noname", &bytes), &options).unwrap();
            assert_volume(&volume, sample, [1.0, 2.0, 3.0], &values(sample));
        }
    }
}

#[test]
fn gzip_and_zstandard() {
    let folder = Folder::new();
    let (sample, bytes) = (SampleType::I16, payload(SampleType::I16, ByteOrder::Big));
    for (name, packed) in
        [("a_3x2x2_int16be.raw.gz", gzip(&bytes)), ("a_3x2x2_int16be.raw.zst", zstd(&bytes))]
    {
        assert_volume(&folder.read(name, &packed), sample, [1.0; 3], &values(sample));
        for cut in 0..packed.len() {
            let line = folder.refuse(name, &packed[..cut]);
            assert!(line.contains("holds") || line.contains("damaged") || line.contains("empty"), "{line}");
        }
    }
    // Two gzip members are one stream.
    let volume = folder.read("b_3x2x2_int16be.raw.gz", [gzip(&bytes[..7]), gzip(&bytes[7..])].concat());
    assert_volume(&volume, sample, [1.0; 3], &values(sample));
}

#[test]
fn numpy_names() {
    for (name, sample, order) in [
        ("uint8", SampleType::U8, ByteOrder::Little),
        (">u2", SampleType::U16, ByteOrder::Big),
        ("<i2", SampleType::I16, ByteOrder::Little),
        ("|i1", SampleType::I8, ByteOrder::Little),
        ("=f8", SampleType::F64, ByteOrder::NATIVE),
        (">f4", SampleType::F32, ByteOrder::Big),
    ] {
        assert_eq!(name.parse(), Ok(Element { sample, order }), "{name}");
    }
    for bad in ["", ">", "u3", "uint64", "float16", ">>u2", "UINT8", "\u{e9}"] {
        let error = bad.parse::<Element>().unwrap_err().to_string();
        assert!(error.starts_with(&format!("dtype is '{bad}', expected one of uint8")), "{error}");
    }
}

#[test]
fn a_large_file_is_mapped_without_a_copy_and_a_swapped_one_copied() {
    let folder = Folder::new();
    let [x, y, z] = [256_usize, 256, 64];
    let values: Vec<u16> = (0..x * y * z).map(|i| (i * 7919 % 65_521) as u16).collect();
    for order in ORDERS {
        let bytes =
            |value: &u16| if order == ByteOrder::Big { value.to_be_bytes() } else { value.to_le_bytes() };
        let bytes: Vec<u8> = values.iter().flat_map(bytes).collect();
        let name =
            if order == ByteOrder::Big { "l_256x256x64_uint16be.raw" } else { "l_256x256x64_uint16.raw" };
        let volume = folder.read(name, bytes);
        let volery_scene::Samples::U16(found) = volume.grid.samples() else { panic!("u16") };
        assert!(found[..] == values[..], "{order:?}");
        // The pages of a map are those of the file: what the file now holds shows.
        std::fs::File::options()
            .write(true)
            .open(folder.path(name))
            .map(|mut file| {
                std::io::Write::write_all(&mut file, &[0x55, 0x55]).unwrap();
            })
            .unwrap();
        let is_mapped = found[0] == 0x5555;
        assert_eq!(is_mapped, order == ByteOrder::NATIVE, "{order:?}");
    }
}

#[test]
fn sizes_that_lie() {
    let folder = Folder::new();
    assert_eq!(folder.refuse("a_3x2x2_uint8.raw", [0; 11]), "the file holds 11 bytes, expected 12");
    assert_eq!(folder.refuse("a_3x2x2_uint8.raw", [0; 13]), "the file holds 13 bytes, expected 12");
    let line = folder.refuse("a_3x2x2_uint8.raw.gz", gzip(&[0; 13]));
    assert_eq!(line, "the gzip stream holds 13 bytes, expected 12");
    let line = folder.refuse("a_3x2x2_uint8.raw.zst", zstd(&[0; 5]));
    assert_eq!(line, "the zstd stream holds 5 bytes, expected 12");
}

#[test]
fn dims_that_overflow_or_are_zero() {
    let folder = Folder::new();
    let huge = "the volume needs 340282366920938463463374607431768211455 bytes, expected at most 68719476736";
    let name = format!("a_{0}x{0}x{0}_uint8.raw", u64::MAX);
    assert_eq!(folder.refuse(&name, [0; 12]), huge);
    let line = folder.refuse("a_4294967296x4294967296x2_float64.raw", [0; 12]);
    assert!(line.starts_with("the volume needs 295147905179352825856 bytes"), "{line}");
    let line = folder.refuse("a_0x2x2_uint8.raw", [0; 12]);
    assert_eq!(line, "dims is 0 x 2 x 2, expected at least 1 sample along each axis");
    let line = folder.refuse("a_99999999999999999999x2x2_uint8.raw", [0; 12]);
    assert!(line.starts_with("file name is "), "{line}");
}

#[test]
fn the_limit_on_bytes_is_kept() {
    let folder = Folder::new();
    let path = folder.put("a_3x2x2_uint16.raw", [0; 24]);
    let options = ReadOptions { max_bytes: 23, ..ReadOptions::default() };
    assert_eq!(refuse(&path, &options), "the volume needs 24 bytes, expected at most 23");
    assert!(read_volume(&path, &ReadOptions { max_bytes: 24, ..options }).is_ok());
}

#[test]
fn what_is_no_file() {
    let folder = Folder::new();
    let options = ReadOptions::default();
    assert!(refuse(&folder.path("missing.raw"), &options).starts_with("file name is 'missing.raw'"));
    assert!(refuse(&folder.path("missing_3x2x2_uint8.raw"), &options).starts_with("cannot be read: "));
    assert!(refuse(&folder.path("missing.nii"), &options).starts_with("cannot be read: "));
    for name in
        ["a_3x2x2_uint8.raw", "a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.vti", "a.tif", "a.png", "a.jpg", "a"]
    {
        assert_eq!(folder.refuse(name, b""), "is empty, expected a file with content", "{name}");
    }
    let line = refuse(folder.0.path(), &options);
    assert!(line.starts_with("image size is") || line.contains("a.png: is empty"), "{line}");
    let empty = folder.path("empty.raw");
    std::fs::create_dir(&empty).unwrap();
    assert!(refuse(&empty, &options).starts_with("is a folder without slices, expected"));
    #[cfg(unix)]
    {
        let sized = ReadOptions { dims: Some([1; 3]), element: "uint8".parse().ok(), ..options };
        let line = refuse("/dev/zero".as_ref(), &sized);
        assert_eq!(line, "is a device or pipe, expected a regular file");
    }
}

#[cfg(unix)]
#[test]
fn names_that_are_not_utf_8_or_hold_line_breaks() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new();
    let path = folder.0.path().join(OsStr::from_bytes(b"\xff\xfe_3x2x2_uint8.raw"));
    std::fs::write(&path, [7; 12]).unwrap();
    assert_eq!(read_volume(&path, &ReadOptions::default()).unwrap().grid.num_samples(), 12);
    std::fs::write(&path, [7; 2]).unwrap();
    let line = read_volume(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(line.ends_with("_3x2x2_uint8.raw: the file holds 2 bytes, expected 12"), "{line}");
    let path = folder.0.path().join("two\nlines_3x2x2_uint8.raw");
    std::fs::write(&path, [7; 2]).unwrap();
    let line = read_volume(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(!line.contains('\n') && line.contains("two\\nlines"), "{line}");
}

#[test]
fn spacing_that_is_no_distance() {
    let folder = Folder::new();
    let path = folder.put("a_3x2x2_uint8.raw", [0; 12]);
    for (spacing, shown) in [(f64::NAN, "NaN"), (0.0, "0"), (-1.0, "-1"), (f64::INFINITY, "inf")] {
        let options = ReadOptions { spacing: Some([1.0, spacing, 1.0].into()), ..ReadOptions::default() };
        let expected = format!("spacing {shown} along axis 1, expected a positive finite number");
        assert!(refuse(&path, &options).ends_with(&expected));
    }
}
