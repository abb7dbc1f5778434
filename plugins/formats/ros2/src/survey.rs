//! The content of a bag: its topics with their rates, stamps and frames.

use crate::bag::Bag;
use crate::cdr::{Body, Cursor, body};
use crate::form::Form;
use crate::program::{Program, SLOTS, has_field};
use crate::route::{Delay, stamp_path};
use crate::transforms::Transforms;
use navfuse_core::model::stream::StreamError;
use std::path::PathBuf;

/// Words in the name of a topic or a frame of a velocity log.
const LOGS: [&str; 5] = ["dvl", "doppler", "bottom_track", "bottomtrack", "velocity_log"];
/// Types of messages with a number alone.
const NUMBERS: [&str; 2] = ["std_msgs/Float64", "std_msgs/Float32"];

/// The use of a topic that its type suggests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Use {
    /// Inertial measurements.
    Imu,
    /// Fixes of GNSS.
    Fix,
    /// Velocities of a log.
    VelocityLog,
    /// Pressure.
    Pressure,
    /// Odometry of another program.
    Odometry,
    /// Poses with a covariance.
    Pose,
    /// Poses whose height alone changes, or numbers of a topic that is called depth.
    Depth,
    /// Velocities along the axes of a velocity log, by the name of the topic or of the frame: a twist, or an
    /// odometry that never moves along x and y.
    LogTwist,
    /// Inertial measurements of PX4.
    Px4Imu,
    /// Fixes of PX4.
    Px4Fix,
}

/// A topic of a bag.
#[derive(Clone, Debug)]
pub struct TopicSurvey {
    /// Its name.
    pub name: String,
    /// The type of its messages.
    pub kind: String,
    /// The use that the type suggests.
    pub usage: Option<Use>,
    /// Number of messages.
    pub messages: u64,
    /// Times at which the first and the last message were received, nanoseconds since 1970.
    pub span: [i64; 2],
    /// Frame of the sensor, as the first message names it. That of an odometry is its child frame,
    /// whose pose it gives.
    pub frame: String,
    /// Number of messages whose stamp is zero.
    pub unstamped: u64,
    /// The time from the stamps to receiving.
    delay: Delay,
    /// How the stamp is read, if the type has one.
    stamp: Option<Program>,
    /// Set if the message begins with a header.
    headed: bool,
    /// The coordinates of a pose.
    place: Option<Program>,
    /// Set while no pose has moved along x or y.
    upright: bool,
}

impl TopicSurvey {
    /// Mean rate, Hz.
    pub fn rate(&self) -> f64 {
        let span = (self.span[1] - self.span[0]) as f64 * 1e-9;
        if span > 0.0 { (self.messages - 1) as f64 / span } else { 0.0 }
    }

    /// The use, as the type and the messages suggest it.
    pub fn usage(&self) -> Option<Use> {
        let has = |words: &[&str], name: &str| {
            let name = name.to_lowercase();
            words.iter().any(|word| name.contains(word))
        };
        let log = has(&LOGS, &self.name) || has(&LOGS, &self.frame);
        let rests = self.upright && self.messages > 1;
        let twist = self.kind.starts_with("geometry_msgs/Twist") && self.headed;
        match self.usage {
            Some(Use::Pose) if rests => Some(Use::Depth),
            Some(Use::Odometry) if rests && log => Some(Use::LogTwist),
            None if twist && log => Some(Use::LogTwist),
            None if NUMBERS.contains(&self.kind.as_str()) && has(&["depth"], &self.name) => {
                Some(Use::Depth)
            }
            usage => usage,
        }
    }

    /// The mean time from the stamps to receiving, s, if the messages have stamps.
    pub fn lag(&self) -> Option<f64> {
        self.delay.mean()
    }

    /// Describes the time from the stamps to receiving.
    pub fn delay(&self) -> Option<String> {
        self.delay.describe()
    }
}

/// The content of a bag.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// The topics in the order of the bag.
    pub topics: Vec<TopicSurvey>,
    /// The frames of `/tf_static`.
    pub frames: Transforms,
    /// What was damaged.
    pub faults: Option<String>,
}

