//! Axes of channels, components and volumes in NRRD, NIfTI and MetaImage, wherever they stand; numbers of 64 bits;
//! data in several files.

use volery_io::ByteOrder::{self, Big, Little};
use volery_io::{ReadOptions, Volume, read_volume};
use volery_scene::SampleType;

use crate::make::{Nifti, encode, gzip, mha_header, zlib};
use crate::{Folder, assert_values, refuse};

fn options(channel: Option<usize>, time_step: Option<usize>) -> ReadOptions {
    ReadOptions { channel, time_step, ..ReadOptions::default() }
}

#[track_caller]
fn read(folder: &Folder, name: &str, options: &ReadOptions) -> Volume {
    read_volume(&folder.path(name), options).unwrap_or_else(|error| panic!("{error}"))
}

/// The value at (x, y, z) of a channel: no two are the same.
fn value(x: usize, y: usize, z: usize, channel: usize) -> f64 {
    (1000 * channel + 100 * z + 10 * y + x) as f64
}

/// An array of 3 x 2 x 2 and so many channels, with the axis of channels at a place among the four.
fn array(channels: usize, place: usize) -> (Vec<f64>, Vec<usize>) {
    let mut sizes = vec![3, 2, 2];
    sizes.insert(place, channels);
    let total = sizes.iter().product::<usize>();
    let values = (0..total).map(|mut number| {
        let mut indices = sizes
            .iter()
            .map(|size| {
                let index = number % size;
                number /= size;
                index
            })
            .collect::<Vec<_>>();
        let channel = indices.remove(place);
        value(indices[0], indices[1], indices[2], channel)
    });
    (values.collect(), sizes)
}

fn of_channel(channel: usize) -> Vec<f64> {
    (0..12).map(|i| value(i % 3, i / 3 % 2, i / 6, channel)).collect()
}

#[test]
fn nrrd_axis_of_channels_may_stand_anywhere() {
    let folder = Folder::new();
    for kind in ["list", "vector", "none"] {
        for place in 0..4 {
            for (order, encoding) in [(Little, "raw"), (Big, "gzip"), (Little, "text"), (Little, "hex")] {
                let (values, sizes) = array(2, place);
                let data = encode(SampleType::F32, order, &values);
                let data = match encoding {
                    "gzip" => gzip(&data),
                    "text" => {
                        values.iter().map(|value| format!("{value}\n")).collect::<String>().into_bytes()
                    }
                    "hex" => data.iter().map(|byte| format!("{byte:02x} ")).collect::<String>().into_bytes(),
                    _ => data,
                };
                let mut directions = vec!["(1,0,0)", "(0,1,0)", "(0,0,2)"];
                directions.insert(place, "none");
                let mut kinds = vec!["domain"; 3];
                kinds.insert(place, kind);
                let sizes = sizes.iter().map(usize::to_string).collect::<Vec<_>>().join(" ");
                let header = format!(
                    "NRRD0005\ntype: float\ndimension: 4\nspace: RAS\nsizes: {sizes}\nspace directions: {}\nkinds: {}\n\
                     endian: {}\nencoding: {encoding}\n\n",
                    directions.join(" "),
                    kinds.join(" "),
                    if order == Big { "big" } else { "little" }
                );
                folder.put("a.nrrd", [header.as_bytes(), &data].concat());
                for channel in 0..2 {
                    let volume = read(&folder, "a.nrrd", &options(Some(channel), None));
                    assert_eq!(volume.grid.dims(), [3, 2, 2]);
                    assert_eq!(volume.grid.spacing().to_array(), [1.0, 1.0, 2.0]);
                    assert_values(&volume, &of_channel(channel));
                }
                let volume = read(&folder, "a.nrrd", &ReadOptions::default());
                if kind == "vector" {
                    let length = |i: usize| of_channel(0)[i].hypot(of_channel(1)[i]);
                    let found: Vec<f64> = (0..12).map(|i| volume.grid.samples().value(i, 0)).collect();
                    assert!((0..12).all(|i| (found[i] / length(i) - 1.0).abs() < 1e-6), "{found:?}");
                    assert!(
                        volume.notes[0].contains("2 components; their magnitude is used"),
                        "{:?}",
                        volume.notes
                    );
                } else {
                    assert_values(&volume, &of_channel(0));
                    assert_eq!(volume.notes, ["channel 0 of 2 is used (another one, 0 to 1, can be chosen)"]);
                }
                let line = refuse(&folder.path("a.nrrd"), &options(Some(2), None));
                assert_eq!(line, "channel asked for is 2, expected 0 to 1");
            }
        }
    }
}

