//! Windows of a picture whose pixels share rays: what lies between rays, and what it is worth to cast more.
//!
//! # Method
//! Squares of `stride` pixels come in the colour of their pixel `(stride / 2, stride / 2)`. Between the pixels that have
//! rays of their own, colours are interpolated in two directions, over the edges of windows too: what a finer window
//! shows beyond the edge is a value there as good as another.
//!
//! What a stride loses in a window is foreseen from the last picture, by how far the middle of `stride` pixels is from
//! the mean of the two ends. Of finer details than a window showed nothing is known: at an edge half the stride loses
//! the root of half as much, and so it is taken to do.

use rayon::prelude::*;
use volery_frame::Image;
use volery_frame::backend::{MAX_STRIDE, MAX_WINDOW_SIDE, WINDOW_STEP};

/// Strides from the finest to the coarsest.
pub(super) const STRIDES: [u32; 4] = [1, 2, 4, MAX_STRIDE];

/// Windows that a picture should have: fewer are shared out too coarsely, of more each costs more than its rays.
const NUM_WINDOWS: f64 = 64.0;

/// What a window is taken to lose at least by any stride.
const LEAST_LOSS: f64 = 1.0 / 2048.0;

/// What half the stride loses at an edge: half as many pixels are off by as much.
const FINER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The squares that a picture is cut into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Windows {
    pub(super) size: [u32; 2],
    pub(super) side: u32,
}

/// What each stride loses in a window: root of the mean squared difference of a channel.
pub(super) type Losses = [f64; STRIDES.len()];

impl Windows {
    pub(super) fn new(size: [u32; 2]) -> Self {
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let wanted = (pixels / NUM_WINDOWS).sqrt() / f64::from(WINDOW_STEP);
        let steps = wanted.floor().min(f64::from(MAX_WINDOW_SIDE / WINDOW_STEP)).max(1.0);
        Self { size, side: steps as u32 * WINDOW_STEP }
    }

    fn across(&self) -> u32 {
        self.size[0].div_ceil(self.side)
    }

    pub(super) fn num(&self) -> u32 {
        self.across() * self.size[1].div_ceil(self.side)
    }

    /// All windows, so that those drawn one after the other lie far apart: what time then is wrong by, it is wrong by
    /// all over the picture, and not from some row on.
    pub(super) fn scattered(&self) -> Vec<u32> {
        let num = self.num();
        // Near the golden section, which leaves gaps as equal as can be.
        let from = (f64::from(num) * 0.618) as u32;
        let step = (from.max(1)..).find(|&step| gcd(step, num) == 1).unwrap_or(1);
        (0..num).map(|place| (u64::from(place) * u64::from(step) % u64::from(num)) as u32).collect()
    }

    /// First and last pixel along x and y, the last not included.
    pub(super) fn bounds(&self, window: u32) -> [[u32; 2]; 2] {
        let first = [window % self.across() * self.side, window / self.across() * self.side];
        [first, [0, 1].map(|axis| self.size[axis].min(first[axis] + self.side))]
    }

    /// Rays of a window with a stride.
    pub(super) fn num_rays(&self, window: u32, stride: u32) -> f64 {
        let [first, last] = self.bounds(window);
        [0, 1].map(|axis| f64::from((last[axis] - first[axis]).div_ceil(stride))).iter().product()
    }

    /// The stride of a pixel.
    fn stride_at(&self, strides: &[u32], [x, y]: [u32; 2]) -> u32 {
        strides[(y / self.side * self.across() + x / self.side) as usize]
    }

    /// Puts interpolated colours between the rays of windows with such strides. `shown` is room for a copy.
    pub(super) fn interpolate(&self, image: &mut Image, strides: &[u32], shown: &mut Vec<[f32; 3]>) {
        if strides.iter().all(|&stride| stride == 1) {
            return;
        }
        shown.resize(image.pixels.len(), [0.0; 3]);
        shown.par_iter_mut().zip(&image.pixels).with_min_len(1 << 14).for_each(|(to, from)| *to = *from);
        let [width, height] = self.size;
        let side = self.side as usize;
        image.pixels.par_chunks_mut(width as usize).zip(0..height).with_min_len(8).for_each(|(row, y)| {
            for (first, pixels) in (0..width).step_by(side).zip(row.chunks_mut(side)) {
                let stride = self.stride_at(strides, [first, y]);
                if stride > 1 {
                    self.interpolate_row(shown, (first, y), stride, pixels);
                }
            }
        });
    }

