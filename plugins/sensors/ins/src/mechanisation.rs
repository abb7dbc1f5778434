//! Strapdown navigation in north-east-down axes on WGS-84.
//!
//! The equations are those of Groves, 2nd ed., chapter 5, and Savage, *Strapdown Inertial
//! Navigation Integration Algorithm Design* (J. Guidance 21(1-2), 1998). Over one interval the
//! corrected rotation vector and velocity increment are taken as constant rates in the body, for
//! which the integrals are exact. Quantities that change slowly (Earth rate, transport rate,
//! Coriolis, gravity, radii) are evaluated once, at the midpoint of the interval, which is accurate
//! to second order.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::state::geodesy::Geodetic;
use std::f64::consts::PI;
use thiserror::Error;

use crate::earth::{LatitudeNode, LocalEarth};

/// Largest latitude, degrees, north or south, without the frame `wander-azimuth`: north-east-down axes
/// do not exist at the poles.
pub const MAX_LATITUDE_DEG: f64 = 89.9;

/// Attitude, velocity and position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavState {
    /// Rotation from body (forward-right-down) to north-east-down.
    pub c_b_n: UnitQuaternion<f64>,
    /// Velocity relative to the Earth in north-east-down, m/s.
    pub velocity: Vector3<f64>,
    /// Position on WGS-84.
    pub position: Geodetic<f64>,
}

/// Integrals of the inertial sensors over an interval, biases already removed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increments {
    /// Integral of the angular rate `w_ib^b`, rad.
    pub dtheta: Vector3<f64>,
    /// Integral of the specific force `f^b`, m/s.
    pub dvel: Vector3<f64>,
    /// Length of the interval, s.
    pub dt: f64,
}

saved!(Increments { dtheta, dvel, dt });

impl Increments {
    /// Returns the part of this sample for a fraction of its interval, at the sample's mean rates.
    #[must_use]
    pub fn part(&self, fraction: f64) -> Self {
        Self { dtheta: self.dtheta * fraction, dvel: self.dvel * fraction, dt: self.dt * fraction }
    }
}

/// Quantities of a step that the error model needs, at the midpoint or as a mean over the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepRates {
    /// Length of the interval, s.
    pub dt: f64,
    /// Mean over the interval of the rotation from body to navigation axes (the axes of its
    /// beginning; the difference, 4e-7 at 100 Hz, is below what the error model resolves).
    pub c_b_n: Matrix3<f64>,
    /// Mean specific force in navigation axes, m/s^2.
    pub specific_force: Vector3<f64>,
    /// Mean velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Earth rate `w_ie^n`, rad/s.
    pub earth_rate: Vector3<f64>,
    /// Transport rate `w_en^n`, rad/s; in a wander-azimuth step without its vertical part.
    pub transport_rate: Vector3<f64>,
    /// The ellipsoid and gravity at the midpoint.
    pub earth: LocalEarth,
    /// Turn of north and east from axes that are carried along, over a wander-azimuth step, rad.
    pub turn: f64,
}

/// Error of a step.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum MechanisationError {
    /// The interval is not a positive number of seconds.
    #[error(
        "the inertial interval is {dt} s: it must be positive; check that the samples are in time \
         order"
    )]
    Interval {
        /// The interval, s.
        dt: f64,
    },
    /// The latitude is too near a pole for north-east-down navigation.
    #[error(
        "the latitude reached {degrees:.4} deg: north-east-down navigation ends at 89.9 deg north \
         and south; frame = \"wander-azimuth\" of the process has no such end"
    )]
    Latitude {
        /// The latitude, degrees.
        degrees: f64,
    },
    /// A number is infinite or not a number.
    #[error(
        "the inertial step's {what} is not finite: check the sensor's samples and the initial \
         state"
    )]
    NonFinite {
        /// Name of the part of the state or increments that is not finite; `result` if all of these
        /// are finite.
        what: &'static str,
    },
}

