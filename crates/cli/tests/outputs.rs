//! What a run writes is nothing that it reads and nothing twice; and it is whole or not there.
#![cfg(unix)]

mod common;

use std::collections::BTreeMap;
use std::os::unix::fs::symlink;
use std::path::Path;

use common::{Workshop, legacy_grid, scene_json};

/// Every file of a folder and what is in it, folders in it too; links as what they lead to.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("a folder to write in") {
        let path = entry.expect("a folder to write in").path();
        let name = path.file_name().expect("a folder to write in").to_string_lossy().into_owned();
        if path.is_dir() {
            found
                .extend(contents(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
        } else {
            // A link to nowhere has no content.
            found.insert(name, std::fs::read(&path).unwrap_or_default());
        }
    }
    found
}

/// A run that must be refused changes nothing.
#[track_caller]
fn refused(shop: &Workshop, line: &str, words: &[&str]) {
    let before = contents(&shop.path(""));
    let outcome = shop.run_line(line);
    assert!(matches!(outcome.code, Some(1 | 2)), "volery {line}: {:?} {}", outcome.code, outcome.stdout);
    outcome.fails(outcome.code.expect("a folder to write in"), words);
    assert!(contents(&shop.path("")) == before, "volery {line} changed something");
}

/// Every kind of input there is.
fn workshop() -> Workshop {
    let shop = Workshop::new();
    shop.write("v_4x4x4_uint8.raw", (0..64).collect::<Vec<u8>>());
    shop.write("t.json", scene_json("x")["transfer_function"].to_string());
    shop.write("hull.obj", "v 5 5 5\nv 30 5 5\nv 5 30 9\nf 1 2 3\n");
    let mut scene = scene_json("waves.nrrd");
    scene["meshes"] = serde_json::json!([{"file": "hull.obj", "color": [1, 0, 0]}]);
    shop.write("s.json", scene.to_string());
    shop.write("data.bin", (0..64).collect::<Vec<u8>>());
    shop.write(
        "h.nhdr",
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: data.bin\n\n",
    );
    shop.write("ring.vtk", legacy_grid(1.0, usize::MAX));
    shop.write("late.vtk", legacy_grid(0.5, usize::MAX));
    shop.write(
        "a.pvd",
        "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"0\" file=\"ring.vtk\"/>\
         <DataSet timestep=\"1\" file=\"late.vtk\"/></Collection></VTKFile>",
    );
    std::fs::create_dir(shop.path("slices")).expect("a folder to write in");
    for name in ["slices/00.png", "slices/01.png"] {
        volery::io::write_png(&shop.path(name), 5, 4, &[[0.5, 0.2, 0.1]; 20]).expect("a folder to write in");
    }
    shop
}

/// A run and its inputs.
const RUNS: [(&str, &[&str]); 6] = [
    ("render v_4x4x4_uint8.raw --size 8x8", &["v_4x4x4_uint8.raw"]),
    ("render waves.nrrd --transfer t.json --size 8x8", &["waves.nrrd", "t.json"]),
    ("render s.json --size 8x8", &["s.json", "waves.nrrd", "hull.obj"]),
    ("render h.nhdr --size 8x8", &["h.nhdr", "data.bin"]),
    ("render ring.vtk --size 8x8", &["ring.vtk"]),
    ("render slices --size 8x8", &["slices/00.png", "slices/01.png"]),
];

#[test]
fn no_output_of_a_picture_is_an_input_by_any_name() {
    let shop = workshop();
    let mut num_tried = 0;
    for (line, inputs) in RUNS {
        for input in inputs {
            let full = shop.path(input);
            for (option, ending) in [
                ("-o", "png"),
                ("-o", "exr"),
                ("--error-map", "png"),
                ("--report", "json"),
                ("--save-scene", "json"),
            ] {
                let [soft, hard] = ["soft", "hard"].map(|name| format!("{name}.{ending}"));
                symlink(&full, shop.path(&soft)).unwrap();
                std::fs::hard_link(&full, shop.path(&hard)).unwrap();
                let own =
                    Path::new(input).extension().is_some_and(|own| own == ending) || option == "--report";
                let plain =
                    own.then(|| vec![(*input).to_owned(), format!("./{input}"), full.display().to_string()]);
                for name in plain.unwrap_or_default().into_iter().chain([soft.clone(), hard.clone()]) {
                    let output = if option == "-o" { "" } else { "-o new.png" };
                    let words = [option, "is the input"];
                    refused(&shop, &format!("{line} {output} {option} {name}"), &words);
                    num_tried += 1;
                }
                for name in [soft, hard] {
                    std::fs::remove_file(shop.path(name)).unwrap();
                }
            }
        }
    }
    assert!(num_tried > 100, "{num_tried}");
}

