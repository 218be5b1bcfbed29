//! Unstructured grids: pictures beside VTK's Bunyk ray cast and projected tetrahedra, slices beside vtkCutter.
//!
//! VTK's mappers of grids take a control point's opacity for an extinction per unit distance, `s = a / u`, Volery and
//! VTK's volume mappers mean `s = -ln(1 - a) / u`. Each is judged by its own meaning: for VTK the reference is of a
//! transfer function whose opacity is `1 - exp(-a)`, by many control points between those of the scene.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::peers::{BACKENDS, scene_file};
use super::table::{BUNYK, CUTTER, Row};
use super::volery::Volery;
use super::vtk::Vtk;

/// VTK's mappers of grids: what the worker calls them, and people.
const MAPPERS: [(&str, &str); 2] = [("bunyk", BUNYK.0), ("tetrahedra", "VTK projected tetrahedra")];

/// What Volery draws with: the setting for people, and the options of the program.
type Setting = (&'static str, &'static [&'static str]);

const EVEN: [Setting; 6] = [
    ("32 slices", &["--slices", "32"]),
    ("64 slices", &["--slices", "64"]),
    ("128 slices", &["--slices", "128"]),
    ("256 slices", &["--slices", "256"]),
    ("512 slices", &["--slices", "512"]),
    ("1024 slices", &["--slices", "1024"]),
];

const SEMI_ADAPTIVE: [Setting; 3] = [
    ("16 slices, finer for thin cells", &["--slices", "16", "--adaptive", "1"]),
    ("64 slices, finer for thin cells", &["--slices", "64", "--adaptive", "1"]),
    ("128 slices, finer for thin cells", &["--slices", "128", "--adaptive", "1"]),
];

/// Control points between two of the scene, for VTK's meaning of opacity.
const POINTS_BETWEEN: u32 = 64;

/// Cuts through grids: planes, and their normal.
const CUT_PLANES: u32 = 256;
const CUT_NORMAL: [f64; 3] = [0.3, 0.5, 0.81];

/// Whether a scene is one of a grid.
///
/// # Errors
/// When it cannot be read.
pub(super) fn is_grid(scene: &Path) -> Result<bool, String> {
    Ok(read(scene)?["input"]["kind"] == "grid")
}

fn read(scene: &Path) -> Result<Value, String> {
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", scene.display());
    let text = fs::read_to_string(scene).map_err(|error| failed(&error))?;
    serde_json::from_str(&text).map_err(|error| failed(&error))
}

/// Measures the pictures of a scene. Adds the devices that drew and are new.
///
/// # Errors
/// When data, VTK or Volery are missing or fail.
pub(super) fn measure(
    (volery, vtk): (&Volery, &mut Vtk),
    (data, folder): (&Path, &Path),
    name: &str,
    [frames, rounds]: [u32; 2],
    devices: &mut Vec<String>,
) -> Result<Vec<Row>, String> {
    let scene = scene_file(data, name)?;
    let reference = volery.write_reference(&in_vtk_meaning(&scene, folder)?, data, None)?;
    vtk.load_grid(&scene, data, &reference)?;
    let mut of_vtk = MAPPERS.map(|(_, program)| Row::new(name, program, BUNYK.1));
    let programs = BACKENDS
        .iter()
        .flat_map(|backend| EVEN.iter().chain(&SEMI_ADAPTIVE).map(move |setting| (*backend, *setting)));
    let mut of_volery: Vec<_> = programs
        .map(|(backend, setting)| {
            let row = Row::new(name, &format!("Volery {backend}"), setting.0);
            (backend, setting.1, Some(row))
        })
        .collect();
    for round in 0..rounds {
        for (row, (mapper, _)) in of_vtk.iter_mut().zip(MAPPERS) {
            vtk.draw_grid(mapper, frames, row)?;
        }
        for (backend, options, slot) in &mut of_volery {
            let Some(row) = slot else { continue };
            match volery.draw((&scene, data), (backend, frames), options, round == 0, row) {
                Ok(device) if devices.contains(&device) => {}
                Ok(device) => devices.push(device),
                Err(error) => {
                    println!("{error}: left out");
                    *slot = None;
                }
            }
        }
    }
    Ok(of_vtk.into_iter().chain(of_volery.into_iter().filter_map(|(_, _, row)| row)).collect())
}

/// The scene with opacities that say to Volery what the scene's say to VTK's mappers of grids.
fn in_vtk_meaning(scene: &Path, folder: &Path) -> Result<PathBuf, String> {
    let mut described = read(scene)?;
    let points = described["transfer_function"]["points"].as_array().ok_or("a scene without points")?;
    let at = |a: &Value, b: &Value, w: f64| {
        let mix = |a: &Value, b: &Value| {
            let [a, b] = [a, b].map(|x| x.as_f64().unwrap_or(f64::NAN));
            a + (b - a) * w
        };
        let color: Vec<f64> = (0..3).map(|i| mix(&a["color"][i], &b["color"][i])).collect();
        let opacity = -(-mix(&a["opacity"], &b["opacity"])).exp_m1();
        json!({"value": mix(&a["value"], &b["value"]), "color": color, "opacity": opacity})
    };
    let between = |pair: &[Value]| {
        let (a, b) = (pair[0].clone(), pair[1].clone());
        (0..POINTS_BETWEEN).map(move |i| at(&a, &b, f64::from(i) / f64::from(POINTS_BETWEEN)))
    };
    let mut denser: Vec<Value> = points.windows(2).flat_map(between).collect();
    denser.extend(points.last().map(|last| at(last, last, 0.0)));
    described["transfer_function"]["points"] = denser.into();
    let file = folder.join("vtk_meaning.json");
    fs::write(&file, format!("{described:#}\n")).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(file)
}

/// The file of a grid that a scene of this kind is named after: `slices_bluntfin`.
pub(super) fn cut_file(name: &str) -> Option<String> {
    Some(format!("{}.vtu", name.strip_prefix("slices_")?))
}

/// Measures cuts through a grid.
///
/// # Errors
/// When data, VTK or Volery are missing or fail.
pub(super) fn measure_cuts(
    (volery, vtk): (&Volery, &mut Vtk),
    data: &Path,
    (name, file): (&str, &str),
    [frames, rounds]: [u32; 2],
) -> Result<Vec<Row>, String> {
    let file = data.join(file);
    let mut rows = [Row::new(name, CUTTER.0, CUTTER.1), Row::new(name, "Volery slicing", CUTTER.1)];
    let [of_vtk, of_volery] = &mut rows;
    vtk.load_cut(&file, CUT_PLANES, CUT_NORMAL)?;
    for _ in 0..rounds {
        vtk.cut(frames, of_vtk)?;
        volery.slice(&file, CUT_PLANES, CUT_NORMAL, frames, of_volery)?;
    }
    Ok(rows.into())
}
