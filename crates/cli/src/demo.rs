//! `volery demo`: every technique and dial there is on generated volumes, with time and error of each.

use std::path::{Path, PathBuf};

use volery::glam::DVec3;
use volery::output::{ErrorMap, write_image};
use volery::{BackendChoice, ColorMap, Preset, Session, View, ViewOptions, VoxelGrid, fit, open_backend};

use crate::args::DemoArgs;
use crate::progress::Progress;
use crate::sheet::{Tile, contact_sheet};
use crate::{Failure, say};

/// Width and height of a picture.
const SIDE: u32 = 320;

/// Frames per row; the first also uploads.
const FRAMES: usize = 5;

/// Fractions of the value range.
const TOLERANCES: [f64; 2] = [0.2, 0.5];

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
    let mut tiles = Vec::new();
    for scene in scenes() {
        draw_scene(scene, args.backend.into(), folder, &mut tiles)?;
    }
    let columns = tiles.len() as u32 / 2;
    let sheet = folder.join("contact-sheet.png");
    write_image(&sheet, &contact_sheet(&tiles, columns))?;
    say(sheet.display())
}

fn draw_scene(
    scene: Scene,
    choice: BackendChoice,
    folder: &Path,
    tiles: &mut Vec<Tile>,
) -> Result<(), Failure> {
    let Scene { name, grid, preset, direction } = scene;
    let mut session = {
        let _busy = Progress::spinner(format!("building the pyramid of {name}"));
        Session::open(grid, open_backend(choice)?)?
    };
    let options = ViewOptions {
        width: SIDE,
        height: SIDE,
        direction,
        orthographic: false,
        transfer: Some(session.preset(preset)),
    };
    let full = session.view(&options);
    let parallel = session.view(&ViewOptions { orthographic: true, ..options });
    let [fine, coarse] = TOLERANCES.map(|tolerance| View { tolerance: Some(tolerance), ..full.clone() });
    let rows = [
        ("full resolution".to_owned(), &full),
        ("orthographic".to_owned(), &parallel),
        (format!("tolerance {}", TOLERANCES[0]), &fine),
        (format!("tolerance {}", TOLERANCES[1]), &coarse),
    ];
    for (title, view) in rows {
        let (mut picture, truth) = {
            let bar = Progress::bar(format!("{name}, {title}"));
            let mut picture = session.render_frames(view, FRAMES)?;
            let truth = session.verify(view, &mut picture, &|done| bar.set(done))?;
            (picture, truth)
        };
        let path = file_name(folder, name, &title);
        picture.report.input.path = Some(name.to_owned());
        let report = &picture.report;
        let milliseconds = 1e3 * report.seconds.frame;
        let error = report.error.as_ref().expect("it was verified");
        let (max, rmse) = (error.measured_max, error.measured_rmse);
        say(format_args!(
            "{name:<15} {title:<19} {milliseconds:>10.1} {:>7}  {max:>9.5} {rmse:>9.6}",
            report.work.nodes,
        ))?;
        write_image(&path, &picture.image)?;
        let caption = [format!("{name}: {title}"), format!("{milliseconds:.1} ms, rmse {rmse:.5}")];
        if view.tolerance == Some(TOLERANCES[1]) {
            let map = ErrorMap::new(&picture.image, &truth)?;
            write_image(&file_name(folder, name, "error map"), &map.image)?;
            tiles.push(Tile { image: picture.image, caption });
            let caption = [format!("{name}: its error x {}", map.gain), format!("largest {max:.5}")];
            tiles.push(Tile { image: map.image, caption });
        } else {
            tiles.push(Tile { image: picture.image, caption });
        }
    }
    Ok(())
}

fn file_name(folder: &Path, name: &str, title: &str) -> PathBuf {
    folder.join(format!("{name}-{}.png", title.replace(' ', "-")))
}
