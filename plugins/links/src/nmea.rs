//! Writing sentences of NMEA 0183.

use std::fmt::{Arguments, Write};

/// Appends a sentence with this content.
pub fn seal(out: &mut String, content: Arguments<'_>) {
    let begin = out.len();
    // writing to a text cannot fail
    let _ = write!(out, "${content}");
    close(out, begin);
}

/// Appends the checksum of the sentence that begins at this byte, and the line break.
pub fn close(out: &mut String, begin: usize) {
    let sum = out.as_bytes()[begin + 1..].iter().fold(0, |sum, b| sum ^ b);
    let _ = write!(out, "*{sum:02X}\r\n");
}

/// Time of the day in whole milliseconds, as sentences have it.
pub fn time_of_day(at: &navfuse_core::units::calendar::Calendar) -> String {
    format!("{:02}{:02}{:02}.{:03}", at.hour, at.minute, at.second, at.nanos / 1_000_000)
}

/// Latitude and longitude, deg, as four fields.
pub fn place(latitude: f64, longitude: f64) -> String {
    format!("{},{}", minutes(latitude, 2, ["N", "S"]), minutes(longitude, 3, ["E", "W"]))
}

/// Degrees and minutes of an angle, and the letter of its side.
fn minutes(degrees: f64, digits: usize, letters: [&'static str; 2]) -> String {
    // whole units of 1e-7 minutes, so that no 60.0000000 minutes appear
    let units = (degrees.abs() * 600_000_000.0).round() as u64;
    let (whole, rest) = (units / 600_000_000, units % 600_000_000);
    let letter = letters[usize::from(degrees < 0.0)];
    format!("{whole:0digits$}{:02}.{:07},{letter}", rest / 10_000_000, rest % 10_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minutes_never_reach_sixty_and_the_side_is_a_letter() {
        assert_eq!(place(43.5, -59.999_999_999_999), "4330.0000000,N,06000.0000000,W");
    }
}
