//! Vectors that turn with an attitude.
//!
//! A velocity in navigation axes that was found by integrating a specific force in body axes has turned with every error of
//! the attitude. Its error is thus resolved in the group of both (right-invariant: Barrau & Bonnabel, IEEE Trans. Autom.
//! Control 62, 2017; Hartley, Ghaffari, Eustice & Grizzle, Int. J. Robotics Research 39, 2020):
//! ```text
//! C = exp([phi x]) C^,   a = exp([phi x]) a^ + J(phi) xi,   delta = xi + phi x a^
//! ```
//! with `J` the left Jacobian of SO(3), `a` the vector from where it is zero, and `delta` what the covariance is about: the
//! error of the vector itself to first order. What body axes see of the vector depends on `xi` alone, so that a correction
//! which moves the estimate does not make the attitude seem observed. An additive error has that fault, and a filter with
//! degrees of initial heading error grows overconfident by it.

use crate::covariance::Covariance;
use crate::manifold::MAX_TANGENT;
use crate::state::{Layout, State};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Where a vector that turns is zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum About {
    /// At zero: a velocity.
    Zero,
    /// Where the filter started: a position.
    Start,
}

/// A block that turns with an attitude.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turning {
    pub vector: usize,
    pub rotation: usize,
    pub about: About,
}

impl Turning {
    /// The vector from where it is zero.
    fn arm(&self, layout: &Layout, state: &State) -> Vector3<f64> {
        let block = &layout.blocks[self.vector];
        let values = &state.values[block.range()];
        let mut arm = [0.0; 3];
        match self.about {
            About::Zero => (block.operations.coordinates)(values, &mut arm),
            About::Start => (block.operations.local)(values, &state.origin[block.range()], &mut arm),
        }
        arm.into()
    }
}

