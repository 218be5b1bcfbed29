//! The tables and pictures of documents, made by examples of the integration tests.

use std::fs;
use std::path::Path;
use std::process::Command;

use super::table;
use crate::shell;

/// Options of `cargo xtask bench planes`, `fans` and `stacks`.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Put the tables between the markers of the document, and the pictures beside it
    #[arg(long)]
    update_docs: bool,
}

/// Runs an example in release and prints its tables, which are those of `docs/NAME.md`.
///
/// # Errors
/// When data are missing, it does not build, or it fails.
pub(super) fn run(options: &Options, name: &str, example: &str) -> Result<(), String> {
    let data = shell::data_folder()?.ok_or("no folder ../shared/data, and VOLERY_DATA is not set")?;
    let build = ["build", "--release", "--package", "volery-tests", "--example", example];
    shell::run(&mut shell::cargo(&build))?;
    let program = shell::target_folder(&shell::metadata()?)?.join("release/examples").join(example);
    let docs = shell::root().join("docs");
    let pictures = if options.update_docs { docs.clone() } else { super::work_folder()? };
    let tables = shell::read(Command::new(program).args([&data, &pictures]))?;
    print!("{tables}");
    if options.update_docs { update(&docs, name, &tables) } else { Ok(()) }
}

fn update(docs: &Path, name: &str, tables: &str) -> Result<(), String> {
    let document = docs.join(name).with_extension("md");
    let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", document.display());
    let text = fs::read_to_string(&document).map_err(|error| failed(&error))?;
    let pasted = table::pasted(&text, name, tables).map_err(|error| failed(&error))?;
    fs::write(&document, pasted).map_err(|error| failed(&error))
}
