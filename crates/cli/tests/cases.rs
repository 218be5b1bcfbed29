//! Small inputs made after public reports of other programs, each with what is right.

mod common;

use common::{Workshop, legacy_grid};
use volery::VoxelGrid;
use volery::glam::DVec3;

/// Samples of a cube of 24^3 by their distance from its middle and from the axis along z.
fn cube(value: impl Fn(f64, f64) -> i16) -> VoxelGrid {
    let samples: Vec<i16> = (0..24 * 24 * 24)
        .map(|i| {
            let [x, y, z] = [i % 24, i / 24 % 24, i / 576].map(|index| f64::from(index) - 11.5);
            value((x * x + y * y + z * z).sqrt(), (x * x + y * y).sqrt())
        })
        .collect();
    VoxelGrid::new([24, 24, 24], DVec3::ONE, samples).expect("a cube of samples")
}

/// How many pixels of a picture are not background.
fn num_seen(shop: &Workshop, name: &str) -> usize {
    let picture = volery::io::read_png_rgb(&shop.path(name)).expect("a picture that was drawn");
    let background = picture.pixels[0];
    picture.pixels.iter().filter(|pixel| (0..3).any(|c| (pixel[c] - background[c]).abs() > 0.02)).count()
}

/// A ball of soft tissue with a bony core, in air.
fn ball(radius: f64) -> i16 {
    match radius {
        r if r < 3.0 => 1200,
        r if r < 7.0 => 40,
        _ => -1000,
    }
}

#[test]
fn c1_render_ct_shows_the_ball_and_not_its_padding() {
    let shop = Workshop::new();
    shop.write_volume("plain.nrrd", &cube(|radius, _| ball(radius)));
    shop.done("render plain.nrrd -o plain.png --size 64x64");
    let plain = num_seen(&shop, "plain.png");
    assert!(plain > 300, "{plain} pixels of the ball");
    for padding in [-3024, -2000, -2048, -32768] {
        let name = format!("ct{padding}.nrrd");
        let inside = |radius, from_axis| if from_axis > 11.0 { padding } else { ball(radius) };
        shop.write_volume(&name, &cube(inside));
        shop.done(&format!("render {name} -o a.png --size 64x64"));
        let seen = num_seen(&shop, "a.png");
        assert!(seen.abs_diff(plain) < plain / 4, "padding of {padding}: {seen} pixels, {plain} of the ball");
        // Noise in air does not bring the cylinder back.
        let mut state = 1_u32;
        let samples: Vec<i16> = (0..24 * 24 * 24)
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let noise = (state >> 26) as i16 - 32;
                let [x, y, z] = [i % 24, i / 24 % 24, i / 576].map(|index| f64::from(index) - 11.5);
                let from_axis = (x * x + y * y).sqrt();
                if from_axis > 11.0 { padding } else { ball((from_axis * from_axis + z * z).sqrt()) + noise }
            })
            .collect();
        shop.write_volume(
            &name,
            &VoxelGrid::new([24, 24, 24], DVec3::ONE, samples).expect("a cube of samples"),
        );
        shop.done(&format!("render {name} -o a.png --size 64x64"));
        let seen = num_seen(&shop, "a.png");
        assert!(seen.abs_diff(plain) < plain / 4, "padding of {padding}: {seen} pixels, {plain} of the ball");
    }
}

