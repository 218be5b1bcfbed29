//! Runs the program in a folder of its own.
#![allow(dead_code, reason = "each test program uses a part")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use volery::VoxelGrid;
use volery::glam::DVec3;
use volery::io::World;

/// What the program did.
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// A folder with a generated volume, deleted at the end.
pub(crate) struct Workshop(tempfile::TempDir);

impl Workshop {
    pub(crate) fn new() -> Self {
        let workshop = Self(tempfile::tempdir().expect("a temporary folder"));
        workshop.write_volume("waves.nrrd", &volery_data::marschner_lobb_u8(40));
        workshop
    }

    pub(crate) fn path(&self, name: impl AsRef<OsStr>) -> PathBuf {
        self.0.path().join(Path::new(name.as_ref()))
    }

    pub(crate) fn write_volume(&self, name: impl AsRef<OsStr>, grid: &VoxelGrid) {
        volery::io::write_nrrd(&self.path(name), grid, World::Plain).expect("a volume is written");
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("a file is written");
    }

    /// A scene of a volume: 48x32 pixels of the whole.
    pub(crate) fn write_scene(&self, name: &str, file: &str) {
        let scene = scene_json(file);
        self.write(name, scene.to_string());
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_slice(&self.bytes(name)).expect("valid JSON")
    }

    /// Everything in the folder, hidden files too.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).expect("the folder");
        let mut names: Vec<_> = entries
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Runs `volery` with these arguments, in the folder.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, arguments: &[S]) -> Outcome {
        let output = Command::new(env!("CARGO_BIN_EXE_volery"))
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .expect("the program starts");
        Outcome {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// As [`Workshop::run`], with the arguments in one line.
    pub(crate) fn run_line(&self, line: &str) -> Outcome {
        self.run(&line.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs what must succeed.
    pub(crate) fn done(&self, line: &str) -> Outcome {
        let outcome = self.run_line(line);
        assert_eq!(outcome.code, Some(0), "volery {line}: {}", outcome.stderr);
        assert_eq!(outcome.stderr, "", "volery {line}");
        outcome
    }
}

impl Outcome {
    /// Asserts an exit status and one line of complaint that has these words in it.
    #[track_caller]
    pub(crate) fn fails(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, Some(code), "{}", self.stderr);
        assert!(self.stderr.ends_with('\n') && self.stderr.lines().count() == 1, "{:?}", self.stderr);
        assert!(self.stderr.starts_with("error: "), "{:?}", self.stderr);
        for word in words {
            assert!(self.stderr.contains(word), "no {word:?} in {:?}", self.stderr);
        }
    }
}

pub(crate) fn scene_json(file: &str) -> serde_json::Value {
    serde_json::json!({
        "input": {"kind": "volume", "file": file},
        "size": [48, 32],
        "background": [0.1, 0.2, 0.3],
        "camera": {"projection": "perspective", "eye": [90.0, -70.0, 60.0], "target": [19.5, 19.5, 19.5],
                   "up": [0, 0, 1], "fov_y_deg": 25.0},
        "transfer_function": {
            "points": [{"value": 100, "color": [0.2, 0.4, 0.9], "opacity": 0.0},
                       {"value": 255, "color": [1.0, 0.8, 0.3], "opacity": 0.3}],
            "unit_distance": 1.0}
    })
}

/// A small volume with spacing.
pub(crate) fn head() -> VoxelGrid {
    volery_data::head([72, 90, 90], DVec3::splat(2.5))
}

/// A volume of 32-bit floats in words, so that axes may be of any kind.
pub(crate) fn text_nrrd(sizes: &str, kinds: &str, value: impl Fn(usize) -> f64) -> String {
    let count: usize = sizes.split(' ').map(|size| size.parse::<usize>().expect("a size")).product();
    let dimension = sizes.split(' ').count();
    let values: Vec<String> = (0..count).map(|i| value(i).to_string()).collect();
    format!(
        "NRRD0004\ntype: float\ndimension: {dimension}\nsizes: {sizes}\nkinds: {kinds}\nencoding: text\n\n{}\n",
        values.join(" ")
    )
}

/// Numbers of which no two that stand near each other are the same.
pub(crate) fn vector(i: usize) -> f64 {
    (i * i % 101) as f64 + 0.25 * i as f64
}

/// The generated grid with a vector at each node beside its values: three times its place, along each axis.
pub(crate) fn legacy_vectors() -> String {
    let points = volery_data::cylinder(2).points().to_vec();
    let lines = points.iter().map(|p| format!("{} {} {}", 3.0 * p.x, 3.0 * p.y, 3.0 * p.z));
    format!("{}VECTORS flow double\n{}\n", legacy_grid(1.0, usize::MAX), lines.collect::<Vec<_>>().join("\n"))
}

/// A collection of these files, a time step each.
pub(crate) fn collection(files: &[&str]) -> String {
    let step = |(time, file): (usize, &&str)| format!("<DataSet timestep=\"{time}\" file=\"{file}\"/>");
    let steps: String = files.iter().enumerate().map(step).collect();
    format!("<?xml version=\"1.0\"?><VTKFile type=\"Collection\"><Collection>{steps}</Collection></VTKFile>")
}

/// A file of the generated grid in VTK's legacy format: its values times a factor, some of its cells.
pub(crate) fn legacy_grid(factor: f64, num_cells: usize) -> String {
    let grid = volery_data::cylinder(2);
    let list = |numbers: Vec<String>| numbers.join(" ");
    let points = list(grid.points().iter().flat_map(|p| p.to_array()).map(|x| x.to_string()).collect());
    let cells: Vec<_> = grid.cells().iter().take(num_cells).collect();
    let nodes: usize = cells.iter().map(|(_, nodes)| nodes.len() + 1).sum();
    let lists = list(
        cells
            .iter()
            .map(|(_, nodes)| format!("{} {}", nodes.len(), list(nodes.iter().map(u32::to_string).collect())))
            .collect(),
    );
    let number = |name: &str| match name {
        "tetrahedron" => "10",
        "hexahedron" => "12",
        "wedge" => "13",
        _ => "14",
    };
    let types = list(cells.iter().map(|(cell_type, _)| number(cell_type.name()).to_owned()).collect());
    let values = &grid.arrays()[0].values;
    let values = list((0..values.len()).map(|node| (factor * values.value(node, 0)).to_string()).collect());
    format!(
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {n} double\n{points}\n\
         CELLS {cells} {size}\n{lists}\nCELL_TYPES {cells}\n{types}\nPOINT_DATA {n}\nSCALARS heat double\n\
         LOOKUP_TABLE default\n{values}\n",
        n = grid.points().len(),
        cells = cells.len(),
        size = nodes,
    )
}
