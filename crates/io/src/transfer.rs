//! Transfer functions from files: our own JSON, and colour maps that ParaView saved.
//!
//! Ours is `{"points": [{"value": 0, "color": [0, 0, 0], "opacity": 0}, ...], "unit_distance": 1}`, in data
//! units; for functions over value and gradient magnitude see [`read_transfer_2d`]. ParaView's is one preset or an array of them, with `RGBPoints` and maybe `Points`; commas before a
//! closing bracket are forgiven, since ParaView ships such files. `NanColor` is not used: a blank sample
//! holds no matter. Maps of `IndexedColors` have no values to interpolate and are refused.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;
use volery_scene::{TransferFunction, transfer};

use crate::bytes::load_text;
use crate::error::{OneLine, Problem, first_of, quoted};

mod color;
mod color_map;
mod json;

pub use color::ColorSpace;
pub use color_map::{ColorMap, MAX_COLOR_ERROR, MAX_OPACITY_ERROR, OpacityPoint};
pub(crate) use json::{Transfer2dJson, TransferJson};
pub use json::{Transfer2dProblem, read_transfer_2d, write_transfer, write_transfer_2d};

/// Transfer function files larger than this are refused.
const MAX_FILE_BYTES: u64 = 64 << 20;

/// How a colour map becomes a transfer function; without effect on our own JSON, which says it all.
#[derive(Clone, Debug)]
pub struct TransferOptions<'a> {
    /// The map to take from a file of several.
    pub map: Option<&'a str>,
    /// The values to stretch the map over, in place of its own.
    pub range: Option<[f64; 2]>,
    /// The world length that the map's opacities refer to.
    pub unit_distance: f64,
}

/// A transfer function and what its file calls it.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedTransfer {
    /// The map's name, or the file's.
    pub name: String,
    /// The function.
    pub transfer: TransferFunction,
    /// Whether it goes over [`TransferOptions::range`]; our own JSON has values of its own.
    pub is_stretched: bool,
}

/// A file that could not be read as a transfer function.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", OneLine(.path.display()))]
pub struct TransferError {
    /// The file as asked for.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: TransferProblem,
}

