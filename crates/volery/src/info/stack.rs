//! What a stack of slices is, without drawing it.

use std::fmt;

use serde::Serialize;
use volery_slicing::QuantizedMesh;

use super::number;

/// What a file of slices holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StackInfo {
    /// `stack`.
    pub kind: &'static str,
    /// The unit normal of its planes.
    pub normal: [f64; 3],
    /// Planes with triangles.
    pub slices: usize,
    /// Vertices of all slices and of the outline's strips between them.
    pub vertices: usize,
    /// Triangles of all.
    pub triangles: usize,
    /// Bytes of vertices and triangles in memory.
    pub bytes: usize,
    /// Whether vertices have gradients.
    pub has_gradients: bool,
    /// The values that its numbers can tell.
    pub range: [f64; 2],
}

impl StackInfo {
    /// Looks at all of a stack.
    pub fn of(mesh: &QuantizedMesh) -> Self {
        let value = |number: u16| mesh.quantization.value([0, 0, 0, number]);
        Self {
            kind: "stack",
            normal: mesh.normal.to_array(),
            slices: mesh
                .sheets
                .iter()
                .filter(|sheet| sheet.thickness[1] == 0.0 && sheet.thickness[0] > 0.0)
                .count(),
            vertices: mesh.points.len(),
            triangles: mesh.triangles.len(),
            bytes: mesh.num_bytes(),
            has_gradients: !mesh.gradients.is_empty(),
            range: [value(0), value(u16::MAX)],
        }
    }
}

/// A few lines for people.
impl fmt::Display for StackInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, normal, slices, vertices, triangles, bytes, has_gradients, range } = self;
        let gradients = if *has_gradients { "with" } else { "without" };
        writeln!(f, "kind      {kind} of slices, {gradients} gradients")?;
        writeln!(f, "normal    {}", normal.map(number).join(", "))?;
        writeln!(f, "slices    {slices}")?;
        writeln!(f, "vertices  {vertices}")?;
        writeln!(f, "triangles {triangles}")?;
        writeln!(f, "bytes     {bytes}")?;
        writeln!(f, "range     {} to {}", number(range[0]), number(range[1]))
    }
}
