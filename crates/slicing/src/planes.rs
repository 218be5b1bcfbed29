//! A family of parallel planes.

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::{Plane, UnstructuredGrid};

/// Parallel planes `normal · x = position` by ascending position.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    normal: DVec3,
    positions: Vec<f64>,
    distance: f64,
}

/// Why planes could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A normal without direction.
    #[error("slicing planes: normal {found}, expected a finite vector other than zero")]
    Normal {
        /// As given.
        found: DVec3,
    },
    /// A distance between planes that is none.
    #[error("slicing planes: distance {found} between planes, expected a positive finite number")]
    Distance {
        /// As given.
        found: f64,
    },
    /// Positions that are not finite or do not ascend.
    #[error(
        "slicing planes: position {found} of plane {plane}, expected finite positions in ascending order"
    )]
    Position {
        /// Number of the plane.
        plane: usize,
        /// As given.
        found: f64,
    },
    /// More than can be numbered.
    #[error("slicing planes: {found} planes, expected at most {}", Planes::MAX)]
    TooMany {
        /// How many.
        found: usize,
    },
    /// A grid that is no thicker along the normal than rounding of its coordinates.
    #[error(
        "slicing planes: the grid is flat along {normal}, at {position}, expected an extent to spread planes over"
    )]
    Flat {
        /// The unit normal.
        normal: DVec3,
        /// Where it lies.
        position: f64,
    },
    /// Planes so near to one another that numbers cannot tell their positions apart.
    #[error(
        "slicing planes: {count} planes from {low} to {high}, expected so few that 64 bits tell their positions apart"
    )]
    TooFine {
        /// How many.
        count: usize,
        /// Where the grid begins along the normal.
        low: f64,
        /// Where it ends.
        high: f64,
    },
    /// A grid without any cell that is not blank has no extent to spread planes over.
    #[error("slicing planes: the grid has no cell that is not blank, expected at least one")]
    NoCells,
}

impl Planes {
    /// The most planes of one family.
    pub const MAX: usize = 1 << 24;

    /// Planes at these positions along `normal`, which may have any length and is made a unit vector;
    /// each stands for a slab of thickness `distance`.
    ///
    /// # Errors
    /// When the normal has no direction, the distance is not positive or the positions do not ascend.
    pub fn new(normal: DVec3, positions: Vec<f64>, distance: f64) -> Result<Self, Error> {
        Self::of_unit(unit(normal)?, positions, distance)
    }

    pub(crate) fn of_unit(unit: DVec3, positions: Vec<f64>, distance: f64) -> Result<Self, Error> {
        if !(distance > 0.0 && distance.is_finite()) {
            return Err(Error::Distance { found: distance });
        }
        if positions.len() > Self::MAX {
            return Err(Error::TooMany { found: positions.len() });
        }
        let ascends = |plane: usize| {
            positions[plane].is_finite() && (plane == 0 || positions[plane - 1] < positions[plane])
        };
        if let Some(plane) = (0..positions.len()).find(|&plane| !ascends(plane)) {
            return Err(Error::Position { plane, found: positions[plane] });
        }
        Ok(Self { normal: unit, positions, distance })
    }

    /// `count` planes evenly over the extent of a grid: in the middles of as many slabs that fill it.
    ///
    /// # Errors
    /// As [`new`](Self::new); also when the grid has no cells, and when it is flat along the normal.
    pub fn over(grid: &UnstructuredGrid, normal: DVec3, count: usize) -> Result<Self, Error> {
        let unit = unit(normal)?;
        let [low, high] = extent(grid, unit)?;
        if count > Self::MAX {
            return Err(Error::TooMany { found: count });
        }
        if high - low == 0.0 {
            return Err(Error::Flat { normal: unit, position: low });
        }
        let distance = (high - low) / count.max(1) as f64;
        let positions: Vec<f64> = (0..count).map(|plane| low + (plane as f64 + 0.5) * distance).collect();
        if positions.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(Error::TooFine { count, low, high });
        }
        Self::of_unit(unit, positions, distance)
    }

    /// The unit normal.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Distances of the planes from the origin along the normal, ascending.
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// Thickness of the slab that each plane stands for.
    pub fn distance(&self) -> f64 {
        self.distance
    }

    /// Number of planes.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// A plane of the family.
    ///
    /// # Panics
    /// When there is no such plane.
    pub fn plane(&self, plane: usize) -> Plane {
        Plane { normal: self.normal, distance: self.positions[plane] }
    }

    /// Where the slabs of the planes end: in the middle between two planes; of the first and the last plane half a
    /// distance away. One more than planes, or none.
    pub(crate) fn slab_ends(&self) -> Vec<f64> {
        let (Some(first), Some(last)) = (self.positions.first(), self.positions.last()) else {
            return Vec::new();
        };
        let half = 0.5 * self.distance;
        let middles = self.positions.windows(2).map(|pair| pair[0] + 0.5 * (pair[1] - pair[0]));
        std::iter::once(first - half).chain(middles).chain([last + half]).collect()
    }

    /// How many planes lie at or below a position: the planes that a node there is above.
    pub(crate) fn num_at_or_below(&self, position: f64) -> u32 {
        let positions = self.positions.as_slice();
        let Some(&first) = positions.first() else { return 0 };
        // Right at once where the planes are even; elsewhere a search.
        let guess = (((position - first) / self.distance) as usize).min(positions.len());
        let is_split = |at: usize| {
            at <= positions.len()
                && (at == 0 || positions[at - 1] <= position)
                && positions.get(at).is_none_or(|&next| next > position)
        };
        let found = [guess + 1, guess, guess + 2].into_iter().find(|&at| is_split(at));
        found.unwrap_or_else(|| positions.partition_point(|&plane| plane <= position)) as u32
    }
}

