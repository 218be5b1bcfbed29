//! Undo and redo: the states that something went through, as a line with a present.

/// The states of an edited thing. What was undone can be redone until a new state is pushed.
///
/// Whole states are kept. A state that shares its large parts, as [`TransferFunction2d`](crate::TransferFunction2d)
/// does, costs what it does not share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct History<T> {
    /// The latest last.
    past: Vec<T>,
    present: T,
    /// The next to redo last.
    future: Vec<T>,
}

impl<T> History<T> {
    /// A history that starts at a state.
    pub const fn new(present: T) -> Self {
        Self { past: Vec::new(), present, future: Vec::new() }
    }

    /// The state as it is now.
    pub const fn present(&self) -> &T {
        &self.present
    }

    /// Makes a state the present one, after the one there was; drops what could be redone.
    pub fn push(&mut self, state: T) {
        self.past.push(std::mem::replace(&mut self.present, state));
        self.future.clear();
    }

    /// Goes back by one state; `false` at the first, where nothing changes.
    pub fn undo(&mut self) -> bool {
        let Some(state) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(&mut self.present, state));
        true
    }

    /// Goes forward by one state; `false` at the last, where nothing changes.
    pub fn redo(&mut self) -> bool {
        let Some(state) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(&mut self.present, state));
        true
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[derive(Clone, Copy, Debug)]
    enum Step {
        Push(u8),
        Undo,
        Redo,
    }

    fn step() -> impl Strategy<Value = Step> {
        prop_oneof![any::<u8>().prop_map(Step::Push), Just(Step::Undo), Just(Step::Redo)]
    }

    #[test]
    fn a_new_state_drops_what_was_undone() {
        let mut history = History::new('a');
        assert!(!history.undo() && !history.redo());
        history.push('b');
        history.push('c');
        assert!(history.undo() && history.undo() && !history.undo());
        assert_eq!(*history.present(), 'a');
        assert!(history.redo());
        assert_eq!(*history.present(), 'b');
        history.push('d');
        assert!(!history.redo(), "c is gone");
        assert!(history.undo());
        assert_eq!(*history.present(), 'b');
    }

    proptest! {
        /// Against one list and a place in it.
        #[test]
        fn any_steps_lead_where_a_list_says(steps in proptest::collection::vec(step(), 0..60)) {
            let mut history = History::new(0);
            let (mut list, mut at) = (vec![0], 0);
            for step in steps {
                let moved = match step {
                    Step::Push(state) => {
                        history.push(state);
                        list.truncate(at + 1);
                        list.push(state);
                        at += 1;
                        continue;
                    }
                    Step::Undo => (history.undo(), at > 0, -1),
                    Step::Redo => (history.redo(), at + 1 < list.len(), 1),
                };
                prop_assert_eq!(moved.0, moved.1);
                at = at.wrapping_add_signed(if moved.1 { moved.2 } else { 0 });
                prop_assert_eq!(*history.present(), list[at]);
            }
        }
    }
}
