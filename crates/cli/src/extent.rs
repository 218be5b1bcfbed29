//! Grids that numbers of 64 bits cannot slice.

use std::path::Path;

use volery::UnstructuredGrid;
use volery::glam::DVec3;
use volery::info::number;

use crate::Failure;

/// Squares of longer distances are no numbers.
const LONGEST: f64 = 1e150;
/// Steps of 64-bit numbers between two planes, at least.
const LEAST_STEPS: f64 = 16.0;

/// Refuses grids whose cells lie too far apart for a camera, or too near one another, for where they are, to be told
/// apart in so many slices; `normal` is that of the planes where it is known, along which a grid must not be flat.
pub(crate) fn check(
    path: &Path,
    grid: &UnstructuredGrid,
    num_slices: usize,
    normal: Option<DVec3>,
) -> Result<(), Failure> {
    // That every cell is blank is said elsewhere.
    let Some([low, high]) = grid.world_bounds() else { return Ok(()) };
    let corner = |corner: DVec3| corner.to_array().map(number).join(", ");
    let place = || format!("lies from {} to {}", corner(low), corner(high));
    let size = (high - low).max_element();
    let farthest = low.abs().max(high.abs()).max_element();
    if [size, farthest].iter().any(|length| length.is_nan() || *length >= LONGEST) {
        let problem = format!("{}, expected places within 1e150 of the origin", place());
        return Err(Failure::of_file(path, problem));
    }
    let step = low.abs().max(high.abs()).max_element() * f64::EPSILON;
    let most = size / (LEAST_STEPS * step);
    if size > 0.0 && most < num_slices as f64 {
        let most = number(most.floor());
        let problem = format!(
            "{}, where 64-bit numbers can tell {most} slices apart, expected fewer than {num_slices}",
            place()
        );
        return Err(Failure::of_file(path, problem));
    }
    let along = |normal: DVec3| {
        let [a, b] = [low, high].map(|corner| corner * normal);
        b.max(a).element_sum() - a.min(b).element_sum()
    };
    match normal.map(DVec3::normalize).filter(|normal| along(*normal) == 0.0) {
        None => Ok(()),
        Some(normal) => {
            let problem = format!("{}, flat along {}, expected another --axis", place(), corner(normal));
            Err(Failure::of_file(path, problem))
        }
    }
}
