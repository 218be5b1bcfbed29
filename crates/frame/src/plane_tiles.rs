//! Where the rays of pixels meet planes: f64 up to a form that f32 evaluates without loss.
//!
//! # Method
//! The ray of a pixel starts at `o` and runs along `d`, both affine in the pixel, and meets the plane
//! `n · x = distance` at the depth `t = (distance - n · o) / (n · d)`. Near an *anchor*, a pixel whose ray meets
//! the plane at `P` and depth `T`, the pixel `(a, b)` further sees exactly
//! ```text
//! place = P + (a U + b V) / (1 + a u + b v),    depth = T + (a U' + b V') / (1 + a u + b v)
//! u = n · d_x / n · d,    U' = -(n · o_x + T n · d_x) / n · d,    U = o_x + T d_x + U' d    (V by y, likewise)
//! ```
//! In orthographic views `u` and `v` are zero. What is large, the place of the anchor, stays in f64 and is given
//! as a whole cell and a rest; what f32 computes is only how a tile of the picture spreads around it.
//!
//! The anchor is the corner of the tile that is nearest in depth, so that denominators are at most 1, and reach
//! zero at the plane's horizon.
//!
//! Along a plane's normal that is parallel to an axis the place is no quotient but a constant, and it is the
//! volume's end where distance and extent are equal in the world: so the samples of an image, which is a volume
//! without thickness, are found by the plane that they lie in, without any tolerance.
//!
//! # Error
//! Evaluated in f32 a place is off by less than 1e-6 of what the tile spans of the plane, however far the eye is.
//! (test `places_in_f32_are_those_of_f64`)

use glam::DVec3;
use volery_scene::{Plane, Projection, RayGrid};

use crate::{PictureView, VolumeLayout};

/// Pixels of a tile per axis.
pub const TILE: u32 = 16;

/// Cells per pixel, and the like, beyond which nothing is told apart: keeps f32 finite.
const LARGEST: f64 = 1e18;

/// A plane as one tile of the picture sees it. Places are in finest cells, depths in any unit that all planes of
/// the tile share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneTile {
    /// A whole cell of the volume, exact in f32, to which places are relative.
    pub base: [f32; 3],
    /// Pixel of the tile, `[x, y]`, to which the rest refers.
    pub anchor: [f32; 2],
    /// Place and depth that the anchor sees.
    pub seen: [f32; 4],
    /// Change of place and depth per pixel to the right, before the division.
    pub dx: [f32; 4],
    /// The same per pixel down.
    pub dy: [f32; 4],
    /// Change of the denominator per pixel right and down.
    pub shrink: [f32; 2],
    /// Depth of the eye, or of the plane on which orthographic rays start: what lies before it is not seen.
    pub first_depth: f32,
    /// Depth along the view direction from the plane of the eye on, in world lengths, that is 0 here.
    pub zero_depth: f64,
}

/// The planes of a frame, ready to be asked tile by tile.
#[derive(Clone, Debug)]
pub struct PlaneTiles {
    planes: Vec<View>,
    rays: RayGrid,
    is_perspective: bool,
    spacing: DVec3,
    cells: DVec3,
}

/// A plane, with what its rays have in common.
#[derive(Clone, Copy, Debug)]
struct View {
    plane: Plane,
    /// The axis that the normal is parallel to, and the place along it in finest cells.
    fixed: Option<(usize, f64)>,
}

/// Depth and denominator at an anchor.
#[derive(Clone, Copy)]
struct Anchor {
    corner: [f64; 2],
    depth: f64,
    toward: f64,
}

impl PlaneTiles {
    /// The planes as a picture's camera sees them; none is degenerate.
    pub fn new(picture: &PictureView<'_>, planes: &[Plane], layout: &VolumeLayout) -> Self {
        let cells = DVec3::from_array(layout.cells.map(f64::from));
        let view = |plane: &Plane| {
            let is_along = |&axis: &usize| (0..3).all(|other| other == axis || plane.normal[other] == 0.0);
            let fixed = (0..3).find(is_along).map(|axis| {
                let world = plane.distance / plane.normal[axis];
                let is_end = world == cells[axis] * layout.spacing[axis];
                (axis, if is_end { cells[axis] } else { world / layout.spacing[axis] })
            });
            View { plane: plane.normalized(), fixed }
        };
        Self {
            planes: planes.iter().map(view).collect(),
            rays: picture.camera.rays(picture.width, picture.height),
            is_perspective: matches!(picture.camera.projection, Projection::Perspective { .. }),
            spacing: layout.spacing,
            cells,
        }
    }

    /// How the tile whose upper left pixel is `(column, row)` sees each plane, in the order given; `None` for
    /// those that are certain not to show the volume there.
    pub fn tile(&self, column: u32, row: u32) -> impl Iterator<Item = Option<PlaneTile>> {
        let first = [column, row].map(|pixel| f64::from(pixel) + 0.5);
        let anchors = self.planes.iter().map(move |view| self.anchor(view, first));
        // Depths relative to a common one, so that where planes cross f32 tells which is in front.
        let common = anchors.clone().flatten().next().map_or(0.0, |anchor| anchor.depth);
        self.planes
            .iter()
            .zip(anchors)
            .map(move |(view, anchor)| Some(self.plane_tile(view, first, &anchor?, common)))
    }

