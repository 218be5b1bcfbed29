//! From pieces to one grid: which array, which cells, values at the nodes.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use volery_scene::{CellType, Cells, UnstructuredGrid};

use super::kinds::{self, Kind};
use super::{
    ArrayRange, GridArray, GridFile, GridFormat, GridOptions, Part, Piece, PieceArray, PieceCells, Place,
};
use crate::choice::{Choices, checked_channel};
use crate::error::{OneLine, Problem, quoted};
use crate::near::one_of;

/// Bytes of a point and its value, of a cell without its nodes, of a node of a cell.
const POINT_BYTES: u128 = 32;
const CELL_BYTES: u128 = 5;
const NODE_BYTES: u64 = 4;

/// Bits of `vtkGhostType` on cells: a copy of a cell in another piece, one that finer ones replace, hidden; and on
/// points: hidden.
const DUPLICATE_OR_REFINED: u8 = 1 | 8;
const HIDDEN: u8 = 32;
const HIDDEN_POINT: u8 = 2;

/// Reads and joins the pieces; also says which array was read and what was decided.
pub(super) fn join(format: GridFormat, parts: &[Part], options: &GridOptions) -> Result<GridFile, Problem> {
    let bytes_left = bytes_left(parts, options)?;
    let mut decided = Vec::new();
    let array = choose(parts, options.array.as_deref(), &mut decided)?;
    if let Some(channel) = options.channel.filter(|_| array.is_none()) {
        return Err(Problem::field("channel asked for", channel, "none: the file has no array"));
    }
    let channels = array.as_ref().map_or(1, |array| array.components as u64);
    let channel = checked_channel(channels, options.channel)?.map(|channel| channel as usize);
    let has_several = parts.iter().filter(|part| part.piece.num_cells() > 0).count() > 1;
    let places = has_several.then(HashMap::new);
    let mut joined = Joined { nodes_left: bytes_left / NODE_BYTES, places, ..Joined::default() };
    for part in parts.iter().filter(|part| part.piece.num_cells() > 0) {
        part.run(|piece| joined.add(piece, array.as_ref(), channel))?;
    }
    let (grid, mut notes) = joined.finish(array.as_ref(), channel)?;
    for note in parts.iter().flat_map(|part| [part.notes.clone(), part.piece.notes()].concat()) {
        // Pieces of one grid often say the same.
        if !decided.contains(&note) {
            decided.push(note);
        }
    }
    notes.append(&mut decided);
    Ok(GridFile { grid, format, array, choices: Choices { channels, time_steps: 1 }, notes })
}

/// The ranges of all arrays.
pub(super) fn ranges(parts: &[Part], options: &GridOptions) -> Result<Vec<ArrayRange>, Problem> {
    bytes_left(parts, options)?;
    let range_of = |array: &PieceArray| {
        let array = array.array.clone();
        let channel = options.channel.filter(|channel| (0..array.components).contains(channel));
        let channel = channel.filter(|_| array.components > 1);
        let (mut range, mut blank, mut problem) = ([f64::INFINITY, f64::NEG_INFINITY], 0, None);
        for part in parts {
            match part.run(|piece| scalars(piece, &array, channel)) {
                Ok(values) => {
                    for value in values {
                        if value.is_finite() {
                            range = [range[0].min(value), range[1].max(value)];
                        } else {
                            blank += 1;
                        }
                    }
                }
                Err(found) => problem = Some(found.to_string()),
            }
        }
        let range = (range[0] <= range[1] && problem.is_none()).then_some(range);
        ArrayRange { array, channel, range, blank, problem }
    };
    Ok(arrays(parts).iter().map(range_of).collect())
}

/// What the limit leaves for the nodes of cells, by the counts that the pieces state.
fn bytes_left(parts: &[Part], options: &GridOptions) -> Result<u64, Problem> {
    let sum = |count: fn(&dyn Piece) -> u64| parts.iter().map(|part| u128::from(count(&*part.piece))).sum();
    let (points, cells): (u128, u128) = (sum(|piece| piece.num_points()), sum(|piece| piece.num_cells()));
    let max = u128::from(options.max_bytes);
    let max_points = (max / POINT_BYTES).min(u32::MAX.into());
    if points > max_points {
        return Err(Problem::field("number of points", points, format!("at most {max_points}")));
    }
    let left = max - points * POINT_BYTES;
    let max_cells = left / CELL_BYTES;
    if cells > max_cells {
        return Err(Problem::field("number of cells", cells, format!("at most {max_cells}")));
    }
    // At most `max`, which was 64 bits.
    Ok((left - cells * CELL_BYTES) as u64)
}

