//! What the program says when it cannot.

mod common;

use common::{Workshop, scene_json};
use serde_json::json;
use volery::VoxelGrid;
use volery::glam::DVec3;

/// A command that must fail leaves the folder as it was.
#[track_caller]
fn fails(shop: &Workshop, line: &str, code: i32, words: &[&str]) {
    let before = shop.names();
    shop.run_line(line).fails(code, words);
    assert_eq!(shop.names(), before, "volery {line} left something behind");
}

#[test]
fn wrong_command_lines_are_status_2() {
    let shop = Workshop::new();
    for (line, words) in [
        ("", &["subcommand"][..]),
        ("paint", &["paint"]),
        ("render", &["-o", "required"]),
        ("render waves.nrrd", &["OUT.png"]),
        ("render waves.nrrd -o a.jpg", &["a.jpg", ".png"]),
        ("render waves.nrrd -o a", &["'a'", ".png"]),
        ("render waves.nrrd -o a.png --size 0x0", &["0 x 0", "at least 1"][..1]),
        ("render waves.nrrd -o a.png --size 0x10", &["0 x 10"]),
        ("render waves.nrrd -o a.png --size 100000x2", &["100000 x 2"]),
        ("render waves.nrrd -o a.png --size 65536x65536", &["65536 x 65536"]),
        ("render waves.nrrd -o a.png --size 99999999999x1", &["99999999999x1", "WIDTHxHEIGHT"]),
        ("render waves.nrrd -o a.png --size=-3x4", &["-3x4", "WIDTHxHEIGHT"]),
        ("render waves.nrrd -o a.png --tolerance NaN", &["NaN", "0 to 1"]),
        ("render waves.nrrd -o a.png --tolerance -0.5", &["-0.5", "0 to 1"]),
        ("render waves.nrrd -o a.png --tolerance inf", &["inf"]),
        ("render waves.nrrd -o a.png --tolerance many", &["many"]),
        ("render waves.nrrd -o a.png --memory -5", &["-5", "MiB"]),
        ("render waves.nrrd -o a.png --memory 3MB", &["3MB", "MiB"]),
        ("render waves.nrrd -o a.png --memory 1e9", &["1e9", "whole number"]),
        ("render waves.nrrd -o a.png --memory 99999999999GiB", &["99999999999GiB"]),
        ("render waves.nrrd -o a.png --memory 1MiB --tolerance 0.1", &["--memory", "--tolerance"]),
        ("render waves.nrrd -o a.png --technique stack --memory 1MiB", &["--memory", "stack"]),
        ("render waves.nrrd -o a.png --memory 1MiB --interest 1,2,3", &["sphere:X,Y,Z,RADIUS,W"]),
        ("render waves.nrrd -o a.png --memory 1MiB --interest sphere:1,2,3,0,1", &["radius above 0"]),
        ("render waves.nrrd -o a.png --memory 1MiB --interest box:5,0,0,1,1,1,1", &["low at most high"]),
        (
            "render waves.nrrd -o a.png --memory 1MiB --interest sphere:1,2,3,4,-1",
            &["weight is -1.0", "at least 0"],
        ),
        ("render waves.nrrd -o a.png --view 1", &["AZIMUTH"]),
        ("render waves.nrrd -o a.png --view 1,2,0", &["zoom"]),
        ("render waves.nrrd -o a.png --view NaN,2", &["finite"]),
        ("render waves.nrrd -o a.png --transfer rainbow", &["rainbow", "viridis"]),
        ("render waves.nrrd -o a.png --technique slices", &["slices", "raycast"]),
        ("render waves.nrrd -o a.png --backend vulkan", &["vulkan", "software"]),
        ("render waves.nrrd -o a.png --frames 0", &["--frames"]),
        ("render waves.nrrd -o a.png --threads 0", &["--threads"]),
        ("render waves.nrrd -o a.png --error 2", &["0 to 1"]),
        ("render waves.nrrd -o a.png --technique fans --show-nodes", &["--show-nodes", "plane"]),
        ("render waves.nrrd -o a.png --thickness exact", &["--thickness", "fans"]),
        ("render waves.nrrd -o a.png --plane 1,2,3", &["NX,NY,NZ,D"]),
        ("render waves.nrrd -o a.png --plane 0,0,0,1", &["normal"]),
        ("render waves.nrrd -o a.png --plane 0,0,1,inf", &["distance"]),
        ("render waves.nrrd -o a.png --focus 1", &["X,Y,Z"]),
        ("render waves.nrrd -o a.png --focus 1,2,nan", &["X,Y,Z"]),
        ("render waves.nrrd -o a.png --quality 2", &["--focus"]),
        ("render waves.nrrd -o a.png --focus 1,2,3 --quality -1", &["at least 0"]),
        ("render waves.nrrd -o a.png --error-map e.txt", &["e.txt"]),
        ("info", &["FILE"]),
    ] {
        fails(&shop, line, 2, words);
    }
}

