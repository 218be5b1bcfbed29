//! Grids: every encoding, VTK's own files, pieces, ghosts, and what is refused.

use std::path::Path;

use volery_io::ByteOrder::Big;
use volery_io::grid::{ArrayRange, Place, read_array_ranges};
use volery_io::{GridFile, GridOptions, is_grid, read_grid};
use volery_scene::CellType::{Hexahedron, Pyramid, Tetrahedron, Voxel, Wedge};

use crate::Folder;
use crate::make::{ORDERS, VTI_DATA};
use crate::make_grid::{ASCII, CELLS, Form, Packing, exodus, points, usual_vtu};

/// What VTK 9.7 wrote (see `vtk/make.py`): all hold the same grid.
const BY_VTK: [(&str, &[u8]); 8] = [
    ("ascii.vtu", include_bytes!("vtk/ascii.vtu")),
    ("lz4_inline_wide.vtu", include_bytes!("vtk/lz4_inline_wide.vtu")),
    ("lzma_raw.vtu", include_bytes!("vtk/lzma_raw.vtu")),
    ("lzma_base64_big_wide.vtu", include_bytes!("vtk/lzma_base64_big_wide.vtu")),
    ("ascii_42.vtk", include_bytes!("vtk/ascii_42.vtk")),
    ("ascii_51.vtk", include_bytes!("vtk/ascii_51.vtk")),
    ("binary_42.vtk", include_bytes!("vtk/binary_42.vtk")),
    ("binary_51.vtk", include_bytes!("vtk/binary_51.vtk")),
];

fn of(array: &str) -> GridOptions {
    GridOptions { array: Some(array.to_owned()), ..GridOptions::default() }
}

#[track_caller]
fn read(path: &Path, options: &GridOptions) -> GridFile {
    read_grid(path, options).unwrap_or_else(|error| panic!("{error}"))
}

/// Reads a grid that must be refused in one line that starts with its path; returns the rest.
#[track_caller]
fn refuse(path: &Path, options: &GridOptions) -> String {
    let line = match read_grid(path, options) {
        Ok(file) => panic!("{} was read: {file:?}", path.display()),
        Err(error) => error.to_string(),
    };
    assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    let rest = line.strip_prefix(&format!("{}: ", path.display()));
    rest.unwrap_or_else(|| panic!("{line} does not name the file")).to_owned()
}

fn values(file: &GridFile) -> Vec<f64> {
    let array = &file.grid.arrays()[0];
    (0..array.values.len()).map(|i| array.values.value(i, 0)).collect()
}

/// The cells of `vtk/make.py` that have volume, with their corners.
#[track_caller]
fn assert_usual_cells(file: &GridFile) {
    let found: Vec<f64> = file.grid.points().iter().flat_map(|point| point.to_array()).collect();
    assert_eq!(found, points());
    let types = [Hexahedron, Voxel, Tetrahedron, Pyramid, Wedge, Tetrahedron];
    assert_eq!(file.grid.cells().types(), types);
    for ((cell_type, nodes), (_, expected)) in file.grid.cells().iter().zip(CELLS) {
        let expected: Vec<u32> =
            expected.iter().take(cell_type.num_nodes()).map(|&node| node as u32).collect();
        assert_eq!(nodes, expected);
    }
    assert!(file.notes.contains(&"cells read by their corner nodes: 1 quadratic tetrahedron".to_owned()));
    let left_out = "cells of types that are not read, left out: 1 triangle, 1 pixel".to_owned();
    assert!(file.notes.contains(&left_out), "{:?}", file.notes);
}

#[test]
fn files_that_vtk_wrote_in_every_form_hold_the_same_grid() {
    let folder = Folder::new();
    for (name, bytes) in BY_VTK {
        let path = folder.put(name, bytes);
        assert!(is_grid(&path));
        let file = read(&path, &of("p"));
        println!("{name}: {:?}", file.grid);
        assert_usual_cells(&file);
        assert_eq!(values(&file), (0..12).map(|i| 1.5 * f64::from(i)).collect::<Vec<_>>());
        assert_eq!(read(&path, &GridOptions::default()).array.unwrap().name, "p");
        let velocity = read(&path, &of("velocity"));
        let expected = |i: u32| f64::from(2 * i * i + 4).sqrt();
        let worst = values(&velocity).into_iter().zip(0..).map(|(found, i)| (found - expected(i)).abs());
        let worst = worst.fold(0.0, f64::max);
        println!("magnitude differs by {worst:e}, at most 1e-14");
        assert!(worst <= 1e-14);
        assert!(velocity.notes[0].contains("3 components; its magnitude"), "{:?}", velocity.notes);
        assert_averages(&read(&path, &of("q r")));
    }
}

