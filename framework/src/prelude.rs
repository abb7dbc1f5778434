//! Names for the author of a plugin: `use navfuse_core::prelude::*`.

pub use crate::compose::Composer;
pub use crate::compose::calibration::{
    Calibration, LengthBias, LeverArm, Misalignment, ScaleFactor,
};
pub use crate::model::error::ComposeError;
pub use crate::model::process::input::InputModel;
pub use crate::model::process::{
    BuiltProcess, Densities, Input, Interval, Moved, OwnDynamics, ProcessError, ProcessModel, Step,
};
pub use crate::model::record::{Record, Wants};
pub use crate::model::sensor::Role;
pub use crate::model::sensor::dynamic::DynamicModel;
pub use crate::model::sensor::measurement::{Jacobian, MeasurementModel};
pub use crate::model::sensor::motion::Motion;
pub use crate::model::sensor::mounting::Mounting;
pub use crate::model::sensor::roster::Roster;
pub use crate::model::simulate::Scene;
pub use crate::model::stream::{RunInfo, Sink, Source, StreamError};
pub use crate::plugin::{
    OpenContext, Plugin, ProcessType, Registry, SensorType, SinkType, SourceType,
};
pub use crate::state::covariance::{
    DenseSlot, InputSlot, NoiseSlot, PhiDiagonal, PhiSlot, Transition,
};
pub use crate::state::display;
pub use crate::state::geodesy::Geodetic;
pub use crate::state::manifold::{Manifold, Position, Reading, Rotation, Scalar, Vector};
pub use crate::state::{
    AnyHandle, BlockSpec, Display, Dynamics, Handle, Layout, Mode, Past, State, Transients,
    Vehicle, View,
};
pub use crate::units::sample::{Channel, Sample, SensorId};
pub use crate::units::time::{Span, Time};
pub use crate::units::{
    Acceleration, AccelerationNoise, Angle, AngularRate, AngularRateNoise, AngularRateRandomWalk,
    Current, Frequency, GSensitivity, GSensitivityRandomWalk, Length, LengthRandomWalk,
    MagneticField, Positive, Pressure, Quantity, Ratio, RatioRandomWalk, Sigma, Speed, Temperature,
    Triple, Voltage,
};
pub use crate::{Real, number};
pub use nalgebra::{SMatrix, SVector, Vector3, convert};
pub use schemars::JsonSchema;
pub use serde::Deserialize;
