//! `volery demo`: every technique and dial there is on generated volumes and cells, with time and error of each.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use volery::glam::DVec3;
use volery::output::{ErrorMap, write_image};
use volery::{
    Backend, BackendChoice, ColorMap, Data, Dial, Focus, GridData, How, Picture, PlaneView, Preset, Session,
    Slicing, StackView, Thickness, View, ViewOptions, VolumeData, VoxelGrid, fit, reference,
};

use crate::args::DemoArgs;
use crate::outputs::Outputs;
use crate::progress::Progress;
use crate::sheet::{Tile, contact_sheet};
use crate::{Failure, open, say};

/// Width and height of a picture.
const SIDE: u32 = 228;

/// Pictures in a row of the contact sheet: those of one scene.
const COLUMNS: u32 = 7;

/// Cells around the cylinder, over four.
const CELLS: usize = 12;

/// Slices where few are shown.
const FEW_SLICES: usize = 24;

/// Frames per row; the first also uploads.
const FRAMES: usize = 5;

/// Fractions of the value range.
const TOLERANCES: [f64; 2] = [0.2, 0.5];

/// Of the planes: small volumes are coarse soon.
const PLANE_QUALITY: f64 = 0.5;

/// Of the cubes, as a fraction of the value range.
const FANS_TOLERANCE: f64 = 0.1;

/// A generated volume and how it is shown.
struct Scene {
    name: &'static str,
    grid: VoxelGrid,
    preset: Preset,
    direction: fit::Direction,
}

fn scenes() -> [Scene; 2] {
    let head = Scene {
        name: "head",
        grid: volery_data::head([120, 150, 150], DVec3::splat(1.5)),
        preset: Preset::Auto,
        direction: fit::Direction { azimuth_deg: 30.0, elevation_deg: 10.0, zoom: 1.0 },
    };
    let waves = Scene {
        name: "marschner-lobb",
        grid: volery_data::marschner_lobb_u8(96),
        preset: Preset::Colors(ColorMap::Viridis),
        direction: fit::Direction::default(),
    };
    [head, waves]
}

pub(crate) fn run(args: &DemoArgs) -> Result<(), Failure> {
    let folder = args.output.as_path();
    let is_picture = |name: &OsStr| Path::new(name).extension().is_some_and(|ending| ending == "png");
    Outputs::default().folder("-o", folder, is_picture).check([])?;
    let choice = BackendChoice::from(args.backend);
    let backend = open(choice)?;
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::of_file(folder, format_args!("cannot be made: {error}")))?;
    say("data            picture             ms a frame  pieces  max error      rmse")?;
    let mut sheet = Sheet { folder, backend, tiles: Vec::new() };
    for scene in scenes() {
        sheet.draw_scene(&scene)?;
    }
    sheet.draw_cells()?;
    let file = folder.join("contact-sheet.png");
    write_image(&file, &contact_sheet(&sheet.tiles, COLUMNS))?;
    say(file.display())
}

/// The pictures so far.
struct Sheet<'a> {
    folder: &'a Path,
    backend: Box<dyn Backend>,
    tiles: Vec<Tile>,
}

