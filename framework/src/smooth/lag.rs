//! Fixed-lag smoothing: every estimate from the samples of the time after it up to the lag, while
//! the run goes on.
//!
//! A boundary divides the samples that an estimate uses:
//! ```text
//!          t            boundary            t + lag
//!   -------+---------------+-------------------+------> time
//!          |  M1, b1, C1   |    M2, b2, C2     |
//! ```
//! When the boundary moves to the present, one backward pass gives `M1, b1, C1` of every estimate
//! before it, and they wait on a stack. From then on the filter adds its steps to `M2, b2, C2`,
//! and an estimate is complete as soon as the filter is the lag ahead of it: `stretch.rs` joins
//! both parts. When the stack is empty, the boundary moves again. So every step is passed once
//! forward and once backward, whatever the lag, and the result is that of the fixed-interval
//! smoother on the samples until then.

use super::adjoint::Adjoint;
use super::error::SmoothError;
use super::estimate::{Estimate, Row, time_of};
use super::forward::{Forward, Visit};
use super::stretch::Stretch;
use super::tape::Rows;
use crate::compose::estimator::Linearised;
use crate::model::record::{Epoch, Observer};
use crate::state::Layout;
use crate::state::covariance::{Transition, Update};
use crate::units::time::{Span, Time};
use std::sync::Arc;

/// Estimates that wait until the filter is the lag ahead of them.
pub(super) struct Lagged {
    layout: Arc<Layout>,
    row: Row,
    lag: Span,
    /// Steps since the boundary.
    stretch: Stretch,
    /// Estimates before the boundary: each with the sums from its time to the boundary, the
    /// earliest one last.
    stack: Rows,
    /// Numbers of the earliest one, which has left the stack; empty if there is none.
    first: Vec<f64>,
    /// Time of the first estimate after the boundary.
    after: Option<Time>,
    adjoint: Adjoint,
    estimate: Estimate,
    delta: Vec<f64>,
    /// Set if the filter failed: `stretch` then has a part of a step.
    failed_step: bool,
}

impl Lagged {
    pub(super) fn new(ekf: &dyn Linearised, lag: Span) -> Result<Self, SmoothError> {
        let layout = Arc::clone(&ekf.composition().layout);
        let row = Row::new(&layout);
        let considers = ekf.considered().contains(&true);
        Ok(Self {
            lag,
            stretch: Stretch::new(row.n, ekf.considered()),
            stack: Rows::new(row.width() + Adjoint::width(row.n, considers))?,
            first: Vec::new(),
            after: None,
            adjoint: Adjoint::new(&layout, ekf.considered()),
            estimate: Estimate::new(&layout),
            delta: vec![0.0; row.n],
            failed_step: false,
            layout,
            row,
        })
    }

    /// Notes a step of the filter.
    pub(super) fn transition(&mut self, transition: &Transition) {
        self.stretch.transition(transition);
    }

    /// Notes a correction.
    pub(super) fn correction(&mut self, update: &Update) {
        self.stretch.correction(&self.layout, update);
    }

    /// Notes an estimate that the run records.
    pub(super) fn epoch(&mut self, time: Time) {
        self.after.get_or_insert(time);
    }

    /// Notes that the filter failed in its last step.
    pub(super) fn take_back(&mut self) {
        self.failed_step = true;
    }

    /// Returns `true` if the earliest estimate is complete at the present of the filter.
    pub(super) fn is_due(&self, now: Time) -> bool {
        time_of(&self.first).or(self.after).is_some_and(|time| now - time >= self.lag)
    }

    /// Passes the complete estimates to `each`.
    pub(super) fn release(
        &mut self,
        forward: &mut Forward,
        ekf: &mut dyn Linearised,
        mut each: impl FnMut(&Epoch<'_>),
    ) -> Result<(), SmoothError> {
        while self.is_due(ekf.state().time) {
            if self.first.is_empty() {
                self.move_boundary(forward, ekf)?;
            }
            self.give(&mut each)?;
        }
        Ok(())
    }

    /// Passes all estimates that are left to `each`: no further sample comes.
    pub(super) fn finish(
        &mut self,
        forward: &mut Forward,
        ekf: &mut dyn Linearised,
        mut each: impl FnMut(&Epoch<'_>),
    ) -> Result<(), SmoothError> {
        if std::mem::take(&mut self.failed_step) {
            self.stretch.clear();
            forward.again(ekf, self)?;
        }
        while !self.first.is_empty() {
            self.give(&mut each)?;
        }
        if self.after.is_some() {
            self.move_boundary(forward, ekf)?;
        }
        while !self.first.is_empty() {
            self.give(&mut each)?;
        }
        Ok(())
    }

    /// Moves the boundary to the present of the filter, and fills the stack.
    fn move_boundary(
        &mut self,
        forward: &mut Forward,
        ekf: &mut dyn Linearised,
    ) -> Result<(), SmoothError> {
        let present = ekf.snapshot();
        let mut adjoint = Adjoint::at_boundary(&self.layout, ekf.considered());
        self.stack.clear()?;
        let (stack, numbers) = (&mut self.stack, &mut self.first);
        forward.backward(ekf, &mut adjoint, false, |adjoint, visit| {
            if let Visit::Epoch(values) = visit {
                numbers.clear();
                numbers.extend_from_slice(values);
                adjoint.write(numbers);
                stack.push(numbers)?;
            }
            Ok(())
        })?;
        ekf.restore(&present);
        forward.restart(ekf)?;
        self.stretch.clear();
        self.after = None;
        self.stack.pop(&mut self.first)?;
        Ok(())
    }

    /// Passes the earliest estimate to `each`, as the samples until now determine it.
    fn give(&mut self, each: &mut impl FnMut(&Epoch<'_>)) -> Result<(), SmoothError> {
        let Self { layout, row, estimate, adjoint, delta, first, .. } = self;
        let (values, sums) = first.split_at(row.width());
        estimate.read(row, values);
        adjoint.join(sums, &self.stretch);
        adjoint.smooth(&mut estimate.covariance, delta);
        layout.inject(&mut estimate.state, delta, &mut estimate.covariance);
        each(&estimate.epoch(layout));
        self.stack.pop(first)?;
        Ok(())
    }
}

impl Observer for Lagged {
    fn epoch(&mut self, _: &Epoch<'_>) {}
    fn transition(&mut self, transition: &Transition) {
        self.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.correction(update);
    }
}
