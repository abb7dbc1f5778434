//! Navigation computation by the velocity and position integration formulae.
//!
//! With `b0` and `n0` the body and navigation axes of the beginning of a step, both frozen in inertial
//! space, the navigation equations integrate to
//! ```text
//! C_n^n0 v^n(t)  = v^n(0) + C_b^n(0) int C_b^b0 f^b dt + int C_n^n0 (g^n - w_ie^n x v^n) dt
//! p(t)           = p(0) + int R_c v^n dt
//! C_b^n(t)       = C_n0^n C_b^n(0) C_b^b0
//! ```
//! (Wu & Pan, *Velocity/position integration formula part II: application to strapdown inertial
//! navigation computation*, IEEE Trans. Aerosp. Electron. Syst. 49(2), 2013). The rotation of the
//! navigation axes during a step is thus part of the formula, and no approximation of it. The unknown
//! velocity and position on the right side are iterated.
//!
//! The integrals over a step are those of the collocation at three Gauss points, which is exact to
//! the sixth order. Angular rate and specific force are the derivatives of the polynomials whose
//! differences are the increments of the last samples: two of them give rates that are linear in time,
//! as in the paper.

use crate::earth::LocalEarth;
use crate::mechanisation::{
    Increments, MechanisationError, NavState, StepRates, check, check_length, wrapped,
};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::state::geodesy::Geodetic;

/// Largest number of samples that a polynomial passes through.
pub const MAX_SAMPLES: usize = 4;

/// Largest ratio of the lengths of two samples of one polynomial: it would swing beyond a gap.
const LARGEST_RATIO: f64 = 2.0;

/// `sqrt(15)`.
const ROOT: f64 = 3.872_983_346_207_417;
/// Gauss points of the interval from 0 to 1, their weights, and the integrals from 0 to each point of
/// the parabola through the values at all of them (Hairer, Norsett & Wanner, *Solving Ordinary
/// Differential Equations I*, table II.7.4).
const POINTS: [f64; 3] = [0.5 - ROOT / 10.0, 0.5, 0.5 + ROOT / 10.0];
const WEIGHTS: [f64; 3] = [5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0];
const UNTIL: [[f64; 3]; 3] = [
    [5.0 / 36.0, 2.0 / 9.0 - ROOT / 15.0, 5.0 / 36.0 - ROOT / 30.0],
    [5.0 / 36.0 + ROOT / 24.0, 2.0 / 9.0, 5.0 / 36.0 - ROOT / 24.0],
    [5.0 / 36.0 + ROOT / 30.0, 2.0 / 9.0 + ROOT / 15.0, 5.0 / 36.0],
];

/// Iterations of the velocity and position in a step. Each of them divides the error by
/// `1 / (w_ie dt)` and `1 / (3e-6 dt^2)`, the change of gravity with the height: 1e4 for 1 s.
const ITERATIONS: usize = 3;

/// Largest number of iterations of the attitude, and the change of a quaternion that ends them.
const MOST: usize = 30;
const SMALLEST: f64 = 1e-17;

/// Angular rate `w_ib^b`, rad/s, and specific force `f^b`, m/s^2.
pub type Rates = [Vector3<f64>; 2];

/// The integrator by the integration formulae. As [`crate::mechanisation::Mechanisation`], it stores
/// inertial samples alone and takes a sample in parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Formulae {
    /// Number of samples of a polynomial.
    samples: usize,
    /// The last complete samples, the latest one first; those without a length are not there yet.
    history: [Increments; MAX_SAMPLES - 1],
    /// The parts taken so far of the sample that is not complete.
    pending: Increments,
}

saved!(Formulae { history, pending } except { samples });

impl Formulae {
    /// Creates an integrator whose rates are polynomials through that number of samples, at most
    /// [`MAX_SAMPLES`]: one for constant rates, two for linear ones.
    pub fn new(samples: usize) -> Self {
        let samples = samples.clamp(1, MAX_SAMPLES);
        Self { samples, history: Default::default(), pending: Increments::default() }
    }

    /// Forgets the samples so far, as after a gap.
    pub fn restart(&mut self) {
        *self = Self::new(self.samples);
    }

    /// Advances a state by a part of an inertial sample that lasts `sample_dt` seconds in all: see
    /// [`crate::mechanisation::Mechanisation::step_part`].
    ///
    /// # Errors
    /// See [`MechanisationError`]. A step that failed leaves the integrator unchanged.
    pub fn step_part(
        &mut self,
        state: &NavState,
        inc: &Increments,
        sample_dt: f64,
    ) -> Result<(NavState, StepRates), MechanisationError> {
        check_length(inc, sample_dt)?;
        let polynomial = self.polynomial(&inc.part(sample_dt / inc.dt));
        let begin = self.pending.dt;
        let rates = |time: f64| polynomial.rates(begin + time);
        let (next, rates) = advance(state, inc.dt, rates);
        check(state, inc, &next, true)?;
        self.remember(inc, sample_dt);
        Ok((next, rates))
    }

