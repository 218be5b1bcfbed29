//! What `vtkGhostType` hides, in every VTK format; pieces; and which array is drawn where nobody says.

use std::path::Path;

use volery_io::grid::read_array_ranges;
use volery_io::{GridOptions, ReadOptions, Volume, read_grid, read_volume};
use volery_scene::SampleType;

use crate::make_grid::{ASCII, CELLS, exodus};
use crate::{Folder, assert_values};

fn text(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value} ")).collect()
}

/// An array of XML.
fn array(kind: &str, name: &str, values: &[f64]) -> String {
    format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{}</DataArray>", text(values))
}

/// Image data of so many points, or pieces of it: their extents, point data and cell data.
fn vti(whole: &str, pieces: &[(&str, String, String)]) -> String {
    let pieces: String = pieces
        .iter()
        .map(|(extent, points, cells)| {
            format!("<Piece Extent=\"{extent}\"><PointData>{points}</PointData><CellData>{cells}</CellData></Piece>")
        })
        .collect();
    format!(
        "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"{whole}\">{pieces}</ImageData></VTKFile>"
    )
}

fn blank(volume: &Volume) -> Vec<bool> {
    (0..volume.grid.num_samples()).map(|i| volume.grid.samples().value(i, 0).is_nan()).collect()
}

#[test]
fn hidden_points_are_blank_and_ghosts_are_never_drawn() {
    let folder = Folder::new();
    // Bits: a copy, hidden, both, and others.
    let ghosts = [0.0, 2.0, 1.0, 3.0, 0.0, 130.0, 4.0, 32.0, 2.0];
    let values: Vec<f64> = (10..19).map(f64::from).collect();
    let file = |kind: &str| {
        let points = array("UInt8", "vtkGhostType", &ghosts) + &array(kind, "v", &values);
        vti("0 2 0 2 0 0", &[("0 2 0 2 0 0", points, String::new())])
    };
    for (kind, sample) in [
        ("UInt8", SampleType::F32),
        ("Int16", SampleType::F32),
        ("UInt32", SampleType::F64),
        ("Float64", SampleType::F64),
    ] {
        let volume = folder.read("a.vti", file(kind));
        assert_eq!((volume.array.as_deref(), volume.grid.sample_type()), (Some("v"), sample));
        assert_eq!(blank(&volume), ghosts.map(|bits| bits as u8 & 2 != 0));
        assert_eq!(volume.grid.samples().value(7, 0), 17.0);
        assert_eq!(volume.notes, ["4 samples are hidden by vtkGhostType, and blank"]);
    }
    let path = folder.put("a.vti", file("UInt8"));
    let options = ReadOptions { array: Some("vtkGhostType".to_owned()), ..ReadOptions::default() };
    assert_eq!(crate::refuse(&path, &options), "array is 'vtkGhostType', expected one of 'v'");
    let legacy = format!(
        "# vtk DataFile Version 5.1\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 3 1\nSPACING 1 1 1\nORIGIN 0 0 0\n\
         POINT_DATA 9\nFIELD FieldData 2\nvtkGhostType 1 9 unsigned_char\n{}\nMETADATA\nINFORMATION 0\n\nv 1 9 short\n{}\n",
        text(&ghosts),
        text(&values)
    );
    let volume = folder.read("a.vtk", legacy);
    assert_eq!(volume.array.as_deref(), Some("v"));
    assert_eq!(blank(&volume), ghosts.map(|bits| bits as u8 & 2 != 0));
}

