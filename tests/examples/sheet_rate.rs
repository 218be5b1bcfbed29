//! Times the software executor on the slices of a grid's scene: `sheet_rate SCENE.json DATA COUNT REPEATS` prints
//! `{"triangles": N, "slice_seconds": S, "seconds": [..]}`.
//!
//! Planes are across the view. The mesh is made once; the first picture is not timed.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use volery_frame::{Backend, Content, Frame, Sheet, SheetTransfer, SheetVertices, Sheets};
use volery_io::{GridOptions, SceneFile, read_grid};
use volery_slicing::{Planes, Rays, Slicer};
use volery_software::SoftwareBackend;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, data, count, repeats] = arguments.as_slice() else {
        return Err("usage: sheet_rate SCENE.json DATA COUNT REPEATS".into());
    };
    let scene = SceneFile::read(Path::new(scene))?;
    let grid = read_grid(&Path::new(data).join(&scene.input.file), &GridOptions::default())?.grid;
    let slicer = Slicer::new(grid)?;
    let array = slicer.grid().arrays().iter().find(|array| Some(&array.name) == scene.input.array.as_ref());
    let values = &array.ok_or("the scene's array is not in the grid")?.values;
    let normal = (scene.camera.target - scene.camera.eye).normalize();
    let planes = Planes::over(slicer.grid(), normal, count.parse()?)?;
    let start = Instant::now();
    let mut mesh = slicer.mesh(&planes, values, None)?;
    mesh.orient_strips(Rays::From(scene.camera.eye));
    let slice_seconds = start.elapsed().as_secs_f64();
    let eye = (scene.camera.eye - mesh.origin).dot(mesh.normal);
    let sheet = |sheet: &volery_slicing::MeshSheet| Sheet {
        first: sheet.triangles.start,
        count: sheet.triangles.end - sheet.triangles.start,
        thickness: sheet.thickness.map(|t| t as f32),
    };
    let sheets: Vec<_> = mesh.back_to_front(eye).map(sheet).collect();
    let range = mesh.points.iter().map(|point| f64::from(point[3]));
    let range = [range.clone().fold(f64::INFINITY, f64::min), range.fold(f64::NEG_INFINITY, f64::max)];
    let content = Sheets {
        revision: Sheets::next_revision(),
        normal: mesh.normal,
        origin: mesh.origin,
        vertices: SheetVertices::Exact { points: &mesh.points, gradients: &mesh.gradients },
        triangles: &mesh.triangles,
        sheets: &sheets,
        transfer: &SheetTransfer::new(&scene.transfer, range),
        light: None,
    };
    let frame = Frame {
        width: scene.size[0],
        height: scene.size[1],
        camera: scene.camera,
        background: scene.background.map(|channel| channel as f32),
        meshes: &[],
        content: Content::Sheets(content),
    };
    let mut backend = SoftwareBackend::new();
    let first = backend.draw(&frame)?.image;
    let mut seconds = Vec::new();
    for _ in 0..repeats.parse()? {
        let start = Instant::now();
        let image = backend.draw(&frame)?.image;
        seconds.push(start.elapsed().as_secs_f64());
        if image != first {
            return Err("the same frame gave another picture".into());
        }
    }
    let sum: f64 = first.pixels.as_flattened().iter().map(|&x| f64::from(x)).sum();
    println!(
        "{{\"triangles\": {}, \"vertices\": {}, \"slice_seconds\": {slice_seconds}, \"sum\": {sum}, \"seconds\": {seconds:?}}}",
        mesh.triangles.len(),
        mesh.points.len()
    );
    Ok(())
}
