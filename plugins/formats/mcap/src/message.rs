//! The messages of the log in CDR, little-endian. [`crate::schema`] has their definitions.

use crate::pose::{ENU_NED, Link, Pose, Velocity};
use crate::template::ImuMessage;
use nalgebra::{Matrix3, Matrix6, UnitQuaternion};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Derived, Event, Level, Outcome, UpdateRecord};
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use re_cdr::{CdrWriter, LittleEndian};
use std::borrow::Cow;

/// The fixed frame: north, east, down in the tangent at the first epoch's position.
pub const FIXED_FRAME: &str = "ned";
/// The body: forward, right, down.
pub const BODY_FRAME: &str = "base_link_frd";
/// Standard atmosphere, Pa.
pub const ATMOSPHERE: f64 = 101_325.0;
/// Pressure of one metre of sea water (1025 kg/m^3) at standard gravity, Pa.
pub const PASCALS_PER_METRE: f64 = 1025.0 * 9.806_65;
/// Bits of a missing channel in a message without presence bits: a NaN that no computation returns.
pub const MISSING: u64 = 0x7ff8_0000_6d69_7373;

/// A time in the form of ROS: whole seconds, rounded down, and nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds, below a second.
    pub nanosec: u32,
}

impl Stamp {
    /// The time zero.
    pub(crate) const ZERO: Self = Self { sec: 0, nanosec: 0 };
    const NANOS: i64 = 1_000_000_000;

    /// The stamp of a time.
    ///
    /// # Errors
    /// When the time is more than 68 years from zero.
    pub fn new(time: Time) -> Result<Self, StreamError> {
        let nanos = time.nanos();
        let sec = i32::try_from(nanos.div_euclid(Self::NANOS)).map_err(|_| {
            StreamError::format(format!(
                "the time {time} does not fit a ROS time stamp, which ends 68 years from zero"
            ))
        })?;
        Ok(Self { sec, nanosec: nanos.rem_euclid(Self::NANOS) as u32 })
    }

    /// The time of a stamp: the inverse of [`Self::new`].
    pub fn time(self) -> Time {
        Time::from_nanos(i64::from(self.sec) * Self::NANOS + i64::from(self.nanosec))
    }
}

/// State of a part of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// It works.
    Ok,
    /// It works in part.
    Warn,
    /// It gives nothing.
    Stale,
}

/// The state of a sensor as a status of `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// Name of the sensor.
    pub name: String,
    /// State.
    pub health: Health,
    /// State in words.
    pub text: Cow<'static, str>,
    /// Further values, each with its name.
    pub values: Vec<(Cow<'static, str>, String)>,
}

/// The use of a sample in words; the columns name the channels.
pub fn outcome_words(outcome: Outcome, columns: &[String]) -> Cow<'static, str> {
    match outcome {
        Outcome::Accepted => "accepted".into(),
        Outcome::Placed => "placed".into(),
        Outcome::Gated => "gated".into(),
        Outcome::Rejected(why) => format!("rejected: {}", why.reason(columns)).into(),
    }
}

/// Appends one message to a buffer.
pub struct Encoder<'a>(CdrWriter<'a, LittleEndian>);

impl<'a> Encoder<'a> {
    /// Begins a message.
    pub fn new(buffer: &'a mut Vec<u8>) -> Self {
        buffer.extend_from_slice(&[0, 1, 0, 0]); // plain CDR, little-endian
        Self(CdrWriter::new(buffer))
    }

    /// A message that is complete.
    pub(crate) fn whole(mut self, message: &[u8]) {
        // the four bytes of the format are there already
        self.0.buffer_mut().extend_from_slice(&message[4..]);
    }

    fn stamp(&mut self, stamp: Stamp) {
        self.0.write_i32(stamp.sec);
        self.0.write_u32(stamp.nanosec);
    }

    pub(crate) fn header(&mut self, stamp: Stamp, frame: &str) {
        self.stamp(stamp);
        self.0.write_string(frame);
    }

