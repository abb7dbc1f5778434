//! Filter state of the blocks that come and go.

use crate::checkpoint::saved;
use crate::state::covariance::{Covariance, Update};
use crate::state::{Layout, State};
use crate::units::time::Time;

/// Filter state of the blocks that come and go.
#[derive(Clone, Debug)]
pub(in crate::filter) struct Transients {
    /// Time of the last observation of each label's block.
    seen: Vec<Time>,
}

saved!(Transients {} each { seen });

impl Transients {
    pub(in crate::filter) fn new(labels: usize) -> Self {
        Self { seen: vec![Time::MIN; labels] }
    }

    /// Time of the last observation of each label's block.
    pub(super) fn seen(&self) -> &[Time] {
        &self.seen
    }

    /// Notes that a block takes a label.
    pub(super) fn occupy(&mut self, label: usize, time: Time) {
        self.seen[label] = time;
    }

    /// First error state whose variance is not a positive finite number; an absent block has none.
    pub(in crate::filter) fn first_invalid(
        layout: &Layout,
        state: &State,
        covariance: &Covariance,
    ) -> Option<usize> {
        let first = covariance.first_invalid()?;
        if layout.labels == 0 {
            return Some(first);
        }
        let present = (0..layout.blocks.len()).filter(|slot| !layout.is_absent(state, *slot));
        let mut rows = present.flat_map(|slot| layout.blocks[slot].tangent_range());
        rows.find(|i| {
            let variance = covariance.get(*i, *i);
            !(variance > 0.0 && variance.is_finite())
        })
    }

    /// Notes that an accepted sample observed the blocks that its model read.
    pub(in crate::filter) fn note(&mut self, layout: &Layout, update: &Update, time: Time) {
        if self.seen.is_empty() {
            return;
        }
        let labels = update.read.slots().filter_map(|slot| layout.blocks[slot].label);
        labels.for_each(|label| self.seen[label] = time);
    }
}
