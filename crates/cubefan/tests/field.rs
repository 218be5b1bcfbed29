//! Many boxes as one: fields of random octree leaves drawn by fans, pixel by pixel, against the ray integral.

mod world;

use volery_cubefan::{Cuboid, Fans, HalfSpace, LatticeEye, Relative, Viewpoint, chord};
use world::{Point, Screen, Sequence, Wide, is_covered, norm, scale, sub, turn, weights, wide};

const NUM_CELLS: i32 = 16;
const NUM_PIXELS: usize = 48;

/// A leaf of a random octree: lattice planes and an extinction.
struct Leaf {
    low: [i32; 3],
    high: [i32; 3],
    extinction: f64,
}

fn leaves(sequence: &mut Sequence) -> Vec<Leaf> {
    let mut open = vec![([0; 3], NUM_CELLS)];
    let mut leaves = Vec::new();
    while let Some((low, size)) = open.pop() {
        if size > 1 && (size > 8 || sequence.below(3) > 0) {
            let half = size / 2;
            open.extend(
                (0..8).map(|octant| {
                    (std::array::from_fn(|axis| low[axis] + half * (octant >> axis & 1)), half)
                }),
            );
        } else {
            let extinction = sequence.between(0.0, 2.0);
            leaves.push(Leaf { low, high: low.map(|low| low + size), extinction });
        }
    }
    leaves
}

/// A picture of so many pixels; points relative to the eye.
struct Picture {
    screen: Screen,
    /// Half the width of the picture at depth 1, or in world units.
    half: f64,
}

impl Picture {
    fn to_pixels(&self, point: Point) -> [f64; 2] {
        let half_size = NUM_PIXELS as f64 / 2.0;
        self.screen.project(point).map(|part| (part / self.half + 1.0) * half_size)
    }

    /// Start and direction of the ray through a pixel.
    fn ray(&self, column: usize, row: usize) -> (Point, Point) {
        let [right, up, forward] = self.screen.axes;
        let part = |place: usize| ((place as f64 + 0.5) / (NUM_PIXELS as f64 / 2.0) - 1.0) * self.half;
        let aside = |axis: usize| right[axis] * part(column) + up[axis] * part(row);
        if self.screen.is_parallel {
            (std::array::from_fn(|axis| aside(axis) - 1e3 * forward[axis]), forward)
        } else {
            ([0.0; 3], std::array::from_fn(|axis| forward[axis] + aside(axis)))
        }
    }

    /// The four sides of the picture.
    fn sides(&self) -> [HalfSpace<f64>; 4] {
        let [right, up, forward] = self.screen.axes;
        [(right, 1.0), (right, -1.0), (up, 1.0), (up, -1.0)].map(|(across, sign)| {
            if self.screen.is_parallel {
                HalfSpace { normal: scale(across, sign), offset: -self.half }
            } else {
                let normal = std::array::from_fn(|axis| forward[axis] * self.half + sign * across[axis]);
                HalfSpace { normal, offset: 0.0 }
            }
        })
    }
}

/// Thickness of one box in every pixel that its fans cover; how often a pixel was covered.
struct Drawn {
    thickness: Vec<f64>,
    times: Vec<u32>,
}

