//! Cubes of an octree in perspective, drawn as triangle fans.
//!
//! # Method
//! Schussman and Max 2001: each voxel is a cube of constant value; eight cubes whose mean is near enough to all of
//! their voxels are drawn as one. One walk over the tree does it all, in visibility order from the back: what is
//! perfectly transparent or outside the view is skipped with all that is in it; a cube within the tolerance is
//! drawn; of all others the children are visited, those on the far side of the planes between them first. The order
//! is exact from any eye, inside the volume too: a plane between children has the eye on one side, and nothing on the
//! other can hide what is on this (the argument of `volery_octree::order`, backwards).
//!
//! # Cameras that move
//! The order depends on the eye by how many planes between voxels lie below it along each axis, and on the way of
//! parallel rays by signs: so it is the same from everywhere in one octant outside the slabs of the cubes' box. The cubes depend on
//! the eye only where some are outside the view. So the last list serves again, under its revision, where that order is
//! the same and all of it is inside the view, and is sent to no device again: it is the one that a walk would make.
//!
//! # Matter
//! What matter is drawn is that of the mean: colour and extinction of the transfer function there, classified in
//! f64. Where the mean is transparent though some voxels are not, nothing is drawn: that is the price of a tolerance.
//!
//! # When fans, when rays
//! Fans integrate a piecewise constant field exactly, whatever the opacity. Rays integrate the trilinear field between
//! samples, which for sampled signals is far nearer to the truth at equal cost; see `docs/fans.md` for the curves.
//!
//! # Guarantees
//! - A tolerance of 0 draws voxels alone.
//! - The same cubes in the same order whatever the number of threads.
//!
//! # Non-goals
//! Colour samples; volumes of more than [`MAX_DIM`] samples along an axis, whose cubes 16 bits cannot number.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, IVec3};
use rayon::prelude::*;
use volery_frame::{Backend, Cube, Revision, Thickness, VolumeLayout};
use volery_octree::{Frustum, Viewpoint};
use volery_pyramid::{CubeTree, Layout};
use volery_scene::{Camera, Projection, Sample, TransferFunction, VoxelGrid, for_samples};

use super::raycast::{matter_truth, matter_view};
use crate::data::VolumeData;
use crate::residency::Store;
use crate::session::{RenderError, VerifyError};
use crate::technique::{Drawing, Kept, Plan, Technique, Work};
use crate::texels::Encoding;
use crate::view::{Dial, How, View, ViewOptions};

/// Longest axis in samples.
pub const MAX_DIM: usize = 1 << 16;

/// Cubes of this many voxels along an axis and more are tested against the view: below, tests cost more than they
/// save.
const CULLED_LEVEL: u32 = 3;

/// Levels below the root at which the walk is shared among threads.
const SHARED_LEVELS: u32 = 3;

/// The technique, with the tree of cubes in the last encoding, and the last list of them.
#[derive(Default)]
pub(crate) struct Fans {
    tree: Kept<Encoding, CubeTree>,
    list: Option<List>,
}

/// Cubes of which none was left out for being outside the view.
struct List {
    made_of: (Encoding, TransferFunction, f64),
    order: [usize; 3],
    revision: Revision,
    cubes: Arc<Vec<Cube>>,
    /// Of all of them, on the lattice.
    lattice_bounds: [IVec3; 2],
    spacing: DVec3,
}

impl List {
    fn bounds(&self) -> [DVec3; 2] {
        self.lattice_bounds.map(|corner| corner.as_dvec3() * self.spacing / 2.0)
    }

    /// Whether a walk from there goes the same way: planes that no cubes lie on both sides of do not matter.
    fn is_ordered_for(&self, order: [usize; 3]) -> bool {
        let [low, high] = self.lattice_bounds.map(|corner| corner.to_array().map(|plane| plane as usize));
        (0..3).all(|axis| {
            let inner = |number: usize| number.clamp(low[axis].div_ceil(2), high[axis] / 2);
            inner(order[axis]) == inner(self.order[axis])
        })
    }
}

