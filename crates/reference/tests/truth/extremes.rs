//! Values of large offset, outliers, shells thinner than rounding, far eyes, huge and tiny worlds; and rays that only
//! touch the value of a step, where the promise ends.

use glam::DVec3;
use volery_data::{hash, ramp, uniform};
use volery_reference::{GridTracer, PlaneScene, Tracer, render};
use volery_scene::{Camera, Plane, Ray, TransferFunction, VoxelGrid};

use crate::cells::{Filling, lattice};
use crate::slow::{Random, check, perspective, slab, transfer};

const COLOR: [f64; 3] = [0.9, 0.5, 0.2];
const THRESHOLD: f64 = 1e-9;

/// `1 - exp(-depth)`, the light of white matter.
fn opacity(depth: f64) -> f64 {
    -(-depth).exp_m1()
}

/// Values between `offset` and `offset + span`, and one that may be anything.
fn block(offset: f64, span: f64, outlier: Option<f64>) -> VoxelGrid {
    let value = |i: u32| offset + span * (f64::from((37 * i + 11) % 101) / 101.0);
    let mut values: Vec<f64> = (0..12).map(value).collect();
    values[7] = outlier.unwrap_or(values[7]);
    VoxelGrid::new([3, 2, 2], DVec3::ONE, values).expect("12 samples")
}

/// Kinks and steps between the same values.
fn bands(offset: f64, span: f64) -> TransferFunction {
    let points = [
        (0.1, [0.0, 0.1, 0.9], 0.0),
        (0.3, [0.5, 0.8, 0.0], 0.4),
        (0.5, [0.1, 0.2, 0.8], 0.1),
        (0.5, [0.9, 0.9, 0.9], 0.3),
        (0.8, [0.6, 0.3, 0.9], 0.9),
        (0.9, [1.0, 0.7, 0.1], 0.2),
    ];
    transfer(&points.map(|(value, color, opacity)| (offset + span * value, color, opacity)), 0.8)
}

/// Colour and transmittance of one ray, computed with 50 digits by another program.
#[test]
fn offsets_and_outliers_cost_no_digits() {
    let right = [
        (0.0, 1.0, None, [0.448855265681734, 0.453561842022426, 0.476196036186645, 0.301033963457228]),
        (1e6, 0.01, None, [0.448855265448325, 0.453561841997253, 0.476196036017603, 0.301033964263886]),
        (1e6, 0.001, None, [0.448855303880217, 0.453561864494369, 0.476196081345206, 0.301033937070011]),
        (1e9, 1.0, None, [0.448855269322376, 0.453561834262687, 0.476196053916140, 0.301033952625925]),
        (-1e9, 1.0, None, [0.448855269322376, 0.453561834262687, 0.476196053916140, 0.301033952625925]),
        (1e12, 1.0, None, [0.448787242516516, 0.453546013036063, 0.476082147559915, 0.301124420542159]),
        (4e9, 200.0, None, [0.448855266274233, 0.453561842247767, 0.476196037046753, 0.301033962645360]),
        (0.0, 1.0, Some(1e20), [0.403662935438906, 0.282564054807234, 0.040366293543890, 0.596337064561093]),
        (
            1e9,
            1.0,
            Some(0.0),
            [7.66833480121237e-10, 1.27749029034025e-9, 5.40830431207768e-10, 0.999999997882747],
        ),
    ];
    let ray = Ray { origin: DVec3::new(-0.7, 0.35, 0.2), direction: DVec3::new(0.9375, 0.25, 0.2421875) };
    for (offset, span, outlier, expected) in right {
        let (grid, matter) = (block(offset, span, outlier), bands(offset, span));
        let found = Tracer::new(&grid, &matter).unwrap().trace(&ray);
        let [r, g, b] = found.color;
        let errors = [r, g, b, found.transmittance].into_iter().zip(expected).map(|(a, b)| (a - b).abs());
        check(&format!("{offset:e} + [0, {span:e}], {outlier:?}"), errors.fold(0.0, f64::max), 1e-13);
    }
}

