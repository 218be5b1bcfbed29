//! The lower convex hull of bytes and error, of every subtree.

use std::cmp::Ordering;

use volery_pyramid::{Layout, Node};

use super::fixed::{SUM_BITS, Scale};
use super::{Held, Price};

/// What a cut of a subtree takes and loses; ordered by bytes, then errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Point {
    pub(super) bytes: u64,
    /// In units of [`Scale`].
    pub(super) error: u64,
}

impl Point {
    pub(super) fn plus(self, other: Self) -> Self {
        Self { bytes: self.bytes + other.bytes, error: self.error + other.error }
    }
}

/// A resolution at which a node may be held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Choice {
    pub(super) resolution: u32,
    pub(super) point: Point,
}

/// Lists of a level, one after the other: that of node `i` ends at `ends[i]`.
#[derive(Clone, Debug)]
struct Lists<T> {
    ends: Vec<usize>,
    items: Vec<T>,
}

impl<T> Lists<T> {
    fn with_capacity(num_lists: usize, num_items: usize) -> Self {
        Self { ends: Vec::with_capacity(num_lists), items: Vec::with_capacity(num_items) }
    }

    fn end(&mut self) {
        self.ends.push(self.items.len());
    }

    fn get(&self, index: usize) -> &[T] {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.items[start..self.ends[index]]
    }
}

/// The choices of all nodes by level; of a node those that no other beats, bytes rising, errors falling.
#[derive(Clone, Debug)]
pub(super) struct Prices {
    levels: Vec<Lists<Choice>>,
}

impl Prices {
    /// Asks for every price, level by level from the finest.
    pub(super) fn ask(layout: &Layout, mut price: impl FnMut(Node, u32) -> Option<Price>) -> (Self, Scale) {
        let most_bytes = Self::most_bytes(layout);
        let mut asked = Vec::new();
        let mut largest = Vec::new();
        let mut has_unknown = false;
        for level in 0..layout.num_levels() {
            let num = layout.num_nodes(level);
            let mut lists = Lists::with_capacity(num, num * layout.num_levels() as usize);
            for node in layout.level_nodes(level) {
                let mut most = 0.0;
                for resolution in layout.resolutions(node) {
                    let Some(price) = price(node, resolution).filter(|price| price.bytes <= most_bytes)
                    else {
                        continue;
                    };
                    if price.error < f64::INFINITY {
                        most = f64::max(most, price.error);
                    } else {
                        has_unknown = true;
                    }
                    lists.items.push((resolution, price));
                }
                lists.end();
                largest.push(most);
            }
            asked.push(lists);
        }
        let scale = Scale::new(&largest, has_unknown, layout.num_nodes(0));
        let levels = (0..).zip(&asked).map(|(level, lists)| choices(layout, level, lists, &scale)).collect();
        (Self { levels }, scale)
    }

    /// More than this a node cannot be counted at.
    pub(super) fn most_bytes(layout: &Layout) -> u64 {
        let num_nodes: usize = (0..layout.num_levels()).map(|level| layout.num_nodes(level)).sum();
        (1 << SUM_BITS) / num_nodes as u64
    }

    /// Raises the error of nodes that have one choice each to that of their children together, where it is below.
    pub(super) fn raise(&mut self, layout: &Layout) {
        for level in 1..layout.num_levels() {
            for (index, node) in layout.level_nodes(level).enumerate() {
                let children: u64 = layout.children(node).map(|child| self.own(layout, child).error).sum();
                let own = &mut self.levels[level as usize].items[index].point.error;
                *own = children.max(*own);
            }
        }
    }

    /// What a node has that has one choice.
    pub(super) fn own(&self, layout: &Layout, node: Node) -> Point {
        self.of(layout, node)[0].point
    }

    pub(super) fn of(&self, layout: &Layout, node: Node) -> &[Choice] {
        self.levels[node.level as usize].get(layout.node_index(node))
    }
}

/// The choices of a level that no other of their node beats. Of equal ones the coarsest stays.
fn choices(layout: &Layout, level: u32, asked: &Lists<(u32, Price)>, scale: &Scale) -> Lists<Choice> {
    let mut lists = Lists::with_capacity(asked.ends.len(), asked.items.len());
    let mut sorted: Vec<Choice> = Vec::new();
    for (index, node) in layout.level_nodes(level).enumerate() {
        let num_finest = num_finest(layout, node);
        let choice = |&(resolution, price): &(u32, Price)| {
            let point = Point { bytes: price.bytes, error: scale.units_of(price.error, num_finest) };
            Choice { resolution, point }
        };
        sorted.clear();
        sorted.extend(asked.get(index).iter().rev().map(choice));
        sorted.sort_by_key(|choice| choice.point);
        let mut least = u64::MAX;
        for &choice in &sorted {
            if choice.point.error < least {
                least = choice.point.error;
                lists.items.push(choice);
            }
        }
        lists.end();
    }
    lists
}

