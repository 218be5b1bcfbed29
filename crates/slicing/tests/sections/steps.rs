//! Meshes and the values at their vertices: time steps, values that are no numbers, threads.

use std::time::{Duration, Instant};

use glam::DVec3;
use proptest::prelude::*;
use volery_scene::{Samples, UnstructuredGrid};
use volery_slicing::error::{Mesh as MeshError, Values};
use volery_slicing::{Planes, Rays, Refinement, SliceMesh, Slicer, blank_where_not_finite};

use crate::hard::any_parts;
use crate::support::{Random, mixed};

const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);

/// Values and gradients at random.
fn step(grid: &UnstructuredGrid, seed: u64) -> (Samples, Vec<DVec3>) {
    let mut random = Random(seed);
    let values: Vec<f64> = grid.points().iter().map(|_| random.signed()).collect();
    (values.into(), grid.points().iter().map(|_| random.vector()).collect())
}

/// Points, gradients, triangles and sheets.
type Bits = ([Vec<[u32; 4]>; 2], Vec<[u32; 3]>, String);

/// All there is, as bits.
fn bits(mesh: &SliceMesh) -> Bits {
    let of = |vectors: &[[f32; 4]]| vectors.iter().map(|vector| vector.map(f32::to_bits)).collect();
    ([of(&mesh.points), of(&mesh.gradients)], mesh.triangles.clone(), format!("{:?}", mesh.sheets))
}

#[test]
fn other_values_give_the_bits_of_a_new_mesh() {
    let slicer = Slicer::new(mixed(5, 0.15, 51).grid()).unwrap();
    let planes = Planes::over(slicer.grid(), NORMAL, 30).unwrap();
    let refinement = Refinement { first_planes: 4, share: 1.0 };
    let [(first, _), (second, gradients)] = [1, 2].map(|seed| step(slicer.grid(), seed));
    let make = |values: &Samples, gradients| {
        let adaptive = slicer.mesh_adaptively(NORMAL, refinement, values, gradients).unwrap().0;
        [slicer.mesh(&planes, values, gradients).unwrap(), adaptive]
    };
    let (before, anew) = (make(&first, None), make(&second, Some(gradients.as_slice())));
    for (mut mesh, anew) in before.clone().into_iter().zip(anew) {
        mesh.set_values(&second, Some(&gradients)).unwrap();
        assert_eq!(bits(&mesh), bits(&anew));
        assert_eq!(mesh.gradients.len(), mesh.points.len());
        for gradient in &mesh.gradients {
            let length = gradient[..3].iter().map(|part| part * part).sum::<f32>().sqrt();
            assert!((length - 1.0).abs() < 1e-6 && gradient[3] > 0.0, "{gradient:?}");
        }
    }
    let [mut mesh, _] = make(&second, Some(&gradients));
    mesh.set_values(&first, None).unwrap();
    assert_eq!(bits(&mesh), bits(&before[0]), "and back, without gradients");
}

#[test]
fn a_linear_field_is_linear_at_all_vertices() {
    let slicer = Slicer::new(mixed(4, 0.15, 52).grid()).unwrap();
    let rise = DVec3::new(0.7, -1.1, 0.4);
    let values: Vec<f64> = slicer.grid().points().iter().map(|&point| rise.dot(point)).collect();
    let gradients = vec![rise; values.len()];
    let planes = Planes::over(slicer.grid(), NORMAL, 20).unwrap();
    let mesh = slicer.mesh(&planes, &values.into(), Some(&gradients)).unwrap();
    let mut worst = 0.0f64;
    for (point, gradient) in mesh.points.iter().zip(&mesh.gradients) {
        let [x, y, z, value] = point.map(f64::from);
        worst = worst.max((rise.dot(DVec3::new(x, y, z) + mesh.origin) - value).abs());
        let [x, y, z, magnitude] = gradient.map(f64::from);
        worst = worst.max((DVec3::new(x, y, z) * magnitude - rise).length());
    }
    println!("values and gradients wrong by {worst:.1e}, limit 1e-6");
    assert!(worst <= 1e-6);
}

#[test]
fn values_that_do_not_fit_are_errors_and_change_nothing() {
    let slicer = Slicer::new(mixed(2, 0.1, 53).grid()).unwrap();
    let planes = Planes::over(slicer.grid(), NORMAL, 5).unwrap();
    let (values, gradients) = step(slicer.grid(), 3);
    let expected = values.len();
    let few: Samples = vec![0.0f32; expected - 1].into();
    let error = slicer.mesh(&planes, &few, None).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("slice mesh: {} values at nodes, expected {expected}", expected - 1)
    );
    assert!(slicer.mesh(&planes, &values, Some(&gradients[1..])).is_err());
    let mut mesh = slicer.mesh(&planes, &values, Some(&gradients)).unwrap();
    let before = bits(&mesh);
    let one: Samples = vec![0u8].into();
    assert!(matches!(mesh.set_values(&one, None), Err(Values::Count { found: 1, .. })));
    assert!(matches!(mesh.set_values(&values, Some(&[])), Err(Values::Count { what: "gradients", .. })));
    assert_eq!(bits(&mesh), before);
    mesh.edges.clear();
    let error = mesh.set_values(&values, None).unwrap_err();
    assert!(matches!(error, Values::NoEdges { found: 0, .. }), "{error}");
}