/// Halves, quarters, and so on: with an offset they are the same numbers still, and so is the picture.
#[test]
fn a_shift_that_is_exact_changes_not_a_bit() {
    let values =
        |offset: f64| -> Vec<f64> { (0..60).map(|i| offset + (hash(i) % 1024) as f64 / 1024.0).collect() };
    let draw = |offset: f64| {
        let points =
            [(0.0, [0.2, 0.9, 0.4], 0.0), (0.25, COLOR, 1.0), (0.75, [0.3; 3], 0.2), (0.75, COLOR, 0.4)];
        let matter = transfer(&points.map(|(value, color, opacity)| (offset + value, color, opacity)), 0.7);
        let voxels = VoxelGrid::new([5, 4, 3], DVec3::ONE, values(offset)).unwrap();
        let cells = lattice([4, 3, 2], Filling::Hexahedra, |p| p * (1.0 + 0.7 * p.z));
        let nodes = [values(offset), vec![offset; 24]].concat();
        let tracer = GridTracer::new(&cells, &nodes.into(), &matter).unwrap();
        let planes = [Plane::through(voxels.extent() / 2.0, DVec3::new(0.3, -0.5, 0.81))];
        let planes = PlaneScene {
            grid: &voxels,
            planes: &planes,
            transfer: &matter,
            nearest: false,
            is_transparent: true,
            meshes: &[],
        };
        let camera = perspective(DVec3::new(8.0, -9.0, 7.0), voxels.extent() / 2.0, 35.0);
        [
            render(&voxels, &camera, &matter, [0.0; 3], 40, 30).unwrap(),
            tracer.render(&camera, [0.0; 3], 40, 30, &|_| {}).unwrap(),
            planes.render(&camera, [0.0; 3], [40, 30], &|_| {}).unwrap(),
        ]
    };
    let at_zero = draw(0.0);
    for image in &at_zero {
        let lit = image.pixels().iter().filter(|pixel| **pixel != [0.0; 3]).count();
        assert!(lit > 100, "{lit} pixels");
    }
    for offset in [2f64.powi(20), 2f64.powi(30), -2f64.powi(40)] {
        assert!(draw(offset) == at_zero, "shifted by {offset}");
    }
}

/// A ramp, and matter of a width of values that its rounding could not hold: `width` of values is `width / slope` of a
/// ray, and there the mean of `-ln(1 - a)` over all opacities `a` is 1.
#[test]
fn shells_thinner_than_anything_have_their_integral() {
    let mut random = Random::new(31);
    // Where faces of cells cut the shell their place is rounded, which 1e-15 of a cell at an extinction of 1e5 shows.
    for (num_cells, beside) in [(1, 0.3), (7, 0.3), (7, 0.0)] {
        let gradient = DVec3::X / f64::from(num_cells);
        let grid = ramp([num_cells as usize + 1, 3, 3], DVec3::ONE, gradient, 0.0);
        for width in [1e-3, 1e-6, 1e-9, 1e-12, 1e-15] {
            // Per cell 7,000, or so that a shell is about as deep as 1.
            for unit_distance in [1.0 / 7e3, width * f64::from(num_cells)] {
                if beside == 0.0 && unit_distance < 1e-5 {
                    continue;
                }
                let mut greatest = 0.0;
                for _ in 0..40 {
                    let middle = 0.1 + 0.8 * random.unit();
                    let (low, high) = (middle - width, middle + width);
                    let tent = [(low, COLOR, 0.0), (middle, COLOR, 1.0), (high, COLOR, 0.0)];
                    let slab = [(low, COLOR, 0.0), (low, COLOR, 0.9), (high, COLOR, 0.9), (high, COLOR, 0.0)];
                    let way = DVec3::new(1.0, 0.02 + random.unit() * 0.1, 0.02 + random.unit() * 0.1);
                    let direction = if random.unit() < 0.5 { way.normalize() } else { -way.normalize() };
                    let target = DVec3::new(middle * f64::from(num_cells), 1.0 - beside, 1.0 + beside);
                    let ray = Ray { origin: target - direction * 11.0, direction };
                    let length = (high - low) / gradient.dot(direction).abs() / unit_distance;
                    for (points, extinction) in [(&tent[..], 1.0), (&slab[..], 10f64.ln())] {
                        let found = Tracer::new(&grid, &transfer(points, unit_distance)).unwrap().trace(&ray);
                        let error = (1.0 - found.transmittance - opacity(extinction * length)).abs();
                        greatest = f64::max(greatest, error);
                    }
                }
                let what = format!(
                    "{num_cells} cells, shell {width:e} {beside} beside faces, per {unit_distance:.0e}"
                );
                check(&what, greatest, THRESHOLD);
            }
        }
    }
}

