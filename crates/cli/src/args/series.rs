//! Names of several files: a place for a number in one name.

use std::path::{Path, PathBuf};

use super::RenderArgs;

/// A path with a number in place of its `%d` or `%03d`; `None` where it has not exactly one.
pub(crate) fn numbered(path: &Path, number: usize) -> Option<PathBuf> {
    let (before, after) = path.to_str()?.split_once('%')?;
    let (digits, after) = after.split_once('d')?;
    let is_width = digits.is_empty() || digits.len() == 2 && digits.starts_with('0');
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    let is_good = is_width && !after.contains('%');
    is_good.then(|| PathBuf::from(format!("{before}{number:0width$}{after}")))
}

/// Whether a name looks as if it had a place for a number, a wrong one too.
fn has_place(path: &Path) -> bool {
    let name = path.to_string_lossy();
    let mut parts = name.split('%');
    parts.next();
    parts.any(|part| part.trim_start_matches(|c: char| c.is_ascii_digit()).starts_with('d'))
}

/// Why the names of outputs do not fit what is written: one file or several.
pub(super) fn conflict(args: &RenderArgs) -> Option<String> {
    let has_steps = !args.stack.time_steps.is_empty();
    if has_steps && args.save_scene.is_some() {
        return Some("--save-scene is for one picture, --time-steps makes several".to_owned());
    }
    if args.path.is_some() && (has_steps || args.frames < 2) {
        let found = if has_steps { "--time-steps is given" } else { "--frames is 1" };
        return Some(format!("--path goes through --frames, of which there must be several, but {found}"));
    }
    if args.progressive.is_some() && (args.path.is_some() || args.budget_ms.is_some()) {
        let other = if args.path.is_some() { "--path" } else { "--budget-ms" };
        return Some(format!("--progressive shows one view until it is full, expected it without {other}"));
    }
    let is_series = args.frames > 1 && has_place(&args.output);
    let output = ("-o", Some(&args.output), has_steps || is_series);
    let others = [
        ("--error-map", args.error_map.as_ref(), has_steps),
        ("--bound-map", args.bound_map.as_ref(), has_steps),
        ("--report", args.report.as_ref(), has_steps),
        ("--save-scene", args.save_scene.as_ref(), false),
    ];
    let problem = |(option, path, is_several): (&str, Option<&PathBuf>, bool)| {
        let path = path?;
        let shown = path.display();
        if is_several && numbered(path, 0).is_none() {
            let of = if has_steps { "time step" } else { "frame" };
            return Some(format!(
                "{option} {shown}: expected a name with %d or %03d for the number of the {of}"
            ));
        }
        let way = if option == "-o" { ", or --frames or --time-steps for several files" } else { "" };
        let is_literal = !is_several && has_place(path);
        is_literal
            .then(|| format!("{option} {shown}: has a place for a number, expected a name for one file{way}"))
    };
    [output].into_iter().chain(others).find_map(problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_their_place() {
        let of = |path: &str| numbered(Path::new(path), 7).map(|path| path.to_string_lossy().into_owned());
        assert_eq!(of("a/b-%03d.png").as_deref(), Some("a/b-007.png"));
        assert_eq!(of("%d.exr").as_deref(), Some("7.exr"));
        for wrong in ["a.png", "%.png", "%3d.png", "%0xd.png", "%03d-%03d.png", "%s%d.png", "%099d.png"] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_place_for_a_number_is_seen_where_it_is_wrong_too() {
        for name in ["%d.png", "a-%03d.png", "%3d.png", "%d-%d.png"] {
            assert!(has_place(Path::new(name)), "{name}");
        }
        for name in ["a.png", "100%.png", "50%-done.png", "%s.png"] {
            assert!(!has_place(Path::new(name)), "{name}");
        }
    }
}
