//! Volery, as its users run it: the program, its report, its own check against the reference.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::table::{Error, Row};
use crate::shell;

/// The program, built, and where its pictures and reports go.
pub(super) struct Volery {
    program: PathBuf,
    reference_picture: PathBuf,
    slice_rate: PathBuf,
    folder: PathBuf,
}

impl Volery {
    /// Builds what is measured.
    ///
    /// # Errors
    /// When it does not build.
    pub(super) fn build(folder: &Path) -> Result<Self, String> {
        // In one go, so that all are built with the same features and share their dependencies.
        let all = ["--bin", "volery", "--example", "reference_picture", "--example", "slice_rate"];
        shell::run(shell::cargo(&["build", "--release", "--workspace"]).args(all))?;
        let release = shell::target_folder(&shell::metadata()?)?.join("release");
        Ok(Self {
            program: release.join("volery"),
            reference_picture: release.join("examples/reference_picture"),
            slice_rate: release.join("examples/slice_rate"),
            folder: folder.to_path_buf(),
        })
    }

    /// Writes the true picture of a scene, or of a plane through its volume, as `.npy` for VTK to be compared with; returns the file.
    pub(super) fn write_reference(
        &self,
        scene: &Path,
        data: &Path,
        plane: Option<&str>,
    ) -> Result<PathBuf, String> {
        let output = self.folder.join("reference.npy");
        shell::run(Command::new(&self.reference_picture).args([scene, data, &output]).args(plane))?;
        Ok(output)
    }

    /// Cuts a grid by parallel planes and adds times and number of polygons to the row.
    pub(super) fn slice(
        &self,
        grid: &Path,
        count: u32,
        normal: [f64; 3],
        repeats: u32,
        row: &mut Row,
    ) -> Result<(), String> {
        let normal = normal.map(|x| x.to_string()).join(",");
        let mut command = Command::new(&self.slice_rate);
        command.arg(grid).args([count.to_string(), normal, repeats.to_string()]);
        let text = shell::read(&mut command)?;
        row.take(&serde_json::from_str(&text).map_err(|error| format!("slice_rate: {error}"))?)
    }

    /// Draws a scene and adds the times to the row; `verify` fills in its error.
    /// Returns the device's name.
    ///
    /// # Errors
    /// When the backend is not there, or the report lacks what is needed.
    pub(super) fn draw(
        &self,
        (scene, data): (&Path, &Path),
        (backend, frames): (&str, u32),
        options: &[&str],
        verify: bool,
        row: &mut Row,
    ) -> Result<String, String> {
        let (picture, report) = (self.folder.join("volery.png"), self.folder.join("volery.json"));
        let mut command = Command::new(&self.program);
        command.args(["render"]).args(options).arg(scene).arg("--data").arg(data).arg("-o").arg(picture);
        // One more than is measured: the first pays for the upload, as VTK's first does.
        command.args(["--backend", backend, "--frames", &(frames + 1).to_string(), "--report"]).arg(&report);
        if verify {
            command.arg("--verify");
        }
        shell::read(&mut command)?;
        let failed = |what: String| format!("{}: {what}", report.display());
        let text = fs::read_to_string(&report).map_err(|error| failed(error.to_string()))?;
        let found: Value = serde_json::from_str(&text).map_err(|error| failed(error.to_string()))?;
        let times = found["frames"].as_array().ok_or_else(|| failed("no frames".to_owned()))?;
        row.seconds.extend(times.iter().skip(1).filter_map(|frame| frame["seconds"].as_f64()));
        if verify {
            let error = |name: &str| found["error"][name].as_f64();
            row.reference = Some(Error {
                rmse: error("measured_rmse").ok_or_else(|| failed("no error.measured_rmse".to_owned()))?,
                max: error("measured_max").ok_or_else(|| failed("no error.measured_max".to_owned()))?,
            });
        }
        Ok(found["backend"]["device"].as_str().unwrap_or("unknown").to_owned())
    }
}
