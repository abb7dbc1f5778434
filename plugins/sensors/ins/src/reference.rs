//! Reference solution: the motion of the vehicle from another system, to start from and to compare
//! with.

use crate::earth::earth_rate_ned;
use crate::navigation::Navigation;
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::sensor::{Accuracy, Reference, Role};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Angle, Length, Positive, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Reference solution: position, velocity and attitude, or some of them. The filter can start from
/// it, and the run compares the estimates with it; it never corrects the filter.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSolution {
    /// Position of the reference point from the IMU, in body axes. Default: at the IMU.
    pub lever_arm: Option<Triple<Length>>,
    /// 1-sigma of the reference, with which the verdict compares the estimate at the end. Default:
    /// exact in a simulation; 10 m, 0.5 m/s and 2 deg in a recording.
    pub accuracy: Option<StatedAccuracy>,
    /// Process whose state the reference gives. A vehicle without an IMU has no such process; its
    /// reference has no lever arm.
    #[serde(default = "crate::default_name")]
    pub navigation: String,
}

/// 1-sigma of each component of a reference.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatedAccuracy {
    /// Position north, east and down.
    pub position: Positive<Length>,
    /// Velocity north, east and down.
    pub velocity: Positive<Speed>,
    /// Roll, pitch and yaw.
    pub attitude: Positive<Angle>,
}

impl StatedAccuracy {
    fn si(&self) -> Accuracy {
        let Self { position, velocity, attitude } = self;
        Accuracy {
            position: position.value().si(),
            velocity: velocity.value().si(),
            attitude: attitude.value().si(),
        }
    }
}

const CHANNELS: [(&str, &str); 9] = [
    ("lat", "rad"),
    ("lon", "rad"),
    ("height", "m"),
    ("vel_n", "mps"),
    ("vel_e", "mps"),
    ("vel_d", "mps"),
    ("roll", "rad"),
    ("pitch", "rad"),
    ("yaw", "rad"),
];

impl SensorType for ReferenceSolution {
    const TYPE: &'static str = "reference";

    fn channels(&self) -> Vec<Channel> {
        Channel::all(CHANNELS).into()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let (name, arm) = (&self.navigation, self.lever_arm.is_some());
        let navigation = match Navigation::find_turning(composer, name, "lever_arm", arm) {
            Err(error) if arm || composer.vehicle().attitude.is_some() => {
                return Err(error);
            }
            found => found.ok(),
        };
        let lever_arm = self.lever_arm.map_or_else(Vector3::zeros, |l| l.si());
        composer.mounted(Mounting::at_constant(lever_arm));
        let accuracy = self.accuracy.map(|accuracy| accuracy.si());
        Ok(Role::Reference(Arc::new(ReferenceModel { navigation, lever_arm, accuracy })))
    }
}

struct ReferenceModel {
    /// Source of the angular rate, which a lever arm needs.
    navigation: Option<Navigation>,
    lever_arm: Vector3<f64>,
    accuracy: Option<Accuracy>,
}

impl Reference for ReferenceModel {
    /// Any of position, velocity and attitude may be missing. The lever arm turns with the
    /// attitude, and with that of the estimate where the sample has none.
    fn motion(&self, layout: &Layout, state: &State, sample: &Sample) -> Option<Motion> {
        let array = |first| sample.array::<3>(first);
        let (position, velocity) = (array(0), array(3));
        let attitude = array(6).map(|c| UnitQuaternion::from_euler_angles(c[0], c[1], c[2]));
        if position.is_none() && velocity.is_none() && attitude.is_none() {
            return None;
        }
        let mut motion = Motion::unknown(sample.time);
        if let Some([latitude, longitude, height]) = position {
            motion.position = Geodetic { latitude, longitude, height };
        }
        motion.velocity = velocity.map_or(motion.velocity, Vector3::from);
        motion.c_b_n = attitude.unwrap_or(motion.c_b_n);
        let Some(navigation) = self.navigation else {
            let earth = earth_rate_ned(motion.position.latitude);
            motion.w_ib_b = motion.c_b_n.inverse_transform_vector(&earth);
            motion.f_ib_b = Vector3::zeros();
            return Some(motion);
        };
        let c_b_n = attitude.unwrap_or_else(|| {
            UnitQuaternion::from_rotation_matrix(&state.get(layout, navigation.attitude))
        });
        let latitude = position.map_or_else(
            || state.get(layout, navigation.position).latitude,
            |[latitude, ..]| latitude,
        );
        let rate = navigation.published(&navfuse_core::state::View::new(layout, state));
        motion.w_ib_b = Vector3::from(rate) - navigation.biases(layout, state)[0];
        motion.f_ib_b = Vector3::zeros();
        let w_eb_b = motion.w_ib_b - c_b_n.inverse_transform_vector(&earth_rate_ned(latitude));
        motion.position = motion.position.displaced(&-(c_b_n * self.lever_arm));
        motion.velocity -= c_b_n * w_eb_b.cross(&self.lever_arm);
        Some(motion)
    }

