//! Reference solution: the motion of the vehicle from another system, to start from and to compare
//! with.

use crate::earth::earth_rate_ned;
use crate::navigation::Navigation;
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::motion::Motion;
use navfuse_core::model::sensor::{Reference, Role};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, Triple};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Reference solution: position, velocity and attitude. The filter can start from it, and the run
/// compares the estimates with it; it never corrects the filter.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSolution {
    /// Position of the reference point from the IMU, in body axes. Default: at the IMU.
    pub lever_arm: Option<Triple<Length>>,
    /// Process whose state the reference gives. A vehicle without an IMU has no such process; its
    /// reference has no lever arm.
    #[serde(default = "crate::default_name")]
    pub navigation: String,
}

const CHANNELS: [Channel; 9] = [
    Channel::new("lat", "rad"),
    Channel::new("lon", "rad"),
    Channel::new("height", "m"),
    Channel::new("vel_n", "mps"),
    Channel::new("vel_e", "mps"),
    Channel::new("vel_d", "mps"),
    Channel::new("roll", "rad"),
    Channel::new("pitch", "rad"),
    Channel::new("yaw", "rad"),
];

impl SensorType for ReferenceSolution {
    const TYPE: &'static str = "reference";

    fn channels(&self) -> Vec<Channel> {
        CHANNELS.to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let navigation = match Navigation::find(composer, "navigation", &self.navigation) {
            Err(error)
                if self.lever_arm.is_some()
                    || composer.names().any(|n| n.ends_with(".attitude")) =>
            {
                return Err(error);
            }
            found => found.ok(),
        };
        let lever_arm = self.lever_arm.map_or_else(Vector3::zeros, |l| l.si());
        Ok(Role::Reference(Arc::new(ReferenceModel { navigation, lever_arm })))
    }
}

struct ReferenceModel {
    /// Source of the angular rate, which a lever arm needs.
    navigation: Option<Navigation>,
    lever_arm: Vector3<f64>,
}

impl Reference for ReferenceModel {
    fn motion(&self, layout: &Layout, state: &State, sample: &Sample) -> Option<Motion> {
        let c: [f64; 9] = sample.array(0)?;
        let c_b_n = UnitQuaternion::from_euler_angles(c[6], c[7], c[8]);
        let point = Geodetic { latitude: c[0], longitude: c[1], height: c[2] };
        let w_ie_b = c_b_n.inverse_transform_vector(&earth_rate_ned(c[0]));
        let w_ib_b = self.navigation.map_or(w_ie_b, |navigation| {
            let signal =
                navfuse_core::state::View::new(layout, state).signal(navigation.angular_rate);
            Vector3::from(signal) - state.get(layout, navigation.gyro_bias)
        });
        let w_eb_b = w_ib_b - w_ie_b;
        Some(Motion {
            time: sample.time,
            position: point.displaced(&-(c_b_n * self.lever_arm)),
            velocity: Vector3::new(c[3], c[4], c[5]) - c_b_n * w_eb_b.cross(&self.lever_arm),
            c_b_n,
            w_ib_b,
            f_ib_b: Vector3::zeros(),
        })
    }

    fn sample(&self, motion: &Motion, sample: &mut Sample) {
        let (roll, pitch, yaw) = motion.c_b_n.euler_angles();
        let w_eb_b = motion.w_ib_b
            - motion.c_b_n.inverse_transform_vector(&earth_rate_ned(motion.position.latitude));
        let point = motion.position.displaced(&(motion.c_b_n * self.lever_arm));
        let v = motion.velocity + motion.c_b_n * w_eb_b.cross(&self.lever_arm);
        let values =
            [point.latitude, point.longitude, point.height, v.x, v.y, v.z, roll, pitch, yaw];
        values.iter().enumerate().for_each(|(k, v)| sample.set(k, *v));
    }
}
