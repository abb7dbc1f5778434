//! The start of a filter without a reference and without a course: an alignment where the gyros find
//! north, else the attitude of gravity with a heading that is asked for.

use super::priors::gyro_bias;
use super::text::{AS_ANSWERED, Text};
use crate::Heading;
use crate::recording::Recording;
use crate::stream::StreamSurvey;
use std::fmt::Write;

/// Longest and shortest alignment at rest, s.
const LONGEST: f64 = 900.0;
const SHORTEST: f64 = 12.0;
/// Shortest recording, s, for the usual alignment in motion, and for any.
const IN_MOTION: f64 = 300.0;
const SHORTEST_IN_MOTION: f64 = 60.0;
/// Silence of a velocity log at the start, s, after which an alignment begins, and in it without a key.
pub const LATE: f64 = 1.0;
const BRIDGED: f64 = 5.0;
/// Speed, m/s, from which a course is a heading, and velocity of a log from which a vehicle moves.
pub const SLOWEST: f64 = 0.7;
const SWIMS: f64 = 0.05;
/// Heading that is accurate enough, rad: 5 deg.
const GATE: f64 = 0.087;
/// Heading that gyros with this bias do not find in motion, rad: 20 deg.
const HOPELESS: f64 = 0.35;
/// Heading from which a filter linearises again, deg.
const WIDE: f64 = 5.0;
/// Rate of the Earth along north at 48 deg, deg/h.
const EARTH_RATE: f64 = 10.0;

/// The 1-sigma of the heading that gyros find in a time at rest, rad: the mean of their noise
/// against the Earth's rate.
fn north(imu: &StreamSurvey, seconds: f64) -> f64 {
    imu.densities()[0] / seconds.max(1.0).sqrt() / EARTH_RATE
}

/// Question about a heading that no file shows, where no position contradicts another one.
const RELATIVE: &str = "no file shows the heading at the start: headings, velocities and the track count from it; give \
                        it with --heading 75";
/// Question about a heading that no file shows, but that positions need.
const UNKNOWN: &str = "no file shows the heading at the start, and the gyros do not find north in this time: give it \
                       with --heading 75, or count from it with --heading relative; positions decide between eight";
/// 1-sigma of a heading that nobody knows, and of one that is zero by definition, deg.
const ANY: f64 = 30.0;
const DEFINED: f64 = 0.1;

/// A heading at the start, deg, with its 1-sigma and a question about it.
struct Known {
    yaw: f64,
    sigma: f64,
    question: Option<&'static str>,
}

impl Known {
    /// The heading of a sensor, rad.
    fn measured(yaw: f64, sigma: f64, question: &'static str) -> Self {
        Self { yaw: yaw.to_degrees(), sigma, question: Some(question) }
    }

    /// A heading that is zero by definition.
    fn defined() -> Self {
        Self { yaw: 0.0, sigma: DEFINED, question: Some(RELATIVE) }
    }

    fn answered(heading: Heading) -> Self {
        let (yaw, sigma) = match heading {
            Heading::Known(yaw, sigma) => (yaw, sigma),
            Heading::Relative => (0.0, DEFINED),
        };
        Self { yaw, sigma, question: None }
    }
}

