//! Logs of vehicles and inertial units: the messages by which each sensor is recognised.

use crate::class::{self, FixClass};
use crate::found::Found;
use navfuse_core::document::quoted;
use navfuse_frames::Stamp;
use navfuse_vehicle_logs::{Format, Options, Topic};
use std::io::Cursor;

/// The messages of a sensor, the best first, each with a second one that completes it.
type Choice = (&'static str, &'static [(&'static str, Option<&'static str>)]);

const CHOICES: [Choice; 6] = [
    (
        "imu",
        &[
            ("sensor_combined", None),
            ("vehicle_imu", None),
            ("HIGHRES_IMU", None),
            ("SCALED_IMU", None),
            ("RAW_IMU", None),
            ("SCALED_IMU2", None),
            ("RAWIMUSX", None),
            ("RAWIMUX", None),
            ("NUCLEUS-IMU", None),
            ("ESF-MEAS", None),
            ("ExtSensorMeas", None),
            ("PSINS", None),
            ("VNIMU", None),
            ("VNYMR", None),
            ("IMU", None),
            ("IMU_SHORT", None),
            ("IMU_DATA", None),
            ("VN-DELTA", None),
            ("VN-IMU", None),
            ("MIP-IMU", None),
            ("MIP-DELTA", None),
            ("AngularVelocity", Some("Acceleration")),
        ],
    ),
    (
        "dvl",
        &[
            ("VISION_POSITION_DELTA", None),
            ("VISO", None),
            ("NUCLEUS-BOTTOM-TRACK", None),
            ("DVL_BOTTOM_TRACK", None),
            ("GroundVelocity", None),
        ],
    ),
    (
        "depth",
        &[
            ("SCALED_PRESSURE2", None),
            ("SCALED_PRESSURE3", None),
            ("BARO", None),
            ("NUCLEUS-AHRS", None),
            ("DEPTH", None),
            ("Depth", None),
        ],
    ),
    (
        "gnss",
        &[
            ("sensor_gps", None),
            ("vehicle_gps_position", None),
            ("GPS_RAW_INT", None),
            ("GPS2_RAW", None),
            ("GPS", Some("GPA")),
            ("NAV-PVT", None),
            ("PVTGeodetic", None),
            ("BESTPOS", Some("BESTVEL")),
            ("VNGPS", None),
            ("GPS1_POS", Some("GPS1_VEL")),
            ("VN-GPS", None),
            ("MIP-GNSS", None),
            ("GpsFix", None),
        ],
    ),
    (
        "reference",
        &[
            ("vehicle_local_position", Some("vehicle_attitude")),
            ("GLOBAL_POSITION_INT", Some("ATTITUDE")),
            ("POS", Some("ATT")),
            ("NUCLEUS-INS", None),
            ("INSPVAX", None),
            ("INSPVA", None),
            ("INSPVAS", None),
            ("VNINS", None),
            ("SBET", None),
            ("EKF_NAV", Some("EKF_EULER")),
            ("VN-INS", None),
            ("MIP-FILTER", None),
            ("EstimatedState", None),
        ],
    ),
    (
        "attitude",
        &[
            ("vehicle_attitude", None),
            ("ATTITUDE", None),
            ("ATT", None),
            ("NUCLEUS-AHRS", None),
            ("EKF_EULER", None),
            ("VN-ATTITUDE", None),
            ("MIP-FILTER", None),
            ("EulerAngles", None),
        ],
    ),
];
/// The messages with increments instead of rates; `IMU` of KF-GINS alone.
const INCREMENTS: [&str; 5] = ["RAWIMUSX", "RAWIMUX", "PSINS", "VN-DELTA", "MIP-DELTA"];
/// The receivers with a velocity.
const MOVING: [&str; 11] = [
    "sensor_gps",
    "vehicle_gps_position",
    "GPS_RAW_INT",
    "GPS2_RAW",
    "GPS",
    "NAV-PVT",
    "PVTGeodetic",
    "VNGPS",
    "VN-GPS",
    "MIP-GNSS",
    "GpsFix",
];
/// The messages that complete a receiver with a velocity.
const VELOCITIES: [&str; 2] = ["BESTVEL", "GPS1_VEL"];
/// The logs of NovAtel without gravity and without the Earth's rate.
const CORRECTED: [&str; 4] = ["CORRIMUDATA", "CORRIMUDATAS", "CORRIMUS", "IMURATECORRIMUS"];
/// Least number of logs with wrong checksums.
const LOGS: usize = 3;
/// Seconds of a week, and the intervals, s, at which an inertial unit may write.
const WEEK: f64 = 604_800.0;
const INTERVALS: std::ops::RangeInclusive<f64> = 2e-4..=1.0;
/// Pressure, hPa, that no weather makes: a metre of water below the highest one.
const WET: f64 = 1185.0;

