//! One head, written down in other orders of its samples, in other formats and turned in the world: one picture.

use std::fmt::Write as _;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use volery::{
    BackendChoice, Camera, ControlPoint, Dial, Focus, How, InputError, Plane, PlaneView, Session, Thickness,
    TransferFunction, View, ViewOptions, VolumeData, read_input,
};
use volery_reference::Image;
use volery_scene::{Samples, TriangleMesh, VoxelGrid};
use volery_tests::{Shared, at_most, backend, distance, exact};

by_both_backends! {
    files_in_any_order_show_one_head
    oblique_heads_are_turned_cameras
}

const SIZE: [u32; 2] = [72, 88];

/// Root mean square difference of a channel, of planes; of cubes, where a ray may run along an edge; and of matter: half a
/// bin of the table to which executors round values, within an error that they state. In another order of samples another
/// cell may be on the other side of an edge, or be cut finer. Exact pictures have a difference of 1e-9 at most.
const MAX_RMSE: f64 = 1e-6;
const MAX_CUBE_RMSE: f64 = 5e-6;
const MAX_MATTER_RMSE: f64 = 1.0 / 16384.0;

/// The head in right, anterior, superior: dims and spacing that differ, a lump on its right cheek.
fn head() -> VoxelGrid {
    let (dims, spacing) = ([34, 42, 39], DVec3::new(3.5, 3.0, 3.25));
    // Of another crate, with its face to -y.
    let Samples::I16(values) = volery_data::head(dims, spacing).samples().clone() else {
        panic!("Hounsfield units")
    };
    let value = |[x, y, z]: [usize; 3]| {
        let lump = DVec3::new(x as f64 - 26.0, y as f64 - 34.0, z as f64 - 13.0).length() < 5.0;
        if lump { 600 } else { values[(z * dims[1] + dims[1] - 1 - y) * dims[0] + x] }
    };
    let places = (0..dims.iter().product())
        .map(|i: usize| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]]);
    let grid = VoxelGrid::new(dims, spacing, places.map(value).collect::<Vec<i16>>()).unwrap();
    let axes = DMat3::from_diagonal(spacing);
    grid.with_world_from_index(DAffine3::from_mat3_translation(axes, DVec3::new(-57.0, -83.5, -40.25)))
        .unwrap()
}

/// The same samples with index axis `i` along axis `from[i]` of the head, backwards where that is said.
fn reordered(head: &VoxelGrid, from: [usize; 3], is_back: [bool; 3]) -> VoxelGrid {
    let (old, map) = (head.dims(), head.world_from_index());
    let dims = from.map(|axis| old[axis]);
    let place = |new: [usize; 3]| {
        let mut place = [0; 3];
        (0..3).for_each(|i| place[from[i]] = if is_back[i] { dims[i] - 1 - new[i] } else { new[i] });
        place
    };
    let value = |i: usize| {
        let index = head.index(place([i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]]));
        head.samples().value(index, 0) as i16
    };
    let values: Vec<i16> = (0..dims.iter().product()).map(value).collect();
    let axis = |i: usize| map.matrix3.col(from[i]) * if is_back[i] { -1.0 } else { 1.0 };
    let first = DVec3::from_array(place([0; 3]).map(|at| at as f64));
    let turned = DAffine3::from_mat3_translation(
        DMat3::from_cols(axis(0), axis(1), axis(2)),
        map.transform_point3(first),
    );
    let spacing = DVec3::from_array(from.map(|axis| head.spacing()[axis]));
    VoxelGrid::new(dims, spacing, values).unwrap().with_world_from_index(turned).unwrap()
}

/// A file of 16-bit numbers.
fn bytes(grid: &VoxelGrid) -> Vec<u8> {
    (0..grid.num_samples()).flat_map(|i| (grid.samples().value(i, 0) as i16).to_le_bytes()).collect()
}

fn numbers(of: impl IntoIterator<Item = f64>) -> String {
    of.into_iter().fold(String::new(), |mut text, x| {
        let _ = write!(text, "{}{x}", if text.is_empty() { "" } else { " " });
        text
    })
}

/// By `sform`, in RAS.
fn nifti(grid: &VoxelGrid) -> Vec<u8> {
    let mut head = vec![0_u8; 352];
    let mut put = |at: usize, part: &[u8]| head[at..at + part.len()].copy_from_slice(part);
    put(0, &348_i32.to_le_bytes());
    let dims = grid.dims().map(|n| n as i16);
    for (i, n) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &i16::to_le_bytes(n));
    }
    put(70, &4_i16.to_le_bytes());
    put(72, &16_i16.to_le_bytes());
    let spacing = grid.spacing().to_array();
    for (i, step) in [1.0, spacing[0], spacing[1], spacing[2]].into_iter().enumerate() {
        put(76 + 4 * i, &(step as f32).to_le_bytes());
    }
    put(108, &352_f32.to_le_bytes());
    put(254, &1_i16.to_le_bytes());
    let map = grid.world_from_index();
    for (i, number) in
        (0..3).flat_map(|i| map.matrix3.row(i).extend(map.translation[i]).to_array()).enumerate()
    {
        put(280 + 4 * i, &(number as f32).to_le_bytes());
    }
    put(344, b"n+1\0");
    [head, bytes(grid)].concat()
}

