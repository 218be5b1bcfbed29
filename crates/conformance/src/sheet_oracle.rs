//! What sheets should show: every ray against every triangle, in f64, and stacks to take pictures of.

use glam::DVec3;
use volery_scene::{Camera, Projection, Ray};

use volery_frame::{
    Backend, Content, Counted, DrawError, Frame, Image, Light, PictureView, Quantization, Revision, Sheet,
    SheetTransfer, SheetVertices, Sheets,
};

use super::cubes::Random;
use super::oracle::{each_pixel, over};
use super::world::{BACKGROUND, BACKGROUND_F64};

/// A table, and what its entries lie over.
#[derive(Clone)]
pub(super) struct Table {
    pub(super) entries: Vec<[f32; 4]>,
    pub(super) columns: usize,
    pub(super) values: [f64; 2],
    pub(super) magnitudes: [f64; 2],
}

impl Table {
    /// One colour and extinction for all values.
    pub(super) fn constant(color: [f32; 3], extinction: f32) -> Self {
        let [r, g, b] = color;
        Self::of_values(vec![[r, g, b, extinction]], [0.0, 1.0])
    }

    pub(super) fn of_values(entries: Vec<[f32; 4]>, values: [f64; 2]) -> Self {
        Self { columns: entries.len(), entries, values, magnitudes: [0.0, 1.0] }
    }

    /// Values from 0 to 1: dark and thin to bright and dense.
    pub(super) fn ramp(extinction: f32) -> Self {
        Self::of_values(vec![[0.9, 0.1, 0.0, 0.2 * extinction], [0.1, 0.8, 1.0, extinction]], [0.0, 1.0])
    }

    fn transfer(&self) -> SheetTransfer {
        SheetTransfer::of_entries(self.entries.clone(), self.columns, self.values, self.magnitudes)
    }

    /// Bilinear between entries.
    fn classify(&self, value: f64, magnitude: f64) -> [f64; 4] {
        let rows = self.entries.len() / self.columns;
        let place = |x: f64, [low, high]: [f64; 2], count: usize| {
            let at = ((x - low) / (high - low)).clamp(0.0, 1.0) * (count - 1) as f64;
            let low = (at.floor() as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let (left, right, u) = place(value, self.values, self.columns);
        let (top, bottom, v) = place(magnitude, self.magnitudes, rows);
        std::array::from_fn(|i| {
            let at = |row: usize, column: usize| f64::from(self.entries[row * self.columns + column][i]);
            let upper = at(top, left) * (1.0 - u) + at(top, right) * u;
            let lower = at(bottom, left) * (1.0 - u) + at(bottom, right) * u;
            upper * (1.0 - v) + lower * v
        })
    }
}

/// Sheets that own what they are made of.
#[derive(Clone)]
pub(super) struct Scene {
    pub(super) normal: DVec3,
    pub(super) origin: DVec3,
    pub(super) points: Vec<[f32; 4]>,
    pub(super) gradients: Vec<[f32; 4]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// With where they are along the normal, from the origin; in any order.
    pub(super) sheets: Vec<(f64, Sheet)>,
    pub(super) table: Table,
    pub(super) light: Option<Light>,
}

/// How a scene's vertices are given.
pub(super) type Quantized = (Vec<[u16; 4]>, Vec<[i8; 4]>, Quantization);

impl Scene {
    /// Nothing, of a normal.
    pub(super) fn new(normal: DVec3, table: Table) -> Self {
        Self {
            normal: normal.normalize(),
            origin: DVec3::ZERO,
            points: Vec::new(),
            gradients: Vec::new(),
            triangles: Vec::new(),
            sheets: Vec::new(),
            table,
            light: None,
        }
    }

    /// Two unit vectors beside the normal.
    pub(super) fn beside(&self) -> [DVec3; 2] {
        let u = self.normal.any_orthonormal_vector();
        [u, self.normal.cross(u)]
    }

    /// Adds triangles as one sheet at a place along the normal.
    pub(super) fn add(&mut self, position: f64, thickness: [f32; 2], triangles: &[[u32; 3]]) {
        let (first, count) = (self.triangles.len() as u32, triangles.len() as u32);
        self.triangles.extend(triangles);
        self.sheets.push((position, Sheet { first, count, thickness, counted: Counted::All }));
    }

    /// Adds a square of `2 half` by `2 half` around `middle` (from the origin), cut into `cells` by `cells` crooked
    /// quadrangles with shared vertices, with values by place from the origin.
    pub(super) fn add_square(
        &mut self,
        middle: DVec3,
        half: f64,
        cells: u32,
        thickness: f32,
        random: &mut Random,
        value: impl Fn(DVec3) -> f64,
    ) {
        let ([u, v], first) = (self.beside(), self.points.len() as u32);
        for row in 0..=cells {
            for column in 0..=cells {
                let mut along = |i: u32| {
                    let is_inside = i > 0 && i < cells;
                    let aside = if is_inside { 0.7 * (random.next() - 0.5) } else { 0.0 };
                    (2.0 * (f64::from(i) + aside) / f64::from(cells) - 1.0) * half
                };
                let place = middle + u * along(column) + v * along(row);
                let [x, y, z] = place.to_array().map(|x| x as f32);
                self.points.push([x, y, z, value(place) as f32]);
            }
        }
        let corner = |column: u32, row: u32| first + column + row * (cells + 1);
        let quads = (0..cells * cells).map(|i| [i % cells, i / cells]);
        let triangles: Vec<_> = quads
            .flat_map(|[x, y]| {
                let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x, y + 1), corner(x + 1, y + 1)];
                if (x + y) % 2 == 0 { [[a, b, c], [d, b, c]] } else { [[a, b, d], [d, a, c]] }
            })
            .collect();
        self.add(middle.dot(self.normal), [thickness, 0.0], &triangles);
    }

