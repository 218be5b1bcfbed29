//! How far one picture is from another.
//!
//! All measures are over all three channels, linear, with a range of 1: rmse and the greatest difference,
//! PSNR = `-20 log10(rmse)` dB, and the mean structural similarity of Wang, Bovik, Sheikh, Simoncelli ("Image
//! quality assessment", IEEE Trans. Image Processing 13, 2004): a Gaussian window of 11 x 11 pixels with
//! σ = 1.5, K₁ = 0.01, K₂ = 0.03, over all windows that lie wholly in the picture; the mean of the channels.

use std::array;

use crate::image::Image;

/// Pixels along an edge of the window of structural similarity.
const WINDOW: usize = 11;
const WINDOW_SIGMA: f64 = 1.5;
/// `(K₁ L)²` and `(K₂ L)²` with a range L of 1.
const STABILISERS: [f64; 2] = [0.01 * 0.01, 0.03 * 0.03];

/// Two pictures that cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("pictures of {}x{} and {}x{} pixels, expected the same size", .left[0], .left[1], .right[0], .right[1])]
pub struct Error {
    /// Columns and rows of the first picture.
    pub left: [u32; 2],
    /// Columns and rows of the second picture.
    pub right: [u32; 2],
}

/// All measures of the difference of two pictures. NaN pixels make them NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Root of the mean squared difference of all channels.
    pub rmse: f64,
    /// Greatest difference of any channel.
    pub max: f64,
    /// Peak signal to noise ratio in decibel; infinite for equal pictures.
    pub psnr_db: f64,
    /// Mean structural similarity, 1 for equal pictures; `None` for pictures smaller than the window.
    pub ssim: Option<f64>,
}

/// Compares two pictures of the same size.
///
/// # Errors
/// When the sizes differ.
pub fn compare(left: &Image, right: &Image) -> Result<Comparison, Error> {
    check_sizes(left, right)?;
    let (mut sum, mut max) = (0.0, 0.0);
    for (a, b) in left.pixels().iter().flatten().zip(right.pixels().iter().flatten()) {
        let difference = (a - b).abs();
        sum += difference * difference;
        if difference > max || difference.is_nan() {
            max = difference;
        }
    }
    let rmse = (sum / (3 * left.pixels().len()).max(1) as f64).sqrt();
    Ok(Comparison { rmse, max, psnr_db: -20.0 * rmse.log10(), ssim: similarity(left, right) })
}

/// The absolute difference times `gain`, at most 1: a picture to look at.
///
/// # Errors
/// When the sizes differ.
pub fn difference(left: &Image, right: &Image, gain: f64) -> Result<Image, Error> {
    check_sizes(left, right)?;
    let amplified =
        |(a, b): (&[f64; 3], &[f64; 3])| array::from_fn(|i| ((a[i] - b[i]).abs() * gain).min(1.0));
    let pixels = left.pixels().iter().zip(right.pixels()).map(amplified).collect();
    Ok(Image::of_all_pixels(left.width(), left.height(), pixels))
}

fn check_sizes(left: &Image, right: &Image) -> Result<(), Error> {
    let size = |image: &Image| [image.width(), image.height()];
    if size(left) == size(right) { Ok(()) } else { Err(Error { left: size(left), right: size(right) }) }
}

fn similarity(left: &Image, right: &Image) -> Option<f64> {
    let [width, height] = [left.width() as usize, left.height() as usize];
    if width < WINDOW || height < WINDOW {
        return None;
    }
    let kernel = kernel();
    let channels = (0..3).map(|channel| {
        // Windowed means of a, b, a², b², ab: first along rows, then along columns.
        let moments = |(l, r): (&[f64; 3], &[f64; 3])| {
            let (a, b) = (l[channel], r[channel]);
            [a, b, a * a, b * b, a * b]
        };
        let pixels: Vec<[f64; 5]> = left.pixels().iter().zip(right.pixels()).map(moments).collect();
        let rows = filtered(&pixels, &kernel, width - WINDOW + 1, height, [width, 1]);
        let windows =
            filtered(&rows, &kernel, width - WINDOW + 1, height - WINDOW + 1, [width - WINDOW + 1; 2]);
        windows.iter().map(similarity_of_window).sum::<f64>() / windows.len() as f64
    });
    Some(channels.sum::<f64>() / 3.0)
}

fn kernel() -> [f64; WINDOW] {
    let bell = |i: usize| {
        let distance = i as f64 - (WINDOW / 2) as f64;
        (-distance * distance / (2.0 * WINDOW_SIGMA * WINDOW_SIGMA)).exp()
    };
    let sum: f64 = (0..WINDOW).map(bell).sum();
    array::from_fn(|i| bell(i) / sum)
}

/// `width * height` weighted sums of input elements that are `step` apart, in rows of `stride`.
fn filtered(
    input: &[[f64; 5]],
    kernel: &[f64; WINDOW],
    width: usize,
    height: usize,
    [stride, step]: [usize; 2],
) -> Vec<[f64; 5]> {
    let sum_at = |first: usize| {
        let mut sum = [0.0; 5];
        for (tap, weight) in kernel.iter().enumerate() {
            let moments = &input[first + tap * step];
            sum = array::from_fn(|i| sum[i] + weight * moments[i]);
        }
        sum
    };
    (0..height).flat_map(|y| (0..width).map(move |x| y * stride + x)).map(sum_at).collect()
}

