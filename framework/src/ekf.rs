//! The error-state extended Kalman filter.
//!
//! It owns injection, reset, gating and the covariance; models never touch them. Measurements wait until the driving
//! sensor's samples reach their time, then its interval is split there, so that every update happens at its own time.

use crate::compose::{Composition, Role};
use crate::covariance::{Covariance, Transition, Update};
use crate::dynamics::BlockDynamics;
use crate::gate::{Action, Recovery};
use crate::process::{Input, Interval, ProcessError, ProcessModel};
use crate::record::{Epoch, Event, Level, Observer, Outcome, Rejection, Truth, UpdateRecord};
use crate::sample::{MAX_CHANNELS, Sample};
use crate::simulate::Random;
use crate::state::{Layout, Mode, State};
use crate::time::Time;
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

/// A sensor as the filter sees it.
#[derive(Clone)]
struct SensorSlot {
    name: String,
    thresholds: [f64; MAX_CHANNELS + 1],
    recovery: Recovery,
    last: Time,
    /// Since when every sample was gated, and how many.
    gated: Option<(Time, u64)>,
}

#[derive(Clone)]
enum Start {
    /// At the first driving sample, or measurement where nothing drives, from this time on.
    At(Time),
    /// At the first reference from this time on.
    FromReference(Time),
    Running,
}

/// The filter: feed it samples in order of time.
pub struct Ekf {
    composition: Composition,
    layout: Arc<Layout>,
    memory: Memory,
    considered: Vec<bool>,
    perturb: Option<Random>,
    update: Update,
    truth: State,
    constants: State,
    known_constants: Vec<bool>,
    known: Vec<bool>,
}

