//! Validates every WGSL file with naga and writes what the Rust side must agree with: `emit` says what.
//!
//! A file that does not parse or validate fails the build; all such files are reported, not only the first. A line
//! `// import NAME` adds the file `parts/NAME.wgsl` behind the shader: order means nothing in WGSL, and lines keep their
//! numbers.

mod emit;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{env, fs};

use naga::valid::{Capabilities, ValidationFlags, Validator};

/// A shader file that validated.
struct Shader {
    /// File name without its extension; the name of the Rust module.
    name: String,
    /// Its text with all parts.
    path: PathBuf,
    module: naga::Module,
    info: naga::valid::ModuleInfo,
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(report) => {
            eprintln!("{report}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR").map_err(|e| e.to_string())?).join("src/wgsl");
    println!("cargo::rerun-if-changed=build");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut report = String::new();
    let mut rust = String::new();
    let paths = wgsl_files(&folder)?;
    for path in &paths {
        let text = load(path).and_then(|shader| emit::module(&shader));
        match text {
            Ok(text) => rust += &text,
            Err(error) => report += &format!("{error}\n"),
        }
    }
    if paths.is_empty() {
        let _ = writeln!(report, "{}: no .wgsl file, expected at least 1", folder.display());
    }
    if !report.is_empty() {
        return Err(report);
    }
    let names = paths.iter().map(|path| name_of(path)).collect::<Result<Vec<_>, _>>()?;
    rust += &emit::list(&names);
    let out = Path::new(&env::var("OUT_DIR").map_err(|e| e.to_string())?).join("shaders.rs");
    fs::write(&out, rust).map_err(|e| format!("{}: {e}", out.display()))
}

/// All shader files, in order of name.
fn wgsl_files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut paths = Vec::new();
    for entry in entries {
        let path = entry.map_err(|e| format!("{}: {e}", folder.display()))?.path();
        if path.extension().is_some_and(|extension| extension == "wgsl") {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

fn name_of(path: &Path) -> Result<String, String> {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    stem.map(str::to_owned).ok_or_else(|| format!("{}: expected a name in ASCII", path.display()))
}

fn load(path: &Path) -> Result<Shader, String> {
    let shown = path.display().to_string();
    let source = with_parts(path)?;
    let module =
        naga::front::wgsl::parse_str(&source).map_err(|e| e.emit_to_string_with_path(&source, &shown))?;
    // Without capabilities: what every device has.
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .map_err(|e| e.emit_to_string_with_path(&source, &shown))?;
    let name = name_of(path)?;
    let path = Path::new(&env::var("OUT_DIR").map_err(|e| e.to_string())?).join(format!("{name}.wgsl"));
    fs::write(&path, source).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(Shader { name, path, module, info })
}

/// The text of a shader and of the parts that it imports.
fn with_parts(path: &Path) -> Result<String, String> {
    let read = |path: &Path| fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));
    let mut source = read(path)?;
    let names: Vec<_> =
        source.lines().filter_map(|line| line.strip_prefix("// import ")).map(str::to_owned).collect();
    for name in names {
        source.push('\n');
        source += &read(&path.with_file_name("parts").join(format!("{name}.wgsl")))?;
    }
    Ok(source)
}
