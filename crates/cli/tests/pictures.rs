//! What the program draws and reports.

mod common;

use common::{Workshop, head, scene_json};
use serde_json::Value;

/// All keys of an object and of the objects in it, as paths.
fn keys(value: &Value) -> Vec<String> {
    fn visit(value: &Value, prefix: &str, keys: &mut Vec<String>) {
        match value {
            Value::Object(fields) => {
                for (name, field) in fields {
                    let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
                    visit(field, &path, keys);
                }
            }
            Value::Array(items) if items.first().is_some_and(Value::is_object) => {
                visit(&items[0], prefix, keys);
            }
            _ => keys.push(prefix.to_owned()),
        }
    }
    let mut found = Vec::new();
    visit(value, "", &mut found);
    found.sort();
    found
}

#[test]
fn a_file_alone_makes_a_picture_with_something_on_it() {
    let shop = Workshop::new();
    let outcome = shop.done("render waves.nrrd -o waves.png");
    assert!(outcome.stdout.starts_with("waves.png: 768x768, raycast, "), "{}", outcome.stdout);
    let picture = volery::io::read_png_rgb(&shop.path("waves.png")).unwrap();
    assert_eq!((picture.width, picture.height), (768, 768));
    let background = picture.pixels[0];
    let drawn = picture.pixels.iter().filter(|pixel| **pixel != background).count();
    let share = drawn as f64 / picture.pixels.len() as f64;
    assert!((0.25..0.95).contains(&share), "{share} of the picture is drawn on");
    let brightest = picture.pixels.iter().flatten().copied().fold(0.0, f32::max);
    assert!(brightest > 0.5, "brightest {brightest}");
}

#[test]
fn the_report_has_the_keys_of_the_contract_and_no_others() {
    let shop = Workshop::new();
    let line = "render waves.nrrd -o a.png --size 40x30 --backend software";
    shop.done(&format!("{line} --report plain.json"));
    let plain = [
        "backend.device",
        "backend.kind",
        "camera.eye",
        "camera.fov_y_deg",
        "camera.projection",
        "camera.target",
        "camera.up",
        "error.budget.arithmetic",
        "error.budget.classification",
        "error.budget.early_stop",
        "error.budget.max",
        "error.budget.quadrature",
        "error.budget.texels",
        "error.budget.touching",
        "frames.seconds",
        "image.height",
        "image.width",
        "input.dims",
        "input.kind",
        "input.path",
        "input.scalar",
        "inputs.bytes",
        "inputs.path",
        "seconds.build",
        "seconds.draw",
        "seconds.frame",
        "seconds.load",
        "seconds.select",
        "seconds.upload",
        "technique",
        "transfer_function.points.color",
        "transfer_function.points.opacity",
        "transfer_function.points.value",
        "transfer_function.unit_distance",
        "version",
        "work.bricks",
        "work.bytes_resident",
        "work.bytes_uploaded",
        "work.nodes",
        "work.nodes_by_level",
    ];
    let report = shop.json("plain.json");
    assert_eq!(keys(&report), plain);
    assert_eq!(report["input"]["dims"], serde_json::json!([40, 40, 40]));
    assert_eq!(report["input"]["kind"], "volume");
    assert_eq!(report["backend"]["kind"], "software");

    shop.done(&format!("{line} --report all.json --tolerance 0.1 --verify"));
    let more = [
        "dial.tolerance",
        "error.against",
        "error.measured_max",
        "error.measured_psnr_db",
        "error.measured_rmse",
    ];
    let mut all: Vec<_> = plain.iter().chain(&more).copied().collect();
    all.sort_unstable();
    let report = shop.json("all.json");
    assert_eq!(keys(&report), all);
    assert_eq!(report["dial"]["tolerance"], 0.1);
    assert_eq!(report["error"]["against"], "reference f64");
}