#[test]
fn nrrd_axes_without_a_place_are_told_by_kind_direction_or_spacing() {
    let folder = Folder::new();
    let (values, _) = array(2, 2);
    let data = encode(SampleType::F64, Little, &values);
    let read = |fields: &str| {
        let header = format!(
            "NRRD0005\ntype: double\ndimension: 4\nsizes: 3 2 2 2\nendian: little\nencoding: raw\n{fields}\n\n"
        );
        folder.read("a.nrrd", [header.as_bytes(), &data].concat())
    };
    for fields in [
        "kinds: domain domain list domain",
        "spacings: 1 1 nan 2",
        "space directions: (1,0,0) (0,1,0) (nan,nan,nan) (0,0,2)",
        "kinds: space space ??? space\nspace directions: (1,0,0) (0,1,0) none (0,0,2)",
    ] {
        assert_values(&read(fields), &of_channel(0));
    }
    // Four axes of which nothing is said: the slowest numbers volumes, and so does time wherever it is.
    let header = "NRRD0005\ntype: uint8\ndimension: 4\nsizes: 2 2 2 3\nencoding: raw\n\n";
    let silent = folder.read("b.nrrd", [header.as_bytes(), &[7; 24]].concat());
    assert_eq!((silent.grid.dims(), silent.notes.len()), ([2, 2, 2], 1));
    let times = read("kinds: domain domain time domain");
    assert_values(&times, &of_channel(0));
    assert_eq!(times.notes, ["the file holds 2 volumes; the first is used (another, 0 to 1, can be chosen)"]);
    let second = read_volume(&folder.path("a.nrrd"), &options(None, Some(1))).unwrap();
    assert_values(&second, &of_channel(1));
}

#[test]
fn nrrd_spacings_that_are_not_known_become_1_and_are_said() {
    let folder = Folder::new();
    let header =
        "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 3 2 2\nencoding: raw\nspacings: 1 nan 0.625\n\n";
    let volume = folder.read("a.nrrd", [header.as_bytes(), &[7; 12]].concat());
    assert_eq!(volume.grid.spacing().to_array(), [1.0, 1.0, 0.625]);
    assert_eq!(volume.notes, ["spacings of axis 1 is NaN, not known; 1 is used"]);
}

#[test]
fn nrrd_and_metaimage_data_in_several_files() {
    let folder = Folder::new();
    for (number, slice) in [[1_u8, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12]].into_iter().enumerate() {
        folder.put(&format!("plain{number}.raw"), slice);
        folder.put(&format!("skip{:03}.raw", 5 + 2 * number), [b"a\nb\nxx", &slice[..]].concat());
        folder.put(&format!("packed{number}.gz"), gzip(&[&[99, 99], &slice[..]].concat()));
        folder.put(&format!("packed{number}.z"), zlib(&slice));
    }
    let expected: Vec<f64> = (1..13).map(f64::from).collect();
    let nrrd = |fields: &str| format!("NRRD0005\ntype: uint8\ndimension: 3\nsizes: 3 2 2\n{fields}\n");
    for fields in [
        "encoding: raw\ndata file: LIST\nplain0.raw\nplain1.raw",
        "encoding: raw\ndata file: LIST 2\r\nplain0.raw\r\nplain1.raw\r\n",
        "encoding: raw\ndata file: plain%d.raw 0 1 1",
        "encoding: raw\nline skip: 2\nbyte skip: 2\ndata file: skip%03d.raw 5 7 2",
        "encoding: raw\nbyte skip: -1\ndata file: skip%03d.raw 5 7 2 2",
        "encoding: gzip\nbyte skip: 2\ndata file: LIST\npacked0.gz\npacked1.gz",
    ] {
        assert_values(&folder.read("a.nhdr", nrrd(fields)), &expected);
    }
    let meta = |packed: bool, file: &str| mha_header(SampleType::U8, ByteOrder::Little, packed, file);
    for header in [
        meta(false, "LIST\nplain0.raw\nplain1.raw"),
        meta(false, "plain%d.raw 0 1 1"),
        meta(true, "LIST 2\npacked0.z\npacked1.z"),
    ] {
        assert_values(&folder.read("a.mhd", header), &expected);
    }
    let line = folder.refuse("a.nhdr", nrrd("encoding: raw\ndata file: LIST\nplain0.raw\nmissing.raw"));
    assert!(line.contains("missing.raw: cannot be read"), "{line}");
    folder.put("short.raw", [1]);
    let line = folder.refuse("a.nhdr", nrrd("encoding: raw\ndata file: LIST\nplain0.raw\nshort.raw"));
    assert!(line.contains("a file is 5 bytes short"), "{line}");
}