/// `exp([phi x]) - I` and the left Jacobian of SO(3).
fn turn(phi: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let exp = Rotation3::new(*phi);
    let angle = phi.norm();
    let skew = phi.cross_matrix();
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        (2.0 * ((0.5 * angle).sin() / angle).powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    let jacobian = Matrix3::identity() + skew * a + skew * skew * b;
    // J phi x = exp - I, which keeps the digits of a small angle
    debug_assert!((jacobian * skew - (exp.matrix() - Matrix3::identity())).norm() < 1e-12);
    (jacobian * skew, jacobian)
}

impl Layout {
    /// Injects a correction of the error state into the estimated blocks, and moves the covariance to the error about the
    /// new estimate.
    pub(crate) fn inject(&self, state: &mut State, delta: &mut [f64], covariance: &mut Covariance) {
        let turns = |t: &&Turning| self.blocks[t.vector].estimated() && self.blocks[t.rotation].estimated();
        // the correction along the group, as each block's own
        for t in self.turning.iter().filter(turns) {
            let (v, r) = (self.blocks[t.vector].tangent_range(), self.blocks[t.rotation].tangent_range());
            let phi = Vector3::from_column_slice(&delta[r]);
            let given = Vector3::from_column_slice(&delta[v.clone()]);
            let arm = t.arm(self, state);
            let (turned, jacobian) = turn(&phi);
            let moved = turned * arm + jacobian * (given - phi.cross(&arm));
            delta[v].copy_from_slice(moved.as_slice());
        }
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        for block in self.blocks.iter().filter(|b| b.estimated()) {
            let range = block.tangent_range();
            let delta = &delta[range.clone()];
            (block.operations.retract)(&mut state.values[block.range()], delta);
            if (block.operations.reset)(delta, &mut jacobian) {
                covariance.transform(range, &jacobian);
            }
        }
        // xi stays: delta' = xi + phi' x a', where phi' = J phi by the reset of the attitude
        for t in self.turning.iter().filter(turns) {
            let (v, r) = (self.blocks[t.vector].tangent_range(), self.blocks[t.rotation].tangent_range());
            let phi = Vector3::from_column_slice(&delta[r.clone()]);
            let moved = Vector3::from_column_slice(&delta[v.clone()]);
            let (_, jacobian) = turn(&phi);
            let Some(inverse) = jacobian.try_inverse() else { continue };
            let now = t.arm(self, state);
            let shear = (now - moved).cross_matrix() * inverse - now.cross_matrix();
            covariance.shear(v, r, &shear);
        }
    }

    /// The error of an estimate that its covariance is about, `truth [-] estimate`: one number a tangent component. Blocks that
    /// are not `known` have none; a vector then turns with no attitude.
    pub fn error(&self, truth: &State, estimate: &State, known: &[bool], out: &mut [f64]) {
        out.fill(0.0);
        let uncertain = |slot: usize| known[slot] && self.blocks[slot].tangent.is_some();
        for (_, block) in self.blocks.iter().enumerate().filter(|(slot, _)| uncertain(*slot)) {
            let (to, from) = (&truth.values[block.range()], &estimate.values[block.range()]);
            (block.operations.local)(to, from, &mut out[block.tangent_range()]);
        }
        for t in self.turning.iter().filter(|t| uncertain(t.vector) && uncertain(t.rotation)) {
            let (v, r) = (self.blocks[t.vector].tangent_range(), self.blocks[t.rotation].tangent_range());
            let phi = Vector3::from_column_slice(&out[r]);
            let moved = Vector3::from_column_slice(&out[v.clone()]);
            let arm = t.arm(self, estimate);
            let (turned, jacobian) = turn(&phi);
            if let Some(inverse) = jacobian.try_inverse() {
                let delta = inverse * (moved - turned * arm) + phi.cross(&arm);
                out[v].copy_from_slice(delta.as_slice());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::calibration::display;
    use crate::compose::Composer;
    use crate::covariance::Update;
    use crate::manifold::{Position, Rotation, Vector};
    use crate::simulate::Random;
    use crate::state::{BlockSpec, Display, Dynamics, Mode};
    use crate::time::Time;
    use nalgebra::{DMatrix, Vector6};

    /// Attitude, velocity and position, of which the last two turn with the first or do not.
    fn layout(turns: bool) -> Layout {
        let mut composer = Composer::default();
        composer.begin("ins");
        let spec = |display: Display| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: vec![1.0; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        let attitude = composer.block::<Rotation>("attitude", spec(display::ANGLES)).expect("a block");
        let velocity = composer.block::<Vector<3>>("velocity", spec(display::VELOCITY)).expect("a block");
        let position = composer.block::<Position>("position", spec(display::POSITION)).expect("a block");
        if turns {
            composer.turns_with(velocity, attitude, About::Zero);
            composer.turns_with(position, attitude, About::Start);
        }
        composer.finish().0
    }

    fn displaced(layout: &Layout, state: &State, random: &mut Random, sizes: [f64; 3]) -> State {
        let mut moved = state.clone();
        moved.time = Time::default();
        for (block, size) in layout.blocks.iter().zip(sizes) {
            let delta: Vec<f64> = (0..3).map(|_| size * random.normal()).collect();
            (block.operations.retract)(&mut moved.values[block.range()], &delta);
        }
        moved
    }

    #[test]
    fn injecting_the_error_of_an_estimate_gives_the_truth() {
        let layout = layout(true);
        let mut random = Random::new(1, "turning");
        for _ in 0..200 {
            let start = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
            let mut estimate = displaced(&layout, &start, &mut random, [0.3, 5.0, 1e3]);
            estimate.origin.clone_from(&start.values);
            let truth = displaced(&layout, &estimate, &mut random, [0.4, 3.0, 200.0]);
            let mut delta = [0.0; 9];
            layout.error(&truth, &estimate, &[true; 3], &mut delta);
            let mut covariance = Covariance::zero(9);
            (0..9).for_each(|i| covariance.set(i, i, 1.0));
            layout.inject(&mut estimate, &mut delta, &mut covariance);
            let mut left = [0.0; 9];
            layout.error(&truth, &estimate, &[true; 3], &mut left);
            // rounding of a position of 6e6 m in radians is 1e-9 m
            assert!(left.iter().all(|e| e.abs() < 1e-8), "{left:?}");
        }
    }

    #[test]
    fn a_small_error_is_that_of_each_block() {
        let (turning, plain) = (layout(true), layout(false));
        let mut random = Random::new(2, "turning");
        let estimate = displaced(&turning, &turning.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        let truth = displaced(&turning, &estimate, &mut random, [1e-6, 1e-6, 1e-6]);
        let (mut a, mut b) = ([0.0; 9], [0.0; 9]);
        turning.error(&truth, &estimate, &[true; 3], &mut a);
        plain.error(&truth, &estimate, &[true; 3], &mut b);
        // they differ by half the squared angle times 5 m/s, or times 1 km
        let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 0.5 * 1e-11 * 3e3, "{worst}");
    }

    /// The attitude's covariance after many velocities in body axes, each of which moves the estimate, relative to the prior.
    fn after_body_velocities(turns: bool) -> f64 {
        let layout = layout(turns);
        let mut random = Random::new(3, "turning");
        let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 0.0]);
        let mut covariance = Covariance::zero(9);
        // phi and xi unrelated, so that delta = xi - [v x] phi
        let v = Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
        let phi = Matrix3::from_diagonal_element(0.04);
        let cross = -v.cross_matrix() * phi;
        let velocity = Matrix3::from_diagonal_element(0.25) - cross * v.cross_matrix().transpose();
        for i in 0..3 {
            for j in 0..3 {
                covariance.set(i, j, phi[(i, j)]);
                covariance.set(3 + i, j, cross[(i, j)]);
                covariance.set(3 + i, 3 + j, velocity[(i, j)]);
            }
            covariance.set(6 + i, 6 + i, 1.0);
        }
        let mut update = Update::with_capacity(9, 3);
        for _ in 0..50 {
            let c = Rotation3::from_matrix_unchecked(*state.get(&layout, handle(&layout)).matrix());
            let v = Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
            let to_body = *c.inverse().matrix();
            let h = [to_body * v.cross_matrix(), to_body];
            update.m = 3;
            update.columns = (0..6).collect();
            update.h = (0..3).flat_map(|i| h.map(|h| [h[(i, 0)], h[(i, 1)], h[(i, 2)]]).concat()).collect();
            update.innovation = (0..3).map(|_| 0.5 * random.normal()).collect();
            update.r = DMatrix::from_diagonal_element(3, 3, 0.01).as_slice().to_vec();
            update.innovate(&covariance).expect("S is positive definite");
            update.apply(&mut covariance, &[false; 9]);
            layout.inject(&mut state, &mut update.delta, &mut covariance);
        }
        let sum: Vector6<f64> = Vector6::from_fn(|i, _| covariance.get(i, i));
        sum.fixed_rows::<3>(0).sum() / phi.trace()
    }

    fn handle(layout: &Layout) -> crate::state::Handle<Rotation> {
        assert_eq!(layout.blocks[0].name, "ins.attitude");
        crate::state::Handle { slot: 0, manifold: std::marker::PhantomData }
    }

    #[test]
    fn a_velocity_in_body_axes_never_tells_the_attitude() {
        let kept = after_body_velocities(true);
        assert!((kept - 1.0).abs() < 1e-9, "{kept}");
        // without it the same updates pretend to know more
        let pretended = after_body_velocities(false);
        assert!(pretended < 0.5, "{pretended}");
    }
}