/// Writes the alignment, or the attitude at the start.
pub fn align<'a>(
    out: &mut Text,
    recording: &Recording,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
    answer: Option<Heading>,
) {
    let Some(imu) = stream("imu").filter(|imu| imu.samples > 0) else {
        return level(out, None, None);
    };
    if let Some(heading) = answer {
        return level(out, Some(imu), Some(Known::answered(heading)));
    }
    let compass = stream("compass").and_then(|s| s.first.get(s.channel("heading")?));
    let compass =
        compass.map(|yaw| Known::measured(yaw, 2.0, "heading of the compass at the start"));
    let own = recording.attitude.map(|[_, _, yaw]| {
        let question = "the heading of the vehicle's own filter: is it from true north?";
        Known::measured(yaw, 8.0, question)
    });
    let known = compass.or(own);
    // without positions of a vehicle that moves, any heading fits
    let free = stream("gnss").is_none_or(|gnss| gnss.fastest < SLOWEST);
    let begun = |out: &mut Text| {
        out.relative = known.is_none() && free;
        Some(Known::defined()).filter(|_| out.relative)
    };
    // a receiver measures the velocity too
    let moving = recording.part("gnss").is_some_and(|gnss| gnss.found.velocity);
    let velocity = if moving { ", velocity = \"dvl\"" } else { "" };
    let (mut span, rest) = (imu.length(), rests(stream));
    let mut gap = String::new();
    if let Some(log) = stream("dvl").filter(|log| !rest && log.samples > 0) {
        let begin = log.span[0].seconds().ceil();
        if log.span[0].since(imu.span[0]) > LATE {
            out.begin = Some(begin);
            span = imu.span[1].min(log.span[1]).seconds() - begin;
        }
        if log.gaps.1 > BRIDGED {
            let _ = write!(gap, ", max_gap = \"{} s\"", (1.1 * log.gaps.1).ceil());
        }
    }
    // a vehicle in motion does not tell the bias of its gyros from the rate of the Earth
    let noise = north(imu, span.min(IN_MOTION));
    let moving = noise.hypot(gyro_bias(Some(imu), false) / EARTH_RATE);
    // the last second is for the filter
    let duration = (span - 1.0).floor().min(LONGEST);
    if rest || recording.part("dvl").is_none() {
        if duration < SHORTEST || north(imu, duration) > GATE {
            let begun = begun(out);
            return level(out, Some(imu), known.or(begun));
        }
        (out.aligned_at_rest, out.finds_north) = (true, true);
        out.ask(
            &format!(
                "alignment = {{ method = \"static\", duration = \"{duration} s\", \
                 heading_gate = \"5 deg\" }}"
            ),
            "time at rest from the start, and the heading that is accurate enough",
        );
    } else if (known.is_some() && moving > GATE) || (free && noise > GATE) || moving > HOPELESS {
        let begun = begun(out);
        let unknown = known.is_none() && !free;
        level(out, Some(imu), known.or(begun));
        // positions decide between a few headings
        if unknown {
            let other = |k: u8| {
                let [roll, pitch] = tilt(Some(imu));
                format!(
                    "process.ins.attitude.initial=[\"{roll:.2} deg\", \"{pitch:.2} deg\", \"{} deg\"]",
                    45 * u16::from(k)
                )
            };
            out.alternatives = (1..8).map(other).collect();
        }
    } else if span >= IN_MOTION {
        out.finds_north = true;
        out.line(&format!("alignment = {{ method = \"in-motion\"{velocity}{gap} }}"));
    } else if span >= SHORTEST_IN_MOTION {
        let duration = (0.7 * span).floor();
        (out.wide, out.finds_north) = (true, true);
        out.ask(
            &format!(
                "alignment = {{ method = \"in-motion\"{velocity}{gap}, duration = \"{duration} s\", \
                 heading_gate = \"20 deg\" }}"
            ),
            "the recording is short: which heading is accurate enough?",
        );
    } else {
        let begun = begun(out);
        level(out, Some(imu), known.or(begun));
    }
}

/// Roll and pitch by the mean specific force, deg.
fn tilt(imu: Option<&StreamSurvey>) -> [f64; 2] {
    let first = imu.and_then(|imu| imu.channel("accel_x").or_else(|| imu.channel("dvel_x")));
    let force = imu.zip(first).map(|(imu, k)| [imu.mean[k], imu.mean[k + 1], imu.mean[k + 2]]);
    let [x, y, z] = force.unwrap_or([0.0, 0.0, -1.0]);
    [(-y).atan2(-z).to_degrees(), x.atan2(y.hypot(z)).to_degrees()]
}

/// Roll and pitch by the mean specific force, and a heading that no gyro finds.
fn level(out: &mut Text, imu: Option<&StreamSurvey>, known: Option<Known>) {
    let [roll, pitch] = tilt(imu);
    let unknown = Known { yaw: 0.0, sigma: ANY, question: Some(UNKNOWN) };
    let Known { yaw, sigma, question } = known.unwrap_or(unknown);
    out.wide = sigma > WIDE;
    let line = format!(
        "attitude = {{ initial = [\"{roll:.2} deg\", \"{pitch:.2} deg\", \"{yaw:.1} deg\"], \
         sigma = [\"1 deg\", \"1 deg\", \"{sigma} deg\"] }}"
    );
    match question {
        Some(question) => out.ask(&line, question),
        None => out.line(&format!("{line}    {AS_ANSWERED}")),
    }
    out.ask(
        "velocity = { initial = [\"0 m/s\", \"0 m/s\", \"0 m/s\"], sigma = \"0.5 m/s\" }",
        "velocity at the start",
    );
}

/// Tests whether the vehicle rests by all of its sensors: one that moves evenly has a steady force.
pub fn rests<'a>(stream: &impl Fn(&str) -> Option<&'a StreamSurvey>) -> bool {
    let log = |s: &StreamSurvey| {
        let first = s.channel("vel_x").unwrap_or(0);
        let fast = |k: usize| s.mean[k].abs().max(s.wander[k]) > SWIMS;
        s.samples > 0 && (first..first + 3).any(fast)
    };
    stream("imu").is_some_and(StreamSurvey::is_steady)
        && !stream("dvl").is_some_and(log)
        && stream("gnss").is_none_or(|s| s.fastest < SLOWEST)
}
