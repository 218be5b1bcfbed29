use std::io::{self, Write};

use glam::{DAffine3, DMat3, DVec3};
use volery_io::{
    Orientation, ReadOptions, World, read_png_rgb, read_volume, write_atomically, write_exr, write_nrrd,
    write_png,
};
use volery_scene::{SampleType, Samples, VoxelGrid};

use crate::Folder;
use crate::make::values;

fn names(folder: &Folder) -> Vec<String> {
    let entries = std::fs::read_dir(folder.0.path()).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn png_rounds_linear_values_without_gamma() {
    let folder = Folder::new();
    let path = folder.path("a.png");
    let pixels =
        [[0.0, 0.5, 1.0], [-1.0, 2.0, f32::NAN], [0.0019, 0.002, 0.25], [f32::INFINITY, -0.0, 0.999]];
    write_png(&path, 2, 2, &pixels).unwrap();
    let picture = read_png_rgb(&path).unwrap();
    assert_eq!((picture.width, picture.height), (2, 2));
    let bytes: Vec<u8> = picture.pixels.as_flattened().iter().map(|v| (v * 255.0).round() as u8).collect();
    assert_eq!(bytes, [0, 128, 255, 0, 255, 0, 0, 1, 64, 255, 0, 255]);
    for byte in 0..=255u8 {
        let value = f32::from(byte) / 255.0;
        write_png(&path, 1, 1, &[[value; 3]]).unwrap();
        assert_eq!(read_png_rgb(&path).unwrap().pixels, [[value; 3]], "eight bits come back exactly");
    }
}

#[test]
fn exr_keeps_every_bit() {
    let folder = Folder::new();
    let path = folder.path("a.exr");
    let pixels: Vec<[f32; 3]> =
        (0..35).map(|i| [i as f32 / 7.0, -1e-30 * i as f32, 1e30 + i as f32 * 1e25]).collect();
    write_exr(&path, 7, 5, &pixels).unwrap();
    let image = exr::prelude::read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![[f32::NAN; 3]; size.width() * size.height()],
        |pixels: &mut Vec<[f32; 3]>, at, (r, g, b, _): (f32, f32, f32, f32)| {
            pixels[at.y() * 7 + at.x()] = [r, g, b]
        },
    );
    assert_eq!(image.unwrap().layer_data.channel_data.pixels, pixels);
    let first = std::fs::read(&path).unwrap();
    write_exr(&path, 7, 5, &pixels).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), first, "the same bytes each time");
}

#[test]
fn nrrd_of_every_type_comes_back() {
    let folder = Folder::new();
    let path = folder.path("a.nrrd");
    let numbers = |sample| values(sample).into_iter();
    let all: [Samples; 10] = [
        numbers(SampleType::U8).map(|v| v as u8).collect::<Vec<_>>().into(),
        numbers(SampleType::I8).map(|v| v as i8).collect::<Vec<_>>().into(),
        numbers(SampleType::U16).map(|v| v as u16).collect::<Vec<_>>().into(),
        numbers(SampleType::I16).map(|v| v as i16).collect::<Vec<_>>().into(),
        numbers(SampleType::U32).map(|v| v as u32).collect::<Vec<_>>().into(),
        numbers(SampleType::I32).map(|v| v as i32).collect::<Vec<_>>().into(),
        numbers(SampleType::F32).map(|v| v as f32).collect::<Vec<_>>().into(),
        numbers(SampleType::F64).collect::<Vec<_>>().into(),
        (0..12).map(|i| [i, i + 1, 255 - i]).collect::<Vec<[u8; 3]>>().into(),
        (0..12).map(|i| [i, i + 1, 255 - i, 9]).collect::<Vec<[u8; 4]>>().into(),
    ];
    for samples in all {
        let grid = VoxelGrid::new([3, 2, 2], DVec3::new(0.1, 1e-9, 3e7), samples).unwrap();
        write_nrrd(&path, &grid, World::Plain).unwrap();
        let volume = read_volume(&path, &ReadOptions::default()).unwrap();
        assert_eq!(volume.grid.sample_type(), grid.sample_type());
        assert_eq!((volume.grid.dims(), volume.grid.spacing()), (grid.dims(), grid.spacing()));
        for i in 0..12 {
            for channel in 0..grid.sample_type().channels() {
                assert_eq!(volume.grid.samples().value(i, channel), grid.samples().value(i, channel));
            }
        }
        assert!(volume.notes.is_empty());
    }
}

