//! A camera that shows what there is to see.
//!
//! # Method
//! Every sample of a level of at most [`MAX_SAMPLES`], or cell of a grid, weighs as much as its opacity. The domain is divided
//! into blocks, at most [`MAX_BLOCKS`] along an axis, and the lightest blocks are left out as long as they hold
//! no more than [`TRIM`] of all weight together, so that specks of noise do not push the camera away. The camera
//! then stands as near as it can with every corner of the other blocks in the picture, and in its middle.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use glam::{DQuat, DVec2, DVec3};
use rayon::prelude::*;
use volery_io::World;
use volery_pyramid::Layout;
use volery_scene::{Camera, Placement, Projection, Samples, TransferFunction, UnstructuredGrid, VoxelGrid};

/// Samples looked at, at most.
pub const MAX_SAMPLES: usize = 1 << 21;

/// Blocks along an axis, at most.
pub const MAX_BLOCKS: usize = 32;

/// Values of a cell whose opacity is looked at, from its lowest to its highest.
const VALUES_PER_CELL: u32 = 9;

/// Share of opacity that may lie outside all blocks.
pub const TRIM: f64 = 0.002;

/// Part of the picture's width or height that the blocks fill.
const FILL: f64 = 0.92;

/// Full vertical angle of view of a fitted camera.
const FOV_Y_DEG: f64 = 30.0;

/// How often the picture is moved to its middle; each time leaves less than a quarter of what was off.
const NUM_CENTERINGS: usize = 6;

/// From where to look at a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// About z: 0 looks along +y, positive turns the eye towards +x.
    pub azimuth_deg: f64,
    /// Above the xy plane.
    pub elevation_deg: f64,
    /// Above 1 comes nearer.
    pub zoom: f64,
}

impl Default for Direction {
    /// From the right, a little from above.
    fn default() -> Self {
        Self { azimuth_deg: 35.0, elevation_deg: 22.0, zoom: 1.0 }
    }
}

impl Direction {
    /// Straight at planes of this unit normal, from the side of them that is nearer to the default.
    pub fn facing(normal: DVec3) -> Self {
        let [_, _, forward] = Self::default().turned(DVec3::ONE, DVec3::Z).axes();
        let side = if normal.dot(forward) > 0.0 { -normal } else { normal };
        Self::toward_eye(side, DVec3::Z)
    }

    /// From where a vector points to, of any length but 0, in a picture whose upwards direction is `up`.
    pub fn toward_eye(to_eye: DVec3, up: DVec3) -> Self {
        let side = turn_of(up).inverse() * to_eye.normalize_or_zero();
        let azimuth_deg =
            if side.truncate() == DVec2::ZERO { 0.0 } else { side.x.atan2(-side.y).to_degrees() };
        Self { azimuth_deg, elevation_deg: side.z.clamp(-1.0, 1.0).asin().to_degrees(), zoom: 1.0 }
    }

    /// A camera that shows a box from here, for its axes alone. The angles are about `up`: z turned into it on the shortest
    /// way turns x and y, too.
    fn turned(self, extent: DVec3, up: DVec3) -> Camera {
        let Self { azimuth_deg, elevation_deg, .. } = self;
        let camera = Camera::fitted(extent, azimuth_deg, elevation_deg, 1.0, false);
        if up == DVec3::Z {
            return camera;
        }
        let turn = turn_of(up);
        Camera { eye: camera.target + turn * (camera.eye - camera.target), up: turn * camera.up, ..camera }
    }
}

/// What turns z into a direction on the shortest way; into -z about x.
fn turn_of(up: DVec3) -> DQuat {
    let up = up.normalize_or_zero();
    if up.z < -1.0 + 1e-12 { DQuat::from_rotation_x(PI) } else { DQuat::from_rotation_arc(DVec3::Z, up) }
}