fn similarity_of_window(&[a, b, aa, bb, ab]: &[f64; 5]) -> f64 {
    let [c1, c2] = STABILISERS;
    let covariance = ab - a * b;
    let variances = (aa - a * a) + (bb - b * b);
    (2.0 * a * b + c1) * (2.0 * covariance + c2) / ((a * a + b * b + c1) * (variances + c2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, value: impl Fn(u32, u32, usize) -> f64) -> Image {
        let pixels = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| array::from_fn(|channel| value(x, y, channel)))
            .collect();
        Image::new(width, height, pixels).unwrap()
    }

    fn texture(x: u32, y: u32, channel: usize) -> f64 {
        f64::from((x * 7 + y * 13 + x * y + channel as u32 * 5) % 17) / 32.0
    }

    #[test]
    fn equal_pictures_are_equal_by_every_measure() {
        let image = picture(20, 15, texture);
        let equal = Comparison { rmse: 0.0, max: 0.0, psnr_db: f64::INFINITY, ssim: Some(1.0) };
        assert_eq!(compare(&image, &image).unwrap(), equal);
    }

    #[test]
    fn a_constant_shift_has_its_closed_form() {
        let (from, to) = (0.25, 0.5);
        let comparison = compare(&picture(16, 16, |_, _, _| from), &picture(16, 16, |_, _, _| to)).unwrap();
        assert_eq!((comparison.rmse, comparison.max), (0.25, 0.25));
        assert!((comparison.psnr_db - 20.0 * 4f64.log10()).abs() < 1e-12);
        let expected = (2.0 * from * to + 1e-4) / (from * from + to * to + 1e-4);
        assert!((comparison.ssim.unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn one_wrong_channel_of_one_pixel() {
        let image = picture(10, 10, |_, _, _| 0.5);
        let wrong = picture(10, 10, |x, y, c| if (x, y, c) == (3, 4, 1) { 0.8 } else { 0.5 });
        let comparison = compare(&image, &wrong).unwrap();
        assert!((comparison.max - 0.3).abs() < 1e-15);
        assert!((comparison.rmse - 0.3 / 300f64.sqrt()).abs() < 1e-15);
        assert_eq!(comparison.ssim, None, "10 x 10 pixels have no window of 11 x 11");
    }

    /// Structural similarity by its definition: every window on its own, variances about the mean.
    fn similarity_by_definition(left: &Image, right: &Image) -> f64 {
        let weight = |dx: u32, dy: u32| {
            let (x, y) = (f64::from(dx) - 5.0, f64::from(dy) - 5.0);
            (-(x * x + y * y) / 4.5).exp()
        };
        let window = || (0..11).flat_map(|dy| (0..11).map(move |dx| (dx, dy)));
        let total: f64 = window().map(|(dx, dy)| weight(dx, dy)).sum();
        let (mut sum, mut count) = (0.0, 0.0);
        for (x, y) in (0..=left.height() - 11).flat_map(|y| (0..=left.width() - 11).map(move |x| (x, y))) {
            for c in 0..3 {
                let mean = |f: &dyn Fn(f64, f64) -> f64| {
                    window()
                        .map(|(dx, dy)| {
                            let (a, b) = (left.pixel(x + dx, y + dy)[c], right.pixel(x + dx, y + dy)[c]);
                            weight(dx, dy) * f(a, b)
                        })
                        .sum::<f64>()
                        / total
                };
                let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
                let (va, vb) = (mean(&|a, _| (a - ma).powi(2)), mean(&|_, b| (b - mb).powi(2)));
                let cov = mean(&|a, b| (a - ma) * (b - mb));
                sum += (2.0 * ma * mb + 1e-4) * (2.0 * cov + 9e-4)
                    / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
                count += 1.0;
            }
        }
        sum / count
    }

    #[test]
    fn similarity_is_that_of_its_definition() {
        let left = picture(23, 14, texture);
        let right = picture(23, 14, |x, y, c| (texture(x, y, c) * 0.8 + texture(y, x, c) * 0.3).min(1.0));
        let (found, expected) =
            (compare(&left, &right).unwrap().ssim.unwrap(), similarity_by_definition(&left, &right));
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        assert!(expected > 0.1 && expected < 0.95, "a telling case: {expected}");
    }

    #[test]
    fn sizes_must_agree_and_nan_is_not_swallowed() {
        let image = picture(4, 3, |_, _, _| 0.0);
        let error = compare(&image, &picture(3, 4, |_, _, _| 0.0)).unwrap_err();
        assert_eq!(error, Error { left: [4, 3], right: [3, 4] });
        let nan = picture(4, 3, |x, _, _| if x == 1 { f64::NAN } else { 0.0 });
        let comparison = compare(&image, &nan).unwrap();
        assert!(comparison.max.is_nan() && comparison.rmse.is_nan());
    }

    #[test]
    fn a_difference_is_amplified_and_clamped() {
        let (dark, light) = (picture(2, 1, |_, _, _| 0.1), picture(2, 1, |x, _, _| 0.1 + 0.2 * f64::from(x)));
        let image = difference(&dark, &light, 10.0).unwrap();
        assert_eq!(image.pixels(), [[0.0; 3], [1.0; 3]]);
    }
}
