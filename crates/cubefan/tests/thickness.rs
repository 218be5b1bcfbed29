//! Thickness inside triangles: exact by interpolated shares, and how far plain interpolation is from it.

mod world;

use proptest::prelude::*;
use volery_cubefan::{Cuboid, Fans, HalfSpace, Viewpoint, chord};
use world::{
    Point, Screen, Sequence, closed_chord, corners, cover_defect, cuboid, doubled_area, hull, norm, scale,
    sub, triangles, turn, wide,
};

/// Largest errors over many views of a cube of side 1 at a distance, as shares of the cube's longest chord in
/// the picture: thickness linear on the screen, with perspective correction, and from shares.
fn interpolation_errors(distance: f64, sequence: &mut Sequence) -> [f64; 3] {
    let mut errors = [0.0_f64; 3];
    for _ in 0..400 {
        let way = sequence.point(-1.0, 1.0);
        let eye = scale(way, distance / norm(way));
        let cube = cuboid([-0.5; 3], [0.5; 3]);
        let Some(fans) = Fans::new(Viewpoint::Eye(eye), &cube).filter(|fans| fans.aspect().class() > 0)
        else {
            continue;
        };
        let screen = Screen::before(sub(cube.low, eye), sub(cube.high, eye));
        let longest = fans.vertices().iter().fold(0.0_f64, |longest, vertex| longest.max(vertex.thickness));
        for triangle in triangles(&fans) {
            let weights = sequence.weights();
            let mix =
                |weights: Point, number: [f64; 3]| (0..3).map(|at| weights[at] * number[at]).sum::<f64>();
            // The same point of the picture by weights on the screen and in space.
            let depths = triangle.map(|vertex| screen.depth(vertex.point));
            let in_space: Point = std::array::from_fn(|at| weights[at] / depths[at]);
            let in_space = scale(in_space, 1.0 / in_space.iter().sum::<f64>());
            let point: Point =
                std::array::from_fn(|axis| mix(in_space, triangle.map(|vertex| vertex.point[axis])));
            let exact = chord(eye, point, &cube);
            let thickness = triangle.map(|vertex| vertex.thickness);
            let by_shares = fans.thickness(
                point,
                mix(in_space, triangle.map(|vertex| vertex.before)),
                mix(in_space, triangle.map(|vertex| vertex.through)),
            );
            for (error, found) in
                errors.iter_mut().zip([mix(weights, thickness), mix(in_space, thickness), by_shares])
            {
                *error = error.max((found - exact).abs() / longest);
            }
        }
    }
    errors
}

#[test]
fn linear_thickness_is_off_by_size_over_distance_and_shares_are_exact() {
    let mut sequence = Sequence::new(21);
    let mut before: Option<[f64; 3]> = None;
    println!(
        "distance / side   linear on the screen   perspective-correct   by shares   (of the longest chord)"
    );
    for power in 0..11 {
        let distance = f64::from(1 << power);
        let errors = interpolation_errors(distance, &mut sequence);
        println!("{distance:>15}   {:>20.6}   {:>19.6}   {:>9.1e}", errors[0], errors[1], errors[2]);
        assert!(errors[2] < 1e-12, "by shares: {:e}, at most 1e-12", errors[2]);
        assert!(errors[0] < 0.5 / distance && errors[1] < 0.5 / distance);
        if let Some(before) = before.filter(|_| power > 3) {
            let ratio = before[0] / errors[0];
            assert!((1.5..2.7).contains(&ratio), "twice as far is half as wrong, found {ratio}");
        }
        before = Some(errors);
    }
}

#[test]
fn along_parallel_rays_linear_thickness_is_exact() {
    let mut sequence = Sequence::new(22);
    let mut worst = 0.0_f64;
    for case in 0..5000 {
        // Every fourth view is along a face, every 16th along an axis.
        let mut way = sequence.point(-1.0, 1.0);
        way[case % 3] *= f64::from(u8::from(case % 4 > 0));
        way[(case + 1) % 3] *= f64::from(u8::from(case % 16 > 0));
        let low = sequence.point(-3.0, 3.0);
        let size = sequence.point(0.1, 4.0);
        let cube = cuboid(low, std::array::from_fn(|axis| low[axis] + size[axis]));
        let fans = Fans::new(Viewpoint::Direction(way), &cube).unwrap();
        let screen = Screen::looking(way, true);
        let (area, negative) = cover_defect(&fans, &screen, &corners(cube.low, cube.high));
        assert!(area < 1e-9 && negative < 1e-12, "{area:e} {negative:e}");
        for triangle in triangles(&fans) {
            let weights = sequence.weights();
            let mix = |number: [f64; 3]| (0..3).map(|at| weights[at] * number[at]).sum::<f64>();
            let point: Point = std::array::from_fn(|axis| mix(triangle.map(|vertex| vertex.point[axis])));
            if turn(triangle.map(|vertex| screen.project(vertex.point))).abs() < 1e-9 {
                continue;
            }
            let exact = chord(std::array::from_fn(|axis| point[axis] - 1e2 * way[axis]), way, &cube);
            let found = mix(triangle.map(|vertex| vertex.thickness));
            assert_eq!(found, fans.thickness(point, 1.0, mix(triangle.map(|vertex| vertex.through))));
            worst = worst.max((found - exact).abs());
        }
    }
    println!("parallel: thickness differs by {worst:e}, at most 1e-11");
    assert!(worst < 1e-11);
}

