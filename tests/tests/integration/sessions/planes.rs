//! The technique plane: pictures that get better as data arrive, and what dials promise.

use std::sync::atomic::{AtomicUsize, Ordering};
use volery_tests::{Drawer, planes_of};

use volery::glam::DVec3;
use volery::{
    BackendChoice, Dial, Focus, How, Image, Plane, PlaneView, RenderError, Sampling, Step, View, ViewOptions,
    VolumeData, VolumeError, VoxelGrid, open_backend,
};
use volery_octree::{Cut, low_corners};
use volery_pyramid::{Brick, Kind, Layout, Node, NodeSource, NodeStats, Pyramid, ReadError};
use volery_scene::SampleType;

const CELLS: usize = volery::data::BRICK_CELLS;

fn session_of(grid: VoxelGrid) -> Drawer<VolumeData> {
    Drawer::volume(grid, open_backend(BackendChoice::Software).unwrap(), How::Planes(PlaneView::default()))
        .unwrap()
}

fn head() -> VoxelGrid {
    volery_data::head([150, 180, 170], DVec3::new(1.0, 1.0, 1.2))
}

/// Two planes, seen from aslant.
fn view_of(session: &Drawer<VolumeData>) -> View {
    let extent = session.data().grid().extent();
    let planes = vec![
        Plane::through(extent * 0.48, DVec3::new(0.3, 0.5, 0.81)),
        Plane::through(extent * 0.52, DVec3::new(1.0, -0.2, 0.1)),
    ];
    let how = Some(How::Planes(PlaneView { planes, ..PlaneView::default() }));
    session.view(&ViewOptions { width: 90, height: 80, how, ..ViewOptions::default() })
}

/// Full resolution, a focus, a largest error, and both.
fn dials(session: &Drawer<VolumeData>) -> Vec<View> {
    let view = view_of(session);
    let point = session.data().grid().extent() * DVec3::new(0.4, 0.2, 0.6);
    let focus = Some(Focus { point, quality: 0.6 });
    let with = |focus, max_error: Option<f64>| {
        let mut view = view.clone();
        planes_of(&mut view).focus = focus;
        view.dial = max_error.map_or(Dial::Full, Dial::Error);
        view
    };
    vec![view.clone(), with(focus, None), with(None, Some(0.25)), with(focus, Some(0.1))]
}

/// A pyramid whose bricks arrive in an order of their own, some with every question whether they are there.
struct Late {
    pyramid: Pyramid,
    seed: u64,
    num_questions: AtomicUsize,
    /// Questions until the last brick is there; a brick that is read before was waited for.
    patience: usize,
}

impl Late {
    fn new(grid: &VoxelGrid, seed: u64, patience: usize) -> Self {
        let pyramid = Pyramid::build(grid, Kind::Decimated, CELLS).unwrap();
        Self { pyramid, seed, num_questions: AtomicUsize::new(0), patience }
    }
}

impl NodeSource for Late {
    fn layout(&self) -> &Layout {
        self.pyramid.layout()
    }

    fn sample_type(&self) -> SampleType {
        self.pyramid.sample_type()
    }

    fn stats(&self, node: Node) -> &[NodeStats] {
        self.pyramid.stats(node)
    }

    fn is_at_hand(&self, node: Node) -> bool {
        let asked = self.num_questions.fetch_add(1, Ordering::Relaxed);
        let key = node.index.iter().fold(u64::from(node.level), |key, &i| key << 16 | u64::from(i));
        let arrives_after = volery_data::hash(self.seed ^ volery_data::hash(key)) % self.patience as u64;
        asked as u64 >= arrives_after
    }

    fn read_brick(&self, node: Node, brick: &mut Brick) -> Result<(), ReadError> {
        self.pyramid.read_brick(node, brick)
    }
}

fn largest_difference(a: &Image, b: &Image) -> f64 {
    let differences = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    differences.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}

fn rmse(a: &Image, b: &Image) -> f64 {
    let differences = a.pixels.iter().flatten().zip(b.pixels.iter().flatten());
    let sum: f64 = differences.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / (3 * a.pixels.len()) as f64).sqrt()
}

