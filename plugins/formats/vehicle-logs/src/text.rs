//! Logs of text: NovAtel and VectorNav.

use navfuse_core::units::calendar::{GPS_ZERO, SECOND, WEEK, utc_of_gps};
use navfuse_frames::Stamp;

/// The stamp of a GPS week and the seconds of the week.
pub fn gps(week: u16, seconds: f64) -> Stamp {
    let within = (0.0..=604_800.0).contains(&seconds);
    // a week has 6e5 s: nanoseconds fit into the mantissa
    let nanos = if within { (seconds * 1e9).round() as i64 } else { 0 };
    let gps = i64::from(week).checked_mul(WEEK).and_then(|w| w.checked_add(GPS_ZERO + nanos));
    gps.filter(|_| within).map_or(Stamp::Missing, |gps| Stamp::Date(utc_of_gps(gps)))
}

/// UTC, as nanoseconds since 1970, of nanoseconds of GPS time.
pub fn gps_nanos(nanos: i64) -> i64 {
    utc_of_gps(GPS_ZERO.saturating_add(nanos))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_week_and_seconds_beyond_any_date_are_no_time() {
        assert_ne!(gps(2212, 336_000.0), Stamp::Missing);
        // 65 535 weeks are 4e19 ns
        for (week, seconds) in [(u16::MAX, 0.0), (2212, 1e300), (2212, -1.0), (2212, f64::NAN)] {
            assert_eq!(gps(week, seconds), Stamp::Missing);
        }
    }
}