/// A side that data are seen from. The front of anatomical data is y, that of others -y; the right is x, as a patient has
/// it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The face of a patient; of other data, where nobody says otherwise, the side of low y.
    Front,
    /// The other one.
    Back,
    /// Of low x.
    Left,
    /// Of high x.
    Right,
    /// Of high z.
    Top,
    /// Of low z.
    Bottom,
    /// The front of a patient.
    Anterior,
    /// The back of a patient.
    Posterior,
    /// The head of a patient.
    Superior,
    /// The feet of a patient.
    Inferior,
}

impl Side {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Front,
        Self::Back,
        Self::Left,
        Self::Right,
        Self::Top,
        Self::Bottom,
        Self::Anterior,
        Self::Posterior,
        Self::Superior,
        Self::Inferior,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
            Self::Left => "left",
            Self::Right => "right",
            Self::Top => "top",
            Self::Bottom => "bottom",
            Self::Anterior => "anterior",
            Self::Posterior => "posterior",
            Self::Superior => "superior",
            Self::Inferior => "inferior",
        }
    }

    /// The unit vector of the world from data to an eye on this side; `None` for sides of patients in a world that knows
    /// none.
    pub fn to_eye(self, world: World) -> Option<DVec3> {
        let is_patient = world == World::Anatomical;
        let front = if is_patient { DVec3::Y } else { -DVec3::Y };
        match self {
            Self::Front => Some(front),
            Self::Back => Some(-front),
            Self::Left => Some(-DVec3::X),
            Self::Right => Some(DVec3::X),
            Self::Top => Some(DVec3::Z),
            Self::Bottom => Some(-DVec3::Z),
            Self::Anterior => is_patient.then_some(DVec3::Y),
            Self::Posterior => is_patient.then_some(-DVec3::Y),
            Self::Superior => is_patient.then_some(DVec3::Z),
            Self::Inferior => is_patient.then_some(-DVec3::Z),
        }
    }
}

/// How a camera looks that shows everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// From where.
    pub direction: Direction,
    /// What is up in the picture: a direction of the world, of any length but 0.
    pub up: DVec3,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// Width over height of the picture.
    pub aspect: f64,
}

/// Boxes of a grid's space, `[low, high]`, that hold the visible matter; the whole domain if nothing is visible.
///
/// Samples are looked at and blocks laid out from the corner that is lowest in the world, along its axes: so the boxes
/// are the same wherever the file begins.
pub fn visible_blocks(
    grid: &VoxelGrid,
    layout: &Layout,
    placement: &Placement,
    transfer: &TransferFunction,
) -> Vec<[DVec3; 2]> {
    let small = |&level: &u32| layout.level_dims(level).iter().product::<usize>() <= MAX_SAMPLES;
    let level = (0..layout.num_levels()).find(small).unwrap_or(layout.num_levels() - 1);
    let nearest = placement.nearest_axes();
    // Of space, for each axis of the world.
    let own: [usize; 3] = std::array::from_fn(|axis| (0..3).find(|&i| nearest[i].0 == axis).unwrap_or(axis));
    let dims = own.map(|axis| layout.level_dims(level)[axis]);
    // Cells of the level per block; its samples and those of the next block's lower face count.
    let cells = dims.map(|n| (n - 1).div_ceil(MAX_BLOCKS).max(1));
    let num_blocks: [usize; 3] = std::array::from_fn(|axis| (dims[axis] - 1).div_ceil(cells[axis]).max(1));
    let (samples, all) = (grid.samples(), grid.dims());
    // What a sample of the level adds to the place in the grid, along an axis of the world.
    let place = |axis: usize, at: usize| {
        let (i, stride) = (own[axis], all[..own[axis]].iter().product::<usize>());
        let index = (at << level).min(all[i] - 1);
        stride * if nearest[i].1 { index } else { all[i] - 1 - index }
    };
    let weigh = |block: usize| {
        let number = [
            block % num_blocks[0],
            block / num_blocks[0] % num_blocks[1],
            block / num_blocks[0] / num_blocks[1],
        ];
        let first: [usize; 3] = std::array::from_fn(|axis| number[axis] * cells[axis]);
        let last: [usize; 3] = std::array::from_fn(|axis| (first[axis] + cells[axis]).min(dims[axis] - 1));
        let along_x: Vec<usize> = (first[0]..=last[0]).map(|x| place(0, x)).collect();
        let mut weight = 0.0;
        for z in first[2]..=last[2] {
            for y in first[1]..=last[1] {
                let row = place(1, y) + place(2, z);
                let opacity = |x: &usize| {
                    let value = samples.value(row + x, 0);
                    if value.is_finite() { transfer.classify(value).1 } else { 0.0 }
                };
                weight += along_x.iter().map(opacity).sum::<f64>();
            }
        }
        (weight, block_bounds([first, last], level, layout, nearest))
    };
    let blocks = (0..num_blocks.iter().product()).into_par_iter().map(weigh).collect();
    heaviest(blocks).unwrap_or_else(|| vec![[DVec3::ZERO, layout.domain() * layout.spacing()]])
}