#[test]
fn a_budget_of_memory_is_kept_and_reported_or_refused() {
    let shop = Workshop::new();
    let line = "render waves.nrrd -o a.exr --size 60x50 --backend software";
    let refused = shop.run_line(&format!("{line} --memory 0"));
    refused.fails(1, &["memory is 0 bytes", "coarsest cut"]);
    let words = refused.stderr.split("expected at least ").nth(1).unwrap();
    let least: u64 = words.split(':').next().unwrap().parse().unwrap();
    assert!(!shop.path("a.exr").exists());
    shop.done(&format!("{line} --memory {least} --report least.json"));
    let report = shop.json("least.json");
    assert_eq!(report["dial"]["memory"], least);
    assert!(report["work"]["bytes_resident"].as_u64().unwrap() <= least);
    assert!(report["error"]["predicted_rmse"].as_f64().unwrap() > 0.0);
    shop.done(&format!("{line} --report full.json"));
    let full = shop.bytes("a.exr");
    shop.done(&format!("{line} --memory 2GiB --report all.json --save-scene scene.json"));
    assert_eq!(shop.bytes("a.exr"), full, "all of it fits");
    assert_eq!(shop.json("all.json")["error"]["predicted_rmse"], 0.0);
    assert_eq!(shop.json("scene.json")["memory"], 2_u64 << 30);
    shop.done("render scene.json -o b.exr --backend software");
    assert_eq!(shop.bytes("b.exr"), full);
    let interest = "--interest sphere:1,2,3,4,5 --interest box:0,0,0,1,1,1,2";
    shop.run_line(&format!("{line} {interest}")).fails(1, &["interest is read with memory alone"]);
    shop.done(&format!("{line} --memory 1GiB {interest} --save-scene scene.json"));
    let found = &shop.json("scene.json")["interest"];
    assert_eq!(found[0]["sphere"], serde_json::json!({"center": [1.0, 2.0, 3.0], "radius": 4.0}));
    assert_eq!((&found[1]["box"][1][0], &found[1]["weight"]), (&1.0.into(), &2.0.into()));
    for technique in ["plane", "fans"] {
        let line = format!("{line} --memory 1GiB --technique {technique}");
        shop.run_line(&line).fails(1, &[technique, "Memory", "expected Full"]);
    }
}

#[test]
fn tolerance_0_is_the_full_resolution_bit_for_bit() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    for volume in ["waves", "head"] {
        for ending in ["png", "exr"] {
            let line = format!("render {volume}.nrrd --size 90x70 -o");
            shop.done(&format!("{line} full.{ending}"));
            shop.done(&format!("{line} zero.{ending} --tolerance 0"));
            assert!(
                shop.bytes(&format!("full.{ending}")) == shop.bytes(&format!("zero.{ending}")),
                "{volume}"
            );
        }
    }
    shop.done("render waves.nrrd --size 90x70 -o coarse.exr --tolerance 0.5 --report coarse.json");
    shop.done("render waves.nrrd --size 90x70 -o full.exr");
    assert!(shop.bytes("coarse.exr") != shop.bytes("full.exr"), "a tolerance has an effect");
    let levels = &shop.json("coarse.json")["work"]["nodes_by_level"];
    assert!(levels.as_array().is_some_and(|levels| levels.len() > 1), "{levels}");
}

#[test]
fn verified_pictures_are_within_the_contract() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    for line in [
        "waves.nrrd",
        "waves.nrrd --orthographic --transfer viridis",
        "head.nrrd --transfer ct-soft-tissue",
        "head.nrrd --view 200,-30,1.5 --transfer ct-bone",
    ] {
        shop.done(&format!("render {line} --size 120x100 -o a.png --verify --report r.json"));
        let error = &shop.json("r.json")["error"];
        let (rmse, max) = (error["measured_rmse"].as_f64().unwrap(), error["measured_max"].as_f64().unwrap());
        println!("{line}: rmse {rmse:.6}, max {max:.6}");
        assert!(rmse <= 0.002 && max <= 0.02, "{line}: rmse {rmse} above 0.002 or max {max} above 0.02");
        assert!(rmse > 0.0 && max >= rmse);
    }
}

#[test]
fn a_coarse_cut_is_farther_from_the_truth_and_says_so() {
    let shop = Workshop::new();
    let rmse = |extra: &str| {
        shop.done(&format!("render waves.nrrd --size 80x80 -o a.png --verify --report r.json {extra}"));
        shop.json("r.json")["error"]["measured_rmse"].as_f64().unwrap()
    };
    let (full, coarse) = (rmse(""), rmse("--tolerance 0.5"));
    assert!(coarse > 4.0 * full, "full {full}, coarse {coarse}");
}

