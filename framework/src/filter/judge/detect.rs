//! What looks at the samples beside the filter: the monitor of the driving sensor, and the detectors of
//! pseudo-measurements.

use crate::filter::ekf::Ekf;
use crate::filter::parts::Parts;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::Input;
use crate::model::record::finding::{Basis, Severity};
use crate::model::record::{Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use std::sync::Arc;

impl Ekf {
    /// Shows a driving sample, corrected with the estimate, to the monitor of the driven process.
    pub(in crate::filter) fn watch_input(&mut self, input: Input<'_>, observer: &mut dyn Observer) {
        let Self { stepper, layout, parts, .. } = self;
        let Parts { estimate, propagation, watch, signatures, .. } = parts;
        let input = propagation.corrected(stepper, (layout, &estimate.state), input);
        let Some(finding) = watch.input(layout, estimate, &input) else { return };
        // what such samples do to the state is none of the errors that the tests look for
        if (finding.basis, finding.severity) == (Basis::Samples, Severity::DoNotUse) {
            *signatures = None;
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
            let (index, holds) = self.parts.watch.detect(k, sample);
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
