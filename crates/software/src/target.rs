//! A picture under way: what each pixel has gathered from the front, and what light is left.
//!
//! # Method
//! A tile that shows nothing yet has no memory; the first part that may show in it gives it some. Whatever casts rays,
//! crosses planes or sums cubes and sheets goes on from what is there, which f32 holds to the bit, so where a picture is
//! cut into parts cannot be seen. Surfaces and the background come behind all parts, at the end.

use std::time::Instant;

use fearless_simd::{Level, dispatch, prelude::*};
use rayon::prelude::*;
use volery_frame::{Image, PictureView, RayDoubt, Window};

use crate::math::axes;
use crate::surfaces::Surfaces;

/// Pixels of a tile per axis.
pub(crate) const TILE: u32 = 32;

/// Pixels of a packet per axis; a lane is `column + 4 * row`.
pub(crate) const PACKET: u32 = 4;

/// Packets of a tile per axis: a tile's packets are the bits of a `u64`.
pub(crate) const TILE_PACKETS: u32 = TILE / PACKET;

pub(crate) const NUM_PACKETS: usize = (TILE_PACKETS * TILE_PACKETS) as usize;

const NUM_PIXELS: usize = (TILE * TILE) as usize;

/// Red, green, blue and transmittance of a packet's rays.
pub(crate) type Light = [[f32; 16]; 4];

/// The numbers of a [`RayDoubt`] of a packet's rays.
pub(crate) type Doubt = [[f32; 16]; 3];

/// Of rays that have met nothing.
const DARK: Light = [[0.0; 16], [0.0; 16], [0.0; 16], [1.0; 16]];

/// Red, green, blue and transmittance of the pixels of a tile, row by row.
pub(crate) type Rows = [[f32; 4]; NUM_PIXELS];

/// A picture under way.
#[derive(Debug)]
pub(crate) struct Target {
    /// Without meshes, which are in `surfaces`.
    pub(crate) view: PictureView<'static>,
    pub(crate) surfaces: Surfaces,
    /// Row by row; whole even where they reach over the edge of the picture.
    pub(crate) tiles: Vec<Tile>,
    pub(crate) shown: Shown,
    /// Pixels of a window per axis, if it is drawn in windows; and those that are drawn now, the whole picture if none
    /// are.
    pub(crate) window_side: Option<u32>,
    pub(crate) windows: Vec<Window>,
    /// What each of those took of all threads together.
    pub(crate) window_seconds: Vec<f64>,
}

/// What the parts so far were.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Shown {
    pub(crate) num_parts: u32,
    pub(crate) has_rays: bool,
    /// Of parts that are all sheets: see [`Sheets::emitted`](volery_frame::Sheets::emitted).
    pub(crate) emitted: Option<[[f32; 3]; 2]>,
    /// Whether the last part was planes, which are put before what is behind in one rounding.
    pub(crate) is_planes: bool,
}

/// What the pixels of a tile have gathered; none where nothing was.
#[derive(Debug)]
pub(crate) struct Tile {
    /// Pixels per axis that share a ray. The first packets of the first rows hold them, as if the tile were so much
    /// smaller.
    pub(crate) stride: u32,
    light: Option<Box<[Light; NUM_PACKETS]>>,
    doubts: Option<Box<[Doubt; NUM_PACKETS]>>,
}

impl Tile {
    const EMPTY: Self = Self { stride: 1, light: None, doubts: None };

    /// Packets row by row.
    #[inline]
    pub(crate) fn light(&mut self) -> &mut [Light; NUM_PACKETS] {
        self.light.get_or_insert_with(|| Box::new([DARK; NUM_PACKETS]))
    }

    #[inline]
    pub(crate) fn light_and_doubts(&mut self) -> (&mut [Light; NUM_PACKETS], &mut [Doubt; NUM_PACKETS]) {
        self.light();
        let Self { light, doubts, .. } = self;
        let light = light.get_or_insert_with(|| Box::new([[[0.0; 16]; 4]; NUM_PACKETS]));
        (light, doubts.get_or_insert_with(|| Box::new([[[0.0; 16]; 3]; NUM_PACKETS])))
    }

    /// The pixels row by row.
    #[inline(always)]
    pub(crate) fn rows(&self) -> Rows {
        let mut rows = [[0.0, 0.0, 0.0, 1.0]; NUM_PIXELS];
        for (packet, light) in (0..).zip(self.light.iter().flat_map(|light| light.iter())) {
            for lane in 0..16 {
                rows[place(packet, lane)] = [0, 1, 2, 3].map(|i| light[i][lane as usize]);
            }
        }
        rows
    }

