//! Which crate may use which, and what algorithm crates must not reach.

use std::collections::BTreeSet;

use serde_json::Value;

use super::mask;
use super::{File, Finding};

/// A package, its folder, and what it may use of the workspace. Tests may use more.
struct Rule {
    package: &'static str,
    folder: &'static str,
    may_use: &'static [&'static str],
}

const fn rule(package: &'static str, folder: &'static str, may_use: &'static [&'static str]) -> Rule {
    Rule { package, folder, may_use }
}

/// The crate graph: arrows of use only ever point up this list.
const GRAPH: [Rule; 17] = [
    rule("volery-scene", "crates/scene", &[]),
    rule("volery-data", "data", &["volery-scene"]),
    rule("volery-pyramid", "crates/pyramid", &["volery-scene"]),
    rule("volery-octree", "crates/octree", &["volery-scene", "volery-pyramid"]),
    rule("volery-cubefan", "crates/cubefan", &[]),
    rule("volery-schedule", "crates/schedule", &[]),
    rule("volery-slicing", "crates/slicing", &["volery-scene"]),
    rule("volery-frame", "crates/frame", &["volery-scene"]),
    rule("volery-conformance", "crates/conformance", &["volery-scene", "volery-frame"]),
    rule("volery-software", "crates/software", &["volery-scene", "volery-frame", "volery-cubefan"]),
    rule("volery-shaders", "shaders", &[]),
    rule("volery-wgpu", "crates/wgpu", &["volery-scene", "volery-cubefan", "volery-frame", "volery-shaders"]),
    rule("volery-reference", "crates/reference", &["volery-scene"]),
    rule("volery-io", "crates/io", &["volery-scene", "volery-slicing"]),
    rule(
        "volery",
        "crates/volery",
        &[
            "volery-scene",
            "volery-pyramid",
            "volery-octree",
            "volery-cubefan",
            "volery-schedule",
            "volery-slicing",
            "volery-frame",
            "volery-software",
            "volery-wgpu",
            "volery-reference",
            "volery-io",
        ],
    ),
    rule("volery-cli", "crates/cli", &["volery", "volery-data"]),
    rule("xtask", "xtask", &[]),
];

/// The integration tests use everything.
const TESTS: &str = "volery-tests";

/// Crates of methods: plain data in, plain data out.
const ALGORITHMS: [&str; 8] = [
    "volery-scene",
    "volery-pyramid",
    "volery-octree",
    "volery-slicing",
    "volery-cubefan",
    "volery-schedule",
    "volery-frame",
    "volery-reference",
];

/// Packages that algorithm crates must not reach by any way: devices and files.
const DEVICES_AND_FILES: [&str; 8] =
    ["wgpu", "wgpu-core", "wgpu-hal", "naga", "memmap2", "tempfile", "image", "pollster"];

/// What the source of algorithm crates must not name.
const CLOCKS_AND_FILES: [&str; 6] =
    ["std::fs", "std::time", "std::net", "std::process", "std::env", "std::thread::sleep"];

/// Crates with `unsafe` code, and what for.
const UNSAFE: [(&str, &str); 1] = [("crates/io", "mapping of large files into memory")];

pub(super) fn findings(metadata: &Value, files: &[File]) -> Result<Vec<Finding>, String> {
    let mut findings = arrows(metadata)?;
    findings.extend(reach(metadata)?);
    findings.extend(clocks_and_files(files));
    findings.extend(unsafe_code(files));
    findings.extend(lints(metadata, files)?);
    Ok(findings)
}

/// The packages of the workspace: name, folder, and what metadata says of each.
pub(super) fn members(metadata: &Value) -> Result<Vec<(String, String, &Value)>, String> {
    let root = string(&metadata["workspace_root"])?;
    let ids = array(&metadata["workspace_members"])?;
    let packages = array(&metadata["packages"])?.iter().filter(|package| ids.contains(&package["id"]));
    packages
        .map(|package| {
            let manifest = string(&package["manifest_path"])?;
            let folder = manifest.strip_prefix(root).and_then(|path| path.strip_suffix("Cargo.toml"));
            let folder = folder.ok_or_else(|| format!("{manifest}: not under {root}"))?;
            let folder = folder.replace('\\', "/").trim_matches('/').to_owned();
            Ok((string(&package["name"])?.to_owned(), folder, package))
        })
        .collect()
}

fn string(value: &Value) -> Result<&str, String> {
    value.as_str().ok_or_else(|| format!("cargo metadata: {value}, expected a string"))
}

fn array(value: &Value) -> Result<&[Value], String> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| format!("cargo metadata: {value}, expected an array"))
}

