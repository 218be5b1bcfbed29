//! Vertices on the screen, in homogeneous coordinates.

use fearless_simd::{Level, dispatch, prelude::*};
use glam::DVec3;
use rayon::prelude::*;
use volery_frame::{Counted, PictureView, Sheets};
use volery_scene::{Projection, RayGrid};

/// Vertices that a thread projects at a time.
const CHUNK: usize = 1 << 13;

/// A vertex as the picture sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// `(x, y, w)`: it shows at `(x / w, y / w)`, in pixels, with the centre of the first at 0. In perspective `w` is
    /// the depth over the largest there is, else 1.
    pub(super) place: [f64; 3],
    /// Where it shows, no farther than two pixels beside the picture; NaN unless it is before the eye.
    pub(super) screen: [f32; 2],
    pub(super) value: f32,
    /// World lengths before the plane of the eye.
    pub(super) depth: f32,
}

/// A frame's view of sheets.
pub(super) struct View {
    rays: RayGrid,
    /// What a place relative to the origin of the sheets is multiplied by, and what is added.
    rows: [DVec3; 3],
    constants: [f64; 3],
    forward: DVec3,
    /// Of the sheets.
    origin: DVec3,
    /// From the origin.
    eye: DVec3,
    depth_of_origin: f64,
    normal: DVec3,
    pub(super) is_perspective: bool,
    pub(super) size: [u32; 2],
}

/// An obliquity above this is this: sheets seen from their side.
const MAX_OBLIQUITY: f64 = 1e8;

impl View {
    pub(super) fn new(picture: &PictureView<'_>, content: &Sheets<'_>, points: &[[f32; 4]]) -> Self {
        let rays = picture.camera.rays(picture.width, picture.height);
        let is_perspective = matches!(picture.camera.projection, Projection::Perspective { .. });
        let (right, down) =
            if is_perspective { (rays.toward_dx, rays.toward_dy) } else { (rays.origin_dx, rays.origin_dy) };
        let forward = picture.camera.axes()[2];
        let size = [picture.width, picture.height];
        let middle = size.map(|n| 0.5 * f64::from(n) - 0.5);
        let [right, down] = [right, down].map(|pixel| pixel / pixel.length_squared());
        let origin = content.origin - picture.camera.eye;
        let (rows, constants) = if is_perspective {
            let reach = origin.length() + 2.0 * largest(points);
            let rows = [right + forward * middle[0], down + forward * middle[1], forward];
            let rows = rows.map(|row| row / reach.max(f64::MIN_POSITIVE));
            (rows, rows.map(|row| row.dot(origin)))
        } else {
            ([right, down, DVec3::ZERO], [right.dot(origin) + middle[0], down.dot(origin) + middle[1], 1.0])
        };
        let depth_of_origin = forward.dot(origin);
        let (normal, origin, eye) = (content.normal, content.origin, picture.camera.eye - content.origin);
        Self { eye, rays, rows, constants, forward, origin, depth_of_origin, normal, is_perspective, size }
    }

    /// The vertices, in their order.
    pub(super) fn vertices(&self, level: Level, points: &[[f32; 4]]) -> Vec<Vertex> {
        let mut vertices = Vec::with_capacity(points.len());
        let project = |points: &[[f32; 4]]| {
            dispatch!(level, simd => simd.vectorize(
                #[inline(always)]
                || points.iter().map(|point| self.vertex(point)).collect::<Vec<_>>()
            ))
        };
        let chunks: Vec<_> = points.par_chunks(CHUNK).map(project).collect();
        chunks.iter().for_each(|chunk| vertices.extend_from_slice(chunk));
        vertices
    }

    #[inline(always)]
    fn vertex(&self, &[x, y, z, value]: &[f32; 4]) -> Vertex {
        let point = DVec3::new(x.into(), y.into(), z.into());
        let of = |i: usize| self.rows[i].dot(point) + self.constants[i];
        let place = [of(0), of(1), of(2)];
        let depth = (self.forward.dot(point) + self.depth_of_origin) as f32;
        let is_before = place[2] > 0.0 && (place[0] + place[1]).is_finite();
        let on_screen = |axis: usize| {
            let end = f64::from(self.size[axis]) + 1.0;
            if is_before { (place[axis] / place[2]).clamp(-2.0, end) as f32 } else { f32::NAN }
        };
        Vertex { place, screen: [on_screen(0), on_screen(1)], value, depth }
    }

    /// Length in a sheet over its thickness, along the ray of a pixel.
    #[inline(always)]
    pub(super) fn obliquity(&self, column: u32, row: u32) -> f32 {
        let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
        let toward = self.rays.toward + self.rays.toward_dx * x + self.rays.toward_dy * y;
        (toward.length() / self.normal.dot(toward).abs()).min(MAX_OBLIQUITY) as f32
    }

    /// Whether a triangle, whose corners are relative to the origin of the sheets, counts for the rays that meet it.
    pub(super) fn counts(&self, counted: Counted, [a, b, c]: [DVec3; 3]) -> bool {
        let outward = (b - a).cross(c - a);
        let (to_plane, to_middle) = if self.is_perspective {
            let from_eye = a - self.eye;
            (from_eye, from_eye + ((b - a) + (c - a)) / 3.0)
        } else {
            (self.forward, self.forward)
        };
        counted.counts(outward.dot(to_plane) > 0.0, self.normal.dot(to_middle) > 0.0)
    }

    /// How deep the ray of a pixel meets a triangle, whose corners are relative to the origin of the sheets, and the
    /// length of the ray per depth.
    pub(super) fn meet(&self, corners: [DVec3; 3], column: u32, row: u32) -> (f64, f64) {
        let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
        let start = self.rays.origin + self.rays.origin_dx * x + self.rays.origin_dy * y - self.origin;
        let toward = self.rays.toward + self.rays.toward_dx * x + self.rays.toward_dy * y;
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a);
        let met = normal.dot(a - start) / normal.dot(toward);
        let depths = corners.map(|corner| self.forward.dot(corner) + self.depth_of_origin);
        // `max` and `min` take the other where the plane is met nowhere.
        let [low, high] = [f64::min, f64::max].map(|of| of(of(depths[0], depths[1]), depths[2]));
        (met.max(low).min(high), toward.length())
    }
}

/// The largest coordinate of any point that is finite.
fn largest(points: &[[f32; 4]]) -> f64 {
    let of_point = |&[x, y, z, _]: &[f32; 4]| {
        [x, y, z].map(f32::abs).into_iter().filter(|x| x.is_finite()).fold(0.0, f32::max)
    };
    let of_chunk = |points: &[[f32; 4]]| points.iter().map(of_point).fold(0.0, f32::max);
    f64::from(points.par_chunks(CHUNK).map(of_chunk).reduce(|| 0.0, f32::max))
}