/// In LPS.
fn lps(grid: &VoxelGrid) -> DAffine3 {
    DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * grid.world_from_index()
}

fn metaimage(grid: &VoxelGrid) -> Vec<u8> {
    let map = lps(grid);
    let directions = (0..3).flat_map(|i| (map.matrix3.col(i) / grid.spacing()[i]).to_array());
    let head = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = {}\n\
         Offset = {}\nElementSpacing = {}\nDimSize = {}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n",
        numbers(directions),
        numbers(map.translation.to_array()),
        numbers(grid.spacing().to_array()),
        numbers(grid.dims().map(|n| n as f64)),
    );
    [head.into_bytes(), bytes(grid)].concat()
}

fn nrrd_in_lps(grid: &VoxelGrid) -> Vec<u8> {
    let map = lps(grid);
    let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let head = format!(
        "NRRD0005\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: {}\nspace directions: {} {} {}\n\
         endian: little\nencoding: raw\nspace origin: {}\n\n",
        numbers(grid.dims().map(|n| n as f64)),
        vector(map.matrix3.x_axis),
        vector(map.matrix3.y_axis),
        vector(map.matrix3.z_axis),
        vector(map.translation),
    );
    [head.into_bytes(), bytes(grid)].concat()
}

/// Makes a file of a volume.
type Writer = fn(&VoxelGrid) -> Vec<u8>;

/// Reads a file as the program does.
fn opened(name: &str, file: &[u8]) -> Result<VolumeData, Box<InputError>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, file).unwrap();
    Ok(read_input(&path, None)?.volume_data()?)
}

/// What stands where in the world: a screen beside the head, planes, a focus.
fn mesh() -> TriangleMesh {
    let points =
        vec![DVec3::new(70.0, -60.0, -45.0), DVec3::new(20.0, 40.0, 60.0), DVec3::new(10.0, 75.0, -30.0)];
    TriangleMesh::new(points, vec![[0, 1, 2]], [0.2, 0.8, 0.4]).unwrap()
}

/// Named views: of matter where nobody says from where and how, and of thin matter, by every technique; with meshes, planes
/// and a focus.
fn views(session: &Session<VolumeData>) -> Vec<(&'static str, View)> {
    let [width, height] = SIZE;
    let view = |how: Option<How>| session.view(&ViewOptions { width, height, how, ..ViewOptions::default() });
    let matter = view(None);
    let point = |value, level, opacity| ControlPoint { value, color: [level, 0.8, 1.0 - level], opacity };
    let haze = [point(-1000.0, 0.1, 0.0), point(1600.0, 0.9, 0.05)].to_vec();
    let thin = View { transfer: TransferFunction::new(haze, 4.0).unwrap().into(), ..matter.clone() };
    let among = View { meshes: [mesh()].into(), ..thin.clone() };
    let cut = Plane { normal: DVec3::new(0.4, 0.8, -0.3), distance: 2.0 };
    let planes = PlaneView { planes: vec![cut], ..PlaneView::default() };
    let focus = Some(Focus { point: DVec3::new(30.0, 20.0, -10.0), quality: 1e9 });
    let mut focused = view(Some(How::Planes(PlaneView { focus, ..planes.clone() })));
    focused.meshes = [mesh()].into();
    vec![
        ("matter", matter),
        ("thin matter", thin),
        ("thin matter and a mesh", among),
        ("three planes", view(Some(How::Planes(PlaneView::default())))),
        ("a plane, a focus, a mesh", focused),
        ("cubes", view(Some(How::Fans(Thickness::Exact)))),
    ]
}

/// How a picture is drawn, by which backend.
fn drawn(session: &mut Session<VolumeData>, view: &View, backend: &Shared) -> Image {
    exact(&session.render(view, &mut backend.clone()).unwrap().image)
}

fn all(session: &mut Session<VolumeData>, backend: &Shared) -> Vec<(&'static str, Image)> {
    views(session).into_iter().map(|(name, view)| (name, drawn(session, &view, backend))).collect()
}

/// The exact pictures of matter and of planes.
fn truths(session: &mut Session<VolumeData>, backend: &Shared) -> Vec<(&'static str, Image)> {
    let views = views(session).into_iter().filter(|(name, _)| !matches!(*name, "matter" | "cubes"));
    let truth = |(name, view): (&'static str, View)| {
        let mut picture = session.render(&view, &mut backend.clone()).unwrap();
        (name, session.verify(&view, &mut picture, &|_| {}).unwrap())
    };
    views.map(truth).collect()
}

fn assert_same(what: &str, view: &str, found: &Image, expected: &Image) {
    let most = match view {
        "cubes" => MAX_CUBE_RMSE,
        _ if view.contains("matter") => MAX_MATTER_RMSE,
        _ => MAX_RMSE,
    };
    at_most("rmse", distance(&format!("{what}, {view}"), found, expected).rmse, most);
}

