//! Records of a run: updates and epochs, and the observer that receives them.

use crate::model::record::finding::Finding;
use crate::model::record::{Event, Outcome, Rejection};
use crate::state::carried::Back;
use crate::state::covariance::{Covariance, Transition, Update, standard_deviation};
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId, channels};
use crate::units::time::Time;

/// Record of a measuring sensor's sample.
#[derive(Clone, Copy, Debug)]
pub struct UpdateRecord<'a> {
    /// The sample's time.
    pub time: Time,
    /// The sensor.
    pub sensor: SensorId,
    /// Outcome.
    pub outcome: Outcome,
    /// Normalised innovation squared; NaN where none was computed. An isolated sensor's samples
    /// have one too.
    pub nis: f64,
    /// The gate's threshold on it; infinite where the gate is off.
    pub threshold: f64,
    /// Present channels, one bit each: the order of the innovation.
    pub present: u16,
    /// Innovation `z [-] h(x)` of the present channels, SI.
    pub innovation: &'a [f64],
    /// Innovation covariance `S`, row-major.
    pub covariance: &'a [f64],
}

impl UpdateRecord<'_> {
    /// Present channels among the first `N`, each with its innovation and 1-sigma.
    pub fn channels(&self) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        let m = self.innovation.len();
        channels(self.present).zip(0..m).map(move |(channel, k)| {
            (channel, self.innovation[k], standard_deviation(self.covariance[k * m + k]))
        })
    }
}

/// A sample of a driving sensor that the filter rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRejection {
    /// The sample's time.
    pub time: Time,
    /// The driving sensor.
    pub sensor: SensorId,
    /// Reason.
    pub reason: Rejection,
}

/// The estimate at one time.
#[derive(Clone, Copy, Debug)]
pub struct Epoch<'a> {
    /// The layout of the state.
    pub layout: &'a Layout,
    /// The estimate; `state.time` is the epoch's time.
    pub state: &'a State,
    /// Its covariance.
    pub covariance: &'a Covariance,
    /// The truth, where a reference gives it at this time.
    pub truth: Option<Truth<'a>>,
}

/// Known truth of a state.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// True state.
    pub state: &'a State,
    /// Which blocks of the state are known, one entry per slot.
    pub known: &'a [bool],
}

impl Truth<'_> {
    /// Error of the estimate of a block in its display unit, the truth in the axes of the estimate: near
    /// a pole north differs between them.
    pub fn show_error(&self, layout: &Layout, slot: usize, estimate: &State, out: &mut [f64]) {
        let (block, mut back) = (&layout.blocks[slot], Back::default());
        let truth = layout.true_value(slot, [self.state, estimate], self.known, &mut back);
        block.show_difference(&estimate.values[block.range()], truth, out);
    }
}

/// A filter takes all samples since its start once more, linearised at another trajectory. Until the
/// end of the repetition, [`Observer::transition`] and [`Observer::correction`] receive what
/// replaces those before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Repetition<'a> {
    /// The filter is at its start again; also after a repetition that another one follows.
    Begins,
    /// The filter has reached the present again, and injects this error.
    Ends(&'a [f64]),
    /// The repetition failed: what it replaced holds again.
    Failed,
}

/// Observes a filter: every method passes on to [`Observer::behind`], which by default is nobody, and
/// `()` observes nothing.
///
/// ```
/// use navfuse_core::model::record::{Observer, Outcome, UpdateRecord};
/// /// Counts the gated samples.
/// #[derive(Default)]
/// struct Gated(usize);
/// impl Observer for Gated {
///     fn update(&mut self, update: &UpdateRecord<'_>) {
///         self.0 += usize::from(update.outcome == Outcome::Gated);
///     }
/// }
/// ```
pub trait Observer {
    /// The observer behind this one, which receives what this one does not take itself: for a layer
    /// between a filter and its run.
    fn behind(&mut self) -> Option<&mut dyn Observer> {
        None
    }
    /// Receives an estimate, at the output rate and wherever a reference is known.
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        if let Some(behind) = self.behind() {
            behind.epoch(epoch);
        }
    }
    /// Receives the outcome of a measuring sensor's sample.
    fn update(&mut self, update: &UpdateRecord<'_>) {
        if let Some(behind) = self.behind() {
            behind.update(update);
        }
    }
    /// Receives `Phi` and the accumulated `Q` of a propagation, which a backward pass needs.
    fn transition(&mut self, transition: &Transition) {
        if let Some(behind) = self.behind() {
            behind.transition(transition);
        }
    }
    /// Receives a correction: Jacobian, gain and innovation covariance in the update's work space.
    /// Its `delta` is the injected error, as [`crate::state::Layout::reset_rows`] takes it.
    fn correction(&mut self, update: &Update) {
        if let Some(behind) = self.behind() {
            behind.correction(update);
        }
    }
    /// Receives state and covariance at the start and after each propagation. In a further pass of
    /// the smoother, the state is that at which the filter linearises, and `offset` the estimate
    /// relative to it; otherwise `offset` is empty.
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        if let Some(behind) = self.behind() {
            behind.moved(state, covariance, offset);
        }
    }
    /// Receives the offset of [`Self::moved`] after a correction or a clone.
    fn corrected(&mut self, offset: &[f64]) {
        if let Some(behind) = self.behind() {
            behind.corrected(offset);
        }
    }
    /// Receives the beginning and the end of a repetition.
    fn repetition(&mut self, repetition: Repetition<'_>) {
        if let Some(behind) = self.behind() {
            behind.repetition(repetition);
        }
    }
    /// Receives the innovation of a gated sample, its covariance and that with the error, after
    /// [`Self::update`].
    fn gated(&mut self, update: &Update) {
        if let Some(behind) = self.behind() {
            behind.gated(update);
        }
    }
    /// Receives a sample of the driving sensor, and the reason if the filter rejected it.
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        if let Some(behind) = self.behind() {
            behind.input(sample, rejected);
        }
    }
    /// Receives an event.
    fn event(&mut self, event: Event) {
        if let Some(behind) = self.behind() {
            behind.event(event);
        }
    }
    /// Receives a fault that the filter found.
    fn finding(&mut self, finding: Finding) {
        if let Some(behind) = self.behind() {
            behind.finding(finding);
        }
    }
}

impl Observer for () {}
