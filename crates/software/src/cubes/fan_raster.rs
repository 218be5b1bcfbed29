//! Fans of triangles, rasterised: the length between vertices is linear on the screen.
//!
//! Vertices are put on a grid of 1/4096 pixel, and all edge functions are whole numbers: signs are exact. A pixel on
//! an edge belongs to the triangle to its lower right. Where a vertex that was moved folds a sliver over, it counts
//! backwards. So every pixel of the silhouette counts exactly once, and none twice.

use volery_cubefan::{Cuboid, Fans, Viewpoint};

use super::bins::Entry;
use super::view::View;
use crate::target::{NUM_PACKETS, PACKET, TILE_PACKETS};

/// Steps of vertices per pixel.
const STEPS: i64 = 4096;

/// Vertices farther from the middle of the picture, in pixels, are not rasterised: edge functions fit 62 bits.
const MAX_DISTANCE: f64 = 131_072.0;

/// Lengths in one cube after the other, of the pixels of one tile.
pub(super) struct Raster<'a> {
    view: &'a View,
    /// First pixel of the tile.
    first: [i64; 2],
    viewpoint: Viewpoint<f64>,
    /// By packet and lane.
    lengths: Vec<[f32; 16]>,
}

/// A vertex on the screen, in steps, and the length there.
#[derive(Clone, Copy)]
struct Vertex {
    place: [i64; 2],
    length: f32,
}

/// First and last pixel along x and y.
type Window = [[i64; 2]; 2];

impl<'a> Raster<'a> {
    /// For the tile that begins at this pixel.
    pub(super) fn new(view: &'a View, first: [u32; 2]) -> Self {
        let viewpoint = if view.is_perspective {
            Viewpoint::Eye(view.eye.to_array())
        } else {
            Viewpoint::Direction(view.forward.to_array())
        };
        Self { view, first: first.map(i64::from), viewpoint, lengths: vec![[0.0; 16]; NUM_PACKETS] }
    }

    /// Lengths in unit lengths, meaningful in the packets of the entry; none where slabs must do.
    pub(super) fn lengths(&mut self, bounds: [[i32; 3]; 2], entry: &Entry) -> Option<&[[f32; 16]]> {
        let step = self.view.step;
        let [low, high] =
            bounds.map(|corner| std::array::from_fn(|axis| f64::from(corner[axis]) * step[axis]));
        let fans = Fans::new(self.viewpoint, &Cuboid { low, high })?;
        if fans.aspect().class() == 0 {
            return None;
        }
        let mut vertices = [Vertex { place: [0; 2], length: 0.0 }; 10];
        for (on_screen, vertex) in vertices.iter_mut().zip(fans.vertices()) {
            *on_screen = Vertex { place: self.place(vertex.point.into())?, length: vertex.thickness as f32 };
        }
        let mut packets = entry.packets();
        while packets != 0 {
            self.lengths[packets.trailing_zeros() as usize] = [0.0; 16];
            packets &= packets - 1;
        }
        let window = entry.pixels(self.first);
        for triangle in fans.triangles() {
            self.add(triangle.map(|vertex| vertices[usize::from(vertex)]), window);
        }
        Some(&self.lengths)
    }

    /// Where a fan's point shows, in steps; none behind the eye and far outside.
    fn place(&self, point: glam::DVec3) -> Option<[i64; 2]> {
        let view = self.view;
        let from_eye = if view.is_perspective { point } else { point - view.eye };
        let depth = from_eye.dot(view.forward);
        let is_before = if view.is_perspective { depth > 0.0 } else { depth >= 0.0 };
        let scale = if view.is_perspective { depth } else { 1.0 };
        let from_middle = view.pixels_per_length.map(|per_length| from_eye.dot(per_length) / scale);
        let is_near = from_middle.iter().all(|pixels| pixels.abs() < MAX_DISTANCE);
        let middle = view.middle();
        (is_before && is_near).then(|| {
            [0, 1].map(|axis| ((from_middle[axis] + middle[axis]) * STEPS as f64).round_ties_even() as i64)
        })
    }

    /// Adds the lengths of one triangle, counter-clockwise as the eye sees it.
    fn add(&mut self, [a, c, b]: [Vertex; 3], [first, last]: Window) {
        let cross = |from: [i64; 2], to: [i64; 2], point: [i64; 2]| {
            (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0])
        };
        // Rows go down, so `a b c` is a positive turn unless the triangle is folded over.
        let area = cross(a.place, b.place, c.place);
        let (b, c, sign) = if area < 0 { (c, b, -1.0) } else { (b, c, 1.0) };
        if area == 0 {
            return;
        }
        let corners = [a, b, c];
        let edges = [[b, c], [c, a], [a, b]].map(|edge| edge.map(|vertex| vertex.place));
        // What an edge function must reach: 0 on edges whose pixels are this triangle's, else 1.
        let least = edges.map(|[from, to]| {
            let is_owned = to[1] < from[1] || (to[1] == from[1] && to[0] > from[0]);
            i64::from(!is_owned)
        });
        let per_area = sign / area.abs() as f32;
        let range = |axis: usize| {
            let places = corners.map(|vertex| vertex.place[axis]);
            let [low, high] = [places.iter().min(), places.iter().max()].map(|end| end.copied().unwrap_or(0));
            let from = (low - STEPS / 2 + STEPS - 1).div_euclid(STEPS).max(first[axis]);
            from..=(high - STEPS / 2).div_euclid(STEPS).min(last[axis])
        };
        for row in range(1) {
            for column in range(0) {
                let center = [column, row].map(|pixel| pixel * STEPS + STEPS / 2);
                let weights = edges.map(|[from, to]| cross(from, to, center));
                if (0..3).all(|edge| weights[edge] >= least[edge]) {
                    let sum: f32 = (0..3).map(|i| weights[i] as f32 * corners[i].length).sum();
                    let [x, y] = [(column - self.first[0]) as u32, (row - self.first[1]) as u32];
                    let packet = y / PACKET * TILE_PACKETS + x / PACKET;
                    self.lengths[packet as usize][(y % PACKET * PACKET + x % PACKET) as usize] +=
                        sum * per_area;
                }
            }
        }
    }
}
