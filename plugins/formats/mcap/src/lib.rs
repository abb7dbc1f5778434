//! MCAP: records a run for replay to the same bits, and for ROS 2 tools, Foxglove and rerun.
//!
//! The file has the profile `ros2`, with `ros2msg` schemas and CDR messages. Its topics are:
//!
//! | topic | type | content |
//! |---|---|---|
//! | `/sensor/NAME` | `sensor_msgs/Imu` | a sample with the channels `gyro_x..z` (rad/s) and `accel_x..z` (m/s^2), along forward, right, down; a channel that is missing is the NaN `0x7ff800006d697373` |
//! | `/sensor/NAME` | `navfuse_msgs/Sample` | a sample of any other sensor: names, values and presence of its channels, in SI |
//! | `/sensor/NAME/pressure` | `sensor_msgs/FluidPressure` | in addition, for a sensor whose only channel is `depth`: 101325 Pa and the pressure of the water above it, 1025 kg/m^3 x 9.80665 m/s^2. Replay reads the depth instead |
//! | `/reference/NAME/fix` | `sensor_msgs/NavSatFix` | in addition, the position of a reference |
//! | `/innovation/NAME` | `navfuse_msgs/Innovation` | the use of a sample of a measuring sensor: outcome, NIS, innovation and its 1-sigma |
//! | `/state/OWNER/BLOCK` | `navfuse_msgs/BlockState` | every block at every epoch in its display unit: estimate, 1-sigma, and error where the truth is known |
//! | `/estimate/odometry` | `nav_msgs/Odometry` | pose of `base_link_frd` in `ned`, velocity in body axes, covariances |
//! | `/estimate/fix` | `sensor_msgs/NavSatFix` | geodetic position and its covariance (east, north, up, as that message requires) |
//! | `/tf` | `tf2_msgs/TFMessage` | `base_link_frd` in `ned`, and the frames of the sensors whose mounting the filter estimates |
//! | `/tf_static` | `tf2_msgs/TFMessage` | `ned` in `map`, `base_link` and the frames of the other sensors in `base_link_frd`; once |
//! | `/estimate/path`, `/reference/path` | `nav_msgs/Path` | the way of the estimate and of the truth so far, at most 256 poses |
//! | `/reference/odometry` | `nav_msgs/Odometry` | the true pose of `reference_frd` in `ned`, and the velocity in its axes, once a second |
//! | `/estimate/markers` | `visualization_msgs/MarkerArray` | the ellipsoid of 3 sigma and the lever arms, once a second |
//! | `/verdict` | `navfuse_msgs/Verdict` | level and line of the verdict, at the end |
//! | `/health/NAME` | `navfuse_msgs/Health` | used, NIS too large, doubted, gated, rejected, isolated or silent: a message for each change, whose stamp is its begin |
//! | `/log` | `rcl_interfaces/Log` | events, and findings as warnings |
//! | `/finding` | `navfuse_msgs/Finding` | a fault that was found: severity, basis, evidence and remedy |
//! | `/rejection` | `navfuse_msgs/Rejection` | a sample of a driving sensor that the filter rejected, and why |
//! | `/derived` | `navfuse_msgs/Derived` | a quantity that a sink derives: a table at one time |
//!
//! **Frames.** `ned` is north and east in the tangent plane at the position of the first epoch, and down from
//! height zero.
//! `base_link_frd` is the body, forward, right, down, at the point whose position is estimated.
//! `map` is `ned` with the axes east, north, up, and `base_link` is the body with the axes forward,
//! left, up, as RViz expects them. The frame of a sensor has the sensor's name, its place and its
//! axes. The orientation refers to north, east and down at the body. The odometry has no angular
//! rate: the first element of the covariance of the angular rate is -1.
//!
//! **Time.** The stamp of a message is the run time to the nanosecond, even if negative; replay
//! reads this stamp. Log time and publish time are the run time plus `log_time_offset_ns` of the
//! metadata. This offset is zero unless the first sample is before zero; then it is the smallest
//! number of whole seconds that makes the log time of the first sample positive or zero. A later
//! sample with a still earlier time has the log time zero.
//!
//! **Scenario.** The metadata record `navfuse`, the first record of the file, has `name`,
//! `version`, `seed`, `simulated` (`true` if every source simulates its samples),
//! `log_time_offset_ns`, `description` if the scenario has one, and `scenario`, the TOML as it was
//! run. The attachment `scenario.toml` holds the same TOML.
//!
//! **Verdict.** The metadata record `navfuse_verdict`, written at the end of the run, has the entry
//! `json`: the verdict of the run with its reasons, as in the result of `navfuse run`. A log that
//! was cut off, or that an earlier version wrote, has none.
//!
//! The channel of the samples of a sensor has the `type` and the `purpose` (`input`, `measurement`
//! or `reference`) of the sensor in its metadata. [`LogReader`] reads the log for reports.
//!
//! [`BagSink`] writes the estimates as a bag of ROS 2, with the axes of REP 103.
//!
//! Beside the log stands its layout for Foxglove, `run.foxglove.json`, whose panels have the blocks and
//! sensors of the run.
//!
//! The same run gives the same bytes. A log that was cut off is read up to the cut.

mod background;
mod bag;
mod chunk;
mod file;
mod format;
mod frames;
mod lanes;
mod layout;
mod log;
mod message;
mod messages;
mod motion;
mod pause;
mod pose;
mod reader;
mod records;
mod schema;
mod shown;
mod sink;
mod source;
mod template;
mod topics;
mod writer;

pub use bag::BagSink;
pub use chunk::Definition;
pub use file::Compression;
pub use log::{LogInfo, read_scenario};
pub use message::{Diagnosis, Encoder, Health, Stamp, outcome_words};
pub use messages::Messages;
pub use motion::{Motion, Moved};
pub use pose::{Link, Pose, Velocity};
pub use reader::{BlockEntry, Entry, InnovationEntry, LogReader, RejectionEntry, SensorEntry};
pub use schema::Schema;
pub use sink::{Mcap, McapSink};
pub use source::{McapLog, McapSource};
pub use writer::Outlet;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type and the sink type `mcap`.
#[derive(Clone, Copy, Debug)]
pub struct McapPlugin;

impl Plugin for McapPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<McapLog>();
        registry.sink::<Mcap>();
    }

    navfuse_core::named_after_crate!();
}
