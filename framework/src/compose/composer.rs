//! The composer, with which process and sensor types build their models.

use crate::compose::bodies::Bodies;
use crate::model::error::ComposeError;
use crate::model::process::{BuiltProcess, Step, Stepping};
use crate::model::sensor::Role;
use crate::model::sensor::detector::Detector;
use crate::model::sensor::mounting::Mounting;
use crate::model::sensor::{Purpose, SensorInfo};
use crate::state::covariance::{InputSlot, Transition};
use crate::state::layout::Turning;
use crate::state::manifold::{Manifold, Operations, Rotation, Vector};
use crate::state::{
    AnyHandle, Block, BlockSpec, Dynamics, Handle, Layout, Mode, Past, Signal, Vehicle,
};
use crate::units::sample::Channel;
use std::any::Any;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// Knowledge without a sensor: its channels, and the model that relates them to the state.
type Constraint = (SensorInfo, Role);

/// Collects the blocks, signals and transition of a composition.
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
    detector: Option<Box<dyn Detector>>,
    clones: Vec<[usize; 2]>,
    /// Places of the effect of driving sensors: the sensor, and the number of the place.
    input_places: Vec<(String, usize)>,
    mounting: Option<Mounting>,
    pub(super) bodies: Bodies,
    folder: PathBuf,
}

