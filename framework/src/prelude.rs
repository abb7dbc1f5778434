//! What the author of a plugin needs, in one `use navfuse_core::prelude::*`.

pub use crate::Real;
pub use crate::calibration::{Calibration, LengthBias, LeverArm, Misalignment, ScaleFactor, display};
pub use crate::compose::{BuiltProcess, ComposeError, Composer, Role};
pub use crate::covariance::{NoiseSlot, PhiDiagonal, PhiSlot, Transition};
pub use crate::geodesy::Geodetic;
pub use crate::manifold::{Manifold, Position, Reading, Rotation, Scalar, Vector};
pub use crate::measurement::{Jacobian, MeasurementModel};
pub use crate::motion::Motion;
pub use crate::process::{Interval, ProcessError, ProcessModel};
pub use crate::registry::{OpenContext, Plugin, ProcessType, Registry, SensorType, SinkType, SourceType};
pub use crate::sample::{Channel, Sample, SensorId};
pub use crate::simulate::Scene;
pub use crate::state::{BlockSpec, Display, Dynamics, Handle, Layout, Mode, State, View};
pub use crate::stream::{RunInfo, Sink, Source, StreamError};
pub use crate::time::Time;
pub use crate::units::{
    Acceleration, Angle, AngularRate, AngularRateNoise, Frequency, Length, Positive, Pressure, Ratio, Sigma, Speed,
    Triple,
};
pub use nalgebra::{SMatrix, SVector, Vector3, convert};
pub use schemars::JsonSchema;
pub use serde::Deserialize;
