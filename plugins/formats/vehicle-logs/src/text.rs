//! Logs of text: NovAtel and VectorNav.

use navfuse_core::units::calendar::{GPS_ZERO, SECOND, WEEK, utc_of_gps};
use navfuse_frames::Stamp;

/// The stamp of a GPS week and the seconds of the week.
pub fn gps(week: u16, seconds: f64) -> Stamp {
    // a week has 6e5 s: nanoseconds fit into the mantissa
    let within = (0.0..=604_800.0).contains(&seconds);
    let nanos = (seconds * 1e9).round() as i64;
    let gps = GPS_ZERO + i64::from(week) * WEEK + nanos;
    if within { Stamp::Date(utc_of_gps(gps)) } else { Stamp::Missing }
}

/// The stamp of seconds of the week without the week.
pub fn of_week(week: Option<u16>, weeks: i64, seconds: f64) -> Stamp {
    let passed = weeks * WEEK / SECOND;
    match week.map(|w| u16::try_from(i64::from(w) + weeks)) {
        Some(Ok(week)) => gps(week, seconds),
        Some(Err(_)) => Stamp::Missing,
        None => Stamp::Date(((seconds + passed as f64) * 1e9).round() as i64),
    }
}

/// The number in a field; NaN for an empty field or another text.
pub fn number(field: &[u8]) -> f64 {
    let text = std::str::from_utf8(field).unwrap_or_default().trim();
    let plain = text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b));
    text.parse().ok().filter(|_| plain).unwrap_or(f64::NAN)
}
