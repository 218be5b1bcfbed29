//! The bound of a picture against what it bounds: the largest difference from the full resolution.

use std::path::Path;

use volery::glam::DVec3;
use volery::{Dial, Focus, How, Plane, PlaneView, Sampling, View, ViewOptions, VolumeData};
use volery_tests::{Drawer, at_most, data_folder, draw, exact, planes_of};

use super::{ENGINE, MOUSE, MRI, Random, colors, read, software};

/// Largest errors to ask for, in turn.
const ERRORS: [f64; 4] = [0.02, 0.05, 0.1, 0.2];

const NUM_PLANES: usize = 260;

/// Pictures of all volumes that a dial must change, or nothing is tested.
const MIN_CHANGED: usize = 400;

/// The largest difference of any channel of any pixel.
fn largest_difference(session: &mut Drawer<VolumeData>, view: &View) -> (f64, f64) {
    let coarse = draw(session, view);
    let mut full = View { dial: Dial::Full, ..view.clone() };
    (planes_of(&mut full).focus, full.dial) = (None, Dial::Full);
    let full = draw(session, &full);
    let differences = coarse.image.pixels.iter().flatten().zip(full.image.pixels.iter().flatten());
    let measured = differences.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
    assert_eq!(exact(&full.image).width(), view.width);
    let bound = coarse.report.error.and_then(|error| error.bound_max).expect("planes have a bound");
    assert_eq!(full.report.error.and_then(|error| error.bound_max), Some(0.0), "the full resolution itself");
    (measured, bound)
}

/// Straight at a plane.
fn facing(session: &Drawer<VolumeData>, plane: Plane, side: u32) -> View {
    let mut options = ViewOptions { width: side, height: side, ..ViewOptions::default() };
    options.how = Some(How::Planes(PlaneView { planes: vec![plane], ..PlaneView::default() }));
    session.view(&options)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// How far bounds are above what is measured, of the planes that show a difference.
fn ratios(name: &str, data: &Path) -> Vec<f64> {
    let mut session = software(read(data, name));
    let mut random = Random::new(3);
    let extent = session.data().grid().extent();
    let mut ratios: [Vec<f64>; 4] = Default::default();
    let mut worst = f64::INFINITY;
    for number in 0..NUM_PLANES {
        let mut view = facing(&session, random.plane(extent), 256);
        let max_error = ERRORS[number % ERRORS.len()];
        view.dial = Dial::Error(max_error);
        let (measured, bound) = largest_difference(&mut session, &view);
        assert!(measured <= bound, "{name}, plane {number}: measured {measured}, bound {bound}");
        assert!(bound <= max_error, "{name}, plane {number}: bound {bound}, asked for {max_error}");
        if measured > 0.0 {
            ratios[number % ERRORS.len()].push(bound / measured);
            worst = worst.min(bound - measured);
        }
    }
    for (max_error, ratios) in ERRORS.iter().zip(&ratios).filter(|(_, ratios)| !ratios.is_empty()) {
        println!("{name}, E = {max_error}: median bound / measured {:.3}", median(ratios.clone()));
    }
    println!("{name}: the bound is above the measured maximum by at least {worst:.2e}, expected at least 0");
    ratios.concat()
}

/// No pixel of 260 planes through each volume is farther off than the bound, and no bound is above what was asked
/// for. Half of the bounds of each volume are within 3 times the measured maximum.
#[test]
fn real_data_keep_their_bound_and_it_is_tight() {
    let test = "real_data_keep_their_bound_and_it_is_tight";
    let Some(data) = data_folder(test) else { return };
    let mut all = Vec::new();
    for name in [ENGINE, MOUSE, MRI] {
        let of_volume = ratios(name, &data);
        let what = format!("{name}: median bound / measured of {} planes that differ", of_volume.len());
        at_most(&what, median(of_volume.clone()), 3.0);
        all.extend(of_volume);
    }
    assert!(all.len() > MIN_CHANGED, "only {} pictures differ from the full resolution", all.len());
    at_most(&format!("median bound / measured of all {} planes", all.len()), median(all), 3.0);
}

/// Whatever chose the nodes: a focus, a tolerance, several transparent planes, the nearest sample.
#[test]
fn every_picture_keeps_the_bound_that_it_reports() {
    let test = "every_picture_keeps_the_bound_that_it_reports";
    let Some(data) = data_folder(test) else { return };
    let mut random = Random::new(8);
    for name in [ENGINE, MRI] {
        let mut session = software(read(&data, name));
        let extent = session.data().grid().extent();
        let mut closest = f64::INFINITY;
        for number in 0..120 {
            let mut view = facing(&session, random.plane(extent), 128);
            view.transfer =
                if number % 2 == 0 { colors(session.value_range()).into() } else { view.transfer };
            if number % 3 != 0 {
                planes_of(&mut view).planes.push(random.plane(extent));
                planes_of(&mut view).planes.push(Plane::through(random.point(extent), DVec3::X));
            }
            planes_of(&mut view).is_transparent = number % 4 >= 2;
            planes_of(&mut view).sampling = [Sampling::Linear, Sampling::Nearest][number % 5 / 3];
            let quality = [0.0, 0.25, 0.5, 1.0, 2.0][number % 7 % 5];
            let focus = Focus { point: random.point(extent), quality };
            planes_of(&mut view).focus = (number % 6 != 0).then_some(focus);
            view.dial = match (number % 6 == 0 || number % 11 == 0, number % 5 < 2) {
                (true, _) => Dial::Tolerance(random.between(0.01, 0.4)),
                (false, true) => Dial::Error(random.between(0.02, 0.4)),
                (false, false) => Dial::Full,
            };
            let (measured, bound) = largest_difference(&mut session, &view);
            assert!(measured <= bound, "{name}, {number}: measured {measured}, bound {bound}, {view:?}");
            closest = closest.min(bound / measured);
        }
        println!("{name}: bound / measured is {closest:.3} at least, expected at least 1");
    }
}

/// Colours keep it, too.
#[test]
fn colors_keep_their_bound() {
    let mut random = Random::new(21);
    let mut session = software(volery_data::tissue([150, 130, 90]));
    let extent = session.data().grid().extent();
    let mut ratios = Vec::new();
    for number in 0..60 {
        let mut view = facing(&session, random.plane(extent), 128);
        planes_of(&mut view).is_transparent = number % 2 == 0;
        view.dial = Dial::Error(random.between(0.005, 0.2));
        let (measured, bound) = largest_difference(&mut session, &view);
        assert!(measured <= bound, "{number}: measured {measured}, bound {bound}");
        ratios.push(bound / measured);
    }
    at_most("tissue: median bound / measured", median(ratios), 2.0);
}
