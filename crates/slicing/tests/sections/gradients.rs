//! Gradients at nodes: exact on linear fields, whatever the cells; of least norm where directions are missing.

use glam::{DMat3, DVec3};
use proptest::prelude::*;
use volery_scene::{CellType, Samples, UnstructuredGrid};
use volery_slicing::node_gradients;

use crate::support::{Parts, Random, mixed, unit_cell};

const SLOPE: DVec3 = DVec3::new(2.0, -3.0, 5.0);

fn linear(grid: &UnstructuredGrid, slope: DVec3, at_origin: f64) -> Samples {
    Samples::from(grid.points().iter().map(|&point| at_origin + slope.dot(point)).collect::<Vec<_>>())
}

/// The largest error of the gradients at nodes that cells use, over the length of the slope.
fn worst(parts: &Parts, slope: DVec3) -> f64 {
    let grid = parts.grid();
    let found = node_gradients(&grid, &linear(&grid, slope, 0.0));
    let used = parts.cells.iter().flat_map(|(_, nodes)| nodes);
    used.map(|&node| (found[node as usize] - slope).length()).fold(0.0, f64::max) / slope.length()
}

fn check(what: &str, found: f64, most: f64) {
    println!("{what}: relative error {found:.1e}, at most {most:.1e}");
    assert!(found <= most, "{what}: {found:e}");
}

fn moved(parts: &Parts, place: impl Fn(DVec3) -> DVec3) -> Parts {
    Parts { points: parts.points.iter().map(|&point| place(point)).collect(), cells: parts.cells.clone() }
}

#[test]
fn linear_fields_are_exact_in_single_cells_either_way_round() {
    for cell_type in CellType::ALL {
        let nodes: Vec<u32> = (0..cell_type.num_nodes() as u32).collect();
        let mut random = Random(cell_type as u64);
        let mut found: f64 = 0.0;
        for _ in 0..200 {
            let points =
                unit_cell(cell_type).into_iter().map(|point| point + 0.2 * random.vector()).collect();
            let mut parts = Parts { points, cells: vec![(cell_type, nodes.clone())] };
            found = found.max(worst(&parts, SLOPE));
            parts.cells[0].1.reverse();
            found = found.max(worst(&parts, SLOPE));
        }
        check(cell_type.name(), found, 1e-12);
    }
}

#[test]
fn linear_fields_are_exact_in_mixed_stretched_sheared_and_distant_grids() {
    let parts = mixed(6, 0.2, 5);
    check("mixed, warped, collapsed", worst(&parts, SLOPE), 1e-13);
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 0.5, 0.81).normalize(), 0.7);
    // Values are rounded at 1e-15 and differ by 1e-4 from thin cell to thin cell.
    let stretch = DVec3::new(1.0, 1e-4, 0.01);
    let thin = moved(&mixed(6, 0.0, 6), |point| turn * (stretch * point));
    check("stretched by 1e4, turned", worst(&thin, SLOPE), 1e-10);
    let warped = moved(&parts, |point| turn * (stretch * point));
    check("stretched by 1e4, warped, turned", worst(&warped, SLOPE), 1e-9);
    // Directions within 1e-2 of a line and 1e-4 of a plane.
    let shear = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(100.0, 20.0, 1.0));
    check("sheared by 1e2", worst(&moved(&parts, |point| shear * point), SLOPE), 1e-9);
    // Coordinates are rounded at 1e-10, values at ten times that.
    check("1e6 away", worst(&moved(&parts, |point| point + DVec3::splat(1e6)), SLOPE), 1e-8);
    let both = moved(&parts, |point| turn * (stretch * point) + DVec3::splat(1e3));
    check("stretched by 1e4, 1e3 away", worst(&both, SLOPE), 1e-7);
    for scale in [1e-100, 1e100] {
        check("other units", worst(&moved(&parts, |point| scale * point), SLOPE), 1e-13);
    }
}

/// A cube of which only the face at `z = 0` has values.
fn one_sided() -> (UnstructuredGrid, Samples) {
    let points = unit_cell(CellType::Hexahedron);
    let parts = Parts { points, cells: vec![(CellType::Hexahedron, (0..8).collect())] };
    let grid = parts.grid();
    let value = |point: &DVec3| if point.z == 0.0 { SLOPE.dot(*point) } else { f64::NAN };
    let values = Samples::from(grid.points().iter().map(value).collect::<Vec<_>>());
    (grid, values)
}

