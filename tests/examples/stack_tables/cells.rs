//! What slicing takes: cells met and polygons of each step, and a time step beside slicing anew.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use volery::glam::DVec3;
use volery_io::{GridOptions, read_grid};
use volery_slicing::{Planes, Refinement, Slicer, Step};

const GRIDS: [&str; 3] = ["bluntfin", "k3d_fem", "post_mixed"];
const NORMAL: DVec3 = DVec3::new(0.3, 0.5, 0.81);
const FIRST_PLANES: usize = 32;
const NUM_PLANES: usize = 256;
const RUNS: usize = 7;

/// Prints all.
pub(crate) fn tables(data: &Path) -> Result<(), Box<dyn Error>> {
    semi_adaptive(&slicer(data, GRIDS[0])?)?;
    println!("\n### Time steps\n");
    println!("| grid | new mesh, ms | slices alone, ms | new values, ms | mesh / values | slices / values |");
    println!("|---|---|---|---|---|---|");
    GRIDS.iter().try_for_each(|name| time_step(name, &slicer(data, name)?))
}

fn slicer(data: &Path, name: &str) -> Result<Slicer, Box<dyn Error>> {
    let file = read_grid(&data.join(format!("{name}.vtu")), &GridOptions::default())?;
    Ok(Slicer::new(file.grid)?)
}

fn semi_adaptive(slicer: &Slicer) -> Result<(), Box<dyn Error>> {
    let grid = slicer.grid();
    let values = &grid.arrays().first().ok_or("a grid without arrays")?.values;
    let refinement = Refinement { first_planes: FIRST_PLANES, share: 1.0 };
    let (_, marked) = slicer.slice_adaptively(NORMAL, refinement)?;
    let (_, classes) = slicer.mesh_adaptively(NORMAL, refinement, values, None)?;
    println!("\n### Semi-adaptive slicing of {}\n", GRIDS[0]);
    println!("| way | distance | planes | polygons | polygons so far | cells met so far |");
    println!("|---|---|---|---|---|---|");
    let num_cells = grid.cells().len();
    steps("the paper's marking", &marked, num_cells);
    steps("by extent", &classes, num_cells);
    // The paper's alternative (Chopra and Meyer): no distance at or above the smallest edge.
    let edge = |cell: usize| {
        let (_, nodes) = grid.cells().get(cell);
        let places = nodes.iter().map(|&node| grid.points()[node as usize]);
        let pairs =
            nodes.iter().flat_map(|&a| places.clone().map(move |b| grid.points()[a as usize].distance(b)));
        pairs.filter(|&distance| distance > 0.0).fold(f64::INFINITY, f64::min)
    };
    let smallest = (0..num_cells).map(edge).fold(f64::INFINITY, f64::min);
    let first = Planes::over(grid, NORMAL, 1)?;
    let count = (first.distance() / smallest).floor() as usize + 1;
    let planes = Planes::over(grid, NORMAL, count)?;
    let polygons = slicer.slice(&planes)?.num_polygons();
    println!(
        "| uniform, below the smallest edge | {:.2e} | {count} | {polygons} | {polygons} | |",
        planes.distance()
    );
    Ok(())
}

fn steps(way: &str, steps: &[Step], num_cells: usize) {
    let (mut num_met, mut num_polygons) = (0, 0);
    for step in steps {
        num_met += step.num_met;
        num_polygons += step.num_polygons;
        let share = 100.0 * num_met as f64 / num_cells as f64;
        let Step { distance, num_planes, num_polygons: of_step, .. } = step;
        println!("| {way} | {distance:.2e} | {num_planes} | {of_step} | {num_polygons} | {share:.2} % |");
    }
}

fn time_step(name: &str, slicer: &Slicer) -> Result<(), Box<dyn Error>> {
    let values = &slicer.grid().arrays().first().ok_or("a grid without arrays")?.values;
    let planes = Planes::over(slicer.grid(), NORMAL, NUM_PLANES)?;
    let made = slicer.mesh(&planes, values, None)?;
    let mut mesh = made.clone();
    let anew = seconds(|| Ok(slicer.mesh(&planes, values, None).map(drop)?))?;
    let slices = seconds(|| Ok(slicer.slice(&planes).map(drop)?))?;
    let update = seconds(|| Ok(mesh.set_values(values, None)?))?;
    if mesh != made {
        return Err(format!("{name}: the same values gave another mesh").into());
    }
    println!(
        "| {name} | {:.2} | {:.2} | {:.2} | {:.1} | {:.1} |",
        1e3 * anew,
        1e3 * slices,
        1e3 * update,
        anew / update,
        slices / update
    );
    Ok(())
}

/// The median of several runs.
fn seconds(mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    let mut found = Vec::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        run()?;
        found.push(start.elapsed().as_secs_f64());
    }
    found.sort_by(f64::total_cmp);
    Ok(found[RUNS / 2])
}
