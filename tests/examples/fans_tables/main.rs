//! Tables and picture of docs/fans.md: `fans_tables DATA PICTURES`.
//!
//! `cargo xtask bench fans` runs it. Prints Markdown, and writes `fans.png` into the folder `PICTURES`. Times are
//! medians of the frames after the first, of the software backend where nothing else is said; errors are against the
//! picture in f64 of the trilinear field between the samples.

mod opacity;

use std::error::Error;
use std::path::{Path, PathBuf};

use volery::glam::DVec3;
use volery::output::write_image;
use volery::{
    BackendChoice, ControlPoint, Dial, How, Image, Thickness, TransferFunction, View, ViewOptions,
    VolumeData, open_backend,
};
use volery_reference::metrics::compare;
use volery_software::SoftwareBackend;
use volery_tests::{Drawer, exact, read_scene, view_of};

const FRAMES: usize = 4;

/// The paper's, of the range of values.
const FIGURE_9: [f64; 3] = [0.0, 0.18, 0.48];
const CURVE: [f64; 10] = [0.0, 0.01, 0.02, 0.05, 0.09, 0.18, 0.25, 0.33, 0.48, 0.6];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [data, pictures] = arguments.as_slice() else {
        return Err("usage: fans_tables DATA PICTURES".into());
    };
    head(pictures)?;
    Engine::open(data)?.tables()?;
    opacity::tables();
    Ok(())
}

/// One picture, with its times in seconds.
struct Timed {
    image: Image,
    nodes: usize,
    triangles: usize,
    select: f64,
    draw: f64,
    frame: f64,
}

/// The last of some frames, with the times of the median of those after the first.
fn draw(session: &mut Drawer<VolumeData>, view: &View) -> Result<Timed, Box<dyn Error>> {
    let mut frames = Vec::new();
    let mut last = session.render(view)?;
    for _ in 1..FRAMES {
        last = session.render(view)?;
        frames.push(last.report.seconds);
    }
    frames.sort_by(|a, b| a.frame.total_cmp(&b.frame));
    let seconds = frames[frames.len() / 2];
    Ok(Timed {
        image: last.image,
        nodes: last.report.work.nodes.unwrap_or_default(),
        triangles: last.report.work.triangles.unwrap_or_default(),
        select: seconds.select,
        draw: seconds.draw,
        frame: seconds.frame,
    })
}

/// The scene, by both techniques, and its truth.
struct Engine {
    software: Drawer<VolumeData>,
    /// On the best device of wgpu.
    gpu: Drawer<VolumeData>,
    /// Of rays.
    view: View,
    truth: volery_reference::Image,
}

impl Engine {
    fn open(data: &Path) -> Result<Self, Box<dyn Error>> {
        let input = read_scene(data, "engine");
        let view = view_of(&input);
        let open = |choice| -> Result<Drawer<VolumeData>, Box<dyn Error>> {
            Ok(Drawer::volume(input.volume()?.grid.clone(), open_backend(choice)?, How::Raycast)?)
        };
        let (mut software, gpu) = (open(BackendChoice::Software)?, open(BackendChoice::Wgpu)?);
        let mut picture = software.render(&view)?;
        let truth = software.verify(&view, &mut picture, &|_| ())?;
        Ok(Self { software, gpu, view, truth })
    }

    fn errors(&self, timed: &Timed) -> Result<String, Box<dyn Error>> {
        let found = compare(&exact(&timed.image), &self.truth)?;
        Ok(format!("{:.5} | {:.4}", found.rmse, found.max))
    }

    fn tables(&mut self) -> Result<(), Box<dyn Error>> {
        let [width, height] = [self.view.width, self.view.height];
        println!("### Figure 9 of the paper, again");
        println!(
            "engine 256 x 256 x 128, {width} x {height} pixels, {} threads; wgpu is {}. The paper has 5.20 M, \
             0.19 M and 15.8 K cubes of 256 x 256 x 110 samples by its own transfer function, and 37.5, 0.95 and \
             0.070 s.\n",
            rayon::current_num_threads(),
            self.gpu.render(&self.view)?.report.backend.device,
        );
        println!(
            "| tolerance | thickness | cubes | triangles | per cube | selection s | rendering s | M cubes/s | rmse | \
             max |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|");
        for tolerance in FIGURE_9 {
            for (thickness, name) in [(Thickness::Exact, "exact"), (Thickness::Interpolated, "interpolated")]
            {
                let view =
                    View { dial: Dial::Tolerance(tolerance), how: How::Fans(thickness), ..self.view.clone() };
                let drawn = [draw(&mut self.software, &view)?, draw(&mut self.gpu, &view)?];
                for (device, timed) in ["software", "wgpu"].iter().zip(drawn) {
                    println!(
                        "| {} % | {name}, {device} | {} | {} | {:.2} | {:.4} | {:.4} | {:.1} | {} |",
                        tolerance * 100.0,
                        timed.nodes,
                        timed.triangles,
                        timed.triangles as f64 / timed.nodes as f64,
                        timed.select,
                        timed.draw,
                        timed.nodes as f64 / timed.draw / 1e6,
                        self.errors(&timed)?,
                    );
                }
            }
        }
        self.paper()?;
        self.curve()
    }

