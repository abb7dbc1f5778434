//! The inertial error state in wander-azimuth axes, which exist at the poles.
//!
//! The errors are those of [`crate::error_model`], but attitude and velocity of the truth are carried
//! to the position of the estimate along the great circle between both, without a turn about the
//! vertical ([`Composer::carries`]):
//! ```text
//! phi = phi_n - g e_D,   dv = dv_n - g e_D x v,   g = tan(L) / (R_E+h) dp_E
//! ```
//! with `phi_n` and `dv_n` of the error model in north-east-down. With this the tangents of the
//! latitude cancel. In axes that are north, east and down at the beginning of a step and do not turn
//! about the vertical, `w_en = [v_E/(R_E+h), -v_N/(R_N+h), 0]`,
//! ```text
//! phi'  = -w_in x phi - dw_in - C dbg
//! dv'   = -f x phi - C dba - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v + dg
//! dp_N' = dv_N + (-v_D dp_N + v_N dp_D)/(R_N+h)
//! dp_E' = dv_E + (-v_D dp_E + v_E dp_D)/(R_E+h)
//! dp_D' = dv_D
//! dw_ie = w_ie x [dp_E/(R_E+h), -dp_N/(R_N+h), 0]
//! dw_en,D = (v_N dp_E - v_E dp_N) / ((R_N+h)(R_E+h))
//! ```
//! The last row is the curvature of the ellipsoid: two parallel tracks turn from each other. The other
//! rows of `dw_en` are those of the velocity, of the height, of the slopes of the radii and, with
//! `dp_E`, of the axes of the curvature, `e^2 sin L cos L R_E / (1 - e^2 sin^2 L)` times `-v_N` and `v_E`
//! over `(R_N+h)(R_E+h)^2`. At the end of the step all errors turn to north and east of its end.
//!
//! [`Composer::carries`]: navfuse_core::compose::Composer::carries

use crate::earth::EARTH_RATE;
use crate::mechanisation::StepRates;
use crate::navigation::Navigation;
use crate::places::Places;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::compose::Composer;
use navfuse_core::state::Handle;
use navfuse_core::state::covariance::{InputSlot, NoiseSlot, PhiSlot, Transition};
use navfuse_core::state::manifold::Vector;
use schemars::JsonSchema;
use serde::Deserialize;

/// Axes in which a strapdown process integrates and has its errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Frame {
    /// North, east, down.
    #[default]
    NorthEastDown,
    /// Axes that are carried along with the position, without a turn about the vertical. The values of
    /// attitude, velocity and position stay in north, east, down.
    WanderAzimuth,
}

/// Places of the process in the transition, by its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FramePlaces {
    North(Places),
    Wander(WanderPlaces),
}

/// The blocks of the transition matrix of the inertial error state over a step.
#[derive(Clone, Copy, Debug)]
pub struct WanderTransition {
    /// Of attitude, velocity and position on attitude.
    pub phi: [Matrix3<f64>; 3],
    /// Of attitude, velocity and position on velocity.
    pub v: [Matrix3<f64>; 3],
    /// Of velocity and position on position.
    pub p: [Matrix3<f64>; 2],
    /// Of gyro bias on attitude, and of accelerometer bias on velocity.
    pub bias: Matrix3<f64>,
    /// Of a constant acceleration in the axes of the beginning on velocity.
    pub gravity: Matrix3<f64>,
    /// Mean rotation from body to north-east-down of the end.
    pub c_b_n: Matrix3<f64>,
}

/// `I - [w x]`.
fn turned_back(w: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() - w.cross_matrix()
}

