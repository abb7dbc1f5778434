//! The parameters of the source.

use crate::format::Format;
use navfuse_core::units::{Duration, Positive};
use navfuse_frames::{ChecksumUse, TimeConfig};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Reads the log of an autopilot or of an inertial unit: PX4 ULog, ArduPilot DataFlash, MAVLink
/// telemetry log, NovAtel, VectorNav, SBG, MicroStrain, u-blox, Septentrio, Nortek Nucleus, KF-GINS,
/// PSINS, SBET, LCM, DUNE (IMC).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VehicleLog {
    /// The file, absolute or relative to the folder of the scenario.
    pub file: PathBuf,
    /// Format of the file. Default: recognised from its content.
    pub format: Option<Format>,
    /// Message of each sensor, by the name of the sensor.
    pub sensors: BTreeMap<String, SensorConfig>,
    /// Times of a MAVLink log: `message` (default), the time in a message, or `received`, the time
    /// at which it was received.
    #[serde(default)]
    pub stamp: StampUse,
    /// GPS week of the first record, for SBET and KF-GINS. Default: none; times are seconds of the
    /// week.
    pub week: Option<u16>,
    /// Time between two messages, for VectorNav, whose messages have no time. Default: none.
    pub interval: Option<Positive<Duration>>,
    /// Number of the inertial unit in NovAtel's list, for RAWIMU and RAWIMUS, which do not have it.
    /// Default: none.
    pub unit: Option<u32>,
    /// Checksums of NovAtel's logs in text: `check` (default), or `ignore` for a program that writes
    /// wrong ones. The logs with a wrong one are counted.
    #[serde(default)]
    pub checksum: ChecksumUse,
    /// Definitions of the messages in a log of LCM: files `.lcm`, absolute or relative to the
    /// folder of the scenario.
    #[serde(default)]
    pub definitions: Vec<PathBuf>,
    /// The clock of the log.
    #[serde(default)]
    pub time: TimeConfig,
}

/// The time of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StampUse {
    /// The time in the message.
    #[default]
    Message,
    /// The time at which the message was received.
    Received,
}

/// The message of a sensor.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Name of the message, such as `sensor_combined` or `HIGHRES_IMU`.
    pub message: String,
    /// Instance of the message: the instance of ULog, the system of MAVLink, the
    /// entity of IMC. Default: the first one
    /// in the file.
    pub instance: Option<u32>,
    /// Name of a second message that fills the channels the first one lacks, interpolated to its
    /// times, such as the attitude of a reference. Default: none.
    pub with: Option<String>,
    /// Values that fields of the message must have, such as `{ id = 0 }`. Default: any.
    #[serde(default)]
    pub only: BTreeMap<String, f64>,
    /// Field of each channel, by the name of the channel. Default: the fields of a known message.
    #[serde(default)]
    pub channels: BTreeMap<String, FieldConfig>,
}

/// The field of a channel.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldConfig {
    /// Name of the field, such as `gyro_rad[0]`.
    pub field: String,
    /// Unit of the field, such as `cm/s`. Default: the SI unit of the channel.
    pub unit: Option<String>,
    /// Factor on the value, such as -1 for an axis with the opposite direction. Default: 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Number that is added after unit and factor, in the SI unit of the channel. Default: 0.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}
