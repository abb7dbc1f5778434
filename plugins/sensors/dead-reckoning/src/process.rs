//! The process: attitude from the AHRS, a body velocity that wanders, and the position.
//!
//! ```text
//! C_b^n(t') = exp([-e x]) C_ahrs(t')              e: slow error of the AHRS, about north, east, down
//! v'        = C_b^n(t') C_n^b(t) v + a            a: white acceleration
//! p'        = p [+] (v + v') dt / 2
//! ```
//! The velocity turns with the vehicle, so that a turn at constant speed needs no acceleration. With
//! the true attitude `exp([phi x]) C_b^n`, a reading with the white error `w` leaves `phi' = -de - w`,
//! and the error of the velocity is, with `D = C_b^n(t') C_n^b(t)`,
//! ```text
//! dv' = D dv + D [v x] phi - [v' x] phi' + a
//! ```

use crate::ahrs::{Ahrs, SimulatedAhrs};
use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{Matrix3, Rotation3, SMatrix};
use navfuse_core::prelude::*;
use navfuse_core::state::Signal;
use navfuse_ins::earth::earth_rate_ned;
use navfuse_ins::{InitialPosition, InitialValue, Navigation};

/// Dead reckoning of a vehicle without an IMU, driven by an AHRS: attitude, velocity, position, and
/// the slow error of the AHRS. A sensor of the velocity, such as a DVL, makes it useful.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DeadReckoning {
    /// AHRS that drives the process: the name of its `[sensor.NAME]` table.
    #[serde(default = "ahrs")]
    pub ahrs: String,
    /// White acceleration by which the velocity wanders, one value, or north, east, down. A vehicle
    /// that changes its speed by `s` within `t` seconds needs about `s / sqrt(t)`.
    pub acceleration: Sigma<Triple<AccelerationNoise>>,
    /// Velocity north, east, down: prior sigma, and the initial value where no reference gives it.
    pub velocity: InitialValue<Triple<Speed>>,
    /// Position: prior sigma north, east, down, and the initial value where no reference gives it.
    pub position: InitialPosition,
    /// Turn of the vehicle while the AHRS is silent, as white noise. Default: 5 deg/s/sqrt(Hz).
    #[serde(default = "five_degrees")]
    pub turn: Sigma<AngularRateNoise>,
}

fn ahrs() -> String {
    "ahrs".into()
}

fn five_degrees() -> Sigma<AngularRateNoise> {
    Sigma::from_si(5.0_f64.to_radians())
}

/// Components of the error of the AHRS: rotations about these axes.
const ERROR: Display = Display { components: &["north", "east", "down"], ..display::ANGLES };

impl ProcessType for DeadReckoning {
    const TYPE: &'static str = "dead-reckoning";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let ahrs: Ahrs = composer.input::<Ahrs>("ahrs", &self.ahrs)?.clone();
        let sigma = ahrs.error();
        if sigma.amin() <= 0.0 || ahrs.noise.value().si() <= 0.0 {
            let text = "noise, tilt and heading of the AHRS are above zero: no AHRS is exact";
            return Err(ComposeError::new("ahrs", text));
        }
        let constant = |sigma: Vector3<f64>, dynamics, display| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: sigma.as_slice().to_vec(),
            truth: None,
            dynamics,
            display,
        };
        // the first reading gives the attitude, and the first step its covariance
        let white = Vector3::repeat(ahrs.noise.value().si());
        let attitude = constant(sigma + white, Dynamics::Constant, display::ANGLES);
        let attitude = composer.block("attitude", attitude)?;
        let velocity = self.velocity.block(composer, "velocity", display::VELOCITY)?;
        let velocity = composer.block("velocity", velocity)?;
        let position = self.position.block(composer)?;
        let position = composer.block("position", position)?;
        composer.turns_with_heading(velocity, attitude);
        let (sigmas, time) = (sigma.as_slice().to_vec(), ahrs.correlation_time.value().si());
        let slow = Dynamics::GaussMarkov { sigma: sigmas, time };
        let error = composer.block("ahrs_error", constant(sigma, slow, ERROR))?;
        let angular_rate = composer.signal("angular_rate");
        let earlier = composer.earlier(angular_rate);
        let navigation = Navigation {
            angular_rate: Some(angular_rate),
            ..Navigation::provide(composer, attitude, velocity, position)
        };
        let gap = ahrs.max_gap.value().si();
        let simulator = SimulatedAhrs { ahrs: ahrs.clone(), attitude, error };
        let model = DeadReckoningModel {
            navigation,
            angular_rates: [angular_rate, earlier],
            error,
            places: Places::new(composer, &navigation, error),
            acceleration: self.acceleration.value().si().map(|a| a * a),
            turn: self.turn.value().si().powi(2),
            ahrs,
            before: None,
            last: None,
            rates: Default::default(),
        };
        Ok(BuiltProcess::new(model)
            .coasts_after(gap)
            .driven_by(self.ahrs, simulator)
            .wanders_with_its_sensor())
    }
}

