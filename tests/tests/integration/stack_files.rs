//! Stacks of slices in files: how many bytes, how fast, how far the picture changes, what others say of them.

use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use volery::io::{GlbOptions, GridOptions, read_grid, read_stack};
use volery::{BackendChoice, GridSession, Image, Slices, open_backend};
use volery_frame::{Content, Frame, Quantization, Sheet, SheetTransfer, SheetVertices, Sheets};
use volery_io::SceneFile;
use volery_slicing::{MeshSheet, Planes, QuantizedMesh, Rays, SliceMesh, Slicer};
use volery_tests::{at_most, data_folder, distance, exact, scenes_folder};

const NAMES: [&str; 3] = ["bluntfin", "k3d_fem", "post_mixed"];
const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);
const MAX_BYTES: u64 = 1 << 30;

fn slices(data: &Path, name: &str) -> Slices {
    let file = read_grid(&data.join(format!("{name}.vtu")), &GridOptions::default()).unwrap();
    let session = GridSession::open(file.grid, None, open_backend(BackendChoice::Software).unwrap()).unwrap();
    session.slices(NORMAL, 256).unwrap()
}

/// With every triangle from its least corner on.
fn turned(mut mesh: QuantizedMesh) -> QuantizedMesh {
    let turn = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    mesh.triangles.iter_mut().for_each(|triangle| *triangle = turn(*triangle));
    mesh
}

#[test]
fn files_of_real_grids_are_small_and_come_back() {
    let Some(data) = data_folder("stack_files::files_of_real_grids_are_small_and_come_back") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in NAMES {
        let slices = slices(&data, name);
        let vsl = folder.path().join(format!("{name}.vsl"));
        let bytes = slices.write_vsl(&vsl).unwrap();
        let share = bytes as f64 / slices.counts.float_bytes as f64;
        at_most(&format!("{name}: bytes of a file over bytes of floats"), share, 0.045);
        assert_eq!(turned(read_stack(&vsl, MAX_BYTES).unwrap()), turned(slices.mesh()), "{name}");
        for is_coded in [false, true] {
            let glb = folder.path().join(format!("{name}.glb"));
            let bytes = slices.write_glb(&glb, GlbOptions { is_coded }).unwrap();
            let share = bytes as f64 / slices.counts.float_bytes as f64;
            let threshold = if is_coded { 0.14 } else { 0.51 };
            at_most(&format!("{name}: glTF, coded: {is_coded}"), share, threshold);
            assert_eq!(turned(read_stack(&glb, MAX_BYTES).unwrap()), turned(slices.mesh()), "{name}");
        }
    }
}

/// The picture of a scene from sheets in order for its camera.
fn picture(scene: &SceneFile, mesh: &SliceMesh, vertices: SheetVertices<'_>, range: [f64; 2]) -> Image {
    let eye = (scene.camera.eye - mesh.origin).dot(mesh.normal);
    let sheet = |sheet: &MeshSheet| Sheet {
        first: sheet.triangles.start,
        count: sheet.triangles.end - sheet.triangles.start,
        thickness: sheet.thickness.map(|part| part as f32),
    };
    let sheets: Vec<Sheet> = mesh.back_to_front(eye).map(sheet).collect();
    let content = Sheets {
        revision: 0,
        normal: mesh.normal,
        origin: mesh.origin,
        vertices,
        triangles: &mesh.triangles,
        sheets: &sheets,
        transfer: &SheetTransfer::new(&scene.transfer, range),
        light: None,
    };
    let frame = Frame {
        width: scene.size[0],
        height: scene.size[1],
        camera: scene.camera,
        background: scene.background.map(|channel| channel as f32),
        meshes: &[],
        content: Content::Sheets(content),
    };
    open_backend(BackendChoice::Software).unwrap().draw(&frame).unwrap().image
}

#[test]
fn a_file_changes_the_picture_little() {
    let Some(data) = data_folder("stack_files::a_file_changes_the_picture_little") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["bluntfin", "k3d_fem"] {
        let scene = SceneFile::read(&scenes_folder(&data).join(format!("{name}.json"))).unwrap();
        let options = GridOptions { array: scene.input.array.clone(), ..GridOptions::default() };
        let file = read_grid(&data.join(&scene.input.file), &options).unwrap();
        let session =
            GridSession::open(file.grid.clone(), None, open_backend(BackendChoice::Software).unwrap())
                .unwrap();
        let normal = (scene.camera.target - scene.camera.eye).normalize();
        let slicer = Slicer::new(file.grid).unwrap();
        let planes = Planes::over(slicer.grid(), normal, 256).unwrap();
        let mut mesh = slicer.mesh(&planes, &slicer.grid().arrays()[0].values, None).unwrap();
        let rays = Rays::From(scene.camera.eye);
        mesh.orient_strips(rays);
        let range = session.value_range();
        let points = SheetVertices::Exact { points: &mesh.points, gradients: &[] };
        let exact_picture = picture(&scene, &mesh, points, range);

        let path = folder.path().join("a.vsl");
        session.slices(normal, 256).unwrap().write_vsl(&path).unwrap();
        let read = read_stack(&path, MAX_BYTES).unwrap();
        let mut decoded = read.to_mesh();
        decoded.orient_strips(rays);
        let volery_slicing::Quantization { low, scale, magnitude_scale } = read.quantization;
        let quantization = Quantization { low, scale, magnitude_scale };
        let points = SheetVertices::Quantized { points: &read.points, gradients: &[], quantization };
        let picture = picture(&scene, &decoded, points, range);
        let what = format!("{name}: from a file against as sliced");
        let found = distance(&what, &exact(&exact_picture), &exact(&picture));
        at_most(&what, found.rmse, 0.0002);
        let black = volery_reference::metrics::compare(
            &exact(&exact_picture),
            &exact(&Image { pixels: vec![[0.0; 3]; exact_picture.pixels.len()], ..exact_picture.clone() }),
        );
        assert!(black.unwrap().rmse > 0.02, "{name}: there is something to see");
    }
}

/// Prints how many errors and warnings the validator finds, and the first messages.
const VALIDATE: &str = "
const validator = require('gltf-validator');
validator.validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1]))).then(report => {
    const issues = report.issues;
    const first = issues.messages.filter(message => message.severity < 2).slice(0, 3);
    console.log(JSON.stringify([issues.numErrors, issues.numWarnings, first.map(message => message.message)]));
});";

#[test]
fn the_khronos_validator_finds_no_error() {
    const NAME: &str = "stack_files::the_khronos_validator_finds_no_error";
    let Some(data) = data_folder(NAME) else { return };
    let Some(validator) = std::env::var_os("VOLERY_GLTF_VALIDATOR").map(PathBuf::from) else {
        println!(
            "ignored: {NAME} (VOLERY_GLTF_VALIDATOR names no folder with the npm package gltf-validator)"
        );
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    for name in NAMES {
        let slices = slices(&data, name);
        for is_coded in [false, true] {
            let path = folder.path().join("a.glb");
            slices.write_glb(&path, GlbOptions { is_coded }).unwrap();
            let output = Command::new("node")
                .current_dir(&validator)
                .args(["-e", VALIDATE])
                .arg(&path)
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            println!("{name}, coded: {is_coded}: {said}");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            assert_eq!(said.trim(), "[0,0,[]]", "{name}, coded: {is_coded}");
        }
    }
}
