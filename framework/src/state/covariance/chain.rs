//! Products of transitions.

use super::Transition;
use std::sync::Arc;

/// Product `Psi = Phi_k ... Phi_1` of the transitions since the last [`Self::restart`].
///
/// It has the few columns that the transitions read.
#[derive(Clone, Debug, Default)]
pub(super) struct Chain {
    /// Rows that the transitions change, which copies of one transition share.
    rows: Arc<[usize]>,
    /// Columns in which `Psi` may differ from the identity, ascending.
    columns: Vec<usize>,
    stride: usize,
    /// These columns of `Psi`, row-major.
    psi: Vec<f64>,
    /// Set once the product has a factor.
    moved: bool,
    /// Work space of [`Self::append`].
    work: Vec<f64>,
}

impl Chain {
    /// Multiplies the product by a transition from the left. Returns `false`, and leaves the
    /// product as it is, for a transition with other places than those before: restart it first.
    pub(super) fn append(&mut self, transition: &Transition) -> bool {
        if !Arc::ptr_eq(&self.rows, transition.kernel.rows()) {
            if self.moved {
                return false;
            }
            self.begin(transition);
        }
        transition.carry(&mut self.psi, self.stride, &mut self.work);
        self.moved = true;
        true
    }

    /// Sets the product to the identity.
    pub(super) fn restart(&mut self) {
        if !std::mem::take(&mut self.moved) {
            return;
        }
        for &row in self.rows.iter() {
            let psi = &mut self.psi[row * self.stride..][..self.stride];
            psi.fill(0.0);
            if let Ok(k) = self.columns.binary_search(&row) {
                psi[k] = 1.0;
            }
        }
    }

    /// Returns `true` if there is a factor.
    pub(super) fn moved(&self) -> bool {
        self.moved
    }

    /// Place of an element in [`Self::values`], if it may differ from the identity.
    pub(super) fn place(&self, row: usize, column: usize) -> Option<usize> {
        Some(row * self.stride + self.columns.binary_search(&column).ok()?)
    }

    /// Elements of the product, see [`Self::place`].
    pub(super) fn values(&self) -> &[f64] {
        &self.psi
    }

    /// Sets the product to the identity, for transitions with the places of this one.
    fn begin(&mut self, transition: &Transition) {
        self.columns.clear();
        self.columns.extend(transition.places().iter().flat_map(|place| [place.0, place.1]));
        self.columns.sort_unstable();
        self.columns.dedup();
        self.stride = self.columns.len().max(1).next_multiple_of(4);
        let rows = self.columns.last().map_or(0, |last| last + 1);
        self.psi.clear();
        self.psi.resize(rows * self.stride, 0.0);
        for (k, column) in self.columns.iter().enumerate() {
            self.psi[column * self.stride + k] = 1.0;
        }
        self.rows = Arc::clone(transition.kernel.rows());
    }
}
