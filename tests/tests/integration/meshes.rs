//! Opaque surfaces in scene files: read from `.obj` and `.glb`, drawn by every technique, judged by the reference.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;
use volery::{
    BackendChoice, How, Input, InputData, Picture, Plane, PlaneView, Thickness, View, VolumeData, read_input,
};
use volery_tests::{Drawer, SMOOTH_EXTENT, at_most, backend, distance, draw, exact, smooth, view_of};

const SCENE: &str = r#"{"input": {"kind": "KIND", "file": "FILE"}, "size": [160, 120], "background": [0.1, 0.15, 0.2],
    "camera": {"projection": "perspective", "eye": [17, -11, 9], "target": [4, 4, 4], "up": [0, 0, 1], "fov_y_deg": 40},
    "transfer_function": {"points": [{"value": 0, "color": [0.1, 0.2, 0.9], "opacity": 0.02},
                                     {"value": 1, "color": [1, 0.6, 0.1], "opacity": 0.3}], "unit_distance": 1},
    "meshes": [{"file": "parts/fold.obj", "color": [0.2, 0.9, 0.3]}, {"file": "ball.glb", "color": [0.9, 0.3, 0.3]}]}"#;

/// Two quadrilaterals in an angle, one of which leaves the data; a line that is no surface.
const FOLD: &str =
    "v 1 -2 1\nv 7 -2 2\nv 6.5 5 5\nv 1.5 5 4\nv 6 9 11\nv 2 9.5 10\nf 1 2 3 4\nf 4 3 5 6\nl 1 3\n";

