//! Rule: the gyros and a sensor that measures velocities in body axes have the senses that the accelerometers see.
//!
//! With the velocity `v` in body axes, `r = f - dv/dt - w x v` is the reaction to gravity. In axes that do not turn
//! with the vehicle, `C r` with `C' = C [w x]` is constant. The rule compares the scatter of `C r` about its mean in
//! windows for the samples as they are and for each error of use. It needs no attitude, and sees what the tilt does
//! not show: the sign of the gyro about the vertical, in a turn.

use super::fault::Fault;
use super::turning::DEGREE;
use crate::navigation::Navigation;
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::monitor::MeasuredVelocity;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};

/// Least time between two velocities of a block, and the longest, s.
const BLOCK: f64 = 0.9;
const GAP: f64 = 3.0;
/// Number of blocks of a window: a gyro that is off by 100 deg/h turns gravity by 0.1 m/s^2 meanwhile.
const WINDOW: u32 = 24;
/// Ratio of the scatter that is evidence of an error of use, as for gyros that turn gravity, and the one to
/// the best error of use of another part.
const EVIDENCE: f64 = 9.0;
const ALONE: f64 = 3.0;
/// Least sum of squares that the error of use has to explain, (m/s^2)^2: a turn of 3 deg/s at 1.5 m/s gives
/// `2 w v` = 0.16 m/s^2, and half of it is left after ten of such blocks.
const LEAST: f64 = 0.1;

/// Part whose samples have another sense.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Gyros,
    Velocity,
    /// One of the two is turned by 180 deg about the vertical, and [`super::axes`] names both: without a motion to
    /// the side a velocity along `x` alone looks the same.
    Either,
}

/// Factors of the axes, which make the samples as they should be.
const RIGHT: [f64; 3] = [1.0; 3];
const X: [f64; 3] = [-1.0, 1.0, 1.0];
const Y: [f64; 3] = [1.0, -1.0, 1.0];
const Z: [f64; 3] = [1.0, 1.0, -1.0];

/// Errors of use: the part, its factors, and words for them.
const ERRORS: [(Part, [f64; 3], &str); 9] = [
    (Part::Either, [-1.0, -1.0, 1.0], ""),
    (Part::Gyros, [1.0 / DEGREE; 3], "its gyros were converted from deg/s twice"),
    (Part::Gyros, X, "its x gyro has the other sign"),
    (Part::Gyros, Y, "its y gyro has the other sign"),
    (Part::Gyros, Z, "its z gyro has the other sign"),
    (Part::Velocity, X, "its velocity along x has the other sign"),
    (Part::Velocity, Y, "its velocity along y has the other sign"),
    (Part::Velocity, Z, "its velocity along z has the other sign"),
    (Part::Velocity, [-1.0; 3], "all its velocities have the other sign"),
];

/// Means of a block, and the velocities at its ends.
#[derive(Clone, Copy, Debug)]
struct Block {
    w: Vector3<f64>,
    f: Vector3<f64>,
    v: [Vector3<f64>; 2],
    time: f64,
}

/// Scatter of the reaction to gravity for one reading of the samples.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    /// Axes of the body at the end of the last block, in those at the begin of the window.
    c: Matrix3<f64>,
    sum: Vector3<f64>,
    squares: f64,
    /// Sum of squares about the mean of each window before.
    residual: f64,
}

saved!(Scatter { c, sum, squares, residual });

impl Default for Scatter {
    fn default() -> Self {
        Self { c: Matrix3::identity(), sum: Vector3::zeros(), squares: 0.0, residual: 0.0 }
    }
}

impl Scatter {
    fn add(&mut self, gyros: [f64; 3], velocity: [f64; 3], block: &Block) {
        let w = block.w.component_mul(&Vector3::from(gyros));
        let v = block.v.map(|v| v.component_mul(&Vector3::from(velocity)));
        let half = Rotation3::from_scaled_axis(w * (0.5 * block.time)).into_inner();
        let middle = self.c * half;
        let change = (v[1] - v[0]) / block.time;
        let reaction = middle * (block.f - change - w.cross(&((v[0] + v[1]) * 0.5)));
        self.sum += reaction;
        self.squares += reaction.norm_squared();
        self.c = middle * half;
    }

