//! Cells that list nodes more than once, in every pattern there is.

use glam::DVec3;
use volery_scene::{CellType, Samples, UnstructuredGrid};
use volery_slicing::{CompactMesh, Planes, SliceMesh, Slicer};

use crate::mesh::{Line, chord, drawn};
use crate::support::{Parts, Random, surface, unit_cell};

const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);

/// Every way in which nodes can be the same: for each place the first place with its node.
fn patterns(num_nodes: usize) -> Vec<Vec<usize>> {
    let mut patterns = vec![vec![]];
    for place in 0..num_nodes {
        let longer = patterns.iter().flat_map(|pattern: &Vec<usize>| {
            let firsts = (0..place).filter(|&first| pattern[first] == first).chain([place]);
            firsts.map(|first| [&pattern[..], &[first]].concat()).collect::<Vec<_>>()
        });
        patterns = longer.collect();
    }
    patterns
}

/// A cell of this pattern, moved out of its even shape, its nodes numbered at random.
fn cell(cell_type: CellType, pattern: &[usize], jitter: f64, random: &mut Random) -> Parts {
    let mut points = unit_cell(cell_type);
    points.iter_mut().for_each(|point| *point += jitter * random.vector());
    let names = random.shuffled(points.len());
    let mut named = points.clone();
    names.iter().zip(&points).for_each(|(&name, &point)| named[name] = point);
    let nodes = pattern.iter().map(|&place| names[place] as u32).collect();
    Parts { points: named, cells: vec![(cell_type, nodes)] }
}

/// The tetrahedra between the faces of a cell and one of its nodes; none if some of them are the other way round, so
/// that the cell is more than their sum.
fn tetrahedra(parts: &Parts) -> Option<Parts> {
    let (cell_type, nodes) = &parts.cells[0];
    let around = |&apex: &u32| {
        let mut cells = Vec::new();
        for [a, b, c] in surface(*cell_type, nodes) {
            let [p, q, r] = [a, b, c].map(|node| parts.points[node as usize] - parts.points[apex as usize]);
            let volume = p.dot(q.cross(r));
            if volume.abs() > 1e-12 {
                // As a tetrahedron has its nodes: the last where the first three turn to.
                cells.push((volume, vec![a, c, b, apex]));
            }
        }
        let sign = cells.iter().map(|(volume, _)| volume).sum::<f64>().signum();
        let is_sum = !cells.is_empty() && cells.iter().all(|(volume, _)| volume * sign > 0.0);
        is_sum.then(|| Parts {
            points: parts.points.clone(),
            cells: cells.into_iter().map(|(_, nodes)| (CellType::Tetrahedron, nodes)).collect(),
        })
    };
    nodes.iter().find_map(around)
}

fn values(grid: &UnstructuredGrid) -> Samples {
    grid.points().iter().map(|point| point.dot(NORMAL) as f32).collect::<Vec<_>>().into()
}

fn mesh(parts: &Parts, normal: DVec3, count: usize) -> SliceMesh {
    let slicer = Slicer::new(parts.grid()).unwrap();
    let planes = Planes::over(slicer.grid(), normal, count).unwrap();
    slicer.mesh(&planes, &values(slicer.grid()), None).unwrap()
}

/// Volume of the matter that the sheets stand for, seen along the normal.
fn drawn_volume(mesh: &SliceMesh) -> f64 {
    let of_sheet = |sheet: &volery_slicing::MeshSheet| {
        let triangles = &mesh.triangles[sheet.triangles.start as usize..sheet.triangles.end as usize];
        let of_triangle = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|vertex| {
                let [x, y, z, _] = mesh.points[vertex as usize].map(f64::from);
                DVec3::new(x, y, z)
            });
            let area = 0.5 * mesh.normal.dot((b - a).cross(c - a));
            let thickness = sheet.thickness[0] + sheet.thickness[1] * mesh.normal.dot((a + b + c) / 3.0);
            // Slices go around the normal, of folded cells against it where matter is taken away; strips have signs.
            thickness * if sheet.is_strip() { area.abs() } else { area }
        };
        triangles.iter().map(of_triangle).sum::<f64>()
    };
    mesh.sheets.iter().map(of_sheet).sum()
}

