//! Fixed-interval smoothing: every estimate from all samples of the run.

use super::adjoint::Adjoint;
use super::change::Change;
use super::course::{Trajectory, Writer};
use super::error::SmoothError;
use super::estimate::{self, Estimate, Row};
use super::forward::{Forward, Visit};
use super::quality::{Quality, QualityReport};
use super::tape::Rows;
use crate::compose::estimator::Linearised;
use crate::model::record::Epoch;
use crate::state::Layout;
use std::sync::Arc;

/// Share of a variance that later samples take away below which they change nothing.
const UNCHANGED: f64 = 1e-6;

/// Smoothed estimates of a run.
pub(super) struct Smoothed {
    rows: Rows,
    layout: Arc<Layout>,
    pub(super) quality: QualityReport,
    /// Smoothed trajectory for a further pass, and the change by this one.
    pub(super) course: Option<Trajectory>,
    pub(super) change: Change,
}

impl Smoothed {
    /// Passes backward over the run with its filter, which is left in any state. The smoothed
    /// trajectory is there for a `further` pass.
    pub(super) fn of(
        forward: &mut Forward,
        ekf: &mut dyn Linearised,
        further: bool,
    ) -> Result<Self, SmoothError> {
        let composition = ekf.composition();
        let layout = Arc::clone(&composition.layout);
        let (start, end) = (forward.start.unwrap_or_default(), ekf.state().time);
        let mut quality = Quality::new(composition, start, end);
        let mut adjoint = Adjoint::new(&layout, ekf.considered());
        let row = Row::new(&layout);
        let mut rows = Rows::new(row.width())?;
        let mut smoother = Smoother {
            row,
            estimate: Estimate::new(&layout),
            delta: vec![0.0; row.n],
            differences: vec![0.0; row.n],
            sigmas: vec![0.0; row.n],
        };
        let mut course = if further { Some(Writer::new(&layout)?) } else { None };
        let mut written = Vec::with_capacity(row.width());
        forward.backward(ekf, &mut adjoint, further, |adjoint, visit| {
            match visit {
                Visit::Sample { sensor, time, m, square } => {
                    quality.sample(sensor.0, time, m, square);
                }
                Visit::Gated { sensor, time, square, threshold } => {
                    quality.gated(sensor.0, time, square.map(|square| square <= threshold));
                }
                Visit::Epoch(values) => {
                    smoother.smooth(&layout, adjoint, values);
                    let epoch = smoother.estimate.epoch(&layout);
                    quality.epoch(&epoch, &smoother.differences);
                    written.clear();
                    estimate::write(&epoch, &mut written);
                    rows.push(&written)?;
                }
                Visit::Course(values) => {
                    if let Some(course) = &mut course {
                        course.push(adjoint, values, &smoother.sigmas)?;
                    }
                }
            }
            Ok(())
        })?;
        // the first estimate of the run is the last one that the backward pass has met
        quality.begin(&layout, &smoother.estimate.state, adjoint.filtered());
        let quality = quality.report(ekf.composition());
        let change = course.as_ref().map(|course| course.change).unwrap_or_default();
        let course = course.map(Writer::finish).transpose()?;
        Ok(Self { rows, layout, quality, course, change })
    }

    /// Passes the estimates to `each` in order of time.
    pub(super) fn each(mut self, mut each: impl FnMut(&Epoch<'_>)) -> Result<(), SmoothError> {
        let row = Row::new(&self.layout);
        let mut estimate = Estimate::new(&self.layout);
        let mut numbers = Vec::with_capacity(row.width());
        while self.rows.pop(&mut numbers)? {
            estimate.read(&row, &numbers);
            each(&estimate.epoch(&self.layout));
        }
        Ok(())
    }
}

/// The smoothed estimate of one time.
struct Smoother {
    row: Row,
    estimate: Estimate,
    delta: Vec<f64>,
    /// Difference of each error state from the filter, in its sigma.
    differences: Vec<f64>,
    /// Smoothed sigmas.
    sigmas: Vec<f64>,
}

impl Smoother {
    fn smooth(&mut self, layout: &Layout, adjoint: &mut Adjoint, values: &[f64]) {
        let Self { row, estimate, delta, differences, sigmas } = self;
        let (values, offset) = values.split_at(row.width());
        estimate.read(row, values);
        for (i, variance) in differences.iter_mut().enumerate() {
            *variance = estimate.covariance.get(i, i);
        }
        adjoint.smooth(&mut estimate.covariance, delta);
        for (i, (value, delta)) in differences.iter_mut().zip(&*delta).enumerate() {
            let known = *value - estimate.covariance.get(i, i);
            // later samples that change nothing leave rounding alone
            *value = if known > UNCHANGED * *value { delta / known.sqrt() } else { 0.0 };
        }
        // a further pass has linearised at the state, and the estimate is the state and its offset
        delta.iter_mut().zip(offset).for_each(|(delta, d)| *delta += d);
        for (i, sigma) in sigmas.iter_mut().enumerate() {
            *sigma = estimate.covariance.get(i, i).sqrt();
        }
        layout.inject(&mut estimate.state, delta, &mut estimate.covariance);
    }
}