    fn end_window(&mut self, count: u32) {
        let residual = self.squares - self.sum.norm_squared() / f64::from(count);
        *self = Self { residual: self.residual + residual, ..Self::default() };
    }

    fn abandon_window(&mut self) {
        *self = Self { residual: self.residual, ..Self::default() };
    }
}

/// Comparison of the senses with those of the first sensor that measures in axes of its own.
#[derive(Clone, Default)]
pub(super) struct Senses {
    sensor: Option<String>,
    begin: Option<Vector3<f64>>,
    w: Vector3<f64>,
    f: Vector3<f64>,
    time: f64,
    count: u32,
    right: Scatter,
    wrong: [Scatter; ERRORS.len()],
    due: bool,
    reported: bool,
}

saved!(Senses { sensor, begin, w, f, time, count, right, wrong, due, reported });

impl Senses {
    /// Ends the comparison: the samples show another fault.
    pub(super) fn end(&mut self) {
        self.reported = true;
    }

    /// Takes a velocity that a sensor measures.
    pub(super) fn measured(
        &mut self,
        filter: &FilterView<'_>,
        n: &Navigation,
        measured: &MeasuredVelocity<'_>,
    ) {
        if self.reported || !measured.own_axes {
            return;
        }
        if self.sensor.get_or_insert_with(|| measured.sensor.to_owned()) == measured.sensor {
            let c_n_b = filter.state.get(filter.layout, n.attitude).inverse();
            self.velocity(c_n_b * Vector3::from(measured.velocity));
        }
    }

    /// Takes a velocity in body axes, and adds the block that it ends.
    fn velocity(&mut self, v: Vector3<f64>) {
        if self.begin.is_some() && self.time < BLOCK {
            return;
        }
        let (w, f, time) = (self.w, self.f, self.time);
        match self.begin.filter(|_| time < GAP) {
            Some(begin) => {
                self.add(&Block { w: w / time, f: f / time, v: [begin, v], time });
            }
            None => {
                self.count = 0;
                self.all(Scatter::abandon_window);
            }
        }
        self.begin = Some(v);
        (self.w, self.f, self.time) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    }

    fn all(&mut self, change: impl FnMut(&mut Scatter)) {
        std::iter::once(&mut self.right).chain(&mut self.wrong).for_each(change);
    }

    fn add(&mut self, block: &Block) {
        self.right.add(RIGHT, RIGHT, block);
        for (scatter, (part, signs, _)) in self.wrong.iter_mut().zip(&ERRORS) {
            match part {
                Part::Gyros => scatter.add(*signs, RIGHT, block),
                Part::Velocity | Part::Either => scatter.add(RIGHT, *signs, block),
            }
        }
        self.count += 1;
        if self.count == WINDOW {
            self.all(|scatter| scatter.end_window(WINDOW));
            self.count = 0;
            self.due = true;
        }
    }