    /// The sheets from back to front.
    pub(super) fn back_to_front(&self, camera: &Camera) -> Vec<Sheet> {
        let mut sheets = self.sheets.clone();
        let from_eye = |position: f64| match camera.projection {
            Projection::Perspective { .. } => (position - (camera.eye - self.origin).dot(self.normal)).abs(),
            Projection::Orthographic { .. } => {
                position * (camera.target - camera.eye).dot(self.normal).signum()
            }
        };
        sheets.sort_by(|(a, _), (b, _)| from_eye(*b).total_cmp(&from_eye(*a)));
        sheets.into_iter().map(|(_, sheet)| sheet).collect()
    }

    /// A place from the origin, as it is given.
    fn place(&self, vertex: u32) -> DVec3 {
        let [x, y, z, _] = self.points[vertex as usize].map(f64::from);
        DVec3::new(x, y, z)
    }

    /// Where a ray meets a triangle: the weights of its vertices.
    fn weights(&self, ray: &Ray, triangle: [u32; 3]) -> Option<[f64; 3]> {
        let [a, b, c] = triangle.map(|vertex| self.place(vertex) + (self.origin - ray.origin));
        let normal = (b - a).cross(c - a);
        let facing = normal.dot(ray.direction);
        if facing == 0.0 {
            return None;
        }
        let distance = normal.dot(a) / facing;
        let hit = ray.direction * distance;
        let weight = |p: DVec3, q: DVec3| (p - hit).cross(q - hit).dot(normal) / normal.length_squared();
        let weights = [weight(b, c), weight(c, a), weight(a, b)];
        (distance >= 0.0 && weights.iter().all(|&weight| weight >= 0.0)).then_some(weights)
    }

