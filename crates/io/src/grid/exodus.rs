//! Exodus II in netCDF-3: nodes, blocks of elements of one type, values at nodes and on elements at time steps.
//!
//! One time step is read, the first unless another one is asked for. Side sets and node sets are not used. Files in netCDF-4, which is HDF5, are
//! refused. Each list is checked against the size of the file before it is read.

use glam::DVec3;
use netcdf_reader::{NcFile, NcSliceInfo, NcSliceInfoElem, NcType};

use super::{GridArray, Part, Piece, PieceArray, PieceCells, Place};
use crate::choice::{checked_step, first_note};
use crate::error::Problem;

/// Names take more memory than bytes in the file.
const MAX_ARRAYS: u64 = 1 << 16;

/// The file and where its values are.
struct Exodus {
    file: NcFile,
    file_bytes: u64,
    num_points: usize,
    num_cells: usize,
    blocks: Vec<Block>,
    arrays: Vec<PieceArray>,
    /// For each array its number among those of its place, from 0.
    numbers: Vec<u64>,
    num_steps: u64,
    /// The one that is read.
    step: u64,
}

/// Elements of one type.
struct Block {
    /// From 1.
    number: usize,
    elements: usize,
    nodes_each: usize,
    vtk: u8,
}

/// Opens the content of a file and runs something on it.
pub(super) fn with_parts<R>(
    bytes: &[u8],
    step: Option<usize>,
    run: impl FnOnce(u64, &[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    if bytes.starts_with(b"\x89HDF") {
        let expected = "Exodus II in netCDF-3 (classic), as 'nccopy -k cdf5' makes it";
        return Err(Problem::field("format", "netCDF-4 (HDF5)", expected));
    }
    let file = NcFile::from_bytes(bytes).map_err(|error| Problem::damaged("the netCDF header", error))?;
    let mut exodus = Exodus::new(file, bytes.len() as u64)?;
    // A file without values has its mesh.
    let num_steps = exodus.num_steps.max(1);
    exodus.step = checked_step(num_steps, step)?.unwrap_or(0);
    let mut part = Part::new(None, exodus);
    part.notes.extend(first_note("time steps", num_steps, step));
    run(num_steps, &[part])
}

impl Exodus {
    fn new(file: NcFile, file_bytes: u64) -> Result<Self, Problem> {
        let mut exodus = Self {
            file,
            file_bytes,
            num_points: 0,
            num_cells: 0,
            blocks: Vec::new(),
            arrays: Vec::new(),
            numbers: Vec::new(),
            num_steps: 0,
            step: 0,
        };
        let expected = "the dimension of an Exodus II file";
        let needed = |name: &str| exodus.dimension(name)?.ok_or_else(|| Problem::missing(name, expected));
        let dims = needed("num_dim")?;
        if dims != 3 {
            return Err(Problem::field("num_dim", dims, 3));
        }
        (exodus.num_points, exodus.num_cells) = (needed("num_nodes")?, needed("num_elem")?);
        exodus.add_blocks()?;
        exodus.num_steps = exodus.dimension("time_step")?.unwrap_or(0) as u64;
        if exodus.num_steps > 0 {
            exodus.add_arrays("name_nod_var", Place::Points)?;
            exodus.add_arrays("name_elem_var", Place::Cells)?;
        }
        Ok(exodus)
    }

    fn dimension(&self, name: &str) -> Result<Option<usize>, Problem> {
        let dimensions =
            self.file.dimensions().map_err(|error| Problem::damaged("the netCDF header", error))?;
        let Some(found) = dimensions.iter().find(|dimension| dimension.name == name) else { return Ok(None) };
        super::count(found.size, 1).map(Some).map_err(|problem| problem.of_array(name))
    }

    fn has(&self, variable: &str) -> bool {
        self.file.variable(variable).is_ok()
    }

    /// The lengths of a variable's dimensions.
    fn shape(&self, variable: &str) -> Result<Vec<u64>, Problem> {
        let found = self
            .file
            .variable(variable)
            .map_err(|_| Problem::missing(variable, "a variable of Exodus II"))?;
        Ok(found.dimensions().iter().map(|dimension| dimension.size).collect())
    }

    fn add_blocks(&mut self) -> Result<(), Problem> {
        let num_blocks = self.dimension("num_el_blk")?.unwrap_or(0);
        let num_variables = self.file.variables().map_or(0, <[_]>::len);
        if num_blocks > num_variables {
            return Err(Problem::field("num_el_blk", num_blocks, format!("at most {num_variables}")));
        }
        let mut total = 0_usize;
        for number in 1..=num_blocks {
            let name = format!("connect{number}");
            // A block without elements has no list.
            if !self.has(&name) {
                continue;
            }
            let shape = self.shape(&name)?;
            let &[elements, nodes_each] = shape.as_slice() else {
                return Err(Problem::field(name, format!("{} dimensions", shape.len()), "2"));
            };
            let (elements, nodes_each) = (super::count(elements, 1)?, super::count(nodes_each, 1)?);
            let variable = self.file.variable(&name).ok();
            let attribute =
                variable.and_then(|found| found.attributes.iter().find(|a| a.name == "elem_type"));
            let kind = attribute.and_then(|attribute| attribute.value.as_string()).unwrap_or_default();
            self.blocks.push(Block { number, elements, nodes_each, vtk: vtk_type(&kind, nodes_each) });
            total = total.saturating_add(elements);
        }
        if total != self.num_cells {
            return Err(Problem::field("elements of all blocks", total, self.num_cells));
        }
        Ok(())
    }

    /// Adds the arrays that a list names.
    fn add_arrays(&mut self, list: &str, place: Place) -> Result<(), Problem> {
        if !self.has(list) {
            return Ok(());
        }
        let shape = self.shape(list)?;
        self.check_size(list, &shape)?;
        if shape.contains(&0) || shape.first().is_some_and(|&names| names > MAX_ARRAYS) {
            let found = shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x ");
            return Err(Problem::field(list, found, format!("1 to {MAX_ARRAYS} names of at least 1 letter")));
        }
        let names = self.file.read_variable_as_strings(list);
        let names = names.map_err(|error| Problem::damaged("a list of names", error).of_array(list))?;
        for (number, name) in names.iter().enumerate() {
            let name = name.trim_matches(|c: char| c == '\0' || c.is_whitespace()).to_owned();
            let scalar = self.value_type(place, number + 1);
            let array = GridArray { name, place, components: 1, scalar };
            self.arrays.push(PieceArray { array, is_active: false });
            self.numbers.push(number as u64);
        }
        Ok(())
    }

    /// The type of the values of one array, by the first variable that holds some.
    fn value_type(&self, place: Place, number: usize) -> &'static str {
        let names = match place {
            Place::Points => vec![format!("vals_nod_var{number}"), "vals_nod_var".to_owned()],
            Place::Cells => {
                let name = |block: &Block| format!("vals_elem_var{number}eb{}", block.number);
                self.blocks.iter().map(name).collect()
            }
        };
        let found = names.iter().find_map(|name| self.file.variable(name).ok());
        if found.is_some_and(|variable| *variable.dtype() == NcType::Float) { "f32" } else { "f64" }
    }

    /// Refuses a list that is longer than the file, so that nothing is allocated for it.
    fn check_size(&self, variable: &str, shape: &[u64]) -> Result<(), Problem> {
        let count = shape.iter().try_fold(1_u64, |count, &length| count.checked_mul(length));
        match count {
            Some(count) if count <= self.file_bytes => Ok(()),
            _ => {
                let found = shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x ");
                Err(Problem::field("size", found, "at most that of the file").of_array(variable))
            }
        }
    }

    /// All numbers of a variable where its first dimensions are these.
    fn read(&self, variable: &str, first: &[u64], expected: usize) -> Result<Vec<f64>, Problem> {
        let shape = self.shape(variable)?;
        self.check_size(variable, &shape)?;
        let rest = shape.get(first.len()..).unwrap_or_default();
        let found = rest.iter().try_fold(1_u64, |count, &length| count.checked_mul(length));
        let inside =
            shape.len() >= first.len() && first.iter().zip(&shape).all(|(index, length)| index < length);
        if !inside || found != Some(expected as u64) {
            let found = shape.iter().map(u64::to_string).collect::<Vec<_>>().join(" x ");
            let expected = format!("{expected} numbers in the last {} dimensions", rest.len());
            return Err(Problem::field("size", found, expected).of_array(variable));
        }
        if expected == 0 {
            return Ok(Vec::new());
        }
        let fixed = first.iter().map(|&index| NcSliceInfoElem::Index(index));
        let whole = rest.iter().map(|&end| NcSliceInfoElem::Slice { start: 0, end, step: 1 });
        let selection = NcSliceInfo { selections: fixed.chain(whole).collect() };
        let read = self.file.read_variable_slice_as_f64(variable, &selection);
        let read = read.map_err(|error| Problem::damaged("the variable", error).of_array(variable))?;
        Ok(read.iter().copied().collect())
    }
}

/// VTK's number of an Exodus type. The corners stand first, in the same order, in both.
fn vtk_type(exodus: &str, nodes: usize) -> u8 {
    let name = exodus.trim_matches('\0').trim().to_ascii_uppercase();
    let is = |start: &str| name.starts_with(start);
    match nodes {
        4 if is("TET") => 10,
        8 if is("HEX") => 12,
        6 if is("WEDGE") => 13,
        5 if is("PYRA") => 14,
        _ if is("TET") => 24,
        27 if is("HEX") => 29,
        _ if is("HEX") => 25,
        _ if is("WEDGE") => 26,
        _ if is("PYRA") => 27,
        _ if is("NFACED") => 42,
        _ if is("NSIDED") => 7,
        _ if is("QUAD") || is("SHELL") && nodes > 3 => 9,
        _ if is("TRI") || is("SHELL") => 5,
        _ if is("BAR") || is("BEAM") || is("TRUSS") || is("EDGE") => 3,
        _ if is("SPHERE") || is("CIRCLE") => 1,
        _ => u8::MAX,
    }
}

impl Piece for Exodus {
    fn num_points(&self) -> u64 {
        self.num_points as u64
    }

    fn num_cells(&self) -> u64 {
        self.num_cells as u64
    }

    fn arrays(&self) -> &[PieceArray] {
        &self.arrays
    }

    fn points(&self) -> Result<Vec<DVec3>, Problem> {
        let n = self.num_points;
        let [x, y, z] = if self.has("coord") {
            let axis = |axis| self.read("coord", &[axis], n);
            [axis(0)?, axis(1)?, axis(2)?]
        } else {
            [self.read("coordx", &[], n)?, self.read("coordy", &[], n)?, self.read("coordz", &[], n)?]
        };
        Ok(x.into_iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z)).collect())
    }

    fn cells(&self, max_nodes: u64) -> Result<PieceCells, Problem> {
        let mut cells = PieceCells { types: Vec::new(), ends: Vec::new(), nodes: Vec::new() };
        let mut next_end = super::rising_ends(max_nodes);
        let mut node = super::node_below(self.num_points as u64);
        for block in &self.blocks {
            let &Block { number, elements, nodes_each, vtk } = block;
            let variable = format!("connect{number}");
            let count = super::count(elements as u64, nodes_each)?;
            for value in self.read(&variable, &[], count)? {
                // Nodes count from 1; whole numbers of 32 bits are exact.
                cells.nodes.push(node(value as i64 - 1).map_err(|problem| problem.of_array(&variable))?);
            }
            for _ in 0..elements {
                let last = cells.ends.last().copied().unwrap_or(0);
                cells.ends.push(next_end(last.saturating_add(nodes_each) as i64)?);
                cells.types.push(vtk);
            }
        }
        Ok(cells)
    }

    fn values(&self, array: usize) -> Result<Vec<f64>, Problem> {
        let number = self.numbers[array];
        if self.arrays[array].array.place == Place::Points {
            let own = format!("vals_nod_var{}", number + 1);
            return if self.has(&own) {
                self.read(&own, &[self.step], self.num_points)
            } else {
                self.read("vals_nod_var", &[self.step, number], self.num_points)
            };
        }
        let mut values = Vec::new();
        for block in &self.blocks {
            let own = format!("vals_elem_var{}eb{}", number + 1, block.number);
            if self.has(&own) {
                values.extend(self.read(&own, &[self.step], block.elements)?);
            } else {
                // The file says that this block has no such value.
                values.resize(values.len() + block.elements, f64::NAN);
            }
        }
        Ok(values)
    }

    fn varies(&self, array: usize, seen: &mut Vec<f64>) -> Result<bool, Problem> {
        let values = self.values(array)?;
        let mut known = seen.first().copied().into_iter().chain(values).filter(|value| value.is_finite());
        let Some(first) = known.next() else { return Ok(false) };
        *seen = vec![first];
        Ok(known.any(|value| value != first))
    }
}
