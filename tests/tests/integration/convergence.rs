//! Orders of convergence (Etiene and others 2014): halve the grid, and the error must fall as the method
//! promises. It finds what golden pictures hide.

use glam::DVec3;
use volery::{BackendChoice, Camera, ControlPoint, How, TransferFunction, View};
use volery_reference::Image;
use volery_scene::VoxelGrid;
use volery_tests::{Drawer, SMOOTH_EXTENT, backend, distance, draw, exact, matter_view, smooth, values_of};

/// Colour and opacity change with the value, without a kink inside the field's range.
fn view() -> View {
    let points = vec![
        ControlPoint { value: 0.0, color: [0.1, 0.3, 0.9], opacity: 0.0 },
        ControlPoint { value: 1.0, color: [1.0, 0.6, 0.1], opacity: 0.6 },
    ];
    let camera = Camera::fitted(DVec3::splat(SMOOTH_EXTENT), 30.0, 20.0, 1.0, false);
    matter_view(camera, TransferFunction::new(points, 1.0).unwrap(), [0.0; 3], [48, 48])
}

fn truth(grid: &VoxelGrid, view: &View) -> Image {
    volery_reference::render(grid, &view.camera, values_of(view), view.background, view.width, view.height)
        .unwrap()
}

/// Orders between neighbouring errors of halved cells.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

#[test]
fn the_reference_converges_with_the_grid_at_second_order() {
    // Trilinear interpolation is of second order, the integral along the ray is exact.
    let view = view();
    let finest = truth(&smooth(256), &view);
    let errors = [8, 16, 32].map(|cells| {
        let found =
            distance(&format!("reference, {cells} cells to 256"), &truth(&smooth(cells), &view), &finest);
        found.rmse
    });
    let found = orders(&errors);
    println!("orders {found:.2?}, expected 2 within .15");
    assert!(found.iter().all(|order| (order - 2.0).abs() < 0.15), "{found:?}");
}

by_both_backends! { a_backend_converges_to_the_reference_at_second_order }

fn a_backend_converges_to_the_reference_at_second_order(choice: BackendChoice, test: &str) {
    // On the same samples, what is left is the integration over parts of cells. Matter is thin here: where straight
    // pieces could be off by much, backends cut finer or integrate exactly, and there is no order to be seen.
    let thin = TransferFunction::new(values_of(&view()).points().to_vec(), 10.0).unwrap();
    let view = View { transfer: thin.into(), ..view() };
    let mut errors = Vec::new();
    for cells in [8, 16, 32] {
        let grid = smooth(cells);
        let Some(backend) = backend(choice, test) else { return };
        let drawn =
            exact(&draw(&mut Drawer::volume(grid.clone(), backend, How::Raycast).unwrap(), &view).image);
        errors.push(distance(&format!("{choice:?}, {cells} cells"), &drawn, &truth(&grid, &view)).rmse);
    }
    let found = orders(&errors);
    let whole = found.iter().sum::<f64>() / found.len() as f64;
    println!("orders {found:.2?}, over all {whole:.2}, expected at least 1.8");
    assert!(whole >= 1.8 && found.iter().all(|order| *order > 1.0), "{choice:?}: {found:?}");
}

#[test]
fn pixels_converge_to_the_integral_over_the_picture() {
    // A pixel is its centre: the mean over the picture is a midpoint rule. The silhouette has kinks but no steps,
    // so its order is above 1.
    let grid = smooth(8);
    let mean = |size: u32| {
        let image = truth(&grid, &View { width: size, height: size, ..view() });
        image.pixels().iter().flatten().sum::<f64>() / f64::from(size * size * 3)
    };
    let finest = mean(512);
    let errors = [16, 32, 64, 128].map(|size| (mean(size) - finest).abs());
    let order = (errors[0] / errors[3]).log2() / 3.0;
    println!("errors {errors:?}, order {order:.2}, expected above 1");
    assert!(order > 1.0, "{order}");
}
