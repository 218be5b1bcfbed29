//! Budgets of device memory: kept at every moment, never spent for a worse picture, refused where nothing fits.

use std::sync::{Arc, Mutex};

use volery::fit::Direction;
use volery::glam::DVec3;
use volery::{
    Backend, BackendChoice, ControlPoint, Dial, How, Interest, Picture, PlaneView, Region, RenderError,
    Thickness, TransferFunction, View, ViewOptions, VoxelGrid,
};
use volery_frame::{Brick, BrickId, UploadError, VolumeLayout};
use volery_tests::{
    Drawer, at_most, backend, data_folder, distance, draw, exact, read_scene, smooth, view_of,
};

/// The most bytes that a backend ever held, with texels on their way to it; since it was last asked.
#[derive(Clone, Default)]
struct Peak(Arc<Mutex<u64>>);

impl Peak {
    fn see(&self, bytes: u64) {
        let mut most = self.0.lock().unwrap();
        *most = bytes.max(*most);
    }

    fn take(&self) -> u64 {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

/// Looks at every change of what a backend holds.
struct Watched {
    backend: Box<dyn Backend>,
    peak: Peak,
}

impl Backend for Watched {
    volery_conformance::hand_on!(self, self.backend => device volume is_resident resident_bytes brick_bytes room
        uploaded_bytes begin begin_windows draw_windows draw_part finished wait finish);

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let done = self.backend.set_volume(layout);
        self.peak.see(self.resident_bytes());
        done
    }

    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        let bytes = |brick: &Brick<'_>| (brick.texels.len() * brick.texels.texel_type().bytes()) as u64;
        let on_the_way: u64 = bricks.iter().map(bytes).sum();
        let done = self.backend.upload(bricks);
        self.peak.see(self.resident_bytes() + on_the_way);
        done
    }

    fn evict(&mut self, bricks: &[BrickId]) {
        self.backend.evict(bricks);
    }

    fn reserve(&mut self, num_bricks: usize, max_bytes: u64) -> Result<(), UploadError> {
        let done = self.backend.reserve(num_bricks, max_bytes);
        self.peak.see(self.resident_bytes());
        done
    }
}

/// Matter in a band of values, which hides some of what is behind.
fn band() -> TransferFunction {
    let point = |value: f64, opacity: f64| ControlPoint { value, color: [0.9, value, 0.2], opacity };
    let points = vec![point(0.0, 0.0), point(0.45, 0.0), point(0.6, 0.5), point(0.75, 0.1), point(1.0, 0.9)];
    TransferFunction::new(points, 1.0).unwrap()
}

fn from(session: &Drawer<volery::VolumeData>, azimuth_deg: f64) -> View {
    let direction = Direction { azimuth_deg, elevation_deg: 20.0, zoom: 1.0 };
    let options = ViewOptions {
        width: 72,
        height: 64,
        direction: Some(direction),
        transfer: Some(band().into()),
        ..ViewOptions::default()
    };
    session.view(&options)
}

fn within(view: &View, bytes: u64) -> View {
    View { dial: Dial::Memory(bytes), ..view.clone() }
}

fn predicted(picture: &Picture) -> f64 {
    picture.report.error.as_ref().and_then(|error| error.predicted_rmse).expect("a budget predicts an error")
}

/// A volume of some levels, and of no power of two.
fn volume() -> VoxelGrid {
    smooth(140)
}

/// The bytes that the coarsest cut takes.
fn least(session: &mut Drawer<volery::VolumeData>, view: &View) -> u64 {
    match session.render(&within(view, 0)) {
        Err(RenderError::Memory { found: 0, least }) => least,
        other => panic!("{other:?}, expected a budget that is too small"),
    }
}

by_both_backends! {
    no_moment_of_loading_takes_more_than_the_budget
    more_memory_is_never_predicted_to_be_worse
    a_budget_above_the_volume_is_the_full_resolution_bit_for_bit
    budgets_below_the_coarsest_cut_are_refused_with_what_would_do
}

