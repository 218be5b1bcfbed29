//! Kinds of scenes in which a picture was wrong in silence. Each is within .01 of the truth, .001 in the mean square.

use glam::DVec3;
use volery::{BackendChoice, Camera, How, Projection, TransferFunction};
use volery_reference::Tracer;
use volery_scene::{Samples, VoxelGrid};
use volery_tests::{Drawer, Shared, at_most, backend, distance, draw, exact, matter_view, values_of};

use super::{BACKGROUND, aslant, fill, noise, shell, transfer, wave};

by_both_backends! {
    one_voxel_far_above_the_others
    two_odd_voxels_that_widen_sixteen_bits
    padding_of_ct
    a_comb_of_two_hundred_bands
    shells_thinner_than_a_step_of_bytes
    a_dense_thin_shell
    dense_matter_of_many_colours
    a_step_into_opaque_matter
    two_neighbouring_values_of_sixteen_bits
    rays_in_the_faces_of_the_domain
    values_far_from_zero
    blanks_in_a_bent_field
}

const SIZE: [u32; 2] = [48, 48];

/// What no picture here may miss by more, and its root of the mean square.
const MAX: f64 = 0.01;
const RMSE: f64 = 0.001;

/// Draws volumes with one backend and holds them against the truth.
struct Judge {
    test: String,
    backend: Shared,
}

impl Judge {
    /// `None` if the test is ignored.
    fn new(choice: BackendChoice, test: &str) -> Option<Self> {
        Some(Self { test: test.to_owned(), backend: Shared::new(backend(choice, test)?) })
    }

    /// The picture from aslant of a volume with samples 1 apart.
    fn judge(&self, what: &str, dims: [usize; 3], samples: impl Into<Samples>, transfer: TransferFunction) {
        let grid = VoxelGrid::new(dims, DVec3::ONE, samples).unwrap();
        let camera = aslant(grid.extent());
        self.judge_from(what, &grid, camera, transfer, SIZE);
    }

    fn judge_from(
        &self,
        what: &str,
        grid: &VoxelGrid,
        camera: Camera,
        transfer: TransferFunction,
        size: [u32; 2],
    ) {
        let backend = Box::new(self.backend.clone());
        let mut session = Drawer::volume(grid.clone(), backend, How::Raycast).unwrap();
        let view = matter_view(camera, transfer, BACKGROUND, size);
        let drawn = exact(&draw(&mut session, &view).image);
        let tracer = Tracer::new(grid, values_of(&view)).unwrap().with_tolerance(1e-9);
        let truth = tracer.render(&camera, BACKGROUND, size[0], size[1], &|_| {}).unwrap();
        let shown = truth.pixels().iter().filter(|&&pixel| pixel != BACKGROUND).count();
        assert!(shown > truth.pixels().len() / 10, "{what}: matter in {shown} pixels only");
        let what = format!("{}, {what}", self.test);
        let found = distance(&what, &drawn, &truth);
        at_most("largest difference", found.max, MAX);
        at_most("rmse", found.rmse, RMSE);
    }
}

/// Cells beside blank ones, so bent that they are read in more pieces than two, and cells without any bend.
fn blanks_in_a_bent_field(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [23, 25, 21];
    let colors = transfer(&[(0.0, 0.0), (0.3, 0.2), (0.6, 0.05), (1.0, 0.5)], 1.0);
    for (what, bend) in [("smooth", 0.0), ("rough", 0.5)] {
        let mut samples = fill(dims, |p| ((1.0 - bend) * wave(p) + bend * noise(p)) as f32);
        for place in (0..samples.len()).filter(|place| volery_data::hash(*place as u64).is_multiple_of(29)) {
            samples[place] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][place % 3];
        }
        judge.judge(what, dims, samples, colors.clone());
    }
}

fn one_voxel_far_above_the_others(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [32, 30, 28];
    for high in [1e3, 1e6, 1e20] {
        let mut samples = fill(dims, |p| wave(p) as f32);
        samples[(14 * dims[1] + 11) * dims[0] + 17] = high;
        let transfer = transfer(&[(0.0, 0.0), (0.4, 0.02), (1.0, 0.3)], 1.0);
        judge.judge(&format!("one of {high:e}"), dims, samples, transfer);
    }
}

fn two_odd_voxels_that_widen_sixteen_bits(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [27, 14, 29];
    let mut samples = fill(dims, |p| (80.0 * wave(p) - 40.0).round() as i16);
    samples[1234] = i16::MIN;
    samples[7000] = i16::MAX;
    let transfer = transfer(&[(-30.0, 0.0), (0.0, 0.05), (40.0, 0.3), (60.0, 0.0)], 1.0);
    judge.judge("a window of soft tissue", dims, samples, transfer);
}

