//! Writes the reference picture of a scene as NumPy's `.npy`: `reference_picture SCENE.json DATA OUT.npy`.
//!
//! `cargo xtask bench peers` compares VTK's pictures with it: rows from the top, f32, RGB.

use std::error::Error;
use std::fs;
use std::path::Path;

use volery_tests::view_of;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [scene, data, output] = arguments.as_slice() else {
        return Err("usage: reference_picture SCENE.json DATA OUT.npy".into());
    };
    let input = volery::read_input(Path::new(scene), Some(Path::new(data)))?;
    let view = view_of(&input);
    let grid = &input.volume.grid;
    let (width, height) = (view.width, view.height);
    let truth = volery_reference::render(grid, &view.camera, &view.transfer, view.background, width, height)?;

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