fn no_moment_of_loading_takes_more_than_the_budget(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let peak = Peak::default();
    let backend = Box::new(Watched { backend, peak: peak.clone() });
    let mut session = Drawer::volume(volume(), backend, How::Raycast).unwrap();
    let view = from(&session, 30.0);
    let full = draw(&mut session, &view).report.work.bytes_resident;
    let least = least(&mut session, &view);
    assert!(least < full / 16, "{least} of {full} bytes: there is something to choose");
    let mut held_less = 0;
    // Budgets that shrink and grow, from other sides, after what took more.
    for (step, share) in [1.0, 0.5, 0.25, 0.3, 0.1, 0.02, 0.6, 0.05, 0.9].into_iter().enumerate() {
        let budget = least.max((full as f64 * share) as u64);
        let from = from(&session, 30.0 * step as f64);
        peak.take();
        let picture = draw(&mut session, &within(&from, budget));
        let (work, peak) = (&picture.report.work, peak.take());
        let bricks = (work.bricks, work.nodes);
        println!("{test}: {budget} bytes: peak {peak}, {} resident, {bricks:?} bricks", work.bytes_resident);
        assert!(work.bytes_resident <= budget && peak <= budget, "{peak} of {budget} bytes");
        assert_eq!(picture.report.dial.unwrap().memory, Some(budget));
        held_less += usize::from(picture.report.work.nodes_by_level.as_ref().unwrap().len() > 1);
        if step == 2 {
            let again = draw(&mut session, &within(&from, budget)).report.work;
            assert_eq!(again.bytes_uploaded, 0, "what the last frame had stays");
        }
    }
    assert!(held_less >= 5, "{held_less} pictures with coarse nodes");
}

fn more_memory_is_never_predicted_to_be_worse(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let mut session = Drawer::volume(volume(), backend, How::Raycast).unwrap();
    let view = from(&session, 75.0);
    let full_picture = draw(&mut session, &view);
    let full = full_picture.report.work.bytes_resident;
    let least = least(&mut session, &view);
    let truth = exact(&full_picture.image);
    let (mut last, mut measured) = (f64::INFINITY, Vec::new());
    for step in 0..=24_u32 {
        let budget = least + ((full - least) as f64 * f64::from(step) / 22.0) as u64;
        let picture = draw(&mut session, &within(&view, budget));
        let error = predicted(&picture);
        assert!(error <= last, "{budget} bytes: {error} predicted after {last}");
        last = error;
        let found = distance(
            &format!("{test}: {budget} bytes, {error:.5} predicted"),
            &exact(&picture.image),
            &truth,
        );
        measured.push((error, found.rmse));
    }
    assert_eq!(last, 0.0, "all fits");
    assert!(measured[0].1 > 10.0 * measured[20].1, "the picture follows");
    // What is predicted is of the size of what is measured, where that is more than rounding.
    for (predicted, found) in measured.into_iter().filter(|(_, found)| *found > 2e-3) {
        assert!((0.1..=10.0).contains(&(predicted / found)), "{predicted} predicted, {found} found");
    }
}

fn a_budget_above_the_volume_is_the_full_resolution_bit_for_bit(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let mut session = Drawer::volume(volume(), backend, How::Raycast).unwrap();
    let view = from(&session, -20.0);
    let full = draw(&mut session, &view);
    for budget in [u64::MAX, 1 << 40] {
        let picture = draw(&mut session, &within(&view, budget));
        assert_eq!(picture.image, full.image);
        assert_eq!(predicted(&picture), 0.0);
    }
}

