//! A contact sheet: small pictures in rows, each with a caption under it.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster};
use volery::Image;

/// Pixels around each picture.
const MARGIN: u32 = 12;
const LINE_HEIGHT: u32 = 20;
const FONT: RasterHeight = RasterHeight::Size16;
/// Linear RGB, as everything here.
const PAPER: [f32; 3] = [0.10, 0.11, 0.13];
const INK: [f32; 3] = [0.92, 0.92, 0.88];

/// One picture of a sheet.
pub(crate) struct Tile {
    pub(crate) image: Image,
    /// One line each; what does not fit is cut off.
    pub(crate) caption: [String; 2],
}

/// Lays out tiles, all of one size, `columns` to a row.
pub(crate) fn contact_sheet(tiles: &[Tile], columns: u32) -> Image {
    let [tile_width, tile_height] =
        tiles.first().map_or([0, 0], |tile| [tile.image.width, tile.image.height]);
    let rows = (tiles.len() as u32).div_ceil(columns);
    let cell = [tile_width + MARGIN, tile_height + MARGIN + 2 * LINE_HEIGHT];
    let (width, height) = (MARGIN + columns * cell[0], MARGIN + rows * cell[1]);
    let mut sheet = Image { width, height, pixels: vec![PAPER; width as usize * height as usize] };
    for (place, tile) in (0..).zip(tiles) {
        let left = MARGIN + place % columns * cell[0];
        let top = MARGIN + place / columns * cell[1];
        for (row, pixels) in (top..).zip(tile.image.pixels.chunks(tile_width.max(1) as usize)) {
            let start = (row * width + left) as usize;
            sheet.pixels[start..][..pixels.len()].copy_from_slice(pixels);
        }
        for (line, text) in (0..).zip(&tile.caption) {
            let baseline = top + tile_height + 4 + line * LINE_HEIGHT;
            write_line(&mut sheet, text, [left, baseline], left + tile_width);
        }
    }
    sheet
}

/// Writes from the upper left corner of the first letter, up to column `end`.
fn write_line(sheet: &mut Image, text: &str, [mut left, top]: [u32; 2], end: u32) {
    for letter in text.chars() {
        let Some(raster) = get_raster(letter, FontWeight::Regular, FONT) else { continue };
        let width = raster.width() as u32;
        if left + width > end {
            return;
        }
        for (row, cover) in (top..).zip(raster.rows()) {
            for (column, &cover) in (left..).zip(cover) {
                let cover = f32::from(cover) / 255.0;
                let pixel = &mut sheet.pixels[(row * sheet.width + column) as usize];
                *pixel = std::array::from_fn(|i| pixel[i] + (INK[i] - pixel[i]) * cover);
            }
        }
        left += width;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_do_not_touch_and_captions_are_written() {
        let tile = |gray| Tile {
            image: Image { width: 40, height: 30, pixels: vec![[gray; 3]; 1200] },
            caption: ["ab".to_owned(), "much too long for its tile".to_owned()],
        };
        let sheet = contact_sheet(&[tile(0.3), tile(0.6), tile(0.9)], 2);
        assert_eq!((sheet.width, sheet.height), (12 + 2 * 52, 12 + 2 * 82));
        for gray in [0.3, 0.6, 0.9] {
            assert_eq!(sheet.pixels.iter().filter(|pixel| **pixel == [gray; 3]).count(), 1200);
        }
        let inked = sheet.pixels.iter().filter(|pixel| pixel[0] > 0.7 && pixel[2] < pixel[0]).count();
        assert!(inked > 30, "{inked} pixels of letters");
    }
}
