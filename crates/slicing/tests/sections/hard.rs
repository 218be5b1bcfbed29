//! Cells and planes that break slicers.

use glam::DVec3;
use proptest::prelude::*;
use volery_scene::CellType::{self, Hexahedron, Tetrahedron, Wedge};
use volery_slicing::{Planes, Slicer, Stack};

use crate::support::{Parts, clipped_area, mixed, unit_cell};

fn slice(parts: &Parts, planes: &Planes) -> Stack {
    Slicer::new(parts.grid()).unwrap().slice(planes).unwrap()
}

/// Area of all polygons of a layer.
fn area(parts: &Parts, stack: &Stack, layer: usize) -> f64 {
    let Some(section) = &stack.layers()[layer].section else { return 0.0 };
    section.areas(stack.normal(), &section.positions(&parts.points)).iter().sum()
}

#[test]
fn a_wedge_written_as_a_collapsed_hexahedron_is_the_wedge() {
    let wedge = Parts { points: unit_cell(Wedge), cells: vec![(Wedge, vec![0, 1, 2, 3, 4, 5])] };
    let mut collapsed = wedge.clone();
    collapsed.cells = vec![(Hexahedron, vec![0, 1, 2, 2, 3, 4, 5, 5])];
    for normal in [DVec3::X, DVec3::Z, DVec3::new(0.3, 0.5, 0.81), DVec3::new(-1.0, 0.2, 0.1)] {
        let planes = Planes::over(&wedge.grid(), normal, 9).unwrap();
        let [expected, found] =
            [&wedge, &collapsed].map(|parts| crate::support::meaning(&slice(parts, &planes)));
        assert_eq!(found, expected, "{normal}");
    }
}

#[test]
fn cells_without_volume_leave_no_side_unmatched() {
    // A cube with a flat hexahedron on one of its faces, then a second cube.
    let mut points = unit_cell(Hexahedron);
    points.extend(unit_cell(Hexahedron)[4..].to_vec());
    points.extend(unit_cell(Hexahedron)[4..].iter().map(|&point| point + DVec3::Z));
    let cells = [[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11], [8, 9, 10, 11, 12, 13, 14, 15]];
    let parts = Parts { points, cells: cells.map(|nodes| (Hexahedron, nodes.to_vec())).to_vec() };
    let outline = crate::support::outline(&parts.grid());
    for normal in [DVec3::X, DVec3::Z, DVec3::new(0.3, 0.5, 0.81)] {
        let planes = Planes::over(&parts.grid(), normal, 20).unwrap();
        let stack = slice(&parts, &planes);
        for (_, section) in stack.sections() {
            crate::support::num_open_on_outline(section, &outline).unwrap();
        }
        let volume: f64 = (0..20).map(|layer| area(&parts, &stack, layer) * planes.distance()).sum();
        assert!((volume - 2.0).abs() < 0.01, "{normal}: {volume}");
    }
}

#[test]
fn blank_cells_and_nodes_that_are_nowhere_are_left_out() {
    let parts = mixed(4, 0.0, 11);
    let planes = Planes::new(DVec3::Z, vec![0.5, 2.5], 1.0).unwrap();
    let whole = slice(&parts, &planes);
    let lost = parts.cells[0].1[0];
    let mut broken = parts.clone();
    broken.points[lost as usize] = DVec3::new(f64::NAN, f64::INFINITY, 0.0);
    let stack = slice(&broken, &planes);
    let area_of = |without: &dyn Fn(&[u32]) -> bool, plane: f64| -> f64 {
        let cells = parts.cells.iter().filter(|(_, nodes)| !without(nodes));
        cells.map(|(cell_type, nodes)| clipped_area(&parts.points, *cell_type, nodes, DVec3::Z, plane)).sum()
    };
    let expected = area_of(&|nodes| nodes.contains(&lost), 0.5);
    assert!(expected < 16.0 && (area(&broken, &stack, 0) - expected).abs() < 1e-6);
    assert!((area(&parts, &whole, 1) - 16.0).abs() < 1e-6);
    let blank = parts.cells.iter().map(|(_, nodes)| nodes.contains(&lost)).collect();
    let slicer = Slicer::new(parts.grid().with_blank(blank).unwrap()).unwrap();
    let marked = slicer.slice(&planes).unwrap();
    assert_eq!(crate::support::meaning(&marked), crate::support::meaning(&stack));
}

#[test]
fn a_grid_far_from_the_origin_is_cut_like_one_at_it() {
    let near = mixed(4, 0.1, 12);
    let mut far = near.clone();
    far.points.iter_mut().for_each(|point| *point += DVec3::splat(1e6));
    let normal = DVec3::new(0.3, 0.5, 0.81);
    let [near_stack, far_stack] =
        [&near, &far].map(|parts| slice(parts, &Planes::over(&parts.grid(), normal, 30).unwrap()));
    for layer in 0..30 {
        let [expected, found] = [area(&near, &near_stack, layer), area(&far, &far_stack, layer)];
        assert!((found - expected).abs() <= 1e-6 * expected.max(1.0), "layer {layer}: {found}, {expected}");
    }
}

