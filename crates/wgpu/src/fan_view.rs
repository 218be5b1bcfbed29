//! From a frame of cubes to the numbers that the shader reads: in f64 up to the last step.

use std::ops::Range;

use glam::{DVec3, IVec3};
use volery_cubefan::LatticeEye;
use volery_frame::{Frame, VolumeLayout};
use volery_scene::Projection;
use volery_shaders::cubes;

/// An eye beyond the domain by so many lattice planes is far: places are then told from the domain's end.
const FAR_PLANES: i32 = 64;

/// Parts of a direction below this are none: the shader's smallest number.
const TINY: f64 = cubes::TINY as f64;

/// A part of a picture that is drawn at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Tile {
    /// Column and row of its first pixel.
    pub(crate) first: [u32; 2],
    /// Pixels.
    pub(crate) size: [u32; 2],
    pub(crate) picture_width: u32,
}

impl Tile {
    /// The tiles of a band of rows, of at most `most` pixels per axis.
    pub(crate) fn of(picture_width: u32, rows: Range<u32>, most: u32) -> impl Iterator<Item = Self> {
        let starts = rows.clone().step_by(most as usize);
        starts.flat_map(move |row| {
            let height = most.min(rows.end - row);
            (0..picture_width).step_by(most as usize).map(move |column| {
                let size = [most.min(picture_width - column), height];
                Self { first: [column, row], size, picture_width }
            })
        })
    }
}

/// What maps positions, in the shader's units and relative to its anchor, to a number.
fn row(part: DVec3, rest: f64, anchor_from_eye: DVec3) -> [f32; 4] {
    part.extend(part.dot(anchor_from_eye) + rest).as_vec4().to_array()
}

/// The shader's frame for a tile.
pub(crate) fn shader_frame(frame: &Frame<'_>, layout: &VolumeLayout, tile: Tile) -> cubes::Frame {
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

    let rays = frame.camera.rays(frame.width, frame.height);
    let [_, _, forward] = frame.camera.axes();
    let is_parallel = matches!(frame.camera.projection, Projection::Orthographic { .. });
    let (dx, dy) = if is_parallel {
        (rays.origin_dx / unit, rays.origin_dy / unit)
    } else {
        (rays.toward_dx, rays.toward_dy)
    };
    // Pixels from the middle of the picture, times depth in perspective.
    let (pixels_x, pixels_y) = (dx / dx.length_squared(), dy / dy.length_squared());
    let (depth, is_unit) = if is_parallel { (DVec3::ZERO, 1.0) } else { (forward, 0.0) };
    let [width, height] = tile.size.map(f64::from);
    let center_x = f64::from(frame.width) / 2.0 - f64::from(tile.first[0]);
    let center_y = f64::from(frame.height) / 2.0 - f64::from(tile.first[1]);
    let (shift_x, shift_y) = (2.0 * center_x / width - 1.0, 1.0 - 2.0 * center_y / height);
    let clip = |pixels: DVec3, shift: f64| row(pixels + depth * shift, is_unit * shift, anchor_from_eye);
    let way = DVec3::select(forward.abs().cmplt(DVec3::splat(TINY)), DVec3::ZERO, forward);
    cubes::Frame {
        clip_x: clip(pixels_x * (2.0 / width), shift_x),
        clip_y: clip(pixels_y * (-2.0 / height), shift_y),
        clip_w: row(depth, is_unit, anchor_from_eye),
        depth: row(forward * is_unit, 0.0, anchor_from_eye),
        way: (way * is_unit).as_vec3().to_array(),
        is_parallel: is_parallel.into(),
        eye_whole: lattice_eye.whole,
        unit_length: unit.max(f64::from(f32::MIN_POSITIVE)) as f32,
        eye_fraction: lattice_eye.fraction,
        step: step.as_vec3().to_array(),
        anchor_whole: anchor_whole.to_array(),
        anchor_fraction: glam::Vec3::select(is_far, glam::Vec3::ZERO, eye_fraction).to_array(),
        anchor_from_eye: anchor_from_eye.as_vec3().to_array(),
        end: end.to_array(),
        center: [center_x as f32, center_y as f32],
        slope_per_pixel: [dx, dy].map(|d| ((1.0 - is_unit) * d.length()) as f32),
        ..bytemuck::Zeroable::zeroed()
    }
}
