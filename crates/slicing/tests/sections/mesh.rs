//! Meshes of slices and strips: along any line they stand for the matter there is.

use std::collections::BTreeSet;

use glam::DVec3;
use volery_scene::CellType::{Hexahedron, Tetrahedron, Voxel};
use volery_scene::{Samples, UnstructuredGrid};
use volery_slicing::{MeshSheet, Planes, Rays, Refinement, SliceMesh, Slicer};

use crate::support::{Parts, Random, mixed, surface, unit_cell};

const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);

fn values(grid: &UnstructuredGrid) -> Samples {
    let points = grid.points().iter();
    points.map(|point| point.dot(DVec3::new(0.2, -0.7, 1.3)) as f32).collect::<Vec<f32>>().into()
}

fn mesh(slicer: &Slicer, planes: &Planes) -> SliceMesh {
    slicer.mesh(planes, &values(slicer.grid()), None).unwrap()
}

/// A line in space: a place on it and its unit direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) place: DVec3,
    pub(crate) direction: DVec3,
}

impl Line {
    /// How far along the line a triangle is met, and whether its normal points along the line.
    fn meet(&self, corners: [DVec3; 3]) -> Option<(f64, bool)> {
        let [a, b, c] = corners.map(|corner| corner - self.place);
        // Volumes over the sides, all of one sign where the line passes inside.
        let [u, v, w] = [[b, c], [c, a], [a, b]].map(|[from, to]| self.direction.dot(from.cross(to)));
        let sum = u + v + w;
        let is_met = u > 0.0 && v > 0.0 && w > 0.0 || u < 0.0 && v < 0.0 && w < 0.0;
        is_met.then(|| (self.direction.dot(a * u + b * v + c * w) / sum, sum > 0.0))
    }
}

/// Length of a line in all cells: where it leaves the triangles of their surfaces, less where it comes in.
pub(crate) fn chord(grid: &UnstructuredGrid, line: Line) -> f64 {
    let mut sum = 0.0;
    for cell in (0..grid.cells().len()).filter(|&cell| !grid.is_blank(cell)) {
        let (cell_type, nodes) = grid.cells().get(cell);
        let (mut length, mut volume) = (0.0, 0.0);
        for triangle in surface(cell_type, nodes) {
            let corners = triangle.map(|node| grid.points()[node as usize]);
            let [a, b, c] = corners.map(|corner| corner - grid.points()[nodes[0] as usize]);
            volume += a.dot(b.cross(c));
            if let Some((along, leaves)) = line.meet(corners) {
                length += if leaves { along } else { -along };
            }
        }
        sum += length * volume.signum();
    }
    sum
}

/// Boxes on top of each other, each thinner than the one below by half, beside one as high as all.
fn tower(count: usize) -> Parts {
    let mut parts = Parts::default();
    let mut height = 0.0;
    for floor in 0..=count {
        let corner = |at: u32| DVec3::new(f64::from(at & 1), f64::from(at >> 1), height);
        parts.points.extend((0..4).map(corner));
        height += 0.5f64.powi(floor as i32 + 1);
    }
    parts.cells = (0..count as u32).map(|floor| (Voxel, (4 * floor..4 * floor + 8).collect())).collect();
    let start = parts.points.len() as u32;
    parts.points.extend(unit_cell(Voxel).into_iter().map(|point| point + 2.0 * DVec3::X));
    parts.cells.push((Voxel, (start..start + 8).collect()));
    parts
}

/// Corners of a triangle, relative to the origin of the mesh.
fn corners(mesh: &SliceMesh, triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|vertex| {
        let [x, y, z, _] = mesh.points[vertex as usize];
        DVec3::new(f64::from(x), f64::from(y), f64::from(z))
    })
}

fn triangles<'a>(mesh: &'a SliceMesh, sheet: &MeshSheet) -> &'a [[u32; 3]] {
    &mesh.triangles[sheet.triangles.start as usize..sheet.triangles.end as usize]
}

/// Matter that the sheets stand for along a line.
pub(crate) fn drawn(mesh: &SliceMesh, line: Line) -> f64 {
    let line = Line { place: line.place - mesh.origin, ..line };
    let mut sum = 0.0;
    for sheet in &mesh.sheets {
        for &triangle in triangles(mesh, sheet) {
            if let Some((along, _)) = line.meet(corners(mesh, triangle)) {
                let place = mesh.normal.dot(line.place + along * line.direction);
                sum += sheet.thickness[0] + sheet.thickness[1] * place;
            }
        }
    }
    sum / mesh.normal.dot(line.direction).abs()
}

