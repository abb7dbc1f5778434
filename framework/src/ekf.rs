//! The error-state extended Kalman filter.
//!
//! It owns injection, reset, gating and the covariance; models never touch them. Measurements wait until the driving
//! sensor's samples reach their time, then its interval is split there, so that every update happens at its own time.

mod cadence;
mod correct;
pub(crate) mod delay;
mod start;

use crate::compose::{Composition, Role};
use crate::covariance::{Covariance, Transition, Update};
use crate::draw::{Draw, TrueState};
use crate::dynamics::BlockDynamics;
use crate::process::{Input, Interval, ProcessError, ProcessModel};
use crate::record::{Epoch, Event, Level, Observer, Outcome, Rejection, Truth, UpdateRecord};
use crate::sample::{MAX_CHANNELS, Sample};
use crate::simulate::Random;
use crate::state::{Layout, Mode, State};
use crate::time::Time;
use cadence::Cadence;
use correct::SensorSlot;
use delay::History;
use start::Start;
use std::collections::VecDeque;
use std::sync::Arc;

/// The most measurements that wait for the driving sensor.
const MAX_PENDING: usize = 1024;

/// Why the filter cannot go on.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum EstimatorError {
    /// A process model failed.
    #[error("at {time}: {process}: {error}")]
    Process {
        /// When.
        time: Time,
        /// Which.
        process: String,
        /// Why.
        error: ProcessError,
    },
    /// The covariance is no longer one.
    #[error(
        "at {time}: the variance of {block} is not positive: its prior sigma and the noise of the sensors that see it \
         differ by too many orders of magnitude, or a model gives a wrong Jacobian"
    )]
    Covariance {
        /// When.
        time: Time,
        /// The block whose variance is wrong.
        block: String,
    },
}

/// The filter: feed it samples in order of time.
pub struct Ekf {
    composition: Composition,
    layout: Arc<Layout>,
    /// The sensor that drives a process model, if any does.
    driver: Option<usize>,
    considered: Vec<bool>,
    update: Update,
    memory: Memory,
}

/// All that changes while the filter runs: a clone is a snapshot.
#[derive(Clone)]
struct Memory {
    start: Start,
    draws: Option<Random>,
    state: State,
    covariance: Covariance,
    transition: Transition,
    dynamics: BlockDynamics,
    processes: Vec<Box<dyn ProcessModel>>,
    sensors: Vec<SensorSlot>,
    /// Where the state was, if some sensor tells of that.
    history: Option<History>,
    /// The time of the last driving sample.
    input: Option<Time>,
    cadence: Cadence,
    /// Measurements ahead of the driving sensor, in order of time.
    pending: VecDeque<Sample>,
    /// What is true beside the motion.
    constants: TrueState,
    truth: State,
    known: Vec<bool>,
}

impl Clone for Box<dyn ProcessModel> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}

/// A whole filter at one time, to go back to.
#[derive(Clone)]
pub struct Snapshot(Memory);

impl Ekf {
    /// A filter for the composition, which waits for its start.
    pub fn new(composition: Composition) -> Self {
        let layout = Arc::clone(&composition.layout);
        let n = layout.tangent;
        let mut considered = vec![false; n];
        for block in layout.blocks.iter().filter(|b| b.spec.mode == Mode::Consider) {
            considered[block.tangent_range()].fill(true);
        }
        let start = composition.start();
        let from_reference = composition.estimator.from_reference();
        let constants = TrueState::new(&layout, composition.seed, start);
        let mut transition = composition.transition.clone();
        let dynamics = BlockDynamics::new(&layout, &mut transition);
        Self {
            driver: composition.processes.iter().find_map(|p| p.input),
            considered,
            update: Update::with_capacity(n, MAX_CHANNELS),
            memory: Memory {
                start: if from_reference { Start::FromReference(start) } else { Start::At(start) },
                draws: (composition.estimator.draw != Draw::Nothing).then(|| Random::new(composition.seed, "initial")),
                state: layout.initial_state(),
                covariance: Covariance::zero(n),
                history: History::new(&composition),
                transition,
                dynamics,
                processes: composition.processes.iter().map(|p| p.model.boxed_clone()).collect(),
                sensors: composition.sensors.iter().map(|s| SensorSlot::new(s, n)).collect(),
                input: None,
                cadence: Cadence::default(),
                pending: VecDeque::with_capacity(MAX_PENDING),
                truth: constants.state.clone(),
                known: constants.known.clone(),
                constants,
            },
            layout,
            composition,
        }
    }

    /// The estimate.
    pub fn state(&self) -> &State {
        &self.memory.state
    }

    /// Its covariance.
    pub fn covariance(&self) -> &Covariance {
        &self.memory.covariance
    }

