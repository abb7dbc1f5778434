//! Sentences of NMEA 0183 with the talker `IN`, integrated navigation.

use crate::{Fix, Form, UtcClock};
use navfuse_core::units::calendar::{Calendar, DAY};
use navfuse_nmea::writing::{circle, place, seal};
use std::io::{self, Write};

/// Metres per second of a knot.
const KNOT: f64 = 1852.0 / 3600.0;

/// For each epoch GGA, GST and, as far as the log has them, RMC, HDT, PASHR and ZDA.
pub struct Sentences {
    clock: UtcClock,
    text: String,
}

impl Sentences {
    pub fn new(clock: UtcClock) -> Self {
        Self { clock, text: String::new() }
    }
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
        let place = place(latitude, longitude);
        let text = &mut self.text;
        text.clear();
        // quality 6: estimated. A separation of zero makes the altitude the height above the
        // ellipsoid
        let height = fix.position.height;
        seal(text, format_args!("INGGA,{time},{place},6,00,,{height:.4},M,0.0,M,,"));
        let s = fix.position_sigma;
        seal(text, format_args!("INGST,{time},,,,,{:.4},{:.4},{:.4}", s.x, s.y, s.z));
        if let Some([v, _]) = fix.velocity {
            let (speed, course) = (v.x.hypot(v.y) / KNOT, circle(v.y.atan2(v.x).to_degrees(), 4));
            let date = date.map_or_else(String::new, |(day, month, year)| {
                format!("{day:02}{month:02}{:02}", year.rem_euclid(100))
            });
            seal(text, format_args!("INRMC,{time},A,{place},{speed:.5},{course},{date},,,E"));
        }
        if let Some([angles, sigma]) = fix.attitude {
            let heading = circle(angles.z.to_degrees(), 4);
            seal(text, format_args!("INHDT,{heading},T"));
            let [roll, pitch] = [angles.x, angles.y].map(f64::to_degrees);
            let s = sigma.map(f64::to_degrees);
            let accuracy = format!("{:.4},{:.4},{:.4}", s.x, s.y, s.z);
            seal(
                text,
                format_args!("PASHR,{time},{heading},T,{roll:+.4},{pitch:+.4},,{accuracy},0,1"),
            );
        }
        if let Some((day, month, year)) = date {
            seal(text, format_args!("INZDA,{time},{day:02},{month:02},{year:04},00,00"));
        }
        out.write_all(text.as_bytes())
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}
