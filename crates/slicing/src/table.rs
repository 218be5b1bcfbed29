//! Which section a cell has for which signs of its nodes: tables made from the faces of the cell.
//!
//! # Method
//! A node counts as above when it is above the plane or on it. Walk around a face, outward normal towards the
//! eye: the plane's section of that face runs from the side where the walk goes down through the plane to the
//! side where it comes up. So every face hands the section on from one edge of the cell to another, and every
//! edge that crosses the plane belongs to two faces, which walk along it in opposite directions: one hands the
//! section to it, the other takes it on. Following that from edge to edge gives closed polygons, around the
//! plane's normal in a cell of positive volume.
//!
//! A face of four nodes is two triangles on either side of one of its diagonals. Where the diagonal itself
//! crosses the plane it gives the section one more corner, between the two on the sides; that is left to the
//! caller, who knows whether the face is planar and the corner idle. Where the signs alternate around the face,
//! four sides cross, and the diagonal decides which belong together: its two ends have the same sign and stay
//! connected, the other two nodes are cut off. Both cells at a face split it by the same diagonal, so they agree.
//!
//! The polygons are those of the surface; no inner diagonal is chosen. A plane's section is flat whatever spans
//! it, so marching cubes' inner ambiguity has no meaning here.

use std::sync::LazyLock;

use volery_scene::CellType;

/// The most edges a cell has; each is a corner of its section at most once.
const MAX_EDGES: usize = 12;

/// The most polygons a section has: the hexahedron of alternating signs, four corners cut off.
const MAX_POLYGONS: usize = 4;

/// In place of a face of four nodes: one of three.
const TRIANGLE: u8 = 7;

/// A corner of a polygon and the face over which the next one is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Corner(u8);

impl Corner {
    const fn new(edge: u8, quad: u8) -> Self {
        Self(edge | quad << 4)
    }

    /// Place of the edge in [`Table::edges`].
    #[inline]
    pub(crate) const fn edge(self) -> usize {
        (self.0 & 15) as usize
    }

    /// Place of the face in [`Table::quads`]; beyond its end for a triangle.
    #[inline]
    pub(crate) const fn quad(self) -> usize {
        (self.0 >> 4) as usize
    }
}

/// The polygons of one set of signs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Case {
    num_polygons: u8,
    /// Where the corners of each polygon end.
    ends: [u8; MAX_POLYGONS],
    corners: [Corner; MAX_EDGES],
}

impl Case {
    /// The corners of each polygon.
    #[inline]
    pub(crate) fn polygons(&self) -> impl Iterator<Item = &[Corner]> {
        (0..usize::from(self.num_polygons)).map(|polygon| {
            let start = if polygon == 0 { 0 } else { self.ends[polygon - 1] };
            &self.corners[usize::from(start)..usize::from(self.ends[polygon])]
        })
    }
}

/// What there is to know of one set of signs before the diagonals are known.
#[derive(Clone, Copy, Debug, Default)]
struct Signs {
    /// The first of its cases.
    first: u16,
    /// Faces of four nodes with alternating signs.
    ambiguous: u8,
    /// Faces whose first, and whose second diagonal crosses the plane.
    crossed: [u8; 2],
}

/// All sections of one type of cell.
#[derive(Debug)]
pub(crate) struct Table {
    /// Edges as places of nodes.
    pub(crate) edges: Vec<[u8; 2]>,
    /// Faces of four nodes; the first diagonal goes from the first node to the third, the second from the second
    /// to the fourth.
    pub(crate) quads: Vec<[u8; 4]>,
    signs: Vec<Signs>,
    cases: Vec<Case>,
}

/// By type of cell, then whether the cell is the other way round.
static TABLES: LazyLock<[[Table; 2]; CellType::ALL.len()]> =
    LazyLock::new(|| CellType::ALL.map(|cell_type| [false, true].map(|flip| Table::new(cell_type, flip))));

/// All tables, by number of the type, then whether the cell is the other way round.
pub(crate) fn tables() -> &'static [[Table; 2]; CellType::ALL.len()] {
    &TABLES
}

