//! What cannot be drawn is said, and nothing panics.

use std::sync::Mutex;

use glam::DVec3;
use volery_data::{noise, uniform};
use volery_reference::{Error, Tracer, render};
use volery_scene::{Camera, SampleType, VoxelGrid, camera};

use crate::slow::{Random, perspective, transfer};

#[test]
fn colours_are_refused() {
    let matter = transfer(&[(0.0, [1.0; 3], 0.5)], 1.0);
    let rgb = VoxelGrid::new([2, 1, 1], DVec3::ONE, vec![[1u8, 2, 3]; 2]).unwrap();
    let error = Tracer::new(&rgb, &matter).unwrap_err();
    assert_eq!(error, Error::ColorSamples { found: SampleType::Rgb8 });
    assert_eq!(error.to_string(), "reference: samples are rgb8, expected scalars");
}

#[test]
fn cameras_and_sizes_without_meaning_are_refused() {
    let grid = uniform([2, 2, 2], DVec3::ONE, 1.0);
    let matter = transfer(&[(0.0, [1.0; 3], 0.5)], 1.0);
    let good = Camera::fitted(grid.extent(), 0.0, 0.0, 1.0, false);
    let bad = Camera { target: good.eye, ..good };
    let picture = |camera: &Camera, width, height| render(&grid, camera, &matter, [0.0; 3], width, height);
    let defects = vec![camera::Defect::NoDirection];
    assert_eq!(picture(&bad, 4, 4).unwrap_err(), Error::Camera { defects });
    for (width, height) in [(0, 4), (4, 0), (u32::MAX, u32::MAX)] {
        assert_eq!(picture(&good, width, height).unwrap_err(), Error::Size { width, height });
    }
}

#[test]
fn progress_rises_to_the_end() {
    let grid = uniform([2, 2, 2], DVec3::ONE, 1.0);
    let matter = transfer(&[(0.0, [1.0; 3], 0.5)], 1.0);
    let camera = Camera::fitted(grid.extent(), 0.0, 0.0, 1.0, false);
    let parts = Mutex::new(Vec::new());
    let record = |part| parts.lock().unwrap().push(part);
    Tracer::new(&grid, &matter).unwrap().render(&camera, [0.0; 3], 3, 8, &record).unwrap();
    let mut parts = parts.into_inner().unwrap();
    parts.sort_by(f64::total_cmp);
    assert_eq!(parts, [0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0]);
}

#[test]
fn extreme_numbers_end_in_numbers() {
    let mut random = Random::new(20);
    for (scale, spacing) in [(1e290, 1e-300), (1e-310, 1e300), (1e100, 1.0), (1.0, 1e-6)] {
        let values: Vec<f64> = (0..64).map(|_| (random.unit() - 0.5) * scale).collect();
        let grid = VoxelGrid::new([4, 4, 4], DVec3::splat(spacing), values).unwrap();
        for unit_distance in [f64::MIN_POSITIVE, 1.0, f64::MAX] {
            let points = [(-0.3, [0.2; 3], 0.0), (0.0, [0.9; 3], 1.0), (0.3, [0.4; 3], 0.1)];
            let points = points.map(|(value, color, opacity)| (value * scale, color, opacity));
            let matter = transfer(&points, unit_distance);
            let center = grid.extent() / 2.0;
            let camera = perspective(center + DVec3::new(0.6, -1.0, 0.8) * spacing * 9.0, center, 40.0);
            if !camera.defects().is_empty() {
                // Beyond the camera's own range of numbers, and so refused.
                assert!(render(&grid, &camera, &matter, [0.5; 3], 9, 9).is_err());
                continue;
            }
            let image = render(&grid, &camera, &matter, [0.5; 3], 9, 9).unwrap();
            for pixel in image.pixels() {
                let unit = |c: f64| (-1e-9..=1.0 + 1e-9).contains(&c);
                assert!(pixel.iter().all(|&c| unit(c)), "{scale:e} {spacing:e} {unit_distance:e}: {pixel:?}");
            }
        }
    }
}

#[test]
fn no_tolerance_is_too_small_to_end() {
    let grid = noise([3, 3, 3], 23);
    let matter = transfer(&[(0.0, [0.2; 3], 0.0), (128.0, [0.9; 3], 1.0), (255.0, [0.1; 3], 0.0)], 1.0);
    let ray = volery_scene::Ray { origin: DVec3::new(0.3, -1.0, 0.6), direction: DVec3::Y };
    let lights = [1e-15, 1e-30, 0.0, -1.0, f64::NAN]
        .map(|tolerance| Tracer::new(&grid, &matter).unwrap().with_tolerance(tolerance).trace(&ray));
    assert!(lights.iter().all(|light| *light == lights[0]));
    assert!(lights[0].transmittance < 0.9);
}

#[test]
fn rays_that_are_none_meet_nothing_or_something_but_end() {
    let grid = noise([5, 5, 5], 21);
    let matter = transfer(&[(0.0, [0.2; 3], 0.0), (255.0, [0.9; 3], 1.0)], 1.0);
    let tracer = Tracer::new(&grid, &matter).unwrap();
    let numbers = [0.0, -0.0, 1.0, -1.0, 2.0, 4.0, 1e-310, -1e-310, 1e300, f64::INFINITY, f64::NAN];
    let mut random = Random::new(22);
    for _ in 0..20_000 {
        let mut any = || numbers[random.below(numbers.len())];
        let origin = DVec3::new(any(), any(), any());
        let direction = DVec3::new(any(), any(), any());
        let light = tracer.trace(&volery_scene::Ray { origin, direction });
        assert!((0.0..=1.0).contains(&light.transmittance), "{origin} {direction}: {light:?}");
    }
}
