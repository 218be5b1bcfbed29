//! Integration tests of the workspace: what the crates promise together, on real data and across backends.
//!
//! The library holds what the tests share; the tests are in `tests/integration`, a module per family of hard
//! cases. A test that cannot run here fails, unless `VOLERY_WITHOUT_DATA` or `VOLERY_WITHOUT_GPU` is set; then
//! it prints `ignored: NAME (reason)`, which `cargo xtask test` counts as skipped.

use std::env;
use std::path::{Path, PathBuf};

use glam::DVec3;
use volery::{
    Backend, BackendChoice, Data, Dial, How, Image, Input, InputData, Picture, StackView, View, open_backend,
    read_input,
};
use volery_frame::{Content, DrawError, Planes};
use volery_io::SceneFile;
use volery_io::scene_file::SceneTransfer;
use volery_reference::metrics::{Comparison, compare};
use volery_scene::{Camera, TransferFunction, VoxelGrid};

mod drawer;
mod shared;

pub use drawer::{Drawer, planes_of, stack_of, values_of, with_stack};
pub use shared::Shared;

/// The folder of real data: `VOLERY_DATA`, or `../shared/data` from the root of the workspace. `None` means that
/// the test is ignored, and has been printed.
///
/// # Panics
/// When the folder is missing and `VOLERY_WITHOUT_DATA` does not allow it.
pub fn data_folder(test: &str) -> Option<PathBuf> {
    if env::var_os("VOLERY_WITHOUT_DATA").is_some() {
        println!("ignored: {test} (no data)");
        return None;
    }
    let usual = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = env::var_os("VOLERY_DATA").map_or_else(usual, PathBuf::from);
    assert!(
        folder.is_dir(),
        "{test} needs real data: {} is no folder; set VOLERY_DATA, or VOLERY_WITHOUT_DATA to do without",
        folder.display()
    );
    Some(folder)
}

/// The scene files that lie beside the data.
pub fn scenes_folder(data: &Path) -> PathBuf {
    data.join("../peers/scenes")
}

/// A scene of the peers and its volume.
///
/// # Panics
/// When it cannot be read.
pub fn read_scene(data: &Path, name: &str) -> Input {
    let file = scenes_folder(data).join(format!("{name}.json"));
    read_input(&file, Some(data)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What a scene file says to draw, at full resolution.
///
/// # Panics
/// When the input came without a scene file, or one that leaves something open.
pub fn view_of(input: &Input) -> View {
    let scene = input.scene.as_ref().expect("read from a scene file");
    let size = scene.size.expect("a scene with a size");
    let camera = scene.camera.expect("a scene with a camera");
    let background = scene.background.expect("a scene with a background");
    let view = matter_view(camera, transfer_of(scene).clone(), background, size);
    let is_grid = matches!(input.data, InputData::Grid(_));
    let how = if is_grid { How::Stack(StackView::default()) } else { How::Raycast };
    View { meshes: input.meshes.clone(), how, ..view }
}

/// A view of all matter in full resolution, in front of `background`.
pub fn matter_view(
    camera: Camera,
    transfer: TransferFunction,
    background: [f64; 3],
    [width, height]: [u32; 2],
) -> View {
    let meshes = [].into();
    let (transfer, dial, interest, how) = (transfer.into(), Dial::Full, [].into(), How::Raycast);
    View { width, height, camera, background, meshes, transfer, dial, interest, how }
}

/// The transfer function of a scene that has one over values.
///
/// # Panics
/// When it has none, or another.
pub fn transfer_of(scene: &SceneFile) -> &TransferFunction {
    match &scene.transfer {
        Some(SceneTransfer::Values(transfer)) => transfer,
        other => panic!("expected a transfer function over values, found {other:?}"),
    }
}

/// A backend for a test. `None` means that the test is ignored for want of a GPU, and has been printed.
///
/// # Panics
/// When wgpu has no device and `VOLERY_WITHOUT_GPU` does not allow it.
pub fn backend(choice: BackendChoice, test: &str) -> Option<Box<dyn Backend>> {
    if choice == BackendChoice::Wgpu && env::var_os("VOLERY_WITHOUT_GPU").is_some() {
        println!("ignored: {test} (no GPU)");
        return None;
    }
    Some(
        open_backend(choice)
            .unwrap_or_else(|error| panic!("{test}: {error}; set VOLERY_WITHOUT_GPU to do without")),
    )
}

/// One picture of a session.
///
/// # Panics
/// When it cannot be drawn.
pub fn draw<D: Data>(session: &mut Drawer<D>, view: &View) -> Picture {
    session.render(view).unwrap_or_else(|error| panic!("{error}"))
}

/// A picture for the metrics.
///
/// # Panics
/// When the picture has not as many pixels as it says.
pub fn exact(image: &Image) -> volery_reference::Image {
    volery_reference::Image::from_f32(image.width, image.height, &image.pixels).expect("pictures are whole")
}

/// World size of [`smooth`].
pub const SMOOTH_EXTENT: f64 = 8.0;

/// A smooth field without symmetry, in [0, 1], sampled with `cells` cells per axis.
///
/// # Panics
/// When there is no cell.
pub fn smooth(cells: usize) -> VoxelGrid {
    let step = SMOOTH_EXTENT / cells as f64;
    let mut values = Vec::with_capacity((cells + 1).pow(3));
    for z in 0..=cells {
        for y in 0..=cells {
            for x in 0..=cells {
                let p = DVec3::new(x as f64, y as f64, z as f64) * step;
                let wave = (0.9 * p.x + 0.3 * p.z).sin() * (0.7 * p.y).cos() * (0.5 * p.z + 0.2 * p.x).sin();
                values.push(0.5 + 0.5 * wave);
            }
        }
    }
    VoxelGrid::new([cells + 1; 3], DVec3::splat(step), values).expect("a grid of at least one cell")
}

/// Prints how far two pictures of one size are apart.
///
/// # Panics
/// When they are of different size.
pub fn distance(what: &str, left: &volery_reference::Image, right: &volery_reference::Image) -> Comparison {
    let found = compare(left, right).expect("pictures of one view");
    println!("{what}: rmse {:.6}, max {:.6}, {:.1} dB", found.rmse, found.max, found.psnr_db);
    found
}

/// Prints a threshold beside the value that was measured, and compares them.
///
/// # Panics
/// When the value is above, or no number.
pub fn at_most(what: &str, measured: f64, threshold: f64) {
    println!("{what}: {measured:.3e}, at most {threshold:.3e}");
    assert!(measured <= threshold, "{what}: {measured:e}, expected at most {threshold:e}");
}

/// Draws planes as if no node touched a coarser one: what blending is there for.
pub struct Unblended<B>(pub B);

impl<B: Backend> Backend for Unblended<B> {
    volery_conformance::hand_on!(self, self.0 => device set_volume volume is_resident upload evict resident_bytes brick_bytes room reserve
        uploaded_bytes begin begin_windows draw_windows wait finished finish);

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        let Content::Planes(planes) = *content else { return self.0.draw_part(content) };
        let mut bricks = planes.bricks.to_vec();
        bricks.iter_mut().for_each(|brick| brick.low_corners = 0);
        self.0.draw_part(&Content::Planes(Planes { bricks: &bricks, ..planes }))
    }
}
