//! Volumes to take pictures of: values from a function, cut into bricks of any level.

use glam::{DVec3, UVec3};
use volery_scene::{Camera, ControlPoint, Projection, TransferFunction};

use volery_frame::{
    Backend, Brick, BrickId, Content, Frame, Image, JoinedBrick, PictureView, PlacedBrick, RayTransfer, Rays,
    Revision, TexelType, Texels, VolumeLayout,
};

pub(super) const BACKGROUND: [f32; 3] = [0.125, 0.25, 0.5];
pub(super) const BACKGROUND_F64: [f64; 3] = [0.125, 0.25, 0.5];

/// How a volume is cut and stored.
#[derive(Clone, Copy)]
pub(super) struct Storage {
    pub(super) brick_cells: u32,
    pub(super) texel: TexelType,
    pub(super) value_scale: f64,
    pub(super) value_offset: f64,
}

impl Storage {
    pub(super) const F32: Self = Self::plain(TexelType::F32);

    /// Texels are the values.
    pub(super) const fn plain(texel: TexelType) -> Self {
        Self { brick_cells: 8, texel, value_scale: 1.0, value_offset: 0.0 }
    }

    /// Texels cover values from 0 to 1.
    pub(super) fn unit(texel: TexelType) -> Self {
        let value_scale = match texel {
            TexelType::U8 => 1.0 / 255.0,
            TexelType::U16 => 1.0 / 65535.0,
            TexelType::F32 | TexelType::Rgba8 => 1.0,
        };
        Self { value_scale, ..Self::plain(texel) }
    }
}

/// A volume whose value at any place is given by a function of the position in finest cells.
pub(super) struct Volume {
    pub(super) layout: VolumeLayout,
    dims: [usize; 3],
    values: Vec<f64>,
    value_at: Box<dyn Fn(DVec3) -> f64>,
}

/// A brick with its texels.
pub(super) struct OwnedBrick {
    pub(super) placed: PlacedBrick,
    pub(super) samples: [u32; 3],
    pub(super) texels: OwnedTexels,
}

pub(super) enum OwnedTexels {
    U8(Vec<u8>),
    U16(Vec<u16>),
    F32(Vec<f32>),
    Rgba8(Vec<[u8; 4]>),
}

impl OwnedBrick {
    pub(super) fn lend(&self) -> Brick<'_> {
        let texels = match &self.texels {
            OwnedTexels::U8(texels) => Texels::U8(texels),
            OwnedTexels::U16(texels) => Texels::U16(texels),
            OwnedTexels::F32(texels) => Texels::F32(texels),
            OwnedTexels::Rgba8(texels) => Texels::Rgba8(texels),
        };
        Brick { id: self.placed.id, samples: self.samples, texels }
    }
}