/// Places of the process in `Phi` and `Q`. The blocks follow each other in the error state, so that
/// one block of noise holds attitude, velocity and position.
#[derive(Clone, Copy, Debug)]
struct Places {
    phi_phi: PhiDiagonal<3>,
    phi_e: PhiDiagonal<3>,
    v_phi: PhiSlot<3, 3>,
    v_v: PhiSlot<3, 3>,
    v_e: PhiSlot<3, 3>,
    p_phi: PhiSlot<3, 3>,
    p_v: PhiSlot<3, 3>,
    p_p: PhiDiagonal<3>,
    p_e: PhiSlot<3, 3>,
    q: NoiseSlot<9>,
}

impl Places {
    fn new(composer: &mut Composer, n: &Navigation, error: Handle<Vector<3>>) -> Self {
        let (phi, v) = (composer.tangent(n.attitude), composer.tangent(n.velocity));
        let (p, e) = (composer.tangent(n.position), composer.tangent(error));
        let t = composer.transition();
        Self {
            phi_phi: t.phi_diagonal(phi, phi),
            phi_e: t.phi_diagonal(phi, e),
            v_phi: t.phi(v, phi),
            v_v: t.phi(v, v),
            v_e: t.phi(v, e),
            p_phi: t.phi(p, phi),
            p_v: t.phi(p, v),
            p_p: t.phi_diagonal(p, p),
            p_e: t.phi(p, e),
            q: t.noise(phi),
        }
    }
}

/// A reading of the AHRS.
#[derive(Clone, Copy, Debug, Default)]
struct Reading {
    time: Time,
    /// Rotation vector of `C_b^n`, rad.
    vector: Vector3<f64>,
}

saved!(Reading { time, vector });

#[derive(Clone)]
struct DeadReckoningModel {
    navigation: Navigation,
    /// The angular rate, and the earlier one.
    angular_rates: [Signal<3>; 2],
    error: Handle<Vector<3>>,
    places: Places,
    ahrs: Ahrs,
    /// Power spectral density of the acceleration, north, east, down, m^2/s^3.
    acceleration: Vector3<f64>,
    /// Power spectral density of the turn without an AHRS, rad^2/s.
    turn: f64,
    /// Reading before the last one.
    before: Option<Reading>,
    last: Option<Reading>,
    /// Rates of the turns between the last readings, the newest first, in body axes, rad/s: the first and the third have no
    /// reading in common.
    rates: [Vector3<f64>; 3],
}

saved!(DeadReckoningModel {
    before, last, rates,
} except {
    navigation, angular_rates, error, places, ahrs, acceleration, turn,
});

