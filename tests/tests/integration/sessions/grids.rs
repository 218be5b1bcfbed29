//! Sessions of grids: what is sliced again, what a time step does, how far pictures are from the truth.

use std::sync::Arc;
use volery_tests::{Drawer, stack_of, values_of, with_stack};

use volery::fit::Direction;
use volery::glam::DVec3;
use volery::{
    Backend, BackendChoice, CellType, Cells, ControlPoint, GridData, GridError, How, Image, Preset,
    RenderError, Slicing, StackError, StackView, StepChange, Transfer, TransferFunction, TransferFunction2d,
    UnstructuredGrid, VerifyError, View, ViewOptions, open_backend,
};
use volery_scene::transfer2d::{Palette, Sliders};

fn software() -> Box<dyn Backend> {
    open_backend(BackendChoice::Software).unwrap()
}

fn session_of(grid: impl Into<Arc<UnstructuredGrid>>) -> Drawer<GridData> {
    Drawer::grid(grid, None, software()).unwrap()
}

fn options(azimuth_deg: f64, orthographic: bool) -> ViewOptions {
    let direction = Some(Direction { azimuth_deg, elevation_deg: 20.0, zoom: 1.0 });
    ViewOptions { width: 80, height: 64, direction, orthographic, ..ViewOptions::default() }
}

fn sliced(view: &View, num_slices: usize) -> View {
    with_stack(view, |stack| stack.num_slices = num_slices)
}

fn bits(image: &Image) -> Vec<[u32; 3]> {
    image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// The cells of the generated grid with other values, of each point.
fn with_values(value: impl Fn(DVec3) -> f64) -> UnstructuredGrid {
    let cylinder = volery_data::cylinder(4);
    let values: Vec<f64> = cylinder.points().iter().map(|&point| value(point)).collect();
    UnstructuredGrid::new(cylinder.points().to_vec(), cylinder.cells().clone())
        .unwrap()
        .with_array("f", values)
        .unwrap()
}

/// Haze between two values, per world length of 1.
fn transfer(low: f64, high: f64) -> TransferFunction {
    let point = |value, color, opacity| ControlPoint { value, color, opacity };
    let points = vec![
        point(low, [0.1, 0.2, 0.9], 0.0),
        point((low + high) / 2.0, [0.9, 0.8, 0.1], 0.9),
        point(high, [0.9, 0.1, 0.1], 0.3),
    ];
    TransferFunction::new(points, 1.0).unwrap()
}

fn rmse(session: &mut Drawer<GridData>, view: &View) -> f64 {
    let mut picture = session.render(view).unwrap();
    session.verify(view, &mut picture, &|_| ()).unwrap();
    picture.report.error.unwrap().measured.unwrap().measured_rmse
}

fn difference(a: &Image, b: &Image) -> f64 {
    let pairs = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    let sum: f64 = pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / (3 * a.pixels.len()) as f64).sqrt()
}

#[test]
fn the_error_falls_at_second_order_with_the_number_of_slices() {
    // Linear in every cell, so that nothing but the distance of slices makes an error.
    let mut session = session_of(with_values(|point| point.dot(DVec3::new(0.6, 0.3, 0.5))));
    let [low, high] = session.value_range();
    for orthographic in [false, true] {
        for slicing in [Slicing::Immediate, Slicing::Axes] {
            let transfer = Some(transfer(low, high).into());
            let mut view = session.view(&ViewOptions { transfer, ..options(35.0, orthographic) });
            stack_of(&mut view).slicing = slicing;
            let errors = [16, 32, 64, 128].map(|slices| rmse(&mut session, &sliced(&view, slices)));
            println!("{slicing:?}, orthographic {orthographic}: rmse {errors:?}");
            for pair in errors.windows(2) {
                assert!(
                    pair[0] / pair[1] > 3.0,
                    "{slicing:?}: {errors:?}, expected a fall by 4, at least by 3"
                );
            }
            assert!(errors[3] < 2e-5, "{slicing:?}: {errors:?}, expected the last below 2e-5");
        }
    }
}

