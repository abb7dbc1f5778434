//! Sentences of NMEA 0183 with the talker `IN`, integrated navigation.

use crate::{Fix, Form, UtcClock};
use navfuse_core::units::calendar::{Calendar, DAY};
use std::io::{self, Write};

/// Metres per second of a knot.
const KNOT: f64 = 1852.0 / 3600.0;

/// For each epoch GGA, GST and, as far as the log has them, RMC, HDT, PASHR and ZDA.
pub struct Sentences {
    clock: UtcClock,
}

impl Sentences {
    pub fn new(clock: UtcClock) -> Self {
        Self { clock }
    }
}

/// Writes a sentence with its checksum, the exclusive or of all characters between `$` and `*`.
fn sentence(out: &mut dyn Write, content: &str) -> io::Result<()> {
    let checksum = content.bytes().fold(0, |sum, byte| sum ^ byte);
    write!(out, "${content}*{checksum:02X}\r\n")
}

/// An angle as degrees and minutes with 1e-7 minutes, 0.2 mm, and its hemisphere.
fn degrees_and_minutes(angle: f64, width: usize, hemispheres: [char; 2]) -> String {
    let hemisphere = hemispheres[usize::from(angle < 0.0)];
    // in units of the last digit, so that the minutes never round to 60
    let units = (angle.abs() * 60e7).round() as u64;
    let (degrees, rest) = (units / 600_000_000, units % 600_000_000);
    let (minutes, decimals) = (rest / 10_000_000, rest % 10_000_000);
    format!("{degrees:0width$}{minutes:02}.{decimals:07},{hemisphere}")
}

/// An angle of a circle, deg, with this many decimals; never 360.
fn circle(radians: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", radians.to_degrees().rem_euclid(360.0));
    if text.starts_with("360") { format!("{:.decimals$}", 0.0) } else { text }
}

impl Form for Sentences {
    fn begin(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let utc = self.clock.utc(fix.time);
        let nanos = utc.unwrap_or_else(|| fix.time.nanos().rem_euclid(DAY));
        let c = Calendar::of_unix_nanos(nanos);
        let micros = c.nanos / 1000;
        let time = format!("{:02}{:02}{:02}.{micros:06}", c.hour, c.minute, c.second);
        let date = utc.map(|_| (c.day, c.month, c.year));
        let [latitude, longitude] = fix.degrees();
        let place = format!(
            "{},{}",
            degrees_and_minutes(latitude, 2, ['N', 'S']),
            degrees_and_minutes(longitude, 3, ['E', 'W'])
        );
        // quality 6: estimated. A separation of zero makes the altitude the height above the
        // ellipsoid
        let height = fix.position.height;
        sentence(out, &format!("INGGA,{time},{place},6,00,,{height:.4},M,0.0,M,,"))?;
        let s = fix.position_sigma;
        sentence(out, &format!("INGST,{time},,,,,{:.4},{:.4},{:.4}", s.x, s.y, s.z))?;
        if let Some([v, _]) = fix.velocity {
            let (speed, course) = (v.x.hypot(v.y) / KNOT, circle(v.y.atan2(v.x), 4));
            let date = date.map_or_else(String::new, |(day, month, year)| {
                format!("{day:02}{month:02}{:02}", year.rem_euclid(100))
            });
            sentence(out, &format!("INRMC,{time},A,{place},{speed:.5},{course},{date},,,E"))?;
        }
        if let Some([angles, sigma]) = fix.attitude {
            let heading = circle(angles.z, 4);
            sentence(out, &format!("INHDT,{heading},T"))?;
            let [roll, pitch] = [angles.x, angles.y].map(f64::to_degrees);
            let s = sigma.map(f64::to_degrees);
            let accuracy = format!("{:.4},{:.4},{:.4}", s.x, s.y, s.z);
            sentence(
                out,
                &format!("PASHR,{time},{heading},T,{roll:+.4},{pitch:+.4},,{accuracy},0,1"),
            )?;
        }
        if let Some((day, month, year)) = date {
            sentence(out, &format!("INZDA,{time},{day:02},{month:02},{year:04},00,00"))?;
        }
        Ok(())
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minutes_and_headings_never_round_to_a_full_turn() {
        let text = |angle| degrees_and_minutes(angle, 3, ['E', 'W']);
        assert_eq!(text(9.999_999_999_999), "01000.0000000,E");
        assert_eq!(text(-0.5), "00030.0000000,W");
        assert_eq!(circle((-1e-9_f64).to_radians(), 4), "0.0000");
        assert_eq!(circle((-90.0_f64).to_radians(), 4), "270.0000");
    }
}