/// The arrays of the first piece that has cells; the others must have those that are read.
fn arrays<'a>(parts: &'a [Part]) -> &'a [PieceArray] {
    let first = parts.iter().find(|part| part.piece.num_cells() > 0).or(parts.first());
    first.map_or(&[], |part| part.piece.arrays())
}

fn is_ghost(array: &GridArray) -> bool {
    matches!(array.name.as_str(), "vtkGhostType" | "vtkGhostLevels")
}

/// The array that is asked for; else the active scalars, else the first: scalars before vectors, points before cells,
/// and what is the same everywhere only where nothing else varies.
fn choose(
    parts: &[Part],
    wanted: Option<&str>,
    notes: &mut Vec<String>,
) -> Result<Option<GridArray>, Problem> {
    let arrays = arrays(parts);
    if let Some(name) = wanted {
        let on = |place| arrays.iter().find(move |a| a.array.place == place && a.array.name == name);
        let found = on(Place::Points).or_else(|| on(Place::Cells));
        if found.is_none() {
            parts.iter().try_for_each(|part| part.run(|piece| piece.check_left_out(name)))?;
        }
        return found.map(|found| Some(found.array.clone())).ok_or_else(|| {
            let names: Vec<_> = arrays.iter().map(|array| array.array.name.as_str()).collect();
            Problem::field("array", quoted(name), format!("one of {}", OneLine(one_of(name, &names))))
        });
    }
    let mut candidates: Vec<_> = arrays.iter().filter(|array| !is_ghost(&array.array)).collect();
    // Stable, so that the order of the file decides last.
    candidates.sort_by_key(|PieceArray { array, is_active }| {
        let is_vector = array.components > 1;
        (is_vector, array.place == Place::Cells, !is_active)
    });
    let mut skipped = Vec::new();
    for candidate in candidates.iter().filter(|_| candidates.len() > 1) {
        let name = quoted(&candidate.array.name);
        match varies(parts, &candidate.array) {
            Ok(false) => skipped.push(format!("array {name} is the same everywhere")),
            // What the file shows must be read, or its fault be said.
            Err(problem) if !candidate.is_active => {
                skipped.push(format!("array {name} cannot be read: {problem}"));
            }
            _ => {
                notes.extend(skipped.iter().map(|why| format!("{why}; {name} is used")));
                return Ok(Some(candidate.array.clone()));
            }
        }
    }
    Ok(candidates.first().map(|first| first.array.clone()))
}

