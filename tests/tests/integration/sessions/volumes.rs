//! Sessions: what stays resident, what a dial does, what backends are asked for.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use volery_tests::Drawer;

use volery::fit::Direction;
use volery::glam::DVec3;
use volery::{
    Backend, BackendChoice, ControlPoint, Device, DeviceKind, Dial, How, Image, PlaneView, Preset,
    RenderError, SampleType, Session, Thickness, TransferFunction, View, ViewOptions, VolumeData,
    VolumeError, VoxelGrid, open_backend,
};
use volery_frame::{
    Brick, BrickId, Content, DrawError, Drawn, FinishedPart, PictureView, Revision, UploadError,
    UploadedBytes, VolumeLayout, Window,
};

fn software() -> Box<dyn Backend> {
    open_backend(BackendChoice::Software).unwrap()
}

fn small() -> ViewOptions {
    ViewOptions { width: 80, height: 60, ..ViewOptions::default() }
}

fn session_of(grid: VoxelGrid) -> Drawer<VolumeData> {
    Drawer::volume(grid, software(), How::Raycast).unwrap()
}

fn turned(session: &Drawer<VolumeData>, azimuth_deg: f64) -> View {
    let direction = Direction { azimuth_deg, elevation_deg: 10.0, zoom: 1.0 };
    session.view(&ViewOptions { direction: Some(direction), ..small() })
}

#[test]
fn only_what_changed_is_uploaded() {
    let mut session = session_of(volery_data::marschner_lobb_u8(80));
    let view = session.view(&small());
    let first = session.render(&view).unwrap().report.work;
    assert_eq!(first.bricks, first.nodes);
    assert!(first.bytes_uploaded > 0);
    assert_eq!(
        session.render(&turned(&session, 120.0)).unwrap().report.work.bricks.unwrap(),
        0,
        "another camera"
    );
    let recolored = View { transfer: session.preset(Preset::Mri).into(), ..view.clone() };
    assert_eq!(
        session.render(&recolored).unwrap().report.work.bricks.unwrap(),
        0,
        "another transfer function"
    );
    let coarse = session.render(&View { dial: Dial::Tolerance(0.9), ..view.clone() }).unwrap().report.work;
    let coarse_nodes = coarse.nodes_by_level.unwrap()[1..].iter().sum::<usize>();
    assert_eq!(coarse.bricks, Some(coarse_nodes), "coarse nodes are new");
    assert!(coarse_nodes > 0);
    assert_eq!(
        session.render(&view).unwrap().report.work.bricks.unwrap(),
        0,
        "the fine ones are still there"
    );
}

#[test]
fn a_picture_does_not_depend_on_what_was_drawn_before() {
    let grid = volery_data::marschner_lobb_u8(80);
    let mut used = session_of(grid.clone());
    for azimuth in [10.0, 100.0, 250.0] {
        let view = View { dial: Dial::Tolerance(0.3), ..turned(&used, azimuth) };
        used.render(&view).unwrap();
    }
    let view = turned(&used, 40.0);
    let fresh = session_of(grid).render(&view).unwrap().image;
    assert!(used.render(&view).unwrap().image == fresh);
}

#[test]
fn tolerance_0_draws_the_finest_level_where_the_field_changes() {
    // A constant half, which is drawn as it is.
    let half = volery_data::half_space([70, 70, 70], DVec3::ONE, DVec3::X, 35.0);
    let mut session = session_of(half);
    let point = |value, opacity| ControlPoint { value, color: [1.0; 3], opacity };
    let transfer = TransferFunction::new(vec![point(0.0, 0.01), point(255.0, 0.1)], 1.0).unwrap();
    let view = session.view(&ViewOptions { transfer: Some(transfer.into()), ..small() });
    let full = session.render(&view).unwrap();
    let zero = session.render(&View { dial: Dial::Tolerance(0.0), ..view.clone() }).unwrap();
    assert!(full.image == zero.image);
    let nodes = full.report.work.nodes_by_level.as_ref().unwrap();
    assert!(nodes[0] > 0 && nodes.iter().sum::<usize>() < 27, "{nodes:?}");
    assert_eq!(
        zero.report.work.nodes_by_level.as_ref().unwrap(),
        full.report.work.nodes_by_level.as_ref().unwrap()
    );
    let tiny = session.render(&View { dial: Dial::Tolerance(1e-12), ..view }).unwrap();
    assert!(
        tiny.report.work.nodes_by_level.as_ref().unwrap().len() > 1,
        "constant parts may be coarse at any other tolerance"
    );
}