    /// What a ray sees.
    pub(super) fn seen(&self, ray: &Ray, sheets: &[Sheet], background: [f64; 3]) -> [f64; 3] {
        let cosine = self.normal.dot(ray.direction).abs();
        let mut light = background;
        for sheet in sheets {
            for &triangle in &self.triangles[sheet.first as usize..][..sheet.count as usize] {
                let Some(weights) = self.weights(ray, triangle) else { continue };
                let [a, b, c] = triangle.map(|vertex| self.place(vertex));
                let is_leaving = (b - a).cross(c - a).dot(ray.direction) > 0.0;
                if !sheet.counted.counts(is_leaving, self.normal.dot(ray.direction) > 0.0) {
                    continue;
                }
                let mean = |of: &dyn Fn(usize) -> f64| {
                    (0..3).map(|i| weights[i] * of(triangle[i] as usize)).sum::<f64>()
                };
                let value = mean(&|vertex| f64::from(self.points[vertex][3]));
                let along = mean(&|vertex| self.place(vertex as u32).dot(self.normal));
                let gradient: [f64; 4] = std::array::from_fn(|i| {
                    mean(&|vertex| self.gradients.get(vertex).map_or(0.0, |gradient| f64::from(gradient[i])))
                });
                let [r, g, b, extinction] = self.table.classify(value, gradient[3]);
                let shade = self.shade(DVec3::new(gradient[0], gradient[1], gradient[2]));
                let thickness = f64::from(sheet.thickness[0]) + f64::from(sheet.thickness[1]) * along;
                let limit = f64::from(volery_frame::sheets::MAX_STRIP_DEPTH);
                let most = if sheet.thickness[1] == 0.0 { f64::INFINITY } else { limit };
                let depth = (extinction * thickness / cosine).max(-limit).min(most);
                light = over([r, g, b].map(|x| x * shade), depth, light);
            }
        }
        std::array::from_fn(|i| {
            light[i].clamp(
                self.emitted(i, f64::min).min(background[i]),
                self.emitted(i, f64::max).max(background[i]),
            )
        })
    }

    /// The least or the largest number that a channel of the matter's colours has.
    pub(super) fn emitted(&self, channel: usize, of: fn(f64, f64) -> f64) -> f64 {
        let shades = self.light.map_or([1.0; 2], |Light { ambient, diffuse, .. }| {
            [f64::from(ambient), 1.0_f64.max(f64::from(ambient + diffuse))]
        });
        let colors = self.table.entries.iter().map(|entry| f64::from(entry[channel]));
        colors.flat_map(|color| shades.map(|shade| color * shade)).reduce(of).expect("a table has entries")
    }

    fn shade(&self, direction: DVec3) -> f64 {
        let (Some(light), Some(direction)) = (self.light, direction.try_normalize()) else { return 1.0 };
        let toward = DVec3::from_array(light.toward.map(f64::from));
        f64::from(light.ambient) + f64::from(light.diffuse) * direction.dot(toward).abs()
    }

