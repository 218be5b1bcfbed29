//! Opacity from the transfer function to the pixel: its limits, and that no resolution changes it.
//!
//! VTK's 2D transfer functions, vispy and neuroglancer get denser or thinner with the sampling distance. Here
//! the distance of samples, the number of bricks and the level of the cut are swept with the same matter.

use glam::DVec3;
use volery::{BackendChoice, ControlPoint, Dial, How, TransferFunction, View, ViewOptions, VolumeData};
use volery_reference::Image;
use volery_scene::VoxelGrid;
use volery_tests::{Drawer, at_most, backend, distance, draw, exact, values_of};

by_both_backends! {
    extremes_of_extinction_are_exact
    opacity_one_hides_everything_behind_a_sixteenth_of_a_cell
    the_distance_of_samples_does_not_change_opacity
    the_level_of_the_cut_does_not_change_opacity
    a_finer_unit_distance_is_the_same_matter
}

/// White matter of one opacity at all values, per world length 1.
fn white(opacity: f64) -> TransferFunction {
    TransferFunction::new(vec![ControlPoint { value: 0.0, color: [1.0; 3], opacity }], 1.0).unwrap()
}

/// Transparent at 0, half opaque and orange at 1, linear between.
fn ramp() -> TransferFunction {
    let clear = ControlPoint { value: 0.0, color: [0.1, 0.2, 0.9], opacity: 0.0 };
    let dense = ControlPoint { value: 1.0, color: [1.0, 0.5, 0.1], opacity: 0.5 };
    TransferFunction::new(vec![clear, dense], 1.0).unwrap()
}

/// A session and a view of it from aslant, on black; `None` if the test is ignored.
fn prepared(
    grid: VoxelGrid,
    transfer: TransferFunction,
    choice: BackendChoice,
    test: &str,
) -> Option<(Drawer<VolumeData>, View)> {
    let session = Drawer::volume(grid, backend(choice, test)?, How::Raycast).unwrap();
    let options =
        ViewOptions { width: 64, height: 64, transfer: Some(transfer.into()), ..ViewOptions::default() };
    let view = View { background: [0.0; 3], ..session.view(&options) };
    Some((session, view))
}

fn truth(grid: &VoxelGrid, view: &View) -> Image {
    volery_reference::render(grid, &view.camera, values_of(view), view.background, view.width, view.height)
        .unwrap()
}

fn extremes_of_extinction_are_exact(choice: BackendChoice, test: &str) {
    for opacity in [0.0, 1e-30, 1e-7, 1e-4, 0.5, 1.0 - 1e-12] {
        let grid = volery_data::uniform([9, 9, 9], DVec3::ONE, 0.0);
        let Some((mut session, view)) = prepared(grid.clone(), white(opacity), choice, test) else {
            return;
        };
        let drawn = exact(&draw(&mut session, &view).image);
        let found = distance(&format!("{choice:?}, opacity {opacity:e}"), &drawn, &truth(&grid, &view));
        // A backend may leave a ray that lets 1/4096 through.
        at_most("largest difference", found.max, 1.0 / 4096.0 + 2e-5);
        // Light of nearly nothing must not be lost: it may differ in its own digits, or in those of an f32 near 1.
        if opacity < 1e-3 {
            let brightest = drawn.pixels().iter().flatten().fold(0.0_f64, |a, &b| a.max(b));
            at_most("faint light", found.max, 1e-5 * brightest + f64::from(f32::EPSILON));
        }
    }
}