/// The box of space between two samples of a level that are counted along the axes of the world.
fn block_bounds(
    [first, last]: [[usize; 3]; 2],
    level: u32,
    layout: &Layout,
    nearest: [(usize, bool); 3],
) -> [DVec3; 2] {
    let step = layout.spacing() * (1_u64 << level) as f64;
    let end = layout.domain() * layout.spacing();
    let along = |i: usize, counted: [usize; 3]| (counted[nearest[i].0] as f64 * step[i]).min(end[i]);
    let [low, high] = [first, last].map(|counted| [0, 1, 2].map(|i| along(i, counted)));
    let is_back = nearest.map(|(_, is_along)| !is_along);
    let pick = |own: [f64; 3], other: [f64; 3]| {
        DVec3::from_array([0, 1, 2].map(|i| if is_back[i] { end[i] - other[i] } else { own[i] }))
    };
    [pick(low, high), pick(high, low)]
}

/// Boxes in world units around the visible matter of cells; those of all cells if nothing is visible.
///
/// A cell weighs its box times the mean opacity over its values, and is in the block of its middle.
pub fn visible_cells(
    grid: &UnstructuredGrid,
    values: &Samples,
    transfer: &TransferFunction,
) -> Vec<[DVec3; 2]> {
    let Some([first, last]) = grid.world_bounds() else { return vec![[DVec3::ZERO; 2]] };
    let size = (last - first) / MAX_BLOCKS as f64;
    let mut blocks: BTreeMap<[usize; 3], (f64, [DVec3; 2])> = BTreeMap::new();
    for (cell, (_, nodes)) in grid.cells().iter().enumerate() {
        if grid.is_blank(cell) {
            continue;
        }
        let nodes = || nodes.iter().map(|&node| node as usize);
        let own = nodes().map(|node| values.value(node, 0));
        let [low, high] =
            own.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
        if transfer.is_transparent(low, high) {
            continue;
        }
        let value = |step: u32| low + (high - low) * f64::from(step) / f64::from(VALUES_PER_CELL - 1);
        let opacity: f64 = (0..VALUES_PER_CELL).map(|step| transfer.classify(value(step)).1).sum();
        let bounds = nodes().map(|node| [grid.points()[node]; 2]).reduce(around);
        let Some([from, to]) = bounds else { continue };
        // Along a flat axis the place is no number, which is block 0.
        let place = ((0.5 * (from + to) - first) / size).to_array().map(|place| place as usize);
        let block = blocks.entry(place).or_insert((0.0, [from, to]));
        block.0 += opacity * (to - from).element_product();
        block.1 = around(block.1, [from, to]);
    }
    heaviest(blocks.into_values().collect()).unwrap_or_else(|| vec![[first, last]])
}

fn around([low, high]: [DVec3; 2], [other_low, other_high]: [DVec3; 2]) -> [DVec3; 2] {
    [low.min(other_low), high.max(other_high)]
}

