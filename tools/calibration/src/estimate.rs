//! Result of a method.

use nalgebra::{Matrix4, Vector3};
use navfuse_segments::Mounting;

/// Estimate from the samples up to one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntermediateEstimate {
    /// Time, s on the recording's clock.
    pub time: f64,
    /// Estimate from the samples up to that time.
    pub mounting: Mounting,
}

/// Result of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Scale factor and misalignment.
    pub mounting: Mounting,
    /// Covariance of `k` and of the rotation vector `δ` in instrument axes, rad; the true `C_b^d`
    /// is `exp(δ x)` times the estimate. `None` if the method has none.
    pub covariance: Option<Matrix4<f64>>,
    /// Flags of `k`, roll, pitch and yaw; a component that is not determined keeps its initial
    /// value.
    pub determined: [bool; 4],
    /// Estimate over time, if the method has one.
    pub history: Vec<IntermediateEstimate>,
    /// Times of the first and the last used sample, s on the recording's clock.
    pub used: [f64; 2],
    /// Notes for the user.
    pub notes: Vec<String>,
}

impl Estimate {
    /// Limits of the settled estimate: deviation from the final value of `k`, and of yaw in rad.
    pub const SETTLED: (f64, f64) = (2e-3, 0.1 * std::f64::consts::PI / 180.0);

    /// Returns `k` (1) and roll, pitch and yaw (rad).
    pub fn values(&self) -> [f64; 4] {
        let a = self.mounting.angles();
        [self.mounting.k, a.x, a.y, a.z]
    }

    /// Returns the 1-sigma of `k` (1) and of roll, pitch and yaw (rad); `None` if the method has
    /// none.
    pub fn sigma(&self) -> Option<[f64; 4]> {
        let p = self.covariance?;
        // Jacobian of the Euler angles by the rotation vector: central differences, exact to 1e-10
        let d = 1e-5;
        let turned = |axis: usize, by: f64| {
            let mut v = Vector3::zeros();
            v[axis] = by;
            crate::solve::moved(&self.mounting, 0.0, &v).angles()
        };
        let mut j = Matrix4::identity();
        for axis in 0..3 {
            let column = (turned(axis, d) - turned(axis, -d)) / (2.0 * d);
            (0..3).for_each(|i| j[(i + 1, axis + 1)] = column[i]);
        }
        let p = j * p * j.transpose();
        Some(std::array::from_fn(|i| p[(i, i)].max(0.0).sqrt()))
    }

    /// Returns the error of `k` (1) and of roll, pitch and yaw (rad).
    pub fn error(&self, truth: &Mounting) -> [f64; 4] {
        let t = truth.angles();
        let (e, t) = (self.values(), [truth.k, t.x, t.y, t.z]);
        std::array::from_fn(|i| e[i] - t[i])
    }

    /// Returns the time from the first used sample until `k` and yaw stay within [`Self::SETTLED`]
    /// of their final values, s. `None` without a history.
    pub fn settled_after(&self) -> Option<f64> {
        let end = self.history.last()?;
        let off = |s: &IntermediateEstimate| {
            (s.mounting.k - end.mounting.k).abs() > Self::SETTLED.0
                || (s.mounting.angles().z - end.mounting.angles().z).abs() > Self::SETTLED.1
        };
        let last = self
            .history
            .iter()
            .rposition(off)
            .map_or(self.history[0].time, |k| self.history[k + 1].time);
        Some(last - self.used[0])
    }
}
