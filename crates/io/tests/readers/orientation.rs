//! Where files of every format say that their samples lie: in RAS for anatomical ones, and what is said of it.

use glam::DVec3;
use volery_io::{ByteOrder, ReadOptions, Volume, World, read_volume};
use volery_scene::SampleType;

use crate::Folder;
use crate::make::{Nifti, gzip, mha_header};

/// Checks where the first sample and its neighbours along x, y, z lie, relative to the first.
#[track_caller]
fn assert_places(volume: &Volume, first: [f64; 3], steps: [[f64; 3]; 3]) {
    let map = volume.grid.world_from_index();
    let close = |found: DVec3, expected: [f64; 3]| found.distance(DVec3::from_array(expected)) < 1e-6;
    assert!(close(map.translation, first), "{:?}, expected {first:?}", map.translation);
    for (axis, step) in steps.into_iter().enumerate() {
        let found = map.transform_vector3(DVec3::AXES[axis]);
        assert!(close(found, step), "axis {axis}: {found:?}, expected {step:?}");
    }
}

#[track_caller]
fn assert_note(volume: &Volume, expected: Option<&str>) {
    let found = volume.orientation().note();
    match expected {
        None => assert_eq!(found, None),
        Some(expected) => {
            let found = found.unwrap_or_default();
            assert!(found.contains(expected), "{found:?}, expected {expected}");
        }
    }
}

const MIRRORED: &str = "so mirrored: left and right change sides";

/// The same file with numbers at these places of its header, for both versions of NIfTI.
fn nifti(codes: [(usize, i16); 2], numbers: &[(usize, f32)]) -> Vec<u8> {
    let mut file = Nifti::new(SampleType::U8, ByteOrder::Little).file(&[7; 12]);
    for (at, code) in codes {
        file[at..at + 2].copy_from_slice(&code.to_le_bytes());
    }
    for &(at, number) in numbers {
        file[at..at + 4].copy_from_slice(&number.to_le_bytes());
    }
    file
}

