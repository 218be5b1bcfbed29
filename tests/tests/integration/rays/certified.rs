//! Bounds of pixels hold for what backends draw, and a largest error is kept.
//!
//! What a backend's arithmetic and integration add to coarse data is no part of a bound: a picture of all data shows how
//! much that is here, beside its thousandfold smaller mean.

use glam::DVec3;
use volery::{BackendChoice, Camera, Dial, How, Projection, TransferFunction, View};
use volery_scene::VoxelGrid;
use volery_tests::{Drawer, at_most, backend, draw, exact, matter_view};

use super::{BACKGROUND, aslant, noise, transfer, wave};

by_both_backends! {
    no_pixel_is_farther_from_the_truth_than_its_bound
    a_largest_error_is_kept
    a_largest_error_of_nothing_is_the_full_resolution
}

/// What backends add, at most: see `docs/rays.md`.
const DRAWING: f64 = 0.004;

const SIZE: [u32; 2] = [30, 25];

fn grid(dims: [usize; 3], value: impl Fn([usize; 3]) -> f32) -> VoxelGrid {
    VoxelGrid::new(dims, DVec3::new(1.0, 0.9, 1.2), volery_data::fill(dims, value)).expect("a grid")
}

/// More than one brick along each axis, and what differs: smooth, rough, with outliers, with holes, of whole numbers.
fn scenes() -> Vec<(&'static str, VoxelGrid, TransferFunction)> {
    let dims = [70, 49, 66];
    let smooth = |p: [usize; 3]| wave(p) as f32;
    let is_hole = |p: [usize; 3]| noise(p.map(|i| i / 9)) < 0.1;
    let ramp = || transfer(&[(0.4, 0.0), (0.6, 0.05), (0.9, 0.3)], 2.0);
    let steps = || transfer(&[(0.3, 0.0), (0.3, 0.1), (0.5, 0.2), (0.5, 0.0), (0.8, 0.0), (0.85, 1.0)], 2.0);
    let bytes = volery_data::fill(dims, |p| (255.0 * wave(p.map(|i| i / 2))) as u8);
    let spacing = DVec3::new(1.0, 0.9, 1.2);
    vec![
        ("smooth", grid(dims, smooth), ramp()),
        ("smooth, steps", grid(dims, smooth), steps()),
        ("rough", grid(dims, |p| (0.7 * wave(p) + 0.3 * noise(p)) as f32), ramp()),
        ("outliers", grid(dims, |p| if noise(p) < 1e-3 { -1e6 } else { smooth(p) }), steps()),
        ("holes", grid(dims, |p| if is_hole(p) { f32::NAN } else { smooth(p) }), ramp()),
        (
            "bytes",
            VoxelGrid::new(dims, spacing, bytes).expect("a grid"),
            transfer(&[(90.0, 0.0), (200.0, 0.2)], 2.0),
        ),
    ]
}

fn views(grid: &VoxelGrid, transfer: &TransferFunction) -> [View; 3] {
    let extent = DVec3::from_array(grid.dims().map(|n| (n - 1) as f64)) * grid.spacing();
    let outside = aslant(extent);
    let parallel = Camera { projection: Projection::Orthographic { height: 60.0 }, ..outside };
    let inside = Camera { eye: 0.45 * extent, ..outside };
    [outside, parallel, inside].map(|camera| matter_view(camera, transfer.clone(), BACKGROUND, SIZE))
}

fn no_pixel_is_farther_from_the_truth_than_its_bound(choice: BackendChoice, test: &str) {
    let (mut num_coarse, mut most): (usize, f64) = (0, 0.0);
    for (name, grid, transfer) in scenes() {
        let Some(backend) = backend(choice, test) else {
            return;
        };
        let views = views(&grid, &transfer);
        let mut session = Drawer::volume(grid, backend, How::Raycast).expect("a volume");
        for view in views {
            let full = draw(&mut session, &view);
            let truth = session.verify(&view, &mut full.clone(), &|_| ()).expect("a small picture");
            for tolerance in [0.02, 0.08, 0.2, 1.0] {
                let view = View { dial: Dial::Tolerance(tolerance), ..view.clone() };
                let mut picture = draw(&mut session, &view);
                let bound = session.certify(&view, &mut picture).expect("bounds of rays");
                let stated = picture.report.error.expect("certified");
                assert_eq!(stated.bound_max, Some(bound.max()));
                let drawn = exact(&picture.image);
                for ((bound, drawn), truth) in bound.pixels.iter().zip(drawn.pixels()).zip(truth.pixels()) {
                    for channel in 0..3 {
                        let above = (drawn[channel] - truth[channel]).abs() - f64::from(bound[channel]);
                        assert!(above <= DRAWING, "{name}, tolerance {tolerance}: {above} above the bound");
                        most = most.max(above);
                    }
                }
                num_coarse += usize::from(bound.max() > 0.01);
            }
        }
    }
    at_most("the farthest beyond a bound", most, DRAWING);
    assert!(num_coarse > 20, "{num_coarse} pictures are coarse");
}

fn a_largest_error_is_kept(choice: BackendChoice, test: &str) {
    let mut num_coarse = 0;
    for (name, grid, transfer) in scenes() {
        let Some(backend) = backend(choice, test) else { return };
        let view = views(&grid, &transfer)[0].clone();
        let mut session = Drawer::volume(grid, backend, How::Raycast).expect("a volume");
        let (mut before, mut levels_before) = (f64::INFINITY, Vec::new());
        for error in [0.5, 0.2, 0.05, 0.01] {
            let view = View { dial: Dial::Error(error), ..view.clone() };
            let mut picture = draw(&mut session, &view);
            session.verify(&view, &mut picture, &|_| ()).expect("a small picture");
            let stated = picture.report.error.expect("bounded");
            let bound = stated.bound_max.expect("a bound");
            at_most(&format!("{name}, error {error}: bound"), bound, error);
            let measured = stated.measured.expect("verified").measured_max;
            at_most(&format!("{name}, error {error}: measured"), measured, bound + DRAWING);
            assert!(bound <= before, "{name}: a smaller error has a larger bound");
            let levels = picture.report.work.nodes_by_level.expect("of a volume");
            num_coarse += usize::from(levels.iter().skip(1).any(|&num| num > 0));
            // A cut that is refined has the more nodes the finer it is.
            let num = |levels: &[usize]| levels.iter().sum::<usize>();
            assert!(num(&levels) >= num(&levels_before), "{name}: a smaller error has fewer nodes");
            (before, levels_before) = (bound, levels);
        }
    }
    assert!(num_coarse > 5, "{num_coarse} pictures have coarse nodes");
}

fn a_largest_error_of_nothing_is_the_full_resolution(choice: BackendChoice, test: &str) {
    let (_, grid, transfer) = scenes().swap_remove(1);
    let Some(backend) = backend(choice, test) else { return };
    let view = views(&grid, &transfer)[0].clone();
    let mut session = Drawer::volume(grid, backend, How::Raycast).expect("a volume");
    let full = draw(&mut session, &view).image;
    let dialled = draw(&mut session, &View { dial: Dial::Error(0.0), ..view }).image;
    assert!(full == dialled);
}