/// A place in the box of a grid's nodes.
fn place(grid: &UnstructuredGrid, random: &mut Random) -> DVec3 {
    let [low, high] = grid.world_bounds().unwrap();
    low + (high - low) * (0.5 + 0.5 * random.vector())
}

/// The largest difference of matter drawn from the chord, over the size of the grid, and how many lines met any.
fn compare(
    grid: &UnstructuredGrid,
    mesh: &SliceMesh,
    mut line: impl FnMut(&mut Random) -> Line,
) -> (f64, usize) {
    let [low, high] = grid.world_bounds().unwrap();
    let mut random = Random(77);
    let (mut worst, mut met) = (0.0f64, 0);
    for _ in 0..300 {
        let line = line(&mut random);
        let [expected, found] = [chord(grid, line), drawn(mesh, line)];
        worst = worst.max((found - expected).abs() / (high - low).length());
        met += usize::from(expected.abs() > 0.0);
    }
    (worst, met)
}

#[track_caller]
fn chords_along_the_normal(name: &str, grid: UnstructuredGrid, planes: &Planes, limit: f64) {
    let slicer = Slicer::new(grid).unwrap();
    let mesh = mesh(&slicer, planes);
    let grid = slicer.grid();
    let direction = planes.normal();
    let (worst, met) = compare(grid, &mesh, |random| Line { place: place(grid, random), direction });
    println!(
        "{name}, {} planes: worst {worst:.1e} of the size, limit {limit:.0e}, {met} lines",
        planes.len()
    );
    assert!(met > 20 && worst <= limit);
}

#[test]
fn every_line_along_the_normal_has_its_length_in_the_grid() {
    for count in [1, 2, 9, 200] {
        for (name, jitter) in [("cubes", 0.0), ("warped", 0.15)] {
            let grid = mixed(4, jitter, 31).grid();
            for normal in [NORMAL, DVec3::Z, DVec3::new(-1.0, 1e-3, 0.0)] {
                let planes = Planes::over(&grid, normal, count).unwrap();
                chords_along_the_normal(name, grid.clone(), &planes, 1e-6);
            }
        }
    }
}

#[test]
fn every_line_of_any_direction_has_it_once_strips_are_oriented() {
    for (count, jitter) in [(1, 0.0), (40, 0.0), (1, 0.15), (40, 0.15)] {
        let slicer = Slicer::new(mixed(4, jitter, 32).grid()).unwrap();
        let grid = slicer.grid();
        let planes = Planes::over(grid, NORMAL, count).unwrap();
        let mut mesh = mesh(&slicer, &planes);
        for direction in [DVec3::new(1.0, -0.2, 0.4), DVec3::Z, -NORMAL, DVec3::new(-1.0, 0.3, 0.5)] {
            let direction = direction.normalize();
            mesh.orient_strips(Rays::Along(direction));
            let (worst, met) = compare(grid, &mesh, |random| Line { place: place(grid, random), direction });
            println!("{count} planes, rays along {direction:.2}: worst {worst:.1e}, limit 1e-6, {met} lines");
            assert!(met > 20 && worst <= 1e-6);
        }
        for eye in [DVec3::new(12.0, -7.0, 9.0), DVec3::new(2.0, 2.0, 7.0), DVec3::new(-1.0, -1.5, -2.0)] {
            mesh.orient_strips(Rays::From(eye));
            let (worst, met) = compare(grid, &mesh, |random| Line {
                place: eye,
                direction: (place(grid, random) - eye).normalize(),
            });
            println!("{count} planes, rays from {eye:.1}: worst {worst:.1e}, limit 1e-6, {met} lines");
            assert!(met > 20 && worst <= 1e-6);
        }
        let along = slicer.mesh(&planes, &values(grid), None).unwrap();
        mesh.orient_strips(Rays::Along(planes.normal()));
        assert_eq!(mesh.sheets, along.sheets, "a mesh can be turned to other rays and back");
    }
}