    /// Interpolates a row of a window, from ray to ray.
    fn interpolate_row(
        &self,
        shown: &[[f32; 3]],
        (first, y): (u32, u32),
        stride: u32,
        pixels: &mut [[f32; 3]],
    ) {
        let [width, height] = self.size;
        let [above, below] =
            around(y, stride, height).map(|y| &shown[(y * width) as usize..][..width as usize]);
        let down = share(y, around(y, stride, height)[0], stride);
        let column = |x: u32| mix(above[x as usize], below[x as usize], down);
        let half = (stride / 2) as usize;
        // From the middle of a square to that of the next all lie between the same two rays: half a square comes first.
        let (start, rest) = pixels.split_at_mut(half.min(pixels.len()));
        let [left, right] = around(first, stride, width);
        let mut colors = [column(left), column(right)];
        let fill = |pixels: &mut [[f32; 3]], x: u32, left: u32, colors: [[f32; 3]; 2]| {
            for (x, pixel) in (x..).zip(pixels) {
                *pixel = mix(colors[0], colors[1], share(x, left, stride));
            }
        };
        fill(start, first, left, colors);
        for (x, pixels) in
            (first + stride / 2..).step_by(stride as usize).zip(rest.chunks_mut(stride as usize))
        {
            let [left, right] = around(x, stride, width);
            colors = [colors[1], column(right)];
            fill(pixels, x, left, colors);
        }
    }

    /// What strides would lose in the windows of a picture that was drawn with these.
    pub(super) fn losses(&self, image: &Image, strides: &[u32]) -> Vec<Losses> {
        let losses = |window: u32| {
            let drawn = strides[window as usize];
            let mut coarser = self.loss(image, window, 2 * MAX_STRIDE);
            let mut losses = [0.0; STRIDES.len()];
            for (loss, &stride) in losses.iter_mut().zip(&STRIDES).rev() {
                let found = if stride > drawn { self.loss(image, window, stride) } else { FINER * coarser };
                coarser = found.max(LEAST_LOSS);
                *loss = coarser;
            }
            losses
        };
        (0..self.num()).into_par_iter().map(losses).collect()
    }

    /// Root mean square of how far the middle of `stride` pixels is from the mean of the ends.
    fn loss(&self, image: &Image, window: u32, stride: u32) -> f64 {
        let [[x0, y0], [x1, y1]] = self.bounds(window);
        let half = stride / 2;
        let [width, height] = self.size;
        let pixel = |x: u32, y: u32| image.pixels[(y * width + x) as usize];
        let (mut sum, mut num) = (0.0, 0_u32);
        for y in (y0 + half..y1).step_by(stride as usize) {
            for x in (x0 + half..x1).step_by(stride as usize) {
                let middle = pixel(x, y);
                let ends = [
                    (x + half < width).then(|| [pixel(x - half, y), pixel(x + half, y)]),
                    (y + half < height).then(|| [pixel(x, y - half), pixel(x, y + half)]),
                ];
                for [a, b] in ends.into_iter().flatten() {
                    sum += (0..3).map(|i| f64::from(middle[i] - 0.5 * (a[i] + b[i])).powi(2)).sum::<f64>();
                    num += 3;
                }
            }
        }
        (sum / f64::from(num.max(1))).sqrt()
    }
}

