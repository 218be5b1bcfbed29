//! Which of several: channels, components, volumes, time steps; and what a file says of how it is to be shown.

mod common;

use common::{Workshop, collection, legacy_grid, legacy_vectors, text_nrrd, vector};
use serde_json::json;
use volery::VoxelGrid;
use volery::glam::{DAffine3, DMat3, DVec3};
use volery::io::{World, write_nrrd};

const SIZE: &str = "--size 24x20 --backend software";

/// Draws `line` and `same`, and asserts that the pictures are the same.
fn assert_same(shop: &Workshop, line: &str, same: &str) {
    shop.done(&format!("render {line} {SIZE} -o a.exr"));
    shop.done(&format!("render {same} {SIZE} -o b.exr"));
    assert!(shop.bytes("a.exr") == shop.bytes("b.exr"), "{line} is not {same}");
}

fn assert_other(shop: &Workshop, line: &str, other: &str) {
    shop.done(&format!("render {line} {SIZE} -o a.exr"));
    shop.done(&format!("render {other} {SIZE} -o b.exr"));
    assert!(shop.bytes("a.exr") != shop.bytes("b.exr"), "{line} is {other}");
}

#[test]
fn a_channel_of_a_volume_is_the_volume_of_that_channel() {
    let shop = Workshop::new();
    shop.write("v.nrrd", text_nrrd("3 6 5 4", "vector domain domain domain", vector));
    let length = |i: usize| (0..3).map(|c| vector(3 * i + c).powi(2)).sum::<f64>().sqrt();
    let domain = "domain domain domain";
    for channel in 0..3 {
        shop.write(&format!("{channel}.nrrd"), text_nrrd("6 5 4", domain, |i| vector(3 * i + channel)));
        for option in ["--channel", "--component"] {
            assert_same(&shop, &format!("v.nrrd {option} {channel}"), &format!("{channel}.nrrd"));
        }
    }
    assert_other(&shop, "v.nrrd --channel 0", "v.nrrd --channel 1");
    assert_other(&shop, "v.nrrd", "v.nrrd --channel 0");
    let info = shop.done("info v.nrrd").stdout;
    assert!(info.contains("\nchoose    --channel 0 to 2\n") && info.contains("magnitude"), "{info}");
    let range = |line: &str| {
        let text = shop.done(&format!("info {line} --json")).stdout;
        let json: serde_json::Value = serde_json::from_str(&text).expect("valid JSON");
        assert_eq!(json["choices"], json!({"channels": 3}));
        json["channels"][0]["range"][1].as_f64().expect("a range")
    };
    let most = |value: &dyn Fn(usize) -> f64| (0..120).map(value).fold(0.0, f64::max);
    assert!((range("v.nrrd") - most(&length)).abs() < 1e-4);
    assert_eq!(range("v.nrrd --channel 2"), most(&|i| vector(3 * i + 2)));
    // Colours are drawn as they are, one of their channels by its values.
    let pixels: Vec<_> = (0..60).map(|i| [i as f32 / 60.0, 0.5, 1.0 - i as f32 / 60.0]).collect();
    volery::io::write_png(&shop.path("c.png"), 10, 6, &pixels).expect("a picture");
    assert_other(&shop, "c.png --channel 0", "c.png --channel 2");
    shop.done(&format!("render c.png --channel 2 --transfer viridis {SIZE} -o a.exr"));
    assert!(shop.done("info c.png").stdout.contains("choose    --channel 0 to 2"));
    assert!(!shop.done("info waves.nrrd").stdout.contains("choose"));
}