fn padding_of_ct(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [40; 3];
    let middle = DVec3::splat(19.5);
    for padding in [-1024, -3024, i16::MIN] {
        // A head: air, a shell of bone, tissue of 0 to 120; nothing but padding beside the round field of view.
        let samples = fill(dims, |p| {
            let at = DVec3::from_array(p.map(|i| i as f64)) - middle;
            match at.length() {
                _ if at.truncate().length() > 19.0 => padding,
                r if r < 14.0 => (120.0 * wave(p)).round() as i16,
                r if r < 16.0 => 700,
                _ => -1000,
            }
        });
        let windows = [(0.0, 0.0), (20.0, 0.0), (40.0, 0.08), (60.0, 0.0), (80.0, 0.1), (120.0, 0.0)];
        judge.judge(&format!("padding {padding}"), dims, samples, transfer(&windows, 1.0));
    }
}

fn a_comb_of_two_hundred_bands(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [37, 32, 36];
    let band = |i: u32| {
        let (start, opacity) = (f64::from(i) / 200.0, if i.is_multiple_of(2) { 0.999 } else { 0.001 });
        [(start, opacity), (start + 0.004, opacity)]
    };
    let comb: Vec<(f64, f64)> = (0..200).flat_map(band).collect();
    judge.judge("200 bands", dims, fill(dims, wave), transfer(&comb, 1.0));
}

fn shells_thinner_than_a_step_of_bytes(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [31, 12, 38];
    let bytes = || fill(dims, |p| (255.0 * wave(p)).round() as u8);
    let middle = 148.139_368_5;
    let tent = [(middle - 0.1, 0.0), (middle, 0.99), (middle + 0.1, 0.0)];
    judge.judge("opacity .99, half width .1", dims, bytes(), transfer(&tent, 1.0));
    for half_width in [0.1, 0.01] {
        let opaque = shell(middle - half_width, middle + half_width, 1.0, 1.0);
        judge.judge(&format!("opacity 1, half width {half_width}"), dims, bytes(), opaque);
    }
}

fn a_dense_thin_shell(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [30, 29, 33];
    // Extinction 6931 per cell; a ray straight through the shell meets a tenth of a cell of it.
    let dense = shell(0.343_629_66, 0.353_629_66, 0.5, 1e-4);
    judge.judge("width .01, extinction 7e3", dims, fill(dims, wave), dense);
}

fn dense_matter_of_many_colours(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [25, 11, 39];
    let ramp = || transfer(&[(0.0, 0.1), (0.3, 0.6), (0.6, 0.4), (1.0, 0.7)], 1e-4);
    judge.judge("smooth", dims, fill(dims, wave), ramp());
    judge.judge("noise", dims, fill(dims, |p| noise(p) as f32), ramp());
}

fn a_step_into_opaque_matter(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [34, 12, 22];
    let step = 0.596_493_713_877_6;
    let opaque = transfer(&[(0.0, 0.0), (step, 0.0), (step, 1.0), (1.0, 1.0)], 1.0);
    judge.judge("smooth f64", dims, fill(dims, wave), opaque);
}

fn two_neighbouring_values_of_sixteen_bits(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [16, 30, 30];
    let mask = fill(dims, |p| 65_000 + u16::from(wave(p) > 0.5));
    let transfer = transfer(&[(65_000.0, 0.0), (65_000.5, 0.3), (65_001.0, 0.05)], 1.0);
    judge.judge("65000 and 65001", dims, mask, transfer);
}

fn rays_in_the_faces_of_the_domain(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [9, 6, 7];
    let grid = VoxelGrid::new(dims, DVec3::new(1.0, 0.5, 2.0), fill(dims, |p| noise(p) as f32)).unwrap();
    let ramp = || transfer(&[(0.0, 0.1), (1.0, 0.3)], 1.0);
    for (forward, up) in [(0, 2), (1, 0), (2, 1)] {
        for (sign, mirror) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)] {
            // Half a unit from pixel to pixel, with rays at 0 and at the last sample along both axes.
            let size = [25, 25];
            let eye = grid.extent().floor() / 2.0 - DVec3::AXES[forward] * sign * 32.0;
            let camera = Camera {
                eye,
                target: eye + DVec3::AXES[forward] * sign,
                up: DVec3::AXES[up] * mirror,
                projection: Projection::Orthographic { height: 12.5 },
                is_mirrored: false,
            };
            judge.judge_from(&format!("along axis {forward} x {sign}"), &grid, camera, ramp(), size);
        }
    }
}

fn values_far_from_zero(choice: BackendChoice, test: &str) {
    let Some(judge) = Judge::new(choice, test) else { return };
    let dims = [16, 15, 14];
    let ramp = |offset: f64, range: f64| {
        let at = |part: f64| offset + part * range;
        transfer(&[(at(0.1), 0.0), (at(0.5), 0.1), (at(0.995), 0.4)], 1.0)
    };
    let words = fill(dims, |p| 4_000_000_000 + (200.0 * noise(p)) as u32);
    judge.judge("u32 4e9 + [0, 200]", dims, words, ramp(4e9, 200.0));
    judge.judge("f32 1e6 + [0, 1]", dims, fill(dims, |p| (1e6 + wave(p)) as f32), ramp(1e6, 1.0));
    judge.judge("f64 1e6 + [0, .01]", dims, fill(dims, |p| 1e6 + 0.01 * noise(p)), ramp(1e6, 0.01));
}
