//! The coarse alignment: an attitude from the first samples.

use super::config::{AlignmentMethod, CoarseMethod, Formula};
use super::error::AlignmentError;
use super::in_flight::{Received, Track};
use super::inertial::{Instant, Integral, align};
use super::optimisation::{analytic, fit};
use super::sensors::{Channels, Model};
use super::settings::AlignmentSettings;
use crate::earth::LocalEarth;
use crate::imu::Imu;
use crate::mechanisation::Increments;
use crate::navigation::Navigation;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::state::covariance::Update;
use navfuse_core::state::manifold::Reading;
use navfuse_core::state::{Block, Layout, Mode, State, View};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use navfuse_core::units::time::{Span, Time};
use std::collections::VecDeque;

/// Interval between the instants of an alignment at rest, s.
const INTERVAL: f64 = 1.0;
/// Ratio of a velocity to its sigma beyond which the vehicle moves.
const MOTION: f64 = 6.0;
/// Least number of velocities of an alignment in motion.
const FEWEST: usize = 10;
/// Largest prior sigma of a misalignment, rad, for which Monte Carlo runs showed consistent states.
const VERIFIED: f64 = 1.0 / 180.0 * std::f64::consts::PI;

/// Sensors of an alignment.
#[derive(Clone)]
pub(crate) struct Sensed {
    pub navigation: Navigation,
    pub imu: Imu,
    pub driver: usize,
    /// Index and model of the sensor that measures the velocity.
    pub velocity: Option<(usize, Model)>,
    /// Channels of that sensor, if it is a GNSS receiver, and the formula in which they enter.
    pub gnss: Option<(Channels, Formula)>,
}

/// Attitude and velocity at the beginning.
#[derive(Clone, Debug)]
pub(crate) struct CoarseSolution {
    pub c_b_n: UnitQuaternion<f64>,
    pub velocity: Vector3<f64>,
}

impl CoarseSolution {
    pub fn set(&self, layout: &Layout, navigation: &Navigation, state: &mut State) {
        state.set(layout, navigation.attitude, &self.c_b_n.to_rotation_matrix());
        state.set(layout, navigation.velocity, &self.velocity);
    }
}

/// Integrates the inertial samples and collects the instants from which the attitude follows.
#[derive(Clone, Default)]
pub(crate) struct CoarseAlignment {
    /// The state at the beginning with the identity as attitude and zero velocity, at which the
    /// model of the velocity sensor is linearised.
    state: State,
    earth: LocalEarth,
    begin: Time,
    /// Time of the latest driving sample.
    last: Time,
    integral: Integral,
    /// Sums of angles and velocity increments, for the analytic alignment.
    sums: (Vector3<f64>, Vector3<f64>),
    instants: Vec<Instant>,
    /// In motion, the sample of the velocity sensor at each instant, and the angular rate then.
    measured: Vec<(Sample, [f64; 3])>,
    /// Velocity samples later than the latest driving sample.
    waiting: VecDeque<Sample>,
    /// The fixes of GNSS.
    track: Track,
}

saved!(CoarseAlignment {
    state,
    earth,
    begin,
    last,
    integral,
    sums,
    instants,
    measured,
    waiting,
    track
});

impl CoarseAlignment {
    pub fn new(layout: &Layout, state: &State, navigation: Navigation) -> Self {
        let position = state.get(layout, navigation.position);
        let mut state = state.clone();
        state.set(layout, navigation.attitude, &Rotation3::identity());
        state.set(layout, navigation.velocity, &Vector3::zeros());
        Self {
            earth: LocalEarth::at(position.latitude, position.height),
            begin: state.time,
            last: state.time,
            state,
            integral: Integral::default(),
            sums: (Vector3::zeros(), Vector3::zeros()),
            instants: Vec::new(),
            measured: Vec::new(),
            waiting: VecDeque::new(),
            track: Track::default(),
        }
    }

    /// Time since the beginning, s.
    pub fn elapsed(&self) -> f64 {
        self.last.since(self.begin)
    }

