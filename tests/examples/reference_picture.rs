//! Writes the reference picture of a scene as NumPy's `.npy`: `reference_picture SCENE.json DATA OUT.npy`,
//! or of a plane through its volume: `reference_picture SCENE.json DATA OUT.npy NX,NY,NZ,D`.
//!
//! `cargo xtask bench peers` compares VTK's pictures with it: rows from the top, f32, RGB.

use std::error::Error;
use std::fs;
use std::path::Path;

use volery::glam::DVec3;
use volery::{InputData, Plane, View};
use volery_reference::{GridTracer, PlaneScene};
use volery_tests::{values_of, view_of};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let (scene, data, output, plane) = match arguments.as_slice() {
        [scene, data, output] => (scene, data, output, None),
        [scene, data, output, plane] => (scene, data, output, Some(parse_plane(&plane.to_string_lossy())?)),
        _ => return Err("usage: reference_picture SCENE.json DATA OUT.npy [NX,NY,NZ,D]".into()),
    };
    let input = volery::read_input(Path::new(scene), Some(Path::new(data)))?;
    let view = view_of(&input);
    let (width, height) = (view.width, view.height);
    let View { camera, background, .. } = &view;
    let transfer = values_of(&view);
    let truth = match (&input.data, plane) {
        (InputData::Grid(file), None) => {
            let array = file.array.as_ref().ok_or("a grid without an array")?;
            let array = file.grid.array(&array.name).ok_or("the grid lacks its array")?;
            let tracer = GridTracer::new(&file.grid, &array.values, transfer)?;
            tracer.render(camera, *background, width, height, &|_| {})?
        }
        (_, None) => {
            let grid = &input.volume()?.grid;
            volery_reference::render(grid, camera, transfer, *background, width, height)?
        }
        (_, Some(plane)) => {
            let (grid, planes) = (&input.volume()?.grid, &[plane]);
            let scene =
                PlaneScene { grid, planes, transfer, nearest: false, is_transparent: false, meshes: &[] };
            scene.render(camera, *background, [width, height], &|_| {})?
        }
    };

    let described = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}, 3), }}");
    // Magic, version and length take 10 bytes; the header ends with a line break on a multiple of 64.
    let padding = 63 - (10 + described.len()) % 64;
    let header = format!("{described}{}\n", " ".repeat(padding));
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len())?.to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(truth.pixels().iter().flatten().flat_map(|&channel| (channel as f32).to_le_bytes()));
    fs::write(output, bytes)?;
    Ok(())
}

fn parse_plane(text: &str) -> Result<Plane, Box<dyn Error>> {
    let numbers: Vec<f64> = text.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let [x, y, z, distance] = numbers[..] else { return Err("expected NX,NY,NZ,D".into()) };
    Ok(Plane { normal: DVec3::new(x, y, z), distance })
}
