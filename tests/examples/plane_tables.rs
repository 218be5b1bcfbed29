//! Tables and pictures of docs/planes.md: `plane_tables DATA PICTURES`.
//!
//! `cargo xtask bench planes` runs it. Prints Markdown, and writes the pictures into the folder `PICTURES`. Times are
//! of the software backend: the first picture of a backend without bricks (cold: select, upload, draw) and the
//! fastest of those that follow (warm).

use std::error::Error;
use std::path::{Path, PathBuf};

use volery::glam::DVec3;
use volery::output::write_image;
use volery::{
    Backend, Camera, Dial, Focus, How, Image, Picture, Plane, PlaneView, Projection, Sampling, View,
    ViewOptions, VolumeData, VoxelGrid,
};
use volery_reference::metrics::{Comparison, compare};
use volery_software::SoftwareBackend;
use volery_tests::{Drawer, Shared, Unblended, exact, planes_of};

/// Pictures are square, of so many pixels.
const SIDE: u32 = 512;
const WARM_FRAMES: usize = 5;
const QUALITIES: [f64; 9] = [0.25, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];
/// Largest errors near a focus, and everywhere without one.
const ERRORS: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.3];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [data, pictures] = arguments.as_slice() else {
        return Err("usage: plane_tables DATA PICTURES".into());
    };
    figure_6(pictures)?;
    head(pictures)?;
    let mut scenes = scenes(data)?;
    paper_table(&mut scenes)?;
    scenes.iter_mut().try_for_each(curve)
}

/// A volume and how it is cut.
struct Scene {
    name: &'static str,
    session: Drawer<VolumeData>,
    backend: Shared,
    /// In full resolution.
    view: View,
    focus: DVec3,
}

/// One picture, with its times in milliseconds.
struct Timed {
    picture: Picture,
    cold: f64,
    warm: f64,
}

impl Scene {
    /// A volume cut by an oblique plane through its middle, an image by itself; the focus a little off the middle.
    fn new(name: &'static str, grid: VoxelGrid) -> Result<Self, Box<dyn Error>> {
        let extent = grid.extent();
        let mut options = ViewOptions { width: SIDE, height: SIDE, ..ViewOptions::default() };
        let plane = Plane::through(extent / 2.0, DVec3::new(0.3, 0.5, 0.81)).normalized();
        let mut focus = extent * DVec3::new(0.45, 0.45, 0.5);
        if extent.z > 0.0 {
            let planes = PlaneView { planes: vec![plane], ..PlaneView::default() };
            options.how = Some(How::Planes(planes));
            focus -= plane.normal * plane.signed_distance(focus);
        }
        let backend = Shared::new(Box::new(SoftwareBackend::new()));
        let session = Drawer::volume(grid, Box::new(backend.clone()), How::Planes(PlaneView::default()))?;
        let view = session.view(&options);
        Ok(Self { name, session, backend, view, focus })
    }

    fn draw(&mut self, view: &View) -> Result<Timed, Box<dyn Error>> {
        self.backend.cool()?;
        let picture = self.session.render(view)?;
        let warm = self.session.render_frames(view, WARM_FRAMES)?.report.frames;
        let warm = warm.iter().map(|frame| frame.seconds).fold(f64::INFINITY, f64::min);
        Ok(Timed { cold: 1e3 * picture.report.seconds.frame, warm: 1e3 * warm, picture })
    }

    fn full(&mut self) -> Result<Timed, Box<dyn Error>> {
        self.draw(&self.view.clone())
    }

    /// With a focus of this quality, and what is near it within this error.
    fn focused(&self, quality: f64, max_error: Option<f64>) -> View {
        let mut view = self.view.clone();
        planes_of(&mut view).focus = Some(Focus { point: self.focus, quality });
        view.dial = max_error.map_or(Dial::Full, Dial::Error);
        view
    }

    /// The quarter of a picture around the focus.
    fn quarter(&self, image: &Image) -> volery_reference::Image {
        let camera = &self.view.camera;
        let [right, up, _] = camera.axes();
        let Projection::Orthographic { height } = camera.projection else { return exact(image) };
        let offset = (self.focus - camera.target) / height * f64::from(SIDE);
        let half = SIDE / 2;
        let first = |along: f64| (along + f64::from(half / 2)).round().clamp(0.0, f64::from(half)) as u32;
        let (left, top) = (first(offset.dot(right)), first(-offset.dot(up)));
        let rows = (top..top + half).map(|row| (row * SIDE + left) as usize);
        let pixels = rows.flat_map(|start| &image.pixels[start..start + half as usize]).copied().collect();
        exact(&Image { width: half, height: half, pixels })
    }

