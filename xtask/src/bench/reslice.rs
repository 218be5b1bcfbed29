//! An oblique plane through a resident 512^3 volume, by vtkImageReslice and by Volery's technique plane.
//!
//! Both sample the same points: an orthographic camera looks straight at the plane. VTK's output has 8 bits a value
//! and no transfer function; Volery's is grey over 0 to 255, in 32 bits, read back.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::table::Row;
use super::volery::Volery;
use super::vtk::Vtk;

/// The volume that the plane goes through.
const FILE: &str = "mouse_512x512x512_uint8.raw.zst";
const DIMS: [u32; 3] = [512; 3];
const SPACING: [f64; 3] = [0.15625, 0.15625, 0.175_781];
/// Of the plane, which goes through the middle of the volume.
const NORMAL: [f64; 3] = [0.3, 0.5, 0.81];
/// World height of the picture: nearly all of the section is in it.
const HEIGHT: f64 = 100.0;

/// Width and height of the picture a scene of this kind is named after: `plane_512`.
pub(super) fn side(name: &str) -> Option<u32> {
    name.strip_prefix("plane_")?.parse().ok()
}

/// Writes the scene of a picture of `side` pixels; returns the file and the plane as `--plane` takes it.
///
/// # Errors
/// When it cannot be written.
pub(super) fn write_scene(folder: &Path, side: u32) -> Result<(PathBuf, String), String> {
    let middle: Vec<f64> = (0..3).map(|axis| f64::from(DIMS[axis] - 1) / 2.0 * SPACING[axis]).collect();
    let eye: Vec<f64> = (0..3).map(|axis| middle[axis] + 100.0 * NORMAL[axis]).collect();
    let distance: f64 = (0..3).map(|axis| middle[axis] * NORMAL[axis]).sum();
    let gray = |value: f64| {
        let level = value / 255.0;
        json!({"value": value, "color": [level, level, level], "opacity": 1.0})
    };
    let scene = json!({
        "name": format!("plane_{side}"),
        "input": {"kind": "volume", "file": FILE, "dims": DIMS, "dtype": "uint8", "spacing": SPACING},
        "size": [side, side],
        "background": [0, 0, 0],
        "camera": {"projection": "orthographic", "eye": eye, "target": middle, "up": [0, 0, 1], "height": HEIGHT},
        "transfer_function": {"points": [gray(0.0), gray(255.0)], "unit_distance": 1.0},
    });
    let file = folder.join(format!("plane_{side}.json"));
    fs::write(&file, format!("{scene:#}\n")).map_err(|error| format!("{}: {error}", file.display()))?;
    let [x, y, z] = NORMAL;
    Ok((file, format!("{x},{y},{z},{distance}")))
}

/// Measures one size; rounds and frames as the ray-cast scenes have. Adds the devices that drew and are new.
///
/// # Errors
/// When data, VTK or Volery are missing or fail.
pub(super) fn measure(
    (volery, vtk): (&Volery, &mut Vtk),
    (data, folder): (&Path, &Path),
    side: u32,
    [frames, rounds]: [u32; 2],
    devices: &mut Vec<String>,
) -> Result<Vec<Row>, String> {
    let (scene, plane) = write_scene(folder, side)?;
    let reference = volery.write_reference(&scene, data, Some(&plane))?;
    let name = format!("plane_{side}");
    let mut of_vtk = Row::new(&name, super::table::RESLICE.0, super::table::RESLICE.1);
    let mut of_volery = super::peers::BACKENDS
        .map(|backend| Some(Row::new(&name, &format!("Volery {backend}"), "full resolution")));
    let plane_options = ["--technique", "plane", "--plane", &plane];
    vtk.load_plane(&scene, data, &reference)?;
    for round in 0..rounds {
        vtk.reslice(frames, &mut of_vtk)?;
        for (slot, backend) in of_volery.iter_mut().zip(super::peers::BACKENDS) {
            let Some(row) = slot else { continue };
            match volery.draw((&scene, data), (backend, frames), &plane_options, round == 0, row) {
                Ok(device) if devices.contains(&device) => {}
                Ok(device) => devices.push(device),
                Err(error) => {
                    println!("{error}: left out");
                    *slot = None;
                }
            }
        }
    }
    Ok(std::iter::once(of_vtk).chain(of_volery.into_iter().flatten()).collect())
}