#[test]
fn axes_and_immediate_show_the_same() {
    let mut session = session_of(volery_data::cylinder(6));
    for (azimuth, orthographic) in [(10.0, false), (45.0, false), (100.0, true), (225.0, false)] {
        let immediate = session.view(&options(azimuth, orthographic));
        let mut axes = immediate.clone();
        stack_of(&mut axes).slicing = Slicing::Axes;
        let found = [immediate, axes].map(|view| session.render(&view).unwrap().image);
        let rmse = difference(&found[0], &found[1]);
        println!("{azimuth}, orthographic {orthographic}: rmse {rmse:.6}, at most 0.001");
        assert!(rmse < 0.001, "{azimuth}: rmse {rmse}, expected below 0.001");
    }
}

#[test]
fn the_truth_is_near_for_every_type_of_cell() {
    let mut session = session_of(volery_data::cylinder(8));
    for adaptive in [None, Some(1.0)] {
        let mut view = session.view(&options(35.0, false));
        stack_of(&mut view).adaptive = adaptive;
        let found = rmse(&mut session, &view);
        println!("adaptive {adaptive:?}: rmse {found:.6}, at most 0.001");
        assert!(found < 0.001, "adaptive {adaptive:?}: rmse {found}, expected below 0.001");
    }
}

#[test]
fn opacity_does_not_depend_on_the_number_of_slices() {
    let mut session = session_of(with_values(|_| 1.0));
    let point = |opacity| ControlPoint { value: 1.0, color: [1.0; 3], opacity };
    let transfer = TransferFunction::new(vec![point(0.4)], 0.5).unwrap();
    let view = session.view(&ViewOptions { transfer: Some(transfer.into()), ..options(35.0, false) });
    let truth = session.render(&sliced(&view, 2000)).unwrap().image;
    for slices in [50, 100, 150, 200, 250] {
        let found = session.render(&sliced(&view, slices)).unwrap().image;
        let [mean, expected] = [&found, &truth].map(|image| {
            image.pixels.as_flattened().iter().map(|&c| f64::from(c)).sum::<f64>()
                / image.pixels.len() as f64
                / 3.0
        });
        println!("{slices} slices: mean {mean:.6}, expected {expected:.6} +- 0.00001");
        assert!((mean - expected).abs() < 1e-5, "{slices} slices: mean {mean}, expected {expected}");
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let grid = Arc::new(volery_data::cylinder(6));
    let pictures = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut session = session_of(grid.clone());
            let mut view = session.view(&options(35.0, false));
            let immediate = session.render(&view).unwrap().image;
            stack_of(&mut view).adaptive = Some(1.0);
            stack_of(&mut view).num_slices = 32;
            let adaptive = session.render(&view).unwrap().image;
            [bits(&immediate), bits(&adaptive)]
        })
    });
    assert!(pictures[0] == pictures[1] && pictures[0] == pictures[2]);
}

#[test]
fn a_time_step_is_a_new_session_bit_for_bit() {
    let step = |time: f64| with_values(|point| (3.0 * point.x + time).sin() + point.z);
    for slicing in [Slicing::Immediate, Slicing::Axes] {
        let mut session = session_of(step(0.0));
        let mut view = session.view(&options(35.0, false));
        stack_of(&mut view).slicing = slicing;
        let first = session.render(&view).unwrap();
        assert!(first.report.work.bytes_uploaded > 0);
        assert_eq!(session.render(&view).unwrap().report.work.bytes_uploaded, 0, "nothing is new");
        for time in [0.7, 2.0] {
            assert_eq!(session.data_mut().set_step(step(time)), Ok(StepChange::Values));
            let found = session.render(&view).unwrap().image;
            let mut fresh = session_of(step(time));
            assert_eq!(session.value_range(), fresh.value_range());
            let expected = fresh.render(&view).unwrap().image;
            assert!(bits(&found) == bits(&expected), "{slicing:?} at {time}");
            assert!(bits(&found) != bits(&first.image), "another time looks different");
        }
    }
}

#[test]
fn a_time_step_with_other_cells_or_holes_is_sliced_anew() {
    let field = |point: DVec3| point.x + point.z;
    let hole = |point: DVec3| if point.x > 0.5 { f64::NAN } else { field(point) };
    let mut session = session_of(with_values(field));
    let view = session.view(&options(35.0, false));
    session.render(&view).unwrap();
    let other = volery_data::cylinder(2);
    let values: Vec<f64> = other.points().iter().map(|&point| field(point)).collect();
    let other = UnstructuredGrid::new(other.points().to_vec(), other.cells().clone()).unwrap();
    for grid in [with_values(hole), other.with_array("f", values).unwrap(), with_values(field)] {
        let grid = Arc::new(grid);
        assert_eq!(session.data_mut().set_step(grid.clone()), Ok(StepChange::Cells));
        let expected = session_of(grid).render(&view).unwrap().image;
        assert!(bits(&session.render(&view).unwrap().image) == bits(&expected));
    }
    let before = session.render(&view).unwrap().image;
    assert!(matches!(
        session.data_mut().set_values(vec![1.0f32; 3]),
        Err(GridError::NumValues { found: 3, .. })
    ));
    assert_eq!(session.data_mut().set_step(with_values(|_| f64::NAN)), Err(GridError::Blank));
    assert!(bits(&session.render(&view).unwrap().image) == bits(&before), "an error changes nothing");
}

