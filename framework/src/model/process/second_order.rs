//! The second order of an error, which the linear model of a process neglects.
//!
//! It is the same for all samples as long as the error stays, so that no number of samples averages it. What it
//! acts along can therefore never be known better, at a given error, than the root of its mean square. Where the
//! covariance has less, noise of the state makes up the difference, before the next step. It ends by itself once the
//! error is known.

use crate::checkpoint::saved;
use crate::state::covariance::{Covariance, NoiseSlot, Transition};
use crate::state::manifold::{Manifold, Rotation};
use crate::state::{Handle, Layout, State};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// The second order of the error of an attitude, and the states that take it for their own.
#[derive(Clone, Copy, Debug)]
pub struct SecondOrder {
    /// Least variance of the tilt so far.
    least: f64,
    /// Set if the last step had noise.
    active: bool,
    /// Covariance of the horizontal position that was added for the way, as far as the corrections have left it, and
    /// the whole one after it was added.
    added: [Matrix2<f64>; 2],
    /// First columns of the attitude and of the states in the error state.
    columns: [usize; 2],
    noise: NoiseSlot<3>,
    term: Term,
}

#[derive(Clone, Copy, Debug)]
enum Term {
    Force { attitude: Handle<Rotation>, magnitude: f64 },
    Way,
}

saved!(SecondOrder { least, active, added } except { columns, noise, term });

impl SecondOrder {
    /// A vertical force of that magnitude, SI, in the axes from which `attitude` maps to north, east, down, and
    /// a bias in these axes.
    ///
    /// A tilt `t = (t_N, t_E)` takes `g |t|^2 / 2` off the vertical component, which the filter takes for a bias: 0.8
    /// deg make 0.1 mg. For a Gaussian tilt of the covariance `P_t` its mean square is
    /// ```text
    /// s^2 = E[(g |t|^2 / 2)^2] = g^2 ((tr P_t)^2 + 2 tr P_t^2) / 4
    /// ```
    /// 0.02 deg leave 0.17 ug. `columns` are the first ones of attitude and bias in the error state.
    pub fn of_tilt(
        transition: &mut Transition,
        attitude: Handle<Rotation>,
        columns: [usize; 2],
        magnitude: f64,
    ) -> Self {
        Self::new(transition, columns, Term::Force { attitude, magnitude })
    }

    /// The way that the filter has made with a heading.
    ///
    /// A heading error `e` turns the way `d` across by `d e`, and back along it by `d e^2 / 2`: 5 deg take 4 m off a
    /// kilometre. The mean square of the latter is `3 d^2 P_e^2 / 4`. The covariance has the way since the position was
    /// known, `d = |P_pe| / P_e`. It is no part of the linear error, so that it adds to its variance; a correction that
    /// leaves the share `a` of the position's error leaves `a^2` of what was added, and of `d^2`. `columns` are the
    /// first ones of attitude and position in the error state.
    pub fn of_heading(transition: &mut Transition, columns: [usize; 2]) -> Self {
        Self::new(transition, columns, Term::Way)
    }

    fn new(transition: &mut Transition, columns: [usize; 2], term: Term) -> Self {
        let noise = transition.doubt(columns[1]);
        let added = [Matrix2::zeros(); 2];
        Self { least: f64::INFINITY, active: false, added, columns, noise, term }
    }

    /// The mean square of the second order of a force of that magnitude, from the traces of the covariance of
    /// the tilt and of its square.
    pub fn mean_square(magnitude: f64, trace: f64, of_square: f64) -> f64 {
        0.25 * magnitude * magnitude * (trace * trace + 2.0 * of_square)
    }

    /// Writes the noise of a step that begins at an estimate; none without an estimate.
    pub(crate) fn fill(
        &mut self,
        layout: &Layout,
        estimate: Option<(&State, &Covariance)>,
        transition: &mut Transition,
    ) {
        if estimate.is_none() && !self.active {
            return;
        }
        let missing = estimate.and_then(|(state, covariance)| match self.term {
            Term::Force { attitude, magnitude } => {
                let block = &layout.blocks[attitude.slot()];
                let attitude = Rotation::load::<f64>(&state.values[block.range()]);
                self.force(magnitude, &attitude.matrix().row(2).transpose(), covariance)
            }
            Term::Way => self.way(covariance),
        });
        self.active = missing.is_some();
        transition.set_noise(self.noise, &missing.unwrap_or_default());
    }

