//! Checks of files one by one: sizes, unfinished marks, what ties the tree to one machine.

use super::mask;
use super::{File, Finding};

const MAX_FILE_LINES: usize = 600;
const MAX_FUNCTION_LINES: usize = 80;
const MAX_FILE_BYTES: u64 = 512 << 10;

pub(super) fn findings(files: &[File]) -> Vec<Finding> {
    let checks = [file_size, file_length, function_length, unfinished, machine_paths, registries];
    files.iter().flat_map(|file| checks.iter().flat_map(move |check| check(file))).collect()
}

/// Large files make every clone slow for ever.
fn file_size(file: &File) -> Vec<Finding> {
    if file.bytes <= MAX_FILE_BYTES {
        return Vec::new();
    }
    let message = format!("{} KiB, expected at most {} KiB", file.bytes >> 10, MAX_FILE_BYTES >> 10);
    vec![Finding::new(&file.path, 0, message)]
}

fn file_length(file: &File) -> Vec<Finding> {
    let lines = file.text.lines().count();
    if lines <= MAX_FILE_LINES || !file.has_extension(&["rs", "wgsl", "py"]) {
        return Vec::new();
    }
    vec![Finding::new(
        &file.path,
        0,
        format!("{lines} lines, expected at most {MAX_FILE_LINES}: split by meaning"),
    )]
}

/// Functions of Rust and WGSL from the line with `fn` to the line of the closing brace.
fn function_length(file: &File) -> Vec<Finding> {
    if !file.has_extension(&["rs", "wgsl"]) {
        return Vec::new();
    }
    let code = mask::code(&file.text);
    let mut findings = Vec::new();
    for (start, _) in code.match_indices("fn ") {
        let is_word = !code[..start].ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let name: String =
            code[start + 3..].chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        if !is_word || name.is_empty() {
            continue;
        }
        let lines = function_lines(&code[start..]);
        if lines > MAX_FUNCTION_LINES {
            let message = format!("fn {name} has {lines} lines, expected at most {MAX_FUNCTION_LINES}");
            findings.push(Finding::new(&file.path, line_of(&code, start), message));
        }
    }
    findings
}

/// Lines from the start of `code`, a function, to its end: the closing brace, or `;` where it has no body.
fn function_lines(code: &str) -> usize {
    let mut depth = 0_usize;
    let mut brackets = 0_usize;
    for (at, c) in code.char_indices() {
        match c {
            '[' | '(' => brackets += 1,
            ']' | ')' => brackets = brackets.saturating_sub(1),
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        let is_end = (c == '}' && depth == 0) || (c == ';' && depth == 0 && brackets == 0);
        if is_end {
            return code[..=at].lines().count();
        }
    }
    code.lines().count()
}

/// Work that was put off: it belongs into an issue.
fn unfinished(file: &File) -> Vec<Finding> {
    if !file.has_extension(&["rs", "wgsl", "py", "md", "toml"]) {
        return Vec::new();
    }
    // Split, so that this file does not find itself.
    let marks = [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("XX", "X"), concat!("HA", "CK")];
    let macros = [concat!("to", "do!"), concat!("unimple", "mented!")];
    let text =
        if file.has_extension(&["rs"]) { mask::code_and_comments(&file.text) } else { file.text.clone() };
    let words = marks.iter().chain(&macros);
    words
        .flat_map(|word| {
            occurrences(&text, word).map(move |line| {
                Finding::new(&file.path, line, format!("{word}: finish it, or open an issue"))
            })
        })
        .collect()
}

/// Paths that exist on one machine only.
fn machine_paths(file: &File) -> Vec<Finding> {
    // Split, so that this file does not find itself.
    let roots = [
        concat!("/wo", "rk/"),
        concat!("/ro", "ot/"),
        concat!("/ho", "me/"),
        concat!("/Us", "ers/"),
        concat!("/t", "mp/"),
        concat!("C:", "\\"),
    ];
    let finds = roots.iter().flat_map(|root| {
        file.text.lines().enumerate().filter_map(move |(index, line)| {
            let at = line.find(root)?;
            // What follows a word, a dot or a slash is part of a relative path or of an address.
            let before = line[..at].chars().next_back();
            let is_absolute =
                !before.is_some_and(|c| c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '/' | '}'));
            is_absolute.then(|| {
                Finding::new(
                    &file.path,
                    index + 1,
                    format!("{root}..: a path of one machine; expected a relative one"),
                )
            })
        })
    });
    finds.collect()
}

