//! Vertices in few bytes.

use glam::DVec3;

/// What quantised numbers mean: `x = low + scale * i`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantization {
    /// Of x, y, z relative to the origin, and of the value: what 0 stands for.
    pub low: [f32; 4],
    /// What one step stands for.
    pub scale: [f32; 4],
    /// What one step of 255 of a gradient's magnitude stands for.
    pub magnitude_scale: f32,
}

impl Quantization {
    /// The nearest numbers; a value that is not a number is 0.
    pub fn point(&self, place: DVec3, value: f64) -> [u16; 4] {
        let parts = [place.x, place.y, place.z, value];
        std::array::from_fn(|part| {
            let scale = f64::from(self.scale[part]);
            let step = if scale > 0.0 { (parts[part] - f64::from(self.low[part])) / scale } else { 0.0 };
            // A cast keeps to the range, and makes 0 of what is no number.
            step.round() as u16
        })
    }

    /// The nearest numbers for a direction of unit length, or zero, and a magnitude.
    pub fn gradient(&self, direction: DVec3, magnitude: f64) -> [i8; 4] {
        let scale = f64::from(self.magnitude_scale);
        let step = if scale > 0.0 { (magnitude / scale).round() as u8 } else { 0 };
        let [x, y, z] = direction.to_array().map(|part| (part * 127.0).round() as i8);
        [x, y, z, step.cast_signed()]
    }

    /// Place relative to the origin.
    pub fn place(&self, point: [u16; 4]) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|part| self.part(point, part)))
    }

    /// The value.
    pub fn value(&self, point: [u16; 4]) -> f64 {
        self.part(point, 3)
    }

    fn part(&self, point: [u16; 4], part: usize) -> f64 {
        f64::from(self.low[part]) + f64::from(self.scale[part]) * f64::from(point[part])
    }
}
