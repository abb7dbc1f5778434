//! Joyce (1989): scale factor and yaw from the horizontal velocity over the ground.

use crate::fixes::pairs;
use crate::kinsey::velocities;
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix4, Rotation3, Vector3, Vector4};
use navfuse_segments::Mounting;

/// Let `(u_d, v_d)` be the DVL's north and east velocity at its initial mounting, and `(u, v)` the
/// velocity over the ground:
///
/// ```text
/// tan a = <u_d v - v_d u> / <u_d u + v_d v>        A^2 = <u^2 + v^2> / <u_d^2 + v_d^2>
/// ```
/// Then `v^n = A R(a) v_d^n`: the instrument's yaw decreases by `a`, and `k` by the factor `A`.
/// Roll and pitch keep their initial values.
pub fn estimate(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.over_ground()?;
    let initial = velocity.initial;
    let (pairs, own) = pairs(data)?;
    let flat = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
    let (mut sine, mut cosine, mut ground, mut doppler) = (0.0, 0.0, 0.0, 0.0);
    let mut history = Vec::new();
    let at = |sine: f64, cosine: f64, ground: f64, doppler: f64| {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), f64::atan2(sine, cosine));
        Mounting { k: initial.k * (doppler / ground).sqrt(), c_b_d: initial.c_b_d * turn.inverse() }
    };
    let mut mounting = initial;
    let sides: Vec<_> = pairs
        .iter()
        .map(|p| (flat(p.c_b_n * p.body), flat(p.c_b_n * initial.body(&p.y))))
        .collect();
    for (pair, (v, d)) in pairs.iter().zip(&sides) {
        sine += d.x * v.y - d.y * v.x;
        cosine += d.dot(v);
        ground += v.norm_squared();
        doppler += d.norm_squared();
        if ground > 0.0 && doppler > 0.0 {
            mounting = at(sine, cosine, ground, doppler);
            history.push(IntermediateEstimate { time: pair.time, mounting });
        }
    }
    if history.is_empty() {
        return Err(CalibrationError::Motion(
            "the vehicle does not move while there are \
                                             fixes"
                .into(),
        ));
    }
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), f64::atan2(sine, cosine));
    let gain = (ground / doppler).sqrt();
    let left: f64 = sides.iter().map(|(v, d)| (v - turn * d * gain).norm_squared()).sum();
    let variance = left / (2.0 * pairs.len() as f64 - 2.0).max(1.0) / ground;
    // roll and pitch keep their prior; a pitch p reduces the horizontal speed by p^2 / 2
    let tilt = velocity.angle_sigma.map(|s| s * s);
    let scale = (variance + 0.75 * tilt.y.powi(2)) * mounting.k.powi(2);
    let used = [pairs[0].time, pairs[pairs.len() - 1].time];
    let covariance = Matrix4::from_diagonal(&Vector4::new(scale, tilt.x, tilt.y, variance))
        + data.attitude_covariance(&mounting, used);
    let notes = vec![
        data.attitude_source(),
        velocities(own),
        "scale factor and yaw only: roll and pitch keep their initial values and their prior; \
         sigma from white residuals and this tilt"
            .into(),
    ];
    let determined = [true, false, false, true];
    Ok(Estimate { mounting, covariance: Some(covariance), determined, history, used, notes })
}
