//! How a frame sees the lattice: where its points show, and where its planes are crossed.
//!
//! Lengths are in units of the shortest edge of a finest cell, so that neither tiny nor huge spacings leave the range
//! of f32.

use glam::{DVec3, IVec3};
use volery_frame::{PictureView, VolumeLayout};
use volery_scene::{Projection, RayGrid};

use crate::surfaces::Surfaces;
use crate::target::PACKET;

/// Steps of rays that all but stand still along an axis are this long, so that their inverse exists.
const LEAST_STEP: f64 = 1e-30;

/// A frame's view of a layout.
pub(super) struct View {
    /// In unit lengths.
    rays: RayGrid,
    /// World length of a unit.
    unit_length: f64,
    /// Unit lengths of a lattice step.
    pub(super) step: DVec3,
    /// In lattice steps.
    domain: DVec3,
    pub(super) is_perspective: bool,
    /// The eye, in unit lengths.
    pub(super) eye: DVec3,
    pub(super) forward: DVec3,
    /// What a place right and below of the eye is multiplied by to have its pixel, at depth 1 or for parallel rays.
    pub(super) pixels_per_length: [DVec3; 2],
    /// Of the picture.
    pub(super) size: [u32; 2],
}

/// Where sixteen rays cross lattice planes: plane `i` across `axis` at `i * length_per_step[axis] + at_origin[axis]`,
/// counted from where the ray enters the domain, or from its start if that is later.
pub(super) struct PacketRays {
    pub(super) length_per_step: [[f32; 16]; 3],
    pub(super) at_origin: [[f32; 16]; 3],
    /// Where the rays end.
    pub(super) end: [f32; 16],
}

impl View {
    pub(super) fn new(picture: &PictureView<'_>, layout: &VolumeLayout) -> Self {
        let unit_length = layout.spacing.min_element();
        let rays = picture.camera.rays(picture.width, picture.height);
        let is_perspective = matches!(picture.camera.projection, Projection::Perspective { .. });
        let scale = unit_length.recip();
        let (right, down) = if is_perspective {
            (rays.toward_dx, rays.toward_dy)
        } else {
            (rays.origin_dx * scale, rays.origin_dy * scale)
        };
        let rays = RayGrid {
            origin: rays.origin * scale,
            origin_dx: rays.origin_dx * scale,
            origin_dy: rays.origin_dy * scale,
            ..rays
        };
        Self {
            rays,
            unit_length,
            step: layout.spacing * (0.5 * scale),
            domain: 2.0 * DVec3::from_array(layout.cells.map(f64::from)),
            is_perspective,
            eye: picture.camera.eye * scale,
            forward: picture.camera.axes()[2],
            pixels_per_length: [right, down].map(|pixel| pixel / pixel.length_squared()),
            size: [picture.width, picture.height],
        }
    }

    #[inline]
    pub(super) fn unit_length(&self) -> f32 {
        self.unit_length as f32
    }

    /// From the eye to a lattice point, in unit lengths.
    #[inline]
    pub(super) fn toward(&self, point: [i32; 3]) -> DVec3 {
        IVec3::from_array(point).as_dvec3() * self.step - self.eye
    }

    /// The middle of the picture in pixels from its upper left corner.
    #[inline]
    pub(super) fn middle(&self) -> [f64; 2] {
        self.size.map(|n| 0.5 * f64::from(n))
    }

    /// The rays of the packet whose upper left pixel is `(column, row)`, to where surfaces are. Pixels outside the
    /// picture are as good as others.
    pub(super) fn packet(&self, column: u32, row: u32, surfaces: &Surfaces) -> PacketRays {
        let none = [[0.0; 16]; 3];
        let mut packet = PacketRays { length_per_step: none, at_origin: none, end: [f32::INFINITY; 16] };
        for lane in 0..16_u32 {
            let [column, row] = [column + lane % PACKET, row + lane / PACKET];
            let ray = self.rays.pixel(column, row);
            let origin = ray.origin / self.step;
            let direction = ray.direction / self.step;
            let direction = direction.map(|d| if d.abs() < LEAST_STEP { LEAST_STEP } else { d });
            let (low, high) = (-origin / direction, (self.domain - origin) / direction);
            let enter = low.min(high).max_element().max(0.0);
            if low.max(high).min_element() < enter {
                // All planes at 0: no cube is met.
                continue;
            }
            packet.end[lane as usize] = (surfaces.distance(column, row) / self.unit_length - enter) as f32;
            let entry = origin + enter * direction;
            for axis in 0..3 {
                packet.length_per_step[axis][lane as usize] = direction[axis].recip() as f32;
                packet.at_origin[axis][lane as usize] = (-entry[axis] / direction[axis]) as f32;
            }
        }
        packet
    }
}
