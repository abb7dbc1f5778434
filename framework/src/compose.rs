//! Composing a state from parts: what a process or sensor type calls while it builds its model.

use crate::covariance::Transition;
use crate::document::{DocumentError, Node};
use crate::draw::Draw;
use crate::gate::{Action, Policy};
use crate::manifold::{Manifold, Operations, Rotation, Scalar, Vector};
use crate::measurement::AnyMeasurement;
use crate::motion::Motion;
use crate::process::ProcessModel;
use crate::sample::{Channel, MAX_CHANNELS, Sample};
use crate::scenario::Initial;
use crate::simulate::{Faults, Simulate};
use crate::state::{Block, BlockSpec, Handle, Layout, MAX_BLOCKS, Mode, Signal, State};
use crate::stream::{Purpose, SensorInfo};
use crate::time::Time;
use crate::turning::Turning;
use crate::units::Sigma;
use std::any::Any;
use std::marker::PhantomData;
use std::sync::Arc;

/// Why a part cannot be composed: the key below its table, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct ComposeError {
    key: String,
    message: String,
}

impl ComposeError {
    /// An error about a key of the part's table (empty for the table itself).
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }

    /// The error with its place in the document.
    pub(crate) fn at(&self, node: &Node<'_>) -> DocumentError {
        let mut place = node.clone();
        for key in self.key.split('.').filter(|k| !k.is_empty()) {
            match place.get(key) {
                Some(inner) => place = inner,
                None => return place.error(format!("{key}: {}", self.message)),
            }
        }
        place.error(&self.message)
    }
}

/// What a sensor is to the estimator.
pub enum Role {
    /// It drives the process model that names it.
    Input(Box<dyn Any + Send>),
    /// It corrects the state.
    Measurement(Arc<dyn AnyMeasurement + Sync>),
    /// It tells the truth.
    Reference(Arc<dyn Reference>),
}

impl Role {
    /// The role of a measurement model.
    pub fn measurement<M, const N: usize>(model: M) -> Self
    where
        M: crate::measurement::MeasurementModel<N> + Sync,
    {
        Self::Measurement(Arc::new(crate::measurement::Erased(model)))
    }
}

/// Reads the motion of the body from a reference's sample.
///
/// ```
/// use navfuse_core::{compose::Reference, nalgebra::{UnitQuaternion, Vector3}, prelude::*};
/// /// Fixes of a tracking station: position alone.
/// struct Fixes;
/// impl Reference for Fixes {
///     fn motion(&self, _: &Layout, _: &State, sample: &Sample) -> Option<Motion> {
///         let [latitude, longitude, height] = sample.array(0)?;
///         Some(Motion {
///             time: sample.time,
///             position: Geodetic { latitude, longitude, height },
///             velocity: Vector3::zeros(),
///             c_b_n: UnitQuaternion::identity(),
///             w_ib_b: Vector3::zeros(),
///             f_ib_b: Vector3::zeros(),
///         })
///     }
///     fn sample(&self, motion: &Motion, sample: &mut Sample) {
///         let p = motion.position;
///         [p.latitude, p.longitude, p.height].into_iter().enumerate().for_each(|(k, x)| sample.set(k, x));
///     }
/// }
/// ```
pub trait Reference: Send + Sync {
    /// The motion of the body's origin; the state's signals may be used. `None` if channels are missing.
    fn motion(&self, layout: &Layout, state: &State, sample: &Sample) -> Option<Motion>;
    /// The reverse: the sample that a reference would give on a known motion.
    fn sample(&self, motion: &Motion, sample: &mut Sample);
}

/// A process model and what it runs on.
pub struct BuiltProcess {
    /// The model.
    pub model: Box<dyn ProcessModel>,
    /// The sensor that drives it, if any.
    pub input: Option<DrivingSensor>,
}

/// The sensor that drives a process model.
pub struct DrivingSensor {
    /// Its name in the scenario.
    pub name: String,
    /// How it is simulated.
    pub simulator: Box<dyn Simulate>,
}

