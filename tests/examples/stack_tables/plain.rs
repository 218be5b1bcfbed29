//! A stack as the paper draws it: slices alone, without the strips of the outline.

use std::error::Error;

use volery::{Backend, Image, Input, InputData};
use volery_frame::{Content, Counted, Frame, PictureView, Sheet, SheetTransfer, SheetVertices, Sheets};
use volery_slicing::{MeshSheet, Planes, Slicer};
use volery_software::SoftwareBackend;

/// Draws planes across the view of a scene.
pub(crate) fn draw(input: &Input, count: usize) -> Result<Image, Box<dyn Error>> {
    let (InputData::Grid(file), Some(scene)) = (&input.data, &input.scene) else {
        return Err("expected a scene of a grid".into());
    };
    let camera = scene.camera.ok_or("a scene without a camera")?;
    let slicer = Slicer::new(file.grid.clone())?;
    let values = &file.array.as_ref().ok_or("a grid without an array")?.name;
    let values = &slicer.grid().array(values).ok_or("the grid lacks its array")?.values;
    let [_, _, forward] = camera.axes();
    let stack = slicer.slice(&Planes::over(slicer.grid(), forward, count)?)?;
    let mesh = slicer.mesh_of_stack(stack, values, None)?;
    let sheet = |sheet: &MeshSheet| Sheet {
        first: sheet.triangles.start,
        count: sheet.triangles.end - sheet.triangles.start,
        thickness: sheet.thickness.map(|t| t as f32),
        counted: Counted::All,
    };
    let eye = (camera.eye - mesh.origin).dot(mesh.normal);
    let sheets: Vec<_> = mesh.back_to_front(eye).map(sheet).collect();
    let of_vertices = mesh.points.iter().map(|point| f64::from(point[3]));
    let range = of_vertices
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
    let content = Content::Sheets(Sheets {
        revision: None,
        normal: mesh.normal,
        origin: mesh.origin,
        vertices: SheetVertices::Exact { points: &mesh.points, gradients: &[] },
        triangles: &mesh.triangles,
        sheets: &sheets,
        transfer: &SheetTransfer::new(volery_tests::transfer_of(scene), range),
        light: None,
    });
    let [width, height] = scene.size.ok_or("a scene without a size")?;
    let background = scene.background.ok_or("a scene without a background")?.map(|channel| channel as f32);
    let frame = Frame { view: PictureView { width, height, camera, background, meshes: &[] }, content };
    Ok(SoftwareBackend::new().draw(&frame)?.image)
}
