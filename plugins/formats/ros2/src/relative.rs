//! Relative poses: the poses of a topic, as the motion from each to the next.
//!
//! With `p` and `q` of the message and `'` for the message before:
//! ```text
//! translation = q'^-1 (p - p'),   rotation = log(q'^-1 q)
//! ```
//! Both are along the axes of the body at the message before. The axes of the world cancel.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use navfuse_core::units::sample::{Sample, SensorId};

/// The channels of a relative pose: translation, m, and rotation vector, rad.
pub const CHANNELS: [&str; 6] = ["move_x", "move_y", "move_z", "turn_x", "turn_y", "turn_z"];

/// The pose of a message as position and rotation vector; `None` if its quaternion is no rotation.
pub fn pose(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Option<[f64; 6]> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if norm.is_nan() || (norm - 1.0).abs() > 0.01 {
        return None;
    }
    let turn = UnitQuaternion::from_quaternion(q).scaled_axis();
    let [px, py, pz] = position;
    Some([px, py, pz, turn.x, turn.y, turn.z])
}

/// The poses of a sensor, whose samples hold them until they are in order of time.
#[derive(Clone, Debug)]
pub struct Chain {
    channels: [usize; 6],
    /// The sensor's axes of the message, along those of the vehicle.
    to_body: Matrix3<f64>,
    previous: Option<(Vector3<f64>, UnitQuaternion<f64>)>,
}

impl Chain {
    /// A chain of the poses in these channels.
    pub fn new(channels: [usize; 6], to_body: Matrix3<f64>) -> Self {
        Self { channels, to_body, previous: None }
    }

    /// Replaces the pose of a sample by the motion since the one before. Returns `false` for the
    /// first pose, which has none.
    fn increment(&mut self, sample: &mut Sample) -> bool {
        let [x, y, z, turn_x, turn_y, turn_z] =
            self.channels.map(|channel| sample.get(channel).unwrap_or(f64::NAN));
        let position = Vector3::new(x, y, z);
        let attitude = UnitQuaternion::from_scaled_axis(Vector3::new(turn_x, turn_y, turn_z));
        let Some((from, past)) = self.previous.replace((position, attitude)) else { return false };
        let moved = self.to_body * past.inverse_transform_vector(&(position - from));
        let turned = self.to_body * (past.inverse() * attitude).scaled_axis();
        let motion = moved.iter().chain(turned.iter());
        for (channel, value) in self.channels.iter().zip(motion.clone()) {
            sample.set(*channel, *value);
        }
        // positions at the ends of the numbers have no difference
        motion.copied().all(f64::is_finite)
    }
}

/// The chains of a bag by their sensor.
#[derive(Debug, Default)]
pub struct Chains(Vec<(SensorId, String, Chain)>);

impl Chains {
    /// Adds the chain of a sensor from a topic.
    ///
    /// # Errors
    /// Gives the topic that the sensor has a chain from already.
    pub fn add(&mut self, sensor: SensorId, topic: &str, chain: Chain) -> Result<(), String> {
        let known = self.0.iter().find(|(own, other, _)| *own == sensor && other != topic);
        if let Some((_, other, _)) = known {
            return Err(other.clone());
        }
        self.0.push((sensor, topic.to_owned(), chain));
        Ok(())
    }

    /// Replaces the pose of a sample by the motion since the one before, where its sensor measures
    /// that. Returns `false` if the sample has none.
    pub fn increment(&mut self, sample: &mut Sample) -> bool {
        let own = self.0.iter_mut().find(|(sensor, ..)| *sensor == sample.sensor);
        own.is_none_or(|(_, _, chain)| chain.increment(sample))
    }
}
