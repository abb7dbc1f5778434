//! What a run tells: epochs, updates and events.

use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;

/// What became of one sample of a measuring sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The state was corrected.
    Accepted,
    /// The innovation was outside the gate; the state is unchanged.
    Gated,
    /// The sample could not be used; the state is unchanged.
    Rejected(Rejection),
}

/// Why a sample could not be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// That channel is NaN or infinite.
    NotFinite(usize),
    /// No channel is there, or for a driving sensor not all of them.
    Missing,
    /// Not later than the sensor's sample before it.
    OutOfOrder,
    /// Earlier than the state, which cannot go back.
    Late,
    /// The innovation covariance is not positive definite.
    Singular,
    /// The driving sensor fell silent before this time was reached.
    NoInput,
}

/// One use of a sample of a measuring sensor.
#[derive(Clone, Copy, Debug)]
pub struct UpdateRecord<'a> {
    /// The sample's time.
    pub time: Time,
    /// The sensor.
    pub sensor: SensorId,
    /// What became of it.
    pub outcome: Outcome,
    /// Normalised innovation squared; NaN where none was computed.
    pub nis: f64,
    /// The gate's threshold on it; infinite where the gate is off.
    pub threshold: f64,
    /// The channels that were there, one bit each: the order of the innovation.
    pub present: u16,
    /// Innovation `z [-] h(x)` of the channels that were there, SI.
    pub innovation: &'a [f64],
    /// Innovation covariance `S`, row-major.
    pub covariance: &'a [f64],
}

impl UpdateRecord<'_> {
    /// Innovation and its 1-sigma for each of the first `N` channels, where it was there.
    pub fn channels(&self) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
        let m = self.innovation.len();
        let present = self.present;
        (0..u16::BITS as usize).filter(move |i| present >> i & 1 == 1).zip(0..m).map(
            move |(channel, k)| {
                (channel, self.innovation[k], self.covariance[k * m + k].max(0.0).sqrt())
            },
        )
    }
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

/// What is known to be true.
#[derive(Clone, Copy, Debug)]
pub struct Truth<'a> {
    /// The true state.
    pub state: &'a State,
    /// Which blocks of it are known, one a slot.
    pub known: &'a [bool],
}

/// How much an event matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Worth a line in the log.
    Info,
    /// The run goes on, but not as intended.
    Warning,
    /// The run, or a part of it, ends.
    Error,
}

/// Something that a person should read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When, on the run's clock.
    pub time: Time,
    /// How much it matters.
    pub level: Level,
    /// Which sensor, process, source or sink it is about.
    pub about: String,
    /// What happened.
    pub text: String,
}

/// Observes a filter: every method does nothing by default, and `()` observes nothing.
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
    /// Receives an estimate, at the output rate and wherever a reference is known.
    fn epoch(&mut self, _epoch: &Epoch<'_>) {}
    /// Receives the outcome of a measuring sensor's sample.
    fn update(&mut self, _update: &UpdateRecord<'_>) {}
    /// Receives `Phi` and the accumulated `Q` of a propagation, which a backward pass needs.
    fn transition(&mut self, _transition: &Transition) {}
    /// Receives a correction: Jacobian, gain and innovation covariance in the update's work space. Its
    /// `delta` is the injected error, as [`crate::state::Layout::reset_rows`] takes it.
    fn correction(&mut self, _update: &Update) {}
    /// Receives a sample of the driving sensor, and the reason if the filter rejected it.
    fn input(&mut self, _sample: &Sample, _rejected: Option<Rejection>) {}
    /// Receives an event.
    fn event(&mut self, _event: Event) {}
}

impl Observer for () {}