/// Finest nodes inside a node.
fn num_finest(layout: &Layout, node: Node) -> u64 {
    let nodes = layout.nodes(0);
    let along = |axis: usize| {
        let first = u64::from(node.index[axis]) << node.level;
        (u64::from(nodes[axis]) - first).min(1 << node.level)
    };
    along(0) * along(1) * along(2)
}

/// Where a point of a subtree comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Origin {
    /// The node itself, held at a resolution.
    Own(u32),
    /// Its children, after this many of their merged steps.
    Split(u32),
}

/// From a vertex of a hull to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// How many more; above 0.
    pub(super) bytes: u64,
    /// How much less; above 0.
    pub(super) error: u64,
    /// Of the vertex where it ends.
    to: Origin,
}

impl Step {
    /// Steeper than all others: something for nothing.
    const FREE: Self = Self { bytes: 0, error: 1, to: Origin::Split(0) };

    /// The most error that a part of the step's bytes can save, whole units of it.
    pub(super) fn gain(&self, bytes: u64) -> u64 {
        (u128::from(self.error) * u128::from(bytes) / u128::from(self.bytes)) as u64
    }

    /// Steeper first.
    pub(super) fn by_slope(&self, other: &Self) -> Ordering {
        let product = |error: u64, bytes: u64| u128::from(error) * u128::from(bytes);
        product(other.error, self.bytes).cmp(&product(self.error, other.bytes))
    }

    fn is_steeper(&self, other: &Self) -> bool {
        self.by_slope(other).is_lt()
    }
}

/// A hull without its steps.
#[derive(Clone, Copy, Debug)]
struct Start {
    point: Point,
    origin: Origin,
    /// The cheapest cut of the subtree: the first vertex. Its last is `point` and all steps.
    last: Point,
}

/// The hull of a subtree: vertices from the fewest bytes to the least error, slopes falling, equal ones apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hull<'a> {
    pub(super) first: Point,
    origin: Origin,
    last: Point,
    steps: &'a [Step],
}

impl Hull<'_> {
    pub(super) fn last(&self) -> Point {
        self.last
    }

    /// The step that leaves a vertex; none from the last.
    pub(super) fn step(&self, vertex: usize) -> Option<&Step> {
        self.steps.get(vertex)
    }

    /// The last vertex of at most `max_bytes`.
    pub(super) fn last_within(&self, max_bytes: u64) -> Option<usize> {
        let mut left = max_bytes.checked_sub(self.first.bytes)?;
        let fits = |step: &&Step| match left.checked_sub(step.bytes) {
            Some(rest) => {
                left = rest;
                true
            }
            None => false,
        };
        Some(self.steps.iter().take_while(fits).count())
    }

    /// The steepest way on from the node itself; none where nothing in it is better.
    pub(super) fn slope_of_own(&self) -> Option<Step> {
        match self.origin {
            Origin::Own(_) => self.steps.first().copied(),
            Origin::Split(_) => Some(Step::FREE),
        }
    }

    pub(super) fn point(&self, vertex: usize) -> Point {
        let mut point = self.first;
        for step in &self.steps[..vertex] {
            point.bytes += step.bytes;
            point.error -= step.error;
        }
        point
    }

    /// The first vertex after which no step is steeper than `price`: the best where bytes cost that.
    pub(super) fn best_at(&self, price: &Step) -> usize {
        self.steps.partition_point(|step| step.is_steeper(price))
    }

    fn origin(&self, vertex: usize) -> Origin {
        vertex.checked_sub(1).map_or(self.origin, |before| self.steps[before].to)
    }
}

/// The hulls of a level.
#[derive(Clone, Debug)]
struct Level {
    /// Of each subtree; none where it cannot be held.
    starts: Vec<Option<Start>>,
    steps: Lists<Step>,
    /// Of each split, which child (by its place among the children) takes each of the merged steps.
    takers: Lists<u8>,
}

/// The hulls of all subtrees.
#[derive(Clone, Debug)]
pub(super) struct Hulls {
    levels: Vec<Level>,
}

