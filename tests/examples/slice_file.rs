//! Slices a grid file by even planes and says what it took: `slice_file FILE [PLANES [NX,NY,NZ]]`.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use volery_io::{GridOptions, read_grid};
use volery_slicing::{Planes, Refinement, Slicer};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let file = arguments.first().ok_or("expected a file")?;
    let count = arguments.get(1).map_or(Ok(256), |count| count.parse())?;
    let components = arguments.get(2).map_or("0.3,0.5,0.81", String::as_str).split(',').map(str::parse);
    let normal: [f64; 3] = components
        .collect::<Result<Vec<f64>, _>>()?
        .try_into()
        .map_err(|_| "expected a normal of 3 numbers")?;
    let normal = DVec3::from_array(normal);

    let grid = read_grid(Path::new(file), &GridOptions::default())?.grid;
    println!("{grid:?}");
    let started = Instant::now();
    let slicer = Slicer::new(grid)?;
    println!("prepare: {} edges, {:.1} ms", slicer.num_edges(), started.elapsed().as_secs_f64() * 1e3);
    let planes = Planes::over(slicer.grid(), normal, count)?;
    let (mut slice_seconds, mut value_seconds) = (f64::INFINITY, f64::INFINITY);
    let mut stack = slicer.slice(&planes)?;
    for _ in 0..15 {
        let started = Instant::now();
        stack = slicer.slice(&planes)?;
        slice_seconds = slice_seconds.min(started.elapsed().as_secs_f64());
        let started = Instant::now();
        for (_, section) in stack.sections() {
            std::hint::black_box(section.positions(slicer.grid().points()));
            if let Some(array) = slicer.grid().arrays().first() {
                std::hint::black_box(section.values(&array.values));
            }
        }
        value_seconds = value_seconds.min(started.elapsed().as_secs_f64());
    }
    let num_polygons = stack.num_polygons();
    println!(
        "slice: {num_polygons} polygons, {} vertices, {:.2} ms, {:.1} million polygons per second",
        stack.num_vertices(),
        slice_seconds * 1e3,
        num_polygons as f64 / slice_seconds / 1e6
    );
    println!("positions and values on one core: {:.2} ms", value_seconds * 1e3);
    let started = Instant::now();
    let (refined, steps) = slicer.slice_adaptively(normal, Refinement { first_planes: 32, share: 1.0 })?;
    println!(
        "semi-adaptively: {} polygons, {:.1} ms",
        refined.num_polygons(),
        started.elapsed().as_secs_f64() * 1e3
    );
    let num_cells = slicer.grid().cells().len();
    let mut met = 0;
    for step in steps {
        met += step.num_met;
        let share = 100.0 * met as f64 / num_cells as f64;
        let (planes, polygons) = (step.num_planes, step.num_polygons);
        println!("  distance {:.3e}: {planes} planes, {polygons} polygons, {share:.2} % met", step.distance);
    }
    Ok(())
}
