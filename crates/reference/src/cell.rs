//! The field along a ray through the cell between eight neighbouring samples.

use glam::DVec3;

use crate::cubic::Cubic;

/// Values of the eight samples; bit 0, 1, 2 of the index is the upper one along x, y, z.
pub(crate) type Corners = [f64; 8];

/// Least and greatest; `None` if the cell is blank, that is, has a corner that is not finite.
pub(crate) fn range(corners: &Corners) -> Option<[f64; 2]> {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    let mut finite = true;
    for &value in corners {
        finite &= value.is_finite();
        range = [range[0].min(value), range[1].max(value)];
    }
    finite.then_some(range)
}

/// The value to count from on a straight way through the unit cell: that of the corner next to its middle. What is
/// far above or below it has little weight there.
pub(crate) fn base(corners: &Corners, enter: DVec3, exit: DVec3) -> f64 {
    let is_upper = |axis: usize| usize::from(enter[axis] + exit[axis] > 1.0);
    corners[is_upper(0) | is_upper(1) << 1 | is_upper(2) << 2]
}

/// The same for a transfer function that changes at some values, from which others are `beyond`: of corners as near to
/// those the one next to the middle. Counted from an outlier, values that can be seen would have no digits.
pub(crate) fn base_near(corners: &Corners, enter: DVec3, exit: DVec3, beyond: impl Fn(f64) -> f64) -> f64 {
    let middle = base(corners, enter, exit);
    let nearest = |near: f64, &corner: &f64| if beyond(corner) < beyond(near) { corner } else { near };
    corners.iter().fold(middle, nearest)
}

/// `a` at 0, `b` at 1, exactly; never beyond them by more than rounding, and it cannot overflow.
fn mix(a: f64, b: f64, w: f64) -> f64 {
    a * (1.0 - w) + b * w
}

/// How far the trilinear field is above `base` on the straight way from `enter` to `exit`, points of the unit cell.
///
/// The field is linear in each coordinate, so its Bernstein coefficients are the means of its values at the
/// mixed points (its blossom): those that take none, one, two or all of their coordinates from `exit`.
pub(crate) fn along(corners: &Corners, base: f64, enter: DVec3, exit: DVec3) -> Cubic {
    // Each step replaces one axis of the corners by "at enter" (bit clear) and "at exit" (bit set).
    let mut values = corners.map(|value| value - base);
    for (axis, bit) in [(0, 1), (1, 2), (2, 4)] {
        for low in (0..8).filter(|index| index & bit == 0) {
            let (a, b) = (values[low], values[low | bit]);
            values[low] = mix(a, b, enter[axis]);
            values[low | bit] = mix(a, b, exit[axis]);
        }
    }
    let one = (values[1] + values[2] + values[4]) / 3.0;
    let two = (values[3] + values[5] + values[6]) / 3.0;
    Cubic::new([values[0], one, two, values[7]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Field;
    use proptest::prelude::*;

    fn trilinear(corners: &Corners, p: DVec3) -> f64 {
        (0..8)
            .map(|i| {
                let side = |bit: usize, w: f64| if i >> bit & 1 == 1 { w } else { 1.0 - w };
                corners[i] * side(0, p.x) * side(1, p.y) * side(2, p.z)
            })
            .sum()
    }

    #[test]
    fn blank_corners_make_a_blank_cell() {
        let mut corners = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.5];
        assert_eq!(range(&corners), Some([0.5, 7.0]));
        for blank in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            corners[5] = blank;
            assert_eq!(range(&corners), None);
        }
    }

    proptest! {
        #[test]
        fn the_cubic_is_the_field(
            corners in proptest::array::uniform8(-1.0..1.0f64),
            from in proptest::array::uniform3(0.0..=1.0f64),
            to in proptest::array::uniform3(0.0..=1.0f64),
            t in 0.0..=1.0f64,
        ) {
            let (from, to) = (DVec3::from_array(from), DVec3::from_array(to));
            let base = base(&corners, from, to);
            let cubic = along(&corners, base, from, to);
            let expected = trilinear(&corners, from + (to - from) * t);
            prop_assert!((base + cubic.at(t) - expected).abs() < 3e-15);
        }
    }
}