/// A unit vector, also from one whose square over- or underflows.
fn unit(normal: DVec3) -> Result<DVec3, Error> {
    let scale = normal.abs().max_element();
    if !(normal.is_finite() && scale > 0.0) {
        return Err(Error::Normal { found: normal });
    }
    // A unit vector stays as it is, to the bit, so that stacks along it can be merged.
    let is_unit = (normal.length_squared() - 1.0).abs() <= 8.0 * f64::EPSILON;
    Ok(if is_unit { normal } else { (normal / scale).normalize() })
}

/// Smallest and largest position of the nodes of cells that are not blank.
pub(crate) fn extent(grid: &UnstructuredGrid, unit: DVec3) -> Result<[f64; 2], Error> {
    let none = || [f64::INFINITY, f64::NEG_INFINITY];
    let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let of_cell = |cell: usize| {
        let (_, nodes) = grid.cells().get(cell);
        let along = nodes.iter().map(|&node| unit.dot(grid.points()[node as usize]));
        along.fold(none(), |extent, position| join(extent, [position; 2]))
    };
    let cells = (0..grid.cells().len()).into_par_iter().filter(|&cell| !grid.is_blank(cell));
    let extent = cells.map(of_cell).reduce(none, join);
    if extent[0] > extent[1] { Err(Error::NoCells) } else { Ok(extent) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_at_or_below_are_counted_as_a_search_counts() {
        let even: Vec<f64> = (0..100).map(|plane| 0.3 + 0.1 * f64::from(plane)).collect();
        let uneven: Vec<f64> = (0..100).map(|plane| 1e-3 * f64::from(plane).powi(3)).collect();
        for positions in [even, uneven, vec![], vec![7.0]] {
            let planes = Planes::new(DVec3::X, positions.clone(), 0.1).unwrap();
            let at = positions.iter().flat_map(|&p| [p, p.next_down(), p.next_up()]);
            for position in at.chain([-1e300, 1e300, f64::NEG_INFINITY, f64::INFINITY, f64::NAN, 0.0]) {
                let expected = positions.iter().filter(|&&plane| plane <= position).count();
                assert_eq!(planes.num_at_or_below(position) as usize, expected, "at {position}");
            }
        }
    }

    #[test]
    fn what_makes_no_planes_is_an_error() {
        let error = |normal, positions: &[f64], distance| {
            Planes::new(normal, positions.to_vec(), distance).unwrap_err()
        };
        assert_eq!(error(DVec3::ZERO, &[], 1.0), Error::Normal { found: DVec3::ZERO });
        assert!(matches!(error(DVec3::NAN, &[], 1.0), Error::Normal { .. }));
        assert_eq!(error(DVec3::X, &[], 0.0), Error::Distance { found: 0.0 });
        assert_eq!(error(DVec3::X, &[0.0, 0.0], 1.0), Error::Position { plane: 1, found: 0.0 });
        assert!(matches!(error(DVec3::X, &[f64::NAN], 1.0), Error::Position { plane: 0, .. }));
        let tiny = Planes::new(DVec3::splat(1e-300), vec![], 1.0).unwrap();
        assert!((tiny.normal().length() - 1.0).abs() < 1e-15);
    }
}
