//! The truth of cutting planes: what the full-resolution samples show where each pixel's ray meets them.
//!
//! A ray meets a plane at `t = (distance - normal · origin) / (normal · direction)`, in `f64`. There the field is
//! trilinear (or the nearest sample), and the transfer function gives colour and opacity, with no length involved.
//! Planes are composed front to back along each ray, so that those which cut one another hide one another right;
//! at equal distance the one listed first is in front.

use glam::DVec3;
use volery_scene::{Camera, Plane, Ray, SampleType, TransferFunction, TriangleMesh, VoxelGrid};

use crate::image::Image;
use crate::render::{Error, picture};
use crate::surfaces::Backdrop;

/// Distance beyond the domain's faces, relative to the reach of the scene, that counts as on them: a plane that
/// coincides with a face is seen in spite of rounding.
const FACE_SLACK: f64 = 1e-12;

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
        picture(camera, size, (self.meshes, background), progress, |ray, backdrop| {
            self.trace_to(ray, backdrop)
        })
    }

    /// What one ray sees of the planes.
    pub fn trace(&self, ray: &Ray, background: [f64; 3]) -> [f64; 3] {
        self.trace_to(ray, &Backdrop::far(background))
    }

    fn trace_to(&self, ray: &Ray, backdrop: &Backdrop) -> [f64; 3] {
        let hit = |plane: &Plane| {
            let Plane { normal, distance } = plane.normalized();
            (distance - normal.dot(ray.origin)) / normal.dot(ray.direction)
        };
        let is_seen = |t: &f64| *t >= 0.0 && t.is_finite() && *t < backdrop.distance;
        let mut hits: Vec<f64> = self.planes.iter().map(hit).filter(is_seen).collect();
        // Stable, so that of equals the first stays in front.
        hits.sort_by(f64::total_cmp);
        let (mut color, mut clear) = ([0.0; 3], 1.0);
        for t in hits {
            let Some((seen, opacity)) = self.at(ray.origin, ray.direction * t) else { continue };
            let opacity = if self.is_transparent { opacity } else { 1.0 };
            (0..3).for_each(|i| color[i] += clear * opacity * seen[i]);
            clear *= 1.0 - opacity;
        }
        std::array::from_fn(|i| color[i] + clear * backdrop.color[i])
    }

    /// Colour and opacity at `origin + way`; `None` outside the domain and where it is blank.
    fn at(&self, origin: DVec3, way: DVec3) -> Option<([f64; 3], f64)> {
        let spacing = self.grid.spacing();
        let last = DVec3::from_array(self.grid.dims().map(|n| (n - 1) as f64));
        let slack = (origin.abs() + way.abs()) / spacing * FACE_SLACK;
        let place = (origin + way) / spacing;
        if (place + slack).cmplt(DVec3::ZERO).any() || (place - slack).cmpgt(last).any() {
            return None;
        }
        let place = place.clamp(DVec3::ZERO, last);
        let channel = |channel: usize| self.field(place, channel).filter(|value| value.is_finite());
        match self.grid.sample_type() {
            SampleType::Rgb8 => Some(([channel(0)?, channel(1)?, channel(2)?].map(|x| x / 255.0), 1.0)),
            SampleType::Rgba8 => {
                Some(([channel(0)?, channel(1)?, channel(2)?].map(|x| x / 255.0), channel(3)? / 255.0))
            }
            _ => Some(self.transfer.classify(channel(0)?)),
        }
    }

    /// The field of a channel at a place in the domain, in units of samples.
    fn field(&self, place: DVec3, channel: usize) -> Option<f64> {
        let dims = self.grid.dims();
        let sample =
            |[x, y, z]: [usize; 3]| self.grid.samples().value((z * dims[1] + y) * dims[0] + x, channel);
        if self.nearest {
            return Some(sample(place.to_array().map(|x| (x + 0.5 + MIDDLE_SLACK).floor() as usize)));
        }
        let low =
            std::array::from_fn(|axis| (place[axis].floor() as usize).min(dims[axis].saturating_sub(2)));
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut at = low;
            for axis in 0..3 {
                let w = place[axis] - low[axis] as f64;
                if corner >> axis & 1 == 1 {
                    at[axis] = (low[axis] + 1).min(dims[axis] - 1);
                    weight *= w;
                } else {
                    weight *= 1.0 - w;
                }
            }
            let value = sample(at);
            if !value.is_finite() {
                return None;
            }
            sum += weight * value;
        }
        Some(sum)
    }
}
