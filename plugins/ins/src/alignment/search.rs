//! The coarse alignment: from the samples of the beginning to an attitude.

use super::aligner::{Plan, Sensed};
use super::inertial::{Instant, Integral, align};
use super::optimisation::analytic;
use super::{Coarse, Method};
use crate::earth::LocalEarth;
use crate::mechanisation::Increments;
use crate::navigation::Navigation;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::model::measurement::{AnyMeasurement, At};
use navfuse_core::state::covariance::Update;
use navfuse_core::state::manifold::Reading;
use navfuse_core::state::{Block, Layout, Mode, State, View};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};
use navfuse_core::units::time::Time;
use std::collections::VecDeque;

/// At rest an instant is noted so often, s.
const INTERVAL: f64 = 1.0;
/// So many sigma of the velocity are a motion.
const MOTION: f64 = 6.0;
/// The fewest velocities in motion.
const FEWEST: usize = 10;
/// The largest prior sigma of a misalignment, rad, up to which the sigma of all states was found true over many runs.
const VERIFIED: f64 = 1.0 / 180.0 * std::f64::consts::PI;

/// What was found of the beginning.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub c_b_n: UnitQuaternion<f64>,
    pub velocity: Vector3<f64>,
}

impl Found {
    pub fn set(&self, layout: &Layout, navigation: &Navigation, state: &mut State) {
        state.set(layout, navigation.attitude, &self.c_b_n.to_rotation_matrix());
        state.set(layout, navigation.velocity, &self.velocity);
    }
}

/// Goes through the samples, and notes what the attitude follows from.
#[derive(Clone)]
pub(crate) struct Search {
    navigation: Navigation,
    /// The state of the beginning with the attitude of body axes and no velocity: where a velocity sensor is asked.
    state: State,
    earth: LocalEarth,
    begin: Time,
    /// The driving sample before.
    last: Time,
    integral: Integral,
    /// Sums of angles and velocity increments, for the analytic alignment.
    sums: (Vector3<f64>, Vector3<f64>),
    instants: Vec<Instant>,
    /// In motion, the velocity sensor's sample at each instant, and the angular rate then.
    told: Vec<(Sample, [f64; 3])>,
    /// Velocities that the driving sensor has not reached.
    waiting: VecDeque<Sample>,
}

impl Search {
    pub fn new(layout: &Layout, state: &State, navigation: Navigation) -> Self {
        let position = state.get(layout, navigation.position);
        let mut state = state.clone();
        state.set(layout, navigation.attitude, &Rotation3::identity());
        state.set(layout, navigation.velocity, &Vector3::zeros());
        Self {
            navigation,
            earth: LocalEarth::at(position.latitude, position.height),
            begin: state.time,
            last: state.time,
            state,
            integral: Integral::default(),
            sums: (Vector3::zeros(), Vector3::zeros()),
            instants: Vec::new(),
            told: Vec::new(),
            waiting: VecDeque::new(),
        }
    }

    /// Since the beginning, s.
    pub fn elapsed(&self) -> f64 {
        self.last.since(self.begin)
    }

