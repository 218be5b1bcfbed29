//! Random data, the exact picture of what is drawn beside the exact picture of what there is.
//!
//! A field that is trilinear in coarse cells is so in the fine ones too: sampled at the finest places, it is a volume that
//! the reference draws. So both pictures are exact, and their difference is what is bounded.

use glam::DVec3;
use volery_data::hash;
use volery_octree::{Answer, Joined, joined};
use volery_pyramid::{Kind, Layout, Pyramid};
use volery_reference::{Image, Tracer};
use volery_scene::{Camera, ControlPoint, Projection, Samples, VoxelGrid};

use super::*;
use crate::residency::Numbers;
use crate::texels::Encoding;
use crate::view::{Dial, How, Transfer};

/// Numbers in [0, 1), one after the other.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 += 1;
        (hash(self.0) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn below(&mut self, num: usize) -> usize {
        (self.next() * num as f64) as usize
    }
}

struct Scene {
    grid: VoxelGrid,
    transfer: TransferFunction,
    camera: Camera,
    background: [f64; 3],
    tolerance: f64,
}

/// Smooth or rough, of some sample types; a field from 0 to 100 but for an offset.
fn grid(random: &mut Random) -> VoxelGrid {
    let dims = [0, 1, 2].map(|_| 2 + random.below(24));
    let waves: Vec<[f64; 5]> = (0..4).map(|_| [0; 5].map(|_| random.next())).collect();
    let noise = if random.next() < 0.3 { random.between(0.0, 60.0) } else { 0.0 };
    let offset = if random.next() < 0.2 { 1e5 } else { 0.0 };
    let mut value = |place: [usize; 3]| {
        let wave = |[x, y, z, phase, size]: &[f64; 5]| {
            let turns = x * place[0] as f64 + y * place[1] as f64 + z * place[2] as f64;
            12.5 * size * (1.0 + (0.6 * turns + 6.3 * phase).sin())
        };
        offset + waves.iter().map(wave).sum::<f64>() + noise * random.next()
    };
    let values = volery_data::fill(dims, &mut value);
    let samples = match random.below(4) {
        0 => Samples::from(
            values.iter().map(|&value| (value - offset).clamp(0.0, 255.0) as u8).collect::<Vec<_>>(),
        ),
        1 => Samples::from(values.iter().map(|&value| (value - offset) as u16).collect::<Vec<_>>()),
        2 => Samples::from(values.iter().map(|&value| value as f32).collect::<Vec<_>>()),
        _ => Samples::from(values),
    };
    let spacing = DVec3::from([0, 1, 2].map(|_| random.between(0.5, 2.0)));
    VoxelGrid::new(dims, spacing, samples).expect("a grid")
}

/// Two to seven points, some of them steps, spikes or opaque.
fn transfer(random: &mut Random, [low, high]: [f64; 2]) -> TransferFunction {
    let num = 2 + random.below(6);
    let densest = [0.05, 0.3, 0.9, 1.0][random.below(4)];
    let mut values: Vec<f64> = (0..num).map(|_| random.between(low, high)).collect();
    values.sort_by(f64::total_cmp);
    let mut points = Vec::new();
    for value in values {
        let point = |random: &mut Random| {
            let opacity = if random.next() < 0.3 { 0.0 } else { random.between(0.0, densest) };
            let opacity = if densest == 1.0 && random.next() < 0.3 { 1.0 } else { opacity };
            ControlPoint { value, color: [0; 3].map(|_| random.next()), opacity }
        };
        points.push(point(random));
        if random.next() < 0.2 {
            points.push(point(random));
        }
    }
    TransferFunction::new(points, random.between(0.5, 4.0)).expect("points in order")
}

