//! Correction of driving samples by input models, and the effect of their states on `Phi`.

use super::held::Held;
use crate::compose::Composition;
use crate::model::process::Input;
use crate::model::process::input::Correction;
use crate::state::covariance::Transition;
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::sync::Arc;

/// The input models of one driving sensor, with their work space.
pub(super) struct Corrected {
    sensor: usize,
    correction: Arc<Correction>,
    /// The corrected sample.
    sample: Sample,
    /// Derivative of the corrected channels with respect to the states of the models.
    derivative: Vec<f64>,
    /// Set if the current step has a sample of the sensor.
    used: bool,
}

impl Corrected {
    /// The sensors of a composition that have input models.
    pub(super) fn of(composition: &Composition) -> Vec<Self> {
        let sensors = composition.sensors.iter().enumerate();
        sensors
            .filter_map(|(sensor, s)| {
                let correction = s.correction.clone()?;
                let sample = Sample::empty(Time::MIN, SensorId(sensor));
                Some(Self { sensor, correction, sample, derivative: Vec::new(), used: false })
            })
            .collect()
    }
}

/// Corrects the samples that drive a step with the state at its beginning, and differentiates the
/// correction.
pub(super) fn correct(
    corrected: &mut [Corrected],
    layout: &Layout,
    state: &State,
    input: Option<&Input<'_>>,
    held: &[Held],
) {
    for own in corrected {
        let first = input.map(|input| input.sample).filter(|s| s.sensor.0 == own.sensor);
        let other = || held.iter().find_map(|h| h.sample_of(own.sensor));
        own.used = false;
        if let Some(sample) = first.or_else(other) {
            own.sample = own.correction.correct(layout, state, sample);
            own.correction.differentiate(layout, state, sample, &mut own.derivative);
            own.used = true;
        }
    }
}

/// The input with its corrected sample.
pub(super) fn replace<'a>(corrected: &'a [Corrected], input: Input<'a>) -> Input<'a> {
    match corrected.iter().find(|own| own.used && own.sensor == input.sample.sensor.0) {
        Some(own) => Input { sample: &own.sample, ..input },
        None => input,
    }
}

/// Adds the effect of the models' states to `Phi`, after the processes have filled it. Without a
/// sample, no state of a model has an effect.
pub(super) fn couple(corrected: &[Corrected], transition: &mut Transition) {
    for own in corrected {
        let link = own.correction.link();
        if own.used {
            transition.add_inputs(link, &own.derivative);
        } else {
            transition.clear_inputs(link);
        }
    }
}