#[test]
fn nifti_by_sform_then_qform_then_nothing() {
    let folder = Folder::new();
    let rows = |values: [f32; 12]| (0..12).map(|i| (280 + 4 * i, values[i])).collect::<Vec<_>>();
    let (none, sform, qform) = ([(254, 0), (252, 0)], [(254, 1), (252, 0)], [(254, 0), (252, 1)]);
    let las = rows([-1.0, 0.0, 0.0, 8.0, 0.0, 2.0, 0.0, -3.0, 0.0, 0.0, 0.5, 4.0]);
    for file in [nifti(sform, &las), gzip(&nifti(sform, &las))] {
        let volume = folder.read("a.nii", file);
        assert_places(&volume, [8.0, -3.0, 4.0], [[-1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.5]]);
        assert_eq!((volume.world, volume.orientation().to_string().as_str()), (World::Anatomical, "LAS"));
        assert_note(&volume, Some(MIRRORED));
    }
    let ras = rows([1.0, 0.0, 0.0, 8.0, 0.0, 2.0, 0.0, -3.0, 0.0, 0.0, 0.5, 4.0]);
    assert_note(&folder.read("a.nii", nifti(sform, &ras)), None);
    // The same numbers where no code says that they hold.
    let volume = folder.read("a.nii", nifti(none, &las));
    assert_places(&volume, [0.0; 3], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.5]]);
    assert_eq!(volume.world, World::Plain);
    assert_note(&volume, None);
    // A quarter turn about z: b = c = 0, d = sin 45 degrees; x runs to the front, y to the left.
    let turned = [(264, 0.5_f32.sqrt()), (268, 1.0), (272, 2.0), (276, 3.0)];
    let volume = folder.read("a.nii", nifti(qform, &turned));
    assert_places(&volume, [1.0, 2.0, 3.0], [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.5]]);
    assert_note(&volume, Some("run to ALS; the picture is drawn along them, and so turned against"));
    // A negative factor turns the third axis back.
    let mirrored = [&turned[..], &[(76, -1.0)]].concat();
    let volume = folder.read("a.nii", nifti(qform, &mirrored));
    assert_places(&volume, [1.0, 2.0, 3.0], [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, -0.5]]);
    assert_note(&volume, Some(MIRRORED));
    // Half a turn about x: a = 0, b = 1.
    let volume = folder.read("a.nii", nifti(qform, &[(256, 1.0)]));
    assert_places(&volume, [0.0; 3], [[1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, -0.5]]);
    // Where both hold, sform counts; where it spans no space, that is said.
    let both = [&turned[..], &ras].concat();
    assert_eq!(folder.read("a.nii", nifti([(254, 2), (252, 1)], &both)).orientation().to_string(), "RAS");
    let flat = folder.read("a.nii", nifti(sform, &[]));
    assert!(
        flat.notes.contains(&"the axes of the file span no space; its orientation is not used".to_owned())
    );
    let longer = rows([3.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    let volume = folder.read("a.nii", nifti(sform, &longer));
    assert_eq!(
        volume.notes,
        ["voxels are 3 x 2 x 0.5 by sform, as the world has them, and 1 x 2 x 0.5 by pixdim"]
    );
}

#[test]
fn nrrd_of_every_space() {
    let folder = Folder::new();
    let read = |fields: &str| {
        let header =
            format!("NRRD0005\ntype: uint8\ndimension: 3\nsizes: 3 2 2\nencoding: raw\n{fields}\n\n");
        folder.read("a.nrrd", [header.as_bytes(), &[7; 12]].concat())
    };
    let axes = "space directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)";
    for (space, signs, name, note) in [
        ("left-posterior-superior", [-1.0, -1.0, 1.0], "LPS", Some("turned against the world")),
        ("LPS", [-1.0, -1.0, 1.0], "LPS", Some("turned against the world")),
        ("left-anterior-superior", [-1.0, 1.0, 1.0], "LAS", Some(MIRRORED)),
        ("RAS", [1.0, 1.0, 1.0], "RAS", None),
        ("right-anterior-superior-time", [1.0, 1.0, 1.0], "RAS", None),
        ("scanner-xyz", [1.0, 1.0, 1.0], "+x +y +z", None),
    ] {
        let volume = read(&format!("space: {space}\n{axes}"));
        let [x, y, z] = signs;
        assert_places(
            &volume,
            [10.0 * x, 20.0 * y, 30.0 * z],
            [[x, 0.0, 0.0], [0.0, 2.0 * y, 0.0], [0.0, 0.0, 3.0 * z]],
        );
        assert_eq!(volume.orientation().to_string(), name);
        assert_note(&volume, note);
        assert_eq!(volume.grid.spacing().to_array(), [1.0, 2.0, 3.0]);
    }
    // What two signs turned back is right as it is drawn.
    assert_note(&read("space: LPS\nspace directions: (-1,0,0) (0,-1,0) (0,0,2.5)"), None);
    let permuted = read("space: LPS\nspace directions: (0,0,3) (1,0,0) (0,2,0)");
    assert_eq!(permuted.grid.spacing().to_array(), [3.0, 1.0, 2.0]);
    assert_note(&permuted, Some("run to SLP"));
    assert_note(&read("space: LPS\nspace directions: (1,0,0) (0.5,1,0) (0,0,2)"), Some("sheared"));
    let negative = read("spacings: -1 2 3");
    assert_eq!((negative.grid.spacing().x, negative.orientation().to_string().as_str()), (1.0, "-x +y +z"));
    assert_note(&negative, Some("so mirrored"));
}

#[test]
fn metaimage_in_lps_by_the_names_that_win() {
    let folder = Folder::new();
    let header = mha_header(SampleType::U8, ByteOrder::Little, false, "LOCAL");
    let matrix = "TransformMatrix = 1 0 0 0 1 0 0 0 1";
    let read =
        |fields: &str| folder.read("a.mha", [header.replace(matrix, fields).as_bytes(), &[7; 12]].concat());
    let volume = read("TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 10 20 30");
    // In LPS x runs to the back and y to the right.
    assert_places(&volume, [-10.0, -20.0, 30.0], [[0.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.5]]);
    assert_eq!(volume.orientation().to_string(), "PRS");
    let names = ["Orientation = 1 0 0 0 -1 0 0 0 1", "Rotation = -1 0 0 0 -1 0 0 0 1", matrix];
    for (count, name) in [(1, "LAS"), (2, "RAS"), (3, "LPS")] {
        // Whatever stands last.
        for reversed in [false, true] {
            let mut fields = names[..count].to_vec();
            if reversed {
                fields.reverse();
            }
            assert_eq!(read(&fields.join("\n")).orientation().to_string(), name);
        }
    }
    for fields in ["Position = 1 1 1\nOffset = 2 2 2\nOrigin = 3 3 3", "Origin = 3 3 3\nOffset = 2 2 2"] {
        assert_eq!(read(fields).grid.world_from_index().translation.to_array(), [-3.0, -3.0, 3.0]);
    }
    assert_eq!(read("Position = 1 1 1\nOffset = 2 2 2").grid.world_from_index().translation.z, 2.0);
    let center = "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nCenterOfRotation = 5 5 5";
    assert!(read(center).notes[0].starts_with("CenterOfRotation is not used, as in ITK"));
    // A file that says nothing is not anatomical.
    let silent = read("Comment = x");
    assert_eq!((silent.world, silent.notes.len()), (World::Plain, 0));
    let line = folder.refuse("a.mha", header.replace(matrix, "TransformMatrix = 1 0 0"));
    assert_eq!(line, "TransformMatrix is '1 0 0', expected 9 numbers");
}

#[test]
fn vti_by_direction_origin_and_extent() {
    let folder = Folder::new();
    let read = |attributes: &str, section: &str| {
        let text = format!(
            "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"5 7 0 2 1 3\" {attributes}>\
             <Piece Extent=\"5 7 0 2 1 3\"><{section}><DataArray type=\"UInt8\" Name=\"a\" format=\"ascii\">{}</DataArray>\
             </{section}></Piece></ImageData></VTKFile>",
            "3 ".repeat(if section == "PointData" { 27 } else { 8 })
        );
        folder.read("a.vti", text)
    };
    let attributes = "Origin=\"1 2 3\" Spacing=\"1 2 4\" Direction=\"0 1 0 1 0 0 0 0 1\"";
    let volume = read(attributes, "PointData");
    assert_places(&volume, [1.0, 7.0, 7.0], [[0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 4.0]]);
    assert_note(&volume, Some("run to +y +x +z; the picture is drawn along them, and so mirrored"));
    // The centre of the first cell.
    let cells = read(attributes, "CellData");
    assert_places(&cells, [2.0, 7.5, 9.0], [[0.0, 1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 4.0]]);
    let plain = read("Origin=\"1 2 3\" Spacing=\"1 2 4\"", "PointData");
    assert_places(&plain, [6.0, 2.0, 7.0], [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 4.0]]);
    assert_note(&plain, None);
}

