//! What of a grid does not depend on the planes: its edges, and how the faces of its cells are split.
//!
//! # Method
//! Edges are gathered by their lower node and numbered in the order of (lower, higher) node, so their numbers
//! do not depend on the order of cells. A face of four nodes is split by the diagonal at its lowest node. If it
//! is warped, its diagonals passing each other at more than [`WARPED`] of the longer, that diagonal becomes an
//! edge like any other; else its corner in a section would lie on the line between its neighbours, and is left
//! out. Both cells at a face take its nodes in the same order, so rounding cannot make them disagree.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::{CellType, UnstructuredGrid};

use crate::outline::Outline;
use crate::table::{Table, tables};

/// Distance of a face's diagonals, over the length of the longer, up to which the face counts as planar. A
/// section leaves out a corner no farther than that from its outline.
const WARPED: f64 = 1e-6;

/// A grid made ready for slicing by any planes.
#[derive(Debug)]
pub struct Slicer {
    grid: Arc<UnstructuredGrid>,
    /// Pairs of nodes, the lower first, ascending.
    pub(crate) edges: Vec<[u32; 2]>,
    cells: Vec<Cell>,
    /// Numbers of the edges of each cell, then of the diagonals of its faces if one of them is warped.
    cell_edges: Vec<u32>,
    outline: OnceLock<Outline>,
}

/// Why a grid could not be made ready.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// More edges than can be numbered.
    #[error("slicing: {found} edges of cells, expected at most {}", u32::MAX)]
    TooManyEdges {
        /// Counted once per cell.
        found: usize,
    },
}

/// What of a cell does not depend on the planes.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Where its edges start.
    start: u32,
    /// Which faces are split by their second diagonal.
    choice: u8,
    /// Which faces are warped.
    warped: u8,
    /// The table is that of a cell the other way round.
    is_flipped: bool,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Kind {
    Blank,
    /// With a node that it lists more than once.
    Collapsed,
    #[default]
    Whole,
}

/// A cell with its table, ready to be cut.
pub(crate) struct Ready<'a> {
    pub(crate) nodes: &'a [u32],
    table: &'static Table,
    choice: u8,
    warped: u8,
    is_collapsed: bool,
    edges: &'a [u32],
}

impl Slicer {
    /// Numbers the edges of a grid and splits its faces. Once per grid; any planes can follow.
    ///
    /// # Errors
    /// When there are more edges than 32 bits can number.
    pub fn new(grid: impl Into<Arc<UnstructuredGrid>>) -> Result<Self, Error> {
        let grid = grid.into();
        let mut cells: Vec<Cell> =
            (0..grid.cells().len()).into_par_iter().map(|cell| Cell::new(&grid, cell)).collect();
        let mut total = 0;
        for (cell, cell_type) in cells.iter_mut().zip(grid.cells().types()) {
            cell.start = total as u32;
            total += cell.num_edges(*cell_type);
            if u32::try_from(total).is_err() {
                return Err(Error::TooManyEdges { found: total });
            }
        }
        let pairs_of = |cell: usize| cells[cell].pairs(&grid, cell);
        let pairs: Vec<[u32; 2]> = (0..cells.len()).into_par_iter().flat_map_iter(pairs_of).collect();
        let (edges, cell_edges) = number_edges(grid.points().len(), &pairs);
        Ok(Self { grid, edges, cells, cell_edges, outline: OnceLock::new() })
    }

    /// The grid.
    pub fn grid(&self) -> &Arc<UnstructuredGrid> {
        &self.grid
    }

    /// How many edges, and diagonals of warped faces, the grid has.
    pub fn num_edges(&self) -> usize {
        self.edges.len()
    }

    /// The outline of all cells that are not blank, made when it is first asked for.
    pub(crate) fn outline(&self) -> &Outline {
        self.outline.get_or_init(|| Outline::of_classes(self, 1, |_| Some(0)).pop().unwrap_or_default())
    }

