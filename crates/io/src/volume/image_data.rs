//! Image data of VTK: arrays on the points or cells of a lattice, in one or several pieces, whatever file they are in.
//!
//! The array read is the one asked for, else the active scalars, else the first; numbers and colours before vectors,
//! points before cells, and what is the same everywhere only where nothing else varies. Cell data become samples at
//! the cell centres. What `vtkGhostType` hides is blank, which makes whole numbers real ones.

use std::path::Path;

use glam::{DMat3, DVec3};
use volery_scene::{Sample, Samples, for_samples};

use super::Decoded;
use crate::bytes::reserve;
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout, checked_spacing};
use crate::numbers::{Numbers, Scalar};
use crate::orientation::Placement;
use crate::raster::{Array, Meaning, Raster, Role};
use crate::volume::ReadOptions;

/// Pieces may lie so far apart that the box around them has so many times their samples.
const MAX_SPARSE: u64 = 16;

/// Bits of `vtkGhostType`: on points hidden; on cells replaced by finer ones or hidden.
const HIDDEN_POINT: u8 = 2;
const HIDDEN_CELL: u8 = 8 | 32;

/// A lattice and what lies on it.
pub(super) struct ImageData<'a> {
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    /// The direction of each axis.
    pub(super) directions: DMat3,
    /// At least one.
    pub(super) pieces: Vec<ImagePiece<'a>>,
}

/// A part of the lattice.
pub(super) struct ImagePiece<'a> {
    /// The first and last point along each axis.
    pub(super) extent: [i64; 6],
    pub(super) arrays: Vec<ImageArray<'a>>,
    /// The file that it is in, if it is not the one asked for.
    pub(super) path: Option<&'a Path>,
}

/// An array of a piece, not read yet.
pub(super) struct ImageArray<'a> {
    pub(super) on_cells: bool,
    pub(super) name: Option<String>,
    pub(super) components: u64,
    /// The type of its numbers, or what is there instead.
    pub(super) scalar: Result<Scalar, String>,
    /// Whether the file names it as the one to show.
    pub(super) is_active: bool,
    pub(super) order: ByteOrder,
    /// Opens the numbers, which take so many bytes in binary form.
    pub(super) open: Box<dyn Fn(u64) -> Result<Numbers<'a>, Problem> + 'a>,
}

/// The lattice points or cells of a box.
#[derive(Clone, Copy)]
struct Region {
    low: [i64; 3],
    dims: [u64; 3],
}

impl Region {
    fn of(extent: [i64; 6], on_cells: bool) -> Result<Self, Problem> {
        let mut region = Self { low: [0; 3], dims: [0; 3] };
        for axis in 0..3 {
            let [low, high] = [extent[2 * axis], extent[2 * axis + 1]];
            let cells = high.checked_sub(low).and_then(|cells| u64::try_from(cells).ok());
            let Some(cells) = cells else {
                return Err(Problem::field("Extent", quoted(format!("{extent:?}")), "rising pairs"));
            };
            region.low[axis] = low;
            // A flat axis has one layer of cells.
            region.dims[axis] = if on_cells { cells.max(1) } else { cells + 1 };
        }
        Ok(region)
    }

    /// Whether all of it is part of another region.
    fn is_in(&self, whole: &Self) -> bool {
        (0..3).all(|axis| {
            let start =
                self.low[axis].checked_sub(whole.low[axis]).and_then(|start| u64::try_from(start).ok());
            start.is_some_and(|start| start.saturating_add(self.dims[axis]) <= whole.dims[axis])
        })
    }

    fn num_samples(&self) -> u64 {
        self.dims.iter().fold(1, |count, &n| count.saturating_mul(n))
    }

    /// The place of this region's sample `(0, y, z)` in another one around it, as it lies in memory.
    fn row_in(&self, whole: &Self, y: usize, z: usize) -> usize {
        let at = |axis: usize, index: usize| (self.low[axis] - whole.low[axis]) as usize + index;
        (at(2, z) * whole.dims[1] as usize + at(1, y)) * whole.dims[0] as usize + at(0, 0)
    }
}