/// A ball of `2 * 24 * 32` triangles, as a binary glTF whose node moves it.
fn ball() -> Vec<u8> {
    let (rows, columns) = (24_u32, 32_u32);
    let mut bytes = Vec::new();
    for i in 0..(rows + 1) * columns {
        let latitude = std::f32::consts::PI * (i / columns) as f32 / rows as f32;
        let longitude = std::f32::consts::TAU * (i % columns) as f32 / columns as f32;
        let point = [latitude.sin() * longitude.cos(), latitude.sin() * longitude.sin(), latitude.cos()];
        bytes.extend(point.iter().flat_map(|x| x.to_le_bytes()));
    }
    let num_points = (rows + 1) * columns;
    for i in 0..rows * columns {
        let (a, b) = (i, i / columns * columns + (i + 1) % columns);
        let corners = [a, b, b + columns, a, b + columns, a + columns];
        bytes.extend(corners.iter().flat_map(|corner| corner.to_le_bytes()));
    }
    let (split, whole, num_corners) = (12 * num_points, bytes.len(), 6 * rows * columns);
    let mut text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "scene": 0,
        "nodes": [{{"mesh": 0, "translation": [5, 2.5, 5.5], "scale": [1.5, 1.5, 1.5]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": {num_points}, "type": "VEC3"}},
                      {{"bufferView": 1, "componentType": 5125, "count": {num_corners}, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": {split}}},
                        {{"buffer": 0, "byteOffset": {split}, "byteLength": {}}}],
        "buffers": [{{"byteLength": {whole}}}]}}"#,
        whole - split as usize
    );
    text.push_str(&" ".repeat(text.len().next_multiple_of(4) - text.len()));
    let words = [u32::from_le_bytes(*b"glTF"), 2, (28 + text.len() + whole) as u32, text.len() as u32];
    let mut file: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    file.extend(b"JSON");
    file.extend(text.as_bytes());
    file.extend((whole as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    file
}

/// The smooth field on hexahedra, in VTK's legacy format.
fn grid_file(cells: usize) -> String {
    let grid = smooth(cells);
    let (n, step) = (cells + 1, SMOOTH_EXTENT / cells as f64);
    let mut text = format!(
        "# vtk DataFile Version 3.0\nsmooth\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
        n * n * n
    );
    for i in 0..n * n * n {
        let [x, y, z] = [i % n, i / n % n, i / n / n].map(|i| i as f64 * step);
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    let num = cells * cells * cells;
    writeln!(text, "CELLS {num} {}", 9 * num).unwrap();
    for i in 0..num {
        let a = (i / cells / cells * n + i / cells % cells) * n + i % cells;
        let [b, c, d] = [a + 1, a + 1 + n, a + n];
        let up = n * n;
        writeln!(text, "8 {a} {b} {c} {d} {} {} {} {}", a + up, b + up, c + up, d + up).unwrap();
    }
    writeln!(text, "CELL_TYPES {num}\n{}", "12\n".repeat(num)).unwrap();
    writeln!(text, "POINT_DATA {}\nSCALARS value double 1\nLOOKUP_TABLE default", n * n * n).unwrap();
    for i in 0..n * n * n {
        writeln!(text, "{}", grid.samples().value(i, 0)).unwrap();
    }
    text
}

/// Reads the scene of a kind of data, whose file was put into the folder.
fn read(folder: &Path, kind: &str, file: &str) -> Input {
    std::fs::create_dir_all(folder.join("parts")).unwrap();
    std::fs::write(folder.join("parts/fold.obj"), FOLD).unwrap();
    std::fs::write(folder.join("ball.glb"), ball()).unwrap();
    let scene = folder.join("scene.json");
    std::fs::write(&scene, SCENE.replace("KIND", kind).replace("FILE", file)).unwrap();
    let input = read_input(&scene, None).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(input.meshes.iter().map(|mesh| mesh.triangles().len()).collect::<Vec<_>>(), [4, 1536]);
    assert!(
        input.notes().iter().any(|note| note == "parts/fold.obj: 1 line left out: no surface"),
        "{:?}",
        input.notes()
    );
    input
}

fn read_volume_scene(grid: &volery::VoxelGrid) -> (tempfile::TempDir, Input) {
    let folder = tempfile::tempdir().unwrap();
    volery_io::write_nrrd(&folder.path().join("volume.nrrd"), grid, volery_io::World::Plain).unwrap();
    let input = read(folder.path(), "volume", "volume.nrrd");
    (folder, input)
}

/// Compares a picture with the truth, and shows that the meshes are in it.
fn check(what: &str, picture: &Picture, truth: &volery_reference::Image, without: &Picture, max_rmse: f64) {
    let found = distance(what, &exact(&picture.image), truth);
    at_most(&format!("{what}: rmse"), found.rmse, max_rmse);
    let pairs = picture.image.pixels.iter().zip(&without.image.pixels);
    let num_changed =
        pairs.filter(|(with, without)| (0..3).any(|i| (with[i] - without[i]).abs() > 0.05)).count();
    println!("{what}: meshes change {num_changed} of {} pixels", picture.image.pixels.len());
    assert!(num_changed > 1000, "{what}: {num_changed}");
}

fn check_session(session: &mut Drawer<VolumeData>, view: &View, what: &str, max_rmse: f64) {
    let mut picture = draw(session, view);
    let without = draw(session, &View { meshes: [].into(), ..view.clone() });
    let truth = session.verify(view, &mut picture, &|_| {}).unwrap_or_else(|error| panic!("{error}"));
    check(what, &picture, &truth, &without, max_rmse);
}

/// What a technique may be off by, and on a GPU what outlines add, whose corners are put on 1/256 of a pixel.
fn max_rmse(choice: BackendChoice, of_technique: f64) -> f64 {
    if choice == BackendChoice::Software { of_technique } else { of_technique + 1e-3 }
}

by_both_backends! { meshes_among_rays meshes_among_planes meshes_among_cubes meshes_among_sheets }

fn meshes_among_rays(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let (_folder, input) = read_volume_scene(&smooth(32));
    let view = view_of(&input);
    let mut session = Drawer::volume(input.volume().unwrap().grid.clone(), backend, How::Raycast).unwrap();
    check_session(&mut session, &view, test, max_rmse(choice, 2e-5));
}

fn meshes_among_planes(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let (_folder, input) = read_volume_scene(&smooth(32));
    let planes = vec![
        Plane { normal: DVec3::X, distance: 3.1 },
        Plane { normal: DVec3::new(0.2, -0.7, 0.6), distance: -0.4 },
        Plane { normal: DVec3::Z, distance: 5.2 },
    ];
    let planes = PlaneView { planes, is_transparent: true, ..PlaneView::default() };
    let view = View { how: How::Planes(planes), ..view_of(&input) };
    let mut session =
        Drawer::volume(input.volume().unwrap().grid.clone(), backend, How::Planes(PlaneView::default()))
            .unwrap();
    check_session(&mut session, &view, test, max_rmse(choice, 1e-6));
}

/// Cubes of one value are the matter of the volume, so the truth is the same.
fn meshes_among_cubes(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let (_folder, input) = read_volume_scene(&volery_data::uniform([17; 3], DVec3::splat(0.5), 0.6));
    let view = View { how: How::Fans(Thickness::Exact), ..view_of(&input) };
    let mut session = Drawer::volume(input.volume().unwrap().grid.clone(), backend, How::Raycast).unwrap();
    check_session(&mut session, &view, test, max_rmse(choice, 1e-6));
}

fn meshes_among_sheets(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("grid.vtk"), grid_file(16)).unwrap();
    let input = read(folder.path(), "grid", "grid.vtk");
    let view = view_of(&input);
    let InputData::Grid(file) = &input.data else { panic!("a grid was read") };
    let mut session = Drawer::grid(file.grid.clone(), None, backend).unwrap();
    let mut draw = |view: &View| session.render(view).unwrap_or_else(|error| panic!("{error}"));
    let (mut picture, without) = (draw(&view), draw(&View { meshes: [].into(), ..view.clone() }));
    let truth = session.verify(&view, &mut picture, &|_| {}).unwrap_or_else(|error| panic!("{error}"));
    check(test, &picture, &truth, &without, max_rmse(choice, 6e-4));
}
