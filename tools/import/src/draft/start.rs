//! The start of a filter without a reference and without a course: an alignment where the gyros find
//! north, else the attitude of gravity with a heading that is asked for.

use super::{Text, rests};
use crate::recording::Recording;
use crate::stream::StreamSurvey;

/// Longest and shortest alignment at rest, s.
const LONGEST: f64 = 900.0;
const SHORTEST: f64 = 12.0;
/// Shortest recording, s, for the usual alignment in motion, and for any.
const IN_MOTION: f64 = 300.0;
const SHORTEST_IN_MOTION: f64 = 60.0;
/// Heading that is accurate enough, rad: 5 deg.
const GATE: f64 = 0.087;
/// Heading from which a filter linearises again, deg.
const WIDE: f64 = 5.0;
/// Rate of the Earth along north at 48 deg, deg/h.
const EARTH_RATE: f64 = 10.0;

/// The 1-sigma of the heading that gyros find in a time at rest, rad: the mean of their noise
/// against the Earth's rate.
fn north(imu: &StreamSurvey, seconds: f64) -> f64 {
    imu.densities()[0] / seconds.max(1.0).sqrt() / EARTH_RATE
}

/// The heading at the start, rad, with its 1-sigma in deg and a question about it.
type Heading = (f64, f64, &'static str);

/// Writes the alignment, or the attitude at the start.
pub fn align<'a>(
    out: &mut Text,
    recording: &Recording,
    stream: &impl Fn(&str) -> Option<&'a StreamSurvey>,
) {
    let Some(imu) = stream("imu").filter(|imu| imu.samples > 0) else {
        return level(out, None, None);
    };
    let compass = stream("compass").and_then(|s| s.first.get(s.channel("heading")?));
    let compass = compass.map(|yaw| (yaw, 2.0, "heading of the compass at the start"));
    let own = recording.attitude.map(|[_, _, yaw]| {
        (yaw, 8.0, "the heading of the vehicle's own filter: is it from true north?")
    });
    let known = compass.or(own);
    // a receiver measures the velocity too
    let moving = recording.part("gnss").is_some_and(|gnss| gnss.found.velocity);
    let velocity = if moving { ", velocity = \"dvl\"" } else { "" };
    let (span, rest) = (imu.length(), rests(stream));
    // the last second is for the filter
    let duration = (span - 1.0).floor().min(LONGEST);
    if rest || recording.part("dvl").is_none() {
        if duration < SHORTEST || north(imu, duration) > GATE {
            return level(out, Some(imu), known);
        }
        out.ask(
            &format!(
                "alignment = {{ method = \"static\", duration = \"{duration} s\", \
                 heading_gate = \"5 deg\" }}"
            ),
            "time at rest from the start, and the heading that is accurate enough",
        );
    } else if known.is_some() && north(imu, span.min(IN_MOTION)) > GATE {
        level(out, Some(imu), known);
    } else if span >= IN_MOTION {
        out.line(&format!("alignment = {{ method = \"in-motion\"{velocity} }}"));
    } else if span >= SHORTEST_IN_MOTION {
        let duration = (0.7 * span).floor();
        out.wide = true;
        out.ask(
            &format!(
                "alignment = {{ method = \"in-motion\"{velocity}, duration = \"{duration} s\", \
                 heading_gate = \"20 deg\" }}"
            ),
            "the recording is short: which heading is accurate enough?",
        );
    } else {
        level(out, Some(imu), known);
    }
}

/// Roll and pitch by the mean specific force, and a heading that no gyro finds.
fn level(out: &mut Text, imu: Option<&StreamSurvey>, known: Option<Heading>) {
    let first = imu.and_then(|imu| imu.channel("accel_x").or_else(|| imu.channel("dvel_x")));
    let force = imu.zip(first).map(|(imu, k)| [imu.mean[k], imu.mean[k + 1], imu.mean[k + 2]]);
    let [x, y, z] = force.unwrap_or([0.0, 0.0, -1.0]);
    let (roll, pitch) = ((-y).atan2(-z).to_degrees(), x.atan2(y.hypot(z)).to_degrees());
    let unknown = "the heading at the start: the gyros do not find north in this time";
    let (yaw, sigma, question) = known.unwrap_or((0.0, 30.0, unknown));
    let yaw = yaw.to_degrees();
    out.wide = sigma > WIDE;
    out.ask(
        &format!(
            "attitude = {{ initial = [\"{roll:.2} deg\", \"{pitch:.2} deg\", \"{yaw:.1} deg\"], \
             sigma = [\"1 deg\", \"1 deg\", \"{sigma} deg\"] }}"
        ),
        question,
    );
    out.ask(
        "velocity = { initial = [\"0 m/s\", \"0 m/s\", \"0 m/s\"], sigma = \"0.5 m/s\" }",
        "velocity at the start",
    );
}