#[test]
fn cells_around_values_that_are_none_are_blank() {
    let field = |point: DVec3| point.x + point.z;
    let is_hole = |point: DVec3| point.y > 0.6;
    let grid = with_values(field);
    let is_blank = |nodes: &[u32]| nodes.iter().any(|&node| is_hole(grid.points()[node as usize]));
    let flags: Vec<bool> = grid.cells().iter().map(|(_, nodes)| is_blank(nodes)).collect();
    assert!(flags.iter().any(|&blank| blank) && !flags.iter().all(|&blank| blank));
    let mut marked = session_of(grid.with_blank(flags).unwrap());
    let mut holed =
        session_of(with_values(|point| if is_hole(point) { f64::INFINITY } else { field(point) }));
    let view = marked.view(&options(35.0, false));
    assert_eq!(view, holed.view(&options(35.0, false)));
    assert_eq!(marked.value_range(), holed.value_range());
    let [a, b] = [&mut marked, &mut holed].map(|session| session.render(&view).unwrap().image);
    assert!(bits(&a) == bits(&b));
}

#[test]
fn the_report_says_what_there_was_to_do() {
    let mut session = session_of(volery_data::cylinder(4));
    let view = sliced(&session.view(&options(35.0, false)), 100);
    let picture = session.render_frames(&view, 3).unwrap();
    let report = &picture.report;
    assert_eq!((report.input.kind, report.technique, report.input.scalar), ("grid", "stack", "f32"));
    let cells = report.input.cells.as_ref().unwrap();
    let count_of = |name: &str| cells.get(name).copied();
    assert_eq!(count_of("wedge"), Some(2 * 256));
    assert_eq!((count_of("pyramid"), count_of("voxel")), (Some(64), None));
    let (seconds, work) = (&report.seconds, &report.work);
    assert!(seconds.geometry.unwrap() > 0.0, "each of several frames is sliced");
    let parts = seconds.select + seconds.geometry.unwrap() + seconds.draw;
    assert!((seconds.frame - parts).abs() < 1e-9 && seconds.upload.is_none());
    assert_eq!((report.frames.len(), work.slices), (3, Some(100)));
    // Most polygons have more than three corners.
    assert!(work.polygons.unwrap() > 5_000 && 2 * work.polygons.unwrap() < 3 * work.triangles.unwrap());
    assert!(work.triangles.unwrap() > 10_000 && work.bytes_uploaded > 3 * 10_000 * 12);
    let mut axes = view.clone();
    stack_of(&mut axes).slicing = Slicing::Axes;
    session.render(&axes).unwrap();
    let moved = session.view(&options(36.0, true));
    let moved = View { how: axes.how, ..moved };
    let geometry = session.render(&moved).unwrap().report.seconds.geometry.unwrap();
    assert!(geometry < 1e-3, "{geometry} s for stacks that are there");
}

#[test]
fn every_preset_shows_something() {
    let session = session_of(volery_data::cylinder(3));
    for preset in Preset::all() {
        assert!(!session.preset(preset).points().is_empty(), "{}", preset.name());
    }
}