    fn accuracy(&self) -> Option<Accuracy> {
        self.accuracy
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
    use crate::testing::{Bench, compose};
    use nalgebra::{UnitQuaternion, Vector3};
    use navfuse_core::model::sensor::Role;
    use navfuse_core::model::sensor::motion::Motion;
    use navfuse_core::state::geodesy::Geodetic;
    use navfuse_core::units::sample::{Sample, SensorId};
    use navfuse_core::units::time::Time;

    /// A vehicle heads north at 10 m/s and turns by 0.5 rad/s to the right. A reference 2 m ahead of
    /// the IMU moves east by 1 m/s; the rate of the Earth moves it by 2e-4 m/s. Back at the IMU there
    /// is the motion again, but for the change of the radii of the Earth over 2 m, a millionth of it.
    #[test]
    fn a_lever_arm_moves_the_reference_and_is_taken_off_again() {
        let bench = Bench::new(&["sensor.reference.lever_arm=[\"2 m\", \"0 m\", \"0 m\"]"]);
        let composition = &bench.composition;
        let index = composition.sensor("reference").unwrap();
        let Role::Reference(reference) = &composition.sensors[index].role else {
            panic!("{index}")
        };
        let motion = Motion {
            time: Time::default(),
            position: Geodetic { latitude: 0.8, longitude: 0.1, height: 50.0 },
            velocity: Vector3::new(10.0, 0.0, 0.0),
            c_b_n: UnitQuaternion::identity(),
            w_ib_b: Vector3::new(0.0, 0.0, 0.5),
            f_ib_b: Vector3::zeros(),
        };
        let mut sample = Sample::empty(Time::default(), SensorId(index));
        reference.sample(&motion, &mut sample);
        let velocity = Vector3::from(sample.array::<3>(3).unwrap());
        assert!((velocity - Vector3::new(10.0, 1.0, 0.0)).norm() < 2e-4, "{velocity}");
        let mut state = bench.state();
        bench.navigation.publish(&mut state, &motion.w_ib_b.into());
        let back = reference.motion(&composition.layout, &state, &sample).unwrap();
        assert!((back.velocity - motion.velocity).norm() < 1e-6, "{}", back.velocity);
        assert!(back.position.ned_from(&motion.position).norm() < 2e-6);
    }

    /// A lever arm turns with the attitude of a process, and one that exists under another name is
    /// meant.
    #[test]
    fn a_reference_that_needs_a_process_names_the_one_that_is_missing() {
        let vehicle = |lever_arm: &str, process: &str| {
            let text = format!("name = 'reference'\n{process}\n[sensor.reference]\n{lever_arm}\n");
            compose(&text, &[]).map_or_else(|error| error, |_| String::new())
        };
        let ins = "[process.strapdown]\ntype = 'ins'\nattitude = { sigma = '1 deg' }
            velocity = { sigma = '1 m/s' }\nposition = { sigma = '1 m' }
            [sensor.imu]\ngyro_noise = '1 deg/h/sqrt(Hz)'\naccel_noise = '1 mg/sqrt(Hz)'";
        assert!(!vehicle("", "").contains("ins.attitude"), "{}", vehicle("", ""));
        for (lever_arm, process) in [("lever_arm = '1 m'", ""), ("", ins)] {
            let error = vehicle(lever_arm, process);
            assert!(error.contains("ins.attitude"), "{error}");
        }
        let named = vehicle("navigation = 'strapdown'", ins);
        assert_eq!(named, "");
    }
}