/// Opacity 1 at one value only, and a ray through edges and corners of cells where samples have this value.
#[test]
fn a_ray_through_samples_of_opacity_1_is_not_stopped_by_them() {
    let grid = ramp([6, 6, 6], DVec3::new(1.0, 0.3, 0.7), DVec3::new(0.25, 0.0, 0.0), 0.0);
    let tent = transfer(&[(0.0, COLOR, 0.0), (0.5, COLOR, 1.0), (1.0, COLOR, 0.0)], 100.0);
    let cells = lattice([5; 3], Filling::Hexahedra, |p| p * grid.spacing());
    let nodes: Vec<f64> = cells.points().iter().map(|p| 0.25 * p.x).collect();
    let cells = GridTracer::new(&cells, &nodes.into(), &tent).unwrap();
    let voxels = Tracer::new(&grid, &tent).unwrap();
    let mut greatest = 0.0;
    for target in 0..36 {
        let sample = DVec3::new(2.0, f64::from(target % 6), f64::from(target / 6)) * grid.spacing();
        for code in 0..27 {
            let step = DVec3::new(f64::from(code % 3), f64::from(code / 3 % 3), f64::from(code / 9)) - 1.0;
            let direction = (step * grid.spacing()).normalize_or_zero();
            let ray = Ray { origin: sample - direction * 7.0, direction };
            let Some([start, end]) = slab(&ray, DVec3::ZERO, grid.extent()).filter(|_| step.x != 0.0) else {
                continue;
            };
            // The mean of -ln(1 - a) over opacities from one to another; both ways from the peak.
            let primitive = |clear: f64| if clear > 0.0 { clear * (clear.ln() - 1.0) } else { 0.0 };
            let clear = |t: f64| (1.0 - 0.5 * (ray.origin.x + t * direction.x)).abs().min(1.0);
            let side = |t: f64| (primitive(0.0) - primitive(clear(t))) * 2.0 / direction.x.abs();
            let expected = opacity((side(start) + side(end)) / 100.0);
            for found in [voxels.trace(&ray), cells.trace(&ray)] {
                let error = (1.0 - found.transmittance - expected).abs();
                assert!(error < THRESHOLD, "{sample} {step}: {error:e}");
                greatest = f64::max(greatest, error);
            }
        }
    }
    check("rays through samples at a peak", greatest, THRESHOLD);
}

/// A ray in a layer of samples of opacity 1 keeps that value all the way, so it is opaque however long a unit is.
#[test]
fn a_ray_along_samples_of_opacity_1_sees_them() {
    let grid = ramp([6, 6, 6], DVec3::ONE, DVec3::Z * 0.25, 0.0);
    let tent = transfer(&[(0.0, [1.0; 3], 0.0), (0.5, COLOR, 1.0), (1.0, [1.0; 3], 0.0)], 1e3);
    let tracer = Tracer::new(&grid, &tent).unwrap();
    for direction in [DVec3::X, -DVec3::Y, DVec3::new(0.6, 0.8, 0.0)] {
        let light = tracer.trace(&Ray { origin: DVec3::new(1.2, 1.3, 2.0) - direction * 9.0, direction });
        assert_eq!((light.color, light.transmittance), (COLOR, 0.0), "along {direction}");
    }
}

/// A far ray brought near to where it meets something, with one rounding.
fn near(ray: &Ray, way: f64) -> Ray {
    let moved = |axis: usize| ray.direction[axis].mul_add(way, ray.origin[axis]);
    Ray { origin: DVec3::new(moved(0), moved(1), moved(2)), ..*ray }
}

