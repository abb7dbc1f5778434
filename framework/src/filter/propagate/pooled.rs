//! A covariance rate below that of the driving sensor: the transitions of several steps as one.
//!
//! To first order, the product of the transitions `I + A_k` of short steps is `I + sum A_k`, and
//! their process noise adds up. Products of two `A_k` are neglected: a tilt that turns into a
//! velocity, which turns into a position, does so one pooled step later. The estimate itself takes
//! every sample.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::state::covariance::Transition;
use crate::units::time::{Span, Time};

/// The steps since the covariance was propagated.
#[derive(Clone)]
pub(super) struct PooledSteps {
    /// Time between two propagations of the covariance.
    period: Span,
    /// Beginning of the first step, if there is one.
    since: Option<Time>,
    /// The transition over all steps.
    whole: Transition,
    /// The share of the identity in its elements.
    identity: Vec<f64>,
}

saved!(PooledSteps { since, whole } except { period, identity });

impl PooledSteps {
    /// The pool of a composition that sets a covariance rate.
    pub(super) fn new(composition: &Composition, transition: &Transition) -> Option<Self> {
        let period = composition.estimator.covariance_period()?;
        let identity = transition.identity();
        Some(Self { period, since: None, whole: transition.clone(), identity })
    }

    /// Adds the step of a transition from one time to another. Returns `true` when the covariance
    /// is due.
    pub(super) fn add(&mut self, transition: &Transition, from: Time, to: Time) -> bool {
        match self.since {
            None => self.whole.copy_step(transition),
            Some(_) => self.whole.add_step(transition, &self.identity),
        }
        // the step after this one, if as long as this one, would end too late
        to + (to - from) - *self.since.get_or_insert(from) > self.period
    }

    /// The transition over all steps.
    pub(super) fn whole(&self) -> &Transition {
        &self.whole
    }

    /// Returns `true` if the covariance has not taken all steps.
    pub(super) fn holds_steps(&self) -> bool {
        self.since.is_some()
    }

    /// Ends the steps: the covariance takes them with the transition that is returned.
    pub(super) fn take(&mut self) -> &mut Transition {
        self.since = None;
        &mut self.whole
    }
}