#[test]
fn signed_and_shifted_samples_make_the_same_picture() {
    let unsigned = volery_data::noise([34, 33, 35], 5);
    let values: Vec<u8> = (0..unsigned.num_samples()).map(|i| unsigned.samples().value(i, 0) as u8).collect();
    let point = |value: f64, opacity| ControlPoint { value, color: [0.9, 0.5, 0.2], opacity };
    let transfer = |shift: f64| {
        TransferFunction::new(vec![point(128.0 + shift, 0.0), point(250.0 + shift, 0.4)], 1.0).unwrap()
    };
    let draw = |grid: VoxelGrid, shift: f64| {
        let mut session = session_of(grid);
        let view = session.view(&ViewOptions { transfer: Some(transfer(shift).into()), ..small() });
        session.render(&view).unwrap().image
    };
    let grid = |samples: volery::Samples| VoxelGrid::new(unsigned.dims(), DVec3::ONE, samples).unwrap();
    let expected = draw(unsigned.clone(), 0.0);
    let i8s: Vec<i8> = values.iter().map(|&v| (i16::from(v) - 128) as i8).collect();
    assert!(draw(grid(i8s.into()), -128.0) == expected, "i8");
    let close = |image: &Image, name: &str| {
        let off =
            image.pixels.iter().flatten().zip(expected.pixels.iter().flatten()).map(|(a, b)| (a - b).abs());
        let largest = off.fold(0.0, f32::max);
        assert!(largest < 1e-3, "{name}: {largest}");
    };
    let at = |shift: f64| values.iter().map(move |&v| f64::from(v) + shift);
    close(&draw(grid(at(-20_000.0).map(|v| v as i16).collect::<Vec<_>>().into()), -20_000.0), "i16");
    close(&draw(grid(at(60_000.0).map(|v| v as u16).collect::<Vec<_>>().into()), 60_000.0), "u16");
    close(&draw(grid(at(-2e9).map(|v| v as i32).collect::<Vec<_>>().into()), -2e9), "i32");
    close(&draw(grid(at(4e9).map(|v| v as u32).collect::<Vec<_>>().into()), 4e9), "u32");
    close(&draw(grid(at(1e6).map(|v| v as f32).collect::<Vec<_>>().into()), 1e6), "f32");
    close(&draw(grid(at(1e12).collect::<Vec<_>>().into()), 1e12), "f64");
}