#[test]
fn far_eyes_see_what_near_ones_see() {
    let gradient = DVec3::new(0.03, 0.05, -0.02);
    let grid = ramp([8, 6, 7], DVec3::new(1.0, 0.5, 3.0), gradient, 0.5);
    let size = grid.extent().length();
    let [low, high] = grid.value_range(0).unwrap();
    let matter = transfer(&[(low, COLOR, 0.1), (high, [0.1, 0.4, 1.0], 0.9)], 2.0);
    let cells = lattice([7, 5, 6], Filling::Mixed, |p| p * grid.spacing());
    let nodes: Vec<f64> = cells.points().iter().map(|&p| 0.5 + gradient.dot(p)).collect();
    let cells = GridTracer::new(&cells, &nodes.into(), &matter).unwrap();
    let tracer = Tracer::new(&grid, &matter).unwrap();
    let planes = [Plane::through(grid.extent() / 2.0, DVec3::new(0.3, 0.5, 0.81))];
    let planes = PlaneScene {
        grid: &grid,
        planes: &planes,
        transfer: &matter,
        nearest: false,
        is_transparent: true,
        meshes: &[],
    };
    let mut random = Random::new(32);
    for far in [1e3, 1e6, 1e9, 1e12] {
        let mut greatest = [0.0; 3];
        let mut lit = 0;
        for _ in 0..200 {
            let target = (random.point() * 1.2 - 0.1) * grid.extent();
            let direction = (random.point() - 0.5).normalize();
            let ray = Ray { origin: target - direction * far * size, direction };
            let close = near(&ray, (far - 3.0) * size);
            let difference =
                |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
            let right = tracer.trace(&close).over([0.0; 3]);
            lit += usize::from(right != [0.0; 3]);
            let errors = [
                difference(tracer.trace(&ray).over([0.0; 3]), right),
                difference(cells.trace(&ray).over([0.0; 3]), right),
                difference(planes.trace(&ray, [0.0; 3]), planes.trace(&close, [0.0; 3])),
            ];
            (0..3).for_each(|i| greatest[i] = f64::max(greatest[i], errors[i]));
        }
        assert!(lit > 100, "{lit} rays meet matter");
        for (what, error) in ["voxels", "cells", "planes"].into_iter().zip(greatest) {
            check(&format!("{what} from {far:e} sizes away"), error, THRESHOLD);
        }
    }
}

/// From afar, where the ray enters is coarser than the corner that it cuts off.
#[test]
fn far_eyes_see_corners_thinner_than_the_rounding_of_distances() {
    let grid = uniform([3, 3, 3], DVec3::ONE, 1.0);
    let matter = transfer(&[(1.0, COLOR, 0.5)], 1e-5);
    let tracer = Tracer::new(&grid, &matter).unwrap();
    let mut random = Random::new(34);
    for far in [1e9, 1e12] {
        let (mut greatest, mut lit) = (0.0, 0);
        for _ in 0..300 {
            let target = DVec3::new(random.unit() * 1e-5, random.unit() * 1e-5, 0.5 + random.unit());
            let direction = DVec3::new(1.0, -0.5 - random.unit(), 0.1 * random.unit()).normalize();
            let ray = Ray { origin: target - direction * far, direction };
            let close = near(&ray, far - 3.0);
            let chord = slab(&close, DVec3::ZERO, grid.extent()).map_or(0.0, |[a, b]| b - a);
            lit += usize::from(chord > 0.0);
            let error = 1.0 - tracer.trace(&ray).transmittance - opacity(matter.extinction(1.0) * chord);
            greatest = f64::max(greatest, error.abs());
        }
        assert!(lit > 50, "{lit} rays meet the corner");
        // Where a near ray enters is rounded, too: to 1e-15, of units of 1e-5.
        check(&format!("corners from {far:e} sizes away"), greatest, THRESHOLD);
    }
}