#[test]
fn no_two_outputs_are_one_file() {
    let shop = workshop();
    symlink(shop.path("there.png"), shop.path("dangling.png")).unwrap();
    shop.write("old.json", "old");
    symlink("old.json", shop.path("link.json")).unwrap();
    std::fs::create_dir(shop.path("steps")).unwrap();
    symlink("../old.json", shop.path("steps/00.json")).unwrap();
    let line = "render waves.nrrd --size 8x8";
    for options in [
        "-o a.png --error-map a.png",
        "-o a.png --error-map ./a.png",
        "-o a.png --report a.png",
        "-o a.png --report old.json --save-scene old.json",
        "-o a.png --report old.json --save-scene link.json",
        "-o a.png --report r.json --save-scene slices/../r.json",
        "-o steps/03.png --progressive steps",
        "-o a.png --report steps/1.json --progressive steps",
        "-o a.png --report old.json --progressive steps",
        "-o a.png --error-map a%d.png --frames 3",
        "-o a%d.png --error-map a1.png --frames 3",
    ] {
        refused(&shop, &format!("{line} {options}"), &[]);
    }
    let line = "render ring.vtk --size 8x8 --time-steps a.pvd";
    refused(&shop, &format!("{line} -o a%d.png --report a%d.png"), &["--report", "-o"]);
    refused(&shop, &format!("{line} -o a%d.png --error-map ./a%d.png"), &["--error-map", "-o"]);
}

#[test]
fn pictures_on_the_way_and_steps_and_slices_are_no_inputs() {
    let shop = workshop();
    std::fs::create_dir(shop.path("steps")).unwrap();
    symlink(shop.path("waves.nrrd"), shop.path("steps/02.png")).unwrap();
    refused(
        &shop,
        "render waves.nrrd --size 8x8 -o a.png --progressive steps",
        &["--progressive", "waves.nrrd"],
    );
    let slices = "render slices --size 8x8 --technique plane";
    refused(&shop, &format!("{slices} -o a.png --progressive slices"), &["--progressive", "slices"]);
    refused(&shop, &format!("{slices} -o slices/02.png"), &["-o", "a new slice"]);
    symlink(shop.path("late.vtk"), shop.path("r1.json")).unwrap();
    let line = "render ring.vtk --size 8x8 --time-steps a.pvd -o a%d.png --report r%d.json";
    refused(&shop, line, &["--report", "late.vtk"]);
    symlink(shop.path("ring.vtk"), shop.path("ring.vsl")).unwrap();
    refused(&shop, "slice ring.vtk -o ring.vsl --count 4", &["-o", "ring.vtk"]);
    // Pieces that a file names.
    let piece = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\
         <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">0 0 0 1 0 0 0 1 0 0 0 1</DataArray>\
         </Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">0 1 2 3</DataArray>\
         <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">4</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">10</DataArray></Cells>\
         <PointData><DataArray type=\"Float32\" Name=\"p\" format=\"ascii\">1 2 3 4</DataArray></PointData>\
         </Piece></UnstructuredGrid></VTKFile>";
    shop.write("piece.vtu", piece);
    shop.write(
        "all.pvtu",
        "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"piece.vtu\"/></PUnstructuredGrid></VTKFile>",
    );
    symlink(shop.path("piece.vtu"), shop.path("out.glb")).unwrap();
    refused(&shop, "slice all.pvtu -o out.glb --count 4", &["-o", "piece.vtu"]);
    refused(&shop, "render all.pvtu -o a.png --report piece.vtu", &["--report", "piece.vtu"]);
    // A demo writes many pictures: two names of one file are refused, another file is left alone.
    std::fs::create_dir(shop.path("demo")).unwrap();
    shop.write("demo/contact-sheet.png", "mine");
    symlink("contact-sheet.png", shop.path("demo/head-full-resolution.png")).unwrap();
    refused(&shop, "demo -o demo --backend software", &["-o"]);
}