/// Rasterises fans with exact interpolation. The clip has a margin of its own: sides a little outside.
fn draw<F: Wide>(fans: &Fans<F>, picture: &Picture, sides: &[HalfSpace<F>; 4]) -> Drawn {
    let mut drawn =
        Drawn { thickness: vec![0.0; NUM_PIXELS * NUM_PIXELS], times: vec![0; NUM_PIXELS * NUM_PIXELS] };
    for &triangle in fans.triangles() {
        let polygon = fans.clipped(triangle, sides);
        let vertices = polygon.vertices();
        for next in 2..vertices.len() {
            let corners = [vertices[0], vertices[next - 1], vertices[next]];
            let flat = corners.map(|vertex| picture.to_pixels(wide(vertex.point)));
            let has_area = turn(flat) > 0.0;
            if !has_area {
                continue;
            }
            let bounds = [0, 1].map(|axis| {
                let parts = flat.map(|point| point[axis].clamp(0.0, NUM_PIXELS as f64));
                let low = parts.iter().copied().fold(f64::INFINITY, f64::min) as usize;
                low.saturating_sub(1)
                    ..(parts.iter().copied().fold(0.0, f64::max) as usize + 1).min(NUM_PIXELS)
            });
            for row in bounds[1].clone() {
                for column in bounds[0].clone() {
                    let at = [column as f64 + 0.5, row as f64 + 0.5];
                    if !is_covered(flat, at) {
                        continue;
                    }
                    let shares = weights(flat, at);
                    let depths = corners.map(|vertex| picture.screen.depth(wide(vertex.point)));
                    let shares: Point = std::array::from_fn(|place| shares[place] / depths[place]);
                    let shares = scale(shares, 1.0 / shares.iter().sum::<f64>());
                    let mix = |number: &dyn Fn(usize) -> f64| {
                        (0..3).map(|place| shares[place] * number(place)).sum::<f64>()
                    };
                    let point: Point =
                        std::array::from_fn(|axis| mix(&|place| corners[place].point[axis].wide()));
                    let length = if fans.is_parallel() { 1.0 } else { norm(point) };
                    let thickness = length * mix(&|place| corners[place].through.wide())
                        / mix(&|place| corners[place].before.wide());
                    drawn.thickness[row * NUM_PIXELS + column] += thickness;
                    drawn.times[row * NUM_PIXELS + column] += 1;
                }
            }
        }
    }
    drawn
}

/// Optical depth of the field by fans against the sum of chords, and the largest difference of a transmittance.
fn compare(
    leaves: &[Leaf],
    spacing: Point,
    eye: Point,
    picture: &Picture,
    fans_of: &dyn Fn(&Leaf) -> Option<Drawn>,
) -> (f64, f64, u32) {
    let plane =
        |index: [i32; 3]| -> Point { std::array::from_fn(|axis| f64::from(index[axis]) * spacing[axis]) };
    let origin = if picture.screen.is_parallel { [0.0; 3] } else { eye };
    let (mut by_fans, mut by_rays) = (vec![0.0; NUM_PIXELS * NUM_PIXELS], vec![0.0; NUM_PIXELS * NUM_PIXELS]);
    let mut length = vec![0.0; NUM_PIXELS * NUM_PIXELS];
    let mut most = 0;
    for leaf in leaves {
        let drawn = fans_of(leaf);
        let relative = Cuboid { low: sub(plane(leaf.low), origin), high: sub(plane(leaf.high), origin) };
        for row in 0..NUM_PIXELS {
            for column in 0..NUM_PIXELS {
                let place = row * NUM_PIXELS + column;
                let (start, direction) = picture.ray(column, row);
                by_rays[place] += leaf.extinction * chord(start, direction, &relative);
                if let Some(drawn) = &drawn {
                    by_fans[place] += leaf.extinction * drawn.thickness[place];
                    length[place] += drawn.thickness[place];
                    most = most.max(drawn.times[place]);
                }
            }
        }
    }
    let whole = Cuboid { low: sub([0.0; 3], origin), high: sub(plane([NUM_CELLS; 3]), origin) };
    let (mut by_length, mut by_transmittance) = (0.0_f64, 0.0_f64);
    for row in 0..NUM_PIXELS {
        for column in 0..NUM_PIXELS {
            let place = row * NUM_PIXELS + column;
            let (start, direction) = picture.ray(column, row);
            by_length = by_length.max((length[place] - chord(start, direction, &whole)).abs());
            let difference = (-by_fans[place]).exp() - (-by_rays[place]).exp();
            by_transmittance = by_transmittance.max(difference.abs());
        }
    }
    (by_length, by_transmittance, most)
}

/// Places and views: name, eye in lattice steps, direction, half the picture.
fn views() -> Vec<(&'static str, Point, Point, f64, bool)> {
    let narrow = 15.0_f64.to_radians().tan();
    let centre = scale([1.0; 3], f64::from(NUM_CELLS) / 2.0);
    let outside = [-20.3, 9.1, 27.7];
    vec![
        ("outside, 30 degrees", outside, sub(centre, outside), narrow, false),
        ("outside, 90 degrees", [-3.3, 2.2, 18.1], sub(centre, [-3.3, 2.2, 18.1]), 1.0, false),
        ("inside, 90 degrees", [7.3, 5.1, 9.7], [0.3, 1.0, -0.2], 1.0, false),
        ("inside, on planes", [8.0, 4.0, 9.5], [0.3, 1.0, -0.2], 1.0, false),
        ("inside, on a corner, along an axis", [8.0, 8.0, 8.0], [0.0, 1.0, 0.0], 1.0, false),
        ("outside, on planes, along an axis", [8.0, 8.0, 24.0], [0.0, 0.0, -1.0], 1.0, false),
        ("on a face, grazing", [4.0, 0.0, 16.0], [0.6, 1.0, 0.0], 1.0, false),
        ("parallel", centre, [0.5, -0.7, -0.6], 14.0, true),
        ("parallel, along an axis", centre, [0.0, 0.0, -1.0], 24.0, true),
    ]
}

