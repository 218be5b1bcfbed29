//! Slices of grids, in files.

mod common;

use common::Workshop;
use volery::io::read_stack;

/// Two hexahedra one above the other, with two arrays.
const GRID: &str = "# vtk DataFile Version 3.0
two boxes
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 12 double
0 0 0 2 0 0 2 1 0 0 1 0 0 0 1 2 0 1 2 1 1 0 1 1 0 0 3 2 0 3 2 1 3 0 1 3
CELLS 2 18
8 0 1 2 3 4 5 6 7
8 4 5 6 7 8 9 10 11
CELL_TYPES 2
12 12
POINT_DATA 12
SCALARS heat double
LOOKUP_TABLE default
0 1 2 3 4 5 6 7 8 9 10 11
SCALARS load double
LOOKUP_TABLE default
5 5 5 5 5 5 5 5 9 9 9 9
";

fn workshop() -> Workshop {
    let shop = Workshop::new();
    shop.write("boxes.vtk", GRID);
    shop
}

#[test]
fn slices_are_written_and_counted() {
    let shop = workshop();
    for (name, more) in [("a.vsl", ""), ("a.glb", ""), ("b.glb", "--meshopt")] {
        // At heights 0.25, 0.75, ... there is one rectangle each.
        let said = shop.done(&format!("slice boxes.vtk -o {name} --count 6 --axis z {more}")).stdout;
        for words in ["array      heat", "planes     6, 5.000000e-1 apart", "polygons   6\n"] {
            assert!(said.contains(words), "no {words:?} in {said}");
        }
        // Four corners of 28 bytes; four vertices of 12 and four numbers of 4.
        assert!(said.contains(&format!("float      {:>12} bytes 100.00 %", 6 * 4 * 28)), "{said}");
        assert!(said.contains(&format!("indexed    {:>12} bytes", 6 * 4 * 16)), "{said}");
        let bytes = shop.bytes(name).len();
        assert!(said.contains(&format!("file       {bytes:>12} bytes")), "{bytes}: {said}");
        let mesh = read_stack(&shop.path(name), 1 << 20).expect("it is read back");
        let slices: Vec<_> = mesh.sheets.iter().filter(|sheet| sheet.thickness[1] == 0.0).collect();
        assert_eq!(slices.len(), 6);
        assert!(slices.iter().all(|sheet| sheet.thickness[0] == 0.5 && sheet.triangles.len() == 2));
    }
}

#[test]
fn the_axis_and_the_array_are_taken() {
    let shop = workshop();
    let said = shop.done("slice boxes.vtk -o a.vsl --count 4 --axis -3,0,0 --array load").stdout;
    assert!(said.contains("array      load") && said.contains("planes     4, 5.000000e-1 apart"), "{said}");
    let mesh = read_stack(&shop.path("a.vsl"), 1 << 20).expect("it is read back");
    assert_eq!(mesh.normal.to_array(), [-1.0, 0.0, 0.0]);
    let values = mesh.to_mesh().points.into_iter().map(|point| point[3]);
    let [low, high] = values.fold([9.0f32, 5.0], |[low, high], value| [low.min(value), high.max(value)]);
    assert_eq!([low, high], [5.0, 9.0]);
}

#[test]
fn what_cannot_be_sliced_leaves_nothing() {
    let shop = workshop();
    shop.write("empty.vtk", "");
    let fails = |line: &str, code: i32, words: &[&str]| {
        let before = shop.names();
        shop.run_line(line).fails(code, words);
        assert_eq!(shop.names(), before, "volery {line} left something behind");
    };
    for (line, words) in [
        ("slice boxes.vtk", &["-o", "required"][..]),
        ("slice boxes.vtk -o a.obj", &["a.obj", ".glb or .vsl"]),
        ("slice boxes.vtk -o a.vsl --count 0", &["--count"]),
        ("slice boxes.vtk -o a.vsl --axis w", &["'w'", "NX,NY,NZ"]),
        ("slice boxes.vtk -o a.vsl --axis 0,0,0", &["0,0,0", "length above 0"]),
        ("slice boxes.vtk -o a.vsl --axis 1,nan,0", &["NX,NY,NZ"]),
    ] {
        fails(line, 2, words);
    }
    for (line, words) in [
        ("slice none.vtk -o a.vsl", &["none.vtk"][..]),
        ("slice empty.vtk -o a.vsl", &["empty.vtk", "is empty"]),
        ("slice waves.nrrd -o a.vsl", &["waves.nrrd", ".vtu"]),
        ("slice boxes.vtk -o a.vsl --array cold", &["boxes.vtk", "cold", "heat"]),
        ("slice boxes.vtk -o none/a.glb", &["none/a.glb", "cannot be written"]),
    ] {
        fails(line, 1, words);
    }
}
