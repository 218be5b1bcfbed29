//! Where the box of a grid lies in the world: turned, perhaps mirrored, and moved.
//!
//! A grid's own *space* has sample `(i, j, k)` at `(i, j, k) * spacing`. A [`Placement`] takes it to the world and back
//! without changing a length, so extinction, step lengths and errors mean the same in both. Where the axes of the samples
//! are left-handed, space is a mirror image of the world, and so is the [`Camera`] in it: the picture is the same.

use glam::{DAffine3, DMat3, DVec3};

use crate::{Camera, Plane, TriangleMesh};

/// The largest sine between two axes and a right angle that is taken for rounding: 0.1 degrees. The placement is the
/// rotation nearest to such axes.
const MAX_SHEAR: f64 = 1.75e-3;

/// Axes that differ from those of the world by less than this, in radians, are those of the world: files hold
/// directions in 32 bits, and a plane along samples shall be along them. Half a micrometre in half a metre.
const SNAP: f64 = 1e-6;

/// Steps to the nearest rotation: each squares what is missing, at most [`MAX_SHEAR`].
const NUM_STEPS: usize = 4;

/// From a grid's space to the world: lengths stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Of orthogonal columns of length 1; of determinant -1 where it mirrors.
    world_from_grid: DMat3,
    /// Of the first sample.
    origin: DVec3,
}

/// Axes of samples that are not at right angles.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("axes {} and {} of the samples meet at {degrees:.2} degrees, expected a right angle", ["x", "y", "z"][.axes[0]], ["x", "y", "z"][.axes[1]])]
pub struct Sheared {
    /// The two that are farthest from it.
    pub axes: [usize; 2],
    /// The angle between them.
    pub degrees: f64,
}

impl Default for Placement {
    /// Where space is the world.
    fn default() -> Self {
        Self { world_from_grid: DMat3::IDENTITY, origin: DVec3::ZERO }
    }
}

impl Placement {
    /// That of the samples of a map that can be turned back, whatever their distances.
    ///
    /// # Errors
    /// When their axes are not at right angles.
    pub fn of(world_from_index: &DAffine3) -> Result<Self, Sheared> {
        let matrix = world_from_index.matrix3;
        let axes = [0, 1, 2].map(|axis| matrix.col(axis).normalize_or_zero());
        let cosine = |[a, b]: [usize; 2]| axes[a].dot(axes[b]);
        let pairs = [[0, 1], [0, 2], [1, 2]];
        let worst = pairs.into_iter().max_by(|a, b| cosine(*a).abs().total_cmp(&cosine(*b).abs()));
        if let Some(axes) = worst.filter(|&pair| cosine(pair).abs() > MAX_SHEAR) {
            return Err(Sheared { axes, degrees: cosine(axes).clamp(-1.0, 1.0).acos().to_degrees() });
        }
        let mut rotation = DMat3::from_cols(axes[0], axes[1], axes[2]);
        for _ in 0..NUM_STEPS {
            // Newton's iteration for the polar decomposition: no axis is better than another.
            rotation = (rotation + rotation.inverse().transpose()) * 0.5;
        }
        let snapped = snapped(rotation);
        let is_near = (rotation - snapped).to_cols_array().iter().all(|difference| difference.abs() < SNAP);
        let world_from_grid = if is_near { snapped } else { rotation };
        Ok(Self { world_from_grid, origin: world_from_index.translation })
    }

    /// Whether space is the world.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Whether space is a mirror image of the world.
    pub fn is_mirrored(&self) -> bool {
        self.world_from_grid.determinant() < 0.0
    }

    /// For each axis of space the axis of the world that it is nearest to, and whether it runs along it.
    pub fn nearest_axes(&self) -> [(usize, bool); 3] {
        nearest_axes(self.world_from_grid)
    }

    /// The place of a point of space in the world.
    pub fn to_world(&self, point: DVec3) -> DVec3 {
        self.world_from_grid * point + self.origin
    }

    /// A direction of space in the world.
    pub fn direction_to_world(&self, direction: DVec3) -> DVec3 {
        self.world_from_grid * direction
    }

    /// The place of a point of the world in space.
    pub fn to_grid(&self, point: DVec3) -> DVec3 {
        self.direction_to_grid(point - self.origin)
    }

    /// A direction of the world in space.
    pub fn direction_to_grid(&self, direction: DVec3) -> DVec3 {
        self.world_from_grid.transpose() * direction
    }

    /// The camera that takes, of space, the picture that this one takes of the world.
    #[must_use]
    pub fn camera_to_grid(&self, camera: &Camera) -> Camera {
        Camera {
            eye: self.to_grid(camera.eye),
            target: self.to_grid(camera.target),
            up: self.direction_to_grid(camera.up),
            projection: camera.projection,
            is_mirrored: camera.is_mirrored != self.is_mirrored(),
        }
    }

    /// A plane of the world in space.
    #[must_use]
    pub fn plane_to_grid(&self, plane: &Plane) -> Plane {
        Plane {
            normal: self.direction_to_grid(plane.normal),
            distance: plane.distance - plane.normal.dot(self.origin),
        }
    }

    /// A surface of the world in space: another, with a revision of its own.
    #[must_use]
    pub fn mesh_to_grid(&self, mesh: &TriangleMesh) -> TriangleMesh {
        mesh.moved(|point| self.to_grid(point))
    }

    /// The smallest box along the axes of the world around a box of space.
    pub fn bounds_to_world(&self, [low, high]: [DVec3; 2]) -> [DVec3; 2] {
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        (0..8_usize).fold(none, |[first, last], corner| {
            let pick = |axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] };
            let place = self.to_world(DVec3::new(pick(0), pick(1), pick(2)));
            [first.min(place), last.max(place)]
        })
    }
}

