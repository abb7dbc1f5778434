//! Records of a run on their way to another thread: copies in memory that is used again.

use crate::model::record::finding::Finding;
use crate::model::record::{
    Derived, Epoch, Event, InputRejection, Outcome, Record, Repetition, Truth, UpdateRecord,
};
use crate::model::stream::{Sink, StreamError};
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;

/// Records of one batch. A thread is woken for a batch, which costs as much as a few dozen records.
const RECORDS: usize = 256;

/// Texts of one batch, in events, findings and derived quantities: their memory is not used again.
const TEXTS: usize = 64;

/// A [`Record`] of a batch. Its content, but for a small one, is the next of its kind in the batch.
enum Owned {
    Sample,
    Epoch(Estimate),
    Update,
    InputRejection(InputRejection),
    /// The places of the transitions from here on.
    Places(Box<Transition>),
    Transition,
    Correction,
    Repetition(Repeated),
    Event(Event),
    Finding(Box<Finding>),
    Derived(Derived),
    /// No record: the sink begins a new file.
    Reopening,
}

/// The record that an estimate makes.
type Estimate = for<'a> fn(&'a Epoch<'a>) -> Record<'a>;

/// A repetition that owns its error.
enum Repeated {
    Begins,
    Ends(Vec<f64>),
    Failed,
}

impl Repeated {
    fn of(repetition: Repetition<'_>) -> Self {
        match repetition {
            Repetition::Begins => Self::Begins,
            Repetition::Ends(injected) => Self::Ends(injected.to_vec()),
            Repetition::Failed => Self::Failed,
        }
    }

    fn borrowed(&self) -> Repetition<'_> {
        match self {
            Self::Begins => Repetition::Begins,
            Self::Ends(injected) => Repetition::Ends(injected),
            Self::Failed => Repetition::Failed,
        }
    }
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
    order: Vec<Owned>,
    texts: usize,
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
        self.order.len() >= RECORDS || self.texts >= TEXTS
    }

    /// Returns `true` if there is no record.
    pub(super) fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Forgets the records and keeps the memory.
    pub(super) fn clear(&mut self) {
        self.order.clear();
        self.texts = 0;
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

    /// Copies a record; `places` is a transition with the places that the other thread knows.
    pub(super) fn push(&mut self, record: &Record<'_>, places: &mut Option<Transition>) {
        let owned = match *record {
            Record::Sample(sample) => {
                self.samples.push(*sample);
                Owned::Sample
            }
            Record::Epoch(epoch) => self.epoch(|e| Record::Epoch(e), epoch),
            Record::Newest(epoch) => self.epoch(|e| Record::Newest(e), epoch),
            Record::Filtered(epoch) => self.epoch(|e| Record::Filtered(e), epoch),
            Record::Update(update) => self.update(update),
            Record::InputRejection(rejection) => Owned::InputRejection(*rejection),
            Record::Transition(transition) => self.transition(transition, places),
            Record::Correction(update) => {
                self.corrections.push(update);
                Owned::Correction
            }
            Record::Repetition(repetition) => Owned::Repetition(Repeated::of(repetition)),
            Record::Event(event) => self.text(Owned::Event(event.clone())),
            Record::Finding(finding) => self.text(Owned::Finding(Box::new(finding.clone()))),
            Record::Derived(derived) => self.text(Owned::Derived(derived.clone())),
            // the verdict comes after the thread has ended
            Record::Verdict(_) => return,
        };
        self.order.push(owned);
    }

    /// Adds the wish for a new file.
    pub(super) fn push_reopening(&mut self) {
        self.order.push(Owned::Reopening);
    }

    /// Counts a record that owns a text.
    fn text(&mut self, owned: Owned) -> Owned {
        self.texts += 1;
        owned
    }

    fn epoch(&mut self, estimate: Estimate, epoch: &Epoch<'_>) -> Owned {
        self.states.push(epoch.state);
        self.covariances.push(epoch.covariance);
        self.compared.push(epoch.truth.is_some());
        if let Some(truth) = epoch.truth {
            self.truths.push(truth.state);
            self.known.extend_from_slice(truth.known);
        }
        Owned::Epoch(estimate)
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Owned {
        let &UpdateRecord { time, sensor, outcome, nis, threshold, present, .. } = update;
        let numbers = [update.innovation.len(), update.covariance.len()];
        self.numbers.extend_from_slice(update.innovation);
        self.numbers.extend_from_slice(update.covariance);
        let update = Innovation { time, sensor, outcome, nis, threshold, present, numbers };
        self.updates.push(update);
        Owned::Update
    }

    fn transition(&mut self, transition: &Transition, known: &mut Option<Transition>) -> Owned {
        if known.as_ref().is_none_or(|known| !known.has_places_of(transition)) {
            *known = Some(transition.clone());
            self.order.push(Owned::Places(Box::new(transition.clone())));
        }
        transition.write_step(&mut self.steps);
        Owned::Transition
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
                Owned::Sample => samples.next().map(|sample| sink.take(&Record::Sample(sample))),
                Owned::Epoch(estimate) => {
                    let truth = |(state, known)| Truth { state, known };
                    let truth = match compared.next() {
                        Some(true) => truths.next().zip(known.next()).map(truth),
                        _ => None,
                    };
                    let estimated = states.next().zip(covariances.next());
                    estimated.map(|(state, covariance)| {
                        sink.take(&estimate(&Epoch { layout, state, covariance, truth }))
                    })
                }
                Owned::Update => updates.next().map(|update| {
                    let &Innovation { time, sensor, outcome, nis, threshold, present, .. } = update;
                    let [innovation, covariance] = update.numbers.map(|n| split(&mut numbers, n));
                    sink.take(&Record::Update(&UpdateRecord {
                        time,
                        sensor,
                        outcome,
                        nis,
                        threshold,
                        present,
                        innovation,
                        covariance,
                    }))
                }),
                Owned::InputRejection(rejection) => {
                    Some(sink.take(&Record::InputRejection(rejection)))
                }
                Owned::Places(transition) => {
                    places.clone_from(transition);
                    None
                }
                Owned::Transition => {
                    places.read_step(&mut steps);
                    Some(sink.take(&Record::Transition(places)))
                }
                Owned::Correction => {
                    corrections.next().map(|update| sink.take(&Record::Correction(update)))
                }
                Owned::Repetition(repeated) => {
                    Some(sink.take(&Record::Repetition(repeated.borrowed())))
                }
                Owned::Event(event) => Some(sink.take(&Record::Event(event))),
                Owned::Finding(finding) => Some(sink.take(&Record::Finding(finding))),
                Owned::Derived(derived) => Some(sink.take(&Record::Derived(derived))),
                Owned::Reopening => Some(sink.reopen()),
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