fn assert_not_mirrored_by_chance(image: &Image) {
    let [width, height] = SIZE;
    let turned = (0..height).flat_map(|row| (0..width).rev().map(move |column| image.pixel(column, row)));
    let turned = Image::new(width, height, turned.collect()).unwrap();
    assert!(distance("and its mirror image", image, &turned).rmse > 0.02, "a head without left and right");
}

fn files_in_any_order_show_one_head(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    let head = head();
    let mut session = Session::new(opened("ras.nii", &nifti(&head)).unwrap());
    let expected = all(&mut session, &backend);
    let exact_pictures = truths(&mut session, &backend);
    assert_not_mirrored_by_chance(&expected[0].1);
    let (yes, no) = (true, false);
    let formats: [(&str, Writer); 3] = [("a.nii", nifti), ("a.mha", metaimage), ("a.nrrd", nrrd_in_lps)];
    for (number, (name, from, is_back)) in [
        ("LAS", [0, 1, 2], [yes, no, no]),
        ("LPS", [0, 1, 2], [yes, yes, no]),
        ("RPI", [0, 1, 2], [no, yes, yes]),
        ("PIR", [1, 2, 0], [yes, yes, no]),
        ("ASL", [1, 2, 0], [no, no, yes]),
        ("SAR", [2, 1, 0], [no, no, no]),
        ("ILP", [2, 0, 1], [yes, yes, yes]),
        ("RSA", [0, 2, 1], [no, no, no]),
    ]
    .into_iter()
    .enumerate()
    {
        let grid = reordered(&head, from, is_back);
        // Each format has an order of either hand.
        let (file, write) = formats[number % formats.len()];
        let data = opened(file, &write(&grid)).unwrap();
        assert_eq!(data.grid().dims(), grid.dims());
        let mut session = Session::new(data);
        for ((view, found), (_, expected)) in all(&mut session, &backend).iter().zip(&expected) {
            assert_same(&format!("{test}, {name} in {file}"), view, found, expected);
        }
        // The exact pictures are of one head, too, whatever the executors make of it.
        for ((view, found), (_, expected)) in truths(&mut session, &backend).iter().zip(&exact_pictures) {
            at_most(&format!("{name}, the truth of {view}"), distance(name, found, expected).max, 1e-9);
        }
    }
}

/// A head that lies askew, seen by a camera that lies askew as well; planes and meshes turn with them.
fn oblique_heads_are_turned_cameras(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test).map(Shared::new) else { return };
    let head = head();
    let mut straight = Session::new(opened("ras.nrrd", &nrrd_in_lps(&head)).unwrap());
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -1.0, 0.5).normalize(), 0.35));
    let turn = DAffine3::from_mat3_translation(turn, DVec3::new(12.0, -5.0, 3.0));
    for (from, is_back) in [([0, 1, 2], [true, false, false]), ([2, 0, 1], [false, true, false])] {
        let grid = reordered(&head, from, is_back);
        let askew = turn * grid.world_from_index();
        let askew = grid.with_world_from_index(askew).unwrap();
        let mut session = Session::new(opened("askew.mha", &metaimage(&askew)).unwrap());
        for (name, view) in views(&straight) {
            let turned = turned(&view, &turn);
            let (found, expected) =
                (drawn(&mut session, &turned, &backend), drawn(&mut straight, &view, &backend));
            assert_same(test, name, &found, &expected);
        }
    }
    let sheared = DAffine3::from_mat3(DMat3::from_cols(
        DVec3::new(3.5, 0.0, 0.0),
        DVec3::new(0.5, 3.0, 0.0),
        DVec3::new(0.0, 0.0, 3.25),
    ));
    let sheared = head.with_world_from_index(sheared).unwrap();
    let error = opened("sheared.nii", &nifti(&sheared)).err().expect("no rotation makes such axes");
    let line = error.to_string();
    assert!(
        line.contains(
            "sheared.nii: axes x and y of the samples meet at 80.54 degrees, expected a right angle"
        ),
        "{line}"
    );
}

fn turned(view: &View, turn: &DAffine3) -> View {
    let Camera { eye, target, up, .. } = view.camera;
    let camera = Camera {
        eye: turn.transform_point3(eye),
        target: turn.transform_point3(target),
        up: turn.transform_vector3(up),
        ..view.camera
    };
    let plane = |plane: &Plane| {
        let normal = turn.transform_vector3(plane.normal);
        Plane { normal, distance: plane.distance + normal.dot(turn.translation) }
    };
    let how = match &view.how {
        How::Planes(planes) => How::Planes(PlaneView {
            planes: planes.planes.iter().map(plane).collect(),
            focus: planes.focus.map(|focus| Focus { point: turn.transform_point3(focus.point), ..focus }),
            ..planes.clone()
        }),
        other => other.clone(),
    };
    let points =
        |mesh: &TriangleMesh| mesh.points().iter().map(|&point| turn.transform_point3(point)).collect();
    let mesh = |mesh: &TriangleMesh| {
        TriangleMesh::new(points(mesh), mesh.triangles().to_vec(), mesh.color()).unwrap()
    };
    let meshes = view.meshes.iter().map(mesh).collect();
    View { camera, meshes, how, dial: Dial::Full, ..view.clone() }
}