impl Volume {
    pub(super) fn new(
        dims: [u32; 3],
        spacing: DVec3,
        storage: Storage,
        value_at: impl Fn(DVec3) -> f64 + 'static,
    ) -> Self {
        let mut layout = VolumeLayout {
            revision: Revision::new(),
            cells: dims.map(|n| n - 1),
            spacing,
            brick_cells: storage.brick_cells,
            texel: storage.texel,
            value_scale: storage.value_scale,
            value_offset: storage.value_offset,
            value_range: [0.0, 0.0],
        };
        let mut values = Vec::new();
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    let value = stored(&layout, value_at(UVec3::new(x, y, z).as_dvec3()));
                    if value.is_finite() {
                        range = [range[0].min(value), range[1].max(value)];
                    }
                    values.push(value);
                }
            }
        }
        layout.value_range = if range[0] <= range[1] { range } else { [0.0, 0.0] };
        Self { layout, dims: dims.map(|n| n as usize), values, value_at: Box::new(value_at) }
    }

    pub(super) fn extent(&self) -> DVec3 {
        UVec3::from_array(self.layout.cells).as_dvec3() * self.layout.spacing
    }

    /// The trilinear field at a position in finest cells; NaN in cells with a blank corner.
    pub(super) fn trilinear(&self, position: DVec3) -> f64 {
        let cells = DVec3::from_array(self.layout.cells.map(f64::from));
        let cell = position.floor().clamp(DVec3::ZERO, (cells - 1.0).max(DVec3::ZERO));
        let w = (position - cell).clamp(DVec3::ZERO, DVec3::ONE);
        let first = cell.to_array().map(|i| i as usize);
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut index = 0;
            for axis in (0..3).rev() {
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { w[axis] } else { 1.0 - w[axis] };
                index = index * self.dims[axis] + (first[axis] + upper).min(self.dims[axis] - 1);
            }
            let value = self.values[index];
            sum += if value.is_finite() { weight * value } else { f64::NAN };
        }
        sum
    }

    /// The value of a sample; beyond the domain, what coarse bricks have there.
    pub(super) fn sample(&self, cell: [u32; 3]) -> f64 {
        stored(&self.layout, (self.value_at)(UVec3::from_array(cell).as_dvec3()))
    }

    /// The brick of a level that begins at this finest cell.
    pub(super) fn brick(&self, level: u32, first_cell: [u32; 3]) -> OwnedBrick {
        let layout = &self.layout;
        let samples: [u32; 3] = std::array::from_fn(|axis| {
            let cells = layout.cells[axis].saturating_sub(first_cell[axis]).div_ceil(1 << level);
            cells.min(layout.brick_cells) + 1
        });
        let [i, j, k] = first_cell.map(u64::from);
        let id = BrickId(u64::from(level) << 60 | k << 40 | j << 20 | i);
        let mut texels = Vec::new();
        for z in 0..samples[2] {
            for y in 0..samples[1] {
                for x in 0..samples[0] {
                    let cell = UVec3::from_array(first_cell) + (UVec3::new(x, y, z) << level);
                    texels.push(texel_of(layout, (self.value_at)(cell.as_dvec3())));
                }
            }
        }
        let texels = match layout.texel {
            TexelType::U8 => OwnedTexels::U8(texels.iter().map(|&t| t as u8).collect()),
            TexelType::U16 => OwnedTexels::U16(texels.iter().map(|&t| t as u16).collect()),
            TexelType::F32 => OwnedTexels::F32(texels.iter().map(|&t| t as f32).collect()),
            TexelType::Rgba8 => OwnedTexels::Rgba8(texels.iter().map(|&t| color_of(t)).collect()),
        };
        OwnedBrick { placed: PlacedBrick { id, first_cell, level }, samples, texels }
    }

    /// All bricks of level 0, in visibility order.
    pub(super) fn bricks(&self, camera: &Camera) -> Vec<OwnedBrick> {
        self.cut(camera, |_, _| true)
    }

    /// The bricks of a cut, front to back: from the root on, nodes for which `refine` holds are replaced by
    /// their children.
    pub(super) fn cut(&self, camera: &Camera, refine: impl Fn(u32, [u32; 3]) -> bool) -> Vec<OwnedBrick> {
        let largest = self.layout.cells.into_iter().max().unwrap_or(0);
        let root = (0..32).find(|&level| self.layout.brick_cells << level >= largest).unwrap_or(31);
        let mut bricks = Vec::new();
        self.visit(camera, &refine, root, [0; 3], &mut bricks);
        bricks
    }

    fn visit(
        &self,
        camera: &Camera,
        refine: &dyn Fn(u32, [u32; 3]) -> bool,
        level: u32,
        first_cell: [u32; 3],
        bricks: &mut Vec<OwnedBrick>,
    ) {
        if level == 0 || !refine(level, first_cell) {
            bricks.push(self.brick(level, first_cell));
            return;
        }
        let half = self.layout.brick_cells << (level - 1);
        // The octant nearest to the eye comes first, its neighbours across one plane before those across two.
        let nearest = (0..3).fold(0_u32, |octant, axis| {
            let middle = f64::from(first_cell[axis] + half) * self.layout.spacing[axis];
            let is_upper = match camera.projection {
                Projection::Perspective { .. } => camera.eye[axis] > middle,
                Projection::Orthographic { .. } => camera.target[axis] < camera.eye[axis],
            };
            octant | u32::from(is_upper) << axis
        });
        for flips in [0, 1, 2, 4, 3, 5, 6, 7_u32] {
            let octant = nearest ^ flips;
            let child = std::array::from_fn(|axis| first_cell[axis] + half * (octant >> axis & 1));
            if (0..3).all(|axis| child[axis] < self.layout.cells[axis].max(1)) {
                self.visit(camera, refine, level - 1, child, bricks);
            }
        }
    }

    /// The transfer function as a frame wants it.
    pub(super) fn integrated(&self, transfer: &TransferFunction) -> RayTransfer {
        RayTransfer::new(transfer, &self.layout)
    }
}

/// The texel that stores a value, before it is narrowed.
fn texel_of(layout: &VolumeLayout, value: f64) -> f64 {
    let texel = (value - layout.value_offset) / layout.value_scale;
    match layout.texel {
        TexelType::U8 => texel.round().clamp(0.0, 255.0),
        TexelType::U16 => texel.round().clamp(0.0, 65535.0),
        TexelType::F32 => f64::from(texel as f32),
        TexelType::Rgba8 => texel,
    }
}

