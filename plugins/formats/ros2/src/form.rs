//! The known message types: their fields, and the channels that they fill.

use crate::axes::{Axes, attitude, swap};
use crate::config::{TopicConfig, Tracked};
use crate::definition::Definitions;
use crate::error::DefinitionError;
use crate::program::{Program, has_field};
use crate::relative::{CHANNELS as MOTION, Chain, pose};
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_frames::validity::{accuracy, is_place, is_refused, is_velocity};
use std::cell::Cell;

/// Standard atmosphere, Pa.
const ATMOSPHERE: f64 = 101_325.0;
/// Density of sea water, kg/m^3.
const SEA_WATER: f64 = 1025.0;
/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.806_65;

/// A known type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    Imu,
    Fix,
    Twist,
    Odometry,
    Pose,
    Orientation,
    Pressure,
    Magnetic,
    Range,
    /// `marine_acoustic_msgs/Dvl`.
    MarineDvl,
    /// The message of Water Linked's driver and of those like it.
    WaterLinked,
    /// Bottom track of Nortek's driver.
    Nortek,
}

/// The reason why an intact message gives no sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unused {
    /// A receiver without a fix.
    NoFix,
    /// A velocity that the instrument declares invalid.
    Invalid,
    /// A velocity over the bottom where that through the water is wanted, or the other way round.
    OtherTrack,
    /// None of its numbers belongs to the sensor.
    Empty,
}

/// The values of a message by the names of the channels; NaN where it has none.
pub type Values = [f64; 22];

const RATES: [&str; 6] = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"];

/// The variances of the three velocities.
const TWIST_VARIANCES: [&str; 3] =
    ["twist.covariance[0]", "twist.covariance[7]", "twist.covariance[14]"];

/// The fields of three coordinates and of a quaternion below a path.
fn below(path: &str, names: &[&str]) -> Vec<String> {
    names.iter().map(|name| format!("{path}.{name}")).collect()
}

impl Form {
    /// The form of a type.
    pub fn of(kind: &str) -> Option<Self> {
        Some(match kind {
            "sensor_msgs/Imu" => Self::Imu,
            "sensor_msgs/NavSatFix" => Self::Fix,
            "geometry_msgs/TwistStamped"
            | "geometry_msgs/TwistWithCovarianceStamped"
            | "geometry_msgs/Twist" => Self::Twist,
            "nav_msgs/Odometry" => Self::Odometry,
            "geometry_msgs/PoseWithCovarianceStamped" | "geometry_msgs/PoseStamped" => Self::Pose,
            "geometry_msgs/QuaternionStamped" => Self::Orientation,
            "sensor_msgs/FluidPressure" => Self::Pressure,
            "sensor_msgs/MagneticField" => Self::Magnetic,
            "sensor_msgs/Range" => Self::Range,
            "marine_acoustic_msgs/Dvl" => Self::MarineDvl,
            "interfaces/BottomTrack" | "nucleus_driver_msgs/BottomTrack" => Self::Nortek,
            // the package has other names in later versions and in copies
            other => match other.split('/').next_back() {
                Some("DVL") => Self::WaterLinked,
                Some("BottomTrack") => Self::Nortek,
                _ => return None,
            },
        })
    }

