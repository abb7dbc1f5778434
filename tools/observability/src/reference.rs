//! The uncertainty of each state without measurements, from its own dynamics alone: the reference
//! of its sigma.

use navfuse_core::state::covariance::{Covariance, Transition};
use navfuse_core::state::{Block, Layout};
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
    blocks: Vec<Own>,
    /// Index in `blocks` for each tangent axis.
    owner: Vec<usize>,
    /// The last transition of a new pattern: states that come and go have patterns of their own.
    learnt: Option<Transition>,
    /// Set for each row with declared elements: it has no implicit one on the diagonal.
    declared: Vec<bool>,
    phi: Vec<f64>,
    work: Vec<f64>,
}

/// An uncertain block.
#[derive(Clone, Debug)]
struct Own {
    slot: usize,
    range: Range<usize>,
    /// Set if the errors of other blocks drive it.
    driven: bool,
    /// Set if it is not driven, and has dynamics of its own.
    moves: bool,
}

impl Reference {
    /// Creates the reference from the initial covariance.
    pub fn new(layout: &Layout, start: &Covariance) -> Self {
        let n = layout.tangent;
        let own = |(slot, block): (usize, &Block)| {
            let range = block.tangent_range();
            (!range.is_empty()).then_some(Own { slot, range, driven: false, moves: false })
        };
        let blocks: Vec<Own> = layout.blocks.iter().enumerate().filter_map(own).collect();
        let (mut covariance, mut owner) = (Covariance::zero(n), vec![0; n]);
        for (at, Own { range, .. }) in blocks.iter().enumerate() {
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
            learnt: None,
            declared: vec![false; n],
            phi: vec![0.0; n * n],
            work: vec![0.0; n * n],
        }
    }

    /// Returns `true` if the errors of other blocks drive the block.
    pub fn driven(&self, slot: usize) -> bool {
        self.blocks.iter().any(|b| b.slot == slot && b.driven)
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
        if self.learnt.as_ref().is_none_or(|known| !known.has_places_of(transition)) {
            self.learn(transition);
        }
        let Self { covariance, blocks, owner, declared, phi, work, .. } = self;
        let n = owner.len();
        let moving = || blocks.iter().filter(|block| block.moves).map(|block| &block.range);
        if moving().next().is_none() {
            return;
        }
        for (i, j) in moving().flat_map(pairs) {
            phi[i * n + j] = if i == j && !declared[i] { 1.0 } else { 0.0 };
        }
        let own = |i: usize| blocks[owner[i]].moves;
        for (i, j, value) in transition.elements().filter(|(i, ..)| own(*i)) {
            phi[i * n + j] += value;
        }
        type Elements<'a> = &'a mut dyn Iterator<Item = (usize, usize, f64)>;
        let add = |covariance: &mut Covariance, noise: Elements<'_>| {
            for (i, j, q) in noise.filter(|&(i, j, _)| j <= i && own(i)) {
                covariance.set(i, j, covariance.get(i, j) + q);
            }
        };
        add(covariance, &mut transition.noise_before());
        for range in moving() {
            for (i, j) in pairs(range) {
                let product = |k: usize| phi[i * n + k] * covariance.get(k, j);
                work[i * n + j] = range.clone().map(product).sum();
            }
            for (i, j) in pairs(range).filter(|(i, j)| j <= i) {
                let sum = range.clone().map(|k| work[i * n + k] * phi[j * n + k]).sum();
                covariance.set(i, j, sum);
            }
        }
        add(covariance, &mut transition.noise_after());
    }

    /// Finds the blocks with dynamics from the declared elements of `Phi` and `Q`, and from those of
    /// the first transition the driven blocks.
    fn learn(&mut self, transition: &Transition) {
        if self.learnt.is_none() {
            let others = transition.elements().filter(|&(i, j, _)| self.owner[i] != self.owner[j]);
            others.for_each(|(i, ..)| self.blocks[self.owner[i]].driven = true);
        }
        self.declared.fill(false);
        transition.elements().for_each(|(i, ..)| self.declared[i] = true);
        let elements = transition.elements().map(|(i, ..)| i);
        for i in elements.chain(transition.noise_after().map(|(i, ..)| i)) {
            let block = &mut self.blocks[self.owner[i]];
            block.moves = !block.driven;
        }
        self.learnt = Some(transition.clone());
    }
}

fn pairs(range: &Range<usize>) -> impl Iterator<Item = (usize, usize)> + use<> {
    let (start, n) = (range.start, range.len());
    (0..n * n).map(move |k| (start + k / n, start + k % n))
}
