//! Places of a strapdown process in the transition.

use crate::navigation::Navigation;
use navfuse_core::compose::Composer;
use navfuse_core::state::Handle;
use navfuse_core::state::covariance::{InputSlot, NoiseSlot, PhiDiagonal, PhiSlot};
use navfuse_core::state::manifold::Vector;

/// Places that the model fills in `Phi` and `Q`. A velocity down does not turn the axes, and a
/// position to the east changes neither them nor gravity: these columns have no place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Places {
    pub phi_phi: PhiSlot<3, 3>,
    pub phi_v: PhiSlot<3, 2>,
    pub phi_p: [PhiSlot<3, 1>; 2],
    pub phi_bg: PhiSlot<3, 3>,
    pub v_phi: PhiSlot<3, 3>,
    pub v_v: PhiSlot<3, 3>,
    pub v_p: [PhiSlot<3, 1>; 2],
    pub v_ba: PhiSlot<3, 3>,
    pub v_g: PhiDiagonal<3>,
    pub p_v: PhiDiagonal<3>,
    pub p_p: PhiSlot<3, 3>,
    pub q_phi: NoiseSlot<3>,
    pub q_v: NoiseSlot<3>,
    pub phi_gyro: InputSlot<3, 3>,
    pub v_accel: InputSlot<3, 3>,
}

impl Places {
    pub(crate) fn new(
        composer: &mut Composer,
        n: &Navigation,
        gravity: Option<Handle<Vector<3>>>,
        imu: &str,
    ) -> Self {
        let (phi, v) = (composer.tangent(n.attitude), composer.tangent(n.velocity));
        let (p, bg, ba) = (
            composer.tangent(n.position),
            n.gyro_bias.and_then(|bias| composer.tangent(bias)),
            n.accel_bias.and_then(|bias| composer.tangent(bias)),
        );
        let gravity = gravity.and_then(|gravity| composer.tangent(gravity));
        let phi_gyro = composer.input_place(imu, phi, 0);
        let v_accel = composer.input_place(imu, v, 3);
        let down = p.map(|north| north + 2);
        let t = composer.transition();
        Self {
            phi_phi: t.phi(phi, phi),
            phi_v: t.phi(phi, v),
            phi_p: [t.phi(phi, p), t.phi(phi, down)],
            phi_bg: t.phi(phi, bg),
            v_phi: t.phi(v, phi),
            v_v: t.phi(v, v),
            v_p: [t.phi(v, p), t.phi(v, down)],
            v_ba: t.phi(v, ba),
            v_g: t.phi_diagonal(v, gravity),
            p_v: t.phi_diagonal(p, v),
            p_p: t.phi(p, p),
            q_phi: t.noise(phi),
            q_v: t.noise(v),
            phi_gyro,
            v_accel,
        }
    }
}