#[test]
fn planes_far_finer_and_far_coarser_than_cells() {
    let parts = Parts { points: unit_cell(Tetrahedron), cells: vec![(Tetrahedron, vec![0, 1, 2, 3])] };
    let fine = Planes::over(&parts.grid(), DVec3::ONE, 100_000).unwrap();
    let stack = slice(&parts, &fine);
    assert_eq!(stack.num_polygons(), 100_000);
    let volume: f64 = (0..100_000).map(|layer| area(&parts, &stack, layer) * fine.distance()).sum();
    assert!((volume * 6.0 - 1.0).abs() < 1e-6, "{volume}");
    let coarse = Planes::new(DVec3::Z, vec![-1e9, 0.25, 1e9], 1e9).unwrap();
    let sections =
        slice(&parts, &coarse).layers().iter().map(|layer| layer.section.is_some()).collect::<Vec<_>>();
    assert_eq!(sections, [false, true, false]);
    let none = Planes::new(DVec3::Z, vec![], 1.0).unwrap();
    assert!(slice(&parts, &none).layers().is_empty());
}

#[test]
fn more_polygons_than_memory_holds_are_an_error() {
    let parts = mixed(6, 0.0, 13);
    let error = Slicer::new(parts.grid())
        .unwrap()
        .slice(&Planes::over(&parts.grid(), DVec3::Z, Planes::MAX).unwrap());
    assert!(error.unwrap_err().to_string().contains("expected at most"));
}

#[test]
fn a_grid_without_cells_has_no_extent_and_no_sections() {
    let nothing = Parts::default();
    assert!(Planes::over(&nothing.grid(), DVec3::Z, 3).is_err());
    let planes = Planes::new(DVec3::Z, vec![0.0, 1.0], 1.0).unwrap();
    assert_eq!(slice(&nothing, &planes).num_polygons(), 0);
}

#[test]
fn grids_too_flat_too_fine_or_too_far_are_refused_with_their_numbers() {
    let box_of = |low: DVec3, size: DVec3| Parts {
        points: unit_cell(Hexahedron).into_iter().map(|point| low + size * point).collect(),
        cells: vec![(Hexahedron, (0..8).collect())],
    };
    let planes =
        |parts: &Parts, count| Planes::over(&parts.grid(), DVec3::Z, count).map_err(|e| e.to_string());
    let flat = planes(&box_of(DVec3::splat(3.0), DVec3::new(1.0, 1.0, 0.0)), 3).unwrap_err();
    assert!(flat.contains("flat along") && flat.contains("at 3,"), "{flat}");
    // An extent of eight steps of what 64 bits hold there.
    let fine = box_of(DVec3::splat(1e9), DVec3::splat(8.0 * 2.0_f64.powi(-23)));
    assert_eq!(planes(&fine, 2).map(|planes| planes.len()), Ok(2));
    let error = planes(&fine, 300).unwrap_err();
    assert!(error.contains("300 planes from 1000000000 to"), "{error}");
    for (size, is_drawn) in [(1e30, true), (1e31, false), (1e300, false)] {
        let slicer = Slicer::new(box_of(DVec3::ZERO, DVec3::new(size, 1.0, 1.0)).grid()).unwrap();
        let planes = Planes::over(slicer.grid(), DVec3::Z, 3).unwrap();
        let mesh = slicer.mesh(&planes, &vec![0.0_f32; 8].into(), None);
        let is_finite = mesh.as_ref().map(|mesh| mesh.points.as_flattened().iter().all(|x| x.is_finite()));
        match is_finite {
            Ok(is_finite) => assert!(is_drawn && is_finite, "{size:e}"),
            Err(error) => assert!(!is_drawn && error.to_string().contains("from its middle"), "{error}"),
        }
    }
}

pub(crate) fn any_parts() -> impl Strategy<Value = Parts> {
    // Few places and few nodes, so that nodes coincide, repeat, and lie on planes.
    let coordinate = prop_oneof![4 => (0..4i32).prop_map(f64::from), 1 => -1e3..1e3f64, 1 => any::<f64>()];
    let point = [coordinate.clone(), coordinate.clone(), coordinate].prop_map(DVec3::from_array);
    let cell = (0..CellType::ALL.len(), proptest::array::uniform8(0..12u32)).prop_map(|(place, nodes)| {
        let cell_type = CellType::ALL[place];
        (cell_type, nodes[..cell_type.num_nodes()].to_vec())
    });
    (proptest::collection::vec(point, 12), proptest::collection::vec(cell, 0..20))
        .prop_map(|(points, cells)| Parts { points, cells })
}

proptest! {
    #[test]
    fn no_cell_however_bad_panics_or_leaves_an_open_polygon(
        parts in any_parts(),
        normal in prop_oneof![Just(DVec3::X), Just(DVec3::ONE), Just(DVec3::new(0.3, 0.5, 0.81))],
        first in -2.0..2.0f64,
    ) {
        let positions = (0..40).map(|plane| first + 0.25 * f64::from(plane)).collect();
        let planes = Planes::new(normal, positions, 0.25).unwrap();
        let stack = slice(&parts, &planes);
        for (_, section) in stack.sections() {
            prop_assert_eq!(section.cells().len(), section.num_polygons());
            prop_assert!(section.weights().iter().all(|weight| (0.0..=1.0).contains(weight)));
            for polygon in section.polygons() {
                prop_assert!(polygon.len() >= 3);
                prop_assert!(polygon.iter().all(|&vertex| (vertex as usize) < section.num_vertices()));
                for (at, vertex) in polygon.iter().enumerate() {
                    prop_assert_ne!(*vertex, polygon[(at + 1) % polygon.len()], "a side of no edge");
                }
            }
        }
        let _ = parts.grid().defects();
    }
}
