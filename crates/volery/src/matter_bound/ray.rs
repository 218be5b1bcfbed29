//! One ray through the field: its pieces, what lies behind each, and what they add up to.

use volery_scene::Ray;

use super::colors::{Colors, Run, Seen};
use super::field::{Field, Node, trilinear};
use crate::view::View;

/// How often a cell is halved at most.
const MAX_DEPTH: u32 = 6;

/// What is left of the light where a ray ends: what is behind it may be anything that can be seen.
const LEAST_CLEAR: f64 = 1e-6;

/// What sums of f64 may be off by, relatively.
const ROUNDING: f64 = 1e-9;

/// A piece of a ray.
struct Piece {
    length: f64,
    /// The place of its node among all.
    place: u32,
    /// What the drawn field shows.
    drawn: Seen,
    /// Least extinction of the exact one.
    extinction: f64,
    /// Values of both, and the largest difference; none where there is none or nothing to be seen.
    change: Option<(Run, f64)>,
    /// Least and largest colour behind any place in it, by channel.
    behind: [[f64; 2]; 3],
}

/// What rays are walked with: one after the other.
pub(super) struct Walker<'a> {
    field: &'a Field,
    colors: &'a Colors,
    background: [[f64; 2]; 3],
    /// The largest difference of two colours that can be seen, by channel.
    widths: [f64; 3],
    pieces: Vec<Piece>,
    /// What each node may change in a channel, by its place.
    changes: Vec<(u32, f64)>,
    /// What is left of the light behind the pieces, at most.
    clear: f64,
}

impl<'a> Walker<'a> {
    pub(super) fn new(field: &'a Field, colors: &'a Colors, view: &View) -> Self {
        // A surface has any colour.
        let background = view.background.map(|c| if view.meshes.is_empty() { [c, c] } else { [0.0, 1.0] });
        let widths = [0, 1, 2].map(|channel| {
            let [[a, b], [c, d]] = [background[channel], colors.seen[channel]];
            b.max(d) - a.min(c)
        });
        Self { field, colors, background, widths, pieces: Vec::new(), changes: Vec::new(), clear: 1.0 }
    }

    /// How far a ray's channels can be from the exact ones.
    pub(super) fn bound(&mut self, ray: &Ray) -> [f32; 3] {
        self.pieces.clear();
        self.clear = 1.0;
        self.cut(ray);
        self.look_behind();
        self.sum().map(|bound| if bound > 0.0 { ((bound * (1.0 + ROUNDING)) as f32).next_up() } else { 0.0 })
    }

    /// The bound of a ray, and what the nodes that it meets may change, by their places.
    pub(super) fn causes(&mut self, ray: &Ray) -> (f64, Vec<(u32, f64)>) {
        let bound = self.bound(ray).into_iter().fold(0.0, f32::max);
        (f64::from(bound), self.changes.iter().filter(|(_, change)| *change > 0.0).copied().collect())
    }

