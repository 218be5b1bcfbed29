//! The reference against slow ways to the same pictures that share nothing with it.

use crate::slow::{Random, cell_of, check, difference, march, oracle, orthographic, perspective, transfer};
use glam::DVec3;
use volery_data::{half_space, holes, marschner_lobb, noise};
use volery_reference::{Image, Light, Tracer, metrics, render};
use volery_scene::{Camera, Ray, TransferFunction, VoxelGrid};

const TOLERANCE: f64 = 1e-9;
const THRESHOLD: f64 = 1e-9;

/// Smooth over the whole range of values: no kink, no step.
fn smooth(low: f64, high: f64) -> TransferFunction {
    transfer(&[(low, [0.1, 0.4, 1.0], 0.0), (high, [1.0, 0.7, 0.1], 0.7)], 1.0)
}

/// Everything a transfer function can have: clear stretches, kinks, a step up and down, a peak of opacity 1,
/// and an opaque end.
fn wild(low: f64, high: f64) -> TransferFunction {
    let at = |w: f64| low + (high - low) * w;
    let points = [
        (at(0.1), [0.0, 0.1, 0.9], 0.0),
        (at(0.2), [0.5, 0.1, 0.9], 0.3),
        (at(0.3), [0.5, 0.8, 0.0], 0.0),
        (at(0.4), [0.5, 0.8, 0.0], 0.0),
        (at(0.4), [0.9, 0.2, 0.1], 0.1),
        (at(0.5), [0.1, 0.2, 0.8], 0.2),
        (at(0.5), [0.9, 0.9, 0.9], 0.01),
        (at(0.65), [0.6, 0.3, 0.9], 1.0),
        (at(0.8), [0.6, 0.9, 0.3], 0.4),
        (at(0.95), [1.0, 0.1, 0.3], 0.7),
        (at(0.95), [0.1, 1.0, 0.3], 1.0),
    ];
    transfer(&points, 3.0)
}

/// The greatest difference from the oracle over rays.
fn greatest_difference(grid: &VoxelGrid, transfer: &TransferFunction, rays: &[Ray]) -> f64 {
    let tracer = Tracer::new(grid, transfer).expect("scalars");
    let mut lit = 0;
    let mut greatest = 0.0;
    for ray in rays {
        let (found, expected) = (tracer.trace(ray), oracle(grid, transfer, ray, TOLERANCE));
        let error = difference(&found, &expected);
        assert!(error <= THRESHOLD, "{ray:?}: {found:?}, expected {expected:?}");
        greatest = f64::max(greatest, error);
        lit += usize::from(found.transmittance < 0.99);
    }
    assert!(lit * 4 >= rays.len(), "{lit} of {} rays meet matter", rays.len());
    greatest
}

/// From around the domain into it.
fn random_rays(grid: &VoxelGrid, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let extent = grid.extent();
    let ray = |_| {
        let origin = (random.point() * 3.0 - DVec3::ONE) * extent;
        Ray { origin, direction: (random.point() * extent - origin).normalize() }
    };
    (0..count).map(ray).collect()
}

#[test]
fn random_rays_through_noise() {
    for (dims, seed) in [([6, 7, 5], 1), ([2, 2, 2], 2), ([2, 9, 17], 3), ([13, 3, 2], 4)] {
        let grid = noise(dims, seed);
        for (name, transfer) in [("smooth", smooth(0.0, 255.0)), ("wild", wild(0.0, 255.0))] {
            let error = greatest_difference(&grid, &transfer, &random_rays(&grid, 40, seed + 10));
            check(&format!("noise {dims:?}, {name}"), error, THRESHOLD);
        }
    }
}