#[test]
fn inputs_that_cannot_be_read_are_status_1() {
    let shop = Workshop::new();
    shop.write("empty.nrrd", "");
    shop.write("empty_4x4x4_uint8.raw", "");
    shop.write("short_4x4x4_uint8.raw", [0; 63]);
    shop.write("text.dat", "hello");
    shop.write("bad.json", "{\"input\": ");
    shop.write("empty.json", "");
    std::fs::create_dir(shop.path("folder")).unwrap();
    for (name, words) in [
        ("missing.nrrd", &["missing.nrrd"][..]),
        ("missing.json", &["missing.json"]),
        ("folder", &["folder"]),
        ("empty.nrrd", &["empty.nrrd"]),
        ("empty_4x4x4_uint8.raw", &["empty_4x4x4_uint8.raw", "is empty"]),
        ("short_4x4x4_uint8.raw", &["63 bytes", "64"]),
        ("text.dat", &["text.dat", "expected"]),
        ("bad.json", &["bad.json"]),
        ("empty.json", &["empty.json"]),
        ("bluntfin.vtu", &["bluntfin.vtu"]),
    ] {
        fails(&shop, &format!("render {name} -o a.png"), 1, words);
        fails(&shop, &format!("info {name}"), 1, words);
    }
}

const TETRAHEDRON: &str = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n\
    POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\n\
    SCALARS p float\nLOOKUP_TABLE default\n1 2 3 4\n";

#[test]
fn grids_are_described_or_refused_in_one_line() {
    let shop = Workshop::new();
    shop.write("good.vtk", TETRAHEDRON);
    shop.done("render good.vtk -o good.png --size 9x9");
    let text = shop.done("info good.vtk").stdout;
    for line in
        ["kind      grid, legacy VTK", "points    4", "cells     1 tetrahedron", "p on points: f32, 1 to 4"]
    {
        assert!(text.contains(line), "{text}");
    }
    let json: serde_json::Value = serde_json::from_str(&shop.done("info good.vtk --json").stdout).unwrap();
    assert_eq!((&json["kind"], &json["cells"]["tetrahedron"]), (&json!("grid"), &json!(1)));
    assert_eq!(json["bounds"], json!([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]));
    for (from, to, words) in [
        ("4 0 1 2 3", "4 0 1 2 4", &["CELLS: node is 4"][..]),
        ("4 0 1 2 3", "4 0 1 2 -3", &["CELLS: node is -3"]),
        ("CELLS 1 5", "CELLS 1 6", &["bad.vtk"]),
        ("\n10\n", "\n5\n", &["number of cells is 0", "at least one that has volume"]),
        ("POINTS 4", "POINTS 5000000000", &["POINTS: "]),
        ("UNSTRUCTURED_GRID", "STRUCTURED_POINTS", &["DIMENSIONS is missing"]),
    ] {
        shop.write("bad.vtk", TETRAHEDRON.replacen(from, to, 1));
        fails(&shop, "info bad.vtk", 1, &[words, &["bad.vtk"]].concat());
        fails(&shop, "render bad.vtk -o a.png", 1, &[words, &["bad.vtk"]].concat());
    }
}

#[test]
fn scenes_that_make_no_sense_are_status_1() {
    let shop = Workshop::new();
    let mut number = 0;
    let mut check = |change: &dyn Fn(&mut serde_json::Value), words: &[&str]| {
        let mut scene = scene_json("waves.nrrd");
        change(&mut scene);
        number += 1;
        let name = format!("scene{number}.json");
        shop.write(&name, scene.to_string());
        fails(&shop, &format!("render {name} -o a.png"), 1, &[words, &[name.as_str()]].concat());
    };
    check(&|scene| scene["size"] = json!([0, 0]), &["0 x 0"]);
    check(&|scene| scene["size"] = json!([4_000_000_000_u32, 4]), &["4000000000"]);
    check(&|scene| scene["size"] = json!([-1, 4]), &["-1"]);
    check(&|scene| scene["background"] = json!([0, 2, 0]), &["background"]);
    check(&|scene| scene["input"]["spacing"] = json!([1, 0, 1]), &["spacing"]);
    check(&|scene| scene["input"]["spacing"] = json!([1, null, 1]), &["null"]);
    check(&|scene| scene["input"]["kind"] = json!("cloud"), &["cloud"]);
    check(&|scene| scene["camera"]["eye"] = scene["camera"]["target"].clone(), &["camera"]);
    check(&|scene| scene["camera"]["fov_y_deg"] = json!(180), &["180"]);
    check(&|scene| scene["camera"]["up"] = json!([0, 0, 0]), &["up"]);
    check(&|scene| scene["transfer_function"]["points"] = json!([]), &["control point"]);
    check(&|scene| scene["transfer_function"]["points"][0]["opacity"] = json!(1.5), &["1.5"]);
    check(&|scene| scene["transfer_function"]["unit_distance"] = json!(0), &["unit_distance"]);
    check(&|scene| scene["colour"] = json!(1), &["colour"]);
    check(
        &|scene| {
            scene.as_object_mut().unwrap().remove("input");
        },
        &["input"],
    );
    let mut cells = scene_json("waves.nrrd");
    cells["input"]["kind"] = json!("grid");
    shop.write("cells.json", cells.to_string());
    fails(&shop, "render cells.json -o a.png", 1, &["waves.nrrd", "expected one that ends in .vtu"]);
    // JSON has no NaN, so one there is no JSON.
    shop.write("nan.json", scene_json("waves.nrrd").to_string().replace("[48,32]", "[NaN,32]"));
    fails(&shop, "render nan.json -o a.png", 1, &["nan.json"]);
    shop.write("gone.json", scene_json("nowhere.nrrd").to_string());
    fails(&shop, "render gone.json -o a.png", 1, &["nowhere.nrrd"]);
}

