//! The tables: plain arrays of small integers, made at compile time, for the processor and for shaders.
//!
//! Vertex `v = x + 2y + 4z` of a box has low (0) or high (1) coordinates; faces 0..6 are -x +x -y +y -z +z.
//!
//! # Rows
//! [`ROWS`] is figure 8 of the paper, and contains figure 7. A row is a proper rotation of the cube: the one
//! that carries face 5 (+z) of the template to the *first* face and face 0 (-x) to the *second*. It is built
//! from that sentence, not copied; row (1, 2) as printed repeats a vertex, it must read 0 2 4 6 1 3 5 7.
//!
//! # One template for all classes
//! Ten vertices, four *inner* ones around and six *outer* ones, are joined by the same twelve triangles
//! whatever the class; [`TEMPLATES`] says which corner each vertex is. A GPU draws all boxes with one index
//! buffer, in any order of classes.
//!
//! ```text
//!   O5-----------O4          inner I0..I3, then outer O0..O5, counter-clockwise as the eye sees them.
//!   | \   I3--I2/ \          I0 and I2 are tips of two outer edges each, I1 and I3 of one each.
//!   |  \ / | /|   O3         Class 1 has four outer vertices: O1 = O0 and O4 = O3, and the last two
//!   O0--I0--I1  /            triangles are empty.
//!     \ |    \ /
//!      O1----O2
//! ```
//! With the eye outside, the inner vertices are the rectangle in the plane of the first face where rays enter
//! through that face and leave through the opposite one; inner vertex `v` of the template (0, 1, 2, 3, the
//! corners of the opposite face) is at the low or high end of that rectangle as the bits of `v` say. In the
//! paper's figures these are: class 1: 0, 1, 2, 3. Class 2: A, 1, B, 3. Class 3a: A, 1, 6, B. The outer ones
//! are the silhouette.
//!
//! With the eye inside (class 0) the twelve triangles are the six faces seen from inside: the ring of outer
//! vertices is folded onto the path of edges 0-1-5-7, the inner ones are the corners 3, 6, 4, 2.

/// Vertices of a template: four inner ones, then six outer ones.
pub const NUM_VERTICES: usize = 10;

/// The twelve triangles over the ten vertices, counter-clockwise as the eye sees them. Class 1 needs only the
/// first ten, the others have no area there.
pub const TRIANGLES: [[u8; 3]; 12] = [
    [0, 1, 3],
    [1, 2, 3],
    [0, 6, 1],
    [1, 7, 2],
    [2, 9, 3],
    [3, 4, 0],
    [0, 5, 6],
    [1, 6, 7],
    [2, 8, 9],
    [3, 9, 4],
    [0, 4, 5],
    [2, 7, 8],
];

/// By class 0..4: the template's corner at each of the ten vertices.
pub const TEMPLATES: [[u8; NUM_VERTICES]; 4] = [
    [3, 6, 4, 2, 1, 5, 7, 5, 1, 0],
    [0, 1, 3, 2, 4, 4, 5, 7, 7, 6],
    [1, 3, 2, 0, 4, 5, 7, 6, 2, 0],
    [0, 1, 3, 2, 0, 4, 5, 7, 3, 2],
];

/// Figure 8: the corner of the box at each corner of the template. Row [`row`]`(first, second)`.
pub const ROWS: [[u8; 8]; 24] = rows();

/// How a box shows, as `4 * row + class`, by its sides and the axis of the first face.
///
/// Sides are `s0 + 3 s1 + 9 s2`, with 0 for an axis without a face toward the eye, 1 for the low and 2 for the
/// high face. An axis without a face toward the eye is replaced by the lowest that has one.
pub const ASPECTS: [[u8; 3]; 27] = aspects();

/// [`TEMPLATES`] carried through [`ROWS`]: the corner of the box at each of the ten vertices, by aspect.
pub const CORNERS: [[u8; NUM_VERTICES]; 96] = corners();

