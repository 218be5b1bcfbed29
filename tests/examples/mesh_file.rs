//! Makes meshes of a stack through a grid file, of even planes and semi-adaptively, and says what it took:
//! `mesh_file FILE [PLANES [FIRST_PLANES]]`.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use volery_io::{GridOptions, read_grid};
use volery_slicing::{Planes, Refinement, Slicer};

/// The shortest of some runs in milliseconds, and what the last gave.
fn shortest<T>(mut run: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let started = Instant::now();
        let made = run();
        (started.elapsed().as_secs_f64() * 1e3, made)
    };
    let mut best = timed();
    for _ in 0..14 {
        let next = timed();
        best = (best.0.min(next.0), next.1);
    }
    best
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let file = arguments.first().ok_or("expected a file")?;
    let count = arguments.get(1).map_or(Ok(256), |count| count.parse())?;
    let first_planes = arguments.get(2).map_or(Ok(32), |count| count.parse())?;
    let slicer = Slicer::new(read_grid(Path::new(file), &GridOptions::default())?.grid)?;
    let array = slicer.grid().arrays().first().ok_or("expected an array of values at the points")?;
    let values = &array.values;
    let normal = DVec3::new(0.3, 0.5, 0.81);
    let planes = Planes::over(slicer.grid(), normal, count)?;

    let started = Instant::now();
    slicer.mesh(&planes, values, None)?;
    println!("first mesh, outline found: {:.1} ms", started.elapsed().as_secs_f64() * 1e3);
    let (slicing, stack) = shortest(|| slicer.slice(&planes));
    let stack = stack?;
    println!("slices alone: {slicing:.1} ms, {} polygons", stack.num_polygons());
    let (plain, _) = shortest(|| slicer.mesh_of_stack(stack.clone(), values, None));
    println!("mesh of these (and a copy of them): {plain:.1} ms");
    let (meshing, mesh) = shortest(|| slicer.mesh(&planes, values, None));
    let mut mesh = mesh?;
    let strips = mesh.sheets.iter().filter(|sheet| sheet.thickness[1] != 0.0);
    let num_strips: usize = strips.map(|sheet| sheet.triangles.len()).sum();
    println!(
        "mesh: {meshing:.1} ms, {} vertices, {} triangles, {num_strips} of them of strips",
        mesh.points.len(),
        mesh.triangles.len()
    );
    let (update, updated) = shortest(|| mesh.set_values(values, None));
    updated?;
    println!(
        "other values: {update:.2} ms, {:.1} times faster than slices alone, {:.1} times than the mesh",
        slicing / update,
        meshing / update
    );
    let refinement = Refinement { first_planes, share: 1.0 };
    let (adaptive, made) = shortest(|| slicer.mesh_adaptively(normal, refinement, values, None));
    let (mesh, steps) = made?;
    let num_polygons: usize = steps.iter().map(|step| step.num_polygons).sum();
    println!(
        "semi-adaptively: {adaptive:.1} ms, {num_polygons} polygons, {} triangles with strips, {} sheets",
        mesh.triangles.len(),
        mesh.sheets.len()
    );
    let mut num_met = 0;
    for step in steps {
        num_met += step.num_met;
        let share = 100.0 * num_met as f64 / slicer.grid().cells().len() as f64;
        let (planes, polygons) = (step.num_planes, step.num_polygons);
        println!("  distance {:.3e}: {planes} planes, {polygons} polygons, {share:.2} % met", step.distance);
    }
    Ok(())
}