#[test]
fn what_has_nothing_to_lose_is_written() {
    let shop = workshop();
    let before = contents(&shop.path(""));
    symlink("/dev/null", shop.path("null.png")).unwrap();
    symlink("/dev/null", shop.path("null.json")).unwrap();
    let line = "render waves.nrrd --size 8x8 -o null.png --error-map null.png --report null.json --save-scene null.json";
    shop.done(line);
    for link in ["null.png", "null.json"] {
        assert!(std::fs::symlink_metadata(shop.path(link)).unwrap().is_symlink());
        std::fs::remove_file(shop.path(link)).unwrap();
    }
    assert!(contents(&shop.path("")) == before);
    // Names that are alike and places that are apart.
    std::fs::create_dir(shop.path("pictures")).unwrap();
    let apart = "-o pictures/00.png --error-map 00.png --progressive steps --report pictures/00.json";
    shop.done(&format!("render waves.nrrd --size 8x8 {apart}"));
}

#[test]
fn places_where_nothing_can_be_written_are_found_before_drawing() {
    let shop = workshop();
    let line = "render waves.nrrd --size 8x8";
    for (options, words) in [
        ("-o nowhere/a.png", &["-o nowhere/a.png", "folder nowhere does not exist"][..]),
        ("-o a.png --report nowhere/r.json", &["--report nowhere/r.json", "does not exist"]),
        ("-o a.png --error-map slices", &["slices"]),
        ("-o a.png --error-map waves.nrrd/a.png", &["waves.nrrd"]),
        ("-o a.png --save-scene slices/x/s.json", &["slices/x"]),
        ("-o a.png --progressive waves.nrrd", &["waves.nrrd", "expected a folder"]),
        ("-o a.png --progressive t.json/steps", &["t.json", "expected a folder"]),
        ("-o a.png --report slices", &["--report slices", "folder"]),
    ] {
        refused(&shop, &format!("{line} {options}"), words);
    }
    refused(&shop, "slice ring.vtk -o nowhere/a.vsl", &["-o nowhere/a.vsl"]);
    refused(&shop, "demo -o waves.nrrd", &["waves.nrrd", "expected a folder"]);
    std::fs::create_dir(shop.path("taken.png")).unwrap();
    refused(&shop, &format!("{line} -o taken.png"), &["taken.png", "folder"]);
}

#[test]
fn a_full_disk_leaves_nothing() {
    let shop = workshop();
    symlink("/dev/full", shop.path("full.png")).unwrap();
    let outcome = shop.run_line("render waves.nrrd --size 64x64 -o full.png");
    outcome.fails(1, &["full.png", "No space left"]);
    let limited = |blocks: u32, line: &str| {
        let program = env!("CARGO_BIN_EXE_volery");
        let script = format!("ulimit -f {blocks}; exec {program} {line}");
        let done = std::process::Command::new("sh").args(["-c", &script]).current_dir(shop.path("")).output();
        let output = done.unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let before = shop.names();
    for line in [
        "render waves.nrrd --size 512x512 --backend software -o a.exr",
        "render waves.nrrd --size 512x512 --backend software --view 30,20,3 -o a.png",
        "slice ring.vtk --count 400 -o a.glb",
        "slice ring.vtk --count 400 -o a.vsl",
    ] {
        let (code, said) = limited(2, line);
        assert_eq!((code, said.lines().count()), (Some(1), 1), "{line}: {said}");
        assert!(said.contains("File too large"), "{line}: {said}");
        assert_eq!(shop.names(), before, "{line}");
    }
}

#[test]
fn frames_with_a_place_for_their_number_are_a_series() {
    let shop = workshop();
    let line = "render waves.nrrd --size 9x9";
    shop.done(&format!("{line} -o x-%03d.png --frames 4 --report r.json"));
    let names: Vec<_> = shop.names().into_iter().filter(|name| name.starts_with("x-")).collect();
    assert_eq!(names, ["x-000.png", "x-001.png", "x-002.png", "x-003.png"]);
    shop.done(&format!("{line} -o one.png"));
    assert!(names.iter().all(|name| shop.bytes(name) == shop.bytes("one.png")));
    assert_eq!(shop.json("r.json")["frames"].as_array().unwrap().len(), 4);
    for options in [
        "-o x-%03d.png",
        "-o x-%3d.png --frames 4",
        "-o %d-%d.png --frames 2",
        "-o a.png --frames 4 --report r%d.json",
        "-o a.png --save-scene s%02d.json",
    ] {
        refused(&shop, &format!("{line} {options}"), &["%"]);
    }
}
