//! The axes along which the attitude determines the lever arm of a position sensor: Tang, Wu, Wu, Wu,
//! Hu & Shen (2009), *INS/GPS integration: global observability analysis*.
//!
//! With known attitude and motion of the IMU but for a constant, a position sensor at the lever arm
//! `l` measures `p(t) + C_b^n(t) l`. The constant and `l` are separable by what `C_b^n` changes:
//! ```text
//! G = mean of (C - C~)' (C - C~),      C~ = mean of C_b^n
//! ```
//! A body that keeps its attitude has `G = 0`. One that turns about a single axis `a` has `G a = 0`, so
//! that the part of `l` along the axis of the turns is the same as a shift of the whole track. Turns
//! about two axes determine all of `l`.

use crate::finder::eigen;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Smallest root of an eigenvalue of `G` that counts: turns of less than 1 deg r.m.s.
const LEAST: f64 = 0.0175;

/// How far an attitude separates a lever arm from the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LeverArm {
    /// Roots of the eigenvalues of `G`, the largest first: r.m.s. motion of the end of a lever arm of
    /// 1 m along each axis, m.
    pub singular_values: Vector3<f64>,
    /// The axes in body axes, as columns.
    pub axes: Matrix3<f64>,
    /// Number of axes along which the lever arm is determined.
    pub rank: usize,
}

impl LeverArm {
    /// Computes the axes for attitudes `C_b^n` at equal intervals; `None` without any.
    pub fn of(attitudes: &[UnitQuaternion<f64>]) -> Option<Self> {
        let count = attitudes.len() as f64;
        let matrices = || attitudes.iter().map(|c| c.to_rotation_matrix().into_inner());
        let mean = matrices().sum::<Matrix3<f64>>() / count;
        let scatter = matrices().map(|c| (c - mean).transpose() * (c - mean));
        let scatter = scatter.sum::<Matrix3<f64>>() / count;
        let (values, axes) = (!attitudes.is_empty()).then(|| eigen(scatter))?;
        let singular_values = values.map(|v| v.max(0.0).sqrt());
        let rank = singular_values.iter().filter(|s| **s > LEAST).count();
        Some(Self { singular_values, axes, rank })
    }

    /// 1-sigma of the lever arm along each axis, m, of `fixes` positions of a 1-sigma `sigma`, m, if the
    /// motion of the IMU is known but for a constant; infinite along an axis that is not determined.
    pub fn sigma(&self, sigma: f64, fixes: usize) -> Vector3<f64> {
        let each = sigma / (fixes.max(1) as f64).sqrt();
        self.singular_values.map(|s| if s > LEAST { each / s } else { f64::INFINITY })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use std::f64::consts::TAU;

    /// Attitudes around a full circle of heading, with a roll that swings three times on the way.
    fn circle(roll: f64) -> LeverArm {
        let attitude = |k: u32| {
            let angle = TAU * f64::from(k) / 360.0;
            UnitQuaternion::from_euler_angles(roll * (3.0 * angle).sin(), 0.0, angle)
        };
        LeverArm::of(&(0..360).map(attitude).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn turns_determine_the_lever_arm_across_their_axis() {
        let still = LeverArm::of(&[UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3); 9]).unwrap();
        assert_eq!((still.rank, LeverArm::of(&[])), (0, None));
        // a full circle moves an arm of 1 m across by 1 m r.m.s., and one along the axis not at all
        let flat = circle(0.0);
        assert_eq!(flat.rank, 2);
        assert!((flat.singular_values - Vector3::new(1.0, 1.0, 0.0)).norm() < 1e-6, "{flat:?}");
        assert!(flat.axes.column(2).z.abs() > 1.0 - 1e-6, "{flat:?}");
        // 100 fixes of 1 m: 0.1 m across, nothing along
        let sigma = flat.sigma(1.0, 100);
        assert!((sigma.x - 0.1).abs() < 1e-6 && sigma.z.is_infinite(), "{sigma}");
        // a roll with the amplitude A moves an arm down by A/sqrt(2) sideways
        let banked = circle(0.1);
        assert_eq!(banked.rank, 3);
        assert!((banked.singular_values.z / 0.0707 - 1.0).abs() < 0.02, "{banked:?}");
    }
}
