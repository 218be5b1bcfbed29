//! Where the picture is taken from: perspective and orthographic cameras, and their rays.

use glam::DVec3;

/// How the view is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// All rays start at the eye.
    Perspective {
        /// Full vertical angle of view in degrees, in (0, 180).
        fov_y_deg: f64,
    },
    /// All rays are parallel to the view direction and start on the plane through the eye.
    Orthographic {
        /// Height of the picture in world units.
        height: f64,
    },
}

/// A camera: where it stands, where it looks, what is up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World position of the eye.
    pub eye: DVec3,
    /// A world point in the middle of the picture.
    pub target: DVec3,
    /// A world direction that points up in the picture; need not be orthogonal to the view.
    pub up: DVec3,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Whether left and right of the picture change sides. So a camera in a mirror image of the world takes the picture
    /// that it takes of the world.
    pub is_mirrored: bool,
}

/// One thing that is wrong with a camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// A coordinate of eye, target or up is not finite.
    #[error("camera: eye, target and up must be finite")]
    NotFinite,
    /// Eye and target coincide.
    #[error("camera: eye and target are the same point, expected a direction to look in")]
    NoDirection,
    /// `up` is zero or parallel to the view.
    #[error("camera: up is parallel to the view direction, expected another direction")]
    NoUp,
    /// The angle of view is outside (0, 180).
    #[error("camera: fov_y_deg is {found}, expected above 0 and below 180")]
    FieldOfView {
        /// The angle as given, in degrees.
        found: f64,
    },
    /// The height is not positive and finite.
    #[error("camera: height is {found}, expected a positive finite number")]
    Height {
        /// The height as given, in world units.
        found: f64,
    },
}

/// A ray in world space; points are `origin + t * direction` for `t >= 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: DVec3,
    /// Unit vector.
    pub direction: DVec3,
}

/// The rays of all pixels of a picture: affine in the pixel's coordinates.
///
/// The ray of the image point `(x, y)` in pixels from the top left corner starts at
/// `origin + x * origin_dx + y * origin_dy` and goes along `toward + x * toward_dx + y * toward_dy`
/// (not normalised).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayGrid {
    /// Start of the ray of the top left corner.
    pub origin: DVec3,
    /// Change of the start per pixel to the right; zero in perspective.
    pub origin_dx: DVec3,
    /// Change of the start per pixel down; zero in perspective.
    pub origin_dy: DVec3,
    /// Direction of the ray of the top left corner, not normalised.
    pub toward: DVec3,
    /// Change of the direction per pixel to the right; zero in orthographic views.
    pub toward_dx: DVec3,
    /// Change of the direction per pixel down; zero in orthographic views.
    pub toward_dy: DVec3,
}

impl RayGrid {
    /// The ray through the image point `(x, y)`, in pixels from the top left corner.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        Ray {
            origin: self.origin + self.origin_dx * x + self.origin_dy * y,
            direction: (self.toward + self.toward_dx * x + self.toward_dy * y).normalize(),
        }
    }

    /// The ray through the centre of pixel `(column, row)`; row 0 is the top.
    #[inline]
    pub fn pixel(&self, column: u32, row: u32) -> Ray {
        self.ray(f64::from(column) + 0.5, f64::from(row) + 0.5)
    }
}

impl Camera {
    /// Everything that keeps this camera from taking a picture.
    pub fn defects(&self) -> Vec<Defect> {
        let mut defects = Vec::new();
        let view = self.target - self.eye;
        if !(self.eye.is_finite() && self.target.is_finite() && self.up.is_finite()) {
            defects.push(Defect::NotFinite);
        } else if view.length_squared() == 0.0 || !view.length_squared().is_finite() {
            defects.push(Defect::NoDirection);
        } else {
            let sine = view.normalize().cross(self.up.normalize_or_zero()).length();
            if sine < 1e-9 {
                defects.push(Defect::NoUp);
            }
        }
        match self.projection {
            Projection::Perspective { fov_y_deg: found } if !(found > 0.0 && found < 180.0) => {
                defects.push(Defect::FieldOfView { found });
            }
            Projection::Orthographic { height: found } if !(found > 0.0 && found.is_finite()) => {
                defects.push(Defect::Height { found });
            }
            _ => {}
        }
        defects
    }

    /// Unit vectors `(right, up, forward)` of the picture in world space; left-handed where it is mirrored. Meaningful
    /// when [`Camera::defects`] finds nothing.
    pub fn axes(&self) -> [DVec3; 3] {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        [if self.is_mirrored { -right } else { right }, right.cross(forward), forward]
    }

