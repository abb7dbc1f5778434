//! The parameters of the source.

use crate::axes::Axes;
use navfuse_core::units::{Angle, Density, Duration, Pressure, Triple};
use navfuse_frames::{Datum, TimeConfig};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Reads a bag of ROS 2: MCAP or SQLite, split, packed by zstd or lz4, or damaged.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ros2 {
    /// The bag: its folder, or one of its files; absolute or relative to the folder of the scenario.
    pub path: PathBuf,
    /// Further files of the bag, in their order. Not needed for a folder.
    #[serde(default)]
    pub more: Vec<PathBuf>,
    /// Topics by the sensor that receives their messages: `imu = { topic = "/imu/data" }`.
    pub sensors: BTreeMap<String, TopicConfig>,
    /// Time of a message: that in its header (default), or that at which it was received.
    #[serde(default)]
    pub stamp: Stamping,
    /// Longest time that a message may be received after messages with later stamps. Default: 10 s.
    pub wait: Option<Duration>,
    /// The clock of the bag, which counts from 1970.
    #[serde(default)]
    pub time: TimeConfig,
}

/// The time of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stamping {
    /// The stamp in its header. A type without a header has the time at which it was received.
    #[default]
    Header,
    /// The time at which it was received.
    Receive,
}

/// The velocities that are used of a log that tracks bottom and water.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Tracked {
    /// Over the bottom.
    #[default]
    Bottom,
    /// Through the water.
    Water,
}

/// The topics of a sensor and the treatment of their messages.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TopicConfig {
    /// The topic. Its type decides which channels it fills; `channels` is for any other type.
    pub topic: Option<String>,
    /// Further topics of the sensor, such as the velocity of a GNSS receiver.
    pub more: Vec<String>,
    /// Fields of messages by the channel of the sensor: `speed = { field = "twist.linear.x" }`.
    /// They replace those that the type of the topic fills.
    pub channels: BTreeMap<String, MessageField>,
    /// Time of a message. Default: the time of the source.
    pub stamp: Option<Stamping>,
    /// Field with the time of a message, for a type without a header: `{ field = "timestamp", unit =
    /// "us" }`. Default: `stamp` decides.
    pub time: Option<TimeField>,
    /// Axes of the vectors in the messages: `flu` (forward, left, up; with the world east, north, up)
    /// or `frd` (forward, right, down; north, east, down). Default: `frd` for velocity
    /// logs, `flu` for all others.
    pub axes: Option<Axes>,
    /// Roll, pitch and yaw of the sensor's axes in the vehicle's, both forward, right, down. Vectors
    /// along the sensor's axes are turned by it. Default: zero.
    pub rotation: Option<Triple<Angle>>,
    /// Position at which the coordinates of `nav_msgs/Odometry` and poses are zero. Without it, their
    /// positions are not used.
    pub datum: Option<Datum>,
    /// Pressure at the surface, for the depth from `sensor_msgs/FluidPressure`. Default: 101325 Pa.
    pub atmosphere: Option<Pressure>,
    /// Density of the water, for this depth. Default: 1025 kg/m^3.
    pub density: Option<Density>,
    /// Velocities that are used of a log that tracks bottom and water: `bottom` (default) or `water`.
    pub track: Tracked,
}

/// The field with the time of a message.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeField {
    /// Path of the field, whose zero is the zero of the clock of the bag.
    pub field: String,
    /// Unit of the field, such as "us".
    pub unit: String,
}

/// A field of a message.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MessageField {
    /// Path of the field: `twist.twist.linear.x`, or `ranges[2]` for an element of a list.
    pub field: String,
    /// Topic, where it differs from the sensor's.
    pub topic: Option<String>,
    /// Unit of the field. Default: the SI unit of the channel.
    pub unit: Option<String>,
    /// Factor of the value, such as -1 for an axis that points the other way. Default: 1.
    pub scale: Option<f64>,
    /// Value in SI that is added. Default: 0.
    pub offset: Option<f64>,
}
