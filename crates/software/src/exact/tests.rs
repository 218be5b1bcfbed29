//! Single cells against the reference.

use fearless_simd::{Level, dispatch};
use glam::DVec3;
use volery_frame::{RayTransfer, Revision, TexelType, VolumeLayout};
use volery_reference::Tracer;
use volery_scene::{ControlPoint, Ray, Samples, TransferFunction, VoxelGrid};

use super::*;

/// Numbers in [0, 1) from a seed.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        // splitmix64
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

/// The opacity of a control point by its number.
type Opacity = Box<dyn FnMut(usize, &mut Chance) -> f64>;

/// A transfer function of one family over values from 0 to 1.
fn transfer(family: &str, chance: &mut Chance) -> TransferFunction {
    let num = 2 + chance.below(6);
    let mut values: Vec<f64> = (0..num).map(|_| chance.next()).collect();
    let mut unit_distance = 1.0;
    let mut opacity: Opacity = Box::new(|_, chance| chance.next());
    match family {
        "ramps" => {}
        "poles" => opacity = Box::new(|_, chance| if chance.next() < 0.5 { 1.0 } else { chance.next() }),
        "steps" => values.extend(values.clone()),
        "comb" => {
            values = (0..200).map(|i| f64::from(i) / 199.0).collect();
            opacity = Box::new(|i, chance| if i % 2 == 0 { 0.0 } else { chance.next() });
        }
        "shell" => {
            let (at, half) = (chance.next(), 10.0_f64.powf(-1.0 - 4.0 * chance.next()));
            values = vec![at - half, at, at + half];
            unit_distance = half * 10.0;
            opacity = Box::new(|i, chance| if i == 1 { 0.1 + 0.9 * chance.next() } else { 0.0 });
        }
        "dense" => unit_distance = 10.0_f64.powf(-4.0 * chance.next()),
        _ => unit_distance = 1e4,
    }
    values.sort_by(f64::total_cmp);
    let point = |(i, value)| ControlPoint {
        value,
        color: [chance.next(), chance.next(), chance.next()],
        opacity: opacity(i, chance),
    };
    TransferFunction::new(values.into_iter().enumerate().map(point).collect(), unit_distance).unwrap()
}

/// The field on a way through a cell of these corners, by powers of the share of the way.
fn cubic(corners: &[f64], from: DVec3, to: DVec3) -> [f64; 4] {
    let at = |t: f64| {
        let p = from + (to - from) * t;
        (0..8)
            .map(|i| {
                let side = |bit: usize, w: f64| if i >> bit & 1 == 1 { w } else { 1.0 - w };
                corners[i] * side(0, p.x) * side(1, p.y) * side(2, p.z)
            })
            .sum::<f64>()
    };
    // Through four points.
    let [a, b, c, d] = [at(0.0), at(1.0 / 3.0), at(2.0 / 3.0), at(1.0)];
    let third = (d - 3.0 * c + 3.0 * b - a) * 4.5;
    let second = (c - 2.0 * b + a) * 4.5 - third;
    [a, d - a - second - third, second, third]
}

/// Against the reference, which shares nothing with this.
#[test]
fn cells_of_every_kind_are_those_of_the_reference() {
    let mut chance = Chance(7);
    for family in ["ramps", "poles", "steps", "comb", "shell", "dense", "thin"] {
        let mut worst = (0.0, String::new());
        for case in 0..3000 {
            let flat = case % 10 == 0;
            let corners: Vec<f64> = (0..8).map(|_| chance.next()).collect();
            let corners = if flat { vec![corners[0]; 8] } else { corners };
            let tf = transfer(family, &mut chance);
            let grid = VoxelGrid::new([2; 3], DVec3::ONE, Samples::F64(corners.clone().into())).unwrap();
            let mut side = |axis: usize, at: f64| {
                let mut p = DVec3::new(chance.next(), chance.next(), chance.next());
                p[axis] = at;
                p
            };
            let (from, to) = (side(case % 3, 0.0), side((case + case / 3) % 3, 1.0));
            let way = to - from;
            let tracer = Tracer::new(&grid, &tf).unwrap();
            let expected = tracer.trace(&Ray { origin: from - way, direction: way.normalize() });
            let layout = VolumeLayout {
                revision: Revision::new(),
                cells: [1; 3],
                spacing: DVec3::ONE,
                brick_cells: 1,
                texel: TexelType::F32,
                value_scale: 1.0,
                value_offset: 0.0,
                value_range: [0.0, 1.0],
            };
            let transfer = RayTransfer::new(&tf, &layout);
            let bands = Bands {
                bands: transfer.bands(),
                depth_scale: transfer.depth_scale() as f32,
                huge: 1e3,
                flat_rounding: 0.0,
            };
            let mut powers = cubic(&corners, from, to);
            powers[0] -= transfer.texel_origin();
            let range = [f64::min, f64::max]
                .map(|of| corners.iter().copied().reduce(of).unwrap() - transfer.texel_origin());
            let found = dispatch!(Level::new(), simd => {
                let splat = |x: f64| f32x16::splat(simd, x as f32);
                let powers = powers.map(splat);
                let mut light = Light::none(simd);
                let all = mask32x16::splat(simd, true);
                let ends = [powers[0], powers[0] + powers[1] + powers[2] + powers[3]];
                let (range, length) = (range.map(splat), splat(way.length()));
                let field = Field { cubic: powers, ends, range, length };
                add_cells(simd, bands, &field, all, &mut light);
                let color: [[f32; 16]; 3] = light.color.map(Into::into);
                let clear: [f32; 16] = light.transmittance.into();
                [color[0][3], color[1][3], color[2][3], clear[3]]
            });
            let [r, g, b] = expected.color;
            let error = [r, g, b, expected.transmittance]
                .iter()
                .zip(found)
                .map(|(e, f)| (e - f64::from(f)).abs())
                .fold(0.0, f64::max);
            if error.is_nan() || error > worst.0 {
                worst = (error, format!("case {case}, {found:?} for {expected:?}, {powers:?}, {tf:?}"));
            }
        }
        println!("{family}: error {:.2e} (threshold 1e-3)\n    {}", worst.0, worst.1);
        assert!(worst.0 < 1e-3, "{family}: {}", worst.1);
    }
}
