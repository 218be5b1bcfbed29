//! Pictures known in closed form, each to 1e-9.

use crate::slow::{check, greatest_error, orthographic, perspective, slab, transfer};
use glam::DVec3;
use volery_data::{half_space, ramp, uniform};
use volery_reference::render;
use volery_scene::{Camera, Ray, TransferFunction};

const BACKGROUND: [f64; 3] = [0.1, 0.6, 0.3];
const COLOR: [f64; 3] = [0.9, 0.5, 0.2];
const THRESHOLD: f64 = 1e-9;

fn mixed(front: [f64; 3], transmittance: f64) -> [f64; 3] {
    std::array::from_fn(|i| front[i] * (1.0 - transmittance) + BACKGROUND[i] * transmittance)
}

/// Outside, near, inside, from a corner, along an axis, through the sample planes; both projections.
pub(crate) fn cameras(extent: DVec3) -> Vec<(&'static str, Camera)> {
    let (center, size) = (extent / 2.0, extent.length());
    let oblique = center + DVec3::new(0.7, -1.1, 0.6) * size;
    let along_x = DVec3::new(-size, center.y, center.z);
    vec![
        ("perspective", perspective(oblique, center, 50.0)),
        ("perspective along x", perspective(along_x, center, 40.0)),
        ("perspective from inside", perspective(center * 0.9, extent, 100.0)),
        ("perspective from a corner", perspective(DVec3::ZERO, extent, 120.0)),
        ("perspective in a face", perspective(DVec3::new(0.0, center.y, center.z), center, 120.0)),
        ("perspective from afar", perspective(center + (oblique - center) * 1e6, center, 5e-5)),
        ("orthographic", orthographic(oblique, center, size * 1.3)),
        ("orthographic along x", orthographic(along_x, center, size * 1.3)),
        ("orthographic along z", orthographic(center + DVec3::Z * size, center, size * 1.3)),
        ("orthographic from inside", orthographic(center, extent, size)),
    ]
}

#[test]
fn uniform_block() {
    let matter = transfer(&[(0.0, COLOR, 0.3)], 0.7);
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 10.0), DVec3::splat(1e-6), DVec3::splat(1e6)] {
        let grid = uniform([6, 5, 4], spacing, 7.3);
        let scale = grid.extent().length();
        let matter = TransferFunction::new(matter.points().to_vec(), 0.1 * scale).unwrap();
        for (name, camera) in cameras(grid.extent()) {
            let image = render(&grid, &camera, &matter, BACKGROUND, 41, 31).unwrap();
            let error = greatest_error(&image, &camera, grid.extent(), |ray| {
                let chord = slab(ray, DVec3::ZERO, grid.extent()).map_or(0.0, |[start, end]| end - start);
                mixed(COLOR, (-matter.extinction(7.3) * chord).exp())
            });
            check(&format!("uniform, spacing {spacing}, {name}"), error, THRESHOLD);
        }
    }
}

/// `∫ -ln(1 - a) dt` where `a` goes linearly from `from` to `to` over a length.
fn depth_of_ramp(from: f64, to: f64, length: f64) -> f64 {
    if from.max(to) < 1e-6 {
        // The first terms of the series; the closed form would cancel.
        return ((from + to) / 2.0 + (from * from + from * to + to * to) / 6.0) * length;
    }
    depth_of_clear_ramp(1.0 - from, 1.0 - to, length)
}

/// The same, given `1 - a` at both ends.
fn depth_of_clear_ramp(from: f64, to: f64, length: f64) -> f64 {
    if (from - to).abs() < 1e-12 * from {
        return -from.ln() * length;
    }
    let primitive = |clear: f64| if clear > 0.0 { clear * clear.ln() - clear } else { 0.0 };
    (primitive(from) - primitive(to)) / (to - from) * length
}

#[test]
fn linear_ramp_of_one_colour() {
    // Opacity is linear in the value, the value in space: a ray's optical depth has the closed form above.
    let gradient = DVec3::new(0.03, 0.05, -0.02);
    for (most_opaque, spacing) in [(0.4, DVec3::ONE), (1.0, DVec3::ONE), (0.9, DVec3::new(1.0, 0.5, 3.0))] {
        let grid = ramp([8, 6, 7], spacing, gradient / spacing, 0.2);
        let [low, high] = grid.value_range(0).unwrap();
        let matter = transfer(&[(low, COLOR, 0.0), (high, COLOR, most_opaque)], 2.0);
        for (name, camera) in cameras(grid.extent()) {
            let image = render(&grid, &camera, &matter, BACKGROUND, 33, 29).unwrap();
            let error = greatest_error(&image, &camera, grid.extent(), |ray| {
                let Some(ends) = slab(ray, DVec3::ZERO, grid.extent()) else { return BACKGROUND };
                let opacity = ends.map(|t| {
                    let value = 0.2 + (gradient / spacing).dot(ray.origin + ray.direction * t);
                    ((value - low) / (high - low)).clamp(0.0, 1.0) * most_opaque
                });
                let depth = depth_of_ramp(opacity[0], opacity[1], ends[1] - ends[0]) / 2.0;
                mixed(COLOR, (-depth).exp())
            });
            check(&format!("ramp to {most_opaque}, spacing {spacing}, {name}"), error, THRESHOLD);
        }
    }
}

