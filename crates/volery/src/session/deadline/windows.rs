//! Windows of a picture whose pixels share rays: what lies between rays, and what it is worth to cast more.
//!
//! # Method
//! Squares of `stride` pixels come in the colour of their pixel `(stride / 2, stride / 2)`. Between the pixels that have
//! rays of their own, colours are interpolated in two directions, over the edges of windows too: what a finer window
//! shows beyond the edge is a value there as good as another.
//!
//! What a stride loses in a window is foreseen from the last picture, by how far the middle of `stride` pixels is from
//! the mean of the two ends. Of finer details than a window showed nothing is known: they are taken to lose half of what
//! the next coarser ones lose, as edges do.

use rayon::prelude::*;
use volery_frame::Image;
use volery_frame::backend::{MAX_STRIDE, MAX_WINDOW_SIDE, WINDOW_STEP};

/// Strides from the finest to the coarsest.
pub(super) const STRIDES: [u32; 4] = [1, 2, 4, MAX_STRIDE];

/// Windows that a picture should have: fewer are shared out too coarsely, of more each costs more than its rays.
const NUM_WINDOWS: f64 = 64.0;

/// What a window may lose at least by any stride: one step of a screen's colours.
const LEAST_LOSS: f64 = 1.0 / 512.0;

/// The squares that a picture is cut into.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Windows {
    pub(super) size: [u32; 2],
    pub(super) side: u32,
}

/// What each stride loses in a window: root of the mean squared difference of a channel.
pub(super) type Losses = [f64; STRIDES.len()];

impl Windows {
    /// Of a picture, each at least so many tiles large that threads have something to share.
    pub(super) fn new(size: [u32; 2], num_threads: usize) -> Self {
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let wanted = (pixels / NUM_WINDOWS).sqrt() / f64::from(WINDOW_STEP);
        let least = (2.0 * num_threads as f64).sqrt().ceil();
        let steps = wanted.floor().max(least).min(f64::from(MAX_WINDOW_SIDE / WINDOW_STEP)).max(1.0);
        Self { size, side: steps as u32 * WINDOW_STEP }
    }

    fn across(&self) -> u32 {
        self.size[0].div_ceil(self.side)
    }

    pub(super) fn num(&self) -> u32 {
        self.across() * self.size[1].div_ceil(self.side)
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

    /// Puts interpolated colours between the rays of windows with such strides.
    pub(super) fn interpolate(&self, image: &mut Image, strides: &[u32]) {
        if strides.iter().all(|&stride| stride == 1) {
            return;
        }
        let shown = image.pixels.clone();
        let [width, height] = self.size;
        let at = |x: i64, y: i64| {
            let [x, y] = [x.clamp(0, i64::from(width) - 1), y.clamp(0, i64::from(height) - 1)];
            shown[(y * i64::from(width) + x) as usize]
        };
        image.pixels.par_chunks_mut(width as usize).zip(0..height).for_each(|(row, y)| {
            for (first, pixels) in
                (0..width).step_by(self.side as usize).zip(row.chunks_mut(self.side as usize))
            {
                let stride = self.stride_at(strides, [first, y]);
                if stride == 1 {
                    continue;
                }
                let step = f64::from(stride) as f32;
                let (above, down) = around(y, stride);
                for (x, pixel) in (first..).zip(pixels) {
                    let (left, right) = around(x, stride);
                    let end = i64::from(stride);
                    let corners = [
                        at(left, above),
                        at(left + end, above),
                        at(left, above + end),
                        at(left + end, above + end),
                    ];
                    let [u, v] = [right as f32 / step, down as f32 / step];
                    *pixel = [0, 1, 2].map(|channel| {
                        let [a, b, c, d] = corners.map(|corner| corner[channel]);
                        let (upper, lower) = (a + u * (b - a), c + u * (d - c));
                        upper + v * (lower - upper)
                    });
                }
            }
        });
    }

    /// What strides would lose in the windows of a picture that was drawn with these.
    pub(super) fn losses(&self, image: &Image, strides: &[u32]) -> Vec<Losses> {
        let losses = |window: u32| {
            let mut losses = [0.0; STRIDES.len()];
            let drawn = strides[window as usize];
            for (loss, &stride) in losses.iter_mut().zip(&STRIDES).rev() {
                *loss = if stride > drawn { self.loss(image, window, stride) } else { 0.0 };
            }
            // From the coarsest that is known on.
            for level in (1..STRIDES.len()).rev() {
                if STRIDES[level] <= drawn {
                    losses[level] =
                        losses.get(level + 1).map_or(LEAST_LOSS * f64::from(drawn), |coarser| 0.5 * coarser);
                }
                losses[level] = losses[level].max(LEAST_LOSS * f64::from(STRIDES[level]).sqrt());
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

/// The pixel with a ray before another, or its own, along an axis; and how far the other is behind it.
fn around(pixel: u32, stride: u32) -> (i64, i64) {
    let (pixel, stride) = (i64::from(pixel), i64::from(stride));
    let behind = (pixel - stride / 2).rem_euclid(stride);
    (pixel - behind, behind)
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
