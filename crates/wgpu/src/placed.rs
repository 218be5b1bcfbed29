//! Where bricks are for rays: the units of all that were placed under a transfer function, on the device.

use std::collections::HashSet;

use volery_frame::{JoinedBrick, Rays, Revision};
use volery_shaders::raycast;

use crate::bindings::buffer;
use crate::choice::{Choice, beside};
use crate::gpu::{Failure, Gpu, Upload};
use crate::pool::Pool;
use crate::raycast::{Form, units_texture};
use crate::units::{Matter, Units};

/// What was made for bricks and a transfer function.
pub(crate) struct Placed {
    generation: u64,
    transfer: Revision,
    bricks: HashSet<JoinedBrick>,
    /// Slots of bricks with cells for which the table is too coarse.
    exact_slots: HashSet<u32>,
    pub(crate) units: Units,
    pub(crate) texture: wgpu::Texture,
    /// Of slots.
    pub(crate) choice: Choice,
    /// Of the bricks in slots.
    pub(crate) seams: wgpu::Buffer,
}

impl Placed {
    /// What serves a part, all of whose bricks are resident: what there is, or new.
    pub(crate) fn serving(
        kept: Option<Self>,
        gpu: &Gpu,
        pool: &Pool,
        rays: &Rays<'_>,
    ) -> Result<Self, Failure> {
        let Some(placed) = kept else { return Self::new(gpu, pool, rays, HashSet::new()) };
        let is_current =
            placed.generation == pool.generation() && placed.transfer == rays.transfer.revision();
        if is_current && rays.bricks.iter().all(|brick| placed.bricks.contains(brick)) {
            return Ok(placed);
        }
        let (old, new) =
            (placed.bricks.iter().map(|brick| &brick.placed), rays.bricks.iter().map(|brick| &brick.placed));
        let others = beside(old, new, pool);
        let stay = placed.bricks.iter().copied().filter(|brick| others.contains(&brick.placed)).collect();
        Self::new(gpu, pool, rays, stay)
    }

    fn new(gpu: &Gpu, pool: &Pool, rays: &Rays<'_>, others: HashSet<JoinedBrick>) -> Result<Self, Failure> {
        let (layout, resident) = (pool.layout(), pool.resident());
        let bricks: Vec<_> = rays.bricks.iter().copied().chain(others).collect();
        let placed: Vec<_> = bricks.iter().map(|brick| brick.placed).collect();
        let mut seams = vec![0_u32; pool.num_slots().max(1) as usize];
        for brick in &bricks {
            if let Some(resident) = resident.get(&brick.placed.id) {
                seams[resident.slot as usize] = brick.seams;
            }
        }
        let matter =
            Matter { layout, resident, transfer: rays.transfer, slots_per_layer: pool.slots_per_layer() };
        let units = Units::new(&matter, &placed);
        let max = gpu.device.limits().max_texture_dimension_3d;
        if units.dims.iter().any(|&n| n > max) {
            let [x, y, z] = units.dims;
            return Err(Failure::Other(format!(
                "volume of {x} x {y} x {z} units, expected at most {max} per axis"
            )));
        }
        let slot_of = |word: u32| {
            (word >> raycast::LAYER_SHIFT & raycast::SLOT_MASK) * pool.slots_per_layer()
                + (word & raycast::SLOT_MASK)
        };
        let is_exact =
            |words: &&[u32; 2]| words[0] & raycast::OCCUPIED != 0 && words[1] & raycast::EXACT != 0;
        let exact_slots = units.words.iter().filter(is_exact).map(|words| slot_of(words[0])).collect();
        let (texture, choice, seams) = gpu.checked(|| {
            let seams = buffer(gpu, Upload::Places, "volery seams", &seams, wgpu::BufferUsages::STORAGE);
            (units_texture(gpu, &units), Choice::of(gpu, pool.num_slots() as usize), seams)
        })?;
        Ok(Self {
            generation: pool.generation(),
            transfer: rays.transfer.revision(),
            bricks: bricks.into_iter().collect(),
            exact_slots,
            units,
            texture,
            choice,
            seams,
        })
    }

    /// Tells the device which bricks are of a part, for the commands that come next, and returns what the part asks of
    /// the pipeline.
    pub(crate) fn choose(&mut self, gpu: &Gpu, pool: &Pool, rays: &Rays<'_>) -> Form {
        let resident: Vec<_> =
            rays.bricks.iter().filter_map(|brick| pool.resident().get(&brick.placed.id)).collect();
        let form = Form {
            has_exact: resident.iter().any(|brick| self.exact_slots.contains(&brick.slot)),
            has_seams: rays.bricks.iter().any(|brick| brick.seams != 0),
            has_others: rays.bricks.iter().collect::<HashSet<_>>().len() < self.bricks.len(),
            ..Form::new(pool.layout(), resident.iter().any(|brick| brick.summary.has_blanks))
        };
        if form.has_others {
            self.choice.send(gpu, resident.iter().map(|brick| brick.slot));
        }
        form
    }
}
