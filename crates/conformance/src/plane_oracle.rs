//! What cutting planes should show: every pixel by itself in f64, a search through all bricks, sums over corners.

use glam::DVec3;
use volery_scene::{Camera, Plane, Projection, Ray, TransferFunction};

use volery_frame::planes::{OUTLINE_PIXELS, outline_color};
use volery_frame::{
    Backend, BlendedBrick, Content, DrawError, Frame, Image, PictureView, PlacedBrick, Planes, PointTransfer,
    Sampling,
};

use super::oracle::{Pixels, assert_close};
use super::world::{BACKGROUND, BACKGROUND_F64, OwnedBrick, OwnedTexels, Volume};

/// Most pixels in whose neighbourhood the picture may jump, as a share of all.
const MAX_DOUBTFUL: f64 = 0.08;

/// How far around a pixel's centre a jump makes it doubtful, in pixels.
const DOUBT: f64 = 2e-3;

/// What to see of a volume.
pub(super) struct Look {
    pub(super) planes: Vec<Plane>,
    pub(super) transfer: TransferFunction,
    pub(super) sampling: Sampling,
    pub(super) is_transparent: bool,
    pub(super) shows_bricks: bool,
}

impl Look {
    /// Opaque planes, trilinear, without outlines.
    pub(super) fn opaque(planes: Vec<Plane>, transfer: TransferFunction) -> Self {
        let sampling = Sampling::Linear;
        Self { planes, transfer, sampling, is_transparent: false, shows_bricks: false }
    }
}

/// A brick with its low corners.
pub(super) type Blended = (OwnedBrick, u8);

/// Bricks that show their own samples alone.
pub(super) fn unblended(bricks: Vec<OwnedBrick>) -> Vec<Blended> {
    bricks.into_iter().map(|brick| (brick, 0)).collect()
}

/// The low corners of a cut: those that a coarser brick touches.
pub(super) fn blended(volume: &Volume, bricks: Vec<OwnedBrick>) -> Vec<Blended> {
    let placed: Vec<PlacedBrick> = bricks.iter().map(|brick| brick.placed).collect();
    let size = |brick: &PlacedBrick| volume.layout.brick_cells << brick.level;
    let low_corners = |brick: &PlacedBrick| {
        (0..8).fold(0_u8, |corners, corner| {
            let at: [u32; 3] =
                std::array::from_fn(|axis| brick.first_cell[axis] + size(brick) * (corner >> axis & 1));
            let touches = |other: &&PlacedBrick| {
                (0..3).all(|a| (other.first_cell[a]..=other.first_cell[a] + size(other)).contains(&at[a]))
            };
            let is_low = placed.iter().filter(touches).any(|other| other.level > brick.level);
            corners | u8::from(is_low) << corner
        })
    };
    let corners: Vec<_> = placed.iter().map(low_corners).collect();
    bricks.into_iter().zip(corners).collect()
}

