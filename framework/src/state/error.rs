//! Error injection and reset, and the error of a velocity that turns with the heading.
//!
//! A velocity in navigation axes that results from integrating specific force in body axes turns
//! with every error of the heading. Its error is therefore resolved in the group of both
//! (right-invariant error: Barrau & Bonnabel, IEEE Trans. Autom. Control 62, 2017; Hartley,
//! Ghaffari, Eustice & Grizzle, Int. J. Robotics Research 39, 2020):
//! ```text
//! v = exp([psi x]) v^ + J(psi) xi,   delta = xi + psi x v^,   psi = (0, 0, phi_D)
//! ```
//! Here `J` is the left Jacobian of SO(3), and the covariance refers to `delta`, which to first
//! order is the error of the velocity itself. The velocity in body axes depends on `xi` alone, so
//! that a correction of the estimate does not make the heading appear observed. An additive error
//! has that fault: with degrees of initial heading error it makes the filter overconfident. Only
//! the vertical axis turns. Gravity observes the other two axes, and turning them would make a
//! filter that is aided by depth alone overconfident.

use crate::state::carried::Back;
use crate::state::covariance::Covariance;
use crate::state::layout::Turning;
use crate::state::manifold::{MAX_TANGENT, left_jacobian};
use crate::state::{Layout, State, vectorised};
use nalgebra::{Matrix3, Vector3};

impl Turning {
    fn velocity(&self, layout: &Layout, state: &State) -> Vector3<f64> {
        let block = &layout.blocks[self.velocity];
        let mut v = [0.0; 3];
        (block.operations.coordinates)(&state.values[block.range()], &mut v);
        v.into()
    }

    /// Change of the velocity by an error `delta` of it and an error of the heading.
    fn moved(&self, layout: &Layout, state: &State, delta: &[f64], heading: f64) -> Vector3<f64> {
        let psi = Vector3::new(0.0, 0.0, heading);
        let given = Vector3::from_column_slice(delta);
        let velocity = self.velocity(layout, state);
        let (turned, jacobian) = turn(&psi);
        turned * velocity + jacobian * (given - psi.cross(&velocity))
    }
}

/// `exp([phi x]) - I`, computed without cancellation for small angles, and the left Jacobian of
/// SO(3).
fn turn(phi: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let jacobian = left_jacobian(phi);
    (jacobian * phi.cross_matrix(), jacobian)
}

/// Columns that [`turn_rows`] takes at once.
const COLUMNS: usize = 8;

/// `G = J G` in place, for the rows of one block; `j` and `g` are row-major.
#[inline(always)]
fn turn_rows(j: &[f64], g: &mut [f64], stride: usize) {
    for from in (0..stride).step_by(COLUMNS) {
        let count = COLUMNS.min(stride - from);
        let mut turned = [[0.0; COLUMNS]; MAX_TANGENT];
        for (j, turned) in j.chunks_exact(g.len() / stride).zip(&mut turned) {
            for (j, g) in j.iter().zip(g.chunks_exact(stride)) {
                // a whole group is compiled without a loop
                match g[from..].first_chunk::<COLUMNS>() {
                    Some(g) => turned.iter_mut().zip(g).for_each(|(t, g)| *t += j * g),
                    None => turned.iter_mut().zip(&g[from..]).for_each(|(t, g)| *t += j * g),
                }
            }
        }
        for (g, turned) in g.chunks_exact_mut(stride).zip(&turned) {
            g[from..from + count].copy_from_slice(&turned[..count]);
        }
    }
}

impl Layout {
    /// Velocities that turn with the heading when a correction moves both.
    pub(super) fn corrected(&self) -> impl DoubleEndedIterator<Item = &Turning> {
        self.turning
            .iter()
            .filter(|t| self.blocks[t.velocity].estimated() && self.blocks[t.attitude].estimated())
    }

    /// Tangent ranges of the velocities that turn, each with that of its attitude.
    pub(crate) fn headings(
        &self,
    ) -> impl Iterator<Item = (std::ops::Range<usize>, std::ops::Range<usize>)> {
        let range = |slot: usize| self.blocks[slot].tangent_range();
        let turning = self.turning.iter().map(move |t| (range(t.velocity), range(t.attitude)));
        turning.filter(|(velocity, attitude)| !velocity.is_empty() && !attitude.is_empty())
    }

