//! The covariance takes the steps between two uses of it as one: see [`Pool`].
//!
//! The estimate itself takes every sample. A pool ends when it is full, before each use of the covariance, and
//! where `covariance_rate` ends it.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::compose::covariance_rate::CovarianceRate;
use crate::state::covariance::{Covariance, Pool, Transition};
use crate::units::time::{Span, Time};

/// The steps since the covariance was propagated.
#[derive(Clone)]
pub(super) struct PooledSteps {
    /// Longest time between two propagations of the covariance.
    period: Option<Span>,
    /// Beginning of the first step.
    since: Time,
    pool: Pool,
}

saved!(PooledSteps { since, pool } except { period });

impl PooledSteps {
    /// An empty pool; `None` where the covariance takes every step by itself.
    pub(super) fn new(composition: &Composition, transition: &Transition) -> Option<Self> {
        let period = match composition.estimator.covariance_rate() {
            CovarianceRate::EverySample => return None,
            CovarianceRate::Least(rate) => Span::from_seconds(1.0 / rate.value().si()),
            CovarianceRate::Bounded => None,
        };
        let pool = Pool::new(&composition.layout, transition);
        Some(Self { period, since: Time::MIN, pool })
    }

    /// Adds the step of a transition from one time to another. Returns `true` when the covariance
    /// is due.
    pub(super) fn add(&mut self, transition: &Transition, from: Time, to: Time) -> bool {
        if self.pool.is_empty() {
            self.since = from;
        }
        let full = self.pool.add(transition, to.since(from));
        // the step after this one, if as long as this one, would end too late
        full || self.period.is_some_and(|period| to + (to - from) - self.since > period)
    }

    /// Returns `true` if the covariance has not taken all steps.
    pub(super) fn holds_steps(&self) -> bool {
        !self.pool.is_empty()
    }

    /// Moves a covariance over the steps: see [`Pool::take`].
    pub(super) fn take(&mut self, covariance: &mut Covariance) -> &mut Transition {
        self.pool.take(covariance)
    }
}
