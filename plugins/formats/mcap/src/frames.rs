//! The tree of frames: the map, the local level frame, the vehicle and its sensors.
//!
//! ```text
//! map ── ned ── base_link_frd ─┬─ base_link
//!                              └─ NAME, of every sensor
//! ```

use crate::chunk::Definitions;
use crate::log::StreamFailure;
use crate::message::{BODY_FRAME, FIXED_FRAME, Pose, Stamp};
use crate::schema;
use crate::sink::LogWriter;
use crate::topics::Topic;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::stream::RunInfo;
use std::f64::consts::FRAC_1_SQRT_2;

/// The fixed frame of RViz and of Foxglove's 3D panel: east, north, up, at the origin of
/// [`FIXED_FRAME`].
pub const MAP_FRAME: &str = "map";
/// The body with the axes of ROS (REP 103): forward, left, up.
pub const ROS_BODY_FRAME: &str = "base_link";

/// A frame in its parent.
#[derive(Clone, Copy, Debug)]
pub struct Link<'a> {
    pub parent: &'a str,
    pub child: &'a str,
    /// Origin of the child along the axes of the parent, m.
    pub translation: Vector3<f64>,
    /// Rotation from the child to the parent.
    pub rotation: UnitQuaternion<f64>,
}

/// Half a turn about the bisector of two horizontal axes, which exchanges these and turns the
/// third: from north, east, down to east, north, up.
pub fn ned_in_map() -> UnitQuaternion<f64> {
    let (x, y) = (FRAC_1_SQRT_2, FRAC_1_SQRT_2);
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, x, y, 0.0))
}

/// Half a turn about the forward axis: from forward, left, up to forward, right, down.
pub fn ros_in_body() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0))
}

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