    /// Displaces the values of a state by an error, as [`Self::inject`] does: `to = from [+] delta`.
    /// Considered blocks move too. For a velocity that turns, `delta` receives the actual change.
    pub(crate) fn displace(&self, from: &State, delta: &mut [f64], to: &mut State) {
        to.values.copy_from_slice(&from.values);
        for t in &self.turning {
            let (v, a) =
                (self.blocks[t.velocity].tangent_range(), self.blocks[t.attitude].tangent_range());
            if v.is_empty() || a.is_empty() {
                continue;
            }
            let moved = t.moved(self, from, &delta[v.clone()], delta[a.start + 2]);
            delta[v].copy_from_slice(moved.as_slice());
        }
        for block in &self.blocks {
            let delta = &delta[block.tangent_range()];
            if delta.iter().any(|d| *d != 0.0) {
                (block.operations.retract)(&mut to.values[block.range()], delta);
            }
        }
        self.carry(from, to);
    }

    /// Converts a Jacobian over `columns` (row-major), taken with respect to the error about a state
    /// that [`Self::displace`] gave, into one with respect to `delta`, the error about the state
    /// before: `H G` with the reset `G` of [`Self::inject`]. `delta` is that of
    /// [`Self::displace`], and a velocity that turns has its heading among the columns.
    pub(crate) fn reset_columns(&self, delta: &[f64], columns: &[usize], h: &mut [f64]) {
        let w = columns.len();
        let at = |column: usize| columns.iter().position(|&c| c == column);
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        let mut row = [0.0; MAX_TANGENT];
        for block in self.blocks.iter().filter(|b| b.tangent.is_some()) {
            let (range, n) = (block.tangent_range(), block.operations.tangent);
            let Some(first) = at(range.start) else { continue };
            if !(block.operations.reset)(&delta[range], &mut jacobian) {
                continue;
            }
            for h in h.chunks_exact_mut(w) {
                let h = &mut h[first..first + n];
                for (k, x) in row[..n].iter_mut().enumerate() {
                    *x = (0..n).map(|i| h[i] * jacobian[i * n + k]).sum();
                }
                h.copy_from_slice(&row[..n]);
            }
        }
        for t in self.corrected() {
            let (v, a) =
                (self.blocks[t.velocity].tangent_range(), self.blocks[t.attitude].tangent_range());
            let Some((first, heading)) = at(v.start).zip(at(a.start + 2)) else { continue };
            let by = Vector3::z().cross(&Vector3::from_column_slice(&delta[v]));
            for h in h.chunks_exact_mut(w) {
                h[heading] += (0..3).map(|i| h[first + i] * by[i]).sum::<f64>();
            }
        }
    }

