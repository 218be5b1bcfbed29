//! Gradients at the nodes of a grid, from values at the nodes.
//!
//! # Method
//! Least squares: the gradient `g` of a node minimises `Σ (Δf - g · d)² / |d|²` over the other nodes of the cells
//! around it, where `d` leads to the other node and `Δf` is how much the value rises on the way. A node counts once for
//! every cell that both share (in a collapsed one, once for every place it has there). The weights make each term the error of a derivative along a direction, so near nodes
//! in thin cells count as much as far ones, and the scale of the grid does not matter. Shape functions would do as
//! well in good cells, but have no gradient at the corners of collapsed ones.
//!
//! With `u = d / |d|` that is `M g = Σ u Δf / |d|`, `M = Σ u uᵀ`. Where the directions lie near a plane or a line, as in
//! thin cells, the sums are taken again in coordinates along the eigenvectors of `M` in which `M` is 1, and so lose no
//! digits. Where they lie within it, to a sine of 1e-6, nothing is known across; then `g` has no part across: it is the
//! solution of least norm.
//!
//! # Guarantees
//! - Exact on linear fields, for any type, orientation and shape of cells, but for what the rounding of coordinates and
//!   values does over the thickness of a cell.
//! - Nodes whose value is NaN or infinite do not count for others; their own gradient is zero, as is that of nodes
//!   without neighbours, or with neighbours nowhere but in blank cells or at the same place.
//! - The same bits whatever the number of threads.
//!
//! # Limits
//! Around a curved wall with cells much thinner than they are long, values along the wall spoil the derivative across
//! it by the curvature; the weights keep that small, they do not remove it.

use glam::{DMat3, DVec3, Vec3Swizzles};
use rayon::prelude::*;
use volery_scene::{Sample, Samples, UnstructuredGrid, for_samples};

/// Eigenvalues of `M`, squares of sines, below this part of its trace count as zero.
const FLAT: f64 = 1e-12;

/// With a determinant above this part of the cube of a third of its trace `M` is solved as it is.
const ROUND: f64 = 1e-6;

/// The gradient of the values at every node, per world length; of the first channel of colours.
///
/// # Panics
/// When there are fewer values than the grid has nodes.
pub fn node_gradients(grid: &UnstructuredGrid, values: &Samples) -> Vec<DVec3> {
    fn of<T: Sample>(values: &[T], num_points: usize) -> Vec<f64> {
        values[..num_points].iter().map(|value| value.channel(0)).collect()
    }
    let values = for_samples!(values, |values| of(values, grid.points().len()));
    let around = CellsAround::new(grid);
    (0..grid.points().len())
        .into_par_iter()
        .map(|node| gradient(grid, &values, node, around.node(node)))
        .collect()
}

/// The cells around each node that are not blank, ascending; those with a node twice are there twice.
struct CellsAround {
    starts: Vec<u32>,
    cells: Vec<u32>,
}

impl CellsAround {
    fn new(grid: &UnstructuredGrid) -> Self {
        let cells = grid.cells();
        let num_cells = cells.len();
        let is_blank: Vec<bool> = (0..num_cells).into_par_iter().map(|cell| grid.is_blank(cell)).collect();
        let full = (0..num_cells).filter(|&cell| !is_blank[cell]);
        // Counts, then the end of each node's cells, then, as they are put in from the back, the start.
        let mut starts = vec![0u32; grid.points().len() + 1];
        for cell in full.clone() {
            cells.get(cell).1.iter().for_each(|&node| starts[node as usize] += 1);
        }
        let mut end = 0;
        for start in &mut starts {
            end += *start;
            *start = end;
        }
        let mut around = vec![0; end as usize];
        for cell in full.rev() {
            for &node in cells.get(cell).1 {
                let place = &mut starts[node as usize];
                *place -= 1;
                around[*place as usize] = cell as u32;
            }
        }
        Self { starts, cells: around }
    }

    fn node(&self, node: usize) -> &[u32] {
        &self.cells[self.starts[node] as usize..self.starts[node + 1] as usize]
    }
}

fn gradient(grid: &UnstructuredGrid, values: &[f64], node: usize, cells: &[u32]) -> DVec3 {
    let (point, value) = (grid.points()[node], values[node]);
    if !value.is_finite() {
        return DVec3::ZERO;
    }
    let around = || {
        let others = cells.iter().flat_map(|&cell| grid.cells().get(cell as usize).1);
        others.map(|&other| (grid.points()[other as usize] - point, values[other as usize] - value))
    };
    let (matrix, right) = normal_equations(around(), |d| d);
    let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    let gradient = if matrix.determinant() > ROUND * (trace / 3.0).powi(3) {
        matrix.inverse() * right
    } else {
        let (eigenvalues, vectors) = eigen(&matrix);
        let is_known = eigenvalues.map(|eigenvalue| eigenvalue > FLAT * trace);
        let scale = |axis: usize| if is_known[axis] { 1.0 / eigenvalues[axis].sqrt() } else { 0.0 };
        let to_round = DMat3::from_diagonal(DVec3::from_array([0, 1, 2].map(scale))) * vectors.transpose();
        let (matrix, right) = normal_equations(around(), |d| to_round * d);
        let unknown = DVec3::from_array(is_known.map(|is_known| f64::from(!is_known)));
        to_round.transpose() * ((matrix + DMat3::from_diagonal(unknown)).inverse() * right)
    };
    if gradient.is_finite() { gradient } else { DVec3::ZERO }
}

/// `M` and `Σ u Δf / |d|` in other coordinates, from pairs of `d` and `Δf`; the lengths are those of `d`.
fn normal_equations(
    around: impl Iterator<Item = (DVec3, f64)>,
    place: impl Fn(DVec3) -> DVec3,
) -> (DMat3, DVec3) {
    let (mut diagonal, mut rest, mut right) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
    for (d, rise) in around {
        let weight = 1.0 / d.length_squared();
        // Zero where they are infinitely far, infinite where they are at one place.
        if weight.is_normal() && rise.is_finite() {
            let d = place(d);
            let weighted = weight * d;
            diagonal += weighted * d;
            rest += weighted.yzx() * d.zxy();
            right += weighted * rise;
        }
    }
    let matrix = DMat3::from_cols(
        DVec3::new(diagonal.x, rest.z, rest.y),
        DVec3::new(rest.z, diagonal.y, rest.x),
        DVec3::new(rest.y, rest.x, diagonal.z),
    );
    (matrix, right)
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn eigen(matrix: &DMat3) -> ([f64; 3], DMat3) {
    // Converges quadratically; six sweeps leave nothing but rounding.
    const SWEEPS: usize = 8;
    let (mut a, mut vectors) = (matrix.to_cols_array_2d(), DMat3::IDENTITY.to_cols_array_2d());
    for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().cycle().take(3 * SWEEPS) {
        if a[p][q] == 0.0 {
            continue;
        }
        let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        let tangent = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypot(1.0));
        let cosine = 1.0 / tangent.hypot(1.0);
        let sine = tangent * cosine;
        for column in &mut a {
            (column[p], column[q]) =
                (cosine * column[p] - sine * column[q], sine * column[p] + cosine * column[q]);
        }
        for i in 0..3 {
            (a[p][i], a[q][i]) = (cosine * a[p][i] - sine * a[q][i], sine * a[p][i] + cosine * a[q][i]);
            let [from, to] = [vectors[p][i], vectors[q][i]];
            (vectors[p][i], vectors[q][i]) = (cosine * from - sine * to, sine * from + cosine * to);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], DMat3::from_cols_array_2d(&vectors))
}