    /// Takes a sample; the result when there are enough.
    pub fn take(
        &mut self,
        layout: &Layout,
        sensed: &Sensed,
        plan: &Plan,
        sample: &Sample,
    ) -> Result<bool, String> {
        let sensor = sample.sensor.0;
        if sensed.velocity.as_ref().is_some_and(|(index, _)| *index == sensor) {
            self.waiting.push_back(*sample);
        }
        let dt = sample.time.since(self.last);
        if sensor != sensed.driver || dt <= 0.0 {
            return Ok(false);
        }
        let Some((w, f)) = sensed.imu.rates(sample, dt) else { return Ok(false) };
        self.state.publish(self.navigation.angular_rate, &[w.x, w.y, w.z]);
        let bias = |block| self.state.get(layout, block);
        let (w, f) = (w - bias(self.navigation.gyro_bias), f - bias(self.navigation.accel_bias));
        if self.instants.is_empty() && plan.method == Method::Static {
            self.note(0.0, Vector3::zeros());
        }
        let part = |dt: f64| Increments { dtheta: w * dt, dvel: f * dt, dt };
        if let Some((_, model)) = &sensed.velocity {
            while let Some(waiting) = self.waiting.pop_front_if(|s| s.time <= sample.time) {
                self.velocity(
                    layout,
                    model.as_ref(),
                    waiting,
                    &part(waiting.time.since(self.last).max(0.0)),
                    plan,
                )?;
            }
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
        Ok(self.elapsed() >= plan.coarse_duration)
    }

    /// Attitude and velocity at the beginning from what was seen.
    pub fn find(&self, sensed: &Sensed, plan: &Plan) -> Result<Found, String> {
        match plan.method {
            Method::InMotion => self.in_motion(plan),
            Method::Given | Method::Static => self.at_rest(sensed, plan),
        }
    }

    /// Asks the velocity sensor again, with the calibration of a state.
    pub fn measure_again(&mut self, layout: &Layout, sensed: &Sensed, state: &State) {
        let Some((_, model)) = &sensed.velocity else { return };
        let navigation = self.navigation;
        self.state.values.copy_from_slice(&state.values);
        self.state.set(layout, navigation.attitude, &Rotation3::identity());
        self.state.set(layout, navigation.velocity, &Vector3::zeros());
        for (instant, (sample, rate)) in self.instants.iter_mut().zip(&self.told) {
            self.state.publish(navigation.angular_rate, rate);
            if let Some(velocity) =
                body_velocity(layout, model.as_ref(), &self.state, sample, navigation)
            {
                instant.velocity = velocity;
            }
        }
    }

    /// In motion, what to say of a velocity sensor whose misalignment is known less well than was verified.
    pub fn unverified(&self, layout: &Layout, sensed: &Sensed) -> Option<String> {
        let ((_, model), (sample, _)) = (sensed.velocity.as_ref()?, self.told.first()?);
        let mut update = Update::with_capacity(layout.tangent, MAX_CHANNELS);
        model.linearise(&At { layout, state: &self.state, sample }, &mut update);
        let attitude = layout.block(self.navigation.attitude).tangent;
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
        Some(format!(
            "{name} has a prior sigma of {:.1} deg, and alignments in motion were verified up to {:.0} deg: what the turns do not \
             tell of it, as a rule its roll, then gets a sigma that is too small; measure the mounting, or take value and sigma \
             from an earlier dive (sensor.{name}.initial and .sigma)",
            sigma.to_degrees(),
            VERIFIED.to_degrees(),
            name = block.name,
        ))
    }

    fn note(&mut self, time: f64, velocity: Vector3<f64>) {
        let Integral { c_b_b0, dvel, .. } = self.integral;
        self.instants.push(Instant { time, c_b_b0, dvel, velocity });
    }

    /// A sample of the velocity sensor, within a driving sample of which this is the part before it.
    fn velocity(
        &mut self,
        layout: &Layout,
        model: &dyn AnyMeasurement,
        mut sample: Sample,
        before: &Increments,
        plan: &Plan,
    ) -> Result<(), String> {
        model.complete(&mut sample);
        let Some(velocity) = body_velocity(layout, model, &self.state, &sample, self.navigation)
        else {
            return Ok(());
        };
        let time = sample.time.since(self.begin);
        self.gap(time, plan)?;
        let mut then = self.integral;
        if before.dt > 0.0 {
            then.advance(before);
        }
        self.instants.push(Instant { time, c_b_b0: then.c_b_b0, dvel: then.dvel, velocity });
        self.told
            .push((sample, View::new(layout, &self.state).signal(self.navigation.angular_rate)));
        Ok(())
    }

    /// Refuses a time without velocities that is too long, up to `time` since the beginning.
    fn gap(&self, time: f64, plan: &Plan) -> Result<(), String> {
        let last = self.instants.last().map_or(0.0, |i| i.time);
        if time - last <= plan.max_gap {
            return Ok(());
        }
        let at = |t: f64| self.begin + Time::from_seconds(t).unwrap_or_default();
        Err(format!(
            "no velocity for {:.1} s from {} on, inside an alignment in motion of {} s: start after it (estimator.start), end \
             before it (alignment.duration), or bridge it (alignment.max_gap)",
            time - last,
            at(last),
            plan.duration
        ))
    }

    fn in_motion(&self, plan: &Plan) -> Result<Found, String> {
        self.gap(self.elapsed(), plan)?;
        let count = self.instants.len();
        let found = (count >= FEWEST).then(|| align(&self.instants, &self.earth)).flatten();
        let (Some(found), Some(first)) = (found, self.instants.first()) else {
            return Err(format!(
                "{count} velocities in {} s do not tell the attitude: a sensor that measures all three components is needed, \
                 at least {FEWEST} times, away from the poles",
                plan.duration
            ));
        };
        Ok(Found { velocity: found.c_b_n * (first.c_b_b0 * first.velocity), c_b_n: found.c_b_n })
    }

    fn at_rest(&self, sensed: &Sensed, plan: &Plan) -> Result<Found, String> {
        let pole = || {
            "gravity and Earth rate do not tell the attitude here, or the IMU's samples are zero"
                .to_owned()
        };
        let found = align(&self.instants, &self.earth).ok_or_else(pole)?;
        // the velocity that a vehicle at rest seems to have by noise, biases and sway
        let (gyro, accel) =
            (sensed.imu.gyro_noise.value().si().amax(), sensed.imu.accel_noise.value().si().amax());
        let g = self.earth.gravity;
        let sigma = |t: f64| {
            let drift = g * gyro * t.powf(1.5) / 3_f64.sqrt();
            let (tilting, falling) = (g * plan.bias.0 * 0.5 * t * t, plan.bias.1 * t);
            let squares = tilting * tilting + falling * falling + drift * drift + accel * accel * t;
            (2.0 * plan.rest_velocity.powi(2) + squares).sqrt()
        };
        // the attitude fits the end best, so that its share of the error there grows evenly
        let end = self.elapsed();
        let sigma = |t: f64| sigma(t).hypot(sigma(end) * t / end);
        let times = self.instants.iter().skip(1).map(|i| i.time);
        if let Some((time, error)) =
            times.zip(&found.residuals).find(|(t, r)| **r > MOTION * sigma(*t))
        {
            let at = self.begin + Time::from_seconds(time).unwrap_or_default();
            return Err(format!(
                "the vehicle does not rest: its velocity is {error:.2} m/s off zero about {at}, and an alignment at rest needs {} s \
                 from {} on; start at a time at rest (estimator.start), raise alignment.rest_velocity if this is sway, or \
                 align in motion (alignment.method = \"in-motion\")",
                plan.duration, self.begin
            ));
        }
        let c_b_n = match plan.coarse {
            Coarse::Optimisation => found.c_b_n,
            Coarse::Analytic => {
                let t = self.elapsed();
                analytic(&(self.sums.1 / t), &(self.sums.0 / t), &self.earth).ok_or_else(pole)?
            }
        };
        Ok(Found { c_b_n, velocity: Vector3::zeros() })
    }
}

/// The velocity in body axes that a sensor tells, with everything else as the state says: `h` is linear in the velocity, so one
/// step of weighted least squares at the attitude of body axes gives it. `None` where the channels do not tell all three components.
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