#[test]
fn legacy_structured_points_start_at_their_origin() {
    let folder = Folder::new();
    let header = "# vtk DataFile Version 3.0\nby ITK\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 1 1\n\
                  ORIGIN -1 2 3e1\nSPACING 0.5 1 1\nPOINT_DATA 2\nSCALARS s short 1\nLOOKUP_TABLE default\n7 -9\n";
    let volume = folder.read("a.vtk", header);
    assert_places(&volume, [-1.0, 2.0, 30.0], [[0.5, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    crate::assert_values(&volume, &[7.0, -9.0]);
    assert!(!volery_io::is_grid(&folder.path("a.vtk")));
}

#[test]
fn a_spacing_that_is_asked_for_keeps_directions() {
    let folder = Folder::new();
    let header = "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 3 2 2\nencoding: raw\nspace: RAS\n\
                  space directions: (0,3,0) (-4,0,0) (0,0,5)\n\n";
    let path = folder.put("a.nrrd", [header.as_bytes(), &[7; 12]].concat());
    let options = ReadOptions { spacing: Some(DVec3::new(1.0, 2.0, 0.5)), ..ReadOptions::default() };
    let volume = read_volume(&path, &options).unwrap();
    assert_places(&volume, [0.0; 3], [[0.0, 1.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.5]]);
}
