//! VTK's legacy format, `.vtk`: unstructured grids, and the arrays of structured points, in text or in big endian bytes, cells as one list of counts
//! and nodes or, from version 5, as offsets and connectivity.

use glam::DVec3;

use super::{GridArray, Part, Piece, PieceArray, PieceCells, Place};
use crate::error::{Problem, quoted};
use crate::numbers::Scalar;

mod scan;

pub(crate) use scan::Block;
use scan::{BlockType, Scanner};

/// The kinds of data set that are read.
const GRID_DATASET: &str = "UNSTRUCTURED_GRID";
pub(crate) const POINTS_DATASET: &str = "STRUCTURED_POINTS";

/// Where everything lies in a file.
#[derive(Default)]
pub(crate) struct Legacy<'a> {
    /// The lattice of structured points.
    pub(crate) lattice: Lattice,
    points: Option<Block<'a>>,
    cells: Option<CellBlocks<'a>>,
    types: Option<Block<'a>>,
    arrays: Vec<PieceArray>,
    blocks: Vec<Block<'a>>,
    num_points: usize,
    num_cells: usize,
}

/// Points in rows and columns.
pub(crate) struct Lattice {
    pub(crate) dims: Option<[usize; 3]>,
    pub(crate) spacing: [f64; 3],
    pub(crate) origin: [f64; 3],
}

impl Default for Lattice {
    fn default() -> Self {
        Self { dims: None, spacing: [1.0; 3], origin: [0.0; 3] }
    }
}

enum CellBlocks<'a> {
    /// For each cell the number of its nodes and then these.
    Mixed(Block<'a>),
    /// Where cells start and end, and the nodes.
    Split { offsets: Block<'a>, connectivity: Block<'a> },
}