#[test]
fn fields_of_boxes_are_covered_once_per_ray() {
    let mut sequence = Sequence::new(11);
    for (name, eye, forward, half, is_parallel) in views() {
        for spacing in [[1.0; 3], [0.4, 1.0, 1.7]] {
            let leaves = leaves(&mut sequence);
            let along: [f64; 3] = std::array::from_fn(|axis| forward[axis] * spacing[axis]);
            let eye: Point = std::array::from_fn(|axis| eye[axis] * spacing[axis]);
            let picture = Picture { screen: Screen::looking(along, is_parallel), half };
            let plane = |index: [i32; 3]| -> Point {
                std::array::from_fn(|axis| f64::from(index[axis]) * spacing[axis])
            };
            let fans = |leaf: &Leaf| {
                let cuboid = Cuboid { low: plane(leaf.low), high: plane(leaf.high) };
                let viewpoint = if is_parallel {
                    Viewpoint::Direction(picture.screen.axes[2])
                } else {
                    Viewpoint::Eye(eye)
                };
                Fans::new(viewpoint, &cuboid).map(|fans| draw(&fans, &picture, &picture.sides()))
            };
            let (length, transmittance, most) = compare(&leaves, spacing, eye, &picture, &fans);
            println!(
                "{name}, {} boxes: length differs by {length:e}, transmittance by {transmittance:e} (at most 1e-9), \
                 a pixel covered {most} times (at most once) by a box",
                leaves.len()
            );
            assert!(length < 1e-9 && transmittance < 1e-9 && most == 1);
        }
    }
}

/// Edges of boxes of all levels go through centres of pixels, and thickness jumps there: the fill rule gives each
/// centre to exactly one box of a layer.
#[test]
fn edges_through_pixels_are_covered_once() {
    let mut sequence = Sequence::new(15);
    for axis in 0..3 {
        let mut forward = [0.0; 3];
        forward[axis] = if axis == 1 { 1.0 } else { -1.0 };
        // Two steps to a pixel, centres at odd steps.
        let picture = Picture { screen: Screen::looking(forward, true), half: NUM_PIXELS as f64 };
        let leaves = leaves(&mut sequence);
        let mut length = vec![0.0; NUM_PIXELS * NUM_PIXELS];
        for leaf in &leaves {
            let cuboid = Cuboid { low: leaf.low.map(f64::from), high: leaf.high.map(f64::from) };
            let fans = Fans::new(Viewpoint::Direction(forward), &cuboid).unwrap();
            let drawn = draw(&fans, &picture, &picture.sides());
            length.iter_mut().zip(drawn.thickness).for_each(|(length, thickness)| *length += thickness);
        }
        let (mut num_inside, whole) = (0, f64::from(NUM_CELLS));
        for row in 0..NUM_PIXELS {
            for column in 0..NUM_PIXELS {
                let (start, _) = picture.ray(column, row);
                let across = (0..3).filter(|&other| other != axis);
                if across.clone().all(|axis| 0.0 < start[axis] && start[axis] < whole) {
                    num_inside += 1;
                    assert_eq!(length[row * NUM_PIXELS + column], whole, "column {column}, row {row}");
                } else if across.clone().any(|axis| start[axis] < 0.0 || whole < start[axis]) {
                    assert_eq!(length[row * NUM_PIXELS + column], 0.0, "column {column}, row {row}");
                }
            }
        }
        println!("axis {axis}: {num_inside} pixels, {} boxes, each pixel {whole} deep exactly", leaves.len());
        assert_eq!(num_inside, 8 * 8);
    }
}

