//! VTK's numbers of cell types.

use volery_scene::CellType;

/// What a reader makes of a type of cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Read as it is.
    Linear(CellType),
    /// Of higher order: its corners, which VTK lists first, are read.
    Corners(CellType),
    /// Left out.
    Other,
}

pub(super) fn kind(vtk: u8) -> Kind {
    if let Some(cell_type) = CellType::from_vtk(vtk) {
        return Kind::Linear(cell_type);
    }
    match vtk {
        24 | 71 | 78 => Kind::Corners(CellType::Tetrahedron),
        25 | 29 | 33 | 72 | 79 => Kind::Corners(CellType::Hexahedron),
        26 | 31 | 32 | 73 | 80 => Kind::Corners(CellType::Wedge),
        27 | 37 | 74 | 81 => Kind::Corners(CellType::Pyramid),
        _ => Kind::Other,
    }
}

/// A type's name for people.
pub(super) fn name(vtk: u8) -> String {
    let name = match vtk {
        0 => "empty cell",
        1 => "vertex",
        2 => "poly-vertex",
        3 => "line",
        4 => "poly-line",
        5 => "triangle",
        6 => "triangle strip",
        7 => "polygon",
        8 => "pixel",
        9 => "quad",
        10..=14 => CellType::from_vtk(vtk).map_or("", CellType::name),
        15 => "pentagonal prism",
        16 => "hexagonal prism",
        21 => "quadratic edge",
        22 => "quadratic triangle",
        23 => "quadratic quad",
        24 => "quadratic tetrahedron",
        25 => "quadratic hexahedron",
        26 => "quadratic wedge",
        27 => "quadratic pyramid",
        28 => "biquadratic quad",
        29 => "triquadratic hexahedron",
        30 => "quadratic linear quad",
        31 => "quadratic linear wedge",
        32 => "biquadratic quadratic wedge",
        33 => "biquadratic quadratic hexahedron",
        34 => "biquadratic triangle",
        35 => "cubic line",
        36 => "quadratic polygon",
        37 => "triquadratic pyramid",
        41 => "convex point set",
        42 => "polyhedron",
        68 => "Lagrange curve",
        69 => "Lagrange triangle",
        70 => "Lagrange quad",
        71 => "Lagrange tetrahedron",
        72 => "Lagrange hexahedron",
        73 => "Lagrange wedge",
        74 => "Lagrange pyramid",
        75 => "Bezier curve",
        76 => "Bezier triangle",
        77 => "Bezier quad",
        78 => "Bezier tetrahedron",
        79 => "Bezier hexahedron",
        80 => "Bezier wedge",
        81 => "Bezier pyramid",
        u8::MAX => "element of an unknown type",
        _ => return format!("cell of type {vtk}"),
    };
    name.to_owned()
}