    /// The middle of the outline's bounds, and how far they reach from it.
    pub(crate) fn middle_and_reach(&self) -> [DVec3; 2] {
        let points = self.outline().nodes.iter().map(|&node| self.grid.points()[node as usize]);
        let bounds = points.map(|point| [point; 2]);
        let bounds = bounds.reduce(|[low, high], [a, b]| [low.min(a), high.max(b)]);
        bounds.map_or([DVec3::ZERO; 2], |[low, high]| {
            let reach = 0.5 * high - 0.5 * low;
            [low + reach, reach]
        })
    }

    pub(crate) fn num_cells(&self) -> usize {
        self.cells.len()
    }

    pub(crate) fn is_blank(&self, cell: usize) -> bool {
        self.cells[cell].kind == Kind::Blank
    }

    /// Gives the faces of a cell, around the outward normal.
    pub(crate) fn for_faces(&self, cell: usize, mut give: impl FnMut(&[u32])) {
        let (cell_type, nodes) = self.grid.cells().get(cell);
        for places in cell_type.faces() {
            let mut face = [0; 4];
            let face = &mut face[..places.len()];
            for (node, &place) in face.iter_mut().zip(*places) {
                *node = nodes[usize::from(place)];
            }
            if self.cells[cell].is_flipped {
                face.reverse();
            }
            give(face);
        }
    }

    #[inline]
    pub(crate) fn cell(&self, cell: usize) -> Ready<'_> {
        let (cell_type, nodes) = self.grid.cells().get(cell);
        let Cell { start, choice, warped, is_flipped, kind } = self.cells[cell];
        Ready {
            nodes,
            table: &tables()[cell_type as usize][usize::from(is_flipped)],
            choice,
            warped,
            is_collapsed: kind == Kind::Collapsed,
            edges: &self.cell_edges[start as usize..],
        }
    }
}

impl Ready<'_> {
    /// Appends the polygons for these signs: `vertex` gives the number of the vertex on an edge, `ends` takes
    /// where each polygon ends in `corners`.
    #[inline]
    pub(crate) fn cut(
        &self,
        above: u32,
        mut vertex: impl FnMut(u32) -> u32,
        corners: &mut Vec<u32>,
        ends: &mut Vec<u32>,
    ) {
        let inserted = self.warped & self.table.crossed(above, self.choice);
        let num_edges = self.table.edges.len();
        let (start, first_end) = (corners.len(), ends.len());
        for polygon in self.table.case(above, self.choice).polygons() {
            if inserted == 0 {
                corners.extend(polygon.iter().map(|corner| vertex(self.edges[corner.edge()])));
            } else {
                for corner in polygon {
                    corners.push(vertex(self.edges[corner.edge()]));
                    if inserted >> corner.quad() & 1 == 1 {
                        corners.push(vertex(self.edges[num_edges + corner.quad()]));
                    }
                }
            }
            ends.push(corners.len() as u32);
        }
        if self.is_collapsed {
            without_repeated(corners, start, ends, first_end);
        }
    }
}

/// Puts in place of the polygons from `start` on, of a cell with repeated nodes, those around what they cover: sides
/// that are passed both ways go, the rest is followed from side to side, and split where it comes to a vertex again.
fn without_repeated(corners: &mut Vec<u32>, start: usize, ends: &mut Vec<u32>, first_end: usize) {
    let mut sides: Vec<[u32; 2]> = Vec::with_capacity(corners.len() - start);
    let mut first = start;
    for end in ends.drain(first_end..) {
        let polygon = &corners[first..end as usize];
        for (at, &from) in polygon.iter().enumerate() {
            let to = polygon[(at + 1) % polygon.len()];
            match sides.iter().position(|&side| side == [to, from]) {
                Some(back) => drop(sides.remove(back)),
                None if from != to => sides.push([from, to]),
                None => {}
            }
        }
        first = end as usize;
    }
    corners.truncate(start);
    let mut keep = |part: &[u32]| {
        if part.len() >= 3 {
            corners.extend_from_slice(part);
            ends.push(corners.len() as u32);
        }
    };
    let mut path: Vec<u32> = Vec::with_capacity(sides.len());
    while !sides.is_empty() {
        // As many sides come to a vertex as go from it, so a path ends where it began.
        let next = path.last().and_then(|&at| sides.iter().position(|side| side[0] == at));
        let [from, to] = sides.remove(next.unwrap_or(0));
        if path.is_empty() {
            path.push(from);
        }
        match path.iter().position(|&other| other == to) {
            Some(first) => {
                keep(&path[first..]);
                path.truncate(if first == 0 { 0 } else { first + 1 });
            }
            None => path.push(to),
        }
    }
}

