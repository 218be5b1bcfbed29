//! Convergence: the whole way from samples to pixels is of second order in the size of a cell.

use glam::DVec3;
use volery_scene::Camera;

use volery_frame::Backend;

use super::oracle::{Medium, assert_shows_something, difference, march};
use super::world::{BACKGROUND_F64, Storage, Volume, draw, smooth_transfer};

/// A smooth function sampled ever finer: halving the cell quarters the error against the function's own
/// picture. Fixed steps, or pieces that do not end at the faces of cells, fall behind.
pub fn error_falls_with_the_square_of_the_cell(backend: &mut dyn Backend) {
    let field = |p: DVec3| {
        let q = p - DVec3::new(0.45, 0.55, 0.5);
        0.5 + 0.45 * (5.0 * q.x + 2.0 * q.y * q.y).sin() * (4.0 * q.z - 1.5 * q.x).cos()
    };
    let tf = smooth_transfer(0.08);
    let (extent, size) = (DVec3::ONE, [32, 32]);
    let camera = Camera::fitted(extent, 30.0, 20.0, 1.1, false);
    let medium = Medium { extent, step: 1.0 / 2048.0, transfer: &tf, value: &field };
    let expected = march(&medium, &camera, size, BACKGROUND_F64);
    assert_shows_something("analytic field", &expected, BACKGROUND_F64);
    let cells = [4_u32, 8, 16, 32];
    let errors = cells.map(|n| {
        let spacing = 1.0 / f64::from(n);
        let volume =
            Volume::new([n + 1; 3], DVec3::splat(spacing), Storage::F32, move |p| field(p * spacing));
        let [max, rmse] = difference(&draw(backend, &volume, &tf, &camera, size), &expected);
        println!("{n} cells: rmse {rmse:.3e}, max {max:.3e}");
        rmse
    });
    // The slope of the least-squares line through the logarithms.
    let logs = [0.0, 1.0, 2.0, 3.0].map(|i: f64| (i - 1.5, errors[i as usize].log2()));
    let slope = logs.iter().map(|(x, y)| x * y).sum::<f64>() / logs.iter().map(|(x, _)| x * x).sum::<f64>();
    println!("order {:.2} (threshold 1.8)", -slope);
    assert!(-slope >= 1.8, "order {:.2} of errors {errors:?}, expected at least 1.8", -slope);
}
