//! What an unstructured grid is, without drawing it.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::Serialize;
use volery_io::grid::{ArrayRange, GridArray, read_array_ranges};
use volery_io::{GridFile, GridOptions, ReadError, read_grid};
use volery_scene::CellType;

use super::{Choices, number};

/// What a grid file holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GridInfo {
    /// `grid`.
    pub kind: &'static str,
    /// Name of the format.
    pub format: String,
    /// Number of points, those that no cell uses among them.
    pub points: usize,
    /// Cells of each type that occurs.
    pub cells: BTreeMap<&'static str, usize>,
    /// Cells of them that hold no matter.
    pub blank_cells: usize,
    /// Smallest and largest corner of the points that cells use; missing if every cell is blank.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Every array of the file.
    pub arrays: Vec<ArrayInfo>,
    /// Name of the array that is drawn unless another one is asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Which of several is drawn, where there are several.
    #[serde(skip_serializing_if = "Choices::is_empty")]
    pub choices: Choices,
    /// What is wrong with cells, by fault and type.
    pub defects: Vec<DefectInfo>,
    /// What the reader decided, a sentence each.
    pub notes: Vec<String>,
}

/// An array of a grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArrayInfo {
    /// Its name.
    pub name: String,
    /// `points` or `cells`.
    pub place: String,
    /// Numbers for each point or cell.
    pub components: usize,
    /// Type of a number: `f32`, `i64`, ...
    pub scalar: &'static str,
    /// Which of several components the range is of; missing for their magnitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// Smallest and largest finite value; missing if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Values that are NaN or infinite.
    pub blank: u64,
    /// Why its values cannot be read, if they cannot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}

/// One kind of defect on cells of one type.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DefectInfo {
    /// What is wrong: `zero volume`, `inverted`, ...
    pub fault: &'static str,
    /// The type of the cells.
    pub cell_type: &'static str,
    /// Cells that have it.
    pub cells: usize,
    /// How often it occurs on them: a cell may have several faces that are not planar.
    pub count: usize,
    /// The first cell that has it.
    pub first_cell: usize,
}

impl GridInfo {
    /// Reads a grid and looks at every array and every cell.
    ///
    /// # Errors
    /// When the file cannot be read as a grid.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let options = GridOptions::default();
        Self::of(path, read_grid(path, &options)?, &options)
    }

    /// Looks at every array of a file and every cell of the grid that was read from it by these options.
    ///
    /// # Errors
    /// When an array of the file cannot be read.
    pub fn of(path: &Path, file: GridFile, options: &GridOptions) -> Result<Self, ReadError> {
        let arrays = read_array_ranges(path, options)?.into_iter().map(ArrayInfo::from);
        let grid = &file.grid;
        let cells = CellType::ALL.iter().zip(grid.cells().count_by_type());
        let cells = cells.filter(|(_, count)| *count > 0).map(|(cell_type, count)| (cell_type.name(), count));
        Ok(Self {
            kind: "grid",
            format: file.format.to_string(),
            points: grid.points().len(),
            cells: cells.collect(),
            blank_cells: (0..grid.cells().len()).filter(|&cell| grid.is_blank(cell)).count(),
            bounds: grid.world_bounds().map(|bounds| bounds.map(|corner| corner.to_array())),
            arrays: arrays.collect(),
            array: file.array.map(|array| array.name),
            choices: file.choices.into(),
            defects: defects(grid),
            notes: file.notes,
        })
    }
}

/// Counts the defects of cells, in the order of faults and types.
fn defects(grid: &volery_scene::UnstructuredGrid) -> Vec<DefectInfo> {
    let mut found: BTreeMap<(&str, &str), DefectInfo> = BTreeMap::new();
    // By fault and type the last cell seen, so that a cell is counted once.
    let mut last: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for defect in grid.defects() {
        let (fault, cell_type) = (defect.fault.name(), defect.cell_type.name());
        let first_cell = defect.cell;
        let new = DefectInfo { fault, cell_type, cells: 0, count: 0, first_cell };
        let info = found.entry((fault, cell_type)).or_insert(new);
        info.count += 1;
        info.cells += usize::from(last.insert((fault, cell_type), defect.cell) != Some(defect.cell));
    }
    found.into_values().collect()
}

impl From<ArrayRange> for ArrayInfo {
    fn from(ArrayRange { array, channel, range, blank, problem }: ArrayRange) -> Self {
        let GridArray { name, place, components, scalar } = array;
        Self { name, place: place.to_string(), components, scalar, channel, range, blank, problem }
    }
}

/// A few lines for people.
impl fmt::Display for GridInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "kind      {}, {}", self.kind, self.format)?;
        writeln!(f, "points    {}", self.points)?;
        for (name, count) in &self.cells {
            writeln!(f, "cells     {count} {name}")?;
        }
        if self.blank_cells > 0 {
            writeln!(f, "blank     {} cells", self.blank_cells)?;
        }
        if let Some([low, high]) = self.bounds {
            let [low, high] = [low, high].map(|corner| corner.map(number).join(", "));
            writeln!(f, "bounds    {low} to {high}")?;
        }
        for array in &self.arrays {
            write!(f, "array     {} on {}: ", array.name.escape_debug(), array.place)?;
            if array.components > 1 {
                write!(f, "{} x ", array.components)?;
            }
            write!(f, "{}", array.scalar)?;
            match (array.range, &array.problem) {
                (_, Some(problem)) => write!(f, ", cannot be read: {problem}")?,
                (Some([low, high]), None) => {
                    let what = match array.channel {
                        Some(channel) => format!("channel {channel} "),
                        None if array.components > 1 => "magnitude ".to_owned(),
                        None => String::new(),
                    };
                    write!(f, ", {what}{} to {}", number(low), number(high))?;
                }
                (None, None) => write!(f, ", no finite value")?,
            }
            if array.blank > 0 {
                write!(f, ", {} blank", array.blank)?;
            }
            writeln!(f, "{}", if self.array.as_ref() == Some(&array.name) { " (drawn)" } else { "" })?;
        }
        write!(f, "{}", self.choices)?;
        for DefectInfo { fault, cell_type, cells, count, first_cell } in &self.defects {
            let times = if count > cells { format!(", {count} times") } else { String::new() };
            writeln!(f, "defect    {fault}: {cells} {cell_type}{times}, first cell {first_cell}")?;
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note      {note}"))
    }
}
