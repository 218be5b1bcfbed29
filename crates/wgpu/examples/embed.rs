//! Draws on a device of this program's own, into a texture of its own, without reading the picture back; then compares
//! the texture with the same picture read back, and prints the largest difference.

use std::error::Error;
use std::sync::mpsc;

use glam::DVec3;
use volery_frame::{
    Backend, Content, Cube, Cubes, Frame, PictureView, Revision, TexelType, Thickness, VolumeLayout,
};
use volery_scene::{Camera, TriangleMesh};
use volery_wgpu::{USEFUL_FEATURES, WgpuBackend, needed_limits};

const SIZE: [u32; 2] = [320, 240];

/// Wide enough for the comparison; a window's format does as well.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
const PIXEL_BYTES: u32 = 16;

fn main() -> Result<(), Box<dyn Error>> {
    println!("largest difference from the picture that is read back: {:e}", largest_difference()?);
    Ok(())
}

/// Of any channel, between the texture and the picture that is read back.
pub(crate) fn largest_difference() -> Result<f32, Box<dyn Error>> {
    let (device, queue) = open()?;
    let mut backend = WgpuBackend::with_device(device.clone(), queue.clone())?;
    backend.set_volume(&layout())?;
    let (cubes, meshes) = (cubes(), [surface()?]);
    let frame = Frame { view: view(&meshes), content: content(&cubes) };
    let read_back = backend.draw(&frame)?.image;

    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
    backend.begin(&frame.view)?;
    backend.draw_part(&frame.content)?;
    backend.finish_into(&target, FORMAT)?;

    let shown = read(&device, &queue, &texture)?;
    let pixels = read_back.pixels.iter().zip(shown.chunks_exact(4));
    let differences = pixels.flat_map(|(a, b)| [0, 1, 2].map(|i| (a[i] - b[i]).abs()));
    Ok(differences.fold(0.0, f32::max))
}

/// A device as any program opens one.
fn open() -> Result<(wgpu::Device, wgpu::Queue), Box<dyn Error>> {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    Ok(pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("embed"),
        required_features: adapter.features() & USEFUL_FEATURES,
        required_limits: needed_limits(),
        ..Default::default()
    }))?)
}

fn layout() -> VolumeLayout {
    VolumeLayout {
        revision: Revision::new(),
        cells: [16; 3],
        spacing: DVec3::ONE,
        brick_cells: 8,
        texel: TexelType::U8,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 255.0],
    }
}

/// A wall of glass bricks, farther ones first.
fn cubes() -> Vec<Cube> {
    let places = (0..16 * 16).map(|i| [i % 16, i / 16]);
    let cube = |[x, y]: [u16; 2]| Cube {
        index: [x, y, 8],
        level: 0,
        color: [f32::from(x) / 15.0, f32::from(y) / 15.0, 0.5],
        extinction: 0.5,
    };
    places.map(cube).collect()
}

fn content(cubes: &[Cube]) -> Content<'_> {
    Content::Cubes(Cubes { revision: None, cubes, thickness: Thickness::Exact })
}

/// An opaque triangle behind the bricks.
fn surface() -> Result<TriangleMesh, Box<dyn Error>> {
    let points = [[2.0, 2.0, 4.0], [14.0, 3.0, 4.0], [7.0, 15.0, 2.0]].map(DVec3::from_array);
    Ok(TriangleMesh::new(points.to_vec(), vec![[0, 1, 2]], [0.9, 0.8, 0.2])?)
}

fn view(meshes: &[TriangleMesh]) -> PictureView<'_> {
    let [width, height] = SIZE;
    let camera = Camera::fitted(DVec3::splat(16.0), 20.0, 75.0, f64::from(width) / f64::from(height), true);
    PictureView { width, height, camera, background: [0.1, 0.2, 0.3], meshes }
}

/// The numbers of a texture.
fn read(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    texture: &wgpu::Texture,
) -> Result<Vec<f32>, Box<dyn Error>> {
    let [width, height] = SIZE;
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("staging"),
        size: u64::from(width * height * PIXEL_BYTES),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                // A multiple of 256, as copies want it.
                bytes_per_row: Some(width * PIXEL_BYTES),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let (sender, receiver) = mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| drop(sender.send(result)));
    device.poll(wgpu::PollType::wait_indefinitely())?;
    receiver.recv()??;
    Ok(bytemuck::cast_slice(&staging.get_mapped_range(..)?).to_vec())
}