#[test]
fn what_cannot_be_drawn_is_an_error() {
    let open = |grid: UnstructuredGrid, name: Option<&str>| Drawer::grid(grid, name, software()).err();
    let missing = open(volery_data::cylinder(1), Some("heat")).unwrap();
    assert_eq!(missing.to_string(), "array 'heat' is missing, expected one of: speed2");
    let cylinder = volery_data::cylinder(1);
    let bare = UnstructuredGrid::new(cylinder.points().to_vec(), cylinder.cells().clone()).unwrap();
    assert_eq!(open(bare.clone(), None), Some(GridError::NoArrays));
    let wide: Vec<f64> =
        (0..bare.points().len()).map(|i| if i % 2 == 0 { -1.7e308 } else { 1.7e308 }).collect();
    assert!(matches!(open(bare.with_array("f", wide).unwrap(), None), Some(GridError::TooWide { .. })));
    let none = UnstructuredGrid::new(vec![DVec3::ZERO], Cells::default()).unwrap();
    assert_eq!(open(none.with_array("f", vec![1.0]).unwrap(), None), Some(GridError::Blank));
    // A point, and a place for what is missing.
    for (corner, expected) in [(0.0_f64, "cells from (0, 0, 0) to (0, 0, 0),"), (1e300, "to (1, 1, 1e300),")]
    {
        let points = [[0.0; 3], [corner.min(1.0), 0.0, 0.0], [0.0, corner.min(1.0), 0.0]];
        let points = points.into_iter().chain([[0.0, 0.0, corner]]).map(DVec3::from_array).collect();
        let cells = Cells::new(vec![volery_scene::CellType::Tetrahedron], vec![0, 1, 2, 3]).unwrap();
        let grid = UnstructuredGrid::new(points, cells).unwrap().with_array("f", vec![1.0; 4]).unwrap();
        let error = open(grid, None).unwrap().to_string();
        assert!(error.contains(expected) && error.len() < 120, "{error}");
    }

    let mut session = session_of(volery_data::cylinder(1));
    let good = session.view(&options(0.0, false));
    let mut fails = |stack: StackView| {
        session.render(&View { how: How::Stack(stack), ..good.clone() }).unwrap_err().to_string()
    };
    assert_eq!(fails(StackView { num_slices: 0, ..StackView::default() }), "0 slices, expected at least 1");
    let share = fails(StackView { adaptive: Some(f64::NAN), ..StackView::default() });
    assert!(share.contains("share NaN"), "{share}");
    assert!(fails(StackView { num_slices: usize::MAX, ..StackView::default() }).contains("planes"));
    assert!(matches!(session.render_frames(&good, 0), Err(RenderError::NoFrame)));
    assert!(matches!(session.render(&View { width: 0, ..good }), Err(RenderError::Empty { .. })));
    // All nodes at one place: there is no direction to look in.
    let cells = Cells::new(vec![CellType::Tetrahedron], vec![0, 1, 2, 3]).unwrap();
    let point = UnstructuredGrid::new(vec![DVec3::ONE; 4], cells).unwrap();
    let point = point.with_array("f", vec![1.0, 2.0, 3.0, 4.0]).unwrap();
    assert!(matches!(open(point, None), Some(GridError::Extent { .. })));
}

#[test]
fn few_bits_are_nearly_as_good_and_slices_from_a_file_show_the_same() {
    let grid = Arc::new(volery_data::cylinder(6));
    let mut session = session_of(grid.clone());
    let exact = session.view(&options(35.0, false));
    let mut quantized = exact.clone();
    stack_of(&mut quantized).is_quantized = true;
    let [a, b] = [&exact, &quantized].map(|view| session.render(view).unwrap());
    let rmse = difference(&a.image, &b.image);
    println!("quantised: rmse {rmse:.6}, at most 0.0001");
    assert!(rmse > 0.0 && rmse < 1e-4, "rmse {rmse}, expected below 1e-4");
    assert!(b.report.work.bytes_uploaded < a.report.work.bytes_uploaded);

    let slicer = volery_slicing::Slicer::new(grid.clone()).unwrap();
    let [_, _, forward] = exact.camera.axes();
    let planes = volery_slicing::Planes::over(&grid, forward, StackView::default().num_slices).unwrap();
    let mesh = slicer.mesh(&planes, &grid.arrays()[0].values, None).unwrap();
    let file = volery::QuantizedMesh::new(&mesh).unwrap();
    let mut stack = Drawer::stack(file, software()).unwrap();
    let as_they_are = View { how: How::Slices { is_lit: false }, ..exact.clone() };
    let found = stack.render_frames(&as_they_are, 2).unwrap();
    assert!(bits(&found.image) == bits(&b.image));
    let [_, _, facing] = stack.view(&ViewOptions::default()).camera.axes();
    assert!(facing.dot(forward).abs() > 1.0 - 1e-6, "{facing}, expected along {forward}");
    assert_eq!((found.report.input.kind, found.report.frames.len()), ("stack", 2));
    let lit = View { how: How::Slices { is_lit: true }, ..exact.clone() };
    assert!(matches!(stack.render_frames(&lit, 1), Err(RenderError::NoGradients)));
    assert!(matches!(stack.render_frames(&as_they_are, 0), Err(RenderError::NoFrame)));
    let empty = volery::QuantizedMesh::new(&volery_slicing::SliceMesh::default()).unwrap();
    assert_eq!(Drawer::stack(empty, software()).err(), Some(StackError::Empty));
}