impl<'a> ImageData<'a> {
    pub(super) fn read(&self, options: &ReadOptions) -> Result<Decoded, Problem> {
        let mut notes = Vec::new();
        let chosen = self.choose(options.array.as_deref(), &mut notes)?;
        let (on_cells, name) = (chosen.on_cells, chosen.name.clone());
        let whole = self.whole(on_cells)?;
        if on_cells {
            notes.push("the array lies on cells; its values are samples at the cell centres".to_owned());
        }
        let samples = self.samples(chosen, &whole, options, &mut notes)?;
        let layout = Layout::new("Extent", whole.dims, samples.sample_type(), ByteOrder::NATIVE, options)?;
        let samples = match self.hidden(&whole, on_cells)? {
            Some(hidden) if hidden.contains(&true) => {
                let count = hidden.iter().filter(|hidden| **hidden).count();
                notes.push(format!("{count} samples are hidden by vtkGhostType, and blank"));
                blanked(&samples, &hidden)?
            }
            _ => samples,
        };
        let spacing = checked_spacing("Spacing", self.spacing, layout.dims, options, &mut notes)?;
        let mut decoded = Decoded::new(layout.dims, spacing, samples, notes);
        decoded.placement = Some(self.placement(&whole, on_cells));
        decoded.array = name;
        decoded.choices.channels = chosen.components;
        Ok(decoded)
    }

    /// The box around all pieces.
    fn whole(&self, on_cells: bool) -> Result<Region, Problem> {
        let mut around = self.pieces[0].extent;
        for piece in &self.pieces {
            for axis in 0..3 {
                around[2 * axis] = around[2 * axis].min(piece.extent[2 * axis]);
                around[2 * axis + 1] = around[2 * axis + 1].max(piece.extent[2 * axis + 1]);
            }
            Region::of(piece.extent, on_cells)?;
        }
        Region::of(around, on_cells)
    }

    fn placement(&self, whole: &Region, on_cells: bool) -> Placement {
        let axes = self.directions * DMat3::from_diagonal(DVec3::from_array(self.spacing));
        // Along a flat axis the samples of cells lie in the plane of its points.
        let half = |axis: usize| if on_cells && whole.dims[axis] > 1 { 0.5 } else { 0.0 };
        let first = DVec3::from_array([0, 1, 2].map(|axis| whole.low[axis] as f64 + half(axis)));
        Placement::plain(axes, DVec3::from_array(self.origin) + axes * first)
    }