/// Sets the volume, uploads and draws.
pub(super) fn try_draw(
    backend: &mut dyn Backend,
    volume: &Volume,
    bricks: &[Blended],
    look: &Look,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Result<Image, DrawError> {
    assert!(camera.defects().is_empty(), "the suite's camera: {:?}", camera.defects());
    backend.set_volume(&volume.layout).expect("the suite's volumes are small");
    let lent: Vec<_> = bricks.iter().map(|(brick, _)| brick.lend()).collect();
    backend.upload(&lent).expect("the suite's bricks fit the layout and are small");
    let placed =
        |(brick, low_corners): &Blended| BlendedBrick { placed: brick.placed, low_corners: *low_corners };
    let placed: Vec<_> = bricks.iter().map(placed).collect();
    let content = Content::Planes(Planes {
        planes: &look.planes,
        bricks: &placed,
        transfer: &PointTransfer::new(&look.transfer, &volume.layout),
        sampling: look.sampling,
        is_transparent: look.is_transparent,
        shows_bricks: look.shows_bricks,
    });
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    backend.draw(&frame).map(|drawn| drawn.image)
}

/// Draws, compares with the oracle, and returns both. `max` is for any channel of any pixel that is not doubtful.
pub(super) fn check(
    what: &str,
    backend: &mut dyn Backend,
    (volume, bricks): (&Volume, &[Blended]),
    look: &Look,
    camera: &Camera,
    size: [u32; 2],
    max: f64,
) -> Image {
    let image = try_draw(backend, volume, bricks, look, camera, size).expect("the suite's frames are right");
    let (mut expected, num_doubtful) = expected(volume, bricks, look, camera, size, max);
    for (expected, found) in expected.iter_mut().zip(&image.pixels) {
        if expected[0].is_nan() {
            *expected = found.map(f64::from);
        }
    }
    let share = num_doubtful as f64 / expected.len() as f64;
    println!("{what}: {share:.4} of the pixels are doubtful (threshold {MAX_DOUBTFUL})");
    assert!(share <= MAX_DOUBTFUL, "{what}: {share} of the pixels are doubtful");
    assert_close(what, &image, &expected, max, 0.5 * max);
    image
}

/// The picture, NaN where it jumps by about `max` within [`DOUBT`] pixels, and how many such pixels there are.
fn expected(
    volume: &Volume,
    bricks: &[Blended],
    look: &Look,
    camera: &Camera,
    [width, height]: [u32; 2],
    max: f64,
) -> (Pixels, usize) {
    let rays = camera.rays(width, height);
    let oracle = Oracle { volume, bricks, look, camera };
    let mut num_doubtful = 0;
    let mut pixels = Vec::new();
    for row in 0..height {
        for column in 0..width {
            let at = |dx: f64, dy: f64| {
                let [x, y] = [f64::from(column) + 0.5 + dx, f64::from(row) + 0.5 + dy];
                let ray = |dx, dy| rays.ray(x + dx, y + dy);
                oracle.light(&ray(0.0, 0.0), [&ray(1e-4, 0.0), &ray(0.0, 1e-4)])
            };
            let here = at(0.0, 0.0);
            // Where the picture is smooth, opposite sides differ by as much.
            let jumps = |dx: f64, dy: f64| {
                let (one, other) = (at(dx, dy), at(-dx, -dy));
                (0..3).any(|i| (one[i] + other[i] - 2.0 * here[i]).abs() > 0.5 * max)
            };
            let is_doubtful = jumps(DOUBT, DOUBT) || jumps(DOUBT, -DOUBT);
            num_doubtful += usize::from(is_doubtful);
            pixels.push(if is_doubtful { [f64::NAN; 3] } else { here });
        }
    }
    (pixels, num_doubtful)
}

struct Oracle<'a> {
    volume: &'a Volume,
    bricks: &'a [Blended],
    look: &'a Look,
    camera: &'a Camera,
}

