//! VTK's XML unstructured grid, `.vtu`: one or several pieces; arrays as in every VTK XML file.

use glam::DVec3;

use super::{GridArray, Part, Piece, PieceArray, PieceCells, Place};
use crate::error::Problem;
use crate::numbers::{Numbers, Scalar};
use crate::vtk_xml::{Document, Element};

/// One `Piece`.
pub(super) struct VtuPiece<'a> {
    document: &'a Document<'a>,
    element: &'a Element<'a>,
    num_points: u64,
    num_cells: u64,
    arrays: Vec<PieceArray>,
    /// The elements of the arrays, and the type of their numbers.
    elements: Vec<(&'a Element<'a>, Scalar)>,
    /// Arrays that hold no numbers, by their names.
    others: Vec<(String, &'a Element<'a>)>,
}

/// Opens the content of a file and runs something on its pieces.
pub(super) fn with_parts<R>(
    bytes: &[u8],
    run: impl FnOnce(&[Part]) -> Result<R, Problem>,
) -> Result<R, Problem> {
    let document = Document::parse(bytes, "UnstructuredGrid")?;
    let pieces = pieces(&document)?.into_iter();
    let parts: Vec<_> = pieces.map(|piece| Part::new(None, piece)).collect();
    run(&parts)
}

/// The pieces of a file, at least one.
pub(super) fn pieces<'a>(document: &'a Document<'a>) -> Result<Vec<VtuPiece<'a>>, Problem> {
    let pieces: Vec<_> =
        document.all("Piece").map(|element| VtuPiece::new(document, element)).collect::<Result<_, _>>()?;
    if pieces.is_empty() {
        return Err(Problem::missing("Piece", "at least one"));
    }
    Ok(pieces)
}

impl<'a> VtuPiece<'a> {
    fn new(document: &'a Document<'a>, element: &'a Element<'a>) -> Result<Self, Problem> {
        let count = |name: &str| {
            element.number(name)?.ok_or_else(|| Problem::missing(name, "a whole number for each piece"))
        };
        let (num_points, num_cells) = (count("NumberOfPoints")?, count("NumberOfCells")?);
        let mut piece = Self {
            document,
            element,
            num_points,
            num_cells,
            arrays: Vec::new(),
            elements: Vec::new(),
            others: Vec::new(),
        };
        for (section, place) in [("PointData", Place::Points), ("CellData", Place::Cells)] {
            for section in document.children(element, section) {
                piece.add_arrays(section, place)?;
            }
        }
        Ok(piece)
    }

    /// Adds the arrays of a section that hold numbers; others, such as strings, are none that could be drawn.
    fn add_arrays(&mut self, section: &'a Element<'a>, place: Place) -> Result<(), Problem> {
        let active = section.attribute("Scalars")?;
        for element in self.document.children(section, "DataArray") {
            let name = element.attribute("Name")?.unwrap_or_default();
            match number_type(element) {
                Ok((scalar, components)) => {
                    let is_active = active.as_deref() == Some(name.as_str());
                    let array = GridArray { name, place, components, scalar: scalar.name() };
                    self.arrays.push(PieceArray { array, is_active });
                    self.elements.push((element, scalar));
                }
                Err(_) => self.others.push((name, element)),
            }
        }
        Ok(())
    }

    /// The array of a name in a section of one piece, such as `offsets` in `Cells`; of any name if none is said.
    fn topology(&self, section: &str, name: Option<&str>) -> Result<&'a Element<'a>, Problem> {
        let section_element = self.document.children(self.element, section).next();
        for array in section_element.into_iter().flat_map(|found| self.document.children(found, "DataArray"))
        {
            if name.is_none() || array.attribute("Name")?.as_deref() == name {
                return Ok(array);
            }
        }
        Err(Problem::missing(name.unwrap_or(section), format!("a DataArray in {section}")))
    }

