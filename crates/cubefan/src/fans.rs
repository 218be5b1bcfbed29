//! The fans of a box: ten vertices, twelve triangles, thickness everywhere.
//!
//! # Method
//! Let `a` and `b` be the distances from the eye to the near and the far plane across an axis. Of the axes
//! whose near face is toward the eye, the *first* is the one of the largest `a / b`, that is of the largest
//! `a / (b - a)`: a ray through the far corner enters through that face, and a ray through the near corner
//! leaves through the opposite one. (The paper sorts faces by dot products of unit vectors, which is the same
//! order for cubes, and a wrong one for boxes of unequal sides. The order of second and third does not
//! matter: class 3b is class 3a with these two exchanged, so one template serves both.)
//!
//! Both planes of the first axis are parallel. Draw the far face onto the near one along the rays, that is,
//! scale it by `a / b`: what both have in common is a rectangle, and all crossings of front and back edges
//! inside the silhouette are its corners, in all ten cases. There the ray's way inside the box is `b/a - 1`
//! times its way to the box; on the silhouette it is 0. So fans need no intersection of edges, no case for
//! A and B, and one comparison more than the paper's sort of three.
//!
//! # Guarantees
//! - *Covered exactly once.* All vertices lie on front faces, their coordinates are bits of face planes or lie
//!   between two of them. In exact arithmetic on those very bits the triangles tile the front faces of the
//!   box without gap or overlap: rounding moves seams inside a face, never the silhouette. Projected from
//!   the eye, front faces cover the silhouette once.
//! - *Neighbours agree*, see [`place`](crate::place); a silhouette vertex is a corner of the box, bit for bit.
//! - *Perspective is exact.* On every triangle `before` and `through` are linear functions of the position
//!   in the triangle's plane (both faces' 1/t are affine on the screen), so what a GPU interpolates
//!   with perspective correction is exact, and so is `thickness = |point| * through / before` in every
//!   fragment. Interpolated `thickness` is exact along parallel rays only.
//! - *No near plane is needed.* Vertices have world positions; those behind the eye have `w <= 0`. Homogeneous
//!   clipping, in hardware or by [`Fans::clipped`], cuts triangles exactly.
//! - *Eye inside* (or on the boundary): the six faces as seen from inside, with the thickness from the eye to
//!   the exit. Faces through the eye have no area.
//!
//! # Non-goals
//! No colour, no opacity, no order of boxes.

use crate::aspect::Aspect;
use crate::place::{Cuboid, Relative, Viewpoint, way};
use crate::real::{Real, length};
use crate::table::{NUM_VERTICES, TRIANGLES};

/// A vertex of a fan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex<F> {
    /// Where the eye's ray enters the box, relative to the eye; where it leaves, if the eye is inside. For
    /// parallel rays in the box's own coordinates.
    pub point: [F; 3],
    /// Length of the ray inside the box.
    pub thickness: F,
    /// The share of the way from the eye to the exit that is before the box; 1 with the eye inside, 1 for
    /// parallel rays.
    pub before: F,
    /// The share of that way that is inside the box; 1 with the eye inside; the thickness for parallel rays.
    pub through: F,
}

/// How a box covers the screen: what is common to its vertices. 64 bytes in `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fans<F> {
    /// Low and high ends of the box.
    outer: [[F; 3]; 2],
    /// Low and high ends of the rectangle of inner vertices, which is in the plane of the first face.
    inner: [[F; 3]; 2],
    before: F,
    through: F,
    aspect: Aspect,
    is_parallel: bool,
}

impl<F: Real> Fans<F> {
    /// The fans of a box; none if a side is not above zero, or a number is NaN or not below [`Real::HUGE`], or
    /// the direction has no part of [`Real::TINY`].
    pub fn new(viewpoint: Viewpoint<F>, cuboid: &Cuboid<F>) -> Option<Self> {
        match viewpoint {
            Viewpoint::Eye(eye) => Self::from_eye(&Relative::new(cuboid, eye)),
            Viewpoint::Direction(direction) => Self::along(direction, &Relative::new(cuboid, [F::ZERO; 3])),
        }
    }