impl Oracle<'_> {
    /// What a ray sees; `neighbours` are those a ten thousandth of a pixel to the right and down.
    fn light(&self, ray: &Ray, neighbours: [&Ray; 2]) -> [f64; 3] {
        let mut hits: Vec<_> = (0..self.look.planes.len()).filter_map(|i| self.hit(i, ray)).collect();
        hits.sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.plane.cmp(&b.plane)));
        let (mut light, mut transmittance) = ([0.0; 3], 1.0);
        for hit in &hits {
            let Some((brick, low_corners)) =
                self.bricks.iter().find(|(b, _)| self.holds(&b.placed, hit.place))
            else {
                continue;
            };
            let scale = f64::from(1_u32 << brick.placed.level);
            let in_brick = (hit.place - DVec3::from_array(brick.placed.first_cell.map(f64::from))) / scale;
            if (0..3).any(|axis| in_brick[axis] > f64::from(brick.samples[axis] - 1)) {
                continue;
            }
            let line = if self.look.shows_bricks { self.outline(brick, hit, neighbours) } else { 0.0 };
            let mut add = |color: [f64; 3], opacity: f64| {
                (0..3).for_each(|i| light[i] += transmittance * opacity * color[i]);
                transmittance *= 1.0 - opacity;
            };
            add(outline_color(brick.placed.level).map(f64::from), line);
            if let Some(([r, g, b], opacity)) = self.color(brick, *low_corners, in_brick) {
                add([r, g, b], if self.look.is_transparent { opacity } else { 1.0 });
            }
        }
        std::array::from_fn(|i| light[i] + transmittance * BACKGROUND_F64[i])
    }

    /// Where a ray meets a plane in the volume.
    fn hit(&self, plane: usize, ray: &Ray) -> Option<Hit> {
        let (layout, Plane { normal, distance }) = (&self.volume.layout, self.look.planes[plane]);
        let depth = (distance - normal.dot(ray.origin)) / normal.dot(ray.direction);
        let starts_at_eye = matches!(self.camera.projection, Projection::Perspective { .. });
        if !depth.is_finite() || depth < 0.0 || (starts_at_eye && depth == 0.0) {
            return None;
        }
        let mut place = (ray.origin + ray.direction * depth) / layout.spacing;
        for axis in 0..3 {
            if (0..3).all(|other| other == axis || normal[other] == 0.0) {
                // At the ends of the volume no rounding may push the plane out.
                let at = distance / normal[axis] / layout.spacing[axis];
                let near_end = (at - f64::from(layout.cells[axis])).abs() < 1e-12 * at.abs();
                place[axis] = if near_end { f64::from(layout.cells[axis]) } else { at };
            }
        }
        let cells = DVec3::from_array(layout.cells.map(f64::from));
        let is_inside = place.cmpge(DVec3::ZERO).all() && place.cmple(cells).all();
        is_inside.then_some(Hit { plane, depth, place })
    }

    fn holds(&self, placed: &PlacedBrick, place: DVec3) -> bool {
        let [low, high] = placed.bounds(&self.volume.layout);
        (0..3).all(|axis| {
            let (low, high) = (f64::from(low[axis]), f64::from(high[axis]));
            let is_end = high == f64::from(self.volume.layout.cells[axis]);
            place[axis] >= low && (place[axis] < high || is_end)
        })
    }

    fn outline(&self, brick: &OwnedBrick, hit: &Hit, neighbours: [&Ray; 2]) -> f64 {
        let [low, high] = brick.placed.bounds(&self.volume.layout);
        let unbounded = |ray: &Ray| {
            let Plane { normal, distance } = self.look.planes[hit.plane];
            let depth = (distance - normal.dot(ray.origin)) / normal.dot(ray.direction);
            (ray.origin + ray.direction * depth) / self.volume.layout.spacing
        };
        let moved = neighbours.map(|ray| (unbounded(ray) - hit.place) * 1e4);
        let pixels = (0..3).map(|axis| {
            let slope = moved[0][axis].hypot(moved[1][axis]);
            let distance =
                (hit.place[axis] - f64::from(low[axis])).min(f64::from(high[axis]) - hit.place[axis]);
            // Along a normal the place stands still, but for what rounding leaves of that.
            if slope > 1e-6 { distance / slope } else { f64::INFINITY }
        });
        let width = 0.5 * f64::from(OUTLINE_PIXELS) + 0.5;
        (width - pixels.fold(f64::INFINITY, f64::min)).clamp(0.0, 1.0)
    }

    /// Straight colour and opacity at a place in samples of a brick; `None` where it is blank.
    fn color(&self, brick: &OwnedBrick, low_corners: u8, place: DVec3) -> Option<([f64; 3], f64)> {
        let size = f64::from(self.volume.layout.brick_cells);
        let ratio: f64 = (0..8)
            .filter(|corner| low_corners >> corner & 1 == 1)
            .map(|corner| corner_weight(corner, place / size))
            .sum();
        let ratio = if low_corners == 255 { 1.0 } else { ratio };
        let sampling = self.look.sampling;
        let high = if ratio < 1.0 { sampled(brick, place, 1, sampling) } else { Some([0.0; 4]) }?;
        let low = if ratio > 0.0 { sampled(brick, place, 2, sampling) } else { Some([0.0; 4]) }?;
        let mixed: [f64; 4] = std::array::from_fn(|i| (1.0 - ratio) * high[i] + ratio * low[i]);
        if let OwnedTexels::Rgba8(_) = brick.texels {
            let [r, g, b, a] = mixed.map(|x| x / 255.0);
            return Some(([r, g, b], a));
        }
        let layout = &self.volume.layout;
        Some(self.look.transfer.classify(layout.value_offset + layout.value_scale * mixed[0]))
    }
}

struct Hit {
    plane: usize,
    depth: f64,
    /// In finest cells.
    place: DVec3,
}

fn corner_weight(corner: usize, at: DVec3) -> f64 {
    (0..3).map(|axis| if corner >> axis & 1 == 1 { at[axis] } else { 1.0 - at[axis] }).product()
}

/// Every `step`-th sample of a brick and the last, as a field; `None` where it is blank.
fn sampled(brick: &OwnedBrick, place: DVec3, step: u32, sampling: Sampling) -> Option<[f64; 4]> {
    let place = place / f64::from(step);
    let texel = |index: [u32; 3]| {
        let [x, y, z]: [usize; 3] =
            std::array::from_fn(|axis| (index[axis] * step).min(brick.samples[axis] - 1) as usize);
        let at = (z * brick.samples[1] as usize + y) * brick.samples[0] as usize + x;
        let value = match &brick.texels {
            OwnedTexels::U8(texels) => f64::from(texels[at]),
            OwnedTexels::U16(texels) => f64::from(texels[at]),
            OwnedTexels::F32(texels) => f64::from(texels[at]),
            OwnedTexels::Rgba8(texels) => return Some(texels[at].map(f64::from)),
        };
        value.is_finite().then_some([value; 4])
    };
    if sampling == Sampling::Nearest {
        return texel((place + 0.5).floor().to_array().map(|i| i as u32));
    }
    let last_cell = brick.samples.map(|n| f64::from((n - 1).div_ceil(step).max(1) - 1));
    let cell = place.floor().min(DVec3::from_array(last_cell));
    let mut sum = [0.0; 4];
    for corner in 0..8 {
        let index = std::array::from_fn(|axis| cell[axis] as u32 + (corner as u32 >> axis & 1));
        let weight = corner_weight(corner, place - cell);
        let texel = texel(index)?;
        (0..4).for_each(|i| sum[i] += weight * texel[i]);
    }
    Some(sum)
}
