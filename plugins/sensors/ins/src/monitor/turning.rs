//! Rule: gravity turns in body axes as the gyros turn.
//!
//! With the velocity `v` in body axes, `p = f - w x v` is the reaction to gravity and the change of
//! speed. Without the latter, `p' = -w x p`. Axes that are left-handed turn it the other way; rates
//! in deg/s turn it 57 times too far. The rule compares the residuals of that equation for the
//! samples as they are with those for each error of use.

use super::fault::Fault;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::record::finding::{Basis, Severity};

/// Length of the blocks of which means are compared, s.
const BLOCK: f64 = 0.5;
/// Ratio of the residuals that is evidence of an error of use.
const EVIDENCE: f64 = 9.0;
/// Part of the observed change that the error of use must explain.
const EXPLAINED: f64 = 0.5;
/// Least sum of squared changes for a decision, (m/s^2)^2: rolling by 5 deg in two seconds.
const LEAST: f64 = 0.1;
/// Number of blocks before a decision.
const BLOCKS: u32 = 8;

/// An error of use: the samples as they should be, from those that are.
struct Reading {
    words: &'static str,
    /// Matrices on the specific force and on the angular rate, by row.
    force: [f64; 9],
    rate: [f64; 9],
}

const ONE: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

const fn diagonal(x: f64, y: f64, z: f64) -> [f64; 9] {
    [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
}

/// Axes of the whole IMU.
const fn axes(words: &'static str, axes: [f64; 9]) -> Reading {
    Reading { words, force: axes, rate: axes }
}

/// Gyros beside right accelerometers.
const fn gyros(words: &'static str, rate: [f64; 9]) -> Reading {
    Reading { words, force: ONE, rate }
}

/// A degree, rad: the factor of gyros whose unit is wrong.
pub(super) const DEGREE: f64 = 1_f64.to_radians();

#[rustfmt::skip]
const ERRORS: [Reading; 10] = [
    gyros("the gyros are in deg/s", diagonal(DEGREE, DEGREE, DEGREE)),
    gyros("the gyros were converted from deg/s twice", diagonal(1.0 / DEGREE, 1.0 / DEGREE, 1.0 / DEGREE)),
    gyros("the x gyro has the other sign", diagonal(-1.0, 1.0, 1.0)),
    gyros("the y gyro has the other sign", diagonal(1.0, -1.0, 1.0)),
    axes("the x axis points backward", diagonal(-1.0, 1.0, 1.0)),
    axes("the y axis points left", diagonal(1.0, -1.0, 1.0)),
    axes("the z axis points up", diagonal(1.0, 1.0, -1.0)),
    axes("the x and y axes are swapped", [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
    axes("the x and z axes are swapped", [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]),
    axes("the y and z axes are swapped", [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0]),
];

/// Mean rates of a block.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    w: Vector3<f64>,
    f: Vector3<f64>,
    v: Vector3<f64>,
}

saved!(Block { w, f, v });

/// Sums of squares for one reading of the samples.
#[derive(Clone, Copy, Debug, Default)]
struct Squares {
    /// Of the residuals, and of the change itself.
    residual: f64,
    change: f64,
}

saved!(Squares { residual, change });

impl Squares {
    /// Adds two blocks, read with these matrices on the specific force and on the angular rate.
    fn add(&mut self, force: &[f64; 9], rate: &[f64; 9], before: &Block, after: &Block) {
        let (force, rate) = (Matrix3::from_row_slice(force), Matrix3::from_row_slice(rate));
        let p = |b: &Block| force * b.f - (rate * b.w).cross(&b.v);
        let (p0, p1) = (p(before), p(after));
        let angle = rate * (before.w + after.w) * (0.5 * BLOCK);
        let (change, turned) = (p1 - p0, -angle.cross(&((p0 + p1) * 0.5)));
        self.residual += (change - turned).norm_squared();
        self.change += change.norm_squared();
    }
}

/// Comparison of the accelerometers with the gyros.
#[derive(Clone, Default)]
pub(super) struct Turning {
    /// Velocity in body axes after the last correction, m/s.
    pub(super) velocity: Vector3<f64>,
    w: Vector3<f64>,
    f: Vector3<f64>,
    time: f64,
    before: Option<Block>,
    blocks: u32,
    right: Squares,
    wrong: [Squares; ERRORS.len()],
    reported: bool,
}

saved!(Turning { velocity, w, f, time, before, blocks, right, wrong, reported });

impl Turning {
    #[inline]
    pub(super) fn take(&mut self, w: &Vector3<f64>, f: &Vector3<f64>, dt: f64) -> Option<Fault> {
        self.w += w * dt;
        self.f += f * dt;
        self.time += dt;
        if self.time < BLOCK || self.reported {
            return None;
        }
        let block = Block { w: self.w / self.time, f: self.f / self.time, v: self.velocity };
        (self.w, self.f, self.time) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let before = self.before.replace(block)?;
        self.blocks += 1;
        self.right.add(&ONE, &ONE, &before, &block);
        for (squares, Reading { force, rate, .. }) in self.wrong.iter_mut().zip(&ERRORS) {
            squares.add(force, rate, &before, &block);
        }
        self.decide()
    }

    fn decide(&mut self) -> Option<Fault> {
        if self.blocks < BLOCKS || self.right.residual < LEAST {
            return None;
        }
        // an error of use that puts a level vehicle on its side is none
        let level = |force: &[f64; 9]| {
            let f =
                Matrix3::from_row_slice(force) * self.before.map_or_else(Vector3::zeros, |b| b.f);
            f.z < -0.5 * f.norm()
        };
        let squares = self.wrong.iter().zip(&ERRORS).filter(|(_, reading)| level(&reading.force));
        let (best, Reading { words, .. }) =
            squares.min_by(|(a, _), (b, _)| a.residual.total_cmp(&b.residual))?;
        let ratio = self.right.residual / best.residual;
        if best.change < LEAST || ratio < EVIDENCE || best.residual > EXPLAINED * best.change {
            return None;
        }
        self.reported = true;
        Some(Fault {
            severity: Severity::DoNotUse,
            basis: Basis::Samples,
            text: format!(
                "gravity does not turn as the gyros turn; the residuals are {:.0} times smaller if, \
                 for example, {words}",
                ratio.sqrt()
            ),
            remedy: "check the units and signs of the gyros, and that the axes of gyros and \
                     accelerometers are forward, right, down: change the sign of one axis, or exchange two"
                .to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use nalgebra::Rotation3;

    /// Rate of the samples, Hz: a power of two, so that times add up without rounding.
    const RATE: f64 = 64.0;

    /// Velocity of the vehicle in its own axes, m/s: turning adds to the specific force.
    const VELOCITY: Vector3<f64> = Vector3::new(3.0, 0.5, -0.3);

    /// Sample `k` of a vehicle that rolls and pitches by 0.35 rad, or a share of it, at 0.25 and
    /// 0.2 Hz.
    fn rocking(k: u32, share: f64) -> (Vector3<f64>, Vector3<f64>) {
        let at = |t: f64| {
            let (roll, pitch) = (0.35 * (1.57 * t).sin(), 0.35 * (1.26 * t).sin());
            Rotation3::from_euler_angles(share * roll, share * pitch, share * 0.2 * t)
        };
        let t = f64::from(k) / RATE;
        let w = (at(t).inverse() * at(t + 1.0 / RATE)).scaled_axis() * RATE;
        let up = Vector3::new(0.0, 0.0, -9.81);
        (w, at(t + 0.5 / RATE).inverse() * up + w.cross(&VELOCITY))
    }

    /// The first fault within a minute, with the number of samples.
    fn fault(mut samples: impl FnMut(u32) -> (Vector3<f64>, Vector3<f64>)) -> Option<(u32, Fault)> {
        let mut rule = Turning { velocity: VELOCITY, ..Turning::default() };
        (0..60 * RATE as u32).find_map(|k| {
            let (w, f) = samples(k);
            rule.take(&w, &f, 1.0 / RATE).map(|fault| (k + 1, fault))
        })
    }

    #[test]
    fn a_vehicle_that_rocks_is_no_fault() {
        assert!(fault(|k| rocking(k, 1.0)).is_none());
    }

    /// Each error of use makes the samples from those that would be right. Eight changes between
    /// blocks of half a second take 4.5 s. What remains with the right samples is the curvature of
    /// the motion in a block, less than a tenth of the change.
    #[test]
    fn every_error_of_use_is_named_after_eight_changes() {
        for Reading { words: name, force, rate } in ERRORS {
            let [force, rate] = [force, rate].map(|m| Matrix3::from_row_slice(&m));
            let inverse = rate.try_inverse().unwrap();
            let read = |k| {
                let (w, f) = rocking(k, 1.0);
                (inverse * w, force * f)
            };
            let (samples, found) = fault(read).unwrap();
            assert_eq!(f64::from(samples) / RATE, 4.5, "{name}");
            assert!(found.text.ends_with(name), "{name}: {}", found.text);
            let times = found.text.split(' ').find_map(|word| word.parse::<f64>().ok());
            assert!(times.is_some_and(|times| times > 10.0), "{}", found.text);
        }
    }

    /// Rolling by 5 deg is enough; a hundredth of the rocking, by 0.2 deg, turns gravity by less than
    /// 0.1 (m/s^2)^2 in a minute: (3.5e-3 * 9.81 * 1.57 / 2)^2 / 2 for 120 changes of two axes.
    #[test]
    fn a_vehicle_that_hardly_moves_is_not_judged() {
        let in_degrees = |share: f64| {
            fault(|k| {
                let (w, f) = rocking(k, share);
                (w * 57.3, f)
            })
        };
        assert!(in_degrees(0.25).is_some());
        assert!(in_degrees(0.01).is_none());
    }

    /// Gyros that show 1 rad/s beside accelerometers that show a shaking alone: no unit of the gyros
    /// explains that, although one that makes them 57 times smaller leaves smaller residuals.
    #[test]
    fn a_contradiction_that_no_error_of_use_explains_is_left_to_other_rules() {
        let shaking = |k: u32| {
            let side = if (k / 32).is_multiple_of(2) { 0.2 } else { -0.2 };
            let force = Vector3::new(0.0, side, -9.81);
            (Vector3::x(), force + Vector3::x().cross(&VELOCITY))
        };
        assert!(fault(shaking).is_none());
    }
}