/// Reads a bag once and describes its content. Returns `None` if `stop` returned `true`.
///
/// # Errors
/// When the bag cannot be read.
pub fn survey(
    paths: &[PathBuf],
    mut stop: impl FnMut() -> bool,
) -> Result<Option<Survey>, StreamError> {
    let mut bag = Bag::open(paths)?;
    let mut found = Survey::default();
    let mut count = 0_u64;
    while let Some(message) = bag.next(|_| true)? {
        let (topic, received, data) = (message.topic, message.received, message.data);
        count += 1;
        if count.is_multiple_of(4096) && stop() {
            return Ok(None);
        }
        if let Some(known) = found.topics.get_mut(topic) {
            known.take(received, data);
            if known.kind == "tf2_msgs/TFMessage" && known.name.ends_with("tf_static") {
                let _ = found.frames.take(data); // a malformed message has no frames
            }
            continue;
        }
        let data = data.to_vec();
        for new in &bag.topics()[found.topics.len()..] {
            let kind = new.short_kind();
            let definitions = new.definitions().unwrap_or_default();
            let has = |field: &str| has_field(&definitions, &kind, field);
            let px4 = match kind.as_str() {
                "px4_msgs/SensorCombined" => Some(Use::Px4Imu),
                "px4_msgs/SensorGps" if has("latitude_deg") => Some(Use::Px4Fix),
                _ => None,
            };
            let usage = px4.or_else(|| {
                Form::of(&kind).and_then(|form| match form {
                    Form::Imu => Some(Use::Imu),
                    Form::Fix => Some(Use::Fix),
                    Form::MarineDvl | Form::WaterLinked | Form::Nortek => Some(Use::VelocityLog),
                    Form::Pressure => Some(Use::Pressure),
                    Form::Odometry => Some(Use::Odometry),
                    Form::Pose if kind.contains("Covariance") => Some(Use::Pose),
                    _ => None,
                })
            });
            let stamp = stamp_path(&definitions, &kind).and_then(|path| {
                let paths = ["sec", "nanosec"].map(|part| format!("{path}.{part}"));
                Program::new(&definitions, &kind, &[paths[0].as_str(), paths[1].as_str()]).ok()
            });
            let headed = definitions
                .fields(&kind)
                .is_ok_and(|fields| fields.first().is_some_and(|f| f.name == "header"));
            let place = matches!(usage, Some(Use::Pose | Use::Odometry)).then(|| {
                let path = ["x", "y"].map(|axis| format!("pose.pose.position.{axis}"));
                Program::new(&definitions, &kind, &[path[0].as_str(), path[1].as_str()]).ok()
            });
            found.topics.push(TopicSurvey {
                place: place.flatten(),
                upright: true,
                name: new.name.clone(),
                kind,
                usage,
                messages: 0,
                span: [0; 2],
                frame: String::new(),
                unstamped: 0,
                delay: Delay::default(),
                stamp,
                headed,
            });
        }
        if let Some(new) = found.topics.get_mut(topic) {
            if new.headed {
                let of_child = new.usage == Some(Use::Odometry);
                new.frame = frame(&data, of_child).unwrap_or_default();
            }
            new.take(received, &data);
            if new.kind == "tf2_msgs/TFMessage" && new.name.ends_with("tf_static") {
                let _ = found.frames.take(&data);
            }
        }
    }
    found.faults = bag.faults();
    Ok(Some(found))
}

/// The frame in the header at the beginning of a message, or the child frame after it.
fn frame(message: &[u8], of_child: bool) -> Option<String> {
    fn read<const LITTLE: bool>(mut at: Cursor<'_, LITTLE>, of_child: bool) -> Option<String> {
        at.stamp().ok()?;
        if of_child {
            at.text().ok()?;
        }
        Some(String::from_utf8_lossy(at.text().ok()?).into_owned())
    }
    match body(message).ok()? {
        Body::Little(bytes) => read(Cursor::<true>::new(bytes), of_child),
        Body::Big(bytes) => read(Cursor::<false>::new(bytes), of_child),
        Body::Packed(bytes) => read(Cursor::<true>::packed(bytes), of_child),
    }
}

impl TopicSurvey {
    fn take(&mut self, received: i64, data: &[u8]) {
        if self.messages == 0 {
            self.span[0] = received;
        }
        self.messages += 1;
        self.span[1] = received;
        if let Some(place) = self.place.as_ref().filter(|_| self.upright) {
            let mut slots = [f64::NAN; SLOTS];
            self.upright = place.read(data, &mut slots).is_ok() && slots[..2] == [0.0, 0.0];
        }
        let Some(stamp) = &self.stamp else { return };
        let mut slots = [f64::NAN; SLOTS];
        if stamp.read(data, &mut slots).is_err() {
            return;
        }
        if slots[0] == 0.0 && slots[1] == 0.0 {
            self.unstamped += 1;
        } else {
            let stamp = slots[0] as i64 * 1_000_000_000 + slots[1] as i64;
            self.delay.add(received.saturating_sub(stamp));
        }
    }
}