fn bound(step: &Step) -> f64 {
    step.picture.report.error.unwrap().bound_max.unwrap()
}

#[test]
fn the_last_of_the_pictures_is_the_picture_bit_for_bit() {
    let grid = head();
    for (number, view) in dials(&session_of(grid.clone())).iter().enumerate() {
        let expected = session_of(grid.clone()).render(view).unwrap();
        for bricks_per_step in [0, 1, 7, 1000] {
            let mut session = session_of(grid.clone());
            let steps = session.progressive(view, None, bricks_per_step).unwrap();
            let num_bricks = steps.num_bricks();
            let steps: Vec<Step> = steps.map(Result::unwrap).collect();
            let least = num_bricks.div_ceil(bricks_per_step.max(1));
            assert_eq!(steps.len(), least, "dial {number}, {bricks_per_step} a step: all are at hand");
            let last = steps.last().unwrap();
            assert!(last.is_last && steps[..least - 1].iter().all(|step| !step.is_last));
            assert!(last.picture.image == expected.image, "dial {number}, {bricks_per_step} a step");
            assert_eq!(
                last.picture.report.work.nodes_by_level.as_ref().unwrap(),
                expected.report.work.nodes_by_level.as_ref().unwrap()
            );
            assert_eq!(bound(last), expected.report.error.unwrap().bound_max.unwrap());
            let sent: usize = steps.iter().map(|step| step.picture.report.work.bricks.unwrap()).sum();
            assert_eq!(sent, num_bricks, "each brick once");
        }
    }
}

/// Whatever comes when: the first picture shows all of the domain, the bound of none is below what it is off, and
/// in the end it is the same picture.
#[test]
fn late_bricks_make_pictures_that_get_better() {
    let grid = head();
    for seed in 0..6 {
        for (number, view) in dials(&session_of(grid.clone())).iter().enumerate() {
            let mut session = session_of(grid.clone());
            let mut finest = view.clone();
            (planes_of(&mut finest).focus, finest.dial) = (None, Dial::Full);
            let truth = session_of(grid.clone()).render(&finest).unwrap().image;
            let expected = session_of(grid.clone()).render(view).unwrap().image;
            let late = Late::new(&grid, seed, 3000);
            let steps = session.progressive(view, Some(&late), 5).unwrap();
            let mut errors = Vec::new();
            let mut bounds = Vec::new();
            let mut last = None;
            for step in steps {
                let step = step.unwrap();
                let measured = largest_difference(&step.picture.image, &truth);
                assert!(measured <= bound(&step), "measured {measured}, bound {}", bound(&step));
                bounds.push(bound(&step));
                errors.push(rmse(&step.picture.image, &truth));
                let shown =
                    |image: &Image| image.pixels.iter().map(|p| *p == image.pixels[0]).collect::<Vec<_>>();
                if !matches!(view.dial, Dial::Error(_)) && errors.len() == 1 {
                    let background = shown(&truth).iter().filter(|is| **is).count();
                    let found = shown(&step.picture.image).iter().filter(|is| **is).count();
                    assert_eq!(found, background, "the first picture has no hole");
                }
                last = Some(step.picture.image);
            }
            assert!(last.unwrap() == expected, "seed {seed}, dial {number}");
            let rises = |values: &[f64]| values.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
            println!(
                "seed {seed}, dial {number}: {} pictures, rmse {:.4} to {:.4}, rises by {:.5} at most; bound {:.3} \
                 to {:.3}, rises by {:.5} at most",
                errors.len(),
                errors[0],
                errors[errors.len() - 1],
                rises(&errors),
                bounds[0],
                bounds[bounds.len() - 1],
                rises(&bounds),
            );
            assert!(errors.len() > 3 && errors[0] > 2.0 * errors[errors.len() - 1]);
            assert!(rises(&errors) <= 0.02 * errors[0], "a picture is worse than the one before: {errors:?}");
            assert!(rises(&bounds) <= 0.0, "a bound rises: {bounds:?}");
        }
    }
}