    /// Finds the pieces of a ray, front to back.
    fn cut(&mut self, ray: &Ray) {
        let field = self.field;
        let spacing = field.spacing;
        let origin: [f64; 3] = std::array::from_fn(|axis| ray.origin[axis] / spacing[axis]);
        let direction: [f64; 3] = std::array::from_fn(|axis| ray.direction[axis] / spacing[axis]);
        let at =
            |t: f64| -> [f64; 3] { std::array::from_fn(|axis| t.mul_add(direction[axis], origin[axis])) };
        let (mut t, mut end) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let faces = [0.0, field.cells[axis] as f64].map(|face| (face - origin[axis]) / direction[axis]);
            if direction[axis] == 0.0 {
                if !(0.0..=field.cells[axis] as f64).contains(&origin[axis]) {
                    return;
                }
                continue;
            }
            t = t.max(faces[0].min(faces[1]));
            end = end.min(faces[0].max(faces[1]));
        }
        if field.cells.contains(&0) || t.partial_cmp(&end).is_none_or(|order| order.is_ge()) {
            return;
        }
        let start = at(t);
        let mut cell: [i64; 3] =
            std::array::from_fn(|axis| (start[axis].floor() as i64).clamp(0, field.cells[axis] - 1));
        loop {
            let node = field.node(cell);
            // What is clear is crossed whole.
            let step = match node {
                None => field.log_brick,
                Some(node) if node.is_clear => node.level + field.log_brick,
                Some(node) => node.level,
            };
            let low = cell.map(|cell| cell >> step << step);
            let exits: [f64; 3] = std::array::from_fn(|axis| {
                let plane = if direction[axis] > 0.0 { low[axis] + (1 << step) } else { low[axis] };
                let exit = (plane as f64 - origin[axis]) / direction[axis];
                if direction[axis] == 0.0 { f64::INFINITY } else { exit }
            });
            let exit = exits[0].min(exits[1]).min(exits[2]).clamp(t, end);
            if let Some(node) = node.filter(|node| !node.is_clear)
                && exit > t
            {
                let size = (1_u64 << node.level) as f64;
                let ends = [t, exit].map(|t| {
                    let place = at(t);
                    std::array::from_fn(|axis| ((place[axis] - low[axis] as f64) / size).clamp(0.0, 1.0))
                });
                self.add(node, cell, ends, exit - t);
            }
            if exit >= end || self.clear < LEAST_CLEAR {
                return;
            }
            let place = at(exit);
            for axis in 0..3 {
                if exits[axis] <= exit {
                    cell[axis] = if direction[axis] > 0.0 { low[axis] + (1 << step) } else { low[axis] - 1 };
                } else {
                    let last = (low[axis] + (1 << step)).min(field.cells[axis]) - 1;
                    cell[axis] = (place[axis].floor() as i64).clamp(low[axis], last);
                }
                if cell[axis] < 0 || cell[axis] >= field.cells[axis] {
                    return;
                }
            }
            t = exit;
        }
    }

    /// Adds the pieces of a cell, from one place in it to another.
    fn add(&mut self, node: &Node, finest: [i64; 3], [from, to]: [[f64; 3]; 2], length: f64) {
        let Some(cell) = self.field.cell(node, finest) else { return };
        let place = self.field.place(finest).unwrap_or(0) as u32;
        let all = range(&cell.corners);
        let run = self.colors.run(all[0] + cell.error[0] - cell.margin, all[1] + cell.error[1] + cell.margin);
        if self.colors.seen(run).extinction()[1] > 0.0 {
            let cubic = bernstein(&cell.corners, [from, to]);
            self.add_pieces((place, cell.error, cell.margin), &cubic, length, 0);
        }
    }

    /// Adds a cubic in pieces in which values, and the colour behind, vary little: more of them where it crosses a step
    /// of the transfer function, since only near it can the exact field be on the other side.
    fn add_pieces(&mut self, cell: (u32, [f64; 2], f64), cubic: &[f64; 4], length: f64, depth: u32) {
        let (place, error, margin) = cell;
        let [low, high] = range(cubic);
        let [low, high] = [low - margin, high + margin];
        let run = self.colors.run(low + error[0], high + error[1]);
        let is_coarse = error != [0.0; 2];
        let is_long = || high - low > 2.0 * (error[1] - error[0]) && self.colors.has_step(run);
        if is_coarse && (depth == 0 || depth < MAX_DEPTH && is_long()) {
            let (first, rest) = halves(cubic);
            self.add_pieces(cell, &first, 0.5 * length, depth + 1);
            self.add_pieces(cell, &rest, 0.5 * length, depth + 1);
            return;
        }
        let seen = self.colors.seen(run);
        let drawn = if is_coarse { self.colors.seen(self.colors.run(low, high)) } else { seen };
        let [extinction, most] = seen.extinction();
        if most > 0.0 {
            self.clear *= (-extinction * length).exp();
            let change = is_coarse.then_some((run, error[1].max(-error[0])));
            self.pieces.push(Piece { length, place, drawn, extinction, change, behind: [[0.0; 2]; 3] });
        }
    }

    /// Finds what colour lies behind each piece, from the last to the first.
    fn look_behind(&mut self) {
        let mut behind = self.background;
        if self.clear < LEAST_CLEAR {
            for (behind, seen) in behind.iter_mut().zip(self.colors.seen) {
                *behind = [behind[0].min(seen[0]), behind[1].max(seen[1])];
            }
        }
        for piece in self.pieces.iter_mut().rev() {
            // Least and largest opacity of the piece.
            let opacity = piece.drawn.extinction().map(|extinction| -(-extinction * piece.length).exp_m1());
            piece.behind = std::array::from_fn(|channel| {
                let [low, high] = behind[channel];
                if opacity[1] == 0.0 {
                    return [low, high];
                }
                let [darkest, brightest] = piece.drawn.color(channel);
                let over = |color: f64, behind: f64| {
                    opacity.map(|opacity| opacity * color + (1.0 - opacity) * behind)
                };
                let [a, b] = over(darkest, low);
                let [c, d] = over(brightest, high);
                behind[channel] = [a.min(b), c.max(d)];
                [low.min(a.min(b)), high.max(c.max(d))]
            });
        }
    }

    /// Adds up what the pieces may change, from the front.
    fn sum(&mut self) -> [f64; 3] {
        self.changes.clear();
        let mut clear = 1.0;
        let mut sums = [0.0; 3];
        let mut least = self.widths;
        for piece in &self.pieces {
            let opacity = -(-piece.extinction * piece.length).exp_m1();
            if let Some((run, error)) = piece.change {
                // ∫ T dt
                let way = if piece.extinction > 0.0 { opacity / piece.extinction } else { piece.length };
                let mut most: f64 = 0.0;
                for (channel, sum) in sums.iter_mut().enumerate() {
                    let change = self.colors.change(run, channel, piece.behind[channel], error);
                    if change > 0.0 {
                        let change = clear * way.min(piece.length) * change;
                        *sum += change;
                        most = most.max(change.min(clear * self.widths[channel]));
                    }
                }
                match self.changes.last_mut() {
                    Some((place, sum)) if *place == piece.place => *sum += most,
                    _ => self.changes.push((piece.place, most)),
                }
            }
            clear *= 1.0 - opacity;
            for channel in 0..3 {
                least[channel] = least[channel].min(sums[channel] + clear * self.widths[channel]);
            }
            if clear == 0.0 {
                return least;
            }
        }
        if self.clear < LEAST_CLEAR {
            return least;
        }
        // Behind the last piece there is the same.
        std::array::from_fn(|channel| least[channel].min(sums[channel]))
    }
}

/// The Bernstein coefficients of a trilinear field along a line in its cell: its polar form at the ends.
fn bernstein(corners: &[f64; 8], ends: [[f64; 3]; 2]) -> [f64; 4] {
    let field = |which: [usize; 3]| trilinear(corners, std::array::from_fn(|axis| ends[which[axis]][axis]));
    let mean = |a: [usize; 3], b: [usize; 3], c: [usize; 3]| (field(a) + field(b) + field(c)) / 3.0;
    [
        field([0, 0, 0]),
        mean([1, 0, 0], [0, 1, 0], [0, 0, 1]),
        mean([0, 1, 1], [1, 0, 1], [1, 1, 0]),
        field([1, 1, 1]),
    ]
}

/// Least and largest of some values.
fn range(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

/// Both halves of a cubic.
fn halves(cubic: &[f64; 4]) -> ([f64; 4], [f64; 4]) {
    // What is left in place is the second half, from its end on.
    let mut rest = *cubic;
    let first = [3, 2, 1, 0].map(|num| {
        let first = rest[0];
        for i in 0..num {
            rest[i] += 0.5 * (rest[i + 1] - rest[i]);
        }
        first
    });
    (first, rest)
}
