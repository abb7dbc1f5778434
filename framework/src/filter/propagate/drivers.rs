//! Several driving sensors, and gaps of the first one.
//!
//! The first driven process of a scenario sets the pace: its sample covers the interval that ends
//! at the sample's time, and measurements wait for it. The samples of every other driving sensor
//! split the interval at their own time, and hold from there to the next one, as a command does.
//!
//! In a gap of the first sensor, a process that coasts moves without a sample: the measurements
//! advance the time.

use crate::filter::ekf::Ekf;
use crate::filter::parts::Parts;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::Input;
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};

impl Ekf {
    /// Uses a measurement at its own time: now, or once the driving sensor has reached it. If no
    /// sensor drives, time advances to the measurement.
    pub(in crate::filter) fn use_at_its_time(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        if self.driver.is_none() {
            if self.parts.start.is_due(sample.time) {
                self.initialise(sample.time, false, observer);
            }
            self.advance(sample.time, None, observer)?;
            return self.use_sample(sample, observer);
        }
        if self.parts.pace.input().is_some_and(|input| sample.time <= input) {
            return self.use_sample(sample, observer);
        }
        self.wait(sample, observer);
        self.coast_on(sample.time, observer)
    }

    /// Queues a measurement until the driving sensor reaches its time. Samples of different sensors
    /// may arrive in any order.
    fn wait(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        // a running filter is compared with a reference after all other samples of the same time
        let (sensors, running) = (&self.composition.sensors, self.running());
        let last = |s: &Sample| running && matches!(sensors[s.sensor.0].role, Role::Reference(_));
        if let Some(oldest) = self.parts.pace.wait(sample, last) {
            self.reject(&oldest, Rejection::NoInput, observer);
        }
    }

    /// Shows a driving sample to the processes before the start, and starts where it is due.
    pub(in crate::filter) fn prepare(
        &mut self,
        input: Input<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Self { layout, stepper, parts, .. } = self;
        let Parts { propagation, estimate, pace, start, .. } = parts;
        propagation.prepare(stepper, layout, &mut estimate.state, input);
        let (time, first) = (input.sample.time, pace.input().is_none());
        if start.is_due(time) {
            pace.forget_before(time); // samples before the start are unused
            self.initialise(time, false, observer);
        } else if first && self.coasts_after().is_some() {
            // a process that coasts comes from a reference to its first driving sample
            self.use_waiting(..time, None, observer)?;
            self.advance(time, None, observer)?;
        } else if first {
            self.parts.pace.forget_before(time); // the motion before the first driving sample is unknown
        }
        Ok(())
    }

    /// Brings the filter to the beginning of a driving sample: the process coasts over a gap that
    /// is too long to bridge. Returns `None` for a late sample, whose time the filter has passed.
    pub(in crate::filter) fn reach_begin<'a>(
        &mut self,
        input: Input<'a>,
        observer: &mut dyn Observer,
    ) -> Result<Option<Input<'a>>, EstimatorError> {
        let Input { sample, duration, usual, .. } = input;
        if self.running() && sample.time <= self.state().time && duration > usual {
            self.reject(sample, Rejection::Late, observer);
            return Ok(None);
        }
        if self.running() && self.coasts_after().is_some_and(|gap| duration > gap) {
            self.coast_to(&input, observer)?;
            return Ok(Some(Input { duration: usual, ..input }));
        }
        if usual < duration {
            self.report_missing(&input, observer);
        }
        Ok(Some(input))
    }

    /// Warns once that samples of the driving sensor are missing; [`Self::finish`] gives their
    /// number.
    fn report_missing(&self, input: &Input<'_>, observer: &mut dyn Observer) {
        let Input { sample, duration, usual, .. } = *input;
        if self.parts.pace.missing().0 == 1 {
            let about = self.composition.sensors[sample.sensor.0].info.name.clone();
            let text = format!(
                "{duration:.3} s without a sample, {usual:.3} s is usual: bridged at the mean rate"
            );
            observer.event(Event { time: sample.time, level: Level::Warning, about, text });
        }
    }

    /// Takes a sample of a driving sensor beside the first, which holds from its time on.
    pub(in crate::filter) fn hold(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        let running = self.running();
        if running && sample.time < self.state().time {
            self.reject(sample, Rejection::Late, observer);
            return;
        }
        let Self { layout, stepper, parts, .. } = self;
        let Parts { propagation, estimate, .. } = parts;
        if propagation.hold(stepper, layout, &mut estimate.state, running, sample) {
            observer.input(sample, None);
        }
    }

    /// Longest gap of the first driving sensor that its process bridges, s, if the process coasts
    /// on longer ones.
    fn coasts_after(&self) -> Option<f64> {
        let first = self.composition.processes.iter().find(|p| p.input.is_some())?;
        first.coasts_after
    }

    /// Advances the time with the measurements while the first driving sensor is silent. `now` is
    /// the time of the latest measurement: an earlier sample of the driving sensor would have
    /// arrived.
    fn coast_on(&mut self, now: Time, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        match self.coasts_after().zip(self.parts.pace.input()) {
            Some((gap, input)) if self.running() && now.since(input) > gap => {
                self.use_waiting(..now, None, observer)
            }
            _ => Ok(()),
        }
    }

    /// Coasts over the gap before a driving sample, to the time at which the sample begins.
    fn coast_to(
        &mut self,
        input: &Input<'_>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Input { sample, duration, usual, .. } = *input;
        let begin = sample.time - Span::from_seconds(usual).unwrap_or_default();
        self.use_waiting(..=begin, None, observer)?;
        self.advance(begin, None, observer)?;
        let about = self.composition.sensors[sample.sensor.0].info.name.clone();
        let text = format!("{duration:.3} s without a sample: the process coasted");
        observer.event(Event { time: sample.time, level: Level::Warning, about, text });
        Ok(())
    }
}