    /// The corner of a tile that is nearest to a plane, unless no corner sees the plane's part in the volume.
    fn anchor(&self, view: &View, first: [f64; 2]) -> Option<Anchor> {
        let last = f64::from(TILE - 1);
        let corners = [[0.0, 0.0], [last, 0.0], [0.0, last], [last, last]];
        let seen =
            corners.map(|corner| self.depth(&view.plane, [first[0] + corner[0], first[1] + corner[1]]));
        let mut nearest: Option<Anchor> = None;
        for (corner, &(depth, toward)) in corners.into_iter().zip(&seen) {
            let is_seen = depth.is_finite() && (!self.is_perspective || depth > 0.0);
            if is_seen && nearest.is_none_or(|nearest| depth < nearest.depth) {
                nearest = Some(Anchor { corner, depth, toward });
            }
        }
        let is_whole = seen.iter().all(|(depth, _)| depth.is_finite() && *depth > 0.0);
        // Between corners that all see the plane places are between theirs.
        if is_whole {
            let places: [DVec3; 4] = std::array::from_fn(|i| {
                self.place(view, [first[0] + corners[i][0], first[1] + corners[i][1]], seen[i].0)
            });
            let is_beside = |axis: usize| {
                let margin = 1e-6 * (1.0 + self.cells[axis]);
                places.iter().all(|place| place[axis] < -margin)
                    || places.iter().all(|place| place[axis] > self.cells[axis] + margin)
            };
            if (0..3).any(is_beside) {
                return None;
            }
        }
        nearest
    }

    /// Depth at which the ray of an image point meets a plane, and how directly it runs towards it.
    fn depth(&self, plane: &Plane, [x, y]: [f64; 2]) -> (f64, f64) {
        let rays = &self.rays;
        let origin = rays.origin + rays.origin_dx * x + rays.origin_dy * y;
        let toward = plane.normal.dot(rays.toward + rays.toward_dx * x + rays.toward_dy * y);
        ((plane.distance - plane.normal.dot(origin)) / toward, toward)
    }

    /// The place in finest cells at a depth of an image point's ray.
    fn place(&self, view: &View, [x, y]: [f64; 2], depth: f64) -> DVec3 {
        let rays = &self.rays;
        let origin = rays.origin + rays.origin_dx * x + rays.origin_dy * y;
        let direction = rays.toward + rays.toward_dx * x + rays.toward_dy * y;
        let mut place = (origin + direction * depth) / self.spacing;
        if let Some((axis, fixed)) = view.fixed {
            place[axis] = fixed;
        }
        place
    }

    fn plane_tile(&self, view: &View, first: [f64; 2], anchor: &Anchor, common: f64) -> PlaneTile {
        let (rays, normal) = (&self.rays, view.plane.normal);
        let at = [first[0] + anchor.corner[0], first[1] + anchor.corner[1]];
        let direction = rays.toward + rays.toward_dx * at[0] + rays.toward_dy * at[1];
        let place = self.place(view, at, anchor.depth);
        let base = place.floor().clamp(DVec3::ZERO, self.cells);
        // Depths in the size of cells, so that the units of the world do not matter.
        let unit = self.spacing.max_element();
        let change = |origin_change: DVec3, toward_change: DVec3| {
            let deeper =
                -(normal.dot(origin_change) + anchor.depth * normal.dot(toward_change)) / anchor.toward;
            let moved = origin_change + toward_change * anchor.depth + direction * deeper;
            let mut moved = moved / self.spacing;
            if let Some((axis, _)) = view.fixed {
                moved[axis] = 0.0;
            }
            [moved.x, moved.y, moved.z, deeper / unit].map(narrow)
        };
        let rest = place - base;
        PlaneTile {
            base: base.as_vec3().to_array(),
            anchor: anchor.corner.map(|x| x as f32),
            seen: [rest.x, rest.y, rest.z, (anchor.depth - common) / unit].map(narrow),
            dx: change(rays.origin_dx, rays.toward_dx),
            dy: change(rays.origin_dy, rays.toward_dy),
            shrink: [rays.toward_dx, rays.toward_dy].map(|d| narrow(normal.dot(d) / anchor.toward)),
            first_depth: narrow(-common / unit),
            zero_depth: common,
        }
    }
}