#[test]
fn without_directions_across_the_gradient_has_no_part_across() {
    let (grid, values) = one_sided();
    let found = node_gradients(&grid, &values);
    for (node, gradient) in found.iter().enumerate() {
        let expected = if node < 4 { DVec3::new(SLOPE.x, SLOPE.y, 0.0) } else { DVec3::ZERO };
        assert!((*gradient - expected).length() < 1e-14, "node {node}: {gradient}, expected {expected}");
    }
    // A flat hexahedron, turned out of the axes: the slope within its plane.
    let turn = DMat3::from_axis_angle(DVec3::new(0.3, 0.5, 0.81).normalize(), 0.7);
    let flat =
        unit_cell(CellType::Hexahedron).into_iter().map(|point| turn * (point * DVec3::new(1.0, 1.0, 0.0)));
    let parts = Parts { points: flat.collect(), cells: vec![(CellType::Hexahedron, (0..8).collect())] };
    let grid = parts.grid();
    let expected = SLOPE - turn.z_axis * turn.z_axis.dot(SLOPE);
    for gradient in node_gradients(&grid, &linear(&grid, SLOPE, 0.0)) {
        assert!((gradient - expected).length() < 1e-13, "{gradient}, expected {expected}");
    }
    // On a line: the slope along it.
    let along = DVec3::new(1.0, 2.0, -2.0) / 3.0;
    let points = [0.0, 1.0, 3.0, 4.0].map(|distance| distance * along).to_vec();
    let grid = Parts { points, cells: vec![(CellType::Tetrahedron, vec![0, 1, 2, 3])] }.grid();
    for gradient in node_gradients(&grid, &linear(&grid, SLOPE, 7.0)) {
        assert!((gradient - along * along.dot(SLOPE)).length() < 1e-14, "{gradient}");
    }
}

#[test]
fn nodes_without_value_place_or_cell_do_no_harm() {
    let parts = mixed(4, 0.1, 9);
    let used = parts.cells[0].1.clone();
    let mut points = parts.points.clone();
    let num_points = points.len();
    points.push(DVec3::ONE);
    let grid = Parts { points, cells: parts.cells.clone() }.grid();
    let mut values: Vec<f64> = grid.points().iter().map(|&point| SLOPE.dot(point)).collect();
    values[used[0] as usize] = f64::NAN;
    values[used[1] as usize] = f64::NEG_INFINITY;
    let found = node_gradients(&grid, &Samples::from(values));
    assert_eq!([found[used[0] as usize], found[used[1] as usize], found[num_points]], [DVec3::ZERO; 3]);
    for node in parts.cells.iter().flat_map(|(_, nodes)| nodes).filter(|node| !used[..2].contains(node)) {
        assert!((found[*node as usize] - SLOPE).length() < 1e-12, "node {node}: {}", found[*node as usize]);
    }
    // Blank cells, and nodes that are nowhere.
    let blank = grid.clone().with_blank(vec![true; grid.cells().len()]).unwrap();
    let values = linear(&grid, SLOPE, 0.0);
    assert!(node_gradients(&blank, &values).iter().all(|&gradient| gradient == DVec3::ZERO));
    let mut lost = parts.clone();
    lost.points[used[0] as usize] = DVec3::new(0.0, f64::NAN, f64::INFINITY);
    assert!(node_gradients(&lost.grid(), &values).iter().all(|gradient| gradient.is_finite()));
}

#[test]
fn numbers_at_the_ends_of_their_range_give_numbers() {
    let far = [0.0, 1e-300, 1e300, f64::MAX, -f64::MAX, f64::MIN_POSITIVE, 1e154, 1e-154];
    let mut random = Random(3);
    for _ in 0..2000 {
        let mut pick = || far[random.below(far.len())];
        let points = (0..8).map(|_| DVec3::new(pick(), pick(), pick())).collect();
        let values: Vec<f64> = (0..8).map(|_| pick()).collect();
        let grid = Parts { points, cells: vec![(CellType::Hexahedron, (0..8).collect())] }.grid();
        let found = node_gradients(&grid, &Samples::from(values));
        assert!(found.iter().all(|gradient| gradient.is_finite()), "{grid:?}: {found:?}");
    }
}

