//! Regions of a volume that matter more than the rest, or less.
//!
//! Boada, Navazo and Scopigno let a user mark regions of maximal interest, whose nodes are held better (sections 3 and
//! 5). Here a region has a weight: what is lost inside counts so many times, where a budget of memory is shared out.

use glam::DVec3;

/// A region and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interest {
    /// Where.
    pub region: Region,
    /// How many times a difference of colour counts there: 1 as elsewhere, 0 not at all.
    pub weight: f64,
}

/// A part of world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Along the axes, its faces included.
    Box {
        /// The corner of least coordinates.
        low: DVec3,
        /// The corner of greatest coordinates.
        high: DVec3,
    },
    /// All points within a distance.
    Sphere {
        /// Its middle.
        center: DVec3,
        /// The distance, above 0.
        radius: f64,
    },
}

impl Interest {
    /// Whether it is a region with a weight.
    pub(crate) fn is_meaningful(&self) -> bool {
        let is_region = match self.region {
            Region::Box { low, high } => low.is_finite() && high.is_finite() && low.cmple(high).all(),
            Region::Sphere { center, radius } => center.is_finite() && radius > 0.0 && radius.is_finite(),
        };
        is_region && self.weight >= 0.0 && self.weight.is_finite()
    }

    /// Where a motion without change of lengths takes it; a box that is turned becomes the box around it.
    pub(crate) fn moved(&self, motion: impl Fn(DVec3) -> DVec3) -> Self {
        let region = match self.region {
            Region::Box { low, high } => {
                let corner = |number: usize| {
                    DVec3::from(std::array::from_fn(|axis| [low, high][number >> axis & 1][axis]))
                };
                let corners = || (0..8).map(|number| motion(corner(number)));
                Region::Box {
                    low: corners().fold(DVec3::INFINITY, DVec3::min),
                    high: corners().fold(DVec3::NEG_INFINITY, DVec3::max),
                }
            }
            Region::Sphere { center, radius } => Region::Sphere { center: motion(center), radius },
        };
        Self { region, ..*self }
    }

    /// Whether a box touches the region.
    fn meets(&self, [low, high]: [DVec3; 2]) -> bool {
        match self.region {
            Region::Box { low: from, high: to } => low.cmple(to).all() && from.cmple(high).all(),
            Region::Sphere { center, radius } => center.clamp(low, high).distance(center) <= radius,
        }
    }
}

/// The largest weight of the regions that a box touches; 1 where there is none.
pub(crate) fn weight_of(interest: &[Interest], bounds: [DVec3; 2]) -> f64 {
    let weights = interest.iter().filter(|interest| interest.meets(bounds)).map(|interest| interest.weight);
    weights.reduce(f64::max).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_move_with_their_corners() {
        let turned = |p: DVec3| DVec3::new(10.0 - p.y, p.x, -p.z);
        let region = Region::Box { low: DVec3::new(1.0, 2.0, 3.0), high: DVec3::new(4.0, 6.0, 8.0) };
        let moved = Interest { region, weight: 2.0 }.moved(turned);
        let expected = Region::Box { low: DVec3::new(4.0, 1.0, -8.0), high: DVec3::new(8.0, 4.0, -3.0) };
        assert_eq!(moved, Interest { region: expected, weight: 2.0 });
        let region = Region::Sphere { center: DVec3::ONE, radius: 2.0 };
        let moved = Interest { region, weight: 2.0 }.moved(turned);
        assert_eq!(moved.region, Region::Sphere { center: DVec3::new(9.0, 1.0, -1.0), radius: 2.0 });
    }

    #[test]
    fn regions_touch_boxes_by_their_nearest_point() {
        let (low, high) = (DVec3::splat(2.0), DVec3::splat(4.0));
        let meets = |region: Region| Interest { region, weight: 3.0 }.meets([low, high]);
        assert!(meets(Region::Box { low: DVec3::ZERO, high: DVec3::splat(2.0) }), "a corner is enough");
        assert!(!meets(Region::Box { low: DVec3::ZERO, high: DVec3::new(9.0, 9.0, 1.9) }));
        assert!(meets(Region::Sphere { center: DVec3::splat(3.0), radius: 0.1 }), "inside");
        let corner = 3.0_f64.sqrt();
        assert!(meets(Region::Sphere { center: DVec3::ONE, radius: corner + 1e-12 }));
        assert!(!meets(Region::Sphere { center: DVec3::ONE, radius: corner - 1e-12 }));
    }

    #[test]
    fn the_largest_weight_of_a_region_counts_and_1_elsewhere() {
        let region = Region::Sphere { center: DVec3::ZERO, radius: 1.0 };
        let interest = [Interest { region, weight: 0.5 }, Interest { region, weight: 0.25 }];
        assert_eq!(weight_of(&interest, [DVec3::ZERO, DVec3::ONE]), 0.5);
        assert_eq!(weight_of(&interest, [DVec3::splat(5.0), DVec3::splat(6.0)]), 1.0);
    }
}
