//! Deadlines: what a picture is whatever the budget. How well budgets are kept is measured, not tested: `docs/deadlines.md`.

use volery::{
    BackendChoice, Deadline, Dial, GridData, How, PlaneView, RenderError, Session, StackView, Thickness,
    View, ViewOptions, VolumeData,
};
use volery_software::SoftwareBackend;
use volery_tests::{at_most, backend, distance, exact};

/// Time for anything, and for nothing.
const ENOUGH_SECS: f64 = 1e4;
const NO_SECS: f64 = 0.0;

fn by(view: &View, budget_secs: f64) -> View {
    View { dial: Dial::Deadline(Deadline { budget_secs, gaze: None }), ..view.clone() }
}

fn options(how: How) -> ViewOptions {
    ViewOptions { width: 200, height: 150, how: Some(how), ..ViewOptions::default() }
}

fn volume() -> Session<VolumeData> {
    Session::new(VolumeData::new(volery_data::marschner_lobb_u8(80)).unwrap())
}

#[test]
fn with_time_enough_a_picture_is_that_of_full_resolution() {
    let mut backend = SoftwareBackend::new();
    let mut session = volume();
    for how in [How::Raycast, How::Planes(PlaneView::default())] {
        let view = session.view(&options(how));
        let full = session.render(&view, &mut backend).unwrap();
        for frame in 0..6 {
            let picture = session.render(&by(&view, ENOUGH_SECS), &mut backend).unwrap();
            let paced = picture.report.frames[0].paced.unwrap();
            let seconds = picture.report.seconds;
            assert!(seconds.select > 0.0 && seconds.upload.is_some() && seconds.draw > 0.0, "{seconds:?}");
            println!("{} {frame}: {paced:?}", view.how.name());
            if frame > 0 {
                assert_eq!(picture.image, full.image, "{} {frame}", view.how.name());
                assert_eq!((paced.rung, paced.rays_per_pixel), (0, 1.0), "{paced:?}");
                assert_eq!(picture.report.error.is_some(), full.report.error.is_some());
            }
        }
    }
    let mut cells = Session::new(GridData::new(volery_data::cylinder(10), None).unwrap());
    let view = cells.view(&options(How::Stack(StackView::default())));
    let full = cells.render(&view, &mut backend).unwrap();
    for frame in 0..6 {
        let picture = cells.render(&by(&view, ENOUGH_SECS), &mut backend).unwrap();
        assert!(frame == 0 || picture.image == full.image, "stack {frame}");
    }
}

#[test]
fn without_time_a_picture_is_whole() {
    for choice in [BackendChoice::Software, BackendChoice::Wgpu] {
        let Some(mut backend) = backend(choice, "without_time_a_picture_is_whole") else { continue };
        let backend = backend.as_mut();
        let mut session = volume();
        for how in [How::Raycast, How::Planes(PlaneView::default())] {
            let view = session.view(&options(how));
            let full = session.render(&view, backend).unwrap();
            let picture = session.render(&by(&view, NO_SECS), backend).unwrap();
            let paced = picture.report.frames[0].paced.unwrap();
            assert!(paced.is_at_floor && paced.rays_per_pixel < 0.1, "{choice:?}: {paced:?}");
            assert_eq!(picture.report.dial.unwrap().budget_ms, Some(0.0));
            // What is known of full resolution is not said of it.
            assert_eq!(picture.report.error, None);
            let name = format!("{choice:?}, {}, at the floor", view.how.name());
            let found = distance(&name, &exact(&picture.image), &exact(&full.image));
            at_most(&name, found.rmse, 0.12);
            assert!(found.max > 0.0, "{name} is coarser than full resolution");
            let again = session.render(&by(&view, NO_SECS), backend).unwrap();
            assert_eq!(again.image, picture.image, "{name}, again");
        }
    }
}

#[test]
fn bricks_come_in_time_or_later() {
    let mut backend = SoftwareBackend::new();
    let grid = volery_data::noise([129, 129, 129], 3);
    let mut session = Session::new(VolumeData::new(grid).unwrap());
    let view = by(&session.view(&options(How::Raycast)), 2e-3);
    let mut rungs = Vec::new();
    while rungs.last() != Some(&0) && rungs.len() < 1000 {
        let report = session.render(&view, &mut backend).unwrap().report;
        rungs.push(report.frames[0].paced.unwrap().rung);
    }
    println!("{rungs:?}");
    assert!(rungs[0] > 0, "not all bricks come within a quarter of 2 ms");
    assert!(rungs.is_sorted_by(|before, after| before >= after), "{rungs:?}");
    assert_eq!(rungs.last(), Some(&0), "in the end all are there");
}

#[test]
fn deadlines_that_are_none_are_refused() {
    let mut backend = SoftwareBackend::new();
    let mut session = volume();
    let view = session.view(&options(How::Raycast));
    for found in [
        Deadline { budget_secs: f64::NAN, gaze: None },
        Deadline { budget_secs: -1.0, gaze: None },
        Deadline { budget_secs: f64::INFINITY, gaze: None },
        Deadline { budget_secs: 1.0, gaze: Some([0.5, 1.5]) },
        Deadline { budget_secs: 1.0, gaze: Some([f64::NAN, 0.5]) },
    ] {
        let view = View { dial: Dial::Deadline(found), ..view.clone() };
        let error = session.render(&view, &mut backend).unwrap_err();
        assert!(matches!(error, RenderError::Deadline { .. }), "{found:?}: {error}");
    }
    let fans = View { how: How::Fans(Thickness::Exact), ..by(&view, 1.0) };
    let error = session.render(&fans, &mut backend).unwrap_err().to_string();
    assert!(error.contains("fans") && error.contains("expected Full or Tolerance"), "{error}");
}