    /// All cubes of the paper's count, at full resolution.
    fn paper(&mut self) -> Result<(), Box<dyn Error>> {
        const CUBES: usize = 5_200_000;
        let samples = self.software.data().grid().samples();
        let mut voxels_from = [0; 257];
        for place in 0..samples.len() {
            voxels_from[samples.value(place, 0) as usize] += 1;
        }
        // How many voxels have this value or a higher one.
        for value in (0..256).rev() {
            voxels_from[value] += voxels_from[value + 1];
        }
        let value = (1..256).min_by_key(|&value| CUBES.abs_diff(voxels_from[value])).unwrap_or_default();
        println!("\n### As many cubes as the paper");
        println!("Everything from the value {value} on is visible, at tolerance 0.\n");
        println!(
            "| opacity per voxel | cubes | selection s | rendering s | M cubes/s |\n|---|---|---|---|---|"
        );
        let scene = self.view.transfer.clone();
        for opacity in [0.01, 0.1] {
            let point = |value: f64, color, opacity| ControlPoint { value, color, opacity };
            let step = value as f64 - 0.5;
            self.view.transfer = TransferFunction::new(
                vec![
                    point(step, [0.0; 3], 0.0),
                    point(step, [0.3, 0.3, 0.9], opacity),
                    point(255.0, [1.0, 0.8, 0.4], opacity),
                ],
                1.0,
            )?
            .into();
            let how = How::Fans(Thickness::Exact);
            let timed = draw(&mut self.software, &View { how, ..self.view.clone() })?;
            println!(
                "| {opacity} | {} | {:.4} | {:.4} | {:.1} |",
                timed.nodes,
                timed.select,
                timed.draw,
                timed.nodes as f64 / timed.draw / 1e6,
            );
        }
        self.view.transfer = scene;
        Ok(())
    }

    fn curve(&mut self) -> Result<(), Box<dyn Error>> {
        println!("\n### Time against error");
        println!(
            "Fans with exact thickness, and rays at the same tolerance; a frame is selection and rendering.\n"
        );
        println!(
            "| tolerance | fans: cubes | frame ms | rmse | max | rays: bricks | frame ms | rmse | max |\n\
             |---|---|---|---|---|---|---|---|---|"
        );
        for tolerance in CURVE {
            let view = View { dial: Dial::Tolerance(tolerance), ..self.view.clone() };
            let [fans, rays] = [&View { how: How::Fans(Thickness::Exact), ..view.clone() }, &view]
                .map(|view| draw(&mut self.software, view));
            let [fans, rays] = [fans?, rays?];
            println!(
                "| {:.0} % | {} | {:.1} | {} | {} | {:.1} | {} |",
                tolerance * 100.0,
                fans.nodes,
                fans.frame * 1e3,
                self.errors(&fans)?,
                rays.nodes,
                rays.frame * 1e3,
                self.errors(&rays)?,
            );
        }
        Ok(())
    }
}

/// A generated head at the paper's tolerances, side by side.
fn head(folder: &Path) -> Result<(), Box<dyn Error>> {
    const SIDE: usize = 320;
    let grid = volery_data::head_u8([128, 160, 160], DVec3::ONE);
    let mut session = Drawer::volume(grid, Box::new(SoftwareBackend::new()), How::Fans(Thickness::Exact))?;
    let view =
        session.view(&ViewOptions { width: SIDE as u32, height: SIDE as u32, ..ViewOptions::default() });
    let mut pictures = Vec::new();
    for tolerance in FIGURE_9 {
        pictures.push(session.render(&View { dial: Dial::Tolerance(tolerance), ..view.clone() })?.image);
    }
    let rows =
        (0..SIDE).flat_map(|row| pictures.iter().map(move |picture| &picture.pixels[row * SIDE..][..SIDE]));
    let pixels = rows.flatten().copied().collect();
    let width = view.width * pictures.len() as u32;
    Ok(write_image(&folder.join("fans.png"), &Image { width, height: view.height, pixels })?)
}
