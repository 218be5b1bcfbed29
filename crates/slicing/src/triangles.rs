//! Triangles of polygons, for those who can draw nothing else.
//!
//! # Method
//! A polygon without a corner that turns back is a fan around its first corner. Others, from warped cells, lose ear
//! after ear: a corner that turns forward and whose triangle holds no other corner, inside or on its rim. Where rounding leaves none, the
//! corner that turns most is taken, so there are always two triangles fewer than corners.

use glam::DVec3;

use crate::section::Section;

impl Section {
    /// The polygons as triangles of vertex numbers, around the unit normal `normal`, where `positions` are those of
    /// its vertices; polygon after polygon, two triangles fewer than it has corners.
    ///
    /// # Panics
    /// When there are fewer positions than vertices.
    pub fn triangles(&self, normal: DVec3, positions: &[DVec3]) -> Vec<[u32; 3]> {
        let mut triangles = Vec::with_capacity(self.num_triangles());
        let position = |vertex: u32| positions[vertex as usize];
        self.for_triangles((normal, f64::INFINITY), position, |triangle| triangles.push(triangle), |_| {});
        triangles
    }

    /// How many triangles there are in all polygons.
    pub(crate) fn num_triangles(&self) -> usize {
        self.corners().len() - 2 * self.num_polygons()
    }

    /// Hands out the triangles of all polygons around the normal: to `take` those of polygons that go against it and
    /// are more than `least_width` across, which they have to be turned around for, to `give` those of the others.
    pub(crate) fn for_triangles(
        &self,
        (normal, least_width): (DVec3, f64),
        position: impl Fn(u32) -> DVec3,
        mut give: impl FnMut([u32; 3]),
        mut take: impl FnMut([u32; 3]),
    ) {
        let turn = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [a, b, c].map(&position);
            normal.dot((b - a).cross(c - b))
        };
        let is_same = |a: u32, b: u32| position(a) == position(b);
        let clip = |rest: &mut Vec<u32>, give: &mut dyn FnMut([u32; 3])| {
            while rest.len() > 3 {
                let ear = ear(rest, turn, is_same);
                give(around(rest, ear));
                rest.remove(ear);
            }
            give([rest[0], rest[1], rest[2]]);
        };
        let mut rest = Vec::new();
        for polygon in self.polygons() {
            let is_convex = (0..polygon.len()).all(|at| turn(around(polygon, at)) >= 0.0);
            if is_convex {
                polygon[1..].windows(2).for_each(|side| give([polygon[0], side[0], side[1]]));
                continue;
            }
            rest.clear();
            rest.extend_from_slice(polygon);
            if is_against(polygon, normal, least_width, &position) {
                rest.reverse();
                clip(&mut rest, &mut take);
            } else {
                clip(&mut rest, &mut give);
            }
        }
    }
}

/// Whether a polygon goes against the normal, and its area is more than so wide a strip of its length.
fn is_against(polygon: &[u32], normal: DVec3, least_width: f64, position: impl Fn(u32) -> DVec3) -> bool {
    let first = position(polygon[0]);
    let (mut twice_area, mut length) = (0.0, 0.0_f64);
    for side in polygon[1..].windows(2) {
        let [from, to] = [position(side[0]) - first, position(side[1]) - first];
        twice_area += normal.dot(from.cross(to));
        length = length.max(from.length()).max(to.length());
    }
    -0.5 * twice_area > least_width * length
}

/// A corner between its neighbours.
fn around(polygon: &[u32], at: usize) -> [u32; 3] {
    let count = polygon.len();
    [polygon[(at + count - 1) % count], polygon[at], polygon[(at + 1) % count]]
}

/// The corner to cut off next.
fn ear(polygon: &[u32], turn: impl Fn([u32; 3]) -> f64, is_same: impl Fn(u32, u32) -> bool) -> usize {
    let holds = |[a, b, c]: [u32; 3], other: u32| {
        ![a, b, c].iter().any(|&corner| is_same(corner, other))
            && [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| turn([from, to, other]) >= 0.0)
    };
    let is_ear = |&at: &usize| {
        let triangle = around(polygon, at);
        turn(triangle) > 0.0 && !polygon.iter().any(|&other| holds(triangle, other))
    };
    let by_turn = |&a: &usize, &b: &usize| turn(around(polygon, a)).total_cmp(&turn(around(polygon, b)));
    (0..polygon.len()).find(is_ear).or_else(|| (0..polygon.len()).max_by(by_turn)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A section of one polygon with these corners in the plane z = 0, around z.
    fn polygon(corners: &[[f64; 2]]) -> (Section, Vec<DVec3>) {
        let count = corners.len() as u32;
        let section = Section {
            corners: (0..count).collect(),
            ends: vec![count],
            cells: vec![0],
            ..Section::default()
        };
        (section, corners.iter().map(|&[x, y]| DVec3::new(x, y, 0.0)).collect())
    }

    #[test]
    fn triangles_cover_what_the_polygon_covers_once() {
        let shapes: [&[[f64; 2]]; 5] = [
            &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            &[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [0.0, 1.0]],
            // An arrow, an L, and a star.
            &[[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]],
            &[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]],
            &[
                [3.0, 0.0],
                [1.0, 1.0],
                [0.0, 3.0],
                [-1.0, 1.0],
                [-3.0, 0.0],
                [-1.0, -1.0],
                [0.0, -3.0],
                [1.0, -1.0],
            ],
        ];
        for shape in shapes {
            for first in 0..shape.len() {
                let mut shape = shape.to_vec();
                shape.rotate_left(first);
                let (section, positions) = polygon(&shape);
                let triangles = section.triangles(DVec3::Z, &positions);
                assert_eq!(triangles.len(), shape.len() - 2);
                let areas = triangles.iter().map(|triangle| {
                    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
                    0.5 * (b - a).cross(c - a).z
                });
                let areas: Vec<f64> = areas.collect();
                // None the wrong way round, and together the whole: so none lies over another.
                assert!(areas.iter().all(|&area| area >= 0.0), "{shape:?}: {areas:?}");
                let whole = section.areas(DVec3::Z, &positions)[0];
                assert!((areas.iter().sum::<f64>() - whole).abs() < 1e-12, "{shape:?}");
            }
        }
    }

    #[test]
    fn a_polygon_without_area_or_sense_gives_its_number_of_triangles() {
        let shapes: [&[[f64; 2]]; 3] = [
            &[[0.0, 0.0]; 5],
            &[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
            &[[f64::NAN, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, f64::INFINITY]],
        ];
        for shape in shapes {
            let (section, positions) = polygon(shape);
            assert_eq!(section.triangles(DVec3::Z, &positions).len(), shape.len() - 2);
        }
    }
}
