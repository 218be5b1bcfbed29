//! NRRD and MetaImage.

use volery_io::{ByteOrder, Format, ReadOptions};
use volery_scene::SampleType;

use crate::make::{ORDERS, SCALARS, gzip, mha, mha_header, nrrd, nrrd_type, payload, values, zlib};
use crate::{Folder, assert_values, assert_volume, refuse};

#[test]
fn nrrd_every_type_order_and_encoding_attached_and_detached() {
    let folder = Folder::new();
    for sample in SCALARS {
        for order in ORDERS {
            let bytes = payload(sample, order);
            for (encoding, data) in [("raw", bytes.clone()), ("gzip", gzip(&bytes)), ("gz", gzip(&bytes))] {
                let file = nrrd(sample, order, encoding, &data);
                let volume = folder.read("a.nrrd", &file);
                assert_eq!(volume.format, Format::Nrrd);
                assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
                assert_eq!((volume.notes.len(), volume.orientation().note().is_some()), (0, true));

                folder.put("a.data", &data);
                let header = format!(
                    "NRRD0005\r\ntype: {}\r\ndimension: 3\r\nsizes: 3 2 2\r\nspacings: 1 2 0.5\r\n\
                     endian: {}\r\nencoding: {encoding}\r\ndata file: a.data\r\n",
                    nrrd_type(sample),
                    if order == ByteOrder::Big { "big" } else { "little" }
                );
                assert_volume(&folder.read("a.nhdr", header), sample, [1.0, 2.0, 0.5], &values(sample));
            }
        }
    }
}

fn nrrd_text(fields: &str, data: &[u8]) -> Vec<u8> {
    [b"NRRD0004\n", fields.as_bytes(), b"\n\n", data].concat()
}

#[test]
fn nrrd_colours_come_from_a_first_axis_that_is_not_space() {
    let folder = Folder::new();
    let bytes: Vec<u8> = (0..24).collect();
    let expected: Vec<f64> = (0..24).map(f64::from).collect();
    for fields in [
        "type: uint8\ndimension: 4\nsizes: 3 2 2 2\nencoding: raw",
        "type: uint8\ndimension: 4\nsizes: 3 2 2 2\nkinds: RGB-color domain domain domain\nencoding: raw",
        "type: uint8\ndimension: 4\nsizes: 4 3 2 1\nspacings: nan 1 1 1\nkinds: RGBA-color space space space\nencoding: raw",
        "type: uint8\ndimension: 4\nsizes: 3 2 2 2\nkinds: vector domain domain domain\nencoding: raw",
        "type: uint8\ndimension: 4\nsizes: 3 2 2 2\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nencoding: raw",
        "type: uint8\ndimension: 3\nsizes: 3 4 2\nkinds: 3-color domain domain\nencoding: raw",
    ] {
        let volume = folder.read("a.nrrd", nrrd_text(fields, &bytes));
        assert!(volume.grid.sample_type().channels() >= 3, "{fields}");
        assert_values(&volume, &expected);
    }
    // Three samples along x are no colour.
    let volume =
        folder.read("a.nrrd", nrrd_text("type: uint8\ndimension: 3\nsizes: 3 4 2\nencoding: raw", &bytes));
    assert_eq!(volume.grid.dims(), [3, 4, 2]);
    let fields = "type: short\ndimension: 4\nsizes: 3 2 2 1\nkinds: vector domain domain domain\nendian: little\nencoding: raw";
    let volume = folder.read("a.nrrd", nrrd_text(fields, &bytes));
    let length = |i: u32| {
        (0..3).map(|j| f64::from(256 * (6 * i + 2 * j + 1) + 6 * i + 2 * j).powi(2)).sum::<f64>().sqrt()
    };
    assert_values(&volume, &[0, 1, 2, 3].map(|i| f64::from(length(i) as f32)));
}

#[test]
fn nrrd_skips_bytes_from_either_end() {
    let folder = Folder::new();
    let bytes = payload(SampleType::U8, ByteOrder::Little);
    for (skip, data) in [("5", [&[9; 5], &bytes[..]].concat()), ("-1", [&[9; 7], &bytes[..]].concat())] {
        let fields = format!("type: uint8\ndimension: 3\nsizes: 3 2 2\nbyte skip: {skip}\nencoding: raw");
        let attached = folder.read("a.nrrd", nrrd_text(&fields, &data));
        assert_values(&attached, &values(SampleType::U8));
        folder.put("b.raw", &data);
        let volume = folder.read("a.nhdr", nrrd_text(&format!("{fields}\ndatafile: b.raw"), b""));
        assert_values(&volume, &values(SampleType::U8));
    }
}