/// Opens the content of a file and runs something on it.
pub(super) fn with_parts<R>(
    bytes: &[u8],
    run: impl FnOnce(&[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    let legacy = Legacy::parse(bytes, GRID_DATASET)?;
    run(&[Part::new(None, legacy)])
}

impl<'a> Legacy<'a> {
    /// Finds everything in a file of one kind of data set.
    pub(crate) fn parse(bytes: &'a [u8], dataset: &str) -> Result<Self, Problem> {
        let mut scanner = Scanner::new(bytes);
        if !scanner.line().starts_with(b"# vtk DataFile Version") {
            return Err(Problem::missing("first line", "'# vtk DataFile Version'"));
        }
        let _title = scanner.line();
        let form = scanner.expect("form")?;
        scanner.is_binary = match form.to_ascii_uppercase().as_str() {
            "ASCII" => false,
            "BINARY" => true,
            _ => return Err(Problem::field("form", quoted(form), "ASCII or BINARY")),
        };
        let mut legacy = Self::default();
        let mut place = None;
        let mut has_dataset = false;
        while let Some(word) = scanner.word()? {
            let keyword = word.to_ascii_uppercase();
            match keyword.as_str() {
                "DATASET" => {
                    let found = scanner.expect("DATASET")?;
                    if !found.eq_ignore_ascii_case(dataset) {
                        return Err(Problem::field("DATASET", quoted(found), dataset));
                    }
                    has_dataset = true;
                }
                "POINT_DATA" | "CELL_DATA" => {
                    let points = keyword == "POINT_DATA";
                    let expected = if points { legacy.num_points } else { legacy.num_cells };
                    let found = scanner.count(&keyword)?;
                    if found != expected {
                        return Err(Problem::field(keyword, found, expected));
                    }
                    place = Some(if points { Place::Points } else { Place::Cells });
                }
                "METADATA" => scanner.skip_metadata(),
                "DIMENSIONS" | "SPACING" | "ASPECT_RATIO" | "ORIGIN" if dataset == POINTS_DATASET => {
                    legacy.lattice(&keyword, &mut scanner)?;
                }
                "POINTS" | "CELLS" | "CELL_TYPES" => legacy.geometry(&keyword, &mut scanner)?,
                "FIELD" => legacy.fields(place, &mut scanner)?,
                _ => legacy.attribute(&keyword, place, &mut scanner)?,
            }
        }
        if !has_dataset {
            return Err(Problem::missing("DATASET", dataset));
        }
        Ok(legacy)
    }

    /// The arrays, each with its numbers.
    pub(crate) fn arrays_and_blocks(&self) -> impl Iterator<Item = (&PieceArray, Block<'a>)> {
        self.arrays.iter().zip(self.blocks.iter().copied())
    }

    fn lattice(&mut self, keyword: &str, scanner: &mut Scanner<'a>) -> Result<(), Problem> {
        if keyword != "DIMENSIONS" {
            let list = if keyword == "ORIGIN" { &mut self.lattice.origin } else { &mut self.lattice.spacing };
            for number in list {
                *number = scanner.number(keyword)?;
            }
            return Ok(());
        }
        let mut dims = [0; 3];
        for size in &mut dims {
            *size = scanner.count(keyword)?;
        }
        let shown = || quoted(dims.map(|n| n.to_string()).join(" "));
        let product =
            |each: fn(usize) -> usize| dims.iter().try_fold(1_usize, |all, &n| all.checked_mul(each(n)));
        let num_points = product(|n| n).filter(|&points| points > 0 && points <= isize::MAX as usize);
        self.num_points = num_points.ok_or_else(|| {
            Problem::field(keyword, shown(), "at least 1 sample along each axis, that can be addressed")
        })?;
        // A flat axis has one layer of cells.
        self.num_cells = product(|n| (n - 1).max(1)).unwrap_or(0);
        self.lattice.dims = Some(dims);
        Ok(())
    }

    fn geometry(&mut self, keyword: &str, scanner: &mut Scanner<'a>) -> Result<(), Problem> {
        let count = scanner.count(keyword)?;
        let int = BlockType::Number(Scalar::I32);
        match keyword {
            "POINTS" => {
                let block_type = BlockType::parse(scanner.expect("type of POINTS")?)?;
                self.points =
                    scanner.block(block_type, count, 3).map_err(|problem| problem.of_array(keyword))?;
                self.num_points = count;
            }
            "CELL_TYPES" => {
                self.types = scanner.block(int, count, 1).map_err(|problem| problem.of_array(keyword))?;
            }
            _ => {
                let size = scanner.count("size of CELLS")?;
                let (cells, num_cells) =
                    cell_blocks(count, size, scanner).map_err(|problem| problem.of_array(keyword))?;
                (self.cells, self.num_cells) = (cells, num_cells);
            }
        }
        Ok(())
    }

    /// The arrays of a `FIELD`; outside the data of points and cells they are passed only.
    fn fields(&mut self, place: Option<Place>, scanner: &mut Scanner<'a>) -> Result<(), Problem> {
        scanner.expect("name of FIELD")?;
        let mut left = scanner.count("number of arrays in FIELD")?;
        while left > 0 {
            let name = scanner.expect("name of an array in FIELD")?;
            if name.eq_ignore_ascii_case("METADATA") {
                scanner.skip_metadata();
                continue;
            }
            left -= 1;
            if name == "NULL_ARRAY" {
                continue;
            }
            let components = scanner.count("components of an array in FIELD")?;
            let tuples = scanner.count("tuples of an array in FIELD")?;
            let block_type = BlockType::parse(scanner.expect("type of an array in FIELD")?)?;
            self.array(name, place, block_type, [tuples, components], scanner)?;
        }
        Ok(())
    }

    /// One attribute of points or cells by its keyword.
    fn attribute(
        &mut self,
        keyword: &str,
        place: Option<Place>,
        scanner: &mut Scanner<'a>,
    ) -> Result<(), Problem> {
        let known = "POINTS, CELLS, CELL_TYPES, POINT_DATA, CELL_DATA, FIELD, SCALARS, VECTORS or the like";
        let unknown = || Problem::field("keyword", quoted(keyword), known);
        let tuples = match place {
            _ if keyword == "LOOKUP_TABLE" => 0,
            Some(Place::Points) => self.num_points,
            Some(Place::Cells) => self.num_cells,
            None => return Err(unknown()),
        };
        // Colours are bytes or, in text, numbers from 0 to 1.
        let color = BlockType::Number(if scanner.is_binary { Scalar::U8 } else { Scalar::F32 });
        let components = match keyword {
            "VECTORS" | "NORMALS" => 3,
            "TENSORS" => 9,
            "TENSORS6" => 6,
            "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" | "SCALARS" => 1,
            "TEXTURE_COORDINATES" | "COLOR_SCALARS" | "LOOKUP_TABLE" => 0,
            _ => return Err(unknown()),
        };
        let name = scanner.expect(keyword)?;
        let components = if components > 0 { components } else { scanner.count(keyword)? };
        let (block_type, components) = match keyword {
            "LOOKUP_TABLE" => {
                // A table of colours: `components` is its size.
                scanner.block(color, components, 4)?;
                return Ok(());
            }
            "COLOR_SCALARS" => (color, components),
            "SCALARS" => scalars_header(scanner)?,
            _ => (BlockType::parse(scanner.expect(keyword)?)?, components),
        };
        self.array(name, place, block_type, [tuples, components], scanner)
    }

    fn array(
        &mut self,
        name: &str,
        place: Option<Place>,
        block_type: BlockType,
        [tuples, components]: [usize; 2],
        scanner: &mut Scanner<'a>,
    ) -> Result<(), Problem> {
        let name = decoded(name);
        let block =
            scanner.block(block_type, tuples, components).map_err(|problem| problem.of_array(&name))?;
        let (Some(block), Some(place)) = (block, place) else { return Ok(()) };
        let expected = if place == Place::Points { self.num_points } else { self.num_cells };
        if tuples != expected || components == 0 {
            let expected = format!("{expected} tuples of at least 1");
            return Err(
                Problem::field("array", format!("{tuples} tuples of {components}"), expected).of_array(name)
            );
        }
        let array = GridArray { name, place, components, scalar: block.scalar.name() };
        self.arrays.push(PieceArray { array, is_active: false });
        self.blocks.push(block);
        Ok(())
    }
}

/// Type and components after the name of `SCALARS`, and the line after it.
fn scalars_header(scanner: &mut Scanner) -> Result<(BlockType, usize), Problem> {
    let block_type = BlockType::parse(scanner.expect("type of SCALARS")?)?;
    let components = String::from_utf8_lossy(scanner.line()).into_owned();
    let components = match components.as_str() {
        "" => 1,
        text => text.parse().map_err(|_| Problem::field("components of SCALARS", quoted(text), "1 to 4"))?,
    };
    let table = scanner.expect("LOOKUP_TABLE")?;
    if !table.eq_ignore_ascii_case("LOOKUP_TABLE") {
        return Err(Problem::field("word after SCALARS", quoted(table), "LOOKUP_TABLE"));
    }
    scanner.expect("name of LOOKUP_TABLE")?;
    Ok((block_type, components))
}

/// The cells after `CELLS count size`, and how many they are.
fn cell_blocks<'a>(
    count: usize,
    size: usize,
    scanner: &mut Scanner<'a>,
) -> Result<(Option<CellBlocks<'a>>, usize), Problem> {
    if !scanner.is_next(b"OFFSETS") {
        let block = scanner.block(BlockType::Number(Scalar::I32), size, 1)?;
        return Ok((block.map(CellBlocks::Mixed), count));
    }
    let mut list = |name: &str, length| {
        let found = scanner.expect(name)?;
        if found != name {
            return Err(Problem::field("list of cells", quoted(found), name));
        }
        let block_type = BlockType::parse(scanner.expect("type of a list")?)?;
        scanner.block(block_type, length, 1).map_err(|problem| problem.of_array(name))
    };
    let (offsets, connectivity) = (list("OFFSETS", count)?, list("CONNECTIVITY", size)?);
    let (Some(offsets), Some(connectivity)) = (offsets, connectivity) else {
        return Err(Problem::field("type of a list", "bit or string", "int or vtktypeint64"));
    };
    Ok((Some(CellBlocks::Split { offsets, connectivity }), count.saturating_sub(1)))
}

/// A name without its escapes of `%` and two digits.
fn decoded(name: &str) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        let digits = after.get(..2).and_then(|digits| std::str::from_utf8(digits).ok());
        match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()).filter(|_| byte == b'%') {
            Some(escaped) => {
                bytes.push(escaped);
                rest = &after[2..];
            }
            None => {
                bytes.push(byte);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

impl CellBlocks<'_> {
    /// Ends and nodes of the cells.
    fn read(
        &self,
        num_points: u64,
        num_cells: usize,
        max_nodes: u64,
    ) -> Result<(Vec<usize>, Vec<u32>), Problem> {
        let mut end = super::rising_ends(max_nodes);
        let mut node = super::node_below(num_points);
        let (mut ends, mut nodes) = (Vec::new(), Vec::new());
        match self {
            Self::Mixed(block) => {
                let mut left = 0;
                block.numbers()?.visit_wholes(block.scalar, block.count, |value| {
                    if left > 0 {
                        left -= 1;
                        nodes.push(node(value)?);
                    } else {
                        left = usize::try_from(value).map_err(|_| {
                            Problem::field(
                                format!("number of nodes of cell {}", ends.len()),
                                value,
                                "0 or more",
                            )
                        })?;
                        ends.push(end(value.saturating_add(nodes.len() as i64))?);
                    }
                    Ok(())
                })?;
                if left > 0 || ends.len() != num_cells {
                    let found = format!("{} cells, {left} nodes short", ends.len());
                    return Err(Problem::field("list of cells", found, format!("{num_cells} whole cells")));
                }
            }
            Self::Split { offsets, connectivity } => {
                let mut read = offsets.numbers()?.wholes(offsets.scalar, offsets.count, end)?.into_iter();
                let first = read.next();
                if first.is_some_and(|first| first != 0) {
                    return Err(Problem::field("first offset", first.unwrap_or(0), 0));
                }
                ends = read.collect();
                let last = ends.last().copied().unwrap_or(0);
                if last != connectivity.count {
                    return Err(Problem::field("last offset", last, connectivity.count));
                }
                nodes = connectivity.numbers()?.wholes(connectivity.scalar, connectivity.count, node)?;
            }
        }
        Ok((ends, nodes))
    }
}

impl Piece for Legacy<'_> {
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
        let block = self.points.ok_or_else(|| Problem::missing("POINTS", "one list"))?;
        let read = || block.numbers()?.reals(block.scalar, block.count);
        let numbers = read().map_err(|problem: Problem| problem.of_array("POINTS"))?;
        Ok(numbers.as_chunks::<3>().0.iter().copied().map(DVec3::from_array).collect())
    }

    fn cells(&self, max_nodes: u64) -> Result<PieceCells, Problem> {
        let cells = self.cells.as_ref().ok_or_else(|| Problem::missing("CELLS", "one list"))?;
        let read = cells.read(self.num_points as u64, self.num_cells, max_nodes);
        let (ends, nodes) = read.map_err(|problem| problem.of_array("CELLS"))?;
        let types = self.types.ok_or_else(|| Problem::missing("CELL_TYPES", "one list"))?;
        if types.count != self.num_cells {
            return Err(Problem::field("CELL_TYPES", types.count, self.num_cells));
        }
        let read = || types.numbers()?.wholes(types.scalar, types.count, super::vtk_type);
        let types = read().map_err(|problem: Problem| problem.of_array("CELL_TYPES"))?;
        Ok(PieceCells { types, ends, nodes })
    }

    fn values(&self, array: usize) -> Result<Vec<f64>, Problem> {
        let block = self.blocks[array];
        let read = || block.numbers()?.reals(block.scalar, block.count);
        read().map_err(|problem: Problem| problem.of_array(&self.arrays[array].array.name))
    }

    fn varies(&self, array: usize, seen: &mut Vec<f64>) -> Result<bool, Problem> {
        let (block, array) = (self.blocks[array], &self.arrays[array].array);
        let mut read = || block.numbers()?.vary(block.scalar, block.count, array.components, seen);
        read().map_err(|problem: Problem| problem.of_array(&array.name))
    }
}
