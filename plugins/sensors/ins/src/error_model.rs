//! The inertial error state in north-east-down axes, in continuous time and over a step.
//!
//! Every error is "true minus estimate":
//! - `phi`, rad: `C_true = exp([phi x]) C`, on the left, so in navigation axes;
//! - `dv`, m/s, north-east-down;
//! - `dp`, m: `dp_N = (R_N + h) dL`, `dp_E = (R_E + h) cos(L) dlon`, `dp_D = -dh`;
//! - `bg`, rad/s and `ba`, m/s^2, in body axes: `w = measured - b_g`, `f = measured - b_a`.
//!
//! Differencing the strapdown equations (Groves, 2nd ed., section 5.4) to first order gives
//! ```text
//! phi' = -w_in x phi - dw_in - C dbg
//! dv'  = -f x phi - C dba - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v + dg
//! dp_N' = dv_N - v_D/(R_N+h) dp_N + v_N/(R_N+h) dp_D
//! dp_E' = dv_E + [v_E tan(L) dp_N - (v_N tan(L) + v_D) dp_E + v_E dp_D]/(R_E+h)
//! dp_D' = dv_D
//! ```
//! (compare Groves section 14.2.4, where the attitude error has the other sign and the position
//! error is in radians). The position error is in metres, so that all rows of `Phi` have similar
//! magnitude. The position rows use `d(R_E cos L)/dL = -R_N sin L`; the slope of `R_N` cancels in
//! the first.

use nalgebra::{Matrix3, Matrix3x2, Vector3};

use crate::earth::EARTH_RATE;
use crate::mechanisation::StepRates;

/// The blocks of the transition matrix `Phi` of the inertial error state over a step; the field
/// `x_y` is the effect of `y` on `x`. The block `p_v` is the identity times the interval. Blocks
/// that are not named are zero, or the identity on the diagonal of the biases.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertialTransition {
    /// Attitude on attitude.
    pub phi_phi: Matrix3<f64>,
    /// Velocity north and east on attitude, s/m. A velocity down turns no axes.
    pub phi_v: Matrix3x2<f64>,
    /// Position north and down on attitude, 1/m. A position to the east changes no rate.
    pub phi_p: [Vector3<f64>; 2],
    /// Gyroscope bias on attitude, s.
    pub phi_bg: Matrix3<f64>,
    /// Attitude on velocity, m/s.
    pub v_phi: Matrix3<f64>,
    /// Velocity on velocity.
    pub v_v: Matrix3<f64>,
    /// Position north and down on velocity, 1/s.
    pub v_p: [Vector3<f64>; 2],
    /// Accelerometer bias on velocity, s.
    pub v_ba: Matrix3<f64>,
    /// Position on position.
    pub p_p: Matrix3<f64>,
}

/// `I - [w x]`.
#[inline(always)]
#[rustfmt::skip]
fn turned_back(w: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(
        1.0, w.z, -w.y,
        -w.z, 1.0, w.x,
        w.y, -w.x, 1.0,
    )
}