    /// Takes a sample, and reports whether there are enough.
    pub fn take(
        &mut self,
        layout: &Layout,
        sensed: &Sensed,
        settings: &AlignmentSettings,
        sample: &Sample,
    ) -> Result<bool, AlignmentError> {
        let sensor = sample.sensor.0;
        if sensed.velocity.as_ref().is_some_and(|(index, _)| *index == sensor) {
            self.waiting.push_back(*sample);
        }
        let dt = sample.time.since(self.last);
        if sensor != sensed.driver || dt <= 0.0 {
            return Ok(false);
        }
        let Some((w, f)) = sensed.imu.rates(sample, dt) else { return Ok(false) };
        sensed.navigation.publish(&mut self.state, &[w.x, w.y, w.z]);
        let [gyro, accel] = sensed.navigation.biases(layout, &self.state);
        let (w, f) = (w - gyro, f - accel);
        if self.instants.is_empty() && settings.method == AlignmentMethod::Static {
            self.note(0.0, Vector3::zeros());
        }
        let part = |dt: f64| Increments { dtheta: w * dt, dvel: f * dt, dt };
        while let Some(waiting) = self.waiting.pop_front_if(|s| s.time <= sample.time) {
            let before = part(waiting.time.since(self.last).max(0.0));
            self.velocity(layout, sensed, waiting, &before, settings)?;
        }
        self.integral.advance(&part(dt));
        self.sums.0 += w * dt;
        self.sums.1 += f * dt;
        self.last = sample.time;
        if let Some(last) = self.instants.last().map(|i| i.time)
            && sensed.velocity.is_none()
            && self.elapsed() >= last + INTERVAL
        {
            self.note(self.elapsed(), Vector3::zeros());
        }
        Ok(self.elapsed() >= settings.coarse_duration)
    }

    /// Computes attitude and velocity at the beginning from the samples so far.
    pub fn find(
        &self,
        sensed: &Sensed,
        settings: &AlignmentSettings,
    ) -> Result<CoarseSolution, AlignmentError> {
        match settings.method {
            AlignmentMethod::InMotion => self.in_motion(settings),
            AlignmentMethod::InFlight => self.in_flight(sensed, settings),
            AlignmentMethod::Given | AlignmentMethod::Static | AlignmentMethod::Course => {
                self.at_rest(sensed, settings)
            }
        }
    }

    /// Recomputes the velocities with the calibration states that a trial has estimated.
    pub fn measure_again(&mut self, layout: &Layout, sensed: &Sensed, state: &State) {
        let Some((_, model)) = &sensed.velocity else { return };
        let navigation = sensed.navigation;
        self.state.values.copy_from_slice(&state.values);
        self.state.set(layout, navigation.attitude, &Rotation3::identity());
        self.state.set(layout, navigation.velocity, &Vector3::zeros());
        for (instant, (sample, rate)) in self.instants.iter_mut().zip(&self.measured) {
            navigation.publish(&mut self.state, rate);
            if let Some(velocity) =
                body_velocity(layout, model.as_ref(), &self.state, sample, navigation)
            {
                instant.velocity = velocity;
            }
        }
    }

    /// Doubts an alignment in motion by a velocity sensor whose prior misalignment is beyond
    /// [`VERIFIED`]: evidence and remedy.
    pub fn unverified(&self, layout: &Layout, sensed: &Sensed) -> Option<(String, String)> {
        let ((_, model), (sample, _)) = (sensed.velocity.as_ref()?, self.measured.first()?);
        let mut update = Update::with_capacity(layout.tangent, MAX_CHANNELS);
        model.linearise(&At { layout, state: &self.state, sample }, &mut update);
        let attitude = layout.block(sensed.navigation.attitude).tangent;
        let read = |b: &&Block| {
            b.spec.mode == Mode::Estimate && b.tangent.is_some_and(|t| update.columns.contains(&t))
        };
        let rotations = layout
            .blocks
            .iter()
            .filter(|b| b.operations.reading == Reading::Angles && b.tangent != attitude);
        let (block, sigma) = rotations
            .filter(read)
            .map(|b| (b, b.spec.sigma.iter().copied().fold(0.0, f64::max)))
            .find(|(_, sigma)| *sigma > 1.001 * VERIFIED)?;
        let name = &block.name;
        let evidence = format!(
            "{name} has a prior sigma of {:.1} deg, and alignments in motion were verified up to \
             {:.0} deg: components that the turns do not determine, as a rule the roll, then become \
             overconfident",
            sigma.to_degrees(),
            VERIFIED.to_degrees(),
        );
        let remedy = format!(
            "give [estimator] relinearise = \"240 s\", measure the mounting, or take value and \
             sigma from an earlier dive (sensor.{name}.initial and .sigma)"
        );
        Some((evidence, remedy))
    }

