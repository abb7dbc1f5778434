//! Process models, which propagate blocks.

use crate::checkpoint::{Io, Saved};
use crate::model::process::ProcessError;
use crate::model::process::input::{AnyInput, ErasedInput, InputModel};
use crate::model::process::monitor::Monitor;
use crate::model::process::product::Product;
use crate::model::process::screening::{Screening, Spread};
use crate::model::process::second_order::SecondOrder;
use crate::model::process::start::InitialAlignment;
use crate::model::sensor::motion::Motion;
use crate::model::simulate::{DrivingSensor, Random, Simulate};
use crate::state::covariance::Transition;
use crate::state::manifold::Manifold;
use crate::state::{Handle, Layout, State};
use crate::units::sample::Sample;
use crate::units::time::Time;

/// A time interval over which a process model propagates the state.
#[derive(Clone, Copy, Debug)]
pub struct Interval<'a> {
    /// Beginning of the interval: the time of the state.
    pub from: Time,
    /// End of the interval.
    pub to: Time,
    /// Driving sample whose interval covers this one, for a process with a driving sensor; `None`
    /// while the process coasts. The process of a second driving sensor sees the last sample of
    /// that sensor, which holds from its time on, and `None` before the first.
    pub input: Option<Input<'a>>,
}

/// A driving sample and its interval.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Sample, at the end of its interval.
    pub sample: &'a Sample,
    /// Length of its interval, s: from the previous sample to this one.
    pub duration: f64,
    /// Usual interval of the sensor, s: less than `duration` where samples are missing before this
    /// one.
    pub usual: f64,
    /// Uncertainty of the sample beyond the noise of the sensor, 1-sigma of each channel over the
    /// whole interval, where the filter replaced a faulty sample.
    pub spread: Option<&'a Spread>,
}

impl Interval<'_> {
    /// Length of the interval, s.
    pub fn duration(&self) -> f64 {
        self.to.since(self.from)
    }
}

/// Propagates its blocks, and fills the blocks of `Phi` and `Q` that it declares.
///
/// A model declares its places in `Phi` and `Q` when it is composed
/// ([`crate::compose::Composer::transition`]). A declared place replaces its whole row of the error
/// state; all other rows follow the dynamics of their own block.
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
///         // the row of the place; the row of the speed follows the block's own dynamics
///         Self { place, speed, phi: [t.phi(p, p), t.phi(p, v)] }
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
    /// Propagates the state over the interval and fills `Phi` and `Q`.
    ///
    /// # Errors
    /// When state or input is outside the range of the model.
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError>;

    /// Takes a driving sample before the start of the filter: a model may publish its signals.
    fn prepare(&mut self, _layout: &Layout, _state: &mut State, _input: &Input<'_>) {}

    /// Discards the model's memory, after the state was set or corrected from outside.
    fn restart(&mut self) {}

    /// Sets the blocks and signals that this model propagates to their values on a known motion,
    /// and marks these blocks as known.
    ///
    /// This is how a simulation, or a recorded reference, becomes the truth of the estimated state.
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]);

    /// Moves the truth of the blocks that no trajectory gives over `dt` seconds, with the noise
    /// that [`Self::propagate`] assumes, and marks these blocks as known: the clock of a receiver,
    /// a current, a vehicle with dynamics of its own. The truth wanders where `estimator.draw` is
    /// "all". A block that a process moves, and whose truth neither a trajectory nor this function
    /// moves, has no truth: nobody judges its estimate.
    fn wander(
        &mut self,
        _layout: &Layout,
        _truth: &mut State,
        _known: &mut [bool],
        _dt: f64,
        _random: &mut Random,
    ) {
    }

    /// Saves or restores what the process remembers between its calls.
    /// Default: it remembers nothing.
    fn memory(&mut self, _io: &mut Io<'_>) {}

    /// Copies the model with its memory for a snapshot of the filter.
    fn boxed_clone(&self) -> Box<dyn ProcessModel>;
}

impl Saved for dyn ProcessModel {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.part("process", |io| self.memory(io));
    }
}

/// A process model that propagates nothing: its blocks follow their own dynamics, such as a random
/// walk or a Gauss-Markov process.
#[derive(Clone, Copy, Debug)]
pub struct OwnDynamics;

impl ProcessModel for OwnDynamics {
    fn propagate(
        &mut self,
        _: &Layout,
        _: &mut State,
        _: &Interval<'_>,
        _: &mut Transition,
    ) -> Result<(), ProcessError> {
        Ok(())
    }

    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(*self)
    }
}