impl Composer {
    /// A composer for a scenario in a folder.
    pub(crate) fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), ..Self::default() }
    }

    pub(crate) fn begin(&mut self, owner: &str) {
        owner.clone_into(&mut self.owner);
    }

    pub(crate) fn add_input(&mut self, name: &str, config: Box<dyn Any + Send>) {
        self.inputs.push((name.to_owned(), config));
    }

    pub(crate) fn take_inputs(&mut self) -> Vec<(String, Box<dyn Any + Send>)> {
        std::mem::take(&mut self.inputs)
    }

    pub(crate) fn take_notes(&mut self) -> Vec<(String, String)> {
        std::mem::take(&mut self.notes)
    }

    pub(crate) fn take_input_places(&mut self) -> Vec<(String, usize)> {
        std::mem::take(&mut self.input_places)
    }

    pub(crate) fn take_constraints(&mut self) -> Vec<(String, Constraint)> {
        std::mem::take(&mut self.constraints)
    }

    pub(crate) fn take_detector(&mut self) -> Option<Box<dyn Detector>> {
        self.detector.take()
    }

    pub(crate) fn finish(self) -> (Layout, Transition, Vec<String>) {
        (self.layout, self.transition, self.needs_reference)
    }

    /// Declares that the initial value under this key is missing, so that a reference must give it.
    pub fn needs_reference(&mut self, key: &str) {
        self.needs_reference.push(format!("{}.{key}", self.owner));
    }

    /// Adds a note for the user that is no error: `navfuse check` prints it, and every run logs it.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push((self.owner.clone(), text.into()));
    }

    /// Name of the part that is being composed: its table in the scenario.
    pub fn owner(&self) -> &str {
        &self.owner
    }

    /// Adds a state block `owner.name`.
    ///
    /// # Errors
    /// When the name is taken or the number of components is not the manifold's.
    pub fn block<M: Manifold>(
        &mut self,
        name: &str,
        spec: BlockSpec,
    ) -> Result<Handle<M>, ComposeError> {
        let full = format!("{}.{name}", self.owner);
        if self.layout.find(&full).is_some() {
            return Err(ComposeError::new(name, format!("the state {full} exists already")));
        }
        let slot = self.layout.blocks.len();
        let given = [Some(&spec.initial), Some(&spec.sigma), spec.truth.as_ref()];
        if let Some(wrong) = given.into_iter().flatten().find(|v| v.len() != M::TANGENT) {
            let message =
                format!("{} components are needed, {} are given", M::TANGENT, wrong.len());
            return Err(ComposeError::new(name, message));
        }
        let operations = Operations::of::<M>();
        let tangent = (spec.mode != Mode::Fixed).then_some(self.layout.tangent);
        self.layout.tangent += tangent.map_or(0, |_| operations.tangent);
        let offset = self.layout.ambient;
        self.layout.ambient += operations.ambient;
        self.layout.blocks.push(Block {
            name: full,
            spec,
            operations,
            offset,
            tangent,
            wanders: false,
            label: None,
        });
        Ok(Handle { slot, manifold: PhantomData })
    }

    /// Adds the past of a block: a clone of its value and its covariance, taken at every sample of
    /// the sensor that is being composed, or at those that `MeasurementModel::keyframe` names,
    /// after the update. The model reads it with [`View::then`]: the value at the previous sample,
    /// such as the pose from which visual odometry measures. The first sample, and the first one
    /// after a sample that the filter rejects unseen, updates nothing. A simulation takes the same
    /// clone of the truth.
    ///
    /// The past of a velocity that turns with the heading needs the past of its attitude, composed
    /// before it.
    ///
    /// [`View::then`]: crate::state::View::then
    ///
    /// # Errors
    /// When the sensor has this past already, or lacks that of the attitude.
    pub fn past<M: Manifold>(&mut self, of: Handle<M>) -> Result<Past<M>, ComposeError> {
        let source = &self.layout.blocks[of.slot];
        let name = format!("past_{}", source.name.rsplit('.').next().unwrap_or(&source.name));
        let full = source.name.clone();
        let spec = BlockSpec { truth: None, dynamics: Dynamics::Constant, ..source.spec.clone() };
        let turning = self.layout.turning.iter().find(|t| t.velocity == of.slot);
        let attitude = turning.map(|t| {
            let clone = self.clones.iter().find(|[from, _]| *from == t.attitude);
            clone.map(|[_, past]| *past).ok_or_else(|| {
                let attitude = &self.layout.blocks[t.attitude].name;
                let message = format!("the past of {full} needs the past of {attitude} before it");
                ComposeError::new(&name, message)
            })
        });
        let attitude = attitude.transpose()?;
        let past = self.block::<M>(&name, spec)?;
        if let Some(attitude) = attitude {
            self.layout.turning.push(Turning { velocity: past.slot, attitude });
        }
        self.layout.clones.push([of.slot, past.slot]);
        self.clones.push([of.slot, past.slot]);
        Ok(Past(past))
    }

    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }

    pub(super) fn layout_mut(&mut self) -> &mut Layout {
        &mut self.layout
    }

    /// Clones of the sensor that is being composed.
    pub(crate) fn take_clones(&mut self) -> Vec<[usize; 2]> {
        std::mem::take(&mut self.clones)
    }

    /// States the place, the axes and the beams of the sensor that is being composed, with which
    /// logs and viewers draw it. Default: at the origin of the body, with its axes.
    pub fn mounted(&mut self, mounting: Mounting) {
        self.mounting = Some(mounting);
    }

    pub(crate) fn take_mounting(&mut self) -> Mounting {
        self.mounting.take().unwrap_or_default()
    }

    fn slot_of(&self, key: &str, full: &str) -> Result<usize, ComposeError> {
        self.layout.blocks.iter().position(|b| b.name == full).ok_or_else(|| {
            let names: Vec<&str> = self.names().collect();
            // a state of that name which another part has: the key names the wrong part
            let own = |name: &&str| {
                full.split_once('.').map(|f| f.1) == name.split_once('.').map(|n| n.1)
            };
            let near = crate::document::did_you_mean(full, names.iter().copied());
            let near = near.or_else(|| names.iter().copied().find(own));
            let hint = near.map_or_else(String::new, |n| format!("; did you mean {n}?"));
            let all = names.join(", ");
            ComposeError::new(key, format!("there is no state {full}{hint} (states so far: {all})"))
        })
    }

    /// Finds the block of that full name, such as `ins.velocity`; `key` is the parameter that names
    /// its owner.
    ///
    /// # Errors
    /// When there is no such block, or it lives on another manifold.
    pub fn find<M: Manifold>(&self, key: &str, full: &str) -> Result<Handle<M>, ComposeError> {
        let slot = self.slot_of(key, full)?;
        if self.layout.blocks[slot].operations.kind != std::any::TypeId::of::<M>() {
            return Err(ComposeError::new(
                key,
                format!("the state {full} is of another kind than is needed"),
            ));
        }
        Ok(Handle { slot, manifold: PhantomData })
    }

    /// As [`Self::find`], for a block of any manifold.
    ///
    /// # Errors
    /// When there is no such block.
    pub fn find_any(&self, key: &str, full: &str) -> Result<AnyHandle, ComposeError> {
        let slot = self.slot_of(key, full)?;
        Ok(AnyHandle { slot, ambient: self.layout.blocks[slot].operations.ambient })
    }

    /// Full names of the states so far, such as `ins.velocity`.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.layout.blocks.iter().map(|b| b.name.as_str())
    }

    /// Declares that a velocity in north, east, down results from integration in the axes from
    /// which `attitude` maps, so that a heading error turns it along: see Barrau & Bonnabel (2017)
    /// on invariant errors.
    pub fn turns_with_heading(&mut self, velocity: Handle<Vector<3>>, attitude: Handle<Rotation>) {
        self.layout.turning.push(Turning { velocity: velocity.slot, attitude: attitude.slot });
    }

    /// Declares what blocks mean for the motion of the body that the process moves. The first
    /// process that declares it moves the vehicle: see [`Layout::vehicle`].
    pub fn moves(&mut self, vehicle: Vehicle) {
        self.layout.vehicles.push(vehicle);
    }

    /// The full name of a block.
    pub fn name<M>(&self, block: Handle<M>) -> &str {
        &self.layout.block(block).name
    }

    /// The motion of the vehicle, as far as processes have declared it.
    pub fn vehicle(&self) -> Vehicle {
        self.layout.vehicle()
    }

    /// Adds knowledge without a sensor, such as that the vehicle is at rest: `0 = h(x) + v`, `v ~
    /// N(0, R)`. The filter applies it when the process's alignment asks for it
    /// ([`crate::model::process::start::Supervision`]), and gates, records and counts it like a sensor of
    /// that name. A process has at most one constraint.
    pub fn constraint<M, const N: usize>(&mut self, name: &str, channels: [Channel; N], model: M)
    where
        M: crate::model::sensor::measurement::MeasurementModel<N> + Sync,
    {
        let info = SensorInfo {
            name: name.to_owned(),
            kind: "constraint".to_owned(),
            channels: channels.to_vec(),
            purpose: Purpose::Measurement,
            mounting: Mounting::default(),
        };
        self.constraints.push((self.owner.clone(), (info, Role::measurement(model))));
    }

    /// Makes the sensor that is being composed a pseudo-measurement: no instrument gives its
    /// samples, and the filter applies it where the detector finds that it holds. A scenario that
    /// simulates the sensor has samples of it, with noise; the detector is not used then.
    pub fn detected_by(&mut self, detector: impl Detector + 'static) {
        self.detector = Some(Box::new(detector));
    }

    /// Adds a signal `owner.name` of `N` numbers.
    pub fn signal<const N: usize>(&mut self, name: &str) -> Signal<N> {
        let offset = self.layout.signals;
        self.layout.signals += N;
        self.signals.push((format!("{}.{name}", self.owner), offset, N));
        Signal { offset }
    }

    /// Adds the earlier value of a signal, from readings that share no noise with those of the present one.
    ///
    /// A signal with noise is in the innovation of a sensor that reads it, and in the derivative of the
    /// prediction by a parameter, such as a lever arm: each parameter would then seem to be zero. The test for wrong
    /// parameters takes the derivative with the earlier value. A signal without one has no noise that matters.
    pub fn earlier<const N: usize>(&mut self, signal: Signal<N>) -> Signal<N> {
        let offset = self.layout.signals;
        self.layout.signals += N;
        self.layout.earlier.push([signal.offset, offset, N]);
        Signal { offset }
    }

    /// Finds the signal of that full name, such as `ins.angular_rate`.
    ///
    /// # Errors
    /// When there is no such signal of `N` numbers.
    pub fn find_signal<const N: usize>(
        &self,
        key: &str,
        full: &str,
    ) -> Result<Signal<N>, ComposeError> {
        (self.signals.iter().find(|(name, _, n)| name == full && *n == N))
            .map(|(_, offset, _)| Signal { offset: *offset })
            .ok_or_else(|| {
                ComposeError::new(key, format!("there is no signal {full} of {N} numbers"))
            })
    }

    /// Configuration that the driving sensor of that name hands over; `key` is the parameter that
    /// names the sensor.
    ///
    /// # Errors
    /// When there is no driving sensor of that name, or it is of another type.
    pub fn input<C: Any>(&self, key: &str, name: &str) -> Result<&C, ComposeError> {
        let Some((_, config)) = self.inputs.iter().find(|(n, _)| n == name) else {
            let names: Vec<&str> = self.inputs.iter().map(|(n, _)| n.as_str()).collect();
            let message = format!("there is no driving sensor {name}; add a table [sensor.{name}]");
            let names = if names.is_empty() {
                String::new()
            } else {
                format!(" (there are: {})", names.join(", "))
            };
            return Err(ComposeError::new(key, message + &names));
        };
        config
            .downcast_ref()
            .ok_or_else(|| ComposeError::new(key, format!("the sensor {name} is of another type")))
    }

    /// Declares that a step changes `R` error states from `row` on by `C` channels of the driving
    /// sensor `name`, from `first_channel` on. The process fills the derivative in each step with
    /// [`Transition::set_input`]; the states of input models thus reach `Phi`.
    pub fn input_place<const R: usize, const C: usize>(
        &mut self,
        name: &str,
        row: Option<usize>,
        first_channel: usize,
    ) -> InputSlot<R, C> {
        let slot = self.transition.input(row, first_channel);
        self.input_places.extend(slot.0.map(|place| (name.to_owned(), place)));
        slot
    }

    /// First index of a block's error in the error state; `None` when fixed.
    pub fn tangent<M>(&self, block: Handle<M>) -> Option<usize> {
        self.layout.block(block).tangent
    }

    /// Number of error states so far.
    pub fn tangents(&self) -> usize {
        self.layout.tangent
    }

    /// The path of a file that a parameter names; a relative path starts at the scenario's folder.
    /// `key` is the parameter.
    ///
    /// ```
    /// # use navfuse_core::prelude::*;
    /// # use std::path::PathBuf;
    /// fn table(composer: &Composer, given: &PathBuf) -> Result<String, ComposeError> {
    ///     let path = composer.file("table", given)?;
    ///     let failed = |e| ComposeError::new("table", format!("{}: {e}", path.display()));
    ///     std::fs::read_to_string(&path).map_err(failed)
    /// }
    /// ```
    ///
    /// # Errors
    /// When there is no such file.
    pub fn file(&self, key: &str, path: impl AsRef<Path>) -> Result<PathBuf, ComposeError> {
        let path = self.folder.join(path);
        if path.exists() {
            return Ok(path);
        }
        let shown = std::path::absolute(&path).unwrap_or(path);
        Err(ComposeError::new(
            key,
            format!(
                "{}: there is no such file; a relative path starts at the scenario's folder",
                shown.display()
            ),
        ))
    }

    /// Builds a process from one function: finds the blocks that it reads and moves, and declares
    /// their places in `Phi` and `Q`. Call it once the blocks exist.
    pub fn step(&mut self, step: impl Step) -> BuiltProcess {
        BuiltProcess::new(Stepping::new(step, &self.layout, &mut self.transition))
    }

    /// Transition, in which a process model declares the places of `Phi` and `Q` that it fills.
    pub fn transition(&mut self) -> &mut Transition {
        &mut self.transition
    }
}
