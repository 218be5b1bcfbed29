//! One cell at a time.

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};
use volery_scene::CellType;
use volery_slicing::{Planes, Slicer};

use crate::support::{Parts, Random, clipped_area, unit_cell};

/// The same cell the other way round, as the other wedge convention or an inverted cell has it.
fn mirrored(cell_type: CellType, nodes: &[u32]) -> Vec<u32> {
    let order: &[usize] = match cell_type {
        CellType::Tetrahedron => &[0, 2, 1, 3],
        CellType::Pyramid => &[0, 3, 2, 1, 4],
        CellType::Wedge => &[3, 4, 5, 0, 1, 2],
        CellType::Hexahedron | CellType::Voxel => &[4, 5, 6, 7, 0, 1, 2, 3],
    };
    order.iter().map(|&place| nodes[place]).collect()
}

/// A cell in general position: stretched, turned, nodes moved by up to `jitter` and numbered at random.
fn random_cell(cell_type: CellType, jitter: f64, random: &mut Random) -> Parts {
    let stretch = DMat3::from_cols(random.vector(), random.vector(), random.vector()) + 1.5 * DMat3::IDENTITY;
    let corners = unit_cell(cell_type);
    let names = random.shuffled(corners.len());
    let mut points = vec![DVec3::ZERO; corners.len()];
    for (corner, &name) in corners.iter().zip(&names) {
        points[name] = stretch * (*corner + jitter * random.vector());
    }
    let nodes = names.iter().map(|&name| name as u32).collect();
    Parts { points, cells: vec![(cell_type, nodes)] }
}

/// Sum of areas of a cell's polygons in each plane, the oracle's areas, and the signs that occurred.
fn compare_areas(parts: &Parts, planes: &Planes, seen: &mut BTreeSet<u32>) -> f64 {
    let (cell_type, nodes) = &parts.cells[0];
    let stack = Slicer::new(parts.grid()).unwrap().slice(planes).unwrap();
    let mut worst: f64 = 0.0;
    for layer in stack.layers() {
        let expected = clipped_area(&parts.points, *cell_type, nodes, stack.normal(), layer.position);
        let found: f64 = layer.section.as_ref().map_or(0.0, |section| {
            section.areas(stack.normal(), &section.positions(&parts.points)).iter().sum()
        });
        worst = worst.max((found - expected).abs());
        let is_above = |&node: &u32| stack.normal().dot(parts.points[node as usize]) >= layer.position;
        let above = nodes.iter().enumerate().map(|(place, node)| u32::from(is_above(node)) << place);
        seen.insert(above.sum());
    }
    worst
}

#[test]
fn areas_are_those_of_clipped_tetrahedra() {
    for cell_type in CellType::ALL {
        let mut random = Random(cell_type as u64);
        let mut seen = BTreeSet::new();
        let mut worst: f64 = 0.0;
        for round in 0..600 {
            let jitter = [0.0, 0.1, 0.3][round % 3];
            let mut parts = random_cell(cell_type, jitter, &mut random);
            if round % 2 == 1 {
                parts.cells[0].1 = mirrored(cell_type, &parts.cells[0].1);
            }
            let planes = Planes::over(&parts.grid(), random.vector(), 16).unwrap();
            worst = worst.max(compare_areas(&parts, &planes, &mut seen));
        }
        println!(
            "{cell_type}: {} of {} signs, area off by {worst:.1e}, at most 1e-6",
            seen.len(),
            1 << cell_type.num_nodes()
        );
        assert!(worst <= 1e-6, "{cell_type}: {worst:e}");
    }
}

#[test]
fn every_set_of_signs_has_the_area_of_clipped_tetrahedra() {
    let planes = Planes::new(DVec3::Z, vec![0.0], 1.0).unwrap();
    for cell_type in CellType::ALL {
        let mut random = Random(50 + cell_type as u64);
        let (mut seen, mut worst) = (BTreeSet::new(), 0.0f64);
        for above in 0..1u32 << cell_type.num_nodes() {
            for round in 0..6 {
                // Heights of the wanted signs make folded cells; areas then count by orientation, as volumes do.
                let mut parts = random_cell(cell_type, 0.0, &mut random);
                let nodes = parts.cells[0].1.clone();
                for (place, (&node, corner)) in nodes.iter().zip(unit_cell(cell_type)).enumerate() {
                    let height = 0.05 + random.signed().abs();
                    let height = if above >> place & 1 == 1 { height } else { -height };
                    parts.points[node as usize] = DVec3::new(corner.x + 0.3 * corner.z, corner.y, height);
                }
                if round % 2 == 1 {
                    parts.cells[0].1 = mirrored(cell_type, &nodes);
                }
                worst = worst.max(compare_areas(&parts, &planes, &mut seen));
            }
        }
        println!("{cell_type}: {} signs, area off by {worst:.1e}, at most 1e-6", seen.len());
        assert_eq!(seen.len(), 1 << cell_type.num_nodes());
        assert!(worst <= 1e-6, "{cell_type}: {worst:e}");
    }
}