/// The strapdown integrator. It stores the previous inertial sample, for coning and sculling, and
/// no part of the navigation state; so a filter may correct the state freely, and a copy is a
/// snapshot. Sine and cosine of the latitude come from the nearest node of a grid, which it keeps.
///
/// A sample may be taken in parts, where an update falls inside its interval: see
/// [`Self::step_part`]. After a gap in the samples, begin with a default integrator again: without
/// a previous sample, it applies no coning or sculling to the first one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mechanisation {
    /// The last complete sample.
    previous: Option<Increments>,
    /// The parts taken so far of the sample that is not complete.
    pending: Option<Increments>,
    node: Option<LatitudeNode>,
    /// Set if the axes of a step are carried along with the position, and do not turn to the north.
    wanders: bool,
}

saved!(Mechanisation { previous, pending, node } except { wanders });

impl Mechanisation {
    /// Creates an integrator whose steps are taken in axes that do not turn about the vertical with
    /// respect to the Earth (wander azimuth, Groves section 5.3.5, with `w_en,D = 0`). They begin at
    /// north, east and down of each step, and the state is turned to north, east and down of its end:
    /// so the steps lead through a pole.
    #[must_use]
    pub fn wander_azimuth() -> Self {
        Self { wanders: true, ..Self::default() }
    }

    /// Forgets the samples so far, as after a gap.
    pub(crate) fn restart(&mut self) {
        *self = Self { wanders: self.wanders, ..Self::default() };
    }

    /// Advances a state by one whole inertial sample.
    ///
    /// # Errors
    /// See [`MechanisationError`]. A step that failed leaves the integrator unchanged.
    #[inline]
    pub fn step(
        &mut self,
        state: &NavState,
        sample: &Increments,
    ) -> Result<(NavState, StepRates), MechanisationError> {
        self.step_part(state, sample, sample.dt)
    }

    /// Advances a state by a part of an inertial sample that lasts `sample_dt` seconds in all; the
    /// increments are the share of the part ([`Increments::part`]).
    ///
    /// For a given previous sample and length, the coning and sculling of a sample are linear in
    /// its increments, so each part takes its share, and the parts add up to the whole. The parts
    /// become the previous sample when together they last `sample_dt` (to one part in a million).
    /// An unfinished sample is merged with the next one into a single sample at their mean rates.
    ///
    /// # Errors
    /// See [`MechanisationError`]. A step that failed leaves the integrator unchanged.
    #[inline(always)]
    pub fn step_part(
        &mut self,
        state: &NavState,
        inc: &Increments,
        sample_dt: f64,
    ) -> Result<(NavState, StepRates), MechanisationError> {
        check_length(inc, sample_dt)?;
        let (rotation, dvel) = self.coning_sculling(inc, sample_dt);
        let latitude = state.position.latitude;
        let node = match self.node {
            Some(node) if node.is_nearest(latitude) => node,
            _ => LatitudeNode::near(latitude),
        };
        let (next, rates) = if self.wanders {
            advance::<true>(state, &rotation, &dvel, inc.dt, &node)
        } else {
            advance::<false>(state, &rotation, &dvel, inc.dt, &node)
        };
        check(state, inc, &next, !self.wanders)?;
        self.node = Some(node);
        self.remember(inc, sample_dt);
        Ok((next, rates))
    }

    /// Computes [`Self::coning_sculling`] of the whole next sample, which becomes the previous one.
    pub(crate) fn compensate(&mut self, sample: &Increments) -> (Vector3<f64>, Vector3<f64>) {
        let equivalent = self.coning_sculling(sample, sample.dt);
        self.remember(sample, sample.dt);
        equivalent
    }