impl DeadReckoningModel {
    /// Takes a reading, unless it is the last one again.
    fn take(&mut self, sample: &Sample) -> Result<(), ProcessError> {
        let Some(c_b_n) = self.ahrs.attitude(sample) else {
            return Err(ProcessError::input("channels of the AHRS are missing"));
        };
        let reading = Reading { time: sample.time, vector: c_b_n.scaled_axis() };
        if self.last.is_none_or(|last| last.time != reading.time) {
            self.before = self.last.replace(reading);
            if let Some((_, turn, [begin, end])) = self.readings() {
                let length = end.since(begin);
                self.rates.rotate_right(1);
                self.rates[0] = if length > 0.0 { turn / length } else { Vector3::zeros() };
            }
        }
        Ok(())
    }

    /// The last two readings: the earlier attitude, the turn from it to the last one in body axes,
    /// and their times. Without an earlier reading, or after a gap, the last one stands for both.
    fn readings(&self) -> Option<(Rotation3<f64>, Vector3<f64>, [Time; 2])> {
        let last = self.last?;
        let gap = self.ahrs.max_gap.value().si();
        let near = |before: &Reading| last.time.since(before.time) <= gap;
        let before = self.before.filter(near).unwrap_or(last);
        let [from, to] = [before, last].map(|reading| Rotation3::new(reading.vector));
        Some((from, (from.inverse() * to).scaled_axis(), [before.time, last.time]))
    }

    /// Attitude of the AHRS at a time between its last two readings, at a constant rate.
    fn reading_at(&self, time: Time) -> Option<Rotation3<f64>> {
        let (from, turn, [begin, end]) = self.readings()?;
        let length = end.since(begin);
        let part = if length > 0.0 { (time.since(begin) / length).min(1.0) } else { 1.0 };
        Some(from * Rotation3::new(turn * part))
    }

    /// Publishes the angular rate with respect to inertial space, as gyros would measure it: the
    /// turn between two readings, and the Earth rate.
    fn publish(&self, layout: &Layout, state: &mut State) {
        let latitude = state.get(layout, self.navigation.position).latitude;
        let attitude = state.get(layout, self.navigation.attitude);
        let earth_rate = attitude.inverse() * earth_rate_ned(latitude);
        let [now, _, earlier] = self.rates;
        for (signal, turn) in self.angular_rates.into_iter().zip([now, earlier]) {
            state.publish(signal, &(turn + earth_rate).into());
        }
    }

    /// Marks attitude, velocity and position as known.
    fn mark(&self, known: &mut [bool]) {
        let n = &self.navigation;
        for slot in [n.attitude.slot(), n.velocity.slot(), n.position.slot()] {
            known[slot] = true;
        }
    }

    /// Variance of the fresh error of the attitude, about north, east and down: the white noise of a
    /// reading, and the change of its slow error over `dt`; or the unknown turn without a reading.
    fn fresh(&self, read: bool, dt: f64) -> Vector3<f64> {
        if !read {
            return Vector3::repeat(self.turn * dt);
        }
        let time = self.ahrs.correlation_time.value().si();
        let white = self.ahrs.noise.value().si().powi(2);
        self.ahrs.error().map(|sigma| white - sigma * sigma * (-2.0 * dt / time).exp_m1())
    }
}

/// Noise of attitude, velocity and position over `dt`: `phi'` has the fresh error `n` of the variance
/// `fresh`, which moves the velocity `v` by `-[v x] n`; the acceleration adds Groves eq. 3.44.
fn noise(
    fresh: &Vector3<f64>,
    v: &Vector3<f64>,
    acceleration: &Vector3<f64>,
    dt: f64,
) -> SMatrix<f64, 9, 9> {
    let mut g = SMatrix::<f64, 9, 3>::zeros();
    let turned = -v.cross_matrix();
    g.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    g.fixed_view_mut::<3, 3>(3, 0).copy_from(&turned);
    g.fixed_view_mut::<3, 3>(6, 0).copy_from(&(turned * (0.5 * dt)));
    let mut q = g * Matrix3::from_diagonal(fresh) * g.transpose();
    for (k, a) in acceleration.iter().enumerate() {
        q[(3 + k, 3 + k)] += a * dt;
        q[(3 + k, 6 + k)] += a * dt * dt / 2.0;
        q[(6 + k, 3 + k)] += a * dt * dt / 2.0;
        q[(6 + k, 6 + k)] += a * dt.powi(3) / 3.0;
    }
    q
}

