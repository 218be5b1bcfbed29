//! Pictures of grids, of their time steps, and what is said where there can be none.

mod common;

use common::{Workshop, legacy_grid, scene_json};
use serde_json::json;

fn workshop() -> Workshop {
    let shop = Workshop::new();
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    shop
}

#[track_caller]
fn fails(shop: &Workshop, line: &str, code: i32, words: &[&str]) {
    let before = shop.names();
    shop.run_line(line).fails(code, words);
    assert_eq!(shop.names(), before, "volery {line} left something behind");
}

#[test]
fn a_grid_is_drawn_and_reported() {
    let shop = workshop();
    let line = "render ring.vtk -o a.exr --size 60x50 --backend software --verify --report a.json";
    let said = shop.done(line).stdout;
    for words in ["60x50, stack, software", "slice ", "triangles", "against reference f64"] {
        assert!(said.contains(words), "no {words:?} in {said}");
    }
    let report = shop.json("a.json");
    assert_eq!((&report["input"]["kind"], &report["technique"]), (&json!("grid"), &json!("stack")));
    assert_eq!(
        report["input"]["cells"],
        json!({"hexahedron": 32, "pyramid": 16, "tetrahedron": 160, "wedge": 64})
    );
    assert_eq!((&report["input"]["scalar"], &report["work"]["slices"]), (&json!("f64"), &json!(128)));
    for missing in ["dims", "nodes", "upload", "bricks"] {
        assert!(!report.to_string().contains(&format!("\"{missing}\"")), "{missing} does not apply");
    }
    let keys: Vec<_> = report["seconds"].as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["build", "draw", "frame", "geometry", "load", "select"]);
    let rmse = report["error"]["measured_rmse"].as_f64().unwrap();
    assert!(rmse < 0.01, "rmse {rmse}, expected below 0.01");
}

#[test]
fn options_of_stacks_change_the_picture_as_they_say() {
    let shop = workshop();
    let picture = |name: &str, options: &str| {
        shop.done(&format!("render ring.vtk -o {name}.exr --size 60x50 --report {name}.json {options}"));
        (
            shop.bytes(&format!("{name}.exr")),
            shop.json(&format!("{name}.json"))["work"]["slices"].as_u64().unwrap(),
        )
    };
    let default = picture("default", "");
    assert_eq!(default, picture("same", "--technique stack --slices 128 --array heat"));
    assert_eq!(picture("few", "--slices 20").1, 20);
    let axes = picture("axes", "--axes");
    assert!(axes.0 != default.0, "other planes, other bits");
    let adaptive = picture("adaptive", "--slices 8 --adaptive 1").1;
    assert!(adaptive > 8, "{adaptive} slices");
    shop.done("render ring.vtk -o frames.exr --size 60x50 --frames 3");
    assert!(shop.bytes("frames.exr") == default.0);
}

#[test]
fn a_scene_of_a_grid_is_drawn_and_described() {
    let shop = workshop();
    let mut scene = scene_json("ring.vtk");
    scene["input"] = json!({"kind": "grid", "file": "ring.vtk", "array": "heat"});
    scene["camera"] = json!({"projection": "orthographic", "eye": [5, -5, 4], "target": [0, 0, 0.75],
                             "up": [0, 0, 1], "height": 4});
    scene["transfer_function"]["points"][0]["value"] = json!(0);
    scene["transfer_function"]["points"][1]["value"] = json!(4);
    shop.write("scene.json", scene.to_string());
    shop.done("render scene.json -o a.png");
    let picture = volery::io::read_png_rgb(&shop.path("a.png")).unwrap();
    assert_eq!([picture.width, picture.height], [48, 32]);
    let background = [0.1, 0.2, 0.3];
    let is_seen = |pixel: &[f32; 3]| (0..3).any(|c| (pixel[c] - background[c]).abs() > 0.03);
    assert!(picture.pixels.iter().filter(|pixel| is_seen(pixel)).count() > 50, "something is seen");
    let text = shop.done("info scene.json").stdout;
    assert!(text.contains("kind      grid") && text.contains("heat on points: f64"), "{text}");
    scene["input"]["array"] = json!("cold");
    shop.write("scene.json", scene.to_string());
    fails(&shop, "render scene.json -o b.png", 1, &["ring.vtk", "cold", "heat"]);
    shop.done("render scene.json -o b.png --array heat");
    assert!(shop.bytes("a.png") == shop.bytes("b.png"));
    scene["input"]["kind"] = json!("volume");
    shop.write("scene.json", scene.to_string());
    fails(&shop, "render scene.json -o c.png", 1, &["ring.vtk"]);
}