    /// Computes the rotation vector and velocity increment of an interval at constant body rates
    /// that are equivalent to the increments: Savage's two-sample coning and sculling,
    /// `phi = a2 + a1 x a2 / 12` and `dv = v2 + (a1 x v2 + v1 x a2) / 12` (compare Groves section
    /// 5.5), for unequal intervals. Without them a vibration about two axes, out of phase, would
    /// drift.
    ///
    /// For rates linear in time over `T1` then `T2`, the integrals `1/2 int alpha x w` and
    /// `1/2 int (alpha x f + nu x w)` over `T2` are the same cross products times
    /// `T2^2 / (6 T1 (T1 + T2))`, which is 1/12 when `T1 = T2`.
    #[inline]
    fn coning_sculling(&self, inc: &Increments, sample_dt: f64) -> (Vector3<f64>, Vector3<f64>) {
        let Some(previous) = &self.previous else { return (inc.dtheta, inc.dvel) };
        let factor = sample_dt * sample_dt / (6.0 * previous.dt * (previous.dt + sample_dt));
        let coning = previous.dtheta.cross(&inc.dtheta);
        let sculling = previous.dtheta.cross(&inc.dvel) + previous.dvel.cross(&inc.dtheta);
        (inc.dtheta + coning * factor, inc.dvel + sculling * factor)
    }

    #[inline]
    fn remember(&mut self, inc: &Increments, sample_dt: f64) {
        let taken = match &self.pending {
            None => *inc,
            Some(p) => Increments {
                dtheta: p.dtheta + inc.dtheta,
                dvel: p.dvel + inc.dvel,
                dt: p.dt + inc.dt,
            },
        };
        if taken.dt >= sample_dt * (1.0 - 1e-6) {
            self.previous = Some(taken);
            self.pending = None;
        } else {
            self.pending = Some(taken);
        }
    }
}

/// `1 / n!`, because a multiplication is several times faster than a division.
const F3: f64 = 1.0 / 6.0;
const F4: f64 = 1.0 / 24.0;
const F5: f64 = 1.0 / 120.0;
const F6: f64 = 1.0 / 720.0;
const F7: f64 = 1.0 / 5_040.0;
const F8: f64 = 1.0 / 40_320.0;
const F9: f64 = 1.0 / 362_880.0;
const F10: f64 = 1.0 / 3_628_800.0;

/// Exact integrals of a rotation at constant rate by the rotation vector `phi` (`x` its square),
/// with `K = [phi x]`.
struct Rotation {
    /// `exp(phi)` as a quaternion.
    quaternion: Quaternion<f64>,
    /// `a = (1 - cos)/x`, `b = (phi - sin)/phi^3`, `c = (1/2 - a)/x`, for which
    /// `int_0^1 exp(K u) du = I + a K + b K^2` and
    /// `int_0^1 int_0^u exp(K s) ds du = I/2 + b K + c K^2`.
    a: f64,
    b: f64,
    c: f64,
}

impl Rotation {
    #[inline(always)]
    fn new(phi: &Vector3<f64>) -> Self {
        let x = phi.norm_squared();
        // Half angle: sine over the whole angle, and cosine.
        let (sinc, cos, b, c);
        if x < 0.01 {
            // The first terms omitted from `sinc` and `cos` are (x/4)^5/11! and (x/4)^5/10!, below
            // 3e-20; those of `b` and `c`, x^4/11! and x^4/12!, are below 3e-16 where x b and x c
            // matter to 1.
            let u = 0.25 * x;
            sinc = 0.5 - u * (0.5 * F3 - u * (0.5 * F5 - u * (0.5 * F7 - u * (0.5 * F9))));
            cos = 1.0 - u * (0.5 - u * (F4 - u * (F6 - u * F8)));
            b = F3 - x * (F5 - x * (F7 - x * F9));
            c = F4 - x * (F6 - x * (F8 - x * F10));
        } else {
            let angle = x.sqrt();
            let (sin, cos_half) = (0.5 * angle).sin_cos();
            sinc = sin / angle;
            cos = cos_half;
            b = (1.0 - 2.0 * sinc * cos) / x;
            c = (0.5 - 2.0 * sinc * sinc) / x;
        }
        Self { quaternion: Quaternion::from_parts(cos, phi * sinc), a: 2.0 * sinc * sinc, b, c }
    }
}

