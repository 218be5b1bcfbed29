//! Opaque surfaces: what the ray of each pixel ends at.
//!
//! # Method
//! Homogeneous rasterisation (Olano and Greer 1997) in f64. A corner is `(x w, y w, w)` with `x` and `y` in pixels from
//! the picture's middle, and `w` the depth, or 1 where rays are parallel; the cross product of two corners is an edge
//! function, which needs no division, so triangles through the plane of the eye are like others. A pixel's centre is
//! in a triangle where the three have one sign or are 0; the depth there is a mean of the corners' depths. Two
//! triangles that share a side have the very same edge function but for its sign, so nothing shows between them.
//!
//! Bands of rows are drawn side by side, each with the triangles that its rows may meet in the order given, of which
//! the first of the nearest stays. So nothing depends on threads.
//!
//! # Cost
//! 20 bytes per pixel, 16 per triangle that may show and band; nothing where there are no meshes.

use std::ops::RangeInclusive;

use glam::DVec3;
use rayon::prelude::*;
use volery_frame::PictureView;
use volery_scene::mesh::shade;
use volery_scene::{Projection, RayGrid, TriangleMesh};

/// Rows of a band.
const ROWS: u32 = 16;

/// Nearer than this share of its distance from the eye a corner is not projected.
const NEAR: f64 = 1e-9;

/// What every pixel's ray ends at: a surface or the background.
#[derive(Debug)]
pub(crate) struct Surfaces {
    rays: RayGrid,
    width: u32,
    background: [f32; 3],
    /// Along the view direction from the plane of the eye on, in world lengths; infinite where there is no surface.
    /// Empty where the frame has none at all.
    depths: Vec<f64>,
    /// Of the surface as lit, or of the background; empty as depths are.
    colors: Vec<[f32; 3]>,
}

impl Surfaces {
    /// Those of a checked picture.
    pub(crate) fn new(picture: &PictureView<'_>) -> Self {
        let view = View::new(picture);
        let (rays, width, background) = (view.rays, picture.width, picture.background);
        if picture.meshes.iter().all(|mesh| mesh.triangles().is_empty()) {
            return Self { rays, width, background, depths: Vec::new(), colors: Vec::new() };
        }
        let bands = view.bands(picture.meshes);
        let num_pixels = picture.width as usize * picture.height as usize;
        let mut depths = vec![f64::INFINITY; num_pixels];
        let mut colors = vec![picture.background; num_pixels];
        let band_pixels = (picture.width * ROWS) as usize;
        let pixels = depths.par_chunks_mut(band_pixels).zip(colors.par_chunks_mut(band_pixels));
        pixels.zip(bands).enumerate().for_each(|(band, ((depths, colors), listed))| {
            let first_row = band as u32 * ROWS;
            let mut nearest = vec![u32::MAX; depths.len()];
            for (place, footprint) in (0..).zip(&listed) {
                let triangle = view.triangle(footprint.corners(picture.meshes));
                triangle.draw(&view, footprint, first_row, depths, |pixel| nearest[pixel] = place);
            }
            for (pixel, (color, place)) in colors.iter_mut().zip(nearest).enumerate() {
                let Some(footprint) = listed.get(place as usize) else { continue };
                let [column, row] = [pixel as u32 % picture.width, first_row + pixel as u32 / picture.width];
                let [a, b, c] = footprint.corners(picture.meshes);
                let normal = (b - a).cross(c - a).normalize_or_zero();
                let shade = shade(normal.dot(view.rays.pixel(column, row).direction));
                *color =
                    picture.meshes[footprint.mesh as usize].color().map(|channel| (channel * shade) as f32);
            }
        });
        Self { rays, width, background, depths, colors }
    }