/// A sensor in its place.
pub struct Sensor {
    /// Name, type and channels.
    pub info: SensorInfo,
    /// What it is to the estimator.
    pub role: Role,
    /// Gate, recovery and time-out.
    pub policy: Policy,
    /// What goes wrong with it in a simulation, and how often it speaks; `None` if it is not simulated.
    pub simulation: Option<Faults>,
    /// How a driving sensor is simulated; a measuring one is by its model.
    pub simulator: Option<Box<dyn Simulate>>,
    /// Its noise, as the filter takes it, as a multiple of the model's.
    pub noise: f64,
    /// By how much its samples lag, if they do: a sample stamped t tells of the state at t minus this.
    pub time_offset: Option<Handle<Scalar>>,
    /// Whether it is a constraint of a process, which no source gives.
    pub constraint: bool,
}

impl Sensor {
    /// A sensor without policy or simulation.
    pub(crate) fn new(info: SensorInfo, role: Role) -> Self {
        Self {
            info,
            role,
            policy: Policy::default(),
            simulation: None,
            simulator: None,
            noise: 1.0,
            time_offset: None,
            constraint: false,
        }
    }

    /// What a process knows: where it does not hold any more, the process must hear of it, so nothing is inflated.
    pub(crate) fn constraint(info: SensorInfo, role: Role) -> Self {
        let mut sensor = Self { constraint: true, ..Self::new(info, role) };
        sensor.policy.recovery.action = Action::Report;
        sensor
    }
}

/// A process model in its place.
pub struct Process {
    /// Its name in the scenario.
    pub name: String,
    /// Its registered type.
    pub kind: String,
    /// The model.
    pub model: Box<dyn ProcessModel>,
    /// The index of the sensor that drives it.
    pub input: Option<usize>,
    /// The index of its constraint among the sensors.
    pub constraint: Option<usize>,
    /// Whether it finds its initial values itself.
    pub searches: bool,
}

/// Something known without a sensor: its channels, and the model that says what of the state they are.
type Constraint = (SensorInfo, Role);

/// Collects the blocks, signals and the transition of a composition.
#[derive(Default)]
pub struct Composer {
    layout: Layout,
    transition: Transition,
    owner: String,
    signals: Vec<(String, usize, usize)>,
    inputs: Vec<(String, Box<dyn Any + Send>)>,
    needs_reference: Vec<String>,
    notes: Vec<(String, String)>,
    constraints: Vec<(String, Constraint)>,
}

impl Composer {
    pub(crate) fn begin(&mut self, owner: &str) {
        owner.clone_into(&mut self.owner);
    }

    pub(crate) fn add_input(&mut self, name: &str, config: Box<dyn Any + Send>) {
        self.inputs.push((name.to_owned(), config));
    }

    pub(crate) fn take_notes(&mut self) -> Vec<(String, String)> {
        std::mem::take(&mut self.notes)
    }

    pub(crate) fn take_constraints(&mut self) -> Vec<(String, Constraint)> {
        std::mem::take(&mut self.constraints)
    }

    pub(crate) fn finish(self) -> (Layout, Transition, Vec<String>) {
        (self.layout, self.transition, self.needs_reference)
    }

    /// Says that the part's key is not given, so that a reference must say where it starts.
    pub fn needs_reference(&mut self, key: &str) {
        self.needs_reference.push(format!("{}.{key}", self.owner));
    }