fn scene(seed: u64) -> Scene {
    let random = &mut Random(1000 * seed);
    let grid = grid(random);
    let pyramid = Pyramid::build(&grid, Kind::Decimated, 4).expect("small");
    let stats = pyramid.stats(pyramid.layout().root())[0];
    let width = (stats.max - stats.min).max(1.0);
    let transfer = transfer(random, [stats.min - 0.1 * width, stats.max + 0.1 * width]);
    let size = pyramid.layout().domain();
    let direction = DVec3::from([0, 1, 2].map(|_| random.between(-1.0, 1.0))).normalize_or(DVec3::Z);
    let distance = [0.0, 1.5, 3.0][random.below(3)] * size.length().max(1.0);
    let projection = if random.next() < 0.5 {
        Projection::Perspective { fov_y_deg: 40.0 }
    } else {
        Projection::Orthographic { height: size.length().max(1.0) }
    };
    let camera = Camera {
        eye: 0.5 * size - distance * direction,
        target: 0.5 * size + direction,
        up: DVec3::Y,
        is_mirrored: random.next() < 0.2,
        projection,
    };
    let background = [0; 3].map(|_| random.next());
    let tolerance = width * [0.02, 0.1, 0.4, 2.0][random.below(4)];
    Scene { grid, transfer, camera, background, tolerance }
}

/// What a cut shows at the finest samples.
fn drawn(field: &Field, grid: &VoxelGrid, offset: f64) -> VoxelGrid {
    let value = |place: [usize; 3]| {
        let place = place.map(|place| place as i64);
        let cell: [i64; 3] = std::array::from_fn(|axis| place[axis].min(field.cells[axis] - 1));
        let node = field.node(cell).expect("all is drawn");
        let size = 1_i64 << node.level;
        let low = cell.map(|cell| cell / size * size);
        let share = std::array::from_fn(|axis| (place[axis] - low[axis]) as f64 / size as f64);
        offset + field::trilinear(&field.cell(node, cell).expect("no blanks").corners, share)
    };
    VoxelGrid::new(grid.dims(), grid.spacing(), Samples::from(volery_data::fill(grid.dims(), value)))
        .expect("as before")
}

/// The bound, and both pictures.
fn pictures(scene: &Scene) -> Option<(MatterBound, [Image; 2])> {
    let Scene { grid, transfer, camera, background, tolerance } = scene;
    let pyramid = Pyramid::build(grid, Kind::Decimated, 4).expect("small");
    let layout: &Layout = pyramid.layout();
    let stats = pyramid.stats(layout.root())[0];
    let encoding =
        Encoding::new(grid.sample_type(), [stats.min, stats.max]).suiting(transfer, [stats.min, stats.max]);
    let store = Store {
        layout: volery_frame::VolumeLayout {
            revision: volery_frame::Revision::new(),
            cells: grid.dims().map(|n| n as u32 - 1),
            spacing: grid.spacing(),
            brick_cells: 4,
            texel: encoding.texel,
            value_scale: encoding.scale,
            value_offset: encoding.offset,
            value_range: [stats.min, stats.max],
        },
        encoding,
    };
    let error = |node: Node| pyramid.stats(node)[0].error;
    let Joined { cut, seams } = joined(layout, |_: Node| Answer::Draw, error, *tolerance);
    let numbers = Numbers::of(layout);
    let bricks: Vec<JoinedBrick> = cut
        .nodes
        .iter()
        .zip(&seams)
        .map(|(&node, &seams)| JoinedBrick { placed: numbers.place(layout, node), seams })
        .collect();
    let view = View {
        width: 12,
        height: 9,
        camera: *camera,
        background: *background,
        meshes: Vec::new().into(),
        transfer: Transfer::Values(transfer.clone()),
        dial: Dial::Full,
        interest: [].into(),
        how: How::Raycast,
    };
    let source: &dyn NodeSource = &pyramid;
    let bound =
        Search::new((&view, transfer), (source, &store)).bound(&cut.nodes, &bricks).expect("in memory");
    let field =
        Field::new((source, &store), (&cut.nodes, &bricks), transfer, &mut Known::new()).expect("in memory");
    // Cells of nodes without anything to be seen are not kept.
    if field.node([0; 3]).is_none() || bricks.iter().any(|brick| is_clear(&field, brick)) {
        return None;
    }
    let shown = drawn(&field, grid, store.layout.value_offset);
    let picture = |grid: &VoxelGrid| {
        let tracer = Tracer::new(grid, transfer).expect("values");
        tracer.render(camera, *background, view.width, view.height, &|_| ()).expect("small")
    };
    // As the texels have it: what rounding does is no part of a bound.
    let offset = store.layout.value_offset;
    let texels = (0..grid.samples().len())
        .map(|place| offset + f64::from((grid.samples().value(place, 0) - offset) as f32));
    let exact = VoxelGrid::new(grid.dims(), grid.spacing(), texels.collect::<Vec<f64>>()).expect("as before");
    Some((bound, [picture(&shown), picture(&exact)]))
}