    /// The fields in the order of their slots; those that may be missing come last.
    fn fields(self, kind: &str) -> Vec<String> {
        let text = |fields: &[&str]| fields.iter().map(|f| (*f).to_owned()).collect::<Vec<_>>();
        let (xyz, xyzw) = (["x", "y", "z"], ["x", "y", "z", "w"]);
        match self {
            Self::Imu => [
                below("angular_velocity", &xyz),
                below("linear_acceleration", &xyz),
                below("orientation", &xyzw),
                text(&[
                    "angular_velocity_covariance[0]",
                    "linear_acceleration_covariance[0]",
                    "orientation_covariance[0]",
                ]),
            ]
            .concat(),
            Self::Fix => text(&[
                "latitude",
                "longitude",
                "altitude",
                "status.status",
                "position_covariance[0]",
                "position_covariance[4]",
                "position_covariance[8]",
                "position_covariance_type",
            ]),
            Self::Twist => [
                below(
                    match kind {
                        "geometry_msgs/Twist" => "linear",
                        "geometry_msgs/TwistStamped" => "twist.linear",
                        _ => "twist.twist.linear",
                    },
                    &xyz,
                ),
                text(&TWIST_VARIANCES),
            ]
            .concat(),
            Self::Odometry => [
                below("pose.pose.position", &xyz),
                below("pose.pose.orientation", &xyzw),
                below("twist.twist.linear", &xyz),
                text(&TWIST_VARIANCES),
            ]
            .concat(),
            Self::Pose => {
                let pose = if kind == "geometry_msgs/PoseStamped" { "pose" } else { "pose.pose" };
                [
                    below(&format!("{pose}.position"), &xyz),
                    below(&format!("{pose}.orientation"), &xyzw),
                ]
                .concat()
            }
            Self::Orientation => below("quaternion", &xyzw),
            Self::Pressure => text(&["fluid_pressure"]),
            Self::Magnetic => below("magnetic_field", &xyz),
            Self::Range => text(&["range"]),
            Self::MarineDvl => {
                let rest = ["velocity_mode", "num_good_beams", "altitude", "velocity_covar[0]"];
                [below("velocity", &xyz), text(&rest)].concat()
            }
            Self::WaterLinked => {
                let rest =
                    ["velocity_valid", "altitude", "covariance[0]", "velocity_covariance[0]"];
                [below("velocity", &xyz), text(&rest)].concat()
            }
            Self::Nortek => text(&[
                "velocity_x",
                "velocity_y",
                "velocity_z",
                "x_velocity_valid",
                "y_velocity_valid",
                "z_velocity_valid",
            ]),
        }
    }

    /// Number of fields without which a message has no use.
    fn needed(self) -> usize {
        match self {
            Self::Imu => 6,
            Self::Fix => 2,
            Self::Odometry | Self::Pose => 3,
            Self::Orientation => 4,
            Self::Pressure | Self::Range => 1,
            _ => 3,
        }
    }

    /// The steps that read the fields, after `first` others.
    pub fn program(
        self,
        definitions: &Definitions,
        kind: &str,
        first: &[&str],
    ) -> Result<Program, DefinitionError> {
        let mut paths: Vec<String> = first.iter().map(|f| (*f).to_owned()).collect();
        for (k, field) in self.fields(kind).into_iter().enumerate() {
            // the slot of a field that this version of the type lacks stays empty
            let there = k < self.needed() || has_field(definitions, kind, &field);
            paths.push(if there { field } else { String::new() });
        }
        let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
        Program::new(definitions, kind, &paths)
    }

    /// The channels that the form can fill, in the order of [`Values`].
    pub fn channels(self) -> &'static [&'static str] {
        const BODY: [&str; 6] = ["vel_x", "vel_y", "vel_z", "speed", "lateral", "vertical"];
        match self {
            Self::Imu => &[
                RATES[0], RATES[1], RATES[2], RATES[3], RATES[4], RATES[5], "roll", "pitch", "yaw",
                "heading",
            ],
            Self::Fix => &["lat", "lon", "height", "h_acc", "v_acc"],
            Self::Twist => {
                &[BODY[0], BODY[1], BODY[2], BODY[3], BODY[4], BODY[5], "vel_n", "vel_e", "vel_d"]
            }
            Self::Odometry => &[
                BODY[0], BODY[1], BODY[2], BODY[3], BODY[4], BODY[5], "vel_n", "vel_e", "vel_d",
                "lat", "lon", "height", "roll", "pitch", "yaw", "heading", MOTION[0], MOTION[1],
                MOTION[2], MOTION[3], MOTION[4], MOTION[5],
            ],
            Self::Pose => &[
                "lat", "lon", "height", "roll", "pitch", "yaw", "heading", "depth", MOTION[0],
                MOTION[1], MOTION[2], MOTION[3], MOTION[4], MOTION[5],
            ],
            Self::Orientation => &["roll", "pitch", "yaw", "heading"],
            Self::Pressure => &["depth"],
            Self::Magnetic => &["heading", "mag_x", "mag_y", "mag_z"],
            Self::Range => &["range", "altitude"],
            Self::MarineDvl | Self::WaterLinked | Self::Nortek => {
                &["vel_x", "vel_y", "vel_z", "altitude"]
            }
        }
    }

    /// Axes of the type, where no key gives others.
    fn axes(self) -> Axes {
        match self {
            Self::MarineDvl | Self::WaterLinked | Self::Nortek => Axes::Frd,
            _ => Axes::Flu,
        }
    }
}

