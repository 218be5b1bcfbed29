//! Rays on hard data: pictures depend on the field where matter is and on the transfer function, on nothing else.
//!
//! `cargo run --release -p volery-tests --example ray_attack` searches for more of the kind.

use std::f64::consts::TAU;

use glam::DVec3;
use volery::{Camera, ControlPoint, TransferFunction};
use volery_data::{fill, hash};

mod certified;
mod invariances;
mod kinds;

/// In front of it all three channels of matter and of the background differ.
const BACKGROUND: [f64; 3] = [0.1, 0.5, 0.9];

/// A smooth field in [0, 1] without symmetry, a wave about every twelve samples.
fn wave([x, y, z]: [usize; 3]) -> f64 {
    let [x, y, z] = [x, y, z].map(|i| i as f64);
    let waves = (TAU / 12.0 * (x + 0.4 * z)).sin() + (TAU / 13.0 * (y - 0.3 * x) + 1.0).sin();
    0.5 + (waves + (TAU / 11.0 * (z + 0.5 * y) + 2.0).sin()) / 6.0
}

/// Noise in [0, 1).
fn noise([x, y, z]: [usize; 3]) -> f64 {
    hash((x + 1000 * (y + 1000 * z)) as u64) as f64 / 2_f64.powi(64)
}

/// From aslant, a little off the middle.
fn aslant(extent: DVec3) -> Camera {
    let camera = Camera::fitted(extent, 33.0, 24.0, 1.1, false);
    Camera { target: camera.target + 0.013 * extent, ..camera }
}

/// Control points `(value, opacity)` with colours that differ from point to point.
fn transfer(points: &[(f64, f64)], unit_distance: f64) -> TransferFunction {
    let point = |(index, &(value, opacity)): (usize, &(f64, f64))| {
        let color = std::array::from_fn(|channel| noise([index, channel, 7]));
        ControlPoint { value, color, opacity }
    };
    TransferFunction::new(points.iter().enumerate().map(point).collect(), unit_distance).unwrap()
}

/// Matter of one opacity in the values from `low` to `high`, none elsewhere.
fn shell(low: f64, high: f64, opacity: f64, unit_distance: f64) -> TransferFunction {
    transfer(&[(low, 0.0), (low, opacity), (high, opacity), (high, 0.0)], unit_distance)
}
