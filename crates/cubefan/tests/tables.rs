//! Every table row by geometry, and the paper's figures against what is derived.

mod world;

use volery_cubefan::table::{ASPECTS, CORNERS, ROWS, TEMPLATES, TRIANGLES, faces, row};
use world::{Point, Screen, corners, cross, dot, doubled_area, hull, scale, sub, turn, weights};

/// Figure 7 as printed: the row of each first face.
const FIGURE_7: [[u8; 8]; 6] = [
    [1, 5, 3, 7, 0, 4, 2, 6],
    [4, 0, 6, 2, 5, 1, 7, 3],
    [2, 3, 6, 7, 0, 1, 4, 5],
    [4, 5, 0, 1, 6, 7, 2, 3],
    [6, 7, 4, 5, 2, 3, 0, 1],
    [0, 1, 2, 3, 4, 5, 6, 7],
];

/// Figure 8 as printed, with the misprint of row (1, 2).
const FIGURE_8: [([u8; 2], [u8; 8]); 24] = [
    ([0, 2], [5, 7, 1, 3, 4, 6, 0, 2]),
    ([0, 3], [3, 1, 7, 5, 2, 0, 6, 4]),
    ([0, 4], [1, 5, 3, 7, 0, 4, 2, 6]),
    ([0, 5], [7, 3, 5, 1, 6, 2, 4, 0]),
    ([1, 2], [0, 2, 4, 6, 1, 2, 5, 7]),
    ([1, 3], [6, 4, 2, 0, 7, 5, 3, 1]),
    ([1, 4], [2, 6, 0, 4, 3, 7, 1, 5]),
    ([1, 5], [4, 0, 6, 2, 5, 1, 7, 3]),
    ([2, 0], [2, 3, 6, 7, 0, 1, 4, 5]),
    ([2, 1], [7, 6, 3, 2, 5, 4, 1, 0]),
    ([2, 4], [3, 7, 2, 6, 1, 5, 0, 4]),
    ([2, 5], [6, 2, 7, 3, 4, 0, 5, 1]),
    ([3, 0], [4, 5, 0, 1, 6, 7, 2, 3]),
    ([3, 1], [1, 0, 5, 4, 3, 2, 7, 6]),
    ([3, 4], [0, 4, 1, 5, 2, 6, 3, 7]),
    ([3, 5], [5, 1, 4, 0, 7, 3, 6, 2]),
    ([4, 0], [6, 7, 4, 5, 2, 3, 0, 1]),
    ([4, 1], [5, 4, 7, 6, 1, 0, 3, 2]),
    ([4, 2], [4, 6, 5, 7, 0, 2, 1, 3]),
    ([4, 3], [7, 5, 6, 4, 3, 1, 2, 0]),
    ([5, 0], [0, 1, 2, 3, 4, 5, 6, 7]),
    ([5, 1], [3, 2, 1, 0, 7, 6, 5, 4]),
    ([5, 2], [1, 3, 0, 2, 5, 7, 4, 6]),
    ([5, 3], [2, 0, 3, 1, 6, 4, 7, 5]),
];

/// Faces in order of class 3a, as listed in section 5.
const CLASS_3A: [[u8; 3]; 24] = [
    [0, 2, 4],
    [0, 5, 2],
    [0, 4, 3],
    [0, 3, 5],
    [1, 4, 2],
    [1, 5, 3],
    [1, 3, 4],
    [1, 2, 5],
    [2, 4, 0],
    [2, 1, 4],
    [2, 0, 5],
    [2, 5, 1],
    [3, 5, 0],
    [3, 1, 5],
    [3, 4, 1],
    [3, 0, 4],
    [4, 1, 3],
    [4, 3, 0],
    [4, 2, 1],
    [4, 0, 2],
    [5, 0, 3],
    [5, 1, 2],
    [5, 2, 0],
    [5, 3, 1],
];

/// A vertex of the paper's fans: a corner of the template, or a crossing of a front and a back edge.
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    Corner(usize),
    Crossing([usize; 2], [usize; 2]),
}

/// The paper's fans and strips, as lists of vertices.
struct Paper {
    name: &'static str,
    fans: Vec<Vec<At>>,
    strip: Vec<At>,
}

impl Paper {
    fn triangles(&self) -> Vec<[At; 3]> {
        let fans =
            self.fans.iter().flat_map(|fan| fan[1..].windows(2).map(|edge| [fan[0], edge[0], edge[1]]));
        fans.chain(self.strip.windows(3).map(|three| [three[0], three[1], three[2]])).collect()
    }
}

/// Vertices written as in the paper, with the edges that cross in A and B.
fn list(text: &str, crossings: [At; 2]) -> Vec<At> {
    let vertex = |letter: char| match letter {
        'A' => crossings[0],
        'B' => crossings[1],
        digit => At::Corner(digit.to_digit(8).expect("a corner") as usize),
    };
    text.chars().map(vertex).collect()
}

