//! Every crate is introduced: by a README of its own and by a line of ARCHITECTURE.md, which lists no other.

use serde_json::Value;

use super::crates;
use super::{File, Finding};

const ARCHITECTURE: &str = "ARCHITECTURE.md";

pub(super) fn findings(metadata: &Value, files: &[File]) -> Result<Vec<Finding>, String> {
    let members = crates::members(metadata)?;
    let mut findings = Vec::new();
    for (name, folder, package) in &members {
        let readme = format!("{folder}/README.md");
        // `publish = false` is an empty list of registries.
        let is_published = package["publish"].is_null();
        if is_published && !files.iter().any(|file| file.path == readme) {
            findings.push(Finding::new(&readme, 0, format!("{name} has no README.md")));
        }
    }
    let Some(architecture) = files.iter().find(|file| file.path == ARCHITECTURE) else {
        findings.push(Finding::new(ARCHITECTURE, 0, "missing"));
        return Ok(findings);
    };
    let listed = entries(&architecture.text);
    let unlisted = members.iter().filter(|(_, folder, _)| !listed.iter().any(|(_, entry)| entry == folder));
    findings.extend(
        unlisted.map(|(_, folder, _)| Finding::new(ARCHITECTURE, 0, format!("no entry \"### `{folder}`\""))),
    );
    let unknown = listed.iter().filter(|(_, entry)| !members.iter().any(|(_, folder, _)| folder == entry));
    findings.extend(unknown.map(|(line, entry)| {
        Finding::new(ARCHITECTURE, *line, format!("{entry} is no crate of the workspace"))
    }));
    Ok(findings)
}

/// The crates that the code map lists, by folder: headings "### `folder`", and their lines.
fn entries(text: &str) -> Vec<(usize, String)> {
    let headings = text.lines().enumerate().filter_map(|(index, line)| {
        let folder = line.strip_prefix("### `")?.split('`').next()?;
        Some((index + 1, folder.to_owned()))
    });
    headings.collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn missing_and_invented_entries_are_found() {
        let package = |name: &str, folder: &str, publish: Value| {
            json!({"id": name, "name": name, "publish": publish,
            "manifest_path": format!("/r/{folder}/Cargo.toml")})
        };
        let metadata = json!({"workspace_root": "/r", "workspace_members": ["a", "b", "c"],
            "packages": [package("a", "crates/a", Value::Null), package("b", "crates/b", Value::Null),
                package("c", "c", json!([]))]});
        let files = [
            File::sample("crates/a/README.md", "a"),
            File::sample(ARCHITECTURE, "# Map\n### `crates/a`\n### `c`\n### `crates/old`\n"),
        ];
        let found: Vec<String> =
            findings(&metadata, &files).unwrap().iter().map(Finding::to_string).collect();
        assert_eq!(
            found,
            [
                "crates/b/README.md: b has no README.md",
                "ARCHITECTURE.md: no entry \"### `crates/b`\"",
                "ARCHITECTURE.md:4: crates/old is no crate of the workspace",
            ]
        );
    }
}