/// Samples of colour that fall everywhere alike, so that a hole or a seam is a step.
#[test]
fn no_picture_on_the_way_has_a_seam() {
    let mut grid_values = Vec::new();
    let dims = [400, 370, 1];
    for i in 0..dims[0] * dims[1] {
        let [x, y] = [(i % dims[0]) as f64, (i / dims[0]) as f64];
        grid_values.push(((0.21 * x).sin() * (0.17 * y).cos()) as f32);
    }
    let grid = VoxelGrid::new(dims, DVec3::ONE, grid_values).unwrap();
    let mut session = session_of(grid.clone());
    let mut view = session.view(&ViewOptions { width: 700, height: 700, ..ViewOptions::default() });
    planes_of(&mut view).focus = Some(Focus { point: DVec3::new(60.0, 70.0, 0.0), quality: 0.5 });
    let late = Late::new(&grid, 4, 600);
    let mut num_levels = 0;
    for step in session.progressive(&view, Some(&late), 2).unwrap() {
        let step = step.unwrap();
        let image = &step.picture.image;
        let right = image.pixels.chunks(700).flat_map(|row| row.windows(2));
        let right = right.map(|pair| (pair[0][0] - pair[1][0]).abs());
        let inside = |i: usize| image.pixels[i][0] != image.pixels[i + 1][0];
        let background = image.pixels[0][0];
        let steepest = right
            .zip(0..)
            .filter(|&(_, i)| image.pixels[i + i / 699][0] != background && inside(i + i / 699))
            .filter(|&(_, i)| image.pixels[i + i / 699 + 1][0] != background)
            .map(|(step, _)| f64::from(step))
            .fold(0.0, f64::max);
        // A sample is 1.6 pixels; the field rises by 0.21 a sample at most, half of it in grey; coarse levels cut
        // its tops and blend over 30 samples by what they cut.
        let threshold = (0.21 / 2.0 + 0.5 / 30.0) / (700.0 * 0.92 / 399.0) + 1e-4;
        println!(
            "{} nodes: steepest {steepest:.4}, at most {threshold:.4}",
            step.picture.report.work.nodes.unwrap()
        );
        assert!(steepest <= threshold, "{steepest}");
        num_levels = num_levels.max(
            step.picture.report.work.nodes_by_level.as_ref().unwrap().iter().filter(|n| **n > 0).count(),
        );
    }
    assert!(num_levels >= 3, "{num_levels} levels in one picture");
}

#[test]
fn a_focus_sends_less_and_every_dial_keeps_its_promise() {
    let grid = head();
    let views = dials(&session_of(grid.clone()));
    let sent = |view: &View| {
        let picture = session_of(grid.clone()).render(view).unwrap();
        let bound = picture.report.error.unwrap().bound_max.unwrap();
        (picture.report.work.bytes_uploaded, bound, picture.image)
    };
    let (full_bytes, full_bound, full) = sent(&views[0]);
    assert_eq!(full_bound, 0.0);
    for (number, view) in views.iter().enumerate().skip(1) {
        let (bytes, bound, image) = sent(view);
        let measured = largest_difference(&image, &full);
        println!("dial {number}: {bytes} of {full_bytes} bytes, measured {measured:.4}, bound {bound:.4}");
        assert!(bytes < full_bytes && measured <= bound && bound > 0.0);
    }
    // Ends of the dials.
    let mut zero = views[1].clone();
    planes_of(&mut zero).focus.as_mut().unwrap().quality = 0.0;
    assert_eq!(session_of(grid.clone()).render(&zero).unwrap().report.work.nodes.unwrap(), 1);
    for (quality, dial) in [(f64::INFINITY, Dial::Full), (f64::INFINITY, Dial::Error(0.0))] {
        let mut sharp = views[1].clone();
        planes_of(&mut sharp).focus.as_mut().unwrap().quality = quality;
        sharp.dial = dial;
        assert!(sent(&sharp).2 == full, "quality {quality}, {dial:?}");
    }
    let mut zero = views[2].clone();
    zero.dial = Dial::Error(0.0);
    assert!(sent(&zero).2 == full);
}

