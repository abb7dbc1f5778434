//! Propagation: samples wait for the driving sensor, and the filter splits its interval at their
//! times.

use crate::filter::ekf::{Ekf, MAX_PENDING, Memory, rejected};
use crate::filter::judge::noise_level::NoiseLevel;
use crate::filter::propagate::cadence::Cadence;
use crate::filter::propagate::inputs::{correct, replace};
use crate::filter::propagate::linear::propagate;
use crate::filter::start::stage::Stage;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::monitor::Monitor;
use crate::model::process::screening::Spread;
use crate::model::process::start::FilterView;
use crate::model::process::{Input, Interval};
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use crate::units::time::Time;
use std::sync::Arc;

impl Ekf {
    /// Takes a sample: propagates to its time and uses it.
    ///
    /// # Errors
    /// When the filter cannot continue. The estimate before the sample stays.
    pub fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        self.take(sample, observer)?;
        match self.take_found() {
            Some(samples) => self.catch_up(&samples, observer),
            None => Ok(()),
        }
    }

    /// Takes a sample as [`Self::process`] does, except that the samples of a search that ends are
    /// left to the caller: see [`Self::take_found`].
    pub(crate) fn take(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        match self.memory.stage {
            Stage::Searching(_) => return self.search(sample),
            Stage::Found(_) => self.begin_found(observer),
            _ => {}
        }
        let index = sample.sensor.0;
        let is_input = matches!(self.composition.sensors[index].role, Role::Input(_));
        if let Some(rejection) = self.refuse(sample, is_input) {
            self.reject(sample, rejection, observer);
            self.lose_past(sample);
            return Ok(());
        }
        self.memory.sensors[index].take(sample);
        if self.driver == Some(index) {
            self.memory.sensors[index].refused = None;
            return self.screen(sample, observer);
        }
        if self.driver.is_none() {
            if self.memory.stage.is_due(sample.time) {
                self.initialise(sample.time, false, observer);
            }
            self.advance(sample.time, None, observer)?;
            return self.use_sample(sample, observer);
        }
        if self.memory.input.is_some_and(|input| sample.time <= input) {
            return self.use_sample(sample, observer);
        }
        self.wait(sample, observer);
        self.coast_on(sample.time, observer)
    }

    /// Warns once that samples of the driving sensor are missing; [`Self::finish`] gives their
    /// number.
    fn tell_of_missing(
        &mut self,
        sample: &Sample,
        duration: f64,
        usual: f64,
        observer: &mut dyn Observer,
    ) {
        if self.memory.cadence.missing == 1 {
            let about = self.composition.sensors[sample.sensor.0].info.name.clone();
            let text = format!(
                "{duration:.3} s without a sample, {usual:.3} s is usual: bridged at the mean rate"
            );
            observer.event(Event { time: sample.time, level: Level::Warning, about, text });
        }
    }

    /// Reports unused samples and sensors that are still gated after the last sample.
    pub fn finish(&mut self, observer: &mut dyn Observer) {
        self.finish_screening(observer);
        let Cadence { missing, longest, .. } = self.memory.cadence;
        if let Some(driver) = self.driver
            && missing > 1
        {
            let about = self.composition.sensors[driver].info.name.clone();
            let text =
                format!("samples were missing {missing} times, for {longest:.3} s at the longest");
            observer.event(Event {
                time: self.memory.state.time,
                level: Level::Warning,
                about,
                text,
            });
        }
        while let Some(sample) = self.memory.pending.pop_front() {
            observer.update(&rejected(&sample, Rejection::NoInput));
        }
        for (slot, sensor) in self.memory.sensors.iter().zip(&self.composition.sensors) {
            if let Some((text, limit)) = slot.noise.as_ref().map(NoiseLevel::words) {
                let level = if limit { Level::Warning } else { Level::Info };
                let (time, about) = (self.memory.state.time, slot.name.clone());
                observer.event(Event { time, level, about, text });
            }
            // the alignment has already reported the samples of its own constraint
            if !sensor.constraint || sensor.detector.is_some() {
                slot.lockout.finish(&slot.name, slot.last, observer);
            }
        }
    }

    /// Queues a measurement until the driving sensor reaches its time. Samples of different sensors
    /// may arrive in any order.
    fn wait(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        if self.memory.pending.len() == MAX_PENDING
            && let Some(oldest) = self.memory.pending.pop_front()
        {
            self.reject(&oldest, Rejection::NoInput, observer);
        }
        // a running filter is compared with a reference after all other samples of the same time
        let (sensors, running) = (&self.composition.sensors, self.running());
        let place = |s: &Sample| {
            (s.time, running && matches!(sensors[s.sensor.0].role, Role::Reference(_)))
        };
        let pending = &mut self.memory.pending;
        let at =
            pending.iter().rposition(|p| place(p) <= place(sample)).map_or(0, |before| before + 1);
        pending.insert(at, *sample);
    }

    /// Takes a driving sample, and uses the queued samples within its interval on the way.
    pub(super) fn drive(
        &mut self,
        sample: &Sample,
        spread: Option<&Spread>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let duration = self.memory.input.map_or(0.0, |before| sample.time.since(before));
        let usual = self.memory.cadence.usual(duration);
        if self.running() && sample.time <= self.memory.state.time && duration > usual {
            self.reject(sample, Rejection::Late, observer); // time went on without it
            return Ok(());
        }
        let begin = self.coast_to(sample, duration, usual, observer)?;
        let duration = if begin.is_some() { usual } else { duration };
        if usual < duration {
            self.tell_of_missing(sample, duration, usual, observer);
        }
        let input = Input { sample, duration, usual, spread };
        if !self.running() {
            let Memory { processes, state, held, .. } = &mut self.memory;
            let others = |process: usize| held.iter().any(|held| held.drives(process));
            correct(&mut self.corrected, (&self.layout, state), Some(&input), held);
            let input = replace(&self.corrected, input);
            for (_, process) in processes.iter_mut().enumerate().filter(|(k, _)| !others(*k)) {
                process.prepare(&self.layout, state, &input);
            }
            let due = self.memory.stage.is_due(sample.time);
            // the motion before the first driving sample is unknown, and samples before the start
            // are unused
            if due || self.memory.input.is_none() {
                self.memory.pending.retain(|waiting| waiting.time >= sample.time);
            }
            if due {
                self.initialise(sample.time, false, observer);
            }
        }
        while !self.searching()
            && self.memory.pending.front().is_some_and(|waiting| waiting.time <= sample.time)
        {
            let Some(waiting) = self.memory.pending.pop_front() else { break };
            self.advance(waiting.time, Some(input), observer)?;
            self.use_sample(&waiting, observer)?;
        }
        if self.searching() && self.memory.state.time < sample.time {
            // the search began within the interval of this sample, which is the first one that it
            // sees
            self.memory.sensors[sample.sensor.0].last = self.memory.input.unwrap_or(Time::MIN);
            return self.search(sample);
        }
        self.memory.input = Some(sample.time);
        self.advance(sample.time, Some(input), observer)?;
        observer.input(sample, None);
        if self.running()
            && let Some(finding) = self.watch_input(&input)
        {
            // what such samples do to the state is none of the errors that the tests look for
            if (finding.basis, finding.severity) == (Basis::Samples, Severity::DoNotUse) {
                self.memory.signatures = None;
            }
            observer.finding(finding);
        }
        if self.running() {
            self.supervise(observer)?;
            self.detect(sample, observer)?;
        }
        Ok(())
    }

    /// Shows a sample to the detectors, and applies the pseudo-measurements that hold at the
    /// state's time: `0 = h(x) + v`.
    fn detect(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        for k in 0..self.memory.detectors.len() {
            let (index, detector) = &mut self.memory.detectors[k];
            let (index, holds) = (*index, detector.detects(sample));
            let sensor = &self.composition.sensors[index];
            let slot = &mut self.memory.sensors[index];
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

    /// Lets the monitor of the driven process see a driving sample, corrected with the estimate.
    fn watch_input(&mut self, input: &Input<'_>) -> Option<Finding> {
        let Memory { monitor, state, covariance, held, .. } = &mut self.memory;
        correct(&mut self.corrected, (&self.layout, state), Some(input), held);
        let input = replace(&self.corrected, *input);
        let filter = FilterView { layout: &self.layout, state, covariance, gated: None };
        monitor.as_mut()?.input(&filter, &input)
    }

    /// Lets the monitor of the driven process see the estimate.
    pub(super) fn watch<T>(
        &mut self,
        look: impl FnOnce(&mut dyn Monitor, &FilterView<'_>) -> Option<T>,
    ) -> Option<T> {
        let Memory { monitor, state, covariance, .. } = &mut self.memory;
        let filter = FilterView { layout: &self.layout, state, covariance, gated: None };
        look(monitor.as_mut()?.as_mut(), &filter)
    }

    /// Propagates state and covariance to a later time.
    pub(super) fn advance(
        &mut self,
        to: Time,
        input: Option<Input<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let running = self.running();
        let from = self.memory.state.time;
        if to <= from || !running {
            return Ok(());
        }
        let interval = Interval { from, to, input };
        if self.passage.is_some() {
            self.pass(&interval)?;
        } else {
            let Memory { processes, dynamics, held, state, transition, .. } = &mut self.memory;
            let parts = (&mut processes[..], dynamics);
            let corrected = &mut self.corrected;
            propagate(&self.composition, corrected, parts, held, state, &interval, transition)?;
        }
        let Memory { state, pool, transition, .. } = &mut self.memory;
        state.time = to;
        if pool.as_mut().is_none_or(|pool| pool.add(transition, from, to)) {
            self.propagate_covariance(observer);
        }
        Ok(())
    }

    /// Propagates the covariance over the last step, or over all steps that the pool holds.
    pub(super) fn propagate_covariance(&mut self, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        let transition = match &mut m.pool {
            None => &mut m.transition,
            Some(pool) => {
                pool.since = None;
                &mut pool.whole
            }
        };
        // the unscented filter has propagated the covariance with its points
        if self.passage.is_none() {
            transition.propagate(&mut m.covariance);
        }
        observer.transition(transition);
        if let Some((guide, offset)) = self.guide.as_mut().zip(m.offset.as_mut()) {
            guide.propagate(&self.layout, &mut m.state, offset, transition);
        }
        observer.moved(&m.state, &m.covariance, m.offset.as_ref().map_or(&[], |o| &o.d));
        for slot in m.sensors.iter_mut().filter(|slot| !slot.reach.is_empty()) {
            transition.carry_reach(&mut slot.reach);
        }
        if let Some(signatures) = &mut m.signatures {
            signatures.moved(m.state.time);
        }
        if let Some(history) = &mut m.history {
            history.moved(&m.state, transition);
        }
    }

    /// Propagates the covariance to the state's time.
    pub(crate) fn settle(&mut self, observer: &mut dyn Observer) {
        if self.memory.pool.as_ref().is_some_and(|pool| pool.since.is_some()) {
            self.propagate_covariance(observer);
        }
    }

    /// Uses a measurement or reference at the state's time, or rejects it.
    pub(super) fn use_sample(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let role = &self.composition.sensors[sample.sensor.0].role;
        if !matches!(role, Role::Input(_)) {
            self.settle(observer);
        }
        match &self.composition.sensors[sample.sensor.0].role {
            Role::Input(_) => {
                self.hold(sample, observer);
                Ok(())
            }
            Role::Reference(reference) => {
                let reference = Arc::clone(reference);
                self.follow(sample, reference.as_ref(), observer);
                Ok(())
            }
            Role::Measurement(_) if !self.running() => Ok(()),
            Role::Measurement(_) if sample.time < self.memory.state.time => {
                self.reject(sample, Rejection::Late, observer);
                self.lose_past(sample);
                Ok(())
            }
            Role::Measurement(model) => {
                let (model, mut completed) = (Arc::clone(model), *sample);
                model.complete(&mut completed);
                if self.has_past(sample.sensor.0) {
                    match self.admit(&completed, model.as_ref(), observer) {
                        Some(slot) => self.place(slot, &completed, model.as_ref(), observer),
                        None => self.correct(&completed, model.as_ref(), observer)?,
                    }
                }
                if model.keyframe(&completed) {
                    self.take_past(sample.sensor.0, observer);
                }
                self.detect(sample, observer)
            }
        }
    }
}
