//! Triangles cut by planes, for executors without hardware that does it.
//!
//! `point`, `before` and `through` are linear on a triangle, so a cut is exact up to rounding. Two triangles
//! that share an edge get the same new vertex, bit for bit: it is always computed from the inner end to the
//! outer one. Cut by the four planes through the eye and the sides of the picture, everything left is before
//! the eye: a near plane is not needed.

use crate::fans::{Fans, Vertex};
use crate::real::Real;

/// The points `p` with `normal . p >= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace<F> {
    /// Points inwards, of any length.
    pub normal: [F; 3],
    /// 0 for a plane through the eye.
    pub offset: F,
}

/// More cuts than this are not taken.
const MAX_CUTS: usize = 6;
const MAX_VERTICES: usize = 3 + MAX_CUTS;

/// A convex polygon of a few vertices.
#[derive(Clone, Copy, Debug)]
pub struct Polygon<F> {
    vertices: [Vertex<F>; MAX_VERTICES],
    num_vertices: usize,
}

impl<F: Real> Polygon<F> {
    /// In the order of the triangle that was cut; fewer than three if nothing is left.
    pub fn vertices(&self) -> &[Vertex<F>] {
        &self.vertices[..self.num_vertices]
    }

    /// Rounding may add corners to a polygon without area; it is left without them.
    fn push(&mut self, vertex: Vertex<F>) {
        if self.num_vertices < MAX_VERTICES {
            self.vertices[self.num_vertices] = vertex;
            self.num_vertices += 1;
        }
    }
}

impl<F: Real> Fans<F> {
    /// The part of a triangle of these fans inside all half-spaces, at most six.
    pub fn clipped<const CUTS: usize>(
        &self,
        triangle: [u8; 3],
        half_spaces: &[HalfSpace<F>; CUTS],
    ) -> Polygon<F> {
        const { assert!(CUTS <= MAX_CUTS, "at most six cuts of a triangle") };
        let vertices = self.vertices();
        let corners = triangle.map(|place| vertices[usize::from(place) % vertices.len()]);
        let mut polygon = Polygon { vertices: [corners[0]; MAX_VERTICES], num_vertices: 0 };
        corners.into_iter().for_each(|corner| polygon.push(corner));
        for half_space in half_spaces {
            polygon = self.cut(&polygon, half_space);
        }
        polygon
    }

    fn cut(&self, polygon: &Polygon<F>, half_space: &HalfSpace<F>) -> Polygon<F> {
        let HalfSpace { normal, offset } = *half_space;
        let height = |vertex: &Vertex<F>| {
            let p = vertex.point;
            normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - offset
        };
        let mut cut = Polygon { num_vertices: 0, ..*polygon };
        let vertices = polygon.vertices();
        for (place, vertex) in vertices.iter().enumerate() {
            let next = &vertices[(place + 1) % vertices.len()];
            let (here, there) = (height(vertex), height(next));
            if here >= F::ZERO {
                cut.push(*vertex);
            }
            if (here > F::ZERO && there < F::ZERO) || (here < F::ZERO && there > F::ZERO) {
                let [inner, outer] = if here > F::ZERO { [vertex, next] } else { [next, vertex] };
                let share = here.most(there) / (here - there).abs();
                cut.push(self.between(inner, outer, share));
            }
        }
        cut
    }

    fn between(&self, from: &Vertex<F>, to: &Vertex<F>, share: F) -> Vertex<F> {
        let mix = |from: F, to: F| from + (to - from) * share;
        let point = std::array::from_fn(|axis| mix(from.point[axis], to.point[axis]));
        let (before, through) = (mix(from.before, to.before), mix(from.through, to.through));
        Vertex { point, thickness: self.thickness(point, before, through), before, through }
    }
}