#[test]
fn anisotropic_spacing() {
    for spacing in [DVec3::new(1.0, 1.0, 10.0), DVec3::new(0.3, 2.0, 0.1)] {
        let samples = noise([5, 6, 4], 5).samples().clone();
        let grid = VoxelGrid::new([5, 6, 4], spacing, samples).unwrap();
        let error = greatest_difference(&grid, &wild(0.0, 255.0), &random_rays(&grid, 40, 6));
        check(&format!("spacing {spacing}"), error, THRESHOLD);
    }
}

#[test]
fn layers_far_thinner_than_a_cell() {
    // All light comes from a layer at the front, a millionth of a cell thin, in which the colour changes.
    let grid = noise([4, 4, 4], 16);
    for unit_distance in [1e-2, 1e-4, 1e-6] {
        let points = [(-10.0, [0.1, 0.4, 1.0], 0.0), (260.0, [1.0, 0.7, 0.1], 0.9)];
        let matter = transfer(&points, unit_distance);
        let error = greatest_difference(&grid, &matter, &random_rays(&grid, 40, 17));
        check(&format!("opacity per {unit_distance:e}"), error, THRESHOLD);
    }
}

#[test]
fn a_transfer_function_with_more_points_than_values() {
    let points: Vec<_> = (0..1024)
        .map(|i| {
            let wave = f64::from(i * 37 % 101) / 101.0;
            (f64::from(i) / 4.0, [wave, 1.0 - wave, 0.5], if i % 5 == 0 { 0.0 } else { wave * 0.3 })
        })
        .collect();
    let grid = noise([4, 3, 4], 18);
    let error = greatest_difference(&grid, &transfer(&points, 1.0), &random_rays(&grid, 8, 19));
    check("1,024 control points", error, THRESHOLD);
}

#[test]
fn blank_samples() {
    // A quarter of the cells is left.
    let grid = holes([9, 8, 10], 7, 0.15);
    let rays = random_rays(&grid, 150, 8);
    let error = greatest_difference(&grid, &smooth(-0.2, 1.0), &rays);
    check("holes", error, THRESHOLD);
    let all_blank = holes([5, 5, 5], 9, 1.1);
    let tracer = Tracer::new(&all_blank, &wild(0.0, 1.0)).unwrap();
    for ray in &random_rays(&all_blank, 50, 10) {
        assert_eq!(tracer.trace(ray), Light::CLEAR);
    }
}

/// Rays from corners, edges, faces and centres of cells along all 26 directions of the grid.
fn lattice_rays(grid: &VoxelGrid) -> Vec<Ray> {
    let mut rays = Vec::new();
    for code in 0..27 {
        let direction = DVec3::new((code % 3) as f64, (code / 3 % 3) as f64, (code / 9) as f64) - DVec3::ONE;
        if direction == DVec3::ZERO {
            continue;
        }
        let direction = (direction * grid.spacing()).normalize();
        for start in 0..27 {
            // Halves from -1 to beyond the domain, so that starts are in front of it, in it and behind it.
            let halves = DVec3::new((start % 3) as f64, (start / 3 % 3) as f64, (start / 9) as f64);
            let origin = (halves * 1.5 - DVec3::splat(0.5)) * grid.spacing();
            rays.push(Ray { origin, direction });
            rays.push(Ray { origin: origin + grid.spacing() * 0.5, direction });
        }
    }
    rays
}

#[test]
fn eyes_on_corners_edges_faces_and_rays_along_them() {
    for spacing in [DVec3::ONE, DVec3::new(0.5, 1.0, 4.0)] {
        let samples = noise([4, 4, 3], 11).samples().clone();
        let grid = VoxelGrid::new([4, 4, 3], spacing, samples).unwrap();
        let error = greatest_difference(&grid, &smooth(-20.0, 255.0), &lattice_rays(&grid));
        check(&format!("lattice rays, spacing {spacing}"), error, THRESHOLD);
    }
}