/// For each column of a matrix the axis that it is nearest to, each another, and whether it runs along it.
pub fn nearest_axes(columns: DMat3) -> [(usize, bool); 3] {
    let directions = [0, 1, 2].map(|axis| columns.col(axis).normalize_or_zero());
    // Of the six ways to pair axes, the one that is nearest.
    const PAIRS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let nearness = |pairs: &[usize; 3]| -> f64 { (0..3).map(|i| directions[i][pairs[i]].abs()).sum() };
    // Half way between two, rounding does not decide.
    let better = |best: [usize; 3], pairs: [usize; 3]| {
        if nearness(&pairs) > nearness(&best) + 1e-9 { pairs } else { best }
    };
    let nearest = PAIRS.into_iter().fold(PAIRS[0], better);
    [0, 1, 2].map(|i| (nearest[i], directions[i][nearest[i]] >= 0.0))
}

/// The axes of the world that are nearest.
fn snapped(rotation: DMat3) -> DMat3 {
    let [x, y, z] = nearest_axes(rotation)
        .map(|(axis, is_along)| if is_along { DVec3::AXES[axis] } else { -DVec3::AXES[axis] });
    DMat3::from_cols(x, y, z)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::Projection;

    /// Every way to lay axes along axes, and each turned a little.
    fn all() -> Vec<DAffine3> {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.4));
        let origin = DVec3::new(-90.5, 126.0, 7.25);
        let mut all = Vec::new();
        for pairs in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            for signs in 0..8_u32 {
                let axis = |i: usize| {
                    DVec3::AXES[pairs[i]] * if signs >> i & 1 == 1 { -1.0 } else { 1.0 } * (0.5 + i as f64)
                };
                let axes = DMat3::from_cols(axis(0), axis(1), axis(2));
                all.extend([axes, turn * axes].map(|axes| DAffine3::from_mat3_translation(axes, origin)));
            }
        }
        all
    }

    #[test]
    fn there_and_back_is_nowhere_else() {
        for map in all() {
            let placement = Placement::of(&map).unwrap();
            let spacing = [0, 1, 2].map(|axis| map.matrix3.col(axis).length());
            let index = DVec3::new(3.0, 5.0, 11.0);
            let in_space = index * DVec3::from_array(spacing);
            let world = map.transform_point3(index);
            assert!(placement.to_world(in_space).distance(world) < 1e-12, "{map}");
            assert!(placement.to_grid(world).distance(in_space) < 1e-12, "{map}");
            assert_eq!(placement.is_mirrored(), map.matrix3.determinant() < 0.0, "{map}");
        }
    }

    /// What a pixel sees in the world, it sees in space: of mirrored axes, too.
    #[test]
    fn rays_of_a_camera_are_those_of_the_world() {
        for map in all() {
            let placement = Placement::of(&map).unwrap();
            for projection in
                [Projection::Perspective { fov_y_deg: 40.0 }, Projection::Orthographic { height: 9.0 }]
            {
                let camera = Camera {
                    eye: DVec3::new(9.0, -30.0, 14.0),
                    target: DVec3::new(1.0, 2.0, 3.0),
                    up: DVec3::new(0.1, 0.0, 1.0),
                    projection,
                    is_mirrored: false,
                };
                let (world, space) = (camera.rays(30, 20), placement.camera_to_grid(&camera).rays(30, 20));
                for [column, row] in [[0, 0], [29, 0], [7, 19]] {
                    let (expected, found) = (world.pixel(column, row), space.pixel(column, row));
                    let direction = placement.direction_to_world(found.direction);
                    assert!(direction.distance(expected.direction) < 1e-14, "{map}");
                    assert!(placement.to_world(found.origin).distance(expected.origin) < 1e-13, "{map}");
                }
            }
            let plane = Plane { normal: DVec3::new(1.0, -2.0, 0.5), distance: 3.0 };
            let point = DVec3::new(4.0, 5.0, 6.0);
            let found = placement.plane_to_grid(&plane).signed_distance(placement.to_grid(point));
            assert!((found - plane.signed_distance(point)).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_nearly_a_rotation_is_one_and_what_is_sheared_is_refused() {
        let turned = |degrees: f64| DVec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        let map = |y: DVec3| DAffine3::from_mat3(DMat3::from_cols(DVec3::X * 2.0, y, DVec3::Z));
        let near = Placement::of(&map(turned(0.05))).unwrap();
        // Half of the angle each: the order of axes does not matter.
        let expected = 0.025_f64.to_radians();
        assert!((near.direction_to_world(DVec3::X).y.abs() - expected).abs() < 1e-9);
        let error = Placement::of(&map(turned(12.5))).unwrap_err();
        assert_eq!(error.axes, [0, 1]);
        assert!((error.degrees - 77.5).abs() < 1e-9, "{error}");
        assert_eq!(
            error.to_string(),
            "axes x and y of the samples meet at 77.50 degrees, expected a right angle"
        );
        // Rounding of 32 bits is no turn.
        let rounded = DMat3::from_cols(
            DVec3::new(-1.0, 3e-8, 0.0),
            DVec3::new(2e-8, 0.5, 1e-8),
            DVec3::new(0.0, 0.0, 2.0),
        );
        let rounded = Placement::of(&DAffine3::from_mat3(rounded)).unwrap();
        assert_eq!(rounded.direction_to_world(DVec3::ONE), DVec3::new(-1.0, 1.0, 1.0));
    }
}