    #[inline(always)]
    pub(crate) fn set_rows(&mut self, rows: &Rows) {
        for (packet, light) in (0..).zip(self.light()) {
            for lane in 0..16 {
                let pixel = rows[place(packet, lane)];
                (0..4).for_each(|i| light[i][lane as usize] = pixel[i]);
            }
        }
    }

    /// Forgets what it shows, not its memory.
    fn clear(&mut self) {
        if let Some(light) = &mut self.light {
            light.fill(DARK);
        }
        if let Some(doubts) = &mut self.doubts {
            doubts.fill([[0.0; 16]; 3]);
        }
    }

    fn worst_doubt(&self) -> RayDoubt {
        let worst = |number: usize| {
            let packets = self.doubts.iter().flat_map(|doubts| doubts.iter());
            packets.flat_map(|doubt| doubt[number]).fold(0.0, f32::max)
        };
        RayDoubt { cells: worst(0), table_way: worst(1), touching: worst(2) }
    }
}

/// The pixel of a lane of a packet, in a tile row by row.
#[inline(always)]
fn place(packet: u32, lane: u32) -> usize {
    let [x, y] =
        [packet % TILE_PACKETS * PACKET + lane % PACKET, packet / TILE_PACKETS * PACKET + lane / PACKET];
    (y * TILE + x) as usize
}

impl Target {
    pub(crate) fn new(view: &PictureView<'_>) -> Self {
        let num_tiles = view.width.div_ceil(TILE) as usize * view.height.div_ceil(TILE) as usize;
        Self {
            view: PictureView { meshes: &[], ..*view },
            surfaces: Surfaces::new(view),
            tiles: std::iter::repeat_with(|| Tile::EMPTY).take(num_tiles).collect(),
            shown: Shown::default(),
            window_side: None,
            windows: Vec::new(),
            window_seconds: Vec::new(),
        }
    }

    /// First and last tile along x and y of a window.
    fn window_tiles(&self, number: u32) -> [[u32; 2]; 2] {
        let last = [self.view.width, self.view.height].map(|pixels| (pixels - 1) / TILE);
        let Some(side) = self.window_side else { return [[0; 2], last] };
        let [tiles, across] = [side / TILE, self.view.width.div_ceil(side)];
        let first = [number % across * tiles, number / across * tiles];
        [first, [0, 1].map(|axis| last[axis].min(first[axis] + tiles - 1))]
    }

    /// First and last tile along x and y of all that is drawn now.
    pub(crate) fn tile_range(&self) -> [[u32; 2]; 2] {
        let ranges = self.windows.iter().map(|window| self.window_tiles(window.number));
        let join = |[a, b]: [[u32; 2]; 2], [c, d]: [[u32; 2]; 2]| {
            [[0, 1].map(|axis| a[axis].min(c[axis])), [0, 1].map(|axis| b[axis].max(d[axis]))]
        };
        let last = [self.view.width, self.view.height].map(|pixels| (pixels - 1) / TILE);
        ranges.reduce(join).unwrap_or([[0; 2], last])
    }