#[test]
fn volumes_with_nothing_to_cast_rays_through_are_status_1() {
    let shop = Workshop::new();
    let blank = VoxelGrid::new([3, 3, 3], DVec3::ONE, vec![f32::NAN; 27]).unwrap();
    let wide =
        VoxelGrid::new([2, 2, 2], DVec3::ONE, vec![-1.7e308, 1.7e308, 0., 0., 0., 0., 0., 0.]).unwrap();
    let colors = VoxelGrid::new([2, 2, 2], DVec3::ONE, vec![[1u8, 2, 3]; 8]).unwrap();
    shop.write_volume("blank.nrrd", &blank);
    shop.write_volume("wide.nrrd", &wide);
    shop.write_volume("colors.nrrd", &colors);
    shop.write_volume("flat.nrrd", &volery_data::noise([9, 8, 1], 1));
    for (name, words) in [
        ("blank.nrrd", &["blank", "finite"][..]),
        ("wide.nrrd", &["range"]),
        ("colors.nrrd", &["rgb8", "plane"]),
        ("flat.nrrd", &["9 x 8 x 1", "at least 2", "plane"]),
    ] {
        let line = format!("render {name} -o a.png --technique");
        fails(&shop, &format!("{line} raycast"), 1, &[words, &[name]].concat());
        fails(&shop, &format!("{line} fans"), 1, &[words, &[name]].concat());
        shop.done(&format!("info {name}"));
        shop.done(&format!("info {name} --json"));
    }
}

#[test]
fn spacing_that_is_no_length_is_status_1() {
    let shop = Workshop::new();
    for spacing in ["0 1 1", "-inf 1 1"] {
        let header = format!(
            "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: {spacing}\nencoding: raw\n\n"
        );
        let mut bytes = header.into_bytes();
        bytes.extend([0; 8]);
        shop.write("odd.nrrd", bytes);
        fails(&shop, "render odd.nrrd -o a.png", 1, &["odd.nrrd", "spacing"]);
    }
}

#[test]
fn outputs_that_cannot_be_written_are_status_1_and_leave_nothing() {
    let shop = Workshop::new();
    std::fs::create_dir(shop.path("taken.png")).unwrap();
    let line = "render waves.nrrd --size 8x8";
    fails(&shop, &format!("{line} -o nowhere/a.png"), 1, &["nowhere/a.png"]);
    fails(&shop, &format!("{line} -o taken.png"), 1, &["taken.png", "folder"]);
    fails(&shop, &format!("{line} -o waves.nrrd/a.png"), 1, &["a.png"]);
    fails(&shop, "demo -o waves.nrrd", 1, &["waves.nrrd"]);
    // Every place is looked at before the first picture is drawn.
    fails(&shop, &format!("{line} -o a.png --report nowhere/r.json"), 1, &["nowhere/r.json"]);
}

#[test]
fn transfer_files_that_are_wrong_are_status_1() {
    let shop = Workshop::new();
    shop.write("number.json", "7");
    shop.write("cut.json", "{\"points\": [");
    shop.write(
        "opaque.json",
        r#"{"points": [{"value": 0, "color": [0, 0, 0], "opacity": 7}], "unit_distance": 1}"#,
    );
    for name in ["number.json", "cut.json", "opaque.json", "missing.json"] {
        fails(&shop, &format!("render waves.nrrd -o a.png --transfer {name}"), 1, &[name]);
    }
}

#[test]
fn a_name_with_a_line_break_stays_in_one_line() {
    let shop = Workshop::new();
    shop.run(&["render", "two\nlines.nrrd", "-o", "a.png"]).fails(1, &["two\\nlines.nrrd"]);
    shop.run(&["render", "waves.nrrd", "-o", "a.png", "--transfer", "two\nlines"]).fails(2, &["lines"]);
}

#[test]
fn help_shows_an_example_of_every_command() {
    let shop = Workshop::new();
    for command in ["render", "info", "demo"] {
        let help = shop.done(&format!("{command} --help")).stdout;
        assert!(help.contains("Example") && help.contains(&format!("  volery {command} ")), "{help}");
    }
    assert!(shop.done("--version").stdout.starts_with("volery "));
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::process::{Command, Stdio};
    let shop = Workshop::new();
    let mut child = Command::new(env!("CARGO_BIN_EXE_volery"))
        .args(["info", "waves.nrrd"])
        .current_dir(shop.path(""))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty());
}