fn narrow(x: f64) -> f32 {
    x.clamp(-LARGEST, LARGEST) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Revision, TexelType};
    use volery_scene::Camera;

    /// What f32 makes of a tile at one of its pixels: the place from the volume's corner, and the depth.
    fn evaluated(tile: &PlaneTile, pixel: [f32; 2]) -> Option<[f64; 4]> {
        let [a, b] = [pixel[0] - tile.anchor[0], pixel[1] - tile.anchor[1]];
        let denominator = 1.0 + a * tile.shrink[0] + b * tile.shrink[1];
        (denominator > 1e-12).then(|| {
            std::array::from_fn(|i| {
                let moved = tile.seen[i] + (a * tile.dx[i] + b * tile.dy[i]) / denominator;
                f64::from(moved) + if i < 3 { f64::from(tile.base[i]) } else { 0.0 }
            })
        })
    }

    fn layout(cells: u32, spacing: DVec3) -> VolumeLayout {
        VolumeLayout {
            revision: Revision::new(),
            cells: [cells; 3],
            spacing,
            brick_cells: 32,
            texel: TexelType::U8,
            value_scale: 1.0,
            value_offset: 0.0,
            value_range: [0.0, 255.0],
        }
    }

    fn cameras(extent: DVec3) -> Vec<Camera> {
        let near = Camera::fitted(extent, 35.0, 25.0, 1.4, false);
        let toward = (near.target - near.eye).normalize();
        let far = Camera {
            eye: near.target - toward * extent.max_element() * 2000.0,
            projection: Projection::Perspective { fov_y_deg: 0.03 },
            ..near
        };
        let inside = Camera {
            eye: extent * 0.4,
            target: extent,
            projection: Projection::Perspective { fov_y_deg: 110.0 },
            ..near
        };
        vec![near, far, inside, Camera::fitted(extent, 215.0, -50.0, 1.2, true)]
    }

    /// Against `o + t d` in f64, on oblique planes and grazing ones, from an eye a million cells away as well.
    #[test]
    fn places_in_f32_are_those_of_f64() {
        let (mut worst, mut worst_cells, mut num) = (0.0_f64, 0.0_f64, 0);
        for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 10.0), DVec3::splat(1e-9)] {
            let layout = layout(511, spacing);
            let extent = spacing * 511.0;
            for camera in cameras(extent) {
                let planes: Vec<_> = [[0.3, 0.5, 0.81], [1.0, 0.0, 0.0], [0.0, 2.0, 1e-7], [-1.0, 0.7, 0.02]]
                    .map(|n| Plane::through(extent * 0.47, DVec3::from_array(n) / spacing))
                    .into();
                let picture =
                    PictureView { width: 512, height: 384, camera, background: [0.0; 3], meshes: &[] };
                let tiles = PlaneTiles::new(&picture, &planes, &layout);
                let rays = camera.rays(512, 384);
                for (column, row) in
                    (0..512).step_by(112).flat_map(|c| (0..384).step_by(96).map(move |r| (c, r)))
                {
                    for (plane, tile) in planes.iter().zip(tiles.tile(column, row)) {
                        let Some(tile) = tile else { continue };
                        let (mut found, mut expected) = (Vec::new(), Vec::new());
                        for pixel in 0..TILE * TILE {
                            let [x, y] = [pixel % TILE, pixel / TILE];
                            let ray = rays.pixel(column + x, row + y);
                            let depth = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
                            let place = (ray.origin + ray.direction * depth) / spacing;
                            let margin = DVec3::splat(511.0);
                            let is_near = place.cmpge(-margin).all() && place.cmple(margin * 2.0).all();
                            if let Some(at) =
                                evaluated(&tile, [x as f32, y as f32]).filter(|_| depth > 0.0 && is_near)
                            {
                                found.push(DVec3::new(at[0], at[1], at[2]));
                                expected.push(place);
                            }
                        }
                        let span = |f: fn(DVec3, DVec3) -> DVec3| expected.iter().copied().reduce(f);
                        let (Some(low), Some(high)) = (span(DVec3::min), span(DVec3::max)) else { continue };
                        let size = (high - low).max_element();
                        for (found, expected) in found.iter().zip(&expected) {
                            let error = (found - expected).abs().max_element();
                            (worst, num) = (worst.max(error / (size + 0.1)), num + 1);
                            if size < 40.0 {
                                worst_cells = worst_cells.max(error);
                            }
                        }
                    }
                }
            }
        }
        println!(
            "{num} places: error {worst:.2e} of the tile's span (threshold 1e-6), {worst_cells:.2e} cells where tiles span less than 40 (threshold 1e-5)"
        );
        assert!(num > 20_000 && worst < 1e-6 && worst_cells < 1e-5, "{num} {worst:e} {worst_cells:e}");
    }

    /// Planes along axes have their place exactly, at the end of the volume also where spacing rounds.
    #[test]
    fn planes_at_the_ends_of_the_volume_are_in_it() {
        for cells in [0_u32, 1, 3, 7, 49, 511, 100_003] {
            for spacing in [1.0, 0.1, 0.3, 1.0 / 3.0, 7e-9] {
                let layout = layout(cells, DVec3::splat(spacing));
                let extent = f64::from(cells) * spacing;
                let view = Camera::fitted(DVec3::splat(extent.max(1.0)), 30.0, 20.0, 1.0, true);
                let picture =
                    PictureView { width: 16, height: 16, camera: view, background: [0.0; 3], meshes: &[] };
                for (distance, place) in [(0.0, 0.0), (extent, f64::from(cells))] {
                    let planes = [Plane { normal: DVec3::Y, distance }];
                    let tiles = PlaneTiles::new(&picture, &planes, &layout);
                    assert_eq!(tiles.planes[0].fixed, Some((1, place)), "{cells} cells of {spacing}");
                }
            }
        }
    }
}
