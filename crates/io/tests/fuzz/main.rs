//! A mutational fuzzer over every reader: deterministic, without a nightly compiler.
//!
//! Valid files of each format are damaged at random (bits, truncation, splices, numbers in text, lengths in
//! binary headers) and read. A case passes if the reader returns, in time, without a panic, allocating no
//! more than a small multiple of the limit it was given; an error must be one line. `cargo test` runs each
//! reader for a moment; `VOLERY_FUZZ_SECS=N` runs each for N seconds, `VOLERY_FUZZ_SEED` starts elsewhere.
//! A failing input is written to the system's folder for temporary files and named in the failure.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(unsafe_code, reason = "a global allocator that counts is an unsafe trait")]

#[path = "../readers/make.rs"]
#[allow(dead_code, reason = "the readers' tests use more of it")]
mod make;
#[path = "../readers/make_grid.rs"]
#[allow(dead_code, reason = "the readers' tests use more of it")]
mod make_grid;
#[path = "../readers/make_mesh.rs"]
mod make_mesh;
#[path = "../readers/make_stack.rs"]
mod make_stack;
#[path = "../readers/make_tiff.rs"]
#[allow(dead_code, reason = "the readers' tests use more of it")]
mod make_tiff;
mod memory;
mod mutate;
mod seeds;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use volery_io::grid::{GridOptions, is_grid, read_array_ranges, read_grid};
use volery_io::transfer::TransferOptions;
use volery_io::{Element, ReadOptions, SceneFile};
use volery_io::{read_mesh, read_stack, read_transfer, read_transfer_2d, read_volume};

use memory::peak_during;
use mutate::Random;

/// The limit given to the readers.
const MAX_BYTES: u64 = 1 << 20;

/// What a case may allocate: doubling, the decoders' own state, the file itself.
const MAX_ALLOCATED: usize = 24 << 20;

/// Without a wish each family runs so many cases, the same each time.
const DEFAULT_CASES: u64 = 12_000;

fn read_case(path: &Path) -> Result<(), String> {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    let line = if name.ends_with("scene.json") {
        SceneFile::read(path).err().map(|error| error.to_string())
    } else if name.starts_with("mesh") {
        read_mesh(path, [0.5; 3], MAX_BYTES).err().map(|error| error.to_string())
    } else if name.starts_with("stack") {
        read_stack(path, MAX_BYTES).err().map(|error| error.to_string())
    } else if is_grid(path) {
        read_grid_case(path)
    } else if name.ends_with("2d.json") {
        read_transfer_2d(path).err().map(|error| error.to_string())
    } else if name.ends_with(".json") {
        let options = TransferOptions { map: None, range: Some([0.0, 9.0]), unit_distance: 1.0 };
        read_transfer(path, &options).err().map(|error| error.to_string())
    } else {
        let options = ReadOptions { max_bytes: MAX_BYTES, ..ReadOptions::default() };
        match read_volume(path, &options) {
            Err(error) => Some(error.to_string()),
            Ok(volume) => {
                // Touching every sample shows a view that does not fit.
                let grid = &volume.grid;
                let sum: f64 = (0..grid.num_samples()).map(|i| grid.samples().value(i, 0)).sum();
                std::hint::black_box(sum);
                assert!(grid.num_samples() * grid.sample_type().bytes() <= MAX_BYTES as usize);
                None
            }
        }
    };
    match line {
        Some(line) if line.contains('\n') || line.len() > 1000 => {
            Err(format!("the error is no short line: {line}"))
        }
        _ => Ok(()),
    }
}

/// Reads a grid and all its arrays; of errors, the one with more to say.
fn read_grid_case(path: &Path) -> Option<String> {
    let options = GridOptions { max_bytes: MAX_BYTES, ..GridOptions::default() };
    let ranges = read_array_ranges(path, &options).err().map(|error| error.to_string());
    match read_grid(path, &options) {
        Err(error) => Some(error.to_string()).max(ranges),
        Ok(file) => {
            std::hint::black_box((file.grid.defects(), file.grid.world_bounds()));
            ranges
        }
    }
}

/// Reads one damaged file; says what is wrong with how that went.
fn check(path: &Path) -> Result<(), String> {
    let start = Instant::now();
    let (outcome, peak) = peak_during(|| catch_unwind(AssertUnwindSafe(|| read_case(path))));
    outcome.map_err(|_| "it panicked".to_owned())??;
    if peak > MAX_ALLOCATED {
        return Err(format!("{peak} bytes were allocated, expected at most {MAX_ALLOCATED}"));
    }
    if start.elapsed() > Duration::from_secs(5) {
        return Err(format!("it took {:?}", start.elapsed()));
    }
    Ok(())
}

/// A folder in memory where there is one: a busy disk takes milliseconds for each small file.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()
}