/// Package registries are the business of a machine's own configuration.
fn registries(file: &File) -> Vec<Finding> {
    // Split, so that this file does not find itself.
    let hosts = [
        concat!("index.cra", "tes.io"),
        concat!("static.cra", "tes.io"),
        concat!("py", "pi.org"),
        concat!("pythonhos", "ted.org"),
        concat!("registry.np", "mjs.org"),
        concat!("proxy.gol", "ang.org"),
        concat!("--index", "-url"),
        concat!("replace", "-with"),
    ];
    let mut findings: Vec<Finding> = hosts
        .iter()
        .flat_map(|host| {
            occurrences(&file.text, host).map(move |line| {
                Finding::new(&file.path, line, format!("{host}: a registry; expected none in the tree"))
            })
        })
        .collect();
    if file.path == "Cargo.lock" {
        let usual = "source = \"registry+https://github.com/rust-lang/crates.io-index\"";
        let sources = file.text.lines().enumerate().filter(|(_, line)| line.starts_with("source = "));
        findings.extend(sources.filter(|(_, line)| *line != usual).map(|(index, line)| {
            Finding::new(&file.path, index + 1, format!("{line}: expected the index of crates.io"))
        }));
    }
    findings
}

/// The lines, from 1, on which `word` stands by itself.
fn occurrences<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word).filter_map(move |(at, _)| {
        let is_alone = !text[..at].ends_with(is_part) && !text[at + word.len()..].starts_with(is_part);
        is_alone.then(|| line_of(text, at))
    })
}

fn line_of(text: &str, at: usize) -> usize {
    1 + text[..at].matches('\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(check: fn(&File) -> Vec<Finding>, path: &str, text: &str) -> Vec<usize> {
        check(&File::sample(path, text)).iter().map(|finding| finding.line).collect()
    }

    #[test]
    fn long_files_are_found() {
        assert_eq!(lines(file_length, "a.rs", &"\n".repeat(601)), [0]);
        assert!(lines(file_length, "a.rs", &"\n".repeat(600)).is_empty());
        assert!(lines(file_length, "a.json", &"\n".repeat(601)).is_empty());
    }

    #[test]
    fn large_files_are_found() {
        let file = |bytes| File { path: "a.png".to_owned(), bytes, text: String::new() };
        assert_eq!(file_size(&file((512 << 10) + 1)).len(), 1);
        assert_eq!(file_size(&file(512 << 10)).len(), 0);
    }

    #[test]
    fn long_functions_are_found_in_rust_and_wgsl() {
        let body = |lines: usize| "    x();\n".repeat(lines);
        let long = format!(
            "struct S;\n\npub fn long(a: [u8; 3]) {{\n{}}}\nfn short() {{\n{}}}\n",
            body(79),
            body(78)
        );
        assert_eq!(lines(function_length, "a.rs", &long), [3]);
        assert_eq!(lines(function_length, "a.wgsl", &long), [3]);
        assert!(lines(function_length, "a.py", &long).is_empty());
        let none = format!("trait T {{ fn a(b: [u8; 3]); }}\n// fn long() {{\n{}", body(90));
        assert!(lines(function_length, "a.rs", &none).is_empty());
    }

    #[test]
    fn unfinished_work_is_found_in_code_and_comments_but_not_in_literals() {
        let (mark, call) = (concat!("TO", "DO"), concat!("to", "do!"));
        let text = format!("fn a() {{ {call}() }}\n// {mark}: b\nlet c = \"{mark}\";\nlet {mark}S = 1;\n");
        assert_eq!(lines(unfinished, "a.rs", &text), [2, 1]);
        assert_eq!(lines(unfinished, "a.md", mark), [1]);
    }

    #[test]
    fn paths_of_a_machine_are_found() {
        let home = concat!("/ho", "me/");
        let text = format!("see {home}x\nin ../shared{home}x\nhttps://host.org{home}\n\"{home}y\"\n");
        assert_eq!(lines(machine_paths, "a.md", &text), [1, 4]);
    }

    #[test]
    fn registries_are_found() {
        let text = format!("a\n[source]\n{} = 1\n", concat!("replace", "-with"));
        assert_eq!(lines(registries, "config.toml", &text), [3]);
        let lock = "source = \"registry+https://github.com/rust-lang/crates.io-index\"\nsource = \"git+https://b\"\n";
        assert_eq!(lines(registries, "Cargo.lock", lock), [2]);
    }
}
