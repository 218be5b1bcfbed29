//! More small inputs made after public reports: grids with arrays or cells that other programs stumble over, and steps
//! of a transfer function at a value that many samples have.

mod common;

use common::{Workshop, head};
use serde_json::json;
use volery::VoxelGrid;
use volery::glam::DVec3;

const POINTS: &str = "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1";

/// One hexahedron in VTK's XML, with an array p of 0 to 7 and this beside it.
fn vtu(beside: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\
         <UnstructuredGrid><Piece NumberOfPoints=\"8\" NumberOfCells=\"1\"><PointData>\
         <DataArray type=\"Float32\" Name=\"p\" format=\"ascii\">0 1 2 3 4 5 6 7</DataArray>{beside}</PointData>\
         <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">{POINTS}</DataArray></Points>\
         <Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 3 4 5 6 7</DataArray>\
         <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">8</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">12</DataArray></Cells>\
         </Piece></UnstructuredGrid></VTKFile>"
    )
}

#[test]
fn b3_vtu_other_arrays_refuse_nothing() {
    let shop = Workshop::new();
    shop.write("alone.vtu", vtu(""));
    shop.done("render alone.vtu -o alone.png --size 24x24");
    let array = |attributes: &str, numbers: &str| {
        format!("<DataArray {attributes} format=\"ascii\">{numbers}</DataArray>")
    };
    for (beside, said) in [
        (array("type=\"Bit\" Name=\"set\"", "0 1 0 1 0 1 0 1"), "array left out: set"),
        (array("type=\"String\" Name=\"label\"", "97 0 98 0"), "array left out: label"),
        (array("type=\"Float32\" Name=\"none\" NumberOfComponents=\"0\"", ""), "array left out: none"),
        (
            array("type=\"Float32\" Name=\"e\" NumberOfComponents=\"\"", "0 1 2 3 4 5 6 7"),
            "array     e on points: f32, 0 to 7",
        ),
        (
            array("type=\"Float32\" Name=\"short\"", "0 1 2"),
            "cannot be read: short: count of numbers in the array is 3, expected 8",
        ),
    ] {
        shop.write("a.vtu", vtu(&beside));
        let info = shop.done("info a.vtu").stdout;
        assert!(info.contains("cells     1 hexahedron\n"), "{info}");
        assert!(
            info.contains("array     p on points: f32, 0 to 7 (drawn)\n") && info.contains(said),
            "{info}"
        );
        shop.done("render a.vtu -o a.png --size 24x24");
        assert!(shop.bytes("a.png") == shop.bytes("alone.png"), "{said}");
    }
    // What is asked for by name says why it cannot be had.
    shop.write("a.vtu", vtu(&array("type=\"Bit\" Name=\"set\"", "0 1 0 1 0 1 0 1")));
    shop.run_line("render a.vtu -o b.png --array set").fails(1, &["a.vtu", "set", "'Bit'"]);
}

#[test]
fn b4_legacy_component_names_may_be_blank() {
    let shop = Workshop::new();
    let file = |names: &str| {
        let vectors: Vec<String> = (0..8).map(|i| format!("{i} {} 2", 2 * i)).collect();
        format!(
            "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n{POINTS}\nCELLS 1 9\n\
             8 0 1 2 3 4 5 6 7\nCELL_TYPES 1\n12\nPOINT_DATA 8\nSCALARS p float\nLOOKUP_TABLE default\n\
             0 1 2 3 4 5 6 7\nFIELD FieldData 2\nvel 3 8 float\n{}\n{names}ids 1 8 int\n9 1 2 3 4 5 6 7\n",
            vectors.join(" ")
        )
    };
    for names in [
        "",
        "METADATA\nCOMPONENT_NAMES\nNAME\n\n\n\n",
        "METADATA\nCOMPONENT_NAMES\n\nNAME\n\n\n",
        "METADATA\nCOMPONENT_NAMES\n\n\n\n\n",
    ] {
        shop.write("a.vtk", file(names));
        let info = shop.done("info a.vtk").stdout;
        assert!(info.contains("cells     1 hexahedron\n"), "{names:?}: {info}");
        assert!(info.contains("array     p on points: f32, 0 to 7 (drawn)\n"), "{names:?}: {info}");
        assert!(info.contains("array     vel on points: 3 x f32, magnitude 2 to "), "{names:?}: {info}");
        assert!(info.contains("array     ids on points: i32, 1 to 9\n"), "{names:?}: {info}");
        shop.done("render a.vtk -o a.png --size 24x24 --array vel --component 1");
    }
}

