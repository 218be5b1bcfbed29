//! The commands of the README, as they stand there.

mod common;

use common::{Workshop, head};

#[test]
fn every_command_of_the_readme_works() {
    let shop = Workshop::new();
    shop.write_volume("head.nrrd", &head());
    shop.write_scene("scene.json", "waves.nrrd");
    let readme = include_str!("../README.md");
    let commands: Vec<_> = readme.lines().filter_map(|line| line.strip_prefix("volery ")).collect();
    assert_eq!(commands.len(), 5);
    for command in commands {
        // The demo has a test of its own.
        if !command.starts_with("demo") {
            shop.done(command);
        }
    }
    for name in ["head.png", "head.exr", "error.png", "report.json", "scene.png"] {
        assert!(shop.path(name).is_file(), "{name}");
    }
}