    /// Missing covariance of a bias.
    fn force(
        &mut self,
        magnitude: f64,
        down: &Vector3<f64>,
        covariance: &Covariance,
    ) -> Option<Matrix3<f64>> {
        let [tilt, bias] = self.columns;
        let p = |i, j| covariance.get(i, j);
        let tilts = Matrix2::from_fn(|i, j| p(tilt + i, tilt + j));
        self.least = self.least.min(tilts.trace());
        // the bridge of a fault adds to the tilt, for a short time and when the bias is known already
        let share = (GROWN * self.least / tilts.trace()).min(1.0);
        let square = share * share * (tilts * tilts).trace();
        let least = Self::mean_square(magnitude, share * tilts.trace(), square);
        let biases = Matrix3::from_fn(|i, j| p(bias + i, bias + j));
        // most samples find a bias that is less known than the tilt allows
        if least < LEAST * biases.trace() {
            return None;
        }
        let both = Vector2::from_fn(|k, _| (0..3).map(|i| down[i] * p(bias + i, tilt + k)).sum());
        let given_tilt = down.dot(&(biases * *down)) - both.dot(&(tilts.try_inverse()? * both));
        let missing = least - given_tilt.max(0.0);
        (missing > 0.0).then(|| down * down.transpose() * missing)
    }

    /// Missing covariance of a position.
    fn way(&mut self, covariance: &Covariance) -> Option<Matrix3<f64>> {
        let [heading, position] = [self.columns[0] + 2, self.columns[1]];
        let p = |i, j| covariance.get(i, j);
        let positions = Matrix2::from_fn(|i, j| p(position + i, position + j));
        let across = Vector2::from_fn(|i, _| p(position + i, heading));
        // 3 d^2 P_e^2 / 4 with d = |P_pe| / P_e
        let least = 0.75 * across.norm_squared();
        let [added, after] = &mut self.added;
        if least < LEAST * positions.trace() {
            *added = Matrix2::zeros();
            return None;
        }
        let along = Vector2::new(across.y, -across.x).normalize();
        let of = |matrix: &Matrix2<f64>| along.dot(&(matrix * along));
        *added *= (of(&positions) / of(after)).min(1.0).powi(2);
        *after = positions;
        let missing = least - of(added);
        if missing < WAITS * of(after) {
            return None;
        }
        let noise = along * along.transpose() * missing;
        *added += noise;
        *after += noise;
        Some(noise.fixed_resize(0.0))
    }
}

/// Growth of the variance of the tilt above its least value that counts.
const GROWN: f64 = 2.0;

/// Share of the variance along the way below which what adds to it waits for more: 5e-5 in sigma.
const WAITS: f64 = 1e-4;