fn is_clear(field: &Field, brick: &JoinedBrick) -> bool {
    field.node(brick.placed.first_cell.map(i64::from)).is_none_or(|node| node.is_clear)
}

#[test]
fn no_pixel_differs_by_more_than_its_bound() {
    let (mut num_pictures, mut num_coarse, mut ratios, mut closest) = (0, 0, Vec::new(), f64::INFINITY);
    for seed in 0..1500 {
        let scene = scene(seed);
        let Some((bound, [shown, exact])) = pictures(&scene) else { continue };
        num_pictures += 1;
        let (mut most, mut found) = (0.0_f64, 0.0_f64);
        for ((bound, shown), exact) in bound.pixels.iter().zip(shown.pixels()).zip(exact.pixels()) {
            for channel in 0..3 {
                let difference = (shown[channel] - exact[channel]).abs();
                let bound = f64::from(bound[channel]);
                // What the reference may be off by, twice.
                assert!(difference <= bound + 1e-8, "seed {seed}: {difference} above {bound}");
                (most, found) = (most.max(bound), found.max(difference));
                if difference > 1e-6 {
                    closest = closest.min(bound / difference);
                }
            }
        }
        if found > 1e-4 {
            num_coarse += 1;
            ratios.push(most / found);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    println!(
        "{num_pictures} pictures, {num_coarse} that differ: largest bound over largest difference: median {median:.2} \
         (threshold 10), 9 of 10 below {:.1}; the closest of any pixel {closest:.3}, at least 1",
        ratios[ratios.len() * 9 / 10]
    );
    assert!(num_coarse > 300 && median < 10.0);
}

#[test]
fn an_outlier_loosens_no_bound_elsewhere() {
    let dims = [25, 22, 24];
    let wave = |[x, y, z]: [usize; 3]| {
        ((0.7 * x as f32).sin() + (0.6 * y as f32 + 0.3 * z as f32).cos()) * 0.25 + 0.5
    };
    let point = |value, opacity| ControlPoint { value, color: [0.2, 0.6, 0.9], opacity };
    let rms = |outlier: f32| {
        let values = volery_data::fill(dims, |p| if p == [0; 3] { outlier } else { wave(p) });
        let grid = VoxelGrid::new(dims, DVec3::ONE, Samples::from(values)).expect("a grid");
        let transfer =
            TransferFunction::new(vec![point(0.3, 0.0), point(0.9, 0.2)], 1.0).expect("points in order");
        let camera = Camera::fitted(DVec3::new(24.0, 21.0, 23.0), 35.0, 22.0, 1.0, false);
        let scene = Scene { grid, transfer, camera, background: [0.1, 0.5, 0.9], tolerance: 0.3 };
        let (bound, _) = pictures(&scene).expect("nothing is clear");
        bound.rms()
    };
    let plain = rms(wave([0; 3]));
    assert!(plain > 1e-4, "{plain}: something is coarse");
    for outlier in [-1e6, -1e20, 1e30] {
        let found = rms(outlier);
        println!("outlier {outlier:e}: rms of the bound {found:.5}, at most 1.2 of {plain:.5}");
        assert!(found <= 1.2 * plain);
    }
}
