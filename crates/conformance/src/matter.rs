//! What matter looks like: closed forms of uniform cubes and ramps, and every extreme of opacity.

use glam::DVec3;
use volery_scene::Camera;

use volery_frame::{Backend, TexelType};

use super::STOP_TRANSMITTANCE;
use super::oracle::{
    assert_background, assert_close, assert_shows_something, chord, each_pixel, march_volume, over,
};
use super::world::{BACKGROUND, BACKGROUND_F64, Storage, Volume, draw, transfer};

const SIZE: [u32; 2] = [48, 40];

fn cube(dims: [u32; 3], value: f64) -> Volume {
    Volume::new(dims, DVec3::ONE, Storage::F32, move |_| value)
}

/// A cube of one value shows `c (1 - exp(-s l)) + exp(-s l) background` over its chord `l`.
fn uniform_cube(backend: &mut dyn Backend, orthographic: bool) {
    let volume = cube([21, 17, 25], 0.7);
    let color = [0.9, 0.4, 0.2];
    let tf = transfer(&[[0.0, 0.9, 0.4, 0.2, 0.08]], 1.0);
    let depth_per_length = -(-0.08_f64).ln_1p();
    for (azimuth, elevation) in [(30.0, 20.0), (200.0, -55.0), (91.0, 3.0)] {
        let camera = Camera::fitted(volume.extent(), azimuth, elevation, 1.2, orthographic);
        let expected = each_pixel(&camera, SIZE, |ray| {
            let length = chord(ray, DVec3::ZERO, volume.extent()).map_or(0.0, |[from, to]| to - from);
            over(color, depth_per_length * length, BACKGROUND_F64)
        });
        assert_shows_something("uniform cube", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_close(&format!("uniform cube from {azimuth}, {elevation}"), &image, &expected, 2e-5, 1e-5);
    }
}

/// A uniform cube in perspective is its closed form.
pub fn uniform_cube_in_perspective(backend: &mut dyn Backend) {
    uniform_cube(backend, false);
}

/// A uniform cube in an orthographic view is its closed form.
pub fn uniform_cube_orthographic(backend: &mut dyn Backend) {
    uniform_cube(backend, true);
}

/// A linear field under a linear opacity and one colour: with `a` the opacity, linear along each ray,
/// `∫ -ln(1 - a) da = (1 - a) ln(1 - a) + a`.
pub fn linear_ramp_is_the_closed_form(backend: &mut dyn Backend) {
    let dims = [21, 18, 24];
    let slope = DVec3::new(0.02, 0.01, 0.015);
    let volume = Volume::new(dims, DVec3::ONE, Storage::F32, move |p| p.dot(slope));
    let tf = transfer(&[[0.0, 0.9, 0.8, 0.3, 0.0], [1.0, 0.9, 0.8, 0.3, 0.2]], 1.0);
    let antiderivative = |a: f64| (1.0 - a) * (-a).ln_1p() + a;
    for orthographic in [false, true] {
        let camera = Camera::fitted(volume.extent(), 130.0, 35.0, 1.0, orthographic);
        let expected = each_pixel(&camera, SIZE, |ray| {
            let Some([from, to]) = chord(ray, DVec3::ZERO, volume.extent()) else { return BACKGROUND_F64 };
            let opacity = |t: f64| (ray.origin + ray.direction * t).dot(slope) * 0.2;
            let (first, last) = (opacity(from), opacity(to));
            // Where the opacity hardly changes, the mean is that of the middle: the quotient cancels.
            let mean = if (last - first).abs() < 1e-5 {
                -(-(first + last) / 2.0).ln_1p()
            } else {
                (antiderivative(last) - antiderivative(first)) / (last - first)
            };
            over([0.9, 0.8, 0.3], mean * (to - from), BACKGROUND_F64)
        });
        assert_shows_something("linear ramp", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_close(&format!("linear ramp, orthographic {orthographic}"), &image, &expected, 2e-4, 5e-5);
    }
}

/// A parabola along every ray, in matter so thin that straight pieces will do: they have its mean all the same. Straight
/// to the middle of the field, they would be off by 9e-4.
pub fn a_bent_field_has_its_mean(backend: &mut dyn Backend) {
    let volume = Volume::new([5, 5, 2], DVec3::ONE, Storage::F32, |p| p.x * p.y / 16.0);
    let tf = transfer(&[[0.0, 0.9, 0.8, 0.3, 0.0], [1.0, 0.9, 0.8, 0.3, 0.1]], 1.0);
    for azimuth in [135.0, 315.0] {
        let camera = Camera::fitted(volume.extent(), azimuth, 0.0, 1.0, true);
        let expected = march_volume(&volume, &tf, 256.0, &camera, SIZE, BACKGROUND_F64);
        assert_shows_something("bent field", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_close(&format!("bent field from {azimuth}"), &image, &expected, 1e-4, 3e-5);
    }
}

/// Whole numbers at a step so weak that the table is read: they belong to what is above it. On the other side they would
/// be off by .03.
pub fn values_at_a_weak_step_are_above_it(backend: &mut dyn Backend) {
    let volume = Volume::new([21, 17, 25], DVec3::ONE, Storage::plain(TexelType::U8), |p| match p.x {
        x if x < 3.0 => 1.0,
        x if x < 17.0 => 2.0,
        _ => 4.0,
    });
    let stepping_at = |step: f64| {
        let point = |value, opacity| [value, 0.9, 0.8, 0.3, opacity];
        transfer(&[point(1.0, 0.01), point(step, 0.01), point(step, 0.014), point(4.0, 0.014)], 1.0)
    };
    let camera = Camera::fitted(volume.extent(), 80.0, 10.0, 1.0, false);
    // The march's own values are rounded, to either side.
    let expected = march_volume(&volume, &stepping_at(2.0 - 1e-9), 64.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something("weak step", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &stepping_at(2.0), &camera, SIZE);
    assert_close("weak step", &image, &expected, 2e-3, 1e-3);
}

/// A ramp whose colour changes along the ray: front colours hide those behind.
pub fn color_ramp_matches_the_march(backend: &mut dyn Backend) {
    let volume = Volume::new([12, 14, 33], DVec3::ONE, Storage::F32, |p| (p.z / 32.0 + p.x * 0.01).min(1.1));
    let tf =
        transfer(&[[0.0, 1.0, 0.0, 0.0, 0.05], [0.4, 0.0, 1.0, 0.0, 0.15], [1.0, 0.0, 0.0, 1.0, 0.3]], 1.0);
    for (azimuth, elevation) in [(20.0, 70.0), (20.0, -70.0), (0.0, 0.0)] {
        let camera = Camera::fitted(volume.extent(), azimuth, elevation, 1.0, false);
        let expected = march_volume(&volume, &tf, 64.0, &camera, SIZE, BACKGROUND_F64);
        assert_shows_something("colour ramp", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_close(&format!("colour ramp from {azimuth}, {elevation}"), &image, &expected, 3e-3, 1e-3);
    }
}

/// Extinction 0: the background, bit for bit, whatever the data.
pub fn no_extinction_shows_the_background(backend: &mut dyn Backend) {
    let volume = Volume::new([20, 9, 17], DVec3::ONE, Storage::F32, |p| p.x * 0.1 + p.y * p.z);
    let camera = Camera::fitted(volume.extent(), 10.0, 10.0, 1.0, false);
    let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 0.0], [5.0, 0.2, 0.3, 0.1, 0.0]], 1.0);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    assert_background("extinction 0", &image, BACKGROUND);
}

/// Extinction 1e-30: no NaN of 0 / 0, and nothing to see.
pub fn extinction_of_1e_minus_30_changes_nothing(backend: &mut dyn Backend) {
    let camera = |volume: &Volume| Camera::fitted(volume.extent(), 10.0, 10.0, 1.0, false);
    let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 1e-30]], 1.0);
    let background = vec![BACKGROUND_F64; (SIZE[0] * SIZE[1]) as usize];
    for volume in [cube([20, 9, 17], 0.5), Volume::new([20, 9, 17], DVec3::ONE, Storage::F32, |p| p.x)] {
        let image = draw(backend, &volume, &tf, &camera(&volume), SIZE);
        assert_close("extinction 1e-30", &image, &background, 1e-6, 1e-6);
    }
}

