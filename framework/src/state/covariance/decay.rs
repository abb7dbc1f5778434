//! Rows of `Phi` with a single element, on the diagonal: states that decay by themselves.
//!
//! With `D` the diagonal matrix of these elements, and one elsewhere, `Phi = D A`, where `A` keeps
//! such a state. So `Phi P Phi' = D (A P A') D`: most of the work of a wandering state is a factor.

use super::lanes::Lane;
use pulp::{Simd, WithSimd};

/// States that decay by themselves, with the place of each factor in the values of `Phi`.
#[derive(Clone, Debug, Default)]
pub(super) struct Decays {
    states: Vec<(usize, usize)>,
    /// Groups of four columns that have such a state.
    lanes: Vec<usize>,
    /// Factor of each state.
    factors: Vec<Lane>,
}

impl Decays {
    /// Finds the states by the `(row, column)` of each element of `Phi`.
    pub(super) fn new(lanes: usize, places: &[(usize, usize)]) -> Self {
        let mut elements = vec![0_usize; 4 * lanes];
        places.iter().for_each(|(row, _)| elements[*row] += 1);
        let alone = |(row, column): (usize, usize)| row == column && elements[row] == 1;
        let found = places.iter().enumerate().filter(|(_, place)| alone(**place));
        let mut states: Vec<(usize, usize)> = found.map(|(at, place)| (place.0, at)).collect();
        states.sort_unstable();
        let mut groups: Vec<usize> = states.iter().map(|state| state.0 / 4).collect();
        groups.dedup();
        Self { states, lanes: groups, factors: vec![[1.0; 4]; lanes] }
    }

    /// Returns `true` for a state that decays by itself.
    pub(super) fn contains(&self, row: usize) -> bool {
        self.states.binary_search_by_key(&row, |state| state.0).is_ok()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// Approximate size, bytes.
    pub(super) fn size(&self) -> usize {
        size_of_val(&self.states[..])
            + size_of_val(&self.lanes[..])
            + size_of_val(&self.factors[..])
    }

    /// `G = D G`, for rows of `stride` numbers.
    pub(super) fn scale(&self, phi: &[f64], g: &mut [f64], stride: usize) {
        for &(row, at) in &self.states {
            g[row * stride..][..stride].iter_mut().for_each(|g| *g *= phi[at]);
        }
    }
}

/// `P = D P D`. The factor of an element is that of the one on the other side of the diagonal.
pub(super) struct Decay<'a> {
    pub(super) decays: &'a mut Decays,
    pub(super) phi: &'a [f64],
    pub(super) p: &'a mut [Lane],
}

impl WithSimd for Decay<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { decays: Decays { states, lanes, factors }, phi, p } = self;
        for &(row, at) in &*states {
            factors[row / 4][row % 4] = phi[at];
        }
        let mut decaying = states.iter().map(|state| state.0).peekable();
        for (row, p) in p.chunks_exact_mut(factors.len()).enumerate() {
            if decaying.next_if_eq(&row).is_some() {
                let own = factors[row / 4][row % 4];
                for (p, factors) in p.iter_mut().zip(&*factors) {
                    times(simd, p, own, factors);
                }
            } else {
                for &lane in &*lanes {
                    times(simd, &mut p[lane], 1.0, &factors[lane]);
                }
            }
        }
    }
}

/// `p = p (own factors)`.
#[inline(always)]
fn times<S: Simd>(simd: S, p: &mut Lane, own: f64, factors: &Lane) {
    let own = simd.splat_f64s(own);
    for (p, factor) in S::as_mut_simd_f64s(p).0.iter_mut().zip(S::as_simd_f64s(factors).0) {
        *p = simd.mul_f64s(*p, simd.mul_f64s(own, *factor));
    }
}
