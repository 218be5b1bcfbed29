//! The truth of cutting planes: what the full-resolution samples show where each pixel's ray meets them.
//!
//! A ray meets a plane at `t = (distance - normal · origin) / (normal · direction)`, in `f64`. There the field is
//! trilinear (or the nearest sample), and the transfer function gives colour and opacity, with no length involved.
//! The field counts from the nearest sample, so between equal samples it has their value to the last bit, which may be
//! that of a step.
//! Planes are composed front to back along each ray, so that those which cut one another hide one another right;
//! at equal distance the one listed first is in front.

use glam::DVec3;
use volery_scene::{Camera, Plane, Ray, SampleType, TransferFunction, TriangleMesh, VoxelGrid};

use crate::cell;
use crate::field::Field;
use crate::image::Image;
use crate::render::{Error, picture};
use crate::surfaces::Backdrop;
use crate::transfer::Bands;

/// Distance from a layer of samples, relative to the reach of the domain, that counts as in it: a plane that coincides
/// with a face is seen in spite of rounding.
const LAYER_SLACK: f64 = 1e-12;

/// How near to the middle between two samples, in units of samples, a place is in the middle: the upper one counts
/// there. The middle plane of an even number of samples is such a place, in spite of rounding.
const MIDDLE_SLACK: f64 = 1e-9;

/// Planes through a grid, and how they are seen.
#[derive(Clone, Copy, Debug)]
pub struct PlaneScene<'a> {
    /// The samples: scalars, or colours of 8 bits a channel.
    pub grid: &'a VoxelGrid,
    /// In world space, without defects.
    pub planes: &'a [Plane],
    /// Value to colour and opacity; not read for colours.
    pub transfer: &'a TransferFunction,
    /// Whether the nearest sample counts in place of the trilinear field.
    pub nearest: bool,
    /// Whether opacity lets light through; else planes are opaque where they are not blank.
    pub is_transparent: bool,
    /// Opaque surfaces among the planes: they hide what is not before them.
    pub meshes: &'a [TriangleMesh],
}

impl PlaneScene<'_> {
    /// The picture in front of `background`. Calls `progress` with the finished part in [0, 1], from any thread.
    ///
    /// # Errors
    /// When the camera or the size is not meaningful.
    pub fn render(
        &self,
        camera: &Camera,
        background: [f64; 3],
        size: [u32; 2],
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Image, Error> {
        let bands = Bands::new(self.transfer);
        picture(camera, size, (self.meshes, background), progress, |ray, backdrop| {
            self.trace_to(ray, &bands, backdrop)
        })
    }

    /// What one ray sees of the planes.
    pub fn trace(&self, ray: &Ray, background: [f64; 3]) -> [f64; 3] {
        self.trace_to(ray, &Bands::new(self.transfer), &Backdrop::far(background))
    }

    fn trace_to(&self, ray: &Ray, bands: &Bands, backdrop: &Backdrop) -> [f64; 3] {
        let is_seen = |hit: &Hit| hit.t >= 0.0 && hit.t.is_finite() && hit.t < backdrop.distance;
        let mut hits: Vec<Hit> =
            self.planes.iter().map(|plane| Hit::of(ray, &plane.normalized())).filter(is_seen).collect();
        // Stable, so that of equals the first stays in front.
        hits.sort_by(|a, b| a.t.total_cmp(&b.t));
        let (mut color, mut clear) = ([0.0; 3], 1.0);
        for hit in hits {
            let Some((seen, opacity)) = self.at(hit.place, bands) else { continue };
            let opacity = if self.is_transparent { opacity } else { 1.0 };
            (0..3).for_each(|i| color[i] += clear * opacity * seen[i]);
            clear *= 1.0 - opacity;
        }
        std::array::from_fn(|i| color[i] + clear * backdrop.color[i])
    }

    /// Colour and opacity at a place; `None` outside the domain and where it is blank.
    fn at(&self, place: DVec3, bands: &Bands) -> Option<([f64; 3], f64)> {
        let place = self.in_samples(place)?;
        if self.nearest {
            let nearest = place.to_array().map(|x| (x + 0.5 + MIDDLE_SLACK).floor() as usize);
            return self.look(bands, |channel| Some((self.sample(nearest, channel), 0.0)));
        }
        let low = std::array::from_fn(|axis| {
            (place[axis].floor() as usize).min(self.grid.dims()[axis].saturating_sub(2))
        });
        let local = place - DVec3::from_array(low.map(|n| n as f64));
        self.look(bands, |channel| {
            let corners = std::array::from_fn(|corner| {
                let upper = |axis: usize| corner >> axis & 1;
                self.sample(
                    [0, 1, 2].map(|axis| (low[axis] + upper(axis)).min(self.grid.dims()[axis] - 1)),
                    channel,
                )
            });
            cell::range(&corners)?;
            let base = cell::base(&corners, local, local);
            Some((base, cell::along(&corners, base, local, local).at(0.0)))
        })
    }

    /// A place in units of samples; `None` outside the domain. Within rounding of a layer of samples it is in the
    /// layer: of a plane that coincides with one, the layer is seen, not a mixture with the next.
    fn in_samples(&self, place: DVec3) -> Option<DVec3> {
        let spacing = self.grid.spacing();
        let last = DVec3::from_array(self.grid.dims().map(|n| (n - 1) as f64));
        let slack = (place.abs().max_element().max(self.grid.extent().max_element()) / spacing * LAYER_SLACK)
            .min(DVec3::splat(0.5));
        let place = place / spacing;
        let layer = place.round();
        let place = DVec3::select((place - layer).abs().cmple(slack), layer, place);
        (place.cmpge(DVec3::ZERO).all() && place.cmple(last).all()).then_some(place)
    }

    fn sample(&self, [x, y, z]: [usize; 3], channel: usize) -> f64 {
        let dims = self.grid.dims();
        self.grid.samples().value((z * dims[1] + y) * dims[0] + x, channel)
    }

    /// Colour and opacity where each channel's field is as far above a base as said.
    fn look(&self, bands: &Bands, field: impl Fn(usize) -> Option<(f64, f64)>) -> Option<([f64; 3], f64)> {
        let unit = |channel: usize| field(channel).map(|(base, above)| (base + above) / 255.0);
        match self.grid.sample_type() {
            SampleType::Rgb8 => Some(([unit(0)?, unit(1)?, unit(2)?], 1.0)),
            SampleType::Rgba8 => Some(([unit(0)?, unit(1)?, unit(2)?], unit(3)?)),
            _ => {
                let (base, above) = field(0)?;
                let place = bands.at(above, base);
                base.is_finite().then(|| (place.color(), place.opacity()))
            }
        }
    }
}

/// Where a ray meets a plane.
struct Hit {
    /// Along the ray.
    t: f64,
    place: DVec3,
}

impl Hit {
    /// With a plane of unit normal. From afar `t` is too coarse to find the place, so it is found again from near.
    fn of(ray: &Ray, plane: &Plane) -> Self {
        let steps = |place: DVec3| -plane.signed_distance(place) / plane.normal.dot(ray.direction);
        let t = steps(ray.origin);
        let moved = |axis: usize| ray.direction[axis].mul_add(t, ray.origin[axis]);
        let near = DVec3::new(moved(0), moved(1), moved(2));
        Self { t, place: near + ray.direction * steps(near) }
    }
}