    fn note(&mut self, time: f64, velocity: Vector3<f64>) {
        let Integral { c_b_b0, dvel, .. } = self.integral;
        self.instants.push(Instant { time, c_b_b0, dvel, velocity });
    }

    /// Adds the instant of a velocity sample; `before` is the part of the driving sample before it.
    fn velocity(
        &mut self,
        layout: &Layout,
        sensed: &Sensed,
        mut sample: Sample,
        before: &Increments,
        settings: &AlignmentSettings,
    ) -> Result<(), AlignmentError> {
        let (Some((_, model)), navigation) = (&sensed.velocity, sensed.navigation) else {
            return Ok(());
        };
        model.complete(&mut sample);
        let time = sample.time.since(self.begin);
        let mut then = self.integral;
        if before.dt > 0.0 {
            then.advance(before);
        }
        if let Some((channels, formula)) = sensed.gnss {
            self.gap(time, settings)?;
            let at = self.state.get(layout, navigation.position);
            let mut still = [0.0; MAX_CHANNELS];
            let here = At { layout, state: &self.state, sample: &sample };
            model.predict(&here, &mut still[..model.channels()]);
            let received = Received { time, sample: &sample, integral: &then, still, at };
            self.track.take(channels, formula, &received);
            return Ok(());
        }
        let Some(velocity) =
            body_velocity(layout, model.as_ref(), &self.state, &sample, navigation)
        else {
            return Ok(());
        };
        self.gap(time, settings)?;
        self.instants.push(Instant { time, c_b_b0: then.c_b_b0, dvel: then.dvel, velocity });
        self.measured.push((sample, navigation.published(&View::new(layout, &self.state))));
        Ok(())
    }

    /// Rejects a gap in the velocities that is too long, up to `time` since the beginning.
    fn gap(&self, time: f64, settings: &AlignmentSettings) -> Result<(), AlignmentError> {
        let last = self.instants.last().map_or(self.track.time(), |i| i.time);
        if time - last <= settings.max_gap {
            return Ok(());
        }
        let at = |t: f64| self.begin + Span::from_seconds(t).unwrap_or_default();
        Err(AlignmentError::VelocityGap {
            gap: time - last,
            from: at(last),
            duration: settings.duration,
        })
    }

    fn in_motion(&self, settings: &AlignmentSettings) -> Result<CoarseSolution, AlignmentError> {
        self.gap(self.elapsed(), settings)?;
        let count = self.instants.len();
        let fitted = || align(&self.instants, &self.earth, settings.coarse);
        let found = (count >= FEWEST).then(fitted).flatten();
        let (Some(found), Some(first)) = (found, self.instants.first()) else {
            return Err(Self::too_few(count, settings));
        };
        Ok(CoarseSolution {
            velocity: found.c_b_n * (first.c_b_b0 * first.velocity),
            c_b_n: found.c_b_n,
        })
    }

    fn in_flight(
        &self,
        sensed: &Sensed,
        settings: &AlignmentSettings,
    ) -> Result<CoarseSolution, AlignmentError> {
        self.gap(self.elapsed(), settings)?;
        let count = self.track.count();
        let (_, formula) = sensed.gnss.ok_or_else(|| Self::too_few(0, settings))?;
        let fitted = || fit(&self.track.pairs(formula), settings.coarse);
        let c_b_n = (count >= FEWEST).then(fitted).flatten();
        let c_b_n = c_b_n.ok_or_else(|| Self::too_few(count, settings))?;
        Ok(CoarseSolution { velocity: self.track.beginning(formula, &c_b_n), c_b_n })
    }

