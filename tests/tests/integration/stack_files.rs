//! Stacks of slices in files: how many bytes, how fast, how far the picture changes, what others say of them.

use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use volery::io::{GlbOptions, GridOptions, read_grid, read_stack};
use volery::{BackendChoice, How, InputData, Slices, View, open_backend};
use volery_slicing::QuantizedMesh;
use volery_tests::{Drawer, at_most, data_folder, distance, exact, read_scene, stack_of, view_of};

const NAMES: [&str; 3] = ["bluntfin", "k3d_fem", "post_mixed"];
const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);
const MAX_BYTES: u64 = 1 << 30;

fn slices(data: &Path, name: &str) -> Slices {
    let file = read_grid(&data.join(format!("{name}.vtu")), &GridOptions::default()).unwrap();
    let session = Drawer::grid(file.grid, None, open_backend(BackendChoice::Software).unwrap()).unwrap();
    session.data().slices(NORMAL, 256).unwrap()
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

#[test]
fn a_file_changes_the_picture_little() {
    let Some(data) = data_folder("stack_files::a_file_changes_the_picture_little") else { return };
    let folder = tempfile::tempdir().unwrap();
    let software = || open_backend(BackendChoice::Software).unwrap();
    for name in ["bluntfin", "k3d_fem"] {
        let input = read_scene(&data, name);
        let InputData::Grid(file) = &input.data else { panic!("{name} is no grid") };
        let array = file.array.as_ref().map(|array| array.name.as_str());
        let mut session = Drawer::grid(file.grid.clone(), array, software()).unwrap();
        let mut view = view_of(&input);
        stack_of(&mut view).num_slices = 256;
        let sliced = session.render(&view).unwrap().image;

        let [_, _, forward] = view.camera.axes();
        let path = folder.path().join("a.vsl");
        session.data().slices(forward, 256).unwrap().write_vsl(&path).unwrap();
        let mut stack = Drawer::stack(read_stack(&path, MAX_BYTES).unwrap(), software()).unwrap();
        let from_file = stack
            .render_frames(&View { how: How::Slices { is_lit: false }, ..view.clone() }, 1)
            .unwrap()
            .image;
        let what = format!("{name}: from a file against as sliced");
        let found = distance(&what, &exact(&sliced), &exact(&from_file));
        at_most(&what, found.rmse, 0.0002);
        let seen = sliced.pixels.as_flattened().iter().filter(|&&channel| channel > 0.02).count();
        assert!(seen > 50_000, "{name}: {seen} channels of pixels above 0.02, expected something to see");
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