/// The mean of the cells of volume around each node, by asking every cell for every node.
#[track_caller]
fn assert_averages(file: &GridFile) {
    assert!(file.notes[0].contains("averaged to the points"), "{:?}", file.notes);
    for (node, value) in values(file).into_iter().enumerate() {
        let around = CELLS.iter().enumerate().take(6).filter(|(_, (vtk, nodes))| {
            nodes.iter().take(if *vtk == 24 { 4 } else { 8 }).any(|&other| other == node as i64)
        });
        let found: Vec<f64> = around.map(|(cell, _)| 10.0 * cell as f64).collect();
        let expected = found.iter().sum::<f64>() / found.len() as f64;
        assert_eq!(value, expected, "node {node}");
    }
}

#[test]
fn every_type_order_encoding_compression_and_header_width() {
    let folder = Folder::new();
    let types =
        ["UInt8", "Int8", "UInt16", "Int16", "UInt32", "Int32", "UInt64", "Int64", "Float32", "Float64"];
    let numbers: Vec<f64> = (0..12).map(|i| f64::from(i * i)).collect();
    let mut files = 0;
    for data in VTI_DATA {
        for order in ORDERS {
            for packing in [Packing::None, Packing::Zlib, Packing::Lz4] {
                for wide in [false, true] {
                    let form = Form { data, order, packing, wide };
                    for type_name in types {
                        let arrays = [("Name=\"n\"", type_name, numbers.clone())];
                        let path = folder.put("a.vtu", form.vtu(&CELLS, &arrays, &[]));
                        let file = read(&path, &GridOptions::default());
                        assert_usual_cells(&file);
                        assert_eq!(values(&file), numbers, "{form:?} {type_name}");
                        files += 1;
                    }
                }
            }
        }
    }
    assert_eq!(files, 480);
}

#[test]
fn ranges_of_all_arrays() {
    let folder = Folder::new();
    for (name, bytes) in BY_VTK {
        let mut ranges = read_array_ranges(&folder.put(name, bytes), &GridOptions::default()).unwrap();
        ranges.sort_by(|a, b| a.array.name.cmp(&b.array.name));
        let [p, q, velocity] = ranges.as_slice() else { panic!("{ranges:?}") };
        assert_eq!((p.range, p.array.scalar, p.array.place), (Some([0.0, 16.5]), "f32", Place::Points));
        assert_eq!((q.range, q.array.name.as_str(), q.array.place), (Some([0.0, 70.0]), "q r", Place::Cells));
        assert_eq!((velocity.range.unwrap()[0], velocity.array.components), (2.0, 3));
    }
    let blank = vec![f64::NAN; 12];
    let path = folder.put("a.vtu", ASCII.vtu(&CELLS, &[("Name=\"n\"", "Float64", blank)], &[]));
    let ranges = read_array_ranges(&path, &GridOptions::default()).unwrap();
    assert!(matches!(ranges[0], ArrayRange { range: None, blank: 12, .. }), "{ranges:?}");
}

/// A cut file is refused, or nothing of what was asked for is lost.
#[test]
fn truncated_at_every_byte() {
    let folder = Folder::new();
    let mut files: Vec<(&str, Vec<u8>)> =
        BY_VTK.iter().map(|(name, bytes)| (*name, bytes.to_vec())).collect();
    for data in VTI_DATA {
        for packing in [Packing::None, Packing::Lz4] {
            files.push(("a.vtu", usual_vtu(Form { data, order: Big, packing, wide: true })));
        }
    }
    for (name, file) in files {
        let (mut refused, mut whole) = (0, 0);
        for cut in 1..file.len() {
            // A number cut short is another number, if the text ends there.
            if name.starts_with("ascii") && name.ends_with("vtk") && !file[cut - 1].is_ascii_whitespace() {
                continue;
            }
            let path = folder.put(name, &file[..cut]);
            match read_grid(&path, &of("p")) {
                Err(_) => refused += 1,
                Ok(found) => {
                    whole += 1;
                    assert_usual_cells(&found);
                    assert_eq!(values(&found), (0..12).map(|i| 1.5 * f64::from(i)).collect::<Vec<_>>());
                }
            }
        }
        println!("{name}: {refused} refused, {whole} whole of {} bytes", file.len());
        assert!(refused > whole / 2, "{name}");
    }
}

