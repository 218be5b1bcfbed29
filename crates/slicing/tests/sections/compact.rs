//! Compact meshes against the meshes they were made of.

use std::collections::BTreeMap;

use glam::DVec3;
use volery_scene::{Samples, UnstructuredGrid};
use volery_slicing::{
    CompactMesh, Place, Planes, QuantizedMesh, Refinement, SliceMesh, Slicer, error, node_gradients,
};

use crate::support::mixed;

const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);

/// A grid, what is seen of it, and its slices.
pub(crate) struct Case {
    pub(crate) grid: UnstructuredGrid,
    pub(crate) values: Samples,
    pub(crate) gradients: Vec<DVec3>,
    pub(crate) mesh: SliceMesh,
}

impl Case {
    pub(crate) fn new(size: usize, jitter: f64, num_planes: usize, normal: DVec3) -> Self {
        let mut grid = mixed(size, jitter, 7).grid();
        // Neither at the origin nor cubic.
        let moved = grid.points().iter().map(|p| DVec3::new(3.0, -0.2, 1.0) * *p + DVec3::new(1e3, 5.0, 0.0));
        grid = UnstructuredGrid::new(moved.collect(), grid.cells().clone()).unwrap();
        let wave = |p: &DVec3| (0.7 * p.x).sin() * (1.1 * p.z).cos() + 0.1 * p.y;
        let values: Samples = grid.points().iter().map(|p| wave(p) as f32).collect::<Vec<_>>().into();
        let gradients = node_gradients(&grid, &values);
        let slicer = Slicer::new(grid.clone()).unwrap();
        let planes = Planes::over(&grid, normal, num_planes).unwrap();
        let mesh = slicer.mesh(&planes, &values, Some(&gradients)).unwrap();
        Self { grid, values, gradients, mesh }
    }

    pub(crate) fn compact(&self) -> CompactMesh {
        CompactMesh::new(&self.mesh, self.grid.points(), &self.values, Some(&self.gradients)).unwrap()
    }
}

fn dvec3([x, y, z, _]: [f32; 4]) -> DVec3 {
    DVec3::new(x.into(), y.into(), z.into())
}

/// Vertices of the compact mesh by the nodes, as the grid numbers them, and the plane that they lie on.
fn numbers(compact: &CompactMesh, mesh: &SliceMesh) -> BTreeMap<Place, usize> {
    let mut used: Vec<u32> = mesh.edges.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    assert_eq!(used.len(), compact.nodes.len(), "nodes that vertices lie between, and no others");
    let of_grid = |place: &Place| Place { nodes: place.nodes.map(|node| used[node as usize]), ..*place };
    let numbers: BTreeMap<Place, usize> =
        compact.vertices.iter().enumerate().map(|(number, place)| (of_grid(place), number)).collect();
    assert_eq!(numbers.len(), compact.vertices.len(), "no place twice");
    numbers
}

/// The plane of a vertex, the slow way.
fn place(mesh: &SliceMesh, compact: &CompactMesh, vertex: usize) -> Place {
    let nodes = mesh.edges[vertex];
    let off = |plane: f64| (plane - mesh.normal.dot(dvec3(mesh.points[vertex]))).abs();
    let nearest =
        (0..compact.planes.len()).min_by(|&a, &b| off(compact.planes[a]).total_cmp(&off(compact.planes[b])));
    Place { nodes, plane: if nodes[0] == nodes[1] { 0 } else { nearest.unwrap() as u32 } }
}

#[test]
fn a_vertex_is_off_by_what_half_a_step_of_the_nodes_makes() {
    for (jitter, normal) in [(0.0, DVec3::Z), (0.3, NORMAL), (0.3, DVec3::Y)] {
        let case = Case::new(7, jitter, 40, normal);
        let (mesh, compact) = (&case.mesh, case.compact());
        let numbers = numbers(&compact, mesh);
        let quantized = compact.clone().expand();
        let decoded = quantized.to_mesh();
        let [x, y, z, value_step] = quantized.quantization.scale.map(f64::from);
        let step = DVec3::new(x, y, z).length();
        let mut worst = 0.0f64;
        for vertex in 0..mesh.points.len() {
            let place = place(mesh, &compact, vertex);
            let found = decoded.points[numbers[&place]];
            let [from, to] = place.nodes.map(|node| case.grid.points()[node as usize]);
            let edge = to - from;
            // Nodes move by half a step and less, numbers of a vertex are rounded by as much.
            let slope =
                if place.nodes[0] == place.nodes[1] { 1.0 } else { edge.normalize().dot(mesh.normal).abs() };
            let along = (0.5 * step / slope).min(edge.length());
            let allowed = step + along + 1e-6 * dvec3(mesh.points[vertex]).length();
            let off = dvec3(found).distance(dvec3(mesh.points[vertex]));
            assert!(off <= allowed, "vertex {vertex}: off by {off}, at most {allowed}");
            worst = worst.max(off / step);
            let rise = place.nodes.map(|node| case.values.value(node as usize, 0));
            let share = if edge.length() > 0.0 { along / edge.length() } else { 0.0 };
            let allowed = 1.01 * value_step + (rise[1] - rise[0]).abs() * share + 1e-6;
            let off = f64::from(found[3] - mesh.points[vertex][3]).abs();
            assert!(off <= allowed, "value of vertex {vertex}: off by {off}, at most {allowed}");
        }
        println!("normal {normal}: {} vertices, the worst off by {worst:.2} steps", mesh.points.len());
    }
}

