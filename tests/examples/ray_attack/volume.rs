//! Volumes: a shape in [0, 1], stretched over values that people want to see, and what else stands in a file.

use volery::glam::DVec3;
use volery::{SampleType, Samples, VoxelGrid};

use crate::random::Random;

/// A volume, and what makes it hard.
pub(crate) struct Volume {
    pub(crate) grid: VoxelGrid,
    /// Smallest and largest of the values that matter: without outliers and padding.
    pub(crate) core: [f64; 2],
    pub(crate) shape: &'static str,
    pub(crate) values: &'static str,
}

const TYPES: [SampleType; 8] = [
    SampleType::U8,
    SampleType::I8,
    SampleType::U16,
    SampleType::I16,
    SampleType::U32,
    SampleType::I32,
    SampleType::F32,
    SampleType::F64,
];

/// What CT files hold outside the round field of view, and other fill values.
const PADDINGS: [f64; 3] = [-1024.0, -3024.0, -32768.0];

pub(crate) fn is_whole(sample_type: SampleType) -> bool {
    !matches!(sample_type, SampleType::F32 | SampleType::F64)
}

/// Smallest and largest value of a type.
fn limits(sample_type: SampleType) -> [f64; 2] {
    match sample_type {
        SampleType::U8 => [0.0, f64::from(u8::MAX)],
        SampleType::I8 => [f64::from(i8::MIN), f64::from(i8::MAX)],
        SampleType::U16 => [0.0, f64::from(u16::MAX)],
        SampleType::I16 => [f64::from(i16::MIN), f64::from(i16::MAX)],
        SampleType::U32 => [0.0, f64::from(u32::MAX)],
        SampleType::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
        _ => [-1e30, 1e30],
    }
}

impl Volume {
    pub(crate) fn random(random: &mut Random, spacing: DVec3) -> Self {
        let sample_type = random.pick(&TYPES);
        let values = random_values(random, sample_type);
        let core = core(random, sample_type, values);
        let dims: [usize; 3] = std::array::from_fn(|_| random.whole(2, 40));
        let (shape, mut field) = shape(random, dims);
        for value in &mut field {
            *value = core[0] + (core[1] - core[0]) * *value;
            if is_whole(sample_type) {
                *value = value.round();
            }
        }
        spoil(random, &mut field, dims, (values, sample_type, core));
        let samples = narrowed(&field, sample_type);
        let grid = VoxelGrid::new(dims, spacing, samples).expect("dims, spacing and samples fit");
        Self { grid, core, shape, values }
    }
}

/// What beside the shape makes values hard, of what the type can hold.
fn random_values(random: &mut Random, sample_type: SampleType) -> &'static str {
    let kinds: &[&str] = match sample_type {
        SampleType::F32 | SampleType::F64 => &["outliers", "padding", "offset", "blanks"],
        SampleType::I16 | SampleType::I32 => &["outliers", "padding", "offset"],
        _ => &["outliers", "offset"],
    };
    if random.chance(0.35) { "plain" } else { random.pick(kinds) }
}

/// Smallest and largest value that matter.
fn core(random: &mut Random, sample_type: SampleType, values: &str) -> [f64; 2] {
    let [least, most] = limits(sample_type);
    let whole = is_whole(sample_type);
    match (values, sample_type) {
        ("padding", _) => {
            let low = random.pick(&[-1000.0, -200.0, 0.0]);
            [low, low + random.pick(&[200.0, 1000.0, 3000.0])]
        }
        ("offset", SampleType::F32 | SampleType::F64) => {
            let offset = random.decades(2.0, 6.0);
            [offset, offset + 1.0]
        }
        ("offset", SampleType::U32 | SampleType::I32) => {
            let offset = random.pick(&[1e6, 1e8, 2e9, most - 200.0]);
            [offset, offset + random.pick(&[1.0, 20.0, 200.0])]
        }
        ("offset", _) => {
            let span = random.pick(&[1.0, 5.0, 50.0]);
            [most - span, most]
        }
        ("outliers", _) if whole => {
            let span = random.pick(&[1.0, 5.0, 10.0]);
            [0.0, span]
        }
        (_, SampleType::F32 | SampleType::F64) => {
            let span = if random.chance(0.6) { 1.0 } else { random.decades(-3.0, 3.0) };
            let low = if random.chance(0.6) { 0.0 } else { span * random.within(-2.0, 2.0) };
            [low, low + span]
        }
        _ => {
            let span = random.decades(0.3, (most - least).log10()).round().min(most - least);
            let low = random.within(least, most - span).round().clamp(least, most - span);
            [low, low + span]
        }
    }
}