/// A topic with what its messages show.
struct Seen<'a> {
    topic: &'a Topic,
    /// Set if a message has a measurement: a place other than 0 N 0 E, a fix, a pressure of water.
    measures: bool,
    /// The best class of its fixes.
    class: Option<FixClass>,
}

/// Tests whether a message measures anything, as far as its fields show it.
fn measures(topic: &Topic, values: &[f64]) -> bool {
    let field = |name: &str| {
        topic.fields.iter().position(|f| f == name).and_then(|k| values.get(k).copied())
    };
    let first = |names: &[&str]| names.iter().find_map(|name| field(name));
    let place = first(&["lat", "Lat", "latitude", "latitude_deg"]);
    // the status of a DataFlash message counts where it has a place
    let fix = first(&["fix_type", "fixType"]).or(place.and(field("Status")));
    let valid = first(&["status", "computed", "Mode", "valid"]).is_none_or(|status| status >= 1.0);
    let pressure = field("press_abs").or(field("Press").map(|pascals| 0.01 * pascals));
    let fixed = place != Some(0.0) && fix.is_none_or(|kind| kind >= 3.0);
    // of the pressures of a submarine vehicle, one measures the air
    fixed && valid && pressure.is_none_or(|pressure| pressure > WET)
}

/// The class of a fix.
fn class(topic: &Topic, values: &[f64]) -> Option<FixClass> {
    let (field, codes) = class::of_message(&topic.name)?;
    let k = topic.fields.iter().position(|f| f == field)?;
    class::of(codes, *values.get(k)?)
}

/// The sensors in the beginning of the log of a vehicle, whose checksums may be ignored, and notes.
pub fn sensors(
    format: Format,
    beginning: Vec<u8>,
    unchecked: bool,
    notes: &mut Vec<String>,
) -> Vec<Found> {
    // with this interval the stamps of messages without a time are their number
    let options = Options { interval: Some(1), unchecked, ..Options::default() };
    let mut decoder = format.decoder(Cursor::new(beginning), &options);
    // a topic of ULog may be subscribed without a message
    let (mut values, mut counted) = (Vec::new(), Vec::new());
    let mut seen: Vec<Option<(bool, Option<FixClass>)>> = Vec::new();
    while let Ok(Some(record)) = decoder.next(&mut values) {
        if seen.len() <= record.topic {
            seen.resize(record.topic + 1, None);
        }
        let measures = || measures(&decoder.topics()[record.topic], &values);
        let class = class(&decoder.topics()[record.topic], &values);
        let (before, best) = seen[record.topic].unwrap_or_default();
        seen[record.topic] = Some((before || measures(), best.max(class)));
        let week = decoder.topics()[record.topic].fields.first().is_some_and(|f| f == "tow");
        if let (true, Stamp::Date(count)) = (week && format == Format::Vectornav, record.stamp) {
            counted.push((count, values[0]));
        }
    }
    let topics = decoder.topics().iter().zip(&seen);
    let topics: Vec<Seen<'_>> = topics
        .filter_map(|(topic, seen)| seen.map(|(measures, class)| Seen { topic, measures, class }))
        .collect();
    let sensors = CHOICES.iter().filter_map(|choice| sensor(format, choice, &topics, notes));
    let mut sensors: Vec<Found> = sensors.collect();
    let corrected = topics.iter().filter(|t| CORRECTED.contains(&t.topic.name.as_str()));
    notes.extend(corrected.map(|t| {
        let name = &t.topic.name;
        format!("{name} is not used: it lacks gravity and the Earth's rate; record RAWIMUSX")
    }));
    // what lacks to use an inertial unit
    let driven = sensors.iter().any(|found| found.kind == "imu");
    notes.extend(decoder.events().filter(|_| !driven));
    if let Some((first, interval)) = sensors.first_mut().zip(interval(&counted)) {
        first.source.push(format!("interval = \"{interval:.9} s\""));
    }
    sensors
}

