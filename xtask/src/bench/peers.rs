//! VTK and Volery in turn on the same scenes, one run, one machine: time against error.
//!
//! Per scene: Volery's f64 reference is computed once; then some rounds, and in each round every setting of both
//! programs draws its frames, so that what else the machine does falls on all alike. Times are medians over all
//! frames of all rounds; the first frame of a program's turn (upload, shaders) is not timed for either.
//! VTK's time ends when OpenGL has finished, without reading back; Volery's contains the read back.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use super::table::{self, Row};
use super::volery::Volery;
use super::vtk::{self, Vtk};
use super::{grids, reslice};
use crate::shell;

/// Options of `cargo xtask bench peers`.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Scenes by name; `plane_N` is an oblique plane in N x N pixels through the mouse, `slices_FILE` slices through
    /// a grid
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "engine,engine_inside,heptane,mri,tooth16,plane_512,plane_1024,bluntfin,k3d_fem,slices_bluntfin,\
                         slices_post_mixed"
    )]
    scenes: Vec<String>,
    /// Frames per program, setting and round
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Rounds in which the programs take turns
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Put the table between the markers `peers` of README.md
    #[arg(long)]
    update_readme: bool,
}

/// Measures, prints the table, and writes `peers.md` and `peers.json`.
///
/// # Errors
/// When scenes, data, VTK or Volery are missing or fail.
pub(super) fn run(options: &Options) -> Result<(), String> {
    let data = shell::data_folder()?.ok_or("no folder ../shared/data, and VOLERY_DATA is not set")?;
    let folder = super::work_folder()?;
    let has_file = |name: &&String| reslice::side(name).is_none() && grids::cut_file(name).is_none();
    options.scenes.iter().filter(has_file).try_for_each(|name| scene_file(&data, name).map(drop))?;
    let volery = Volery::build(&folder)?;
    let mut vtk = Vtk::start(&folder)?;
    println!("{}", vtk.about);

    let mut rows = Vec::new();
    let mut devices = Vec::new();
    for name in &options.scenes {
        println!("== {name}");
        let repeats = [options.frames, options.rounds];
        let (programs, folders) = ((&volery, &mut vtk), (data.as_path(), folder.as_path()));
        let of_scene = if let Some(side) = reslice::side(name) {
            reslice::measure(programs, folders, side, repeats, &mut devices)?
        } else if let Some(file) = grids::cut_file(name) {
            grids::measure_cuts(programs, &data, (name, &file), repeats)?
        } else if grids::is_grid(&scene_file(&data, name)?)? {
            grids::measure(programs, folders, name, repeats, &mut devices)?
        } else {
            measure(programs, folders, name, repeats, &mut devices)?
        };
        println!("{}", table::markdown(&of_scene, &[]));
        rows.extend(of_scene);
    }
    write(&rows, &about(options, &vtk.about, &devices), &folder, options.update_readme)
}

/// Measures a scene of a volume. Adds the devices that drew and are new.
fn measure(
    (volery, vtk): (&Volery, &mut Vtk),
    (data, _): (&Path, &Path),
    name: &str,
    [frames, rounds]: [u32; 2],
    devices: &mut Vec<String>,
) -> Result<Vec<Row>, String> {
    let scene = &scene_file(data, name)?;
    let reference = volery.write_reference(scene, data, None)?;
    vtk.load(scene, data, &reference)?;
    let mut of_vtk =
        vtk::SETTINGS.map(|(mapper, step)| Row::new(name, vtk::program(mapper), &format!("step {step}")));
    let mut of_volery =
        BACKENDS.map(|backend| Some(Row::new(name, &format!("Volery {backend}"), "full resolution")));
    for round in 0..rounds {
        for (row, (mapper, step)) in of_vtk.iter_mut().zip(vtk::SETTINGS) {
            vtk.draw(mapper, step, frames, row)?;
        }
        for (slot, backend) in of_volery.iter_mut().zip(BACKENDS) {
            let Some(row) = slot else { continue };
            match volery.draw((scene, data), (backend, frames), &[], round == 0, row) {
                Ok(device) if devices.contains(&device) => {}
                Ok(device) => devices.push(device),
                Err(error) => {
                    println!("{error}: left out");
                    *slot = None;
                }
            }
        }
    }
    Ok(of_vtk.into_iter().chain(of_volery.into_iter().flatten()).collect())
}

/// Who draws of Volery.
pub(super) const BACKENDS: [&str; 2] = ["software", "wgpu"];

/// The scene files lie beside the data: `peers/scenes/NAME.json`.
pub(super) fn scene_file(data: &Path, name: &str) -> Result<PathBuf, String> {
    let file = data.join("../peers/scenes").join(format!("{name}.json"));
    if file.is_file() { Ok(file) } else { Err(format!("{}: no such scene", file.display())) }
}

/// Where and how it was measured.
fn about(options: &Options, vtk: &str, devices: &[String]) -> Vec<String> {
    let cores = thread::available_parallelism().map_or("unknown".to_owned(), |cores| cores.to_string());
    vec![
        format!(
            "`cargo xtask bench peers --frames {} --rounds {}`: {vtk}; Volery on {}; {cores} hardware threads.",
            options.frames,
            options.rounds,
            devices.join(", ")
        ),
        "Programs take turns on each scene. Error of all channels in [0, 1] against Volery's f64 reference; VTK's \
         pictures have 8 bits (rounding alone is rmse .0011), Volery's 32; the last column is against VTK's own \
         picture at 1/16 voxel. The yardstick is the first row of VTK with a 1: the GPU ray cast at half a voxel, \
         vtkImageReslice, the Bunyk ray cast, vtkCutter. VTK's mappers of grids are judged by their own meaning of \
         opacity, and draw tetrahedra that are made before."
            .to_owned(),
    ]
}

fn write(rows: &[Row], about: &[String], folder: &Path, update_readme: bool) -> Result<(), String> {
    let table = table::markdown(rows, about);
    print!("{table}");
    let save =
        |path: &Path, text: &str| fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()));
    save(&folder.join("peers.md"), &table)?;
    save(&folder.join("peers.json"), &format!("{:#}\n", table::json(rows, about)))?;
    if update_readme {
        let readme = shell::root().join("README.md");
        let text = fs::read_to_string(&readme).map_err(|error| format!("{}: {error}", readme.display()))?;
        let pasted = table::pasted(&text, "peers", &table)
            .map_err(|error| format!("{}: {error}", readme.display()))?;
        save(&readme, &pasted)?;
    }
    Ok(())
}