/// Fields of a header, and how its refusal begins.
const NRRD_LIES: &[(&str, &str)] = &[
    ("", "dimension is missing, expected it in the header"),
    ("dimension: 3", "sizes is missing"),
    ("dimension: 2\nsizes: 3 2 2", "sizes is '[3, 2, 2]', expected 2 of 1 to 16"),
    ("dimension: 99999999999999999999\nsizes: 3", "dimension is '99999999999999999999', expected 1 to 16"),
    ("dimension: 3\nsizes: 3 -2 2", "sizes is '3 -2 2', expected whole numbers"),
    ("dimension: 3\nsizes: 0 2 2\ntype: uint8\nencoding: raw", "sizes is [0, 2, 2], expected at least 1"),
    ("dimension: 3\nsizes: 3 2 2", "type is missing"),
    ("dimension: 3\nsizes: 3 2 2\ntype: block", "type is 'block', expected an integer"),
    ("dimension: 3\nsizes: 3 2 2\ntype: short\nencoding: raw", "endian is missing, expected the byte order"),
    ("dimension: 3\nsizes: 3 2 2\ntype: short\nendian: middle", "endian is 'middle', expected little or big"),
    ("dimension: 3\nsizes: 3 2 2\ntype: uint8", "encoding is missing"),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: bzip2",
        "encoding is 'bzip2', expected raw, gzip, text or hex",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nspacings: 1 1",
        "spacings is 2 entries, expected 3",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nspace directions: (1,0 (0,1)",
        "space directions is",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nspace directions: (0,0,0) (0,1,0) (0,0,1)",
        "spacings of axis 0 is 0",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nline skip: 3",
        "the data part holds 0 bytes, expected 12",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nline skip: -1",
        "line skip is '-1', expected 0",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: gzip\nbyte skip: -1",
        "byte skip is -1, expected 0 or more",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\nbyte skip: 9223372036854775807",
        "the data part holds 0 bytes",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: LIST",
        "number of files of data file is 0, expected 2, one for each slice",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: i%03d.raw 1 9 1",
        "number of files of data file is 3",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: i%03d.raw 1 2 0",
        "data file is 'i%03d.raw 1 2 0'",
    ),
    (
        "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: i%x.raw 1 2",
        "data file is 'i%x.raw 1 2'",
    ),
    ("dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw", "the data part holds 0 bytes, expected 12"),
    (
        "dimension: 3\nsizes: 4294967296 4294967296 4294967296\ntype: double\nendian: big\nencoding: raw",
        "the volume needs 633825300114114700748351602688 bytes",
    ),
    ("no colon here", "header line is 'no colon here', expected 'field: value'"),
    ("dimension: \u{e9}", "dimension is '\u{e9}', expected 1 to 16"),
];