#[test]
fn frames_are_all_reported_and_only_the_first_uploads() {
    let shop = Workshop::new();
    shop.done("render waves.nrrd --size 64x64 -o a.png --frames 5 --report five.json");
    shop.done("render waves.nrrd --size 64x64 -o b.png --report one.json");
    let [five, one] = ["five.json", "one.json"].map(|name| shop.json(name));
    let seconds: Vec<f64> =
        five["frames"].as_array().unwrap().iter().map(|frame| frame["seconds"].as_f64().unwrap()).collect();
    assert_eq!(seconds.len(), 5);
    let mut sorted = seconds.clone();
    sorted.sort_by(f64::total_cmp);
    assert_eq!(five["seconds"]["frame"].as_f64().unwrap(), sorted[2], "the median of {seconds:?}");
    assert_eq!(five["work"]["bytes_uploaded"], one["work"]["bytes_uploaded"]);
    assert_eq!(one["work"]["bricks"], one["work"]["nodes"]);
    assert!(shop.bytes("a.png") == shop.bytes("b.png"));
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let shop = Workshop::new();
    for threads in [1, 2, 3] {
        shop.done(&format!(
            "render waves.nrrd --size 100x80 -o t{threads}.exr --threads {threads} --backend software"
        ));
    }
    assert!(shop.bytes("t1.exr") == shop.bytes("t2.exr"));
    assert!(shop.bytes("t1.exr") == shop.bytes("t3.exr"));
}

#[test]
fn the_error_map_says_how_much_it_is_amplified() {
    let shop = Workshop::new();
    let outcome = shop.done("render waves.nrrd --size 60x60 -o a.exr --error-map e.png --report r.json");
    let report = shop.json("r.json");
    let max = report["error"]["measured_max"].as_f64().unwrap();
    let line =
        outcome.stdout.lines().find(|line| line.starts_with("e.png: |picture - reference| x ")).unwrap();
    let gain: f64 = line.rsplit(' ').next().unwrap().parse().unwrap();
    assert!(
        gain >= 1.0 && gain.log2().fract() == 0.0 && max * gain <= 1.0 && max * gain > 0.5,
        "{gain} {max}"
    );
    let map = volery::io::read_png_rgb(&shop.path("e.png")).unwrap();
    let brightest = map.pixels.iter().flatten().copied().fold(0.0, f32::max);
    assert!((f64::from(brightest) - max * gain).abs() < 1.0 / 255.0, "{brightest} against {}", max * gain);
}

#[test]
fn paths_in_a_scene_are_relative_to_it_or_to_data() {
    let shop = Workshop::new();
    std::fs::create_dir_all(shop.path("scenes")).unwrap();
    std::fs::create_dir_all(shop.path("elsewhere")).unwrap();
    shop.write_scene("here.json", "waves.nrrd");
    shop.write_scene("scenes/up.json", "../waves.nrrd");
    shop.write_scene("scenes/data.json", "moved.nrrd");
    std::fs::copy(shop.path("waves.nrrd"), shop.path("elsewhere/moved.nrrd")).unwrap();
    shop.done("render here.json -o a.png");
    shop.done("render scenes/up.json -o b.png");
    shop.done("render scenes/data.json --data elsewhere -o c.png");
    assert!(shop.bytes("a.png") == shop.bytes("b.png"));
    assert!(shop.bytes("a.png") == shop.bytes("c.png"));
    shop.run_line("render scenes/data.json -o d.png").fails(1, &["moved.nrrd"]);
}

#[test]
fn options_override_the_scene() {
    let shop = Workshop::new();
    shop.write_scene("s.json", "waves.nrrd");
    let size_of = |name: &str| {
        let picture = volery::io::read_png_rgb(&shop.path(name)).unwrap();
        (picture.width, picture.height)
    };
    shop.done("render s.json -o plain.png");
    assert_eq!(size_of("plain.png"), (48, 32));
    for option in ["--size 20x30", "--view 10,20", "--orthographic", "--transfer magma"] {
        shop.done(&format!("render s.json -o other.png {option}"));
        assert!(shop.bytes("plain.png") != shop.bytes("other.png"), "{option} has no effect");
    }
    shop.done("render s.json -o small.png --size 20x30");
    assert_eq!(size_of("small.png"), (20, 30));
    // A view of its own keeps the scene's background.
    shop.done("render s.json -o turned.png --view 10,20,0.3");
    let corner = volery::io::read_png_rgb(&shop.path("turned.png")).unwrap().pixels[0];
    assert_eq!(corner.map(|c| (c * 255.0).round()), [26.0, 51.0, 77.0]);
}

#[test]
fn a_transfer_function_of_a_file_is_that_of_the_scene() {
    let shop = Workshop::new();
    shop.write_scene("s.json", "waves.nrrd");
    shop.write("t.json", scene_json("x")["transfer_function"].to_string());
    shop.done("render s.json -o a.exr");
    shop.done("render s.json -o b.exr --transfer t.json");
    assert!(shop.bytes("a.exr") == shop.bytes("b.exr"));
}

