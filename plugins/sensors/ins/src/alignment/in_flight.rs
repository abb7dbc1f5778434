//! Attitude from the velocity or the positions of GNSS, in motion and in the air.
//!
//! With `b0` the body axes and `n0` the navigation axes of the beginning, both frozen in inertial
//! space, the navigation equation integrates to the velocity integration formula
//! ```text
//! C_b0^n0 a(t) = b(t) - v^n(0)
//! a(t) = int C_b^b0 f^b dt
//! b(t) = C_n^n0 v^n(t) + w_ie^n0 x int C_n^n0 v^n dt - int C_n^n0 g^n dt
//! ```
//! (Wu & Pan, *Velocity/position integration formula part I: application to in-flight coarse
//! alignment*, IEEE Trans. Aerosp. Electron. Syst. 49(2), 2013). One more integral over time gives the
//! position integration formula, in which `int C_n^n0 v^n dt` is the sum of the ways from one position
//! to the next. Unlike those of a velocity in body axes ([`super::inertial`]), all terms of `b` are
//! known, and latitude and gravity are those along the way.
//!
//! Every sample has the same noise, the first one too. The initial velocity is therefore fitted, as the
//! constant of the velocity formula and the slope of the position formula, and both sides enter
//! without it.
//!
//! An antenna at the lever arm `l` moves with `w x l` against the IMU, which adds `C_b^b0 (w x l)` to
//! `a`, and `C_b^b0 l` to its integral.

use super::config::Formula;
use super::inertial::Integral;
use super::sensors::Channels;
use crate::earth::LocalEarth;
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};

/// A sample of GNSS, and what the IMU measured until then.
pub(super) struct Received<'a> {
    /// Time since the beginning, s.
    pub time: f64,
    pub sample: &'a Sample,
    pub integral: &'a Integral,
    /// Prediction of the sample for a vehicle at the place `at`, whose axes are those of navigation
    /// and which does not move: lever arm and `w x l` in body axes.
    pub still: [f64; MAX_CHANNELS],
    pub at: Geodetic<f64>,
}

impl Received<'_> {
    fn place(&self, first: usize) -> Option<Geodetic<f64>> {
        let [latitude, longitude] = self.sample.array(first)?;
        let height = self.sample.get(first + 2).unwrap_or(self.at.height);
        Some(Geodetic { latitude, longitude, height })
    }

    /// Lever arm in body axes, m.
    fn arm(&self, first: usize) -> Vector3<f64> {
        let [latitude, longitude] = [0, 1].map(|k| self.still[first + k]);
        let height = self.still.get(first + 2).copied().unwrap_or(self.at.height);
        Geodetic { latitude, longitude, height }.ned_from(&self.at)
    }
}

/// A position, and the velocity there where the formula needs it.
#[derive(Clone, Copy, Debug, Default)]
struct Fix {
    /// Time since the beginning, s.
    time: f64,
    place: Geodetic<f64>,
    velocity: Vector3<f64>,
}

saved!(Fix { time, place, velocity });

/// `a` and `b` at a time, of either formula.
#[derive(Clone, Copy, Debug, Default)]
struct Epoch {
    time: f64,
    a: Vector3<f64>,
    b: Vector3<f64>,
}

saved!(Epoch { time, a, b });

/// The integrals of `b` along the fixes of a receiver, and the epochs of the formula.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    fix: Option<Fix>,
    c_n_n0: UnitQuaternion<f64>,
    w_ie_n0: Vector3<f64>,
    /// Integrals over time of `C_n^n0 v^n` and of `C_n^n0 g^n`, single and double.
    moved: [Vector3<f64>; 2],
    fallen: [Vector3<f64>; 2],
    epochs: Vec<Epoch>,
}

saved!(Track { fix, c_n_n0, w_ie_n0, moved, fallen, epochs });

impl Track {
    /// Time of the latest fix since the beginning, s.
    pub fn time(&self) -> f64 {
        self.fix.map_or(0.0, |fix| fix.time)
    }

    /// Number of epochs.
    pub fn count(&self) -> usize {
        self.epochs.len()
    }

