//! Where the workspace is, and how other programs are run.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The root of the workspace.
pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().expect("xtask is a folder of the workspace").to_path_buf()
}

/// The folder of real data: `VOLERY_DATA`, or `../shared/data` from the root; `None` where that is missing.
///
/// # Errors
/// When `VOLERY_DATA` names a folder that does not exist: somebody meant it.
pub(crate) fn data_folder() -> Result<Option<PathBuf>, String> {
    if let Some(named) = env::var_os("VOLERY_DATA") {
        let named = PathBuf::from(named);
        return if named.is_dir() {
            Ok(Some(named))
        } else {
            Err(format!("VOLERY_DATA is {}, expected a folder", named.display()))
        };
    }
    Ok(Some(root().join("../shared/data")).filter(|folder| folder.is_dir()))
}

/// A command of the cargo that runs this program, in the root of the workspace.
pub(crate) fn cargo(arguments: &[&str]) -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(arguments).current_dir(root());
    command
}

/// Runs to the end; its output goes where ours goes.
pub(crate) fn run(command: &mut Command) -> Result<(), String> {
    let status = command.status().map_err(|error| format!("{}: {error}", line_of(command)))?;
    if status.success() { Ok(()) } else { Err(format!("{}: {status}", line_of(command))) }
}

/// Runs to the end and returns what it wrote to its output; its errors go where ours go.
pub(crate) fn read(command: &mut Command) -> Result<String, String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| format!("{}: {error}", line_of(command)))?;
    if !output.status.success() {
        return Err(format!("{}: {}", line_of(command), output.status));
    }
    String::from_utf8(output.stdout).map_err(|_| format!("{}: output is not UTF-8", line_of(command)))
}

/// What `cargo metadata` says of the workspace, with the dependencies that this machine's builds have.
pub(crate) fn metadata() -> Result<serde_json::Value, String> {
    let about = read(Command::new("rustc").args(["--version", "--verbose"]))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or("rustc --version --verbose names no host")?;
    let arguments = ["metadata", "--format-version", "1", "--filter-platform", host];
    let text = read(&mut cargo(&arguments))?;
    serde_json::from_str(&text).map_err(|error| format!("cargo metadata: {error}"))
}

/// The folder that holds what cargo builds.
pub(crate) fn target_folder(metadata: &serde_json::Value) -> Result<PathBuf, String> {
    metadata["target_directory"]
        .as_str()
        .map(PathBuf::from)
        .ok_or("cargo metadata: no target_directory".into())
}

/// The command as a person would type it.
fn line_of(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or(command.get_program());
    let words = std::iter::once(program).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}
