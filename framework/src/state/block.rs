//! State blocks: value, uncertainty and motion of one part of the state.

use crate::state::covariance::standard_deviation;
use crate::state::manifold::{MAX_TANGENT, Operations};
use nalgebra::DMatrix;

/// Treatment of a block by the filter.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    serde::Serialize,
    serde::Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Estimated: part of the error state, corrected by every update.
    #[default]
    Estimate,
    /// Held at its initial value, which counts as exact.
    Fixed,
    /// Held at its initial value, whose uncertainty the other states carry (Schmidt's consider
    /// filter).
    Consider,
}

/// Motion of a block that no process model propagates.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Dynamics {
    /// Constant.
    #[default]
    Constant,
    /// Random walk: power spectral density of the rate along each tangent axis, unit^2/s.
    RandomWalk(Vec<f64>),
    /// First-order Gauss-Markov about the initial value: stationary sigma of each tangent axis,
    /// correlation time in s.
    GaussMarkov {
        /// Stationary sigma of each tangent axis.
        sigma: Vec<f64>,
        /// Correlation time, s.
        time: f64,
    },
}

/// Presentation of a block: SI coordinates divided by `scale` are in `unit`.
#[derive(Clone, Debug, PartialEq)]
pub struct Display {
    /// Unit of sigma and error, such as `deg/h`; empty for a ratio.
    pub unit: &'static str,
    /// SI per `unit`.
    pub scale: f64,
    /// Name of each component: `roll`, `pitch`, `yaw`.
    pub components: &'static [&'static str],
}

/// Specification of a state block: value, uncertainty and motion.
#[derive(Clone, Debug)]
pub struct BlockSpec {
    /// Treatment by the filter.
    pub mode: Mode,
    /// Initial value, in coordinates (SI).
    pub initial: Vec<f64>,
    /// Prior sigma of each *coordinate*, except for a position, where it is of the tangent (SI).
    pub sigma: Vec<f64>,
    /// True value in a simulation, in coordinates (SI).
    pub truth: Option<Vec<f64>>,
    /// Motion.
    pub dynamics: Dynamics,
    /// Presentation.
    pub display: Display,
}

/// A state block with its place in the layout.
#[derive(Clone, Debug)]
pub struct Block {
    /// `owner.name`, such as `dvl.scale`.
    pub name: String,
    /// Specification.
    pub spec: BlockSpec,
    /// Operations of the manifold.
    pub operations: Operations,
    /// Offset of the value in [`crate::state::State::values`].
    pub offset: usize,
    /// Offset of the error in the error state; `None` when fixed.
    pub tangent: Option<usize>,
    /// Set if the truth moves by the dynamics of the block.
    pub wanders: bool,
    /// Place of its label in [`crate::state::State::labels`], if the block comes and goes.
    pub label: Option<usize>,
}

impl Block {
    /// Range of the value in [`crate::state::State::values`].
    pub fn range(&self) -> std::ops::Range<usize> {
        self.offset..self.offset + self.operations.ambient
    }

    /// Range of the error in the error state, empty when fixed.
    pub fn tangent_range(&self) -> std::ops::Range<usize> {
        self.tangent.map_or(0..0, |t| t..t + self.operations.tangent)
    }

    /// Returns `true` if updates correct the block.
    pub fn estimated(&self) -> bool {
        self.tangent.is_some() && self.spec.mode == Mode::Estimate
    }

    /// Name of a component of sigma and error, or its number where it has none.
    pub fn component(&self, k: usize) -> String {
        let names = match self.operations.reading {
            crate::state::manifold::Reading::Tangent => &["north", "east", "down"],
            _ => self.spec.display.components,
        };
        names.get(k).map_or_else(|| k.to_string(), |name| (*name).to_owned())
    }

    /// Coordinates in the display unit; latitude and longitude in degrees.
    pub fn show(&self, values: &[f64], out: &mut [f64]) {
        let n = self.operations.tangent;
        (self.operations.coordinates)(&values[self.range()], &mut out[..n]);
        if self.operations.kind == std::any::TypeId::of::<crate::state::manifold::Position>() {
            out[0] = out[0].to_degrees();
            out[1] = out[1].to_degrees();
        } else {
            out[..n].iter_mut().for_each(|x| *x /= self.spec.display.scale);
        }
    }

