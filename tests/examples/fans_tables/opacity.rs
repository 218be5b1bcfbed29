//! The paper's table of opacities, `1 - exp(-u v)` of length and extinction (section 7), beside `expm1`.

use std::hint::black_box;
use std::time::Instant;

/// Entries per axis.
const SIZES: [usize; 5] = [64, 128, 256, 512, 1024];
/// The largest extinction that the table covers, per voxel: a voxel lets 1/150 of the light through.
const MAX_EXTINCTION: f32 = 5.0;
/// Edges of the largest cube, in voxels.
const CUBES: [u32; 3] = [1, 8, 64];
const NUM_POINTS: usize = 1 << 20;

/// A table over `[0, max_length] x [0, MAX_EXTINCTION]`, read as textures are: linear between entries.
struct Table {
    size: usize,
    max_length: f32,
    entries: Vec<f32>,
}

impl Table {
    fn new(size: usize, max_length: f32) -> Self {
        let at = |i: usize, max: f32| i as f64 / (size - 1) as f64 * f64::from(max);
        let entry = |place: usize| {
            -(-at(place % size, max_length) * at(place / size, MAX_EXTINCTION)).exp_m1() as f32
        };
        Self { size, max_length, entries: (0..size * size).map(entry).collect() }
    }

    #[inline]
    fn opacity(&self, [length, extinction]: [f32; 2]) -> f32 {
        let last = (self.size - 1) as f32;
        let (x, y) = (length / self.max_length * last, extinction / MAX_EXTINCTION * last);
        let (i, j) = ((x as usize).min(self.size - 2), (y as usize).min(self.size - 2));
        let (u, v) = (x - i as f32, y - j as f32);
        let [a, b] = [j, j + 1].map(|j| {
            let row = &self.entries[j * self.size + i..][..2];
            row[0] + (row[1] - row[0]) * u
        });
        a + (b - a) * v
    }
}

/// Points of the unit square without a pattern: multiples of two irrational numbers.
fn points(max_length: f32) -> Vec<[f32; 2]> {
    let part = |i: usize, step: f64| (i as f64 * step).fract() as f32;
    let point = |i| [part(i, 0.754_877_666) * max_length, part(i, 0.569_840_291) * MAX_EXTINCTION];
    (0..NUM_POINTS).map(point).collect()
}

fn nanoseconds(points: &[[f32; 2]], opacity: impl Fn([f32; 2]) -> f32) -> f64 {
    let start = Instant::now();
    black_box(points.iter().map(|&point| opacity(point)).sum::<f32>());
    start.elapsed().as_secs_f64() * 1e9 / points.len() as f64
}

/// Prints the error of tables against their size, and the time of a look-up.
pub(crate) fn tables() {
    println!("\n### The paper's table of opacities");
    println!(
        "`1 - exp(-u v)` in a table of f32, linear between entries, against `expm1` in f64; extinctions up to \
         {MAX_EXTINCTION} per voxel, lengths up to the diagonal of the largest cube. One core, whole loops.\n"
    );
    println!("| largest cube | entries | max | rms | ns | expm1: max | ns |\n|---|---|---|---|---|---|---|");
    for edge in CUBES {
        let max_length = edge as f32 * 3_f32.sqrt();
        let points = points(max_length);
        let exact = |[length, extinction]: [f32; 2]| -(-f64::from(length) * f64::from(extinction)).exp_m1();
        let by_expm1 = |[length, extinction]: [f32; 2]| -(-length * extinction).exp_m1();
        let errors = |opacity: &dyn Fn([f32; 2]) -> f32| {
            let off = points.iter().map(|&point| (f64::from(opacity(point)) - exact(point)).abs());
            off.fold([0.0_f64, 0.0], |[max, sum], off| [max.max(off), sum + off * off])
        };
        let [expm1_max, _] = errors(&by_expm1);
        let expm1_time = nanoseconds(&points, by_expm1);
        for size in SIZES {
            let table = Table::new(size, max_length);
            let [max, sum] = errors(&|point| table.opacity(point));
            let rms = (sum / points.len() as f64).sqrt();
            let time = nanoseconds(&points, |point| table.opacity(point));
            println!(
                "| {edge} | {size} x {size} | {max:.1e} | {rms:.1e} | {time:.1} | {expm1_max:.1e} | {expm1_time:.1} |"
            );
        }
    }
}
