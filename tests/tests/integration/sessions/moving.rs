//! A camera that moves: what goes to a device once all is there.

use volery::fit::Direction;
use volery::{
    BackendChoice, Data, Dial, GridData, How, PlaneView, Session, Slicing, StackView, Thickness, View,
    ViewOptions, VolumeData,
};
use volery_frame::UploadedBytes;
use volery_tests::backend;

/// Cameras of a turn.
const NUM_CAMERAS: u32 = 50;

/// Degrees of a whole turn.
const AROUND: [f64; 2] = [0.0, 360.0];

/// Bytes a picture that depend on the camera: matrices, tiles of planes, one bit per brick.
const MAX_VIEW_BYTES: u64 = 1 << 20;

#[test]
fn a_camera_that_moves_sends_nothing() {
    let test = "a_camera_that_moves_sends_nothing";
    let choice = BackendChoice::Wgpu;
    let mut volume = Session::new(VolumeData::new(volery_data::marschner_lobb_u8(90)).unwrap());
    let planes = How::Planes(PlaneView::default());
    turn(&mut volume, (How::Raycast, Dial::Full), AROUND, choice, test);
    turn(&mut volume, (How::Raycast, Dial::Tolerance(0.1)), AROUND, choice, test);
    turn(&mut volume, (planes.clone(), Dial::Full), AROUND, choice, test);
    turn(&mut volume, (planes, Dial::Error(0.1)), AROUND, choice, test);
    // Cubes are in one order from all of an octant.
    turn(&mut volume, (How::Fans(Thickness::Exact), Dial::Tolerance(0.1)), [20.0, 70.0], choice, test);
    let mut cells = Session::new(GridData::new(volery_data::cylinder(6), None).unwrap());
    let axes = StackView { slicing: Slicing::Axes, num_slices: 64, ..StackView::default() };
    let quantized = StackView { is_quantized: true, ..axes.clone() };
    turn(&mut cells, (How::Stack(axes), Dial::Full), AROUND, choice, test);
    turn(&mut cells, (How::Stack(quantized), Dial::Full), AROUND, choice, test);
}

/// Two turns, from one azimuth to another; the second shows what the first has shown.
fn turn<D: Data>(
    session: &mut Session<D>,
    (how, dial): (How, Dial),
    [first_deg, end_deg]: [f64; 2],
    choice: BackendChoice,
    test: &str,
) {
    let Some(mut backend) = backend(choice, test) else { return };
    let view = |session: &Session<D>, number: u32| {
        let azimuth_deg = first_deg + (end_deg - first_deg) * f64::from(number) / f64::from(NUM_CAMERAS);
        let direction = Some(Direction { azimuth_deg, elevation_deg: 15.0, zoom: 1.0 });
        let options = ViewOptions {
            width: 64,
            height: 48,
            direction,
            how: Some(how.clone()),
            ..ViewOptions::default()
        };
        View { dial, ..session.view(&options) }
    };
    let mut after = [UploadedBytes::default(); 2];
    for bytes in &mut after {
        for number in 0..NUM_CAMERAS {
            let view = view(session, number);
            session.render(&view, backend.as_mut()).unwrap();
        }
        *bytes = backend.uploaded_bytes();
    }
    let [first, second] = after;
    println!("{} {dial:?}: {first:?} after a turn, {second:?} after two", how.name());
    let UploadedBytes { bricks, places, choices, transfers, geometry, views } = second;
    assert_eq!(
        [bricks, places, transfers, geometry],
        [first.bricks, first.places, first.transfers, first.geometry],
        "{}, {dial:?}: bricks, places, transfers, geometry",
        how.name()
    );
    let of_views = choices + views - first.choices - first.views;
    assert!(of_views <= MAX_VIEW_BYTES * u64::from(NUM_CAMERAS), "{of_views} bytes of views");
}