/// Where the row of two faces that share an edge is in [`ROWS`].
pub const fn row(first: u8, second: u8) -> u8 {
    4 * first + second - if second / 2 > first / 2 { 2 } else { 0 }
}

/// The faces of a row, first and second.
pub const fn faces(row: u8) -> [u8; 2] {
    let (first, rank) = (row / 4, row % 4);
    [first, rank + if rank / 2 >= first / 2 { 2 } else { 0 }]
}

/// An axis of the template in the box: which axis of the box, and whether it runs the same way.
#[derive(Clone, Copy)]
struct Carried {
    axis: u8,
    is_same_way: bool,
}

/// x, y, z of the template: z is the normal of the first face, x against that of the second, y = z cross x.
const fn carried_axes([first, second]: [u8; 2]) -> [Carried; 3] {
    let z = Carried { axis: first / 2, is_same_way: first % 2 == 1 };
    let x = Carried { axis: second / 2, is_same_way: second % 2 == 0 };
    let is_cyclic = x.axis == (z.axis + 1) % 3;
    let y = Carried { axis: 3 - x.axis - z.axis, is_same_way: (z.is_same_way == x.is_same_way) == is_cyclic };
    [x, y, z]
}

const fn rows() -> [[u8; 8]; 24] {
    let mut rows = [[0; 8]; 24];
    let mut row = 0;
    while row < 24 {
        let axes = carried_axes(faces(row as u8));
        let mut corner = 0;
        while corner < 8 {
            let mut carried = 0;
            let mut axis = 0;
            while axis < 3 {
                let is_high = corner >> axis & 1 == 1;
                if is_high == axes[axis].is_same_way {
                    carried |= 1 << axes[axis].axis;
                }
                axis += 1;
            }
            rows[row][corner] = carried;
            corner += 1;
        }
        row += 1;
    }
    rows
}

const fn aspects() -> [[u8; 3]; 27] {
    let mut aspects = [[0; 3]; 27];
    let mut sides = 0;
    while sides < 27 {
        let by_axis = [sides % 3, sides / 3 % 3, sides / 9];
        let mut axis = 0;
        while axis < 3 {
            aspects[sides][axis] = aspect(by_axis, axis);
            axis += 1;
        }
        sides += 1;
    }
    aspects
}

/// In class 3 the second face is the one that makes the third the template's +y: the paper's class 3a. The
/// other order would be its class 3b, a mirror image of the same picture with other diagonals.
const fn aspect(sides: [usize; 3], axis: usize) -> u8 {
    let faces = [face_of(sides, 0), face_of(sides, 1), face_of(sides, 2)];
    let class = (sides[0] > 0) as u8 + (sides[1] > 0) as u8 + (sides[2] > 0) as u8;
    if class == 0 {
        return 4 * row(5, 0);
    }
    let first = if sides[axis] > 0 {
        axis
    } else if sides[0] > 0 {
        0
    } else if sides[1] > 0 {
        1
    } else {
        2
    };
    let (next, last) = ((first + 1) % 3, (first + 2) % 3);
    let second = match class {
        1 => next,
        2 if sides[next] > 0 => next,
        2 => last,
        _ => {
            let y = carried_axes([faces[first], faces[next]])[1];
            if (faces[last] % 2 == 1) == y.is_same_way { next } else { last }
        }
    };
    4 * row(faces[first], faces[second]) + class
}

const fn face_of(sides: [usize; 3], axis: usize) -> u8 {
    2 * axis as u8 + (sides[axis] == 2) as u8
}

const fn corners() -> [[u8; NUM_VERTICES]; 96] {
    let mut corners = [[0; NUM_VERTICES]; 96];
    let mut aspect = 0;
    while aspect < 96 {
        let mut vertex = 0;
        while vertex < NUM_VERTICES {
            corners[aspect][vertex] = ROWS[aspect / 4][TEMPLATES[aspect % 4][vertex] as usize];
            vertex += 1;
        }
        aspect += 1;
    }
    corners
}
