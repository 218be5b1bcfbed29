//! Space as one ray sees it: the ray is the third axis.

use std::cmp::Ordering;

use glam::DVec3;
use volery_scene::Ray;

/// An orthonormal frame whose third axis is a ray, and which part of the ray counts.
pub(super) struct View {
    /// On the ray, nearest to the middle of the grid: a far eye costs no digits.
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    right: DVec3,
    up: DVec3,
    /// Along the third axis, in world units.
    pub(super) start: f64,
    pub(super) end: f64,
}

impl View {
    /// The frame of a ray up to a distance from its origin; `None` for what is no ray.
    pub(super) fn new(ray: &Ray, middle: DVec3, distance: f64) -> Option<Self> {
        let given = ray.direction;
        // Not made a unit vector anew where it is one: from afar its last bits matter.
        let is_unit = (given.length_squared() - 1.0).abs() < 1e-12;
        let direction = if is_unit { given } else { given.try_normalize()? };
        let shift = (middle - ray.origin).dot(direction);
        let moved = |axis: usize| direction[axis].mul_add(shift, ray.origin[axis]);
        let origin = DVec3::new(moved(0), moved(1), moved(2));
        if !origin.is_finite() || distance.is_nan() {
            return None;
        }
        // Along a plane of two axes, the third is one of the frame: what lies in the plane is in it to the last bit.
        let (right, up) = match DVec3::AXES.into_iter().find(|axis| axis.dot(direction) == 0.0) {
            Some(up) => (up.cross(direction), up),
            None => direction.any_orthonormal_pair(),
        };
        Some(Self { origin, direction, right, up, start: -shift, end: distance - shift })
    }

    /// A point in the ray's frame. The same bits for every cell that has the point.
    pub(super) fn see(&self, point: DVec3) -> DVec3 {
        let point = point - self.origin;
        DVec3::new(point.dot(self.right), point.dot(self.up), point.dot(self.direction))
    }
}

/// Twice the area of the triangle of the ray and two points, seen along the ray; positive when `b` is to the left of
/// `a`. Within a few units in the last place, whatever cancels.
pub(super) fn area(a: DVec3, b: DVec3) -> f64 {
    let (left, right) = (a.x * b.y, a.y * b.x);
    (left - right) + (a.x.mul_add(b.y, -left) - a.y.mul_add(b.x, -right))
}

/// On which side the ray passes the way from `a` to `b`; `Greater` when it leaves it to its left.
///
/// The exact sign for the coordinates given: rounding keeps order, so unlike products have unlike roundings or equal
/// ones, and then what was rounded off decides. A ray that meets the line counts as moved aside by an infinitely
/// small way `(e, e^2)`; so of the triangles around an edge or a point just those are met that the moved ray meets.
/// `Equal` only for points that coincide.
pub(super) fn side(a: DVec3, b: DVec3) -> Ordering {
    let (left, right) = (a.x * b.y, a.y * b.x);
    let order = |a: f64, b: f64| a.partial_cmp(&b).unwrap_or(Ordering::Equal);
    order(left, right)
        .then_with(|| order(a.x.mul_add(b.y, -left), a.y.mul_add(b.x, -right)))
        .then_with(|| order(a.y, b.y))
        .then_with(|| order(b.x, a.x))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed surface is entered as often as it is left, on points of a tiny lattice, where all that can coincide
    /// does.
    #[test]
    fn a_closed_surface_is_left_as_often_as_entered() {
        let lattice: Vec<DVec3> =
            (0..9).map(|i| DVec3::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0, 0.0)).collect();
        let mut met = 0;
        for code in 0..9usize.pow(4) {
            let corner = |place: u32| lattice[code / 9usize.pow(place) % 9];
            let turn = |[a, b, c]: [u32; 3]| {
                let sides =
                    [side(corner(a), corner(b)), side(corner(b), corner(c)), side(corner(c), corner(a))];
                if sides[0] != Ordering::Equal && sides.iter().all(|&side| side == sides[0]) {
                    sides[0] as i32
                } else {
                    0
                }
            };
            let turns = [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]].map(turn);
            assert_eq!(turns.iter().sum::<i32>(), 0, "{code}: {turns:?}");
            assert!(turns.iter().filter(|&&turn| turn > 0).count() <= 1, "{code}: {turns:?}");
            met += turns.iter().filter(|&&turn| turn > 0).count();
        }
        assert!(met > 500, "{met}");
    }

    #[test]
    fn sides_are_exact_where_products_round_alike() {
        let tiny = f64::EPSILON;
        let a = DVec3::new(1.0 + tiny, 1.0 + 2.0 * tiny, 0.0);
        let b = DVec3::new(1.0, 1.0 + tiny, 0.0);
        // (1 + e)(1 + e) - (1 + 2e) = e^2.
        assert_eq!(side(a, b), Ordering::Greater);
        assert_eq!(side(b, a), Ordering::Less);
        assert_eq!(area(a, b), tiny * tiny);
        assert_eq!(side(a, a), Ordering::Equal);
    }
}
