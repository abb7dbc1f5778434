//! What the author of a sensor needs, in one `use navfuse_core::prelude::*`.

pub use crate::Real;
pub use crate::calibration::{Calibration, LengthBias, LeverArm, Misalignment, ScaleFactor, display};
pub use crate::compose::{ComposeError, Composer, Role};
pub use crate::manifold::{Position, Rotation, Scalar, Vector};
pub use crate::measurement::{Jacobian, MeasurementModel};
pub use crate::registry::{Plugin, Registry, SensorType};
pub use crate::sample::{Channel, Sample};
pub use crate::simulate::Scene;
pub use crate::state::{Display, Handle, View};
pub use crate::units::{
    Acceleration, Angle, AngularRate, AngularRateNoise, Frequency, Length, Positive, Pressure, Ratio, Sigma, Speed,
    Triple,
};
pub use nalgebra::{SMatrix, SVector, Vector3, convert};
pub use schemars::JsonSchema;
pub use serde::Deserialize;