    /// Says something that a person should know of the part, and that is no mistake: `navfuse check` prints it, and every
    /// run has it in its log.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push((self.owner.clone(), text.into()));
    }

    /// The name of the part that is being composed: its table in the scenario.
    pub fn owner(&self) -> &str {
        &self.owner
    }

    /// Adds a state block `owner.name`.
    ///
    /// # Errors
    /// When the name is taken or the number of components is not the manifold's.
    pub fn block<M: Manifold>(&mut self, name: &str, spec: BlockSpec) -> Result<Handle<M>, ComposeError> {
        let full = format!("{}.{name}", self.owner);
        if self.layout.find(&full).is_some() {
            return Err(ComposeError::new(name, format!("the state {full} is there already")));
        }
        let slot = self.layout.blocks.len();
        if slot == MAX_BLOCKS {
            return Err(ComposeError::new(
                name,
                format!(
                    "more than {MAX_BLOCKS} state blocks: a sensor with calibration keys takes 2 to 4, fixed ones too; remove \
                 or disable some"
                ),
            ));
        }
        let given = [Some(&spec.initial), Some(&spec.sigma), spec.truth.as_ref()];
        if let Some(wrong) = given.into_iter().flatten().find(|v| v.len() != M::TANGENT) {
            let message = format!("{} components are needed, {} are given", M::TANGENT, wrong.len());
            return Err(ComposeError::new(name, message));
        }
        let operations = Operations::of::<M>();
        let tangent = (spec.mode != Mode::Fixed).then_some(self.layout.tangent);
        self.layout.tangent += tangent.map_or(0, |_| operations.tangent);
        let offset = self.layout.ambient;
        self.layout.ambient += operations.ambient;
        self.layout.blocks.push(Block { name: full, spec, operations, offset, tangent, wanders: false });
        Ok(Handle { slot, manifold: PhantomData })
    }

    /// The block of that full name, such as `ins.velocity`; `key` is the parameter that named its owner.
    ///
    /// # Errors
    /// When there is no such block, or it lives on another manifold.
    pub fn find<M: Manifold>(&self, key: &str, full: &str) -> Result<Handle<M>, ComposeError> {
        let Some(slot) = self.layout.blocks.iter().position(|b| b.name == full) else {
            let names: Vec<&str> = self.layout.blocks.iter().map(|b| b.name.as_str()).collect();
            let hint = crate::document::did_you_mean(full, names.iter().copied())
                .map_or_else(String::new, |n| format!("did you mean {n}? "));
            return Err(ComposeError::new(
                key,
                format!("there is no state {full}; {hint}(states so far: {})", names.join(", ")),
            ));
        };
        if self.layout.blocks[slot].operations.kind != std::any::TypeId::of::<M>() {
            return Err(ComposeError::new(key, format!("the state {full} is of another kind than is needed")));
        }
        Ok(Handle { slot, manifold: PhantomData })
    }

    /// The full names of the states so far, such as `ins.velocity`.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layout.blocks.iter().map(|b| b.name.as_str())
    }

    /// Says that a velocity in north, east, down was found by integrating in the axes from which `attitude` maps, so that an
    /// error of the heading turns it along: see Barrau & Bonnabel (2017) on invariant errors.
    pub fn turns_with_heading(&mut self, velocity: Handle<Vector<3>>, attitude: Handle<Rotation>) {
        self.layout.turning.push(Turning { velocity: velocity.slot, attitude: attitude.slot });
    }

    /// Adds something that is known without a sensor, such as that the vehicle is at rest: `0 = h(x) + v`, `v ~ N(0, R)`. The
    /// filter is corrected by it when the process says so ([`crate::process::Watch`]); it is gated, recorded and counted as a
    /// sensor of that name is. A process has one at most.
    pub fn constraint<M, const N: usize>(&mut self, name: &str, channels: [Channel; N], model: M)
    where
        M: crate::measurement::MeasurementModel<N> + Sync,
    {
        let info = SensorInfo {
            name: name.to_owned(),
            kind: "constraint".to_owned(),
            channels: channels.to_vec(),
            purpose: Purpose::Measurement,
        };
        self.constraints.push((self.owner.clone(), (info, Role::measurement(model))));
    }

    /// Adds a signal `owner.name` of `N` numbers.
    pub fn signal<const N: usize>(&mut self, name: &str) -> Signal<N> {
        let offset = self.layout.signals;
        self.layout.signals += N;
        self.signals.push((format!("{}.{name}", self.owner), offset, N));
        Signal { offset }
    }

    /// The signal of that full name, such as `ins.angular_rate`.
    ///
    /// # Errors
    /// When there is no such signal of `N` numbers.
    pub fn find_signal<const N: usize>(&self, key: &str, full: &str) -> Result<Signal<N>, ComposeError> {
        (self.signals.iter().find(|(name, _, n)| name == full && *n == N))
            .map(|(_, offset, _)| Signal { offset: *offset })
            .ok_or_else(|| ComposeError::new(key, format!("there is no signal {full} of {N} numbers")))
    }

    /// What the driving sensor of that name told of itself; `key` is the parameter that named it.
    ///
    /// # Errors
    /// When there is no driving sensor of that name, or it is of another type.
    pub fn input<C: Any>(&self, key: &str, name: &str) -> Result<&C, ComposeError> {
        let Some((_, config)) = self.inputs.iter().find(|(n, _)| n == name) else {
            let names: Vec<&str> = self.inputs.iter().map(|(n, _)| n.as_str()).collect();
            let message = format!("there is no driving sensor {name}; add a table [sensor.{name}]");
            let names = if names.is_empty() { String::new() } else { format!(" (there are: {})", names.join(", ")) };
            return Err(ComposeError::new(key, message + &names));
        };
        config.downcast_ref().ok_or_else(|| ComposeError::new(key, format!("the sensor {name} is of another type")))
    }

    /// The first index of a block's error in the error state; `None` when fixed.
    pub fn tangent<M>(&self, block: Handle<M>) -> Option<usize> {
        self.layout.block(block).tangent
    }

    /// Where a process model declares the places of `Phi` and `Q` that it fills.
    pub fn transition(&mut self) -> &mut Transition {
        &mut self.transition
    }
}