/// Cells that list nodes more than once are sliced into files, and drawn as the exact picture has them.
#[test]
fn b1_slice_degenerate_cells() {
    let shop = Workshop::new();
    let file = |vtk: u8, nodes: &[usize]| {
        let list: Vec<String> = nodes.iter().map(usize::to_string).collect();
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 8 double\n{POINTS}\nCELLS 1 {}\n\
             {} {}\nCELL_TYPES 1\n{vtk}\nPOINT_DATA 8\nSCALARS p double\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\n",
            nodes.len() + 1,
            nodes.len(),
            list.join(" ")
        )
    };
    let cells: [(u8, &[usize]); 9] = [
        (12, &[0, 1, 2, 3, 4, 4, 4, 4]),
        (12, &[0, 1, 2, 2, 4, 5, 6, 6]),
        (12, &[0, 1, 2, 3, 4, 5, 2, 3]),
        (12, &[0, 1, 2, 2, 4, 4, 4, 4]),
        // A section of one polygon in another.
        (12, &[0, 1, 2, 3, 4, 5, 0, 4]),
        (13, &[0, 1, 3, 4, 5, 4]),
        (13, &[0, 1, 3, 0, 5, 7]),
        (14, &[0, 1, 2, 2, 4]),
        (14, &[0, 1, 1, 3, 4]),
    ];
    let haze = r#"{"points": [{"value": 0, "color": [0.9, 0.5, 0.1], "opacity": 0.6}], "unit_distance": 1}"#;
    shop.write("haze.json", haze);
    for (vtk, nodes) in cells {
        shop.write("a.vtk", file(vtk, nodes));
        for axis in ["x", "y", "z", "0.3,0.5,0.81"] {
            for output in ["a.vsl", "a.glb"] {
                shop.done(&format!("slice a.vtk -o {output} --count 7 --axis {axis}"));
            }
        }
        let line =
            "render a.vtk -o a.png --size 32x32 --slices 300 --transfer haze.json --verify --report r.json";
        shop.done(line);
        let rmse = shop.json("r.json")["error"]["measured_rmse"].as_f64().expect("an error");
        println!("{vtk} {nodes:?}: rmse {rmse:.5} (limit 0.005)");
        assert!(rmse < 0.005, "{vtk} {nodes:?}: {rmse}");
    }
}

#[test]
fn a9_render_step_at_value_is_exact() {
    let shop = Workshop::new();
    // Labels in blocks; the step is at the value of one of them.
    let label = |i: usize| [0_u8, 1, 100, 200][(i % 16 / 8) + 2 * (i / 16 % 16 / 8)];
    let samples: Vec<u8> = (0..16 * 16 * 16).map(label).collect();
    let labels = VoxelGrid::new([16, 16, 16], DVec3::new(1.0, 0.7, 1.3), samples).expect("a grid");
    shop.write_volume("labels.nrrd", &labels);
    for value in [1, 100, 200] {
        let point =
            |level: f64| json!({"value": value, "color": [level, 0.5, 1.0 - level], "opacity": 0.9 * level});
        let transfer = json!({"points": [point(0.0), point(1.0)], "unit_distance": 1.0});
        shop.write("step.json", transfer.to_string());
        for technique in ["plane", "raycast"] {
            shop.done(&format!(
                "render labels.nrrd -o a.png --technique {technique} --transfer step.json --size 80x80 --backend software \
                 --verify --report r.json"
            ));
            let most = shop.json("r.json")["error"]["measured_max"].as_f64().expect("an error");
            let limit = if technique == "plane" { 0.002 } else { 0.01 };
            println!("{technique} at {value}: {most:.5} (limit {limit})");
            assert!(most < limit, "{technique} at {value}: {most}");
        }
    }
}

/// The largest difference of a channel of two pictures, in levels of 256.
fn distance(shop: &Workshop, names: [&str; 2]) -> f64 {
    let [a, b] = names.map(|name| {
        let volume = volery::io::read_volume(&shop.path(name), &volery::io::ReadOptions::default());
        volume.expect("a picture").grid
    });
    let places = (0..a.num_samples()).flat_map(|place| (0..3).map(move |channel| (place, channel)));
    let differ = |(place, channel)| a.samples().value(place, channel) - b.samples().value(place, channel);
    places.map(differ).fold(0.0, |most, difference: f64| most.max(difference.abs()))
}