fn budgets_below_the_coarsest_cut_are_refused_with_what_would_do(choice: BackendChoice, test: &str) {
    let Some(backend) = backend(choice, test) else { return };
    let mut session = Drawer::volume(volume(), backend, How::Raycast).unwrap();
    let view = from(&session, 10.0);
    let least = least(&mut session, &view);
    match session.render(&within(&view, least - 1)) {
        Err(error @ RenderError::Memory { .. }) => {
            assert_eq!(
                error.to_string(),
                format!(
                    "memory is {} bytes, expected at least {least}: the coarsest cut of this view takes that many",
                    least - 1
                )
            );
        }
        other => panic!("{other:?}, expected a budget that is too small"),
    }
    let coarsest = draw(&mut session, &within(&view, least));
    assert!(coarsest.report.work.bytes_resident <= least);
    assert_eq!(coarsest.report.work.nodes, Some(1), "the root");
    // Nothing to be seen takes nothing.
    let clear = TransferFunction::new(vec![ControlPoint { value: 0.0, color: [1.0; 3], opacity: 0.0 }], 1.0);
    let clear = View { transfer: clear.unwrap().into(), ..within(&view, 0) };
    assert_eq!(draw(&mut session, &clear).report.work.nodes, Some(0));
}

#[test]
fn techniques_that_choose_no_cut_by_bytes_refuse_a_budget() {
    let grid = smooth(20);
    let mut session =
        Drawer::volume(grid, backend(BackendChoice::Software, "").unwrap(), How::Raycast).unwrap();
    for how in [How::Planes(PlaneView::default()), How::Fans(Thickness::Exact)] {
        let view = session.view(&ViewOptions { how: Some(how), ..ViewOptions::default() });
        let error = session.render(&within(&view, 1 << 30)).unwrap_err();
        assert!(matches!(error, RenderError::Dial { dial: Dial::Memory(_), .. }), "{error}");
    }
}

/// Every second sample along each axis, or every fourth.
fn subsampled(grid: &VoxelGrid, step: usize) -> VoxelGrid {
    let dims = grid.dims().map(|n| (n - 1) / step + 1);
    let value =
        |[x, y, z]: [usize; 3]| grid.samples().value(grid.index([x * step, y * step, z * step]), 0) as u8;
    VoxelGrid::new(dims, grid.spacing() * step as f64, volery_data::fill(dims, value)).unwrap()
}

/// At 30 % of the bytes of all samples, and in as many bytes as every second and every fourth sample take.
///
/// The aim is .004. Heptane is far below; engine, all of whose visible bricks have both matter and air, is not: bricks of this
/// size follow no surface (`docs/memory.md`).
fn in_a_part_of_its_bytes(scene: &str, max_rmse: f64, least_gains: [f64; 2]) {
    let test = format!("memory::{scene}_in_a_part_of_its_bytes");
    let Some(data) = data_folder(&test) else { return };
    let input = read_scene(&data, scene);
    let grid = &input.volume().unwrap().grid;
    let view = view_of(&input);
    let software = || backend(BackendChoice::Software, &test).unwrap();
    let mut session = Drawer::volume(grid.clone(), software(), How::Raycast).unwrap();
    let full = exact(&draw(&mut session, &view).image);
    let mut rmse = |bytes: u64| {
        let picture = draw(&mut session, &within(&view, bytes));
        assert!(picture.report.work.bytes_resident <= bytes);
        let nodes = picture.report.work.nodes_by_level.clone();
        let what = format!("{scene} in {bytes} bytes, {:.5} predicted, {nodes:?}", predicted(&picture));
        distance(&what, &exact(&picture.image), &full).rmse
    };
    at_most("rmse at 30 % of the bytes", rmse((0.3 * grid.num_samples() as f64) as u64), max_rmse);
    for (step, least_gain) in [2, 4].into_iter().zip(least_gains) {
        let mut coarse = Drawer::volume(subsampled(grid, step), software(), How::Raycast).unwrap();
        let picture = draw(&mut coarse, &view);
        // And a brick on its way, which nobody counts there, and what samples take that stand for the ends of axes.
        let bytes = (picture.report.work.bytes_resident as f64 * 1.05) as u64 + 40_000;
        let uniform = distance(&format!("every {step}. sample"), &exact(&picture.image), &full).rmse;
        let gain = uniform / rmse(bytes);
        println!("every {step}. sample is {gain:.2} times as wrong, at least {least_gain}");
        assert!(gain >= least_gain);
    }
}

#[test]
fn engine_in_a_part_of_its_bytes() {
    in_a_part_of_its_bytes("engine", 0.018, [0.9, 0.9]);
}

