//! A picture in `f64`.

/// Linear RGB, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[f64; 3]>,
}

/// Pixels that do not make a picture of the size stated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("picture of {width} x {height}: {found} pixels given, expected {}", u64::from(*width) * u64::from(*height))]
pub struct SizeMismatch {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Pixels given.
    pub found: usize,
}

impl Image {
    /// A picture of these pixels, row by row from the top.
    ///
    /// # Errors
    /// When there are not `width * height` pixels.
    pub fn new(width: u32, height: u32, pixels: Vec<[f64; 3]>) -> Result<Self, SizeMismatch> {
        let found = pixels.len();
        if u64::from(width) * u64::from(height) == found as u64 {
            Ok(Self { width, height, pixels })
        } else {
            Err(SizeMismatch { width, height, found })
        }
    }

    /// [`Image::new`] where the number of pixels is known to be right.
    pub(crate) fn of_all_pixels(width: u32, height: u32, pixels: Vec<[f64; 3]>) -> Self {
        debug_assert_eq!(u64::from(width) * u64::from(height), pixels.len() as u64);
        Self { width, height, pixels }
    }

    /// [`Image::new`] of pixels in `f32`.
    ///
    /// # Errors
    /// When there are not `width * height` pixels.
    pub fn from_f32(width: u32, height: u32, pixels: &[[f32; 3]]) -> Result<Self, SizeMismatch> {
        Self::new(width, height, pixels.iter().map(|pixel| pixel.map(f64::from)).collect())
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The pixels, row by row from the top.
    pub fn pixels(&self) -> &[[f64; 3]] {
        &self.pixels
    }

    /// One pixel.
    ///
    /// # Panics
    /// When `column` or `row` is outside the picture.
    pub fn pixel(&self, column: u32, row: u32) -> [f64; 3] {
        assert!(column < self.width && row < self.height, "pixel ({column}, {row})");
        self.pixels[row as usize * self.width as usize + column as usize]
    }
}