#[test]
fn fields_of_boxes_in_f32_from_lattice_integers() {
    let mut sequence = Sequence::new(12);
    for (name, eye, forward, half, _) in views().into_iter().filter(|view| !view.4) {
        let spacing = [0.5, 1.0, 0.25];
        let leaves = leaves(&mut sequence);
        let along: [f64; 3] = std::array::from_fn(|axis| forward[axis] * spacing[axis]);
        let eye: Point = std::array::from_fn(|axis| eye[axis] * spacing[axis]);
        let lattice = LatticeEye::new(eye, spacing);
        let picture = Picture { screen: Screen::looking(along, false), half };
        let sides = picture
            .sides()
            .map(|side| HalfSpace { normal: side.normal.map(|part| part as f32), offset: 0.0 });
        let fans = |leaf: &Leaf| {
            Fans::from_eye(&lattice.relative(leaf.low, leaf.high)).map(|fans| draw(&fans, &picture, &sides))
        };
        let (length, transmittance, most) = compare(&leaves, spacing, eye, &picture, &fans);
        println!(
            "{name}: length differs by {length:e}, transmittance by {transmittance:e}, at most 1e-5; {most} times"
        );
        assert!(length < 1e-4 && transmittance < 1e-5 && most == 1);
    }
}

/// Two boxes of different levels share a plane, the eye is within both across the other axes: so its face is the
/// only one that can be toward the eye.
#[test]
fn neighbours_agree_on_which_side_the_eye_is() {
    let mut sequence = Sequence::new(13);
    let mut counts = [0; 3];
    for _ in 0..200_000 {
        let spacing = sequence.between(1e-3, 10.0) as f32;
        let plane = |index: u64| index as f32 * spacing;
        let index = 1 + sequence.below(1 << 12);
        let eye = [world::beside(plane(index), sequence.below(5) as i32 - 2), 0.3, 77.0];
        let below = Cuboid { low: [plane(index - 1), -9.0, 70.0], high: [plane(index), 9.0, 90.0] };
        let above = Cuboid { low: [plane(index), -1.0, 76.0], high: [plane(index + 4), 1.0, 78.0] };
        let [below, above] = [below, above].map(|cuboid| Relative::new(&cuboid, eye));
        assert_eq!(below.high[0].to_bits(), above.low[0].to_bits());
        let aspects = [below, above].map(|relative| Fans::from_eye(&relative).unwrap().aspect());
        let found = aspects.map(|aspect| (aspect.class(), aspect.faces()[0]));
        let [below, above] = found;
        match eye[0].partial_cmp(&plane(index)) {
            Some(std::cmp::Ordering::Less) => assert!(below.0 == 0 && above == (1, 0), "{found:?}"),
            Some(std::cmp::Ordering::Equal) => assert!(below.0 == 0 && above.0 == 0, "{found:?}"),
            _ => assert!(below == (1, 1) && above.0 == 0, "{found:?}"),
        }
        counts[1 + usize::from(eye[0] > plane(index)) - usize::from(eye[0] < plane(index))] += 1;
    }
    println!("eye below, on, above the plane: {counts:?}");
    assert!(counts.into_iter().all(|count| count > 30_000));
}

#[test]
fn lattice_planes_have_the_sign_of_the_exact_difference() {
    let mut sequence = Sequence::new(14);
    for _ in 0..100_000 {
        let step = sequence.between(1e-3, 10.0);
        let index = sequence.below(1 << 20) as i32 - (1 << 19);
        let beside = world::beside_f64(f64::from(index) * step, sequence.below(7) as i32 - 3);
        let eye = LatticeEye::new([beside; 3], [step; 3]);
        let coordinate = f64::from(eye.whole[0]) + f64::from(eye.fraction[0]);
        for index in [index - 1, index, index + 1] {
            let exact = f64::from(index) - coordinate;
            let plane = eye.plane(0, index);
            assert_eq!(plane.partial_cmp(&0.0), exact.partial_cmp(&0.0), "{index} {coordinate}");
            assert!(eye.plane(0, index - 1) <= plane && plane <= eye.plane(0, index + 1));
        }
    }
    let extreme = LatticeEye::new([f64::NAN, 1e300, -1e300], [1.0; 3]);
    assert!(Fans::from_eye(&extreme.relative([i32::MIN; 3], [i32::MAX; 3])).is_none());
}