#[test]
fn cells_around_values_that_are_no_numbers_can_be_left_out() {
    let grid = mixed(4, 0.1, 54).grid();
    let mut values: Vec<f32> = (0..grid.points().len()).map(|node| node as f32).collect();
    let lost = [grid.cells().get(5).1[0], grid.cells().get(60).1[1]];
    (values[lost[0] as usize], values[lost[1] as usize]) = (f32::NAN, f32::INFINITY);
    let values: Samples = values.into();
    let mut marked = vec![false; grid.cells().len()];
    marked[0] = true;
    let grid = grid.with_blank(marked).unwrap();
    let blank = blank_where_not_finite(&grid, &values);
    for (cell, (_, nodes)) in grid.cells().iter().enumerate() {
        assert_eq!(blank[cell], cell == 0 || nodes.iter().any(|node| lost.contains(node)), "cell {cell}");
    }
    let slicer = Slicer::new(grid.with_blank(blank).unwrap()).unwrap();
    let planes = Planes::over(slicer.grid(), NORMAL, 20).unwrap();
    let mesh = slicer.mesh(&planes, &values, None).unwrap();
    assert!(mesh.points.len() > 100 && mesh.points.as_flattened().iter().all(|part| part.is_finite()));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let parts = mixed(8, 0.15, 55);
    let refinement = Refinement { first_planes: 10, share: 1.0 };
    let make = |num_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(num_threads).build().unwrap();
        pool.install(|| {
            let slicer = Slicer::new(parts.grid()).unwrap();
            let (values, gradients) = step(slicer.grid(), 4);
            let planes = Planes::over(slicer.grid(), NORMAL, 50).unwrap();
            let mut even = slicer.mesh(&planes, &values, Some(&gradients)).unwrap();
            even.orient_strips(Rays::From(DVec3::new(20.0, -10.0, 12.0)));
            let (adaptive, steps) = slicer.mesh_adaptively(NORMAL, refinement, &values, None).unwrap();
            (bits(&even), bits(&adaptive), steps)
        })
    };
    let expected = make(1);
    assert_eq!(make(2), expected);
    assert_eq!(make(7), expected);
}

#[test]
fn a_time_step_is_far_cheaper_than_a_mesh() {
    let slicer = Slicer::new(mixed(20, 0.1, 56).grid()).unwrap();
    let planes = Planes::over(slicer.grid(), NORMAL, 128).unwrap();
    let (values, _) = step(slicer.grid(), 5);
    let mut mesh = slicer.mesh(&planes, &values, None).unwrap();
    let shortest = |run: &mut dyn FnMut()| {
        let timed = |_| {
            let started = Instant::now();
            run();
            started.elapsed()
        };
        (0..9).map(timed).min().unwrap_or(Duration::MAX).as_secs_f64()
    };
    let update = shortest(&mut || mesh.set_values(&values, None).unwrap());
    let anew = shortest(&mut || assert!(slicer.mesh(&planes, &values, None).is_ok()));
    println!(
        "update {:.2} ms, mesh {:.2} ms: {:.1} times faster, at least 5 here",
        update * 1e3,
        anew * 1e3,
        anew / update
    );
    assert!(anew >= 5.0 * update);
}

proptest! {
    #[test]
    fn no_cell_however_bad_panics_or_leaves_the_mesh_inconsistent(
        parts in any_parts(),
        normal in prop_oneof![Just(DVec3::X), Just(DVec3::ONE), Just(NORMAL)],
        first in -2.0..2.0f64,
    ) {
        let slicer = Slicer::new(parts.grid()).unwrap();
        let (values, gradients) = step(slicer.grid(), 6);
        let positions = (0..20).map(|plane| first + 0.3 * f64::from(plane)).collect();
        let planes = Planes::new(normal, positions, 0.3).unwrap();
        let mut mesh = match slicer.mesh(&planes, &values, Some(&gradients)) {
            Ok(mesh) => mesh,
            // Folded cells may reach beyond 32 bits, which is said.
            Err(error) => {
                prop_assert!(matches!(error, MeshError::TooFar { .. }), "{}", error);
                return Ok(());
            }
        };
        mesh.orient_strips(Rays::From(DVec3::new(0.5, 0.2, -3.0)));
        let refinement = Refinement { first_planes: 3, share: 0.9 };
        let adaptive = slicer.mesh_adaptively(normal, refinement, &values, None).map(|(mesh, _)| mesh);
        for mesh in adaptive.into_iter().chain([mesh]) {
            let num_vertices = mesh.points.len() as u32;
            prop_assert!(mesh.triangles.as_flattened().iter().all(|&vertex| vertex < num_vertices));
            let mut ranges: Vec<_> = mesh.sheets.iter().map(|sheet| sheet.triangles.clone()).collect();
            ranges.sort_by_key(|range| range.start);
            let covered = ranges.iter().try_fold(0, |end, range| (end == range.start).then_some(range.end));
            prop_assert_eq!(covered, Some(mesh.triangles.len() as u32), "every triangle once");
            prop_assert!(mesh.sheets.is_sorted_by(|a, b| a.position <= b.position));
        }
    }
}
