//! Axes, signs and beams of Teledyne's instruments.
//!
//! The instrument's X axis points from beam 1 to beam 2, its Y axis from beam 4 to beam 3, and its
//! Z axis away from where it looks. The axes of a sensor of navfuse are forward (Y), right (X) and
//! down (-Z), so that beam 3 points forward. PD0 gives the velocity of the bottom, the other
//! formats that of the vehicle.

use crate::ping::{Attitude, Coordinates, TrackedVelocity};
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The integer that marks a velocity as bad.
const BAD: i16 = i16::MIN;

/// Converts velocities of 1 mm/s.
pub fn velocities(raw: [Option<i16>; 4]) -> [Option<f64>; 4] {
    raw.map(|v| v.filter(|v| *v != BAD).map(|v| f64::from(v) * 1e-3))
}

/// The coordinates of two bits: the coordinate transformation of the fixed leader, or the system
/// configuration of PD4.
pub fn coordinates(bits: u8) -> Coordinates {
    match bits & 3 {
        0 => Coordinates::Beam,
        1 => Coordinates::Instrument,
        2 => Coordinates::Ship,
        _ => Coordinates::Earth,
    }
}

/// The geometry of four beams.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Janus {
    /// Angle between the beams and the Z axis, rad.
    pub slant: f64,
    /// Set if the beams diverge.
    pub convex: bool,
}

impl Janus {
    /// Computes X, Y, Z and the error velocity from the velocities toward the transducer.
    ///
    /// Where one beam is bad, it is the one with which the error velocity is zero; the error
    /// velocity is then `None` (a three-beam solution).
    pub fn axes(&self, beams: [Option<f64>; 4]) -> Option<([f64; 3], Option<f64>)> {
        let pair = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a + b);
        let [b1, b2, b3, b4] = beams;
        let (first, second) = (pair(b1, b2), pair(b3, b4));
        // the error velocity is zero where b1 + b2 = b3 + b4
        let fill = |x: Option<f64>, other: Option<f64>, sum: Option<f64>| {
            x.or_else(|| Some(sum? - other?))
        };
        let four = first.is_some() && second.is_some();
        let [b1, b2, b3, b4] = [
            fill(b1, b2, second)?,
            fill(b2, b1, second)?,
            fill(b3, b4, first)?,
            fill(b4, b3, first)?,
        ];
        let (sin, cos) = self.slant.sin_cos();
        let (a, b) = (0.5 / sin, 0.25 / cos);
        let c = if self.convex { 1.0 } else { -1.0 };
        let axes = [c * a * (b1 - b2), c * a * (b4 - b3), b * (b1 + b2 + b3 + b4)];
        let error = four.then_some(a * FRAC_1_SQRT_2 * (b1 + b2 - b3 - b4));
        axes.iter().all(|v| v.is_finite()).then_some((axes, error))
    }
}

/// Orientation with which an instrument turned its velocities to the ship or to the Earth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mounting {
    /// Heading alignment: direction of beam 3 from the ship's bow, clockwise, rad.
    pub alignment: f64,
    /// Set if the instrument used its tilts.
    pub tilts: bool,
    /// Set if the instrument looks up.
    pub up: bool,
}

impl Mounting {
    /// Turns ship or Earth coordinates back to X, Y, Z of the instrument.
    ///
    /// Teledyne's matrix, `(E, N, U) = M(heading, pitch, roll) (X, Y, Z)`, transposed.
    pub fn turn_back(self, heading: f64, attitude: &Attitude, v: [f64; 3]) -> [f64; 3] {
        let (pitch, roll) = if self.tilts {
            // the pitch of gimbals from that of the tilt sensor
            let pitch = (attitude.pitch.tan() * attitude.roll.cos()).atan();
            (pitch, attitude.roll + if self.up { PI } else { 0.0 })
        } else {
            (0.0, 0.0)
        };
        let (sh, ch) = (heading + self.alignment).sin_cos();
        let ((sp, cp), (sr, cr)) = (pitch.sin_cos(), roll.sin_cos());
        let m = [
            [ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr],
            [-sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr],
            [-cp * sr, sp, cp * cr],
        ];
        [0, 1, 2].map(|k| m[0][k] * v[0] + m[1][k] * v[1] + m[2][k] * v[2])
    }
}

/// All that turns recorded velocities to those of the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Convention {
    /// Coordinates of the record.
    pub coordinates: Coordinates,
    /// Geometry of the beams, where the format has it.
    pub janus: Option<Janus>,
    /// Orientation of the instrument.
    pub mounting: Mounting,
    /// Attitude of the record, where the format has it.
    pub attitude: Option<Attitude>,
    /// 1 where the format gives the velocity of the vehicle, -1 where it gives that of the bottom.
    pub sign: f64,
}

impl Convention {
    /// The track of four recorded velocities.
    pub fn track(&self, recorded: [Option<f64>; 4]) -> TrackedVelocity {
        let [x, y, z, e] = recorded;
        let whole = || Some([x?, y?, z?]);
        let level = self.attitude.unwrap_or_default();
        let (xyz, error, beams) = match self.coordinates {
            Coordinates::Beam => {
                // toward the transducer, the bottom moves as the vehicle moves along the beam
                let beams = (self.sign < 0.0).then_some(recorded);
                match self.janus.and_then(|j| j.axes(recorded)) {
                    Some((xyz, error)) => (Some(xyz), error, beams),
                    None => (None, None, beams),
                }
            }
            Coordinates::Instrument => (whole(), e, None),
            Coordinates::Ship => {
                let turned = whole().filter(|_| self.attitude.is_some() || !self.mounting.tilts);
                (turned.map(|v| self.mounting.turn_back(0.0, &level, v)), e, None)
            }
            Coordinates::Earth => {
                let turned = self
                    .attitude
                    .and_then(|a| Some(self.mounting.turn_back(a.heading, &a, whole()?)));
                (turned, e, None)
            }
        };
        TrackedVelocity {
            coordinates: self.coordinates,
            recorded,
            // forward, right, down
            axes: xyz.map(|[x, y, z]| [self.sign * y, self.sign * x, -self.sign * z]),
            beams,
            error_velocity: error,
            ..TrackedVelocity::default()
        }
    }
}
