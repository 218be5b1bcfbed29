//! Slices through matter, each standing for a slab of it (Benölken and Graf 2005), drawn one over another.
//!
//! # Method
//! A *sheet* is a set of triangles with values at their vertices, which stands for matter of some thickness along the
//! normal that all sheets of a frame share. A ray that meets it at the angle whose cosine with the normal is `c`
//! passes `t / |c|` of that matter, per fragment, so also in perspective. It lets `exp(-s t / |c|)` of the light
//! behind through and adds the rest of the matter's colour, by `expm1`.
//!
//! # Signed thickness
//! The thickness is an affine function of the place along the normal: constant for the plane of a slice. Triangles
//! between two planes with a slope of 1 or -1 stand for what slabs of constant thickness have too much or too little
//! where the domain ends between planes: their thickness has a sign. With it a stack is of second order up to its
//! outline, without it of first (where colour and extinction have no steps). Optical depths of strips count up to
//! [`MAX_STRIP_DEPTH`], to either side.
//!
//! Where what is taken away lies in matter of another colour or extinction than the slab that had too much, a sum of
//! signed sheets can be darker than black. What matter can show is a mixture of its colours and of what is behind, so
//! a pixel's sum is taken to the nearest colour in that range, channel by channel: [`Sheets::emitted`] with what is
//! behind. The truth lies in the range, so this takes no channel of any pixel farther from it.
//!
//! Which sign a triangle of the outline has is a matter of the ray: its thickness rises along a ray that leaves the
//! domain there, and falls along one that comes in. So the triangles of a gap are listed as two sheets, with thicknesses
//! of opposite signs, each of which [counts](Counted) the triangles that are its own for the ray at hand: what is sent to
//! a device serves every eye.
//!
//! # Rules of coverage
//! A pixel is its centre. Triangles that share two vertices by number share that side: a ray through it meets one of
//! the two. What lies before the eye counts, in orthographic views what lies from the plane through the eye on. Either
//! side of a triangle is seen.

use glam::DVec3;
pub use volery_scene::Quantization;
use volery_scene::{Camera, Revision, TransferFunction};

use crate::DrawError;

mod transfer2d;

/// Sheets to see, and how. No brick is read, no volume needed.
#[derive(Clone, Copy, Debug)]
pub struct Sheets<'a> {
    /// Names vertices and triangles: an executor may keep what it made of them for parts that give the same revision,
    /// which promise the same contents. `None` is never kept.
    pub revision: Option<Revision>,
    /// The unit normal of all sheets, in world space.
    pub normal: DVec3,
    /// World position that vertices are relative to.
    pub origin: DVec3,
    /// Places and values.
    pub vertices: SheetVertices<'a>,
    /// Vertex numbers, in any orientation.
    pub triangles: &'a [[u32; 3]],
    /// Back to front: no sheet is hidden by one that comes before it.
    pub sheets: &'a [Sheet],
    /// Value, or value and gradient, to colour and extinction.
    pub transfer: &'a SheetTransfer,
    /// Shades by the gradient, where vertices have one; `None` shows colours as they are.
    pub light: Option<Light>,
}

impl Sheets<'_> {
    /// The least and the largest number of each channel of the colours that this matter can emit, lit or not.
    pub fn emitted(&self) -> [[f32; 3]; 2] {
        // What has no direction has no shade.
        let shades = match self.light {
            None => [1.0; 3],
            Some(Light { ambient, diffuse, .. }) => [1.0, ambient, ambient + diffuse],
        };
        let of = |channel: usize, join: fn(f32, f32) -> f32, none: f32| {
            let colors = self.transfer.entries.iter().map(|entry| entry[channel]);
            colors.flat_map(|color| shades.map(|shade| color * shade)).fold(none, join)
        };
        [(f32::min as fn(f32, f32) -> f32, f32::INFINITY), (f32::max, f32::NEG_INFINITY)]
            .map(|(join, none)| [0, 1, 2].map(|channel| of(channel, join, none)))
    }
}

/// Vertices as numbers, or as few bits as do.
#[derive(Clone, Copy, Debug)]
pub enum SheetVertices<'a> {
    /// As they are.
    Exact {
        /// `[x, y, z, value]`, places relative to the origin in world lengths.
        points: &'a [[f32; 4]],
        /// Unit direction in which the value rises, and the magnitude of its gradient per world length; one per
        /// point, or none at all. A zero direction has no shade.
        gradients: &'a [[f32; 4]],
    },
    /// 12 bytes each, as Benölken and Graf (2005, section 4.2) have it, and decoded by the device.
    Quantized {
        /// `[x, y, z, value]`.
        points: &'a [[u16; 4]],
        /// Direction as signed eighths: `max(i / 127, -1)`; magnitude in the bits of the last as an unsigned byte.
        /// One per point, or none at all.
        gradients: &'a [[i8; 4]],
        /// What the numbers mean.
        quantization: Quantization,
    },
}