#[test]
fn worlds_of_any_size_look_the_same() {
    let gradient = DVec3::new(0.03, 0.05, 0.02);
    let draw = |scale: f64| {
        let grid = ramp([8, 6, 7], DVec3::splat(scale), gradient / scale, 0.2);
        let matter =
            transfer(&[(0.2, COLOR, 0.0), (0.4, [0.1, 0.4, 1.0], 1.0), (0.5, COLOR, 0.1)], 0.7 * scale);
        let cells = lattice([7, 5, 6], Filling::Mixed, |p| p * scale);
        let nodes: Vec<f64> = cells.points().iter().map(|&p| 0.2 + gradient.dot(p / scale)).collect();
        let cells = GridTracer::new(&cells, &nodes.into(), &matter).unwrap();
        let middle = grid.extent() / 2.0;
        let camera = perspective(middle + DVec3::new(9.0, -11.0, 8.0) * scale, middle, 40.0);
        let planes = [Plane::through(middle, DVec3::new(0.3, 0.5, 0.81))];
        let planes = PlaneScene {
            grid: &grid,
            planes: &planes,
            transfer: &matter,
            nearest: false,
            is_transparent: true,
            meshes: &[],
        };
        let draw = |camera: &Camera| {
            [
                render(&grid, camera, &matter, [0.0; 3], 40, 30).unwrap(),
                cells.render(camera, [0.0; 3], 40, 30, &|_| {}).unwrap(),
                planes.render(camera, [0.0; 3], [40, 30], &|_| {}).unwrap(),
            ]
        };
        draw(&camera)
    };
    let right = draw(1.0);
    for scale in [1e-30, 1e-6, 1e6, 1e30] {
        for (what, (found, right)) in ["voxels", "cells", "planes"].iter().zip(draw(scale).iter().zip(&right))
        {
            let channels = found.pixels().iter().flatten().zip(right.pixels().iter().flatten());
            let error = channels.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            check(&format!("{what}, scale {scale:e}"), error, THRESHOLD);
        }
    }
}

/// Where a ray turns back from a step's value, what it has behind the step is as long as a root; and so is the error.
#[test]
fn a_ray_that_touches_a_step_is_off_by_the_root_of_rounding() {
    // The field is x y; along a ray it is a parabola, whose top the step misses by `depth`.
    let mut values = vec![0.0; 8];
    (values[3], values[7]) = (1.0, 1.0);
    let grid = VoxelGrid::new([2, 2, 2], DVec3::ONE, values).unwrap();
    let mut random = Random::new(33);
    for depth in [0.0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-8, 1e-4] {
        let mut greatest = 0.0;
        for _ in 0..300 {
            let place = DVec3::new(0.3 + 0.4 * random.unit(), 0.3 + 0.4 * random.unit(), 0.5);
            // Across the gradient (y, x), where the field turns.
            let direction = DVec3::new(place.x, -place.y, random.unit() * 0.1).normalize();
            let ray = Ray { origin: place - direction * 3.0, direction };
            let top = place.x * place.y;
            let matter = transfer(&[(top - depth, [1.0; 3], 0.0), (top - depth, [1.0; 3], 0.5)], 1.0);
            let length = 2.0 * (depth / (direction.x * direction.y).abs()).sqrt();
            let found = Tracer::new(&grid, &matter).unwrap().trace(&ray);
            let error = (1.0 - found.transmittance - opacity(2f64.ln() * length)).abs();
            greatest = f64::max(greatest, error);
        }
        let rounding = 8.0 * f64::EPSILON;
        let threshold = f64::max(THRESHOLD, rounding / f64::sqrt(f64::max(depth, rounding)));
        check(&format!("a step {depth:e} below the turn"), greatest, threshold);
    }
}

/// Equal samples around a place are the field there, to the last bit, whatever the weights.
#[test]
fn planes_through_equal_samples_at_the_value_of_a_step_are_of_one_colour() {
    for value in [0.1, 100.0, 1e-3, 12_345.678, 1e9 + 0.1, -7.7] {
        let grid = VoxelGrid::new([7, 6, 5], DVec3::new(1.0, 0.3, 0.7), vec![value; 210]).unwrap();
        let matter = transfer(&[(value, [1.0, 0.0, 0.0], 0.1), (value, [0.0, 1.0, 0.0], 0.5)], 1.0);
        let scene = |planes: &[Plane], nearest| {
            let scene = PlaneScene {
                grid: &grid,
                planes,
                transfer: &matter,
                nearest,
                is_transparent: false,
                meshes: &[],
            };
            let middle = grid.extent() / 2.0;
            let camera = perspective(middle + DVec3::new(3.0, -5.0, 4.0), middle, 60.0);
            scene.render(&camera, [0.0; 3], [61, 47], &|_| {}).unwrap()
        };
        let planes = [
            Plane::through(grid.extent() / 2.0, DVec3::new(0.3, 0.5, 0.81)),
            Plane::through(DVec3::ZERO, DVec3::Z),
        ];
        for nearest in [false, true] {
            let drawn = scene(&planes, nearest);
            let count = |color: [f64; 3]| drawn.pixels().iter().filter(|pixel| **pixel == color).count();
            let (right, empty) = (count([0.0, 1.0, 0.0]), count([0.0; 3]));
            assert!(right > 100, "{right} pixels");
            assert_eq!(right + empty, 61 * 47, "{value}, nearest {nearest}");
        }
    }
}