/// Volume inside the triangles of a cell's surface.
fn volume(parts: &Parts) -> f64 {
    let (cell_type, nodes) = &parts.cells[0];
    let part = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|node| parts.points[node as usize] - parts.points[nodes[0] as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    surface(*cell_type, nodes).iter().map(part).sum()
}

#[test]
fn areas_times_distance_are_the_volume_in_every_pattern() {
    for cell_type in CellType::ALL {
        let mut random = Random(41);
        let (mut worst, mut worst_slices, mut num_flat) = (0.0_f64, 0.0_f64, 0);
        let patterns = patterns(cell_type.num_nodes());
        for pattern in patterns.iter().filter(|pattern| pattern.iter().any(|&first| first != 0)) {
            for jitter in [0.0, 0.12] {
                let parts = cell(cell_type, pattern, jitter, &mut random);
                let (slicer, expected) = (Slicer::new(parts.grid()).unwrap(), volume(&parts).abs());
                let planes = Planes::over(slicer.grid(), NORMAL, 50).unwrap();
                let stack = slicer.slice(&planes).unwrap();
                let areas = stack.sections().flat_map(|(_, section)| {
                    section.areas(planes.normal(), &section.positions(&parts.points))
                });
                let slices = areas.sum::<f64>() * planes.distance();
                worst_slices = worst_slices.max((slices - expected).abs());
                for count in [1, 2, 7] {
                    let found = drawn_volume(&mesh(&parts, NORMAL, count));
                    worst = worst.max((found - expected).abs());
                }
                num_flat += usize::from(expected < 1e-9);
            }
        }
        println!("{cell_type}: {} patterns, {num_flat} of twice as many without volume", patterns.len());
        println!("off by {worst:.1e} with strips (limit 1e-6), by {worst_slices:.1e} without (limit 2e-3)");
        assert!(worst <= 1e-6 && worst_slices <= 2e-3, "{cell_type}: {worst:e}, {worst_slices:e}");
    }
}

#[test]
fn lines_through_collapsed_cells_are_those_through_their_tetrahedra() {
    for cell_type in CellType::ALL {
        let mut random = Random(42);
        let (mut worst, mut num_cells, mut num_met) = (0.0_f64, 0, 0);
        for pattern in patterns(cell_type.num_nodes()) {
            let parts = cell(cell_type, &pattern, 0.08, &mut random);
            let Some(tetrahedra) = tetrahedra(&parts) else { continue };
            num_cells += 1;
            let (sliced, whole) = (mesh(&parts, NORMAL, 5), tetrahedra.grid());
            let mut off = 0.0_f64;
            for _ in 0..40 {
                let place = 0.5 * (DVec3::ONE + random.vector());
                let line = Line { place, direction: NORMAL.normalize() };
                let [found, expected] = [drawn(&sliced, line), chord(&whole, line)];
                off = off.max((found - expected).abs());
                num_met += usize::from(expected > 0.0);
            }
            if off > 5e-6 {
                println!("{cell_type} {pattern:?} is off by {off:.1e}");
            }
            worst = worst.max(off);
        }
        println!("{cell_type}: {num_cells} cells, {num_met} lines, off by {worst:.1e} (limit 5e-6)");
        let least = match cell_type {
            CellType::Tetrahedron => 1,
            CellType::Pyramid => 5,
            CellType::Wedge => 10,
            _ => 100,
        };
        assert!(num_cells >= least && num_met > num_cells, "{num_cells} {num_met}");
        assert!(worst <= 5e-6, "{cell_type}: {worst:e}");
    }
}

#[test]
fn every_pattern_has_a_compact_mesh() {
    for cell_type in CellType::ALL {
        let mut random = Random(43);
        for pattern in patterns(cell_type.num_nodes()) {
            for (jitter, normal) in [(0.0, DVec3::X), (0.0, DVec3::Z), (0.1, NORMAL)] {
                let parts = cell(cell_type, &pattern, jitter, &mut random);
                let slicer = Slicer::new(parts.grid()).unwrap();
                // Of a cell that is a point there is nothing to slice.
                let Ok(planes) = Planes::over(slicer.grid(), normal, 6) else { continue };
                let values = values(slicer.grid());
                let mesh = slicer.mesh(&planes, &values, None).unwrap();
                let compact = CompactMesh::new(&mesh, &parts.points, &values, None).unwrap();
                let expanded = compact.expand();
                assert_eq!(expanded.sheets, mesh.sheets, "{cell_type} {pattern:?}");
                assert_eq!(expanded.triangles.len(), mesh.triangles.len());
            }
        }
    }
}
