//! The estimate of a filter.

use super::course::guide::{Guide, Offset};
use crate::checkpoint::saved;
use crate::model::process::start::FilterView;
use crate::model::record::{Epoch, Truth};
use crate::state::covariance::{Covariance, Transition};
use crate::state::{Layout, State};
use crate::units::time::Time;
use nalgebra::Vector3;

/// State and covariance, which every part of the filter reads or changes.
#[derive(Clone)]
pub(super) struct Estimate {
    pub(super) state: State,
    pub(super) covariance: Covariance,
    /// Estimate relative to the state, where the state follows a given trajectory.
    pub(super) offset: Option<Offset>,
    /// Covariance that contains a branch as well.
    pub(super) mixture: Option<Covariance>,
    /// Covariance of the last epoch, where that of the filter was behind.
    pub(super) present: Option<Covariance>,
}

saved!(Estimate { state, covariance } except { offset, mixture, present });

impl Estimate {
    pub(super) fn new(layout: &Layout) -> Self {
        let (state, covariance) = (layout.initial_state(), Covariance::zero(layout.tangent));
        Self { state, covariance, offset: None, mixture: None, present: None }
    }

    /// Estimate relative to the state; empty where the state is the estimate.
    pub(super) fn offset(&self) -> &[f64] {
        self.offset.as_ref().map_or(&[], |offset| &offset.d)
    }

    /// Follows a trajectory over a step that the covariance has taken.
    pub(super) fn follow(
        &mut self,
        guide: Option<&mut Guide>,
        layout: &Layout,
        transition: &Transition,
    ) {
        if let Some((guide, offset)) = guide.zip(self.offset.as_mut()) {
            guide.propagate(layout, &mut self.state, offset, transition);
        }
    }

    /// Returns `true` unless the vehicle may be at rest: its speed is beyond 3.5 sigma. A vehicle without a
    /// velocity among its states counts as one that moves.
    pub(super) fn moves(&self, layout: &Layout) -> bool {
        let Some(block) = layout.vehicle().velocity else { return true };
        let Some(tangent) = layout.blocks[block.slot()].tangent else { return true };
        let velocity: Vector3<f64> = self.state.get(layout, block);
        let variance: f64 = (tangent..tangent + 3).map(|i| self.covariance.get(i, i)).sum();
        velocity.norm_squared() > 3.5 * 3.5 * variance
    }

    /// The covariance as it is reported.
    pub(super) fn reported(&self) -> &Covariance {
        self.mixture.as_ref().unwrap_or(&self.covariance)
    }

    /// The estimate as sinks see it.
    pub(super) fn epoch<'a>(&'a self, layout: &'a Layout, truth: Option<Truth<'a>>) -> Epoch<'a> {
        let covariance = self.present.as_ref().unwrap_or(self.reported());
        Epoch { layout, state: &self.state, covariance, truth }
    }

    /// The estimate as alignments and monitors see it.
    pub(super) fn view<'a>(
        &'a self,
        layout: &'a Layout,
        gated: Option<(Time, u64)>,
    ) -> FilterView<'a> {
        let (state, covariance) = (&self.state, &self.covariance);
        FilterView { layout, state, covariance, gated }
    }
}
