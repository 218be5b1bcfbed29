//! Places of the world: from where to look, what is up, which planes.

use clap::ValueEnum;
use volery::Plane;
use volery::fit::{Direction, Side};
use volery::glam::DVec3;
use volery::io::scene_file::SceneOrientation;
use volery::io::{World, one_of};

use super::numbers;

/// Where samples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Orientation {
    /// Where their file says
    File,
    /// At index times spacing
    Index,
}

impl From<Orientation> for SceneOrientation {
    fn from(orientation: Orientation) -> Self {
        match orientation {
            Orientation::File => Self::File,
            Orientation::Index => Self::Index,
        }
    }
}

/// From where to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum ViewFrom {
    Angles(Direction),
    Side { side: Side, zoom: f64 },
}

impl ViewFrom {
    /// For data of a world, in a picture with that direction up.
    pub(crate) fn direction(self, world: World, up: DVec3) -> Result<Direction, String> {
        match self {
            Self::Angles(direction) => Ok(direction),
            Self::Side { side, zoom } => match side.to_eye(world) {
                Some(to_eye) => Ok(Direction { zoom, ..Direction::toward_eye(to_eye, up) }),
                None => Err(needs_patient(&format!("--view {}", side.name()))),
            },
        }
    }
}

/// A plane, by its equation or as radiologists name it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PlaneName {
    Equation(Plane),
    Anatomical { name: &'static str, normal: DVec3, position: Option<f64> },
}

/// Names of planes, with normals that point to where radiologists look from.
const ANATOMICAL: [(&str, DVec3); 3] =
    [("axial", DVec3::NEG_Z), ("coronal", DVec3::Y), ("sagittal", DVec3::NEG_X)];

impl PlaneName {
    /// For data of a world with that middle.
    pub(crate) fn plane(self, world: World, middle: DVec3) -> Result<Plane, String> {
        match self {
            Self::Equation(plane) => Ok(plane),
            Self::Anatomical { name, .. } if world == World::Plain => {
                Err(needs_patient(&format!("--plane {name}")))
            }
            Self::Anatomical { normal, position, .. } => {
                let along = normal.abs();
                let position = position.unwrap_or(along.dot(middle));
                Ok(Plane { normal, distance: position * normal.dot(along) })
            }
        }
    }
}

fn needs_patient(option: &str) -> String {
    format!("has no anatomical axes that it is drawn by, expected some for {option}")
}

pub(super) fn parse_from(text: &str) -> Result<ViewFrom, String> {
    let expected = || {
        let names = Side::ALL.map(Side::name);
        format!(
            "expected AZIMUTH,ELEVATION or AZIMUTH,ELEVATION,ZOOM: degrees, and a zoom above 0; or {}",
            one_of(text.split(',').next().unwrap_or(text).trim(), &names)
        )
    };
    let checked = |zoom: f64| {
        let good = (1e-3..=1e3).contains(&zoom).then_some(zoom);
        good.ok_or_else(|| "expected finite degrees, and a zoom from 0.001 to 1000".to_owned())
    };
    let (name, zoom) = text.split_once(',').map_or((text, None), |(name, zoom)| (name, Some(zoom)));
    if let Some(side) = Side::ALL.into_iter().find(|side| side.name() == name.trim()) {
        let zoom = zoom.map_or(Ok(1.0), |zoom| zoom.trim().parse().map_err(|_| expected()))?;
        return Ok(ViewFrom::Side { side, zoom: checked(zoom)? });
    }
    let (azimuth_deg, elevation_deg, zoom) = match numbers(text).as_deref() {
        Some(&[azimuth, elevation]) => (azimuth, elevation, 1.0),
        Some(&[azimuth, elevation, zoom]) => (azimuth, elevation, zoom),
        _ => return Err(expected()),
    };
    let is_finite = azimuth_deg.is_finite() && elevation_deg.is_finite();
    let zoom = checked(if is_finite { zoom } else { f64::NAN })?;
    Ok(ViewFrom::Angles(Direction { azimuth_deg, elevation_deg, zoom }))
}

pub(super) fn parse_up(text: &str) -> Result<DVec3, String> {
    let up = numbers(text).and_then(|numbers| <[f64; 3]>::try_from(numbers).ok()).map(DVec3::from_array);
    let up = up.filter(|up| (1e-100..1e100).contains(&up.length()));
    up.ok_or_else(|| "expected X,Y,Z: a direction of length above 0".to_owned())
}

pub(super) fn parse_plane(text: &str) -> Result<PlaneName, String> {
    let (name, position) = text.split_once(':').map_or((text, None), |(name, at)| (name, Some(at)));
    if let Some((name, normal)) = ANATOMICAL.into_iter().find(|(known, _)| *known == name.trim()) {
        let position = position.map(|at| at.trim().parse().ok().filter(|at: &f64| at.is_finite()));
        if position == Some(None) {
            return Err(format!("expected {name} or {name}:POSITION, a finite number of millimetres"));
        }
        return Ok(PlaneName::Anatomical { name, normal, position: position.flatten() });
    }
    let Some(&[x, y, z, distance]) = numbers(text).as_deref() else {
        return Err(
            "expected NX,NY,NZ,D: a normal of length above 0, and a number; or axial, coronal or sagittal"
                .to_owned(),
        );
    };
    let plane = Plane { normal: DVec3::new(x, y, z), distance };
    match plane.defects().first() {
        None => Ok(PlaneName::Equation(plane)),
        Some(defect) => Err(defect.to_string()),
    }
}
