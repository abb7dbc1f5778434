//! The key `screening` of an IMU: limits by which the filter notices faulty samples.

use crate::imu::{Imu, Output};
use navfuse_core::model::process::screening::{ChannelLimits, Screening};
use navfuse_core::units::{Acceleration, AngularRate, Duration, Positive};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// Change of the angular rate within a second that is always possible, rad/s: 0.2 deg/s.
const LEAST_TURN: f64 = 3.5e-3;
/// Change of the specific force within a second that is always possible, m/s^2.
const LEAST_FORCE: f64 = 0.05;

/// `screening` as a table: limits by which the filter notices faulty samples.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImuLimits {
    /// Largest plausible angular rate. Default: 2000 deg/s. Give the range of the gyros: a rate at
    /// its end is saturated.
    #[serde(default = "gyro_range")]
    pub gyro_range: Positive<AngularRate>,
    /// Largest plausible specific force. Default: 500 m/s^2.
    #[serde(default = "accel_range")]
    pub accel_range: Positive<Acceleration>,
    /// Largest plausible change of the angular rate from sample to sample. Default: 25 times the
    /// usual second difference.
    pub gyro_change: Option<Positive<AngularRate>>,
    /// Largest plausible change of the specific force from sample to sample. Default: as for the
    /// gyros.
    pub accel_change: Option<Positive<Acceleration>>,
    /// Duration of identical samples after which the IMU counts as frozen. Default: 5 samples, more
    /// where samples often repeat.
    pub frozen: Option<Positive<Duration>>,
    /// Longest span of faulty samples that is bridged; after a longer one, the result must not be
    /// used.
    #[serde(default = "max_bridge")]
    pub max_bridge: Positive<Duration>,
}

fn gyro_range() -> Positive<AngularRate> {
    Positive::from_si(2000_f64.to_radians())
}
fn accel_range() -> Positive<Acceleration> {
    Positive::from_si(500.0)
}
fn max_bridge() -> Positive<Duration> {
    Positive::from_si(2.0)
}

/// The key `screening`: `"off"`, or a table of limits.
#[derive(Clone, Copy, Debug)]
pub struct ImuScreening(pub Option<ImuLimits>);

impl Default for ImuScreening {
    fn default() -> Self {
        Self(Some(ImuLimits {
            gyro_range: gyro_range(),
            accel_range: accel_range(),
            gyro_change: None,
            accel_change: None,
            frozen: None,
            max_bridge: max_bridge(),
        }))
    }
}

impl<'de> Deserialize<'de> for ImuScreening {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OffOrTable)
    }
}

struct OffOrTable;

impl<'de> Visitor<'de> for OffOrTable {
    type Value = ImuScreening;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"off\", or a table such as { gyro_range = \"300 deg/s\" }")
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        if text == "off" {
            Ok(ImuScreening(None))
        } else {
            Err(E::custom(format!(
                "{text:?} is not \"off\" and not a table such as {{ gyro_range = \"300 deg/s\" }}"
            )))
        }
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        ImuLimits::deserialize(MapAccessDeserializer::new(map)).map(|l| ImuScreening(Some(l)))
    }
}

impl JsonSchema for ImuScreening {
    fn schema_name() -> Cow<'static, str> {
        "ImuScreening".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "const": "off" }, generator.subschema_for::<ImuLimits>()] })
    }
}

impl Imu {
    /// Limits for the screening of the filter; `None` if it is off.
    pub(crate) fn screening(&self) -> Option<Screening> {
        let limits = self.screening.0?;
        let (gyro, accel) = (self.gyro_noise(), self.accel_noise());
        let gyros = (0..3).map(|k| ChannelLimits {
            range: limits.gyro_range.value().si(),
            change: limits.gyro_change.map(|c| c.value().si()),
            noise: gyro[k],
            step: self.gyro_step(),
            motion: LEAST_TURN,
        });
        let accelerometers = (0..3).map(|k| ChannelLimits {
            range: limits.accel_range.value().si(),
            change: limits.accel_change.map(|c| c.value().si()),
            noise: accel[k],
            step: self.accel_step(),
            motion: LEAST_FORCE,
        });
        Some(Screening {
            channels: gyros.chain(accelerometers).collect(),
            integrals: self.output == Output::Increments,
            frozen: limits.frozen.map(|f| f.value().si()),
            max_bridge: limits.max_bridge.value().si(),
        })
    }
}