    /// The array to read, as the first piece has it.
    fn choose(&self, wanted: Option<&str>, notes: &mut Vec<String>) -> Result<&ImageArray<'a>, Problem> {
        let arrays = &self.pieces[0].arrays;
        let offered = || arrays.iter().filter(|array| !array.is_ghost());
        if let Some(name) = wanted {
            let named =
                |on_cells| offered().find(|a| a.on_cells == on_cells && a.name.as_deref() == Some(name));
            return named(false).or_else(|| named(true)).ok_or_else(|| {
                let names: Vec<_> = offered().filter_map(|array| array.name.as_deref()).collect();
                Problem::field("array", quoted(name), format!("one of {}", quoted(names.join(", "))))
            });
        }
        let mut candidates: Vec<_> = offered().filter(|array| array.scalar.is_ok()).collect();
        // Stable, so that the order of the file decides last.
        candidates.sort_by_key(|array| (!array.is_simple(), array.on_cells, !array.is_active));
        let first = candidates.first().copied().or_else(|| offered().next());
        let first = first.ok_or_else(|| Problem::missing("DataArray", "one in PointData or CellData"))?;
        let mut skipped = Vec::new();
        for &array in candidates.iter().filter(|_| candidates.len() > 1) {
            match self.varies(array) {
                Ok(false) => skipped.push(format!("array {} is the same everywhere", array.quoted_name())),
                // What the file shows must be read, or its fault be said.
                Err(problem) if !array.is_active => {
                    skipped.push(format!("array {} cannot be read: {problem}", array.quoted_name()));
                }
                _ => {
                    notes.extend(skipped.iter().map(|why| format!("{why}; {} is used", array.quoted_name())));
                    return Ok(array);
                }
            }
        }
        Ok(first)
    }

    /// Whether an array has two values that differ.
    fn varies(&self, array: &ImageArray) -> Result<bool, Problem> {
        let mut seen = Vec::new();
        for piece in &self.pieces {
            let dims = Region::of(piece.extent, array.on_cells)?.dims;
            let count = dims.iter().try_fold(array.components, |count, &n| count.checked_mul(n));
            let own = piece.same(array)?;
            let scalar = own.known_scalar()?;
            let bytes = count.and_then(|count| count.checked_mul(scalar.bytes()));
            let count = bytes.and_then(|bytes| usize::try_from(bytes / scalar.bytes()).ok());
            let (bytes, count) =
                bytes.zip(count).ok_or_else(|| Problem::field("Extent", "too large", "less"))?;
            if (own.open)(bytes)?.vary(scalar, count, array.components as usize, &mut seen)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The samples of all pieces; what no piece has is blank.
    fn samples(
        &self,
        array: &ImageArray,
        whole: &Region,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        if let [piece] = &self.pieces[..] {
            return piece.samples(piece.same(array)?, options, notes);
        }
        // The pieces are of other sizes than the whole that the caller expects; their sum must be within the limit.
        let of_pieces = ReadOptions { dims: None, ..options.clone() };
        let num_samples = |samples: &Samples| {
            let layout =
                Layout::new("Extent", whole.dims, samples.sample_type(), ByteOrder::NATIVE, &of_pieces);
            layout.map(|layout| layout.num_samples())
        };
        let mut joined: Option<Samples> = None;
        let mut is_missing = Vec::new();
        let parts = self.parts(whole, array.on_cells)?;
        let of_parts = parts.iter().fold(0, |sum: u64, (_, region)| sum.saturating_add(region.num_samples()));
        if whole.num_samples() / MAX_SPARSE > of_parts {
            let expected = format!("at most {MAX_SPARSE} times the {of_parts} samples of all pieces");
            return Err(Problem::field(
                "samples in the box around the pieces",
                whole.num_samples(),
                expected,
            ));
        }
        for (index, (piece, region)) in parts.into_iter().enumerate() {
            let mut own_notes = Vec::new();
            let mut read = || piece.samples(piece.same(array)?, &of_pieces, &mut own_notes);
            let own = read().map_err(|problem| piece.named(problem))?;
            if index == 0 {
                reserve(&mut is_missing, num_samples(&own)?)?;
                is_missing.resize(num_samples(&own)?, true);
                notes.append(&mut own_notes);
            }
            joined = Some(place(joined, &own, &region, whole, &mut is_missing).map_err(|p| piece.named(p))?);
        }
        let joined = joined.ok_or_else(|| Problem::missing("Piece", "at least one"))?;
        let missing = is_missing.iter().filter(|missing| **missing).count();
        if missing == 0 {
            return Ok(joined);
        }
        notes.push(format!("{missing} samples are in no piece, and blank"));
        blanked(&joined, &is_missing)
    }

    /// The pieces that have samples of the whole, and where; a flat one has no cells where the whole is not flat.
    fn parts(&self, whole: &Region, on_cells: bool) -> Result<Vec<(&ImagePiece<'a>, Region)>, Problem> {
        let mut parts = Vec::new();
        for piece in &self.pieces {
            let region = Region::of(piece.extent, on_cells)?;
            if region.is_in(whole) {
                parts.push((piece, region));
            }
        }
        Ok(parts)
    }

    /// For each sample whether it is hidden; `None` if no piece says so.
    fn hidden(&self, whole: &Region, on_cells: bool) -> Result<Option<Vec<bool>>, Problem> {
        let is_ghost =
            |array: &&ImageArray| array.is_ghost() && array.scalar.is_ok() && array.components == 1;
        if !self.pieces.iter().any(|piece| piece.arrays.iter().any(|array| is_ghost(&array))) {
            return Ok(None);
        }
        // As many as the samples, whose number has been checked.
        let count = whole.dims.iter().product::<u64>() as usize;
        let mut hidden = Vec::new();
        reserve(&mut hidden, count)?;
        hidden.resize(count, false);
        for (piece, own) in self.parts(whole, on_cells)? {
            for array in piece.arrays.iter().filter(is_ghost) {
                let region = Region::of(piece.extent, array.on_cells)?;
                let mask = if array.on_cells { HIDDEN_CELL } else { HIDDEN_POINT };
                let bits = piece.samples(array, &ReadOptions::default(), &mut Vec::new());
                let bits = bits.map_err(|problem| piece.named(problem.of_array("vtkGhostType")))?;
                let hides = |index: usize| bits.value(index, 0) as u8 & mask != 0;
                let mut hide = |index: [usize; 3]| {
                    let place = own.row_in(whole, index[1], index[2]) + index[0];
                    hidden[place] = true;
                };
                match (array.on_cells, on_cells) {
                    (true, false) => hide_corners(&region, &own, hides, &mut hide),
                    (false, true) => for_each(&own, |cell| {
                        if corners(cell, &region).any(|point| hides(flat(point, &region))) {
                            hide(cell);
                        }
                    }),
                    _ => for_each(&own, |index| {
                        if hides(flat(index, &region)) {
                            hide(index);
                        }
                    }),
                }
            }
        }
        Ok(Some(hidden))
    }
}

/// Hides points so that no hidden cell is drawn: those that belong to hidden cells alone, and all corners of a hidden
/// cell that has none of these.
fn hide_corners(
    cells: &Region,
    points: &Region,
    hides: impl Fn(usize) -> bool,
    hide: &mut impl FnMut([usize; 3]),
) {
    let around = |point: [usize; 3]| {
        let axis = move |axis: usize| {
            let high = point[axis].min(cells.dims[axis] as usize - 1);
            point[axis].saturating_sub(1).min(high)..=high
        };
        axis(2).flat_map(move |z| axis(1).flat_map(move |y| axis(0).map(move |x| [x, y, z])))
    };
    let is_alone = |point: [usize; 3]| around(point).all(|cell| hides(flat(cell, cells)));
    for_each(points, |point| {
        if is_alone(point) {
            hide(point);
        }
    });
    for_each(cells, |cell| {
        if hides(flat(cell, cells)) && !corners(cell, points).any(is_alone) {
            corners(cell, points).for_each(&mut *hide);
        }
    });
}

/// The corners of a cell; along a flat axis there is one layer of points.
fn corners(cell: [usize; 3], points: &Region) -> impl Iterator<Item = [usize; 3]> {
    let last = points.dims.map(|n| n as usize - 1);
    (0..8).map(move |corner| [0, 1, 2].map(|axis| (cell[axis] + (corner >> axis & 1)).min(last[axis])))
}

fn flat([x, y, z]: [usize; 3], region: &Region) -> usize {
    let [width, height, _] = region.dims.map(|n| n as usize);
    (z * height + y) * width + x
}

fn for_each(region: &Region, mut run: impl FnMut([usize; 3])) {
    let [width, height, depth] = region.dims.map(|n| n as usize);
    for z in 0..depth {
        for y in 0..height {
            (0..width).for_each(|x| run([x, y, z]));
        }
    }
}

/// Puts the samples of a piece into those of all.
fn place(
    joined: Option<Samples>,
    own: &Samples,
    region: &Region,
    whole: &Region,
    is_missing: &mut [bool],
) -> Result<Samples, Problem> {
    fn copy<T: Sample>(
        joined: Option<&[T]>,
        own: &[T],
        region: &Region,
        whole: &Region,
        is_missing: &mut [bool],
    ) -> Result<Vec<T>, Problem> {
        let mut all = Vec::new();
        reserve(&mut all, is_missing.len())?;
        match joined {
            Some(joined) => all.extend_from_slice(joined),
            None => all.resize(is_missing.len(), T::default()),
        }
        let [width, height, _] = region.dims.map(|n| n as usize);
        for (row, values) in own.chunks_exact(width).enumerate() {
            let start = region.row_in(whole, row % height, row / height);
            all[start..start + width].copy_from_slice(values);
            is_missing[start..start + width].fill(false);
        }
        Ok(all)
    }
    macro_rules! same {
        ($($name:ident),*) => {
            match (joined, own) {
                $(
                    (None, Samples::$name(own)) => copy(None, own, region, whole, is_missing)?.into(),
                    (Some(Samples::$name(joined)), Samples::$name(own)) => {
                        copy(Some(&joined), own, region, whole, is_missing)?.into()
                    }
                )*
                (Some(joined), own) => {
                    let expected = format!("{} as in the first piece", joined.sample_type());
                    return Err(Problem::field("type of DataArray", own.sample_type(), expected));
                }
            }
        };
    }
    Ok(same!(U8, I8, U16, I16, U32, I32, F32, F64, Rgb8, Rgba8))
}

/// The same samples as real numbers, some of them blank. Colours lose their light in place of that.
fn blanked(samples: &Samples, blank: &[bool]) -> Result<Samples, Problem> {
    fn convert<S: Sample, T>(
        samples: &[S],
        blank: &[bool],
        of: impl Fn(S, bool) -> T,
    ) -> Result<Vec<T>, Problem> {
        let mut values = Vec::new();
        reserve(&mut values, samples.len())?;
        values.extend(samples.iter().zip(blank).map(|(&sample, &blank)| of(sample, blank)));
        Ok(values)
    }
    fn single<S: Sample>(sample: S, blank: bool) -> f32 {
        if blank { f32::NAN } else { sample.channel(0) as f32 }
    }
    fn double<S: Sample>(sample: S, blank: bool) -> f64 {
        if blank { f64::NAN } else { sample.channel(0) }
    }
    Ok(match samples {
        Samples::Rgb8(colors) => {
            convert(colors, blank, |[r, g, b], blank| if blank { [0; 4] } else { [r, g, b, 255] })?.into()
        }
        Samples::Rgba8(colors) => {
            convert(colors, blank, |color, blank| if blank { [0; 4] } else { color })?.into()
        }
        Samples::U32(values) => convert(values, blank, double)?.into(),
        Samples::I32(values) => convert(values, blank, double)?.into(),
        Samples::F64(values) => convert(values, blank, double)?.into(),
        others => for_samples!(others, |values| convert(values, blank, single)?).into(),
    })
}

impl<'a> ImagePiece<'a> {
    /// What this piece has of an array of the first one.
    fn same(&self, array: &ImageArray) -> Result<&ImageArray<'a>, Problem> {
        let key = |array: &ImageArray| (array.on_cells, array.name.clone(), array.components);
        let found = self.arrays.iter().find(|own| key(own) == key(array));
        found.ok_or_else(|| {
            let expected = "one as in the first piece";
            self.named(Problem::missing(format!("array {}", array.quoted_name()), expected))
        })
    }

    fn named(&self, problem: Problem) -> Problem {
        match self.path {
            Some(path) => problem.of_part(path),
            None => problem,
        }
    }

    fn samples(
        &self,
        array: &ImageArray,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let region = Region::of(self.extent, array.on_cells)?;
        let mut axes = vec![(array.components, Role::Channel)];
        axes.extend(region.dims.map(|size| (size, Role::Space)));
        let (scalar, order) = (array.known_scalar()?, array.order);
        let lattice = Array { field: "Extent", axes, scalar, order, meaning: Meaning::Components };
        let raster: Raster = lattice.plan(options, notes)?;
        raster.in_numbers((array.open)(raster.array_bytes())?, notes)
    }
}

impl ImageArray<'_> {
    fn is_ghost(&self) -> bool {
        self.name.as_deref() == Some("vtkGhostType")
    }

    /// Whether a value is a number or a colour.
    fn is_simple(&self) -> bool {
        self.components == 1 || (self.scalar == Ok(Scalar::U8) && matches!(self.components, 3 | 4))
    }

    fn known_scalar(&self) -> Result<Scalar, Problem> {
        let unknown =
            |found: &String| Problem::field("type of DataArray", quoted(found), "an integer or a float");
        self.scalar.as_ref().copied().map_err(unknown)
    }

    fn quoted_name(&self) -> String {
        quoted(self.name.as_deref().unwrap_or_default())
    }
}
