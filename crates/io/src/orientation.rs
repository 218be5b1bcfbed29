//! Where the samples of a file lie in its world, and what is said of it.
//!
//! # Convention
//! `world_from_index` takes the index of a sample, along the axes as they are read, to the world. The world of
//! anatomical files is RAS: x runs to the patient's right, y to the front (anterior), z to the head (superior).
//! NIfTI is written so. NRRD names its space, and MetaImage is LPS by custom: what runs to the left or to the back
//! is turned by its sign. Of other files (VTK, TIFF, and NRRD without a space) it is the world of the file as it
//! is. Lengths are in the file's unit, millimetres in anatomical files.
//!
//! A picture that is drawn along the axes of the samples needs a note wherever these are not those of the world.

use glam::{DAffine3, DMat3, DVec3};
use volery_scene::placement::nearest_axes;

/// Degrees between axes that nobody sees.
const MIN_DEGREES: f64 = 0.1;

/// What the axes of a file's world mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum World {
    /// Right, anterior, superior.
    Anatomical,
    /// As the file has them; nothing says more.
    Plain,
}

/// Place and orientation of samples in the world of their file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    pub(crate) world_from_index: DAffine3,
    pub(crate) world: World,
}

impl Placement {
    pub(crate) fn plain(axes: DMat3, origin: DVec3) -> Self {
        Self { world_from_index: DAffine3::from_mat3_translation(axes, origin), world: World::Plain }
    }

    /// What is written in an anatomical space, of which each axis in the world is ±1 times the one in the file.
    pub(crate) fn anatomical(axes: DMat3, origin: DVec3, world_from_space: DVec3) -> Self {
        let world_from_space = DAffine3::from_scale(world_from_space);
        let world_from_index = world_from_space * DAffine3::from_mat3_translation(axes, origin);
        Self { world_from_index, world: World::Anatomical }
    }

    /// From left, posterior, superior.
    pub(crate) fn lps(axes: DMat3, origin: DVec3) -> Self {
        Self::anatomical(axes, origin, DVec3::new(-1.0, -1.0, 1.0))
    }

    /// The same directions with another distance of samples.
    pub(crate) fn with_spacing(self, spacing: DVec3) -> Self {
        let axes = self.world_from_index.matrix3;
        let axis = |i: usize| axes.col(i).normalize_or_zero() * spacing[i];
        let matrix3 = DMat3::from_cols(axis(0), axis(1), axis(2));
        Self { world_from_index: DAffine3 { matrix3, ..self.world_from_index }, ..self }
    }
}

/// Three axes out of the first ones of them: those that are missing stand at right angles to the others.
pub(crate) fn completed(axes: &[DVec3]) -> DMat3 {
    let x = axes.first().copied().unwrap_or(DVec3::X);
    let y = axes.get(1).copied().unwrap_or_else(|| {
        let side = if x.normalize_or_zero().y.abs() < 0.9 { DVec3::Y } else { DVec3::Z };
        x.cross(side).cross(x).normalize_or_zero()
    });
    let z = axes.get(2).copied().unwrap_or_else(|| x.cross(y).normalize_or_zero());
    DMat3::from_cols(x, y, z)
}

/// How the axes of samples lie in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Orientation {
    /// For each axis of the samples the axis of the world that it is nearest to, and whether it runs along it.
    axes: [(usize, bool); 3],
    world: World,
    /// The largest angle between an axis and the one of the world that it is nearest to.
    degrees: f64,
    is_sheared: bool,
    is_mirrored: bool,
}

impl Orientation {
    /// That of a map that can be turned back.
    pub fn of(world_from_index: &DAffine3, world: World) -> Self {
        let directions = world_from_index.matrix3.to_cols_array_2d().map(|axis| {
            DVec3::from_array(axis).normalize_or_zero() // Of length 1: the map can be turned back.
        });
        let axes = nearest_axes(world_from_index.matrix3);
        let nearest = axes.map(|(axis, _)| axis);
        let along = |i: usize| directions[i][nearest[i]];
        let degrees = |i: usize| {
            let across = directions[i] - along(i) * DVec3::AXES[nearest[i]];
            across.length().atan2(along(i).abs()).to_degrees()
        };
        let right_angle =
            |i: usize, j: usize| directions[i].dot(directions[j]).abs() < MIN_DEGREES.to_radians();
        Self {
            axes,
            world,
            degrees: (0..3).map(degrees).fold(0.0, f64::max),
            is_sheared: !(right_angle(0, 1) && right_angle(1, 2) && right_angle(0, 2)),
            is_mirrored: directions[0].cross(directions[1]).dot(directions[2]) < 0.0,
        }
    }

