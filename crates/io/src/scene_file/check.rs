//! Values of fields that have the right type and make no sense, found while a scene is parsed.

use std::fmt::Debug;

use serde::de::Error;
use serde::{Deserialize, Deserializer};

use super::{SceneFocus, SceneInterest, SceneMesh, ScenePlane};
use crate::layout::Element;

/// The largest width or height of a picture.
pub const MAX_SIDE: u32 = 1 << 16;

/// The most pixels of a picture.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Most planes over the extent of a grid.
const MAX_SLICES: u32 = 1 << 24;

/// A size that no picture can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("size is {} x {}, expected 1 to {MAX_SIDE} each and at most {MAX_PIXELS} pixels", .found[0], .found[1])]
pub struct SizeError {
    /// Width and height as given.
    pub found: [u32; 2],
}

/// Checks the size of a picture, from a scene or elsewhere.
///
/// # Errors
/// When a side is 0 or above [`MAX_SIDE`], or there are more than [`MAX_PIXELS`].
pub fn check_size(size: [u32; 2]) -> Result<(), SizeError> {
    let [width, height] = size.map(u64::from);
    let sides = size.iter().all(|side| (1..=MAX_SIDE).contains(side));
    if sides && width * height <= MAX_PIXELS { Ok(()) } else { Err(SizeError { found: size }) }
}

type Checked<T, E> = Result<Option<T>, E>;

/// Reads a field that may be missing and fits, or says what it is and what it should be.
fn checked<'de, D, T>(
    deserializer: D,
    field: &str,
    fits: impl Fn(&T) -> bool,
    expected: &str,
) -> Checked<T, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + Debug,
{
    match Option::<T>::deserialize(deserializer)? {
        Some(found) if !fits(&found) => {
            Err(D::Error::custom(format!("{field} is {found:?}, expected {expected}")))
        }
        value => Ok(value),
    }
}

fn is_color(color: &[f64; 3]) -> bool {
    color.iter().all(|channel| (0.0..=1.0).contains(channel))
}

pub(super) fn size<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[u32; 2], D::Error> {
    let size = Option::<[u32; 2]>::deserialize(deserializer)?;
    size.map_or(Ok(()), check_size).map_err(D::Error::custom)?;
    Ok(size)
}

pub(super) fn background<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[f64; 3], D::Error> {
    checked(deserializer, "background", is_color, "three numbers in [0, 1]")
}

pub(super) fn range<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[f64; 2], D::Error> {
    let fits = |[low, high]: &[f64; 2]| low < high && (high - low).is_finite();
    checked(deserializer, "range", fits, "two finite values, the lower first")
}

fn fraction<'de, D: Deserializer<'de>>(deserializer: D, field: &str) -> Checked<f64, D::Error> {
    checked(deserializer, field, |value: &f64| (0.0..=1.0).contains(value), "a number in [0, 1]")
}

pub(super) fn tolerance<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<f64, D::Error> {
    fraction(deserializer, "tolerance")
}

pub(super) fn budget<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<f64, D::Error> {
    let fits = |milliseconds: &f64| *milliseconds >= 0.0 && milliseconds.is_finite();
    checked(deserializer, "budget_ms", fits, "a number of at least 0")
}

pub(super) fn gaze<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[f64; 2], D::Error> {
    let fits = |gaze: &[f64; 2]| gaze.iter().all(|share| (0.0..=1.0).contains(share));
    checked(deserializer, "gaze", fits, "two numbers in [0, 1]")
}

pub(super) fn error<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<f64, D::Error> {
    fraction(deserializer, "error")
}

pub(super) fn adaptive<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<f64, D::Error> {
    fraction(deserializer, "adaptive")
}

pub(super) fn slices<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<u32, D::Error> {
    let expected = format!("1 to {MAX_SLICES}");
    checked(deserializer, "slices", |count| (1..=MAX_SLICES).contains(count), &expected)
}

pub(super) fn dims<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[usize; 3], D::Error> {
    checked(deserializer, "input.dims", |dims: &[usize; 3]| !dims.contains(&0), "three counts of at least 1")
}

pub(super) fn dtype<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<Element, D::Error> {
    let name = Option::<String>::deserialize(deserializer)?;
    let element = name.map(|name| name.parse()).transpose();
    element.map_err(|error: crate::ParseElementError| D::Error::custom(format!("input.{error}")))
}

pub(super) fn spacing<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<[f64; 3], D::Error> {
    let fits = |spacing: &[f64; 3]| spacing.iter().all(|length| *length > 0.0 && length.is_finite());
    checked(deserializer, "input.spacing", fits, "three positive finite numbers")
}

pub(super) fn focus<'de, D: Deserializer<'de>>(deserializer: D) -> Checked<SceneFocus, D::Error> {
    match Option::<SceneFocus>::deserialize(deserializer)? {
        Some(SceneFocus { quality, .. }) if quality < 0.0 => {
            Err(D::Error::custom(format!("focus.quality is {quality:?}, expected at least 0")))
        }
        focus => Ok(focus),
    }
}

/// Checks a region of interest, from a scene or elsewhere.
///
/// # Errors
/// Says what is wrong with it, and what was expected.
pub fn check_interest(interest: &SceneInterest) -> Result<(), String> {
    let SceneInterest { corners, sphere, weight } = *interest;
    let is_region = match (corners, sphere) {
        (Some([low, high]), None) => (0..3).all(|axis| low[axis] <= high[axis]),
        (None, Some(sphere)) => sphere.radius > 0.0,
        _ => return Err("box and sphere, expected one of the two".to_owned()),
    };
    let of_sphere = sphere.iter().flat_map(|sphere| sphere.center.iter().chain([&sphere.radius]));
    if !is_region || !corners.iter().flatten().flatten().chain(of_sphere).all(|x| x.is_finite()) {
        let expected =
            "expected finite numbers, a box with low at most high, or a sphere with a radius above 0";
        return Err(format!("{interest:?}, {expected}"));
    }
    if weight >= 0.0 && weight.is_finite() {
        Ok(())
    } else {
        Err(format!("weight is {weight:?}, expected a number of at least 0"))
    }
}

pub(super) fn interest<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<SceneInterest>, D::Error> {
    let regions = Vec::<SceneInterest>::deserialize(deserializer)?;
    for (index, region) in regions.iter().enumerate() {
        check_interest(region)
            .map_err(|problem| D::Error::custom(format!("interest[{index}]: {problem}")))?;
    }
    Ok(regions)
}

pub(super) fn planes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<ScenePlane>, D::Error> {
    let planes = Vec::<ScenePlane>::deserialize(deserializer)?;
    for (index, &ScenePlane { normal, distance }) in planes.iter().enumerate() {
        let plane = volery_scene::Plane { normal: normal.into(), distance };
        if let Some(defect) = plane.defects().first() {
            return Err(D::Error::custom(format!("planes[{index}]: {defect}")));
        }
    }
    Ok(planes)
}

pub(super) fn meshes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<SceneMesh>, D::Error> {
    let meshes = Vec::<SceneMesh>::deserialize(deserializer)?;
    match meshes.iter().position(|mesh| !is_color(&mesh.color)) {
        None => Ok(meshes),
        Some(index) => {
            let found = meshes[index].color;
            let problem = format!("meshes[{index}].color is {found:?}, expected three numbers in [0, 1]");
            Err(D::Error::custom(problem))
        }
    }
}
