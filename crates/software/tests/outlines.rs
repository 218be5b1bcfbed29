//! A stack whose strips are listed for any eye has the bits of one whose strips were put in order for each.

use glam::DVec3;
use volery_frame::{
    Backend, Content, Counted, Frame, PictureView, Sheet, SheetTransfer, SheetVertices, Sheets,
};
use volery_scene::{Camera, CellType, Cells, Projection, UnstructuredGrid};
use volery_slicing::{MeshSheet, Planes, Rays, SliceMesh, Slicer};
use volery_software::SoftwareBackend;

const NODES: u32 = 4;

/// Crooked hexahedra, sliced across a crooked normal.
fn stack() -> SliceMesh {
    let node = |x: u32, y: u32, z: u32| (z * NODES + y) * NODES + x;
    let places = (0..NODES.pow(3)).map(|i| [i % NODES, i / NODES % NODES, i / NODES / NODES]);
    let points: Vec<_> = places
        .map(|place| {
            let crooked = place.map(|i| f64::from(i * 7919 % 13) / 60.0);
            DVec3::from_array(place.map(f64::from)) + DVec3::new(crooked[1], crooked[2], crooked[0])
        })
        .collect();
    let last = NODES - 1;
    let cells = (0..last.pow(3)).map(|i| [i % last, i / last % last, i / last / last]);
    let nodes = cells.clone().flat_map(|[x, y, z]| {
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
            .map(|[i, j, k]| node(x + i, y + j, z + k))
    });
    let cells = Cells::new(cells.clone().map(|_| CellType::Hexahedron).collect(), nodes.collect());
    let values: Vec<f32> = points.iter().map(|point| (0.3 * point.length()) as f32).collect();
    let grid = UnstructuredGrid::new(points, cells.expect("nodes of cells")).expect("nodes exist");
    let slicer = Slicer::new(grid).expect("few edges");
    let normal = DVec3::new(0.2, -0.3, 1.0).normalize();
    let planes = Planes::over(slicer.grid(), normal, 9).expect("a grid with an extent");
    slicer.mesh(&planes, &values.into(), None).expect("few triangles")
}

fn picture(mesh: &SliceMesh, camera: Camera, is_for_any_eye: bool) -> Vec<[u32; 3]> {
    let listed = if is_for_any_eye { mesh.sheets_for_any_eye() } else { mesh.sheets.clone() };
    let eye = match camera.projection {
        Projection::Perspective { .. } => mesh.normal.dot(camera.eye - mesh.origin),
        Projection::Orthographic { .. } => {
            f64::NEG_INFINITY * mesh.normal.dot(camera.target - camera.eye).signum()
        }
    };
    let sheet = |sheet: &MeshSheet| Sheet {
        first: sheet.triangles.start,
        count: sheet.triangles.end - sheet.triangles.start,
        thickness: sheet.thickness.map(|part| part as f32),
        counted: match (is_for_any_eye && sheet.is_strip(), sheet.thickness[1] > 0.0) {
            (false, _) => Counted::All,
            (true, true) => Counted::Rising,
            (true, false) => Counted::Falling,
        },
    };
    let sheets: Vec<_> = MeshSheet::back_to_front(&listed, eye).map(sheet).collect();
    let transfer = SheetTransfer::of_entries(
        vec![[0.9, 0.2, 0.1, 0.1], [0.1, 0.6, 0.9, 0.6]],
        2,
        [0.0, 1.6],
        [0.0, 1.0],
    );
    let content = Content::Sheets(Sheets {
        revision: None,
        normal: mesh.normal,
        origin: mesh.origin,
        vertices: SheetVertices::Exact { points: &mesh.points, gradients: &[] },
        triangles: &mesh.triangles,
        sheets: &sheets,
        transfer: &transfer,
        light: None,
    });
    let view = PictureView { width: 70, height: 50, camera, background: [0.2, 0.4, 0.1], meshes: &[] };
    let image = SoftwareBackend::new().draw(&Frame { view, content }).expect("right sheets").image;
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

#[test]
fn strips_for_any_eye_have_the_bits_of_strips_in_order() {
    let mesh = stack();
    let target = DVec3::splat(1.6);
    let mut num_strips = 0;
    for step in 0..12 {
        let turn = f64::from(step) * 0.55;
        let eye = target + DVec3::new(5.0 * turn.cos(), 5.0 * turn.sin(), 4.0 * (0.7 * turn).sin());
        let projection = if step % 3 == 2 {
            Projection::Orthographic { height: 5.0 }
        } else {
            Projection::Perspective { fov_y_deg: 40.0 }
        };
        let camera = Camera { eye, target, up: DVec3::Z, projection, is_mirrored: false };
        let mut oriented = mesh.clone();
        oriented.orient_strips(match projection {
            Projection::Perspective { .. } => Rays::From(eye),
            Projection::Orthographic { .. } => Rays::Along(camera.axes()[2]),
        });
        num_strips += oriented.sheets.iter().filter(|sheet| sheet.is_strip()).count();
        assert!(oriented.triangles != mesh.triangles || step % 3 == 2, "eye {step} asks for no other order");
        assert!(
            picture(&mesh, camera, true) == picture(&oriented, camera, false),
            "eye {step}: another picture than of strips in order"
        );
    }
    println!("12 eyes, {num_strips} strips in order");
    assert!(num_strips > 12);
}