    /// Numbers, which are aligned once and copied by eights: a message of an IMU has 37 of them.
    pub(crate) fn numbers(&mut self, values: &[f64]) {
        if values.is_empty() {
            return;
        }
        self.0.align(size_of::<f64>());
        let buffer = self.0.buffer_mut();
        for values in values.chunks(8) {
            let mut bytes = [0; 8 * size_of::<f64>()];
            for (bytes, value) in bytes.as_chunks_mut().0.iter_mut().zip(values) {
                *bytes = value.to_le_bytes();
            }
            buffer.extend_from_slice(&bytes[..size_of_val(values)]);
        }
    }

    /// A sequence of numbers; returns the place of the first.
    pub(crate) fn sequence(&mut self, values: &[f64]) -> usize {
        self.0.write_sequence_length(values.len());
        self.numbers(values);
        self.0.buffer_mut().len() - size_of_val(values)
    }

    pub(crate) fn texts<'t>(&mut self, texts: impl ExactSizeIterator<Item = &'t str>) {
        self.0.write_sequence_length(texts.len());
        texts.for_each(|t| self.0.write_string(t));
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.0.write_string(text);
    }

    pub(crate) fn length(&mut self, length: usize) {
        self.0.write_sequence_length(length);
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.0.write_bool(flag);
    }

    pub(crate) fn integers(&mut self, values: &[i32]) {
        values.iter().for_each(|value| self.0.write_i32(*value));
    }

    pub(crate) fn reals(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.0.write_f32(*value));
    }

    pub(crate) fn quaternion(&mut self, q: &UnitQuaternion<f64>) {
        self.numbers(&[q.i, q.j, q.k, q.w]);
    }

    /// `sensor_msgs/Imu`: three rates (rad/s) and three specific forces (m/s^2); no orientation.
    pub fn imu(self, stamp: Stamp, sample: &Sample) {
        self.whole(ImuMessage::default().of(stamp, sample));
    }

    /// `sensor_msgs/FluidPressure` at a depth (m).
    pub fn pressure(mut self, stamp: Stamp, depth: f64) {
        self.header(stamp, BODY_FRAME);
        self.numbers(&[ATMOSPHERE + PASCALS_PER_METRE * depth, 0.0]);
    }

    /// `sensor_msgs/NavSatFix` of a frame's origin, with the covariance of north, east, down (m^2)
    /// where it is known.
    pub fn fix(
        mut self,
        stamp: Stamp,
        frame: &str,
        position: &Geodetic,
        covariance: Option<&Matrix3<f64>>,
    ) {
        self.header(stamp, frame);
        self.0.write_i8(0); // a fix
        self.0.write_u16(0); // of no satellite system
        self.numbers(&[
            position.latitude.to_degrees(),
            position.longitude.to_degrees(),
            position.height,
        ]);
        let enu = covariance.map_or_else(Matrix3::zeros, |p| ENU_NED * p * ENU_NED);
        self.numbers(enu.transpose().as_slice());
        self.0.write_u8(if covariance.is_some() { 3 } else { 0 });
    }

    /// `geometry_msgs/TwistWithCovarianceStamped` of a velocity (m/s) along the axes of a frame, whose
    /// accuracy and angular rate are unknown.
    pub fn twist(mut self, stamp: Stamp, frame: &str, velocity: &[f64; 3]) {
        self.header(stamp, frame);
        self.numbers(velocity);
        self.numbers(&[0.0; 3 + 36]);
    }

    /// `nav_msgs/Odometry`: position (m) and attitude in the first frame, velocity (m/s) along the
    /// axes of the second, and their covariances. The angular rate is not given: the first element
    /// of its covariance is -1.
    pub fn odometry(
        mut self,
        stamp: Stamp,
        [fixed, body]: [&str; 2],
        pose: &Pose,
        velocity: &Velocity,
    ) {
        self.header(stamp, fixed);
        self.0.write_string(body);
        self.numbers(pose.position.as_slice());
        self.quaternion(&pose.attitude);
        self.numbers(pose.covariance.transpose().as_slice());
        self.numbers(velocity.body.as_slice());
        self.numbers(&[0.0; 3]);
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&velocity.covariance);
        covariance[(3, 3)] = -1.0;
        self.numbers(covariance.transpose().as_slice());
    }

    /// `geometry_msgs/PoseWithCovarianceStamped`: position (m) and attitude in a frame, and their covariance.
    pub fn pose(mut self, stamp: Stamp, frame: &str, pose: &Pose) {
        self.header(stamp, frame);
        self.numbers(pose.position.as_slice());
        self.quaternion(&pose.attitude);
        self.numbers(pose.covariance.transpose().as_slice());
    }

    /// `tf2_msgs/TFMessage`.
    pub fn transforms<'l>(mut self, stamp: Stamp, links: impl Iterator<Item = Link<'l>> + Clone) {
        self.0.write_sequence_length(links.clone().count());
        for link in links {
            self.header(stamp, link.parent);
            self.0.write_string(link.child);
            self.numbers(link.translation.as_slice());
            self.quaternion(&link.rotation);
        }
    }

    /// `diagnostic_msgs/DiagnosticArray`.
    pub fn diagnostics(mut self, stamp: Stamp, sensors: &[Diagnosis]) {
        self.header(stamp, "");
        self.0.write_sequence_length(sensors.len());
        for sensor in sensors {
            self.0.write_u8(match sensor.health {
                Health::Ok => 0,
                Health::Warn => 1,
                Health::Stale => 3,
            });
            for text in [&sensor.name, sensor.text.as_ref(), ""] {
                self.0.write_string(text);
            }
            self.0.write_sequence_length(sensor.values.len());
            for (key, value) in &sensor.values {
                self.0.write_string(key);
                self.0.write_string(value);
            }
        }
    }

    /// `navfuse_msgs/Innovation`.
    pub fn innovation(
        mut self,
        stamp: Stamp,
        sensor: &str,
        columns: &[String],
        update: &UpdateRecord<'_>,
    ) {
        let dof = update.channels().count();
        self.header(stamp, sensor);
        self.0.write_string(&outcome_words(update.outcome, columns));
        self.numbers(&[update.nis, update.threshold]);
        self.0.write_u32(dof as u32);
        self.0.write_sequence_length(dof);
        update.channels().for_each(|(i, _, _)| self.0.write_string(&columns[i]));
        self.0.write_sequence_length(dof);
        update.channels().for_each(|(_, innovation, _)| self.0.write_f64(innovation));
        self.0.write_sequence_length(dof);
        update.channels().for_each(|(_, _, sigma)| self.0.write_f64(sigma));
    }

    /// `navfuse_msgs/Finding`.
    pub fn finding(mut self, stamp: Stamp, finding: &Finding) {
        self.header(stamp, &finding.about);
        let Finding { severity, basis, text, remedy, .. } = finding;
        for text in [severity.name(), basis.name(), text, remedy] {
            self.0.write_string(text);
        }
    }

    /// `navfuse_msgs/Rejection`.
    pub fn rejection(mut self, stamp: Stamp, sensor: &str, reason: &str) {
        self.header(stamp, sensor);
        self.0.write_string(reason);
    }

    /// `navfuse_msgs/Derived`.
    pub fn derived(mut self, stamp: Stamp, derived: &Derived) {
        self.header(stamp, &derived.name);
        self.0.write_string(&derived.unit);
        self.texts(derived.rows.iter().map(String::as_str));
        self.texts(derived.columns.iter().map(String::as_str));
        self.sequence(&derived.values);
    }

    /// `rcl_interfaces/Log`.
    pub fn log(mut self, stamp: Stamp, event: &Event) {
        self.stamp(stamp);
        self.0.write_u8(match event.level {
            Level::Info => 20,
            Level::Warning => 30,
            Level::Error => 40,
        });
        self.0.write_string(&event.about);
        self.0.write_string(&event.text);
        self.0.write_string("");
        self.0.write_string("");
        self.0.write_u32(0);
    }
}