    fn open(&self, element: &'a Element<'a>, scalar: Scalar, count: usize) -> Result<Numbers<'a>, Problem> {
        // A count that overflows is no length that a file could have.
        let bytes = (count as u64).saturating_mul(scalar.bytes());
        self.document.numbers(element, bytes)
    }

    /// Opens an array of values and runs something on its numbers.
    fn with_numbers<R>(
        &self,
        array: usize,
        run: impl FnOnce(Numbers<'a>, Scalar, usize) -> Result<R, Problem>,
    ) -> Result<R, Problem> {
        let GridArray { name, place, components, .. } = &self.arrays[array].array;
        let tuples = if *place == Place::Points { self.num_points } else { self.num_cells };
        let (element, scalar) = self.elements[array];
        let read = || {
            let count = super::count(tuples, *components)?;
            run(self.open(element, scalar, count)?, scalar, count)
        };
        read().map_err(|problem| problem.of_array(name))
    }

    /// Whole numbers that describe cells.
    fn wholes<U>(
        &self,
        name: &str,
        count: usize,
        convert: impl FnMut(i64) -> Result<U, Problem>,
    ) -> Result<Vec<U>, Problem> {
        let element = self.topology("Cells", Some(name))?;
        let read = || {
            let scalar = element.scalar()?;
            self.open(element, scalar, count)?.wholes(scalar, count, convert)
        };
        read().map_err(|problem| problem.of_array(name))
    }
}

/// The type of an array's numbers, and how many make a value.
fn number_type(element: &Element) -> Result<(Scalar, usize), Problem> {
    let (scalar, components) = (element.scalar()?, element.components()?);
    match usize::try_from(components) {
        Ok(components) if components > 0 => Ok((scalar, components)),
        _ => Err(Problem::field("NumberOfComponents", components, "at least 1")),
    }
}

impl Piece for VtuPiece<'_> {
    fn notes(&self) -> Vec<String> {
        let why = |(name, element): &(String, &Element)| {
            let problem = number_type(element).err()?.of_array(name);
            Some(format!("array left out: {problem}"))
        };
        self.others.iter().filter_map(why).collect()
    }

    fn check_left_out(&self, name: &str) -> Result<(), Problem> {
        match self.others.iter().find(|(own, _)| own == name) {
            Some((name, element)) => {
                number_type(element).map(|_| ()).map_err(|problem| problem.of_array(name))
            }
            None => Ok(()),
        }
    }

    fn num_points(&self) -> u64 {
        self.num_points
    }

    fn num_cells(&self) -> u64 {
        self.num_cells
    }

    fn arrays(&self) -> &[PieceArray] {
        &self.arrays
    }

    fn points(&self) -> Result<Vec<DVec3>, Problem> {
        let element = self.topology("Points", None)?;
        let read = || {
            let components = element.number("NumberOfComponents")?;
            if components != Some(3) {
                let found = components.map_or("missing".to_owned(), |found| found.to_string());
                return Err(Problem::field("NumberOfComponents", found, 3));
            }
            let (scalar, count) = (element.scalar()?, super::count(self.num_points, 3)?);
            let numbers = self.open(element, scalar, count)?.reals(scalar, count)?;
            Ok(numbers.as_chunks::<3>().0.iter().copied().map(DVec3::from_array).collect())
        };
        read().map_err(|problem| problem.of_array("Points"))
    }

    fn cells(&self, max_nodes: u64) -> Result<PieceCells, Problem> {
        let num_cells = super::count(self.num_cells, 1)?;
        let ends = self.wholes("offsets", num_cells, super::rising_ends(max_nodes))?;
        let num_nodes = ends.last().copied().unwrap_or(0);
        let nodes = self.wholes("connectivity", num_nodes, super::node_below(self.num_points))?;
        Ok(PieceCells { types: self.wholes("types", num_cells, super::vtk_type)?, ends, nodes })
    }

    fn values(&self, array: usize) -> Result<Vec<f64>, Problem> {
        self.with_numbers(array, |numbers, scalar, count| numbers.reals(scalar, count))
    }

    fn varies(&self, array: usize, seen: &mut Vec<f64>) -> Result<bool, Problem> {
        let components = self.arrays[array].array.components;
        self.with_numbers(array, |numbers, scalar, count| numbers.vary(scalar, count, components, seen))
    }
}