/// Advances a state by one interval at constant body rates; the rotation vector and velocity
/// increment already include coning and sculling. `node` is the nearest one to the latitude. The axes
/// of a step that `WANDERS` do not turn about the vertical.
#[inline(always)]
fn advance<const WANDERS: bool>(
    state: &NavState,
    phi: &Vector3<f64>,
    dvel: &Vector3<f64>,
    dt: f64,
    node: &LatitudeNode,
) -> (NavState, StepRates) {
    let position = &state.position;
    let x = phi.norm_squared();
    let turn = Rotation::new(phi);

    // Velocity and position increments of the specific force in the axes of the beginning (Savage's
    // rotation compensation and its double integral, here in closed form): with K = [phi x], dv = C
    // (I + a K + b K^2) dvel and dr = C (I/2 + b K + c K^2) dvel. `mean` is the mean rotation.
    let start = *state.c_b_n.to_rotation_matrix().matrix();
    let outer = phi * (turn.b * phi.transpose());
    let diagonal = 1.0 - turn.b * x;
    let k = phi * turn.a;
    #[rustfmt::skip]
    let mean_body = Matrix3::new(
        diagonal + outer.m11, outer.m12 - k.z, outer.m13 + k.y,
        outer.m21 + k.z, diagonal + outer.m22, outer.m23 - k.x,
        outer.m31 - k.y, outer.m32 + k.x, diagonal + outer.m33,
    );
    let mean = start * mean_body;
    let dv_f = mean * dvel;
    let dr_f = start
        * (dvel * (0.5 - turn.c * x) + phi.cross(dvel) * turn.b + phi * (turn.c * phi.dot(dvel)));

    // The Earth at the midpoint. R_N of the extrapolation is accurate to 3e-9.
    let half = 0.5 * dt;
    let ahead = state.velocity.x * half / (node.r_n(position.latitude) + position.height);
    let (sin, cos) = node.sin_cos(position.latitude + ahead);
    let height = position.height - state.velocity.z * half;
    let earth = LocalEarth::from_sin_cos(sin, cos, height);
    let gravity = Vector3::new(0.0, 0.0, earth.gravity * dt);
    let earth_rate = earth.earth_rate();

    // Mean velocity over the interval, which Coriolis, transport rate and position need. The
    // predictor lacks the Coriolis acceleration and the rotation of the axes; the corrector adds
    // them.
    let predicted = state.velocity + dr_f + gravity * 0.5;
    let transport_rate = |velocity| {
        let rate = earth.transport_rate(velocity);
        if WANDERS { Vector3::new(rate.x, rate.y, 0.0) } else { rate }
    };
    let rate = earth_rate + transport_rate(&predicted);
    let velocity =
        predicted - (rate + earth_rate).cross(&predicted) * half - rate.cross(&dv_f) * (F3 * dt);

    // Velocity (Groves eqs 5.53 and 5.54, Coriolis and gravity at the midpoint). Meanwhile the axes
    // rotate by zeta, which weights the force by the elapsed time; `int_0^1 u exp(K u) du` is the
    // difference of the two integrals above.
    let transport_rate = transport_rate(&velocity);
    let rate = earth_rate + transport_rate;
    let zeta = rate * dt;
    let dv_n = dv_f - zeta.cross(&(dv_f - dr_f - zeta.cross(&dv_f) * F3));
    let new_velocity = state.velocity + dv_n + gravity - (rate + earth_rate).cross(&velocity) * dt;

    // Attitude (Groves eq. 5.39 and section 5.5, as quaternions): exp(-w_in dt) q exp(phi). The
    // rotation of the axes is below 1e-3 rad, where the series omits less than 1e-14 of it. One
    // Newton step restores the norm.
    let zeta2 = zeta.norm_squared();
    let axes = Quaternion::from_parts(1.0 - 0.125 * zeta2, zeta * (-0.5 + 0.5 * F4 * zeta2));
    let q = axes * (state.c_b_n.into_inner() * turn.quaternion);
    let c_b_n = UnitQuaternion::new_unchecked(q * (1.5 - 0.5 * q.norm_squared()));

    if WANDERS {
        // along the great circle of the mean velocity, to north and east of its end
        let (north, east) = (velocity.x * earth.inv_n * dt, velocity.y * earth.inv_e * dt);
        let moved = position.along(north, east);
        let longitude = wrapped(moved.longitude);
        let position = Geodetic { longitude, height: position.height - velocity.z * dt, ..moved };
        let turn = state.position.turn_to(&position);
        let to_north = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let rates = StepRates {
            dt,
            c_b_n: mean,
            specific_force: dv_n * (1.0 / dt),
            velocity,
            earth_rate,
            transport_rate,
            earth,
            turn,
        };
        let velocity = to_north * new_velocity;
        return (NavState { c_b_n: to_north * c_b_n, velocity, position }, rates);
    }

    // Position (Groves eq. 5.56 with the mean velocity and the midpoint's radii).
    let longitude = position.longitude + velocity.y * earth.inv_e * earth.inv_cos * dt;
    let position = Geodetic {
        latitude: position.latitude + velocity.x * earth.inv_n * dt,
        longitude: wrapped(longitude),
        height: position.height - velocity.z * dt,
    };
    let rates = StepRates {
        dt,
        c_b_n: mean,
        specific_force: dv_n * (1.0 / dt),
        velocity,
        earth_rate,
        transport_rate,
        earth,
        turn: 0.0,
    };
    (NavState { c_b_n, velocity: new_velocity, position }, rates)
}

