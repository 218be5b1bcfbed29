//! Opaque surfaces among what is drawn: what each ray ends at, in `f64`.
//!
//! A ray meets a triangle where the volumes that its direction spans with the triangle's three sides have one sign,
//! or are 0: two triangles that share a side have the very same volume there but for its sign, so no ray slips through
//! between them. The distance is a mean of the corners' distances along the ray, weighted by the volumes.

use glam::DVec3;
use volery_scene::mesh::shade;
use volery_scene::{Camera, Projection, Ray, TriangleMesh};

/// Pixels of a tile per axis, whose rays try the same triangles.
const TILE: u32 = 16;

/// Pixels around a triangle's picture that try it too.
const MARGIN: f64 = 1.0;

/// What a ray ends at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Backdrop {
    /// Along the ray; infinite where there is no surface.
    pub(crate) distance: f64,
    /// Of the surface as lit, or of the background.
    pub(crate) color: [f64; 3],
}

impl Backdrop {
    /// No surface.
    pub(crate) fn far(background: [f64; 3]) -> Self {
        Self { distance: f64::INFINITY, color: background }
    }
}

/// Meshes as one picture's rays meet them.
pub(crate) struct Surfaces<'a> {
    meshes: &'a [TriangleMesh],
    columns: u32,
    /// Numbers of meshes and triangles, in their order; of each tile.
    tiles: Vec<Vec<(u32, u32)>>,
}

impl<'a> Surfaces<'a> {
    /// For a camera without defects and a picture with pixels.
    pub(crate) fn new(meshes: &'a [TriangleMesh], camera: &Camera, [width, height]: [u32; 2]) -> Self {
        let [columns, rows] = [width, height].map(|n| n.div_ceil(TILE));
        if meshes.is_empty() {
            return Self { meshes, columns, tiles: Vec::new() };
        }
        let mut tiles = vec![Vec::new(); columns as usize * rows as usize];
        for (number, mesh) in (0..).zip(meshes) {
            for (triangle, corners) in (0..).zip(mesh.triangles()) {
                let corners = corners.map(|corner| mesh.points()[corner as usize]);
                let Some([first, last]) = touched(camera, [width, height], corners) else { continue };
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        tiles[(y * columns + x) as usize].push((number, triangle));
                    }
                }
            }
        }
        Self { meshes, columns, tiles }
    }

    /// What the ray of a pixel ends at.
    pub(crate) fn backdrop(&self, [column, row]: [u32; 2], ray: &Ray, background: [f64; 3]) -> Backdrop {
        let mut backdrop = Backdrop::far(background);
        let tile = (row / TILE * self.columns + column / TILE) as usize;
        for &(mesh, triangle) in self.tiles.get(tile).into_iter().flatten() {
            let mesh = &self.meshes[mesh as usize];
            let corners = mesh.triangles()[triangle as usize].map(|corner| mesh.points()[corner as usize]);
            if let Some((distance, cosine)) = meet(ray, corners)
                && distance < backdrop.distance
            {
                backdrop = Backdrop { distance, color: mesh.color().map(|channel| channel * shade(cosine)) };
            }
        }
        backdrop
    }
}

/// First and last tile along x and y that rays may meet a triangle in; `None` if there is none.
fn touched(camera: &Camera, size: [u32; 2], corners: [DVec3; 3]) -> Option<[[u32; 2]; 2]> {
    let rays = camera.rays(size[0], size[1]);
    let [_, _, forward] = camera.axes();
    let last = size.map(|n| (n - 1) / TILE);
    let whole = Some([[0, 0], last]);
    let from_eye = corners.map(|corner| corner - camera.eye);
    let depths = from_eye.map(|corner| corner.dot(forward));
    if depths.iter().all(|&depth| depth < 0.0) {
        return None;
    }
    let pixels = match camera.projection {
        Projection::Perspective { .. } => {
            if depths.iter().zip(&from_eye).any(|(&depth, corner)| depth <= 1e-6 * corner.length()) {
                return whole;
            }
            std::array::from_fn(|i| from_eye[i] / depths[i] - rays.toward)
        }
        Projection::Orthographic { .. } => corners.map(|corner| corner - rays.origin),
    };
    let steps = [rays.toward_dx + rays.origin_dx, rays.toward_dy + rays.origin_dy];
    let mut tiles = [[0; 2]; 2];
    for axis in 0..2 {
        let places = pixels.map(|place: DVec3| place.dot(steps[axis]) / steps[axis].length_squared());
        let low = places.into_iter().fold(f64::INFINITY, f64::min) - MARGIN;
        let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max) + MARGIN;
        if high < 0.0 || low > f64::from(size[axis]) {
            return None;
        }
        // Out of range is the end of the range.
        tiles[0][axis] = (low as u32 / TILE).min(last[axis]);
        tiles[1][axis] = (high as u32 / TILE).min(last[axis]);
    }
    Some(tiles)
}

/// Where a ray meets a triangle, and the cosine of its angle with the normal.
fn meet(ray: &Ray, corners: [DVec3; 3]) -> Option<(f64, f64)> {
    let [a, b, c] = corners.map(|corner| corner - ray.origin);
    let volumes = [b.cross(c), c.cross(a), a.cross(b)].map(|sides| sides.dot(ray.direction));
    let is_met = volumes.iter().all(|&volume| volume >= 0.0) || volumes.iter().all(|&volume| volume <= 0.0);
    let sum: f64 = volumes.iter().sum();
    if !is_met || sum == 0.0 {
        return None;
    }
    let along = [a, b, c].map(|corner| corner.dot(ray.direction));
    let distance = volumes.iter().zip(along).map(|(volume, along)| volume / sum * along).sum();
    let normal = (b - a).cross(c - a).normalize_or_zero();
    (distance >= 0.0).then(|| (distance, normal.dot(ray.direction)))
}