    /// How far a picture is from the full resolution: all of it, and in the quarter around the focus.
    fn errors(&self, image: &Image, full: &Image) -> Result<[Comparison; 2], Box<dyn Error>> {
        let whole = compare(&exact(image), &exact(full))?;
        Ok([whole, compare(&self.quarter(image), &self.quarter(full))?])
    }
}

fn read(data: &Path, name: &str) -> Result<VoxelGrid, Box<dyn Error>> {
    Ok(volery::read_input(&data.join(name), None)?.volume()?.grid.clone())
}

fn scenes(data: &Path) -> Result<[Scene; 3], Box<dyn Error>> {
    Ok([
        Scene::new("mandrill 256 x 256, RGB", read(data, "mandrill_256.png")?)?,
        Scene::new("tissue 500 x 500 x 250, RGBA", volery_data::tissue([500, 500, 250]))?,
        Scene::new("mouse 512 x 512 x 512, u8", read(data, "mouse_512x512x512_uint8.raw.zst")?)?,
    ])
}

fn kilobytes(bytes: u64) -> String {
    format!("{:.0}", bytes as f64 / 1e3)
}

fn error_columns([whole, quarter]: [Comparison; 2]) -> String {
    format!("{:.5} | {:.4} | {:.5} | {:.4}", whole.rmse, whole.max, quarter.rmse, quarter.max)
}

/// The paper's table 1 again.
fn paper_table(scenes: &mut [Scene]) -> Result<(), Box<dyn Error>> {
    println!("### Table 1 of the paper, again");
    println!(
        "Fixed is the full resolution, MR a focus of quality 1. Bytes are what a backend without bricks is sent, in \
         kB; times in ms, {SIDE} x {SIDE} pixels, software backend.\n"
    );
    println!(
        "| volume | level-0 nodes | nodes fixed / MR | kB fixed / MR | fewer bytes | cold ms fixed / MR | \
         warm ms fixed / MR | bound | rmse | max | rmse in the quarter | max in the quarter |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for scene in scenes {
        let full = scene.full()?;
        let mr = scene.draw(&scene.focused(1.0, None))?;
        let (fixed_work, mr_work) = (&full.picture.report.work, &mr.picture.report.work);
        let cells = volery::data::BRICK_CELLS;
        let level_0: usize =
            scene.session.data().grid().dims().iter().map(|n| (n - 1).div_ceil(cells).max(1)).product();
        println!(
            "| {} | {level_0} | {} / {} | {} / {} | {:.1} x | {:.1} / {:.1} | {:.1} / {:.1} | {:.3} | {} |",
            scene.name,
            fixed_work.nodes.unwrap_or_default(),
            mr_work.nodes.unwrap_or_default(),
            kilobytes(fixed_work.bytes_uploaded),
            kilobytes(mr_work.bytes_uploaded),
            fixed_work.bytes_uploaded as f64 / mr_work.bytes_uploaded as f64,
            full.cold,
            mr.cold,
            full.warm,
            mr.warm,
            bound(&mr.picture),
            error_columns(scene.errors(&mr.picture.image, &full.picture.image)?),
        );
    }
    Ok(())
}

fn bound(picture: &Picture) -> f64 {
    picture.report.error.and_then(|error| error.bound_max).unwrap_or(f64::NAN)
}