fn paper(class: &str) -> Paper {
    let none = [At::Corner(0); 2];
    let (name, crossings, fans, strip): (_, _, &[&str], _) = match class {
        "1" => ("figure 4", none, &["2376403", "1304573"], ""),
        "2" => {
            let crossings = [At::Crossing([4, 6], [0, 1]), At::Crossing([4, 6], [2, 3])];
            ("figure 5", crossings, &["173BA457"], "736B2A04")
        }
        "3a" => {
            let crossings = [At::Crossing([4, 6], [0, 1]), At::Crossing([6, 7], [1, 3])];
            ("figure 6a", crossings, &["A620451B6", "B157326"], "")
        }
        _ => {
            let crossings = [At::Crossing([4, 6], [1, 5]), At::Crossing([2, 6], [1, 3])];
            ("figure 6b", crossings, &["A6B104576", "B673201"], "")
        }
    };
    let fans = fans.iter().map(|fan| list(fan, crossings)).collect();
    Paper { name, fans, strip: list(strip, crossings) }
}

/// Unit vector out of a face.
fn normal(face: u8) -> Point {
    let mut normal = [0.0; 3];
    normal[usize::from(face / 2)] = if face % 2 == 1 { 1.0 } else { -1.0 };
    normal
}

/// The printed row, misprint and all.
fn printed(first: u8, second: u8) -> [u8; 8] {
    FIGURE_8.iter().find(|(faces, _)| *faces == [first, second]).expect("a row").1
}

/// Pairs of faces that share an edge.
fn pairs() -> Vec<[u8; 2]> {
    FIGURE_8.iter().map(|(faces, _)| *faces).collect()
}

/// An eye before the faces given, nearest to the last, with low and high of the unit cube relative to it.
fn cube_before(faces: &[u8]) -> [Point; 2] {
    let mut eye = [0.43; 3];
    for (&face, distance) in faces.iter().zip([3.1, 1.7, 0.8]) {
        let axis = usize::from(face / 2);
        eye[axis] = if face % 2 == 1 { 1.0 + distance } else { -distance };
    }
    [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]].map(|corner| sub(corner, eye))
}

#[test]
fn rows_are_rotations_that_carry_faces_5_and_0_to_first_and_second() {
    for [first, second] in pairs() {
        let carried = ROWS[usize::from(row(first, second))];
        assert_eq!(faces(row(first, second)), [first, second]);
        let at = corners([-1.0; 3], [1.0; 3]);
        let image = |corner: usize| at[usize::from(carried[corner])];
        // The images of the axes at corner 0 are axes, right-handed, and all corners follow them.
        let axes = [1, 2, 4].map(|corner| scale(sub(image(corner), image(0)), 0.5));
        assert_eq!(cross(axes[0], axes[1]), axes[2], "row ({first}, {second}) is no rotation");
        for (corner, from) in at.iter().enumerate() {
            let rotated: Point =
                std::array::from_fn(|axis| (0..3).map(|part| axes[part][axis] * from[part]).sum());
            assert_eq!(image(corner), rotated, "row ({first}, {second}), corner {corner}");
        }
        assert_eq!(axes[2], normal(first));
        assert_eq!(scale(axes[0], -1.0), normal(second));
    }
}

#[test]
fn the_printed_tables_are_the_derived_ones_but_for_one_vertex() {
    for [first, second] in pairs() {
        let (derived, printed) = (ROWS[usize::from(row(first, second))], printed(first, second));
        if [first, second] == [1, 2] {
            assert_eq!(derived, [0, 2, 4, 6, 1, 3, 5, 7]);
            assert_eq!(
                derived.iter().zip(printed).filter(|(derived, printed)| *derived != printed).count(),
                1
            );
        } else {
            assert_eq!(derived, printed, "row ({first}, {second})");
        }
    }
    for (first, printed) in (0..).zip(FIGURE_7) {
        let is_it = |second: &u8| ROWS[usize::from(row(first, *second))] == printed;
        assert!((0..6).filter(|second| second / 2 != first / 2).any(|second| is_it(&second)), "{first}");
    }
}

#[test]
fn class_3a_is_where_first_second_and_third_are_left_handed() {
    let mut num_left_handed = 0;
    for [first, second] in pairs() {
        for third in (0..6).filter(|face| face / 2 != first / 2 && face / 2 != second / 2) {
            let is_left_handed = dot(cross(normal(first), normal(second)), normal(third)) < 0.0;
            assert_eq!(CLASS_3A.contains(&[first, second, third]), is_left_handed);
            num_left_handed += usize::from(is_left_handed);
        }
    }
    assert_eq!(num_left_handed, CLASS_3A.len());
}