#[test]
fn rays_a_few_ulps_off_the_lattice() {
    let grid = noise([4, 4, 3], 12);
    let mut random = Random::new(13);
    let mut jiggle = |x: f64| {
        let ulps = random.below(65) as f64 - 32.0;
        x + ulps * f64::EPSILON * x.abs().max(0.1)
    };
    let mut off = |v: DVec3| DVec3::new(jiggle(v.x), jiggle(v.y), jiggle(v.z));
    let rays: Vec<Ray> = lattice_rays(&grid)
        .into_iter()
        .map(|ray| Ray { origin: off(ray.origin), direction: off(ray.direction).normalize() })
        .collect();
    let error = greatest_difference_where_inside(&grid, &smooth(-20.0, 255.0), &rays);
    check("rays 32 ulps off the lattice", error, THRESHOLD);
}

/// Rays that graze the domain's faces within rounding may meet matter or not; both are right, so they are
/// left out.
fn greatest_difference_where_inside(grid: &VoxelGrid, transfer: &TransferFunction, rays: &[Ray]) -> f64 {
    let grazes = |ray: &Ray| {
        (0..3).any(|axis| {
            let last = grid.extent()[axis];
            ray.direction[axis].abs() < 1e-12
                && (ray.origin[axis].abs() < 1e-12 || (ray.origin[axis] - last).abs() < 1e-12)
        })
    };
    let inside: Vec<Ray> = rays.iter().filter(|ray| !grazes(ray)).copied().collect();
    assert!(inside.len() * 2 > rays.len(), "{} of {} rays", inside.len(), rays.len());
    greatest_difference(grid, transfer, &inside)
}

#[test]
fn a_ray_on_a_face_is_in_the_cell_above() {
    // Cells below z = 1 are blank. A ray in that plane sees the cells above it, one just below sees nothing.
    let mut values = vec![1.0f32; 27];
    values[4] = f32::NAN;
    let grid = VoxelGrid::new([3, 3, 3], DVec3::ONE, values).unwrap();
    let matter = transfer(&[(0.0, [1.0; 3], 0.5)], 1.0);
    let tracer = Tracer::new(&grid, &matter).unwrap();
    let along_y = |z: f64| tracer.trace(&Ray { origin: DVec3::new(0.5, -1.0, z), direction: DVec3::Y });
    assert_eq!(cell_of(&grid, DVec3::new(0.5, 0.5, 1.0)), [0, 0, 1]);
    assert!((along_y(1.0).transmittance - 0.25).abs() < 1e-15);
    assert_eq!(along_y(1.0 - 1e-9), Light::CLEAR);
    assert!((along_y(2.0).transmittance - 0.25).abs() < 1e-15, "the last face belongs to the last cell");
}

fn marched(grid: &VoxelGrid, transfer: &TransferFunction, camera: &Camera, size: u32, step: f64) -> Image {
    let rays = camera.rays(size, size);
    let pixels = (0..size)
        .flat_map(|row| (0..size).map(move |column| (column, row)))
        .map(|(column, row)| march(grid, transfer, &rays.pixel(column, row), step).over([0.0; 3]))
        .collect();
    Image::new(size, size, pixels).expect("as many pixels as rays")
}

/// The mean order at which the march's error falls as its step is halved three times.
fn mean_order(grid: &VoxelGrid, transfer: &TransferFunction, camera: &Camera, what: &str) -> f64 {
    let truth = render(grid, camera, transfer, [0.0; 3], 24, 24).expect("a scene");
    let errors = [0.1, 0.05, 0.025, 0.0125].map(|step| {
        metrics::compare(&truth, &marched(grid, transfer, camera, 24, step)).expect("one size").rmse
    });
    let order = (errors[0] / errors[3]).log2() / 3.0;
    println!("{what}: rmse {:.4?} thousandths, order {order:.3}", errors.map(|e| e * 1e3));
    order
}

