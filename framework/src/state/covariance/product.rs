//! Products of transitions as values of a sparse pattern, for the records of the smoother.

use super::Transition;
use super::chain::Chain;
use std::sync::Arc;

/// Elements in which a product of transitions of one pattern may differ from the identity.
///
/// An error reaches a row of the product along the declared elements of its factors, so these are
/// the transitive closure of the pattern.
#[derive(Clone, Debug, Default)]
pub(crate) struct Closure {
    /// Rows that the transitions change, which copies of one transition share.
    rows: Arc<[usize]>,
    places: Vec<(usize, usize)>,
}

impl Closure {
    /// Finds the elements for the pattern of a transition. Returns `false` if they are known
    /// already.
    pub(crate) fn find(&mut self, transition: &Transition) -> bool {
        let rows = transition.kernel.rows();
        if Arc::ptr_eq(&self.rows, rows) {
            return false;
        }
        self.places.clear();
        for &row in rows.iter() {
            let mut columns = Vec::new();
            let mut next = vec![row];
            while let Some(from) = next.pop() {
                for &(_, column) in transition.places().iter().filter(|place| place.0 == from) {
                    if !columns.contains(&column) {
                        columns.push(column);
                        next.push(column);
                    }
                }
            }
            columns.sort_unstable();
            self.places.extend(columns.into_iter().map(|column| (row, column)));
        }
        self.rows = Arc::clone(rows);
        true
    }

    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }
}

/// Product `Phi_k ... Phi_1` of the transitions since the last [`Self::restart`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Product {
    chain: Chain,
    closure: Closure,
    /// Place of each element in the chain.
    at: Vec<usize>,
}

impl Product {
    /// Multiplies the product by a transition from the left. Returns `false`, and leaves the
    /// product as it is, for a transition of another pattern than those before.
    pub(crate) fn append(&mut self, transition: &Transition) -> bool {
        if !self.chain.append(transition) {
            return false;
        }
        if self.closure.find(transition) {
            let places = self.closure.places.iter();
            self.at = places.filter_map(|&(row, column)| self.chain.place(row, column)).collect();
        }
        true
    }

    /// Returns `true` if there is no factor.
    pub(crate) fn is_empty(&self) -> bool {
        !self.chain.moved()
    }

    /// `(row, column)` of each element. A row without elements is that of the identity.
    pub(crate) fn places(&self) -> &[(usize, usize)] {
        &self.closure.places
    }

    /// Values of the elements, in the order of [`Self::places`].
    pub(crate) fn values(&self) -> impl Iterator<Item = f64> + '_ {
        let psi = self.chain.values();
        self.at.iter().map(|at| psi[*at])
    }

    /// Sets the product to the identity.
    pub(crate) fn restart(&mut self) {
        self.chain.restart();
    }
}