#[test]
fn a_time_step_of_a_volume_is_the_volume_of_that_time() {
    let shop = Workshop::new();
    shop.write("t.nrrd", text_nrrd("6 5 4 3", "domain domain domain time", vector));
    for step in 0..3 {
        shop.write(
            &format!("{step}.nrrd"),
            text_nrrd("6 5 4", "domain domain domain", |i| vector(120 * step + i)),
        );
        for option in ["--time-step", "--volume"] {
            assert_same(&shop, &format!("t.nrrd {option} {step}"), &format!("{step}.nrrd"));
        }
    }
    assert_other(&shop, "t.nrrd --time-step 1", "t.nrrd --time-step 2");
    let info = shop.done("info t.nrrd").stdout;
    assert!(info.contains("\nchoose    --time-step 0 to 2\n"), "{info}");
    let note = "note: the file holds 3 volumes; the first is used (another, 0 to 2, can be chosen)";
    assert!(shop.done(&format!("render t.nrrd {SIZE} -o a.png")).stdout.contains(note));
    assert!(
        !shop.done(&format!("render t.nrrd --volume 0 {SIZE} -o a.png")).stdout.contains("note: the file")
    );
    let words = ["t.nrrd", "time step asked for is 3, expected 0 to 2"];
    shop.run_line("render t.nrrd --volume 3 -o new.png").fails(1, &words);
}

#[test]
fn a_component_and_a_time_step_of_a_grid() {
    let shop = Workshop::new();
    shop.write("flow.vtk", legacy_vectors());
    shop.write("late.vtk", legacy_grid(3.0, usize::MAX));
    shop.write("steps.pvd", collection(&["flow.vtk", "late.vtk"]));
    // Slices of a component have its values: those of the array that has it alone.
    let points = volery_data::cylinder(2).points().to_vec();
    let whole = legacy_grid(1.0, usize::MAX);
    let (before, _) = whole.split_once("LOOKUP_TABLE").expect("values");
    for (channel, axis) in ["x", "y", "z"].iter().enumerate() {
        let values: Vec<String> = points.iter().map(|point| (3.0 * point[channel]).to_string()).collect();
        shop.write(&format!("{axis}.vtk"), format!("{before}LOOKUP_TABLE default\n{}\n", values.join(" ")));
        assert_same(&shop, &format!("flow.vtk --array flow --channel {channel}"), &format!("{axis}.vtk"));
        shop.done(&format!("slice flow.vtk --array flow --component {channel} -o a.vsl --count 9"));
        shop.done(&format!("slice {axis}.vtk -o b.vsl --count 9"));
        assert!(shop.bytes("a.vsl") == shop.bytes("b.vsl"), "{axis}");
    }
    assert_other(&shop, "flow.vtk --array flow", "flow.vtk --array flow --channel 0");
    assert_same(&shop, "steps.pvd --volume 1", "late.vtk");
    assert_same(&shop, "steps.pvd --time-step 0 --array flow --component 1", "y.vtk");
    let info = shop.done("info steps.pvd --array flow").stdout;
    assert!(info.contains("choose    --channel 0 to 2\nchoose    --time-step 0 to 1\n"), "{info}");
    let info = shop.done("info flow.vtk --array flow --channel 2").stdout;
    let [low, high] =
        points.iter().fold([f64::MAX, f64::MIN], |[a, b], p| [a.min(3.0 * p.z), b.max(3.0 * p.z)]);
    assert!(info.contains(&format!("3 x f64, channel 2 {low} to {high} (drawn)")), "{info}");
    shop.run_line("info flow.vtk --array flow --channel 3").fails(1, &["flow.vtk", "channel", "0 to 2"]);
    // The component holds for every step of a series.
    shop.write("b.vtk", legacy_vectors());
    let line =
        format!("render flow.vtk --array flow --channel 1 --time-steps flow.vtk,b.vtk -o s%d.exr {SIZE}");
    shop.done(&line);
    shop.done(&format!("render y.vtk {SIZE} -o y.exr"));
    assert!(shop.bytes("s0.exr") == shop.bytes("s1.exr") && shop.bytes("s1.exr") == shop.bytes("y.exr"));
}

/// A ball in a NIfTI file that asks to show these values.
fn nifti([low, high]: [f32; 2]) -> Vec<u8> {
    let mut file = vec![0; 352];
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    [3_i16, 16, 16, 16, 1, 1, 1, 1].iter().enumerate().for_each(|(i, n)| put(40 + 2 * i, &n.to_le_bytes()));
    put(70, &4_i16.to_le_bytes());
    put(72, &16_i16.to_le_bytes());
    (0..4).for_each(|i| put(76 + 4 * i, &1_f32.to_le_bytes()));
    put(108, &352_f32.to_le_bytes());
    put(124, &high.to_le_bytes());
    put(128, &low.to_le_bytes());
    put(344, b"n+1\0");
    for i in 0..16 * 16 * 16 {
        let [x, y, z] = [i % 16, i / 16 % 16, i / 256].map(|index| f64::from(index) - 7.5);
        let value = 1000.0 * (-(x * x + y * y + z * z) / 30.0).exp();
        file.extend((value as i16).to_le_bytes());
    }
    file
}