/// What is wrong with a transfer function in a file.
#[derive(Debug, thiserror::Error)]
pub enum TransferProblem {
    /// The file itself.
    #[error("{0}")]
    File(Problem),
    /// It is no JSON, or not of the expected fields.
    #[error("{0}")]
    Json(String),
    /// A field that is wrong, or not supported.
    #[error("{field} is {found}, expected {expected}")]
    Map {
        /// Which field of which map.
        field: String,
        /// What it is.
        found: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The file has several maps, or not the one asked for.
    #[error("the colour map asked for is {found}, expected one of {expected}")]
    Choice {
        /// What was asked for.
        found: String,
        /// What there is.
        expected: String,
    },
    /// The function is not meaningful.
    #[error("transfer function: {}", first_of(&.0.defects))]
    Defects(transfer::Error),
    /// Fields over value and gradient magnitude that make no function.
    #[error("{0}")]
    TwoDimensional(Transfer2dProblem),
    /// A function that [`read_transfer_2d`] reads was read as one over values alone.
    #[error("it is a transfer function over value and gradient magnitude, expected one over values alone")]
    HasMagnitudes,
}

/// Reads a transfer function: our JSON or a colour map of ParaView.
///
/// # Errors
/// When the file cannot be read, is neither, holds no map or several without one being named, or makes no
/// valid transfer function.
pub fn read_transfer(path: &Path, options: &TransferOptions) -> Result<NamedTransfer, TransferError> {
    let read = || {
        let text = load_text(path, MAX_FILE_BYTES).map_err(TransferProblem::File)?;
        let value = lenient_json(&text)?;
        if value.get("points").is_some() {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let transfer = TransferJson::deserialize(value).map_err(json_problem)?.validated();
            let transfer = transfer.map_err(TransferProblem::Defects)?;
            return Ok(NamedTransfer { name, transfer, is_stretched: false });
        }
        if value.get("magnitudes").is_some() {
            return Err(TransferProblem::HasMagnitudes);
        }
        let map = choose(color_maps(&value)?, options.map)?;
        let transfer = map.transfer_function(options.range, options.unit_distance);
        let transfer = transfer.map_err(TransferProblem::Defects)?;
        Ok(NamedTransfer { transfer, name: map.name, is_stretched: options.range.is_some() })
    };
    read().map_err(|problem| TransferError { path: path.to_owned(), problem })
}

/// Reads the colour maps of a text that ParaView saved: one preset or an array of them. Those of
/// [`TransferProblem::Map`] kind are errors even where others in the text are good.
///
/// # Errors
/// When the text is no JSON or one of its maps is wrong or not supported.
pub fn parse_color_maps(text: &str) -> Result<Vec<ColorMap>, TransferProblem> {
    color_maps(&lenient_json(text)?)?.into_iter().collect()
}

fn json_problem(error: serde_json::Error) -> TransferProblem {
    TransferProblem::Json(OneLine(error).to_string())
}

/// Parses JSON in which commas may stand before closing brackets.
fn lenient_json(text: &str) -> Result<Value, TransferProblem> {
    serde_json::from_str(&without_trailing_commas(text)).map_err(json_problem)
}

fn without_trailing_commas(text: &str) -> String {
    let mut clean = String::with_capacity(text.len());
    // A comma, with the white space after it, that waits to see what follows.
    let mut waiting = String::new();
    let (mut in_string, mut escaped) = (false, false);
    for c in text.chars() {
        if !in_string && (c == ',' && waiting.is_empty() || c.is_ascii_whitespace() && !waiting.is_empty()) {
            waiting.push(c);
            continue;
        }
        let keep_from = usize::from(!in_string && matches!(c, ']' | '}') && !waiting.is_empty());
        clean.push_str(&waiting[keep_from..]);
        waiting.clear();
        clean.push(c);
        in_string = if in_string { c != '"' || escaped } else { c == '"' };
        escaped = in_string && c == '\\' && !escaped;
    }
    clean + &waiting
}

fn choose(
    maps: Vec<Result<ColorMap, TransferProblem>>,
    wanted: Option<&str>,
) -> Result<ColorMap, TransferProblem> {
    let names = |maps: &[Result<ColorMap, TransferProblem>]| {
        let names: Vec<_> = maps.iter().flatten().map(|map| map.name.as_str()).collect();
        quoted(names.join(", "))
    };
    match wanted {
        None if maps.len() > 1 => {
            Err(TransferProblem::Choice { found: format!("none of {}", maps.len()), expected: names(&maps) })
        }
        None => maps.into_iter().next().unwrap_or_else(|| {
            Err(TransferProblem::Choice {
                found: "any".to_owned(),
                expected: "at least one in the file".to_owned(),
            })
        }),
        Some(wanted) => {
            let expected = names(&maps);
            let hit = maps.into_iter().flatten().find(|map| map.name == wanted);
            hit.ok_or_else(|| TransferProblem::Choice { found: quoted(wanted), expected })
        }
    }
}

type ParsedMaps = Vec<Result<ColorMap, TransferProblem>>;

fn color_maps(value: &Value) -> Result<ParsedMaps, TransferProblem> {
    match value {
        Value::Array(maps) => Ok(maps.iter().enumerate().map(|(i, map)| color_map(map, i)).collect()),
        Value::Object(_) => Ok(vec![color_map(value, 0)]),
        _ => Err(TransferProblem::Json(
            "expected an object with points or RGBPoints, or an array of such".to_owned(),
        )),
    }
}

fn color_map(value: &Value, index: usize) -> Result<ColorMap, TransferProblem> {
    let name = value.get("Name").and_then(Value::as_str).map(str::to_owned);
    let name = name.unwrap_or_else(|| format!("{}", index + 1));
    let problem = |field: &str, found: String, expected| {
        let field = format!("{field} of colour map {}", quoted(&name));
        TransferProblem::Map { field, found, expected }
    };
    if value.get("RGBPoints").is_none() && value.get("IndexedColors").is_some() {
        return Err(problem("IndexedColors", "a list".to_owned(), "RGBPoints, colours over values"));
    }
    let space = match value.get("ColorSpace").map_or(Some("RGB"), Value::as_str) {
        Some("RGB") => ColorSpace::Rgb,
        Some("HSV") if value.get("HSVWrap").is_some_and(is_true) => ColorSpace::HsvWrapped,
        Some("HSV") => ColorSpace::Hsv,
        Some("Lab" | "CIELAB") => ColorSpace::Lab,
        Some("Diverging") => ColorSpace::Diverging,
        Some("Step") => ColorSpace::Step,
        found => {
            let found = found.map_or_else(|| "no text".to_owned(), quoted);
            return Err(problem("ColorSpace", found, "RGB, HSV, Lab, CIELAB, Diverging or Step"));
        }
    };
    let fours = |field: &'static str| {
        let expected = "numbers in groups of four";
        let numbers: Option<Vec<f64>> = match value.get(field) {
            None | Some(Value::Null) => Some(Vec::new()),
            Some(list) => list.as_array().and_then(|list| list.iter().map(Value::as_f64).collect()),
        };
        let numbers = numbers.ok_or_else(|| problem(field, "something else".to_owned(), expected))?;
        let (groups, rest) = numbers.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(problem(field, format!("{} numbers", numbers.len()), expected));
        }
        let mut groups = groups.to_vec();
        groups.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Ok(groups)
    };
    let colors: Vec<_> =
        fours("RGBPoints")?.into_iter().map(|[x, r, g, b]| (x, [r, g, b].map(settled))).collect();
    if colors.is_empty() {
        return Err(problem("RGBPoints", "empty".to_owned(), "at least one point"));
    }
    let opacity = |[value, opacity, midpoint, sharpness]: [f64; 4]| OpacityPoint {
        value,
        opacity: settled(opacity),
        // VTK keeps midpoints off the ends.
        midpoint: midpoint.clamp(1e-5, 1.0 - 1e-5),
        sharpness: sharpness.clamp(0.0, 1.0),
    };
    Ok(ColorMap { opacities: fours("Points")?.into_iter().map(opacity).collect(), name, space, colors })
}

fn is_true(value: &Value) -> bool {
    value.as_bool().unwrap_or(false) || value.as_f64().is_some_and(|number| number != 0.0)
}

/// A channel just outside [0, 1] by rounding in the program that wrote it.
fn settled(channel: f64) -> f64 {
    if (-1e-6..=1.0 + 1e-6).contains(&channel) { channel.clamp(0.0, 1.0) } else { channel }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_commas_before_brackets_go() {
        let text = r#"[1, 2 ,
            , {"a,]": ",}", "b\"": [3,],}, ]"#;
        let expected = r#"[1, 2 ,
            , {"a,]": ",}", "b\"": [3]} ]"#;
        assert_eq!(without_trailing_commas(text), expected);
        assert_eq!(without_trailing_commas("1,"), "1,");
        assert_eq!(without_trailing_commas("[1, é]"), "[1, é]");
    }
}
