use volery_io::{ByteOrder, Format, ReadOptions, read_volume};
use volery_scene::SampleType;

use crate::make::{Nifti, ORDERS, SCALARS, encode, gzip, payload, values};
use crate::{Folder, assert_values, assert_volume, refuse};

#[test]
fn every_type_order_and_compression() {
    let folder = Folder::new();
    for sample in SCALARS {
        for order in ORDERS {
            let file = Nifti::new(sample, order).file(&payload(sample, order));
            let volume = folder.read("a.nii", &file);
            assert_eq!(volume.format, Format::Nifti);
            assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
            let volume = folder.read("a.nii.gz", gzip(&file));
            assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
            assert!(volume.notes.is_empty(), "{:?}", volume.notes);
        }
    }
}

#[test]
fn slope_and_intercept_are_applied() {
    let folder = Folder::new();
    for (stored, scaled) in [
        (SampleType::U8, SampleType::F32),
        (SampleType::I16, SampleType::F32),
        (SampleType::F32, SampleType::F32),
        (SampleType::I32, SampleType::F64),
        (SampleType::U32, SampleType::F64),
        (SampleType::F64, SampleType::F64),
    ] {
        for order in ORDERS {
            let small = [0.0, 100.0, 1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 34.0, 55.0, 89.0];
            let header = Nifti { scaling: [0.5, -3.0], ..Nifti::new(stored, order) };
            let file = header.file(&encode(stored, order, &small));
            let expected = small.map(|value| 0.5 * value - 3.0);
            assert_volume(&folder.read("a.nii", &file), scaled, [1.0, 2.0, 0.5], &expected);
            assert_volume(&folder.read("a.nii.gz", gzip(&file)), scaled, [1.0, 2.0, 0.5], &expected);
        }
    }
    // A large integer that f32 cannot hold.
    let header = Nifti { scaling: [1.0, 1.0], ..Nifti::new(SampleType::U32, ByteOrder::Little) };
    let volume = folder.read("a.nii", header.file(&payload(SampleType::U32, ByteOrder::Little)));
    assert_eq!(volume.grid.samples().value(1, 0), 4_294_967_296.0);
}

#[test]
fn scaling_that_says_nothing_is_left_alone() {
    let folder = Folder::new();
    let bytes = payload(SampleType::U8, ByteOrder::Little);
    for (scaling, notes) in
        [([0.0, 7.0], 0), ([1.0, 0.0], 0), ([f32::NAN, 0.0], 1), ([1.0, f32::INFINITY], 1)]
    {
        let volume = folder
            .read("a.nii", Nifti { scaling, ..Nifti::new(SampleType::U8, ByteOrder::Little) }.file(&bytes));
        assert_volume(&volume, SampleType::U8, [1.0, 2.0, 0.5], &values(SampleType::U8));
        assert_eq!(volume.notes.len(), notes, "{:?}", volume.notes);
    }
}

#[test]
fn of_a_time_series_the_first_volume_is_read_and_said_so() {
    let folder = Folder::new();
    let header = Nifti { dim: vec![5, 3, 2, 2, 4, 2], ..Nifti::new(SampleType::I16, ByteOrder::Big) };
    let mut bytes = payload(SampleType::I16, ByteOrder::Big);
    bytes.extend([0xab; 24 * 7]);
    for (name, file) in [("a.nii", header.file(&bytes)), ("a.nii.gz", gzip(&header.file(&bytes)))] {
        let volume = folder.read(name, file);
        assert_volume(&volume, SampleType::I16, [1.0, 2.0, 0.5], &values(SampleType::I16));
        assert_eq!(
            volume.notes,
            ["the file holds 8 volumes; the first is used (another, 0 to 7, can be chosen)"]
        );
    }
}

#[test]
fn colours_and_fewer_axes() {
    let folder = Folder::new();
    let bytes: Vec<u8> = (0..24).collect();
    let expected: Vec<f64> = (0..24).map(f64::from).collect();
    for (sample, width) in [(SampleType::Rgb8, 4), (SampleType::Rgba8, 3)] {
        let header = Nifti { dim: vec![2, width, 2], ..Nifti::new(sample, ByteOrder::Little) };
        let volume = folder.read("a.nii", header.file(&bytes));
        assert_eq!(volume.grid.dims(), [width as usize, 2, 1]);
        assert_values(&volume, &expected);
    }
}

#[test]
fn large_files_are_mapped() {
    let folder = Folder::new();
    let header = Nifti { dim: vec![3, 256, 128, 100], ..Nifti::new(SampleType::F32, ByteOrder::NATIVE) };
    let bytes: Vec<u8> = (0..256 * 128 * 100).flat_map(|i| (i as f32).to_ne_bytes()).collect();
    let volume = folder.read("a.nii", header.file(&bytes));
    assert_eq!(volume.grid.value_range(0), Some([0.0, 3_276_799.0]));
    assert_eq!(volume.grid.samples().value(1_000_003, 0), 1_000_003.0);
}

