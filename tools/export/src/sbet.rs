//! SBET, the smoothed best estimate of trajectory of Applanix, and its file of accuracies: records
//! of 17 and of 10 numbers in double precision, little-endian.

use crate::{Fix, Form, UtcClock};
use nalgebra::{Rotation3, Vector3};
use navfuse_core::units::calendar::{GPS_ZERO, SECOND, WEEK, leap_seconds};
use navfuse_core::units::time::Time;
use std::io::{self, Write};

/// Minutes of arc of a radian.
const ARC_MINUTES: f64 = 180.0 * 60.0 / std::f64::consts::PI;

/// The time of a record: seconds of the week of GPS, or of the run where its clock has no date.
fn seconds(clock: UtcClock, time: Time) -> f64 {
    let Some(utc) = clock.utc(time) else { return time.seconds() };
    let gps = utc - GPS_ZERO + leap_seconds(utc);
    gps.rem_euclid(WEEK) as f64 / SECOND as f64
}

fn write(out: &mut dyn Write, numbers: &[f64]) -> io::Result<()> {
    numbers.iter().try_for_each(|n| out.write_all(&n.to_le_bytes()))
}

/// The trajectory. The wander angle is zero, so that the velocity is north, east, down. Acceleration
/// and angular rate are differences of velocity and attitude to the epoch before, along the body's
/// axes; those of the first epoch are zero.
pub struct Trajectory {
    clock: UtcClock,
    last: Option<Fix>,
}

impl Trajectory {
    pub fn new(clock: UtcClock) -> Self {
        Self { clock, last: None }
    }

    /// Mean acceleration and angular rate since the epoch before, relative to the navigation frame.
    fn rates(&self, fix: &Fix) -> [Vector3<f64>; 2] {
        let Some(last) = &self.last else { return [Vector3::zeros(); 2] };
        let dt = fix.time.since(last.time);
        let to_body = fix.c_b_n().unwrap_or_else(Rotation3::identity).inverse();
        let acceleration = match (fix.velocity, last.velocity) {
            (Some([now, _]), Some([before, _])) => to_body * ((now - before) / dt),
            _ => Vector3::zeros(),
        };
        let rate = match last.c_b_n() {
            Some(before) => (before.inverse() * to_body.inverse()).scaled_axis() / dt,
            None => Vector3::zeros(),
        };
        [acceleration, rate]
    }
}

impl Form for Trajectory {
    fn begin(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let p = fix.position;
        let v = fix.velocity.map_or_else(Vector3::zeros, |[v, _]| v);
        let a = fix.attitude.map_or_else(Vector3::zeros, |[a, _]| a);
        let [acceleration, rate] = self.rates(fix);
        write(out, &[seconds(self.clock, fix.time), p.latitude, p.longitude, p.height])?;
        write(out, v.as_slice())?;
        write(out, a.as_slice())?;
        write(out, &[0.0])?;
        write(out, acceleration.as_slice())?;
        write(out, rate.as_slice())?;
        self.last = Some(*fix);
        Ok(())
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}

/// The accuracies: 1-sigma of position (m) and velocity (m/s) north, east, down, and of roll, pitch
/// and heading in minutes of arc.
pub struct Accuracy {
    clock: UtcClock,
}

impl Accuracy {
    pub fn new(clock: UtcClock) -> Self {
        Self { clock }
    }
}

impl Form for Accuracy {
    fn begin(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let v = fix.velocity.map_or_else(Vector3::zeros, |[_, sigma]| sigma);
        let a = fix.attitude.map_or_else(Vector3::zeros, |[_, sigma]| sigma * ARC_MINUTES);
        write(out, &[seconds(self.clock, fix.time)])?;
        write(out, fix.position_sigma.as_slice())?;
        write(out, v.as_slice())?;
        write(out, a.as_slice())
    }

    fn end(&mut self, _: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
}