impl ProcessModel for DeadReckoningModel {
    fn prepare(
        &mut self,
        layout: &Layout,
        state: &mut State,
        input: &navfuse_core::model::process::Input<'_>,
    ) {
        if self.take(input.sample).is_ok()
            && let Some(c_b_n) = self.reading_at(input.sample.time)
        {
            state.set(layout, self.navigation.attitude, &c_b_n);
            self.publish(layout, state);
        }
    }

    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        out: &mut Transition,
    ) -> Result<(), ProcessError> {
        let (n, s, dt) = (self.navigation, self.places, interval.duration());
        if let Some(input) = interval.input {
            self.take(input.sample)?;
        }
        let reading = interval.input.and_then(|_| self.reading_at(interval.to));
        let (from, v) = (state.get(layout, n.attitude), state.get(layout, n.velocity));
        let error = state.get(layout, self.error);
        let to = reading.map_or(from, |reading| Rotation3::new(-error) * reading);
        let turn = to * from.inverse();
        let next = turn * v;
        let moved = state.get(layout, n.position).displaced(&((v + next) * (0.5 * dt)));
        state.set(layout, n.attitude, &to);
        state.set(layout, n.velocity, &next);
        state.set(layout, n.position, &moved);
        self.publish(layout, state);
        // a reading replaces the error of the attitude; without one it stays
        let read = if reading.is_some() { 1.0 } else { 0.0 };
        let turn = turn.into_inner();
        let (v_phi, v_e) = (turn * v.cross_matrix() * read, next.cross_matrix() * read);
        out.set_diagonal(s.phi_phi, &[1.0 - read; 3]);
        out.set_diagonal(s.phi_e, &[-read; 3]);
        out.set(s.v_phi, &v_phi);
        out.set(s.v_v, &turn);
        out.set(s.v_e, &v_e);
        out.set(s.p_phi, &(v_phi * (0.5 * dt)));
        out.set(s.p_v, &((Matrix3::identity() + turn) * (0.5 * dt)));
        out.set_diagonal(s.p_p, &[1.0; 3]);
        out.set(s.p_e, &(v_e * (0.5 * dt)));
        let fresh = self.fresh(reading.is_some(), dt);
        out.set_noise(s.q, &noise(&fresh, &next, &self.acceleration, dt));
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let n = &self.navigation;
        state.set(layout, n.attitude, &motion.c_b_n.to_rotation_matrix());
        state.set(layout, n.velocity, &motion.velocity);
        state.set(layout, n.position, &motion.position);
        if let Some(signal) = n.angular_rate {
            let w = motion.w_ib_b;
            state.publish(signal, &[w.x, w.y, w.z]);
        }
        self.mark(known);
    }

    /// The AHRS gives any attitude, so the vehicle turns about down by the noise of `turn`, and stays
    /// level. The mean of both velocities lacks a part of the position's noise, which is added.
    fn wander(
        &mut self,
        layout: &Layout,
        truth: &mut State,
        known: &mut [bool],
        dt: f64,
        random: &mut Random,
    ) {
        let n = self.navigation;
        let mut normal = || Vector3::from_fn(|_, _| random.normal());
        let (a, b) = (normal(), normal());
        let turn = Rotation3::new(Vector3::z() * ((self.turn * dt).sqrt() * random.normal()));
        let accelerated = self.acceleration.map(|density| (density * dt).sqrt());
        let v = truth.get(layout, n.velocity);
        let next = turn * v + accelerated.component_mul(&a);
        let moved = (v + next) * (0.5 * dt) + accelerated.component_mul(&b) * (dt / 12_f64.sqrt());
        truth.set(layout, n.attitude, &(turn * truth.get(layout, n.attitude)));
        truth.set(layout, n.velocity, &next);
        truth.set(layout, n.position, &truth.get(layout, n.position).displaced(&moved));
        self.mark(known);
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}