    fn too_few(count: usize, settings: &AlignmentSettings) -> AlignmentError {
        AlignmentError::TooFewVelocities { count, duration: settings.duration, least: FEWEST }
    }

    fn at_rest(
        &self,
        sensed: &Sensed,
        settings: &AlignmentSettings,
    ) -> Result<CoarseSolution, AlignmentError> {
        let found = align(&self.instants, &self.earth, settings.coarse);
        let found = found.ok_or(AlignmentError::NoDirection)?;
        // sigma of the apparent velocity of a vehicle at rest: sway at both ends, accelerometer
        // bias and noise, and the tilt from gyro bias (g b t^2 / 2) and gyro noise (g N sqrt(t^3 /
        // 3))
        let (gyro, accel) = (sensed.imu.gyro_noise().amax(), sensed.imu.accel_noise().amax());
        let g = self.earth.gravity;
        let sigma = |t: f64| {
            let drift = g * gyro * t.powf(1.5) / 3_f64.sqrt();
            let (tilting, falling) = (g * settings.bias.0 * 0.5 * t * t, settings.bias.1 * t);
            let squares = tilting * tilting + falling * falling + drift * drift + accel * accel * t;
            (2.0 * settings.rest_velocity.powi(2) + squares).sqrt()
        };
        // a(t) grows with time, so the last instants determine the attitude; their error enters the
        // residuals of the others in proportion to time
        let end = self.elapsed();
        let sigma = |t: f64| sigma(t).hypot(sigma(end) * t / end);
        let times = self.instants.iter().skip(1).map(|i| i.time);
        if let Some((time, error)) =
            times.zip(&found.residuals).find(|(t, r)| **r > MOTION * sigma(*t))
        {
            let at = self.begin + Span::from_seconds(time).unwrap_or_default();
            return Err(AlignmentError::NotAtRest {
                error: *error,
                at,
                duration: settings.duration,
                begin: self.begin,
            });
        }
        let c_b_n = match settings.coarse {
            CoarseMethod::Optimisation | CoarseMethod::VelocityLoci => found.c_b_n,
            CoarseMethod::Analytic => {
                let t = self.elapsed();
                analytic(&(self.sums.1 / t), &(self.sums.0 / t), &self.earth)
                    .ok_or(AlignmentError::NoDirection)?
            }
        };
        Ok(CoarseSolution { c_b_n, velocity: Vector3::zeros() })
    }
}

/// Computes the velocity in body axes from a sample of the velocity sensor, with all other states
/// as they are: `v = (H' R^-1 H)^-1 H' R^-1 (z - h(0))`. One step of weighted least squares
/// suffices, because `h` is linear in the velocity; at the identity as attitude, navigation axes
/// are body axes. `None` where the channels do not determine all three components.
fn body_velocity(
    layout: &Layout,
    model: &dyn AnyMeasurement,
    state: &State,
    sample: &Sample,
    navigation: Navigation,
) -> Option<Vector3<f64>> {
    let first = layout.block(navigation.velocity).tangent?;
    let mut update = Update::with_capacity(layout.tangent, MAX_CHANNELS);
    model.linearise(&At { layout, state, sample }, &mut update);
    let (m, w) = (update.m, update.columns.len());
    let place = update.columns.iter().position(|&c| c == first)?;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for i in 0..m {
        let row = Vector3::from_column_slice(&update.h[i * w + place..][..3]);
        let weight = 1.0 / update.r[i * m + i].max(f64::MIN_POSITIVE);
        normal += row * row.transpose() * weight;
        right += row * (update.innovation[i] * weight);
    }
    let eigenvalues = normal.symmetric_eigenvalues();
    (eigenvalues.min() > 1e-6 * eigenvalues.max())
        .then(|| normal.try_inverse().map(|inverse| inverse * right))?
}

#[cfg(test)]
mod tests;