/// Share of a variance below which the second order is not compared. Rounding leaves a part of a variance that is
/// as small no digits.
const LEAST: f64 = 1e-12;

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::Composer;
    use crate::state::manifold::{Position, Vector};

    use crate::model::simulate::Random;
    use crate::state::{BlockSpec, Dynamics, Mode, display};
    use nalgebra::Rotation3;

    const G: f64 = 9.8;

    /// A vehicle that rolls by 40 deg, its bias, and its position.
    fn vehicle() -> ([SecondOrder; 2], Layout, Transition) {
        let mut composer = Composer::default();
        composer.begin("test");
        let spec = |initial: Vec<f64>, display| BlockSpec {
            mode: Mode::Estimate,
            initial,
            sigma: vec![1.0; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        let attitude = spec(vec![0.7, 0.1, 2.0], display::ANGLES);
        let attitude = composer.block::<Rotation>("attitude", attitude).expect("a block");
        let bias = spec(vec![0.0; 3], display::ACCEL_BIAS);
        composer.block::<Vector<3>>("bias", bias).expect("a block");
        let position = spec(vec![0.7, 0.1, 0.0], display::POSITION);
        composer.block::<Position>("position", position).expect("a block");
        let tilted = SecondOrder::of_tilt(composer.transition(), attitude, [0, 3], G);
        let turned = SecondOrder::of_heading(composer.transition(), [0, 6]);
        let (layout, transition, _) = composer.finish();
        ([tilted, turned], layout, transition)
    }

    /// Covariance of tilts of that sigma, and of a bias whose axes have that sigma at a given tilt.
    fn covariance(tilt: f64, bias: f64) -> Covariance {
        let mut covariance = Covariance::zero(9);
        (0..2).for_each(|i| covariance.set(i, i, tilt * tilt));
        covariance.set(2, 2, 0.01);
        (3..6).for_each(|i| covariance.set(i, i, bias * bias));
        covariance
    }

    /// Variance of the bias along the vertical once the noise of a step was added.
    fn widened(tilt: f64, bias: f64) -> f64 {
        let ([mut tilted, _], layout, mut transition) = vehicle();
        let (state, mut covariance) = (layout.initial_state(), covariance(tilt, bias));
        tilted.fill(&layout, Some((&state, &covariance)), &mut transition);
        transition.add_noise(&mut covariance);
        let down = Rotation3::from_euler_angles(0.7, 0.1, 2.0).matrix().row(2).transpose();
        let p = Matrix3::from_fn(|i, j| covariance.get(3 + i, 3 + j));
        down.dot(&(p * down))
    }

    /// Many samples have measured what is left of the vertical force. The mean of 4000 squares of a quarter of a
    /// chi-square of 2 has a sigma of sqrt((4! - 2^2) / 2^2 / 4000) = 0.035 of itself; 3.5 sigma.
    #[test]
    fn a_bias_under_an_unknown_tilt_is_as_uncertain_as_the_tilt_makes_it() {
        let tilt = 0.0175;
        let mut random = Random::new(3, "tilt");
        let square = |_| {
            let (north, east) = (tilt * random.normal(), tilt * random.normal());
            let left = Rotation3::new(Vector3::new(north, east, 0.0)) * Vector3::new(0.0, 0.0, G);
            (G - left.z).powi(2)
        };
        let mean = (0..4000).map(square).sum::<f64>() / 4000.0;
        let variance = widened(tilt, 1e-7);
        assert!((mean / variance - 1.0).abs() < 3.5 * 0.035, "{mean} {variance}");
    }

    /// A tilt of 1 mrad leaves 14 um/s^2.
    #[test]
    fn a_bias_that_is_less_known_than_the_tilt_allows_stays_as_it_is() {
        assert!((widened(1e-3, 2e-5) - 4e-10).abs() < 1e-20);
        let least = 2.0 * (G * 1e-6_f64).powi(2);
        assert!((widened(1e-3, 1e-6) / least - 1.0).abs() < 1e-9);
    }

    /// Between two corrections the covariance is that of the step before.
    #[test]
    fn the_noise_is_added_once() {
        let ([mut tilted, _], layout, mut transition) = vehicle();
        let (state, covariance) = (layout.initial_state(), covariance(0.01, 1e-7));
        tilted.fill(&layout, Some((&state, &covariance)), &mut transition);
        assert!(transition.noise_dense(9).iter().any(|q| *q > 0.0));
        tilted.fill(&layout, None, &mut transition);
        assert!(transition.noise_dense(9).iter().all(|q| *q == 0.0));
    }

    /// A way of 1000 m to the north-east was made with a heading known to 5 deg. The mean of 4000 fourth powers of a
    /// Gaussian has a sigma of sqrt((105 - 9) / 9 / 4000) = 0.052 of itself; 3.5 sigma.
    #[test]
    fn a_way_made_with_an_unknown_heading_is_as_uncertain_along_as_the_heading_makes_it() {
        let (sigma, way) = (5_f64.to_radians(), 1000.0);
        let ([_, mut turned], layout, mut transition) = vehicle();
        let mut covariance = Covariance::zero(9);
        covariance.set(2, 2, sigma * sigma);
        // to the north-west, across the way
        let across = [-0.5_f64.sqrt() * way, 0.5_f64.sqrt() * way];
        for (i, a) in across.iter().enumerate() {
            covariance.set(6 + i, 2, a * sigma * sigma);
            for (j, b) in across.iter().enumerate() {
                covariance.set(
                    6 + i,
                    6 + j,
                    a * b * sigma * sigma + if i == j { 0.01 } else { 0.0 },
                );
            }
        }
        let state = layout.initial_state();
        turned.fill(&layout, Some((&state, &covariance)), &mut transition);
        transition.add_noise(&mut covariance);
        let p = Matrix2::from_fn(|i, j| covariance.get(6 + i, 6 + j));
        let along = Vector2::repeat(0.5_f64.sqrt());
        let variance = along.dot(&(p * along));
        let mut random = Random::new(4, "heading");
        let square = |_| (way * (1.0 - (sigma * random.normal()).cos())).powi(2);
        let mean = (0..4000).map(square).sum::<f64>() / 4000.0;
        assert!((mean / variance - 1.0).abs() < 3.5 * 0.052, "{mean} {variance}");
        let other = Vector2::new(-0.5_f64.sqrt(), 0.5_f64.sqrt());
        let across = other.dot(&(p * other)) / (way * sigma).powi(2);
        assert!((across - 1.0).abs() < 1e-4, "{across}");
    }

    /// While zeros of the IMU are bridged, the tilt is unknown for a moment: 10 times as wide, it counts as sqrt(2) times.
    #[test]
    fn a_tilt_that_grows_for_a_moment_does_not_lose_the_bias() {
        let ([mut tilted, _], layout, mut transition) = vehicle();
        let state = layout.initial_state();
        let mut added = |tilt: f64| {
            let covariance = covariance(tilt, 1e-9);
            tilted.fill(&layout, Some((&state, &covariance)), &mut transition);
            transition.noise_dense(9).trace()
        };
        let first = added(1e-3);
        assert!((added(1e-2) / first - 4.0).abs() < 1e-6);
        assert!((added(1e-3) / first - 1.0).abs() < 1e-12);
    }
}
