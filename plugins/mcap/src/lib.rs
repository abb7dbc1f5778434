//! MCAP: a run recorded so that it can be replayed to the bit, and read by ROS 2 tools, Foxglove and rerun.
//!
//! The file has the profile `ros2`, with `ros2msg` schemas and CDR messages. What each topic holds:
//!
//! | topic | type | content |
//! |---|---|---|
//! | `/sensor/NAME` | `sensor_msgs/Imu` | a sample with the channels `gyro_x..z` (rad/s) and `accel_x..z` (m/s^2), along forward, right, down; a channel that is missing is the NaN `0x7ff800006d697373` |
//! | `/sensor/NAME` | `navfuse_msgs/Sample` | a sample of any other sensor: names, values and presence of its channels, in SI |
//! | `/sensor/NAME/pressure` | `sensor_msgs/FluidPressure` | beside it, for a sensor with the one channel `depth`: 101325 Pa and 1025 kg/m^3 x 9.80665 m/s^2 of water above it. Replay reads the depth, not this |
//! | `/reference/NAME/fix` | `sensor_msgs/NavSatFix` | beside it, the position of a reference |
//! | `/innovation/NAME` | `navfuse_msgs/Innovation` | what became of a sample of a measuring sensor: outcome, NIS, innovation and its 1-sigma |
//! | `/state/OWNER/BLOCK` | `navfuse_msgs/BlockState` | every block at every epoch in its display unit: estimate, 1-sigma, and error where the truth is known |
//! | `/estimate/odometry` | `nav_msgs/Odometry` | pose of `base_link_frd` in `ned`, velocity in body axes, covariances |
//! | `/estimate/fix` | `sensor_msgs/NavSatFix` | geodetic position and its covariance (east, north, up, as that message has it) |
//! | `/tf` | `tf2_msgs/TFMessage` | `ned` to `base_link_frd` |
//! | `/log` | `rcl_interfaces/Log` | events |
//!
//! **Frames.** `ned` is north, east, down in the tangent plane at the first epoch's position; `base_link_frd` is the body,
//! forward, right, down, at the point whose position is estimated. The orientation is that against north, east and down
//! where the body is. The angular rate is not part of the odometry: the first element of its covariance is -1.
//!
//! **Time.** The stamp of a message is the run time to the nanosecond, also when it is negative: replay reads it. Log and
//! publish time are the run time plus `log_time_offset_ns` of the metadata, which is zero unless the first sample is
//! before zero; then it is the whole seconds that make it positive. A later sample that is earlier still has log time zero.
//!
//! **Scenario.** The metadata record `navfuse`, the first record of the file, has `name`, `version`, `seed`,
//! `log_time_offset_ns` and `scenario`, the TOML as it was run; the attachment `scenario.toml` has that too.
//!
//! The channel of a sensor's samples has in its metadata the sensor's `type` and its `purpose` (`input`, `measurement` or
//! `reference`). [`LogReader`] reads all that the log tells of the estimate, for reports.
//!
//! The same run gives the same bytes. A log that was cut off is read up to the cut.

mod log;
mod message;
mod reader;
mod schema;
mod sink;
mod source;
mod topics;

pub use log::{LogInfo, read_scenario};
pub use message::reason;
pub use reader::{BlockEntry, Entry, InnovationEntry, LogReader, SensorEntry};
pub use sink::{Compression, Mcap, McapSink};
pub use source::{McapLog, McapSource};

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