#[test]
fn linear_ramp_of_changing_colour() {
    // Integrating by parts, I = c(0) - c(L) T(L) + c' ∫ T dt, with T in closed form; the integral of that
    // smooth function is left to Simpson's rule.
    let grid = ramp([9, 5, 5], DVec3::ONE, DVec3::new(0.1, 0.02, 0.05), 0.0);
    let [low, high] = grid.value_range(0).unwrap();
    let (first, last) = ([0.1, 0.9, 0.3], [1.0, 0.2, 0.3]);
    let matter = transfer(&[(low, first, 0.05), (high, last, 0.6)], 1.5);
    for (name, camera) in cameras(grid.extent()) {
        let image = render(&grid, &camera, &matter, BACKGROUND, 25, 21).unwrap();
        let error = greatest_error(&image, &camera, grid.extent(), |ray| {
            let Some([start, end]) = slab(ray, DVec3::ZERO, grid.extent()) else { return BACKGROUND };
            let weight = |t: f64| {
                let p = ray.origin + ray.direction * t;
                (DVec3::new(0.1, 0.02, 0.05).dot(p) - low) / (high - low)
            };
            let opacity = |t: f64| 0.05 + 0.55 * weight(t);
            let clear = |t: f64| (-depth_of_ramp(opacity(start), opacity(t), t - start) / 1.5).exp();
            let (count, step) = (512, (end - start) / 512.0);
            let simpson: f64 = (0..=count)
                .map(|i| {
                    let factor = if i == 0 || i == count { 1.0 } else { 2.0 + 2.0 * f64::from(i % 2) };
                    factor * clear(start + f64::from(i) * step)
                })
                .sum::<f64>()
                * step
                / 3.0;
            std::array::from_fn(|i| {
                let color = |t: f64| first[i] + (last[i] - first[i]) * weight(t);
                let slope = (color(end) - color(start)) / (end - start);
                color(start) + (BACKGROUND[i] - color(end)) * clear(end) + slope * simpson
            })
        });
        check(&format!("ramp of colours, {name}"), error, THRESHOLD);
    }
}

#[test]
fn view_orthogonal_to_the_ramp() {
    // The value is constant along a ray; control points are met exactly on sample planes.
    let grid = ramp([9, 7, 9], DVec3::ONE, DVec3::Z, 0.0);
    let matter = transfer(
        &[(0.0, [0.0; 3], 0.1), (3.0, COLOR, 0.5), (3.0, [0.2, 0.3, 1.0], 0.05), (8.0, [1.0; 3], 0.9)],
        1.0,
    );
    let center = grid.extent() / 2.0;
    for (eye, length) in [(DVec3::new(-5.0, 3.0, 4.0), 8.0), (DVec3::new(4.0, 20.0, 4.0), 6.0)] {
        // 16 rows over a height of 16: rows at half units; 32 over 16 minus half a pixel: on the planes.
        for (height, rows, shift) in [(16.0, 16, 0.0), (16.0, 16, 0.5), (16.0, 48, 0.0)] {
            let lifted = DVec3::Z * shift;
            let camera = orthographic(eye + lifted, center.with_z(4.0) + lifted, height);
            let image = render(&grid, &camera, &matter, BACKGROUND, rows, rows).unwrap();
            let error = greatest_error(&image, &camera, grid.extent(), |ray| {
                let Some([start, end]) = slab(ray, DVec3::ZERO, grid.extent()) else { return BACKGROUND };
                assert!((end - start - length).abs() < 1e-12);
                let (color, _) = matter.classify(ray.origin.z);
                mixed(color, (-matter.extinction(ray.origin.z) * length).exp())
            });
            check(&format!("across the ramp from {eye}, height {height}, {rows} rows"), error, THRESHOLD);
        }
    }
}

#[test]
fn opaque_step() {
    // The field rises from 0 to 255 between x = 2 and x = 3; matter starts at the value 102, so at x = 2.4,
    // and is opaque: what is seen is the colour where the ray enters it.
    let grid = half_space([7, 6, 5], DVec3::ONE, DVec3::X, 3.0);
    let matter = transfer(
        &[(0.0, [1.0; 3], 0.0), (102.0, [1.0; 3], 0.0), (102.0, COLOR, 1.0), (255.0, [0.0, 0.0, 1.0], 1.0)],
        1.0,
    );
    for (name, camera) in cameras(grid.extent()) {
        let image = render(&grid, &camera, &matter, BACKGROUND, 41, 31).unwrap();
        let expected = |ray: &Ray| {
            let matter_low = DVec3::new(2.4, 0.0, 0.0);
            let Some([start, _]) = slab(ray, matter_low, grid.extent()) else { return BACKGROUND };
            let x = (ray.origin + ray.direction * start).x;
            let weight = ((x - 2.4) / 0.6).clamp(0.0, 1.0);
            std::array::from_fn(|i| COLOR[i] + ([0.0, 0.0, 1.0][i] - COLOR[i]) * weight)
        };
        check(
            &format!("opaque step, {name}"),
            greatest_error(&image, &camera, grid.extent(), expected),
            THRESHOLD,
        );
    }
}