    /// Adds a sample of the IMU, and decides after a window; the name is that of the sensor at fault, if it is not
    /// the IMU.
    #[inline]
    pub(super) fn take(
        &mut self,
        w: &Vector3<f64>,
        f: &Vector3<f64>,
        dt: f64,
    ) -> Option<(Fault, Option<&str>)> {
        if self.reported || self.sensor.is_none() {
            return None;
        }
        self.w += w * dt;
        self.f += f * dt;
        self.time += dt;
        if !std::mem::take(&mut self.due) {
            return None;
        }
        let residual = |error: &(&Scatter, Part)| error.0.residual;
        let errors = self.wrong.iter().zip(&ERRORS).map(|(scatter, (part, ..))| (scatter, *part));
        let (at, best) =
            errors.clone().enumerate().min_by(|a, b| residual(&a.1).total_cmp(&residual(&b.1)))?;
        let rival = errors.filter(|error| error.1 != best.1).map(|error| residual(&error));
        let rival = rival.fold(f64::INFINITY, f64::min);
        let (right, left) = (self.right.residual, residual(&best));
        let better = right - left >= LEAST && right >= EVIDENCE * left;
        if !(better && rival >= ALONE * left) {
            return None;
        }
        let sensor = self.sensor.as_deref()?;
        let words = ERRORS[at].2;
        let others = match best.1 {
            Part::Gyros => format!("the velocities of {sensor} and the accelerometers"),
            Part::Velocity => "the gyros and the accelerometers".to_owned(),
            Part::Either => return None,
        };
        self.reported = true;
        let fault = Fault {
            severity: Severity::DoNotUse,
            basis: Basis::Samples,
            text: format!(
                "{words}: so read, its samples fit {others} {:.0} times better",
                (right / left).sqrt()
            ),
            remedy: "check the signs and the unit of its axes, which are forward, right, down; \
                     `navfuse diagnose` tries each"
                .to_owned(),
        };
        Some((fault, (best.1 == Part::Velocity).then_some(sensor)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 16.0;

    /// Rates, specific force and velocity of a vehicle that turns to and fro, pitches, sways, heaves, and changes
    /// its speed: `f = dv/dt + w x v - g`, with noise of a velocity log of 1 cm/s.
    fn samples(seconds: u32) -> Vec<[Vector3<f64>; 3]> {
        let mut c = Rotation3::identity();
        let motion = |t: f64| {
            let speed = 1.5 + 0.4 * (0.11 * t).sin();
            let v = Vector3::new(speed, 0.4 * (0.31 * t).sin(), 0.4 * (0.37 * t).sin());
            let yaw = 0.08 * (0.05 * t).sin();
            (v, Vector3::new(0.01 * (0.23 * t).sin(), 0.02 * (0.19 * t).cos(), yaw))
        };
        let all = (0..seconds * RATE as u32).map(|k| {
            let t = f64::from(k) / RATE;
            let (v, w) = motion(t + 0.5 / RATE);
            let change = (motion(t + 1.0 / RATE).0 - motion(t).0) * RATE;
            c *= Rotation3::from_scaled_axis(w * (0.5 / RATE));
            let f = change + w.cross(&v) - c.inverse() * Vector3::new(0.0, 0.0, 9.81);
            c *= Rotation3::from_scaled_axis(w * (0.5 / RATE));
            let noise = Vector3::from_fn(|axis, _| {
                0.01 * f64::from((k * 7919 + axis as u32 * 104_729) % 1009) / 504.5 - 0.01
            });
            [w, f, motion(t + 1.0 / RATE).0 + noise]
        });
        all.collect()
    }

    /// What is found, and about which part, where the samples are read with these signs.
    fn found(gyros: [f64; 3], velocity: [f64; 3], seconds: u32) -> Option<(String, bool)> {
        let mut rule = Senses { sensor: Some("dvl".to_owned()), ..Senses::default() };
        samples(seconds).iter().enumerate().find_map(|(k, [w, f, v])| {
            let w = w.component_div(&Vector3::from(gyros));
            let fault = rule.take(&w, f, 1.0 / RATE);
            let fault = fault.map(|(fault, other)| (fault.text, other.is_some()));
            if (k + 1).is_multiple_of(RATE as usize) {
                rule.velocity(v.component_mul(&Vector3::from(velocity)));
            }
            fault
        })
    }

    #[test]
    fn each_sense_is_named_with_its_part_and_right_ones_are_no_fault() {
        assert_eq!(found(RIGHT, RIGHT, 600), None);
        for (part, signs, words) in ERRORS {
            let fault = match part {
                Part::Gyros => found(signs, RIGHT, 600),
                Part::Velocity => found(RIGHT, signs, 600),
                Part::Either => {
                    assert_eq!(found(RIGHT, signs, 600), None);
                    continue;
                }
            };
            let right = |(text, other): &(String, bool)| {
                text.contains(words) && *other == (part == Part::Velocity)
            };
            assert!(fault.as_ref().is_some_and(right), "{words}: {fault:?}");
        }
    }

    /// Velocities of another time fit no sense of them.
    #[test]
    fn a_clock_that_is_off_is_no_sense() {
        let mut rule = Senses { sensor: Some("dvl".to_owned()), ..Senses::default() };
        let samples = samples(600);
        for (k, [w, f, _]) in samples.iter().enumerate() {
            assert!(rule.take(w, f, 1.0 / RATE).is_none(), "{k}");
            if (k + 1).is_multiple_of(RATE as usize) {
                rule.velocity(samples[k.saturating_sub(4 * RATE as usize)][2]);
            }
        }
    }
}