    /// The fans of a box given relative to the eye; none as for [`Fans::new`].
    #[inline(always)]
    pub fn from_eye(relative: &Relative<F>) -> Option<Self> {
        if !relative.is_proper() {
            return None;
        }
        let Relative { low, high, size } = relative.without_tiny();
        let near: [F; 3] = std::array::from_fn(|axis| low[axis].most(-high[axis]));
        let far: [F; 3] = std::array::from_fn(|axis| high[axis].most(-low[axis]));
        // In units of the side, which keeps differences that a / b loses from far away; at most 0 where no face
        // is toward the eye.
        let first = largest(std::array::from_fn(|axis| near[axis] / size[axis]));
        let aspect = Aspect::of(low.map(|plane| plane > F::ZERO), high.map(|plane| plane < F::ZERO), first);
        let outer = [low, high];
        if aspect.class() == 0 {
            let (before, through) = (F::ONE, F::ONE);
            return Some(Self { outer, inner: outer, before, through, aspect, is_parallel: false });
        }
        // The far face drawn onto the plane of the near one; ends on the eye's side of it stay as they are,
        // bit for bit, because the factor is at most 1 and rounding is monotone.
        let before = near[first] / far[first];
        let mut inner =
            outer.map(|end| std::array::from_fn(|i| (before * end[i]).most(low[i]).least(high[i])));
        let entry = if low[first] > F::ZERO { low[first] } else { high[first] };
        inner[0][first] = entry;
        inner[1][first] = entry;
        Some(Self { outer, inner, before, through: size[first] / far[first], aspect, is_parallel: false })
    }

    /// The fans of a box for parallel rays, in the coordinates of its planes; none as for [`Fans::new`].
    #[inline]
    pub fn along(direction: [F; 3], relative: &Relative<F>) -> Option<Self> {
        let Relative { low, high, size } = *relative;
        let way = way(direction).filter(|_| relative.is_proper())?;
        let first = largest(std::array::from_fn(|axis| way[axis].abs() / size[axis]));
        let aspect = Aspect::of(way.map(|part| part > F::ZERO), way.map(|part| part < F::ZERO), first);
        let slopes = way.map(|part| part / way[first].abs());
        let entry = if way[first] > F::ZERO { low[first] } else { high[first] };
        let drawn =
            |plane: F, axis: usize| (plane - slopes[axis] * size[first]).most(low[axis]).least(high[axis]);
        let inner = [
            std::array::from_fn(|axis| match axis {
                _ if axis == first => entry,
                _ if way[axis] < F::ZERO => drawn(low[axis], axis),
                _ => low[axis],
            }),
            std::array::from_fn(|axis| match axis {
                _ if axis == first => entry,
                _ if way[axis] > F::ZERO => drawn(high[axis], axis),
                _ => high[axis],
            }),
        ];
        let through = size[first] * length(slopes);
        Some(Self { outer: [low, high], inner, before: F::ONE, through, aspect, is_parallel: true })
    }

    /// Which faces are toward the eye.
    #[inline]
    pub fn aspect(&self) -> Aspect {
        self.aspect
    }

    /// Whether rays are parallel.
    #[inline]
    pub fn is_parallel(&self) -> bool {
        self.is_parallel
    }

    /// Four inner vertices, then six on the silhouette; with the eye inside all are corners of the box.
    #[inline(always)]
    pub fn vertices(&self) -> [Vertex<F>; NUM_VERTICES] {
        let corners = self.aspect.corners();
        let per_length = self.through / self.before;
        let seen_through = |point: [F; 3]| {
            let thickness = if self.is_parallel { self.through } else { length(point) * per_length };
            Vertex { point, thickness, before: self.before, through: self.through }
        };
        if self.aspect.class() == 0 {
            return corners.map(|number| seen_through(corner(&self.outer, number)));
        }
        std::array::from_fn(|place| {
            if place < 4 {
                seen_through(corner(&self.inner, corners[place]))
            } else {
                let point = corner(&self.outer, corners[place]);
                Vertex { point, thickness: F::ZERO, before: F::ONE, through: F::ZERO }
            }
        })
    }

    /// The triangles as places in [`Fans::vertices`], counter-clockwise as the eye sees them: 10 in class 1,
    /// else 12.
    #[inline]
    pub fn triangles(&self) -> &'static [[u8; 3]] {
        if self.aspect.class() == 1 { &TRIANGLES[..10] } else { &TRIANGLES }
    }

    /// The exact thickness at a point of a triangle, from linearly interpolated `point`, `before` and `through`.
    #[inline]
    pub fn thickness(&self, point: [F; 3], before: F, through: F) -> F {
        if self.is_parallel { through } else { length(point) * through / before }
    }
}

/// The place of the largest of three numbers that are not NaN, the lowest of equals.
#[inline]
pub(crate) fn largest<F: Real>(numbers: [F; 3]) -> usize {
    let place = usize::from(numbers[1] > numbers[0]);
    if numbers[2] > numbers[place] { 2 } else { place }
}

/// A corner between the low and the high ends.
#[inline]
fn corner<F: Real>(ends: &[[F; 3]; 2], number: u8) -> [F; 3] {
    std::array::from_fn(|axis| ends[usize::from(number >> axis & 1)][axis])
}