/// The nearest samples of two levels differ by more than their fields: on a ramp the fields are the same.
#[test]
fn the_nearest_sample_has_a_bound_of_its_own() {
    let grid = volery_data::ramp([121, 121, 121], DVec3::ONE, DVec3::new(1.0, 0.5, 0.2), 3.0);
    let mut session = session_of(grid);
    let mut view = view_of(&session);
    planes_of(&mut view).sampling = Sampling::Nearest;
    let full = session.render(&view).unwrap().image;
    planes_of(&mut view).focus = Some(Focus { point: DVec3::ZERO, quality: 0.5 });
    let coarse = session.render(&view).unwrap();
    let bound = coarse.report.error.unwrap().bound_max.unwrap();
    let measured = largest_difference(&coarse.image, &full);
    println!("nearest: measured {measured:.4}, bound {bound:.4}");
    assert!(measured > 0.001 && measured <= bound);
    planes_of(&mut view).sampling = Sampling::Linear;
    let linear = session.render(&view).unwrap().report.error.unwrap().bound_max.unwrap();
    assert!(linear < 1e-4, "a ramp is the same field on every level: {linear}");
}

#[test]
fn the_cut_of_a_plan_is_balanced_and_blended() {
    let mut session = session_of(head());
    for view in dials(&session) {
        let work = session.render(&view).unwrap().report.work;
        assert!(work.polygons.unwrap() > 0 && work.nodes.unwrap() >= work.polygons.unwrap() / 2);
    }
    // What has no coarser neighbour shows none of its samples.
    let layout = Layout::new([61, 61, 61], DVec3::ONE, Kind::Decimated, CELLS).unwrap();
    let cut = Cut { nodes: layout.level_nodes(0).collect(), skipped: Vec::new() };
    assert!(low_corners(&layout, &cut).iter().all(|&low| low == 0));
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let blank = VoxelGrid::new([2, 2, 2], DVec3::ONE, vec![f64::NAN; 8]).unwrap();
    let opened = Drawer::volume(
        blank,
        open_backend(BackendChoice::Software).unwrap(),
        How::Planes(PlaneView::default()),
    );
    assert!(matches!(opened.err(), Some(VolumeError::Blank)));
    let mut session = session_of(volery_data::marschner_lobb(12));
    let good = view_of(&session);
    let mut fails = |change: &dyn Fn(&mut View)| {
        let mut view = good.clone();
        change(&mut view);
        session.render(&view).err().unwrap()
    };
    assert!(matches!(fails(&|view| planes_of(view).planes.clear()), RenderError::NumPlanes { found: 0 }));
    let many = |view: &mut View| planes_of(view).planes = vec![Plane::through(DVec3::ZERO, DVec3::X); 17];
    assert!(matches!(fails(&many), RenderError::NumPlanes { found: 17 }));
    let none = |view: &mut View| planes_of(view).planes[1].normal = DVec3::ZERO;
    assert!(matches!(fails(&none), RenderError::Plane { index: 1, .. }));
    let focus =
        |point, quality| move |view: &mut View| planes_of(view).focus = Some(Focus { point, quality });
    assert!(matches!(fails(&focus(DVec3::NAN, 1.0)), RenderError::Focus { .. }));
    assert!(matches!(fails(&focus(DVec3::ZERO, f64::NAN)), RenderError::Focus { .. }));
    assert!(matches!(fails(&focus(DVec3::ZERO, -1.0)), RenderError::Focus { .. }));
    assert!(matches!(fails(&|view| view.dial = Dial::Error(1.5)), RenderError::MaxError { found: 1.5 }));
    let mut rays =
        Drawer::volume(head(), open_backend(BackendChoice::Software).unwrap(), How::Raycast).unwrap();
    let view = rays.view(&ViewOptions::default());
    assert!(matches!(rays.progressive(&view, None, 1).err(), Some(RenderError::NotProgressive { .. })));
}
