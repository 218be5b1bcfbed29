//! Cuts of the tree as users meet them: the tolerance dial, odd volumes, threads.

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use volery::{BackendChoice, Dial, How, Image, Preset, View, ViewOptions, VolumeData};
use volery_octree::{DataTolerance, select, validate};
use volery_pyramid::{Brick, Kind, Layout, Node, NodeSource, Pyramid};
use volery_scene::VoxelGrid;
use volery_software::SoftwareBackend;
use volery_tests::{
    Drawer, at_most, backend, data_folder, distance, draw, exact, read_scene, smooth, view_of,
};

/// Volumes that break trees: odd, prime, thin, anisotropic, constant, without structure, with holes.
fn hard_volumes() -> Vec<(&'static str, VoxelGrid)> {
    let uneven = DVec3::new(1.0, 1.0, 10.0);
    vec![
        ("prime", volery_data::noise([67, 37, 41], 1)),
        ("thin", volery_data::noise([2, 131, 35], 2)),
        ("least", volery_data::noise([2, 2, 2], 3)),
        ("anisotropic", volery_data::head([70, 66, 34], uneven)),
        ("constant", volery_data::uniform([65, 33, 34], DVec3::ONE, 7.0)),
        ("holes", volery_data::holes([69, 35, 40], 4, 0.1)),
        ("smooth", volery_data::marschner_lobb(81)),
    ]
}

fn software(grid: VoxelGrid) -> Drawer<VolumeData> {
    Drawer::volume(grid, Box::new(SoftwareBackend::new()), How::Raycast).unwrap()
}

/// All values visible, from aslant.
fn whole_view(session: &Drawer<VolumeData>) -> View {
    let transfer = Some(session.preset(Preset::Ramp).into());
    session.view(&ViewOptions { width: 96, height: 80, transfer, ..ViewOptions::default() })
}

fn bits(image: &Image) -> Vec<[u32; 3]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

by_both_backends! { tolerance_zero_is_the_full_resolution_bit_for_bit }

fn tolerance_zero_is_the_full_resolution_bit_for_bit(choice: BackendChoice, test: &str) {
    for (name, grid) in hard_volumes() {
        let Some(backend) = backend(choice, test) else { return };
        let mut session = Drawer::volume(grid, backend, How::Raycast).unwrap();
        let full = whole_view(&session);
        let zero = View { dial: Dial::Tolerance(0.0), ..full.clone() };
        let (full, zero) = (draw(&mut session, &full), draw(&mut session, &zero));
        assert_eq!(
            full.report.work.nodes_by_level.as_ref().unwrap(),
            zero.report.work.nodes_by_level.as_ref().unwrap(),
            "{name}"
        );
        // What has one value is the same at every level.
        let coarse: usize = full.report.work.nodes_by_level.as_ref().unwrap()[1..].iter().sum();
        assert!(coarse == 0 || name == "constant", "{name}: {coarse} coarse nodes");
        assert_eq!(bits(&full.image), bits(&zero.image), "{name}");
    }
}

#[test]
fn error_falls_with_the_tolerance() {
    let mut session = software(smooth(128));
    let view = whole_view(&session);
    let full = exact(&draw(&mut session, &view).image);
    let mut coarser: Option<(f64, usize)> = None;
    for tolerance in [0.01, 0.003, 0.0] {
        let picture = draw(&mut session, &View { dial: Dial::Tolerance(tolerance), ..view.clone() });
        let by_level = picture.report.work.nodes_by_level.as_ref().unwrap();
        let what = format!("tolerance {tolerance}, nodes by level {by_level:?}");
        let found = distance(&what, &exact(&picture.image), &full).rmse;
        let nodes = picture.report.work.nodes.unwrap();
        if let Some((rmse, fewer)) = coarser {
            assert!(nodes > fewer, "{nodes} nodes, expected more than the {fewer} of a larger tolerance");
            assert!(found < rmse, "rmse {found}, expected less than the {rmse} of a larger tolerance");
        }
        coarser = Some((found, nodes));
    }
    assert_eq!(coarser.unwrap().0, 0.0, "tolerance 0 is the full resolution");
}