#[test]
fn every_line_has_its_length_where_cells_have_planes_of_their_own() {
    for (first_planes, share, jitter) in
        [(3, 1.0, 0.0), (3, 1.0, 0.2), (5, 0.5, 0.2), (1, 0.0, 0.2), (40, 1.0, 0.3)]
    {
        let slicer = Slicer::new(mixed(4, jitter, 33).grid()).unwrap();
        let grid = slicer.grid();
        let refinement = Refinement { first_planes, share };
        let (mut mesh, steps) = slicer.mesh_adaptively(NORMAL, refinement, &values(grid), None).unwrap();
        let num_met: usize = steps.iter().map(|step| step.num_met).sum();
        println!("{steps:?}, {} triangles", mesh.triangles.len());
        assert!(num_met as f64 >= share * grid.cells().len() as f64);
        let direction = mesh.normal;
        let (worst, met) = compare(grid, &mesh, |random| Line { place: place(grid, random), direction });
        println!("first {first_planes}, share {share}: worst {worst:.1e}, limit 1e-6, {met} lines");
        assert!(met > 20 && worst <= 1e-6);
        let eye = DVec3::new(12.0, -7.0, 9.0);
        mesh.orient_strips(Rays::From(eye));
        let (worst, _) = compare(grid, &mesh, |random| Line {
            place: eye,
            direction: (place(grid, random) - eye).normalize(),
        });
        println!("from {eye}: worst {worst:.1e}, limit 1e-6");
        assert!(worst <= 1e-6);
    }
}

#[test]
fn holes_gaps_and_blank_cells_have_no_matter() {
    let parts = mixed(4, 0.1, 35);
    let mut random = Random(36);
    let mut holed = parts.clone();
    holed.cells.retain(|_| random.below(4) > 0);
    let blank = parts.cells.iter().map(|_| random.below(4) == 0).collect();
    let marked = parts.grid().with_blank(blank).unwrap();
    let mut broken = parts.clone();
    broken.points[parts.cells[3].1[0] as usize].y = f64::NAN;
    for (name, grid) in [("holed", holed.grid()), ("blank", marked), ("broken", broken.grid())] {
        for count in [1, 13] {
            let planes = Planes::over(&grid, NORMAL, count).unwrap();
            chords_along_the_normal(name, grid.clone(), &planes, 1e-6);
        }
    }
}

#[test]
fn planes_on_faces_between_them_and_unevenly_spaced_leave_every_line_its_length() {
    let grid = mixed(4, 0.0, 37).grid();
    let on_faces = (0..=4).map(f64::from).collect::<Vec<_>>();
    let uneven = vec![-3.0, 0.0, 0.1, 0.11, 1.0, 2.5, 3.999, 4.0, 9.0];
    let below = vec![-9.0];
    for positions in [on_faces, uneven, below] {
        for normal in [DVec3::Z, -DVec3::X, NORMAL] {
            let planes = Planes::new(normal, positions.clone(), 1.0).unwrap();
            let slicer = Slicer::new(grid.clone()).unwrap();
            let mesh = mesh(&slicer, &planes);
            let direction = planes.normal();
            let (worst, met) =
                compare(&grid, &mesh, |random| Line { place: place(&grid, random), direction });
            println!("planes at {positions:?}: worst {worst:.1e}, limit 1e-6, {met} lines");
            assert!(met > 20 && worst <= 1e-6);
        }
    }
    let none = Planes::new(DVec3::Z, Vec::new(), 1.0).unwrap();
    assert!(mesh(&Slicer::new(grid).unwrap(), &none).sheets.is_empty());
}

#[test]
fn far_from_the_origin_a_mesh_is_as_it_is_at_it() {
    let mut parts = mixed(4, 0.15, 38);
    parts.points.iter_mut().for_each(|point| *point += DVec3::new(1e6, -1e6, 2e6));
    let grid = parts.grid();
    let planes = Planes::over(&grid, NORMAL, 20).unwrap();
    chords_along_the_normal("far away", grid, &planes, 1e-6);
}

