//! Pictures of one view that get better as bricks arrive.
//!
//! # Method
//! The cut of the last picture is known before the first brick is there: layout and statistics are at hand. Wanted
//! are its nodes and all their ancestors, coarse levels first, of one level those nearest to the focus first. A step
//! makes some of them resident and draws the finest cut that they allow: each node of the last cut, or the ancestor
//! that stands for it. Levels are shown strictly one after the other: a node is replaced by its children only when
//! every coarser level is complete and all of its children that are wanted are there. So a picture before the last
//! is balanced as the last one is (levels of neighbours are cut off at the same place, or one apart), and as free of
//! seams.
//!
//! # Guarantees
//! The last picture is that of [`Session::render`], bit for bit. Every picture shows all of the planes: the first one
//! waits for the root. Every step makes progress: where no brick is at hand, it waits for the most wanted one.

use std::collections::HashSet;
use std::time::Instant;

use volery_frame::Backend;
use volery_octree::{Answer, select};
use volery_pyramid::{Node, NodeSource};

use super::{Chosen, Planes, choose};
use crate::data::VolumeData;
use crate::residency::{self, Uploaded};
use crate::session::{Picture, RenderError, Session, Times};
use crate::view::{How, PlaneView, View};

/// One picture on the way to the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// What can be seen by now.
    pub picture: Picture,
    /// Whether nothing better comes.
    pub is_last: bool,
}

/// The pictures of one view, an iterator; see [`Session::progressive`].
pub struct Progressive<'a> {
    session: &'a mut Session<VolumeData>,
    backend: &'a mut dyn Backend,
    technique: Planes,
    arrivals: Option<&'a dyn NodeSource>,
    /// As it was asked for, and in the space of the data.
    view: View,
    local: View,
    planes: PlaneView,
    bricks_per_step: usize,
    target: Chosen,
    /// All nodes that will be resident.
    wanted: HashSet<Node>,
    /// Those that are not yet, the most wanted one last.
    missing: Vec<Node>,
    is_done: bool,
}

impl Session<VolumeData> {
    /// Draws a view again and again, each time with at most `bricks_per_step` bricks more (at least 1), until it
    /// is complete. `arrivals` is where bricks come from, a pyramid of this volume that may deliver late; if
    /// missing, the session's own.
    ///
    /// # Errors
    /// When the view is not meaningful, or not of planes: other techniques have no such pictures.
    pub fn progressive<'a>(
        &'a mut self,
        view: &View,
        arrivals: Option<&'a dyn NodeSource>,
        bricks_per_step: usize,
        backend: &'a mut dyn Backend,
    ) -> Result<Progressive<'a>, RenderError> {
        self.check(view)?;
        let local = self.local(view).into_owned();
        let How::Planes(planes) = &local.how else {
            return Err(RenderError::NotProgressive { technique: view.how.name() });
        };
        let planes = planes.clone();
        let volume = self.data();
        let target = choose(volume, &local, &planes);
        let layout = volume.source().layout();
        let mut wanted = HashSet::new();
        for &node in &target.cut.nodes {
            let levels = node.level..layout.num_levels();
            // An ancestor that is wanted already has all of its own.
            levels.map(|level| node.ancestor(level)).take_while(|&node| wanted.insert(node)).for_each(drop);
        }
        let distance = |node: &Node| {
            let [low, high] = layout.world_bounds(*node);
            planes.focus.map_or(0.0, |focus| ((low + high) / 2.0).distance(focus.point))
        };
        let mut missing: Vec<(f64, Node)> = wanted.iter().map(|node| (distance(node), *node)).collect();
        missing.sort_by(|(a_distance, a), (b_distance, b)| {
            let by_level = a.level.cmp(&b.level);
            by_level.then(b_distance.total_cmp(a_distance)).then(b.index.cmp(&a.index))
        });
        Ok(Progressive {
            session: self,
            backend,
            technique: Planes::default(),
            arrivals,
            view: view.clone(),
            local,
            planes,
            bricks_per_step: bricks_per_step.max(1),
            target,
            wanted,
            missing: missing.into_iter().map(|(_, node)| node).collect(),
            is_done: false,
        })
    }
}

impl Progressive<'_> {
    /// How many bricks there will be in all.
    pub fn num_bricks(&self) -> usize {
        self.wanted.len()
    }

    fn step(&mut self) -> Result<Step, RenderError> {
        let start = Instant::now();
        let mut uploaded = self.receive()?;
        let upload = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let is_last = self.missing.is_empty();
        let chosen = if is_last { self.target.clone() } else { self.finest() };
        let plan = self.technique.plan_of(self.session.data_mut(), (&self.local, &self.planes), chosen)?;
        let select = start.elapsed().as_secs_f64();
        let start = Instant::now();
        // Where the backend's memory was full, it may have forgotten what is shown.
        uploaded += self.session.upload(&plan, None, self.backend)?;
        let drawn = self.session.draw(&self.local, &plan, self.backend)?;
        let draw = start.elapsed().as_secs_f64();
        let times = [Times { select, geometry: None, upload: Some(upload), draw, paced: None }];
        let picture = self.session.picture(&self.view, plan, drawn, (uploaded, &times), self.backend);
        Ok(Step { picture, is_last })
    }

    /// Makes bricks resident that are at hand, or waits for the most wanted one.
    fn receive(&mut self) -> Result<Uploaded, RenderError> {
        let store = self.session.data_mut().store_for(self.view.of_values()?);
        let own = self.session.data().source();
        let source: &dyn NodeSource = self.arrivals.unwrap_or(own);
        let mut arrived: Vec<Node> = Vec::new();
        let root = source.layout().root();
        for &node in self.missing.iter().rev() {
            // Without the root there is nothing to show.
            if arrived.len() < self.bricks_per_step && (node == root || source.is_at_hand(node)) {
                arrived.push(node);
            }
        }
        if arrived.is_empty() {
            arrived.extend(self.missing.last());
        }
        let here: HashSet<Node> = arrived.iter().copied().collect();
        let uploaded = residency::upload(source, &store, &arrived, self.backend)?;
        self.missing.retain(|node| !here.contains(node));
        Ok(uploaded)
    }

    /// The finest choice that the bricks which are there allow.
    fn finest(&self) -> Chosen {
        let volume = self.session.data();
        let layout = volume.source().layout();
        let missing: HashSet<Node> = self.missing.iter().copied().collect();
        // Levels above this one are complete.
        let incomplete = self.missing.iter().map(|node| node.level).max().unwrap_or(0);
        let drawn: HashSet<Node> = self.target.cut.nodes.iter().copied().collect();
        let answer = |node: Node| {
            if !self.wanted.contains(&node) || missing.contains(&node) {
                return Answer::Skip;
            }
            let has_all_children = || {
                layout.children(node).all(|child| !self.wanted.contains(&child) || !missing.contains(&child))
            };
            let is_drawn = drawn.contains(&node)
                || node.level <= incomplete
                || node.level == incomplete + 1 && !has_all_children();
            if is_drawn { Answer::Draw } else { Answer::Descend }
        };
        let cut = select(layout, answer);
        Chosen::of(volume, (&self.local, &self.planes), cut)
    }
}

impl Iterator for Progressive<'_> {
    type Item = Result<Step, RenderError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_done {
            return None;
        }
        let step = self.step();
        self.is_done = step.as_ref().map_or(true, |step| step.is_last);
        Some(step)
    }
}