#[test]
fn every_preset_draws() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    for preset in volery::Preset::all() {
        let outcome =
            shop.done(&format!("render head.nrrd -o a.png --size 32x32 --transfer {}", preset.name()));
        assert!(!outcome.stdout.contains("transparent"), "{}", outcome.stdout);
    }
    let outcome = shop.done("render waves.nrrd -o a.png --size 32x32 --transfer ct-bone --orthographic");
    assert!(!outcome.stdout.contains("note:"), "{}", outcome.stdout);
}

#[test]
fn a_transparent_picture_is_told_apart_from_a_failure() {
    let shop = Workshop::new();
    shop.write(
        "t.json",
        r#"{"points": [{"value": 0, "color": [1, 1, 1], "opacity": 0}], "unit_distance": 1}"#,
    );
    let outcome = shop.done("render waves.nrrd -o a.png --size 8x8 --transfer t.json");
    assert!(outcome.stdout.contains("note: the transfer function is transparent"), "{}", outcome.stdout);
}

#[cfg(unix)]
#[test]
fn names_need_not_be_utf8() {
    use std::os::unix::ffi::OsStrExt;
    let shop = Workshop::new();
    let odd = std::ffi::OsStr::from_bytes(b"w\xff.nrrd");
    let picture = std::ffi::OsStr::from_bytes(b"p\xfe.png");
    std::fs::copy(shop.path("waves.nrrd"), shop.path(odd)).unwrap();
    let outcome =
        shop.run(&["render".as_ref(), odd, "-o".as_ref(), picture, "--size".as_ref(), "16x16".as_ref()]);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(shop.path(picture).is_file());
    let missing = std::ffi::OsStr::from_bytes(b"no\xff.nrrd");
    shop.run(&["info".as_ref(), missing]).fails(1, &["no"]);
}

#[test]
fn info_tells_what_a_file_is() {
    let shop = Workshop::new();
    shop.write_volume("holes.nrrd", &volery_data::holes([12, 11, 10], 3, 0.25));
    let text = shop.done("info holes.nrrd").stdout;
    for word in ["volume, NRRD", "12 x 11 x 10", "f32", "1 x 1 x 1", "blank", "histogram"] {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
    let info: Value = serde_json::from_str(&shop.done("info holes.nrrd --json").stdout).unwrap();
    assert_eq!(info["dims"], serde_json::json!([12, 11, 10]));
    let channel = &info["channels"][0];
    let counted: u64 = channel["histogram"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(counted + channel["blank"].as_u64().unwrap(), 12 * 11 * 10);
    shop.write_scene("s.json", "waves.nrrd");
    assert!(shop.done("info s.json").stdout.contains("40 x 40 x 40"));
}

#[test]
fn images_are_known_and_drawn_as_what_they_are() {
    let shop = Workshop::new();
    shop.done("render waves.nrrd -o picture.png --size 20x10");
    let info: Value = serde_json::from_str(&shop.done("info picture.png --json").stdout).unwrap();
    assert_eq!((&info["kind"], &info["scalar"]), (&Value::from("image"), &Value::from("rgb8")));
    assert_eq!(info["channels"].as_array().unwrap().len(), 3);
    let line = "render picture.png -o b.png --technique raycast";
    shop.run_line(line).fails(1, &["picture.png", "rgb8", "one channel"]);
    // Straight at the image: one pixel a sample, and the margin around it.
    shop.done("render picture.png -o c.exr --size 44x24 --report c.json --verify");
    let report = shop.json("c.json");
    assert_eq!(
        (&report["input"]["kind"], &report["technique"]),
        (&Value::from("image"), &Value::from("plane"))
    );
    let max = report["error"]["measured_max"].as_f64().unwrap();
    assert!(max < 1e-5, "{max}");
}

#[test]
fn the_demo_draws_every_technique_and_a_contact_sheet() {
    let shop = Workshop::new();
    let outcome = shop.done("demo -o pictures --backend software");
    let lines: Vec<_> = outcome.stdout.lines().collect();
    assert_eq!(lines.len(), 1 + 3 * 6 + 1, "{}", outcome.stdout);
    assert!(lines.last().unwrap().ends_with("contact-sheet.png"));
    let pictures = std::fs::read_dir(shop.path("pictures")).unwrap().count();
    assert_eq!(pictures, 3 * 7 + 1);
    let sheet = volery::io::read_png_rgb(&shop.path("pictures/contact-sheet.png")).unwrap();
    assert!(sheet.width > 7 * 228 && sheet.height > 3 * 228);
}
