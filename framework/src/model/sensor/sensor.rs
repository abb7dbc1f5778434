//! Sensors and their roles in the estimator.

use crate::model::process::input::Correction;
use crate::model::sensor::body::Ride;
use crate::model::sensor::conversion::Converter;
use crate::model::sensor::delivery::Delay;
use crate::model::sensor::detector::Detector;
use crate::model::sensor::dynamic::{Dynamic, DynamicModel};
use crate::model::sensor::gate::{Action, Gate, Recovery};
use crate::model::sensor::limits::Limit;
use crate::model::sensor::measurement::AnyMeasurement;
use crate::model::sensor::motion::Motion;
use crate::model::sensor::mounting::Mounting;
use crate::model::sensor::robust::Robust;
use crate::model::sensor::rule::UpdateRule;
use crate::model::simulate::{Faults, Simulate};
use crate::state::manifold::Scalar;
use crate::state::{Handle, Layout, State};
use crate::units::sample::{Channel, MAX_CHANNELS, Sample, channels};
use crate::units::time::{Span, Time};
use std::any::Any;
use std::sync::Arc;

/// Description of a sensor for sinks.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorInfo {
    /// Name in the scenario.
    pub name: String,
    /// Registered type.
    pub kind: String,
    /// Channels.
    pub channels: Vec<Channel>,
    /// Purpose.
    pub purpose: Purpose,
    /// Place, axes and beams on the vehicle.
    pub mounting: Mounting,
}

impl SensorInfo {
    /// The name of the channel of that index.
    pub fn channel(&self, index: usize) -> &str {
        self.channels.get(index).map_or("?", |channel| &channel.name)
    }

    /// The words for the channel of that index, for a message: `velocity east`.
    pub fn words(&self, index: usize) -> String {
        self.channels.get(index).map_or_else(|| "a channel".to_owned(), Channel::words)
    }

    /// The index of the channel of that name.
    pub fn position(&self, channel: &str) -> Option<usize> {
        self.channels.iter().position(|c| &*c.name == channel)
    }
}

/// Purpose of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Drives a process model.
    Input,
    /// Corrects the state.
    Measurement,
    /// Gives the truth, for the start and for comparison.
    Reference,
}

/// Role of a sensor in the estimator.
pub enum Role {
    /// Drives the process model that names the sensor.
    Input(Box<dyn Any + Send>),
    /// Corrects the state.
    Measurement(Arc<dyn AnyMeasurement + Sync>),
    /// Gives the truth.
    Reference(Arc<dyn Reference>),
}

impl Role {
    /// Role of a measurement model.
    pub fn measurement<M, const N: usize>(model: M) -> Self
    where
        M: crate::model::sensor::measurement::MeasurementModel<N> + Sync,
    {
        Self::Measurement(Arc::new(crate::model::sensor::measurement::Erased(model)))
    }

    /// Role of a measurement model whose number of channels is known at run time only; the first
    /// `channels` of the sensor are measured.
    pub fn dynamic(channels: usize, model: impl DynamicModel) -> Self {
        Self::Measurement(Arc::new(Dynamic { channels: channels.min(MAX_CHANNELS), model }))
    }
}

/// Converts between a reference's samples and the motion of the body.
///
/// ```
/// use navfuse_core::model::sensor::Reference;
/// use navfuse_core::prelude::*;
/// /// Fixes of a tracking station: position alone.
/// struct Fixes;
/// impl Reference for Fixes {
///     fn motion(&self, _: &Layout, _: &State, sample: &Sample) -> Option<Motion> {
///         let [latitude, longitude, height] = sample.array(0)?;
///         let position = Geodetic { latitude, longitude, height };
///         Some(Motion { position, ..Motion::unknown(sample.time) })
///     }
///     fn sample(&self, motion: &Motion, sample: &mut Sample) {
///         let p = motion.position;
///         for (k, x) in [p.latitude, p.longitude, p.height].into_iter().enumerate() {
///             sample.set(k, x);
///         }
///     }
/// }
/// ```
pub trait Reference: Send + Sync {
    /// Motion of the body's origin; may use the state, such as its signals. A part of the motion
    /// that the sample lacks is NaN ([`Motion::unknown`]): the filter does not compare the blocks
    /// that this makes NaN. `None` if the sample gives no part.
    fn motion(&self, layout: &Layout, state: &State, sample: &Sample) -> Option<Motion>;
    /// The reverse: the sample of a reference on a known motion.
    fn sample(&self, motion: &Motion, sample: &mut Sample);
    /// Stated accuracy, with which the verdict of a run compares; `None` where it is not known.
    fn accuracy(&self) -> Option<Accuracy> {
        None
    }
}

