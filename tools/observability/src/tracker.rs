//! The tracker: follows a run and computes the share of each state that is still prior.

use crate::component::{Component, Determination, square_root};
use crate::direction::{self, Direction};
use crate::initial_error::InitialError;
use crate::reference::Reference;
use crate::share::{Bits, Shares};
use crate::status::{ComponentStatus, DETERMINED};
use navfuse_core::model::record::{Epoch, Outcome, Record, Repetition, UpdateRecord, Wants};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::session::Finished;
use navfuse_core::state::Layout;
use navfuse_core::state::covariance::{Covariance, Transition, Update};
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::units::Unit;
use navfuse_core::units::sample::SensorId;
use navfuse_core::units::time::{Span, Time};

/// Longest time between two judgements of the states, s.
const JUDGED: f64 = 1.0;
/// Squared sensitivity above which a sensor reads a component: one prior sigma changes a sample by
/// a thousandth of its noise.
const READS: f64 = 1e-6;

/// Contribution of a sensor.
#[derive(Clone, Debug)]
pub struct SensorShare {
    /// Name of the sensor.
    pub name: String,
    /// Set if the sensor updates the state.
    pub measures: bool,
    /// Set if it measures velocities alone, as a DVL does.
    pub velocity: bool,
    /// Used samples.
    pub used: u64,
    /// Information on each component of the initial error, bits.
    pub bits: Vec<f64>,
    /// Set for each component that the sensor's model reads.
    pub reads: Vec<bool>,
}

/// Tracks the observability of a run, for any composition.
///
/// For a block with dynamics of its own, the share of prior is `(sigma / reference)^2`, with the
/// sigma without measurements as the reference ([`ComponentStatus::reference`]). For a constant
/// this is the remaining part of the prior variance.
///
/// A driven block, such as the velocity of an INS, has no such reference. Its share is the part of
/// the initial variance that is still in the estimate, `Psi P_0 Psi' / P_0`, where `Psi` is the
/// product of all `(I - K H) Phi`. An unobserved position keeps all of it, however little its sigma
/// has grown; a measured velocity forgets its initial value.
pub struct Tracker {
    layout: Layout,
    /// Set where the epochs are smoothed ones, which have no part in the filter.
    smoothed: bool,
    components: Vec<Component>,
    status: Vec<ComponentStatus>,
    sensors: Vec<SensorShare>,
    started: Option<Propagation>,
    /// The same at the start, and before a repetition.
    first: Option<Propagation>,
    before: Option<Propagation>,
    last_used: Option<SensorId>,
    reductions: Vec<f64>,
    begin: Time,
    /// The last epoch: its time, its estimate and its covariance, and the time up to which the
    /// states are judged.
    end: Time,
    values: Vec<f64>,
    covariance: Covariance,
    judged: Time,
    /// Intervals of judgements and of the history, and the times at which the next are due.
    intervals: [Span; 2],
    next: [Time; 2],
    /// Times of the history; `history` holds the normalised sigmas, row by row.
    times: Vec<f64>,
    history: Vec<f64>,
    bits: Bits,
}

/// Quantities that are propagated from the start on.
#[derive(Clone)]
struct Propagation {
    error: InitialError,
    reference: Reference,
    /// Set after the first transition or update.
    moved: bool,
    work: Covariance,
}

impl Propagation {
    fn new(layout: &Layout, values: &[f64], covariance: &Covariance) -> Self {
        let l = square_root(layout, values, &covariance.to_dense());
        Self {
            error: InitialError::new(layout.tangent, &l),
            reference: Reference::new(layout, covariance),
            moved: false,
            work: Covariance::zero(layout.tangent),
        }
    }

    /// Begins with the prior of the scenario.
    fn of_prior(layout: &Layout) -> Self {
        let state = layout.initial_state();
        let mut covariance = Covariance::zero(layout.tangent);
        for block in layout.blocks.iter().filter(|b| b.tangent.is_some()) {
            let (prior, range) = (block.prior(&state.values), block.tangent_range());
            for (k, &p) in prior.iter().enumerate() {
                covariance.set(range.start + k % range.len(), range.start + k / range.len(), p);
            }
        }
        Self::new(layout, &state.values, &covariance)
    }
}