    /// Runs `draw` for every tile that is drawn now, with the surfaces, its number and the column and row of its first
    /// pixel. The tiles of windows show nothing before.
    pub(crate) fn draw_tiles(&mut self, draw: impl Fn(&Surfaces, u32, [u32; 2], &mut Tile) + Sync) {
        let columns = self.view.width.div_ceil(TILE);
        let mut window_of: Vec<Option<usize>> = vec![None; self.tiles.len()];
        for (place, window) in self.windows.iter().enumerate() {
            let [[x0, y0], [x1, y1]] = self.window_tiles(window.number);
            for (x, y) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y))) {
                window_of[(y * columns + x) as usize] = Some(place);
            }
        }
        let Self { surfaces, tiles, windows, .. } = self;
        let is_whole = windows.is_empty();
        let tiles = (0_u32..).zip(tiles).zip(window_of).filter(|(_, window)| is_whole || window.is_some());
        let tiles: Vec<_> = tiles.collect();
        let seconds = tiles.into_par_iter().map(|((index, tile), window)| {
            let start = Instant::now();
            if let Some(window) = window {
                tile.clear();
                tile.stride = windows[window].stride;
            }
            draw(surfaces, index, [index % columns * TILE, index / columns * TILE], tile);
            (window, start.elapsed().as_secs_f64())
        });
        let seconds: Vec<_> = seconds.collect();
        self.window_seconds = vec![0.0; windows.len()];
        for (window, seconds) in seconds {
            if let Some(window) = window {
                self.window_seconds[window] += seconds;
            }
        }
    }

    /// What the rays of all parts may be off by, if there were any.
    pub(crate) fn ray_doubt(&self) -> Option<RayDoubt> {
        let worst = || self.tiles.par_iter().map(Tile::worst_doubt).reduce(RayDoubt::default, RayDoubt::max);
        self.shown.has_rays.then(worst)
    }

    /// The picture, with what is behind all parts.
    pub(crate) fn image(&self, level: Level) -> Image {
        let (width, height) = (self.view.width, self.view.height);
        // Zeroes need no memory until a band is written, by the thread that fills it.
        let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
        let bands = pixels.par_chunks_mut((width * TILE) as usize);
        let tiles = self.tiles.par_chunks(width.div_ceil(TILE) as usize);
        bands.zip(tiles).enumerate().for_each(|(row, (band, tiles))| {
            let first_row = row as u32 * TILE;
            dispatch!(level, simd => simd.vectorize(
                #[inline(always)]
                || self.fill(band, tiles, first_row)
            ));
        });
        Image { width, height, pixels }
    }

    /// Fills a band of rows from its tiles.
    #[inline(always)]
    fn fill(&self, band: &mut [[f32; 3]], tiles: &[Tile], first_row: u32) {
        for (row, pixels) in (first_row..).zip(band.chunks_exact_mut(self.view.width as usize)) {
            let (packet_row, lane_row) =
                (row % TILE / PACKET * TILE_PACKETS, (row % PACKET * PACKET) as usize);
            let columns = (0..self.view.width).step_by(TILE as usize);
            for ((tile, first_column), pixels) in
                tiles.iter().zip(columns).zip(pixels.chunks_mut(TILE as usize))
            {
                for (column, pixel) in (first_column..).zip(&mut *pixels) {
                    *pixel = self.surfaces.color(column, row);
                }
                let Some(light) = &tile.light else { continue };
                if tile.stride > 1 {
                    let shift = tile.stride.trailing_zeros();
                    for (column, pixel) in (0..).zip(pixels) {
                        let [x, y] = [column, row % TILE].map(|place| place >> shift);
                        let packet = &light[(y / PACKET * TILE_PACKETS + x / PACKET) as usize];
                        let lane = (y % PACKET * PACKET + x % PACKET) as usize;
                        *pixel = self.shown.over([0, 1, 2, 3].map(|i| packet[i][lane]), *pixel);
                    }
                    continue;
                }
                let packets = &light[packet_row as usize..(packet_row + TILE_PACKETS) as usize];
                for (packet, pixels) in packets.iter().zip(pixels.chunks_mut(PACKET as usize)) {
                    for (lane, pixel) in (lane_row..).zip(pixels) {
                        let light = [packet[0][lane], packet[1][lane], packet[2][lane], packet[3][lane]];
                        *pixel = self.shown.over(light, *pixel);
                    }
                }
            }
        }
    }
}

impl Shown {
    /// Light before what is behind it.
    #[inline(always)]
    fn over(&self, light: [f32; 4], behind: [f32; 3]) -> [f32; 3] {
        let [low, high] = match (self.is_planes, self.emitted) {
            (true, _) => {
                return axes(
                    #[inline(always)]
                    |i| light[3].mul_add(behind[i], light[i]),
                );
            }
            (false, None) => {
                return axes(
                    #[inline(always)]
                    |i| light[i] + light[3] * behind[i],
                );
            }
            (false, Some(emitted)) => emitted,
        };
        // `max` takes the other where the sum is NaN.
        axes(
            #[inline(always)]
            |i| {
                let sum = light[i] + light[3] * behind[i];
                sum.max(low[i].min(behind[i])).min(high[i].max(behind[i]))
            },
        )
    }

    /// Counts a part of sheets, which can emit colours between these.
    pub(crate) fn add_sheets(&mut self, [low, high]: [[f32; 3]; 2]) {
        let all = [0, 1, 2];
        self.emitted = match self.emitted {
            None if self.num_parts == 0 => Some([low, high]),
            Some([least, most]) => {
                Some([all.map(|i| least[i].min(low[i])), all.map(|i| most[i].max(high[i]))])
            }
            // What other parts can show is not known.
            None => None,
        };
        (self.num_parts, self.is_planes) = (self.num_parts + 1, false);
    }

    pub(crate) fn add_rays(&mut self) {
        self.add_cubes();
        self.has_rays = true;
    }

    pub(crate) fn add_planes(&mut self) {
        self.add_cubes();
        self.is_planes = true;
    }

    pub(crate) fn add_cubes(&mut self) {
        (self.num_parts, self.emitted, self.is_planes) = (self.num_parts + 1, None, false);
    }
}