/// The value that a cut shows at a place in finest-sample coordinates, from the brick's samples.
fn shown(layout: &Layout, node: Node, brick: &Brick, place: DVec3) -> f64 {
    let step = f64::from(1_u32 << node.level);
    let count = brick.shape.count;
    let mut low = [0; 3];
    let mut fraction = [0.0; 3];
    for axis in 0..3 {
        let first = layout.sample_position(node.level, brick.shape.first[axis]);
        let along = ((place[axis] - first) / step).clamp(0.0, (count[axis] - 1) as f64);
        low[axis] = (along as usize).min(count[axis].saturating_sub(2));
        fraction[axis] = along - low[axis] as f64;
    }
    (0..8_usize)
        .map(|corner| {
            let bit = |axis: usize| corner >> axis & 1;
            let index = std::array::from_fn(|axis| (low[axis] + bit(axis)).min(count[axis] - 1));
            let weights =
                (0..3).map(|axis| if bit(axis) == 1 { fraction[axis] } else { 1.0 - fraction[axis] });
            weights.product::<f64>() * brick.samples.value(brick.shape.index(index), 0)
        })
        .sum()
}

#[test]
fn a_cut_of_real_data_shows_every_sample_within_the_tolerance() {
    let test = "a_cut_of_real_data_shows_every_sample_within_the_tolerance";
    let Some(data) = data_folder(test) else { return };
    let input = volery::read_input(&data.join("fuel_64x64x64_uint8.raw"), None).unwrap();
    let grid = &input.volume().unwrap().grid;
    for kind in [Kind::Decimated, Kind::Averaged] {
        let pyramid = Pyramid::build(grid, kind, 8).unwrap();
        let layout = pyramid.layout();
        for tolerance in [0.0, 1.5, 10.0, 60.0] {
            let cut = select(layout, DataTolerance { source: &pyramid, tolerance });
            assert_eq!(validate::defects(layout, &cut), [], "{kind:?} {tolerance}");
            let mut times_covered = vec![0_u8; grid.num_samples()];
            let mut largest = 0.0_f64;
            let mut brick = Brick::empty(pyramid.sample_type());
            for &node in &cut.nodes {
                pyramid.read_brick(node, &mut brick).unwrap();
                let [xs, ys, zs] = layout.owned(node);
                for (z, y, x) in zs
                    .flat_map(|z| ys.clone().map(move |y| (z, y)))
                    .flat_map(|(z, y)| xs.clone().map(move |x| (z, y, x)))
                {
                    let index = grid.index([x, y, z]);
                    times_covered[index] += 1;
                    let place = DVec3::new(x as f64, y as f64, z as f64);
                    let found = shown(layout, node, &brick, place);
                    largest = largest.max((found - grid.samples().value(index, 0)).abs());
                }
            }
            assert!(
                times_covered.iter().all(|&times| times == 1),
                "{kind:?} {tolerance}: a sample is not covered once"
            );
            // Averages of bytes are kept as bytes; weights of the interpolation round in f64.
            at_most(
                &format!("{kind:?}, {} nodes, error of the field", cut.nodes.len()),
                largest,
                tolerance + 1e-9,
            );
        }
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let grids = hard_volumes();
    let pictures_by = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let pictures = grids.iter().flat_map(|(_, grid)| {
                let mut session = software(grid.clone());
                let view = whole_view(&session);
                [Dial::Full, Dial::Tolerance(0.02)]
                    .map(|dial| bits(&draw(&mut session, &View { dial, ..view.clone() }).image))
            });
            pictures.collect::<Vec<_>>()
        })
    };
    let by_one = pictures_by(1);
    for threads in [2, 7] {
        assert!(pictures_by(threads) == by_one, "{threads} threads");
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_bit_of_real_data() {
    let Some(data) = data_folder("the_number_of_threads_does_not_change_a_bit_of_real_data") else { return };
    let input = read_scene(&data, "tooth16");
    let view = view_of(&input);
    let picture_by = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&draw(&mut software(input.volume().unwrap().grid.clone()), &view).image))
    };
    let by_one = picture_by(1);
    for threads in [2, 7] {
        assert!(picture_by(threads) == by_one, "{threads} threads");
    }
}

#[test]
fn a_volume_of_one_sample_along_an_axis_is_refused_in_one_line() {
    for dims in [[1, 1, 1], [1, 1, 9], [5, 1, 7]] {
        let mut session = software(volery_data::noise(dims, 1));
        let view = whole_view(&session);
        let Err(error) = session.render(&view) else { panic!("{dims:?} was drawn") };
        assert!(error.to_string().contains("at least 2"), "{error}");
    }
}