#[test]
fn triangles_clipped_by_any_plane_through_the_eye_cover_the_clipped_hull() {
    let mut sequence = Sequence::new(23);
    let (mut worst, mut num_crossing) = (0.0_f64, 0);
    for _ in 0..5000 {
        let low = sequence.point(-2.0, 1.0);
        let size = sequence.point(0.1, 2.0);
        let high: Point = std::array::from_fn(|axis| low[axis] + size[axis]);
        let Some(fans) = Fans::new(Viewpoint::Eye([0.0; 3]), &cuboid(low, high)) else { panic!("a box") };
        if fans.aspect().class() == 0 {
            continue;
        }
        // The camera looks anywhere: the box may cross the plane through the eye. What is left after a near plane
        // is seen on the camera's own screen.
        let camera = Screen::looking(sequence.point(-1.0, 1.0), false);
        let near = 1e-3;
        let half_spaces = [HalfSpace { normal: camera.axes[2], offset: near }];
        let depths = corners(low, high).map(|corner| camera.depth(corner));
        num_crossing +=
            usize::from(depths.iter().any(|&depth| depth < near) && depths.iter().any(|&depth| depth > near));
        // The true cover: all entry points beyond the plane, so clip the front faces, in hull terms the cone
        // over the box cut by a plane through no vertex: sum of areas of what is clipped, by an independent
        // clip of the solid angle: sampling directions.
        let clipped: Vec<Vec<[f64; 2]>> = fans
            .triangles()
            .iter()
            .map(|&triangle| {
                let polygon = fans.clipped(triangle, &half_spaces);
                polygon.vertices().iter().map(|vertex| camera.project(vertex.point)).collect()
            })
            .collect();
        for _ in 0..20 {
            let at = [sequence.between(-2.0, 2.0), sequence.between(-2.0, 2.0)];
            let [right, up, forward] = camera.axes;
            let ray: Point =
                std::array::from_fn(|axis| forward[axis] + at[0] * right[axis] + at[1] * up[axis]);
            let length = closed_chord(ray, low, high, 0.0);
            let enters = chord([0.0; 3], ray, &cuboid(low, high));
            worst = worst.max((length - enters).abs());
            let entry = (0..2000).map(|step| f64::from(step) * 2e-3).find(|&t| {
                let p = scale(ray, t);
                (0..3).all(|axis| low[axis] <= p[axis] && p[axis] <= high[axis])
            });
            // Sure hits beyond the near plane only: a chord of more than two steps, entered well behind it.
            let is_sure = length > 0.02 * norm(ray) && entry.is_some_and(|t| t > near + 3e-3);
            let times = clipped
                .iter()
                .filter(|polygon| {
                    polygon.len() > 2
                        && doubled_area(polygon) > 0.0
                        && (0..polygon.len()).all(|place| {
                            turn([polygon[place], polygon[(place + 1) % polygon.len()], at]) > 0.0
                        })
                })
                .count();
            assert!(if is_sure { times == 1 } else { times <= 1 }, "{times} times, chord {length}");
            assert!(length > 0.0 || times == 0);
        }
    }
    println!("{num_crossing} boxes across the near plane; chords differ by {worst:e}, at most 1e-12");
    assert!(num_crossing > 500 && worst < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any box from any eye, in f32: covered once, thickness exact.
    #[test]
    fn any_box_from_any_eye(
        eye in prop::array::uniform3(-20.0_f32..20.0),
        low in prop::array::uniform3(-20.0_f32..20.0),
        size in prop::array::uniform3(0.01_f32..10.0),
        seed in any::<u64>(),
    ) {
        let cube = Cuboid { low, high: std::array::from_fn(|axis| low[axis] + size[axis]) };
        let fans = Fans::new(Viewpoint::Eye(eye), &cube).unwrap();
        let exact_cube = cuboid(wide(cube.low), wide(cube.high));
        let eye = wide(eye);
        let (low, high) = (sub(exact_cube.low, eye), sub(exact_cube.high, eye));
        if fans.aspect().class() > 0 {
            let (area, negative) = cover_defect(&fans, &Screen::before(low, high), &corners(low, high));
            // Planes relative to the eye are rounded once; thin silhouettes feel it.
            let flat = corners(low, high).map(|corner| Screen::before(low, high).project(corner));
            let thin = doubled_area(&hull(&flat)) / 2.0;
            prop_assert!(area < 1e-6 + 1e-6 / thin, "area {area:e}, at most {:e}", 1e-6 + 1e-6 / thin);
            prop_assert!(negative < 1e-6, "negative area {negative:e}");
        }
        let mut sequence = Sequence::new(seed);
        for triangle in triangles(&fans) {
            let weights = sequence.weights();
            let mix = |number: [f32; 3]| (0..3).map(|at| weights[at] * f64::from(number[at])).sum::<f64>();
            let point: Point = std::array::from_fn(|axis| mix(triangle.map(|vertex| vertex.point[axis])));
            let found = norm(point) * mix(triangle.map(|vertex| vertex.through)) / mix(triangle.map(|vertex| vertex.before));
            let exact = chord(eye, point, &exact_cube);
            // In f32 the planes are off by half an ulp of the distance.
            let limit = 1e-5 * (norm(high).max(norm(low)) + exact) ;
            prop_assert!((found - exact).abs() < limit, "thickness {found}, exact {exact}");
        }
    }

    /// The crate's chord against plane hits.
    #[test]
    fn any_chord(
        origin in prop::array::uniform3(-3.0_f64..3.0),
        direction in prop::array::uniform3(-1.0_f64..1.0),
        low in prop::array::uniform3(-3.0_f64..3.0),
        size in prop::array::uniform3(0.01_f64..4.0),
    ) {
        let high: Point = std::array::from_fn(|axis| low[axis] + size[axis]);
        let expected = closed_chord(direction, sub(low, origin), sub(high, origin), 0.0);
        let found = chord(origin, direction, &cuboid(low, high));
        prop_assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
}