/// A longitude that a step may have moved beyond 180 deg, rad.
#[inline(always)]
pub(crate) fn wrapped(longitude: f64) -> f64 {
    if longitude.abs() > PI { longitude - (2.0 * PI).copysign(longitude) } else { longitude }
}

/// Rejects a part of a sample, or a sample, that lasts no time.
#[inline(always)]
pub(crate) fn check_length(inc: &Increments, sample_dt: f64) -> Result<(), MechanisationError> {
    // Written so that a NaN fails too.
    if !(inc.dt > 0.0 && sample_dt > 0.0) {
        return Err(MechanisationError::Interval { dt: inc.dt.min(sample_dt) });
    }
    Ok(())
}

/// Rejects the result of a step that is not finite or, of a step in axes to the north, too near a pole.
#[inline(always)]
pub(crate) fn check(
    state: &NavState,
    inc: &Increments,
    next: &NavState,
    to_north: bool,
) -> Result<(), MechanisationError> {
    let p = &next.position;
    // A sum is finite only if all of its terms are.
    let sum = next.c_b_n.coords.sum() + next.velocity.sum() + p.latitude + p.longitude + p.height;
    if !sum.is_finite() {
        return Err(not_finite(state, inc));
    }
    if to_north && p.latitude.abs() > MAX_LATITUDE_DEG.to_radians() {
        return Err(MechanisationError::Latitude { degrees: p.latitude.to_degrees() });
    }
    Ok(())
}

/// Returns the error for the first of a step's inputs that is not finite, or else for its result.
#[cold]
fn not_finite(state: &NavState, inc: &Increments) -> MechanisationError {
    let p = &state.position;
    let inputs = [
        ("attitude", state.c_b_n.coords.sum()),
        ("velocity", state.velocity.sum()),
        ("position", p.latitude + p.longitude + p.height),
        ("angular increment", inc.dtheta.sum()),
        ("velocity increment", inc.dvel.sum()),
    ];
    let what = inputs.iter().find(|(_, sum)| !sum.is_finite()).map_or("result", |(what, _)| what);
    MechanisationError::NonFinite { what }
}

#[cfg(test)]
#[path = "mechanisation_tests.rs"]
mod tests;
