//! Coasting of a strapdown process: the motion while the IMU is silent.
//!
//! Without an IMU, nothing is known of the motion but that a vehicle changes it slowly. Attitude
//! and velocity therefore stay in the navigation axes, and their errors grow by white noise of
//! angular rate and acceleration:
//! ```text
//! psi' = n_w,   dv' = n_a,   dp' = dv
//! ```
//! The velocity no longer integrates the specific force, so that no attitude error enters it.

use crate::navigation::Navigation;
use crate::places::Places;
use nalgebra::{Matrix3, Matrix3x2, Vector3};
use navfuse_core::state::covariance::Transition;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::{AccelerationNoise, AngularRateNoise, Sigma, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Motion of the vehicle while the IMU is silent for longer than `max_gap`.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coast {
    /// White noise of the angular rate, one value or one for each axis of the body: a vehicle whose
    /// heading changes by 10 deg in 100 s has about "1 deg/s/sqrt(Hz)".
    pub turn: Sigma<Triple<AngularRateNoise>>,
    /// White noise of the acceleration, one value or north, east and down; for a vehicle with the
    /// speed v it is at least v times `turn`, since the velocity turns with the vehicle.
    pub acceleration: Sigma<Triple<AccelerationNoise>>,
}

impl Coast {
    /// Moves the position by `dt` seconds, and fills the transition.
    pub(crate) fn propagate(
        &self,
        n: &Navigation,
        s: &Places,
        layout: &Layout,
        state: &mut State,
        dt: f64,
        out: &mut Transition,
    ) {
        let (attitude, velocity) = (state.get(layout, n.attitude), state.get(layout, n.velocity));
        let position = state.get(layout, n.position).displaced(&(velocity * dt));
        state.set(layout, n.position, &position);
        // the vehicle does not turn; the rotation of the Earth is far below the noise
        let [bias, _] = n.biases(layout, state);
        n.publish(state, &bias.into());
        let (one, none) = (Matrix3::identity(), Matrix3::zeros());
        for place in [s.phi_phi, s.v_v, s.p_p] {
            out.set(place, &one);
        }
        for place in [s.phi_bg, s.v_phi, s.v_ba] {
            out.set(place, &none);
        }
        out.set(s.phi_v, &Matrix3x2::zeros());
        for place in [s.phi_p, s.v_p].into_iter().flatten() {
            out.set(place, &Vector3::zeros());
        }
        out.set_diagonal(s.p_v, &[dt; 3]);
        out.set_diagonal(s.v_g, &[0.0; 3]);
        let variance = |density: Vector3<f64>| Matrix3::from_diagonal(&density.map(|d| d * d * dt));
        let (c_b_n, turn) = (attitude.matrix(), variance(self.turn.value().si()));
        out.set_noise(s.q_phi, &(c_b_n * turn * c_b_n.transpose()));
        out.set_noise(s.q_v, &variance(self.acceleration.value().si()));
    }
}