/// Every package is in the graph, where it says; every use outside tests is an arrow of it, and no test uses a crate
/// that is built on the one that it tests: neither could be packaged first.
fn arrows(metadata: &Value) -> Result<Vec<Finding>, String> {
    let members = members(metadata)?;
    let names: BTreeSet<&str> = members.iter().map(|(name, _, _)| name.as_str()).collect();
    let mut findings = Vec::new();
    for (name, folder, package) in members.iter().filter(|(name, _, _)| name != TESTS) {
        let manifest = format!("{folder}/Cargo.toml");
        let Some(rule) = GRAPH.iter().find(|rule| rule.package == name && rule.folder == folder) else {
            findings.push(Finding::new(&manifest, 0, format!("{name} is not in the crate graph of tidy")));
            continue;
        };
        for dependency in array(&package["dependencies"])? {
            let used = string(&dependency["name"])?;
            let is_for_tests = dependency["kind"].as_str() == Some("dev");
            if !is_for_tests && names.contains(used) && !rule.may_use.contains(&used) {
                let message =
                    format!("{name} uses {used}, expected only {:?} of the workspace", rule.may_use);
                findings.push(Finding::new(&manifest, 0, message));
            }
            if is_for_tests && reaches(used, name) {
                let message = format!("tests of {name} use {used}, which uses {name}, expected no circle");
                findings.push(Finding::new(&manifest, 0, message));
            }
        }
    }
    Ok(findings)
}

/// Whether a package of the graph uses another, by whatever way.
fn reaches(from: &str, to: &str) -> bool {
    let rule = GRAPH.iter().find(|rule| rule.package == from);
    rule.is_some_and(|rule| rule.may_use.iter().any(|&used| used == to || reaches(used, to)))
}

/// No algorithm crate reaches a device or a file through any of its dependencies, tests aside.
fn reach(metadata: &Value) -> Result<Vec<Finding>, String> {
    let packages = array(&metadata["packages"])?;
    let nodes = array(&metadata["resolve"]["nodes"])?;
    let name_of =
        |id: &Value| packages.iter().find(|package| package["id"] == *id).and_then(|p| p["name"].as_str());
    let mut findings = Vec::new();
    for (name, folder, package) in members(metadata)? {
        if !ALGORITHMS.contains(&name.as_str()) {
            continue;
        }
        let (mut reached, mut open) = (vec![&package["id"]], vec![&package["id"]]);
        while let Some(id) = open.pop() {
            let node = nodes.iter().find(|node| node["id"] == *id);
            let Some(node) = node else { return Err(format!("cargo metadata: {id} is not resolved")) };
            for dependency in array(&node["deps"])? {
                let kinds = array(&dependency["dep_kinds"])?;
                let used = &dependency["pkg"];
                if kinds.iter().any(|kind| kind["kind"].is_null()) && !reached.contains(&used) {
                    reached.push(used);
                    open.push(used);
                }
            }
        }
        let forbidden =
            reached.iter().filter_map(|id| name_of(id)).filter(|used| DEVICES_AND_FILES.contains(used));
        findings.extend(forbidden.map(|used| {
            let message =
                format!("{name} reaches {used}, expected no device and no file in an algorithm crate");
            Finding::new(&format!("{folder}/Cargo.toml"), 0, message)
        }));
    }
    Ok(findings)
}

/// The file's crate folder, if it is source of a crate of the graph.
fn crate_of(file: &File) -> Option<&'static Rule> {
    GRAPH.iter().find(|rule| {
        file.path.strip_prefix(rule.folder).is_some_and(|rest| rest.starts_with("/src/"))
            && file.has_extension(&["rs"])
    })
}

/// The source of algorithm crates names neither clock nor file nor environment.
fn clocks_and_files(files: &[File]) -> Vec<Finding> {
    let sources =
        files.iter().filter(|file| crate_of(file).is_some_and(|rule| ALGORITHMS.contains(&rule.package)));
    sources
        .flat_map(|file| lines_with(file, &CLOCKS_AND_FILES, "expected none in an algorithm crate"))
        .collect()
}

/// `unsafe` only where it is named above.
fn unsafe_code(files: &[File]) -> Vec<Finding> {
    let is_named =
        |file: &File| UNSAFE.iter().any(|(folder, _)| file.path.starts_with(&format!("{folder}/")));
    let sources = files.iter().filter(|file| file.has_extension(&["rs"]) && !is_named(file));
    sources
        .flat_map(|file| lines_with(file, &["unsafe"], "expected only in the crates that tidy names"))
        .collect()
}

/// One finding per line of code that has one of the words.
fn lines_with(file: &File, words: &[&str], expected: &str) -> Vec<Finding> {
    let code = mask::code(&file.text);
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut findings = Vec::new();
    for (index, line) in code.lines().enumerate() {
        for word in words {
            let is_there = line.match_indices(word).any(|(at, _)| {
                !line[..at].ends_with(is_part) && !line[at + word.len()..].starts_with(is_part)
            });
            if is_there {
                findings.push(Finding::new(&file.path, index + 1, format!("{word}: {expected}")));
            }
        }
    }
    findings
}

