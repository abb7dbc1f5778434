//! The roster of the blocks that come and go: which are there, and which a sensor adds and removes.

use crate::state::manifold::Manifold;
use crate::state::{Layout, State, Transients};
use crate::units::time::Time;

/// A change of the roster. The value of a new block is in [`Changes::values`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Change {
    /// Adds a block at `value`, the first number of its value: with its prior, or placed by the
    /// sample.
    Add { pool: usize, label: u32, value: usize, placed: bool },
    /// Marginalises a block.
    Remove { pool: usize, label: u32 },
}

/// Changes that a sensor asks for at one sample, in their order.
#[derive(Debug, Default)]
pub(crate) struct Changes {
    pub(crate) list: Vec<Change>,
    pub(crate) values: Vec<f64>,
}

impl Changes {
    pub(crate) fn clear(&mut self) {
        self.list.clear();
        self.values.clear();
    }
}

/// The blocks that come and go, as a sensor sees and changes them before a sample is used: see
/// [`crate::model::sensor::measurement::MeasurementModel::admit`].
#[derive(Debug)]
pub struct Roster<'a> {
    pub(crate) layout: &'a Layout,
    pub(crate) state: &'a State,
    /// Time of the last observation of each label's block.
    pub(crate) seen: &'a [Time],
    pub(crate) changes: &'a mut Changes,
}

impl Roster<'_> {
    /// Returns `true` if a block with that label is there, or is being added.
    pub fn has<M>(&self, of: Transients<M>, label: u32) -> bool {
        let last = self.changes.list.iter().rev().find_map(|change| match *change {
            Change::Add { pool, label: of_change, .. } => {
                (pool == of.pool && of_change == label).then_some(true)
            }
            Change::Remove { pool, label: of_change } => {
                (pool == of.pool && of_change == label).then_some(false)
            }
        });
        last.unwrap_or_else(|| self.layout.holder(self.state, of.pool, label).is_some())
    }

    /// Number of blocks of the pool that are free.
    pub fn free<M>(&self, of: Transients<M>) -> usize {
        let labels = self.layout.pools[of.pool].labels(self.state);
        let absent = labels.iter().filter(|label| label.is_none()).count();
        let (mut added, mut removed) = (0, 0);
        for change in &self.changes.list {
            match change {
                Change::Add { pool, .. } => added += usize::from(*pool == of.pool),
                Change::Remove { pool, .. } => removed += usize::from(*pool == of.pool),
            }
        }
        absent + removed - added
    }

    /// Label that no accepted sample observed for the longest time, and the time of its last
    /// observation, or of its addition if there was none.
    pub fn longest_unseen<M>(&self, of: Transients<M>) -> Option<(u32, Time)> {
        let pool = &self.layout.pools[of.pool];
        let present = pool.labels(self.state).iter().zip(&self.seen[pool.first..]);
        let present = present.filter_map(|(label, seen)| Some(((*label)?, *seen)));
        present.filter(|(label, _)| self.has(of, *label)).min_by_key(|(_, seen)| *seen)
    }

    /// Adds a block with its prior: the value, and the sigma that the pool was composed with,
    /// uncorrelated with every other state. Returns `false`, and adds nothing, if the pool has no
    /// prior sigma or no free block, or if the label is there already.
    pub fn add<M: Manifold>(
        &mut self,
        of: Transients<M>,
        label: u32,
        value: &M::Value<f64>,
    ) -> bool {
        self.layout.pools[of.pool].has_prior && self.push::<M>(of, label, value, false)
    }

    /// Adds a block whose value the present sample determines, by the inverse of the model. The
    /// filter refines the value until the sample's innovation vanishes. The block then has the
    /// covariance of the sample's noise and of the states that the model reads, and the
    /// correlation with them; the sample is used up, and corrects no other state. The sample needs
    /// as many channels as the block has error states. Returns `false`, and adds nothing, if no
    /// block is free or the label is there already.
    pub fn place<M: Manifold>(
        &mut self,
        of: Transients<M>,
        label: u32,
        value: &M::Value<f64>,
    ) -> bool {
        self.push::<M>(of, label, value, true)
    }

    fn push<M: Manifold>(
        &mut self,
        of: Transients<M>,
        label: u32,
        value: &M::Value<f64>,
        placed: bool,
    ) -> bool {
        if self.has(of, label) || self.free(of) == 0 {
            return false;
        }
        let first = self.changes.values.len();
        self.changes.values.resize(first + M::AMBIENT, 0.0);
        M::store(value, &mut self.changes.values[first..]);
        self.changes.list.push(Change::Add { pool: of.pool, label, value: first, placed });
        true
    }

    /// Marginalises a block: its row and column leave the covariance, and what the other states
    /// learned through it stays. Returns `false` if the label is not there.
    pub fn remove<M>(&mut self, of: Transients<M>, label: u32) -> bool {
        let there = self.has(of, label);
        if there {
            self.changes.list.push(Change::Remove { pool: of.pool, label });
        }
        there
    }
}
