//! The parameters of the source.

use crate::format::Format;
use navfuse_core::units::{Positive, Ratio, Speed};
use navfuse_frames::TimeConfig;
use schemars::JsonSchema;
use serde::Deserialize;
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