/// A1 at the command line: left and right never change sides; by index they do, and not in silence.
#[test]
fn a1_files_are_drawn_the_right_way_round() {
    let shop = Workshop::new();
    let grid = head();
    let (dims, values) = (grid.dims(), grid.samples());
    let mut map = volery::glam::DAffine3::from_scale(grid.spacing());
    let ras = grid.clone().with_world_from_index(map).expect("axes that span space");
    // Index x runs to the left, from the right end.
    map.translation.x = grid.extent().x;
    map.matrix3.x_axis = -map.matrix3.x_axis;
    let place = |i: usize| i - i % dims[0] + dims[0] - 1 - i % dims[0];
    let backwards: Vec<i16> = (0..values.len()).map(|i| values.value(place(i), 0) as i16).collect();
    let las = volery::VoxelGrid::new(dims, grid.spacing(), backwards).expect("a grid");
    let las = las.with_world_from_index(map).expect("axes that span space");
    for (name, grid) in [("ras.nrrd", &ras), ("las.nrrd", &las)] {
        volery::io::write_nrrd(&shop.path(name), grid, volery::io::World::Anatomical).expect("a volume");
    }
    let size = "--size 24x24 --backend software";
    let picture = |options: &str, name: &str| {
        let said = shop.done(&format!("render {options} {size} -o {name}")).stdout;
        (said, shop.bytes(name))
    };
    let note = "note: the axes of the samples run to LAS; the picture is drawn along them, and so mirrored: left and \
                right change sides\n";
    for options in ["", "--view right", "--up 0,1,0.1", "--plane sagittal:60 --plane axial"] {
        let (said, _) = picture(&format!("ras.nrrd {options}"), "a.png");
        assert!(!said.contains("axes of the samples"), "{said}");
        let (said, _) = picture(&format!("las.nrrd {options}"), "b.png");
        assert!(distance(&shop, ["a.png", "b.png"]) <= 1.0, "{options}: another picture");
        assert!(!said.contains("axes of the samples"), "{said}");
        if options.contains("--plane") {
            continue;
        }
        let (said, _) = picture(&format!("las.nrrd {options} --orientation index"), "c.png");
        assert!(said.contains(note), "{said}");
        // From the front in place of from behind, at least.
        assert!(!options.is_empty() || distance(&shop, ["a.png", "c.png"]) > 50.0, "the same picture");
    }
    let info = shop.done("info las.nrrd").stdout;
    assert!(info.contains("axes      LAS\n"), "{info}");
    // Scenes ask for it, and those that the program writes do.
    shop.write("scene.json", r#"{"input": {"file": "las.nrrd"}}"#);
    assert!(picture("scene.json", "d.png").0.contains(note));
    picture("las.nrrd --view left --save-scene saved.json", "e.png");
    assert_eq!(shop.json("saved.json")["input"]["orientation"], "file");
    assert_eq!(picture("saved.json", "f.png").1, shop.bytes("e.png"));
}

#[test]
fn sides_and_slices_of_patients_need_a_patient() {
    let shop = Workshop::new();
    for (options, words) in [
        ("--view anterior", ["waves.nrrd: has no anatomical axes", "--view anterior"]),
        ("--plane coronal:3", ["waves.nrrd: has no anatomical axes", "--plane coronal"]),
    ] {
        shop.run_line(&format!("render waves.nrrd {options} -o a.png")).fails(1, &words);
    }
    for (options, words) in [
        ("--view fromt", ["--view", "front"]),
        ("--view front,0", ["--view", "zoom"]),
        ("--up 0,0,0", ["--up", "length above 0"]),
        ("--plane axial:x", ["--plane", "axial:POSITION"]),
    ] {
        let outcome = shop.run_line(&format!("render waves.nrrd {options} -o a.png"));
        assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
        assert!(words.iter().all(|word| outcome.stderr.contains(word)), "{}", outcome.stderr);
    }
    // The front of what is no patient is the side of low y, and up is where somebody says.
    shop.done("render waves.nrrd --view 0,0 --size 24x24 -o a.png --backend software");
    shop.done("render waves.nrrd --view front --size 24x24 -o b.png --backend software");
    assert_eq!(shop.bytes("a.png"), shop.bytes("b.png"));
    shop.done(
        "render waves.nrrd --view top --up 0,1,0 --size 24x24 -o a.png --backend software --report r.json",
    );
    let camera = shop.json("r.json")["camera"].clone();
    assert!(camera["up"][1].as_f64() > Some(0.99), "{camera}");
    assert!(camera["eye"][2].as_f64() > Some(60.0), "{camera}");
}