impl SheetVertices<'_> {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Exact { points, .. } => points.len(),
            Self::Quantized { points, .. } => points.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Checks that numbers of vertices and triangles exist, and that there are as many gradients as vertices, or none.
pub(crate) fn check(content: &Sheets<'_>) -> Result<(), DrawError> {
    let wrong = |what, found: String, expected: String| Err(DrawError::Sheets { what, found, expected });
    let num_vertices = content.vertices.len();
    let num_gradients = match content.vertices {
        SheetVertices::Exact { gradients, .. } => gradients.len(),
        SheetVertices::Quantized { gradients, .. } => gradients.len(),
    };
    if num_gradients != 0 && num_gradients != num_vertices {
        return wrong("the number of gradients", num_gradients.to_string(), format!("0 or {num_vertices}"));
    }
    let largest = content.triangles.as_flattened().iter().copied().max();
    if let Some(found) = largest.filter(|&vertex| vertex as usize >= num_vertices) {
        return wrong("a vertex number", found.to_string(), format!("below {num_vertices}"));
    }
    let num_triangles = content.triangles.len();
    let end = |sheet: &Sheet| u64::from(sheet.first) + u64::from(sheet.count);
    if let Some(sheet) = content.sheets.iter().find(|sheet| end(sheet) > num_triangles as u64) {
        return wrong("the end of a sheet", end(sheet).to_string(), format!("at most {num_triangles}"));
    }
    let length = content.normal.length();
    if (length - 1.0).abs() > 1e-6 || !length.is_finite() {
        return wrong("the length of the normal", length.to_string(), "1".to_owned());
    }
    Ok(())
}

/// Triangles that stand for matter of a thickness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// The first triangle.
    pub first: u32,
    /// How many triangles.
    pub count: u32,
    /// `t = thickness[0] + thickness[1] * (normal . x)` with x relative to the origin, in world lengths.
    pub thickness: [f32; 2],
    /// Which of the triangles count.
    pub counted: Counted,
}

/// Which triangles of a sheet count where a ray meets them. Those of an outline have corners that go around
/// counter-clockwise as seen from outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Counted {
    /// All.
    #[default]
    All,
    /// Where the ray leaves what the outline is of and goes along the normal, or comes in and goes against it.
    Rising,
    /// Elsewhere.
    Falling,
}

impl Counted {
    /// Whether a triangle counts for a ray.
    #[inline]
    pub fn counts(self, is_leaving: bool, is_along_normal: bool) -> bool {
        match self {
            Self::All => true,
            Self::Rising => is_leaving == is_along_normal,
            Self::Falling => is_leaving != is_along_normal,
        }
    }
}

impl Sheet {
    /// Whether its thickness has a slope, and a sign.
    pub fn is_strip(&self) -> bool {
        self.thickness[1] != 0.0
    }
}

/// No optical depth is below minus this, and none of a strip above it. So what comes in and goes out at one place
/// cancels, however dense it is, and what a strip alone stands for is off by 1/150 in opacity at most. Rounding grows
/// 150 times between what is taken away and where it was too much.
pub const MAX_STRIP_DEPTH: f32 = 5.0;

/// A light far away that lights both sides: `color * (ambient + diffuse * |direction . toward|)`, with the direction
/// between vertices made a unit vector again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Unit vector toward the light, in world space.
    pub toward: [f32; 3],
    /// Of the colour where the light does not reach, in [0, 1].
    pub ambient: f32,
    /// Of the colour where the light falls straight on, in addition.
    pub diffuse: f32,
}

impl Light {
    /// A light that shines the way a camera without defects looks. `ambient` of the colour is there without it; where
    /// the gradient points to the viewer, colours are those of the transfer function.
    pub fn along_view(camera: &Camera, ambient: f32) -> Self {
        let [_, _, forward] = camera.axes();
        Self { toward: (-forward).as_vec3().to_array(), ambient, diffuse: 1.0 - ambient }
    }
}

/// Colour and extinction over values, or over values and magnitudes of gradients: a table of one row or of many.
#[derive(Clone, Debug)]
pub struct SheetTransfer {
    revision: Revision,
    entries: Vec<[f32; 4]>,
    columns: usize,
    column_from_value: [f32; 2],
    row_from_magnitude: [f32; 2],
}

