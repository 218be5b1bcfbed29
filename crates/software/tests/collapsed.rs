//! Pictures of cells that list nodes more than once, and of cells without volume.

use glam::DVec3;
use volery_frame::{
    Backend, Content, Counted, Frame, PictureView, Sheet, SheetTransfer, SheetVertices, Sheets,
};
use volery_scene::{Camera, CellType, Cells, Projection, UnstructuredGrid};
use volery_slicing::{Planes, Slicer};
use volery_software::SoftwareBackend;

const SIDE: u32 = 24;
const BACKGROUND: [f32; 3] = [0.2, 0.4, 0.1];

/// Crooked, and numbered so that faces are split by either diagonal.
fn cube() -> Vec<DVec3> {
    let corners =
        [[0, 0, 0], [9, 1, 0], [10, 9, 1], [1, 10, 0], [0, 1, 9], [9, 0, 10], [10, 10, 9], [0, 9, 10]];
    corners.map(|corner| DVec3::from_array(corner.map(|x| 0.1 * f64::from(x)))).to_vec()
}

/// Slices along the view, of values that are linear in space.
fn picture(points: &[DVec3], cells: &[(CellType, Vec<u32>)], extinction: f32) -> Vec<[f32; 3]> {
    let nodes = cells.iter().flat_map(|(_, nodes)| nodes.clone()).collect();
    let cells = Cells::new(cells.iter().map(|cell| cell.0).collect(), nodes).expect("nodes of cells");
    let grid = UnstructuredGrid::new(points.to_vec(), cells).expect("nodes exist");
    let values: Vec<f32> = points.iter().map(|point| point.dot(DVec3::new(0.2, 0.3, 0.4)) as f32).collect();
    let slicer = Slicer::new(grid).expect("few edges");
    let middle = DVec3::splat(0.5);
    let camera = Camera {
        eye: middle + DVec3::new(2.0, 3.0, 1.2),
        target: middle,
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.6 },
        is_mirrored: false,
    };
    // The same planes whatever the cells are.
    let normal = (camera.target - camera.eye).normalize();
    let positions = (0..6).map(|plane| normal.dot(middle) + 0.3 * (f64::from(plane) - 2.5)).collect();
    let planes = Planes::new(normal, positions, 0.3).expect("ascending positions");
    let mesh = slicer.mesh(&planes, &values.into(), None).expect("few triangles");
    let sheet = |sheet: &volery_slicing::MeshSheet| Sheet {
        first: sheet.triangles.start,
        count: sheet.triangles.end - sheet.triangles.start,
        thickness: sheet.thickness.map(|t| t as f32),
        counted: Counted::All,
    };
    let sheets: Vec<_> = mesh.back_to_front(f64::NEG_INFINITY).map(sheet).collect();
    let entries = vec![[0.9, 0.1, 0.2, 0.5 * extinction], [0.1, 0.9, 0.8, extinction]];
    let transfer = SheetTransfer::of_entries(entries, 2, [0.0, 0.9], [0.0, 1.0]);
    let content = Content::Sheets(Sheets {
        revision: None,
        normal,
        origin: mesh.origin,
        vertices: SheetVertices::Exact { points: &mesh.points, gradients: &[] },
        triangles: &mesh.triangles,
        sheets: &sheets,
        transfer: &transfer,
        light: None,
    });
    let frame = Frame {
        view: PictureView { width: SIDE, height: SIDE, camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    SoftwareBackend::new().draw(&frame).expect("right sheets").image.pixels
}

fn difference(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    a.iter().zip(b).flat_map(|(a, b)| (0..3).map(|i| (a[i] - b[i]).abs())).fold(0.0, f32::max)
}

/// Every way in which nodes can be the same: for each place the first place with its node.
fn patterns(num_nodes: usize) -> Vec<Vec<usize>> {
    (0..num_nodes).fold(vec![vec![]], |patterns, place| {
        let longer = |pattern: Vec<usize>| {
            let firsts: Vec<_> = (0..place).filter(|&at| pattern[at] == at).chain([place]).collect();
            firsts.into_iter().map(move |first| [&pattern[..], &[first]].concat())
        };
        patterns.into_iter().flat_map(longer).collect()
    })
}

/// The tetrahedra between the faces of a cell, split at their lowest nodes, and one of its nodes; none if some of them
/// are the other way round.
fn tetrahedra(points: &[DVec3], cell_type: CellType, nodes: &[u32]) -> Option<Vec<(CellType, Vec<u32>)>> {
    let mut triangles = Vec::new();
    for face in cell_type.faces() {
        let face: Vec<u32> = face.iter().map(|&place| nodes[usize::from(place)]).collect();
        let first = (0..face.len()).min_by_key(|&at| face[at])?;
        let at = |step: usize| face[(first + step) % face.len()];
        triangles.extend((1..face.len() - 1).map(|step| [at(0), at(step), at(step + 1)]));
    }
    nodes.iter().find_map(|&apex| {
        let volume = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|node| points[node as usize] - points[apex as usize]);
            a.dot(b.cross(c))
        };
        let (kept, volumes): (Vec<_>, Vec<_>) =
            triangles.iter().map(|t| (t, volume(t))).filter(|(_, volume)| volume.abs() > 1e-9).unzip();
        let is_sum = !kept.is_empty() && volumes.iter().all(|volume| volume.signum() == volumes[0].signum());
        let cell = |&&[a, b, c]: &&[u32; 3]| (CellType::Tetrahedron, vec![a, b, c, apex]);
        is_sum.then(|| kept.iter().map(cell).collect())
    })
}

