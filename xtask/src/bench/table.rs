//! Time against error, as a table for people and as JSON for programs.

use std::fmt::Write;

use serde_json::{Value, json};

/// Distance of a picture from another, of channels in [0, 1].
#[derive(Clone, Copy, Debug)]
pub(super) struct Error {
    pub(super) rmse: f64,
    pub(super) max: f64,
}

impl Error {
    /// `{"rmse": .., "max": ..}`.
    pub(super) fn read(value: &Value) -> Option<Self> {
        Some(Self { rmse: value["rmse"].as_f64()?, max: value["max"].as_f64()? })
    }
}

/// One program with one setting on one scene.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) program: String,
    pub(super) setting: String,
    /// Of each frame of each round.
    pub(super) seconds: Vec<f64>,
    /// Polygons that were made, where that is the work.
    pub(super) polygons: Option<u64>,
    /// Against the f64 reference.
    pub(super) reference: Option<Error>,
    /// Against the program's own converged picture, where it has one.
    pub(super) own_converged: Option<Error>,
}

impl Row {
    pub(super) fn new(scene: &str, program: &str, setting: &str) -> Self {
        let [scene, program, setting] = [scene, program, setting].map(str::to_owned);
        Self {
            scene,
            program,
            setting,
            seconds: Vec::new(),
            polygons: None,
            reference: None,
            own_converged: None,
        }
    }

    /// Adds what VTK answers, or an example of ours.
    pub(super) fn take(&mut self, reply: &Value) -> Result<(), String> {
        let seconds = reply["seconds"].as_array().ok_or_else(|| format!("no seconds in {reply}"))?;
        self.seconds.extend(seconds.iter().filter_map(Value::as_f64));
        self.polygons = reply["polygons"].as_u64();
        self.reference = Error::read(&reply["errors"]["reference"]);
        self.own_converged = Error::read(&reply["errors"]["vtk_converged"]);
        Ok(())
    }

    /// Median and shortest time in milliseconds.
    fn milliseconds(&self) -> Option<(f64, f64)> {
        let mut sorted = self.seconds.clone();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = (sorted.get(sorted.len().checked_sub(1)? / 2)?, sorted.get(sorted.len() / 2)?);
        Some(((low + high) / 2.0 * 1e3, sorted[0] * 1e3))
    }
}

/// The row that others of a scene of rays are compared with.
const YARDSTICK: (&str, &str) = ("VTK GPU ray cast", "step 0.5");

/// The same for planes.
pub(super) const RESLICE: (&str, &str) = ("vtkImageReslice", "linear");

/// The same for grids.
pub(super) const BUNYK: (&str, &str) = ("VTK Bunyk ray cast", "as tetrahedra");

/// The same for slices.
pub(super) const CUTTER: (&str, &str) = ("vtkCutter", "256 planes");

/// Times of a row over those of the yardstick on the same scene.
fn ratio(rows: &[Row], row: &Row) -> Option<f64> {
    let is_yardstick = |other: &&Row| {
        let program = (other.program.as_str(), other.setting.as_str());
        other.scene == row.scene && [YARDSTICK, RESLICE, BUNYK, CUTTER].contains(&program)
    };
    Some(row.milliseconds()?.0 / rows.iter().find(is_yardstick)?.milliseconds()?.0)
}

/// A table in Markdown; `about` are lines that say where and how it was measured.
pub(super) fn markdown(rows: &[Row], about: &[String]) -> String {
    let mut text = String::from(
        "| scene | program | setting | ms, median (min) | of yardstick | rmse | max | rmse to VTK's own |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    let number =
        |value: Option<f64>, decimals: usize| value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    for row in rows {
        let times =
            row.milliseconds().map_or("-".to_owned(), |(median, min)| format!("{median:.1} ({min:.1})"));
        let setting = match row.polygons {
            None => row.setting.clone(),
            Some(polygons) => format!("{}, {polygons} polygons", row.setting),
        };
        let line = [
            row.scene.clone(),
            row.program.clone(),
            setting,
            times,
            number(ratio(rows, row), 3),
            number(row.reference.map(|error| error.rmse), 5),
            number(row.reference.map(|error| error.max), 4),
            number(row.own_converged.map(|error| error.rmse), 5),
        ];
        writeln!(text, "| {} |", line.join(" | ")).expect("a string takes all");
    }
    for line in about {
        write!(text, "\n{line}").expect("a string takes all");
    }
    text.push('\n');
    text
}

/// The same with every frame's time.
pub(super) fn json(rows: &[Row], about: &[String]) -> Value {
    let error = |error: Option<Error>| error.map(|error| json!({"rmse": error.rmse, "max": error.max}));
    let row = |row: &Row| {
        json!({"scene": row.scene, "program": row.program, "setting": row.setting, "seconds": row.seconds,
            "median_ms": row.milliseconds().map(|(median, _)| median), "ratio_to_vtk_gpu_half": ratio(rows, row),
            "polygons": row.polygons, "error_to_reference": error(row.reference), "error_to_own_converged": error(row.own_converged)})
    };
    json!({"about": about, "rows": rows.iter().map(row).collect::<Vec<_>>()})
}

/// `text` with what stands between the markers `NAME:begin` and `NAME:end` replaced.
///
/// # Errors
/// When the markers are missing.
pub(super) fn pasted(text: &str, name: &str, table: &str) -> Result<String, String> {
    let [begin, end] = ["begin", "end"].map(|side| format!("<!-- {name}:{side} -->"));
    let markers = text.split_once(&begin).and_then(|(before, rest)| Some((before, rest.split_once(&end)?.1)));
    let (before, after) = markers.ok_or_else(|| format!("no {begin} with an {end} after it"))?;
    Ok(format!("{before}{begin}\n{table}{end}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> [Row; 2] {
        let yardstick =
            Row { seconds: vec![0.4, 0.1, 0.3, 0.2], ..Row::new("engine", YARDSTICK.0, YARDSTICK.1) };
        let ours = Row {
            seconds: vec![0.05],
            reference: Some(Error { rmse: 0.001, max: 0.01 }),
            ..Row::new("engine", "Volery software", "full")
        };
        [yardstick, ours]
    }

    #[test]
    fn rows_have_median_least_and_ratio() {
        let text = markdown(&rows(), &["On a machine.".to_owned()]);
        assert!(
            text.contains("| engine | VTK GPU ray cast | step 0.5 | 250.0 (100.0) | 1.000 | - | - | - |\n"),
            "{text}"
        );
        assert!(
            text.contains("| full | 50.0 (50.0) | 0.200 | 0.00100 | 0.0100 | - |\n\nOn a machine.\n"),
            "{text}"
        );
        assert_eq!(json(&rows(), &[])["rows"][1]["ratio_to_vtk_gpu_half"], 0.2);
    }

    #[test]
    fn a_document_takes_the_table_between_its_markers_only() {
        let (begin, end) = ("<!-- peers:begin -->", "<!-- peers:end -->");
        let readme = format!("a\n{begin}\nold\n{end}\nb\n");
        let expected = format!("a\n{begin}\nnew\n{end}\nb\n");
        assert_eq!(pasted(&readme, "peers", "new\n").unwrap(), expected);
        assert!(pasted(end, "peers", "new").is_err() && pasted(&readme, "planes", "new").is_err());
        assert!(pasted(&format!("{end}{begin}"), "peers", "new").is_err());
    }
}