    /// 1-sigma of the components in the display unit; zero when fixed, NaN when absent.
    pub fn show_sigma(
        &self,
        values: &[f64],
        covariance: &crate::state::covariance::Covariance,
        out: &mut [f64],
    ) {
        let [shown] = self.show_sigmas(values, [covariance]);
        let n = self.operations.tangent;
        out[..n].copy_from_slice(&shown[..n]);
    }

    /// [`Self::show_sigma`] of several covariances about the same value.
    pub fn show_sigmas<const K: usize>(
        &self,
        values: &[f64],
        covariances: [&crate::state::covariance::Covariance; K],
    ) -> [[f64; MAX_TANGENT]; K] {
        let n = self.operations.tangent;
        let Some(t) = self.tangent else { return [[0.0; MAX_TANGENT]; K] };
        if self.label.is_some() && values[self.offset].is_nan() {
            return [[f64::NAN; MAX_TANGENT]; K];
        }
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        let curved = self.coordinate_jacobian(values, &mut jacobian);
        covariances.map(|covariance| {
            let mut out = [0.0; MAX_TANGENT];
            for (i, out) in out[..n].iter_mut().enumerate() {
                let variance = match curved {
                    true => variance(&jacobian[n * i..n * i + n], covariance, t),
                    false => covariance.get(t + i, t + i),
                };
                *out = standard_deviation(variance) / self.spec.display.scale;
            }
            out
        })
    }

    /// Derivative, with respect to the error, of the components whose 1-sigma
    /// [`Self::show_sigma`] gives, in SI: row-major, one row for each component.
    pub fn shown_jacobian(&self, values: &[f64]) -> [f64; MAX_TANGENT * MAX_TANGENT] {
        let n = self.operations.tangent;
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        if !self.coordinate_jacobian(values, &mut jacobian) {
            jacobian[..n * n].fill(0.0);
            (0..n).for_each(|i| jacobian[n * i + i] = 1.0);
        }
        jacobian
    }

    /// Estimate minus reference in the display unit.
    pub fn show_error(&self, estimate: &[f64], reference: &[f64], out: &mut [f64]) {
        self.show_difference(&estimate[self.range()], &reference[self.range()], out);
    }

    /// As [`Self::show_error`] for values of this block alone.
    pub(crate) fn show_difference(&self, estimate: &[f64], reference: &[f64], out: &mut [f64]) {
        use crate::state::manifold::Reading;
        let n = self.operations.tangent;
        if self.operations.reading == Reading::Tangent {
            (self.operations.local)(estimate, reference, &mut out[..n]);
        } else {
            let mut r = [0.0; MAX_TANGENT];
            (self.operations.coordinates)(estimate, &mut out[..n]);
            (self.operations.coordinates)(reference, &mut r[..n]);
            for (e, r) in out[..n].iter_mut().zip(&r) {
                *e -= r;
                if self.operations.reading == Reading::Angles {
                    *e -= std::f64::consts::TAU * (*e / std::f64::consts::TAU).round();
                }
            }
        }
        out[..n].iter_mut().for_each(|x| *x /= self.spec.display.scale);
    }

    /// Prior covariance of the tangent about the given value.
    pub fn prior(&self, values: &[f64]) -> DMatrix<f64> {
        let n = self.operations.tangent;
        let diagonal =
            DMatrix::from_fn(n, n, |i, j| if i == j { self.spec.sigma[i].powi(2) } else { 0.0 });
        if self.operations.reading != crate::state::manifold::Reading::Angles {
            return diagonal;
        }
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        let curved = self.coordinate_jacobian(values, &mut jacobian);
        let jacobian = || DMatrix::from_row_slice(n, n, &jacobian[..n * n]);
        match curved.then(jacobian).and_then(|jacobian| jacobian.try_inverse()) {
            Some(inverse) => &inverse * diagonal * inverse.transpose(),
            None => diagonal,
        }
    }

