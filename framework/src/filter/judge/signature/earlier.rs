//! The state with the signals that it had earlier.

use crate::model::sensor::measurement::At;
use crate::state::State;

/// A copy of the state in which each signal has its earlier value.
#[derive(Clone, Default)]
pub(super) struct Earlier {
    state: State,
}

impl Earlier {
    /// The state with the earlier signals, or `None` where all are those of the present: they have no noise.
    pub(super) fn of(&mut self, at: &At<'_>) -> Option<&State> {
        let pairs = &at.layout.earlier;
        let range = |from: usize, n: usize| from..from + n;
        let signals = &at.state.signals;
        let same =
            |&[now, before, n]: &[usize; 3]| signals[range(now, n)] == signals[range(before, n)];
        if pairs.iter().all(same) {
            return None;
        }
        self.state.clone_from(at.state);
        for &[now, before, n] in pairs {
            self.state.signals.copy_within(range(before, n), now);
        }
        Some(&self.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Layout;
    use crate::units::sample::{Sample, SensorId};
    use crate::units::time::Time;

    #[test]
    fn each_signal_has_its_earlier_value_unless_all_are_the_same() {
        let layout = Layout { signals: 5, earlier: vec![[0, 3, 2]], ..Layout::default() };
        let sample = Sample::empty(Time::MIN, SensorId(0));
        let mut state = State { signals: vec![1.0, 2.0, 3.0, 4.0, 5.0], ..State::default() };
        let mut earlier = Earlier::default();
        let at = At { layout: &layout, state: &state, sample: &sample };
        assert!(earlier.of(&at).is_some_and(|e| e.signals == [4.0, 5.0, 3.0, 4.0, 5.0]));
        state.signals[3..].copy_from_slice(&[1.0, 2.0]);
        let at = At { layout: &layout, state: &state, sample: &sample };
        assert!(earlier.of(&at).is_none());
    }
}