/// The velocities without those that their variances refuse.
fn unrefused(velocity: [f64; 3], variances: [f64; 3]) -> Result<[f64; 3], Unused> {
    if variances.iter().all(|variance| is_refused(*variance)) {
        return Err(Unused::Invalid);
    }
    let one = |k: usize| if is_refused(variances[k]) { f64::NAN } else { velocity[k] };
    Ok(std::array::from_fn(one))
}

/// A form with the keys of its sensor.
#[derive(Clone, Debug)]
pub struct Converter {
    form: Form,
    axes: Axes,
    rotation: Option<Rotation3<f64>>,
    datum: Option<Geodetic>,
    atmosphere: f64,
    /// Pascals of one metre of water.
    gradient: f64,
    track: Tracked,
    /// Set once a message counted the beams that see the bottom.
    counts: Cell<bool>,
}

impl Converter {
    /// The form for a sensor with these keys.
    pub fn new(form: Form, config: &TopicConfig) -> Self {
        let density = config.density.map_or(SEA_WATER, |d| d.si());
        Self {
            form,
            axes: config.axes.unwrap_or_else(|| form.axes()),
            rotation: config.rotation.map(|r| {
                let [roll, pitch, yaw]: [f64; 3] = r.si().into();
                Rotation3::from_euler_angles(roll, pitch, yaw)
            }),
            datum: config.datum.map(|d| d.position()),
            atmosphere: config.atmosphere.map_or(ATMOSPHERE, |p| p.si()),
            gradient: density * GRAVITY,
            track: config.track,
            counts: Cell::new(false),
        }
    }

    /// A vector along the sensor's axes, along those of the vehicle.
    fn body(&self, vector: [f64; 3]) -> [f64; 3] {
        let vector = self.axes.body(vector);
        self.rotation.map_or(vector, |r| (r * Vector3::from(vector)).into())
    }

    /// The chain of the poses of a sensor with these channels, if it measures relative poses.
    pub fn chain(&self, channels: &[Option<usize>]) -> Option<Chain> {
        let first = self.form.channels().iter().position(|name| *name == MOTION[0])?;
        let mut found = [0; MOTION.len()];
        for (found, channel) in found.iter_mut().zip(channels.get(first..)?) {
            *found = (*channel)?;
        }
        let unit =
            |k| Vector3::from(self.body(std::array::from_fn(|i| f64::from(u8::from(i == k)))));
        Some(Chain::new(found, Matrix3::from_columns(&[unit(0), unit(1), unit(2)])))
    }

    /// A vector along the axes of the world.
    fn world(&self, vector: [f64; 3]) -> [f64; 3] {
        if self.axes == Axes::Flu { swap(vector) } else { vector }
    }

    /// The attitude of the vehicle from that of the sensor.
    fn attitude(&self, q: [f64; 4]) -> Option<Rotation3<f64>> {
        let c = attitude(q, self.axes)?;
        Some(self.rotation.map_or(c, |r| c * r.inverse()))
    }

