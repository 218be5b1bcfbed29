//! Cells beside each other.

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use volery_slicing::{Planes, Slicer, Stack};

use crate::support::{Parts, Random, clipped_area, meaning, mixed, num_open_on_outline, outline};

/// Every section covers the grid once: sides match, every polygon goes around the normal, areas add up.
fn check_cover(parts: &Parts, planes: &Planes, shift: f64) -> [f64; 2] {
    let grid = parts.grid();
    let outline = outline(&grid);
    let stack = Slicer::new(grid).unwrap().slice(planes).unwrap();
    let (mut worst, mut least): (f64, f64) = (0.0, 0.0);
    for layer in stack.layers() {
        let cut = |(cell_type, nodes): &(_, Vec<u32>)| {
            clipped_area(&parts.points, *cell_type, nodes, stack.normal(), layer.position - shift)
        };
        let expected: f64 = parts.cells.iter().map(cut).sum();
        let Some(section) = &layer.section else {
            assert!(expected < 1e-5, "nothing at {}, expected an area of {expected}", layer.position);
            continue;
        };
        num_open_on_outline(section, &outline).unwrap();
        let areas = section.areas(stack.normal(), &section.positions(&parts.points));
        least = areas.iter().copied().fold(least, f64::min);
        worst = worst.max((areas.iter().sum::<f64>() - expected).abs() / expected.max(1.0));
        let positions = section.positions(&parts.points);
        for [a, b, c] in section.triangles(stack.normal(), &positions) {
            let [a, b, c] = [a, b, c].map(|vertex| positions[vertex as usize]);
            least = least.min(0.5 * stack.normal().dot((b - a).cross(c - a)));
        }
    }
    [worst, least]
}

#[test]
fn sections_of_mixed_warped_collapsed_cells_have_no_hole_and_no_overlap() {
    for seed in 0..12 {
        let mut random = Random(1000 + seed);
        let parts = mixed(5, 0.12, seed);
        for normal in [random.vector(), DVec3::new(0.3, 0.5, 0.81), DVec3::Z, DVec3::X] {
            let planes = Planes::over(&parts.grid(), normal, 40).unwrap();
            let [worst, least] = check_cover(&parts, &planes, 0.0);
            assert!(worst <= 1e-6, "seed {seed}, {normal}: area off by {worst:e}, at most 1e-6");
            assert!(
                least >= -1e-6,
                "seed {seed}, {normal}: {least:e} of a polygon or triangle lies over another"
            );
        }
    }
}

#[test]
fn planes_through_nodes_and_whole_layers_draw_everything_once() {
    let parts = mixed(5, 0.0, 3);
    for normal in [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::ONE, DVec3::new(1.0, -1.0, 0.0)] {
        let unit = normal.normalize();
        let mut positions: Vec<f64> = parts.points.iter().map(|&point| unit.dot(point)).collect();
        positions.sort_by(f64::total_cmp);
        positions.dedup();
        let planes = Planes::new(unit, positions, 1.0).unwrap();
        let [worst, least] = check_cover(&parts, &planes, 1e-9);
        assert!(worst <= 1e-6 && least >= -1e-6, "{normal}: area off by {worst:e}, least {least:e}");
    }
    let planes = Planes::new(DVec3::Z, vec![0.0, 1.0, 5.0], 1.0).unwrap();
    let stack = Slicer::new(parts.grid()).unwrap().slice(&planes).unwrap();
    let area = |layer: usize| -> f64 {
        let section = stack.layers()[layer].section.as_ref().unwrap();
        section.areas(DVec3::Z, &section.positions(&parts.points)).iter().sum()
    };
    assert!(stack.layers()[0].section.is_none(), "a layer of faces in the plane is drawn by the cells below");
    assert!((area(1) - 25.0).abs() < 1e-6 && (area(2) - 25.0).abs() < 1e-6);
}