impl Tracker {
    /// Creates a tracker of a run with a history at the interval `every`, s; an infinite interval
    /// keeps no history. It judges the states at the first epoch of each interval, and of each second
    /// where the interval is longer.
    pub fn new(run: &RunInfo, every: f64) -> Self {
        let layout = run.layout.clone();
        let components = Component::of(&layout);
        let n = components.len();
        let sensor = |s: &navfuse_core::model::sensor::SensorInfo| SensorShare {
            name: s.name.clone(),
            measures: s.purpose == Purpose::Measurement,
            velocity: s.channels.iter().all(|c| c.unit == Unit::METRE_PER_SECOND),
            used: 0,
            bits: vec![0.0; n],
            reads: vec![false; n],
        };
        let verdict = |c: &Component| {
            if c.considered { Determination::Considered } else { Determination::NotDetermined }
        };
        let nan = f64::NAN;
        let first = |c| ComponentStatus {
            prior: nan,
            reference: nan,
            sigma: nan,
            weight: 1.0,
            verdict: verdict(c),
            since: None,
            lost: None,
        };
        Self {
            covariance: Covariance::zero(layout.tangent),
            status: components.iter().map(first).collect(),
            sensors: run.sensors.iter().map(sensor).collect(),
            components,
            layout,
            smoothed: run.smoothed,
            started: None,
            first: None,
            before: None,
            last_used: None,
            reductions: vec![1.0; n],
            begin: Time::MIN,
            end: Time::MIN,
            values: Vec::new(),
            judged: Time::MIN,
            intervals: [every.min(JUDGED), every]
                .map(|s| Span::from_seconds(s).unwrap_or(Span::MAX).max(Span::from_nanos(1))),
            next: [Time::MIN; 2],
            times: Vec::new(),
            history: Vec::new(),
            bits: Bits::default(),
        }
    }

    /// Begins with the prior of the scenario, for a run that goes on from a checkpoint: its first
    /// estimate is not the start.
    pub fn begin_with_prior(&mut self) {
        let started = Propagation { moved: true, ..Propagation::of_prior(&self.layout) };
        self.first = Some(started.clone());
        self.started = Some(started);
    }

    /// Returns the layout of the state.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the uncertain components.
    pub fn components(&self) -> &[Component] {
        &self.components
    }

    /// Returns the present status of each component.
    pub fn status(&self) -> &[ComponentStatus] {
        &self.status
    }

    /// Returns the coordinates (SI) of a block at the last epoch; `None` before the first epoch or
    /// for an unknown block.
    pub fn coordinates(&self, name: &str) -> Option<Vec<f64>> {
        let block = self.layout.find(name).filter(|_| !self.values.is_empty())?;
        let mut out = vec![0.0; block.operations.tangent];
        (block.operations.coordinates)(&self.values[block.range()], &mut out);
        Some(out)
    }

    /// Returns the contribution of each sensor.
    pub fn sensors(&self) -> &[SensorShare] {
        &self.sensors
    }

    /// Returns the times of the first and the last epoch.
    pub fn span(&self) -> (Time, Time) {
        (self.begin, self.end)
    }

    /// Returns `true` after the first epoch.
    pub fn started(&self) -> bool {
        self.begin != Time::MIN
    }

    /// Returns the times of the history, s, and the normalised sigmas, row by row.
    pub fn history(&self) -> (&[f64], &[f64]) {
        (&self.times, &self.history)
    }

    /// Returns the share of each sensor in the information about each component over time.
    pub fn shares(&self) -> Shares {
        let each = self.components.iter().enumerate();
        let groups = each.map(|(i, component)| (component.title(&self.layout), i..i + 1));
        Shares::new(&self.bits, &self.sensors, groups)
    }

