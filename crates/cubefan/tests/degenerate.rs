//! Every place of the eye that is special for a box: on face planes, edge lines, corners, the centre, one ulp
//! beside each, 1e6 sizes away; unequal sides; small boxes far from the origin. Cover and thickness for each.

mod world;

use volery_cubefan::{Case, Fans, Real, Relative, Viewpoint, chord};
use world::{
    Point, Screen, Wide, beside, beside_f64, closed_chord, corners, cover_defect, cuboid, norm, scale,
    triangles, wide, wide_box,
};

/// Special coordinates along an axis of the box: 21, exactly on and one ulp beside, in f32.
fn special(low: f32, high: f32) -> Vec<f32> {
    let (size, middle) = (high - low, low + (high - low) / 2.0);
    let around = [low, middle, high].into_iter().flat_map(|at| (-1..=1).map(move |ulps| beside(at, ulps)));
    let away = [0.25, 1.0, 3.0, 100.0, 1e6].into_iter().flat_map(|f| [low - f * size, high + f * size]);
    around.chain(away).chain([low - 1e-6 * size, high + 1e-6 * size]).collect()
}

/// All eyes with special coordinates.
fn eyes(low: [f32; 3], high: [f32; 3]) -> impl Iterator<Item = [f32; 3]> {
    let [x, y, z] = [0, 1, 2].map(|axis| special(low[axis], high[axis]));
    let yz: Vec<_> = y.iter().flat_map(|&y| z.iter().map(move |&z| [y, z])).collect();
    x.into_iter().flat_map(move |x| yz.clone().into_iter().map(move |[y, z]| [x, y, z]))
}

/// What was seen over many boxes.
#[derive(Debug, Default)]
struct Worst {
    num: usize,
    area: f64,
    negative_area: f64,
    thickness: f64,
    inside: f64,
    num_other_first: usize,
}

impl Worst {
    fn take(field: &mut f64, value: f64) {
        assert!(!value.is_nan());
        *field = field.max(value);
    }
}

/// The solid angle of a triangle as seen from the origin, above 0 if counter-clockwise.
fn solid_angle([a, b, c]: [Point; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| scale(p, 1.0 / norm(p)));
    let volume = -world::dot(a, world::cross(b, c));
    2.0 * volume.atan2(1.0 + world::dot(a, b) + world::dot(b, c) + world::dot(c, a))
}

/// With the eye inside or on the boundary, the triangles cover all directions into the box once.
fn check_inside<F: Wide>(fans: &Fans<F>, low: Point, high: Point, worst: &mut Worst) {
    let num_through_eye = (0..3).filter(|&axis| low[axis] == 0.0 || high[axis] == 0.0).count();
    let expected = 4.0 * std::f64::consts::PI / f64::from(1 << num_through_eye);
    let mut sum = 0.0;
    for triangle in triangles(fans) {
        let points = triangle.map(|vertex| wide(vertex.point));
        // A face through the eye has no area; its corners may be the eye itself.
        if world::dot(points[0], world::cross(points[1], points[2])) != 0.0 {
            let angle = solid_angle(points);
            assert!(angle > 0.0, "{angle} {points:?}");
            sum += angle;
        }
        for vertex in triangle {
            let expected = norm(wide(vertex.point));
            Worst::take(
                &mut worst.thickness,
                (vertex.thickness.wide() - expected).abs() / expected.max(1e-300),
            );
        }
    }
    Worst::take(&mut worst.area, (sum / expected - 1.0).abs());
}

/// Planes all but through the eye put through it, as the crate promises for f32. The f64 path settles less, but
/// solid angles of triangles seen from 1e-45 beside their plane are beyond this file's oracle.
fn settled(relative: Relative<f64>) -> Relative<f64> {
    let settle = |plane: f64| if plane.abs() < f64::from(f32::TINY) { 0.0 } else { plane };
    Relative { low: relative.low.map(settle), high: relative.high.map(settle), ..relative }
}