    /// The values of the channels from the fields of a message.
    pub fn values(&self, slots: &[f64]) -> Result<Values, Unused> {
        let three = |k: usize| [slots[k], slots[k + 1], slots[k + 2]];
        let four = |k: usize| [slots[k], slots[k + 1], slots[k + 2], slots[k + 3]];
        let mut out = [f64::NAN; 22];
        let mut put = |k: usize, values: &[f64]| out[k..k + values.len()].copy_from_slice(values);
        let angles = |c: Rotation3<f64>| {
            let (roll, pitch, yaw) = c.euler_angles();
            [roll, pitch, yaw, yaw.rem_euclid(std::f64::consts::TAU)]
        };
        match self.form {
            Form::Imu => {
                if !is_refused(slots[10]) {
                    put(0, &self.body(three(0)));
                }
                if !is_refused(slots[11]) {
                    put(3, &self.body(three(3)));
                }
                if !is_refused(slots[12])
                    && let Some(c) = self.attitude(four(6))
                {
                    put(6, &angles(c));
                }
            }
            Form::Fix => {
                let [lat, lon] = [slots[0], slots[1]].map(f64::to_radians);
                let known = slots[7] > 0.0;
                let refused = known && slots[4..6].iter().any(|v| is_refused(*v));
                if slots[3] < 0.0 || refused || !is_place(lat, lon) {
                    return Err(Unused::NoFix);
                }
                put(0, &[lat, lon, slots[2]]);
                if known {
                    // that of each axis: the root of the mean square
                    let both = [0.5 * (slots[4] + slots[5]), slots[6]];
                    put(3, &both.map(|variance| accuracy(variance).unwrap_or(f64::NAN)));
                }
            }
            Form::Twist => {
                let v = unrefused(three(0), three(3))?;
                let (body, world) = (self.body(v), self.world(v));
                put(0, &[body, body, world].concat());
            }
            Form::Odometry => {
                let v = self.body(unrefused(three(7), three(10)).unwrap_or([f64::NAN; 3]));
                put(0, &[v, v].concat());
                if let Some(c) = self.attitude(four(3)) {
                    put(6, (c * Vector3::from(v)).as_slice());
                    put(12, &angles(c));
                }
                put(9, &self.position(three(0)));
                put(16, &pose(three(0), four(3)).unwrap_or([f64::NAN; 6]));
            }
            Form::Pose => {
                put(0, &self.position(three(0)));
                if let Some(c) = self.attitude(four(3)) {
                    put(3, &angles(c));
                }
                put(7, &[self.world(three(0))[2]]);
                put(8, &pose(three(0), four(3)).unwrap_or([f64::NAN; 6]));
            }
            Form::Orientation => {
                if let Some(c) = self.attitude(four(0)) {
                    put(0, &angles(c));
                }
            }
            Form::Pressure => put(0, &[(slots[0] - self.atmosphere) / self.gradient]),
            Form::Magnetic => {
                let m = self.body(three(0));
                // of a level vehicle: the field points to magnetic north
                let heading = (-m[1]).atan2(m[0]).rem_euclid(std::f64::consts::TAU);
                put(0, &[heading, m[0], m[1], m[2]]);
            }
            Form::Range => put(0, &[slots[0], slots[0]]),
            Form::MarineDvl | Form::WaterLinked | Form::Nortek => self.velocity_log(slots, put)?,
        }
        Ok(out)
    }

    /// The velocity of a log over the bottom or through the water.
    fn velocity_log(
        &self,
        slots: &[f64],
        mut put: impl FnMut(usize, &[f64]),
    ) -> Result<(), Unused> {
        let v = [slots[0], slots[1], slots[2]];
        let (valid, altitude) = match self.form {
            Form::MarineDvl => {
                let water = slots[3] == 2.0;
                if water != (self.track == Tracked::Water) {
                    return Err(Unused::OtherTrack);
                }
                // three beams give a velocity; a driver without the count always leaves it zero
                self.counts.set(self.counts.get() || slots[4] > 0.0);
                let uncounted = !self.counts.get() && v != [0.0; 3];
                let beams = slots[4].is_nan() || slots[4] >= 3.0 || uncounted;
                (beams && !is_refused(slots[6]), slots[5])
            }
            Form::WaterLinked => {
                let refused = slots[5..7].iter().any(|variance| is_refused(*variance));
                (slots[3] != 0.0 && !refused, slots[4])
            }
            _ => (slots[3..6].iter().all(|valid| *valid != 0.0), f64::NAN),
        };
        if !valid || !v.iter().all(|v| is_velocity(*v)) {
            return Err(Unused::Invalid);
        }
        put(0, &self.body(v));
        put(3, &[altitude]);
        Ok(())
    }

    /// Latitude, longitude and height of coordinates from the datum.
    fn position(&self, coordinates: [f64; 3]) -> [f64; 3] {
        let Some(datum) = self.datum else { return [f64::NAN; 3] };
        let p = datum.displaced(&Vector3::from(self.world(coordinates)));
        [p.latitude, p.longitude, p.height]
    }
}

#[cfg(test)]
mod tests;
