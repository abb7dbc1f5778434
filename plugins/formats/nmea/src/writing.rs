//! Writing sentences of NMEA 0183.

use navfuse_core::units::calendar::Calendar;
use std::fmt::{Arguments, Write};

/// Appends a sentence with this content.
pub fn seal(out: &mut String, content: Arguments<'_>) {
    let begin = out.len();
    // writing to a text cannot fail
    let _ = write!(out, "${content}");
    close(out, begin);
}

/// Appends the checksum of the sentence that begins at this byte, the exclusive or of all bytes after
/// its `$`, and the line break.
pub fn close(out: &mut String, begin: usize) {
    let sum = out.as_bytes()[begin + 1..].iter().fold(0, |sum, b| sum ^ b);
    let _ = write!(out, "*{sum:02X}\r\n");
}

/// Time of the day in whole milliseconds.
pub fn time_of_day(at: &Calendar) -> String {
    format!("{:02}{:02}{:02}.{:03}", at.hour, at.minute, at.second, at.nanos / 1_000_000)
}

/// Latitude and longitude, deg, as four fields with 1e-7 minutes, 0.2 mm.
pub fn place(latitude: f64, longitude: f64) -> String {
    format!("{},{}", minutes(latitude, 2, ["N", "S"]), minutes(longitude, 3, ["E", "W"]))
}

/// Degrees and minutes of an angle, deg, and the letter of its side.
fn minutes(angle: f64, width: usize, letters: [&'static str; 2]) -> String {
    // in units of the last digit, so that the minutes never round to 60
    let units = (angle.abs() * 600_000_000.0).round() as u64;
    let (degrees, rest) = (units / 600_000_000, units % 600_000_000);
    let letter = letters[usize::from(angle < 0.0)];
    format!("{degrees:0width$}{:02}.{:07},{letter}", rest / 10_000_000, rest % 10_000_000)
}

/// An angle of a circle, deg, with this many decimals; never 360.
pub fn circle(degrees: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", degrees.rem_euclid(360.0));
    if text.starts_with("360") { format!("{:.decimals$}", 0.0) } else { text }
}

/// The fields of VTG before its mode: course over ground, deg, and speed, knots and km/h, of a velocity
/// to the north and to the east, m/s; the course has this many decimals.
pub fn course_and_speed(north: f64, east: f64, decimals: usize) -> String {
    let (course, speed) = (circle(east.atan2(north).to_degrees(), decimals), north.hypot(east));
    format!("{course},T,,M,{:.4},N,{:.4},K", speed * 3600.0 / 1852.0, speed * 3.6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minutes_and_headings_never_round_to_a_full_turn() {
        assert_eq!(place(43.5, -59.999_999_999_999), "4330.0000000,N,06000.0000000,W");
        assert_eq!(place(-0.5, 9.999_999_999_999), "0030.0000000,S,01000.0000000,E");
        assert_eq!(circle(-1e-9, 4), "0.0000");
        assert_eq!(circle(-90.0, 4), "270.0000");
    }
}