#[test]
fn extreme_opacities_of_a_uniform_block() {
    let grid = uniform([4, 4, 4], DVec3::ONE, 1.0);
    for unit_distance in [1e-30, 1e-3, 1.0, 1e3, 1e30] {
        for opacity in [0.0, 1e-300, 1e-30, 1e-9, 0.5, 1.0 - 1e-9, 1.0 - f64::EPSILON / 2.0, 1.0] {
            let matter = transfer(&[(0.0, COLOR, opacity), (1.0, COLOR, opacity)], unit_distance);
            for (name, camera) in cameras(grid.extent()) {
                let image = render(&grid, &camera, &matter, BACKGROUND, 9, 7).unwrap();
                let error = greatest_error(&image, &camera, grid.extent(), |ray| {
                    let Some([start, end]) = slab(ray, DVec3::ZERO, grid.extent()) else {
                        return BACKGROUND;
                    };
                    mixed(COLOR, (matter.extinction(1.0) * -(end - start)).exp())
                });
                let what = format!("opacity {opacity:e} per {unit_distance:e}, {name}");
                assert!(error <= THRESHOLD, "{what}: {error:e}");
            }
        }
    }
}

#[test]
fn extreme_opacities_of_a_ramp() {
    // Extinctions up to 1e30 that change along the ray, up to the pole: white in front of white is white,
    // and in front of black the transmittance is that of the closed form.
    let grid = ramp([5, 4, 4], DVec3::ONE, DVec3::X, 0.0);
    for unit_distance in [1e-30, 1e-10, 1e-3, 1.0, 1e3] {
        for (low, high) in [
            (0.0, 1.0),
            (1.0, 0.0),
            (1e-30, 1e-20),
            (0.0, 1.0 - 2f64.powi(-50)),
            (1.0 - 2f64.powi(-50), 1.0 - 2f64.powi(-30)),
        ] {
            let white = transfer(&[(0.0, [1.0; 3], low), (4.0, [1.0; 3], high)], unit_distance);
            for (name, camera) in cameras(grid.extent()) {
                let what = format!("opacity {low:e} to {high:e} per {unit_distance:e}, {name}");
                let image = render(&grid, &camera, &white, [1.0; 3], 7, 5).unwrap();
                let error = greatest_error(&image, &camera, grid.extent(), |_| [1.0; 3]);
                assert!(error <= THRESHOLD, "{what}, white: {error:e}");
                let image = render(&grid, &camera, &white, [0.0; 3], 7, 5).unwrap();
                let error = greatest_error(&image, &camera, grid.extent(), |ray| {
                    let Some(ends) = slab(ray, DVec3::ZERO, grid.extent()) else { return [0.0; 3] };
                    let at = |t: f64| ((ray.origin + ray.direction * t).x / 4.0).clamp(0.0, 1.0);
                    let [a, b] = ends.map(|t| low + (high - low) * at(t));
                    let [clear_a, clear_b] = ends.map(|t| (1.0 - low) + (low - high) * at(t));
                    let length = (ends[1] - ends[0]) / unit_distance;
                    let small = a.max(b) < 1e-6;
                    let depth = if small {
                        depth_of_ramp(a, b, length)
                    } else {
                        depth_of_clear_ramp(clear_a, clear_b, length)
                    };
                    [1.0 - (-depth).exp(); 3]
                });
                assert!(error <= THRESHOLD, "{what}, black: {error:e}");
            }
        }
    }
}

#[test]
fn a_block_at_the_very_value_of_opacity_1() {
    let grid = uniform([3, 4, 5], DVec3::ONE, 1.0);
    let peak = transfer(&[(0.0, [0.0; 3], 0.0), (1.0, COLOR, 1.0), (2.0, [1.0; 3], 0.0)], 1e3);
    for (name, camera) in cameras(grid.extent()) {
        let image = render(&grid, &camera, &peak, BACKGROUND, 16, 16).unwrap();
        let error = greatest_error(&image, &camera, grid.extent(), |ray| {
            slab(ray, DVec3::ZERO, grid.extent()).map_or(BACKGROUND, |_| COLOR)
        });
        check(&format!("peak, {name}"), error, THRESHOLD);
    }
}

#[test]
fn without_thickness_there_is_no_matter() {
    let opaque = transfer(&[(0.0, COLOR, 1.0)], 1.0);
    for dims in [[1, 5, 5], [5, 1, 5], [5, 5, 1], [1, 1, 9], [1, 1, 1]] {
        let grid = uniform(dims, DVec3::ONE, 1.0);
        for (name, camera) in cameras(DVec3::splat(4.0)) {
            let image = render(&grid, &camera, &opaque, BACKGROUND, 8, 8).unwrap();
            assert_eq!(
                greatest_error(&image, &camera, grid.extent(), |_| BACKGROUND),
                0.0,
                "{dims:?}, {name}"
            );
        }
    }
}