#[test]
fn cells_thinner_than_the_distance_and_cells_far_thicker_are_whole() {
    let single = Parts { points: unit_cell(Tetrahedron), cells: vec![(Tetrahedron, vec![0, 1, 2, 3])] };
    let planes = Planes::over(&single.grid(), NORMAL, 20_000).unwrap();
    chords_along_the_normal("one tetrahedron", single.grid(), &planes, 1e-6);
    let grid = tower(20).grid();
    for count in [1, 3, 64] {
        let planes = Planes::over(&grid, DVec3::Z, count).unwrap();
        chords_along_the_normal("tower", grid.clone(), &planes, 1e-6);
    }
    let slicer = Slicer::new(grid).unwrap();
    for share in [0.3, 0.9, 1.0] {
        let refinement = Refinement { first_planes: 2, share };
        let found = slicer.mesh_adaptively(DVec3::Z, refinement, &values(slicer.grid()), None);
        let (mesh, steps) = found.unwrap();
        let num_met: usize = steps.iter().map(|step| step.num_met).sum();
        assert!(num_met >= (share * 21.0).ceil() as usize, "{num_met} met of 21, share {share}");
        let (worst, _) = compare(slicer.grid(), &mesh, |random| Line {
            place: place(slicer.grid(), random),
            direction: DVec3::Z,
        });
        println!("tower, share {share}: worst {worst:.1e}, limit 1e-6, {} steps", steps.len());
        assert!(worst <= 1e-6);
        let thickest = |step: &volery_slicing::Step| step.distance <= 0.5;
        assert!(
            steps.iter().all(thickest) && steps.windows(2).all(|pair| pair[1].distance < pair[0].distance)
        );
    }
}

#[test]
fn flat_cells_and_mirrored_grids_do_no_harm() {
    // A flat hexahedron between two cubes, all seen in a mirror.
    let mut points = unit_cell(Hexahedron);
    points.extend(unit_cell(Hexahedron)[4..].to_vec());
    points.extend(unit_cell(Hexahedron)[4..].iter().map(|&point| point + DVec3::Z));
    points.iter_mut().for_each(|point| point.x = -point.x);
    let cells = [[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11], [8, 9, 10, 11, 12, 13, 14, 15]];
    let parts = Parts { points, cells: cells.map(|nodes| (Hexahedron, nodes.to_vec())).to_vec() };
    for normal in [DVec3::Z, NORMAL] {
        let planes = Planes::over(&parts.grid(), normal, 7).unwrap();
        chords_along_the_normal("mirrored", parts.grid(), &planes, 1e-6);
    }
}

/// Matter of all sheets, and of slices alone: thickness over the area as seen along the normal.
fn volumes(mesh: &SliceMesh) -> [f64; 2] {
    let (mut slices, mut strips) = (0.0, 0.0);
    for sheet in &mesh.sheets {
        for &triangle in triangles(mesh, sheet) {
            let [a, b, c] = corners(mesh, triangle);
            let area = 0.5 * mesh.normal.dot((b - a).cross(c - a)).abs();
            let thickness = sheet.thickness[0] + sheet.thickness[1] * mesh.normal.dot(a + b + c) / 3.0;
            let sum = if !sheet.is_strip() { &mut slices } else { &mut strips };
            *sum += area * thickness;
        }
    }
    [slices + strips, slices]
}

#[test]
fn sheets_hold_the_volume_of_the_grid_whatever_the_distance() {
    let slicer = Slicer::new(mixed(4, 0.0, 39).grid()).unwrap();
    for (normal, counts) in [(NORMAL, [1, 4, 16, 64]), (DVec3::new(0.02, 0.0, 1.0), [1, 3, 10, 33])] {
        for count in counts {
            let planes = Planes::over(slicer.grid(), normal, count).unwrap();
            let [all, slices] = volumes(&mesh(&slicer, &planes)).map(|volume| (volume / 64.0 - 1.0).abs());
            println!("{count} planes: volume wrong by {all:.1e} (limit 1e-6), slices alone by {slices:.1e}");
            assert!(all <= 1e-6 && all <= slices.max(1e-6));
        }
    }
}