#[test]
fn blank_samples_are_verified_too() {
    let mut session = session_of(volery_data::holes([40, 36, 34], 11, 0.02));
    let view = session.view(&small());
    for dial in [Dial::Full, Dial::Tolerance(0.4)] {
        let view = View { dial, ..view.clone() };
        let mut picture = session.render(&view).unwrap();
        session.verify(&view, &mut picture, &|_| {}).unwrap();
        let error = picture.report.error.unwrap().measured.unwrap();
        println!("{dial:?}: rmse {:.5}, max {:.5}", error.measured_rmse, error.measured_max);
        assert!(error.measured_rmse < 0.01, "rmse {}", error.measured_rmse);
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let open = |grid| Drawer::volume(grid, software(), How::Raycast).err().unwrap();
    let colors = VoxelGrid::new([2, 2, 2], DVec3::ONE, vec![[0u8; 4]; 8]).unwrap();
    let draw = |grid| {
        let mut session = session_of(grid);
        let view = session.view(&small());
        session.render(&view).err().unwrap()
    };
    assert!(matches!(draw(colors), RenderError::Colors { found: SampleType::Rgba8, .. }));
    assert!(matches!(draw(volery_data::noise([4, 1, 4], 0)), RenderError::Flat { dims: [4, 1, 4], .. }));
    let blank = VoxelGrid::new([2, 2, 2], DVec3::ONE, vec![f64::NAN; 8]).unwrap();
    assert!(matches!(open(blank), VolumeError::Blank));
    let mut session = session_of(volery_data::marschner_lobb(12));
    let good = session.view(&small());
    let mut fails = |view: View| session.render(&view).err().unwrap();
    assert!(matches!(fails(View { width: 0, ..good.clone() }), RenderError::Empty { width: 0, height: 60 }));
    assert!(matches!(
        fails(View { dial: Dial::Tolerance(f64::NAN), ..good.clone() }),
        RenderError::Tolerance { .. }
    ));
    assert!(matches!(
        fails(View { dial: Dial::Tolerance(-0.1), ..good.clone() }),
        RenderError::Tolerance { .. }
    ));
    assert!(matches!(
        fails(View { background: [0.0, 1.1, 0.0], ..good.clone() }),
        RenderError::Background { .. }
    ));
    let camera = volery::Camera { eye: good.camera.target, ..good.camera };
    assert!(matches!(fails(View { camera, ..good.clone() }), RenderError::Camera(_)));
    assert!(matches!(session.render_frames(&good, 0), Err(RenderError::NoFrame)));
}

/// Keeps at most `room` bricks, and remembers what it was asked.
#[derive(Clone, Default)]
struct Narrow {
    room: usize,
    size: [u32; 2],
    volume: Option<Revision>,
    bricks: Arc<Mutex<HashMap<BrickId, usize>>>,
    largest_upload: Arc<Mutex<usize>>,
}

impl Backend for Narrow {
    fn device(&self) -> Device {
        Device { kind: DeviceKind::Software, name: "narrow".to_owned(), in_place_of: None }
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        self.volume = Some(layout.revision);
        self.bricks.lock().unwrap().clear();
        Ok(())
    }

    fn volume(&self) -> Option<Revision> {
        self.volume
    }

    fn is_resident(&self, id: BrickId) -> bool {
        self.bricks.lock().unwrap().contains_key(&id)
    }

    fn upload(&mut self, new: &[Brick<'_>]) -> Result<(), UploadError> {
        let mut bricks = self.bricks.lock().unwrap();
        let required = (bricks.len() + new.len()) as u64;
        if required > self.room as u64 {
            return Err(UploadError::PoolFull { required, max: self.room as u64 });
        }
        let bytes: usize = new.iter().map(|b| b.texels.len() * b.texels.texel_type().bytes()).sum();
        let mut largest = self.largest_upload.lock().unwrap();
        *largest = bytes.max(*largest);
        bricks.extend(new.iter().map(|brick| (brick.id, brick.texels.len())));
        Ok(())
    }

    fn evict(&mut self, bricks: &[BrickId]) {
        let mut held = self.bricks.lock().unwrap();
        held.retain(|id, _| !bricks.contains(id));
    }

    fn resident_bytes(&self) -> u64 {
        self.bricks.lock().unwrap().len() as u64
    }

    fn brick_bytes(&self, _: &VolumeLayout, _: [u32; 3]) -> u64 {
        1
    }

    fn room(&self, _: &VolumeLayout, max_bytes: u64) -> u64 {
        max_bytes
    }

    fn reserve(&mut self, _: usize, _: u64) -> Result<(), UploadError> {
        Ok(())
    }

    fn uploaded_bytes(&self) -> UploadedBytes {
        UploadedBytes::default()
    }

    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError> {
        self.size = [view.width, view.height];
        Ok(())
    }

    fn begin_windows(&mut self, view: &PictureView<'_>, _: u32) -> Result<(), DrawError> {
        self.begin(view)
    }

    fn draw_windows(&mut self, content: &Content<'_>, _: &[Window]) -> Result<u32, DrawError> {
        self.draw_part(content)
    }

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        let bricks = self.bricks.lock().unwrap();
        for brick in content.bricks() {
            assert!(bricks.contains_key(&brick.id), "{brick:?} is not resident");
        }
        Ok(0)
    }

    fn finished(&mut self) -> Vec<FinishedPart> {
        vec![FinishedPart { number: 0, device_seconds: None }]
    }

    fn wait(&mut self) -> Result<(), DrawError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<Drawn, DrawError> {
        let [width, height] = self.size;
        let pixels = vec![[0.0; 3]; (width * height) as usize];
        Ok(Drawn { image: Image { width, height, pixels }, device_seconds: None, ray_doubt: None })
    }
}

#[test]
fn a_full_pool_forgets_what_the_frame_does_not_need() {
    let grid = volery_data::noise([65, 65, 65], 3);
    let backend = Narrow { room: 8, ..Narrow::default() };
    let mut session = Drawer::volume(grid, Box::new(backend.clone()), How::Raycast).unwrap();
    let everything =
        TransferFunction::new(vec![ControlPoint { value: 0.0, color: [1.0; 3], opacity: 0.1 }], 1.0);
    let fine = session.view(&ViewOptions { transfer: Some(everything.unwrap().into()), ..small() });
    assert_eq!(session.render(&fine).unwrap().report.work.nodes.unwrap(), 8);
    let coarse = session.render(&View { dial: Dial::Tolerance(2.0), ..fine.clone() }).unwrap().report.work;
    assert_eq!(
        (coarse.nodes, coarse.bricks, coarse.bytes_resident),
        (Some(1), Some(1), 1),
        "the 8 fine ones went"
    );
    assert_eq!(session.render(&fine).unwrap().report.work.bricks.unwrap(), 8);
    // Room for fewer than one frame needs is an error that says so.
    let tight = Narrow { room: 7, ..Narrow::default() };
    let mut session =
        Drawer::volume(volery_data::noise([65, 65, 65], 3), Box::new(tight), How::Raycast).unwrap();
    let error = session.render(&fine).unwrap_err().to_string();
    assert!(error.contains('8') && error.contains('7'), "{error}");
}

#[test]
fn uploads_come_in_batches_of_bounded_size() {
    let backend = Narrow { room: usize::MAX, ..Narrow::default() };
    let grid = volery_data::ramp([200, 200, 130], DVec3::ONE, DVec3::ONE, 0.0);
    let mut session = Drawer::volume(grid, Box::new(backend.clone()), How::Raycast).unwrap();
    let everything =
        TransferFunction::new(vec![ControlPoint { value: 0.0, color: [1.0; 3], opacity: 0.1 }], 1.0);
    let view = session.view(&ViewOptions { transfer: Some(everything.unwrap().into()), ..small() });
    let work = session.render(&view).unwrap().report.work;
    let largest = *backend.largest_upload.lock().unwrap();
    assert!(largest <= volery::residency::BATCH_BYTES, "{largest}");
    assert!(work.bytes_uploaded > largest as u64, "more than one batch");
}

#[test]
fn refinements_come_coarse_first_and_end_with_the_picture_itself() {
    for how in [How::Raycast, How::Fans(Thickness::Exact)] {
        for dial in [Dial::Full, Dial::Tolerance(0.0), Dial::Tolerance(0.1), Dial::Tolerance(0.9)] {
            let grid = volery_data::marschner_lobb_u8(40);
            let mut session = Drawer::volume(grid, software(), how.clone()).unwrap();
            let view = View { dial, ..session.view(&small()) };
            let steps: Vec<_> = session.refinements(&view).unwrap().map(Result::unwrap).collect();
            let expected = session.render(&view).unwrap();
            let (last, before) = steps.split_last().unwrap();
            assert!(last.is_last && last.picture.image == expected.image, "{how:?} {dial:?}");
            assert!(before.iter().all(|step| !step.is_last));
            let nodes: Vec<_> = steps.iter().map(|step| step.picture.report.work.nodes.unwrap()).collect();
            assert!(nodes.is_sorted(), "{how:?} {dial:?}: {nodes:?}");
            assert_eq!(steps.len() > 1, dial != Dial::Tolerance(0.9), "{how:?} {dial:?}: {nodes:?}");
        }
    }
}

/// Each of 20 pictures of one session, by whatever technique and dial, is that of a new one; so is that of another
/// session in between, by the same backend.
#[test]
fn one_session_changes_technique_and_dial_as_if_it_were_new() {
    let [grid, other] = [volery_data::marschner_lobb(50), volery_data::noise([40, 36, 44], 7)];
    let mut session = session_of(grid.clone());
    let mut between = Session::new(VolumeData::new(other.clone()).unwrap());
    let hows = [How::Raycast, How::Planes(PlaneView::default()), How::Fans(Thickness::Exact)];
    let narrow = |value, opacity| ControlPoint { value, color: [0.9, 0.4, 0.2], opacity };
    let mut builds = Vec::new();
    for number in 0..20 {
        let how = hows[number % 3].clone();
        let dial = match (number % 4, &how) {
            (0, _) => Dial::Full,
            (3, How::Planes(_)) => Dial::Error(0.1),
            (tenths, _) => Dial::Tolerance(0.1 * tenths as f64),
        };
        // Now and then one for which samples are stored in another way.
        let points = vec![narrow(0.5, 0.0), narrow(if number % 5 == 2 { 0.505 } else { 0.9 }, 0.3)];
        let transfer = Some(TransferFunction::new(points, 0.1).unwrap().into());
        let view = session.view(&ViewOptions { how: Some(how), transfer, ..small() });
        let view = View { dial, ..view };
        let found = session.render(&view).unwrap();
        let fresh = session_of(grid.clone()).render(&view).unwrap();
        assert!(found.image == fresh.image, "{number}: {:?}, {dial:?}", view.how);
        builds.push(found.report.seconds.build);
        if number % 6 == 5 {
            let view = between.view(&small());
            let found = between.render(&view, session.backend.as_mut()).unwrap();
            assert!(
                found.image == session_of(other.clone()).render(&view).unwrap().image,
                "{number}: between"
            );
        }
    }
    // Of one technique it is always the same: nothing is built again.
    for (number, build) in builds.iter().enumerate().skip(3) {
        assert_eq!(*build, builds[number - 3], "{number}");
    }
}

#[test]
fn what_a_technique_does_not_obey_is_refused() {
    let mut session = session_of(volery_data::marschner_lobb(12));
    let view = session.view(&small());
    let mut fails = |how: How, dial: Dial| {
        let error = session.render(&View { how, dial, ..view.clone() }).err().unwrap();
        println!("{error}");
        error
    };
    let dial = Dial::Error(0.1);
    assert!(matches!(fails(How::Fans(Thickness::Exact), dial), RenderError::Dial { technique: "fans", .. }));
    let stack = How::Stack(volery::StackView::default());
    assert!(matches!(fails(stack, Dial::Full), RenderError::OtherData { found: "volume", .. }));
}
