//! Records of a run on their way to another thread: copies in memory that is used again.

use crate::model::record::{Epoch, Event, Outcome, Repetition, Truth, UpdateRecord};
use crate::model::stream::{Sink, StreamError};
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;

/// Records of one batch. A thread is woken for a batch, which costs as much as a few dozen records.
const RECORDS: usize = 256;

/// Events of one batch: their texts need memory, which the next batch does not use again.
const EVENTS: usize = 64;

/// A record of a batch. Its content, but for a small one, is the next of its kind in the batch.
enum Record {
    Sample,
    Epoch(Estimate),
    Update,
    /// The places of the transitions from here on.
    Places(Box<Transition>),
    Transition,
    Correction,
    Repetition(Repeated),
    Event(Event),
}

/// The method of a sink that receives an estimate.
#[derive(Clone, Copy)]
pub(super) enum Estimate {
    Epoch,
    Newest,
    Filtered,
}

/// A repetition that owns its error.
enum Repeated {
    Begins,
    Ends(Vec<f64>),
    Failed,
}

/// Items of one kind, of which the first are in use.
struct Pool<T> {
    items: Vec<T>,
    used: usize,
}

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self { items: Vec::new(), used: 0 }
    }
}

impl<T: Clone> Pool<T> {
    /// Copies an item, into the memory of an earlier one where there is one.
    fn push(&mut self, item: &T) {
        match self.items.get_mut(self.used) {
            Some(place) => place.clone_from(item),
            None => self.items.push(item.clone()),
        }
        self.used += 1;
    }

    /// The items in use.
    fn iter(&self) -> std::slice::Iter<'_, T> {
        self.items[..self.used].iter()
    }
}

/// An update that owns its innovation.
struct Innovation {
    time: Time,
    sensor: SensorId,
    outcome: Outcome,
    nis: f64,
    threshold: f64,
    present: u16,
    /// Length of the innovation, and of its covariance.
    numbers: [usize; 2],
}

/// A run of records, in order.
#[derive(Default)]
pub(super) struct Batch {
    order: Vec<Record>,
    events: usize,
    samples: Vec<Sample>,
    states: Pool<State>,
    covariances: Pool<Covariance>,
    /// Set for each estimate that comes with a truth.
    compared: Vec<bool>,
    truths: Pool<State>,
    known: Vec<bool>,
    updates: Vec<Innovation>,
    corrections: Pool<Update>,
    /// The numbers of updates and transitions, one after the other.
    numbers: Vec<f64>,
    steps: Vec<f64>,
}

impl Batch {
    /// Returns `true` if the batch is due.
    pub(super) fn is_full(&self) -> bool {
        self.order.len() >= RECORDS || self.events >= EVENTS
    }