impl Technique<VolumeData> for Fans {
    fn draws(&self, how: &How) -> bool {
        matches!(how, How::Fans(_))
    }

    fn view(&self, volume: &VolumeData, options: &ViewOptions, how: How) -> View {
        matter_view(volume, options, how)
    }

    fn check(&self, volume: &VolumeData, view: &View) -> Result<(), RenderError> {
        view.obeyed(|dial| matches!(dial, Dial::Full | Dial::Tolerance(_)))?;
        view.of_values()?;
        volume.check_matter(&view.how)?;
        let dims = volume.grid().dims();
        if dims.iter().any(|&n| n > MAX_DIM) {
            return Err(RenderError::TooLong { dims, max: MAX_DIM });
        }
        Ok(())
    }

    fn forget_view(&mut self) {
        self.list = None;
    }

    fn prepare(&mut self, volume: &VolumeData) {
        self.tree_for(volume, volume.store());
    }

    fn plan(&mut self, volume: &mut VolumeData, view: &View, _: &dyn Backend) -> Result<Plan, RenderError> {
        let transfer = view.of_values()?;
        let store = volume.store_for(transfer);
        let tree = self.tree_for(volume, store);
        let tolerance = volume.tolerance(view.dial).unwrap_or(0.0);
        let layout = volume.source().layout();
        let order = order(Viewpoint::of(&view.camera, layout), volume.grid().dims());
        let made_of = (store.encoding, transfer.clone(), tolerance);
        let frustum = Frustum::new(layout, &view.camera, view.width, view.height);
        let serves = |list: &&List| {
            list.made_of == made_of && list.is_ordered_for(order) && frustum.holds(list.bounds())
        };
        let (revision, cubes) = match self.list.as_ref().filter(serves) {
            Some(list) => (Some(list.revision), list.cubes.clone()),
            None => {
                let of_volume = (volume.grid(), &*tree, layout);
                let (cubes, is_whole) = cubes(of_volume, store.encoding, (view, transfer), tolerance);
                let cubes = Arc::new(cubes);
                self.list = (is_whole && !cubes.is_empty()).then(|| {
                    let (cubes, lattice_bounds) = (cubes.clone(), lattice_bounds(&cubes, &store.layout));
                    let spacing = store.layout.spacing;
                    List { made_of, order, revision: Revision::new(), cubes, lattice_bounds, spacing }
                });
                (self.list.as_ref().map(|list| list.revision), cubes)
            }
        };
        let mut by_level = Vec::new();
        for cube in &*cubes {
            let level = usize::from(cube.level);
            if by_level.len() <= level {
                by_level.resize(level + 1, 0);
            }
            by_level[level] += 1;
        }
        let thickness = if let How::Fans(thickness) = view.how { thickness } else { Thickness::default() };
        let work = Work {
            nodes_by_level: Some(by_level),
            triangles: Some(num_triangles(&cubes, &store.layout, &view.camera)),
            ..Work::default()
        };
        let drawing = Drawing::Cubes { revision, cubes, thickness };
        Ok(Plan {
            drawing,
            store: Some((store, Vec::new())),
            work,
            bound_max: None,
            predicted_rmse: None,
            geometry_seconds: None,
        })
    }

    fn truth(
        &self,
        volume: &VolumeData,
        view: &View,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        matter_truth(volume, view, progress)
    }
}

impl Fans {
    fn tree_for(&mut self, volume: &VolumeData, store: Store) -> Arc<CubeTree> {
        let Encoding { scale, offset, .. } = store.encoding;
        self.tree.get(&store.encoding, || CubeTree::build(volume.grid(), scale, offset))
    }
}

/// What of a viewpoint decides the order of cubes: how many of the planes between voxels lie below the eye along each
/// axis. Parallel rays see as from far away.
fn order(viewpoint: Viewpoint, dims: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| {
        let most = dims[axis];
        match viewpoint {
            Viewpoint::Direction(direction) => most * usize::from(direction[axis] < 0.0),
            Viewpoint::Eye(eye) => {
                // Planes are half way between whole numbers; what is left of one is exact.
                let whole = eye[axis].floor();
                let number = whole + f64::from(u8::from(eye[axis] - whole > 0.5));
                (number.clamp(0.0, most as f64)) as usize
            }
        }
    })
}