    /// Whether the axes of the samples are those of the world.
    pub fn is_identity(&self) -> bool {
        self.axes == [(0, true), (1, true), (2, true)] && self.degrees < MIN_DEGREES && !self.is_sheared
    }

    /// Whether the samples, drawn along their own axes, show a mirror image.
    pub fn is_mirrored(&self) -> bool {
        self.is_mirrored
    }

    /// What a user has to know of a picture that is drawn along the axes of the samples; `None` where these are those
    /// of the world.
    pub fn note(&self) -> Option<String> {
        if self.is_identity() {
            return None;
        }
        let shown = match (self.is_mirrored(), self.world) {
            (true, World::Anatomical) => "mirrored: left and right change sides",
            (true, World::Plain) => "mirrored",
            (false, _) => "turned against the world of the file",
        };
        Some(format!(
            "the axes of the samples run to {self}; the picture is drawn along them, and so {shown}"
        ))
    }
}

/// `LPS` or `+x -y +z`, and what is not at right angles.
impl std::fmt::Display for Orientation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letters = |(axis, along): (usize, bool)| match self.world {
            World::Anatomical => ["LR", "PA", "IS"][axis][usize::from(along)..][..1].to_owned(),
            World::Plain => format!("{}{}", if along { '+' } else { '-' }, ['x', 'y', 'z'][axis]),
        };
        let separator = if self.world == World::Anatomical { "" } else { " " };
        f.write_str(&self.axes.map(letters).join(separator))?;
        if self.degrees >= MIN_DEGREES {
            write!(f, ", oblique by {:.1} degrees", self.degrees)?;
        }
        if self.is_sheared { f.write_str(", sheared") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(columns: [[f64; 3]; 3], world: World) -> Orientation {
        let axes = DMat3::from_cols_array_2d(&columns);
        Orientation::of(&DAffine3::from_mat3(axes), world)
    }

    /// All 48 ways to lay axes along axes: each exchange of two and each one turned back mirrors.
    #[test]
    fn half_of_all_orientations_are_mirrored() {
        let mut mirrored = 0;
        for (pairs, exchanges) in
            [([0, 1, 2], 0), ([0, 2, 1], 1), ([1, 0, 2], 1), ([1, 2, 0], 2), ([2, 0, 1], 2), ([2, 1, 0], 1)]
        {
            for signs in 0..8_u32 {
                let axis = |i: usize| {
                    let sign = if signs >> i & 1 == 1 { -1.0 } else { 1.0 };
                    (DVec3::AXES[pairs[i]] * sign * (i + 1) as f64).to_array()
                };
                let columns = [0, 1, 2].map(axis);
                let orientation = of(columns, World::Plain);
                let expected = (exchanges + signs.count_ones()) % 2 == 1;
                assert_eq!(orientation.is_mirrored(), expected, "{orientation}");
                assert_eq!(orientation.is_identity(), pairs == [0, 1, 2] && signs == 0, "{orientation}");
                assert_eq!(orientation.note().is_none(), orientation.is_identity());
                mirrored += usize::from(orientation.is_mirrored());
            }
        }
        assert_eq!(mirrored, 24);
    }

    #[test]
    fn names_of_orientations() {
        let las = of([[-2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]], World::Anatomical);
        assert_eq!(las.to_string(), "LAS");
        assert!(las.note().unwrap().ends_with("mirrored: left and right change sides"));
        let (sin, cos) = 30_f64.to_radians().sin_cos();
        let turned = of([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]], World::Plain);
        assert_eq!(turned.to_string(), "+x +y +z, oblique by 30.0 degrees");
        let sheared = of([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 2.0]], World::Anatomical);
        assert_eq!(sheared.to_string(), "RAS, oblique by 26.6 degrees, sheared");
    }
}
