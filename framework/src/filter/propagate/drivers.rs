//! Several driving sensors, and gaps of the first one.
//!
//! The first driven process of a scenario gives the pace: its sample covers the interval that ends
//! at the sample's time, and measurements wait for it. The samples of every other driving sensor
//! split the interval at their own time, and hold from there to the next one, as a command does.
//!
//! On a gap of the first sensor a process that coasts moves without a sample: time goes on with
//! the measurements.

use crate::filter::ekf::Ekf;
use crate::filter::parts::Parts;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::Input;
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};

impl Ekf {
    /// Queues a measurement until the driving sensor reaches its time. Samples of different sensors
    /// may arrive in any order.
    pub(in crate::filter) fn wait(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        // a running filter is compared with a reference after all other samples of the same time
        let (sensors, running) = (&self.composition.sensors, self.running());
        let last = |s: &Sample| running && matches!(sensors[s.sensor.0].role, Role::Reference(_));
        if let Some(oldest) = self.parts.pace.wait(sample, last) {
            self.reject(&oldest, Rejection::NoInput, observer);
        }
    }

    /// Shows a driving sample to the processes before the start, and starts where it is due.
    pub(in crate::filter) fn prepare(&mut self, input: Input<'_>, observer: &mut dyn Observer) {
        let Self { layout, stepper, parts, .. } = self;
        let Parts { propagation, estimate, pace, start, .. } = parts;
        propagation.prepare(stepper, (layout, &mut estimate.state), input);
        let time = input.sample.time;
        let due = start.is_due(time);
        // the motion before the first driving sample is unknown, and samples before the start are
        // unused
        if due || pace.input().is_none() {
            pace.forget_before(time);
        }
        if due {
            self.initialise(time, false, observer);
        }
    }

    /// Warns once that samples of the driving sensor are missing; [`Self::finish`] gives their
    /// number.
    pub(in crate::filter) fn report_missing(
        &self,
        sample: &Sample,
        duration: f64,
        usual: f64,
        observer: &mut dyn Observer,
    ) {
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
        let at = (&**layout, &mut parts.estimate.state, running);
        if parts.propagation.hold(stepper, at, sample) {
            observer.input(sample, None);
        }
    }

    /// Longest gap of the first driving sensor that its process bridges, s, if the process coasts
    /// on longer ones.
    fn coasts_after(&self) -> Option<f64> {
        let first = self.composition.processes.iter().find(|p| p.input.is_some())?;
        first.coasts_after.filter(|_| self.running())
    }

    /// Lets time go on with the measurements while the first driving sensor is silent. `now` is the
    /// time of the latest measurement: an earlier sample of the driving sensor would be there.
    pub(in crate::filter) fn coast_on(
        &mut self,
        now: Time,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Some((gap, input)) = self.coasts_after().zip(self.parts.pace.input()) else {
            return Ok(());
        };
        if now.since(input) <= gap {
            return Ok(());
        }
        while let Some(waiting) = self.parts.pace.next_before(now) {
            self.advance(waiting.time, None, observer)?;
            self.use_sample(&waiting, observer)?;
        }
        Ok(())
    }

    /// Coasts over the gap before a sample that covers `usual` seconds, if the gap is longer than
    /// the process bridges; returns the time at which the sample begins.
    pub(in crate::filter) fn coast_to(
        &mut self,
        sample: &Sample,
        duration: f64,
        usual: f64,
        observer: &mut dyn Observer,
    ) -> Result<Option<Time>, EstimatorError> {
        if self.coasts_after().is_none_or(|gap| duration <= gap) {
            return Ok(None);
        }
        let begin = sample.time - Span::from_seconds(usual).unwrap_or_default();
        while let Some(waiting) = self.parts.pace.next_until(begin) {
            self.advance(waiting.time, None, observer)?;
            self.use_sample(&waiting, observer)?;
        }
        self.advance(begin, None, observer)?;
        let about = self.composition.sensors[sample.sensor.0].info.name.clone();
        let text = format!("{duration:.3} s without a sample: the process coasted");
        observer.event(Event { time: sample.time, level: Level::Warning, about, text });
        Ok(Some(begin))
    }
}