/// What is kept from node to node while hulls are made.
#[derive(Default)]
struct Scratch {
    merged: Vec<(Step, u8)>,
    split: Vec<(Point, Origin)>,
    own: Vec<(Point, Origin)>,
    hull: Vec<(Point, Origin)>,
}

impl Hulls {
    pub(super) fn build(layout: &Layout, prices: &Prices) -> Self {
        let mut hulls = Self { levels: Vec::with_capacity(layout.num_levels() as usize) };
        let mut scratch = Scratch::default();
        for level in 0..layout.num_levels() {
            let num_nodes = layout.num_nodes(level);
            let num_steps = hulls.levels.last().map_or(0, |level| level.steps.items.len());
            let mut made = Level {
                starts: Vec::with_capacity(num_nodes),
                steps: Lists::with_capacity(num_nodes, num_steps),
                takers: Lists::with_capacity(num_nodes, num_steps),
            };
            for node in layout.level_nodes(level) {
                hulls.split(layout, node, &mut scratch, &mut made.takers);
                let own = prices.of(layout, node).iter();
                scratch.own.clear();
                scratch.own.extend(own.map(|choice| (choice.point, Origin::Own(choice.resolution))));
                lower_hull(&scratch.own, &scratch.split, &mut scratch.hull);
                made.push(&scratch.hull);
            }
            hulls.levels.push(made);
        }
        hulls
    }

    /// The vertices of all children together, into the scratch; who takes which step, into a list.
    fn split(&self, layout: &Layout, node: Node, scratch: &mut Scratch, takers: &mut Lists<u8>) {
        scratch.split.clear();
        scratch.merged.clear();
        let mut point = Point { bytes: 0, error: 0 };
        let mut is_whole = node.level > 0;
        for (place, child) in (0..).zip(layout.children(node)) {
            let Some(hull) = self.of(layout, child) else {
                is_whole = false;
                break;
            };
            point = point.plus(hull.first);
            scratch.merged.extend(hull.steps.iter().map(|&step| (step, place)));
        }
        if is_whole {
            // Stable, so equal slopes are taken child by child. Each child's run is sorted already.
            scratch.merged.sort_by(|(a, _), (b, _)| a.by_slope(b));
            scratch.split.push((point, Origin::Split(0)));
            for (count, (step, place)) in (1..).zip(&scratch.merged) {
                point = Point { bytes: point.bytes + step.bytes, error: point.error - step.error };
                scratch.split.push((point, Origin::Split(count)));
                takers.items.push(*place);
            }
        }
        takers.end();
    }