/// The middle of evenly spaced nodes has the derivative of a parabola exactly; at the outline, and where cells are
/// warped, errors fall with the distance.
#[test]
fn curved_fields_converge() {
    let field = |point: DVec3| (point.x).sin() * (1.3 * point.y).cos() + point.z * point.x;
    let slope = |point: DVec3| {
        let [sine, cosine] = [point.x.sin(), point.x.cos()];
        let [across, turned] = [(1.3 * point.y).cos(), (1.3 * point.y).sin()];
        DVec3::new(cosine * across + point.z, -1.3 * sine * turned, point.x)
    };
    let errors = [4, 8, 16].map(|size| {
        let parts = moved(&mixed(size, 0.15, 21), |point| point / size as f64);
        let grid = parts.grid();
        let values: Vec<f64> = grid.points().iter().map(|&point| field(point)).collect();
        let found = node_gradients(&grid, &Samples::from(values));
        let mut squares = (0.0, 0usize);
        for &node in parts.cells.iter().flat_map(|(_, nodes)| nodes) {
            squares.0 += (found[node as usize] - slope(grid.points()[node as usize])).length_squared();
            squares.1 += 1;
        }
        (squares.0 / squares.1 as f64).sqrt()
    });
    println!("rms errors {errors:?}, each at most 0.65 of the one before");
    assert!(errors[0] < 0.2 && errors[1] < 0.65 * errors[0] && errors[2] < 0.65 * errors[1], "{errors:?}");
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let grid = mixed(8, 0.2, 13).grid();
    let values = linear(&grid, SLOPE, 0.5);
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| node_gradients(&grid, &values));
        found.iter().map(|gradient| gradient.to_array().map(f64::to_bits)).collect::<Vec<_>>()
    };
    let alone = bits(1);
    assert_eq!(bits(2), alone);
    assert_eq!(bits(7), alone);
}

/// The slow way: every neighbour once per shared cell, normal equations by elimination with pivots in f64.
fn by_elimination(parts: &Parts, values: &[f64], node: usize) -> DVec3 {
    let mut rows = [[0.0; 4]; 3];
    for (_, nodes) in &parts.cells {
        let places = nodes.iter().filter(|&&own| own as usize == node).count();
        for (&other, _) in nodes.iter().flat_map(|other| std::iter::repeat_n((other, ()), places)) {
            let d = (parts.points[other as usize] - parts.points[node]).to_array();
            let squared: f64 = d.iter().map(|x| x * x).sum();
            if squared > 0.0 {
                for (row, from) in rows.iter_mut().zip(d) {
                    (0..3).for_each(|column| row[column] += from * d[column] / squared);
                    row[3] += from * (values[other as usize] - values[node]) / squared;
                }
            }
        }
    }
    for at in 0..3 {
        let pivot = (at..3).max_by(|&a, &b| rows[a][at].abs().total_cmp(&rows[b][at].abs())).unwrap();
        rows.swap(at, pivot);
        for other in (0..3).filter(|&other| other != at) {
            let factor = rows[other][at] / rows[at][at];
            (at..4).for_each(|column| rows[other][column] -= factor * rows[at][column]);
        }
    }
    DVec3::from_array([0, 1, 2].map(|at| rows[at][3] / rows[at][at]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_values_give_the_least_squares(seed in any::<u64>(), stretch in -3.0..3.0f64) {
        let parts = moved(&mixed(3, 0.25, seed), |point| point * DVec3::new(1.0, stretch.exp(), 0.5));
        let mut random = Random(seed);
        let values: Vec<f64> = parts.points.iter().map(|_| random.signed()).collect();
        let found = node_gradients(&parts.grid(), &Samples::from(values.clone()));
        for &node in parts.cells.iter().flat_map(|(_, nodes)| nodes) {
            let expected = by_elimination(&parts, &values, node as usize);
            let error = (found[node as usize] - expected).length() / expected.length().max(1.0);
            prop_assert!(error < 1e-10, "node {}: {} is not {}", node, found[node as usize], expected);
        }
    }
}
