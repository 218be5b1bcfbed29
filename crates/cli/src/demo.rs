//! `volery demo`: every technique and dial there is on generated volumes, with time and error of each.

use std::path::{Path, PathBuf};

use volery::glam::DVec3;
use volery::output::{ErrorMap, write_image};
use volery::{
    BackendChoice, ColorMap, Focus, PlaneView, Preset, Session, Technique, View, ViewOptions, VoxelGrid, fit,
    open_backend,
};

use crate::args::DemoArgs;
use crate::progress::Progress;
use crate::sheet::{Tile, contact_sheet};
use crate::{Failure, say};

/// Width and height of a picture.
const SIDE: u32 = 272;

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
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure(format!("{}: cannot be made: {error}", folder.display())))?;
    say("volume          picture             ms a frame   nodes  max error      rmse")?;
    let mut sheet = Sheet { folder, tiles: Vec::new() };
    for scene in scenes() {
        sheet.draw_scene(&scene, args.backend.into())?;
    }
    let columns = sheet.tiles.len() as u32 / 2;
    let file = folder.join("contact-sheet.png");
    write_image(&file, &contact_sheet(&sheet.tiles, columns))?;
    say(file.display())
}

/// The pictures so far.
struct Sheet<'a> {
    folder: &'a Path,
    tiles: Vec<Tile>,
}

impl Sheet<'_> {
    fn draw_scene(&mut self, scene: &Scene, choice: BackendChoice) -> Result<(), Failure> {
        let open = |technique: Technique| {
            let _busy = Progress::spinner(format!("building the pyramid of {}", scene.name));
            Ok::<_, Failure>(Session::open(scene.grid.clone(), open_backend(choice)?, technique)?)
        };
        let mut rays = open(Technique::Raycast)?;
        let options = ViewOptions {
            width: SIDE,
            height: SIDE,
            direction: Some(scene.direction),
            transfer: Some(rays.preset(scene.preset)),
            ..ViewOptions::default()
        };
        let full = rays.view(&options);
        let parallel = rays.view(&ViewOptions { orthographic: true, ..options.clone() });
        let [fine, coarse] = TOLERANCES.map(|tolerance| View { tolerance: Some(tolerance), ..full.clone() });
        let name = scene.name;
        self.draw(&mut rays, &full, [name, "full resolution"], false)?;
        self.draw(&mut rays, &parallel, [name, "orthographic"], false)?;
        self.draw(&mut rays, &fine, [name, &format!("tolerance {}", TOLERANCES[0])], false)?;
        self.draw(&mut rays, &coarse, [name, &format!("tolerance {}", TOLERANCES[1])], true)?;

        let mut planes = open(Technique::Plane)?;
        let focus = Some(Focus { point: scene.grid.extent() / 2.0, quality: PLANE_QUALITY });
        let view =
            planes.view(&ViewOptions { planes: PlaneView { focus, ..PlaneView::default() }, ..options });
        self.draw(&mut planes, &view, [name, "planes, focus"], false)?;

        let mut fans = open(Technique::Fans)?;
        let view = View { tolerance: Some(FANS_TOLERANCE), ..full };
        self.draw(&mut fans, &view, [name, &format!("fans, tol. {FANS_TOLERANCE}")], false)
    }

    /// Draws, measures, prints and writes one picture, and the map of its error if that is wanted.
    fn draw(
        &mut self,
        session: &mut Session,
        view: &View,
        [name, title]: [&str; 2],
        maps_error: bool,
    ) -> Result<(), Failure> {
        let (mut picture, truth) = {
            let bar = Progress::bar(format!("{name}, {title}"));
            let mut picture = session.render_frames(view, FRAMES)?;
            let truth = session.verify(view, &mut picture, &|done| bar.set(done))?;
            (picture, truth)
        };
        picture.report.input.path = Some(name.to_owned());
        let report = &picture.report;
        let milliseconds = 1e3 * report.seconds.frame;
        let error = report.error.and_then(|error| error.measured).expect("it was verified");
        let (max, rmse) = (error.measured_max, error.measured_rmse);
        say(format_args!(
            "{name:<15} {title:<19} {milliseconds:>10.1} {:>7}  {max:>9.5} {rmse:>9.6}",
            report.work.nodes,
        ))?;
        write_image(&file_name(self.folder, name, title), &picture.image)?;
        let caption = [format!("{name}: {title}"), format!("{milliseconds:.1} ms, rmse {rmse:.5}")];
        let map = maps_error.then(|| ErrorMap::new(&picture.image, &truth)).transpose()?;
        self.tiles.push(Tile { image: picture.image, caption });
        if let Some(map) = map {
            write_image(&file_name(self.folder, name, "error map"), &map.image)?;
            let caption = [format!("{name}: its error x {}", map.gain), format!("largest {max:.5}")];
            self.tiles.push(Tile { image: map.image, caption });
        }
        Ok(())
    }
}

fn file_name(folder: &Path, name: &str, title: &str) -> PathBuf {
    folder.join(format!("{name}-{}.png", title.replace(". ", " ").replace(' ', "-").replace(',', "")))
}