#[test]
fn c1_outliers_do_not_take_the_colours() {
    let shop = Workshop::new();
    let smooth = |radius: f64| (1000.0 * (-radius * radius / 40.0).exp()) as f32;
    let samples = |outlier: Option<f32>, every: usize| -> Vec<f32> {
        (0..24 * 24 * 24)
            .map(|i| {
                let [x, y, z] = [i % 24, i / 24 % 24, i / 576].map(|index| index as f64 - 11.5);
                match outlier {
                    Some(value) if i % every == 7 && i / 576 < 4 => value,
                    _ => smooth((x * x + y * y + z * z).sqrt()),
                }
            })
            .collect()
    };
    let colors = |name: &str, samples: Vec<f32>| {
        shop.write_volume(
            name,
            &VoxelGrid::new([24, 24, 24], DVec3::ONE, samples).expect("a cube of samples"),
        );
        shop.done(&format!("render {name} -o {name}.png --size 64x64 --report {name}.json"));
        let points = shop.json(&format!("{name}.json"))["transfer_function"]["points"].clone();
        let value = |point: &serde_json::Value| point["value"].as_f64().unwrap();
        let points = points.as_array().unwrap();
        (value(&points[0]), points.iter().map(value).filter(|value| *value < 2000.0).fold(0.0, f64::max))
    };
    let (first, last) = colors("plain.nrrd", samples(None, 1));
    assert!(last > 400.0, "colours from {first} to {last}");
    // Three hot voxels, a fill of a tenth of the samples, and fill that others use.
    for (name, outlier, every) in [
        ("hot.nrrd", 1e9, 800),
        ("fill.nrrd", 1e20, 2),
        ("missing.nrrd", 9.969_21e36, 3),
        ("low.nrrd", -1e30, 2),
    ] {
        let (start, end) = colors(name, samples(Some(outlier), every));
        assert!(
            (start - first).abs() < 60.0 && (end - last).abs() < 60.0,
            "{name}: colours from {start} to {end}"
        );
    }
    // Three hot voxels of 16 bits, the rest in a hundredth of the range.
    let dim = |i: usize, hot: bool| {
        let [x, y, z] = [i % 24, i / 24 % 24, i / 576].map(|index| index as f64 - 11.5);
        let is_hot = hot && i % 5000 == 7;
        if is_hot { u16::MAX } else { smooth((x * x + y * y + z * z).sqrt()) as u16 }
    };
    let seen = [false, true].map(|hot| {
        let samples: Vec<u16> = (0..24 * 24 * 24).map(|i| dim(i, hot)).collect();
        shop.write_volume(
            "hot16.nrrd",
            &VoxelGrid::new([24, 24, 24], DVec3::ONE, samples).expect("a cube of samples"),
        );
        shop.done("render hot16.nrrd -o a.png --size 64x64");
        num_seen(&shop, "a.png")
    });
    assert!(seen[0] > 300 && seen[1] > seen[0] / 2, "{seen:?}");
}

#[test]
fn c1_labels_and_masks_keep_every_value() {
    let shop = Workshop::new();
    for (name, values) in
        [("mask", [0, 1, 1]), ("labels", [0, 1, 50]), ("far", [0, 255, 20000]), ("signed", [-5, 0, 3])]
    {
        let value = |radius| {
            if radius < 4.0 {
                values[2]
            } else if radius < 8.0 {
                values[1]
            } else {
                values[0]
            }
        };
        shop.write_volume(format!("{name}.nrrd"), &cube(|radius, _| value(radius)));
        shop.done(&format!("render {name}.nrrd -o a.png --size 64x64 --report r.json"));
        let points = shop.json("r.json")["transfer_function"]["points"].clone();
        let last = points.as_array().unwrap().last().unwrap().clone();
        let opacity = last["opacity"].as_f64().unwrap();
        assert!(opacity > 0.0 && num_seen(&shop, "a.png") > 300, "{name}: {points}");
    }
}

#[test]
fn b6_render_nothing_says_why() {
    let shop = Workshop::new();
    let mut lonely = vec![f32::NAN; 64];
    (lonely[5], lonely[40]) = (3.0, 4.0);
    shop.write_volume("lonely.nrrd", &VoxelGrid::new([4, 4, 4], DVec3::ONE, lonely).unwrap());
    let said = shop.done("render lonely.nrrd -o o.png --size 32x32").stdout;
    assert!(said.contains("note: nothing is seen: every cell of the volume has a blank sample"), "{said}");
    let away = r#"{"input": {"file": "waves.nrrd"}, "size": [32, 32], "camera": {"projection": "perspective",
        "eye": [90, -70, 60], "target": [190, -120, 60], "up": [0, 0, 1], "fov_y_deg": 25}}"#;
    shop.write("away.json", away);
    let said = shop.done("render away.json -o o.png").stdout;
    assert!(
        said.contains("nothing is seen: the camera does not look at the data, which lie from 0, 0, 0 to 39"),
        "{said}"
    );
    let clear = r#"{"points": [{"value": 0, "color": [1, 1, 1], "opacity": 0}], "unit_distance": 1}"#;
    shop.write("clear.json", clear);
    let said = shop.done("render waves.nrrd -o o.png --size 8x8 --transfer clear.json").stdout;
    assert!(said.contains("nothing is seen: the transfer function lets all light through"), "{said}");
    let said = shop.done("render waves.nrrd -o o.png --size 8x8").stdout;
    assert!(!said.contains("note"), "{said}");
}