/// What to replace by what in the ascii file, and how the refusal begins.
const VTU_LIES: &[(&str, &str, &str)] = &[
    ("type=\"UnstructuredGrid\"", "type=\"PolyData\"", "type is 'PolyData', expected UnstructuredGrid"),
    ("NumberOfPoints=\"12\"", "", "NumberOfPoints is missing"),
    ("NumberOfPoints=\"12\"", "NumberOfPoints=\"-1\"", "NumberOfPoints is '-1', expected a whole number"),
    (
        "NumberOfPoints=\"12\"",
        "NumberOfPoints=\"11\"",
        "connectivity: node is 11, expected 0 or more and below 11",
    ),
    (
        "NumberOfPoints=\"12\"",
        "NumberOfPoints=\"13\"",
        "Points: count of numbers in the array is 36, expected 39",
    ),
    (
        "NumberOfPoints=\"12\"",
        "NumberOfPoints=\"18446744073709551615\"",
        "number of points is 18446744073709551615, expected at most 2147483648",
    ),
    (
        "NumberOfCells=\"8\"",
        "NumberOfCells=\"0\"",
        "number of cells is 0, expected at least one that has volume",
    ),
    ("NumberOfCells=\"8\"", "NumberOfCells=\"9\"", "offsets: count of numbers in the array is 8, expected 9"),
    (
        "NumberOfCells=\"8\"",
        "NumberOfCells=\"7\"",
        "offsets: count of numbers in the array is more, expected 7",
    ),
    (
        "NumberOfCells=\"8\"",
        "NumberOfCells=\"9999999999999\"",
        "number of cells is 9999999999999, expected at most",
    ),
    (">8 16 20", ">-8 16 20", "offsets: end of a cell is -8, expected 0 to "),
    (">8 16 20", ">8 16 2", "offsets: end of a cell is 2, expected 16 to "),
    (">8 16 20", ">8 2000000000 20", "offsets: end of a cell is 20, expected 2000000000 to "),
    (" 44 48<", " 44 49<", "connectivity: count of numbers in the array is 48, expected 49"),
    (" 44 48<", " 44 47<", "connectivity: count of numbers in the array is more, expected 47"),
    (">8 16 20", ">7 16 20", "number of nodes of cell 0 (hexahedron) is 7, expected 8"),
    (">0 1 4 3", ">0 1 12 3", "connectivity: node is 12, expected 0 or more and below 12"),
    (">0 1 4 3", ">0 -1 4 3", "connectivity: node is -1, expected 0 or more and below 12"),
    (">0 1 4 3", ">0 1.5 4 3", "connectivity: the data of the array is '1.5', expected a number of its type"),
    (">12 11 10", ">12 11 256", "types: the data of the array is '256'"),
    ("\"connectivity\"", "\"conn\"", "connectivity is missing"),
    ("type=\"Int64\"", "type=\"Float32\"", "connectivity: type of the array is f32, expected whole numbers"),
    ("type=\"Int64\"", "type=\"String\"", "connectivity: type of DataArray is 'String'"),
    ("NumberOfComponents=\"3\"", "NumberOfComponents=\"2\"", "Points: NumberOfComponents is 2, expected 3"),
    ("NumberOfComponents=\"3\"", "", "Points: NumberOfComponents is missing, expected 3"),
    ("<Points>", "<Point>", "the XML is damaged"),
    ("Name=\"p\"", "Name=\"r\"", "array is 'p', expected one of r"),
    ("Name=\"p\"", "Name=\"p\" NumberOfComponents=\"0\"", "p: NumberOfComponents is 0"),
    (
        "Name=\"p\"",
        "Name=\"p\" NumberOfComponents=\"2\"",
        "p: count of numbers in the array is 12, expected 24",
    ),
];

