//! Drawing on a device and into textures of somebody else's.

use volery_conformance::Property;
use volery_frame::{Backend, DrawError, PictureView};
use volery_scene::{Camera, Projection};
use volery_wgpu::{OpenError, USEFUL_FEATURES, WgpuBackend, needed_limits};

#[path = "../../examples/embed.rs"]
#[expect(dead_code, reason = "the example's own main")]
mod example;

/// What this file checks.
pub(crate) const ALL: &[Property] = &[
    ("a_texture_shows_what_is_read_back", a_texture_shows_what_is_read_back),
    ("targets_that_do_not_fit_are_named", targets_that_do_not_fit_are_named),
    ("devices_with_too_little_are_named", devices_with_too_little_are_named),
];

/// Two shaders end a picture in the same way, but for what a compiler makes of them.
const MAX: f32 = 1e-6;

fn a_texture_shows_what_is_read_back(_: &mut dyn Backend) {
    let max = example::largest_difference().expect("the device draws");
    println!("largest difference {max:e} (threshold {MAX:e})");
    assert!(max <= MAX, "{max:e}, expected at most {MAX:e}");
}

fn device(limits: wgpu::Limits) -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::default();
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))
        .expect("there is a device");
    let descriptor = wgpu::DeviceDescriptor {
        required_features: adapter.features() & USEFUL_FEATURES,
        required_limits: limits,
        ..Default::default()
    };
    pollster::block_on(adapter.request_device(&descriptor)).expect("the device opens")
}

/// Too small, of another format, or none that can be drawn to; the backend goes on.
fn targets_that_do_not_fit_are_named(_: &mut dyn Backend) {
    let (device, queue) = device(needed_limits());
    let mut backend = WgpuBackend::with_device(device.clone(), queue).expect("the device is good enough");
    let target = |size: u32, usage| {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage,
            view_formats: &[],
        });
        texture.create_view(&wgpu::TextureViewDescriptor::default())
    };
    let (drawn_to, copied) = (wgpu::TextureUsages::RENDER_ATTACHMENT, wgpu::TextureUsages::COPY_SRC);
    let camera = Camera {
        eye: glam::DVec3::Z,
        target: glam::DVec3::ZERO,
        up: glam::DVec3::Y,
        projection: Projection::Orthographic { height: 1.0 },
        is_mirrored: false,
    };
    let view = PictureView { width: 8, height: 8, camera, background: [0.5; 3], meshes: &[] };
    let mut ends = |target: &wgpu::TextureView, format| {
        backend.begin(&view).expect("the picture is small");
        let ended = backend.finish_into(target, format);
        assert_eq!(backend.finish().err(), Some(DrawError::NoPicture), "after the end");
        ended
    };
    let small = ends(&target(7, drawn_to), wgpu::TextureFormat::Rgba8Unorm);
    let expected = "target of 7x7 pixels, expected at least 8x8";
    assert_eq!(small, Err(DrawError::Device(expected.to_owned())));
    for (target, format) in [
        (target(8, copied), wgpu::TextureFormat::Rgba8Unorm),
        (target(8, drawn_to), wgpu::TextureFormat::Rgba16Float),
    ] {
        let found = ends(&target, format);
        assert!(matches!(found, Err(DrawError::Device(_))), "{found:?}, expected DrawError::Device");
    }
    assert_eq!(ends(&target(9, drawn_to), wgpu::TextureFormat::Rgba8Unorm), Ok(()));
}

fn devices_with_too_little_are_named(_: &mut dyn Backend) {
    let (device, queue) = device(wgpu::Limits::downlevel_defaults());
    let found = WgpuBackend::with_device(device, queue).err();
    let is_named = |error: &OpenError| matches!(error, OpenError::Limit { found: 4, expected: 6, .. });
    assert!(found.as_ref().is_some_and(is_named), "{found:?}, expected OpenError::Limit");
}
