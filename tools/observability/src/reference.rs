//! The uncertainty of each state without measurements, from its own dynamics alone: the reference
//! of its sigma.

use navfuse_core::state::Layout;
use navfuse_core::state::covariance::{Covariance, Transition};
use std::ops::Range;

/// Prior covariance of every block, propagated with the block's own part of `Phi` and `Q`: `P <-
/// Phi_bb P Phi_bb' + Q_bb`.
///
/// A constant keeps its sigma, a random walk grows, and a Gauss-Markov process tends to its
/// stationary sigma. The errors of other blocks drive the attitude, velocity and position of an
/// INS. Such a driven block has no dynamics of its own and keeps its prior.
#[derive(Clone, Debug)]
pub struct Reference {
    covariance: Covariance,
    prior: Covariance,
    /// Slot, tangent range and driven flag of each uncertain block.
    blocks: Vec<(usize, Range<usize>, bool)>,
    /// Index in `blocks` for each tangent axis.
    owner: Vec<usize>,
    /// Set if any block that is not driven has dynamics; `None` before the first transition.
    moves: Option<bool>,
    phi: Vec<f64>,
    work: Vec<f64>,
}

impl Reference {
    /// Creates the reference from the initial covariance.
    pub fn new(layout: &Layout, start: &Covariance) -> Self {
        let n = layout.tangent;
        let ranges =
            layout.blocks.iter().enumerate().map(|(slot, b)| (slot, b.tangent_range(), false));
        let blocks: Vec<_> = ranges.filter(|(_, range, _)| !range.is_empty()).collect();
        let (mut covariance, mut owner) = (Covariance::zero(n), vec![0; n]);
        for (at, (_, range, _)) in blocks.iter().enumerate() {
            for i in range.clone() {
                owner[i] = at;
                range.clone().for_each(|j| covariance.set(i, j, start.get(i, j)));
            }
        }
        Self {
            prior: covariance.clone(),
            covariance,
            blocks,
            owner,
            moves: None,
            phi: vec![0.0; n * n],
            work: vec![0.0; n * n],
        }
    }

    /// Returns `true` if the errors of other blocks drive the block.
    pub fn driven(&self, slot: usize) -> bool {
        self.blocks.iter().any(|b| b.0 == slot && b.2)
    }

    /// Returns the prior, propagated by the blocks' own dynamics.
    pub fn carried(&self) -> &Covariance {
        &self.covariance
    }

    /// Returns the prior.
    pub fn prior(&self) -> &Covariance {
        &self.prior
    }

    /// Propagates the reference.
    pub fn transition(&mut self, transition: &Transition) {
        match self.moves {
            None => self.learn(transition),
            Some(false) => return,
            Some(true) => {}
        }
        let n = self.owner.len();
        self.phi.fill(0.0);
        (0..n).for_each(|i| self.phi[i * n + i] = 1.0);
        // a row with declared elements has no implicit one on the diagonal
        transition.elements().for_each(|(i, ..)| self.phi[i * n + i] = 0.0);
        transition.elements().for_each(|(i, j, value)| self.phi[i * n + j] += value);
        for (_, range, driven) in &self.blocks {
            if *driven {
                continue;
            }
            for (i, j) in pairs(range) {
                self.work[i * n + j] =
                    range.clone().map(|k| self.phi[i * n + k] * self.covariance.get(k, j)).sum();
            }
            for (i, j) in pairs(range).filter(|(i, j)| j <= i) {
                let sum = range.clone().map(|k| self.work[i * n + k] * self.phi[j * n + k]).sum();
                self.covariance.set(i, j, sum);
            }
        }
        for (i, j, q) in transition.noise_elements().filter(|&(i, j, _)| j <= i) {
            if !self.blocks[self.owner[i]].2 {
                self.covariance.set(i, j, self.covariance.get(i, j) + q);
            }
        }
    }

    /// Finds the driven blocks and those with dynamics from the declared elements of `Phi` and `Q`.
    fn learn(&mut self, transition: &Transition) {
        for (i, j, _) in transition.elements().filter(|&(i, j, _)| self.owner[i] != self.owner[j]) {
            debug_assert_ne!(i, j);
            self.blocks[self.owner[i]].2 = true;
        }
        let own = |i: usize| !self.blocks[self.owner[i]].2;
        let moves = transition.elements().any(|(i, ..)| own(i))
            || transition.noise_elements().any(|(i, ..)| own(i));
        self.moves = Some(moves);
    }
}

fn pairs(range: &Range<usize>) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (start, n) = (range.start, range.len());
    (0..n * n).map(move |k| (start + k / n, start + k % n))
}
