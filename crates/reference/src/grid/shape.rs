//! The field inside a cell: VTK's interpolation of each type, and its inverse.
//!
//! Place and value at local coordinates `(r, s, t)` of the unit cube, prism or pyramid are sums over the nodes of
//! shape functions. For every type they span no more than the eight products `1, r, s, t, rs, st, tr, rst`, so a
//! cell is eight coefficients: a wedge has no `rs` and `rst`, a pyramid is a hexahedron whose top is one point.
//!
//! Where a point has which local coordinates is found by Newton's method, from a guess.

use glam::DVec3;
use volery_scene::CellType;

/// Newton's method ends when a step is below this; it converges quadratically, so the last step leaves the rounding.
const CONVERGED: f64 = 1e-8;

/// Most steps of Newton's method.
const MAX_STEPS: usize = 24;

/// How far local coordinates may be outside the cell, for the sake of faces that are not planar.
const OUTSIDE: f64 = 0.25;

/// Local coordinates of a type's nodes; the apex of a pyramid, which has many, lies above the middle of its base.
pub(super) fn local_nodes(cell_type: CellType) -> &'static [[f64; 3]] {
    match cell_type {
        CellType::Tetrahedron => &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        CellType::Pyramid => {
            &[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]]
        }
        CellType::Wedge => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
        CellType::Hexahedron => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [1.0, 1.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
        CellType::Voxel => &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
            [1.0, 1.0, 1.0],
        ],
    }
}

/// A cell as a map from local coordinates to places and values.
pub(super) struct Shape {
    cell_type: CellType,
    places: [DVec3; 8],
    values: [f64; 8],
}

impl Shape {
    /// The map of a cell; the first entries of the arrays are its nodes'.
    pub(super) fn new(cell_type: CellType, places: &[DVec3; 8], values: &[f64; 8]) -> Self {
        let axes = [0, 1, 2].map(|axis| coefficients(cell_type, &places.map(|place| place[axis])));
        let places = std::array::from_fn(|i| DVec3::new(axes[0][i], axes[1][i], axes[2][i]));
        Self { cell_type, places, values: coefficients(cell_type, values) }
    }

    /// The value at a place, whose local coordinates are found from a guess; `None` where the map has no inverse near.
    pub(super) fn value_at(&self, place: DVec3, guess: DVec3) -> Option<f64> {
        let mut local = guess;
        for _ in 0..MAX_STEPS {
            let step = self.newton_step(place, local);
            local -= step;
            if step.abs().max_element() <= CONVERGED {
                return self.is_near(local).then(|| self.value(local));
            }
        }
        None
    }

    fn newton_step(&self, place: DVec3, DVec3 { x: r, y: s, z: t }: DVec3) -> DVec3 {
        let [c, cr, cs, ct, crs, cst, ctr, crst] = self.places;
        let along_r = cr + crs * s + (ctr + crst * s) * t;
        let along_s = cs + crs * r + (cst + crst * r) * t;
        let along_t = ct + cst * s + (ctr + crst * s) * r;
        let residual = c + cs * s + (ct + cst * s) * t + along_r * r - place;
        let across = along_s.cross(along_t);
        let volume = along_r.dot(across);
        DVec3::new(
            residual.dot(across),
            residual.dot(along_t.cross(along_r)),
            residual.dot(along_r.cross(along_s)),
        ) / volume
    }

    fn value(&self, DVec3 { x: r, y: s, z: t }: DVec3) -> f64 {
        let [c, cr, cs, ct, crs, cst, ctr, crst] = self.values;
        (c + cr * r) + (cs + crs * r) * s + ((ct + ctr * r) + (cst + crst * r) * s) * t
    }

    fn is_near(&self, local: DVec3) -> bool {
        let is_in_cube = (local - 0.5).abs().max_element() <= 0.5 + OUTSIDE;
        is_in_cube && (self.cell_type != CellType::Wedge || local.x + local.y <= 1.0 + OUTSIDE)
    }
}