#[test]
fn heptane_in_a_part_of_its_bytes() {
    in_a_part_of_its_bytes("heptane", 0.001, [1.4, 0.9]);
}

/// Mean square difference of the columns of a picture in a range.
fn mean_square(picture: &Picture, full: &Picture, columns: std::ops::Range<usize>) -> f64 {
    let width = full.image.width as usize;
    let pairs = picture.image.pixels.iter().zip(&full.image.pixels).enumerate();
    let inside = pairs.filter(|(place, _)| columns.contains(&(place % width)));
    let square = |a: &[f32; 3], b: &[f32; 3]| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    inside.map(|(_, (a, b))| square(a, b)).sum()
}

/// Seen along y, the half of low x is the left half of the picture.
#[test]
fn a_region_of_interest_is_held_better_than_without_and_the_rest_worse() {
    let software = backend(BackendChoice::Software, "interest").unwrap();
    let mut session = Drawer::volume(volume(), software, How::Raycast).unwrap();
    let direction = Some(Direction { azimuth_deg: 0.0, elevation_deg: 0.0, zoom: 1.0 });
    let transfer = Some(band().into());
    let (width, height, orthographic) = (72, 72, true);
    let options = ViewOptions { width, height, direction, transfer, orthographic, ..ViewOptions::default() };
    let view = session.view(&options);
    let full = draw(&mut session, &view);
    let budget = (full.report.work.bytes_resident as f64 * 0.4) as u64;
    let extent = session.extent();
    let left = Region::Box { low: DVec3::ZERO, high: extent * DVec3::new(0.4, 1.0, 1.0) };
    let of = |session: &mut Drawer<volery::VolumeData>, interest: &[Interest]| {
        let picture = draw(session, &View { interest: interest.into(), ..within(&view, budget) });
        assert!(picture.report.work.bytes_resident <= budget);
        [mean_square(&picture, &full, 0..28), mean_square(&picture, &full, 40..72)]
    };
    let [plain, much, none] = [None, Some(16.0), Some(0.0)]
        .map(|weight| weight.map(|weight| Interest { region: left, weight }))
        .map(|interest| of(&mut session, interest.as_slice()));
    println!("left and right: {plain:?} plain, {much:?} with a weight of 16, {none:?} with 0");
    assert!(much[0] < 0.9 * plain[0] && much[1] > 2.0 * plain[1]);
    assert!(none[0] > 2.0 * plain[0] && none[1] < 0.5 * plain[1]);
}

/// Regions that are none, weights that are none, and a dial that does not read them.
#[test]
fn regions_that_are_none_are_refused() {
    let software = backend(BackendChoice::Software, "interest").unwrap();
    let mut session = Drawer::volume(smooth(20), software, How::Raycast).unwrap();
    let view = session.view(&ViewOptions { width: 20, height: 20, ..ViewOptions::default() });
    let of_box = |low: f64, high: f64| Region::Box { low: DVec3::splat(low), high: DVec3::splat(high) };
    let of_sphere = |radius: f64| Region::Sphere { center: DVec3::ONE, radius };
    for (region, weight) in [
        (of_box(1.0, 0.0), 1.0),
        (of_box(0.0, f64::INFINITY), 1.0),
        (of_box(f64::NAN, 1.0), 1.0),
        (of_sphere(0.0), 1.0),
        (of_sphere(f64::NAN), 1.0),
        (of_sphere(1.0), -1.0),
        (of_sphere(1.0), f64::INFINITY),
    ] {
        let interest = [Interest { region, weight }].into();
        let error = session.render(&View { interest, ..within(&view, 1 << 30) }).unwrap_err();
        assert!(matches!(error, RenderError::Interest { .. }), "{error}");
    }
    let interest = [Interest { region: of_sphere(1.0), weight: 2.0 }].into();
    let error = session.render(&View { interest, ..view }).unwrap_err();
    assert!(matches!(error, RenderError::Interest { dial: Dial::Full, .. }), "{error}");
}
