//! Every reader against files made by hand: each format, type, byte order and compression; and against
//! truncated, lying and hostile ones.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod axes;
mod foreign;
mod ghosts;
mod grids;
mod images;
mod make;
mod make_grid;
mod make_mesh;
mod make_stack;
mod make_tiff;
mod meshes;
mod nifti;
mod orientation;
mod outputs;
mod raw;
mod regressions;
mod scene;
mod series;
mod stack;
mod text;
mod tiff;
mod transfer;
mod transfer_json;
mod vti;

use std::path::{Path, PathBuf};

use volery_io::{ReadOptions, Volume, read_volume};
use volery_scene::SampleType;

/// A folder of a test's own, deleted at its end.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        // In memory where that can be: a busy disk takes milliseconds for each small file.
        Self(tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        std::fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    /// Writes a file and reads it.
    #[track_caller]
    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Volume {
        let path = self.put(name, bytes);
        read_volume(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Writes a file that must be refused, in one line that starts with its path; returns the rest.
    #[track_caller]
    fn refuse(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        refuse(&self.put(name, bytes), &ReadOptions::default())
    }
}

/// Reads a file that must be refused in one line.
#[track_caller]
fn refuse(path: &Path, options: &ReadOptions) -> String {
    let line = match read_volume(path, options) {
        Ok(volume) => panic!("{} was read: {volume:?}", path.display()),
        Err(error) => error.to_string(),
    };
    assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    let rest = line.strip_prefix(&format!("{}: ", path.display()));
    rest.unwrap_or_else(|| panic!("{line} does not name the file")).to_owned()
}

#[track_caller]
fn assert_volume(volume: &Volume, sample: SampleType, spacing: [f64; 3], expected: &[f64]) {
    assert_eq!(volume.grid.dims(), make::DIMS);
    assert_eq!(volume.grid.sample_type(), sample);
    assert_eq!(volume.grid.spacing().to_array(), spacing);
    assert_values(volume, expected);
}

#[track_caller]
fn assert_values(volume: &Volume, expected: &[f64]) {
    let samples = volume.grid.samples();
    let channels = samples.sample_type().channels();
    let found: Vec<f64> = (0..expected.len()).map(|i| samples.value(i / channels, i % channels)).collect();
    assert_eq!(samples.len() * channels, expected.len());
    assert_eq!(found, expected);
}
