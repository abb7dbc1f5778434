//! A recording as the drivers of ROS 2 publish it.

use crate::link::{domain_of, join};
use crate::names::{of_topic, of_type};
use crate::port::{Node, Publication};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;
use navfuse_mcap::{Encoder, Stamp};

/// The body, along forward, left, up.
const BODY: &str = "base_link";

/// A type of message to which samples are played, with the axes of REP 103.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlayedType {
    /// `sensor_msgs/msg/Imu`.
    Imu,
    /// `sensor_msgs/msg/NavSatFix`.
    Fix,
    /// `geometry_msgs/msg/TwistWithCovarianceStamped`.
    Twist,
    /// `sensor_msgs/msg/FluidPressure`.
    Pressure,
}

impl PlayedType {
    /// All types, by their names in `navfuse play`.
    pub const ALL: [(&'static str, Self); 4] = [
        ("imu", Self::Imu),
        ("fix", Self::Fix),
        ("twist", Self::Twist),
        ("pressure", Self::Pressure),
    ];

    fn kind(self) -> &'static str {
        match self {
            Self::Imu => "sensor_msgs/msg/Imu",
            Self::Fix => "sensor_msgs/msg/NavSatFix",
            Self::Twist => "geometry_msgs/msg/TwistWithCovarianceStamped",
            Self::Pressure => "sensor_msgs/msg/FluidPressure",
        }
    }

    /// The channels of a sensor that a message of the type needs.
    fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Imu => &["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
            Self::Fix => &["lat", "lon", "height"],
            Self::Twist => &["vel_x", "vel_y", "vel_z"],
            Self::Pressure => &["depth"],
        }
    }

    /// Writes the message of a sample; `false` for one that lacks a channel.
    fn write(
        self,
        out: &mut Vec<u8>,
        info: &SensorInfo,
        sample: &Sample,
    ) -> Result<bool, StreamError> {
        let value = |name: &&str| info.position(name).and_then(|channel| sample.get(channel));
        let Some(values) = self.channels().iter().map(value).collect::<Option<Vec<f64>>>() else {
            return Ok(false);
        };
        // forward, right, down and forward, left, up
        let turned = |v: &[f64]| [v[0], -v[1], -v[2]];
        let stamp = Stamp::new(sample.time)?;
        out.clear();
        let message = Encoder::new(out);
        match self {
            Self::Imu => {
                let both = [turned(&values[..3]), turned(&values[3..])].concat();
                message.imu(stamp, &Sample::new(sample.time, sample.sensor, &both));
            }
            Self::Fix => {
                let [latitude, longitude, height] = [values[0], values[1], values[2]];
                message.fix(stamp, BODY, &Geodetic { latitude, longitude, height }, None);
            }
            Self::Twist => message.twist(stamp, BODY, &turned(&values)),
            Self::Pressure => message.pressure(stamp, values[0]),
        }
        Ok(true)
    }
}

/// A topic to which the samples of a sensor are played.
pub struct PlayedTopic {
    kind: PlayedType,
    topic: Publication,
    message: Vec<u8>,
    /// It takes part in the network as long as its topics do.
    _node: Node,
}

impl PlayedTopic {
    /// Offers a topic in a domain, by default that in `ROS_DOMAIN_ID`.
    ///
    /// # Errors
    /// When the network is not there, or this program was built without it.
    pub fn open(kind: PlayedType, topic: &str, domain: Option<u16>) -> Result<Self, StreamError> {
        let node = join(domain_of(domain), &[])?;
        let topic = node.publish(&of_topic(topic), &of_type(kind.kind()))?;
        Ok(Self { kind, topic, message: Vec::new(), _node: node })
    }

    /// Publishes a sample whose times are Unix times; one that lacks a channel of the type is left out.
    ///
    /// # Errors
    /// When the time does not fit a stamp of ROS.
    pub fn send(&mut self, info: &SensorInfo, sample: &Sample) -> Result<(), StreamError> {
        if self.kind.write(&mut self.message, info, sample)? {
            self.topic.send(&self.message);
        }
        Ok(())
    }
}