impl Cell {
    fn new(grid: &UnstructuredGrid, cell: usize) -> Self {
        if grid.is_blank(cell) {
            return Self { kind: Kind::Blank, ..Self::default() };
        }
        let (cell_type, nodes) = grid.cells().get(cell);
        let table = &tables()[cell_type as usize][0];
        let mut found = Self::default();
        for (place, quad) in table.quads.iter().enumerate() {
            let split = Split::new(quad.map(|node| nodes[usize::from(node)]), grid.points());
            found.choice |= u8::from(split.is_second) << place;
            found.warped |= u8::from(split.is_warped) << place;
        }
        let mut corners = [DVec3::ZERO; CellType::MAX_NODES];
        for (corner, &node) in corners.iter_mut().zip(nodes) {
            *corner = grid.points()[node as usize] - grid.points()[nodes[0] as usize];
        }
        found.is_flipped = volume(cell_type, found.choice, &corners) < 0.0;
        if (1..nodes.len()).any(|place| nodes[..place].contains(&nodes[place])) {
            found.kind = Kind::Collapsed;
        }
        found
    }

    fn num_edges(&self, cell_type: CellType) -> usize {
        let table = &tables()[cell_type as usize][0];
        let diagonals = if self.warped == 0 { 0 } else { table.quads.len() };
        if self.kind == Kind::Blank { 0 } else { table.edges.len() + diagonals }
    }

    /// Its edges, then the chosen diagonals if a face is warped: as nodes, the lower first.
    fn pairs(&self, grid: &UnstructuredGrid, cell: usize) -> impl Iterator<Item = [u32; 2]> {
        let (cell_type, nodes) = grid.cells().get(cell);
        let table = &tables()[cell_type as usize][0];
        let (edges, quads): (&[[u8; 2]], &[[u8; 4]]) = match self.kind {
            Kind::Blank => (&[], &[]),
            _ if self.warped == 0 => (&table.edges, &[]),
            _ => (&table.edges, &table.quads),
        };
        let choice = self.choice;
        let diagonal = move |(place, quad): (usize, &[u8; 4])| {
            if choice >> place & 1 == 1 { [quad[1], quad[3]] } else { [quad[0], quad[2]] }
        };
        let places = edges.iter().copied().chain(quads.iter().enumerate().map(diagonal));
        places.map(|pair| {
            let [a, b] = pair.map(|node| nodes[usize::from(node)]);
            [a.min(b), a.max(b)]
        })
    }
}

/// How a face of four nodes is split.
struct Split {
    is_second: bool,
    is_warped: bool,
}

impl Split {
    fn new(nodes: [u32; 4], points: &[DVec3]) -> Self {
        let [a, b, c, d] = nodes;
        let is_second = b.min(d) < a.min(c);
        // From the lowest node to the one across, then the other two, the lower first.
        let ([from, to], [left, right]) = if is_second { ([b, d], [a, c]) } else { ([a, c], [b, d]) };
        let order = [from.min(to), from.max(to), left.min(right), left.max(right)];
        let [from, to, left, right] = order.map(|node| points[node as usize]);
        let (first, second) = (to - from, right - left);
        let normal = first.cross(second);
        let between = normal.dot(left - from);
        let longer = first.length_squared().max(second.length_squared());
        // A face with two nodes in one place is a triangle, whatever rounding says.
        let is_triangle = [[a, b], [b, c], [c, d], [d, a]].iter().any(|&[node, next]| node == next);
        let is_warped =
            !is_triangle && between * between > WARPED * WARPED * longer * normal.length_squared();
        Self { is_second, is_warped }
    }
}

