//! The state of the node, which a lifecycle manager such as Nav2's sees and changes.
//!
//! The states and transitions are those of `lifecycle_msgs`. The filter runs in each of them; the topics of
//! the sink are published in the active state alone, as a managed publisher of ROS 2 does.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// A state of `lifecycle_msgs/msg/State`, by its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// Nothing is published, and the filter has been reset.
    Unconfigured = 1,
    /// Nothing is published.
    Inactive = 2,
    /// The estimates are published.
    Active = 3,
    /// Nothing is published any more.
    Finalized = 4,
}

impl State {
    /// All states, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Unconfigured, Self::Inactive, Self::Active, Self::Finalized];

    /// The label in messages.
    pub fn label(self) -> &'static str {
        match self {
            Self::Unconfigured => "unconfigured",
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Finalized => "finalized",
        }
    }
}

/// A transition of `lifecycle_msgs/msg/Transition`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Number in messages.
    pub id: u8,
    /// Label in messages, which several transitions share.
    pub label: &'static str,
    /// State before it.
    pub start: State,
    /// State after it.
    pub goal: State,
}

impl Transition {
    /// The transition of this number and label between two states.
    const fn new(id: u8, label: &'static str, start: State, goal: State) -> Self {
        Self { id, label, start, goal }
    }

    /// All transitions that a program may ask for.
    pub const ALL: [Self; 7] = [
        Self::new(1, "configure", State::Unconfigured, State::Inactive),
        Self::new(2, "cleanup", State::Inactive, State::Unconfigured),
        Self::new(3, "activate", State::Inactive, State::Active),
        Self::new(4, "deactivate", State::Active, State::Inactive),
        Self::new(5, "shutdown", State::Unconfigured, State::Finalized),
        Self::new(6, "shutdown", State::Inactive, State::Finalized),
        Self::new(7, "shutdown", State::Active, State::Finalized),
    ];

    /// The transition from a state that a request asks for: by its label where it has one, else by its
    /// number.
    pub fn asked(start: State, id: u8, label: &str) -> Option<Self> {
        let named = |t: &Self| if label.is_empty() { t.id == id } else { t.label == label };
        Self::ALL.into_iter().find(|t| t.start == start && named(t))
    }
}

/// The state of the node of this program in a domain, which its link and its sinks share.
#[derive(Debug)]
pub struct Lifecycle(AtomicU8);

/// The nodes of this program, by their domain.
static NODES: Mutex<Vec<(u16, Weak<Lifecycle>)>> = Mutex::new(Vec::new());

impl Lifecycle {
    /// The state of the node in a domain. A new node begins in `start`; a run that is reset goes on in the
    /// state that it had.
    pub fn of(domain: u16, start: State) -> Arc<Self> {
        // a list is a list, whatever happened to a thread that held it
        let mut nodes = NODES.lock().unwrap_or_else(PoisonError::into_inner);
        nodes.retain(|(_, node)| node.strong_count() > 0);
        let known = nodes.iter().find(|(other, _)| *other == domain);
        known.and_then(|(_, node)| node.upgrade()).unwrap_or_else(|| {
            let node = Arc::new(Self(AtomicU8::new(start as u8)));
            nodes.push((domain, Arc::downgrade(&node)));
            node
        })
    }

    /// The state.
    pub fn state(&self) -> State {
        let number = self.0.load(Ordering::Relaxed);
        State::ALL.into_iter().find(|s| *s as u8 == number).unwrap_or(State::Finalized)
    }

    /// Returns `true` while the estimates are published.
    pub fn is_active(&self) -> bool {
        self.state() == State::Active
    }

    /// Changes the state.
    pub fn enter(&self, state: State) {
        self.0.store(state as u8, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_manager_brings_the_node_up_and_down_by_numbers_or_labels() {
        let mut state = State::Unconfigured;
        let up_and_down = [
            (1, "", State::Inactive),
            (0, "activate", State::Active),
            (4, "", State::Inactive),
            (2, "", State::Unconfigured),
            (0, "shutdown", State::Finalized),
        ];
        for (id, label, goal) in up_and_down {
            let asked = Transition::asked(state, id, label);
            assert_eq!(asked.map(|transition| transition.goal), Some(goal), "{label}");
            state = goal;
        }
        // nothing leads out of the last state, and a state has its own transitions alone
        assert!((0..=8).all(|id| Transition::asked(state, id, "").is_none()));
        assert_eq!(Transition::asked(State::Unconfigured, 3, ""), None);
    }

    #[test]
    fn a_link_and_its_sinks_share_the_state_and_a_later_run_begins_anew() {
        let link = Lifecycle::of(231, State::Unconfigured);
        let sink = Lifecycle::of(231, State::Active);
        assert!(!sink.is_active() && Lifecycle::of(232, State::Active).is_active());
        link.enter(State::Active);
        assert!(sink.is_active());
        drop((link, sink));
        assert_eq!(Lifecycle::of(231, State::Inactive).state(), State::Inactive);
    }
}