/// Entries of a table over values alone.
const NUM_VALUES: usize = 4096;

/// The largest extinction of an entry, per world length: executors compute with finite numbers.
const MAX_EXTINCTION: f64 = 1e30;

impl SheetTransfer {
    /// A table over the values of `range` alone; outside, its ends count.
    pub fn new(transfer: &TransferFunction, [low, high]: [f64; 2]) -> Self {
        let width = if high > low { high - low } else { 1.0 };
        let step = width / (NUM_VALUES - 1) as f64;
        let entry = |column: usize| {
            let ([r, g, b], opacity) = transfer.classify(low + step * column as f64);
            [r, g, b, transfer.extinction_of_opacity(opacity).min(MAX_EXTINCTION)].map(|x| x as f32)
        };
        Self::of_entries((0..NUM_VALUES).map(entry).collect(), NUM_VALUES, [low, low + width], [0.0, 1.0])
    }

    /// A table of straight colours and extinctions per world length, row after row, each row of one magnitude.
    /// Entries lie evenly over the two ranges, the first and the last at their ends.
    ///
    /// # Panics
    /// When `columns` is 0 or does not divide the number of entries.
    pub fn of_entries(
        entries: Vec<[f32; 4]>,
        columns: usize,
        values: [f64; 2],
        magnitudes: [f64; 2],
    ) -> Self {
        assert!(columns > 0 && entries.len().is_multiple_of(columns) && !entries.is_empty());
        let rows = entries.len() / columns;
        let place = |count: usize, [low, high]: [f64; 2]| {
            let scale = if high > low { (count - 1) as f64 / (high - low) } else { 0.0 };
            [scale as f32, (-low * scale) as f32]
        };
        let [column_from_value, row_from_magnitude] = [place(columns, values), place(rows, magnitudes)];
        let revision = Revision::new();
        Self { revision, entries, columns, column_from_value, row_from_magnitude }
    }

    /// Names the table, which never changes; that of clones is the same.
    pub fn revision(&self) -> Revision {
        self.revision
    }

    /// `[r, g, b, extinction per world length]`, row after row.
    pub fn entries(&self) -> &[[f32; 4]] {
        &self.entries
    }

    /// Entries of a row, over values.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows, over magnitudes; 1 if they do not count.
    pub fn rows(&self) -> usize {
        self.entries.len() / self.columns
    }

    /// `[scale, offset]` with `column = scale * value + offset`.
    pub fn column_from_value(&self) -> [f32; 2] {
        self.column_from_value
    }

    /// `[scale, offset]` with `row = scale * magnitude + offset`.
    pub fn row_from_magnitude(&self) -> [f32; 2] {
        self.row_from_magnitude
    }

    /// Straight colour and extinction per world length, bilinear between entries.
    #[inline]
    pub fn classify(&self, value: f32, magnitude: f32) -> [f32; 4] {
        let place = |[scale, offset]: [f32; 2], x: f32, count: usize| {
            // `max` takes the other where the place is NaN.
            let at = (scale * x + offset).max(0.0).min((count - 1) as f32);
            let low = (at as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f32)
        };
        let (left, right, u) = place(self.column_from_value, value, self.columns);
        let (top, bottom, v) = place(self.row_from_magnitude, magnitude, self.rows());
        let at = |row: usize, column: usize| self.entries[row * self.columns + column];
        let mix = |a: [f32; 4], b: [f32; 4], w: f32| std::array::from_fn(|i| a[i] + (b[i] - a[i]) * w);
        let upper = mix(at(top, left), at(top, right), u);
        if top == bottom { upper } else { mix(upper, mix(at(bottom, left), at(bottom, right), u), v) }
    }
}

#[cfg(test)]
mod tests {
    use volery_scene::Projection;

    use super::*;

    #[test]
    fn a_light_along_the_view_shows_full_colour_where_the_gradient_meets_the_viewer() {
        let eye = DVec3::new(3.0, 0.0, 4.0);
        let projection = Projection::Perspective { fov_y_deg: 30.0 };
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection, is_mirrored: false };
        let light = Light::along_view(&camera, 0.25);
        let expected = [0.6, 0.0, 0.8];
        assert!((0..3).all(|i| (light.toward[i] - expected[i]).abs() < 1e-6), "{:?}", light.toward);
        assert_eq!(light.ambient + light.diffuse, 1.0);
    }
}
