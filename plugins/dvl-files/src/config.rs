//! The parameters of the source.

use crate::calendar;
use crate::format::Format;
use navfuse_core::units::{Positive, Ratio, Speed, Time as Duration};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::path::PathBuf;

/// Reads the file of a Doppler velocity log as the instrument wrote it: Teledyne PD0, PD4, PD5 and
/// PD6, Nortek AD2CP and NMEA, Water Linked.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DvlFile {
    /// The file, absolute or relative to the folder of the scenario.
    pub file: PathBuf,
    /// Format of the file. Default: recognised from its content.
    pub format: Option<Format>,
    /// Name of the sensor that receives the velocity over the bottom. Default: the only sensor of
    /// type `dvl` or `dvl-beams`.
    pub bottom_track: Option<String>,
    /// Name of the sensor that receives the velocity through the water. Default: none.
    pub water_track: Option<String>,
    /// Name of the sensor that receives the depth of the transducer. Default: none.
    pub depth: Option<String>,
    /// Velocities in ship and Earth coordinates: `refuse` (default), or `file` to turn them back to
    /// the instrument's axes with the attitude in the file.
    #[serde(default)]
    pub attitude: AttitudeUse,
    /// The clock of the instrument.
    #[serde(default)]
    pub time: TimeConfig,
    /// Limits beyond which a velocity is not used.
    #[serde(default)]
    pub screen: Screen,
}

/// Treatment of velocities that are not along the axes of the instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum AttitudeUse {
    /// They are not used.
    #[default]
    Refuse,
    /// They are turned back to the axes of the instrument.
    File,
}

/// The clock of the instrument.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TimeConfig {
    /// Date and time of the instrument's clock at which the run's clock is zero. Default:
    /// 1970-01-01T00:00:00, so that times are those of Unix.
    pub origin: Option<Date>,
    /// Day of the first ping, for a format with a time of the day alone (PD4 and PD5). Default:
    /// none; times count from midnight.
    pub first_day: Option<Date>,
    /// Offset that is added to the time. Default: 0 s.
    pub offset: Option<Duration>,
}

/// Limits beyond which a velocity is not used.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Screen {
    /// Largest magnitude of the error velocity. Default: no limit.
    pub error_velocity: Option<Positive<Speed>>,
    /// Smallest correlation of a beam, as a share of full scale. Default: no limit.
    pub correlation: Option<Ratio>,
    /// Smallest share of good pings of a beam. Default: no limit.
    pub percent_good: Option<Ratio>,
    /// Largest figure of merit, the accuracy that the instrument claims. Default: no limit.
    pub figure_of_merit: Option<Positive<Speed>>,
}

/// A date, in TOML `"2022-06-01"` or `"2022-06-01T08:30:00Z"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Date {
    /// Nanoseconds since 1970.
    pub nanos: i64,
    /// Set if a time of the day was given.
    pub has_time: bool,
}

impl<'de> Deserialize<'de> for Date {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        match calendar::parse(&text) {
            Some((nanos, has_time)) => Ok(Self { nanos, has_time }),
            None => Err(D::Error::custom(format!(
                "{text:?} is no date after 1970; write \"2022-06-01\" or \
                 \"2022-06-01T08:30:00Z\" on the clock of the instrument"
            ))),
        }
    }
}

impl JsonSchema for Date {
    fn schema_name() -> Cow<'static, str> {
        "Date".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "examples": ["2022-06-01T08:30:00Z"] })
    }
}