/// Checks the fans of a box relative to the eye; `exact` is the same box in f64.
fn check<F: Wide>(relative: &Relative<F>, exact: &Relative<f64>, worst: &mut Worst) {
    let fans = Fans::from_eye(relative).expect("a box");
    let rounded = settled(wide_box(relative));
    let at = corners(rounded.low, rounded.high);
    worst.num += 1;
    let is_toward = |axis: &usize| rounded.low[*axis] > 0.0 || rounded.high[*axis] < 0.0;
    let class = (0..3).filter(is_toward).count();
    assert_eq!(usize::from(fans.aspect().class()), class);
    if class == 0 {
        return check_inside(&fans, rounded.low, rounded.high, worst);
    }
    let screen = Screen::before(rounded.low, rounded.high);
    let (area, negative_area) = cover_defect(&fans, &screen, &at);
    Worst::take(&mut worst.area, area);
    Worst::take(&mut worst.negative_area, negative_area);
    let reference = Fans::from_eye(exact).expect("a box");
    if reference.aspect() != fans.aspect() {
        // Only where rounding decides between two axes that are equal but for that.
        let mut keys: Point =
            std::array::from_fn(|axis| exact.low[axis].max(-exact.high[axis]) / exact.size[axis]);
        keys.sort_by(f64::total_cmp);
        assert!(keys[1] / keys[2] > 1.0 - 1e-6, "first face of {relative:?}");
        worst.num_other_first += 1;
        return;
    }
    let slack = 4e-15 * corners(exact.low, exact.high).map(norm).into_iter().fold(0.0, f64::max);
    for (place, (vertex, exact_vertex)) in fans.vertices().iter().zip(reference.vertices()).enumerate() {
        let expected = closed_chord(exact_vertex.point, exact.low, exact.high, slack);
        if place < 4 {
            let defect = (vertex.thickness.wide() / expected - 1.0).abs();
            Worst::take(&mut worst.thickness, defect);
        } else {
            assert_eq!(vertex.thickness.wide(), 0.0, "on the silhouette");
            assert!(at.contains(&wide(vertex.point)), "a corner, bit for bit");
        }
    }
    let mut sequence = world::Sequence::new(worst.num as u64);
    for (triangle, exact_triangle) in triangles(&fans).iter().zip(triangles(&reference)) {
        let weights = sequence.weights();
        let mixed = |number: &dyn Fn(usize) -> f64| {
            (0..3).map(|corner| weights[corner] * number(corner)).sum::<f64>()
        };
        let thickness = |point: &dyn Fn(usize, usize) -> f64,
                         before: &dyn Fn(usize) -> f64,
                         through: &dyn Fn(usize) -> f64| {
            let point: Point = std::array::from_fn(|axis| mixed(&|corner| point(corner, axis)));
            norm(point) * mixed(through) / mixed(before)
        };
        let found = thickness(
            &|corner, axis| triangle[corner].point[axis].wide(),
            &|corner| triangle[corner].before.wide(),
            &|corner| triangle[corner].through.wide(),
        );
        let expected = thickness(
            &|corner, axis| exact_triangle[corner].point[axis],
            &|corner| exact_triangle[corner].before,
            &|corner| exact_triangle[corner].through,
        );
        Worst::take(&mut worst.inside, if expected == 0.0 { found } else { (found / expected - 1.0).abs() });
    }
}

fn report(name: &str, worst: &Worst, [area, thickness]: [f64; 2]) {
    println!("{name}: {worst:?}; at most: area {area:e}, thickness {thickness:e}");
    assert!(worst.area <= area && worst.negative_area <= 1e-12);
    assert!(worst.thickness <= thickness && worst.inside <= thickness);
}