/// 1-sigma of a reference, of each component. The default is exact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Position, m.
    pub position: f64,
    /// Velocity, m/s.
    pub velocity: f64,
    /// Attitude, rad.
    pub attitude: f64,
}

/// A sensor with its place in the composition.
pub struct Sensor {
    /// Name, type and channels.
    pub info: SensorInfo,
    /// Role in the estimator.
    pub role: Role,
    /// Gate on the innovation.
    pub gate: Gate,
    /// Recovery from lock-out.
    pub recovery: Recovery,
    /// Weight of large innovations.
    pub robust: Robust,
    /// Set if the level of the noise follows the innovations.
    pub adaptive_noise: bool,
    /// Rule by which a sample corrects the estimate.
    pub update: UpdateRule,
    /// Plausible values, each with the index of its channel.
    pub limits: Vec<(usize, Limit)>,
    /// Channels that are all zero where there is no measurement, one bit each.
    pub unset: u16,
    /// Silence after which the sensor counts as lost, s; by default from its usual interval.
    pub timeout: Option<f64>,
    /// Longest time from a sample to its arrival; `None` where samples arrive in order.
    pub late: Option<Span>,
    /// Delay of delivery, with which a run rehearses late samples.
    pub delay: Option<Delay>,
    /// Conversion of the samples of all sources.
    pub conversion: Option<Converter>,
    /// Source and past of each clone that the sensor takes, a pair of slots.
    pub clones: Vec<[usize; 2]>,
    /// Spans of time whose samples the filter does not use: from the first time on, and before the
    /// second.
    pub exclude: Vec<[Time; 2]>,
    /// Rate and faults of the simulated sensor; `None` if it is not simulated.
    pub simulation: Option<Faults>,
    /// Simulator of a driving sensor; a measuring sensor is simulated by its model.
    pub simulator: Option<Box<dyn Simulate>>,
    /// Input models that correct the samples of a driving sensor.
    pub correction: Option<Arc<Correction>>,
    /// Noise that the filter assumes, as a multiple of the model's.
    pub noise: f64,
    /// Time offset: a sample stamped t measures the state at t minus this.
    pub time_offset: Option<Handle<Scalar>>,
    /// Set if no source has samples of the sensor: it is a constraint of a process, or a
    /// pseudo-measurement.
    pub constraint: bool,
    /// The body beside the vehicle on which the sensor rides.
    pub ride: Option<Ride>,
    /// Detector of a pseudo-measurement.
    pub detector: Option<Box<dyn Detector>>,
}

impl Sensor {
    /// Creates a sensor with default gate and recovery, not simulated.
    pub(crate) fn new(info: SensorInfo, role: Role) -> Self {
        Self {
            info,
            role,
            gate: Gate::default(),
            recovery: Recovery::default(),
            robust: Robust::Off,
            adaptive_noise: false,
            update: UpdateRule::default(),
            limits: Vec::new(),
            unset: 0,
            timeout: None,
            late: None,
            delay: None,
            conversion: None,
            clones: Vec::new(),
            exclude: Vec::new(),
            simulation: None,
            simulator: None,
            correction: None,
            noise: 1.0,
            time_offset: None,
            constraint: false,
            ride: None,
            detector: None,
        }
    }

    /// Returns `true` if a sample measures nothing, and only marks the time of a past state, such as
    /// a ping.
    pub(crate) fn is_event(&self, sample: &Sample) -> bool {
        let Role::Measurement(model) = &self.role else { return false };
        let measured = sample.present() & ((1_u32 << model.channels()) - 1) as u16;
        let marked = sample.present() != 0 && measured == 0;
        marked && !self.clones.is_empty() && model.keyframe(sample)
    }

    /// Returns `true` if the sample is the zero that stands for no measurement.
    pub(crate) fn is_unset(&self, sample: &Sample) -> bool {
        self.unset != 0 && channels(self.unset).all(|channel| sample.get(channel) == Some(0.0))
    }

    /// Returns `true` if the scenario excludes the sensor's samples of this time.
    pub fn excludes(&self, time: Time) -> bool {
        self.exclude.iter().any(|[from, to]| *from <= time && time < *to)
    }

    /// Returns `true` if the sensor is simulated without noise: its samples repeat themselves at
    /// rest, and its innovations are zero, without a fault.
    pub(crate) fn is_noise_free(&self) -> bool {
        self.simulation.as_ref().is_some_and(|simulation| simulation.noise.value().si() == 0.0)
    }

    /// Creates the constraint of a process. A lock-out is only reported, since the process handles
    /// it.
    pub(crate) fn constraint(info: SensorInfo, role: Role) -> Self {
        let mut sensor = Self { constraint: true, ..Self::new(info, role) };
        sensor.recovery.action = Action::Report;
        sensor
    }
}