#[test]
fn nrrd_skips_lines_before_and_bytes_after_unpacking() {
    let folder = Folder::new();
    let expected: Vec<f64> = (1..13).map(f64::from).collect();
    let data: Vec<u8> = (1..13).collect();
    folder.put("lines.raw", [b"one\ntwo\n", &data[..]].concat());
    folder.put("both.gz", [b"one\n".to_vec(), gzip(&[&[99; 3], &data[..]].concat())].concat());
    for fields in [
        "encoding: raw\nline skip: 2\ndata file: lines.raw",
        "encoding: gzip\nline skip: 1\nbyte skip: 3\ndata file: both.gz",
    ] {
        let header = format!("NRRD0005\ntype: uint8\ndimension: 3\nsizes: 3 2 2\n{fields}\n");
        assert_values(&folder.read("a.nhdr", header), &expected);
    }
}

/// A NIfTI-2 header over the samples of a file of the first version.
fn second_version(first: &Nifti, order: ByteOrder, payload: &[u8]) -> Vec<u8> {
    let mut file = vec![0; 544];
    let mut put = |at: usize, bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if order == Big {
            bytes.reverse();
        }
        file[at..at + bytes.len()].copy_from_slice(&bytes);
    };
    put(0, &540_i32.to_le_bytes());
    put(12, &first.datatype.to_le_bytes());
    for (axis, &size) in first.dim.iter().enumerate() {
        put(16 + 8 * axis, &i64::from(size).to_le_bytes());
    }
    for (axis, &distance) in first.pixdim.iter().enumerate() {
        put(112 + 8 * axis, &f64::from(distance).to_le_bytes());
    }
    put(168, &544_i64.to_le_bytes());
    put(176, &f64::from(first.scaling[0]).to_le_bytes());
    put(184, &f64::from(first.scaling[1]).to_le_bytes());
    // sform: x to the left, from 5.
    put(348, &1_i32.to_le_bytes());
    for (at, value) in [(400, -1.0_f64), (424, 5.0), (440, 2.0), (480, 0.5)] {
        put(at, &value.to_le_bytes());
    }
    put(192, &9.0_f64.to_le_bytes());
    put(200, &2.0_f64.to_le_bytes());
    file[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    file.extend(payload);
    file
}

#[test]
fn nifti_of_the_second_version_and_under_other_names() {
    let folder = Folder::new();
    for order in [Little, Big] {
        let header = Nifti { scaling: [2.0, 1.0], ..Nifti::new(SampleType::I16, order) };
        let values: Vec<f64> = (0..12).map(f64::from).collect();
        let file = second_version(&header, order, &encode(SampleType::I16, order, &values));
        let expected: Vec<f64> = values.iter().map(|value| 2.0 * value + 1.0).collect();
        for (name, bytes) in
            [("a.nii", file.clone()), ("a.nii.gz", gzip(&file)), ("a", file.clone()), ("b", gzip(&file))]
        {
            let volume = folder.read(name, bytes);
            assert_values(&volume, &expected);
            assert_eq!(volume.grid.spacing().to_array(), [1.0, 2.0, 0.5]);
            assert_eq!(volume.orientation().to_string(), "LAS");
            assert_eq!(volume.display_range, Some([2.0, 9.0]));
        }
        // Names that say the contrary of what is there.
        assert_values(&folder.read("packed.nii", gzip(&file)), &expected);
        assert_values(&folder.read("plain.nii.gz", &file), &expected);
        for cut in [3, 100, 347, 348, 500, 543, file.len() - 1] {
            folder.refuse("a.nii", &file[..cut]);
            folder.refuse("a.nii.gz", gzip(&file[..cut]));
        }
    }
}

#[test]
fn nifti_vectors_times_and_sizes_of_0() {
    let folder = Folder::new();
    let (values, _) = array(3, 3);
    let vector = Nifti { dim: vec![5, 3, 2, 2, 1, 3], ..Nifti::new(SampleType::I16, Little) };
    let file = vector.file(&encode(SampleType::I16, Little, &values));
    let path = folder.put("a.nii", &file);
    assert_values(&read_volume(&path, &options(Some(2), None)).unwrap(), &of_channel(2));
    let volume = folder.read("a.nii", &file);
    let length = |i: usize| (0..3).map(|channel| of_channel(channel)[i].powi(2)).sum::<f64>().sqrt();
    assert!((0..12).all(|i| (volume.grid.samples().value(i, 0) / length(i) - 1.0).abs() < 1e-6));
    assert!(volume.notes[0].contains("3 components; their magnitude is used"), "{:?}", volume.notes);

    let times = Nifti { dim: vec![4, 3, 2, 2, 3], ..vector };
    let path = folder.put("a.nii.gz", gzip(&times.file(&encode(SampleType::I16, Little, &values))));
    assert_values(&read_volume(&path, &options(None, Some(2))).unwrap(), &of_channel(2));
    assert_eq!(refuse(&path, &options(None, Some(3))), "time step asked for is 3, expected 0 to 2");
    for dim in [vec![4, 3, 2, 2, 0], vec![7, 3, 2, 2, 0, 0, 0, 0]] {
        let file = Nifti { dim, ..Nifti::new(SampleType::I16, Little) }.file(&encode(
            SampleType::I16,
            Little,
            &of_channel(0),
        ));
        assert_values(&folder.read("a.nii", file), &of_channel(0));
    }
}

