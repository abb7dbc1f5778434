//! Bags of ROS 2: the sensors by the types of the topics.

use crate::found::{Found, OdometryUse};
use navfuse_core::document::quoted;
use navfuse_core::model::stream::StreamError;
use navfuse_ros2::{Survey, TopicSurvey, Use};
use std::path::Path;

/// First bytes of MCAP and of SQLite, the storages of bags of ROS 2, and of a bag of ROS 1.
const STORAGES: [&[u8]; 3] = [b"\x89MCAP", b"SQLite format 3\0", b"#ROSBAG V2.0\n"];
/// The frame of the vehicle, where a bag has it.
const BASE: &str = "base_link";
/// Rotation, rad, below which two frames have the same axes.
const ALIGNED: f64 = 1e-9;

/// A sensor of a bag.
#[derive(Clone, Debug)]
pub struct InBag {
    pub found: Found,
    /// Its position from the IMU along forward, right, down, m, as the frames of the bag have it.
    pub lever_arm: Option<[f64; 3]>,
}

/// Tests whether a file is a bag, by its first bytes. A folder is one, too.
pub fn is_bag(file: &Path, beginning: &[u8]) -> bool {
    file.is_dir() || STORAGES.iter().any(|magic| beginning.starts_with(magic))
}

/// Difference of the times from stamp to receiving, s, beyond which stamps are of several clocks.
const CLOCKS: f64 = 1.0;
/// Words in the names of topics that measure another pressure than the pressure of the water.
const INSIDE: [&str; 6] = ["leak", "internal", "hull", "vacuum", "air", "baro"];

/// Tests whether the stamps of the topics are of several clocks, as where a driver sets none.
fn several_clocks(survey: &Survey) -> bool {
    let used = survey.topics.iter().filter(|t| t.usage().is_some() && t.messages > 0);
    let lags: Vec<f64> = used.map(|t| t.lag().unwrap_or(0.0)).collect();
    let most = lags.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    lags.iter().any(|lag| most - lag > CLOCKS)
}

/// The topic for a use: the one with most messages. A note names the others.
fn choose<'a>(survey: &'a Survey, usage: Use, notes: &mut Vec<String>) -> Option<&'a TopicSurvey> {
    let fits = |t: &&TopicSurvey| t.usage() == Some(usage) && t.messages > 0;
    let outside = |t: &TopicSurvey| {
        let name = t.name.to_lowercase();
        usage != Use::Pressure || INSIDE.iter().all(|word| !name.contains(word))
    };
    let chosen = survey.topics.iter().filter(fits).max_by_key(|t| (outside(t), t.messages))?;
    let others: Vec<String> = survey
        .topics
        .iter()
        .filter(|t| fits(t) && t.name != chosen.name)
        .map(|t| format!("{} ({:.1} Hz)", t.name, t.rate()))
        .collect();
    if !others.is_empty() {
        notes.push(format!(
            "the bag has several topics of type {}: {} ({:.1} Hz) is used, not {}; the key `topic` \
             of the source chooses another",
            chosen.kind,
            chosen.name,
            chosen.rate(),
            others.join(", ")
        ));
    }
    if let Some(delay) = chosen.delay() {
        notes.push(format!("{}: {delay}", chosen.name));
    }
    Some(chosen)
}

/// Adds the keys and questions of a use of the odometry.
pub fn use_odometry(found: &mut Found, usage: OdometryUse) {
    match usage {
        OdometryUse::Reference => {
            found.kind = "reference";
            found.source.push(
                "datum = { latitude = \"45 deg\", longitude = \"0 deg\", height = \"0 m\" }"
                    .to_owned(),
            );
            found.questions.push(
                "the position at which the odometry is zero; is it a reference, or one of the \
                 filters to compare with? `--odometry relative-pose` makes it a sensor"
                    .to_owned(),
            );
        }
        OdometryUse::RelativePose => {
            found.kind = "relative-pose";
            found.questions.push(
                "each message is used as the motion since the message before; is it an odometry of \
                 its own, without the IMU and GNSS of this scenario? `--odometry reference` makes \
                 it the reference"
                    .to_owned(),
            );
        }
    }
}

