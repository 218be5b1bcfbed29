//! Cutting planes on real data: against the truth, against their bounds, while they are dragged.

mod certified;
mod dragging;
mod images;
mod truth;

use std::path::Path;
use volery_tests::Drawer;

use volery::glam::DVec3;
use volery::{ControlPoint, How, Plane, PlaneView, TransferFunction, VolumeData, VoxelGrid};
use volery_software::SoftwareBackend;

const ENGINE: &str = "engine_256x256x128_uint8.raw";
const MOUSE: &str = "mouse_512x512x512_uint8.raw.zst";
const MRI: &str = "mri_256x256x256_uint8.raw.gz";
const TOOTH: &str = "tooth16_103x94x161_uint16be.raw";

fn read(data: &Path, name: &str) -> VoxelGrid {
    let input = volery::read_input(&data.join(name), None).unwrap_or_else(|error| panic!("{error}"));
    input.volume().unwrap().grid.clone()
}

fn software(grid: VoxelGrid) -> Drawer<VolumeData> {
    Drawer::volume(grid, Box::new(SoftwareBackend::new()), How::Planes(PlaneView::default())).unwrap()
}

/// A colour that never is the background's, steep in parts, in the middle half of `range` half transparent.
fn colors([low, high]: [f64; 2]) -> TransferFunction {
    let point = |at: f64, color, opacity| ControlPoint { value: low + (high - low) * at, color, opacity };
    let points = vec![
        point(0.0, [0.1, 0.2, 0.5], 0.9),
        point(0.2, [0.1, 0.5, 0.4], 0.3),
        point(0.5, [0.9, 0.6, 0.1], 0.5),
        point(1.0, [1.0, 1.0, 0.9], 1.0),
    ];
    TransferFunction::new(points, 1.0).unwrap()
}

/// Numbers in [0, 1), the same in every run.
struct Random {
    seed: u64,
    next: u64,
}

impl Random {
    fn new(seed: u64) -> Self {
        Self { seed: volery_data::hash(seed), next: 0 }
    }

    fn number(&mut self) -> f64 {
        self.next += 1;
        (volery_data::hash(self.seed ^ self.next) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.number()
    }

    /// Evenly over the sphere.
    fn direction(&mut self) -> DVec3 {
        loop {
            let point = DVec3::new(self.number(), self.number(), self.number()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&point.length_squared()) {
                return point.normalize();
            }
        }
    }

    /// In the middle four fifths of a box.
    fn point(&mut self, extent: DVec3) -> DVec3 {
        let [x, y, z] = extent.to_array().map(|length| length * self.between(0.1, 0.9));
        DVec3::new(x, y, z)
    }

    fn plane(&mut self, extent: DVec3) -> Plane {
        Plane::through(self.point(extent), self.direction())
    }
}