/// A scenario composed: everything that an estimator needs, with every name resolved.
pub struct Composition {
    /// Name of the scenario.
    pub name: String,
    /// The scenario in TOML with every override in place.
    pub text: String,
    /// The blocks.
    pub layout: Arc<Layout>,
    /// The pattern of the transition.
    pub transition: Transition,
    /// The process models.
    pub processes: Vec<Process>,
    /// The sensors, in the order of their ids.
    pub sensors: Vec<Sensor>,
    /// When and from what the filter starts.
    pub estimator: crate::scenario::EstimatorConfig,
    /// Seed of every random number.
    pub seed: u64,
    /// What the parts said of themselves: the part and the text.
    pub notes: Vec<(String, String)>,
}

/// Which blocks the processes move, one a slot.
pub(crate) fn moved(layout: &Layout, processes: &[Process]) -> Vec<bool> {
    let (mut state, mut moved) = (layout.initial_state(), vec![false; layout.blocks.len()]);
    processes.iter().for_each(|p| p.model.follow(layout, &Motion::at_rest(), &mut state, &mut moved));
    moved
}

impl std::fmt::Debug for Composition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Composition").field("name", &self.name).field("layout", &self.layout).finish_non_exhaustive()
    }
}

impl Composition {
    /// The index of the sensor of that name.
    pub fn sensor(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|s| s.info.name == name)
    }

    /// Which blocks' truth a run can know, one a slot: what the scenario states or draws, and what processes take from a
    /// reference.
    pub fn known(&self) -> Vec<bool> {
        let told = self.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)));
        let moved = moved(&self.layout, &self.processes);
        let stated = self.layout.blocks.iter().map(|b| b.spec.truth.is_some());
        stated.zip(moved).map(|(stated, moved)| stated || (told && moved)).collect()
    }

    /// Makes it what the Cramer-Rao bound runs on: every block starts at its truth, sensors are simulated without noise and
    /// outliers, while the filter takes the noise that they would have, so that it stays at the truth and its covariance is
    /// that of the best estimate. Considered states are estimated.
    pub fn at_truth(&mut self) {
        let mut layout = (*self.layout).clone();
        for block in &mut layout.blocks {
            if let Some(truth) = &block.spec.truth {
                block.spec.initial.clone_from(truth);
            }
            block.wanders = false;
            if block.spec.mode == Mode::Consider {
                block.spec.mode = Mode::Estimate;
            }
        }
        self.layout = Arc::new(layout);
        self.estimator.draw = Draw::Nothing;
        self.processes.iter_mut().for_each(|p| p.searches = false);
        if self.sensors.iter().any(|s| matches!(s.role, Role::Reference(_))) {
            self.estimator.initial = Some(Initial::Reference);
        }
        for (index, sensor) in self.sensors.iter_mut().enumerate() {
            let Some(faults) = &mut sensor.simulation else { continue };
            if sensor.info.purpose == Purpose::Reference {
                continue; // it has no noise
            }
            sensor.noise = faults.noise.value().si();
            faults.noise = Sigma::from_si(0.0);
            faults.outliers = Sigma::from_si(0.0);
            if self.processes.iter().any(|p| p.input == Some(index)) {
                self.transition.scale_noise(sensor.noise);
            }
        }
    }

    /// Checks that a sensor's channels fit a sample and its model.
    pub(crate) fn check_channels(info: &SensorInfo, role: &Role) -> Result<(), String> {
        let count = info.channels.len();
        match role {
            _ if count > MAX_CHANNELS => Err(format!("{count} channels; at most {MAX_CHANNELS} fit a sample")),
            Role::Measurement(model) if model.channels() > count => {
                Err(format!("{count} channels are declared, the model predicts {}", model.channels()))
            }
            _ => Ok(()),
        }
    }

    /// The start of the filter.
    pub fn start(&self) -> Time {
        self.estimator.start()
    }
}
