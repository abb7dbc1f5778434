//! Process models: how blocks move.

use crate::model::error::ComposeError;
use crate::model::motion::Motion;
use crate::model::record::Level;
use crate::model::sensor::Sensor;
use crate::model::simulate::DrivingSensor;
use crate::state::covariance::{Covariance, Transition};
use crate::state::{Layout, State};
use crate::units::sample::Sample;
use crate::units::time::Time;

/// A piece of time over which a process model moves the state.
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a> {
    /// Its beginning: the time of the state.
    pub from: Time,
    /// Its end.
    pub to: Time,
    /// The driving sensor's sample whose interval covers this one, for a model that has such a sensor.
    pub input: Option<Input<'a>>,
}

/// A driving sample and the time it covers.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// The sample, at the end of its interval.
    pub sample: &'a Sample,
    /// The length of its interval, s: from the previous sample to this one.
    pub duration: f64,
    /// The sensor's usual interval, s: less than `duration` where samples are missing before this one.
    pub usual: f64,
}

impl Interval<'_> {
    /// Its length, s.
    pub fn duration(&self) -> f64 {
        self.to.since(self.from)
    }
}

/// How far a search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// More samples are needed.
    On,
    /// Found well enough for a trial: the filter runs through all that was seen, and nobody hears of it but
    /// [`ProcessModel::search_again`]. For a start so far off that the filter would linearise in the wrong place.
    Trial,
    /// Found.
    Found,
}

/// The filter as it is, for a process that watches it.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// The layout of the state.
    pub layout: &'a Layout,
    /// The estimate.
    pub state: &'a State,
    /// Its covariance.
    pub covariance: &'a Covariance,
    /// Since when every sample of the process's constraint was gated, and how many, if the last one was.
    pub gated: Option<(Time, u64)>,
}

/// What a process that watches wants.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    /// Its constraint holds now: the filter is corrected by it.
    pub constrain: bool,
    /// What a person should read.
    pub said: Option<(Level, String)>,
}

/// How a process found its start: for a person, and in numbers.
#[derive(Clone, Debug)]
pub struct Report {
    /// One line.
    pub text: String,
    /// The same for a program.
    pub values: serde_json::Value,
}

/// Why a process model could not go on.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
#[error("{0}")]
pub struct ProcessError(pub String);

/// Propagates the blocks that it names and fills only the blocks of `Phi` and `Q` that it touches.
///
/// The places it fills were declared when it was composed ([`crate::compose::Composer::transition`]). A row of the
/// error state of which it declares any part is replaced as a whole; all others move by their block's own dynamics.
///
/// A place on a line that moves with a speed:
/// ```
/// use navfuse_core::nalgebra::Vector1;
/// use navfuse_core::prelude::*;
///
/// #[derive(Clone)]
/// struct Cart {
///     place: Handle<Scalar>,
///     speed: Handle<Scalar>,
///     phi: [PhiSlot<1, 1>; 2],
/// }
///
/// impl Cart {
///     fn new(composer: &mut Composer, place: Handle<Scalar>, speed: Handle<Scalar>) -> Self {
///         let (p, v) = (composer.tangent(place), composer.tangent(speed));
///         let t = composer.transition();
///         Self { place, speed, phi: [t.phi(p, p), t.phi(p, v)] } // the row of the place; that of the speed is the framework's
///     }
/// }
///
/// impl ProcessModel for Cart {
///     fn propagate(
///         &mut self,
///         layout: &Layout,
///         state: &mut State,
///         interval: &Interval<'_>,
///         transition: &mut Transition,
///     ) -> Result<(), ProcessError> {
///         let dt = interval.duration();
///         let place = state.get(layout, self.place) + state.get(layout, self.speed) * dt;
///         state.set(layout, self.place, &place);
///         transition.set(self.phi[0], &Vector1::new(1.0));
///         transition.set(self.phi[1], &Vector1::new(dt));
///         Ok(())
///     }
///     fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
///         state.set(layout, self.speed, &motion.velocity.x);
///         known[self.speed.slot()] = true;
///     }
///     fn boxed_clone(&self) -> Box<dyn ProcessModel> {
///         Box::new(self.clone())
///     }
/// }
/// ```
pub trait ProcessModel: Send {
    /// Moves the state over the interval and fills `Phi` and `Q`.
    ///
    /// # Errors
    /// When the state or the input is outside what the model can compute with.
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError>;

    /// Sees a driving sample before the filter has started: a model may publish its signals.
    fn prepare(&mut self, _layout: &Layout, _state: &mut State, _input: &Input<'_>) {}

    /// Called once, when every sensor is composed: where a model finds those that it names.
    ///
    /// # Errors
    /// When one that it needs is not there, or is of no use to it.
    fn connect(&mut self, _sensors: &[Sensor]) -> Result<(), ComposeError> {
        Ok(())
    }

    /// Whether it finds the initial values of its blocks itself, from samples. Such a process is driven.
    fn searches(&self) -> bool {
        false
    }

    /// Sees the next sample, of any sensor, while it searches. When it has found, its blocks in `state` are as they were at the
    /// state's time, where the search began, with the prior sigma that they were composed with. The filter starts there,
    /// and takes all that was seen, as if it came only now: so the prior must be wide enough to tell nothing, since the same
    /// samples are used again.
    ///
    /// # Errors
    /// When the samples do not allow it: what is wrong, and what to do.
    fn search(
        &mut self,
        _layout: &Layout,
        _state: &mut State,
        _sample: &Sample,
    ) -> Result<Search, ProcessError> {
        Ok(Search::Found)
    }

    /// After a trial: searches once more in what it has seen, with what the trial found out about the blocks that no process
    /// moves already in `state`.
    ///
    /// # Errors
    /// As [`Self::search`].
    fn search_again(
        &mut self,
        _layout: &Layout,
        _state: &mut State,
    ) -> Result<Search, ProcessError> {
        Ok(Search::Found)
    }

    /// Looks at the filter after every driving sample. It may say that its constraint holds now
    /// ([`crate::compose::Composer::constraint`]), and tell what a person should know.
    ///
    /// # Errors
    /// When the run is of no use from here on.
    fn watch(&mut self, _now: &Moment<'_>) -> Result<Watch, ProcessError> {
        Ok(Watch::default())
    }

    /// What is not finished when there are no more samples; an error, if the result is of no use without it.
    fn unfinished(&self, _now: &Moment<'_>) -> Option<(Level, String)> {
        None
    }

    /// How it found its start.
    fn report(&self) -> Option<Report> {
        None
    }

    /// Called when the state was set or corrected from outside, with what remains of the model's own memory invalid.
    fn restart(&mut self) {}

    /// Sets the blocks and signals that this model moves to what they are on a known motion, and says which.
    ///
    /// This is how a simulation, or a recorded reference, becomes the truth of the estimated state.
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]);

    /// The model's memory beside the state, to continue from a snapshot.
    fn boxed_clone(&self) -> Box<dyn ProcessModel>;
}

/// A process model and what it runs on.
pub struct BuiltProcess {
    /// The model.
    pub model: Box<dyn ProcessModel>,
    /// The sensor that drives it, if any.
    pub input: Option<DrivingSensor>,
}