/// Boxes without the lightest ones, which have [`TRIM`] of all weight together; `None` if none weighs anything.
fn heaviest(mut blocks: Vec<(f64, [DVec3; 2])>) -> Option<Vec<[DVec3; 2]>> {
    blocks.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = blocks.iter().map(|(weight, _)| weight).sum();
    let mut sum = 0.0;
    let light = blocks.iter().take_while(|(weight, _)| {
        sum += weight;
        sum <= all * TRIM
    });
    let num_light = light.count();
    (num_light < blocks.len()).then(|| blocks[num_light..].iter().map(|&(_, block)| block).collect())
}

/// The camera that shows boxes of positive size, which lie in a space that is placed so in the world. Without defects
/// for finite arguments and a positive zoom.
pub fn camera(boxes: &[[DVec3; 2]], placement: &Placement, look: Look) -> Camera {
    let [low, high] = boxes.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], block| {
        [low.min(block[0]), high.max(block[1])]
    });
    let Look { direction, orthographic, aspect, .. } = look;
    let turned = direction.turned(high - low, look.up);
    let [right, up, forward] = turned.axes().map(|axis| placement.direction_to_grid(axis));
    let corners: Vec<DVec3> = boxes
        .iter()
        .flat_map(|block| {
            let pick = |corner: usize, axis: usize| block[corner >> axis & 1][axis];
            (0..8).map(move |corner| DVec3::new(pick(corner, 0), pick(corner, 1), pick(corner, 2)))
        })
        .map(|corner| DVec3::new(corner.dot(right), corner.dot(up), corner.dot(forward)))
        .collect();
    // From here on in the axes of the picture. `slope` is half the picture's height at distance 1, as far as
    // it may be filled.
    let slope = (FOV_Y_DEG / 2.0).to_radians().tan() * FILL;
    let middle = (low + high) / 2.0;
    let mut target = DVec3::new(middle.dot(right), middle.dot(up), middle.dot(forward));
    let (mut distance, mut half_height) = (0.0, 0.0);
    for _ in 0..NUM_CENTERINGS {
        (distance, half_height) = (0.0_f64, 0.0_f64);
        for &corner in &corners {
            let from_target = corner - target;
            let across = from_target.y.abs().max(from_target.x.abs() / aspect);
            distance = distance.max(across / slope - from_target.z);
            half_height = half_height.max(across / FILL);
        }
        let [first, last] =
            corners.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[first, last], &corner| {
                let from_target = corner - target;
                let depth = if orthographic { 1.0 } else { (from_target.z + distance) / distance };
                [first.min(from_target / depth), last.max(from_target / depth)]
            });
        let off = (first + last) / 2.0;
        target += DVec3::new(off.x, off.y, 0.0);
    }
    let target = placement.to_world(right * target.x + up * target.y + forward * target.z);
    let ([_, _, forward], zoom) = (turned.axes(), direction.zoom);
    let projection = if orthographic {
        Projection::Orthographic { height: 2.0 * half_height / zoom }
    } else {
        Projection::Perspective { fov_y_deg: FOV_Y_DEG }
    };
    // Parallel rays start before the boxes, whatever the zoom.
    let distance = if orthographic { distance.max((high - low).length()) } else { distance / zoom };
    Camera { eye: target - forward * distance, target, up: turned.up, projection, is_mirrored: false }
}

/// A camera of parallel rays along `forward` that just shows all of some points, at least one.
pub fn facing(points: &[DVec3], forward: DVec3, up: DVec3, aspect: f64) -> Camera {
    let for_axes = Camera {
        eye: -forward,
        target: DVec3::ZERO,
        up,
        projection: Projection::Orthographic { height: 1.0 },
        is_mirrored: false,
    };
    let [right, up, forward] = for_axes.axes();
    let places = points.iter().map(|point| DVec3::new(point.dot(right), point.dot(up), point.dot(forward)));
    let [low, high] = places
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], place| [low.min(place), high.max(place)]);
    let (middle, size) = ((low + high) / 2.0, high - low);
    let target = right * middle.x + up * middle.y + forward * middle.z;
    let height = size.y.max(size.x / aspect).max(f64::MIN_POSITIVE) / FILL;
    let distance = size.length().max(f64::MIN_POSITIVE);
    Camera {
        eye: target - forward * distance,
        target,
        up,
        projection: Projection::Orthographic { height },
        is_mirrored: false,
    }
}