/// All that changes while the filter runs: a clone is a snapshot.
#[derive(Clone)]
struct Memory {
    start: Start,
    state: State,
    covariance: Covariance,
    transition: Transition,
    dynamics: BlockDynamics,
    processes: Vec<Box<dyn ProcessModel>>,
    sensors: Vec<SensorSlot>,
    input: Option<Sample>,
    pending: VecDeque<Sample>,
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
        let sensors = (composition.sensors.iter())
            .map(|s| SensorSlot {
                name: s.info.name.clone(),
                thresholds: s.policy.gate.thresholds(),
                recovery: s.policy.recovery,
                last: Time::MIN,
                gated: None,
            })
            .collect();
        let from_reference = composition.estimator.from_reference();
        let start = composition.start();
        let (constants, known_constants) = layout.true_state();
        let mut transition = composition.transition.clone();
        let dynamics = BlockDynamics::new(&layout, &mut transition);
        Self {
            considered,
            perturb: composition.estimator.perturb.then(|| Random::new(composition.seed, "initial")),
            update: Update::with_capacity(n, MAX_CHANNELS),
            truth: constants.clone(),
            constants,
            known: known_constants.clone(),
            known_constants,
            memory: Memory {
                start: if from_reference { Start::FromReference(start) } else { Start::At(start) },
                state: layout.initial_state(),
                covariance: Covariance::zero(n),
                transition,
                dynamics,
                processes: composition.processes.iter().map(|p| p.model.boxed_clone()).collect(),
                sensors,
                input: None,
                pending: VecDeque::with_capacity(MAX_PENDING),
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
        Truth { state: &self.truth, known: &self.known }
    }

    /// Takes a sample: propagates to its time and uses it.
    ///
    /// # Errors
    /// When the filter cannot go on; what it was until then stays.
    pub fn process(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        let role = &self.composition.sensors[sample.sensor.0].role;
        let is_input = matches!(role, Role::Input(_));
        if let Some(rejection) = self.refuse(sample) {
            if is_input {
                observer.input(sample, Some(rejection));
            } else {
                observer.update(&rejected(sample, rejection));
            }
            self.explain(sample, rejection, observer);
            return Ok(());
        }
        self.memory.sensors[sample.sensor.0].last = sample.time;
        if is_input {
            return self.drive(sample, observer);
        }
        if self.composition.processes.iter().all(|p| p.input.is_none()) {
            if let Start::At(start) = self.memory.start
                && sample.time >= start
            {
                self.initialise(sample.time, false, observer);
            }
            if self.running() && sample.time >= self.memory.state.time {
                self.advance(sample.time, None, observer)?;
            }
            return self.use_sample(sample, observer);
        }
        let waits = self.memory.input.is_none_or(|input| sample.time > input.time);
        if !waits {
            return self.use_sample(sample, observer);
        }
        if self.memory.pending.len() == MAX_PENDING
            && let Some(oldest) = self.memory.pending.pop_front()
        {
            observer.update(&rejected(&oldest, Rejection::NoInput));
        }
        self.memory.pending.push_back(*sample);
        Ok(())
    }

    /// Says what is left unused when there are no more samples.
    pub fn finish(&mut self, observer: &mut dyn Observer) {
        while let Some(sample) = self.memory.pending.pop_front() {
            observer.update(&rejected(&sample, Rejection::NoInput));
        }
        for slot in &self.memory.sensors {
            if let Some((since, count)) = slot.gated {
                let text = format!("the last {count} samples were gated, since {since}");
                observer.event(Event { time: slot.last, level: Level::Warning, about: slot.name.clone(), text });
            }
        }
    }

    fn refuse(&self, sample: &Sample) -> Option<Rejection> {
        let slot = &self.memory.sensors[sample.sensor.0];
        if let Some(channel) = sample.not_finite() {
            return Some(Rejection::NotFinite(channel));
        }
        if sample.time <= slot.last {
            return Some(Rejection::OutOfOrder);
        }
        let channels = &self.composition.sensors[sample.sensor.0].info.channels;
        let all = (1u32 << channels.len()) - 1;
        let is_input = matches!(self.composition.sensors[sample.sensor.0].role, Role::Input(_));
        let missing = if is_input { u32::from(sample.present()) & all != all } else { sample.present() == 0 };
        missing.then_some(Rejection::Missing)
    }

    /// A driving sample: what waits for its interval is used on the way.
    fn drive(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        let previous = self.memory.input.replace(*sample);
        let duration = previous.map_or(0.0, |p| sample.time.since(p.time));
        let input = Input { sample, duration };
        if !self.running() {
            for process in &mut self.memory.processes {
                process.prepare(&self.layout, &mut self.memory.state, &input);
            }
            if let Start::At(start) = self.memory.start
                && sample.time >= start
            {
                self.initialise(sample.time, false, observer);
            }
        }
        while let Some(waiting) = self.memory.pending.front().copied().filter(|w| w.time <= sample.time) {
            self.memory.pending.pop_front();
            if self.running() && waiting.time > self.memory.state.time {
                self.advance(waiting.time, Some(input), observer)?;
            }
            self.use_sample(&waiting, observer)?;
        }
        let running = self.running();
        if running && sample.time > self.memory.state.time {
            self.advance(sample.time, Some(input), observer)?;
        }
        observer.input(sample, None);
        Ok(())
    }

    /// Moves the state and its covariance to a time.
    fn advance(
        &mut self,
        to: Time,
        input: Option<Input<'_>>,
        _observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let m = &mut self.memory;
        let from = m.state.time;
        if to <= from {
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
        m.state.time = to;
        Ok(())
    }

    /// Starts from the blocks' initial values, or from the truth that a reference just gave.
    fn initialise(&mut self, time: Time, from_reference: bool, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        let signals = m.state.signals.clone();
        m.state = self.layout.initial_state();
        m.state.signals = signals;
        m.state.time = time;
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let told = from_reference && self.known[slot] && !self.known_constants[slot];
            if told {
                m.state.values[block.range()].copy_from_slice(&self.truth.values[block.range()]);
            }
            let prior = block.prior(&m.state.values);
            let range = block.tangent_range();
            for (i, row) in range.clone().enumerate() {
                for (j, column) in range.clone().enumerate() {
                    m.covariance.set(row, column, prior[(i, j)]);
                }
            }
            if let Some(random) = &mut self.perturb
                && told
                && let Some(factor) = prior.cholesky()
            {
                let draw = nalgebra::DVector::from_fn(range.len(), |_, _| random.normal());
                (block.operations.retract)(&mut m.state.values[block.range()], (factor.l() * draw).as_slice());
            }
        }
        m.processes.iter_mut().for_each(|p| p.restart());
        m.start = Start::Running;
        let text = format!("started with {} states", self.layout.tangent);
        observer.event(Event { time, level: Level::Info, about: "estimator".into(), text });
    }

    /// Uses a measurement or reference at the state's time, or turns it away.
    fn use_sample(&mut self, sample: &Sample, observer: &mut dyn Observer) -> Result<(), EstimatorError> {
        let index = sample.sensor.0;
        match &self.composition.sensors[index].role {
            Role::Input(_) => Ok(()),
            Role::Reference(reference) => {
                let running = self.running();
                let late = running && sample.time < self.memory.state.time;
                let waits = matches!(self.memory.start, Start::FromReference(start) if sample.time >= start);
                if late || !(running || waits) {
                    return Ok(());
                }
                let Some(mut motion) = reference.motion(&self.layout, &self.memory.state, sample) else {
                    return Ok(());
                };
                motion.time = sample.time;
                self.truth.values.copy_from_slice(&self.constants.values);
                self.truth.time = sample.time;
                self.known.copy_from_slice(&self.known_constants);
                for process in &self.memory.processes {
                    process.follow(&self.layout, &motion, &mut self.truth, &mut self.known);
                }
                if waits {
                    self.initialise(sample.time, true, observer);
                }
                let truth = Some(Truth { state: &self.truth, known: &self.known });
                let (state, covariance) = (&self.memory.state, &self.memory.covariance);
                observer.epoch(&Epoch { layout: &self.layout, state, covariance, truth });
                Ok(())
            }
            Role::Measurement(model) => {
                if !self.running() {
                    return Ok(());
                }
                if sample.time < self.memory.state.time {
                    observer.update(&rejected(sample, Rejection::Late));
                    self.explain(sample, Rejection::Late, observer);
                    return Ok(());
                }
                let model = Arc::clone(model);
                self.correct(sample, model.as_ref(), observer)
            }
        }
    }

    /// The update at the state's time.
    fn correct(
        &mut self,
        sample: &Sample,
        model: &dyn crate::measurement::AnyMeasurement,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let m = &mut self.memory;
        let update = &mut self.update;
        model.linearise(&self.layout, &m.state, sample, update);
        let Some(mut nis) = update.innovate(&m.covariance) else {
            observer.update(&rejected(sample, Rejection::Singular));
            self.explain(sample, Rejection::Singular, observer);
            return Ok(());
        };
        let slot = &mut m.sensors[sample.sensor.0];
        let threshold = slot.thresholds[update.m];
        let mut outcome = if nis <= threshold { Outcome::Accepted } else { Outcome::Gated };
        let mut event = |level, text| {
            observer.event(Event { time: sample.time, level, about: slot.name.clone(), text });
        };
        let record_nis = nis;
        if outcome == Outcome::Gated {
            let (since, count) = slot.gated.map_or((sample.time, 1), |(since, count)| (since, count + 1));
            if count == 1 || count == 5 {
                let level = if count == 1 { Level::Info } else { Level::Warning };
                let row = if count == 1 { String::new() } else { format!("{count} in a row, ") };
                event(level, format!("gate rejects: {row}NIS {nis:.1} is above {threshold:.1}"));
            }
            let locked_out = sample.time.since(since) >= slot.recovery.after.value().si();
            if locked_out && slot.recovery.action != Action::Report {
                event(Level::Warning, format!("every one of {count} samples was gated since {since}: recovering"));
                if slot.recovery.action == Action::Inflate {
                    // so that the innovation is as likely as its mean: NIS = m
                    let factor = (nis / update.m as f64).sqrt();
                    for s in crate::measurement::slots(model.blocks(&self.layout, &m.state)) {
                        m.covariance.scale(self.layout.blocks[s].tangent_range(), factor);
                    }
                    nis = update.innovate(&m.covariance).unwrap_or(nis);
                }
                slot.gated = None;
                outcome = Outcome::Accepted;
            } else {
                if locked_out && sample.time.since(since) < slot.recovery.after.value().si() * 2.0 && count % 64 == 0 {
                    event(Level::Warning, format!("every one of {count} samples was gated since {since}"));
                }
                slot.gated = Some((since, count));
            }
        } else if let Some((since, count)) = slot.gated.take() {
            event(Level::Info, format!("gate passes again after {count} gated samples since {since}"));
        }
        observer.update(&UpdateRecord {
            time: sample.time,
            sensor: sample.sensor,
            outcome,
            nis: record_nis,
            threshold,
            present: sample.present(),
            innovation: &update.innovation,
            covariance: &update.s,
        });
        if outcome != Outcome::Accepted || !nis.is_finite() {
            return Ok(());
        }
        update.apply(&mut m.covariance, &self.considered);
        let mut jacobian = [0.0; crate::manifold::MAX_TANGENT * crate::manifold::MAX_TANGENT];
        for block in self.layout.blocks.iter().filter(|b| b.spec.mode == Mode::Estimate) {
            let range = block.tangent_range();
            let delta = &update.delta[range.clone()];
            (block.operations.retract)(&mut m.state.values[block.range()], delta);
            if (block.operations.reset)(delta, &mut jacobian) {
                m.covariance.transform(range, &jacobian);
            }
        }
        match m.covariance.first_invalid() {
            None => Ok(()),
            Some(i) => {
                let block = self.layout.blocks.iter().find(|b| b.tangent_range().contains(&i));
                let block = block.map_or_else(String::new, |b| b.name.clone());
                Err(EstimatorError::Covariance { time: sample.time, block })
            }
        }
    }

    /// Says why a sample was rejected, the first time in a row for out-of-order ones.
    fn explain(&self, sample: &Sample, rejection: Rejection, observer: &mut dyn Observer) {
        let sensor = &self.composition.sensors[sample.sensor.0].info;
        let last = self.memory.sensors[sample.sensor.0].last;
        let text = match rejection {
            Rejection::NotFinite(channel) => {
                let name = sensor.channels.get(channel).map_or("?", |c| c.name);
                format!("sample rejected: channel {name} is {}", sample.get(channel).unwrap_or(f64::NAN))
            }
            Rejection::Missing => "sample rejected: channels are missing".to_owned(),
            Rejection::OutOfOrder if sample.time == last => "sample rejected: its time is there already".to_owned(),
            Rejection::OutOfOrder => format!("sample rejected: time goes back from {last} to {}", sample.time),
            Rejection::Late => format!("sample rejected: {} is before the state's {}", sample.time, self.state().time),
            Rejection::Singular => {
                "sample rejected: the innovation covariance is singular; is the sensor's noise zero?".to_owned()
            }
            Rejection::NoInput => "sample unused: no driving sample covers its time".to_owned(),
        };
        observer.event(Event { time: sample.time, level: Level::Warning, about: sensor.name.clone(), text });
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