    /// The rates over a whole sample, from its increments and those before it.
    fn polynomial(&self, sample: &Increments) -> Polynomial {
        let alike = |before: &&Increments| {
            before.dt * LARGEST_RATIO >= sample.dt && before.dt <= LARGEST_RATIO * sample.dt
        };
        let before = self.history[..self.samples - 1].iter().take_while(alike);
        let mut polynomial = Polynomial::default();
        let integral = |i: &Increments| [i.dtheta, i.dvel];
        polynomial.push(0.0, Default::default());
        polynomial.push(sample.dt, integral(sample));
        let (mut time, mut sum) = (0.0, Rates::default());
        for earlier in before {
            time -= earlier.dt;
            let increment = integral(earlier);
            sum = [sum[0] - increment[0], sum[1] - increment[1]];
            polynomial.push(time, sum);
        }
        polynomial
    }

    fn remember(&mut self, inc: &Increments, sample_dt: f64) {
        let Increments { dtheta, dvel, dt } = self.pending;
        let taken =
            Increments { dtheta: dtheta + inc.dtheta, dvel: dvel + inc.dvel, dt: dt + inc.dt };
        if taken.dt >= sample_dt * (1.0 - 1e-6) {
            self.history.rotate_right(1);
            self.history[0] = taken;
            self.pending = Increments::default();
        } else {
            self.pending = taken;
        }
    }
}

/// Integrals of the rates from the beginning of a sample on, as a polynomial of Newton through knots.
#[derive(Default)]
struct Polynomial {
    knots: [f64; MAX_SAMPLES + 1],
    /// Divided differences: `[k]` is the coefficient of the product of the first `k` factors.
    differences: [Rates; MAX_SAMPLES + 1],
    /// The last divided differences of each order, which the next knot continues.
    edge: [Rates; MAX_SAMPLES + 1],
    count: usize,
}

impl Polynomial {
    /// Adds the integrals at another time, s.
    fn push(&mut self, time: f64, integral: Rates) {
        let n = self.count;
        self.knots[n] = time;
        let mut difference = integral;
        for k in 0..n {
            let length = time - self.knots[n - 1 - k];
            let before = std::mem::replace(&mut self.edge[k], difference);
            difference = [0, 1].map(|i| (difference[i] - before[i]) / length);
        }
        self.edge[n] = difference;
        self.differences[n] = difference;
        self.count += 1;
    }

    /// The rates at a time, s: the derivative of the integrals.
    fn rates(&self, time: f64) -> Rates {
        let (mut product, mut slope) = (1.0, 0.0);
        let mut rates = Rates::default();
        for k in 0..self.count {
            for (rate, difference) in rates.iter_mut().zip(&self.differences[k]) {
                *rate += difference * slope;
            }
            let factor = time - self.knots[k];
            slope = slope * factor + product;
            product *= factor;
        }
        rates
    }
}

/// Advances a state by an interval, s, with the rates at times from its beginning on, s: the reference
/// integrator. Its error is that of a collocation of the sixth order.
pub fn integrate(state: &NavState, dt: f64, rates: impl Fn(f64) -> Rates) -> NavState {
    advance(state, dt, rates).0
}

/// The body over a step: its rotation `C_b^b0` at the end, and `C_b^b0` and `C_b^b0 f^b` at the points.
struct Body {
    end: UnitQuaternion<f64>,
    turns: [Matrix3<f64>; 3],
    forces: [Vector3<f64>; 3],
}

impl Body {
    /// With the mean rate `m` and `E(t) = exp(m t)`, the rotation is `C_b^b0 = P E`, where
    /// `dP/dt = P [E (w - m) x]`. `P` is iterated from 1 on; at a constant rate it stays there.
    fn new(dt: f64, rates: &[Rates; 3]) -> Self {
        let mean = sum(WEIGHTS, rates.map(|[w, _]| w));
        let turn = |part: f64| UnitQuaternion::from_scaled_axis(mean * (part * dt));
        let mean_turns = POINTS.map(turn);
        let pure = |k: usize| Quaternion::from_imag(mean_turns[k] * (rates[k][0] - mean) * 0.5);
        let rest = [0, 1, 2].map(pure);
        let one = Quaternion::identity();
        let mut p = [one; 3];
        for _ in 0..MOST {
            let slopes = [0, 1, 2].map(|k| p[k] * rest[k]);
            let next = UNTIL.map(|weights| one + sum(weights, slopes) * dt);
            let change = (0..3).map(|k| (next[k] - p[k]).norm_squared()).fold(0.0, f64::max);
            p = next;
            if change <= SMALLEST * SMALLEST {
                break;
            }
        }
        let end = one + sum(WEIGHTS, [0, 1, 2].map(|k| p[k] * rest[k])) * dt;
        let turns = [0, 1, 2].map(|k| UnitQuaternion::new_normalize(p[k]) * mean_turns[k]);
        let turns = turns.map(|q| q.to_rotation_matrix().into_inner());
        Self {
            end: UnitQuaternion::new_normalize(end) * turn(1.0),
            turns,
            forces: [0, 1, 2].map(|k| turns[k] * rates[k][1]),
        }
    }
}

