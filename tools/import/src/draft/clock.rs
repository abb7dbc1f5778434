//! The clock of a sensor against that of the IMU.

use super::text::Text;
use crate::recording::Part;
use crate::stream::StreamSurvey;

/// Usual 1-sigma of the offset between the clocks of two instruments, s.
const USUAL: f64 = 0.2;
/// Offset, s, by which the velocity of a vehicle changes less than a log measures it: 2 cm/s at 0.4 m/s^2.
const LITTLE: f64 = 0.05;

/// Writes the comparison of the clocks, and the state that follows what it leaves open: the rest of an offset
/// and a drift, or the whole offset of a velocity log in a file of its own, whose clock the motion does not show
/// before the filter runs.
pub(super) fn state(out: &mut Text, part: &Part, stream: Option<&StreamSurvey>, apart: bool) {
    let clock = stream.and_then(|s| s.clock);
    if let Some(clock) = clock {
        out.line(&format!("# {}", clock.describe()));
    }
    if part.found.sensor.iter().any(|key| key.starts_with("time_offset")) {
        return;
    }
    let (span, shifted) = (stream.map_or(0.0, StreamSurvey::length), part.samples.clock.is_some());
    if let Some(line) = clock.and_then(|clock| clock.state(span, shifted)) {
        return out.line(&line);
    }
    let open = clock.map_or(USUAL, |clock| clock.offset[0].hypot(2.0 * clock.offset[1]).min(USUAL));
    if apart && part.name == "dvl" && !shifted && open > LITTLE {
        let line = format!("time_offset = {{ sigma = \"{open:.2} s\" }}");
        out.ask(&line, "its clock against that of the IMU; leave it out if they share one");
    }
}
