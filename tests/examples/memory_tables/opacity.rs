//! Corrections of opacity against the truth: rays through homogeneous matter, a ramp, and nodes of a real volume.
//!
//! A ray of `n` samples one unit apart is shown by its first and last sample alone, as where a node is held coarser
//! (the paper's figures 3 and 4). Errors are of the opacity of the whole stretch of `n` units.

use std::path::Path;

use volery_reference::opacity::{homogeneous, integral, ramp};
use volery_scene::{ControlPoint, TransferFunction, VoxelGrid};
use volery_tests::{read_scene, transfer_of};

use crate::Outcome;

const SAMPLES: [u32; 4] = [2, 4, 8, 16];
const OPACITIES: [f64; 6] = [0.001, 0.01, 0.1, 0.5, 0.9, 1.0];

/// What four ways make of a stretch between two values: none, the paper's (i) and (ii), the exact integral.
fn corrected(transfer: &TransferFunction, [first, last]: [f64; 2], num: u32) -> [f64; 4] {
    let [a, b] = [first, last].map(|value| transfer.classify(value).1);
    [a, homogeneous(a, num), ramp(a, b, num), integral(transfer, first, last, f64::from(num))]
}

/// The opacity of a stretch through `values`, linear between them, one unit apart.
fn truth(transfer: &TransferFunction, values: &[f64]) -> f64 {
    let clear: f64 = values.windows(2).map(|pair| 1.0 - integral(transfer, pair[0], pair[1], 1.0)).product();
    1.0 - clear
}

/// Prints the tables.
pub(crate) fn tables(data: &Path) -> Outcome<()> {
    println!("| matter | n | opacity | none | (i) | (ii) | exact |\n|---|---|---|---|---|---|---|");
    for (name, of_ramp) in [("homogeneous", false), ("ramp from 0", true)] {
        for num in SAMPLES {
            for opacity in OPACITIES {
                let transfer = opacity_of_value(opacity)?;
                let start = if of_ramp { 0.0 } else { 1.0 };
                let share = |sample: u32| start + (1.0 - start) * f64::from(sample) / f64::from(num);
                let values: Vec<f64> = (0..=num).map(share).collect();
                let truth = truth(&transfer, &values);
                let errors = corrected(&transfer, [start, 1.0], num).map(|found| found - truth);
                print(&format!("{name} | {num} | {opacity}"), errors);
            }
        }
    }
    for name in ["engine", "mri"] {
        let input = read_scene(data, name);
        let transfer = transfer_of(input.scene.as_ref().ok_or("a scene")?);
        for num in SAMPLES {
            print(
                &format!("rays of {name} | {num} | rms of all"),
                real(&input.volume()?.grid, transfer, num),
            );
        }
    }
    Ok(())
}

fn print(what: &str, errors: [f64; 4]) {
    let [none, first, second, exact] = errors;
    println!("| {what} | {none:+.2e} | {first:+.2e} | {second:+.2e} | {exact:+.2e} |");
}

/// Opacity rises evenly with the value, from 0 at 0.
fn opacity_of_value(opacity: f64) -> Outcome<TransferFunction> {
    let point = |value: f64| ControlPoint { value, color: [1.0; 3], opacity: opacity * value };
    Ok(TransferFunction::new(vec![point(0.0), point(1.0)], 1.0)?)
}

/// Root mean square errors over stretches along x that are not wholly clear.
fn real(grid: &VoxelGrid, transfer: &TransferFunction, num: u32) -> [f64; 4] {
    let [width, height, depth] = grid.dims();
    let (mut squares, mut count) = ([0.0; 4], 0.0);
    for z in (0..depth).step_by(3) {
        for y in (0..height).step_by(3) {
            let row: Vec<f64> = (0..width).map(|x| grid.samples().value(grid.index([x, y, z]), 0)).collect();
            for values in row.windows(num as usize + 1).step_by(num as usize) {
                let truth = truth(transfer, values);
                if truth > 0.0 {
                    let found = corrected(transfer, [values[0], values[num as usize]], num);
                    (0..4).for_each(|way| squares[way] += (found[way] - truth).powi(2));
                    count += 1.0;
                }
            }
        }
    }
    squares.map(|sum: f64| (sum / count).sqrt())
}