/// The sensors of a bag, its odometry, whose use depends on the rest of the recording, and notes
/// about it.
///
/// # Errors
/// When it is a log of navfuse.
pub fn sensors(
    survey: &Survey,
    file: &Path,
    notes: &mut Vec<String>,
) -> Result<(Vec<InBag>, Option<InBag>), StreamError> {
    if survey.topics.iter().any(|t| t.kind.starts_with("navfuse_msgs/")) {
        return Err(StreamError::format("it is a log of navfuse")
            .in_file(file)
            .with_remedy("`navfuse replay` runs it"));
    }
    notes.extend(survey.faults.clone());
    let px4 = choose(survey, Use::Px4Imu, notes);
    let imu = if px4.is_some() { None } else { choose(survey, Use::Imu, notes) };
    let base = match imu {
        _ if survey.frames.has(BASE) => BASE,
        Some(imu) => imu.frame.as_str(),
        None => "",
    };
    let place = |topic: &TopicSurvey, marine| survey.frames.mounting(base, &topic.frame, marine);
    let origin = imu.and_then(|imu| place(imu, false)).map_or([0.0; 3], |m| m.position);
    let mut used: Vec<&str> = Vec::new();
    let several = several_clocks(survey);
    let add = |topic: &TopicSurvey, kind: &'static str, more: Option<&TopicSurvey>| {
        let marine = kind == "dvl";
        let mut found = Found {
            kind,
            sensor: Vec::new(),
            source: vec![format!("topic = {}", quoted(&topic.name))],
            questions: Vec::new(),
            velocity: more.is_some(),
            ..Found::default()
        };
        if let Some(more) = more {
            found.source.push(format!("more = [{}]", quoted(&more.name)));
            found.questions.push(format!(
                "{} is taken for the velocity of the receiver along east, north, up",
                more.name
            ));
        }
        let unset = topic.unstamped == topic.messages;
        if unset || several {
            let why = if unset { "zero" } else { "not on the clock of the others" };
            found.source.push("stamp = \"receive\"".to_owned());
            found.questions.push(format!(
                "all stamps of {} are {why}: the receive time, which is late, is used",
                topic.name
            ));
        }
        let mounting = place(topic, marine);
        if let Some(m) = mounting.filter(|_| matches!(kind, "imu" | "attitude" | "dvl")) {
            let [roll, pitch, yaw] = m.rotation.map(|a| (a.to_degrees() * 1e9).round() / 1e9 + 0.0);
            if m.rotation.iter().any(|a| a.abs() > ALIGNED) {
                let line = format!("rotation = [\"{roll} deg\", \"{pitch} deg\", \"{yaw} deg\"]");
                found.source.push(line);
                if marine {
                    found.questions.push(
                        "the rotation comes from /tf_static; without it the velocities count as \
                         forward, right, down"
                            .to_owned(),
                    );
                }
            }
        }
        // an IMU that turns with the vehicle is the origin of the lever arms
        let arm = |m: navfuse_ros2::Mounting| -> [f64; 3] {
            std::array::from_fn(|k| ((m.position[k] - origin[k]) * 1e6).round() / 1e6 + 0.0)
        };
        let connected = mounting.filter(|_| imu.is_some_and(|imu| place(imu, false).is_some()));
        InBag { found, lever_arm: connected.map(arm) }
    };
    let mut sensors = Vec::new();
    if let Some(imu) = px4 {
        used.push(&imu.name);
        sensors.push(px4_sensor(imu, "imu", &PX4_IMU));
    }
    if let Some(fix) = px4.and_then(|_| choose(survey, Use::Px4Fix, notes)) {
        used.push(&fix.name);
        sensors.push(px4_sensor(fix, "gnss", &PX4_FIX));
    }
    if let Some(imu) = imu {
        used.push(&imu.name);
        sensors.push(add(imu, "imu", None));
        sensors.push(add(imu, "attitude", None));
    }
    let log = choose(survey, Use::VelocityLog, notes);
    if let Some(dvl) = log.or_else(|| choose(survey, Use::LogTwist, notes)) {
        used.push(&dvl.name);
        sensors.push(add(dvl, "dvl", None));
    }
    let depth = choose(survey, Use::Depth, notes);
    if let Some(depth) = depth {
        used.push(&depth.name);
        let mut sensor = add(depth, "depth", None);
        let question = if depth.kind.starts_with("std_msgs/") {
            sensor.found.source.push("channels.depth = { field = \"data\" }".to_owned());
            format!("the numbers of {} are taken for a depth in m", depth.name)
        } else {
            format!("only the height of the poses of {} changes", depth.name)
        };
        sensor.found.questions.push(question);
        sensors.push(sensor);
    } else if let Some(pressure) = choose(survey, Use::Pressure, notes) {
        used.push(&pressure.name);
        let mut depth = add(pressure, "depth", None);
        depth.found.questions.push(
            "the pressure is taken for pressure under water; a barometer is no depth sensor: remove the \
             sensor then"
                .to_owned(),
        );
        sensors.push(depth);
    }
    let fix = if px4.is_some() { None } else { choose(survey, Use::Fix, notes) };
    if let Some(fix) = fix {
        let velocity = survey.topics.iter().find(|t| {
            t.kind.starts_with("geometry_msgs/Twist") && t.frame == fix.frame && !t.frame.is_empty()
        });
        used.extend([Some(fix), velocity].iter().flatten().map(|t| t.name.as_str()));
        sensors.push(add(fix, "gnss", velocity));
    }
    let odometry = match choose(survey, Use::Odometry, notes) {
        Some(odometry) => Some(odometry),
        None => choose(survey, Use::Pose, notes),
    };
    used.extend(odometry.map(|odometry| odometry.name.as_str()));
    // its kind follows from its use
    let odometry = odometry.map(|odometry| add(odometry, "reference", None));
    let unused: Vec<String> = survey
        .topics
        .iter()
        .filter(|t| !used.contains(&t.name.as_str()))
        .map(|t| {
            let key =
                t.usage().and_then(key).map_or_else(String::new, |key| format!(", for {key}"));
            format!("{} ({}, {} messages{key})", t.name, t.kind, t.messages)
        })
        .collect();
    if !unused.is_empty() {
        notes.push(format!("topics that are not used: {}", unused.join(", ")));
    }
    Ok((sensors, odometry))
}

