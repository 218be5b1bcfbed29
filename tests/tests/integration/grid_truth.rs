//! The reference for grids against VTK: a march in f64 through VTK's own interpolation of cells.
//!
//! The pictures of VTK are of 8 bits, whose rounding alone makes an rmse of up to 0.0011, and marched in steps of a
//! 2,000th of the diagonal. Most of the largest differences (0.023, in the thin layers at the fin of bluntfin) are not
//! ours: vtkProbeFilter finds a cell within a tolerance, so it takes values from beside a cell that it leaves, while
//! vtkCell's own `EvaluatePosition` agrees with the reference there.

use std::time::Instant;

use volery_io::{GridOptions, SceneFile, read_grid};
use volery_reference::{GridTracer, Image};
use volery_tests::{at_most, data_folder, distance, scenes_folder, transfer_of};

fn against_vtk(name: &str, test: &str, rmse: f64, max: f64) {
    let Some(data) = data_folder(test) else { return };
    let scenes = scenes_folder(&data);
    let scene = SceneFile::read(&scenes.join(format!("{name}.json"))).unwrap();
    let options = GridOptions { array: scene.input.array.clone(), ..GridOptions::default() };
    let grid = read_grid(&data.join(&scene.input.file), &options).unwrap().grid;
    let tracer = GridTracer::new(&grid, &grid.arrays()[0].values, transfer_of(&scene)).unwrap();
    let [width, height] = scene.size.unwrap();
    let start = Instant::now();
    let truth =
        tracer.render(&scene.camera.unwrap(), scene.background.unwrap(), width, height, &|_| {}).unwrap();
    println!("{name}: {:.1} s", start.elapsed().as_secs_f64());
    let vtk = volery_io::read_png_rgb(&scenes.join(format!("{name}.vtk.png"))).unwrap();
    let vtk = vtk.pixels.iter().map(|pixel| pixel.map(f64::from)).collect();
    let vtk = Image::new(width, height, vtk).unwrap();
    let found = distance(name, &truth, &vtk);
    at_most(&format!("{name}: rmse against VTK"), found.rmse, rmse);
    at_most(&format!("{name}: largest difference from VTK"), found.max, max);
}

#[test]
fn bluntfin() {
    against_vtk("bluntfin", "grid_truth::bluntfin", 0.001, 0.025);
}

#[test]
fn k3d_fem() {
    against_vtk("k3d_fem", "grid_truth::k3d_fem", 0.0007, 0.008);
}
