//! The keys that the framework takes from the tables of a scenario, beside the keys of each type.

use crate::compose::calibration::TimeOffset;
use crate::compose::correlated::CorrelatedError;
use crate::model::sensor::conversion::Conversion;
use crate::model::sensor::delivery::Delay;
use crate::model::sensor::gate::{Gate, Recovery};
use crate::model::sensor::limits::LimitKeys;
use crate::model::sensor::robust::Robust;
use crate::model::simulate::Faults;
use crate::units::{Duration, Positive};
use schemars::JsonSchema;
use serde::Deserialize;

/// Key of the type, where the table has another name.
pub const TYPE: &str = "type";
/// Key that disables a table.
pub const ENABLED: &str = "enabled";
/// Key of a sensor's simulation, which the type of the sensor may extend.
pub const SIMULATION: &str = "simulation";
/// Key of a process whose truth moves by its own equations.
pub const WANDER: &str = "wander";
/// Keys of the tables of every kind.
pub const TABLE_KEYS: [&str; 2] = [TYPE, ENABLED];
/// Keys of the table of a process.
pub const PROCESS_KEYS: [&str; 3] = [TYPE, ENABLED, WANDER];

/// Defines the struct with the common keys of sensors, and the lists of its keys: the struct is the
/// only place that names a key.
macro_rules! sensor_keys {
    ($(#[$about:meta])* pub struct $name:ident {
        $($(#[$attribute:meta])* pub $key:ident: $type:ty,)*
    }) => {
        $(#[$about])*
        pub struct $name {
            $($(#[$attribute])* pub $key: $type,)*
        }

        impl $name {
            /// Names of these keys.
            pub const KEYS: &[&str] = &[$(stringify!($key)),*];
            /// Names of all keys that the framework takes from the table of a sensor.
            pub const TABLE_KEYS: &[&str] = &[TYPE, ENABLED, $(stringify!($key)),*];
        }
    };
}

sensor_keys! {
    /// Keys of every sensor's table beside those of its type.
    #[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct SensorKeys {
        /// Innovation gate: the probability that a good sample passes, or "off". Default: 0.9999.
        #[serde(default)]
        pub gate: Gate,
        /// Recovery from lock-out, when every sample is gated for too long. Default: after 30 s,
        /// inflate.
        #[serde(default)]
        pub recovery: Recovery,
        /// Robust update: `"huber"` or `"student-t"`, or a table with `kind` and its parameter, so
        /// that a large innovation that passes the gate counts less. Default: off.
        #[serde(default)]
        pub robust: Robust,
        /// Lets the level of the noise follow the innovations, between half and twice the stated
        /// sigma.
        #[serde(default)]
        pub adaptive_noise: bool,
        /// Rule by which a sample corrects the estimate: `"ekf"`, `"iekf"`, `"ukf"`, or one that a
        /// plugin registers. Default: `update` of `[estimator]`.
        pub update: Option<String>,
        /// Plausible values of the channels by name, such as
        /// `{ vel_x = { range = ["-5 m/s", "5 m/s"], rate = "2 m/s^2" } }`; a sample beyond them is
        /// rejected. Default: the range that the type gives, without a rate.
        #[serde(default)]
        pub limits: LimitKeys,
        /// Time-correlated error of the channels, a first-order Gauss-Markov state each. Default:
        /// none.
        pub correlated_error: Option<CorrelatedError>,
        /// Silence after which the sensor counts as lost. Default: three times its usual interval,
        /// at least 5 s.
        pub timeout: Option<Positive<Duration>>,
        /// Lag of the samples: a sample stamped t measures the state at t - time_offset. A
        /// calibration state, as a scale factor is. Default: zero.
        pub time_offset: Option<TimeOffset>,
        /// Longest time from a sample to its arrival, such as "5 s": the filter inserts a late
        /// sample in its place. Default: a sample that arrives late is rejected.
        pub late: Option<Positive<Duration>>,
        /// Delay of delivery, such as `{ mean = "2 s", sigma = "0.5 s" }`: rehearses late samples
        /// with a simulation or a recording. Default: samples arrive at their own time.
        pub delay: Option<Delay>,
        /// Conversion of the samples before the filter takes them, such as
        /// `{ axes = ["y", "x", "-z"] }`, `{ factor = { depth = -1 } }` or `{ clock = "-18 s" }`.
        /// Default: the samples are in the axes, units and time of navfuse.
        pub samples: Option<Conversion>,
        /// Spans of time whose samples the filter does not use, each `["110 s", "125 s"]`: from the
        /// first time on, and before the second. The samples stay in the log.
        #[serde(default)]
        pub exclude: Vec<[Duration; 2]>,
        /// Simulation of the sensor, where there is a simulated source.
        pub simulation: Option<Faults>,
    }
}