    pub(super) fn of(&self, layout: &Layout, node: Node) -> Option<Hull<'_>> {
        let level = &self.levels[node.level as usize];
        let index = layout.node_index(node);
        let start = level.starts[index]?;
        let steps = level.steps.get(index);
        Some(Hull { first: start.point, origin: start.origin, last: start.last, steps })
    }

    pub(super) fn root(&self) -> Hull<'_> {
        let level = self.levels.last().expect("a tree has a level");
        let start = level.starts[0].expect("a root that cannot be held has been refused");
        Hull { first: start.point, origin: start.origin, last: start.last, steps: level.steps.get(0) }
    }

    /// A finest node that nothing holds.
    pub(super) fn uncovered(&self, layout: &Layout) -> Option<Node> {
        let mut node = layout.root();
        if self.of(layout, node).is_some() {
            return None;
        }
        while let Some(child) = layout.children(node).find(|&child| self.of(layout, child).is_none()) {
            node = child;
        }
        Some(node)
    }

    /// Lists what a vertex of a subtree's hull holds, in canonical order; one node's part from elsewhere than its hull.
    pub(super) fn take(
        &self,
        layout: &Layout,
        node: Node,
        vertex: usize,
        replaced: Option<(Node, Origin)>,
        held: &mut Vec<Held>,
    ) {
        let hull = self.of(layout, node).expect("a hull with a vertex");
        let origin = match replaced {
            Some((other, origin)) if other == node => origin,
            _ => hull.origin(vertex),
        };
        match origin {
            Origin::Own(resolution) => held.push(Held { node, resolution }),
            Origin::Split(num_steps) => {
                let mut vertices = [0; 8];
                for &place in &self.takers(layout, node)[..num_steps as usize] {
                    vertices[usize::from(place)] += 1;
                }
                for (child, vertex) in layout.children(node).zip(vertices) {
                    self.take(layout, child, vertex, replaced, held);
                }
            }
        }
    }

    fn takers(&self, layout: &Layout, node: Node) -> &[u8] {
        self.levels[node.level as usize].takers.get(layout.node_index(node))
    }

    /// What is between a vertex of the root's hull and the next.
    pub(super) fn inside(&self, layout: &Layout, prices: &Prices, vertex: usize) -> Inside {
        let (mut node, mut vertex) = (layout.root(), vertex);
        // Down to the one subtree that takes the step.
        let hull = loop {
            let hull = self.of(layout, node).expect("a hull with a vertex");
            match (hull.origin(vertex), hull.origin(vertex + 1)) {
                (Origin::Split(first), Origin::Split(second)) if second == first + 1 => {
                    let (before, place) = (first as usize, self.takers(layout, node)[first as usize]);
                    vertex =
                        self.takers(layout, node)[..before].iter().filter(|&&other| other == place).count();
                    node =
                        layout.children(node).nth(usize::from(place)).expect("the child that takes the step");
                }
                _ => break hull,
            }
        };
        let (from, to) = (hull.point(vertex), hull.point(vertex + 1));
        let own = prices.of(layout, node).iter();
        let mut points: Vec<_> = own.map(|choice| (choice.point, Origin::Own(choice.resolution))).collect();
        self.splits(layout, node, |point, count| points.push((point, Origin::Split(count))));
        points.retain(|(point, _)| (from.bytes..to.bytes).contains(&point.bytes));
        // Stable: of equal points the first stays.
        points.sort_by_key(|&(point, _)| point);
        let mut least = from.error;
        points.retain(|(point, _)| {
            let is_better = point.error < least;
            least = least.min(point.error);
            is_better
        });
        Inside { node, from, points }
    }

    /// Visits the vertices of all children together, if there are, with the number of steps to each.
    fn splits(&self, layout: &Layout, node: Node, mut visit: impl FnMut(Point, u32)) {
        if node.level == 0 {
            return;
        }
        let hulls: Option<Vec<_>> = layout.children(node).map(|child| self.of(layout, child)).collect();
        let Some(hulls) = hulls else { return };
        let mut point = hulls.iter().fold(Point { bytes: 0, error: 0 }, |sum, hull| sum.plus(hull.first));
        visit(point, 0);
        let mut steps: Vec<_> = hulls.iter().map(|hull| hull.steps.iter()).collect();
        for (count, &place) in (1..).zip(self.takers(layout, node)) {
            let step = steps[usize::from(place)].next().expect("as many steps as it takes");
            point = Point { bytes: point.bytes + step.bytes, error: point.error - step.error };
            visit(point, count);
        }
    }
}

/// The points that a subtree's hull leaves out, between two vertices.
#[derive(Clone, Debug)]
pub(super) struct Inside {
    pub(super) node: Node,
    /// The first of the two vertices.
    pub(super) from: Point,
    /// Of its own resolutions and of its children together; bytes rising, errors falling, all better than `from`.
    pub(super) points: Vec<(Point, Origin)>,
}

impl Level {
    fn push(&mut self, hull: &[(Point, Origin)]) {
        let start =
            hull.first().map(|&(point, origin)| Start { point, origin, last: hull[hull.len() - 1].0 });
        self.starts.push(start);
        self.steps.items.extend(hull.windows(2).map(|pair| step(pair[0].0, pair[1])));
        self.steps.end();
    }
}

fn step(from: Point, (to, origin): (Point, Origin)) -> Step {
    Step { bytes: to.bytes - from.bytes, error: from.error - to.error, to: origin }
}

/// The lower left hull of two lists of points, each of rising bytes and falling errors (Andrew's scan).
///
/// Of points on one line all stay, of equal points the first list's.
fn lower_hull(a: &[(Point, Origin)], b: &[(Point, Origin)], hull: &mut Vec<(Point, Origin)>) {
    hull.clear();
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    loop {
        let next = match (a.peek(), b.peek()) {
            (None, None) => return,
            (Some(_), None) => a.next(),
            (None, Some(_)) => b.next(),
            (Some((p, _)), Some((q, _))) => {
                if (p.bytes, p.error) <= (q.bytes, q.error) {
                    a.next()
                } else {
                    b.next()
                }
            }
        };
        let Some(&next) = next else { return };
        if hull.last().is_some_and(|(last, _)| next.0.error >= last.error) {
            continue;
        }
        while let [.., before, last] = hull[..] {
            if !step(last.0, next).is_steeper(&step(before.0, last)) {
                break;
            }
            hull.pop();
        }
        hull.push(next);
    }
}