impl Table {
    fn new(cell_type: CellType, flip: bool) -> Self {
        let faces = cell_type.faces();
        let mut table = Self {
            edges: edges(faces),
            quads: faces.iter().filter_map(|face| (*face).try_into().ok()).collect(),
            signs: Vec::new(),
            cases: Vec::new(),
        };
        for above in 0..1u32 << cell_type.num_nodes() {
            let is_above = |node: u8| above >> node & 1 == 1;
            let mut signs = Signs { first: table.cases.len() as u16, ..Signs::default() };
            for (quad, &[a, b, c, d]) in table.quads.iter().enumerate() {
                let [a, b, c, d] = [a, b, c, d].map(is_above);
                signs.ambiguous |= u8::from(a == c && b == d && a != b) << quad;
                signs.crossed[0] |= u8::from(a != c) << quad;
                signs.crossed[1] |= u8::from(b != d) << quad;
            }
            let subsets = (0..=u8::MAX).filter(|choice| choice & !signs.ambiguous == 0);
            table.cases.extend(subsets.map(|choice| case(faces, &table.edges, flip, is_above, choice)));
            table.signs.push(signs);
        }
        table
    }

    /// The section for these signs, bit by node, 1 for above, where each face of four nodes is split by its
    /// second diagonal if its bit is set in `choice`, else by its first.
    #[inline]
    pub(crate) fn case(&self, above: u32, choice: u8) -> &Case {
        let signs = &self.signs[above as usize];
        let mut place = usize::from(signs.first);
        if signs.ambiguous != 0 {
            place += gather(choice, signs.ambiguous);
        }
        &self.cases[place]
    }

    /// The faces of four nodes whose chosen diagonal crosses the plane.
    #[inline]
    pub(crate) fn crossed(&self, above: u32, choice: u8) -> u8 {
        let [first, second] = self.signs[above as usize].crossed;
        first & !choice | second & choice
    }
}

/// The bits of `value` where `mask` has one, moved together.
fn gather(value: u8, mask: u8) -> usize {
    let (mut rest, mut found, mut at) = (mask, 0, 0);
    while rest != 0 {
        found |= usize::from(value >> rest.trailing_zeros() & 1) << at;
        rest &= rest - 1;
        at += 1;
    }
    found
}

/// Every side of every face once.
fn edges(faces: &[&[u8]]) -> Vec<[u8; 2]> {
    let mut edges = Vec::with_capacity(MAX_EDGES);
    for [from, to] in faces.iter().flat_map(|face| sides(face)) {
        if !edges.contains(&[from, to]) && !edges.contains(&[to, from]) {
            edges.push([from, to]);
        }
    }
    edges
}

/// The sides of a face, in its order.
fn sides(face: &[u8]) -> impl Iterator<Item = [u8; 2]> {
    (0..face.len()).map(|at| [face[at], face[(at + 1) % face.len()]])
}

/// Follows the section from edge to edge.
fn case(faces: &[&[u8]], edges: &[[u8; 2]], flip: bool, is_above: impl Fn(u8) -> bool, choice: u8) -> Case {
    let edge_of = |[from, to]: [u8; 2]| {
        let is_same = |&edge: &[u8; 2]| edge == [from, to] || edge == [to, from];
        edges.iter().position(is_same).map_or(u8::MAX, |edge| edge as u8)
    };
    // The corner after each edge, or before it when the cell is the other way round.
    let mut next = [None; MAX_EDGES];
    let mut num_quads = 0;
    for face in faces {
        let quad = if face.len() == 4 { num_quads } else { TRIANGLE };
        num_quads += u8::from(face.len() == 4);
        let down: Vec<_> = sides(face).filter(|&[from, to]| is_above(from) && !is_above(to)).collect();
        let up: Vec<_> = sides(face).filter(|&[from, to]| !is_above(from) && is_above(to)).collect();
        for (start, end) in pairs(face, &down, &up, choice >> (quad & 7) & 1 == 1) {
            let (start, end) = (edge_of(start), edge_of(end));
            let (start, end) = if flip { (end, start) } else { (start, end) };
            next[usize::from(start)] = Some((end, quad));
        }
    }
    let (mut case, mut num_corners) = (Case::default(), 0);
    for first in 0..edges.len() {
        let mut edge = first;
        while let Some((to, quad)) = next[edge].take() {
            case.corners[usize::from(num_corners)] = Corner::new(edge as u8, quad);
            num_corners += 1;
            edge = usize::from(to);
            if edge == first {
                case.ends[usize::from(case.num_polygons)] = num_corners;
                case.num_polygons += 1;
            }
        }
    }
    case
}

