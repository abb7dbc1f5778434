//! Process models: how blocks move.

use crate::model::motion::Motion;
use crate::model::simulate::{DrivingSensor, Simulate};
use crate::model::start::InitialAlignment;
use crate::state::covariance::Transition;
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

    /// Called when the state was set or corrected from outside, with what remains of the model's own memory invalid.
    fn restart(&mut self) {}

    /// Sets the blocks and signals that this model moves to what they are on a known motion, and says which.
    ///
    /// This is how a simulation, or a recorded reference, becomes the truth of the estimated state.
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]);

    /// The model's memory beside the state, to continue from a snapshot.
    fn boxed_clone(&self) -> Box<dyn ProcessModel>;
}

/// A process model with its driving sensor and its initial alignment.
pub struct BuiltProcess {
    pub(crate) model: Box<dyn ProcessModel>,
    pub(crate) input: Option<DrivingSensor>,
    pub(crate) alignment: Option<Box<dyn InitialAlignment>>,
}

impl BuiltProcess {
    /// A process model without a driving sensor.
    pub fn new(model: impl ProcessModel + 'static) -> Self {
        Self { model: Box::new(model), input: None, alignment: None }
    }

    /// Names the sensor that drives the process, and its simulator.
    #[must_use]
    pub fn driven_by(self, name: impl Into<String>, simulator: impl Simulate + 'static) -> Self {
        let input = DrivingSensor { name: name.into(), simulator: Box::new(simulator) };
        Self { input: Some(input), ..self }
    }

    /// Hands over the alignment that finds the initial values of the process's blocks.
    #[must_use]
    pub fn aligned_by(self, alignment: impl InitialAlignment + 'static) -> Self {
        Self { alignment: Some(Box::new(alignment)), ..self }
    }
}

impl Clone for Box<dyn ProcessModel> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}