#[test]
fn time_steps_are_pictures_of_their_own() {
    let shop = workshop();
    shop.write("late.vtk", legacy_grid(0.5, usize::MAX));
    shop.write("less.vtk", legacy_grid(1.0, 100));
    let collection = |files: &[&str]| {
        let entries: String = files
            .iter()
            .enumerate()
            .map(|(time, file)| format!("<DataSet timestep=\"{time}\" file=\"{file}\"/>"))
            .collect();
        format!("<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>")
    };
    shop.write("a.pvd", collection(&["ring.vtk", "late.vtk", "less.vtk"]));
    let line = "render ring.vtk --size 40x30 --transfer viridis";
    let said = shop.done(&format!("{line} -o t%02d.png --report t%02d.json --time-steps a.pvd")).stdout;
    assert!(said.contains("t01.png") && said.contains("less.vtk: has other points or cells"), "{said}");
    shop.done(&format!("{line} -o l%d.png --time-steps ring.vtk,late.vtk,less.vtk"));
    for step in 0..3 {
        assert!(shop.bytes(&format!("t0{step}.png")) == shop.bytes(&format!("l{step}.png")), "step {step}");
    }
    assert_eq!(shop.json("t01.json")["input"]["path"], json!("late.vtk"));
    shop.done(&format!("{line} -o first.png"));
    assert!(shop.bytes("t00.png") == shop.bytes("first.png"));
    assert!(shop.bytes("t00.png") != shop.bytes("t01.png"));
    // A collection is a grid as well: that of its first step.
    shop.done("render a.pvd -o again.png --size 40x30 --transfer viridis");
    assert!(shop.bytes("again.png") == shop.bytes("first.png"));
    shop.write("gone.pvd", collection(&["nowhere.vtk"]));
    fails(&shop, &format!("{line} -o g%d.png --time-steps gone.pvd"), 1, &["nowhere.vtk"]);
    shop.write("empty.pvd", collection(&[]));
    fails(&shop, &format!("{line} -o g%d.png --time-steps empty.pvd"), 1, &["empty.pvd", "DataSet"]);
    let flat = legacy_grid(1.0, usize::MAX).replace("heat", "cold");
    shop.write("cold.vtk", flat);
    fails(&shop, &format!("{line} -o g%d.png --time-steps cold.vtk"), 1, &["cold.vtk", "heat"]);
}

#[test]
fn wrong_command_lines_are_status_2() {
    let shop = workshop();
    for (options, words) in [
        ("--slices 0", &["--slices"][..]),
        ("--slices many", &["--slices"]),
        ("--adaptive 1.5", &["0 to 1"]),
        ("--adaptive -1", &["0 to 1"]),
        ("--adaptive nan", &["0 to 1"]),
        ("--technique raycast --slices 4", &["--slices", "stack"]),
        ("--technique plane --axes", &["--axes", "stack"]),
        ("--technique stack --focus 1,2,3", &["--focus", "plane"]),
        ("--technique stack --tolerance 0.1", &["--tolerance", "stack"]),
        ("--technique stack --progressive steps", &["--progressive", "stack"]),
        ("--slices 4 --plane 0,0,1,2", &["--slices", "--plane"]),
        ("--time-steps a.vtk,b.vtk", &["a.png", "%d"]),
        ("--time-steps", &["--time-steps"]),
    ] {
        fails(&shop, &format!("render ring.vtk -o a.png {options}"), 2, words);
    }
    fails(
        &shop,
        "render ring.vtk -o %d.png --report r.json --time-steps a.pvd",
        2,
        &["--report", "r.json", "%d"],
    );
    fails(&shop, "render ring.vtk -o %d-%d.png --time-steps a.pvd", 2, &["%d-%d.png"]);
}

