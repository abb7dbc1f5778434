//! Topics of ROS 2: samples from the topics of a vehicle, and estimates as topics; services command the run.
//!
//! The link subscribes to topics, whose messages are read as those of a bag. The sink publishes
//! `nav_msgs/Odometry`, transforms and diagnostics. Both take part in DDS, the network of ROS 2, by
//! themselves. The feature `dds` has the protocol; without it a scenario is checked, and not run.

mod clock;
mod diagnostics;
mod lifecycle;
mod link;
mod names;
mod played;
#[cfg(feature = "dds")]
mod port;
#[cfg(not(feature = "dds"))]
#[path = "no_port.rs"]
mod port;
mod service;
mod sink;

pub use link::Ros2Link;
pub use played::{PlayedTopic, PlayedType};
pub use sink::Ros2Sink;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the link type and the sink type `ros2`.
#[derive(Clone, Copy, Debug)]
pub struct DdsPlugin;

impl Plugin for DdsPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.link::<Ros2Link>();
        registry.sink::<Ros2Sink>();
    }

    navfuse_core::named_after_crate!();
}
