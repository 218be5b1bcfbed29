//! Times slices of a grid: `slice_rate GRID COUNT NX,NY,NZ REPEATS` prints `{"polygons": N, "seconds": [..]}`.
//!
//! `cargo xtask bench peers` has it and vtkCutter cut in turn. Planes lie evenly over the grid, the first half a
//! distance inside. The grid is made ready once, as a session does, and the first cut is not timed.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use volery::glam::DVec3;
use volery_io::{GridOptions, read_grid};
use volery_slicing::{Planes, Slicer};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, count, normal, repeats] = arguments.as_slice() else {
        return Err("usage: slice_rate GRID COUNT NX,NY,NZ REPEATS".into());
    };
    let normal: Vec<f64> = normal.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let [x, y, z] = normal[..] else { return Err("expected NX,NY,NZ".into()) };
    let slicer = Slicer::new(read_grid(Path::new(file), &GridOptions::default())?.grid)?;
    let planes = Planes::over(slicer.grid(), DVec3::new(x, y, z), count.parse()?)?;
    let num_polygons = slicer.slice(&planes)?.num_polygons();
    let mut seconds = Vec::new();
    for _ in 0..repeats.parse()? {
        let start = Instant::now();
        let stack = slicer.slice(&planes)?;
        seconds.push(start.elapsed().as_secs_f64());
        if stack.num_polygons() != num_polygons {
            return Err("the same planes gave another number of polygons".into());
        }
    }
    println!("{{\"polygons\": {num_polygons}, \"seconds\": {seconds:?}}}");
    Ok(())
}