/// A camera of parallel rays that shows the plane through the target as large as `camera` does.
pub fn orthographic(camera: &Camera) -> Camera {
    let height = match camera.projection {
        Projection::Orthographic { height } => height,
        Projection::Perspective { fov_y_deg } => {
            2.0 * (camera.target - camera.eye).length() * (fov_y_deg.to_radians() / 2.0).tan()
        }
    };
    Camera { projection: Projection::Orthographic { height }, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volery_pyramid::{Kind, NodeSource, Pyramid};
    use volery_scene::{CellType, Cells, ControlPoint, VoxelGrid};

    fn corners_fill_the_picture(bounds: [DVec3; 2], camera: &Camera, aspect: f64) -> f64 {
        let [right, up, forward] = camera.axes();
        let mut largest = 0.0_f64;
        for corner in 0..8u32 {
            let pick = |axis: usize| bounds[(corner >> axis & 1) as usize][axis];
            let p = DVec3::new(pick(0), pick(1), pick(2)) - camera.eye;
            let half = match camera.projection {
                Projection::Perspective { fov_y_deg } => {
                    assert!(p.dot(forward) > 0.0, "a corner lies behind the eye");
                    (fov_y_deg / 2.0).to_radians().tan() * p.dot(forward)
                }
                Projection::Orthographic { height } => height / 2.0,
            };
            largest = largest.max(p.dot(up).abs() / half).max(p.dot(right).abs() / (half * aspect));
        }
        largest
    }

    fn look_at(bounds: [DVec3; 2], direction: Direction, orthographic: bool, aspect: f64) -> Camera {
        camera(&[bounds], &Placement::default(), Look { direction, up: DVec3::Z, orthographic, aspect })
    }

    #[test]
    fn a_direction_faces_planes_of_any_normal() {
        let bounds = [DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)];
        for normal in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::Z, DVec3::NEG_Z, DVec3::new(0.3, -0.5, 0.81)]
        {
            let normal = normal.normalize();
            let [_, _, forward] = look_at(bounds, Direction::facing(normal), true, 1.0).axes();
            assert!(normal.dot(forward).abs() > 1.0 - 1e-12, "{normal}: {forward}");
            let [_, _, usual] = look_at(bounds, Direction::default(), true, 1.0).axes();
            assert!(usual.dot(forward) > 0.0, "{normal}: {forward}");
        }
    }

    #[test]
    fn the_box_just_fits_from_everywhere() {
        let bounds = [DVec3::new(5.0, -3.0, 1.0), DVec3::new(9.0, 40.0, 2.0)];
        for (azimuth_deg, elevation_deg) in [(35.0, 22.0), (0.0, 90.0), (200.0, -90.0), (90.0, 0.0)] {
            for aspect in [1.0, 2.5, 0.3] {
                for parallel in [false, true] {
                    let direction = Direction { azimuth_deg, elevation_deg, zoom: 1.0 };
                    let camera = look_at(bounds, direction, parallel, aspect);
                    assert!(camera.defects().is_empty());
                    let filled = corners_fill_the_picture(bounds, &camera, aspect);
                    assert!(
                        filled > FILL - 0.1 && filled < 0.98,
                        "{azimuth_deg} {aspect} {parallel}: {filled}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_visible_blocks_hold_the_matter_and_not_the_air() {
        let mut values = vec![0u8; 40 * 30 * 20];
        for z in 8..12 {
            for y in 10..25 {
                for x in 3..6 {
                    values[(z * 30 + y) * 40 + x] = 100;
                }
            }
        }
        let grid = VoxelGrid::new([40, 30, 20], DVec3::new(1.0, 1.0, 2.0), values).unwrap();
        let pyramid = Pyramid::build(&grid, Kind::Decimated, 8).unwrap();
        let point = |value, opacity| ControlPoint { value, color: [1.0; 3], opacity };
        let transfer = TransferFunction::new(vec![point(50.0, 0.0), point(100.0, 0.5)], 1.0).unwrap();
        let blocks = visible_blocks(&grid, pyramid.layout(), &Placement::default(), &transfer);
        let [low, high] = blocks.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], block| {
            [low.min(block[0]), high.max(block[1])]
        });
        let (first, last) = (DVec3::new(3.0, 10.0, 16.0), DVec3::new(5.0, 24.0, 22.0));
        assert!(low.cmple(first).all() && high.cmpge(last).all(), "{low} {high}");
        assert!((first - low).max_element() <= 4.0 && (high - last).max_element() <= 4.0, "{low} {high}");
        let clear = TransferFunction::new(vec![point(0.0, 0.0)], 1.0).unwrap();
        assert_eq!(
            visible_blocks(&grid, pyramid.layout(), &Placement::default(), &clear),
            [[DVec3::ZERO, grid.extent()]]
        );
    }

    #[test]
    fn the_visible_cells_hold_the_matter_and_not_the_rest() {
        // A row of boxes, of which one in the middle can be seen.
        let points = (0..=50).flat_map(|x| {
            (0..4).map(move |at| DVec3::new(f64::from(x), f64::from(at & 1), f64::from(at >> 1)))
        });
        let points: Vec<DVec3> = points.collect();
        let nodes = (0..50_u32).flat_map(|x| [0, 4, 1, 5, 2, 6, 3, 7].map(|node| 4 * x + node));
        let cells = Cells::new(vec![CellType::Voxel; 50], nodes.collect()).unwrap();
        let grid = UnstructuredGrid::new(points, cells).unwrap();
        let value = |node: usize| if (20..=21).contains(&(node / 4)) { 10.0 } else { 0.0 };
        let values = Samples::from((0..204).map(value).collect::<Vec<f64>>());
        let point = |value, opacity| ControlPoint { value, color: [1.0; 3], opacity };
        let whole = [DVec3::ZERO, DVec3::new(50.0, 1.0, 1.0)];
        let bounds = |points: Vec<ControlPoint>| {
            let transfer = TransferFunction::new(points, 1.0).unwrap();
            visible_cells(&grid, &values, &transfer).into_iter().reduce(around).unwrap()
        };
        // From 9 on: that one alone. Above 5 its neighbours, too. A band that no node is in: these alone.
        let box_of = |from, to| [DVec3::new(from, 0.0, 0.0), DVec3::new(to, 1.0, 1.0)];
        assert_eq!(bounds(vec![point(9.99, 0.0), point(10.0, 1.0)]), box_of(19.0, 22.0));
        assert_eq!(bounds(vec![point(4.0, 0.0), point(5.0, 0.5), point(6.0, 0.0)]), box_of(19.0, 22.0));
        assert_eq!(bounds(vec![point(-1.0, 0.5)]), whole);
        assert_eq!(bounds(vec![point(0.0, 0.0)]), whole);
        // Specks of noise do not push the camera away.
        assert_eq!(bounds(vec![point(0.0, 1e-5), point(1.0, 1e-5), point(5.0, 0.9)]), box_of(19.0, 22.0));
    }

    #[test]
    fn an_orthographic_twin_is_as_large_at_the_target() {
        let bounds = [DVec3::ZERO, DVec3::ONE];
        let perspective = look_at(bounds, Direction::default(), false, 1.0);
        let Projection::Orthographic { height } = orthographic(&perspective).projection else {
            panic!("not orthographic");
        };
        let distance = perspective.eye.distance(perspective.target);
        assert!((height - 2.0 * distance * 15f64.to_radians().tan()).abs() < 1e-12);
    }
}
