//! Selection: a walk from the root that asks a filter what to do with each node.

use volery_pyramid::{Layout, Node};

use crate::cut::Cut;

/// What a filter wants done with a node; ordered by strength.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Answer {
    /// The node is good enough: draw it, do not look at its children.
    Draw,
    /// The node is too coarse: visit its children. At level 0, which has none, it is drawn.
    Descend,
    /// Nothing of the node is to be seen: leave it and its children out.
    Skip,
}

/// A selection filter.
///
/// A filter answers for its own criterion alone and says [`Answer::Draw`] where it has no objection.
/// Filters combine by the stronger answer: a tuple skips a node when one of its filters skips it, else
/// descends when one wants to descend, else draws. A tuple asks from left to right and stops at a skip.
pub trait Filter {
    /// What to do with `node`. Asked for each node at most once in a walk, for a parent before its
    /// children.
    fn answer(&mut self, node: Node) -> Answer;
}

impl<F: FnMut(Node) -> Answer> Filter for F {
    fn answer(&mut self, node: Node) -> Answer {
        self(node)
    }
}

macro_rules! tuple_filter {
    ($($name:ident . $field:tt),*) => {
        impl<$($name: Filter),*> Filter for ($($name,)*) {
            fn answer(&mut self, node: Node) -> Answer {
                let mut strongest = Answer::Draw;
                $(
                    if strongest != Answer::Skip {
                        strongest = strongest.max(self.$field.answer(node));
                    }
                )*
                strongest
            }
        }
    };
}
tuple_filter!(A.0, B.1);
tuple_filter!(A.0, B.1, C.2);
tuple_filter!(A.0, B.1, C.2, D.3);

/// Walks the tree from the root, asking `filter`. The cut covers the domain exactly once.
pub fn select(layout: &Layout, mut filter: impl Filter) -> Cut {
    fn visit(layout: &Layout, node: Node, filter: &mut impl Filter, cut: &mut Cut) {
        match filter.answer(node) {
            Answer::Skip => cut.skipped.push(node),
            Answer::Descend if node.level > 0 => {
                for child in layout.children(node) {
                    visit(layout, child, filter, cut);
                }
            }
            Answer::Draw | Answer::Descend => cut.nodes.push(node),
        }
    }
    let mut cut = Cut::default();
    // As deep as there are levels: at most 31.
    visit(layout, layout.root(), &mut filter, &mut cut);
    cut
}
