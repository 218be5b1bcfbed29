//! VTK, in a Python of its own under the target folder, driven line by line.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use super::table::Row;
use crate::{apt, shell};

/// What VTK draws with: mapper and step in voxels.
pub(super) const SETTINGS: [(&str, f64); 8] = [
    ("gpu", 0.25),
    ("gpu", 0.5),
    ("gpu", 1.0),
    ("gpu", 2.0),
    ("gpu", 4.0),
    ("fixed", 0.5),
    ("fixed", 1.0),
    ("fixed", 2.0),
];

/// Name of a mapper in the table.
pub(super) fn program(mapper: &str) -> &'static str {
    if mapper == "gpu" { "VTK GPU ray cast" } else { "VTK fixed point (CPU)" }
}

/// What OpenGL needs to draw in software without a display.
const OPENGL_PACKAGES: [&str; 4] = ["libegl1", "libgl1", "libegl-mesa0", "libgl1-mesa-dri"];

/// A running worker.
pub(super) struct Vtk {
    process: Child,
    requests: ChildStdin,
    replies: BufReader<ChildStdout>,
    /// Version and device, for people.
    pub(super) about: String,
}

impl Vtk {
    /// Makes the Python environment where it is missing and starts a worker that can draw.
    ///
    /// # Errors
    /// When Python, VTK or OpenGL is missing and cannot be installed.
    pub(super) fn start(folder: &Path) -> Result<Self, String> {
        let python = environment(folder)?;
        if let Ok(vtk) = Self::probed(&python) {
            return Ok(vtk);
        }
        println!("VTK cannot draw here: OpenGL in software is needed");
        apt::install(&OPENGL_PACKAGES).map_err(|error| format!("VTK needs OpenGL; {error}"))?;
        Self::probed(&python)
    }

    fn probed(python: &Path) -> Result<Self, String> {
        let script = shell::root().join("xtask/src/bench/vtk_worker.py");
        let mut command = Command::new(python);
        command.arg(script).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().map_err(|error| format!("{}: {error}", python.display()))?;
        let requests = process.stdin.take().expect("it is piped");
        let replies = BufReader::new(process.stdout.take().expect("it is piped"));
        let mut vtk = Self { process, requests, replies, about: String::new() };
        let found = vtk.ask(&json!({"do": "probe"}))?;
        let text = |name: &str| found[name].as_str().unwrap_or("unknown").to_owned();
        vtk.about = format!("VTK {} on {}", text("vtk"), text("device"));
        Ok(vtk)
    }

    /// Loads a scene; `reference` is its true picture.
    pub(super) fn load(&mut self, scene: &Path, data: &Path, reference: &Path) -> Result<(), String> {
        self.ask(&json!({"do": "load", "scene": scene, "data": data, "reference": reference})).map(drop)
    }

    /// Draws the loaded scene and adds the times to the row.
    pub(super) fn draw(&mut self, mapper: &str, step: f64, frames: u32, row: &mut Row) -> Result<(), String> {
        let reply = self.ask(&json!({"do": "draw", "mapper": mapper, "step": step, "frames": frames}))?;
        row.take(&reply)
    }

    /// Loads the volume of a scene, to be cut by a plane through the camera's target.
    pub(super) fn load_plane(&mut self, scene: &Path, data: &Path, reference: &Path) -> Result<(), String> {
        let request = json!({"do": "load_plane", "scene": scene, "data": data, "reference": reference});
        self.ask(&request).map(drop)
    }

    /// Cuts the loaded volume and adds the times to the row.
    pub(super) fn reslice(&mut self, frames: u32, row: &mut Row) -> Result<(), String> {
        let reply = self.ask(&json!({"do": "reslice", "frames": frames}))?;
        row.take(&reply)
    }

    /// Loads the grid of a scene as tetrahedra; `reference` is its true picture by VTK's meaning of opacity.
    pub(super) fn load_grid(&mut self, scene: &Path, data: &Path, reference: &Path) -> Result<(), String> {
        let request = json!({"do": "load_grid", "scene": scene, "data": data, "reference": reference});
        self.ask(&request).map(drop)
    }

    /// Draws the loaded grid and adds the times to the row.
    pub(super) fn draw_grid(&mut self, mapper: &str, frames: u32, row: &mut Row) -> Result<(), String> {
        let reply = self.ask(&json!({"do": "draw_grid", "mapper": mapper, "frames": frames}))?;
        row.take(&reply)
    }

    /// Loads a grid to be cut by `count` planes.
    pub(super) fn load_cut(&mut self, file: &Path, count: u32, normal: [f64; 3]) -> Result<(), String> {
        self.ask(&json!({"do": "load_cut", "file": file, "count": count, "normal": normal})).map(drop)
    }

    /// Cuts the loaded grid and adds the times and the number of polygons to the row.
    pub(super) fn cut(&mut self, frames: u32, row: &mut Row) -> Result<(), String> {
        let reply = self.ask(&json!({"do": "cut", "frames": frames}))?;
        row.take(&reply)
    }

    fn ask(&mut self, request: &Value) -> Result<Value, String> {
        let failed = |error: std::io::Error| format!("VTK: {error}");
        writeln!(self.requests, "{request}").map_err(failed)?;
        let mut line = String::new();
        self.replies.read_line(&mut line).map_err(failed)?;
        serde_json::from_str(&line).map_err(|_| format!("VTK stopped at {request}"))
    }
}

impl Drop for Vtk {
    fn drop(&mut self) {
        // It may have ended by itself; either way nothing is left to do about it.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The Python that has VTK, made and filled through pip where it is missing.
fn environment(folder: &Path) -> Result<PathBuf, String> {
    let home = folder.join("venv");
    let python = home.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if !python.exists() {
        println!("making a Python environment in {}", home.display());
        let make = || shell::run(Command::new("python3").args(["-m", "venv"]).arg(&home));
        if make().is_err() {
            apt::install(&["python3-venv"])
                .map_err(|error| format!("Python 3 with venv is needed; {error}"))?;
            make()?;
        }
    }
    let has_vtk = shell::run(
        Command::new(&python).args(["-c", "import vtkmodules, numpy, zstandard"]).stderr(Stdio::null()),
    );
    if has_vtk.is_err() {
        println!("installing vtk, numpy and zstandard through pip");
        shell::run(Command::new(&python).args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "vtk",
            "numpy",
            "zstandard",
        ]))?;
    }
    Ok(python)
}
