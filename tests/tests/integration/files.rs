//! Real files against what is written about them, and damaged ones.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use volery_io::{ReadOptions, Volume, read_volume};
use volery_tests::data_folder;

/// What a sidecar says: lines of `key: value`.
fn sidecar(file: &Path) -> BTreeMap<String, String> {
    let text = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let pairs = text.lines().filter_map(|line| line.split_once(": "));
    pairs.map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}

/// Files of the data folder whose name has this ending, sorted.
fn with_ending(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|file| file.to_string_lossy().ends_with(ending)).collect();
    files.sort();
    files
}

fn read(file: &Path, options: &ReadOptions) -> Volume {
    read_volume(file, options).unwrap_or_else(|error| panic!("{error}"))
}

fn numbers(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|word| word.parse().unwrap_or_else(|_| panic!("{text}"))).collect()
}

fn min_max_mean(volume: &Volume) -> [f64; 3] {
    let samples = volume.grid.samples();
    let values = (0..samples.len()).map(|index| samples.value(index, 0));
    let (mut low, mut high, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
    for value in values {
        (low, high, sum) = (low.min(value), high.max(value), sum + value);
    }
    [low, high, sum / samples.len() as f64]
}

#[test]
fn raw_files_are_what_their_sidecars_say() {
    let Some(data) = data_folder("raw_files_are_what_their_sidecars_say") else { return };
    let sidecars = with_ending(&data, ".txt");
    assert!(sidecars.len() >= 9, "{} sidecars in {}", sidecars.len(), data.display());
    for described in sidecars {
        let says = sidecar(&described);
        let name = &says["file"];
        let compressed = ["", ".gz", ".zst"]
            .map(|ending| described.with_extension("").to_string_lossy().into_owned() + ending);
        let file = compressed
            .iter()
            .map(PathBuf::from)
            .find(|file| file.is_file())
            .unwrap_or_else(|| panic!("no {name}"));
        let spacing = numbers(&says["spacing"]);
        let spacing = Some(glam::DVec3::new(spacing[0], spacing[1], spacing[2]));
        // Dims, type and byte order are in the name.
        let volume = read(&file, &ReadOptions { spacing, ..ReadOptions::default() });
        let dims = volume.grid.dims().map(|n| n as f64);
        println!("{name}: {dims:?} {}", volume.grid.sample_type().name());
        assert_eq!(dims.to_vec(), numbers(&says["dims (x fastest)"]), "{name}");
        let type_name = says["type"].replace("uint", "u").replace("int", "i").replace("float", "f");
        assert_eq!(volume.grid.sample_type().name(), type_name, "{name}");
        let bytes = volume.grid.num_samples() * volume.grid.sample_type().bytes();
        assert_eq!(bytes.to_string(), says["raw bytes (after decompression)"], "{name}");
        if let Some(expected) = says.get("min max mean") {
            let expected = numbers(expected);
            let found = min_max_mean(&volume);
            assert_eq!(found[..2], expected[..2], "{name}: least and largest");
            let relative = (found[2] / expected[2] - 1.0).abs();
            println!(
                "    mean {}, printed as {}: relative {relative:.1e}, at most 1e-5",
                found[2], expected[2]
            );
            assert!(relative <= 1e-5, "{name}: mean {}, expected {}", found[2], expected[2]);
        }
    }
}

#[test]
fn nifti_files_and_pictures_are_read() {
    let Some(data) = data_folder("nifti_files_and_pictures_are_read") else { return };
    let found = |name: &str| {
        let volume = read(&data.join(name), &ReadOptions::default());
        (volume.grid.dims(), volume.grid.sample_type().name())
    };
    assert_eq!(found("heptane.nii.gz"), ([302, 302, 302], "u8"));
    assert_eq!(found("mandrill_256.png"), ([256, 256, 1], "rgb8"));
    assert_eq!(found("mandrill_512.png"), ([512, 512, 1], "rgb8"));
    let head = read(&data.join("chris_t1.nii.gz"), &ReadOptions::default());
    let [low, high, mean] = min_max_mean(&head);
    println!(
        "chris_t1: {:?} {}, {low} to {high}, mean {mean}",
        head.grid.dims(),
        head.grid.sample_type().name()
    );
    assert!(low < mean && mean < high);
}

#[test]
fn truncated_real_files_are_refused_in_one_line() {
    let Some(data) = data_folder("truncated_real_files_are_refused_in_one_line") else { return };
    let folder = tempfile::tempdir().unwrap();
    let endings = [".raw", ".raw.gz", ".nii.gz", ".png", ".raw.zst"];
    let files: Vec<_> = endings.iter().flat_map(|ending| with_ending(&data, ending)).collect();
    assert!(files.len() >= 12, "{} files", files.len());
    for file in files {
        let bytes = fs::read(&file).unwrap();
        let cut = folder.path().join(file.file_name().unwrap());
        for length in [0, 1, 40, 1000, bytes.len() / 2, bytes.len() - 1] {
            fs::write(&cut, &bytes[..length]).unwrap();
            let Err(error) = read_volume(&cut, &ReadOptions::default()) else {
                panic!("{} was read with {length} of {} bytes", cut.display(), bytes.len());
            };
            let line = error.to_string();
            assert!(
                !line.contains('\n') && line.contains(&*cut.file_name().unwrap().to_string_lossy()),
                "{line}"
            );
        }
    }
}

#[test]
fn files_of_other_kinds_are_refused_in_one_line() {
    let Some(data) = data_folder("files_of_other_kinds_are_refused_in_one_line") else { return };
    let others = [".vtu", ".vtk", ".ex2", ".md", ".txt"].map(|ending| with_ending(&data, ending));
    for file in others.concat() {
        let Err(error) = read_volume(&file, &ReadOptions::default()) else {
            panic!("{} was read", file.display())
        };
        println!("{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
    }
}