#[test]
fn the_same_bits_for_1_2_and_7_threads() {
    let parts = mixed(8, 0.1, 5);
    let slicer = Slicer::new(parts.grid()).unwrap();
    let planes = Planes::over(slicer.grid(), DVec3::new(0.3, 0.5, 0.81), 64).unwrap();
    let with = |threads: usize| -> Stack {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Slicer::new(parts.grid()).unwrap().slice(&planes).unwrap())
    };
    let one = with(1);
    assert!(one.num_polygons() > 1000);
    for threads in [2, 7] {
        assert_eq!(with(threads), one, "{threads} threads");
    }
}

#[test]
fn the_same_polygons_for_cells_in_any_order() {
    let parts = mixed(8, 0.1, 6);
    let planes = Planes::over(&parts.grid(), DVec3::new(-0.2, 0.5, 0.4), 64).unwrap();
    let of = |parts: &Parts| meaning(&Slicer::new(parts.grid()).unwrap().slice(&planes).unwrap());
    let expected = of(&parts);
    for seed in 0..3 {
        assert!(of(&parts.shuffled(&mut Random(seed))) == expected, "seed {seed}");
    }
}

#[test]
fn slices_put_between_others_are_those_of_one_pass() {
    let slicer = Slicer::new(mixed(6, 0.1, 7).grid()).unwrap();
    let normal = DVec3::new(0.3, 0.5, 0.81);
    let all = Planes::over(slicer.grid(), normal, 60).unwrap();
    let [even, odd] = [0, 1].map(|first| {
        let positions = all.positions().iter().copied().skip(first).step_by(2).collect();
        slicer.slice(&Planes::new(all.normal(), positions, all.distance()).unwrap()).unwrap()
    });
    let mut merged = even.clone();
    merged.merge(odd).unwrap();
    assert_eq!(merged, slicer.slice(&all).unwrap());
    let other = slicer.slice(&Planes::over(slicer.grid(), DVec3::X, 3).unwrap()).unwrap();
    let error = merged.merge(other).unwrap_err();
    assert_eq!(error.found, DVec3::X);
    let mut thinned = merged;
    let kept: Vec<f64> = even.layers().iter().map(|layer| layer.position).collect();
    thinned.retain(|layer| kept.contains(&layer.position));
    assert_eq!(thinned, even);
}

#[test]
fn vertices_between_equal_nodes_of_neighbours_are_one() {
    let parts = mixed(6, 0.1, 8);
    let slicer = Slicer::new(parts.grid()).unwrap();
    let stack = slicer.slice(&Planes::over(slicer.grid(), DVec3::new(0.1, 0.2, 0.9), 20).unwrap()).unwrap();
    for (_, section) in stack.sections() {
        let mut edges = section.edges().to_vec();
        edges.sort_unstable();
        edges.dedup();
        assert_eq!(edges.len(), section.num_vertices(), "one vertex per edge");
        assert!(section.weights().iter().all(|weight| (0.0..=1.0).contains(weight)));
        assert!(section.edges().iter().all(|[low, high]| low < high));
    }
}

#[test]
fn values_linear_in_space_are_exact_at_vertices() {
    let parts = mixed(5, 0.1, 9);
    let linear = |point: DVec3| 2.0 * point.x - 3.0 * point.y + point.z + 5.0;
    let values: Vec<f64> = parts.points.iter().map(|&point| linear(point)).collect();
    let slicer = Slicer::new(parts.grid().with_array("linear", values).unwrap()).unwrap();
    let stack = slicer.slice(&Planes::over(slicer.grid(), DVec3::ONE, 20).unwrap()).unwrap();
    for (layer, section) in stack.sections() {
        let found = section.values(&slicer.grid().arrays()[0].values);
        for (value, position) in found.into_iter().zip(section.positions(&parts.points)) {
            assert!((f64::from(value) - linear(position)).abs() < 1e-5);
            assert!((stack.normal().dot(position) - layer.position).abs() < 1e-6, "on its plane");
        }
    }
}