/// Fuzzes one family of files; `name` must be theirs to read.
fn fuzz(name: &str, files: &[Vec<u8>]) {
    let _alone = memory::alone();
    let number = |variable: &str| std::env::var(variable).ok().and_then(|text| text.parse::<u64>().ok());
    let seconds = number("VOLERY_FUZZ_SECS");
    let seed = number("VOLERY_FUZZ_SEED").unwrap_or(1);
    let folder = folder();
    let path = folder.path().join(name);
    let start = Instant::now();
    for file in files {
        std::fs::write(&path, file).unwrap();
        check(&path).unwrap_or_else(|problem| panic!("{name}: an undamaged file: {problem}"));
    }
    let mut cases = 0;
    let mut random = Random::new(seed);
    while seconds.map_or(cases < DEFAULT_CASES, |seconds| start.elapsed().as_secs() < seconds) {
        cases += 1;
        let mut damaged = mutate::damage(files, &mut random);
        if name.ends_with(".png") && cases % 4 > 0 {
            mutate::repair_png(&mut damaged);
        }
        std::fs::write(&path, &damaged).unwrap();
        if let Err(problem) = check(&path) {
            let kept = std::env::temp_dir().join(format!("volery-fuzz-{seed}-{cases}-{name}"));
            std::fs::write(&kept, &damaged).unwrap();
            panic!("{name}, case {cases} of seed {seed}: {problem}; kept as {}", kept.display());
        }
    }
    println!("{name}: {cases} cases in {:?}", start.elapsed());
}

macro_rules! families {
    ($($test:ident: $name:literal, $files:expr;)*) => {$(
        #[test]
        fn $test() {
            fuzz($name, &$files);
        }
    )*};
}

families! {
    raw: "a_3x2x2_uint16be.raw", seeds::raw();
    raw_gzip: "a_3x2x2_uint16be.raw.gz", seeds::raw_gzip();
    raw_zstd: "a_3x2x2_uint16be.raw.zst", seeds::raw_zstd();
    nifti: "a.nii", seeds::nifti();
    nifti_gzip: "a.nii.gz", seeds::nifti_gzip();
    nrrd: "a.nrrd", seeds::nrrd();
    metaimage: "a.mha", seeds::metaimage();
    vti: "a.vti", seeds::vti();
    pvti: "a.pvti", seeds::pvti();
    structured_points: "points.vtk", seeds::structured_points();
    tiff_axes: "axes.tif", seeds::tiff_axes();
    nrrd_axes: "axes.nrrd", seeds::nrrd_axes();
    vtu: "a.vtu", seeds::vtu();
    pvtu: "a.pvtu", seeds::pvtu();
    pvd: "a.pvd", seeds::pvd();
    legacy_vtk: "a.vtk", seeds::legacy_vtk();
    exodus: "a.ex2", seeds::exodus();
    png: "a.png", seeds::png();
    jpeg: "a.jpg", seeds::jpeg();
    tiff: "a.tif", seeds::tiff();
    mesh_obj: "mesh.obj", seeds::mesh_obj();
    mesh_gltf: "mesh.gltf", seeds::mesh_gltf();
    mesh_glb: "mesh.glb", seeds::mesh_glb();
    scene: "scene.json", seeds::scene();
    transfer: "map.json", seeds::transfer();
    transfer_2d: "2d.json", seeds::transfer_2d();
    stack_vsl: "stack.vsl", seeds::stack_vsl();
    stack_glb: "stack.glb", seeds::stack_glb();
}

/// Files of a kilobyte that promise up to 60 GiB: refused without allocating for the promise.
#[test]
fn promises_of_sixty_gigabytes_allocate_nothing() {
    use volery_scene::SampleType;
    let _alone = memory::alone();
    let folder = folder();
    let zeros = make::gzip(&[0; 1000]);
    let header =
        make::Nifti { dim: vec![3, 4000, 4000, 4000], ..make::Nifti::new(SampleType::U8, make::ORDERS[0]) };
    let nrrd = |encoding: &str, data: &[u8]| {
        let text =
            format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: 4000 4000 4000\nencoding: {encoding}\n\n");
        [text.as_bytes(), data].concat()
    };
    let mha =
        make::mha_header(SampleType::U8, make::ORDERS[0], true, "LOCAL").replace("3 2 2", "4000 4000 4000");
    let vti = |data, compressed| {
        let vti = make::Vti { compressed, ..make::Vti::new(SampleType::U8, data) };
        vti.file_of(&[1.0; 12], "0 3999 0 3999 0 3999", "PointData", "")
    };
    let mut files = vec![
        ("a_4000x4000x4000_uint8.raw", vec![0; 1000]),
        ("a_4000x4000x4000_uint8.raw.gz", zeros.clone()),
        ("a_4000x4000x4000_uint8.raw.zst", make::zstd(&[0; 1000])),
        ("a.nii", header.file(&[0; 1000])),
        ("a.nii.gz", make::gzip(&header.file(&[0; 1000]))),
        ("a.nrrd", nrrd("raw", &[0; 1000])),
        ("a.nrrd", nrrd("gzip", &zeros)),
        ("a.mha", [mha.as_bytes(), &make::zlib(&[0; 1000])].concat()),
    ];
    for data in make::VTI_DATA {
        files.extend([("a.vti", vti(data, false)), ("a.vti", vti(data, true))]);
    }
    for (name, file) in files {
        let path = folder.path().join(name);
        std::fs::write(&path, file).unwrap();
        let (result, peak) = peak_during(|| read_volume(&path, &ReadOptions::default()));
        println!("{name}: {peak} bytes allocated at most, {}", result.as_ref().unwrap_err());
        assert!(peak < 2 << 20, "{name}: {peak} bytes");
    }
}

