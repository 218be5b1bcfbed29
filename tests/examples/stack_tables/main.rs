//! Tables and picture of docs/stacks.md: `stack_tables DATA PICTURES`.
//!
//! `cargo xtask bench stacks` runs it. Prints Markdown, and writes `stacks.png` into the folder `PICTURES`. Times are
//! medians of the frames after the first, on the software backend, slicing included; errors are against the exact
//! picture in f64, by VTK's interpolation in cells.

mod cells;
mod plain;

use std::error::Error;
use std::path::{Path, PathBuf};

use volery::output::write_image;
use volery::{GridData, How, Image, Input, InputData, Picture, StackView, View};
use volery_reference::metrics::{Comparison, compare};
use volery_software::SoftwareBackend;
use volery_tests::{Drawer, exact, read_scene, view_of};

const SCENES: [&str; 2] = ["bluntfin", "k3d_fem"];
const COUNTS: [usize; 6] = [32, 64, 128, 256, 512, 1024];
/// Planes of the first step of semi-adaptive slicing.
const FIRST_COUNTS: [usize; 6] = [8, 16, 32, 64, 128, 256];
const FRAMES: usize = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [data, pictures] = arguments.as_slice() else {
        return Err("usage: stack_tables DATA PICTURES".into());
    };
    for name in SCENES {
        Scene::open(data, name)?.curves()?;
    }
    Scene::open(data, SCENES[0])?.picture(&pictures.join("stacks.png"))?;
    cells::tables(data)
}

/// A scene of a grid and its exact picture.
struct Scene {
    name: &'static str,
    input: Input,
    session: Drawer<GridData>,
    view: View,
    truth: volery_reference::Image,
}

impl Scene {
    fn open(data: &Path, name: &'static str) -> Result<Self, Box<dyn Error>> {
        let input = read_scene(data, name);
        let InputData::Grid(file) = &input.data else { return Err(format!("{name} is no grid").into()) };
        let array = file.array.as_ref().map(|array| array.name.as_str());
        let backend = Box::new(SoftwareBackend::new());
        let mut session = Drawer::grid(file.grid.clone(), array, backend)?;
        let view = view_of(&input);
        let mut picture = session.render(&view)?;
        let truth = session.verify(&view, &mut picture, &|_| ())?;
        Ok(Self { name, input, session, view, truth })
    }

    /// The view, sliced another way.
    fn sliced(&self, num_slices: usize, adaptive: Option<f64>) -> View {
        let how = How::Stack(StackView { num_slices, adaptive, ..StackView::default() });
        View { how, ..self.view.clone() }
    }

    fn distance(&self, image: &Image) -> Result<Comparison, Box<dyn Error>> {
        Ok(compare(&exact(image), &self.truth)?)
    }

    fn curves(&mut self) -> Result<(), Box<dyn Error>> {
        println!("\n### {}\n", self.name);
        println!(
            "| planes | slicing, ms | drawing, ms | both, ms | triangles | rmse | max | rmse of slices alone |"
        );
        println!("|---|---|---|---|---|---|---|---|");
        for count in COUNTS {
            let plain = plain::draw(&self.input, count)?;
            let plain = format!("{:.5}", self.distance(&plain)?.rmse);
            self.row(&format!("{count}"), &self.sliced(count, None), &plain)?;
        }
        for count in FIRST_COUNTS {
            self.row(&format!("{count} and finer for thin cells"), &self.sliced(count, Some(1.0)), "")?;
        }
        Ok(())
    }

    fn row(&mut self, what: &str, view: &View, last: &str) -> Result<(), Box<dyn Error>> {
        let Picture { image, report } = self.session.render_frames(view, FRAMES + 1)?;
        let found = self.distance(&image)?;
        let seconds = report.seconds;
        let slicing = seconds.geometry.unwrap_or_default();
        println!(
            "| {what} | {:.1} | {:.1} | {:.1} | {} | {:.5} | {:.4} | {last} |",
            1e3 * slicing,
            1e3 * seconds.draw,
            1e3 * seconds.frame,
            report.work.triangles.unwrap_or_default(),
            found.rmse,
            found.max,
        );
        Ok(())
    }

    /// Few slices, as they are and with the strips of the outline, beside many.
    fn picture(&mut self, file: &Path) -> Result<(), Box<dyn Error>> {
        const FEW: usize = 24;
        let mut pictures = vec![plain::draw(&self.input, FEW)?];
        for count in [FEW, 512] {
            pictures.push(self.session.render(&self.sliced(count, None))?.image);
        }
        let (width, height) = (pictures[0].width, pictures[0].height);
        let row = |row: u32| {
            let start = (row * width) as usize;
            pictures.iter().flat_map(move |picture| &picture.pixels[start..start + width as usize])
        };
        let pixels = (0..height).flat_map(row).copied().collect();
        Ok(write_image(file, &Image { width: width * pictures.len() as u32, height, pixels })?)
    }
}
