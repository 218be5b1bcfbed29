//! Techniques: from a scene and its dials to a frame that any backend draws.

mod cells;
pub mod fans;
pub mod parts;
pub mod plane;
pub mod raycast;
pub mod residency;
pub mod stack;

use volery_scene::VoxelGrid;

/// How a volume is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// Matter along one ray per pixel.
    Raycast,
    /// Cutting planes.
    Plane,
    /// Cubes of an octree, back to front.
    Fans,
}

impl Technique {
    /// Its name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Raycast => "raycast",
            Self::Plane => "plane",
            Self::Fans => "fans",
        }
    }

    /// What suits a grid: planes for images and for colours, which have no matter, rays for everything else.
    pub fn suiting(grid: &VoxelGrid) -> Self {
        let is_flat = grid.dims().contains(&1);
        if is_flat || grid.sample_type().channels() > 1 { Self::Plane } else { Self::Raycast }
    }
}
