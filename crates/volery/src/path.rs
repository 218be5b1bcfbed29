//! Ways of a camera: sequences of pictures.

use std::f64::consts::TAU;

use glam::DQuat;
use volery_scene::{Camera, Projection};

/// How near a camera comes that zooms, as a share of its distance, or of the height that it sees.
const NEAREST: f64 = 0.5;

/// A way from a camera on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// Once around what the camera looks at, about its own upwards direction.
    Orbit,
    /// Half as far away at the end.
    Zoom,
    /// Li and Shen 2001 (section 5): a quarter of the pictures nearer, half of them around, a quarter farther away again.
    Paper,
}

impl Path {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Orbit, Self::Zoom, Self::Paper];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Orbit => "orbit",
            Self::Zoom => "zoom",
            Self::Paper => "paper",
        }
    }

    /// The camera of one of `num` pictures, from 0; `start` is the first.
    #[must_use]
    pub fn camera(self, start: &Camera, picture: usize, num: usize) -> Camera {
        let (done, num) = (picture as f64, num.max(1) as f64);
        match self {
            Self::Orbit => turned(start, done / num),
            Self::Zoom => nearer(start, done / (num - 1.0).max(1.0)),
            Self::Paper => {
                let quarter = num / 4.0;
                let near = (done / quarter).min((num - done) / quarter).clamp(0.0, 1.0);
                nearer(&turned(start, ((done - quarter) / (2.0 * quarter)).clamp(0.0, 1.0)), near)
            }
        }
    }
}

/// Some turns around the target.
fn turned(camera: &Camera, turns: f64) -> Camera {
    let [_, up, _] = camera.axes();
    let eye = camera.target + DQuat::from_axis_angle(up, TAU * turns) * (camera.eye - camera.target);
    Camera { eye, up, ..*camera }
}

/// From the camera's place, at 0, to the nearest, at 1.
fn nearer(camera: &Camera, share: f64) -> Camera {
    let factor = NEAREST.powf(share);
    match camera.projection {
        Projection::Perspective { .. } => {
            Camera { eye: camera.target + factor * (camera.eye - camera.target), ..*camera }
        }
        Projection::Orthographic { height } => {
            Camera { projection: Projection::Orthographic { height: factor * height }, ..*camera }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn ways_begin_at_the_camera_and_end_where_they_shall() {
        let start = Camera {
            eye: DVec3::new(10.0, 2.0, 3.0),
            target: DVec3::new(1.0, 2.0, 0.5),
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y_deg: 30.0 },
            is_mirrored: false,
        };
        let distance =
            |camera: &Camera| (camera.eye - camera.target).length() / (start.eye - start.target).length();
        for path in Path::ALL {
            let all: Vec<_> = (0..200).map(|picture| path.camera(&start, picture, 200)).collect();
            assert!((all[0].eye - start.eye).length() < 1e-12, "{path:?}");
            let step = all.windows(2).map(|pair| (pair[1].eye - pair[0].eye).length()).fold(0.0, f64::max);
            assert!(step < 0.7, "{path:?} jumps by {step}");
            assert!(all.iter().all(|camera| camera.defects().is_empty()), "{path:?}");
            let ends = match path {
                Path::Orbit => (1.0, 1.0),
                Path::Zoom => (1.0, 0.5),
                Path::Paper => (0.5, 0.5_f64.powf(0.02)),
            };
            assert!(
                (distance(&all[100]) - ends.0).abs() < 0.31 * f64::from(u8::from(path == Path::Zoom)) + 1e-9
            );
            assert!((distance(&all[199]) - ends.1).abs() < 1e-9, "{path:?}: {}", distance(&all[199]));
            // One picture stays where it is.
            assert!((path.camera(&start, 0, 1).eye - start.eye).length() < 1e-12);
        }
    }
}
