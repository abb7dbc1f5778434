//! Transient states: pools of blocks that come and go while the filter runs.
//!
//! A pool has a fixed number of blocks. A block that is there carries the label of what it
//! describes, such as the number of a landmark. A block that is absent has the value NaN, and zero
//! rows and columns in the covariance: a sink shows a gap, and no update reaches it.

use crate::state::layout::{Handle, Layout, State};
use crate::state::manifold::Manifold;
use std::marker::PhantomData;
use std::ops::Range;

/// A pool of blocks that come and go: see `Composer::transients`.
#[derive(Debug)]
pub struct Transients<M> {
    pub(crate) pool: usize,
    pub(crate) manifold: PhantomData<fn() -> M>,
}

impl<M> Clone for Transients<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Transients<M> {}

/// Blocks of a pool.
#[derive(Clone, Debug)]
pub struct Pool {
    /// Name of what a block describes, such as `landmark`.
    pub name: String,
    /// Slots of the blocks.
    pub slots: Range<usize>,
    /// Place of the first label in [`State::labels`].
    pub(crate) first: usize,
    /// Set if the prior sigma of the blocks is given.
    pub(crate) has_prior: bool,
    /// True values by label, as [`State::values`] holds them.
    pub(crate) truths: Vec<(u32, Vec<f64>)>,
}

impl Pool {
    /// Labels of the blocks.
    pub(crate) fn labels<'a>(&self, state: &'a State) -> &'a [Option<u32>] {
        &state.labels[self.first..][..self.slots.len()]
    }

    /// True value of a label, where it is known.
    pub(crate) fn truth(&self, label: u32) -> Option<&[f64]> {
        self.truths.iter().find(|(of, _)| *of == label).map(|(_, value)| value.as_slice())
    }
}

impl Layout {
    /// Slot of the block that carries a label.
    pub(crate) fn holder(&self, state: &State, pool: usize, label: u32) -> Option<usize> {
        let pool = &self.pools[pool];
        let at = pool.labels(state).iter().position(|l| *l == Some(label))?;
        Some(pool.slots.start + at)
    }

    /// Returns `true` if the block of that slot comes and goes, and is not there now.
    pub fn is_absent(&self, state: &State, slot: usize) -> bool {
        self.blocks[slot].label.is_some_and(|label| state.labels[label].is_none())
    }

    /// Returns `true` if a block of that slot comes and goes.
    pub fn is_transient(&self, slot: usize) -> bool {
        self.blocks[slot].label.is_some()
    }

    /// Handle of a slot of the pool.
    pub(crate) fn transient<M: Manifold>(slot: usize) -> Handle<M> {
        Handle { slot, manifold: PhantomData }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_true_value_of_a_label_is_that_of_no_other() {
        let truths = vec![(7, vec![1.0]), (3, vec![2.0])];
        let (name, slots) = ("landmark".to_owned(), 0..2);
        let pool = Pool { name, slots, first: 0, has_prior: false, truths };
        let truth = [7, 3, 4].map(|label| pool.truth(label));
        assert_eq!(truth, [Some(&[1.0][..]), Some(&[2.0][..]), None]);
    }
}