#[test]
fn a_plain_march_converges_to_the_reference_at_its_order() {
    let grid = marschner_lobb(15);
    let extent = grid.extent();
    let cameras = [
        ("perspective", perspective(extent * DVec3::new(1.9, -1.3, 1.6), extent / 2.0, 35.0)),
        ("orthographic", orthographic(extent * DVec3::new(-1.1, 1.4, 0.3), extent / 2.0, extent.y * 1.2)),
        ("from inside", perspective(extent / 2.1, extent * 0.9, 80.0)),
    ];
    for (name, camera) in cameras {
        let order = mean_order(&grid, &smooth(0.0, 1.0), &camera, &format!("smooth, {name}"));
        assert!((order - 2.0).abs() < 0.15, "{name}: order {order}, expected 2 within 0.15");
        // No midpoint falls on a step of the transfer function: first order.
        let step = transfer(&[(0.45, [0.2; 3], 0.0), (0.45, [0.9, 0.8, 0.3], 0.5)], 1.0);
        let order = mean_order(&grid, &step, &camera, &format!("step, {name}"));
        assert!((order - 1.0).abs() < 0.25, "{name}: order {order}, expected 1 within 0.25");
    }
}

#[test]
fn the_error_follows_the_tolerance() {
    let grid = noise([12, 12, 12], 14);
    let extent = grid.extent();
    let camera = perspective(extent * DVec3::new(1.8, -1.2, 1.5), extent / 2.0, 40.0);
    let matter = wild(0.0, 255.0);
    let picture = |tolerance: f64| {
        let tracer = Tracer::new(&grid, &matter).unwrap().with_tolerance(tolerance);
        tracer.render(&camera, [0.2; 3], 40, 40, &|_| {}).unwrap()
    };
    let best = picture(1e-15);
    for (tolerance, threshold) in [(1e-3, 1e-2), (1e-6, 1e-5), (1e-9, 1e-8), (1e-12, 1e-11)] {
        let error = metrics::compare(&best, &picture(tolerance)).unwrap().max;
        check(&format!("tolerance {tolerance:e}"), error, threshold);
    }
    let at_default = render(&grid, &camera, &matter, [0.2; 3], 40, 40).unwrap();
    assert_eq!(at_default, picture(volery_reference::PIECE_TOLERANCE));
}

#[test]
fn skipping_blocks_changes_nothing() {
    // Matter only in two far corners of many blocks, so that almost all is skipped.
    let dims = [41, 37, 29];
    let mut values = vec![0u8; dims.iter().product()];
    values[0] = 200;
    *values.last_mut().unwrap() = 250;
    values[dims[0] * dims[1] * 14 + dims[0] * 16 + 8] = 255;
    let grid = VoxelGrid::new(dims, DVec3::ONE, values).unwrap();
    let matter = transfer(&[(10.0, [0.3, 0.6, 0.9], 0.0), (255.0, [1.0, 0.5, 0.2], 0.9)], 0.3);
    let mut random = Random::new(15);
    let corners = [DVec3::ZERO, grid.extent(), DVec3::new(8.0, 16.0, 14.0)];
    let rays: Vec<Ray> = (0..150)
        .map(|i| {
            let origin = (random.point() * 3.0 - DVec3::ONE) * grid.extent();
            let aim = corners[i % 3] + (random.point() - DVec3::splat(0.5)) * 0.8;
            Ray { origin, direction: (aim - origin).normalize() }
        })
        .collect();
    check("three lit samples among 43,993", greatest_difference(&grid, &matter, &rays), THRESHOLD);
}

#[test]
fn the_same_bits_on_one_thread_and_on_many() {
    let grid = half_space([9, 9, 9], DVec3::ONE, DVec3::new(1.0, 2.0, 0.5), 12.0);
    let camera = Camera::fitted(grid.extent(), 40.0, 25.0, 1.0, false);
    let matter = wild(0.0, 255.0);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&grid, &camera, &matter, [0.5; 3], 33, 27).unwrap())
    };
    let one = on(1);
    for threads in [2, 3, 7] {
        assert!(one == on(threads), "{threads} threads");
    }
}