/// The colour that stores a value from 0 to 1: four channels that differ.
pub(super) fn color_of(value: f64) -> [u8; 4] {
    [value, 1.0 - value, value * value, 1.0 - 0.75 * value].map(|x| (x * 255.0).round() as u8)
}

/// The value as it comes back from its texel.
fn stored(layout: &VolumeLayout, value: f64) -> f64 {
    layout.value_offset + layout.value_scale * texel_of(layout, value)
}

/// Sets the volume and makes the bricks resident.
pub(super) fn hold(backend: &mut dyn Backend, volume: &Volume, bricks: &[OwnedBrick]) {
    backend.set_volume(&volume.layout).expect("the suite's volumes are small");
    let lent: Vec<_> = bricks.iter().map(OwnedBrick::lend).collect();
    backend.upload(&lent).expect("the suite's bricks fit the layout and are small");
}

/// Draws bricks that are resident.
pub(super) fn draw_resident(
    backend: &mut dyn Backend,
    volume: &Volume,
    transfer: &TransferFunction,
    camera: &Camera,
    [width, height]: [u32; 2],
    bricks: &[OwnedBrick],
) -> Image {
    assert!(camera.defects().is_empty(), "the suite's camera: {:?}", camera.defects());
    let placed: Vec<_> = bricks.iter().map(|brick| brick.placed.into()).collect();
    draw_joined(backend, volume, transfer, camera, [width, height], &placed)
}

/// Draws resident bricks that join others.
pub(super) fn draw_joined(
    backend: &mut dyn Backend,
    volume: &Volume,
    transfer: &TransferFunction,
    camera: &Camera,
    [width, height]: [u32; 2],
    bricks: &[JoinedBrick],
) -> Image {
    let transfer = &volume.integrated(transfer);
    let content = Content::Rays(Rays { transfer, bricks });
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    let drawn = backend.draw(&frame).expect("every brick is resident and in its place");
    assert_eq!((drawn.image.width, drawn.image.height), (width, height), "size of the picture");
    assert!(drawn.device_seconds.is_none_or(|s| s >= 0.0 && s.is_finite()), "{:?}", drawn.device_seconds);
    drawn.image
}

/// Uploads and draws bricks.
pub(super) fn draw_bricks(
    backend: &mut dyn Backend,
    volume: &Volume,
    transfer: &TransferFunction,
    camera: &Camera,
    size: [u32; 2],
    bricks: &[OwnedBrick],
) -> Image {
    hold(backend, volume, bricks);
    draw_resident(backend, volume, transfer, camera, size, bricks)
}

/// Uploads and draws the volume at full resolution.
pub(super) fn draw(
    backend: &mut dyn Backend,
    volume: &Volume,
    transfer: &TransferFunction,
    camera: &Camera,
    size: [u32; 2],
) -> Image {
    draw_bricks(backend, volume, transfer, camera, size, &volume.bricks(camera))
}

/// A transfer function from `[value, red, green, blue, opacity]`.
pub(super) fn transfer(points: &[[f64; 5]], unit_distance: f64) -> TransferFunction {
    let point = |&[value, r, g, b, opacity]: &[f64; 5]| ControlPoint { value, color: [r, g, b], opacity };
    TransferFunction::new(points.iter().map(point).collect(), unit_distance)
        .expect("the suite's transfer functions are valid")
}

/// Clear below 0.25, then rising with changing colour; for values from 0 to 1.
pub(super) fn smooth_transfer(unit_distance: f64) -> TransferFunction {
    let points = [
        [0.0, 0.1, 0.1, 0.4, 0.0],
        [0.25, 0.2, 0.3, 0.9, 0.0],
        [0.5, 0.9, 0.6, 0.2, 0.06],
        [0.75, 1.0, 0.3, 0.1, 0.25],
        [1.0, 1.0, 0.9, 0.7, 0.45],
    ];
    transfer(&points, unit_distance)
}

/// The signal of Marschner and Lobb in `[0, 1]` over a box of these finest cells, with as many rings as the
/// samples still show smoothly.
pub(super) fn marschner_lobb(cells: [u32; 3]) -> impl Fn(DVec3) -> f64 + 'static {
    let cells = DVec3::from_array(cells.map(f64::from));
    let rings = (cells.min_element() / 20.0).min(1.2);
    move |position| {
        let p = position / cells * 2.0 - 1.0;
        let (radius, alpha) = (p.x.hypot(p.y), 0.25);
        let half_pi = std::f64::consts::FRAC_PI_2;
        let wave = (4.0 * half_pi * rings * (half_pi * radius).cos()).cos();
        (1.0 - (half_pi * p.z).sin() + alpha * (1.0 + wave)) / (2.0 * (1.0 + alpha))
    }
}