/// A plane that is a layer of samples shows the layer, though the next one differs and places on it are rounded.
#[test]
fn a_plane_in_a_layer_shows_the_layer() {
    let dims = [6, 5, 9];
    let spacing = DVec3::new(1.0, 0.3, 0.1);
    let layer = |i: usize| if i / 30 == 3 { 100.0 } else { 0.0 };
    let grid = VoxelGrid::new(dims, spacing, (0..270).map(layer).collect::<Vec<f64>>()).unwrap();
    let matter = transfer(&[(100.0, [1.0, 0.0, 0.0], 0.1), (100.0, [0.0, 1.0, 0.0], 0.5)], 1.0);
    let planes = [Plane { normal: DVec3::Z * 2.0, distance: 2.0 * (3.0 * 0.1) }];
    let scene = PlaneScene {
        grid: &grid,
        planes: &planes,
        transfer: &matter,
        nearest: false,
        is_transparent: false,
        meshes: &[],
    };
    let middle = grid.extent() / 2.0;
    for eye in [DVec3::new(3.0, -5.0, 4.0), DVec3::new(-1e3, 2e3, 3e3)] {
        let camera = perspective(middle + eye, middle, 30.0 / eye.length());
        let drawn = scene.render(&camera, [0.0; 3], [61, 47], &|_| {}).unwrap();
        let count = |color: [f64; 3]| drawn.pixels().iter().filter(|pixel| **pixel == color).count();
        assert!(count([0.0, 1.0, 0.0]) > 2000, "{} pixels", count([0.0, 1.0, 0.0]));
        assert_eq!(count([1.0, 0.0, 0.0]), 0, "from {eye}");
    }
}

/// Of the nearest samples, those above count in the middle between two layers, though places on it are rounded.
#[test]
fn a_plane_in_the_middle_of_two_layers_shows_the_upper_one() {
    let layer = |i: usize| if i / 30 == 2 { 100.0 } else { 0.0 };
    let samples: Vec<f64> = (0..120).map(layer).collect();
    let grid = VoxelGrid::new([6, 5, 4], DVec3::new(1.0, 0.3, 0.1), samples).unwrap();
    let matter = transfer(&[(50.0, [1.0, 0.0, 0.0], 0.1), (50.0, [0.0, 1.0, 0.0], 0.5)], 1.0);
    let planes = [Plane { normal: DVec3::Z * 3.0, distance: 3.0 * 0.15 }];
    let scene = PlaneScene {
        grid: &grid,
        planes: &planes,
        transfer: &matter,
        nearest: true,
        is_transparent: false,
        meshes: &[],
    };
    let middle = grid.extent() / 2.0;
    let camera = perspective(middle + DVec3::new(3.0, -5.0, 4.0), middle, 5.0);
    let drawn = scene.render(&camera, [0.0; 3], [61, 47], &|_| {}).unwrap();
    let count = |color: [f64; 3]| drawn.pixels().iter().filter(|pixel| **pixel == color).count();
    assert!(count([0.0, 1.0, 0.0]) > 2000, "{} pixels", count([0.0, 1.0, 0.0]));
    assert_eq!(count([1.0, 0.0, 0.0]), 0);
}

/// Opacity 1 at the last value of a uniform far block; nothing overflows.
#[test]
fn opaque_matter_is_opaque_at_any_scale() {
    for spacing in [1e-30, 1e-6, 1.0, 1e6, 1e30] {
        let grid = uniform([4, 4, 4], DVec3::splat(spacing), 1.0);
        let matter = transfer(&[(0.0, [0.0; 3], 0.0), (1.0, COLOR, 1.0)], 1.0);
        let origin = DVec3::new(-1e9, 1.3, 1.4) * spacing;
        let ray = Ray { origin, direction: DVec3::X };
        assert!(slab(&ray, DVec3::ZERO, grid.extent()).is_some());
        let light = Tracer::new(&grid, &matter).unwrap().trace(&ray);
        assert_eq!((light.color, light.transmittance), (COLOR, 0.0), "spacing {spacing:e}");
    }
}

