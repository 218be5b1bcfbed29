//! The exact chord of any ray: what fans are measured against, and a way of their own per fragment.

use crate::place::Cuboid;
use crate::real::{Real, length};

/// Length of the part of the ray `origin + t * direction`, `t >= 0`, inside a box.
///
/// A ray that runs in a face plane belongs to the box above that plane (`low <= origin < high`), so boxes of a
/// grid share the ray out: every part of it is inside one of them. 0 for a ray that misses, for an empty box
/// and where a number is NaN.
pub fn chord<F: Real>(origin: [F; 3], direction: [F; 3], cuboid: &Cuboid<F>) -> F {
    let (mut enter, mut leave) = (F::ZERO, F::ONE / F::ZERO);
    let (mut enter_axis, mut leave_axis) = (3, 3);
    for axis in 0..3 {
        let (low, high) = (cuboid.low[axis], cuboid.high[axis]);
        let has_side = low < high;
        if !has_side {
            return F::ZERO;
        }
        if direction[axis] == F::ZERO {
            let is_between = low <= origin[axis] && origin[axis] < high;
            if !is_between {
                return F::ZERO;
            }
            continue;
        }
        let (first, last) = if direction[axis] > F::ZERO { (low, high) } else { (high, low) };
        let (first, last) =
            ((first - origin[axis]) / direction[axis], (last - origin[axis]) / direction[axis]);
        if first > enter {
            (enter, enter_axis) = (first, axis);
        }
        if last < leave {
            (leave, leave_axis) = (last, axis);
        }
    }
    let is_hit = leave_axis < 3 && enter < leave;
    if !is_hit {
        return F::ZERO;
    }
    // Between opposite faces the difference of two far away numbers is not needed.
    let span = if enter_axis == leave_axis {
        (cuboid.high[enter_axis] - cuboid.low[enter_axis]) / direction[enter_axis].abs()
    } else {
        leave - enter
    };
    span * length(direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_opposite_faces_a_far_origin_costs_no_digit() {
        let unit = Cuboid { low: [0.0; 3], high: [1.0; 3] };
        // The difference of the two distances along the ray would be off by 1e-4 of 1: neither is a whole number.
        let far = 1e12;
        for (origin, along) in [(-far, 0.7), (far, -0.7)] {
            for axis in 0..3 {
                let [mut from, mut way] = [[0.2, 0.3, 0.4], [3e-13, 1e-13, -2e-13]];
                (from[axis], way[axis]) = (origin, along);
                let found = chord(from, way, &unit);
                assert!((found - 1.0).abs() <= 4.0 * f64::EPSILON, "axis {axis}, from {origin}: {found}");
            }
        }
        let unit = Cuboid { low: [0.0; 3], high: [1.0; 3] };
        let found: f32 = chord([-1e6, 0.2, 0.3], [0.7, 3e-7, -2e-7], &unit);
        assert!((found - 1.0).abs() <= 4.0 * f32::EPSILON, "{found}");
    }
}
