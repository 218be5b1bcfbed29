//! `cargo xtask bench`: criterion benches of all crates, Volery beside VTK, and the tables of documents.

mod documents;
mod grids;
mod peers;
mod reslice;
mod table;
mod volery;
mod vtk;

use std::path::PathBuf;

use clap::Subcommand;

use crate::shell;

/// Options of `cargo xtask bench`.
#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct Options {
    #[command(subcommand)]
    which: Option<Which>,
    /// Only the benches whose name has this in it
    filter: Option<String>,
}

#[derive(Subcommand)]
enum Which {
    /// VTK and Volery in turn on the same scenes: time against error.
    Peers(peers::Options),
    /// Multiresolution planes: bytes and time against error, and the pictures of docs/planes.md.
    Planes(documents::Options),
    /// Cubes as fans: time against error beside rays, and the picture of docs/fans.md.
    Fans(documents::Options),
    /// Stacks of slices through grids: time and bytes against error, and the picture of docs/stacks.md.
    Stacks(documents::Options),
}

/// Runs the benches asked for.
///
/// # Errors
/// When one cannot be run.
pub(crate) fn run(options: &Options) -> Result<(), String> {
    match &options.which {
        Some(Which::Peers(options)) => peers::run(options),
        Some(Which::Planes(options)) => documents::run(options, "planes", "plane_tables"),
        Some(Which::Fans(options)) => documents::run(options, "fans", "fans_tables"),
        Some(Which::Stacks(options)) => documents::run(options, "stacks", "stack_tables"),
        None => criterion(options.filter.as_deref()),
    }
}

/// The bench targets by name: without names cargo would run all unit tests as benches, too.
fn criterion(filter: Option<&str>) -> Result<(), String> {
    let metadata = shell::metadata()?;
    let members = metadata["workspace_members"].as_array().ok_or("cargo metadata: no workspace_members")?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata: no packages")?;
    let targets = packages
        .iter()
        .filter(|package| members.contains(&package["id"]))
        .flat_map(|package| package["targets"].as_array().into_iter().flatten());
    let benches: Vec<&str> = targets
        .filter(|target| target["kind"][0] == "bench")
        .filter_map(|target| target["name"].as_str())
        .collect();
    if benches.is_empty() {
        return Err("there is no bench in the workspace".to_owned());
    }
    let mut command = shell::cargo(&["bench", "--workspace"]);
    for bench in benches {
        command.args(["--bench", bench]);
    }
    shell::run(command.arg("--").args(filter))
}

/// Where this subcommand keeps what it makes.
fn work_folder() -> Result<PathBuf, String> {
    let folder = shell::target_folder(&shell::metadata()?)?.join("peers");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    Ok(folder)
}