    pub(super) fn exact(&self) -> SheetVertices<'_> {
        SheetVertices::Exact { points: &self.points, gradients: &self.gradients }
    }

    pub(super) fn try_draw(
        &self,
        backend: &mut dyn Backend,
        revision: Option<Revision>,
        vertices: SheetVertices<'_>,
        camera: &Camera,
        [width, height]: [u32; 2],
    ) -> Result<Image, DrawError> {
        assert!(camera.defects().is_empty(), "the suite's camera: {:?}", camera.defects());
        let (sheets, transfer) = (self.back_to_front(camera), self.table.transfer());
        let content = Content::Sheets(Sheets {
            revision,
            normal: self.normal,
            origin: self.origin,
            vertices,
            triangles: &self.triangles,
            sheets: &sheets,
            transfer: &transfer,
            light: self.light,
        });
        let frame = Frame {
            view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
            content,
        };
        backend.draw(&frame).map(|drawn| drawn.image)
    }

    pub(super) fn draw(&self, backend: &mut dyn Backend, camera: &Camera, size: [u32; 2]) -> Image {
        self.try_draw(backend, None, self.exact(), camera, size).expect("right sheets")
    }

    /// The scene with its vertices rounded to few bits, and these.
    pub(super) fn quantized(&self) -> (Self, Quantized) {
        let range = |i: usize| {
            let of = self.points.iter().map(|point| point[i]);
            [of.clone().fold(f32::INFINITY, f32::min), of.fold(f32::NEG_INFINITY, f32::max)]
        };
        let low = [0, 1, 2, 3].map(|i| range(i)[0]);
        let scale = [0, 1, 2, 3].map(|i| (range(i)[1] - low[i]).max(1e-3) / 65535.0);
        let magnitude_scale = self.gradients.iter().map(|gradient| gradient[3]).fold(1e-3, f32::max) / 255.0;
        let points: Vec<[u16; 4]> = (self.points.iter())
            .map(|point| std::array::from_fn(|i| ((point[i] - low[i]) / scale[i]).round() as u16))
            .collect();
        let gradients: Vec<[i8; 4]> = (self.gradients.iter())
            .map(|&[x, y, z, magnitude]| {
                let [x, y, z] = [x, y, z].map(|x| (x * 127.0).round() as i8);
                [x, y, z, ((magnitude / magnitude_scale).round() as u8).cast_signed()]
            })
            .collect();
        let mut rounded = self.clone();
        for (to, from) in rounded.points.iter_mut().zip(&points) {
            *to = std::array::from_fn(|i| low[i] + scale[i] * f32::from(from[i]));
        }
        for (to, &[x, y, z, magnitude]) in rounded.gradients.iter_mut().zip(&gradients) {
            let [x, y, z] = [x, y, z].map(|i| (f32::from(i) / 127.0).max(-1.0));
            *to = [x, y, z, magnitude_scale * f32::from(magnitude.cast_unsigned())];
        }
        (rounded, (points, gradients, Quantization { low, scale, magnitude_scale }))
    }

    /// Draws the scene and compares it with what every ray sees.
    pub(super) fn check(&self, what: &str, backend: &mut dyn Backend, camera: &Camera, max: f64) {
        let image = self.draw(backend, camera, super::sheets::SIZE);
        self.compare(what, &image, camera, max);
    }

    /// Compares a picture with what every ray sees. Where that changes within a hundredth of a pixel, anything
    /// between is right; where it changes much, pixels are counted, not compared.
    pub(super) fn compare(&self, what: &str, image: &Image, camera: &Camera, max: f64) {
        let sheets = self.back_to_front(camera);
        let size = [image.width, image.height];
        let expected = each_pixel(camera, size, |ray| self.seen(ray, &sheets, BACKGROUND_F64));
        let rays = camera.rays(size[0], size[1]);
        let (mut num_unsure, mut worst, mut sum, mut num_seen) = (0, 0.0_f64, 0.0, 0);
        for (index, (middle, found)) in (0..).zip(expected.iter().zip(&image.pixels)) {
            let [x, y] = [index % size[0], index / size[0]].map(|i| f64::from(i) + 0.5);
            let (mut low, mut high) = (*middle, *middle);
            for [dx, dy] in [[0.01, 0.003], [-0.003, 0.01], [-0.01, -0.003], [0.003, -0.01]] {
                let beside = self.seen(&rays.ray(x + dx, y + dy), &sheets, BACKGROUND_F64);
                (0..3).for_each(|i| (low[i], high[i]) = (low[i].min(beside[i]), high[i].max(beside[i])));
            }
            let is_unsure = (0..3).any(|i| high[i] - low[i] > 0.02);
            num_unsure += usize::from(is_unsure);
            num_seen += usize::from((0..3).any(|i| (middle[i] - BACKGROUND_F64[i]).abs() > 0.02));
            for i in 0..3 {
                let found = f64::from(found[i]);
                assert!(found.is_finite(), "{what}: pixel {index} is {found}");
                // Outlines of many sheets may meet there, each on either side of the ray.
                let error = if is_unsure { 0.0 } else { (low[i] - found).max(found - high[i]).max(0.0) };
                worst = worst.max(error);
                sum += error * error;
            }
        }
        let num = expected.len();
        let rmse = (sum / (3 * num) as f64).sqrt();
        println!(
            "{what}: {num_unsure} of {num} pixels unsure (threshold 3 %), {num_seen} seen (at least 5 %)"
        );
        println!(
            "{what}: max {worst:.2e} (threshold {max:.1e}), rmse {rmse:.2e} (threshold {:.1e})",
            max / 4.0
        );
        assert!(num_unsure * 100 <= 3 * num, "{what}: {num_unsure} pixels change within a hundredth");
        assert!(num_seen * 20 > num, "{what}: {num_seen} pixels show something");
        assert!(worst <= max && rmse <= max / 4.0, "{what}: max {worst:e} of at most {max:e}, rmse {rmse:e}");
    }
}