#[test]
fn hidden_cells_are_blank_on_cells_and_between_points() {
    let folder = Folder::new();
    let cells: Vec<f64> = (0..8).map(f64::from).collect();
    let points: Vec<f64> = (0..27).map(f64::from).collect();
    // Of 2 x 2 x 2 cells the first is hidden, the second replaced by finer ones, the third a copy.
    let ghosts = [32.0, 8.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let file =
        |on_points: String, on_cells: String| vti("0 2 0 2 0 2", &[("0 2 0 2 0 2", on_points, on_cells)]);
    let ghost = array("UInt8", "vtkGhostType", &ghosts);
    let volume = folder.read("a.vti", file(String::new(), ghost.clone() + &array("Float32", "t", &cells)));
    assert_eq!(blank(&volume), [true, true, false, false, false, false, false, false]);
    // On points: each hidden cell has a blank corner, and no shown one has one that need not be.
    let volume = folder.read("a.vti", file(array("Float32", "p", &points), ghost));
    let is_blank = blank(&volume);
    let corners = |cell: usize| {
        let [x, y, z] = [cell % 2, cell / 2 % 2, cell / 4];
        (0..8).map(move |i| (x + i % 2) + 3 * ((y + i / 2 % 2) + 3 * (z + i / 4)))
    };
    for (cell, ghost) in ghosts.iter().enumerate() {
        let has_blank = corners(cell).any(|corner| is_blank[corner]);
        assert_eq!(has_blank, matches!(*ghost as u8, 8 | 32), "cell {cell}");
    }
    // A hidden cell in the middle of others has no corner of its own: all its corners go.
    let mut ghosts = vec![0.0; 27];
    ghosts[13] = 32.0;
    let points: Vec<f64> = (0..64).map(f64::from).collect();
    let file = vti(
        "0 3 0 3 0 3",
        &[("0 3 0 3 0 3", array("Float32", "p", &points), array("UInt8", "vtkGhostType", &ghosts))],
    );
    assert_eq!(blank(&folder.read("a.vti", file)).into_iter().filter(|&blank| blank).count(), 8);
}

#[test]
fn a_cell_with_a_hidden_point_is_blank_in_unstructured_grids() {
    let folder = Folder::new();
    let mut ghosts = vec![0.0; 12];
    ghosts[11] = 2.0;
    let arrays = [
        ("Name=\"vtkGhostType\"", "UInt8", ghosts),
        ("Name=\"p\"", "Float32", (0..12).map(f64::from).collect()),
    ];
    let file =
        read_grid(&folder.put("a.vtu", ASCII.vtu(&CELLS, &arrays, &[])), &GridOptions::default()).unwrap();
    assert_eq!(file.array.unwrap().name, "p");
    // Only the second cell has point 11.
    let found: Vec<bool> = (0..file.grid.cells().len()).map(|cell| file.grid.is_blank(cell)).collect();
    assert_eq!(found, [false, true, false, false, false, false]);
    assert!(file.notes.contains(&"1 cells are hidden, and blank".to_owned()), "{:?}", file.notes);
}

#[test]
fn pieces_of_an_image_are_joined() {
    let folder = Folder::new();
    let value = |x: i64, y: i64, z: i64| (100 * z + 10 * y + x) as f64;
    let points = |extent: [i64; 6]| {
        let [x0, x1, y0, y1, z0, z1] = extent;
        let values: Vec<f64> = (z0..=z1)
            .flat_map(|z| (y0..=y1).flat_map(move |y| (x0..=x1).map(move |x| value(x, y, z))))
            .collect();
        (extent.map(|n| n.to_string()).join(" "), array("Int16", "v", &values))
    };
    let whole: Vec<f64> = (0..24).map(|i| value(i % 4, i / 4 % 3, i / 12)).collect();
    let parts = [points([0, 2, 0, 2, 0, 1]), points([2, 3, 0, 1, 0, 1]), points([2, 3, 1, 2, 0, 1])];
    let pieces: Vec<_> =
        parts.iter().map(|(extent, data)| (extent.as_str(), data.clone(), String::new())).collect();
    let volume = folder.read("a.vti", vti("0 3 0 2 0 1", &pieces));
    assert_eq!((volume.grid.dims(), volume.grid.sample_type()), ([4, 3, 2], SampleType::I16));
    assert_values(&volume, &whole);
    // The same in files, with one that is empty.
    let mut names = String::new();
    for (number, piece) in pieces.iter().enumerate() {
        folder.put(&format!("p{number}.vti"), vti("0 3 0 2 0 1", std::slice::from_ref(piece)));
        names += &format!("<Piece Extent=\"{}\" Source=\"p{number}.vti\"/>", piece.0);
    }
    folder.put("none.vti", vti("0 3 0 2 0 1", &[("0 -1 0 -1 0 -1", String::new(), String::new())]));
    let parallel = |names: &str| {
        format!(
            "<VTKFile type=\"PImageData\"><PImageData WholeExtent=\"0 3 0 2 0 1\" Origin=\"1 2 3\" Spacing=\"1 1 2\">{names}</PImageData></VTKFile>"
        )
    };
    let volume = folder.read("a.pvti", parallel(&(names.clone() + "<Piece Source=\"none.vti\"/>")));
    assert_values(&volume, &whole);
    assert_eq!(volume.grid.world_from_index().translation.to_array(), [1.0, 2.0, 3.0]);
    // What no piece has is blank.
    let volume = folder.read("a.vti", vti("0 3 0 2 0 1", &pieces[..2]));
    assert_eq!(blank(&volume).into_iter().filter(|&blank| blank).count(), 2);
    assert!(volume.notes[0].starts_with("2 samples are in no piece"), "{:?}", volume.notes);
    let far = [pieces[0].clone(), ("900 901 900 901 900 901", points([0, 1, 0, 1, 0, 1]).1, String::new())];
    let line = folder.refuse("a.vti", vti("0 3 0 2 0 1", &far));
    assert!(line.starts_with("samples in the box around the pieces is 733870"), "{line}");
    let line = folder.refuse("a.pvti", parallel("<Piece Source=\"gone.vti\"/>"));
    assert!(line.contains("gone.vti: cannot be read"), "{line}");
}

#[test]
fn an_array_that_is_the_same_everywhere_is_not_the_one_drawn() {
    let folder = Folder::new();
    let varied: Vec<f64> = (0..12).map(f64::from).collect();
    let (same, on_cells) = (vec![5.0; 12], vec![3.0; 8]);
    let note = "array 'a' is the same everywhere; 'b' is used";
    let points = array("Float32", "a", &same) + &array("Float32", "b", &varied);
    let image = vti("0 2 0 1 0 1", &[("0 2 0 1 0 1", points, String::new())]);
    for file in [image.clone(), image.replace("<PointData>", "<PointData Scalars=\"a\">")] {
        let volume = folder.read("a.vti", file);
        assert_eq!((volume.array.as_deref(), volume.notes.as_slice()), (Some("b"), &[note.to_owned()][..]));
    }
    let path = folder.put("a.vti", image);
    let options = ReadOptions { array: Some("a".to_owned()), ..ReadOptions::default() };
    assert_values(&read_volume(&path, &options).unwrap(), &same);

    let read = |path: &Path| read_grid(path, &GridOptions::default()).unwrap();
    let arrays = [("Name=\"a\"", "Float32", same.clone()), ("Name=\"b\"", "Float32", varied.clone())];
    let file = read(&folder.put("a.vtu", ASCII.vtu(&CELLS, &arrays, &[])));
    assert_eq!(file.array.unwrap().name, "b");
    assert!(file.notes.contains(&note.to_owned()), "{:?}", file.notes);
    // Nothing varies: the first.
    let arrays = [("Name=\"a\"", "Float32", same.clone()), ("Name=\"b\"", "Int32", same.clone())];
    let cells = [("Name=\"c\"", "Float32", on_cells)];
    let file = read(&folder.put("a.vtu", ASCII.vtu(&CELLS, &arrays, &cells)));
    assert_eq!(file.array.unwrap().name, "a");
    // A vector that points the same way everywhere varies in no component.
    let vectors: Vec<f64> = [1.0, 2.0, 3.0].repeat(12);
    let arrays = [("Name=\"v\" NumberOfComponents=\"3\"", "Float32", vectors)];
    let cells = [("Name=\"c\" NumberOfComponents=\"2\"", "Float32", (0..16).map(f64::from).collect())];
    let file = read(&folder.put("a.vtu", ASCII.vtu(&CELLS, &arrays, &cells)));
    assert_eq!(file.array.unwrap().name, "c");
}

#[test]
fn one_broken_or_strange_array_refuses_nothing() {
    let folder = Folder::new();
    let varied: Vec<f64> = (0..12).map(f64::from).collect();
    let file = String::from_utf8(ASCII.vtu(&CELLS, &[("Name=\"p\"", "Float32", varied)], &[])).unwrap();
    let others = [
        "<DataArray type=\"Float32\" Name=\"short\" format=\"ascii\">1 2 3</DataArray>",
        "<DataArray type=\"Bit\" Name=\"set\" format=\"ascii\">1 0 1</DataArray>",
        "<DataArray type=\"String\" Name=\"label\" format=\"ascii\">72 0</DataArray>",
        "<DataArray type=\"Float32\" Name=\"none\" NumberOfComponents=\"0\" format=\"ascii\"></DataArray>",
        "<DataArray type=\"Float32\" Name=\"empty\" NumberOfComponents=\"\" format=\"ascii\">1 2</DataArray>",
        "<DataArray type=\"Float32\" Name=\"\" format=\"ascii\">1 2</DataArray>",
        "<DataArray type=\"Float32\" format=\"ascii\">1 2</DataArray>",
        "<DataArray type=\"Float32\" Name=\"far\" format=\"appended\" offset=\"99\"/>",
    ];
    for other in others {
        for text in [
            file.replace("<PointData>\n", &format!("<PointData>\n{other}\n")),
            file.replace("</PointData>", &format!("{other}\n</PointData>")),
        ] {
            let path = folder.put("a.vtu", &text);
            let read =
                read_grid(&path, &GridOptions::default()).unwrap_or_else(|error| panic!("{other}: {error}"));
            assert_eq!(read.array.as_ref().unwrap().name, "p", "{other}");
            let ranges = read_array_ranges(&path, &GridOptions::default()).unwrap();
            let p = ranges.iter().find(|range| range.array.name == "p").unwrap();
            assert_eq!((p.range, &p.problem), (Some([0.0, 11.0]), &None));
            let is_said = ranges.iter().any(|range| range.problem.is_some())
                || read.notes.iter().any(|note| note.contains("left out"));
            assert!(is_said, "{other}: {:?}", read.notes);
        }
        // The same beside the array of an image.
        let points = array("Float32", "p", &(0..12).map(f64::from).collect::<Vec<_>>()) + other;
        let volume = folder.read("a.vti", vti("0 2 0 1 0 1", &[("0 2 0 1 0 1", points, String::new())]));
        assert_eq!(volume.array.as_deref(), Some("p"), "{other}");
    }
}

#[test]
fn exodus_steps_can_be_chosen() {
    let folder = Folder::new();
    let path = folder.put("a.e", exodus().file());
    let values = |time_step| {
        let file = read_grid(&path, &GridOptions { time_step, ..GridOptions::default() }).unwrap();
        file.grid.arrays()[0].values.range(0).unwrap()
    };
    assert_eq!(values(None), values(Some(0)));
    assert_ne!(values(Some(1)), values(Some(0)));
    let options = GridOptions { time_step: Some(2), ..GridOptions::default() };
    let line = read_grid(&path, &options).unwrap_err().to_string();
    assert!(line.ends_with("time step asked for is 2, expected 0 to 1"), "{line}");
    for name in ["run.e-s002", "run.e.4.0", "mesh.g", "mesh.exoII", "mesh.gen", "mesh.nc", "mesh"] {
        let path = folder.put(name, exodus().file());
        assert!(volery_io::is_grid(&path), "{name}");
        assert!(read_grid(&path, &GridOptions::default()).is_ok(), "{name}");
    }
}

#[test]
fn legacy_components_without_names() {
    let folder = Folder::new();
    let text = String::from_utf8(include_bytes!("vtk/ascii_51.vtk").to_vec()).unwrap();
    let cells = text.split("CELL_DATA").next().unwrap();
    let numbers: String = (0..36).map(|i| format!("{i} ")).collect();
    for names in ["X\n\nZ", "\nY\nZ", "X\nY\n", "\n\n"] {
        let vectors = format!(
            "{cells}POINT_DATA 12\nFIELD FieldData 2\nvel 3 12 float\n{numbers}\nMETADATA\nCOMPONENT_NAMES\n{names}\n\
             INFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 1\n\nids 1 12 int\n{}\n",
            &numbers[..26]
        );
        let path = folder.put("a.vtk", vectors);
        let ranges =
            read_array_ranges(&path, &GridOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        let names: Vec<_> = ranges.iter().map(|range| range.array.name.as_str()).collect();
        assert_eq!(names, ["vel", "ids"]);
        assert_eq!(ranges[1].range, Some([0.0, 11.0]));
    }
}