impl Sheet<'_> {
    fn draw_scene(&mut self, scene: &Scene) -> Result<(), Failure> {
        let mut session = {
            let _busy = Progress::spinner(format!("building the pyramid of {}", scene.name));
            Session::new(VolumeData::new(scene.grid.clone())?)
        };
        let options = ViewOptions {
            width: SIDE,
            height: SIDE,
            direction: Some(scene.direction),
            transfer: Some(session.preset(scene.preset).into()),
            ..ViewOptions::default()
        };
        let full = session.view(&options);
        let coarser = |tolerance| View { dial: Dial::Tolerance(tolerance), ..full.clone() };
        let focus = Some(Focus { point: scene.grid.extent() / 2.0, quality: PLANE_QUALITY });
        let planes = How::Planes(PlaneView { focus, ..PlaneView::default() });
        let views = [
            ("full resolution".to_owned(), full.clone(), false),
            (
                "orthographic".to_owned(),
                session.view(&ViewOptions { orthographic: true, ..options.clone() }),
                false,
            ),
            (format!("tolerance {}", TOLERANCES[0]), coarser(TOLERANCES[0]), false),
            (format!("tolerance {}", TOLERANCES[1]), coarser(TOLERANCES[1]), true),
            ("planes, focus".to_owned(), session.view(&ViewOptions { how: Some(planes), ..options }), false),
            (
                format!("fans, tol. {FANS_TOLERANCE}"),
                View { how: How::Fans(Thickness::default()), ..coarser(FANS_TOLERANCE) },
                false,
            ),
        ];
        for (title, view, maps_error) in views {
            self.draw(&mut session, &view, [scene.name, &title], maps_error)?;
        }
        Ok(())
    }

    /// Cells of several types, sliced.
    fn draw_cells(&mut self) -> Result<(), Failure> {
        let mut session = Session::new(GridData::new(volery_data::cylinder(CELLS), None)?);
        let direction = Some(fit::Direction { azimuth_deg: -25.0, elevation_deg: 30.0, zoom: 1.1 });
        let options = ViewOptions { width: SIDE, height: SIDE, direction, ..ViewOptions::default() };
        let options = ViewOptions { transfer: Some(session.preset(Preset::Auto).into()), ..options };
        let full = session.view(&options);
        let parallel = session.view(&ViewOptions { orthographic: true, ..options });
        let of = |stack: StackView| View { how: How::Stack(stack), ..full.clone() };
        let all = StackView::default();
        let few = StackView { num_slices: FEW_SLICES, ..all.clone() };
        let views = [
            ("slices", full.clone(), false),
            ("orthographic", parallel, false),
            ("along axes", of(StackView { slicing: Slicing::Axes, ..all.clone() }), false),
            ("few and finer", of(StackView { adaptive: Some(1.0), ..few.clone() }), false),
            ("few slices", of(few), true),
            ("shaded", of(StackView { is_lit: true, ..all }), false),
        ];
        for (title, view, maps_error) in views {
            self.draw(&mut session, &view, ["cylinder", title], maps_error)?;
        }
        Ok(())
    }

    /// Draws, measures, prints and writes one picture, and the map of its error if that is wanted.
    fn draw<D: Data>(
        &mut self,
        session: &mut Session<D>,
        view: &View,
        [name, title]: [&str; 2],
        maps_error: bool,
    ) -> Result<(), Failure> {
        let (picture, truth) = {
            let bar = Progress::bar(format!("{name}, {title}"));
            let mut picture = session.render_frames(view, FRAMES, self.backend.as_mut())?;
            // The reference knows no light.
            let verify = |picture| session.verify(view, picture, &|done| bar.set(done));
            let truth = view.check_verifiable().is_ok().then(|| verify(&mut picture)).transpose()?;
            (picture, truth)
        };
        self.add([name, title], picture, truth.as_ref(), maps_error)
    }

    /// Prints and writes one picture, and the map of its error if that is wanted and there is a truth.
    fn add(
        &mut self,
        [name, title]: [&str; 2],
        picture: Picture,
        truth: Option<&reference::Image>,
        maps_error: bool,
    ) -> Result<(), Failure> {
        let report = &picture.report;
        let milliseconds = 1e3 * report.seconds.frame;
        let amount = report.work.nodes.or(report.work.slices).unwrap_or_default();
        let error = report.error.and_then(|error| error.measured);
        let (max, rmse) = error.map_or((String::new(), String::new()), |error| {
            (format!("{:.5}", error.measured_max), format!("{:.6}", error.measured_rmse))
        });
        say(format_args!("{name:<15} {title:<19} {milliseconds:>10.1} {amount:>7}  {max:>9} {rmse:>9}"))?;
        write_image(&file_name(self.folder, name, title), &picture.image)?;
        let rmse = error.map_or(String::new(), |error| format!(", rmse {:.5}", error.measured_rmse));
        let caption = [format!("{name}: {title}"), format!("{milliseconds:.1} ms{rmse}")];
        let map =
            truth.filter(|_| maps_error).map(|truth| ErrorMap::new(&picture.image, truth)).transpose()?;
        self.tiles.push(Tile { image: picture.image, caption });
        if let Some(map) = map {
            write_image(&file_name(self.folder, name, "error map"), &map.image)?;
            let caption = [format!("{name}: its error x {}", map.gain), format!("largest {max}")];
            self.tiles.push(Tile { image: map.image, caption });
        }
        Ok(())
    }
}

fn file_name(folder: &Path, name: &str, title: &str) -> PathBuf {
    folder.join(format!("{name}-{}.png", title.replace(". ", " ").replace(' ', "-").replace(',', "")))
}