    /// Derivative of the coordinates with respect to the tangent, row-major. Returns `false` where
    /// it is the identity, where sigma refers to the tangent, and at a pitch of 90 deg, where roll
    /// and yaw are one angle; the sigma of the tangent then stands for that of the angles.
    fn coordinate_jacobian(&self, values: &[f64], jacobian: &mut [f64]) -> bool {
        use crate::state::manifold::Reading;
        // at 1e6 the pitch is within 0.2 arc seconds of 90 deg
        let largest = match self.operations.reading {
            Reading::Tangent => return false,
            _ if self.operations.flat => return false,
            Reading::Angles => 1e6,
            Reading::Coordinates => f64::MAX,
        };
        let n = self.operations.tangent;
        (self.operations.coordinate_jacobian)(&values[self.range()], jacobian);
        jacobian[..n * n].iter().all(|j| j.abs() <= largest)
    }
}

/// Variance of `g x`, with `g` a row of a Jacobian and `x` the error states from `first` on.
fn variance(g: &[f64], covariance: &crate::state::covariance::Covariance, first: usize) -> f64 {
    let mut variance = 0.0;
    for (a, &ga) in g.iter().enumerate().filter(|(_, g)| **g != 0.0) {
        for (b, &gb) in g.iter().enumerate().filter(|(_, g)| **g != 0.0) {
            variance += ga * gb * covariance.get(first + a, first + b);
        }
    }
    variance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::manifold::{Manifold, Rotation, Vector};
    use std::f64::consts::{PI, TAU};

    /// A block of three components, in units of 0.5.
    fn block<M: Manifold>() -> Block {
        Block {
            name: "b".to_owned(),
            spec: BlockSpec {
                mode: Mode::Estimate,
                initial: vec![0.0; 3],
                sigma: vec![1.0; 3],
                truth: None,
                dynamics: Dynamics::Constant,
                display: Display { unit: "", scale: 0.5, components: &[] },
            },
            operations: Operations::of::<M>(),
            offset: 0,
            tangent: Some(0),
            wanders: false,
            label: None,
        }
    }

    /// The numbers of the value that has these coordinates.
    fn values(block: &Block, coordinates: [f64; 3]) -> Vec<f64> {
        let mut ambient = vec![0.0; block.operations.ambient];
        (block.operations.from_coordinates)(&coordinates, &mut ambient);
        ambient
    }

    /// The error of an estimate that has these coordinates.
    fn shown<M: Manifold>(estimate: [f64; 3], reference: [f64; 3]) -> [f64; 3] {
        let block = block::<M>();
        let values = |coordinates| values(&block, coordinates);
        let mut error = [0.0; 3];
        block.show_error(&values(estimate), &values(reference), &mut error);
        error
    }

    /// A heading of 3 rad is 6 - 2 pi = -0.28 rad from one of -3 rad. A quaternion holds an angle
    /// to some 1e-15.
    #[test]
    fn an_error_of_angles_is_within_half_a_turn_and_one_of_a_length_is_not() {
        let angles = shown::<Rotation>([0.1, 0.2, 3.0], [0.0, 0.3, -3.0]);
        let expected = [0.2, -0.2, 2.0 * (6.0 - TAU)];
        assert!(angles.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{angles:?}");
        let lengths = shown::<Vector<3>>([PI + 1.0, -7.0, 0.0], [0.0, 7.0, 2.0]);
        assert_eq!(lengths, [2.0 * (PI + 1.0), -28.0, -4.0]);
    }

    /// Roll and yaw are one angle at a pitch of 90 deg.
    #[test]
    fn where_the_angles_are_singular_the_components_shown_are_those_of_the_error() {
        let block = block::<Rotation>();
        let of = |pitch: f64| block.shown_jacobian(&values(&block, [0.3, pitch, 0.7]));
        let mut identity = [0.0; MAX_TANGENT * MAX_TANGENT];
        (0..3).for_each(|i| identity[4 * i] = 1.0);
        assert_eq!(of(PI / 2.0), identity);
        assert_ne!(of(0.5), identity);
    }
}