/// Every crate takes the lints of the workspace; clippy then checks among others that every `allow` has a reason.
fn lints(metadata: &Value, files: &[File]) -> Result<Vec<Finding>, String> {
    let manifests = members(metadata)?.into_iter().map(|(_, folder, _)| format!("{folder}/Cargo.toml"));
    let without = manifests.filter(|manifest| {
        let file = files.iter().find(|file| file.path == *manifest);
        !file.is_some_and(|file| file.text.contains("[lints]\nworkspace = true\n"))
    });
    Ok(without.map(|manifest| Finding::new(&manifest, 0, "no [lints] workspace = true")).collect())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Two crates of the workspace, `first` using `used` as `kind`, and `between` using wgpu.
    fn world(first: &str, folder: &str, used: &str, kind: Option<&str>) -> Value {
        let package = |name: &str, folder: &str| {
            json!({"id": name, "name": name, "dependencies": [],
            "manifest_path": format!("/r/{folder}/Cargo.toml")})
        };
        let mut user = package(first, folder);
        user["dependencies"] = json!([{"name": used, "kind": kind}]);
        let arrow = |to: &str, kind: Option<&str>| json!([{"pkg": to, "dep_kinds": [{"kind": kind}]}]);
        json!({"workspace_root": "/r", "workspace_members": [first, "volery-io"],
            "packages": [user, package("volery-io", "crates/io"), package("between", "b"), package("wgpu", "w")],
            "resolve": {"nodes": [{"id": first, "deps": arrow(used, kind)}, {"id": "volery-io", "deps": []},
                {"id": "between", "deps": arrow("wgpu", None)}, {"id": "wgpu", "deps": []}]}})
    }

    #[test]
    fn a_use_that_is_no_arrow_is_found() {
        let found = |world: &Value| arrows(world).unwrap().len();
        assert_eq!(found(&world("volery-octree", "crates/octree", "volery-io", None)), 1);
        assert_eq!(found(&world("volery-octree", "crates/octree", "volery-io", Some("build"))), 1);
        assert_eq!(found(&world("volery-octree", "crates/octree", "volery-io", Some("dev"))), 0);
        assert_eq!(found(&world("volery-slicing", "crates/slicing", "volery-io", Some("dev"))), 1);
        assert_eq!(found(&world("volery", "crates/volery", "volery-io", None)), 0);
        assert_eq!(found(&world("volery-new", "crates/new", "between", None)), 1);
        assert_eq!(found(&world("volery-octree", "crates/tree", "between", None)), 1);
    }

    #[test]
    fn arrows_point_up_the_list() {
        for (place, rule) in GRAPH.iter().enumerate() {
            let is_above = |used: &&str| GRAPH[..place].iter().any(|other| other.package == *used);
            assert!(rule.may_use.iter().all(is_above), "{}", rule.package);
        }
    }

    #[test]
    fn a_device_behind_a_dependency_is_found() {
        let found = |world: &Value| reach(world).unwrap().len();
        assert_eq!(found(&world("volery-octree", "crates/octree", "between", None)), 1);
        assert_eq!(found(&world("volery-octree", "crates/octree", "between", Some("dev"))), 0);
        assert_eq!(found(&world("volery-cli", "crates/cli", "between", None)), 0);
    }

    #[test]
    fn clocks_files_and_unsafe_code_are_found() {
        let bad = "use std::time::Instant; // std::fs\nlet a = \"std::fs\";\nlet b = std::fs::read(p);\nunsafe { c() }\n";
        let lines = |findings: Vec<Finding>| findings.iter().map(|finding| finding.line).collect::<Vec<_>>();
        assert_eq!(lines(clocks_and_files(&[File::sample("crates/octree/src/a.rs", bad)])), [1, 3]);
        assert!(lines(clocks_and_files(&[File::sample("crates/io/src/a.rs", bad)])).is_empty());
        assert_eq!(lines(unsafe_code(&[File::sample("crates/octree/src/a.rs", bad)])), [4]);
        assert!(lines(unsafe_code(&[File::sample("crates/io/src/a.rs", bad)])).is_empty());
    }

    #[test]
    fn a_crate_without_the_lints_of_the_workspace_is_found() {
        let world = world("volery", "crates/volery", "volery-io", None);
        let good = File::sample("crates/volery/Cargo.toml", "[lints]\nworkspace = true\n");
        let bad = File::sample("crates/io/Cargo.toml", "[lints]\n");
        let findings = lints(&world, &[good, bad]).unwrap();
        assert_eq!(findings, [Finding::new("crates/io/Cargo.toml", 0, "no [lints] workspace = true")]);
    }
}