#[test]
fn classification_without_magnitudes_is_that_by_value() {
    let mut session = session_of(volery_data::cylinder(5));
    let [low, high] = session.value_range();
    let by_value =
        session.view(&ViewOptions { transfer: Some(transfer(low, high).into()), ..options(35.0, false) });
    let palette = Palette::from_transfer(values_of(&by_value), [low, high], [0.0, 1.0], [1025, 1]).unwrap();
    let function = TransferFunction2d::new(palette, Sliders::default()).unwrap();
    let mut by_both = by_value.clone();
    by_both.transfer = Transfer::Magnitudes(Arc::new(function));
    let [a, b] = [&by_value, &by_both].map(|view| session.render(view).unwrap().image);
    let rmse = difference(&a, &b);
    println!("classified by value and magnitude: rmse {rmse:.6}, at most 0.0001");
    assert!(rmse < 1e-4, "rmse {rmse}, expected below 1e-4");
    let mut picture = session.render(&by_both).unwrap();
    let error = session.verify(&by_both, &mut picture, &|_| ()).unwrap_err();
    assert!(matches!(error, VerifyError::Unknown { what: "gradient magnitudes" }), "{error}");
}

#[test]
fn light_follows_the_gradient_also_after_a_time_step() {
    // A gradient toward the viewer shows full colour, one across the view the ambient part.
    let view_along_x = |session: &Drawer<GridData>, is_lit| {
        let direction = Some(Direction { azimuth_deg: 90.0, elevation_deg: 0.0, zoom: 1.0 });
        let mut view = session.view(&ViewOptions {
            width: 40,
            height: 40,
            direction,
            orthographic: true,
            transfer: Some(
                TransferFunction::new(vec![ControlPoint { value: 0.0, color: [1.0; 3], opacity: 0.5 }], 1.0)
                    .unwrap()
                    .into(),
            ),
            ..ViewOptions::default()
        });
        view.background = [0.0; 3];
        stack_of(&mut view).is_lit = is_lit;
        view
    };
    let light = |image: &Image| image.pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>();
    let mut session = session_of(with_values(|point| point.x));
    let plain = light(&session.render(&view_along_x(&session, false)).unwrap().image);
    let lit = view_along_x(&session, true);
    let along = light(&session.render(&lit).unwrap().image) / plain;
    let values: Vec<f64> = session.data().grid().points().iter().map(|point| point.y).collect();
    assert_eq!(session.data_mut().set_values(values), Ok(StepChange::Values));
    let across = light(&session.render(&lit).unwrap().image) / plain;
    println!("lit along the gradient {along:.4}, expected 1; across {across:.4}, expected 0.25");
    assert!((along - 1.0).abs() < 0.01 && (across - 0.25).abs() < 0.01, "{along}, {across}");
}

#[test]
fn opaque_surfaces_stand_among_the_cells() {
    let mut session = session_of(volery_data::cylinder(6));
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let points = corners.map(|[x, y]| DVec3::new(x, y, 0.7 + 0.3 * x)).to_vec();
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    let mesh = volery_scene::TriangleMesh::new(points, triangles, [0.2, 0.9, 0.3]).unwrap();
    for (slicing, orthographic) in [(Slicing::Immediate, false), (Slicing::Axes, true)] {
        let bare = session.view(&options(35.0, orthographic));
        let bare = with_stack(&bare, |stack| stack.slicing = slicing);
        let view = View { meshes: [mesh.clone()].into(), ..bare.clone() };
        let [with, without] = [&view, &bare].map(|view| session.render(view).unwrap().image);
        let seen = difference(&with, &without);
        let found = rmse(&mut session, &view);
        println!("{slicing:?}: the surface changes the picture by {seen:.4}, rmse {found:.6}, at most 0.001");
        assert!(seen > 0.02 && found < 0.001, "{slicing:?}: {seen}, rmse {found}");
    }
}
