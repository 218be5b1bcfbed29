//! Which faces of a box are toward the eye: the three classes, and the paper's ten cases.

use crate::fans::largest;
use crate::place::{Cuboid, Relative, Viewpoint, way};
use crate::real::Real;
use crate::table::{ASPECTS, CORNERS, NUM_VERTICES, ROWS, faces};

/// Which faces are toward the eye, and which of them rays to the far corner enter through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Aspect(u8);

impl Aspect {
    /// From the faces toward the eye, per axis, and the axis of the first face.
    #[inline]
    pub(crate) fn of(is_low_toward: [bool; 3], is_high_toward: [bool; 3], first: usize) -> Self {
        let side = |axis: usize| usize::from(is_low_toward[axis]) + 2 * usize::from(is_high_toward[axis]);
        Self(ASPECTS[side(0) + 3 * side(1) + 9 * side(2)][first])
    }

    /// The number of faces strictly toward the eye, 1 to 3; 0 with the eye inside or on the boundary.
    #[inline]
    pub fn class(self) -> u8 {
        self.0 % 4
    }

    /// The row of [`ROWS`] that carries the template to this box.
    #[inline]
    pub fn row(self) -> u8 {
        self.0 / 4
    }

    /// The faces that the row is for: the first is toward the eye in classes 1 to 3, the second in 2 and 3.
    #[inline]
    pub fn faces(self) -> [u8; 2] {
        faces(self.row())
    }

    /// The corner of the box for each corner of the template.
    #[inline]
    pub fn remapping(self) -> &'static [u8; 8] {
        &ROWS[usize::from(self.row())]
    }

    /// The corner of the box at each of the ten vertices.
    #[inline]
    pub fn corners(self) -> &'static [u8; NUM_VERTICES] {
        &CORNERS[usize::from(self.0)]
    }
}

/// The topologically different pictures of a box: figure 1 of the paper, and the eye inside.
///
/// The first digit is the class. The second counts pairs of opposite faces of which one is seen exactly from
/// its edge, so that vertices or edges coincide on the screen; of pictures that have ties, `b` and `c` have
/// two or three first faces. Fans are the same for all cases of a class; degenerate ones have triangles
/// without area.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Case {
    /// The eye is inside or on the boundary: the paper stops here.
    Inside,
    /// One face, the far face inside it.
    Case10,
    /// One face, the far face touches one of its edges.
    Case11,
    /// One face, the far face touches two of its edges, or coincides with it along parallel rays.
    Case12,
    /// Two faces.
    Case20a,
    /// Two faces, the far edge behind the near one.
    Case20b,
    /// Two faces, one more exactly from its edge.
    Case21a,
    /// Two faces, one more exactly from its edge, the far edge behind the near one.
    Case21b,
    /// Three faces.
    Case30a,
    /// Three faces, the far corner behind a near edge.
    Case30b,
    /// Three faces, the far corner behind the near one.
    Case30c,
}

impl Case {
    /// The case of a box; none where [`Fans::new`](crate::Fans::new) makes none. Ties are found by
    /// comparing rounded products; fans do not depend on them.
    pub fn of<F: Real>(viewpoint: Viewpoint<F>, cuboid: &Cuboid<F>) -> Option<Self> {
        let origin = match viewpoint {
            Viewpoint::Eye(eye) => eye,
            Viewpoint::Direction(_) => [F::ZERO; 3],
        };
        let relative = Relative::new(cuboid, origin);
        if !relative.is_proper() {
            return None;
        }
        let Relative { low, high, size } = relative.without_tiny();
        // Per axis how strongly a face is toward the eye: above 0, exactly 0, or below.
        let toward: [F; 3] = match viewpoint {
            Viewpoint::Eye(_) => std::array::from_fn(|axis| low[axis].most(-high[axis])),
            Viewpoint::Direction(direction) => way(direction)?.map(F::abs),
        };
        let num_toward = toward.iter().filter(|&&part| part > F::ZERO).count();
        let num_edge_on = toward.iter().filter(|&&part| part == F::ZERO).count();
        let first = largest(std::array::from_fn(|axis| toward[axis] / size[axis]));
        let is_tie = |&axis: &usize| toward[axis] * size[first] == toward[first] * size[axis];
        let num_first = (0..3).filter(is_tie).count();
        Some(match (num_toward, num_edge_on, num_first) {
            (0, _, _) => Self::Inside,
            (1, 0, _) => Self::Case10,
            (1, 1, _) => Self::Case11,
            (1, _, _) => Self::Case12,
            (2, 0, 1) => Self::Case20a,
            (2, 0, _) => Self::Case20b,
            (2, _, 1) => Self::Case21a,
            (2, _, _) => Self::Case21b,
            (_, _, 1) => Self::Case30a,
            (_, _, 2) => Self::Case30b,
            _ => Self::Case30c,
        })
    }
}
