//! The tree of frames: the map, the local level frame, the vehicle and its sensors.
//!
//! ```text
//! map ── ned ── base_link_frd ─┬─ base_link
//!                              └─ NAME, of every sensor
//! ```

use crate::chunk::{Definitions, Topic};
use crate::log::StreamFailure;
use crate::message::{BODY_FRAME, FIXED_FRAME, Stamp};
use crate::pose::{Link, Pose, ned_in_map, ros_in_body};
use crate::schema;
use crate::writer::LogWriter;
use nalgebra::Vector3;
use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::stream::RunInfo;

/// The fixed frame of RViz and of Foxglove's 3D panel: east, north, up, at the origin of
/// [`FIXED_FRAME`].
pub const MAP_FRAME: &str = "map";
/// The body with the axes of ROS (REP 103): forward, left, up.
pub const ROS_BODY_FRAME: &str = "base_link";

/// The topics of the frames.
#[derive(Debug)]
pub struct Frames {
    /// Transforms that change: `/tf`.
    moving: Topic,
    /// Transforms that do not, sent with the first epoch: `/tf_static`.
    fixed: Option<Topic>,
    sensors: Vec<SensorFrame>,
}

/// The frame of a sensor.
#[derive(Debug)]
struct SensorFrame {
    name: String,
    mounting: Mounting,
    /// Set if the filter estimates a part of the mounting.
    estimated: bool,
}

impl Frames {
    pub fn open(log: &mut Definitions, run: &RunInfo) -> Self {
        let sensors = run.sensors.iter().map(|s| SensorFrame {
            name: s.name.clone(),
            mounting: s.mounting.clone(),
            estimated: s.mounting.is_estimated(&run.layout),
        });
        Self {
            sensors: sensors.collect(),
            moving: log.topic("/tf", &schema::TRANSFORMS),
            fixed: Some(log.topic("/tf_static", &schema::TRANSFORMS)),
        }
    }

    /// Writes the frames at an epoch.
    pub fn epoch(
        &mut self,
        log: &mut LogWriter,
        stamp: Stamp,
        epoch: &Epoch<'_>,
        pose: &Pose,
    ) -> Result<(), StreamFailure> {
        let time = epoch.state.time;
        if let Some(mut topic) = self.fixed.take() {
            let map = Link {
                parent: MAP_FRAME,
                child: FIXED_FRAME,
                translation: Vector3::zeros(),
                rotation: ned_in_map(),
            };
            let ros = Link {
                parent: BODY_FRAME,
                child: ROS_BODY_FRAME,
                translation: Vector3::zeros(),
                rotation: ros_in_body(),
            };
            let sensors = of_sensors(&self.sensors, false, epoch);
            let links = [map, ros].into_iter().chain(sensors);
            log.send(&mut topic, time, |m| m.transforms(stamp, links))?;
        }
        let body = Link {
            parent: FIXED_FRAME,
            child: BODY_FRAME,
            translation: pose.position,
            rotation: pose.attitude,
        };
        let links = std::iter::once(body).chain(of_sensors(&self.sensors, true, epoch));
        log.send(&mut self.moving, time, |m| m.transforms(stamp, links))
    }
}

/// The frames of the sensors whose mounting the filter estimates, or of the others.
fn of_sensors<'a>(
    sensors: &'a [SensorFrame],
    estimated: bool,
    epoch: &'a Epoch<'_>,
) -> impl Iterator<Item = Link<'a>> + Clone {
    sensors.iter().filter(move |s| s.estimated == estimated).map(move |s| {
        let (translation, rotation) = s.mounting.pose(epoch.layout, epoch.state);
        Link { parent: BODY_FRAME, child: &s.name, translation, rotation }
    })
}