    /// Whether every ray ends at the background.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.depths.is_empty()
    }

    #[inline]
    fn place(&self, column: u32, row: u32) -> Option<usize> {
        let place = row as usize * self.width as usize + column as usize;
        (column < self.width && place < self.depths.len()).then_some(place)
    }

    /// How deep along the view direction the ray of a pixel ends; infinitely where it meets no surface or is none of
    /// the picture's.
    #[inline]
    pub(crate) fn depth(&self, column: u32, row: u32) -> f64 {
        self.place(column, row).map_or(f64::INFINITY, |place| self.depths[place])
    }

    /// How far from its origin the ray of a pixel ends.
    #[inline]
    pub(crate) fn distance(&self, column: u32, row: u32) -> f64 {
        let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
        let per_depth = self.rays.toward + self.rays.toward_dx * x + self.rays.toward_dy * y;
        self.depth(column, row) * per_depth.length()
    }

    /// What is seen there.
    #[inline]
    pub(crate) fn color(&self, column: u32, row: u32) -> [f32; 3] {
        self.place(column, row).map_or(self.background, |place| self.colors[place])
    }
}

/// A triangle, and the pixels that may show it.
struct Footprint {
    mesh: u32,
    triangle: u32,
    first: [u16; 2],
    last: [u16; 2],
}

impl Footprint {
    fn corners(&self, meshes: &[TriangleMesh]) -> [DVec3; 3] {
        let mesh = &meshes[self.mesh as usize];
        mesh.triangles()[self.triangle as usize].map(|corner| mesh.points()[corner as usize])
    }
}

/// How a frame sees space.
struct View {
    rays: RayGrid,
    eye: DVec3,
    forward: DVec3,
    /// What a place relative to the eye is multiplied by to have its pixels right and below of the middle, times depth
    /// in perspective.
    pixels_per_length: [DVec3; 2],
    is_perspective: bool,
    size: [u32; 2],
}

/// A triangle ready to be drawn.
struct Triangle {
    /// Edge functions, each opposite the corner of its number.
    edges: [[f64; 3]; 3],
    depths: [f64; 3],
}

impl View {
    fn new(picture: &PictureView<'_>) -> Self {
        let rays = picture.camera.rays(picture.width, picture.height);
        let [_, _, forward] = picture.camera.axes();
        Self {
            rays,
            eye: picture.camera.eye,
            forward,
            // One of the two is zero.
            pixels_per_length: [rays.toward_dx + rays.origin_dx, rays.toward_dy + rays.origin_dy]
                .map(|pixel| pixel / pixel.length_squared()),
            is_perspective: matches!(picture.camera.projection, Projection::Perspective { .. }),
            size: [picture.width, picture.height],
        }
    }

    /// Pixels right and below of the middle times depth, and depth.
    fn project(&self, point: DVec3) -> [f64; 3] {
        let from_eye = point - self.eye;
        let [x, y] = self.pixels_per_length.map(|per_length| from_eye.dot(per_length));
        [x, y, from_eye.dot(self.forward)]
    }

    fn triangle(&self, corners: [DVec3; 3]) -> Triangle {
        let projected = corners.map(|corner| self.project(corner));
        let [a, b, c] = projected.map(|[x, y, depth]| [x, y, if self.is_perspective { depth } else { 1.0 }]);
        let cross = |p: [f64; 3], q: [f64; 3]| {
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
        };
        Triangle {
            edges: [cross(b, c), cross(c, a), cross(a, b)],
            depths: projected.map(|[_, _, depth]| depth),
        }
    }

    /// The triangles of each band of rows, in their order.
    fn bands(&self, meshes: &[TriangleMesh]) -> Vec<Vec<Footprint>> {
        let mut bands: Vec<Vec<Footprint>> = (0..self.size[1].div_ceil(ROWS)).map(|_| Vec::new()).collect();
        for (number, mesh) in (0..).zip(meshes) {
            let footprints: Vec<Footprint> = mesh
                .triangles()
                .par_iter()
                .enumerate()
                .filter_map(|(triangle, corners)| {
                    let [first, last] = self.pixels(corners.map(|corner| mesh.points()[corner as usize]))?;
                    Some(Footprint { mesh: number, triangle: triangle as u32, first, last })
                })
                .collect();
            for Footprint { mesh, triangle, first, last } in footprints {
                for band in u32::from(first[1]) / ROWS..=u32::from(last[1]) / ROWS {
                    bands[band as usize].push(Footprint { mesh, triangle, first, last });
                }
            }
        }
        bands
    }