const BOXES: [([f32; 3], [f32; 3]); 5] = [
    ([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
    ([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]),
    ([3.0, 5.0, 7.0], [4.0, 6.0, 17.0]),
    ([0.1, -0.3, 0.7], [0.2, -0.2, 0.8]),
    ([1e3, 2e3, -4e3], [1.064e3, 2.001e3, -3.9e3]),
];

#[test]
fn special_eyes_in_f32() {
    for (low, high) in BOXES {
        let mut worst = Worst::default();
        for eye in eyes(low, high) {
            let relative = Relative::new(&volery_cubefan::Cuboid { low, high }, eye);
            let exact = settled(Relative::new(&cuboid(wide(low), wide(high)), wide(eye)));
            check(&relative, &exact, &mut worst);
        }
        report(&format!("box {low:?} {high:?}"), &worst, [1e-6, 1e-5]);
        assert_eq!(worst.num, 21 * 21 * 21);
        assert!(worst.num_other_first * 20 < worst.num);
    }
}

#[test]
fn special_eyes_in_f64() {
    for (low, high) in BOXES {
        let mut worst = Worst::default();
        for eye in eyes(low, high) {
            let exact = settled(Relative::new(&cuboid(wide(low), wide(high)), wide(eye)));
            check(&exact, &exact, &mut worst);
        }
        // The oracle's slack: 4e-15 of the distance, here up to 1e8 of the smallest sides.
        report(&format!("box {low:?} {high:?}"), &worst, [1e-6, 1e-7]);
        assert_eq!(worst.num_other_first, 0);
    }
}

#[test]
fn a_cube_of_a_millionth_at_a_million() {
    let size = 1e-6_f64;
    let low = [1e6, 1e6 + 17.0 * size, -1e6];
    let high = low.map(|low| low + size);
    let mut worst = Worst::default();
    let special = |axis: usize| {
        let (low, high) = (low[axis], high[axis]);
        let around = [low, high].into_iter().flat_map(|at| (-1..=1).map(move |ulps| beside_f64(at, ulps)));
        let away = [1.0, 30.0, 1e6].into_iter().flat_map(move |f| [low - f * size, high + f * size]);
        around.chain(away).chain([low + size / 2.0]).collect::<Vec<_>>()
    };
    let [x, y, z] = [0, 1, 2].map(special);
    for eye in x.iter().flat_map(|&x| {
        y.iter().flat_map({
            let z = &z;
            move |&y| z.iter().map(move |&z| [x, y, z])
        })
    }) {
        let exact = Relative::new(&cuboid(low, high), eye);
        check(&exact.to_f32(), &exact, &mut worst);
    }
    report("1e-6 at 1e6", &worst, [1e-6, 1e-5]);
    assert_eq!(worst.num, 13 * 13 * 13);
}

#[test]
fn all_ten_cases_occur_and_are_named() {
    let case = |eye: Point| Case::of(Viewpoint::Eye(eye), &cuboid([0.0; 3], [1.0; 3]));
    let along = |direction: Point| Case::of(Viewpoint::Direction(direction), &cuboid([0.0; 3], [1.0; 3]));
    assert_eq!(case([0.5, 0.5, 1.0]), Some(Case::Inside));
    assert_eq!(case([0.5, 0.5, 2.0]), Some(Case::Case10));
    assert_eq!(case([0.5, 0.0, 2.0]), Some(Case::Case11));
    assert_eq!(case([1.0, 0.0, 2.0]), Some(Case::Case12));
    assert_eq!(case([0.5, -1.0, 3.0]), Some(Case::Case20a));
    assert_eq!(case([0.5, -1.0, 2.0]), Some(Case::Case20b));
    assert_eq!(case([0.0, -1.0, 3.0]), Some(Case::Case21a));
    assert_eq!(case([1.0, -1.0, 2.0]), Some(Case::Case21b));
    assert_eq!(case([-1.0, -1.0, 3.0]), Some(Case::Case30a));
    assert_eq!(case([-2.0, -2.0, 2.0]), Some(Case::Case30b));
    assert_eq!(case([-2.0, 3.0, 3.0]), Some(Case::Case30c));
    assert_eq!(along([0.0, 0.0, -2.0]), Some(Case::Case12));
    assert_eq!(along([0.0, 1.0, -2.0]), Some(Case::Case21a));
    assert_eq!(along([3.0, 3.0, -3.0]), Some(Case::Case30c));
    assert_eq!(along([0.0; 3]), None);
}

#[test]
fn what_is_no_box_has_no_fans() {
    let eye = Viewpoint::Eye([-3.0; 3]);
    let good = cuboid([0.0; 3], [1.0; 3]);
    assert!(Fans::new(eye, &good).is_some());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e200, 0.0, -1.0] {
        assert_eq!(Fans::new(eye, &cuboid([0.0; 3], [1.0, bad, 1.0])), None, "high {bad}");
        assert_eq!(chord([-3.0; 3], [1.0; 3], &cuboid([0.0; 3], [1.0, bad.min(0.0), 1.0])), 0.0);
    }
    for bad in [f64::NAN, f64::INFINITY, -1e200] {
        assert_eq!(Fans::new(Viewpoint::Eye([0.0, bad, 0.0]), &good), None, "eye {bad}");
        assert_eq!(Fans::new(Viewpoint::Direction([0.0, bad, 0.0]), &good), None, "direction {bad}");
        assert_eq!(chord([bad; 3], [1.0; 3], &good), 0.0);
    }
    assert_eq!(Fans::new(Viewpoint::Direction([0.0; 3]), &good), None);
}
