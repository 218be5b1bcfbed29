//! From a frame of cubes to the numbers that the shader reads: in f64 up to the last step.

use glam::{DVec3, IVec3};
use volery_cubefan::LatticeEye;
use volery_frame::VolumeLayout;
use volery_shaders::cubes;

use crate::picture::{Picture, Tile};
use crate::tiles::{Affine, TileView};

/// An eye beyond the domain by so many lattice planes is far: places are then told from the domain's end.
const FAR_PLANES: i32 = 64;

/// Parts of a direction below this are none: the shader's smallest number.
const TINY: f64 = cubes::TINY as f64;

/// The shader's frame for a tile.
pub(crate) fn shader_frame(picture: &Picture, layout: &VolumeLayout, tile: Tile) -> cubes::Frame {
    let Picture { view: frame, surfaces, .. } = picture;
    let unit = layout.spacing.max_element() / 2.0;
    let step = layout.spacing / layout.spacing.max_element();
    let lattice_eye = LatticeEye::new(frame.camera.eye.to_array(), (layout.spacing / 2.0).to_array());
    let eye_whole = IVec3::from_array(lattice_eye.whole);
    let end = layout.cells.map(|cells| i32::try_from(2 * i64::from(cells)).unwrap_or(i32::MAX));
    let end = IVec3::from_array(end);

    let is_far =
        eye_whole.cmplt(IVec3::splat(-FAR_PLANES)) | (eye_whole - end).cmpgt(IVec3::splat(FAR_PLANES));
    let nearest = eye_whole.clamp(IVec3::ZERO, end);
    let anchor_whole = IVec3::select(is_far, nearest, eye_whole);
    let from_eye = nearest.as_dvec3() * step - frame.camera.eye / unit;
    let anchor_from_eye = DVec3::select(is_far, from_eye, DVec3::ZERO);
    let eye_fraction = glam::Vec3::from_array(lattice_eye.fraction);

    let view = TileView::new(frame, tile, unit);
    let forward = view.forward;
    let is_unit = if view.is_parallel { 1.0 } else { 0.0 };
    let has_depth = if view.is_parallel || !surfaces.is_empty() { 1.0 } else { 0.0 };
    let eye_depth = -surfaces.zero_depth() / unit;
    let way = DVec3::select(forward.abs().cmplt(DVec3::splat(TINY)), DVec3::ZERO, forward);
    cubes::Frame {
        clip_x: view.clip_x.relative_to(anchor_from_eye),
        clip_y: view.clip_y.relative_to(anchor_from_eye),
        clip_w: view.clip_w.relative_to(anchor_from_eye),
        depth: Affine { slope: forward * has_depth, rest: eye_depth }.relative_to(anchor_from_eye),
        way: (way * is_unit).as_vec3().to_array(),
        is_parallel: view.is_parallel.into(),
        eye_whole: lattice_eye.whole,
        unit_length: unit.max(f64::from(f32::MIN_POSITIVE)) as f32,
        eye_fraction: lattice_eye.fraction,
        step: step.as_vec3().to_array(),
        anchor_whole: anchor_whole.to_array(),
        anchor_fraction: glam::Vec3::select(is_far, glam::Vec3::ZERO, eye_fraction).to_array(),
        anchor_from_eye: anchor_from_eye.as_vec3().to_array(),
        end: end.to_array(),
        center: view.center.map(|pixels| pixels as f32),
        slope_per_pixel: view.ray_per_pixel.map(|d| d.length() as f32),
        eye_depth: eye_depth as f32,
        units_per_length: unit.recip().min(f64::from(f32::MAX)) as f32,
        ..bytemuck::Zeroable::zeroed()
    }
}
