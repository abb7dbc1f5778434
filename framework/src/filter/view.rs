//! What a filter shows of itself: estimate, layout, truth and snapshots.

use super::ekf::Ekf;
use super::judge::branch::Branch;
use super::judge::split::mixture;
use super::parts::Parts;
use crate::compose::Composition;
use crate::compose::snapshot::Snapshot;
use crate::model::record::{Epoch, Truth};
use crate::model::sensor::Role;
use crate::state::covariance::Covariance;
use crate::state::{Block, Layout, State};
use std::borrow::Cow;

impl Ekf {
    /// The estimate.
    pub fn state(&self) -> &State {
        &self.parts.estimate.state
    }

    /// Covariance of the estimate: a copy where the filter has steps left that its own has not taken. While it is
    /// undecided whether a sensor or the filter was wrong, it contains both cases.
    pub fn covariance(&self) -> Cow<'_, Covariance> {
        match self.present() {
            Some(covariance) => Cow::Owned(covariance),
            None => Cow::Borrowed(self.parts.estimate.reported()),
        }
    }

    /// The covariance at the state's time, where that of the filter is behind.
    fn present(&self) -> Option<Covariance> {
        let Parts { estimate, propagation, branch, firsts, .. } = &self.parts;
        if !propagation.is_behind() {
            return None;
        }
        let mut covariance = estimate.covariance.clone();
        let cases = branch.iter().chain(firsts).filter(|_| !self.decides);
        let mut cases: Vec<Branch> = cases.cloned().collect();
        propagation.preview(&mut covariance, |transition| {
            transition.carry_reaches(cases.iter_mut().map(|case| &mut case.effect));
        });
        Some(mixture(&cases, &covariance).unwrap_or(covariance))
    }

    /// Layout of state and covariance.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Composition that the filter runs.
    pub fn composition(&self) -> &Composition {
        &self.composition
    }

    /// Returns `true` once the filter has started.
    pub fn running(&self) -> bool {
        self.parts.start.runs()
    }

    pub(crate) fn searching(&self) -> bool {
        self.parts.start.searches()
    }

    /// Block without an initial value for which the filter waits, although there were references.
    pub(crate) fn lacking(&self) -> Option<&Block> {
        self.parts.start.lacking().map(|slot| &self.layout.blocks[slot])
    }

    pub(super) fn has_reference(&self) -> bool {
        self.composition.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)))
    }

    /// Copies the complete filter.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot::new(self.parts.clone())
    }

    /// Returns to a snapshot of a filter of the same composition.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        if let Some(parts) = snapshot.kept() {
            self.parts.clone_from(parts);
            if self.decides {
                self.parts.estimate.mixture = None;
            }
        }
    }

    /// Last truth that a reference gave or the scenario states.
    pub fn truth(&self) -> Truth<'_> {
        self.parts.truth.view()
    }

    /// Estimate at the current time, with the truth where the scenario states it and no reference
    /// gives it.
    pub fn epoch(&mut self) -> Epoch<'_> {
        let referenced = self.has_reference();
        let present = self.present();
        let Parts { estimate, truth, .. } = &mut self.parts;
        estimate.present = present;
        let stated = !referenced && truth.state_at(&self.layout, estimate.state.time);
        estimate.epoch(&self.layout, stated.then(|| truth.view()))
    }
}