#[test]
fn gradients_point_where_they_did() {
    let case = Case::new(7, 0.3, 40, NORMAL);
    let compact = case.compact();
    let numbers = numbers(&compact, &case.mesh);
    let decoded = compact.clone().expand().to_mesh();
    let largest = case.mesh.gradients.iter().map(|gradient| gradient[3]).fold(0.0, f32::max);
    let mut worst = 0.0f32;
    for (vertex, exact) in case.mesh.gradients.iter().enumerate() {
        let found = decoded.gradients[numbers[&place(&case.mesh, &compact, vertex)]];
        let off = (dvec3(found) * f64::from(found[3])).distance(dvec3(*exact) * f64::from(exact[3]));
        worst = worst.max(off as f32 / largest);
    }
    println!("gradients: off by {worst} of the largest, at most 0.02");
    assert!(worst <= 0.02);
}

/// How often each side of a triangle of a sheet is there.
fn sides(triangles: &[[u32; 3]]) -> BTreeMap<usize, usize> {
    let mut count: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *count.entry([from.min(to), from.max(to)]).or_default() += 1;
        }
    }
    let mut how_often = BTreeMap::new();
    count.into_values().for_each(|count| *how_often.entry(count).or_default() += 1);
    how_often
}

#[test]
fn what_was_watertight_is() {
    let case = Case::new(6, 0.3, 50, NORMAL);
    let (mesh, compact) = (&case.mesh, case.compact());
    assert_eq!(compact.sheets, mesh.sheets);
    for sheet in &mesh.sheets {
        let range = sheet.triangles.start as usize..sheet.triangles.end as usize;
        assert_eq!(sides(&compact.triangles[range.clone()]), sides(&mesh.triangles[range]), "{sheet:?}");
    }
    // Strips share the vertices of slices, and nothing else became one.
    let strips = mesh.sheets.iter().filter(|sheet| sheet.thickness[1] != 0.0).count();
    assert!(strips > 50 && compact.vertices.len() < mesh.points.len(), "{strips} strips");
}

#[test]
fn triangles_are_those_of_the_mesh_and_turn_as_they_did() {
    let case = Case::new(5, 0.3, 30, NORMAL);
    let (mesh, compact) = (&case.mesh, case.compact());
    let numbers = numbers(&compact, mesh);
    let turned = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    let number = |vertex: u32| numbers[&place(mesh, &compact, vertex as usize)] as u32;
    for sheet in &mesh.sheets {
        let range = sheet.triangles.start as usize..sheet.triangles.end as usize;
        let mut expected: Vec<_> =
            mesh.triangles[range.clone()].iter().map(|t| turned(t.map(number))).collect();
        let mut found: Vec<_> = compact.triangles[range].iter().map(|&t| turned(t)).collect();
        expected.sort_unstable();
        found.sort_unstable();
        assert_eq!(found, expected);
    }
}

#[test]
fn stacks_of_other_planes_are_compact_too() {
    let case = Case::new(5, 0.3, 1, NORMAL);
    let slicer = Slicer::new(case.grid.clone()).unwrap();
    let refinement = Refinement { first_planes: 4, share: 1.0 };
    let (stack, _) = slicer.slice_adaptively(NORMAL, refinement).unwrap();
    let mesh = slicer.mesh_of_stack(stack, &case.values, None).unwrap();
    let compact = CompactMesh::new(&mesh, case.grid.points(), &case.values, None).unwrap();
    assert!(compact.gradients.is_empty() && compact.planes.len() > 4);
    let decoded = CompactMesh::decode(&compact.encode(), 1 << 30).unwrap().expand();
    assert_eq!(decoded.points, compact.expand().points);
    // A mesh of no makers, and one of nothing.
    let direct = QuantizedMesh::new(&mesh).unwrap();
    let compact = CompactMesh::of_vertices(direct.clone());
    assert_eq!(compact.clone().expand(), direct);
    assert_eq!(CompactMesh::decode(&compact.encode(), 1 << 30).unwrap().expand().points, direct.points);
    let nothing = SliceMesh { normal: DVec3::Z, ..SliceMesh::default() };
    let compact = CompactMesh::new(&nothing, &[], &Vec::<f32>::new().into(), None).unwrap();
    assert_eq!(CompactMesh::decode(&compact.encode(), 1000).unwrap(), compact);
}

#[test]
fn what_cannot_be_compact_is_an_error() {
    let case = Case::new(2, 0.0, 3, DVec3::Z);
    let compact = |mesh: &SliceMesh, num_nodes: usize| {
        let points = &case.grid.points()[..num_nodes];
        CompactMesh::new(mesh, points, &case.values, None).unwrap_err()
    };
    let all = case.grid.points().len();
    let unmade = SliceMesh { edges: vec![], ..case.mesh.clone() };
    assert!(matches!(compact(&unmade, all), error::Compact::Values(error::Values::NoEdges { .. })));
    assert!(matches!(compact(&case.mesh, 1), error::Compact::Number { what: "a vertex has node", .. }));
    let mut lifted = case.mesh.clone();
    let vertex = lifted.edges.iter().position(|edge| edge[0] != edge[1]).unwrap();
    lifted.points[vertex][2] += 0.1;
    assert!(matches!(compact(&lifted, all), error::Compact::Plane { vertex: found, .. } if found == vertex));
    let mut wrong = case.mesh.clone();
    wrong.triangles[0][1] = u32::MAX;
    assert!(matches!(compact(&wrong, all), error::Compact::Number { found: u32::MAX, .. }));
    let mut sheets = case.mesh.clone();
    sheets.sheets.remove(1);
    assert!(matches!(compact(&sheets, all), error::Compact::Sheets { .. }));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Case::new(6, 0.3, 60, NORMAL).compact().encode())
    };
    let [one, two, seven] = [1, 2, 7].map(bytes);
    assert!(one == two && one == seven);
}