    /// The rays of a picture of `width` by `height` pixels. Meaningful when [`Camera::defects`] finds
    /// nothing. Pixels are square.
    pub fn rays(&self, width: u32, height: u32) -> RayGrid {
        let [right, up, forward] = self.axes();
        let (width, height) = (f64::from(width), f64::from(height));
        let half_height = match self.projection {
            Projection::Perspective { fov_y_deg } => (fov_y_deg.to_radians() / 2.0).tan(),
            Projection::Orthographic { height } => height / 2.0,
        };
        let half_width = half_height * width / height;
        let corner = up * half_height - right * half_width;
        let dx = right * (2.0 * half_width / width);
        let dy = -up * (2.0 * half_height / height);
        match self.projection {
            Projection::Perspective { .. } => RayGrid {
                origin: self.eye,
                origin_dx: DVec3::ZERO,
                origin_dy: DVec3::ZERO,
                toward: forward + corner,
                toward_dx: dx,
                toward_dy: dy,
            },
            Projection::Orthographic { .. } => RayGrid {
                origin: self.eye + corner,
                origin_dx: dx,
                origin_dy: dy,
                toward: forward,
                toward_dx: DVec3::ZERO,
                toward_dy: DVec3::ZERO,
            },
        }
    }

    /// A camera that shows all of the box `[0, extent]`, seen from `azimuth_deg` (about z, 0 looks along
    /// +y, positive turns the eye towards +x) and `elevation_deg` (above the xy plane), with `zoom` above
    /// 1 coming nearer. z is up.
    pub fn fitted(
        extent: DVec3,
        azimuth_deg: f64,
        elevation_deg: f64,
        zoom: f64,
        orthographic: bool,
    ) -> Self {
        let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
        let toward_eye =
            DVec3::new(elevation.cos() * azimuth.sin(), -elevation.cos() * azimuth.cos(), elevation.sin());
        // Straight up or down, "up" is where the azimuth looks to.
        let up = if elevation.cos().abs() < 1e-6 {
            DVec3::new(-azimuth.sin(), azimuth.cos(), 0.0) * elevation.sin().signum()
        } else {
            DVec3::Z * elevation.cos().signum()
        };
        let target = extent / 2.0;
        let radius = (extent.length() / 2.0).max(f64::MIN_POSITIVE) / zoom;
        let fov_y_deg = 30.0_f64;
        let distance = radius / (fov_y_deg / 2.0).to_radians().sin();
        let projection = if orthographic {
            Projection::Orthographic { height: 2.0 * radius }
        } else {
            Projection::Perspective { fov_y_deg }
        };
        let distance = if orthographic { distance.max(extent.length()) } else { distance };
        Self { eye: target + toward_eye * distance, target, up, projection, is_mirrored: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            eye: DVec3::new(0.0, -10.0, 0.0),
            target: DVec3::ZERO,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 90.0 },
            is_mirrored: false,
        }
    }

    #[test]
    fn row_zero_is_the_top_and_column_zero_the_left() {
        let rays = camera().rays(200, 100);
        let corner = rays.ray(0.0, 0.0).direction;
        let expected = DVec3::new(-2.0, 1.0, 1.0).normalize();
        assert!((corner - expected).length() < 1e-15, "{corner}");
        assert!((rays.ray(100.0, 50.0).direction - DVec3::Y).length() < 1e-15);
    }

    #[test]
    fn orthographic_rays_are_parallel() {
        let rays = Camera { projection: Projection::Orthographic { height: 4.0 }, ..camera() }.rays(4, 4);
        let ray = rays.pixel(0, 0);
        assert_eq!(ray.direction, DVec3::Y);
        assert_eq!(ray.origin, DVec3::new(-1.5, -10.0, 1.5));
    }

    #[test]
    fn defects_are_found() {
        let at_target = Camera { eye: DVec3::ZERO, ..camera() };
        assert_eq!(at_target.defects(), [Defect::NoDirection]);
        let no_up = Camera { up: DVec3::Y, ..camera() };
        assert_eq!(no_up.defects(), [Defect::NoUp]);
        let flat = Camera { projection: Projection::Perspective { fov_y_deg: 180.0 }, ..camera() };
        assert_eq!(flat.defects(), [Defect::FieldOfView { found: 180.0 }]);
        let nan = Camera { eye: DVec3::NAN, ..camera() };
        assert_eq!(nan.defects(), [Defect::NotFinite]);
        assert!(camera().defects().is_empty());
    }

    #[test]
    fn a_fitted_camera_sees_every_corner() {
        let extent = DVec3::new(10.0, 3.0, 7.0);
        for (azimuth, elevation) in [(30.0, 20.0), (0.0, 90.0), (200.0, -90.0), (90.0, -35.0)] {
            for orthographic in [false, true] {
                let camera = Camera::fitted(extent, azimuth, elevation, 1.0, orthographic);
                assert!(camera.defects().is_empty(), "{azimuth} {elevation}");
                let [right, up, forward] = camera.axes();
                for corner in 0..8 {
                    let pick = |bit: usize, size: f64| if corner >> bit & 1 == 1 { size } else { 0.0 };
                    let p = DVec3::new(pick(0, extent.x), pick(1, extent.y), pick(2, extent.z)) - camera.eye;
                    let half = match camera.projection {
                        Projection::Perspective { fov_y_deg } => {
                            (fov_y_deg.to_radians() / 2.0).tan() * p.dot(forward)
                        }
                        Projection::Orthographic { height } => height / 2.0,
                    };
                    assert!(p.dot(forward) > 0.0);
                    assert!(p.dot(right).abs() <= half * 1.001 && p.dot(up).abs() <= half * 1.001);
                }
            }
        }
    }
}