/// Padding beside what can be seen: between two samples a ray passes all values from one to the other, however far apart,
/// and shows the end of an opaque band at which it enters.
#[test]
fn bands_beside_padding_are_passed() {
    for padding in [1e20, 3e18, 1e18, -1e17, 1e9] {
        bands_beside(padding);
    }
}

fn bands_beside(padding: f64) {
    let dims = [6, 5, 4];
    let value = |i: u32| if i % 6 < 3 { -500.0 * padding.signum() + f64::from(i % 17) } else { padding };
    let values: Vec<f64> = (0..120).map(value).collect();
    let grid = VoxelGrid::new(dims, DVec3::new(1.0, 0.7, 1.3), values).expect("120 samples");
    // A band between what can be seen and the padding: its end towards what can be seen is near, its other far.
    let (near, far) = ([0.9, 0.5, 0.2], [0.1, 0.3, 0.8]);
    let points = if padding > 0.0 {
        [(-250.0, near, 0.0), (-250.0, near, 1.0), (-248.0, far, 1.0), (-248.0, far, 0.0)]
    } else {
        [(248.0, far, 0.0), (248.0, far, 1.0), (250.0, near, 1.0), (250.0, near, 0.0)]
    };
    let tf = transfer(&points, 1.0);
    let tracer = Tracer::new(&grid, &tf).expect("scalars");
    let mut random = Random::new(9);
    let mut num = 0;
    for _ in 0..2000 {
        // Through the middle of the face on which the last samples that can be seen lie.
        let place = DVec3::new(2.0, 0.1 + 2.6 * random.unit(), 0.1 + 3.7 * random.unit());
        let direction = DVec3::new(0.3 + random.unit(), random.unit() - 0.5, random.unit() - 0.5).normalize();
        for (direction, expected) in [(direction, near), (-direction, far)] {
            let light = tracer.trace(&Ray { origin: place - direction * 20.0, direction });
            assert_eq!(light.transmittance, 0.0, "{place} {direction}");
            let off = (0..3).map(|i| (light.color[i] - expected[i]).abs()).fold(0.0, f64::max);
            assert!(off < THRESHOLD, "{place} {direction}: {:?}, expected {expected:?}", light.color);
            num += 1;
        }
    }
    println!("{num} rays pass a band beside {padding:e}");
}

/// A ray that enters opaque matter through the last samples before padding sees what those are, whatever lies behind.
#[test]
fn faces_before_padding_are_seen_exactly() {
    let seen = |i: u32| -500.0 + 13.0 * f64::from(i * 7 % 17);
    let band = [(-520.0, [0.9, 0.5, 0.2], 1.0), (-280.0, [0.1, 0.3, 0.8], 1.0)];
    let (solid, mut random) = (transfer(&band, 1.0), Random::new(10));
    let with = |padding: f64| {
        let values: Vec<f64> = (0..60).map(|i| if i % 3 < 2 { padding } else { seen(i) }).collect();
        VoxelGrid::new([3, 5, 4], DVec3::ONE, values).expect("60 samples")
    };
    let plain = with(-400.0);
    for padding in [1e20, -1e17, 1e12] {
        let padded = with(padding);
        let tracers = [&plain, &padded].map(|grid| Tracer::new(grid, &solid).expect("scalars"));
        for _ in 0..500 {
            let place = DVec3::new(2.0, 4.0 * random.unit(), 3.0 * random.unit());
            let direction =
                DVec3::new(-0.1 - random.unit(), random.unit() - 0.5, random.unit() - 0.5).normalize();
            let ray = Ray { origin: place - direction * 20.0, direction };
            let [plain, padded] = tracers.each_ref().map(|tracer| tracer.trace(&ray));
            let off = (0..3).map(|i| (plain.color[i] - padded.color[i]).abs()).fold(0.0, f64::max);
            assert!(off < THRESHOLD, "{padding:e}: {ray:?}: {:?}, expected {:?}", padded.color, plain.color);
        }
    }
}