/// Coefficients of `1, r, s, t, rs, st, tr, rst`.
fn coefficients(cell_type: CellType, nodes: &[f64; 8]) -> [f64; 8] {
    let [a, b, c, d, e, f, g, h] = *nodes;
    // Of a hexahedron: the bottom around, then the top around.
    let [a, b, c, d, e, f, g, h] = match cell_type {
        CellType::Tetrahedron => return [a, b - a, c - a, d - a, 0.0, 0.0, 0.0, 0.0],
        CellType::Wedge => {
            return [a, b - a, c - a, d - a, 0.0, (f - d) - (c - a), (e - d) - (b - a), 0.0];
        }
        CellType::Pyramid => [a, b, c, d, e, e, e, e],
        CellType::Hexahedron => [a, b, c, d, e, f, g, h],
        CellType::Voxel => [a, b, d, c, e, f, h, g],
    };
    let bottom = (c - d) - (b - a);
    let top = (g - h) - (f - e);
    [a, b - a, d - a, e - a, bottom, (h - e) - (d - a), (f - e) - (b - a), top - bottom]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// VTK's shape functions as its documentation of each type has them.
    fn weights(cell_type: CellType, [r, s, t]: [f64; 3]) -> Vec<f64> {
        let (or, os, ot) = (1.0 - r, 1.0 - s, 1.0 - t);
        match cell_type {
            CellType::Tetrahedron => vec![1.0 - r - s - t, r, s, t],
            CellType::Pyramid => vec![or * os * ot, r * os * ot, r * s * ot, or * s * ot, t],
            CellType::Wedge => {
                let u = 1.0 - r - s;
                vec![u * ot, r * ot, s * ot, u * t, r * t, s * t]
            }
            CellType::Hexahedron => vec![
                or * os * ot,
                r * os * ot,
                r * s * ot,
                or * s * ot,
                or * os * t,
                r * os * t,
                r * s * t,
                or * s * t,
            ],
            CellType::Voxel => vec![
                or * os * ot,
                r * os * ot,
                or * s * ot,
                r * s * ot,
                or * os * t,
                r * os * t,
                or * s * t,
                r * s * t,
            ],
        }
    }

    proptest! {
        #[test]
        fn the_inverse_finds_what_the_shape_functions_made(
            kind in 0..CellType::ALL.len(),
            warp in proptest::array::uniform24(-0.12..0.12f64),
            values in proptest::array::uniform8(-1.0..1.0f64),
            local in proptest::array::uniform3(0.02..0.98f64),
        ) {
            let cell_type = CellType::ALL[kind];
            let mut local = local;
            match cell_type {
                CellType::Tetrahedron => local = local.map(|x| x / 3.0),
                CellType::Wedge => local = [local[0] / 2.0, local[1] / 2.0, local[2]],
                _ => {}
            }
            let mut places = [DVec3::ZERO; 8];
            for (i, node) in local_nodes(cell_type).iter().enumerate() {
                places[i] = DVec3::from_array(*node) + DVec3::from_slice(&warp[3 * i..3 * i + 3]);
            }
            let weights = weights(cell_type, local);
            let place: DVec3 = weights.iter().zip(places).map(|(&weight, place)| place * weight).sum();
            let expected: f64 = weights.iter().zip(values).map(|(weight, value)| value * weight).sum();
            let shape = Shape::new(cell_type, &places, &values);
            let found = shape.value_at(place, DVec3::splat(0.4)).expect("the map has an inverse");
            prop_assert!((found - expected).abs() < 1e-12, "{cell_type} {local:?}: {found}, expected {expected}");
        }
    }

    #[test]
    fn a_cell_without_inverse_says_so() {
        let flat = [DVec3::ZERO; 8];
        assert!(Shape::new(CellType::Hexahedron, &flat, &[1.0; 8]).value_at(DVec3::X, DVec3::ZERO).is_none());
    }
}
