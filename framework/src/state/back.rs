//! The reset after a correction, passed backward: the transpose of [`Layout::reset_rows`].
//!
//! The reset `G` first turns the velocities with the heading, and then moves the tangent space of
//! each block. The transpose takes both in the reverse order.

use super::Layout;
use super::covariance::Covariance;
use super::manifold::MAX_TANGENT;
use nalgebra::Vector3;
use std::ops::Range;

impl Layout {
    /// `A = G' A` for rows of `width`, with the reset `G` after the injection of `delta`.
    pub(crate) fn reset_back(&self, delta: &[f64], a: &mut [f64], width: usize) {
        let mut column = [0.0; MAX_TANGENT];
        self.each_transposed(delta, |range, transposed| {
            let (first, w) = (range.start, range.len());
            for j in 0..width {
                for (i, c) in column[..w].iter_mut().enumerate() {
                    let row = &transposed[i * w..][..w];
                    *c = (0..w).map(|b| row[b] * a[(first + b) * width + j]).sum();
                }
                (0..w).for_each(|i| a[(first + i) * width + j] = column[i]);
            }
        });
        self.each_turn(delta, |velocity, heading, by| {
            for (row, by) in velocity.zip(by) {
                for j in 0..width {
                    a[heading * width + j] += by * a[row * width + j];
                }
            }
        });
    }

    /// `X = G' X G` for a symmetric matrix.
    pub(crate) fn reset_information(&self, delta: &[f64], x: &mut Covariance) {
        self.each_transposed(delta, |range, transposed| x.transform(range, transposed));
        self.each_turn(delta, |velocity, heading, by| x.shear_back(velocity, heading, by));
    }

    /// Passes the range of each block whose tangent space the injection moves, and the transposed
    /// block of `G`.
    fn each_transposed(&self, delta: &[f64], mut each: impl FnMut(Range<usize>, &[f64])) {
        let mut jacobian = [0.0; MAX_TANGENT * MAX_TANGENT];
        let mut transposed = [0.0; MAX_TANGENT * MAX_TANGENT];
        for block in self.blocks.iter().filter(|b| b.estimated()) {
            let (range, w) = (block.tangent_range(), block.operations.tangent);
            if (block.operations.reset)(&delta[range.clone()], &mut jacobian) {
                (0..w * w).for_each(|k| transposed[k] = jacobian[k % w * w + k / w]);
                each(range, &transposed[..w * w]);
            }
        }
    }

    /// Passes the range of each velocity that turns, the index of its heading, and the column by
    /// which it turns; the last one first.
    fn each_turn(&self, delta: &[f64], mut each: impl FnMut(Range<usize>, usize, &Vector3<f64>)) {
        for t in self.corrected().rev() {
            let velocity = self.blocks[t.velocity].tangent_range();
            let heading = self.blocks[t.attitude].tangent_range().start + 2;
            let by = Vector3::z().cross(&Vector3::from_column_slice(&delta[velocity.clone()]));
            each(velocity, heading, &by);
        }
    }
}