#[test]
fn collapsed_cells_look_like_their_tetrahedra() {
    // Which corners of the cube are those of each type.
    let corners: [(CellType, &[u32]); 5] = [
        (CellType::Tetrahedron, &[0, 2, 5, 7]),
        (CellType::Pyramid, &[0, 1, 2, 3, 6]),
        (CellType::Wedge, &[0, 1, 3, 4, 5, 7]),
        (CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]),
        (CellType::Voxel, &[0, 1, 3, 2, 4, 5, 7, 6]),
    ];
    let points = cube();
    for (cell_type, corners) in corners {
        let (mut worst, mut num_cells, mut num_seen) = (0.0_f32, 0, 0);
        for pattern in patterns(corners.len()) {
            let nodes: Vec<u32> = pattern.iter().map(|&place| corners[place]).collect();
            let Some(tetrahedra) = tetrahedra(&points, cell_type, &nodes) else { continue };
            for extinction in [1.0, 20.0] {
                let whole = picture(&points, &[(cell_type, nodes.clone())], extinction);
                let parts = picture(&points, &tetrahedra, extinction);
                worst = worst.max(difference(&whole, &parts));
                num_seen += whole.iter().filter(|&&pixel| pixel != BACKGROUND).count();
            }
            num_cells += 1;
        }
        println!("{cell_type}: {num_cells} cells, {num_seen} pixels seen, off by {worst:.1e} (limit 1e-3)");
        assert!(num_cells > 0 && num_seen > 20 * num_cells, "{cell_type}: {num_cells} {num_seen}");
        assert!(worst <= 1e-3, "{cell_type}: {worst}");
    }
}

#[test]
fn cells_without_volume_do_not_show_however_dense() {
    let points = cube();
    // In a plane across the view: a tetrahedron, a pyramid, and a wedge folded onto itself.
    let across =
        |x: f64, y: f64| DVec3::splat(0.5) + DVec3::new(3.0, -2.0, 0.0) * x * 0.1 + DVec3::Z * y * 0.3;
    let flat = [across(-1.0, -1.0), across(1.0, -1.1), across(1.2, 1.0), across(-0.9, 1.3), across(0.1, 0.2)];
    let cells = [
        (CellType::Tetrahedron, vec![0, 1, 2, 3]),
        (CellType::Pyramid, vec![0, 1, 2, 3, 4]),
        (CellType::Wedge, vec![0, 1, 2, 0, 1, 2]),
    ];
    for extinction in [1.0, 30.0, 1e4] {
        for cell in &cells {
            let image = picture(&flat, std::slice::from_ref(cell), extinction);
            let worst = image.iter().map(|pixel| difference(&[*pixel], &[BACKGROUND])).fold(0.0, f32::max);
            println!("{} at {extinction:e}: {worst:.1e} from the background (limit 1e-3)", cell.0);
            assert!(worst <= 1e-3, "{} at {extinction:e}: {worst}", cell.0);
        }
    }
    let image = picture(&points, &[(CellType::Hexahedron, (0..8).collect())], 30.0);
    assert!(difference(&image, &[BACKGROUND; (SIDE * SIDE) as usize]) > 0.3, "what has volume shows");
}
