//! Logs of vehicles and inertial units: the messages by which each sensor is recognised.

use crate::found::Found;
use navfuse_core::document::quoted;
use navfuse_vehicle_logs::{Format, Options, Topic};
use std::io::Cursor;

/// The messages of a sensor, the best first, each with a second one that completes it.
type Choice = (&'static str, &'static [(&'static str, Option<&'static str>)]);

const CHOICES: [Choice; 4] = [
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
            ("VNIMU", None),
            ("VNYMR", None),
            ("IMU", None),
        ],
    ),
    ("dvl", &[("VISION_POSITION_DELTA", None)]),
    (
        "gnss",
        &[
            ("sensor_gps", None),
            ("vehicle_gps_position", None),
            ("GPS_RAW_INT", None),
            ("GPS2_RAW", None),
            ("BESTPOS", None),
        ],
    ),
    (
        "reference",
        &[
            ("vehicle_local_position", Some("vehicle_attitude")),
            ("GLOBAL_POSITION_INT", Some("ATTITUDE")),
            ("INSPVAX", None),
            ("INSPVA", None),
            ("INSPVAS", None),
            ("SBET", None),
        ],
    ),
];
/// The messages with increments instead of rates.
const INCREMENTS: [&str; 3] = ["RAWIMUSX", "RAWIMUX", "IMU"];
/// The receivers with a velocity.
const MOVING: [&str; 4] = ["sensor_gps", "vehicle_gps_position", "GPS_RAW_INT", "GPS2_RAW"];

/// The sensors in the beginning of the log of a vehicle.
pub fn sensors(format: Format, beginning: Vec<u8>) -> Vec<Found> {
    let mut decoder = format.decoder(Cursor::new(beginning), &Options::default());
    // a topic of ULog may be subscribed without a message
    let (mut values, mut seen) = (Vec::new(), Vec::new());
    while let Ok(Some(record)) = decoder.next(&mut values) {
        if seen.len() <= record.topic {
            seen.resize(record.topic + 1, false);
        }
        seen[record.topic] = true;
    }
    let topics: Vec<&Topic> =
        decoder.topics().iter().zip(&seen).filter(|(_, s)| **s).map(|(t, _)| t).collect();
    CHOICES.iter().filter_map(|choice| sensor(format, choice, &topics)).collect()
}

fn sensor(format: Format, (kind, messages): &Choice, topics: &[&Topic]) -> Option<Found> {
    let has = |name: &str| topics.iter().any(|t| t.name == name);
    let (message, with) = messages.iter().find(|(message, _)| has(message))?;
    let instances: Vec<u32> =
        topics.iter().filter(|t| t.name == *message).map(|t| t.instance).collect();
    let mut questions = Vec::new();
    let mut text = format!("sensors.{kind} = {{ message = {}", quoted(message));
    if let [first, _, ..] = instances.as_slice() {
        text += &format!(", instance = {first}");
        questions.push(format!(
            "{} instances of {message}: {instances:?}; the first is used",
            instances.len()
        ));
    }
    if let Some(with) = with.filter(|with| has(with)) {
        text += &format!(", with = {}", quoted(with));
    }
    text += " }";
    if *kind == "reference" && format != Format::Sbet {
        questions.push(format!(
            "{message} is the vehicle's own solution: it shares the sensors and is no independent truth"
        ));
    }
    let increments = INCREMENTS.contains(message);
    let sensor = if increments { vec!["output = \"increments\"".to_owned()] } else { Vec::new() };
    let velocity = MOVING.contains(message);
    Some(Found { kind, sensor, source: vec![text], questions, velocity })
}