#[test]
fn b2_slice_flat_names_the_file_and_the_true_reason() {
    let shop = Workshop::new();
    let place = |from: [f64; 3], size: [f64; 3]| {
        let corners =
            [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
        let points: Vec<_> = corners
            .iter()
            .map(|corner| {
                [0, 1, 2]
                    .map(|axis| format!("{:e}", from[axis] + size[axis] * f64::from(corner[axis])))
                    .join(" ")
            })
            .collect();
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n{}\nCELLS 1 9\n\
             8 0 1 2 3 4 5 6 7\nCELL_TYPES 1\n12\nPOINT_DATA 8\nSCALARS p double\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\n",
            points.join("\n")
        )
    };
    shop.write("flat.vtk", place([0.0; 3], [1.0, 1.0, 0.0]));
    shop.write("far.vtk", place([0.0; 3], [1e300; 3]));
    shop.write("fine.vtk", place([1e9; 3], [1e-7 * 1.2, 1e-7 * 1.2, 1e-7 * 1.2]));
    for (line, words) in [
        ("slice flat.vtk -o o.vsl --count 3 --axis z", &["flat.vtk", "flat along 0, 0, 1", "--axis"][..]),
        ("slice far.vtk -o o.glb --count 1 --axis x", &["far.vtk", "1e300", "expected places within"]),
        ("slice far.vtk -o o.vsl --count 3 --axis x", &["far.vtk", "1e300"]),
        ("render far.vtk -o o.png --size 16x16", &["far.vtk", "1e300", "expected places within"]),
        (
            "render fine.vtk -o o.png --size 16x16 --slices 300",
            &["fine.vtk", "slices apart", "expected fewer than 300"],
        ),
    ] {
        let outcome = shop.run_line(line);
        outcome.fails(1, words);
        assert!(outcome.stderr.len() < 300, "{}", outcome.stderr);
    }
    shop.done("slice flat.vtk -o o.vsl --count 3 --axis x");
}

#[test]
fn c15_tf_paraview_several_are_chosen_by_name() {
    let shop = Workshop::new();
    let map = |name: &str, red: f64| {
        format!(r#"{{"Name": "{name}", "ColorSpace": "RGB", "RGBPoints": [0, {red}, 0, 0, 255, 1, 1, 1]}}"#)
    };
    shop.write("two.json", format!("[{}, {}]", map("first", 0.0), map("second", 1.0)));
    shop.write("second.json", map("second", 1.0));
    let line = "render waves.nrrd --size 20x20";
    let words = ["two.json", "expected one of 'first, second'", "--color-map"];
    shop.run_line(&format!("{line} -o a.png --transfer two.json")).fails(1, &words);
    shop.done(&format!("{line} -o a.png --transfer two.json --color-map second"));
    shop.done(&format!("{line} -o b.png --transfer second.json"));
    assert!(shop.bytes("a.png") == shop.bytes("b.png"));
    shop.run_line(&format!("{line} -o c.png --transfer two.json --color-map secnd"))
        .fails(1, &["secnd", "second"]);
}

#[test]
fn c17_raw_names_are_said_on_the_command_line() {
    let shop = Workshop::new();
    let bytes: Vec<u8> = (0..60_u16).flat_map(|i| (4 * i).to_le_bytes()).collect();
    for name in ["v.bin", "v.raw", "v_5x4x3.raw", "v_5x4x3_uint16.raw"] {
        shop.write(name, &bytes);
    }
    let info = shop.done("info v_5x4x3_uint16.raw").stdout;
    for name in ["v.bin", "v.raw", "v_5x4x3.raw"] {
        shop.run_line(&format!("info {name}")).fails(1, &[name, "--dims", "--dtype"]);
        assert_eq!(shop.done(&format!("info {name} --dims 5,4,3 --dtype uint16")).stdout, info);
    }
    let text = shop.done("info v.bin --dims 5,4,3 --dtype uint16 --spacing 1,2,0.5").stdout;
    assert!(text.contains("spacing   1 x 2 x 0.5"), "{text}");
    shop.run_line("info v.bin --dims 5,4,4 --dtype uint16").fails(1, &["v.bin", "120 bytes", "160"]);
}

/// Mesa says `error:` where nothing is wrong; a run that succeeded has no such line.
#[cfg(target_os = "linux")]
#[test]
fn b_drivers_are_quiet() {
    let shop = Workshop::new();
    if std::env::var_os("VOLERY_WITHOUT_GPU").is_some() {
        println!("ignored: b_drivers_are_quiet (no GPU)");
        return;
    }
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_volery"))
        .args(["render", "waves.nrrd", "-o", "a.png", "--size", "8x8", "--backend", "wgpu"])
        .env_remove("XDG_RUNTIME_DIR")
        .env_remove("WAYLAND_DISPLAY")
        .current_dir(shop.path(""))
        .output()
        .unwrap();
    assert!(output.status.success());
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    shop.done("render ring.vtk -o b.png --size 8x8 --backend wgpu");
}
