//! The tables and pictures of docs/planes.md.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::table;
use crate::shell;

/// Options of `cargo xtask bench planes`.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Put the tables between the markers of docs/planes.md, and the pictures beside it
    #[arg(long)]
    update_docs: bool,
}

/// Runs the example `plane_tables` in release and prints its tables.
///
/// # Errors
/// When data are missing, it does not build, or it fails.
pub(super) fn run(options: &Options) -> Result<(), String> {
    let data = shell::data_folder()?.ok_or("no folder ../shared/data, and VOLERY_DATA is not set")?;
    let build = ["build", "--release", "--package", "volery-tests", "--example", "plane_tables"];
    shell::run(&mut shell::cargo(&build))?;
    let program = shell::target_folder(&shell::metadata()?)?.join("release/examples/plane_tables");
    let docs = shell::root().join("docs");
    let pictures = if options.update_docs { docs.clone() } else { super::work_folder()? };
    let tables = shell::read(Command::new(program).args([&data, &pictures]))?;
    print!("{tables}");
    if options.update_docs { update(&docs.join("planes.md"), &tables) } else { Ok(()) }
}

fn update(document: &Path, tables: &str) -> Result<(), String> {
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", document.display());
    let text = fs::read_to_string(document).map_err(|error| failed(&error))?;
    let pasted = table::pasted(&text, "planes", tables).map_err(|error| failed(&error))?;
    fs::write(document, pasted).map_err(|error| failed(&error))
}