    /// Returns the same for blocks, with the information on all of their components.
    pub fn shares_of_blocks(&self) -> Shares {
        let mut begin = 0;
        let blocks = self.components.chunk_by(|a, b| a.slot == b.slot);
        let groups = blocks.map(|block| {
            begin += block.len();
            (block[0].state.clone(), begin - block.len()..begin)
        });
        Shares::new(&self.bits, &self.sensors, groups)
    }

    /// Returns `M`, the remaining covariance of the initial error in units of the prior; row-major,
    /// empty before the start.
    pub fn left(&self) -> &[f64] {
        self.started.as_ref().map_or(&[], |s| s.error.left())
    }

    /// Returns the information on each component if all others were known: prior over remaining
    /// variance, less one.
    pub fn alone(&self) -> &[f64] {
        self.started.as_ref().map_or(&[], |s| s.error.alone())
    }

    /// Returns `true` if the errors of other blocks drive the block.
    pub fn driven(&self, slot: usize) -> bool {
        self.started.as_ref().is_some_and(|s| s.reference.driven(slot))
    }

    /// Returns the least determined directions of the initial error. Considered components and
    /// those that the estimate has forgotten take no part.
    pub fn undetermined(&self) -> Vec<Direction> {
        let forgotten =
            |i: usize| self.driven(self.components[i].slot) && self.status[i].weight <= DETERMINED;
        let of = |i: usize| !self.components[i].considered && !forgotten(i);
        direction::undetermined(self.components.len(), self.left(), of)
    }

    /// The records that a tracker takes.
    pub fn wants() -> Wants {
        let estimates = Wants::EPOCHS | Wants::FILTERED | Wants::UPDATES;
        estimates | Wants::TRANSITIONS | Wants::CORRECTIONS | Wants::REPETITIONS
    }

    /// Takes a record of the filter; returns `true` if it judged the states and the verdict on one
    /// changed.
    pub fn take(&mut self, record: &Record<'_>) -> bool {
        match *record {
            Record::Filtered(epoch) => return self.epoch(epoch),
            Record::Epoch(epoch) if !self.smoothed => return self.epoch(epoch),
            Record::Update(update) => self.update(update),
            Record::Transition(transition) => self.transition(transition),
            Record::Correction(update) => self.correction(update),
            Record::Repetition(repetition) => self.repetition(repetition),
            _ => {}
        }
        false
    }

    /// Takes a transition of the error state.
    fn transition(&mut self, transition: &Transition) {
        if let Some(s) = &mut self.started {
            s.moved = true;
            s.error.transition(transition);
            s.reference.transition(transition);
        }
    }