/// Six times the volume of a cell with its faces split as chosen, around its first node.
fn volume(cell_type: CellType, choice: u8, corners: &[DVec3; CellType::MAX_NODES]) -> f64 {
    let triple = |places: [u8; 3]| {
        let [a, b, c] = places.map(|place| corners[usize::from(place)]);
        a.dot(b.cross(c))
    };
    let (mut sum, mut num_quads) = (0.0, 0);
    for face in cell_type.faces() {
        match **face {
            [a, b, c] => sum += triple([a, b, c]),
            [a, b, c, d] => {
                let is_second = choice >> num_quads & 1 == 1;
                sum += if is_second {
                    triple([b, c, d]) + triple([b, d, a])
                } else {
                    triple([a, b, c]) + triple([a, c, d])
                };
                num_quads += 1;
            }
            _ => {}
        }
    }
    sum
}

/// Every pair once, ascending, and the place there of each pair as given.
pub(crate) fn number_edges(num_nodes: usize, pairs: &[[u32; 2]]) -> (Vec<[u32; 2]>, Vec<u32>) {
    const RUN: usize = 4096;
    let mut starts = vec![0u32; num_nodes + 1];
    for &[low, _] in pairs {
        starts[low as usize + 1] += 1;
    }
    for node in 0..num_nodes {
        starts[node + 1] += starts[node];
    }
    let mut upper = vec![0; pairs.len()];
    let mut next = starts.clone();
    for &[low, high] in pairs {
        upper[next[low as usize] as usize] = high;
        next[low as usize] += 1;
    }
    // Runs of nodes, each with its own part of the upper nodes.
    let (mut runs, mut rest) = (Vec::new(), upper.as_mut_slice());
    for first in (0..num_nodes).step_by(RUN) {
        let ends = &starts[first..=num_nodes.min(first + RUN)];
        let (part, others) = rest.split_at_mut((ends[ends.len() - 1] - ends[0]) as usize);
        runs.push((first, ends, part));
        rest = others;
    }
    let sorted: Vec<(Vec<[u32; 2]>, Vec<u32>)> = runs.into_par_iter().map(sort_run).collect();
    let num_edges = sorted.iter().map(|(edges, _)| edges.len()).sum();
    let (mut edges, mut firsts) = (Vec::with_capacity(num_edges), Vec::with_capacity(num_nodes + 1));
    for (run, starts) in sorted {
        firsts.extend(starts.iter().map(|start| edges.len() as u32 + start));
        edges.extend(run);
    }
    firsts.push(edges.len() as u32);
    let find = |&[low, high]: &[u32; 2]| {
        let [start, end] = [firsts[low as usize], firsts[low as usize + 1]].map(|at| at as usize);
        (start + edges[start..end].partition_point(|edge| edge[1] < high)) as u32
    };
    let numbers = pairs.par_iter().map(find).collect();
    (edges, numbers)
}

/// The pairs of a run of lower nodes, each once, and where those of each node start.
fn sort_run((first, ends, upper): (usize, &[u32], &mut [u32])) -> (Vec<[u32; 2]>, Vec<u32>) {
    let (mut edges, mut starts) = (Vec::with_capacity(upper.len() / 3), Vec::with_capacity(ends.len() - 1));
    for (node, range) in (first as u32..).zip(ends.windows(2)) {
        let bucket = &mut upper[(range[0] - ends[0]) as usize..(range[1] - ends[0]) as usize];
        bucket.sort_unstable();
        starts.push(edges.len() as u32);
        edges.extend(bucket.chunk_by(|a, b| a == b).map(|same| [node, same[0]]));
    }
    (edges, starts)
}