#[test]
fn nrrd_keeps_where_samples_lie() {
    let folder = Folder::new();
    let path = folder.path("a.nrrd");
    let oblique = DMat3::from_rotation_z(0.3) * DMat3::from_diagonal(DVec3::new(-0.7, 1.3, 3.0));
    let sheared = DMat3::from_cols(DVec3::Y * 2.0, DVec3::new(1e-3, 0.5, 0.0), DVec3::NEG_Z);
    let plain = DMat3::from_diagonal(DVec3::new(1.0, 2.0, 0.3));
    let samples: [Samples; 2] = [vec![7_i16; 12].into(), vec![[1_u8, 2, 3]; 12].into()];
    for (axes, origin) in [
        (oblique, DVec3::new(-90.1, 126.0, -1.0 / 3.0)),
        (sheared, DVec3::ZERO),
        (plain, DVec3::ZERO),
        (plain, DVec3::new(1e-300, -4e9, 0.1)),
    ] {
        for (world, samples) in [World::Anatomical, World::Plain].into_iter().zip(&samples) {
            let spacing = DVec3::from_array(axes.to_cols_array_2d().map(|axis| DVec3::from(axis).length()));
            let placed = DAffine3::from_mat3_translation(axes, origin);
            let grid = VoxelGrid::new([3, 2, 2], spacing, samples.clone()).unwrap();
            let grid = grid.with_world_from_index(placed).unwrap();
            write_nrrd(&path, &grid, world).unwrap();
            let volume = read_volume(&path, &ReadOptions::default()).unwrap();
            assert_eq!((volume.grid.world_from_index(), volume.world), (placed, world));
            assert_eq!((volume.grid.spacing(), volume.grid.sample_type()), (spacing, grid.sample_type()));
            assert_eq!(volume.orientation(), Orientation::of(&placed, world));
        }
    }
}

#[test]
fn a_failed_write_leaves_the_old_file_and_nothing_else() {
    let folder = Folder::new();
    let path = folder.put("a.txt", "old");
    let error = write_atomically(&path, |file| {
        file.write_all(b"half")?;
        Err(io::Error::other("no more"))
    });
    assert_eq!(error.unwrap_err().to_string(), format!("{}: cannot be written: no more", path.display()));
    let panicked = std::panic::catch_unwind(|| write_atomically(&path, |_| panic!("in the middle of it")));
    assert!(panicked.is_err());
    assert_eq!(names(&folder), ["a.txt"]);
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    write_atomically(&path, |file| file.write_all(b"new")).unwrap();
    assert_eq!((names(&folder), std::fs::read(&path).unwrap()), (vec!["a.txt".to_owned()], b"new".to_vec()));
}

#[test]
fn where_nothing_can_be_written() {
    let folder = Folder::new();
    let pixels = [[0.0; 3]];
    let line = write_png(folder.0.path(), 1, 1, &pixels).unwrap_err().to_string();
    assert!(line.ends_with("cannot be written: it is a folder, expected a file name"), "{line}");
    let missing = folder.path("no/such/folder.png");
    assert!(write_png(&missing, 1, 1, &pixels).unwrap_err().to_string().contains("cannot be written"));
    let line = write_exr(&folder.path("a.exr"), 2, 2, &pixels).unwrap_err().to_string();
    assert!(line.ends_with("1 pixels, expected 2 x 2, at least 1 x 1"), "{line}");
    write_png(&folder.path("a.png"), 0, 0, &[]).unwrap_err();
    assert!(names(&folder).is_empty());
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_devices_stay_devices() {
    use std::os::unix::fs::FileTypeExt;
    let folder = Folder::new();
    let target = folder.put("target.txt", "old");
    std::os::unix::fs::symlink(&target, folder.path("link")).unwrap();
    write_atomically(&folder.path("link"), |file| file.write_all(b"new")).unwrap();
    assert!(folder.path("link").is_symlink());
    assert_eq!(std::fs::read(&target).unwrap(), b"new");
    write_png("/dev/null".as_ref(), 1, 1, &[[0.0; 3]]).unwrap();
    assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}