#[test]
fn vtu_files_that_lie() {
    let folder = Folder::new();
    let file = String::from_utf8(usual_vtu(ASCII)).unwrap();
    for &(from, to, expected) in VTU_LIES {
        assert!(file.contains(from), "{from}");
        let line = refuse(&folder.put("a.vtu", file.replacen(from, to, 1)), &of("p"));
        // What is left of a name is closed by another tag.
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let flat = ASCII.vtu(&CELLS[6..], &[], &[]);
    let line = refuse(&folder.put("a.vtu", flat), &GridOptions::default());
    assert!(line.starts_with("number of cells is 0 (cells of types that are not read, left out: 1 triangle"));
    let limited = GridOptions { max_bytes: 500, ..GridOptions::default() };
    let line = refuse(&folder.put("a.vtu", file), &limited);
    assert!(line.starts_with("offsets: end of a cell is 20, expected 16 to 19"), "{line}");
    assert!(refuse(&folder.path("none.vtu"), &limited).starts_with("cannot be read: "));
    let line = refuse(&folder.put("a.txt", "hello"), &limited);
    assert!(line.starts_with("file name is 'a.txt', expected one that ends in .vtu"), "{line}");
}

/// The same for the legacy file in text, of version 4.2 and of 5.1.
const LEGACY_LIES: &[(&str, &str, &str, &str)] = &[
    ("42", "# vtk", "# VTK", "first line is missing"),
    ("42", "ASCII", "HEX", "form is 'HEX', expected ASCII or BINARY"),
    ("42", "UNSTRUCTURED_GRID", "POLYDATA", "DATASET is 'POLYDATA', expected UNSTRUCTURED_GRID"),
    ("42", "DATASET UNSTRUCTURED_GRID", "", "DATASET is missing"),
    ("42", "POINTS 12", "POINTS 11", "keyword is '2', expected POINTS"),
    ("42", "POINTS 12", "POINTS -12", "POINTS is '-12', expected a whole number"),
    ("42", "POINTS 12", "POINTS 9999999999999999999", "POINTS: count of numbers is 9999999999999999999"),
    ("42", "POINTS 12 double", "POINTS 12 quad", "type of an array is 'quad'"),
    ("42", "CELLS 8 56", "CELLS 8 57", "keyword is '8', expected POINTS"),
    ("42", "CELLS 8 56", "CELLS 7 56", "CELL_DATA is 8, expected 7"),
    ("42", "\n8 0 1 4 3", "\n9 0 1 4 3", "number of nodes of cell 1 (voxel) is 1, expected 8"),
    ("42", "\n8 0 1 4 3", "\n-8 0 1 4 3", "CELLS: number of nodes of cell 0 is -8, expected 0 or more"),
    ("42", "\n8 0 1 4 3", "\n8 0 1 12 3", "CELLS: node is 12, expected 0 or more and below 12"),
    ("42", "CELL_TYPES 8\n12", "CELL_TYPES 8\n300", "CELL_TYPES: type of a cell is 300, expected 0 to 255"),
    ("42", "CELL_TYPES 8\n12\n", "CELL_TYPES 7\n", "CELL_TYPES is 7, expected 8"),
    ("42", "POINT_DATA 12", "POINT_DATA 13", "POINT_DATA is 13, expected 12"),
    ("42", "LOOKUP_TABLE default", "", "word after SCALARS is '0', expected LOOKUP_TABLE"),
    (
        "42",
        "velocity 3 12 float",
        "velocity 3 11 float",
        "velocity: array is 11 tuples of 3, expected 12 tuples",
    ),
    ("42", "FieldData 1\nvelocity", "FieldData 2\nvelocity", "name of an array in FIELD is missing"),
    ("51", "\n0 8 16", "\n1 8 16", "CELLS: first offset is 1, expected 0"),
    ("51", "\n0 8 16", "\n0 -8 16", "CELLS: end of a cell is -8, expected 0 to"),
    ("51", "44 48", "44 47", "CELLS: last offset is 47, expected 48"),
    ("51", "CONNECTIVITY", "CONNECTION", "CELLS: list of cells is 'CONNECTION', expected CONNECTIVITY"),
    ("51", "\n0 1 4 3", "\n0 1 -4 3", "CELLS: node is -4, expected 0 or more and below 12"),
];

#[test]
fn legacy_files_that_lie() {
    let folder = Folder::new();
    for &(version, from, to, expected) in LEGACY_LIES {
        let (_, bytes) = BY_VTK.iter().find(|(name, _)| *name == format!("ascii_{version}.vtk")).unwrap();
        let file = std::str::from_utf8(bytes).unwrap();
        assert!(file.contains(from), "{version}: {from}");
        let line = refuse(&folder.put("a.vtk", file.replacen(from, to, 1)), &of("p"));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
}

#[test]
fn legacy_sections_that_hold_no_array_are_passed() {
    let folder = Folder::new();
    let text = "# vtk DataFile Version 3.0\nany title\nASCII\nDATASET UNSTRUCTURED_GRID\n\
        FIELD FieldData 2\nTIME 1 1 double\n0.5\nnames 1 2 string\nfirst%20name\nsecond\n\
        POINTS 4 float\n0 0 0 1 0 0\n0 1 0 0 0 1\nMETADATA\nINFORMATION 1\nNAME L2 LOCATION x\nDATA 2 0 1\n\n\
        CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 4\nLOOKUP_TABLE table 2\n0 0 0 1 1 1 1 1\n\
        COLOR_SCALARS c 3\n0 0 0 0 0 0 0 0 0 1 1 1\nscalars bits%2Bx bit 1\nlookup_table default\n0 1 0 1\n\
        SCALARS a%25b int 1\nLOOKUP_TABLE default\n4 3 2 1\nVECTORS v double\n0 0 3 0 4 0 0 0 0 0 3 4\n\
        TENSORS t float\n0 0 0 0 0 0 0 0 0 1 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 2\n";
    let path = folder.put("a.vtk", text);
    let file = read(&path, &GridOptions::default());
    assert_eq!(file.array.as_ref().unwrap().name, "a%b");
    assert_eq!(values(&file), [4.0, 3.0, 2.0, 1.0]);
    assert_eq!(values(&read(&path, &of("v"))), [3.0, 4.0, 0.0, 5.0]);
    assert_eq!(values(&read(&path, &of("t"))), [0.0, 1.0, 0.0, 2.0]);
    // The same behind a carriage return.
    let path = folder.put("a.vtk", text.replace('\n', "\r\n"));
    assert_eq!(values(&read(&path, &GridOptions::default())), [4.0, 3.0, 2.0, 1.0]);
}

#[test]
fn ghosts_are_left_out_but_count_for_averages_and_hidden_and_valueless_cells_are_blank() {
    let folder = Folder::new();
    let cells = [CELLS[2]; 4];
    let arrays = [
        ("Name=\"vtkGhostType\"", "UInt8", vec![0.0, 1.0, 32.0, 0.0]),
        ("Name=\"q\"", "Float32", vec![1.0, 2.0, 6.0, f64::NAN]),
    ];
    let file = read(&folder.put("a.vtu", ASCII.vtu(&cells, &[], &arrays)), &GridOptions::default());
    assert_eq!(file.array.as_ref().unwrap().name, "q");
    assert_eq!(file.grid.cells().len(), 3);
    assert_eq!([0, 1, 2].map(|cell| file.grid.is_blank(cell)), [false, true, true]);
    assert_eq!(values(&file)[0], 3.0);
    assert!(values(&file)[2].is_nan());
    let said = file.notes.join("; ");
    for words in ["1 cells are copies", "1 cells are hidden", "1 cells have no finite value"] {
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn pieces_are_joined() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("parts")).unwrap();
    let pvtu = "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid GhostLevel=\"0\">\
        <PPointData><PDataArray type=\"Float32\" Name=\"p\"/></PPointData>\
        <Piece Source=\"parts/0.vtu\"/><Piece Source=\"parts/1.vtu\"/><Piece Source=\"parts/2.vtu\"/>\
        </PUnstructuredGrid></VTKFile>";
    let path = folder.put("a.pvtu", pvtu);
    let empty = "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>\
        <Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"/></UnstructuredGrid></VTKFile>";
    folder.put("parts/0.vtu", empty);
    folder.put("parts/1.vtu", BY_VTK[2].1);
    folder.put("parts/2.vtu", usual_vtu(ASCII));
    // Equal points with equal values are one, so that the pieces hang together.
    let file = read(&path, &GridOptions::default());
    assert_eq!((file.grid.points().len(), file.grid.cells().len()), (12, 12));
    assert_eq!(file.grid.cells().get(6).1, file.grid.cells().get(0).1);
    assert!(
        file.notes.contains(&"12 points that several pieces share are one each".to_owned()),
        "{:?}",
        file.notes
    );
    let text = String::from_utf8(usual_vtu(ASCII)).unwrap();
    folder.put("parts/2.vtu", text.replace(">0 1.5 3 4.5", ">0 1.5 2 4.5"));
    let file = read(&path, &GridOptions::default());
    assert_eq!((file.grid.points().len(), file.grid.cells().len()), (13, 12));
    assert_eq!(file.grid.cells().get(7).1, [1, 12, 4, 5, 7, 8, 10, 11]);
    assert_eq!(values(&file), [(0..12).map(|i| 1.5 * f64::from(i)).collect(), vec![2.0]].concat());
    // Two points of one piece at one position are a cut in the grid, and stay two.
    let cut = text.replace("2 1 1</DataArray>", "1 1 1</DataArray>").replace("16.5<", "15<");
    folder.put("parts/2.vtu", cut);
    assert_eq!(read(&path, &GridOptions::default()).grid.points().len(), 14);
    // A piece without the array, one that is cut, one that is gone, none.
    let line = refuse(&path, &of("velocity"));
    assert!(line.ends_with("parts/2.vtu: array 'velocity' is missing, expected one with 3 components on points, as in other pieces"), "{line}");
    folder.put("parts/2.vtu", &usual_vtu(ASCII)[..300]);
    assert!(refuse(&path, &of("p")).contains("parts/2.vtu: the XML is damaged"));
    std::fs::remove_file(folder.path("parts/2.vtu")).unwrap();
    assert!(refuse(&path, &of("p")).contains("parts/2.vtu: cannot be read"));
    folder.put("parts/2.vtu", pvtu);
    assert!(
        refuse(&path, &of("p"))
            .contains("parts/2.vtu: type is 'PUnstructuredGrid', expected UnstructuredGrid")
    );
    let none = pvtu.replace("Piece", "Part");
    assert_eq!(refuse(&folder.put("a.pvtu", none), &of("p")), "Piece is missing, expected at least one");
    let nameless = pvtu.replace("Source", "Sauce");
    assert_eq!(
        refuse(&folder.put("a.pvtu", nameless), &of("p")),
        "Source is missing, expected one for each Piece"
    );
}

#[test]
fn exodus_blocks_and_values_at_the_first_step() {
    let folder = Folder::new();
    let path = folder.put("a.ex2", exodus().file());
    let file = read(&path, &GridOptions::default());
    assert_eq!(file.grid.cells().types(), [Hexahedron, Tetrahedron]);
    assert_eq!(file.grid.cells().get(1).1, [1, 2, 4, 7]);
    let found: Vec<f64> = file.grid.points().iter().flat_map(|point| point.to_array()).collect();
    assert_eq!(found, points());
    assert_eq!(file.array.as_ref().unwrap().name, "T");
    assert_eq!(values(&file), (0..12).map(f64::from).collect::<Vec<_>>());
    assert_eq!(values(&read(&path, &of("p")))[0], 12.0);
    let said = file.notes.join("; ");
    assert!(said.contains("2 time steps; the first is used") && said.contains("left out: 1 quad"), "{said}");
    // The tetrahedron has no such value, and shares nodes with the hexahedron.
    let on_cells = read(&path, &of("q"));
    assert_eq!([0, 2].map(|node| values(&on_cells)[node].is_nan()), [false, true]);
    assert_eq!((values(&on_cells)[1], on_cells.grid.is_blank(1)), (7.0, true));

    let line = refuse(&folder.put("a.ex2", b"\x89HDF\r\n\x1a\n"), &of("p"));
    assert_eq!(
        line,
        "format is netCDF-4 (HDF5), expected Exodus II in netCDF-3 (classic), as 'nccopy -k cdf5' makes it"
    );
    assert!(refuse(&folder.put("a.ex2", "hello"), &of("p")).starts_with("the netCDF header is damaged"));
    let whole = exodus().file();
    for cut in 1..whole.len() - 8 {
        refuse(&folder.put("a.ex2", &whole[..cut]), &of("q"));
    }
    let mut wrong = exodus();
    wrong.ints("connect4", &[("num_el_in_blk4", 1), ("num_nod_per_el4", 4)], Some("TET"), &[1, 2, 3, 4]);
    assert!(
        read_grid(&folder.put("a.ex2", wrong.file()), &of("p")).is_ok(),
        "a list beyond the blocks is not read"
    );
}