fn mix(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    [0, 1, 2].map(|channel| a[channel] + share * (b[channel] - a[channel]))
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The pixels with a ray around another along an axis of so many: at the edges twice the same.
fn around(pixel: u32, stride: u32, num: u32) -> [u32; 2] {
    let half = stride / 2;
    let before = (pixel + half) / stride * stride;
    let last = num - 1;
    // Where the last square's ray is beyond the edge, all of it came in its colour.
    [before.checked_sub(half).unwrap_or(half), before + half].map(|place| place.min(last))
}

/// How far a pixel is on the way from one with a ray to the next.
fn share(pixel: u32, before: u32, stride: u32) -> f32 {
    pixel.saturating_sub(before) as f32 / stride as f32
}

/// A picture of fewer pixels as one of more, colours interpolated between the middles of pixels.
pub(super) fn enlarge(image: &Image, [width, height]: [u32; 2]) -> Image {
    let place = |pixel: u32, size: u32, large: u32| {
        let at = ((f64::from(pixel) + 0.5) * f64::from(size) / f64::from(large) - 0.5).max(0.0);
        let first = (at as u32).min(size - 1);
        (first, (first + 1).min(size - 1), (at - f64::from(first)) as f32)
    };
    let pixel = |x: u32, y: u32| image.pixels[(y * image.width + x) as usize];
    let row = |y: u32| {
        let (above, below, v) = place(y, image.height, height);
        (0..width).map(move |x| {
            let (left, right, u) = place(x, image.width, width);
            [0, 1, 2].map(|i| {
                let upper = pixel(left, above)[i] + u * (pixel(right, above)[i] - pixel(left, above)[i]);
                let lower = pixel(left, below)[i] + u * (pixel(right, below)[i] - pixel(left, below)[i]);
                upper + v * (lower - upper)
            })
        })
    };
    Image { width, height, pixels: (0..height).flat_map(row).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture as a backend draws it: squares in the colour of one of their pixels.
    fn drawn(windows: &Windows, strides: &[u32], color: impl Fn([u32; 2]) -> f32) -> Image {
        let [width, height] = windows.size;
        let pixel = |place: u32| {
            let at = [place % width, place / width];
            let stride = windows.stride_at(strides, at);
            [color(at.map(|place| place / stride * stride + stride / 2)); 3]
        };
        Image { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    #[test]
    fn a_ramp_is_interpolated_exactly_but_for_the_edges() {
        let ramp = |[x, y]: [u32; 2]| 0.25 * x as f32 - 0.125 * y as f32;
        for size in [[200, 136], [131, 97], [33, 300], [7, 5]] {
            let windows = Windows::new(size);
            for stride in STRIDES {
                let strides = vec![stride; windows.num() as usize];
                let mut image = drawn(&windows, &strides, ramp);
                windows.interpolate(&mut image, &strides, &mut Vec::new());
                let inner = |place: u32, num: u32| place >= stride / 2 && place + stride < num;
                for (place, pixel) in (0..).zip(&image.pixels) {
                    let at = [place % size[0], place / size[0]];
                    if inner(at[0], size[0]) && inner(at[1], size[1]) {
                        assert_eq!(pixel[0], ramp(at), "stride {stride}, {at:?} of {size:?}");
                    }
                    assert!(pixel[0].is_finite());
                }
            }
        }
    }

    #[test]
    fn windows_with_a_ray_for_each_pixel_stay_as_they_are() {
        let windows = Windows::new([160, 160]);
        let noise = |[x, y]: [u32; 2]| ((x * 7919 + y * 104_729) % 97) as f32;
        let strides: Vec<u32> = (0..windows.num()).map(|window| 1 << (window % 4)).collect();
        let mut image = drawn(&windows, &strides, noise);
        let before = image.clone();
        windows.interpolate(&mut image, &strides, &mut Vec::new());
        for window in (0..windows.num()).filter(|window| window % 4 == 0) {
            let [[x0, y0], [x1, y1]] = windows.bounds(window);
            for place in (y0..y1).flat_map(|y| (x0..x1).map(move |x| (y * 160 + x) as usize)) {
                assert_eq!(image.pixels[place], before.pixels[place]);
            }
        }
        assert_ne!(image, before);
    }

    #[test]
    fn scattered_windows_are_all_once_and_far_apart() {
        for size in [[1, 1], [33, 7], [512, 512], [1920, 1080], [511, 2000]] {
            let windows = Windows::new(size);
            let order = windows.scattered();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..windows.num()).collect::<Vec<_>>(), "{size:?}");
            // The first quarter leaves no half of the picture out.
            let quarter = &order[..order.len() / 4];
            let upper = quarter.iter().filter(|&&window| window < windows.num() / 2).count();
            assert!(upper.abs_diff(quarter.len() - upper) <= 2, "{size:?}: {upper} of {}", quarter.len());
        }
    }

    #[test]
    fn losses_are_those_of_the_details_that_are_there() {
        let windows = Windows::new([256, 256]);
        let all = |stride: u32| vec![stride; windows.num() as usize];
        let loss = |color: &dyn Fn([u32; 2]) -> f32, stride: u32| {
            windows.losses(&drawn(&windows, &all(stride), color), &all(stride))[0]
        };
        // Nothing is lost of a ramp but what is always taken to be; of stripes as much by any stride.
        let ramp = loss(&|[x, _]| 0.001 * x as f32, 1);
        assert!(ramp.iter().all(|&loss| loss < 0.001), "{ramp:?}");
        let stripes = loss(&|[x, _]| (x % 2) as f32, 1);
        assert!(stripes[1] > 0.3, "{stripes:?}");
        // Losses grow with the stride, and what was not drawn is foreseen from what was.
        for drawn in STRIDES {
            let waves = loss(&|[x, y]| (0.05 * x as f32).sin() + (0.07 * y as f32).cos(), drawn);
            assert!(waves.windows(2).skip(1).all(|pair| pair[0] <= pair[1]), "{drawn}: {waves:?}");
        }
    }
}