#[test]
fn strips_have_the_very_vertices_of_slices() {
    // Every face of the outline is warped, so its diagonal is an edge to slices too.
    let slicer = Slicer::new(mixed(3, 0.15, 40).grid()).unwrap();
    let mesh = mesh(&slicer, &Planes::over(slicer.grid(), NORMAL, 25).unwrap());
    let of_slices = mesh.sheets.iter().filter(|sheet| !sheet.is_strip());
    let of_slices: BTreeSet<u32> =
        of_slices.flat_map(|sheet| triangles(&mesh, sheet).as_flattened().to_vec()).collect();
    let bits = |vertex: u32| {
        let at = vertex as usize;
        (mesh.edges[at], mesh.weights[at].to_bits(), mesh.points[at].map(f32::to_bits))
    };
    let known: BTreeSet<_> = of_slices.iter().map(|&vertex| bits(vertex)).collect();
    let mut num_found = 0;
    for vertex in (0..mesh.points.len() as u32).filter(|vertex| !of_slices.contains(vertex)) {
        if mesh.edges[vertex as usize][0] != mesh.edges[vertex as usize][1] {
            assert!(
                known.contains(&bits(vertex)),
                "vertex {vertex} on edge {:?}",
                mesh.edges[vertex as usize]
            );
            num_found += 1;
        }
    }
    println!("{num_found} vertices of strips, {} of slices", known.len());
    assert!(num_found > 100);
}

#[test]
fn sheets_come_from_back_to_front() {
    let slicer = Slicer::new(mixed(3, 0.1, 41).grid()).unwrap();
    let mesh = mesh(&slicer, &Planes::over(slicer.grid(), NORMAL, 10).unwrap());
    let positions: Vec<f64> = mesh.sheets.iter().map(|sheet| sheet.position).collect();
    assert!(positions.is_sorted() && positions.len() > 20);
    let between = |at: usize| 0.5 * (positions[at] + positions[at + 1]);
    for eye in [f64::NEG_INFINITY, f64::INFINITY, -100.0, 100.0, between(7), between(12), positions[9]] {
        let order: Vec<&MeshSheet> = mesh.back_to_front(eye).collect();
        assert_eq!(order.len(), mesh.sheets.len(), "all, once");
        let mut starts: Vec<u32> = order.iter().map(|sheet| sheet.triangles.start).collect();
        starts.sort_unstable();
        starts.dedup();
        assert_eq!(starts.len(), order.len());
        for (behind, before) in order.iter().zip(&order[1..]) {
            // Of two on one side of the eye the nearer comes later.
            let [behind, before] = [behind, before].map(|sheet| sheet.position);
            let is_side = |below: bool| (behind < eye) == below && (before < eye) == below;
            assert!(!is_side(true) || behind <= before, "eye {eye}: {behind} behind {before}");
            assert!(!is_side(false) || behind >= before, "eye {eye}: {behind} behind {before}");
        }
    }
    // Strips of the gap that the eye is in come last, whether its middle is above the eye or below.
    let slices: Vec<f64> =
        mesh.sheets.iter().filter(|sheet| !sheet.is_strip()).map(|sheet| sheet.position).collect();
    for share in [0.1, 0.9] {
        let eye = slices[4] + share * (slices[5] - slices[4]);
        let last = mesh.back_to_front(eye).last().unwrap();
        assert!(last.is_strip() && last.position > slices[4] && last.position < slices[5]);
    }
    let first = |eye: f64| mesh.back_to_front(eye).next().unwrap().position;
    assert_eq!(
        first(f64::NEG_INFINITY),
        positions[positions.len() - 1],
        "rays up: the highest is the farthest"
    );
    assert_eq!(first(f64::INFINITY), positions[0]);
}

#[test]
fn a_strip_that_reaches_from_below_the_eye_to_above_counts_as_its_middle_does() {
    let corners = [[2.0, 0.0, -1.0, 0.0], [2.0, 1.0, 2.0, 0.0], [2.0, -1.0, 2.0, 0.0]];
    // Seen from inside, along x: where the middle is above the eye the ray leaves going up, so thickness rises.
    for (eye_height, rises) in [(0.5, true), (1.5, false)] {
        for first in 0..3u32 {
            let mut mesh = SliceMesh {
                normal: DVec3::Z,
                points: corners.to_vec(),
                triangles: vec![[0, 1, 2].map(|at: u32| (at + first) % 3)],
                sheets: vec![MeshSheet { position: 0.0, thickness: [-0.0, 1.0], triangles: 0..1 }],
                ..SliceMesh::default()
            };
            let [a, b, c] = self::corners(&mesh, mesh.triangles[0]);
            assert!((b - a).cross(c - a).x > 0.0, "the outward normal points along the rays");
            mesh.orient_strips(Rays::From(DVec3::new(-3.0, 0.0, eye_height)));
            let slope = mesh.sheets[0].thickness[1];
            assert_eq!(slope > 0.0, rises, "eye at {eye_height}, first {first}: slope {slope}");
        }
    }
}