/// A shape in [0, 1], x fastest.
fn shape(random: &mut Random, dims: [usize; 3]) -> (&'static str, Vec<f64>) {
    let name = random.pick(&["smooth", "smooth", "smooth", "noise", "noise", "mask", "one hot", "linear"]);
    let name = if random.chance(0.02) { "constant" } else { name };
    let places = || {
        let [nx, ny, nz] = dims;
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    };
    let at = |p: [usize; 3]| {
        DVec3::from_array(std::array::from_fn(|axis| p[axis] as f64 / (dims[axis] - 1) as f64))
    };
    let constant = random.unit();
    let middle = random.vector(0.2, 0.8);
    let waves: [(DVec3, f64); 3] =
        std::array::from_fn(|_| (random.direction() * random.within(1.0, 9.0), random.within(0.0, 6.3)));
    let mut field: Vec<f64> = match name {
        "constant" => places().map(|_| constant).collect(),
        "noise" => places().map(|_| random.unit()).collect(),
        "mask" if random.chance(0.5) => places().map(|_| f64::from(u8::from(random.chance(0.5)))).collect(),
        "mask" => {
            let inside = |p| at(p).distance(middle) < 0.2 + 0.3 * constant;
            places().map(|p| f64::from(u8::from(inside(p)))).collect()
        }
        "linear" => places().map(|p| 0.5 + waves[0].0.normalize().dot(at(p) - 0.5) / 3_f64.sqrt()).collect(),
        "one hot" => places().map(|_| 0.0).collect(),
        _ => {
            let wave = |p| waves.iter().map(|(k, phase)| (k.dot(at(p)) + phase).sin()).sum::<f64>();
            places().map(|p| 0.5 + wave(p) / 6.0).collect()
        }
    };
    if name == "one hot" {
        for _ in 0..random.whole(1, 3) {
            let index = random.whole(0, field.len() - 1);
            field[index] = 1.0;
        }
    }
    (name, field)
}

/// Puts outliers, padding or blanks among the samples.
fn spoil(
    random: &mut Random,
    field: &mut [f64],
    dims: [usize; 3],
    (values, sample_type, core): (&str, SampleType, [f64; 2]),
) {
    match values {
        "outliers" => {
            let [least, most] = limits(sample_type);
            for _ in 0..random.whole(1, 3) {
                let index = random.whole(0, field.len() - 1);
                let far = (core[1] - core[0]) * random.decades(2.0, 20.0) * random.pick(&[-1.0, 1.0, 1.0]);
                field[index] = (core[0] + far).round().clamp(least, most);
            }
        }
        "padding" => {
            let padding = if sample_type == SampleType::I16 || random.chance(0.9) {
                random.pick(&PADDINGS)
            } else {
                1e20_f64.min(limits(sample_type)[1])
            };
            let radius = random.within(0.5, 1.1);
            let [nx, ny, _] = dims.map(|n| n as f64);
            for (index, value) in field.iter_mut().enumerate() {
                let (x, y) = ((index % dims[0]) as f64, (index / dims[0] % dims[1]) as f64);
                let (x, y) = (2.0 * x / (nx - 1.0) - 1.0, 2.0 * y / (ny - 1.0) - 1.0);
                if x.hypot(y) > radius {
                    *value = padding;
                }
            }
        }
        "blanks" => {
            let share = random.decades(-3.0, -0.7);
            for value in field {
                if random.chance(share) {
                    *value = random.pick(&[f64::NAN, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]);
                }
            }
        }
        _ => {}
    }
}

/// The samples as a file of this type holds them.
fn narrowed(field: &[f64], sample_type: SampleType) -> Samples {
    macro_rules! cast {
        ($type:ty) => {
            field.iter().map(|&value| value as $type).collect::<Vec<$type>>().into()
        };
    }
    match sample_type {
        SampleType::U8 => cast!(u8),
        SampleType::I8 => cast!(i8),
        SampleType::U16 => cast!(u16),
        SampleType::I16 => cast!(i16),
        SampleType::U32 => cast!(u32),
        SampleType::I32 => cast!(i32),
        SampleType::F32 => cast!(f32),
        _ => field.to_vec().into(),
    }
}