/// The key of the source with which a topic of this use replaces the one that is used.
fn key(usage: Use) -> Option<&'static str> {
    Some(match usage {
        Use::Imu | Use::Px4Imu => "sensors.imu.topic",
        Use::Fix | Use::Px4Fix => "sensors.gnss.topic",
        Use::VelocityLog | Use::LogTwist => "sensors.dvl.topic",
        Use::Pressure | Use::Depth => "sensors.depth.topic",
        Use::Odometry | Use::Pose => "sensors.odometry.topic",
        _ => return None,
    })
}

/// The fields of messages of PX4 by channel, with their unit where it is another one.
type Fields = [(&'static str, &'static str, &'static str)];
const PX4_IMU: [(&str, &str, &str); 6] = [
    ("gyro_x", "gyro_rad[0]", ""),
    ("gyro_y", "gyro_rad[1]", ""),
    ("gyro_z", "gyro_rad[2]", ""),
    ("accel_x", "accelerometer_m_s2[0]", ""),
    ("accel_y", "accelerometer_m_s2[1]", ""),
    ("accel_z", "accelerometer_m_s2[2]", ""),
];
const PX4_FIX: [(&str, &str, &str); 6] = [
    ("lat", "latitude_deg", "deg"),
    ("lon", "longitude_deg", "deg"),
    ("height", "altitude_ellipsoid_m", ""),
    ("vel_n", "vel_n_m_s", ""),
    ("vel_e", "vel_e_m_s", ""),
    ("vel_d", "vel_d_m_s", ""),
];

/// A sensor of PX4, whose messages have fields of their own and a time since its start.
fn px4_sensor(topic: &TopicSurvey, kind: &'static str, fields: &Fields) -> InBag {
    let mut source = vec![
        format!("topic = {}", quoted(&topic.name)),
        "time = { field = \"timestamp\", unit = \"us\" }".to_owned(),
    ];
    source.extend(fields.iter().map(|(channel, field, unit)| match *unit {
        "" => format!("channels.{channel} = {{ field = \"{field}\" }}"),
        unit => format!("channels.{channel} = {{ field = \"{field}\", unit = \"{unit}\" }}"),
    }));
    let found = Found { kind, source, velocity: kind == "gnss", ..Found::default() };
    InBag { found, lever_arm: None }
}
