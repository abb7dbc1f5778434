//! Blocks of `Phi` and `Q` whose sizes are known at run time only.

use super::Transition;
use nalgebra::DMatrix;
use std::ops::Range;

/// Place of a block of the transition matrix, and of the process noise of its rows, whose sizes are
/// known at run time only.
#[derive(Clone, Copy, Debug)]
pub struct DenseSlot {
    phi: usize,
    q: usize,
    rows: usize,
    columns: usize,
}

impl Transition {
    /// Declares the block of `Phi` in those rows and columns, and the block of `Q` in the rows.
    pub fn dense(&mut self, rows: Range<usize>, columns: Range<usize>) -> DenseSlot {
        let (first, [rows_of, columns_of]) = (rows.start, [rows.len(), columns.len()]);
        let (phi, q) = (self.phi_block(rows, columns), self.noise_block(first, rows_of));
        DenseSlot { phi, q, rows: rows_of, columns: columns_of }
    }

    /// Writes a block of `Phi`, of shape (rows, columns), and one of `Q`, of shape (rows, rows) and
    /// symmetric. Elements that a matrix lacks keep their value.
    pub fn set_dense(&mut self, slot: DenseSlot, phi: &DMatrix<f64>, q: &DMatrix<f64>) {
        let DenseSlot { phi: at, q: at_q, rows, columns } = slot;
        let places = self.phi_from(at)[..rows * columns].iter_mut();
        places.zip(phi).for_each(|(place, value)| *place = *value);
        let places = self.noise_from(at_q)[..rows * rows].iter_mut();
        places.zip(q).for_each(|(place, value)| *place = *value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows from three columns, as the matrices are written.
    #[test]
    fn a_block_of_any_size_has_its_elements_in_their_places() {
        let mut transition = Transition::default();
        let slot = transition.dense(1..3, 0..3);
        let phi = DMatrix::from_row_slice(2, 3, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let q = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]);
        transition.set_dense(slot, &phi, &q);
        transition.elements().for_each(|(i, j, value)| assert_eq!(value, phi[(i - 1, j)]));
        assert_eq!(transition.elements().count(), 6);
        assert_eq!(transition.noise_dense(3).view((1, 1), (2, 2)), q);
    }
}