/// Bytes against error, for all dials.
fn curve(scene: &mut Scene) -> Result<(), Box<dyn Error>> {
    let full = scene.full()?;
    println!("\n### {}", scene.name);
    println!("Bytes against error; a quarter of the picture's area lies around the focus.\n");
    println!(
        "| dial | nodes | kB | fewer bytes | cold ms | warm ms | bound | rmse | max | rmse in the quarter | \
         max in the quarter |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    let mut views: Vec<(String, View)> = Vec::new();
    for quality in QUALITIES {
        views.push((format!("quality {quality}"), scene.focused(quality, None)));
    }
    views.push(("full resolution".to_owned(), scene.view.clone()));
    for max_error in ERRORS {
        let view = scene.focused(1.5, Some(max_error));
        views.push((format!("quality 1.5, error {max_error}"), view));
    }
    for max_error in ERRORS {
        let mut view = scene.view.clone();
        view.dial = Dial::Error(max_error);
        views.push((format!("error {max_error}"), view));
    }
    let full_bytes = full.picture.report.work.bytes_uploaded as f64;
    for (dial, view) in views {
        let timed = scene.draw(&view)?;
        let work = &timed.picture.report.work;
        println!(
            "| {dial} | {} | {} | {:.1} x | {:.1} | {:.1} | {:.4} | {} |",
            work.nodes.unwrap_or_default(),
            kilobytes(work.bytes_uploaded),
            full_bytes / work.bytes_uploaded as f64,
            timed.cold,
            timed.warm,
            bound(&timed.picture),
            error_columns(scene.errors(&timed.picture.image, &full.picture.image)?),
        );
    }
    Ok(())
}

/// Pictures of one size, two in a row, with a margin between them.
fn sheet(pictures: &[Image]) -> Image {
    const MARGIN: u32 = 6;
    let [width, height] = pictures.first().map_or([0, 0], |picture| [picture.width, picture.height]);
    let num_rows = (pictures.len() as u32).div_ceil(2);
    let (sheet_width, sheet_height) = (2 * width + MARGIN, num_rows * (height + MARGIN) - MARGIN);
    let mut pixels = vec![[1.0; 3]; (sheet_width * sheet_height) as usize];
    for (number, picture) in (0..).zip(pictures) {
        let (left, top) = (number % 2 * (width + MARGIN), number / 2 * (height + MARGIN));
        for (row, from) in (top..).zip(picture.pixels.chunks(width as usize)) {
            pixels[(row * sheet_width + left) as usize..][..from.len()].copy_from_slice(from);
        }
    }
    Image { width: sheet_width, height: sheet_height, pixels }
}

/// An image as fine as a fur: rings and tiles under as much white noise.
fn grained(side: usize) -> Result<VoxelGrid, Box<dyn Error>> {
    let (plate, noise) = (volery_data::zone_plate([side; 2]), volery_data::noise([side, side, 1], 6));
    let value = |place: usize, channel: usize| {
        ((plate.samples().value(place, channel) + noise.samples().value(place, 0)) / 2.0) as u8
    };
    let colors: Vec<[u8; 3]> = (0..side * side).map(|place| [0, 1, 2].map(|c| value(place, c))).collect();
    Ok(VoxelGrid::new([side, side, 1], DVec3::ONE, colors)?)
}

/// Figure 6 of the paper, on a generated image: without blending, node boundaries, nearest, linear.
fn figure_6(folder: &Path) -> Result<(), Box<dyn Error>> {
    let grid = grained(512)?;
    let blended = || -> Box<dyn Backend> { Box::new(SoftwareBackend::new()) };
    let torn: Box<dyn Backend> = Box::new(Unblended(SoftwareBackend::new()));
    let rows = [
        (torn, Sampling::Linear, false),
        (blended(), Sampling::Linear, true),
        (blended(), Sampling::Nearest, false),
        (blended(), Sampling::Linear, false),
    ];
    let mut pictures = Vec::new();
    for (backend, sampling, shows_nodes) in rows {
        let mut session = Drawer::volume(grid.clone(), backend, How::Planes(PlaneView::default()))?;
        let mut view = session.view(&ViewOptions { width: 320, height: 320, ..ViewOptions::default() });
        planes_of(&mut view).focus = Some(Focus { point: DVec3::new(285.0, 285.0, 0.0), quality: 0.6 });
        (planes_of(&mut view).sampling, planes_of(&mut view).shows_nodes) = (sampling, shows_nodes);
        let target = DVec3::new(335.0, 335.0, 0.0);
        let projection = Projection::Orthographic { height: 160.0 };
        view.camera =
            Camera { eye: target - 9.0 * DVec3::Z, target, up: -DVec3::Y, projection, is_mirrored: false };
        pictures.push(session.render(&view)?.image);
    }
    Ok(write_image(&folder.join("planes-figure-6.png"), &sheet(&pictures))?)
}

/// An oblique plane through the generated head: as it is seen, and its nodes.
fn head(folder: &Path) -> Result<(), Box<dyn Error>> {
    let grid = volery_data::head([256, 320, 320], DVec3::splat(0.75));
    let plane = Plane::through(grid.extent() * 0.5, DVec3::new(0.75, 0.35, 0.55));
    let mut session =
        Drawer::volume(grid, Box::new(SoftwareBackend::new()), How::Planes(PlaneView::default()))?;
    let mut options = ViewOptions { width: 420, height: 420, ..ViewOptions::default() };
    let eye = session.data().grid().extent() * DVec3::new(0.63, 0.14, 0.49);
    let focus = Some(Focus { point: eye, quality: 0.8 });
    options.how = Some(How::Planes(PlaneView { planes: vec![plane], focus, ..PlaneView::default() }));
    let mut view = session.view(&options);
    let mut pictures = vec![session.render(&view)?.image];
    planes_of(&mut view).shows_nodes = true;
    pictures.push(session.render(&view)?.image);
    Ok(write_image(&folder.join("planes-head.png"), &sheet(&pictures))?)
}
