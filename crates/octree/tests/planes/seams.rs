//! Joined cuts: the field is continuous and keeps its tolerance, whatever the samples are.

use glam::DVec3;
use volery_octree::section::local_position;
use volery_octree::validate::defects;
use volery_octree::{Answer, Joined, joined, seams, select};
use volery_pyramid::{Brick, Node, NodeSource, Pyramid};

use crate::field::{noise_floats, pyramid, read};
use crate::world::Noise;

/// A cut whose samples at seams are those of the coarser level.
struct Field<'a> {
    source: &'a Pyramid,
    joined: Joined,
    bricks: Vec<Brick>,
    bounds: Vec<[DVec3; 2]>,
}

impl<'a> Field<'a> {
    fn new(source: &'a Pyramid, joined: Joined) -> Self {
        let bricks = joined.cut.nodes.iter().map(|&node| read(source, node)).collect();
        let bounds = joined.cut.nodes.iter().map(|&node| source.layout().bounds(node)).collect();
        Self { source, joined, bricks, bounds }
    }

    /// A sample as the node shows it.
    fn sample(&self, place: usize, at: [usize; 3]) -> f64 {
        let (brick, cells) = (&self.bricks[place], self.source.layout().brick_cells());
        let side = at.map(|at| if at == 0 { 0 } else { 1 + usize::from(at == cells) });
        let direction = side[0] + 3 * side[1] + 9 * side[2];
        let is_seam = self.joined.seams[place] >> direction & 1 == 1;
        let mut sum = 0.0;
        for corner in 0..8 {
            let near: [usize; 3] = std::array::from_fn(|axis| {
                let at = at[axis];
                if !is_seam || side[axis] != 1 || at.is_multiple_of(2) {
                    at
                } else if corner >> axis & 1 == 0 {
                    at - 1
                } else {
                    (at + 1).min(brick.shape.count[axis] - 1)
                }
            });
            sum += brick.samples.value(brick.shape.index(near), 0);
        }
        sum / 8.0
    }

    fn value(&self, place: usize, point: DVec3) -> f64 {
        let layout = self.source.layout();
        let cells = local_position(layout, self.joined.cut.nodes[place], point) * layout.brick_cells() as f64;
        let count = self.bricks[place].shape.count;
        let first = [0, 1, 2].map(|axis| (cells[axis].floor() as usize).min(count[axis].saturating_sub(2)));
        let mut sum = 0.0;
        for corner in 0..8 {
            let at: [usize; 3] = std::array::from_fn(|axis| first[axis] + (corner >> axis & 1));
            let share = |axis: usize| {
                let w = cells[axis] - first[axis] as f64;
                if corner >> axis & 1 == 1 { w } else { 1.0 - w }
            };
            let share: f64 = (0..3).map(share).product();
            // A sample without weight may not be there: the axis of a single one.
            if share != 0.0 {
                sum += share * self.sample(place, at);
            }
        }
        sum
    }

    fn touching(&self, point: DVec3) -> impl Iterator<Item = usize> {
        let holds = move |[low, high]: [DVec3; 2]| point.cmpge(low).all() && point.cmple(high).all();
        (0..self.bounds.len()).filter(move |&place| holds(self.bounds[place]))
    }
}

fn error(source: &Pyramid) -> impl Fn(Node) -> f64 + '_ {
    |node| source.stats(node).iter().map(|stats| stats.error).fold(0.0, f64::max)
}

/// A cut by chance, in which some nodes are skipped.
fn cut(source: &Pyramid, noise: &mut Noise) -> Joined {
    let rule = |node: Node, noise: &mut Noise| match noise.unit() {
        x if x < 0.05 && node.level < 2 => Answer::Skip,
        x if x < 0.7 => Answer::Descend,
        _ => Answer::Draw,
    };
    let cut = select(source.layout(), |node: Node| rule(node, noise));
    Joined::of(source.layout(), &cut, &mut |_: Node| Answer::Draw)
}

const DIMS: [[usize; 3]; 6] =
    [[33, 33, 17], [40, 23, 29], [97, 61, 1], [1, 1, 200], [18, 35, 67], [16, 7, 50]];