fn opacity_one_hides_everything_behind_a_sixteenth_of_a_cell(choice: BackendChoice, test: &str) {
    // Exactly opaque matter has no extinction in f32: what is thinner than 1/16 cell may let light through.
    let grid = volery_data::uniform([9, 9, 9], DVec3::ONE, 0.0);
    let Some((mut session, view)) = prepared(grid.clone(), white(1.0), choice, test) else { return };
    let drawn = exact(&draw(&mut session, &view).image);
    // The exact picture of half opaque matter tells how much of it a ray meets: 1 - .5^length.
    let half = truth(&grid, &View { transfer: white(0.5).into(), ..view.clone() });
    let (mut dark, mut bright) = (0, 0);
    for (drawn, half) in drawn.pixels().iter().zip(half.pixels()) {
        let length = -f64::log2(1.0 - half[0]);
        if length == 0.0 {
            assert_eq!(*drawn, [0.0; 3], "beside the cube");
            dark += 1;
        } else if length >= 1.0 / 16.0 {
            assert!(
                drawn.iter().all(|channel| (channel - 1.0).abs() <= 1.0 / 4096.0),
                "{drawn:?} after {length}"
            );
            bright += 1;
        }
    }
    println!("{choice:?}: {bright} pixels opaque, {dark} clear, of {}", 64 * 64);
    assert!(bright > 1000 && dark > 500, "{bright} pixels opaque, {dark} clear");
}

fn the_distance_of_samples_does_not_change_opacity(choice: BackendChoice, test: &str) {
    // A ramp along a diagonal is the same field at every resolution.
    let extent = 16.0;
    let mut first = None;
    for cells in [4_usize, 8, 16, 32, 64] {
        let spacing = DVec3::splat(extent / cells as f64);
        let grid = volery_data::ramp([cells + 1; 3], spacing, DVec3::splat(1.0 / (3.0 * extent)), 0.0);
        let Some((mut session, mut view)) = prepared(grid.clone(), ramp(), choice, test) else { return };
        view.camera = volery::Camera::fitted(DVec3::splat(extent), 30.0, 20.0, 1.0, false);
        let drawn = exact(&draw(&mut session, &view).image);
        let what = format!("{choice:?}, samples {} apart", spacing.x);
        let found = distance(&format!("{what}, to the exact picture"), &drawn, &truth(&grid, &view));
        // The colour within half a cell is taken as constant: tau/12 of its change, at the coarsest.
        at_most("largest difference", found.max, 2e-3);
        let coarsest = first.get_or_insert_with(|| drawn.clone());
        at_most("largest difference to the coarsest", distance(&what, &drawn, coarsest).max, 2e-3);
    }
}

fn the_level_of_the_cut_does_not_change_opacity(choice: BackendChoice, test: &str) {
    // Coarse levels of a ramp are the ramp: whatever the tolerance allows, the matter is the same.
    let grid = volery_data::ramp([129, 129, 129], DVec3::splat(0.125), DVec3::splat(1.0 / 48.0), 0.0);
    let Some((mut session, view)) = prepared(grid.clone(), ramp(), choice, test) else { return };
    let fine = draw(&mut session, &view);
    let coarse = draw(&mut session, &View { dial: Dial::Tolerance(1e-3), ..view.clone() });
    assert_eq!(coarse.report.work.nodes.unwrap(), 1, "a ramp needs the root alone");
    assert!(fine.report.work.nodes.unwrap() > 1, "{} nodes", fine.report.work.nodes.unwrap());
    let found = distance(&format!("{choice:?}, root to finest"), &exact(&coarse.image), &exact(&fine.image));
    at_most("largest difference", found.max, 2e-3);
}

fn a_finer_unit_distance_is_the_same_matter(choice: BackendChoice, test: &str) {
    // Opacity a per u and 1-(1-a)^k per k u are the same extinction.
    let grid = volery_data::uniform([17, 17, 17], DVec3::ONE, 0.0);
    let Some((mut session, view)) = prepared(grid.clone(), white(0.02), choice, test) else { return };
    let expected = exact(&draw(&mut session, &view).image);
    for factor in [0.25, 0.5, 2.0, 4.0] {
        let opacity = -f64::exp_m1(factor * f64::ln_1p(-0.02));
        let point = ControlPoint { value: 0.0, color: [1.0; 3], opacity };
        let transfer = TransferFunction::new(vec![point], factor).unwrap();
        let drawn = exact(&draw(&mut session, &View { transfer: transfer.into(), ..view.clone() }).image);
        at_most(&format!("{choice:?}, unit x{factor}"), distance("units", &drawn, &expected).max, 1e-6);
    }
}