    /// The layout of both.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// What it was composed from.
    pub fn composition(&self) -> &Composition {
        &self.composition
    }

    /// Whether it has started.
    pub fn running(&self) -> bool {
        matches!(self.memory.start, Start::Running)
    }

    fn searching(&self) -> bool {
        matches!(self.memory.start, Start::Searching(_))
    }

    fn has_reference(&self) -> bool {
        self.composition.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)))
    }

    /// The whole filter as it is now.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot(self.memory.clone())
    }

    /// Goes back to a snapshot of a filter of the same composition.
    pub fn restore(&mut self, snapshot: &Snapshot) {
        self.memory.clone_from(&snapshot.0);
    }

    /// The last truth that a reference gave, or that the scenario states.
    pub fn truth(&self) -> Truth<'_> {
        Truth { state: &self.memory.truth, known: &self.memory.known }
    }

    /// The estimate now; with the truth where there is no reference to tell it but the scenario does.
    pub(crate) fn epoch(&mut self) -> Epoch<'_> {
        let told = self.has_reference();
        let m = &mut self.memory;
        let stated = !told && m.constants.known.contains(&true);
        if stated {
            m.constants.advance(&self.layout, m.state.time);
            m.truth.values.copy_from_slice(&m.constants.state.values);
            m.truth.time = m.state.time;
        }
        let truth = stated.then_some(Truth { state: &m.truth, known: &m.known });
        Epoch { layout: &self.layout, state: &m.state, covariance: &m.covariance, truth }
    }

    /// Takes a sample: propagates to its time and uses it.
    ///
    /// # Errors
    /// When the filter cannot go on; what it was until then stays.
    pub fn process(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        if self.searching() {
            return self.search(sample, observer);
        }
        let index = sample.sensor.0;
        let is_input = matches!(self.composition.sensors[index].role, Role::Input(_));
        if is_input && self.driver != Some(index) {
            return Ok(()); // it drives nothing: a second IMU
        }
        if let Some(rejection) = self.refuse(sample, is_input) {
            self.reject(sample, rejection, observer);
            return Ok(());
        }
        self.memory.sensors[index].last = sample.time;
        if is_input {
            self.memory.sensors[index].refused = None;
            return self.drive(sample, observer);
        }
        if self.driver.is_none() {
            if self.memory.start.is_due(sample.time) {
                self.initialise(sample.time, false, observer);
            }
            self.advance(sample.time, None, observer)?;
            return self.use_sample(sample, observer);
        }
        if self.memory.input.is_some_and(|input| sample.time <= input) {
            return self.use_sample(sample, observer);
        }
        self.wait(sample, observer);
        Ok(())
    }

    /// Says once that samples of the driving sensor are missing; how many, when there are no more.
    fn tell_of_missing(&mut self, sample: &Sample, duration: f64, usual: f64, observer: &mut dyn Observer) {
        if self.memory.cadence.missing == 1 {
            let about = self.composition.sensors[sample.sensor.0].info.name.clone();
            let text = format!("{duration:.3} s without a sample, {usual:.3} s is usual: bridged at the mean rate");
            observer.event(Event { time: sample.time, level: Level::Warning, about, text });
        }
    }

    /// Says what is left unused when there are no more samples.
    pub fn finish(&mut self, observer: &mut dyn Observer) {
        let Cadence { missing, longest, .. } = self.memory.cadence;
        if let Some(driver) = self.driver
            && missing > 1
        {
            let about = self.composition.sensors[driver].info.name.clone();
            let text = format!("samples were missing {missing} times, for {longest:.3} s at the longest");
            observer.event(Event { time: self.memory.state.time, level: Level::Warning, about, text });
        }
        while let Some(sample) = self.memory.pending.pop_front() {
            observer.update(&rejected(&sample, Rejection::NoInput));
        }
        for (slot, sensor) in self.memory.sensors.iter().zip(&self.composition.sensors) {
            // a process that knows something until then has told of it
            if let Some(streak) = slot.gated.filter(|_| !sensor.constraint) {
                let text = format!("the last {} samples were gated, since {}", streak.count, streak.since);
                observer.event(Event { time: slot.last, level: Level::Warning, about: slot.name.clone(), text });
            }
        }
    }

    fn refuse(&self, sample: &Sample, is_input: bool) -> Option<Rejection> {
        let slot = &self.memory.sensors[sample.sensor.0];
        if let Some(channel) = sample.not_finite() {
            return Some(Rejection::NotFinite(channel));
        }
        if sample.time <= slot.last {
            return Some(Rejection::OutOfOrder);
        }
        let present = sample.present() & slot.channels;
        let missing = if is_input { present != slot.channels } else { present == 0 };
        missing.then_some(Rejection::Missing)
    }

    /// Keeps a measurement until the driving sensor reaches its time. Sensors may come in any order among themselves.
    fn wait(&mut self, sample: &Sample, observer: &mut dyn Observer) {
        if self.memory.pending.len() == MAX_PENDING
            && let Some(oldest) = self.memory.pending.pop_front()
        {
            self.reject(&oldest, Rejection::NoInput, observer);
        }
        // a running filter is compared with a reference after what else came at its time
        let (sensors, running) = (&self.composition.sensors, self.running());
        let place = |s: &Sample| (s.time, running && matches!(sensors[s.sensor.0].role, Role::Reference(_)));
        let pending = &mut self.memory.pending;
        let at = pending.iter().rposition(|p| place(p) <= place(sample)).map_or(0, |before| before + 1);
        pending.insert(at, *sample);
    }

    /// A driving sample: what waits for its interval is used on the way.
    fn drive(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        let duration = self.memory.input.map_or(0.0, |before| sample.time.since(before));
        let usual = self.memory.cadence.usual(duration);
        if usual < duration {
            self.tell_of_missing(sample, duration, usual, observer);
        }
        let input = Input { sample, duration, usual };
        if !self.running() {
            for process in &mut self.memory.processes {
                process.prepare(&self.layout, &mut self.memory.state, &input);
            }
            let due = self.memory.start.is_due(sample.time);
            // nothing is known of the motion before the first driving sample, and nothing is used before the start
            if due || self.memory.input.is_none() {
                self.memory.pending.retain(|waiting| waiting.time >= sample.time);
            }
            if due {
                self.initialise(sample.time, false, observer);
            }
        }
        while !self.searching() && self.memory.pending.front().is_some_and(|waiting| waiting.time <= sample.time) {
            let Some(waiting) = self.memory.pending.pop_front() else { break };
            self.advance(waiting.time, Some(input), observer)?;
            self.use_sample(&waiting, observer)?;
        }
        if self.searching() && self.memory.state.time < sample.time {
            // the search began within this sample's interval: it is the first that it sees
            self.memory.sensors[sample.sensor.0].last = self.memory.input.unwrap_or(Time::MIN);
            return self.search(sample, observer);
        }
        self.memory.input = Some(sample.time);
        self.advance(sample.time, Some(input), observer)?;
        observer.input(sample, None);
        if self.running() { self.watch(observer) } else { Ok(()) }
    }

    /// Moves the state and its covariance to a time, if it is ahead.
    fn advance(
        &mut self,
        to: Time,
        input: Option<Input<'_>>,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let running = self.running();
        let m = &mut self.memory;
        let from = m.state.time;
        if to <= from || !running {
            return Ok(());
        }
        let interval = Interval { from, to, input };
        for (k, process) in m.processes.iter_mut().enumerate() {
            process.propagate(&self.layout, &mut m.state, &interval, &mut m.transition).map_err(|error| {
                EstimatorError::Process { time: to, process: self.composition.processes[k].name.clone(), error }
            })?;
        }
        m.dynamics.propagate(&self.layout, &mut m.state, interval.duration(), &mut m.transition);
        m.transition.propagate(&mut m.covariance);
        observer.transition(&m.transition);
        for slot in m.sensors.iter_mut().filter(|slot| !slot.reach.is_empty()) {
            m.transition.carry_reach(&mut slot.reach);
        }
        m.state.time = to;
        if let Some(history) = &mut m.history {
            history.moved(&m.state, &m.transition);
        }
        Ok(())
    }

    /// Uses a measurement or reference at the state's time, or turns it away.
    fn use_sample(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        match &self.composition.sensors[sample.sensor.0].role {
            Role::Input(_) => Ok(()),
            Role::Reference(reference) => {
                let reference = Arc::clone(reference);
                self.follow(sample, reference.as_ref(), observer);
                Ok(())
            }
            Role::Measurement(_) if !self.running() => Ok(()),
            Role::Measurement(_) if sample.time < self.memory.state.time => {
                self.reject(sample, Rejection::Late, observer);
                Ok(())
            }
            Role::Measurement(model) => {
                let (model, mut sample) = (Arc::clone(model), *sample);
                model.complete(&mut sample);
                self.correct(&sample, model.as_ref(), observer)
            }
        }
    }
}

fn rejected(sample: &Sample, rejection: Rejection) -> UpdateRecord<'static> {
    UpdateRecord {
        time: sample.time,
        sensor: sample.sensor,
        outcome: Outcome::Rejected(rejection),
        nis: f64::NAN,
        threshold: f64::NAN,
        present: sample.present(),
        innovation: &[],
        covariance: &[],
    }
}
