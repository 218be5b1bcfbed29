//! The commands of the README, as they stand there.

mod common;

use common::{Workshop, head, legacy_grid};

#[test]
fn every_command_of_the_readme_works() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    shop.write_scene("scene.json", "waves.nrrd");
    shop.write("samples.bin", (0..64_000_u32).map(|i| (i % 251) as u8).collect::<Vec<_>>());
    shop.write("wing.vtk", legacy_grid(1.0, usize::MAX));
    shop.write(
        "wing.pvd",
        "<VTKFile type=\"Collection\"><Collection><DataSet file=\"wing.vtk\"/></Collection></VTKFile>",
    );
    let readme = include_str!("../README.md");
    let commands: Vec<_> = readme.lines().filter_map(|line| line.strip_prefix("volery ")).collect();
    assert_eq!(commands.len(), 12);
    for command in commands {
        // The demo has a test of its own.
        if !command.starts_with("demo") {
            shop.done(command);
        }
    }
    for name in [
        "head.png",
        "head.exr",
        "error.png",
        "report.json",
        "scene.png",
        "again.png",
        "samples.png",
        "wing.png",
        "wing-000.png",
        "wing.glb",
        "wing.vsl",
    ] {
        assert!(shop.path(name).is_file(), "{name}");
    }
}