#[test]
fn what_cannot_be_drawn_is_status_1() {
    let shop = workshop();
    for (line, words) in [
        ("ring.vtk --technique raycast", &["ring.vtk", "unstructured grid", "--technique raycast"][..]),
        ("ring.vtk --technique fans", &["ring.vtk", "--technique fans"]),
        ("ring.vtk --plane 0,0,1,0.5", &["ring.vtk", "--plane"]),
        ("ring.vtk --tolerance 0.1", &["ring.vtk", "--tolerance"]),
        ("ring.vtk --array cold", &["ring.vtk", "cold", "heat"]),
        ("waves.nrrd --technique stack", &["waves.nrrd", "volume", "--technique stack"]),
        ("waves.nrrd --slices 4", &["waves.nrrd", "volume", "--slices"]),
        ("waves.nrrd --time-steps a.pvd -o a%d.png", &["--time-steps"]),
    ] {
        let output = if line.contains("-o") { "" } else { "-o a.png" };
        fails(&shop, &format!("render {line} {output}"), 1, words);
    }
    let whole = legacy_grid(1.0, usize::MAX);
    // The first node of the first cell, a wedge.
    let (head, nodes) = whole.split_once("\n6 ").unwrap();
    let (_, rest) = nodes.split_once(' ').unwrap();
    let with_node = |node: &str| format!("{head}\n6 {node} {rest}");
    let nan: String =
        whole.split("default\n").next().unwrap().to_owned() + "default\n" + &"nan ".repeat(100_000);
    for (text, words) in [
        (whole[..whole.len() / 2].to_owned(), &["bad.vtk"][..]),
        (whole.replace("CELLS 272", "CELLS 271"), &["bad.vtk"]),
        (with_node("999999"), &["bad.vtk", "999999"]),
        (with_node("-1"), &["bad.vtk", "-1"]),
        (legacy_grid(1.0, 0), &["bad.vtk", "cells"]),
        (nan, &["bad.vtk"]),
        (String::new(), &["bad.vtk"]),
    ] {
        shop.write("bad.vtk", text);
        fails(&shop, "render bad.vtk -o a.png", 1, words);
    }
}

#[test]
fn slices_from_files_are_drawn_and_described() {
    let shop = workshop();
    // Along x, from far away: what a view along x slices.
    shop.done("slice ring.vtk -o ring.vsl --count 200 --axis x");
    shop.done("slice ring.vtk -o ring.glb --count 200 --axis x");
    for name in ["ring.vsl", "ring.glb"] {
        let view = "--size 60x50 --view 90,0 --orthographic --transfer ramp";
        shop.done(&format!("render {name} -o {name}.png {view} --report {name}.json"));
        let report = shop.json(&format!("{name}.json"));
        assert_eq!((&report["input"]["kind"], &report["work"]["slices"]), (&json!("stack"), &json!(200)));
        assert_eq!(report["seconds"].get("geometry"), None);
        let text = shop.done(&format!("info {name}")).stdout;
        assert!(
            text.contains("kind      stack of slices, with gradients") && text.contains("slices    200"),
            "{text}"
        );
        let found = volery::io::read_png_rgb(&shop.path(format!("{name}.png"))).unwrap();
        shop.done(&format!("render ring.vtk -o cells.png --slices 200 --axes {view}"));
        let expected = volery::io::read_png_rgb(&shop.path("cells.png")).unwrap();
        let pairs = found.pixels.as_flattened().iter().zip(expected.pixels.as_flattened());
        let squares: f32 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        let rmse = (squares / found.pixels.len() as f32 / 3.0).sqrt();
        println!("{name}: rmse {rmse} to slices that are not quantised, at most 0.004");
        assert!(rmse < 0.004, "{name}: rmse {rmse}, expected below 0.004");
        shop.done(&format!("render {name} -o shaded.png --shade --size 20x20"));
        for option in
            ["--verify", "--slices 4", "--technique raycast", "--tolerance 0.1", "--error-map e.png"]
        {
            let words = [name, "stack of slices", option.split(' ').next().unwrap()];
            fails(&shop, &format!("render {name} -o b.png {option}"), 1, &words);
        }
    }
    shop.write("cut.vsl", &shop.bytes("ring.vsl")[..500]);
    fails(&shop, "render cut.vsl -o b.png", 1, &["cut.vsl"]);
    fails(&shop, "render ring.vtk -o b.png --verify --shade", 1, &["reference", "light"]);
}

#[test]
fn a_transfer_function_over_magnitudes_classifies_and_lights() {
    let shop = workshop();
    let function = |opacities: [f64; 4]| {
        let color = [[0.9, 0.5, 0.2]; 4];
        json!({"values": [0, 4], "magnitudes": [0, 2], "columns": 2, "rows": 2, "colors": color, "opacities": opacities,
               "unit_distance": 1.0})
    };
    shop.write("edges.json", function([0.0, 0.0, 0.9, 0.9]).to_string());
    shop.write("all.json", function([0.9; 4]).to_string());
    let line = "render ring.vtk --size 60x50";
    shop.done(&format!("{line} -o edges.png --transfer edges.json"));
    shop.done(&format!("{line} -o all.png --transfer all.json --quantized"));
    let light = |name: &str| {
        let picture = volery::io::read_png_rgb(&shop.path(name)).unwrap();
        picture.pixels.as_flattened().iter().sum::<f32>()
    };
    assert!(light("all.png") > 1.05 * light("edges.png"), "{} {}", light("all.png"), light("edges.png"));
    fails(&shop, "render waves.nrrd -o b.png --transfer all.json", 1, &["all.json", "gradient magnitude"]);
    fails(&shop, &format!("{line} -o b.png --transfer all.json --verify"), 1, &["gradient magnitudes"]);
}
