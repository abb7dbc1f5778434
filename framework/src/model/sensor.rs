//! Sensors: what they are to the estimator.

use crate::model::gate::{Action, Gate, Recovery};
use crate::model::measurement::AnyMeasurement;
use crate::model::motion::Motion;
use crate::model::simulate::{Faults, Simulate};
use crate::state::manifold::Scalar;
use crate::state::{Handle, Layout, State};
use crate::units::sample::{Channel, Sample};
use std::any::Any;
use std::sync::Arc;

/// What a sink knows of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorInfo {
    /// Its name in the scenario.
    pub name: String,
    /// Its registered type.
    pub kind: String,
    /// Its channels.
    pub channels: Vec<Channel>,
    /// What it is for.
    pub purpose: Purpose,
}

/// What a sensor is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// It drives a process model.
    Input,
    /// It corrects the state.
    Measurement,
    /// It tells the truth, to begin from and to compare with.
    Reference,
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
        M: crate::model::measurement::MeasurementModel<N> + Sync,
    {
        Self::Measurement(Arc::new(crate::model::measurement::Erased(model)))
    }
}

/// Reads the motion of the body from a reference's sample.
///
/// ```
/// use navfuse_core::model::sensor::Reference;
/// use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
/// use navfuse_core::prelude::*;
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

/// A sensor in its place.
pub struct Sensor {
    /// Name, type and channels.
    pub info: SensorInfo,
    /// What it is to the estimator.
    pub role: Role,
    /// Gate on the innovation.
    pub gate: Gate,
    /// Way out of lock-out.
    pub recovery: Recovery,
    /// Silence after which the sensor counts as lost, s; by default from its usual interval.
    pub timeout: Option<f64>,
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
    /// A sensor with default gate and recovery, not simulated.
    pub(crate) fn new(info: SensorInfo, role: Role) -> Self {
        Self {
            info,
            role,
            gate: Gate::default(),
            recovery: Recovery::default(),
            timeout: None,
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
        sensor.recovery.action = Action::Report;
        sensor
    }
}