    /// First and last pixel along x and y whose centres a triangle may cover; `None` if there is none.
    fn pixels(&self, corners: [DVec3; 3]) -> Option<[[u16; 2]; 2]> {
        let projected = corners.map(|corner| self.project(corner));
        let near = if self.is_perspective {
            NEAR * corners.map(|corner| (corner - self.eye).length()).into_iter().fold(0.0, f64::max)
        } else {
            0.0
        };
        let mut range = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        let mut widen = |[x, y, depth]: [f64; 3]| {
            let scale = if self.is_perspective { depth } else { 1.0 };
            for (axis, place) in [x / scale, y / scale].into_iter().enumerate() {
                range[0][axis] = range[0][axis].min(place);
                range[1][axis] = range[1][axis].max(place);
            }
        };
        for (from, to) in [(0, 1), (1, 2), (2, 0)].map(|(from, to)| (projected[from], projected[to])) {
            if from[2] >= near {
                widen(from);
            }
            // Where the side leaves what is in front of the eye.
            if (from[2] >= near) != (to[2] >= near) {
                let share = (near - from[2]) / (to[2] - from[2]);
                let between = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
                widen([between[0], between[1], near]);
            }
        }
        let mut pixels = [[0; 2]; 2];
        for axis in 0..2 {
            // From the picture's edge to pixels' centres, and what rounding may take or add.
            let half = 0.5 * f64::from(self.size[axis]) - 0.5;
            let slack = 1e-6 * (1.0 + range[0][axis].abs().max(range[1][axis].abs()));
            let first = (range[0][axis] + half - slack).ceil().max(0.0);
            let last = (range[1][axis] + half + slack).floor().min(f64::from(self.size[axis] - 1));
            // With nothing in front of the eye the range is empty.
            if range[0][axis] > range[1][axis] || first > last {
                return None;
            }
            (pixels[0][axis], pixels[1][axis]) = (first as u16, last as u16);
        }
        Some(pixels)
    }
}

impl Triangle {
    /// Writes the depths of pixels of a band that the triangle covers nearest, and reports these.
    fn draw(
        &self,
        view: &View,
        footprint: &Footprint,
        first_row: u32,
        depths: &mut [f64],
        mut report: impl FnMut(usize),
    ) {
        let width = view.size[0] as usize;
        let num_rows = (depths.len() / width) as u32;
        let range = |axis: usize| u32::from(footprint.first[axis])..=u32::from(footprint.last[axis]);
        let rows = (*range(1).start()).max(first_row)..=(*range(1).end()).min(first_row + num_rows - 1);
        let columns: RangeInclusive<u32> = range(0);
        for row in rows {
            let y = f64::from(row) + 0.5 - 0.5 * f64::from(view.size[1]);
            let pixels = (row - first_row) as usize * width;
            for column in columns.clone() {
                let x = f64::from(column) + 0.5 - 0.5 * f64::from(view.size[0]);
                let weights = self.edges.map(|[a, b, c]| a * x + b * y + c);
                let sum = weights[0] + weights[1] + weights[2];
                let is_in = weights.iter().all(|&weight| weight >= 0.0)
                    || weights.iter().all(|&weight| weight <= 0.0);
                if !is_in || sum == 0.0 {
                    continue;
                }
                let depth = (0..3).map(|i| weights[i] / sum * self.depths[i]).sum::<f64>();
                let pixel = pixels + column as usize;
                if depth >= 0.0 && depth < depths[pixel] {
                    depths[pixel] = depth;
                    report(pixel);
                }
            }
        }
    }
}
