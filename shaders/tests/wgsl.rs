//! Every shader file is part of the crate, and what is reflected is what the file says.

use std::collections::BTreeMap;
use std::path::Path;

use volery_shaders::{ALL, BindingKind, Stages, cubes, raycast};

/// The build validates what it finds; this finds out that it looked at everything.
#[test]
fn every_wgsl_file_was_validated() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pending = vec![folder.to_owned()];
    let (mut files, mut parts) = (BTreeMap::new(), Vec::new());
    while let Some(folder) = pending.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                pending.push(path);
            } else if path.extension().is_some_and(|extension| extension == "wgsl") {
                let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
                let text = std::fs::read_to_string(&path).unwrap();
                if path.parent().unwrap().ends_with("parts") {
                    parts.push((name, text));
                } else {
                    files.insert(name, text);
                }
            }
        }
    }
    println!("{} shader files: {:?}", files.len(), files.keys());
    assert!(!files.is_empty(), "no .wgsl file under {}", folder.display());
    // Behind a shader's own text stand the parts that it imports; no part is left over.
    for (name, text) in &parts {
        let import = format!("// import {name}\n");
        let users: Vec<_> = files.iter_mut().filter(|(_, file)| file.contains(&import)).collect();
        assert!(!users.is_empty(), "no shader imports the part {name}");
        users.into_iter().for_each(|(_, file)| *file += &format!("\n{text}"));
    }
    let all: BTreeMap<_, _> = ALL.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect();
    assert_eq!(files, all, "files on disk and shaders in the crate");
}

#[test]
fn reflection_says_what_the_file_says() {
    assert_eq!(raycast::TILE * raycast::TILE, raycast::MAIN_WORKGROUP.iter().product::<u32>());
    assert_eq!(raycast::OPAQUE_DEPTH, 12.0);
    assert_eq!(std::mem::offset_of!(raycast::Frame, width), 12);
    assert_eq!(size_of::<raycast::Frame>() % 16, 0);
    let numbers: Vec<_> = raycast::BINDINGS.iter().map(|b| (b.group, b.binding)).collect();
    assert_eq!(numbers, (0..numbers.len() as u32).map(|i| (0, i)).collect::<Vec<_>>());
    let gathered = raycast::BINDINGS.iter().find(|b| b.name == "gathered").unwrap();
    assert_eq!(gathered.kind, BindingKind::Storage { read_only: false });
}

#[test]
fn stages_are_those_that_use_a_resource() {
    let stages_of = |name: &str| cubes::BINDINGS.iter().find(|b| b.name == name).unwrap().stages;
    assert_eq!(stages_of("frame"), Stages { vertex: true, fragment: true, compute: false });
    assert_eq!(stages_of("cubes"), Stages { vertex: true, fragment: false, compute: false });
    assert_eq!([cubes::FAN, cubes::MATTER], ["fan", "matter"]);
    let compute = Stages { vertex: false, fragment: false, compute: true };
    assert!(raycast::BINDINGS.iter().all(|binding| binding.stages == compute));
}