/// A process model with its driving sensor and its initial alignment.
pub struct BuiltProcess {
    pub(crate) model: Box<dyn ProcessModel>,
    pub(crate) input: Option<DrivingSensor>,
    pub(crate) alignment: Option<Box<dyn InitialAlignment>>,
    pub(crate) screening: Option<Screening>,
    pub(crate) monitor: Option<Box<dyn Monitor>>,
    pub(crate) coasts_after: Option<f64>,
    pub(crate) biases: Vec<usize>,
    pub(crate) corrections: Vec<(String, Box<dyn AnyInput>)>,
    pub(crate) product: Option<Product>,
    pub(crate) second_order: Vec<SecondOrder>,
    pub(crate) sensor_wanders: bool,
}

impl BuiltProcess {
    /// A process model without a driving sensor.
    pub fn new(model: impl ProcessModel + 'static) -> Self {
        Self {
            model: Box::new(model),
            input: None,
            alignment: None,
            screening: None,
            monitor: None,
            coasts_after: None,
            biases: Vec::new(),
            corrections: Vec::new(),
            product: None,
            second_order: Vec::new(),
            sensor_wanders: false,
        }
    }

    /// Names the sensor that drives the process, and its simulator.
    #[must_use]
    pub fn driven_by(self, name: impl Into<String>, simulator: impl Simulate + 'static) -> Self {
        let input = DrivingSensor { name: name.into(), simulator: Box::new(simulator) };
        Self { input: Some(input), ..self }
    }

    /// Declares that the simulator of the driving sensor reads the truth of the states, and no
    /// trajectory: this truth may then move by [`ProcessModel::wander`], by the key `wander`.
    #[must_use]
    pub fn wanders_with_its_sensor(self) -> Self {
        Self { sensor_wanders: true, ..self }
    }

    /// Hands over an input model, which corrects the samples of the driving sensor `name` with
    /// states of this part: its scale factor, misalignment or other errors.
    #[must_use]
    pub fn correcting<M, const N: usize>(mut self, name: impl Into<String>, model: M) -> Self
    where
        M: InputModel<N>,
    {
        self.corrections.push((name.into(), Box::new(ErasedInput(model))));
        self
    }

    /// Hands over the alignment that finds the initial values of the process's blocks.
    #[must_use]
    pub fn aligned_by(self, alignment: impl InitialAlignment + 'static) -> Self {
        Self { alignment: Some(Box::new(alignment)), ..self }
    }

    /// Hands over the monitor that notices faults of the driving sensor.
    #[must_use]
    pub fn watched_by(self, monitor: impl Monitor + 'static) -> Self {
        Self { monitor: Some(Box::new(monitor)), ..self }
    }

    /// Names a block as a bias of the driving sensor. Where the filter takes it as constant, it tests
    /// whether the bias steps, and widens the covariance by such a step. Where the blocks of all biases have as
    /// many components as the sensor has channels, in their order, it also tests scale factors and axes.
    #[must_use]
    pub fn with_bias<T: Manifold>(mut self, bias: Handle<T>) -> Self {
        self.biases.push(bias.slot());
        self
    }

    /// States the product of two errors that the linear model neglects. While it matters, the filter
    /// linearises the samples since its start again, at their smoothed trajectory.
    #[must_use]
    pub fn neglecting(self, product: Option<Product>) -> Self {
        Self { product, ..self }
    }

    /// States terms of the second order that the linear model neglects: the filter knows the states that they act
    /// along no better than these terms allow.
    #[must_use]
    pub fn curved_by(self, terms: impl IntoIterator<Item = SecondOrder>) -> Self {
        Self { second_order: terms.into_iter().collect(), ..self }
    }

    /// Declares that the process coasts on a gap of its driving sensor longer than `gap` seconds:
    /// the filter then propagates it without an input. Without this, the model decides whether to
    /// bridge a gap or to end the run.
    #[must_use]
    pub fn coasts_after(self, gap: f64) -> Self {
        Self { coasts_after: Some(gap), ..self }
    }

    /// Hands over the limits by which the filter screens the driving sensor.
    #[must_use]
    pub fn screened_by(self, screening: Screening) -> Self {
        Self { screening: Some(screening), ..self }
    }
}

impl Clone for Box<dyn ProcessModel> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}