/// Grids of a kilobyte that promise billions of points, cells or nodes.
#[test]
fn promises_of_large_grids_allocate_nothing() {
    use make_grid::{ASCII, Form, Packing, usual_vtu};
    let _alone = memory::alone();
    let folder = folder();
    let counts = ["NumberOfPoints=\"12\"", "NumberOfCells=\"8\""];
    let mut files = Vec::new();
    for data in make::VTI_DATA {
        for packing in [Packing::None, Packing::Zlib, Packing::Lz4] {
            for count in counts {
                let file = usual_vtu(Form { data, packing, ..ASCII });
                let start = file.windows(count.len()).position(|window| window == count.as_bytes()).unwrap();
                let name = count.split('=').next().unwrap();
                let promise = format!("{name}=\"2000000000\"").into_bytes();
                let rest = file[start + count.len()..].to_vec();
                files.push(("a.vtu", [file[..start].to_vec(), promise, rest].concat()));
            }
        }
    }
    let legacy = String::from_utf8(include_bytes!("../readers/vtk/ascii_51.vtk").to_vec()).unwrap();
    for (from, to) in [("POINTS 12", "POINTS 2000000000"), ("CELLS 9 48", "CELLS 2000000000 2000000000")] {
        files.push(("a.vtk", legacy.replace(from, to).into_bytes()));
    }
    let mut exodus = make_grid::exodus();
    exodus.ints("connect1", &[("num_nodes", 12), ("num_info", 2_000_000_000)], Some("HEX8"), &[1; 8]);
    files.push(("a.ex2", exodus.file()));
    for (name, file) in files {
        let path = folder.path().join(name);
        std::fs::write(&path, file).unwrap();
        let (result, peak) = peak_during(|| read_grid(&path, &GridOptions::default()));
        println!("{name}: {peak} bytes allocated at most, {:?}", result.map_err(|error| error.to_string()));
        assert!(peak < 2 << 20, "{name}: {peak} bytes");
    }
}

/// 256 MiB of equal numbers in packed blocks, where twelve are expected.
#[test]
fn bombs_in_packed_blocks_stop() {
    use make_grid::{ASCII, Form, Packing};
    let _alone = memory::alone();
    let folder = folder();
    let bomb = vec![0.0; 1 << 25];
    for packing in [Packing::Zlib, Packing::Lz4] {
        let form = Form { data: make::VtiData::AppendedRaw, packing, wide: true, ..ASCII };
        let file = form.vtu(&make_grid::CELLS, &[("Name=\"p\"", "Float64", bomb.clone())], &[]);
        println!("{packing:?}: {} bytes", file.len());
        let path = folder.path().join("a.vtu");
        std::fs::write(&path, file).unwrap();
        let (result, peak) = peak_during(|| read_grid(&path, &GridOptions::default()));
        let line = result.unwrap_err().to_string();
        assert!(
            line.ends_with("p: the array by its block table holds 268435456 bytes, expected 96"),
            "{line}"
        );
        assert!(peak < 8 << 20, "{peak} bytes");
    }
}

/// A gzip bomb: 1 GiB of zeros in 1 MiB. What comes counts, so it stops at the first byte too many.
#[test]
fn bombs_stop_at_the_expected_size_and_at_the_limit() {
    use std::io::Write;
    let _alone = memory::alone();
    let folder = folder();
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    for _ in 0..1024 {
        encoder.write_all(&[0; 1 << 20]).unwrap();
    }
    let path = folder.path().join("bomb_64x64x64_uint8.raw.gz");
    std::fs::write(&path, encoder.finish().unwrap()).unwrap();
    let (result, peak) = peak_during(|| read_volume(&path, &ReadOptions::default()));
    assert!(result.unwrap_err().to_string().ends_with("the gzip stream holds 262145 bytes, expected 262144"));
    assert!(peak < 2 << 20, "{peak} bytes");
    let element: Element = "uint8".parse().unwrap();
    let options = ReadOptions {
        dims: Some([1024, 1024, 1024]),
        element: Some(element),
        max_bytes: 1 << 24,
        ..Default::default()
    };
    let (result, peak) = peak_during(|| read_volume(&path, &options));
    let line = result.unwrap_err().to_string();
    assert!(line.ends_with("the volume needs 1073741824 bytes, expected at most 16777216"), "{line}");
    assert!(peak < 1 << 20, "{peak} bytes");
}