/// The box around cubes.
fn lattice_bounds(cubes: &[Cube], layout: &VolumeLayout) -> [IVec3; 2] {
    let bounds = |cube: &Cube| cube.lattice_bounds(layout).map(IVec3::from_array);
    let join = |a: [IVec3; 2], b: [IVec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    cubes.par_iter().map(bounds).reduce(|| [IVec3::MAX, IVec3::MIN], join)
}

/// How many triangles the fans of cubes have: ten for a cube of which one face is toward the eye, else twelve
/// (`volery_cubefan::Fans::triangles`).
fn num_triangles(cubes: &[Cube], layout: &VolumeLayout, camera: &Camera) -> usize {
    // The eye on the lattice, or the way of the rays.
    let step = layout.spacing / 2.0;
    let (eye, way) = match camera.projection {
        Projection::Perspective { .. } => (Some(camera.eye / step), DVec3::ZERO),
        Projection::Orthographic { .. } => (None, camera.target - camera.eye),
    };
    let triangles = |cube: &Cube| {
        let [low, high] = cube.lattice_bounds(layout);
        let is_toward = |axis: &usize| match eye {
            Some(eye) => eye[*axis] < f64::from(low[*axis]) || eye[*axis] > f64::from(high[*axis]),
            None => way[*axis] != 0.0,
        };
        if (0..3).filter(is_toward).count() == 1 { 10 } else { 12 }
    };
    cubes.par_iter().map(triangles).sum()
}

/// Chooses, classifies and orders cubes, back to front, and tells whether none was left out for being outside the view.
/// `tree` is that of `grid` in the encoding; the tolerance is in data units.
fn cubes(
    (grid, tree, layout): (&VoxelGrid, &CubeTree, &Layout),
    Encoding { scale, offset, .. }: Encoding,
    (view, transfer): (&View, &TransferFunction),
    tolerance: f64,
) -> (Vec<Cube>, bool) {
    let of_texel = |texel: f32| {
        let (color, opacity) = transfer.classify(offset + scale * f64::from(texel));
        (color.map(|c| c as f32), transfer.extinction_of_opacity(opacity) as f32)
    };
    // Bytes need no logarithm each.
    let of_bytes: Vec<_> = (0..=u8::MAX).map(|byte| of_texel(byte.into())).collect();
    let classify = |texel: f32| {
        let byte = texel as u8;
        if f32::from(byte) == texel { of_bytes[usize::from(byte)] } else { of_texel(texel) }
    };
    for_samples!(grid.samples(), |values| {
        let walk = Walk {
            tree,
            voxel: |place: usize| tree.texel(values[place].channel(0)),
            classify: &classify,
            is_transparent: |[min, max]: [f32; 2]| {
                let [a, b] = [min, max].map(|texel| offset + scale * f64::from(texel));
                transfer.is_transparent(a.min(b), a.max(b))
            },
            tolerance: tolerance / scale.abs(),
            viewpoint: Viewpoint::of(&view.camera, layout),
            frustum: Frustum::new(layout, &view.camera, view.width, view.height),
            spacing: layout.spacing(),
            domain: layout.domain(),
            is_whole: AtomicBool::new(true),
        };
        (walk.run(), walk.is_whole.into_inner())
    })
}

/// A cube by name: level and index.
type Name = (u32, [usize; 3]);

/// Everything that a walk asks.
struct Walk<'a, V, C, T> {
    tree: &'a CubeTree,
    /// The texel of a voxel, by its place.
    voxel: V,
    /// Colour and extinction of a texel.
    classify: C,
    /// Whether all texels in a range are.
    is_transparent: T,
    /// In texels.
    tolerance: f64,
    viewpoint: Viewpoint,
    frustum: Frustum<'a>,
    spacing: DVec3,
    /// In finest-sample coordinates, from the origin.
    domain: DVec3,
    /// Whether nothing was found outside the view.
    is_whole: AtomicBool,
}