/// Whether an array has two values that differ.
fn varies(parts: &[Part], array: &GridArray) -> Result<bool, Problem> {
    let mut seen = Vec::new();
    for part in parts {
        let differs = part.run(|piece| match piece_tuples(piece, array) {
            0 => Ok(false),
            _ => piece.varies(index_of(piece, array)?, &mut seen),
        })?;
        if differs {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The values that a piece has of an array.
fn piece_tuples(piece: &dyn Piece, array: &GridArray) -> u64 {
    if array.place == Place::Points { piece.num_points() } else { piece.num_cells() }
}

/// The place of an array in a piece.
fn index_of(piece: &dyn Piece, array: &GridArray) -> Result<usize, Problem> {
    let same = |other: &PieceArray| {
        let GridArray { name, place, components, scalar: _ } = &other.array;
        (name, *place, *components) == (&array.name, array.place, array.components)
    };
    piece.arrays().iter().position(same).ok_or_else(|| {
        let expected =
            format!("one with {} components on {}, as in other pieces", array.components, array.place);
        Problem::missing(format!("array {}", quoted(&array.name)), expected)
    })
}

/// The values of an array; of several components one, or their magnitude.
fn scalars(piece: &dyn Piece, array: &GridArray, channel: Option<usize>) -> Result<Vec<f64>, Problem> {
    if piece_tuples(piece, array) == 0 {
        return Ok(Vec::new());
    }
    let values = piece.values(index_of(piece, array)?)?;
    Ok(match (array.components, channel) {
        (1, _) => values,
        (components, Some(channel)) => values.into_iter().skip(channel).step_by(components).collect(),
        (components, None) => {
            values.chunks(components).map(|value| value.iter().fold(0.0, |a, b| f64::hypot(a, *b))).collect()
        }
    })
}

/// For each cell or point the bits of `vtkGhostType`; empty if the piece says nothing.
fn ghost_bits(piece: &dyn Piece, place: Place) -> Result<Vec<u8>, Problem> {
    let is_there = |array: &PieceArray| array.array.place == place && is_ghost(&array.array);
    let Some(index) = piece.arrays().iter().position(is_there) else { return Ok(Vec::new()) };
    let levels = piece.arrays()[index].array.name == "vtkGhostLevels";
    let bits = |value: f64| if levels { u8::from(value > 0.0) } else { value as u8 };
    let components = piece.arrays()[index].array.components;
    Ok(piece.values(index)?.into_iter().step_by(components).map(bits).collect())
}

/// Bits of `vtkGhostType`; a list is empty where the piece says nothing.
struct Ghosts {
    cells: Vec<u8>,
    points: Vec<u8>,
}

impl Ghosts {
    /// Those of a cell, which a hidden corner hides.
    fn of(&self, cell: usize, corners: &[u32]) -> u8 {
        let bits = |list: &[u8], index: usize| list.get(index).copied().unwrap_or(0);
        let hides = |&node: &u32| bits(&self.points, node as usize) & HIDDEN_POINT != 0;
        bits(&self.cells, cell) | if corners.iter().any(hides) { HIDDEN } else { 0 }
    }
}

/// What has been read so far.
#[derive(Default)]
struct Joined {
    points: Vec<DVec3>,
    /// For several pieces the point at a position, by the bits of its coordinates.
    places: Option<HashMap<[u64; 3], u32>>,
    types: Vec<CellType>,
    nodes: Vec<u32>,
    blank: Vec<bool>,
    values: Vec<f64>,
    /// How many cells around each point have given to its value, for an array on cells.
    cells_around: Vec<u32>,
    /// Nodes that cells may still have within the limit.
    nodes_left: u64,
    counts: Counts,
}

/// What is said about cells in notes.
#[derive(Default)]
struct Counts {
    /// Cells by VTK's number of their type.
    left_out: BTreeMap<u8, u64>,
    by_corners: BTreeMap<u8, u64>,
    /// Cells of first order with more nodes than these have.
    too_long: u64,
    copies: u64,
    hidden: u64,
    without_value: u64,
    /// Points that were there already, from another piece.
    shared_points: u64,
}

impl Joined {
    fn add(
        &mut self,
        piece: &dyn Piece,
        array: Option<&GridArray>,
        channel: Option<usize>,
    ) -> Result<(), Problem> {
        let cells = piece.cells(self.nodes_left)?;
        self.nodes_left -= (cells.nodes.len() as u64).min(self.nodes_left);
        let ghosts =
            Ghosts { cells: ghost_bits(piece, Place::Cells)?, points: ghost_bits(piece, Place::Points)? };
        let (points, mut values) = (piece.points()?, None);
        if let Some(array) = array {
            values = Some(scalars(piece, array, channel)?);
        }
        let on_points = array.is_some_and(|array| array.place == Place::Points);
        let places = self.add_points(points, values.as_deref().filter(|_| on_points));
        let cell_values = values.filter(|_| !on_points);
        if cell_values.is_some() {
            self.values.resize(self.points.len(), 0.0);
            self.cells_around.resize(self.points.len(), 0);
        }
        self.add_cells(&cells, &places, &ghosts, cell_values.as_deref())
    }

    /// Adds the points of a piece and their values; returns their places among all points. Points of several
    /// pieces with one position and one value become one, so that pieces hang together; where a piece itself
    /// has several at a position, that is meant.
    fn add_points(&mut self, points: Vec<DVec3>, values: Option<&[f64]>) -> Vec<u32> {
        // Adding 0 turns -0 into it. NaN never equals.
        let key = |point: DVec3| (point + 0.0).to_array().map(f64::to_bits);
        let mut own: HashMap<[u64; 3], u32> = HashMap::new();
        if self.places.is_some() {
            points
                .iter()
                .filter(|point| point.is_finite())
                .for_each(|&point| *own.entry(key(point)).or_default() += 1);
        }
        let place = |(index, point): (usize, DVec3)| {
            let value = values.map(|values| values[index]);
            let single = own.get(&key(point)) == Some(&1);
            let known = self.places.as_ref().filter(|_| single).and_then(|places| places.get(&key(point)));
            let same = |&&place: &&u32| value.is_none_or(|value| value == self.values[place as usize]);
            if let Some(&place) = known.filter(same) {
                self.counts.shared_points += 1;
                return place;
            }
            // Below the number of points of all pieces, which 32 bits can number.
            let place = self.points.len() as u32;
            self.points.push(point);
            self.values.extend(value);
            if let Some(places) = self.places.as_mut().filter(|_| single) {
                places.entry(key(point)).or_insert(place);
            }
            place
        };
        points.into_iter().enumerate().map(place).collect()
    }

    fn add_cells(
        &mut self,
        cells: &PieceCells,
        places: &[u32],
        ghosts: &Ghosts,
        cell_values: Option<&[f64]>,
    ) -> Result<(), Problem> {
        let mut start = 0;
        for (cell, (&vtk, &end)) in cells.types.iter().zip(&cells.ends).enumerate() {
            let nodes = &cells.nodes[start..end];
            start = end;
            let (Kind::Linear(cell_type) | Kind::Corners(cell_type)) = kinds::kind(vtk) else {
                *self.counts.left_out.entry(vtk).or_default() += 1;
                continue;
            };
            let Some(corners) = nodes.get(..cell_type.num_nodes()) else {
                let field = format!("number of nodes of cell {cell} ({})", kinds::name(vtk));
                return Err(Problem::field(field, nodes.len(), cell_type.num_nodes()));
            };
            let bits = ghosts.of(cell, corners);
            let corners = corners.iter().map(|&node| places[node as usize]);
            let mut blank = false;
            if let Some(&value) = cell_values.and_then(|values| values.get(cell)) {
                blank = !value.is_finite();
                self.counts.without_value += u64::from(blank);
                for node in corners.clone().filter(|_| !blank) {
                    self.values[node as usize] += value;
                    self.cells_around[node as usize] += 1;
                }
            }
            if bits & DUPLICATE_OR_REFINED != 0 {
                self.counts.copies += 1;
                continue;
            }
            match kinds::kind(vtk) {
                Kind::Corners(_) => *self.counts.by_corners.entry(vtk).or_default() += 1,
                _ => self.counts.too_long += u64::from(nodes.len() > cell_type.num_nodes()),
            }
            self.counts.hidden += u64::from(bits & HIDDEN != 0);
            self.types.push(cell_type);
            self.nodes.extend(corners);
            self.blank.push(blank || bits & HIDDEN != 0);
        }
        Ok(())
    }

    fn finish(
        mut self,
        array: Option<&GridArray>,
        channel: Option<usize>,
    ) -> Result<(UnstructuredGrid, Vec<String>), Problem> {
        let notes = self.counts.notes(array, channel);
        if self.types.is_empty() {
            let expected = "at least one that has volume";
            let found = if notes.is_empty() { "0".to_owned() } else { format!("0 ({})", notes.join("; ")) };
            return Err(Problem::field("number of cells", found, expected));
        }
        for (value, &cells) in self.values.iter_mut().zip(&self.cells_around) {
            // A point without a cell has no value: 0 / 0 is NaN.
            *value /= f64::from(cells);
        }
        let cells = Cells::new(self.types, self.nodes).map_err(Problem::Cells)?;
        let mut grid = UnstructuredGrid::new(self.points, cells).map_err(Problem::Cells)?;
        if self.blank.contains(&true) {
            grid = grid.with_blank(self.blank).map_err(Problem::Cells)?;
        }
        if let Some(array) = array {
            grid = grid.with_array(array.name.as_str(), self.values).map_err(Problem::Cells)?;
        }
        Ok((grid, notes))
    }
}

impl Counts {
    fn notes(&self, array: Option<&GridArray>, channel: Option<usize>) -> Vec<String> {
        let list = |counts: &BTreeMap<u8, u64>| {
            let each = counts.iter().map(|(&vtk, count)| format!("{count} {}", kinds::name(vtk)));
            each.collect::<Vec<_>>().join(", ")
        };
        let mut notes = Vec::new();
        if let Some(array) = array {
            if array.components > 1 && channel.is_none() {
                notes.push(format!(
                    "the array has {} components; its magnitude is used (a channel, 0 to {}, can be chosen)",
                    array.components,
                    array.components - 1
                ));
            }
            if array.place == Place::Cells {
                notes.push("the array lies on cells; its values are averaged to the points".to_owned());
            }
        }
        if !self.by_corners.is_empty() {
            notes.push(format!("cells read by their corner nodes: {}", list(&self.by_corners)));
        }
        if !self.left_out.is_empty() {
            notes.push(format!("cells of types that are not read, left out: {}", list(&self.left_out)));
        }
        let counted = [
            (self.too_long, "list more nodes than their type has; the first ones are used"),
            (self.copies, "are copies of cells in other pieces, or replaced by finer ones, and left out"),
            (self.hidden, "are hidden, and blank"),
            (self.without_value, "have no finite value, and are blank"),
        ];
        if self.shared_points > 0 {
            notes.push(format!("{} points that several pieces share are one each", self.shared_points));
        }
        let some = counted.into_iter().filter(|(count, _)| *count > 0);
        notes.extend(some.map(|(count, what)| format!("{count} cells {what}")));
        notes
    }
}
