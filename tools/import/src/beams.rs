//! Velocities along the beams of a log: their slant and azimuths by the motion that the IMU measures.
//!
//! A Janus of four beams has two pairs of opposite ones, whose sums are both `2 w cos s`: the pairs with the
//! least difference of these sums are opposite. With the azimuths up to a turn, the horizontal velocity up to
//! the sine of the slant follows, whose changes are those of the specific force (`axes::of_log`): the turn
//! of one against the other is the azimuth of the first beam, and their ratio the sine of the slant.

use crate::axes::{self, Turn};
use crate::clocks::Inertial;
use crate::vertical;
use navfuse_core::nalgebra::{Matrix3, Vector3};

/// Slant from the vertical by which velocities are computed, and the one of an unknown log, deg.
const FIRST: f64 = 30.0;
pub const USUAL: f64 = 25.0;
/// Share of the scale by which the horizontal velocities of an unknown slant may be wrong:
/// `sin 20 deg / sin 25 deg` and `sin 30 deg / sin 25 deg`.
pub const UNKNOWN: f64 = 0.2;
/// Azimuths of four beams whose opposite ones are 1 and 3, 1 and 2, 1 and 4, deg, and of three beams.
const FOUR: [[f64; 4]; 3] =
    [[45.0, 135.0, 225.0, 315.0], [45.0, 225.0, 135.0, 315.0], [45.0, 135.0, 315.0, 225.0]];
const THREE: [f64; 3] = [0.0, 120.0, 240.0];
/// 1-sigma of the scale of a log whose slant is known.
pub const KNOWN: f64 = 0.005;
/// Factor on the least difference of sums within which other pairs may be opposite.
const NEAR: f64 = 4.0;

/// The beams of a log as its file describes them; angles in deg.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Beams {
    pub count: usize,
    pub slant: Option<f64>,
    pub azimuth: Option<Vec<f64>>,
}

/// The beams in the vehicle, as the motion shows them; angles in deg.
#[derive(Clone, Debug, PartialEq)]
pub struct Aimed {
    pub azimuth: Vec<f64>,
    /// 1-sigma of the turn of all azimuths.
    pub sigma: f64,
    pub slant: f64,
    /// 1-sigma of the scale that the slant leaves open.
    pub scale: f64,
}

/// A time, s, with the velocities along the beams, m/s.
pub type Row = (f64, [f64; 4]);

impl Beams {
    /// The usual azimuths of a log of so many beams, deg.
    pub fn usual(count: usize) -> &'static [f64] {
        if count == 3 { &THREE } else { &FOUR[0] }
    }

    /// The sets of azimuths that fit the rows, the usual one first.
    fn candidates(&self, rows: &[Row]) -> Vec<Vec<f64>> {
        if let Some(azimuth) = &self.azimuth {
            return vec![azimuth.clone()];
        }
        let sets: Vec<Vec<f64>> = match self.count {
            3 => vec![THREE.to_vec()],
            _ => {
                // the difference of the sums of the pairs 13 and 24, 12 and 34, 14 and 23
                let difference = |k: usize| {
                    let term = |(_, [a, b, c, d]): &Row| match k {
                        0 => a + c - b - d,
                        1 => a + b - c - d,
                        _ => a + d - b - c,
                    };
                    rows.iter().map(|row| term(row).powi(2)).sum::<f64>()
                };
                let differences = [0, 1, 2].map(difference);
                let least = differences.iter().copied().fold(f64::INFINITY, f64::min);
                let near = FOUR.iter().zip(differences).filter(|(_, d)| *d <= NEAR * least);
                near.map(|(set, _)| set.to_vec()).collect()
            }
        };
        let mirrored = |set: &Vec<f64>| set.iter().map(|a| -a).collect();
        let others: Vec<Vec<f64>> = sets.iter().map(mirrored).collect();
        [sets, others].concat()
    }

    /// The velocities along the axes of beams with these azimuths, by least squares.
    fn velocities(&self, azimuth: &[f64], rows: &[Row]) -> Vec<[f64; 4]> {
        let (sin, cos) = self.slant.unwrap_or(FIRST).to_radians().sin_cos();
        let beam = |a: &f64| {
            let (s, c) = a.to_radians().sin_cos();
            Vector3::new(sin * c, sin * s, cos)
        };
        let beams: Vec<Vector3<f64>> = azimuth.iter().map(beam).collect();
        let normal: Matrix3<f64> = beams.iter().map(|b| b * b.transpose()).sum();
        let Some(inverse) = normal.try_inverse() else { return Vec::new() };
        let velocity = |(t, along): &Row| {
            let sum: Vector3<f64> = beams.iter().zip(along).map(|(b, v)| b * *v).sum();
            let v = inverse * sum;
            [*t, v.x, v.y, v.z]
        };
        rows.iter().map(velocity).collect()
    }

    /// The share of the velocity down in the rate of a depth.
    pub fn sinks(&self, rows: &[Row], depth: &[[f64; 2]], imu: &Inertial) -> Option<f64> {
        let azimuth = self.candidates(rows).into_iter().next()?;
        vertical::sinks(&self.velocities(&azimuth, rows), depth, imu)
    }

    /// The beams in the vehicle; `None` if the motion does not show them.
    pub fn aim(&self, rows: &[Row], imu: &Inertial, force: [f64; 3]) -> Option<Aimed> {
        let turned = |azimuth: Vec<f64>| {
            let turn = axes::of_log(imu, force, &self.velocities(&azimuth, rows))?;
            Some((azimuth, turn))
        };
        let found = self.candidates(rows).into_iter().filter_map(turned);
        let (azimuth, turn) = found.min_by(|a, b| a.1.sigma.total_cmp(&b.1.sigma))?;
        let Turn { angle, sigma, size } = turn;
        let azimuth = azimuth.iter().map(|a| (a + angle.to_degrees()).rem_euclid(360.0)).collect();
        let (slant, scale) = match self.slant {
            Some(slant) => (slant, KNOWN),
            None => (slant(size[0]), (2.0 * sigma).max(size[1])),
        };
        Some(Aimed { azimuth, sigma: sigma.to_degrees(), slant, scale })
    }
}

/// The slant, deg, of velocities that are too large by a factor.
fn slant(size: f64) -> f64 {
    (size * FIRST.to_radians().sin()).min(0.99).asin().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vehicle with 1.2 m/s ahead, 0.3 m/s to the right and 0.1 m/s down; the beams 1 and 2 are opposite.
    #[test]
    fn opposite_beams_are_found_by_their_sums() {
        let beams = Beams { count: 4, slant: Some(20.0), azimuth: None };
        let (s, c) = 20_f64.to_radians().sin_cos();
        let along = |azimuth: f64| {
            let (y, x) = azimuth.to_radians().sin_cos();
            s * (1.2 * x + 0.3 * y) + c * 0.1
        };
        let rows = vec![(0.0, [270.0, 90.0, 0.0, 180.0].map(along)); 20];
        let found = beams.candidates(&rows);
        assert_eq!(found, [FOUR[1].to_vec(), FOUR[1].map(|a| -a).to_vec()]);
    }
}
