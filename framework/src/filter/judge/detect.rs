//! What looks at the samples beside the filter: the monitor of the driving sensor, and the detectors of
//! pseudo-measurements.

use crate::filter::ekf::Ekf;
use crate::filter::judge::factor::Factor;
use crate::filter::judge::watch::Detection;
use crate::filter::parts::Parts;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::Input;
use crate::model::process::monitor::MeasuredVelocity;
use crate::model::record::finding::{Basis, Severity};
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::state::Layout;
use crate::state::covariance::Update;
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Largest ratio of the derivative by the position to the derivative by the velocity at which a
/// channel measures a velocity, 1/s.
const SLIGHT: f64 = 1e-3;
/// Least determinant of the normal equations of three directions, relative to its largest value.
const DETERMINED: f64 = 1e-3;

/// Largest share of the other axes in a derivative along north, east or down: that of a past state has
/// the turn of the Earth since then.
const OWN: f64 = 1e-6;

/// Error of the velocity that the innovation of a sample determines.
struct VelocityError {
    error: Vector3<f64>,
    /// Set if the sample has axes of its own.
    own_axes: bool,
}

/// `None` where the sample does not measure three directions of the velocity.
fn velocity_error(update: &Update, layout: &Layout) -> Option<VelocityError> {
    let vehicle = layout.vehicle();
    let place = |slot: usize| {
        let tangent = layout.blocks[slot].tangent?;
        update.columns.iter().position(|column| *column == tangent)
    };
    let velocity = place(vehicle.velocity?.slot())?;
    let position = vehicle.position.and_then(|block| place(block.slot()));
    let (mut normal, mut right, mut own) = (Matrix3::zeros(), Vector3::zeros(), false);
    for (h, y) in update.h.chunks_exact(update.columns.len()).zip(&update.innovation) {
        let of = |at: usize| Vector3::from_column_slice(&h[at..at + 3]);
        let (v, p) = (of(velocity), position.map_or_else(Vector3::zeros, of));
        if v.norm() > 0.0 && p.norm() <= SLIGHT * v.norm() {
            normal += v * v.transpose();
            right += v * *y;
            own |= v.amax() < (1.0 - OWN) * v.norm();
        }
    }
    let largest = (normal.trace() / 3.0).powi(3);
    let determined = normal.determinant() > DETERMINED * largest;
    let inverse = determined.then(|| normal.try_inverse()).flatten()?;
    Some(VelocityError { error: inverse * right, own_axes: own })
}

impl Ekf {
    /// Shows the velocity that a sample measures to the monitor. Call after [`Update::innovate`].
    pub(in crate::filter) fn watch_velocity(&mut self, index: usize) {
        let Parts { estimate, watch, sensors, .. } = &mut self.parts;
        if !watch.monitors() || self.composition.sensors[index].constraint {
            return;
        }
        let error = velocity_error(&self.work.update, &self.layout);
        let Some(VelocityError { error, own_axes }) = error else { return };
        let Some(block) = self.layout.vehicle().velocity else { return };
        let velocity: Vector3<f64> = estimate.state.get(&self.layout, block);
        let (sensor, velocity) = (sensors[index].name.as_str(), (velocity + error).into());
        let filter = estimate.view(&self.layout, None);
        watch.measured(&filter, &MeasuredVelocity { sensor, velocity, own_axes });
    }

    /// Shows a driving sample, corrected with the estimate, to the monitor of the driven process.
    pub(in crate::filter) fn watch_input(&mut self, input: Input<'_>, observer: &mut dyn Observer) {
        let Self { stepper, layout, parts, .. } = self;
        let Parts { estimate, propagation, watch, signatures, sensors, .. } = parts;
        let input = propagation.corrected(stepper, layout, &estimate.state, input);
        let Some(finding) = watch.input(layout, estimate, &input) else { return };
        // what such samples do to the state is none of the errors that the tests look for
        if (finding.basis, finding.severity) == (Basis::Samples, Severity::DoNotUse) {
            *signatures = None;
            sensors.iter_mut().filter_map(|slot| slot.factor.as_mut()).for_each(Factor::end);
        }
        observer.finding(finding);
    }

    /// Shows a sample to the detectors, and applies the pseudo-measurements that hold at the
    /// state's time: `0 = h(x) + v`.
    pub(in crate::filter) fn detect(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        for k in 0..self.parts.watch.detectors() {
            let Detection { sensor: index, holds } = self.parts.watch.detect(k, sample);
            let sensor = &self.composition.sensors[index];
            let slot = &mut self.parts.sensors[index];
            // samples of two sensors may have one time
            if holds
                && slot.last < sample.time
                && let Role::Measurement(model) = &sensor.role
            {
                slot.last = sample.time;
                let model = Arc::clone(model);
                let zeros = &[0.0; MAX_CHANNELS][..model.channels()];
                let zero = Sample::new(sample.time, SensorId(index), zeros);
                if sensor.excludes(sample.time) {
                    self.reject(&zero, Rejection::Excluded, observer);
                } else {
                    self.correct(&zero, model.as_ref(), observer)?;
                }
            }
        }
        Ok(())
    }
}
