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
//!
//! With `xi = D(v^) delta` to first order, the reset after an injection is the covariance
//! transformation `T = D(v^+)^-1 D(v^)` (Han, Ouyang, Zhu & Wu, arXiv 2511.00453, 2025).

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
mod tests;