#[test]
fn planes_through_nodes_edges_and_faces() {
    let normals = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::new(1.0, 1.0, 0.0), DVec3::ONE];
    for cell_type in CellType::ALL {
        for normal in normals {
            for flip in [false, true] {
                let mut nodes: Vec<u32> = (0..cell_type.num_nodes() as u32).collect();
                if flip {
                    nodes = mirrored(cell_type, &nodes);
                }
                let parts = Parts { points: unit_cell(cell_type), cells: vec![(cell_type, nodes)] };
                let unit = normal.normalize();
                let mut positions: Vec<f64> = parts.points.iter().map(|&point| unit.dot(point)).collect();
                positions.sort_by(f64::total_cmp);
                positions.dedup();
                let planes = Planes::new(unit, positions.clone(), 1.0).unwrap();
                let stack = Slicer::new(parts.grid()).unwrap().slice(&planes).unwrap();
                let area = |layer: &volery_slicing::Layer| {
                    let section = layer.section.as_ref()?;
                    Some(section.areas(unit, &section.positions(&parts.points)).iter().sum::<f64>())
                };
                // On the plane is above it: the limit from below.
                assert_eq!(area(&stack.layers()[0]), None, "{cell_type}: nothing lies below the lowest node");
                for layer in &stack.layers()[1..] {
                    let (cell_type, nodes) = &parts.cells[0];
                    let below = layer.position - 1e-9;
                    let expected = clipped_area(&parts.points, *cell_type, nodes, unit, below);
                    let found = area(layer).unwrap();
                    let distance = (found - expected).abs();
                    assert!(
                        distance < 1e-7,
                        "{cell_type} {normal} at {}: {found} {expected}",
                        layer.position
                    );
                }
            }
        }
    }
}

#[test]
fn areas_times_distance_converge_to_the_volume_at_second_order() {
    for cell_type in CellType::ALL {
        let mut random = Random(77 + cell_type as u64);
        let counts = [8, 16, 32, 64, 128];
        let mut errors = counts.map(|_| 0.0);
        for _ in 0..40 {
            let parts = random_cell(cell_type, 0.2, &mut random);
            let normal = random.vector();
            let slicer = Slicer::new(parts.grid()).unwrap();
            let sum = |count: usize| -> f64 {
                let stack = slicer.slice(&Planes::over(slicer.grid(), normal, count).unwrap()).unwrap();
                let areas = stack.sections().map(|(layer, section)| {
                    let areas = section.areas(stack.normal(), &section.positions(&parts.points));
                    layer.thickness * areas.iter().sum::<f64>()
                });
                areas.sum()
            };
            let volume = volume(&parts);
            for (error, count) in errors.iter_mut().zip(counts) {
                *error += (sum(count) / volume - 1.0).powi(2);
            }
        }
        let rms = errors.map(|sum: f64| (sum / 40.0).sqrt());
        let order = (rms[0] / rms[4]).log2() / 4.0;
        println!("{cell_type}: relative errors {rms:.6?}, order {order:.2}, at least 1.9");
        assert!(order >= 1.9, "{cell_type}: order {order}");
    }
}

/// The volume by tetrahedra around the centre.
fn volume(parts: &Parts) -> f64 {
    let (cell_type, nodes) = &parts.cells[0];
    let triangles = crate::support::surface(*cell_type, nodes);
    let volumes = triangles.into_iter().map(|triangle| {
        let [a, b, c] = triangle.map(|node| parts.points[node as usize] - parts.points[0]);
        a.dot(b.cross(c)) / 6.0
    });
    volumes.sum::<f64>().abs()
}
