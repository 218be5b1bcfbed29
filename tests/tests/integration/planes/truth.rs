//! Planes in full resolution against the picture in f64, straight from the samples.
//!
//! What is left is f32: a place is off by less than 1e-6 of what a tile of 16 pixels spans, some ten samples here,
//! so by 1e-5 samples; from one sample to the next the colour changes by all there is at most. Pixels whose ray
//! grazes the end of the domain, a blank sample or the crossing of two planes could flip as a whole; the cameras
//! stand where none does. The nearest sample flips where a place is within that of the middle between two:
//! there the share of pixels that may is bounded instead.

use volery::fit::Direction;
use volery::glam::DVec3;
use volery::{BackendChoice, How, Plane, PlaneView, Sampling, View, ViewOptions, VolumeData, VoxelGrid};
use volery_tests::{Drawer, at_most, backend, data_folder, distance, draw, exact, planes_of};

use super::{ENGINE, MOUSE, MRI, Random, TOOTH, colors, read};

/// Largest difference of linear samples, of any channel of any pixel.
const MAX_DIFFERENCE: f64 = 2e-5;
const MAX_RMSE: f64 = 5e-7;

/// Views of one oblique plane and of three that cross, from aslant, perspective and orthographic, opaque and
/// transparent.
fn views(session: &Drawer<VolumeData>) -> Vec<(String, View)> {
    let extent = session.data().grid().extent();
    let oblique = Plane::through(extent * DVec3::new(0.47, 0.52, 0.49), DVec3::new(0.3, 0.5, 0.81) / extent);
    let crossing = [DVec3::X, DVec3::new(0.2, 1.0, 0.1), DVec3::new(-0.1, 0.3, 1.0)]
        .map(|normal| Plane::through(extent * 0.51, normal / extent));
    let direction = Some(Direction { azimuth_deg: 33.0, elevation_deg: 41.0, zoom: 1.1 });
    let mut views = Vec::new();
    for (planes, number) in [(vec![oblique], "one plane"), (crossing.to_vec(), "three planes")] {
        for orthographic in [false, true] {
            for is_transparent in [false, true] {
                let mut view = session.view(&ViewOptions {
                    width: 160,
                    height: 120,
                    direction,
                    orthographic,
                    transfer: Some(colors(session.value_range()).into()),
                    ..ViewOptions::default()
                });
                planes_of(&mut view).planes.clone_from(&planes);
                planes_of(&mut view).is_transparent = is_transparent;
                let projection = if orthographic { "orthographic" } else { "perspective" };
                let opacity = if is_transparent { "transparent" } else { "opaque" };
                views.push((format!("{number}, {projection}, {opacity}"), view));
            }
        }
    }
    views
}

fn is_the_truth(grid: VoxelGrid, choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let mut session = Drawer::volume(grid, backend, How::Planes(PlaneView::default())).unwrap();
    for (what, view) in views(&session) {
        let mut picture = draw(&mut session, &view);
        let truth = session.verify(&view, &mut picture, &|_| ()).unwrap();
        let found = distance(&format!("{test}, {what}"), &exact(&picture.image), &truth);
        at_most("largest difference", found.max, MAX_DIFFERENCE);
        at_most("rmse", found.rmse, MAX_RMSE);
        let background = view.background.map(|c| c as f32);
        let num_drawn = picture.image.pixels.iter().filter(|pixel| **pixel != background).count();
        assert!(num_drawn > 500, "{what}: {num_drawn} pixels show something");
    }
}

by_both_backends! { engine mouse mri tooth16 holes tissue the_nearest_sample the_middle_of_an_even_volume }

fn engine(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    is_the_truth(read(&data, ENGINE), choice, test);
}

fn mouse(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    is_the_truth(read(&data, MOUSE), choice, test);
}

fn mri(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    is_the_truth(read(&data, MRI), choice, test);
}

fn tooth16(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    is_the_truth(read(&data, TOOTH), choice, test);
}

/// White noise in f32 with blanks in it: the steepest field, and the most edges.
fn holes(choice: BackendChoice, test: &str) {
    is_the_truth(volery_data::holes([70, 66, 61], 5, 0.01), choice, test);
}

/// Colours with opacity.
fn tissue(choice: BackendChoice, test: &str) {
    is_the_truth(volery_data::tissue([100, 90, 50]), choice, test);
}

/// Oblique planes with nearest samples: whole pixels flip where a place is nearly in the middle between two.
fn the_nearest_sample(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    let Some(backend) = backend(choice, test) else { return };
    let mut session =
        Drawer::volume(read(&data, ENGINE), backend, How::Planes(PlaneView::default())).unwrap();
    for (what, mut view) in views(&session) {
        planes_of(&mut view).sampling = Sampling::Nearest;
        let mut picture = draw(&mut session, &view);
        let truth = session.verify(&view, &mut picture, &|_| ()).unwrap();
        let drawn = exact(&picture.image);
        let is_off = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-5);
        let num_off = drawn.pixels().iter().zip(truth.pixels()).filter(|&pair| is_off(pair)).count();
        let share = num_off as f64 / drawn.pixels().len() as f64;
        // Three axes, three planes, two sides of each middle, 1e-5 samples.
        at_most(&format!("{test}, {what}: share of pixels of another sample"), share, 2e-4);
    }
}

/// The planes through the middle lie exactly between two samples: everybody takes the upper one.
fn the_middle_of_an_even_volume(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    for name in [ENGINE, MOUSE, MRI] {
        let Some(backend) = backend(choice, test) else { return };
        let mut session =
            Drawer::volume(read(&data, name), backend, How::Planes(PlaneView::default())).unwrap();
        let direction = Some(Direction { azimuth_deg: 33.0, elevation_deg: 41.0, zoom: 1.1 });
        let transfer = Some(colors(session.value_range()).into());
        let options = ViewOptions { width: 160, height: 120, direction, transfer, ..ViewOptions::default() };
        let mut view = session.view(&options);
        planes_of(&mut view).sampling = Sampling::Nearest;
        let mut picture = draw(&mut session, &view);
        let truth = session.verify(&view, &mut picture, &|_| ()).unwrap();
        let drawn = exact(&picture.image);
        let is_off = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).any(|i| (a[i] - b[i]).abs() > 1e-5);
        let num_off = drawn.pixels().iter().zip(truth.pixels()).filter(|&pair| is_off(pair)).count();
        let share = num_off as f64 / drawn.pixels().len() as f64;
        at_most(&format!("{test}, {name}: share of pixels of another sample"), share, 2e-4);
    }
}

/// As many planes as there may be, all through each other, transparent: each pixel sorts its own.
#[test]
fn sixteen_planes_hide_one_another_as_in_the_truth() {
    let mut random = Random::new(11);
    let mut session = super::software(volery_data::marschner_lobb_u8(64));
    let extent = session.data().grid().extent();
    for is_transparent in [false, true] {
        let (_, mut view) = views(&session).swap_remove(0);
        planes_of(&mut view).planes = (0..16).map(|_| random.plane(extent)).collect();
        planes_of(&mut view).is_transparent = is_transparent;
        let mut picture = draw(&mut session, &view);
        let truth = session.verify(&view, &mut picture, &|_| ()).unwrap();
        let found = distance("sixteen planes", &exact(&picture.image), &truth);
        at_most("rmse", found.rmse, 1e-5);
    }
}