/// Opacity 1 - 1e-7 per unit, an optical depth of 16 per cell: finite, and the chord still counts at edges.
pub fn nearly_opaque_matter(backend: &mut dyn Backend) {
    let volume = cube([17, 17, 17], 0.7);
    let tf = transfer(&[[0.0, 0.2, 0.9, 0.6, 1.0 - 1e-7]], 1.0);
    let camera = Camera::fitted(volume.extent(), 40.0, 30.0, 1.0, false);
    let depth_per_length = tf.extinction(0.0);
    let expected = each_pixel(&camera, SIZE, |ray| {
        let length = chord(ray, DVec3::ZERO, volume.extent()).map_or(0.0, |[from, to]| to - from);
        over([0.2, 0.9, 0.6], depth_per_length * length, BACKGROUND_F64)
    });
    assert_shows_something("nearly opaque", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    let threshold = STOP_TRANSMITTANCE + 1e-4;
    assert_close("opacity 1 - 1e-7", &image, &expected, threshold, threshold);
}

/// A control point of opacity exactly 1: matter of it hides all that is behind.
pub fn opaque_matter_hides_what_is_behind(backend: &mut dyn Backend) {
    // Seen from above: clear, thin green, then from the middle down opaque red, behind it blue.
    let volume = Volume::new([9, 9, 41], DVec3::ONE, Storage::plain(TexelType::U8), |p| {
        if p.z > 30.0 {
            0.0
        } else if p.z > 20.0 {
            50.0
        } else if p.z > 10.0 {
            100.0
        } else {
            200.0
        }
    });
    let tf = transfer(
        &[
            [0.0, 0.0, 1.0, 0.0, 0.0],
            [50.0, 0.0, 1.0, 0.0, 0.1],
            [60.0, 1.0, 0.0, 0.0, 1.0],
            [140.0, 1.0, 0.0, 0.0, 1.0],
            [141.0, 0.0, 0.0, 1.0, 1.0],
        ],
        1.0,
    );
    let camera = Camera::fitted(volume.extent(), 0.0, 90.0, 3.0, true);
    let expected = march_volume(&volume, &tf, 512.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something("opaque layer", &expected, BACKGROUND_F64);
    let middle = expected[(SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize];
    assert!(middle[2] < 1e-3, "blue behind opaque red shows through in the march: {middle:?}");
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    // The value falls through green and red within one cell, where a piece mixes the colours that it sees.
    assert_close("opaque layer behind a thin one", &image, &expected, 0.03, 0.015);
}

/// A step of the transfer function from clear to opaque: its surface stands where the field has that value.
pub fn opaque_step_stands_at_its_value(backend: &mut dyn Backend) {
    // The distance to the centre of a ball; trilinear between samples.
    let centre = DVec3::new(9.3, 8.8, 10.1);
    let volume = Volume::new([20, 19, 22], DVec3::ONE, Storage::F32, move |p| p.distance(centre));
    let tf =
        transfer(&[[0.0, 1.0, 0.7, 0.2, 1.0], [6.5, 1.0, 0.7, 0.2, 1.0], [6.5, 0.0, 0.0, 0.0, 0.0]], 1.0);
    let camera = Camera::fitted(volume.extent(), 25.0, 40.0, 1.0, false);
    let expected = march_volume(&volume, &tf, 400.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something("opaque step", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    // Pixels on the silhouette see a sliver of ball, whose length errs with the bins of values.
    let differs = |(found, expected): &(&[f32; 3], &[f64; 3])| {
        (0..3).any(|i| (f64::from(found[i]) - expected[i]).abs() > 5e-3)
    };
    let wrong = image.pixels.iter().zip(&expected).filter(differs).count();
    println!("opaque step: {wrong} of {} pixels differ by more than 5e-3 (threshold 6)", expected.len());
    assert!(wrong <= 6, "{wrong} pixels of an opaque ball differ, expected at most 6 on its silhouette");
}

/// A transfer function that is opaque only in a narrow range of values between two samples: fixed steps
/// miss it, the integral over values does not.
pub fn thin_shell_is_not_missed(backend: &mut dyn Backend) {
    let volume = Volume::new([12, 13, 30], DVec3::ONE, Storage::F32, |p| p.z + 0.01 * p.x);
    let points = [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [14.40, 1.0, 1.0, 0.2, 0.0],
        [14.42, 1.0, 1.0, 0.2, 0.999],
        [14.44, 1.0, 1.0, 0.2, 0.0],
    ];
    let tf = transfer(&points, 0.02);
    let camera = Camera::fitted(volume.extent(), 15.0, 65.0, 1.0, false);
    let expected = march_volume(&volume, &tf, 2000.0, &camera, [24, 20], BACKGROUND_F64);
    assert_shows_something("thin shell", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, [24, 20]);
    // The shell is six bins of values wide.
    assert_close("thin shell", &image, &expected, 0.02, 2e-3);
}

/// Half of a volume is padding far above all that is seen. Between two samples rays pass every value from one to the
/// other, an opaque band of values among them, however short the way: they show the end of the band at which they enter.
pub fn opaque_bands_beside_padding_are_passed(backend: &mut dyn Backend) {
    // Where blocks of cells end that a backend may leap over.
    let edge = 6.0;
    let volume = Volume::new([16, 15, 18], DVec3::ONE, Storage::F32, move |p| {
        if p.x > edge { 1e12 } else { 0.2 + 0.1 * (0.9 * p.x + 1.7 * p.y + 0.6 * p.z).sin() }
    });
    let (low, high) = ([1.0, 0.2, 0.1], [0.1, 0.4, 1.0]);
    let point = |value: f64, [r, g, b]: [f64; 3], opacity: f64| [value, r, g, b, opacity];
    let points = [(0.5, low, 0.0), (0.5, low, 1.0), (0.6, high, 1.0), (0.6, high, 0.0)];
    let tf = transfer(&points.map(|(value, color, opacity)| point(value, color, opacity)), 1.0);
    for (azimuth, is_orthographic) in [(35.0, false), (155.0, true), (215.0, false), (330.0, true)] {
        let camera = Camera::fitted(volume.extent(), azimuth, 25.0, 1.2, is_orthographic);
        let expected = each_pixel(&camera, SIZE, |ray| {
            // The way through samples that can be seen and the cells behind them; from the other side it ends with these.
            let end = DVec3::new(edge, volume.extent().y, volume.extent().z);
            let rises = ray.direction.x > 0.0;
            match chord(ray, DVec3::ZERO, end) {
                Some([from, to]) => {
                    let at = ray.origin.x + ray.direction.x * if rises { to } else { from };
                    let crosses = (at - edge).abs() < 1e-9;
                    if crosses { if rises { low } else { high } } else { BACKGROUND_F64 }
                }
                None => BACKGROUND_F64,
            }
        });
        assert_shows_something("padding", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_close(&format!("padding from {azimuth}"), &image, &expected, 1e-3, 1e-4);
    }
}

/// Thin matter whose values lie above those of opaque matter: sums over values must not drown it.
pub fn thin_matter_above_opaque_values(backend: &mut dyn Backend) {
    let volume = Volume::new([18, 17, 33], DVec3::ONE, Storage::F32, |p| {
        if p.z == 0.0 { 0.0 } else { 0.7 + 0.003 * p.z + 0.001 * p.x }
    });
    let points = [
        [0.0, 1.0, 0.2, 0.1, 1.0],
        [0.5, 1.0, 0.2, 0.1, 1.0],
        [0.6, 0.2, 0.5, 1.0, 0.01],
        [0.9, 0.2, 0.8, 1.0, 0.02],
    ];
    let tf = transfer(&points, 1.0);
    let camera = Camera::fitted(volume.extent(), 25.0, 40.0, 1.0, false);
    let expected = march_volume(&volume, &tf, 500.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something("thin above opaque", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    assert_close("thin above opaque", &image, &expected, 0.01, 3e-4);
}

/// A cell that spans many optical depths and whose colour changes: what is seen is its front.
pub fn dense_cells_show_their_front(backend: &mut dyn Backend) {
    let field = |p: DVec3| {
        let q = p.x + 2.0 * p.y + 3.0 * p.z;
        0.5 + 0.5 * (2.3 * q).sin()
    };
    let points = [
        [0.0, 0.1, 0.1, 0.9, 0.0],
        [0.3, 0.1, 0.9, 0.2, 0.4],
        [0.6, 1.0, 0.2, 0.1, 0.6],
        [1.0, 1.0, 1.0, 0.9, 0.9],
    ];
    for (dims, unit_distance) in [([2, 2, 2], 0.1), ([4, 3, 5], 0.05), ([3, 4, 4], 0.02)] {
        let volume = Volume::new(dims, DVec3::ONE, Storage::F32, field);
        let tf = transfer(&points, unit_distance);
        for orthographic in [false, true] {
            let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, orthographic);
            let expected = march_volume(&volume, &tf, 2000.0, &camera, SIZE, BACKGROUND_F64);
            assert_shows_something("dense cells", &expected, BACKGROUND_F64);
            let image = draw(backend, &volume, &tf, &camera, SIZE);
            assert_close(&format!("dense cells {dims:?}"), &image, &expected, 0.02, 1e-3);
        }
    }
}
