//! Several driving sensors, and gaps of the first one.
//!
//! The first driven process of a scenario gives the pace: its sample covers the interval that ends
//! at the sample's time, and measurements wait for it. The samples of every other driving sensor
//! split the interval at their own time, and hold from there to the next one, as a command does.
//!
//! On a gap of the first sensor a process that coasts moves without a sample: time goes on with
//! the measurements.

use crate::filter::ekf::Ekf;
use crate::filter::propagate::held::Held;
use crate::filter::propagate::inputs::{correct, replace};
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};

impl Ekf {
    /// Takes a sample of a driving sensor beside the first, which holds from its time on.
    pub(in crate::filter) fn hold(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        let running = self.running();
        if running && sample.time < self.memory.state.time {
            self.reject(sample, Rejection::Late, observer);
            return;
        }
        let m = &mut self.memory;
        let Some(held) = m.held.iter_mut().find(|held| held.sensor == sample.sensor.0) else {
            return;
        };
        held.interval = held.sample.map_or(0.0, |before| sample.time.since(before.time));
        held.sample = Some(*sample);
        let process = held.process;
        if !running {
            correct(&mut self.corrected, (&self.layout, &m.state), None, &m.held);
            if let Some(input) = m.held.iter().find(|h| h.drives(process)).and_then(Held::input) {
                let input = replace(&self.corrected, input);
                m.processes[process].prepare(&self.layout, &mut m.state, &input);
            }
        }
        observer.input(sample, None);
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
        let Some((gap, input)) = self.coasts_after().zip(self.memory.input) else { return Ok(()) };
        if now.since(input) <= gap {
            return Ok(());
        }
        while let Some(waiting) = self.memory.pending.front().copied()
            && waiting.time < now
        {
            self.memory.pending.pop_front();
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
        while let Some(waiting) = self.memory.pending.front().copied()
            && waiting.time <= begin
        {
            self.memory.pending.pop_front();
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