/// Computes the transition over a step: `Phi = I + F dt` (Groves eq. 3.34 to first order) with `F`
/// of its midpoint.
///
/// With `F` at the midpoint, and the means of `C` and `f` over the interval, an error of second
/// order in `dt` remains only where blocks chain, `F^2 dt^2 / 2`. Within the blocks that are kept
/// it is `w_in dt / 2` of each, 4e-7 at 100 Hz and 4e-6 at 10 Hz. Some blocks are omitted, to keep
/// the propagation of the covariance small:
/// - `p_phi = dt/2 v_phi` and `p_ba = dt/2 v_ba`: 5e-4 m per rad and 5e-5 m per m/s^2 at 100 Hz;
/// - `v_bg = v_phi phi_bg / 2`: 5e-4 m/s per rad/s at 100 Hz, and `p_bg = dt/3 v_bg`.
///
/// Over many steps these telescope: without them the position error lags the velocity error by half
/// a step, and the velocity error lags the attitude error, for any number of steps. An error in
/// velocity that changes by 0.1 m/s leaves the position error short by 0.5 mm at 100 Hz.
///
/// The share of the biases in coning and sculling, the difference of two samples over 12 (1e-5 of
/// `phi_bg` for a change of rate of 1 rad/s^2 at 100 Hz), is omitted too.
#[inline(always)]
pub fn transition(rates: &StepRates) -> InertialTransition {
    let (dt, e, v) = (rates.dt, &rates.earth, &rates.velocity);
    let tan = e.sin * e.inv_cos;
    // over the step: angle of a metre to the north and to the east, and of the velocity
    let (inv_n, inv_e) = (e.inv_n * dt, e.inv_e * dt);
    let (north, east) = (v.x * inv_n, v.y * inv_e);

    // dw_ie / dp_N of w_ie = W [cos L, 0, -sin L] (Groves eq. 2.123), with dL = dp_N / (R_N+h)
    let earth_n = Vector3::new(-e.sin, 0.0, -e.cos) * (EARTH_RATE * inv_n);
    // dw_en / dp: by dp_N through the radii, whose slopes count, and tan(L); by dp_D through the
    // height, dh = -dp_D
    let east_n = -east * e.inv_e * e.r_e_slope * e.inv_n;
    let north_n = -north * e.inv_n * e.r_n_slope * e.inv_n;
    let transport_n =
        Vector3::new(east_n, -north_n, -east_n * tan - east * e.inv_cos * e.inv_cos * e.inv_n);
    let (east_d, north_d) = (east * e.inv_e, north * e.inv_n);
    let transport_d = Vector3::new(east_d, -north_d, -east_d * tan);
    // dv' / dp: the Coriolis term -(2 dw_ie + dw_en) x v, and the gradient of gravity, which makes
    // the vertical channel unstable (Schuler's dynamics follow from v_phi and phi_v)
    let mut v_n = v.cross(&(earth_n * 2.0 + transport_n));
    v_n.z += e.gravity_latitude * inv_n;
    let mut v_d = v.cross(&transport_d);
    v_d.z -= e.gravity_height * dt;

    let earth = rates.earth_rate * dt;
    let w_in = earth + rates.transport_rate * dt;
    let c_dt = rates.c_b_n * -dt;
    // dv' / dv: -[(2 w_ie + w_en) x] - [v x] dw_en/dv, which has few elements
    let (east_tan, north_down) = (east * tan, v.z * inv_n);
    let turn = (v.x * tan + v.z) * inv_e;
    let mut v_v = turned_back(&(w_in + earth));
    v_v.m11 += north_down;
    v_v.m12 -= east_tan;
    v_v.m22 += turn;
    v_v.m31 -= north;
    v_v.m32 -= east;
    InertialTransition {
        phi_phi: turned_back(&w_in),
        // dw_en / dv of w_en = [v_E/(R_E+h), -v_N/(R_N+h), -v_E tan(L)/(R_E+h)] (Groves eq. 5.44)
        phi_v: Matrix3x2::new(0.0, -inv_e, inv_n, 0.0, 0.0, inv_e * tan),
        phi_p: [-(earth_n + transport_n), -transport_d],
        phi_bg: c_dt,
        v_phi: (rates.specific_force * -dt).cross_matrix(),
        v_v,
        v_p: [v_n, v_d],
        v_ba: c_dt,
        // from dL' = v_N/(R_N+h) and dlon' = v_E/((R_E+h) cos L) (Groves eq. 2.111), in metres
        p_p: Matrix3::new(1.0 - north_down, 0.0, north, east_tan, 1.0 - turn, east, 0.0, 0.0, 1.0),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::mechanisation::{Increments, Mechanisation, NavState};
    use crate::testing::Uniform;
    use nalgebra::{SMatrix, SVector, UnitQuaternion};
    use navfuse_core::state::geodesy::Geodetic;

    type Errors = SVector<f64, 15>;

    /// The state with an error put in, and the increments with the biases' error taken out of them.
    fn retract(state: &NavState, sample: &Increments, x: &Errors) -> (NavState, Increments) {
        let part = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
        let perturbed = NavState {
            c_b_n: UnitQuaternion::from_scaled_axis(part(0)) * state.c_b_n,
            velocity: state.velocity + part(3),
            position: state.position.displaced(&part(6)),
        };
        let dt = sample.dt;
        (
            perturbed,
            Increments {
                dtheta: sample.dtheta - part(9) * dt,
                dvel: sample.dvel - part(12) * dt,
                dt,
            },
        )
    }

    fn local(state: &NavState, origin: &NavState) -> SVector<f64, 9> {
        let mut x = SVector::<f64, 9>::zeros();
        x.fixed_rows_mut::<3>(0).copy_from(&(state.c_b_n * origin.c_b_n.inverse()).scaled_axis());
        x.fixed_rows_mut::<3>(3).copy_from(&(state.velocity - origin.velocity));
        x.fixed_rows_mut::<3>(6).copy_from(&state.position.ned_from(&origin.position));
        x
    }

    /// The transition of the mechanisation itself, by central differences of fourth order.
    fn numerical(state: &NavState, sample: &Increments, steps: &Errors) -> SMatrix<f64, 9, 15> {
        let run = |x: &Errors| {
            let (state, sample) = retract(state, sample, x);
            // A previous sample of the same rates: no coning, as in smooth motion.
            Mechanisation::default().step(&state, &sample).unwrap().0
        };
        let origin = run(&Errors::zeros());
        let mut phi = SMatrix::<f64, 9, 15>::zeros();
        for j in 0..15 {
            let at = |k: f64| local(&run(&Errors::ith(j, k * steps[j])), &origin);
            phi.set_column(
                j,
                &((8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * steps[j])),
            );
        }
        phi
    }

    fn random_case(u: &mut Uniform) -> (NavState, Increments) {
        let dt = 0.01;
        let state = NavState {
            c_b_n: UnitQuaternion::from_scaled_axis(u.vector(2.0)),
            velocity: u.vector(30.0 / 3.0_f64.sqrt()),
            position: Geodetic {
                latitude: u.within(80.0_f64.to_radians()),
                longitude: u.within(3.0),
                height: -2_500.0 + u.within(2_500.0),
            },
        };
        let dvel = state.c_b_n.inverse() * (Vector3::new(0.0, 0.0, -9.8) + u.vector(2.0)) * dt;
        (state, Increments { dtheta: u.vector(1.0) * dt, dvel, dt })
    }

    /// Perturbations of a step: large, for the sake of rounding, yet the scale on which the
    /// equations bend (1 rad, or `R cos L`, 1e6 m) is 200 times larger, so that the truncation, of
    /// fourth order, stays below 1e-7.
    fn perturbations() -> Errors {
        let mut steps = Errors::zeros();
        for (i, s) in [1e-2, 10.0, 5_000.0, 1.0, 50.0].into_iter().enumerate() {
            steps.fixed_rows_mut::<3>(3 * i).fill(s);
        }
        steps
    }

    #[test]
    fn the_transition_is_the_derivative_of_the_mechanisation() {
        // Bounds at 100 Hz, 30 m/s, latitude 80 degrees, from the second-order terms `transition`
        // leaves out:
        // - each block relative to itself: (|2 w_ie + w_en| + |w_in|) dt = (1.7e-4 + 1.0e-4) 0.01 =
        //   2.7e-6, and rounding of the difference, 4e-16 rad in 5 km of phi_p's 1.1e-13 rad/m:
        //   1e-6;
        // - diagonal blocks, absolute: dt^2/2 times f tan(L)/R = 12 * 5.7 / 6.4e6 (attitude,
        //   velocity), 5e-10, or times the gravity gradient 3.1e-6 (position), 1.5e-10;
        // - blocks left out, absolute: dt^2/2 times |f| < 14 (p_phi, v_bg), times 1 (p_ba), dt^3/6
        //   |f| (p_bg), 1% over for the turn of 1.7 rad/s 0.01 s; phi_ba: dt^2/2 tan(L)/R.
        const RELATIVE: f64 = 4e-6;
        const DIAGONAL: f64 = 1e-9;
        let mut u = Uniform::new(1);
        for case in 0..500 {
            let (state, sample) = random_case(&mut u);
            let (_, rates) = Mechanisation::default().step(&state, &sample).unwrap();
            let phi = numerical(&state, &sample, &perturbations());
            let t = transition(&rates);
            let z = Matrix3::zeros();
            let v = Vector3::zeros();
            let phi_v =
                Matrix3::from_columns(&[t.phi_v.column(0).into(), t.phi_v.column(1).into(), v]);
            let phi_p = Matrix3::from_columns(&[t.phi_p[0], v, t.phi_p[1]]);
            let v_p = Matrix3::from_columns(&[t.v_p[0], v, t.v_p[1]]);
            let p_v = Matrix3::identity() * rates.dt;
            let relative = |b: &Matrix3<f64>| RELATIVE * b.amax();
            let expected = [
                [
                    (t.phi_phi, DIAGONAL),
                    (phi_v, relative(&phi_v)),
                    (phi_p, relative(&phi_p)),
                    (t.phi_bg, relative(&t.phi_bg)),
                    (z, 5e-11),
                ],
                [
                    (t.v_phi, relative(&t.v_phi)),
                    (t.v_v, DIAGONAL),
                    (v_p, relative(&v_p)),
                    (z, 7e-4),
                    (t.v_ba, relative(&t.v_ba)),
                ],
                [(z, 7e-4), (p_v, relative(&p_v)), (t.p_p, DIAGONAL), (z, 2.4e-6), (z, 5.1e-5)],
            ];
            for (i, row) in expected.iter().enumerate() {
                for (j, (block, bound)) in row.iter().enumerate() {
                    let exact: Matrix3<f64> = phi.fixed_view::<3, 3>(3 * i, 3 * j).into();
                    let error = (exact - block).amax();
                    assert!(
                        error < *bound,
                        "case {case}, block {i} {j}: {error:e} of {bound:e}\n{exact}{block}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_is_left_out_is_what_the_documentation_says() {
        let mut u = Uniform::new(2);
        for _ in 0..50 {
            let (state, sample) = random_case(&mut u);
            let (_, rates) = Mechanisation::default().step(&state, &sample).unwrap();
            let phi = numerical(&state, &sample, &perturbations());
            let t = transition(&rates);
            let half = 0.5 * rates.dt;
            // The next order is the turn in a step, at most 1.7 rad/s 0.01 s, on either side of
            // `f`, of a block of nine components compared by its largest.
            for (i, j, block) in [
                (2, 0, t.v_phi * half),
                (2, 4, t.v_ba * half),
                (1, 3, t.v_phi * t.phi_bg * 0.5),
                (2, 3, t.v_phi * t.phi_bg * (rates.dt / 6.0)),
            ] {
                let exact: Matrix3<f64> = phi.fixed_view::<3, 3>(3 * i, 3 * j).into();
                assert!(
                    (exact - block).amax() < 5e-2 * block.amax(),
                    "block {i} {j}\n{exact}{block}"
                );
            }
        }
    }
}
