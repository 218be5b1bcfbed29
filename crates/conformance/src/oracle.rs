//! What pictures should show: a slow march in f64, chords through boxes, and the comparison.

use glam::DVec3;
use volery_scene::{Camera, Ray, TransferFunction};

use volery_frame::Image;

use super::world::Volume;

/// Rows from the top, pixels from the left.
pub(super) type Pixels = Vec<[f64; 3]>;

/// `[t_in, t_out]` of a ray in the world box `[low, high]`, from the ray's start on; `None` beside it.
pub(super) fn chord(ray: &Ray, low: DVec3, high: DVec3) -> Option<[f64; 2]> {
    let mut span = [0.0, f64::INFINITY];
    for axis in 0..3 {
        let (origin, direction) = (ray.origin[axis], ray.direction[axis]);
        if direction == 0.0 {
            if origin < low[axis] || origin > high[axis] {
                return None;
            }
            continue;
        }
        let ends = [(low[axis] - origin) / direction, (high[axis] - origin) / direction];
        span = [span[0].max(ends[0].min(ends[1])), span[1].min(ends[0].max(ends[1]))];
    }
    (span[0] < span[1]).then_some(span)
}

/// Light over the background after matter of optical depth `depth` and one colour.
pub(super) fn over(color: [f64; 3], depth: f64, background: [f64; 3]) -> [f64; 3] {
    let opacity = -(-depth).exp_m1();
    std::array::from_fn(|i| color[i] * opacity + background[i] * (1.0 - opacity))
}

/// What every pixel shows when `light` tells what a ray sees.
pub(super) fn each_pixel(
    camera: &Camera,
    [width, height]: [u32; 2],
    light: impl Fn(&Ray) -> [f64; 3],
) -> Pixels {
    let rays = camera.rays(width, height);
    let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    pixels.map(|(column, row)| light(&rays.pixel(column, row))).collect()
}

/// The field of which a march takes a picture: its box in the world, and its value at a world position.
pub(super) struct Medium<'a> {
    pub(super) extent: DVec3,
    /// Longest step in world units.
    pub(super) step: f64,
    pub(super) transfer: &'a TransferFunction,
    pub(super) value: &'a dyn Fn(DVec3) -> f64,
}

/// Emission and absorption along every pixel's ray, by the midpoint rule.
pub(super) fn march(medium: &Medium<'_>, camera: &Camera, size: [u32; 2], background: [f64; 3]) -> Pixels {
    each_pixel(camera, size, |ray| {
        let Some([t_in, t_out]) = chord(ray, DVec3::ZERO, medium.extent) else { return background };
        let num_steps = ((t_out - t_in) / medium.step).ceil();
        let step = (t_out - t_in) / num_steps;
        let (mut light, mut transmittance) = ([0.0; 3], 1.0);
        for i in 0..num_steps as u64 {
            let position = ray.origin + ray.direction * (t_in + (i as f64 + 0.5) * step);
            let (color, opacity) = medium.transfer.classify((medium.value)(position));
            let depth = medium.transfer.extinction_of_opacity(opacity) * step;
            let share = -(-depth).exp_m1() * transmittance;
            (0..3).for_each(|i| light[i] += share * color[i]);
            transmittance *= (-depth).exp();
            if transmittance < 1e-12 {
                break;
            }
        }
        std::array::from_fn(|i| light[i] + transmittance * background[i])
    })
}

/// The march through a volume's own trilinear field, `steps_per_cell` to the shortest edge of a cell.
pub(super) fn march_volume(
    volume: &Volume,
    transfer: &TransferFunction,
    steps_per_cell: f64,
    camera: &Camera,
    size: [u32; 2],
    background: [f64; 3],
) -> Pixels {
    let spacing = volume.layout.spacing;
    let medium = Medium {
        extent: volume.extent(),
        step: spacing.min_element() / steps_per_cell,
        transfer,
        value: &|position| volume.trilinear(position / spacing),
    };
    march(&medium, camera, size, background)
}

/// Largest and root mean square difference of any channel.
pub(super) fn difference(found: &Image, expected: &Pixels) -> [f64; 2] {
    let (width, height) = (found.width as usize, found.height as usize);
    assert_eq!(found.pixels.len(), width * height, "pixels of a picture of {width}x{height}");
    assert_eq!(found.pixels.len(), expected.len(), "pixels drawn and expected");
    let (mut max, mut sum) = (0.0_f64, 0.0);
    for (index, (found, expected)) in found.pixels.iter().zip(expected).enumerate() {
        for (&found, expected) in found.iter().zip(expected) {
            assert!(found.is_finite(), "pixel {index} of {width}x{height} is {found}");
            let error = (f64::from(found) - expected).abs();
            max = max.max(error);
            sum += error * error;
        }
    }
    [max, (sum / (3 * expected.len()) as f64).sqrt()]
}

/// Panics unless the picture is within both thresholds; prints them with what was measured.
pub(super) fn assert_close(what: &str, found: &Image, expected: &Pixels, max: f64, rmse: f64) {
    let [found_max, found_rmse] = difference(found, expected);
    println!(
        "{what}: max {found_max:.2e} (threshold {max:.1e}), rmse {found_rmse:.2e} (threshold {rmse:.1e})"
    );
    assert!(
        found_max <= max && found_rmse <= rmse,
        "{what}: max {found_max:e}, expected at most {max:e}; rmse {found_rmse:e}, expected at most {rmse:e}"
    );
}

/// Panics unless a pixel somewhere differs from the background: a comparison of empty pictures proves nothing.
pub(super) fn assert_shows_something(what: &str, expected: &Pixels, background: [f64; 3]) {
    let differs = |pixel: &&[f64; 3]| (0..3).any(|i| (pixel[i] - background[i]).abs() > 0.02);
    let share = expected.iter().filter(differs).count() as f64 / expected.len() as f64;
    assert!(share > 0.05, "{what}: matter covers {share:.3} of the picture, expected more than 0.05");
}

/// Panics unless two pictures have the same bits.
pub(super) fn assert_same_bits(what: &str, a: &Image, b: &Image) {
    assert_eq!((a.width, a.height), (b.width, b.height), "{what}: sizes");
    let differ = a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    let differ = differ.count();
    println!("{what}: {differ} of {} pixels differ in bits (threshold 0)", a.pixels.len());
    assert!(differ == 0, "{what}: {differ} pixels differ in bits");
}

/// Panics unless every pixel is the background, bit for bit.
pub(super) fn assert_background(what: &str, found: &Image, background: [f32; 3]) {
    let width = found.width;
    let expected = Image { width, height: found.height, pixels: vec![background; found.pixels.len()] };
    assert_same_bits(what, found, &expected);
}