/// The sum of the products of weights and values.
fn sum<V>(weights: [f64; 3], values: [V; 3]) -> V
where
    V: std::ops::Mul<f64, Output = V> + std::ops::Add<Output = V>,
{
    let [a, b, c] = values;
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// The rotation vector of `C_n^n0`, this rotation, velocity and position.
type Reached = (Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>, Geodetic<f64>);

/// Quantities of the formulae at one point of a step.
#[derive(Clone, Copy)]
struct Point {
    /// Rotation vector of `C_n^n0`, rad.
    turned: Vector3<f64>,
    c_n_n0: UnitQuaternion<f64>,
    velocity: Vector3<f64>,
    earth: LocalEarth,
}

/// Derivatives over time: of the rotation vector of `C_n^n0`, of the velocity in the axes of the
/// beginning, and of latitude, longitude and height.
struct Slopes {
    turned: Vector3<f64>,
    velocity: Vector3<f64>,
    moved: Vector3<f64>,
}

impl Point {
    fn new(state: &NavState) -> Self {
        let (turned, c_n_n0) = (Vector3::zeros(), UnitQuaternion::identity());
        Self::reached((turned, c_n_n0, state.velocity, state.position))
    }

    fn reached((turned, c_n_n0, velocity, position): Reached) -> Self {
        let earth = LocalEarth::at(position.latitude, position.height);
        Self { turned, c_n_n0, velocity, earth }
    }

    fn slopes(&self, force: &Vector3<f64>) -> Slopes {
        let Self { turned, c_n_n0, velocity, earth } = self;
        let w_ie = earth.earth_rate();
        let w_in = w_ie + earth.transport_rate(velocity);
        let fall = Vector3::z() * earth.gravity - w_ie.cross(velocity);
        let (north, east) = (velocity.x * earth.inv_n, velocity.y * earth.inv_e * earth.inv_cos);
        Slopes {
            // Bortz' equation to the first order of the rotation vector, 1e-4 for a step of 1 s
            turned: w_in + turned.cross(&w_in) * 0.5,
            velocity: force + c_n_n0 * fall,
            moved: Vector3::new(north, east, -velocity.z),
        }
    }
}

fn advance(state: &NavState, dt: f64, rates: impl Fn(f64) -> Rates) -> (NavState, StepRates) {
    let rates = POINTS.map(|part| rates(part * dt));
    let body = Body::new(dt, &rates);
    let start = *state.c_b_n.to_rotation_matrix().matrix();
    let forces = body.forces.map(|force| start * force);
    let all = [0, 1, 2];

    let mut points = [Point::new(state); 3];
    let reach = |weights: [f64; 3], slopes: &[Slopes; 3]| {
        let by =
            |slope: fn(&Slopes) -> Vector3<f64>| sum(weights, all.map(|k| slope(&slopes[k]))) * dt;
        let (turned, moved) = (by(|s| s.turned), by(|s| s.moved));
        let c_n_n0 = UnitQuaternion::from_scaled_axis(turned);
        let velocity = c_n_n0.inverse() * (state.velocity + by(|s| s.velocity));
        let p = state.position;
        let position = Geodetic {
            latitude: p.latitude + moved.x,
            longitude: p.longitude + moved.y,
            height: p.height + moved.z,
        };
        (turned, c_n_n0, velocity, position)
    };
    let slopes = |points: &[Point; 3]| all.map(|k| points[k].slopes(&forces[k]));
    for _ in 0..ITERATIONS {
        let slopes = slopes(&points);
        points = UNTIL.map(|weights| Point::reached(reach(weights, &slopes)));
    }
    let (_, c_n_n0, velocity, position) = reach(WEIGHTS, &slopes(&points));
    let position = Geodetic { longitude: wrapped(position.longitude), ..position };
    let c_b_n = c_n_n0.inverse() * state.c_b_n * body.end;
    let c_b_n = UnitQuaternion::new_normalize(c_b_n.into_inner());
    let middle = &points[1];
    let step = StepRates {
        dt,
        c_b_n: start * sum(WEIGHTS, body.turns),
        specific_force: sum(WEIGHTS, all.map(|k| points[k].c_n_n0.inverse() * forces[k])),
        velocity: sum(WEIGHTS, points.map(|point| point.velocity)),
        earth_rate: middle.earth.earth_rate(),
        transport_rate: middle.earth.transport_rate(&middle.velocity),
        earth: middle.earth,
        turn: 0.0,
    };
    (NavState { c_b_n, velocity, position }, step)
}