#[test]
fn numbers_of_64_bits_are_exact_to_2_to_the_53rd() {
    let folder = Folder::new();
    let big = 1_i64 << 53;
    for order in [Little, Big] {
        let bytes = |numbers: [i64; 12]| -> Vec<u8> {
            numbers
                .iter()
                .flat_map(|n| if order == Big { n.to_be_bytes() } else { n.to_le_bytes() })
                .collect()
        };
        let exact = [0, -1, 2, big - 1, 4, 5, 6, 7, 8, 9, 10, -11];
        let expected: Vec<f64> = exact.iter().map(|&n| n as f64).collect();
        let nifti = Nifti { datatype: 1024, ..Nifti::new(SampleType::U8, order) };
        let nrrd = format!(
            "NRRD0004\ntype: long long\ndimension: 3\nsizes: 3 2 2\nendian: {}\nencoding: raw\n\n",
            if order == Big { "big" } else { "little" }
        );
        let mha = mha_header(SampleType::U8, order, false, "LOCAL").replace("MET_UCHAR", "MET_LONG_LONG");
        let mha = mha.replace("TransformMatrix = 1 0 0 0 1 0 0 0 1\n", "");
        let files = |data: &[u8]| {
            [
                ("a.nii", nifti.file(data)),
                ("a.nii.gz", gzip(&nifti.file(data))),
                ("a.nrrd", [nrrd.as_bytes(), data].concat()),
                ("a.mha", [mha.as_bytes(), data].concat()),
            ]
        };
        for (name, file) in files(&bytes(exact)) {
            let volume = folder.read(name, file);
            assert_eq!(volume.grid.sample_type(), SampleType::F64);
            assert_values(&volume, &expected);
            assert!(volume.notes.is_empty(), "{:?}", volume.notes);
        }
        let mut rounded = exact;
        rounded[5] = big + 1;
        for (name, file) in files(&bytes(rounded)) {
            assert!(folder.read(name, file).notes[0].starts_with("whole numbers of 64 bits from 2^53 on"));
        }
    }
}

#[test]
fn metaimage_byte_order_as_metaio_has_it() {
    let folder = Folder::new();
    let values: Vec<f64> = (0..12).map(f64::from).collect();
    let swapped: Vec<f64> = values.iter().map(|value| 256.0 * value).collect();
    let native = if ByteOrder::NATIVE == Little { &values } else { &swapped };
    let data = encode(SampleType::I16, Little, &values);
    let cases = [
        ("", native),
        ("BinaryDataByteOrderMSB = False\n", &values),
        ("ElementByteOrderMSB = False\n", &values),
        ("ElementByteOrderMSB = T\n", &swapped),
        // Of both, the first of these names wins, wherever it stands.
        ("BinaryDataByteOrderMSB = False\nElementByteOrderMSB = True\n", &values),
        ("ElementByteOrderMSB = True\nBinaryDataByteOrderMSB = False\n", &values),
        ("BinaryDataByteOrderMSB = True\nElementByteOrderMSB = False\n", &swapped),
        ("ElementByteOrderMSB = False\nBinaryDataByteOrderMSB = 1\n", &swapped),
    ];
    for (fields, expected) in cases {
        let header = format!(
            "ObjectType = Image\n\n# by hand\nNDims = 3\nBinaryData = T\n{fields}DimSize: 3 2 2\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        );
        assert_values(&folder.read("a.mha", [header.as_bytes(), &data].concat()), expected);
    }
}

#[test]
fn metaimage_channels_by_magnitude_or_one_of_them() {
    let folder = Folder::new();
    let (values, _) = array(2, 0);
    let header = mha_header(SampleType::F32, Little, false, "LOCAL")
        .replace("MET_FLOAT", "MET_FLOAT_ARRAY\nElementNumberOfChannels = 2");
    let path = folder.put("a.mha", [header.as_bytes(), &encode(SampleType::F32, Little, &values)].concat());
    for channel in 0..2 {
        assert_values(&read_volume(&path, &options(Some(channel), None)).unwrap(), &of_channel(channel));
    }
    let volume = read_volume(&path, &ReadOptions::default()).unwrap();
    assert!(volume.notes[0].contains("2 components; their magnitude is used"), "{:?}", volume.notes);
    let text = header.replace("BinaryData = True", "BinaryData = False");
    let numbers = values.iter().map(|value| format!("{value} ")).collect::<String>();
    let path = folder.put("b.mha", text + &numbers);
    assert_values(&read_volume(&path, &options(Some(1), None)).unwrap(), &of_channel(1));
}