#[test]
fn the_values_that_a_file_asks_to_show_are_those_of_automatic_colours() {
    let shop = Workshop::new();
    let files = [
        ("none.nii", [0.0, 0.0]),
        ("window.nii", [200.0, 400.0]),
        ("wide.nii", [-500.0, 600.0]),
        ("apart.nii", [5000.0, 6000.0]),
        ("turned.nii", [400.0, 200.0]),
    ];
    files.iter().for_each(|(name, window)| shop.write(name, nifti(*window)));
    let said = |line: &str| shop.done(&format!("render {line} {SIZE} -o c.png --report r.json")).stdout;
    let note = "note: colours run over the values that the file asks to show, ";
    for (file, window) in [("window.nii", "200,400"), ("wide.nii", "-500,600")] {
        let shown = window.replace(',', " to ");
        for rest in ["", "--transfer ramp", "--transfer viridis", "--technique plane", "--technique fans"] {
            assert!(
                said(&format!("{file} {rest}")).contains(&format!("{note}{shown} (--range")),
                "{file} {rest}"
            );
            assert_same(&shop, &format!("{file} {rest}"), &format!("none.nii {rest} --range {window}"));
        }
        // What is said on the command line goes before, and what has its own values is not moved.
        for rest in ["--range 100,900", "--transfer ct-bone"] {
            assert!(!said(&format!("{file} {rest}")).contains(note));
            assert_same(&shop, &format!("{file} {rest}"), &format!("none.nii {rest}"));
        }
    }
    said("window.nii --transfer ramp");
    let points = &shop.json("r.json")["transfer_function"]["points"];
    assert_eq!([&points[0]["value"], &points[1]["value"]], [200.0, 400.0]);
    for file in ["none.nii", "apart.nii", "turned.nii"] {
        assert!(!said(file).contains(note), "{file}");
        assert_same(&shop, file, "none.nii");
    }
}

#[test]
fn the_report_says_where_samples_lie() {
    let shop = Workshop::new();
    let samples: Vec<u8> = (0..60).map(|i| i * 4).collect();
    let grid = VoxelGrid::new([5, 4, 3], DVec3::new(2.0, 1.0, 0.5), samples).expect("a grid");
    let mirrored = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::new(-2.0, 1.0, 0.5)),
        DVec3::new(90.0, -126.5, 7.0),
    );
    let placed = grid.clone().with_world_from_index(mirrored).expect("axes that span space");
    for (world, code) in [(World::Anatomical, "LAS"), (World::Plain, "-x +y +z")] {
        write_nrrd(&shop.path("placed.nrrd"), &placed, world).expect("a volume is written");
        shop.done(&format!("render placed.nrrd {SIZE} -o a.png --report r.json"));
        let input = shop.json("r.json")["input"].clone();
        assert_eq!(input["orientation"], code);
        let rows = json!([[-2.0, 0.0, 0.0, 90.0], [0.0, 1.0, 0.0, -126.5], [0.0, 0.0, 0.5, 7.0]]);
        assert_eq!(input["world_from_index"], rows);
        assert_eq!(input["drawn_by"], "file");
        let text = shop.done("info placed.nrrd --json").stdout;
        let info: serde_json::Value = serde_json::from_str(&text).expect("valid JSON");
        assert_eq!(info["orientation"], input["orientation"]);
        assert_eq!(info["origin"], json!([90.0, -126.5, 7.0]));
    }
    shop.write_volume("plain.nrrd", &grid);
    shop.done(&format!("render plain.nrrd {SIZE} -o a.png --report r.json"));
    let input = shop.json("r.json")["input"].clone();
    assert_eq!((input.get("orientation"), input.get("world_from_index")), (None, None));
}