#[test]
fn nrrd_lying_headers() {
    let folder = Folder::new();
    for (fields, expected) in NRRD_LIES {
        let line = folder.refuse("a.nrrd", nrrd_text(fields, b""));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    assert!(folder.refuse("a.nrrd", "NRRD9999\n").starts_with("magic is 'NRRD9999', expected NRRD0001"));
    assert!(folder.refuse("a.nrrd", "PK34").starts_with("magic is 'PK34'"));
    assert!(folder.refuse("a.nrrd", b"NRRD0004\n\xff\xff: 3\n").starts_with("header is not text"));
    let long = [&b"NRRD0004\n#"[..], &vec![b'x'; 2 << 20]].concat();
    assert!(folder.refuse("a.nrrd", long).starts_with("header is longer than 1 MiB"));
    let fields = "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: not/there.raw";
    let line = folder.refuse("a.nrrd", nrrd_text(fields, b""));
    assert!(line.contains("not/there.raw: cannot be read: "), "{line}");
    let fields = "dimension: 3\nsizes: 3 2 2\ntype: uint8\nencoding: raw\ndata file: .";
    let line = folder.refuse("a.nrrd", nrrd_text(fields, b""));
    assert!(line.ends_with("is a folder, expected a file"), "{line}");
}

#[test]
fn nrrd_and_metaimage_truncated_at_every_byte() {
    let folder = Folder::new();
    let bytes = payload(SampleType::U16, ByteOrder::Big);
    for (name, file) in [
        ("a.nrrd", nrrd(SampleType::U16, ByteOrder::Big, "raw", &bytes)),
        ("b.nrrd", nrrd(SampleType::U16, ByteOrder::Big, "gzip", &gzip(&bytes))),
        ("a.mha", mha(SampleType::U16, ByteOrder::Big, false, &bytes)),
        ("b.mha", mha(SampleType::U16, ByteOrder::Big, true, &zlib(&bytes))),
    ] {
        for cut in 0..file.len() {
            folder.refuse(name, &file[..cut]);
        }
        let longer = [&file[..], &[7; 3]].concat();
        if name == "b.nrrd" {
            // What follows a gzip stream must be another one.
            folder.refuse(name, longer);
            continue;
        }
        let volume = folder.read(name, longer);
        assert_volume(&volume, SampleType::U16, [1.0, 2.0, 0.5], &values(SampleType::U16));
        // A zlib stream says where it ends; of plain data the header does, so it may be wrong.
        let is_excess = |note: &&String| note.starts_with("the file goes on after the last sample");
        let excess = volume.notes.iter().filter(is_excess).count();
        assert_eq!(excess, usize::from(name != "b.mha"), "{:?}", volume.notes);
    }
}

#[test]
fn metaimage_every_type_order_and_compression_local_and_detached() {
    let folder = Folder::new();
    for sample in SCALARS {
        for order in ORDERS {
            let bytes = payload(sample, order);
            for (compressed, data) in [(false, bytes.clone()), (true, zlib(&bytes))] {
                let volume = folder.read("a.mha", mha(sample, order, compressed, &data));
                assert_eq!(volume.format, Format::MetaImage);
                assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
                folder.put("a.zraw", &data);
                let volume = folder.read("a.mhd", mha_header(sample, order, compressed, "a.zraw"));
                assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
            }
        }
    }
}

#[test]
fn metaimage_channels_header_sizes_and_element_size() {
    let folder = Folder::new();
    let bytes: Vec<u8> = (0..24).collect();
    let expected: Vec<f64> = (0..24).map(f64::from).collect();
    for (channels, dims) in [(3, "4 2"), (4, "3 2")] {
        let header = format!(
            "NDims = 2\nDimSize = {dims}\nElementType = MET_UCHAR\nElementNumberOfChannels = {channels}\n\
             ElementSize = 3 4\nElementDataFile = LOCAL\n"
        );
        let volume = folder.read("a.mha", [header.as_bytes(), &bytes].concat());
        assert_values(&volume, &expected);
        assert_eq!(volume.grid.spacing().to_array(), [3.0, 4.0, 1.0]);
    }
    for (size, data) in [("5", [&[9; 5], &bytes[..12]].concat()), ("-1", [&[9; 7], &bytes[..12]].concat())] {
        folder.put("a.raw", data);
        let header = format!(
            "NDims = 3\nDimSize = 3 2 2\nElementType = MET_UCHAR\nHeaderSize = {size}\nElementDataFile = a.raw\n"
        );
        assert_values(&folder.read("a.mhd", header), &expected[..12]);
    }
}

#[test]
fn metaimage_lying_headers() {
    let folder = Folder::new();
    let good = mha_header(SampleType::U8, ByteOrder::Little, false, "LOCAL");
    let cases = [
        ("NDims = 3", "NDims = 0", "DimSize is [3, 2, 2], expected 0 of 1 to 10"),
        ("NDims = 3", "NDims = -1", "NDims is '-1', expected 1 to 10"),
        ("NDims = 3\n", "", "NDims is missing"),
        ("DimSize = 3 2 2", "DimSize = 3 2", "DimSize is [3, 2], expected 3 of 1 to 10"),
        ("DimSize = 3 2 2", "DimSize = 3 0 2", "DimSize is [3, 0, 2], expected at least 1"),
        ("DimSize = 3 2 2", "DimSize = 1e9 2 2", "DimSize is '1e9 2 2', expected whole numbers"),
        (
            "DimSize = 3 2 2",
            "DimSize = 9999999999 9999999999 9999999999",
            "the volume needs 999999999700000000029999999999 bytes",
        ),
        ("MET_UCHAR", "MET_OTHER", "ElementType is 'MET_OTHER', expected MET_UCHAR"),
        (
            "MET_UCHAR",
            "MET_UCHAR\nElementNumberOfChannels = 0",
            "ElementNumberOfChannels is 0, expected a whole",
        ),
        (
            "MET_UCHAR",
            "MET_UCHAR\nElementNumberOfChannels = x",
            "ElementNumberOfChannels is 'x', expected a whole",
        ),
        ("BinaryData = True", "BinaryData = False", "count of numbers in the array is 0, expected 12"),
        ("BinaryData = True", "BinaryData = yes", "BinaryData is 'yes', expected True or False"),
        (
            "BinaryDataByteOrderMSB = False",
            "BinaryDataByteOrderMSB = x",
            "BinaryDataByteOrderMSB is 'x', expected True or False",
        ),
        ("ElementSpacing = 1 2 0.5", "ElementSpacing = 1 nan 1", "ElementSpacing of axis 1 is NaN"),
        ("ElementSpacing = 1 2 0.5", "ElementSpacing = 0 1 1", "ElementSpacing of axis 0 is 0"),
        ("LOCAL", "LIST", "number of files of ElementDataFile is 0, expected 2, one for each slice"),
        ("LOCAL", "", "ElementDataFile is '', expected LOCAL"),
        ("LOCAL", "slice%03d.raw 1 9 1", "number of files of ElementDataFile is 3, expected 2"),
        ("ElementDataFile = LOCAL\n", "", "ElementDataFile is missing"),
        ("ObjectType = Image", "no equals sign", "header line is 'no equals sign', expected 'Field = value'"),
        ("CompressedData = False", "CompressedData = True", "the zlib stream is damaged: "),
    ];
    for (from, to, expected) in cases {
        assert!(good.contains(from));
        let line = folder.refuse("a.mha", good.replace(from, to));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let line = folder.refuse(
        "a.mha",
        [good.replace("CompressedData = False", "CompressedData = True").as_bytes(), &[7; 30]].concat(),
    );
    assert!(line.starts_with("the zlib stream is damaged: "), "{line}");
    let options = ReadOptions { max_bytes: 11, ..ReadOptions::default() };
    let path = folder.put("a.mha", [good.as_bytes(), &[0; 12]].concat());
    assert_eq!(refuse(&path, &options), "the volume needs 12 bytes, expected at most 11");
}