impl<V, C, T> Walk<'_, V, C, T>
where
    V: Fn(usize) -> f32 + Sync,
    C: Fn(f32) -> ([f32; 3], f32) + Sync,
    T: Fn([f32; 2]) -> bool + Sync,
{
    fn run(&self) -> Vec<Cube> {
        let root = self.tree.num_levels() - 1;
        let mut subtrees = vec![(root, [0; 3])];
        let mut done = Vec::new();
        for _ in 0..SHARED_LEVELS {
            let mut next = Vec::new();
            for &name in &subtrees {
                match self.visit(name) {
                    Visit::Skip => {}
                    Visit::Draw(_) => next.push(name),
                    Visit::Descend => self.children(name, |child| next.push(child)),
                }
            }
            subtrees = next;
        }
        subtrees
            .into_par_iter()
            .map(|name| {
                let mut cubes = Vec::new();
                self.walk(name, &mut cubes);
                cubes
            })
            .collect_into_vec(&mut done);
        done.concat()
    }

    fn walk(&self, name: Name, cubes: &mut Vec<Cube>) {
        match self.visit(name) {
            Visit::Skip => {}
            Visit::Draw(cube) => cubes.push(cube),
            Visit::Descend => self.children(name, |child| self.walk(child, cubes)),
        }
    }

    fn visit(&self, (level, index): Name) -> Visit {
        let [nx, ny, _] = self.tree.level_dims(level);
        let place = (index[2] * ny + index[1]) * nx + index[0];
        if level == 0 {
            let texel = (self.voxel)(place);
            return if texel.is_finite() { self.draw((level, index), texel) } else { Visit::Skip };
        }
        let cube = self.tree.level(level)[place];
        if cube.is_blank() || (self.is_transparent)([cube.min, cube.max]) {
            return Visit::Skip;
        }
        if level >= CULLED_LEVEL && !self.frustum.may_meet(self.world_bounds((level, index))) {
            self.is_whole.store(false, Ordering::Relaxed);
            return Visit::Skip;
        }
        if f64::from(cube.error()) < self.tolerance {
            self.draw((level, index), cube.mean)
        } else {
            Visit::Descend
        }
    }

    fn draw(&self, (level, index): Name, texel: f32) -> Visit {
        let (color, extinction) = (self.classify)(texel);
        if extinction > 0.0 {
            // Axes of a volume that has cubes are shorter than 2^16, its levels fewer than 17.
            let index = index.map(|i| i as u16);
            Visit::Draw(Cube { index, level: level as u16, color, extinction })
        } else {
            Visit::Skip
        }
    }

    fn world_bounds(&self, (level, index): Name) -> [DVec3; 2] {
        let size = (1_u64 << level) as f64;
        let low = DVec3::from_array(index.map(|i| i as f64)) * size - 0.5;
        [low.max(DVec3::ZERO), (low + size).min(self.domain)].map(|corner| corner * self.spacing)
    }

    /// Hands over the children of a cube, back to front: those that differ from the eye's octant along more axes
    /// first.
    fn children(&self, (level, index): Name, mut take: impl FnMut(Name)) {
        let half = (1_u64 << (level - 1)) as f64;
        let near = (0..3).fold(0_usize, |near, axis| {
            let plane = (2 * index[axis] + 1) as f64 * half - 0.5;
            let is_upper = match self.viewpoint {
                Viewpoint::Eye(eye) => eye[axis] > plane,
                Viewpoint::Direction(direction) => direction[axis] < 0.0,
            };
            near | usize::from(is_upper) << axis
        });
        let dims = self.tree.level_dims(level - 1);
        for flipped in (0..8).rev() {
            let octant = near ^ flipped;
            let child = std::array::from_fn(|axis| 2 * index[axis] + (octant >> axis & 1));
            if (0..3).all(|axis| child[axis] < dims[axis]) {
                take((level - 1, child));
            }
        }
    }
}

/// What a walk does with a cube.
enum Visit {
    Skip,
    Draw(Cube),
    Descend,
}
