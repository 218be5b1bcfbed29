//! Cameras: from outside, inside, far away, and parallel with rays exactly on the faces of the domain.

use std::f64::consts::PI;

use volery::glam::DVec3;
use volery::{Camera, Projection};

use crate::random::Random;

/// Pictures are so many pixels wide and high at least and at most.
const SIDES: [usize; 2] = [24, 40];

pub(crate) const VIEWS: [&str; 6] = ["outside", "outside", "inside", "faces", "parallel", "far"];

/// A picture's size.
pub(crate) fn size(random: &mut Random) -> [u32; 2] {
    std::array::from_fn(|_| random.whole(SIDES[0], SIDES[1]) as u32)
}

/// A camera of a kind of view of the box `[0, extent]`.
pub(crate) fn camera(
    random: &mut Random,
    view: &str,
    extent: DVec3,
    spacing: DVec3,
    size: [u32; 2],
) -> Camera {
    let radius = extent.length() / 2.0;
    let target = extent * random.vector(0.4, 0.6);
    match view {
        "inside" => {
            let eye = extent * random.vector(0.05, 0.95);
            let fov_y_deg = random.within(30.0, 110.0);
            looking(random, eye, |direction| eye + direction * radius, Projection::Perspective { fov_y_deg })
        }
        "faces" => on_faces(random, extent, spacing, size),
        "parallel" => {
            let height = 2.0 * radius * random.within(0.3, 1.1);
            let distance = radius * random.within(1.1, 4.0);
            let eye = target - random.direction() * distance;
            looking(random, eye, |_| target, Projection::Orthographic { height })
        }
        _ => {
            let distance =
                radius * if view == "far" { random.decades(2.0, 9.0) } else { random.within(1.3, 6.0) };
            let angle = 2.0 * (radius / distance).asin() * random.within(0.3, 1.0);
            let eye = target - random.direction() * distance;
            looking(random, eye, |_| target, Projection::Perspective { fov_y_deg: angle * 180.0 / PI })
        }
    }
}

/// A camera with some direction upwards.
fn looking(
    random: &mut Random,
    eye: DVec3,
    target: impl Fn(DVec3) -> DVec3,
    projection: Projection,
) -> Camera {
    loop {
        let camera = Camera {
            eye,
            target: target(random.direction()),
            up: random.direction(),
            projection,
            is_mirrored: false,
        };
        if camera.defects().is_empty() && camera.axes().iter().all(|axis| axis.is_finite()) {
            return camera;
        }
    }
}

/// A parallel view along an axis whose pixels are as far apart as samples, with a column and a row of rays
/// exactly in faces of the domain. Exact where spacings are powers of two.
fn on_faces(random: &mut Random, extent: DVec3, spacing: DVec3, [width, height]: [u32; 2]) -> Camera {
    let forward_axis = random.whole(0, 2);
    let (right_axis, up_axis) = ((forward_axis + 1) % 3, (forward_axis + 2) % 3);
    let step = spacing[right_axis].min(spacing[up_axis]);
    let unit = |axis: usize, sign: f64| DVec3::AXES[axis] * sign;
    let (forward, up) =
        (unit(forward_axis, random.pick(&[-1.0, 1.0])), unit(up_axis, random.pick(&[-1.0, 1.0])));
    // Where the middle of the picture is, so that a pixel near its edge looks along a face.
    let mut middle = |axis: usize, pixels: u32| {
        let (face, inwards) = random.pick(&[(0.0, 1.0), (extent[axis], -1.0)]);
        let pixel = random.whole(1, pixels as usize / 3) as f64 + 0.5;
        face + inwards * (f64::from(pixels) / 2.0 - pixel) * step
    };
    let mut eye = DVec3::ZERO;
    eye[right_axis] = middle(right_axis, width);
    eye[up_axis] = middle(up_axis, height);
    let away = spacing[forward_axis] * 2.0;
    eye[forward_axis] = if forward[forward_axis] > 0.0 { -away } else { extent[forward_axis] + away };
    let target = eye + forward * spacing[forward_axis];
    Camera {
        eye,
        target,
        up,
        projection: Projection::Orthographic { height: step * f64::from(height) },
        is_mirrored: false,
    }
}