    /// Returns `true` if there is no record.
    pub(super) fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Forgets the records and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.order.clear();
        self.events = 0;
        self.samples.clear();
        self.states.used = 0;
        self.covariances.used = 0;
        self.compared.clear();
        self.truths.used = 0;
        self.known.clear();
        self.updates.clear();
        self.corrections.used = 0;
        self.numbers.clear();
        self.steps.clear();
    }

    pub(super) fn sample(&mut self, sample: &Sample) {
        self.order.push(Record::Sample);
        self.samples.push(*sample);
    }

    pub(super) fn epoch(&mut self, estimate: Estimate, epoch: &Epoch<'_>) {
        self.order.push(Record::Epoch(estimate));
        self.states.push(epoch.state);
        self.covariances.push(epoch.covariance);
        self.compared.push(epoch.truth.is_some());
        if let Some(truth) = epoch.truth {
            self.truths.push(truth.state);
            self.known.extend_from_slice(truth.known);
        }
    }

    pub(super) fn update(&mut self, update: &UpdateRecord<'_>) {
        let &UpdateRecord { time, sensor, outcome, nis, threshold, present, .. } = update;
        let numbers = [update.innovation.len(), update.covariance.len()];
        self.numbers.extend_from_slice(update.innovation);
        self.numbers.extend_from_slice(update.covariance);
        let update = Innovation { time, sensor, outcome, nis, threshold, present, numbers };
        self.order.push(Record::Update);
        self.updates.push(update);
    }

    /// Takes a transition; `before` is the one before it, whose places the other thread knows.
    pub(super) fn transition(&mut self, transition: &Transition, before: &mut Option<Transition>) {
        if before.as_ref().is_none_or(|before| !before.has_places_of(transition)) {
            *before = Some(transition.clone());
            self.order.push(Record::Places(Box::new(transition.clone())));
        }
        self.order.push(Record::Transition);
        transition.write_step(&mut self.steps);
    }

    pub(super) fn correction(&mut self, update: &Update) {
        self.order.push(Record::Correction);
        self.corrections.push(update);
    }

    pub(super) fn repetition(&mut self, repetition: Repetition<'_>) {
        let repeated = match repetition {
            Repetition::Begins => Repeated::Begins,
            Repetition::Ends(injected) => Repeated::Ends(injected.to_vec()),
            Repetition::Failed => Repeated::Failed,
        };
        self.order.push(Record::Repetition(repeated));
    }

    pub(super) fn event(&mut self, event: &Event) {
        self.order.push(Record::Event(event.clone()));
        self.events += 1;
    }

    /// Passes the records on to a sink; `places` is the transition that gives the last places.
    pub(super) fn pass_to(
        &self,
        sink: &mut impl Sink,
        layout: &Layout,
        places: &mut Transition,
    ) -> Result<(), StreamError> {
        let (mut samples, mut updates) = (self.samples.iter(), self.updates.iter());
        let (mut states, mut covariances) = (self.states.iter(), self.covariances.iter());
        let (mut compared, mut truths) = (self.compared.iter(), self.truths.iter());
        let mut known = self.known.chunks_exact(layout.blocks.len().max(1));
        let mut corrections = self.corrections.iter();
        let (mut numbers, mut steps) = (&self.numbers[..], &self.steps[..]);
        for record in &self.order {
            let passed = match record {
                Record::Sample => samples.next().map(|sample| sink.sample(sample)),
                Record::Epoch(estimate) => {
                    let truth = |(state, known)| Truth { state, known };
                    let truth = match compared.next() {
                        Some(true) => truths.next().zip(known.next()).map(truth),
                        _ => None,
                    };
                    let estimated = states.next().zip(covariances.next());
                    estimated.map(|(state, covariance)| {
                        let epoch = Epoch { layout, state, covariance, truth };
                        match estimate {
                            Estimate::Epoch => sink.epoch(&epoch),
                            Estimate::Newest => sink.newest(&epoch),
                            Estimate::Filtered => sink.filtered(&epoch),
                        }
                    })
                }
                Record::Update => updates.next().map(|update| {
                    let &Innovation { time, sensor, outcome, nis, threshold, present, .. } = update;
                    let [innovation, covariance] = update.numbers.map(|n| split(&mut numbers, n));
                    sink.update(&UpdateRecord {
                        time,
                        sensor,
                        outcome,
                        nis,
                        threshold,
                        present,
                        innovation,
                        covariance,
                    })
                }),
                Record::Places(transition) => {
                    places.clone_from(transition);
                    None
                }
                Record::Transition => {
                    places.read_step(&mut steps);
                    Some(sink.transition(places))
                }
                Record::Correction => corrections.next().map(|update| sink.correction(update)),
                Record::Repetition(repeated) => Some(sink.repetition(match repeated {
                    Repeated::Begins => Repetition::Begins,
                    Repeated::Ends(injected) => Repetition::Ends(injected),
                    Repeated::Failed => Repetition::Failed,
                })),
                Record::Event(event) => Some(sink.event(event)),
            };
            passed.unwrap_or(Ok(()))?;
        }
        Ok(())
    }
}

/// Takes the first `n` numbers off.
fn split<'a>(numbers: &mut &'a [f64], n: usize) -> &'a [f64] {
    let (first, rest) = numbers.split_at(n);
    *numbers = rest;
    first
}