#[test]
fn truncated_at_every_byte() {
    let folder = Folder::new();
    let file = Nifti::new(SampleType::U16, ByteOrder::Big).file(&payload(SampleType::U16, ByteOrder::Big));
    for cut in 0..file.len() {
        let line = folder.refuse("a.nii", &file[..cut]);
        assert!(line.contains("holds") || line.contains("empty"), "{line}");
    }
    let packed = gzip(&file);
    for cut in 0..packed.len() {
        folder.refuse("a.nii.gz", &packed[..cut]);
    }
}

#[test]
fn lying_headers() {
    let folder = Folder::new();
    let bytes = [0; 12];
    let new = || Nifti::new(SampleType::U8, ByteOrder::Little);
    let cases = [
        (Nifti { dim: vec![0, 3, 2, 2], ..new() }, "dim[0] is 0, expected 1 to 7"),
        (Nifti { dim: vec![8, 3, 2, 2], ..new() }, "dim[0] is 8, expected 1 to 7"),
        (Nifti { dim: vec![3, 3, -2, 2], ..new() }, "dim[2] is -2, expected at least 1"),
        (Nifti { dim: vec![3, 3, 0, 2], ..new() }, "dim[2] is 0, expected at least 1"),
        (
            Nifti { dim: vec![3, 32767, 32767, 32767], ..new() },
            "the data part holds 12 bytes, expected 35181150961663",
        ),
        (Nifti { datatype: 32, ..new() }, "datatype is 32, expected 2, 4, 8"),
        (Nifti { datatype: 0, ..new() }, "datatype is 0, expected 2, 4, 8"),
        (Nifti { vox_offset: f32::NAN, ..new() }, "vox_offset is NaN, expected a whole number"),
        (Nifti { vox_offset: 0.0, ..new() }, "vox_offset is 0, expected a whole number"),
        (Nifti { vox_offset: 352.5, ..new() }, "vox_offset is 352.5, expected a whole number"),
        (Nifti { vox_offset: 1e14, ..new() }, "the data part holds 0 bytes, expected 12"),
        (Nifti { vox_offset: f32::INFINITY, ..new() }, "vox_offset is inf"),
        (
            Nifti { pixdim: [1.0, f32::NAN, 1.0], ..new() },
            "pixdim of axis 1 is NaN, expected a finite number",
        ),
        (Nifti { pixdim: [0.0, 1.0, 1.0], ..new() }, "pixdim of axis 0 is 0, expected a finite number"),
        (Nifti { pixdim: [1.0, 1.0, f32::INFINITY], ..new() }, "pixdim of axis 2 is inf"),
        (Nifti { magic: *b"ni1\0", ..new() }, "magic is 'ni1\\u{0}', expected 'n+1'"),
        (Nifti { magic: *b"\n\n\n\n", ..new() }, "magic is '\\n\\n\\n\\n', expected 'n+1'"),
    ];
    for (header, expected) in cases {
        let file = header.file(&bytes);
        let line = folder.refuse("a.nii", &file);
        let large = "the volume needs 35181150961663 bytes, expected at most 68719476736";
        assert!(line.starts_with(expected) || line == large, "{line}, expected {expected}");
        folder.refuse("a.nii.gz", gzip(&file));
    }
    let negative = Nifti { pixdim: [-1.0, 1.0, 1.0], ..new() };
    let volume = folder.read("a.nii", negative.file(&bytes));
    assert_eq!(volume.grid.spacing().x, 1.0);
    assert_eq!(volume.notes.len(), 1);
    assert!(
        folder.refuse("a.nii", [b'x'; 400]).starts_with("sizeof_hdr is [120, 120, 120, 120], expected 348")
    );
}

#[test]
fn a_file_that_is_not_what_was_asked_for() {
    let folder = Folder::new();
    let path = folder.put("a.nii", Nifti::new(SampleType::U8, ByteOrder::Little).file(&[0; 12]));
    let options = ReadOptions { dims: Some([2, 3, 2]), ..ReadOptions::default() };
    assert_eq!(refuse(&path, &options), "dim is 3 x 2 x 2, expected 2 x 3 x 2 as asked for");
    let options = ReadOptions { element: "int16".parse().ok(), ..ReadOptions::default() };
    assert_eq!(refuse(&path, &options), "sample type is u8, expected i16 as asked for");
    let options = ReadOptions { spacing: Some([4.0; 3].into()), ..ReadOptions::default() };
    assert_eq!(read_volume(&path, &options).unwrap().grid.spacing().to_array(), [4.0; 3]);
}