/// Checks triangles over a cube seen from the origin: edges cross where the figure says, and together the
/// triangles cover the hull once.
fn check_paper(template: &Paper, carried: &[u8; 8], [low, high]: [Point; 2]) {
    let at = corners(low, high);
    let screen = Screen::before(low, high);
    let flat = at.map(|corner| screen.project(corner));
    let place = |corner: usize| usize::from(carried[corner]);
    // Where a crossing is on the picture, by intersecting lines there.
    let project = |vertex: At| match vertex {
        At::Corner(corner) => flat[place(corner)],
        At::Crossing(front, back) => {
            let ([a, b], [c, d]) =
                (front.map(|corner| flat[place(corner)]), back.map(|corner| flat[place(corner)]));
            let share = turn([c, d, a]) / (turn([c, d, a]) - turn([c, d, b]));
            let other = turn([a, b, c]) / (turn([a, b, c]) - turn([a, b, d]));
            assert!((0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&other), "the edges cross");
            [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]
        }
    };
    let expected = doubled_area(&hull(&flat));
    let triangles: Vec<_> = template.triangles().iter().map(|triangle| triangle.map(project)).collect();
    let sum: f64 = triangles.iter().map(|triangle| turn(*triangle).abs()).sum();
    assert!((sum / expected - 1.0).abs() < 1e-12, "{}: area {sum}, expected {expected}", template.name);
    // No two of them overlap: samples of the hull are in exactly one.
    let mut sequence = world::Sequence::new(4);
    for triangle in &triangles {
        let shares = sequence.weights();
        let sample: [f64; 2] =
            std::array::from_fn(|axis| (0..3).map(|corner| shares[corner] * triangle[corner][axis]).sum());
        let covers = |other: &&[[f64; 2]; 3]| weights(**other, sample).iter().all(|weight| *weight > 1e-9);
        assert_eq!(triangles.iter().filter(covers).count(), 1, "{}", template.name);
    }
}

#[test]
fn the_papers_fans_cover_the_hull_once_in_all_6_24_and_24_rows() {
    let mut num_rows = [0; 3];
    for first in 0..6 {
        let template = paper("1");
        assert_eq!(template.triangles().len(), 10);
        check_paper(&template, &FIGURE_7[usize::from(first)], cube_before(&[first]));
        num_rows[0] += 1;
    }
    for [first, second] in pairs() {
        let carried = &ROWS[usize::from(row(first, second))];
        assert_eq!(paper("2").triangles().len(), 12);
        check_paper(&paper("2"), carried, cube_before(&[first, second]));
        num_rows[1] += 1;
        for third in (0..6).filter(|face| face / 2 != first / 2 && face / 2 != second / 2) {
            let cube = cube_before(&[first, second, third]);
            if CLASS_3A.contains(&[first, second, third]) {
                check_paper(&paper("3a"), carried, cube);
                num_rows[2] += 1;
            } else {
                // Figure 8 with the faces swapped.
                check_paper(&paper("3b"), &ROWS[usize::from(row(second, first))], cube);
                num_rows[2] += 1;
            }
        }
    }
    assert_eq!(num_rows, [6, 24, 48]);
}

#[test]
fn the_misprinted_row_does_not_cover() {
    let [low, high] = cube_before(&[1, 2]);
    let result = std::panic::catch_unwind(|| check_paper(&paper("2"), &printed(1, 2), [low, high]));
    assert!(result.is_err(), "the test must find the misprint");
}

#[test]
fn templates_have_the_corners_of_their_class() {
    for (class, template) in TEMPLATES.iter().enumerate() {
        let mut outer = template[4..].to_vec();
        outer.sort_unstable();
        outer.dedup();
        let expected: &[u8] =
            [&[0, 1, 5, 7][..], &[4, 5, 6, 7], &[0, 2, 4, 5, 6, 7], &[0, 2, 3, 4, 5, 7]][class];
        assert_eq!(outer, expected, "class {class}");
    }
    let mut edges = std::collections::BTreeMap::new();
    for triangle in TRIANGLES {
        for place in 0..3 {
            let (from, to) = (triangle[place], triangle[(place + 1) % 3]);
            assert!(edges.insert((from, to), ()).is_none(), "edge {from} {to} twice the same way");
        }
    }
    let border: Vec<_> = edges.keys().filter(|(from, to)| !edges.contains_key(&(*to, *from))).collect();
    assert_eq!(border, [&(4, 5), &(5, 6), &(6, 7), &(7, 8), &(8, 9), &(9, 4)], "a disk with the outer ring");
}

#[test]
fn aspects_name_the_faces_toward_the_eye() {
    for (sides, by_axis) in ASPECTS.iter().enumerate() {
        let side = [sides % 3, sides / 3 % 3, sides / 9];
        let toward: Vec<u8> =
            (0..3).filter(|&axis| side[axis] > 0).map(|axis| (2 * axis + side[axis] - 1) as u8).collect();
        for (axis, &aspect) in by_axis.iter().enumerate() {
            let ([first, second], class) = (faces(aspect / 4), usize::from(aspect % 4));
            assert_eq!(class, toward.len());
            if class == 0 {
                continue;
            }
            assert!(toward.contains(&first));
            assert!(side[axis] == 0 || usize::from(first / 2) == axis);
            assert_eq!(toward.contains(&second), class > 1);
            if class == 3 {
                let third = *toward.iter().find(|face| ![first, second].contains(face)).unwrap();
                assert!(CLASS_3A.contains(&[first, second, third]));
            }
        }
    }
    for (aspect, corners) in CORNERS.iter().enumerate() {
        for (vertex, &corner) in corners.iter().enumerate() {
            assert_eq!(corner, ROWS[aspect / 4][usize::from(TEMPLATES[aspect % 4][vertex])]);
        }
    }
}