/// The sides between which the section of a face runs, from one that goes down to one that comes up.
fn pairs(face: &[u8], down: &[[u8; 2]], up: &[[u8; 2]], second_diagonal: bool) -> Vec<([u8; 2], [u8; 2])> {
    if let ([down], [up]) = (down, up) {
        return vec![(*down, *up)];
    }
    // Signs alternate: each node that is not on the diagonal is cut off, and so pairs its two sides.
    let is_cut_off = |node: u8| {
        let place = face.iter().position(|&other| other == node);
        place.is_some_and(|place| (place % 2 == 0) == second_diagonal)
    };
    let pair = |&start: &[u8; 2]| {
        let shares = |end: &&[u8; 2]| {
            start[1] == end[0] && is_cut_off(start[1]) || start[0] == end[1] && is_cut_off(start[0])
        };
        up.iter().find(shares).map(|&end| (start, end))
    };
    down.iter().filter_map(pair).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// An edge or diagonal as nodes, the lower first.
    type Place = [u8; 2];

    fn place([a, b]: [u8; 2]) -> Place {
        [a.min(b), a.max(b)]
    }

    /// The sides of a section by marching the triangles of a cell's surface: no tables, no ambiguity.
    fn by_triangles(cell_type: CellType, above: u32, choice: u8) -> BTreeSet<(Place, Place)> {
        let is_above = |node: u8| above >> node & 1 == 1;
        let mut triangles = Vec::new();
        let mut num_quads = 0;
        for face in cell_type.faces() {
            match **face {
                [a, b, c] => triangles.push([a, b, c]),
                [a, b, c, d] if choice >> num_quads & 1 == 1 => triangles.extend([[a, b, d], [b, c, d]]),
                [a, b, c, d] => triangles.extend([[a, b, c], [a, c, d]]),
                _ => panic!("face of {} nodes", face.len()),
            }
            num_quads += u32::from(face.len() == 4);
        }
        let mut found = BTreeSet::new();
        for triangle in triangles {
            let find = |down: bool| {
                sides(&triangle).find(|&[from, to]| is_above(from) == down && is_above(to) != down).map(place)
            };
            if let (Some(down), Some(up)) = (find(true), find(false)) {
                found.insert((down, up));
            }
        }
        found
    }

    /// The sides of a table's polygons, corners on crossed diagonals put in.
    fn by_table(table: &Table, above: u32, choice: u8) -> BTreeSet<(Place, Place)> {
        let crossed = table.crossed(above, choice);
        let mut found = BTreeSet::new();
        for polygon in table.case(above, choice).polygons() {
            let mut corners = Vec::new();
            for corner in polygon {
                corners.push(place(table.edges[corner.edge()]));
                if crossed >> corner.quad() & 1 == 1 {
                    let [a, b, c, d] = table.quads[corner.quad()];
                    corners.push(place(if choice >> corner.quad() & 1 == 1 { [b, d] } else { [a, c] }));
                }
            }
            assert!(polygon.len() >= 3, "{polygon:?}");
            for (at, &from) in corners.iter().enumerate() {
                let to = corners[(at + 1) % corners.len()];
                assert!(found.insert((from, to)), "side {from:?} {to:?} twice");
            }
        }
        found
    }

    #[test]
    fn every_case_is_that_of_the_triangulated_surface() {
        for cell_type in CellType::ALL {
            let [table, flipped] = &tables()[cell_type as usize];
            let mut num_cases = 0;
            for above in 0..1u32 << cell_type.num_nodes() {
                for choice in 0..1u8 << table.quads.len() {
                    let expected = by_triangles(cell_type, above, choice);
                    assert_eq!(by_table(table, above, choice), expected, "{cell_type} {above:b} {choice:b}");
                    let backwards = by_table(flipped, above, choice).into_iter().map(|(from, to)| (to, from));
                    assert_eq!(backwards.collect::<BTreeSet<_>>(), expected, "{cell_type} {above:b} flipped");
                    num_cases += 1;
                }
            }
            println!("{cell_type}: {num_cases} cases of signs and diagonals, {} kept", table.cases.len());
        }
    }

    #[test]
    fn swapping_above_and_below_turns_every_polygon_around() {
        for cell_type in CellType::ALL {
            let [table, _] = &tables()[cell_type as usize];
            let all = (1u32 << cell_type.num_nodes()) - 1;
            for above in 0..=all {
                for choice in 0..1u8 << table.quads.len() {
                    let backwards = by_table(table, all ^ above, choice);
                    let backwards = backwards.into_iter().map(|(from, to)| (to, from)).collect();
                    assert_eq!(by_table(table, above, choice), backwards, "{cell_type} {above:b} {choice:b}");
                }
            }
        }
    }
}