/// The sensors of logs of NovAtel in text whose checksums are always wrong; `None` for other files.
pub fn unchecked(beginning: &[u8], notes: &mut Vec<String>) -> Option<Vec<Found>> {
    let options = Options { unchecked: true, ..Options::default() };
    let mut decoder = Format::Novatel.decoder(Cursor::new(beginning.to_vec()), &options);
    let mut values = Vec::new();
    let count = (0..).take_while(|_| matches!(decoder.next(&mut values), Ok(Some(_)))).count();
    if count < LOGS || 2 * decoder.damage().intact_bytes() < beginning.len() as u64 {
        return None;
    }
    let mut found = sensors(Format::Novatel, beginning.to_vec(), true, notes);
    let first = found.first_mut()?;
    first.source.push("checksum = \"ignore\"".to_owned());
    first.questions.push(
        "the checksums of its logs are always wrong: they are not compared, so that damaged logs are \
         used too"
            .to_owned(),
    );
    Some(found)
}

/// The interval, s, of messages without a time, by the numbers of messages at seconds of the week.
fn interval(counted: &[(i64, f64)]) -> Option<f64> {
    let ((first, begin), (last, end)) = (*counted.first()?, *counted.last()?);
    let interval = (end - begin).rem_euclid(WEEK) / (last - first) as f64;
    INTERVALS.contains(&interval).then_some(interval)
}

fn sensor(
    format: Format,
    (kind, messages): &Choice,
    topics: &[Seen<'_>],
    notes: &mut Vec<String>,
) -> Option<Found> {
    let has = |name: &str| topics.iter().any(|t| t.topic.name == name);
    let measuring = |name: &str| topics.iter().any(|t| t.topic.name == name && t.measures);
    let Some((message, with)) = messages.iter().find(|(message, _)| measuring(message)) else {
        let idle = messages.iter().map(|(message, _)| *message).filter(|message| has(message));
        notes.extend(idle.map(|message| {
            format!("{message} has no measurement: no fix, 0 N 0 E, an invalid velocity, or a pressure of air")
        }));
        return None;
    };
    let same = || topics.iter().filter(|t| t.topic.name == *message);
    let mut instances: Vec<u32> = same().map(|t| t.topic.instance).collect();
    if let Some(used) = same().position(|t| t.measures) {
        instances.swap(0, used);
    }
    let mut questions = Vec::new();
    let mut text = format!("sensors.{kind} = {{ message = {}", quoted(message));
    if let [first, _, ..] = instances.as_slice() {
        text += &format!(", instance = {first}");
        questions.push(format!(
            "{} instances of {message}: {instances:?}; the first is used",
            instances.len()
        ));
    }
    let with = with.filter(|with| has(with));
    if let Some(with) = with {
        text += &format!(", with = {}", quoted(with));
    }
    text += " }";
    if *kind == "reference" && format != Format::Sbet {
        questions.push(format!(
            "{message} is the vehicle's own solution: it shares the sensors and is no independent truth"
        ));
    }
    let increments = INCREMENTS.contains(message) || format == Format::KfGins;
    let mut sensor = Vec::new();
    if increments {
        sensor.push("output = \"increments\"".to_owned());
    } else if *message == "VNGPS" {
        // it has the time of the message before it, and is late by what the receiver needs
        sensor.push("time_offset = { sigma = \"0.1 s\" }".to_owned());
    }
    let velocity = MOVING.contains(message) || with.is_some_and(|w| VELOCITIES.contains(&w));
    let used = same().find(|t| Some(&t.topic.instance) == instances.first());
    let class = used.and_then(|t| t.class).filter(|_| *kind == "gnss");
    Some(Found { kind, sensor, source: vec![text], questions, velocity, class, ..Found::default() })
}
