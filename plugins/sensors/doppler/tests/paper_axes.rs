//! The mapping from the axes of Pan & Wu (2016) to ours, proved against their equations.
//!
//! The paper: north-up-east and forward-up-right; ours: north-east-down and forward-right-down.
//! Both pairs differ by the same rotation about the first axis, so that roll and pitch keep their
//! sign and yaw about up is minus yaw about down.

use navfuse_core::nalgebra::{Matrix3, Vector3};
use navfuse_core::state::manifold::{Manifold, Rotation};

/// The largest rounding of a product of three rotation matrices, several times over.
const ROUNDING: f64 = 1e-14;

/// Forward, up, right to forward, right, down; and north, up, east to north, east, down.
#[rustfmt::skip]
const PAPER_TO_OURS: Matrix3<f64> = Matrix3::new(
    1.0, 0.0, 0.0,
    0.0, 0.0, 1.0,
    0.0, -1.0, 0.0,
);

/// Eq. (16) of the paper, as printed: `C_d^b` of roll `phi`, yaw `psi` (about up) and pitch
/// `theta`.
fn equation_16(phi: f64, psi: f64, theta: f64) -> Matrix3<f64> {
    let ((sf, cf), (sp, cp), (st, ct)) = (phi.sin_cos(), psi.sin_cos(), theta.sin_cos());
    #[rustfmt::skip]
    let c = Matrix3::new(
        ct * cp,                  st,      -ct * sp,
        sf * sp - cf * cp * st,   cf * ct,  cp * sf + cf * st * sp,
        cf * sp + cp * sf * st,  -ct * sf,  cf * cp - sf * st * sp,
    );
    c
}

/// Our `C_d^b`, of roll, pitch and yaw (about down): the transpose of what the misalignment block
/// holds.
fn ours(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    Rotation::from_coordinates(&[roll, pitch, yaw]).matrix().transpose()
}

/// Triples of angles that cover the axes, their signs and large values.
fn angles() -> impl Iterator<Item = [f64; 3]> {
    let values = [-2.9, -0.7, -0.1, 0.0, 0.3, 1.2];
    values
        .into_iter()
        .flat_map(move |a| values.into_iter().flat_map(move |b| values.map(|c| [a, b, 0.5 * c])))
}

#[test]
fn roll_and_pitch_keep_their_sign_and_yaw_changes_it() {
    for [phi, psi, theta] in angles() {
        let paper = PAPER_TO_OURS * equation_16(phi, psi, theta) * PAPER_TO_OURS.transpose();
        let difference = (paper - ours(phi, theta, -psi)).amax();
        assert!(difference < ROUNDING, "roll {phi}, yaw {psi}, pitch {theta}: {difference:e}");
    }
}

#[test]
fn the_misalignment_is_roll_after_pitch_after_yaw() {
    // Coordinate transformations about one axis (Groves, 2nd ed., section 2.2.1).
    let rx = |a: f64| Matrix3::new(1.0, 0.0, 0.0, 0.0, a.cos(), a.sin(), 0.0, -a.sin(), a.cos());
    let ry = |a: f64| Matrix3::new(a.cos(), 0.0, -a.sin(), 0.0, 1.0, 0.0, a.sin(), 0.0, a.cos());
    let rz = |a: f64| Matrix3::new(a.cos(), a.sin(), 0.0, -a.sin(), a.cos(), 0.0, 0.0, 0.0, 1.0);
    for [roll, yaw, pitch] in angles() {
        let difference = (rx(roll) * ry(pitch) * rz(yaw) - ours(roll, pitch, yaw)).amax();
        assert!(difference < ROUNDING, "{roll} {pitch} {yaw}: {difference:e}");
    }
}

#[test]
fn the_output_of_the_dvl_is_that_of_equation_7() {
    // The paper's numbers: k = 0.9998, misalignment roll -0.1, yaw -0.5, pitch -0.2 deg, at 5 m/s
    // forward and 1 m/s down.
    let [phi, psi, theta] = [-0.1_f64, -0.5, -0.2].map(f64::to_radians);
    let k = 0.9998;
    let v_paper = Vector3::new(5.0, -1.0, 0.0); // forward, up, right
    let y_paper = equation_16(phi, psi, theta).transpose() * v_paper * k;
    let c_b_d = Rotation::from_coordinates(&[phi, theta, -psi]);
    let y = c_b_d * Vector3::new(5.0, 0.0, 1.0) * k; // forward, right, down
    assert!((y - PAPER_TO_OURS * y_paper).amax() < ROUNDING);
}

#[test]
fn a_vehicle_yawed_by_minus_ten_degrees_about_up_heads_ten_degrees_east_of_north() {
    // North, up, east and forward, up, right in place of the instrument's frames: eq. (16) is
    // C_n^b.
    let c_n_b =
        PAPER_TO_OURS * equation_16(0.0, (-10_f64).to_radians(), 0.0) * PAPER_TO_OURS.transpose();
    let forward = c_n_b.transpose() * Vector3::x();
    assert!((forward.y.atan2(forward.x) - 10_f64.to_radians()).abs() < ROUNDING);
}