/// Computes the transition over a step, to the order of [`crate::error_model::transition`].
pub fn transition(rates: &StepRates) -> WanderTransition {
    let (dt, e, v) = (rates.dt, &rates.earth, &rates.velocity);
    let (inv_n, inv_e) = (e.inv_n * dt, e.inv_e * dt);
    let (north, east) = (v.x * inv_n, v.y * inv_e);
    let column = Vector3::new;
    // dw_ie by a metre to the north and to the east
    let earth_n = column(-e.sin, 0.0, -e.cos) * (EARTH_RATE * inv_n);
    let earth_e = column(0.0, -e.sin, 0.0) * (EARTH_RATE * inv_e);
    // dw_en by a metre to the north, to the east and down
    let slope = |x: f64, inv: f64, slope: f64| -x * inv * slope * e.inv_n;
    let transport_n = column(
        slope(east, e.inv_e, e.r_e_slope),
        -slope(north, e.inv_n, e.r_n_slope),
        -east * e.inv_n,
    );
    let axes = e.r_e_slope * e.inv_n * e.inv_e * inv_e;
    let transport_e = column(-axes * v.x, axes * v.y, north * e.inv_e);
    let transport_d = column(east * e.inv_e, -north * e.inv_n, 0.0);
    let transport = [transport_n, transport_e, transport_d];
    let earth = [earth_n, earth_e, Vector3::zeros()];
    let mut phi_p = [Vector3::zeros(); 3];
    let mut v_p = [Vector3::zeros(); 3];
    for k in 0..3 {
        phi_p[k] = -(earth[k] + transport[k]);
        v_p[k] = v.cross(&(earth[k] * 2.0 + transport[k]));
    }
    v_p[0].z += e.gravity_latitude * inv_n;
    v_p[2].z -= e.gravity_height * dt;

    let earth_rate = rates.earth_rate * dt;
    let w_in = earth_rate + rates.transport_rate * dt;
    let mut v_v = turned_back(&(w_in + earth_rate));
    v_v.m11 += v.z * inv_n;
    v_v.m22 += v.z * inv_e;
    v_v.m31 -= north;
    v_v.m32 -= east;
    #[rustfmt::skip]
    let (phi_v, p_p) = (
        Matrix3::new(
            0.0, -inv_e, 0.0,
            inv_n, 0.0, 0.0,
            0.0, 0.0, 0.0,
        ),
        Matrix3::new(
            1.0 - v.z * inv_n, 0.0, north,
            0.0, 1.0 - v.z * inv_e, east,
            0.0, 0.0, 1.0,
        ),
    );
    // to north and east of the end
    let (sin, cos) = rates.turn.sin_cos();
    let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
    let c_b_n = turn * rates.c_b_n;
    WanderTransition {
        phi: [turned_back(&w_in), phi_v, Matrix3::from_columns(&phi_p)].map(|m| turn * m),
        v: [(rates.specific_force * -dt).cross_matrix(), v_v, Matrix3::from_columns(&v_p)]
            .map(|m| turn * m),
        p: [turn * dt, turn * p_p],
        bias: c_b_n * -dt,
        gravity: turn * dt,
        c_b_n,
    }
}

/// Places of the process in the transition.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WanderPlaces {
    phi: [PhiSlot<3, 3>; 3],
    v: [PhiSlot<3, 3>; 3],
    p: [PhiSlot<3, 3>; 2],
    phi_bg: PhiSlot<3, 3>,
    v_ba: PhiSlot<3, 3>,
    v_g: PhiSlot<3, 3>,
    q_phi: NoiseSlot<3>,
    q_v: NoiseSlot<3>,
    phi_gyro: InputSlot<3, 3>,
    v_accel: InputSlot<3, 3>,
}

impl WanderPlaces {
    pub(crate) fn new(
        composer: &mut Composer,
        n: &Navigation,
        gravity: Option<Handle<Vector<3>>>,
        imu: &str,
    ) -> Self {
        let states = [
            composer.tangent(n.attitude),
            composer.tangent(n.velocity),
            composer.tangent(n.position),
        ];
        let bias = |bias: Option<Handle<Vector<3>>>| bias.and_then(|b| composer.tangent(b));
        let (bg, ba, g) = (bias(n.gyro_bias), bias(n.accel_bias), bias(gravity));
        let [phi, v, p] = states;
        let phi_gyro = composer.input_place(imu, phi, 0);
        let v_accel = composer.input_place(imu, v, 3);
        let t = composer.transition();
        Self {
            phi: states.map(|of| t.phi(phi, of)),
            v: states.map(|of| t.phi(v, of)),
            p: [v, p].map(|of| t.phi(p, of)),
            phi_bg: t.phi(phi, bg),
            v_ba: t.phi(v, ba),
            v_g: t.phi(v, g),
            q_phi: t.noise(phi),
            q_v: t.noise(v),
            phi_gyro,
            v_accel,
        }
    }

    /// Fills the transition; a channel of the IMU acts as a bias of the other sign, times `share`.
    pub(crate) fn fill(&self, phi: &WanderTransition, share: f64, out: &mut Transition) {
        let rows = self.phi.iter().zip(&phi.phi).chain(self.v.iter().zip(&phi.v));
        for (place, value) in rows.chain(self.p.iter().zip(&phi.p)) {
            out.set(*place, value);
        }
        out.set(self.phi_bg, &phi.bias);
        out.set(self.v_ba, &phi.bias);
        out.set(self.v_g, &phi.gravity);
        if out.has_inputs() {
            out.set_input(self.phi_gyro, &(phi.bias * -share));
            out.set_input(self.v_accel, &(phi.bias * -share));
        }
    }

    /// Sets the noise of attitude and velocity.
    pub(crate) fn noise(&self, q: &[Matrix3<f64>; 2], out: &mut Transition) {
        out.set_noise(self.q_phi, &q[0]);
        out.set_noise(self.q_v, &q[1]);
    }
}