    /// Injects a correction of the error state into the estimated blocks, and moves the covariance
    /// to the error about the new estimate. For a velocity that turns, `delta` receives the actual
    /// change.
    pub(crate) fn inject(&self, state: &mut State, delta: &mut [f64], covariance: &mut Covariance) {
        let places = self.places(state);
        for t in self.corrected() {
            let (v, a) =
                (self.blocks[t.velocity].tangent_range(), self.blocks[t.attitude].tangent_range());
            let moved = t.moved(self, state, &delta[v.clone()], delta[a.start + 2]);
            delta[v.clone()].copy_from_slice(moved.as_slice());
            // xi stays, and delta = xi + psi x v
            covariance.shear(v, a.start + 2, &Vector3::z().cross(&moved));
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
        self.carry_corrected(&places, state, covariance);
    }

    /// Resets the covariance of the error with any other quantity, `G` with one row per state
    /// (row-major, rows of `stride`), to the error about the estimate after the injection of
    /// `delta`. The injection does the same to the filter's own covariance. `delta` must be the one
    /// that [`crate::model::record::Observer::correction`] receives; any other breaks the joint
    /// covariance. The turn of axes that are carried along with the position, the correction over the
    /// distance to the pole, is left out.
    pub fn reset_rows(&self, delta: &[f64], g: &mut [f64], stride: usize) {
        vectorised(
            (self, delta, g, stride),
            #[inline(always)]
            |(layout, delta, g, stride): (&Self, &[f64], &mut [f64], usize)| {
                layout.reset_each_row(delta, g, stride);
            },
        );
    }

    #[inline(always)]
    fn reset_each_row(&self, delta: &[f64], g: &mut [f64], stride: usize) {
        for t in self.corrected() {
            let (v, a) =
                (self.blocks[t.velocity].tangent_range(), self.blocks[t.attitude].tangent_range());
            let by = Vector3::z().cross(&Vector3::from_column_slice(&delta[v.clone()]));
            let row = |row: usize| row * stride..(row + 1) * stride;
            for (v, by) in v.zip(by.iter()) {
                let rows = g.get_disjoint_mut([row(v), row(a.start + 2)]);
                let Ok([to, heading]) = rows else { continue };
                to.iter_mut().zip(heading).for_each(|(to, heading)| *to += by * *heading);
            }
        }
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        for block in self.blocks.iter().filter(|b| b.estimated()) {
            let (first, w) = (block.tangent_range().start, block.operations.tangent);
            if (block.operations.reset)(&delta[first..first + w], &mut jacobian) {
                turn_rows(&jacobian[..w * w], &mut g[first * stride..][..w * stride], stride);
            }
        }
    }

    /// Error of an estimate as its covariance describes it, `truth [-] estimate`: one number per
    /// tangent component. Blocks that are not `known` have none; a velocity then turns with no
    /// heading.
    pub fn error(&self, truth: &State, estimate: &State, known: &[bool], out: &mut [f64]) {
        out.fill(0.0);
        let uncertain = |slot: usize| known[slot] && self.blocks[slot].tangent.is_some();
        let mut back = Back::default();
        for (slot, block) in self.blocks.iter().enumerate().filter(|(slot, _)| uncertain(*slot)) {
            let to = self.true_value(slot, [truth, estimate], known, &mut back);
            let from = &estimate.values[block.range()];
            (block.operations.local)(to, from, &mut out[block.tangent_range()]);
        }
        for t in self.turning.iter().filter(|t| uncertain(t.velocity) && uncertain(t.attitude)) {
            let (v, a) =
                (self.blocks[t.velocity].tangent_range(), self.blocks[t.attitude].tangent_range());
            let psi = Vector3::new(0.0, 0.0, out[a.start + 2]);
            let moved = Vector3::from_column_slice(&out[v.clone()]);
            let velocity = t.velocity(self, estimate);
            let (turned, jacobian) = turn(&psi);
            if let Some(inverse) = jacobian.try_inverse() {
                let delta = inverse * (moved - turned * velocity) + psi.cross(&velocity);
                out[v].copy_from_slice(delta.as_slice());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::Composer;
    use crate::model::simulate::Random;
    use crate::state::covariance::Update;
    use crate::state::display;
    use crate::state::manifold::{Position, Rotation, Vector};
    use crate::state::{BlockSpec, Display, Dynamics, Mode};
    use crate::units::time::Time;
    use nalgebra::{DMatrix, Rotation3, Vector6};

    /// Attitude, velocity and position; the velocity turns with the attitude or does not.
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
        let attitude =
            composer.block::<Rotation>("attitude", spec(display::ANGLES)).expect("a block");
        let velocity =
            composer.block::<Vector<3>>("velocity", spec(display::VELOCITY)).expect("a block");
        composer.block::<Position>("position", spec(display::POSITION)).expect("a block");
        if turns {
            composer.turns_with_heading(velocity, attitude);
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

    /// A correction leaves a considered attitude, and with it the axes of the velocity's error.
    #[test]
    fn a_velocity_does_not_turn_with_a_considered_heading() {
        let mut layout = layout(true);
        layout.blocks[0].spec.mode = Mode::Consider;
        let mut random = Random::new(6, "turning");
        let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        let mut covariance = Covariance::zero(9);
        (0..9).for_each(|i| (0..=i).for_each(|j| covariance.set(i, j, random.normal())));
        let (before, velocity) = (covariance.to_dense(), layout.blocks[1].range());
        let start = state.values[velocity.clone()].to_vec();
        let mut delta = [0.0; 9];
        delta[3..6].copy_from_slice(&[1.0, -2.0, 3.0]);
        layout.inject(&mut state, &mut delta, &mut covariance);
        let moved = state.values[velocity].iter().zip(start).map(|(after, before)| after - before);
        assert!(moved.zip([1.0, -2.0, 3.0]).all(|(moved, d)| (moved - d).abs() < 1e-14));
        let after = covariance.to_dense();
        assert_eq!(after.view((0, 0), (6, 6)), before.view((0, 0), (6, 6)));
    }

    #[test]
    fn what_is_carried_beside_the_covariance_stays_its_factor() {
        let layout = layout(true);
        let mut random = Random::new(4, "turning");
        for _ in 0..50 {
            let mut state =
                displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
            // G G' = P, after a heading correction of some 10 degrees as before
            let mut g: Vec<f64> = (0..9 * 9).map(|_| random.normal()).collect();
            let product = |g: &[f64], i: usize, j: usize| {
                (0..9).map(|k| g[i * 9 + k] * g[j * 9 + k]).sum::<f64>()
            };
            let mut covariance = Covariance::zero(9);
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                covariance.set(i, j, product(&g, i, j));
            }
            let mut delta: Vec<f64> = (0..9).map(|_| 0.2 * random.normal()).collect();
            layout.inject(&mut state, &mut delta, &mut covariance);
            layout.reset_rows(&delta, &mut g, 9);
            for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
                let (p, of_g) = (covariance.get(i, j), product(&g, i, j));
                // rounding of elements of some 100
                assert!((p - of_g).abs() < 1e-11, "{i} {j}: {p} {of_g}");
            }
        }
    }

    #[test]
    fn a_displaced_state_is_the_injected_one_and_its_columns_are_reset_as_the_covariance_is() {
        let layout = layout(true);
        let mut random = Random::new(5, "turning");
        for _ in 0..50 {
            let state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
            let mut delta: Vec<f64> = (0..9).map(|_| 0.3 * random.normal()).collect();
            let (mut injected, mut moved, mut by) = (state.clone(), state.clone(), delta.clone());
            layout.displace(&state, &mut by, &mut moved);
            layout.inject(&mut injected, &mut delta, &mut Covariance::zero(9));
            assert_eq!((&moved, &by), (&injected, &delta));
            // rows of the identity become rows of the reset G, in any order of the columns
            let identity: Vec<f64> = (0..81).map(|k| f64::from(k % 10 == 0)).collect();
            let (mut g, columns) = (identity.clone(), [3, 4, 5, 0, 1, 2, 6, 7, 8]);
            layout.reset_rows(&delta, &mut g, 9);
            let mut h: Vec<f64> = (0..81).map(|k| identity[k / 9 * 9 + columns[k % 9]]).collect();
            layout.reset_columns(&delta, &columns, &mut h);
            let apart = (0..81).map(|k| (h[k] - g[k / 9 * 9 + columns[k % 9]]).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-15);
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

    /// The heading's variance after many velocities in body axes, each of which moves the estimate,
    /// relative to the prior.
    fn after_body_velocities(turns: bool) -> f64 {
        let layout = layout(turns);
        let mut random = Random::new(3, "turning");
        let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 0.0]);
        let mut covariance = Covariance::zero(9);
        // psi and xi unrelated, so that delta = xi + psi x v; the tilt is known
        let v = Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
        let phi = Matrix3::from_diagonal(&Vector3::new(1e-12, 1e-12, 0.04));
        let turned = Vector3::z().cross(&v);
        let mut cross = Matrix3::zeros();
        cross.set_column(2, &(turned * 0.04));
        let velocity = Matrix3::from_diagonal_element(0.25) + turned * turned.transpose() * 0.04;
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
            update.h = (0..3)
                .flat_map(|i| h.map(|h| [h[(i, 0)], h[(i, 1)], h[(i, 2)]]).concat())
                .collect();
            update.innovation = (0..3).map(|_| 0.5 * random.normal()).collect();
            update.r = DMatrix::from_diagonal_element(3, 3, 0.01).as_slice().to_vec();
            update.innovate(&covariance).expect("S is positive definite");
            update.apply(&mut covariance, &[false; 9]);
            layout.inject(&mut state, &mut update.delta, &mut covariance);
        }
        let sum: Vector6<f64> = Vector6::from_fn(|i, _| covariance.get(i, i));
        sum[2] / 0.04
    }

    fn handle(layout: &Layout) -> crate::state::Handle<Rotation> {
        assert_eq!(layout.blocks[0].name, "ins.attitude");
        crate::state::Handle { slot: 0, manifold: std::marker::PhantomData }
    }

    #[test]
    fn a_velocity_in_body_axes_never_tells_the_heading() {
        let kept = after_body_velocities(true);
        // the effect of a tilt of 1e-6 rad is of second order
        assert!((kept - 1.0).abs() < 1e-6, "{kept}");
        // without the turning error the same updates make the filter overconfident
        let pretended = after_body_velocities(false);
        assert!(pretended < 0.5, "{pretended}");
    }
}