    /// Takes the outcome of a sample, which precedes its correction.
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.last_used = (update.outcome == Outcome::Accepted).then_some(update.sensor);
    }

    /// Takes a correction of the state.
    fn correction(&mut self, update: &Update) {
        // a filter without a driving sensor may correct before its first epoch
        let layout = &self.layout;
        let started = self.started.get_or_insert_with(|| {
            let started = Propagation::of_prior(layout);
            self.first = Some(started.clone());
            started
        });
        started.moved = true;
        started.error.correction(layout, update, &mut self.reductions);
        let Some(sensor) = self.last_used.and_then(|id| self.sensors.get_mut(id.0)) else { return };
        sensor.used += 1;
        // halving sigma is one bit, and quarters the variance
        let gains = self.reductions.iter().map(|factor| 0.5 * factor.log2());
        sensor.bits.iter_mut().zip(gains).for_each(|(sum, bits)| *sum += bits);
        let (w, prior) = (update.columns.len(), started.reference.prior());
        for (k, &column) in update.columns.iter().enumerate() {
            if sensor.reads[column] {
                continue;
            }
            let sigma = prior.get(column, column).sqrt();
            let seen = |a: usize| {
                (update.h[a * w + k] * sigma).powi(2) > READS * update.r[a * update.m + a]
            };
            sensor.reads[column] = (0..update.m).any(seen);
        }
    }

    /// Takes the beginning and the end of a repetition. Each sensor keeps the information of the
    /// samples as they came.
    fn repetition(&mut self, repetition: Repetition<'_>) {
        match repetition {
            Repetition::Begins => {
                let started = std::mem::replace(&mut self.started, self.first.clone());
                self.before = self.before.take().or(started);
                self.last_used = None;
            }
            Repetition::Ends(injected) => {
                self.before = None;
                if let Some(s) = self.started.as_mut().filter(|_| !injected.is_empty()) {
                    s.error.reset(&self.layout, injected);
                }
            }
            Repetition::Failed => self.started = self.before.take(),
        }
    }

    /// Takes an epoch; returns `true` if it judged the states and the verdict on one changed.
    fn epoch(&mut self, epoch: &Epoch<'_>) -> bool {
        let values = &epoch.state.values;
        let time = epoch.state.time;
        if self.started.as_ref().is_none_or(|s| !s.moved && self.begin == Time::MIN) {
            self.started = Some(Propagation::new(&self.layout, values, epoch.covariance));
            self.first.clone_from(&self.started);
        }
        if self.begin == Time::MIN {
            self.begin = time;
        }
        self.end = time;
        self.values.clone_from(values);
        self.covariance.clone_from(epoch.covariance);
        if time < self.next[0] {
            return false;
        }
        let changed = self.judge();
        let [_, every] = self.intervals;
        if time >= self.next[1] && every < Span::MAX {
            self.times.push(time.seconds());
            self.history.extend(self.status.iter().map(ComponentStatus::normalised));
        }
        for (next, every) in self.next.iter_mut().zip(self.intervals) {
            *next = if time < *next { *next } else { time.next_multiple(every) };
        }
        changed
    }

    /// Judges the states at the last epoch, unless they are judged already. Returns `true` if the
    /// verdict on one changed.
    pub fn finish(&mut self) -> bool {
        self.judged != self.end && self.judge()
    }

    fn judge(&mut self) -> bool {
        self.judged = self.end;
        self.bits.push(self.end.seconds(), &self.sensors);
        let Some(started) = &mut self.started else { return false };
        let (time, values) = (self.end, &self.values);
        let mut changed = false;
        let mut first = 0;
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let range = block.tangent_range();
            if range.is_empty() {
                continue;
            }
            let reference = &started.reference;
            let covariances = [&self.covariance, reference.prior(), reference.carried()];
            let [sigma, prior, reference] = block.show_sigmas(values, covariances);
            let driven = started.reference.driven(slot);
            let mut carried = [0.0; MAX_TANGENT];
            if driven {
                // block of Psi P_0 Psi' that the block's own initial error contributes
                for (i, j) in range.clone().flat_map(|i| range.clone().map(move |j| (i, j))) {
                    let product = |k| started.error.carried(i, k) * started.error.carried(j, k);
                    started.work.set(i, j, range.clone().map(product).sum());
                }
                [carried] = block.show_sigmas(values, [&started.work]);
            }
            for k in 0..range.len() {
                let weight = match (driven, reference[k] > 0.0) {
                    (true, true) => (carried[k] / prior[k]).powi(2),
                    (false, true) => (sigma[k] / reference[k]).powi(2),
                    (_, false) => 1.0,
                };
                let status = &mut self.status[first + k];
                changed |= status.set(time, prior[k], reference[k], sigma[k], weight);
            }
            first += range.len();
        }
        changed
    }
}

/// Sink with a tracker.
pub struct TrackerSink {
    every: f64,
    tracker: Option<Tracker>,
}

impl TrackerSink {
    /// A sink whose tracker keeps normalised sigmas at this interval, s.
    pub fn new(every: f64) -> Self {
        Self { every, tracker: None }
    }

    /// Returns the tracker that a finished run has filled; `None` if the run had no such sink.
    pub fn take(finished: &mut Finished) -> Option<Tracker> {
        let mut tracker = finished.take_sink::<Self>()?.tracker?;
        tracker.finish();
        Some(tracker)
    }
}

impl Sink for TrackerSink {
    fn wants(&self) -> Wants {
        Tracker::wants()
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.tracker = Some(Tracker::new(run, self.every));
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Some(tracker) = &mut self.tracker {
            tracker.take(record);
        }
        Ok(())
    }
}