#[test]
fn nodes_that_touch_agree_at_every_point() {
    let mut noise = Noise(5);
    let (mut worst, mut num, mut num_levels) = (0.0_f64, 0, 0);
    for round in 0..60 {
        let dims = DIMS[round % DIMS.len()];
        let source = pyramid(dims, [2, 4][round % 2], noise_floats(dims, &mut noise));
        let field = Field::new(&source, cut(&source, &mut noise));
        assert_eq!(volery_octree::balance::defects(&field.joined.cut), []);
        for (place, &node) in field.joined.cut.nodes.iter().enumerate() {
            let [low, high] = field.bounds[place];
            for direction in (0..27).filter(|&direction| direction != 13) {
                let side = [direction % 3, direction / 3 % 3, direction / 9];
                let inside = noise.point(low, high);
                let point = DVec3::from_array(std::array::from_fn(|axis| {
                    [low[axis], inside[axis], high[axis]][side[axis]]
                }));
                let own = field.value(place, point);
                for other in field.touching(point).filter(|&other| other != place) {
                    worst = worst.max((field.value(other, point) - own).abs());
                    num += 1;
                    num_levels += u32::from(field.joined.cut.nodes[other].level != node.level);
                }
            }
        }
    }
    println!(
        "largest jump {worst:.1e} (threshold 1e-12) at {num} places, {num_levels} of them between levels"
    );
    assert!(worst < 1e-12 && num_levels > 10_000, "jump {worst:e} at {num_levels} places between levels");
}

#[test]
fn no_point_of_a_joined_cut_is_farther_from_the_truth_than_its_tolerance() {
    let mut noise = Noise(6);
    let (mut coarse, mut num_seams, mut closest) = (0, 0, 0.0_f64);
    for round in 0..24 {
        let dims = DIMS[round % DIMS.len()];
        // Smooth, with fine detail in places.
        let [nx, ny, _] = dims;
        let samples: Vec<f32> = (0..dims.iter().product())
            .map(|i: usize| {
                let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny].map(|x| x as f64);
                let smooth = (x * 0.1 + round as f64).sin() + (y * 0.07 - z * 0.13).cos();
                let rough = f64::from(u8::from((x * 0.05 + y * 0.06 + z * 0.04).sin() > 0.8));
                (smooth + rough * noise.unit()) as f32
            })
            .collect();
        let source = pyramid(dims, [2, 4][round / 6 % 2], samples);
        let layout = source.layout();
        let full = select(layout, |_: Node| Answer::Descend);
        let full = Field::new(&source, Joined { seams: seams(layout, &full), cut: full });
        assert!(full.joined.seams.iter().all(|&seams| seams == 0), "seams of one level");
        for tolerance in [0.02, 0.1, 0.3, 1.0] {
            let found = joined(layout, |_: Node| Answer::Draw, error(&source), tolerance);
            assert_eq!(defects(layout, &found.cut), []);
            assert_eq!(volery_octree::balance::defects(&found.cut), []);
            assert_eq!(found.seams, seams(layout, &found.cut));
            coarse += found.cut.nodes.iter().filter(|node| node.level > 0).count();
            num_seams += found.seams.iter().filter(|&&seams| seams != 0).count();
            let field = Field::new(&source, found);
            let mut measured = 0.0_f64;
            for (place, [low, high]) in field.bounds.iter().copied().enumerate() {
                for i in 0..40 {
                    let point = noise.point(low, high);
                    let point = if i % 2 == 0 { point } else { point.round().clamp(low, high) };
                    let truth = full.touching(point).next().expect("the full resolution covers all");
                    measured = measured.max((field.value(place, point) - full.value(truth, point)).abs());
                }
            }
            closest = closest.max(measured / tolerance);
            assert!(measured < tolerance + 1e-12, "{dims:?}: measured {measured}, tolerance {tolerance}");
        }
    }
    println!(
        "{coarse} coarse nodes, {num_seams} with seams; at most {closest:.3} of the tolerance, expected below 1"
    );
    assert!(coarse > 200 && num_seams > 100, "{coarse} coarse nodes, {num_seams} with seams");
}