    /// Takes a sample; one without all channels that the formula needs is left out.
    pub fn take(&mut self, channels: Channels, formula: Formula, received: &Received<'_>) {
        let Received { time, sample, integral, still, .. } = *received;
        let Some(place) = received.place(channels.position) else { return };
        let measured = channels.velocity.and_then(|first| sample.array::<3>(first));
        let velocity = Vector3::from(measured.unwrap_or_default());
        let here = Fix { time, place, velocity };
        let (a, b) = match (formula, channels.velocity.filter(|_| measured.is_some())) {
            (Formula::Velocity, None) => return,
            (Formula::Velocity, Some(first)) => {
                let before = self.fix.map_or(velocity, |from| from.velocity);
                self.reach(here, (before + velocity) * 0.5);
                let swing = Vector3::from_column_slice(&still[first..first + 3]);
                let b = self.c_n_n0 * velocity + self.w_ie_n0.cross(&self.moved[0]);
                (integral.dvel + integral.c_b_b0 * swing, b - self.fallen[0])
            }
            (Formula::Position, _) => {
                // the way to the first position is a constant, as its error is
                let mean = self.fix.and_then(|from| from.mean_velocity(&here));
                self.reach(here, mean.unwrap_or_default());
                let b = self.moved[0] + self.w_ie_n0.cross(&self.moved[1]);
                let arm = received.arm(channels.position);
                (integral.path + integral.c_b_b0 * arm, b - self.fallen[1])
            }
        };
        self.epochs.push(Epoch { time, a, b });
    }

    /// Extends the integrals to a fix, with the mean velocity until there.
    fn reach(&mut self, to: Fix, velocity: Vector3<f64>) {
        let first = self.fix.is_none();
        let from = self.fix.replace(to).unwrap_or(Fix { time: 0.0, ..to });
        let (dt, middle) = (to.time - from.time, from.middle(&to));
        let earth = LocalEarth::at(middle.latitude, middle.height);
        if first {
            self.w_ie_n0 = earth.earth_rate();
        }
        let (c, w_in) = (self.c_n_n0, earth.earth_rate() + earth.transport_rate(&velocity));
        let extend = |integrals: &mut [Vector3<f64>; 2], rate: Vector3<f64>| {
            let (rate, turning) = (c * rate, c * w_in.cross(&rate));
            integrals[1] += (integrals[0] + rate * (dt / 2.0) + turning * (dt * dt / 6.0)) * dt;
            integrals[0] += (rate + turning * (dt / 2.0)) * dt;
        };
        extend(&mut self.moved, velocity);
        extend(&mut self.fallen, Vector3::z() * earth.gravity);
        self.c_n_n0 *= UnitQuaternion::from_scaled_axis(w_in * dt);
    }

    /// Mean and slope over time of a side of the formula; the velocity formula has no slope to fit.
    fn trend(&self, formula: Formula, side: impl Fn(&Epoch) -> Vector3<f64>) -> Trend {
        let n = self.epochs.len() as f64;
        let time = self.epochs.iter().map(|e| e.time).sum::<f64>() / n;
        let mean = self.epochs.iter().map(&side).sum::<Vector3<f64>>() / n;
        let spread = self.epochs.iter().map(|e| (e.time - time).powi(2)).sum::<f64>();
        let steep = self.epochs.iter().map(|e| side(e) * (e.time - time)).sum::<Vector3<f64>>();
        let slope = match formula {
            Formula::Velocity => Vector3::zeros(),
            Formula::Position => steep / spread,
        };
        Trend { time, mean, slope }
    }

    /// `b` and `a` of each epoch without the fitted initial velocity.
    pub fn pairs(&self, formula: Formula) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let (a, b) = (self.trend(formula, |e| e.a), self.trend(formula, |e| e.b));
        let pair = |e: &Epoch| (e.b - b.at(e.time), e.a - a.at(e.time));
        self.epochs.iter().map(pair).collect()
    }

    /// Velocity at the beginning for an attitude then, m/s.
    pub fn beginning(&self, formula: Formula, c_b0_n: &UnitQuaternion<f64>) -> Vector3<f64> {
        let trend = self.trend(formula, |e| e.b - c_b0_n * e.a);
        match formula {
            Formula::Velocity => trend.mean,
            Formula::Position => trend.slope,
        }
    }
}

/// A straight line over time.
struct Trend {
    time: f64,
    mean: Vector3<f64>,
    slope: Vector3<f64>,
}

impl Trend {
    fn at(&self, time: f64) -> Vector3<f64> {
        self.mean + self.slope * (time - self.time)
    }
}

impl Fix {
    fn middle(&self, to: &Self) -> Geodetic<f64> {
        self.place.displaced(&(to.place.ned_from(&self.place) * 0.5))
    }

    /// Mean velocity until a later position, by the radii of curvature in the middle.
    fn mean_velocity(&self, to: &Self) -> Option<Vector3<f64>> {
        let (dt, middle) = (to.time - self.time, self.middle(to));
        let moved = to.place.ned_from(&middle) - self.place.ned_from(&middle);
        (dt > 0.0).then(|| moved / dt)
    }
}

#[cfg(test)]
mod tests;
