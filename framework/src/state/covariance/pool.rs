//! The steps between two uses of the covariance, taken as one.
//!
//! Many steps `I + A_k` follow each other between two updates. With the sum `S` of `n` changes and
//! their first moment `W = sum (2 k - n - 1) A_k`, their product is, to the second order,
//! ```text
//! I + S + (1 - 1/n) S^2 / 2 + (W S - S W) / (2 n)
//! ```
//! It has all terms of the second order for changes of which one part varies with `k`, such as a
//! specific force, and the others do not. The third order, `S^3 / 6`, is neglected: it bounds the
//! number of steps. A state that decays by itself has the product of its decays.
//!
//! The noise of a step is carried by the steps after it, over the fraction `(n - 1) / 2n` of them on average.
//! So this part of the noise comes before the steps, and the rest after them: the noise is carried to the
//! first order. Of the second, `S Q S'` takes that fraction in place of the mean of its square,
//! `(n - 1)(2n - 1) / 6n^2`, up to a sixth too much, which bounds the number of steps too.

use super::lanes::Lane;
use super::{Covariance, Transition};
use crate::checkpoint::saved;
use crate::state::{Layout, vectorised};
use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};

/// Largest neglected change of an error in one pool, as a share of its sigma.
const NEGLECTED: f64 = 1e-6;
/// Largest growth of a pool over the one before.
const GROWTH: f64 = 4.0;

/// Steps that the covariance has not taken.
#[derive(Clone)]
pub(crate) struct Pool {
    /// Number of steps.
    steps: u32,
    /// Sums of `A_k`, of `k A_k`, and of the noise.
    sum: Vec<f64>,
    moment: Vec<f64>,
    noise: Vec<f64>,
    own: Vec<f64>,
    /// Product of each decay, with its place in `Phi`.
    decays: Vec<Decay>,
    /// Sum of `|A_k|` over all elements, and the one at which the pool is full.
    size: f64,
    room: f64,
    /// The share of the identity in each element, and whether each changed row has one: a row without its
    /// own element is no change of the identity that could add up.
    identity: Vec<f64>,
    complete: bool,
    products: Products,
    /// All steps.
    part: Transition,
    /// Errors, and what they become by each further `S`: work space.
    chain: [Vec<f64>; 4],
    /// Variances of the noise, and of the noise that `S` carries.
    noises: Vec<f64>,
    carried: Vec<f64>,
}

saved!(Pool { steps, size, room } each { sum, moment, noise, own, decays } except {
    identity, complete, products, part, chain, noises, carried
});

#[derive(Clone, Debug)]
struct Decay {
    at: usize,
    place: usize,
    row: usize,
    /// Index of the noise of the block's own dynamics.
    own: Option<usize>,
    factor: f64,
    /// This noise as it is at the end.
    noise: f64,
}

saved!(Decay { factor, noise } except { at, place, row, own });

/// The elements of `S`, and their products.
#[derive(Clone, Debug, Default)]
struct Products {
    /// For each element of the steps its place among those of the whole.
    places: Vec<usize>,
    /// Row and column of each element of the steps, once; first those whose column is a row that the steps
    /// change too, which alone have products.
    own: Vec<(usize, usize)>,
    /// Number of those.
    further: usize,
    /// For each element of the whole the share of the identity, and its place in a dense matrix.
    identity: Vec<f64>,
    dense: Vec<usize>,
    /// Number of lanes of a row.
    lanes: usize,
    /// `S`, `W`, and their products `S^2` and `W S - S W`; dense.
    s: Vec<Lane>,
    w: Vec<Lane>,
    square: Vec<Lane>,
    turn: Vec<Lane>,
}

impl Pool {
    /// An empty pool for steps with the places of this one.
    pub(crate) fn new(layout: &Layout, step: &Transition) -> Self {
        let part = squared(layout, step);
        let products = Products::new(layout.tangent, step, &part);
        let alone = |row: usize| step.places().iter().filter(|place| place.0 == row).count() == 1;
        let places = step.places().iter().enumerate();
        let decays = places.filter(|(_, place)| place.0 == place.1 && alone(place.0));
        let decays = decays.map(|(at, place)| Decay {
            at,
            place: products.places[at],
            row: place.0,
            own: step.own.iter().position(|own| own.row == place.0),
            factor: 1.0,
            noise: 0.0,
        });
        let identity = step.identity();
        let ones = identity.iter().filter(|one| **one != 0.0).count();
        Self {
            complete: ones == step.kernel.rows().len(),
            identity,
            steps: 0,
            sum: vec![0.0; step.phi.len()],
            moment: vec![0.0; step.phi.len()],
            noise: vec![0.0; step.q.len()],
            own: vec![0.0; step.own.len()],
            decays: decays.collect(),
            size: 0.0,
            room: 0.0,
            products,
            part,
            chain: std::array::from_fn(|_| vec![0.0; layout.tangent]),
            noises: vec![0.0; layout.tangent],
            carried: vec![0.0; layout.tangent],
        }
    }

    /// Adds a step. Returns `true` if the pool is full.
    pub(crate) fn add(&mut self, step: &Transition) -> bool {
        self.steps += 1;
        let Self { sum, moment, identity, noise, own, .. } = self;
        let size = vectorised(
            (f64::from(self.steps), &step.phi[..], &identity[..], &mut sum[..], &mut moment[..]),
            #[inline(always)]
            |(k, phi, identity, sum, moment): (f64, &[f64], &[f64], &mut [f64], &mut [f64])| {
                let (phi, rest) = phi.as_chunks::<4>();
                let (identity, ones) = identity.as_chunks::<4>();
                let (sum, sums) = sum.as_chunks_mut::<4>();
                let (moment, moments) = moment.as_chunks_mut::<4>();
                let mut sizes = [0.0; 4];
                for (((phi, one), sum), moment) in phi.iter().zip(identity).zip(sum).zip(moment) {
                    for i in 0..4 {
                        let change = phi[i] - one[i];
                        sum[i] += change;
                        moment[i] += k * change;
                        sizes[i] += change.abs();
                    }
                }
                for (((phi, one), sum), moment) in rest.iter().zip(ones).zip(sums).zip(moments) {
                    let change = phi - one;
                    *sum += change;
                    *moment += k * change;
                    sizes[0] += change.abs();
                }
                sizes.iter().sum::<f64>()
            },
        );
        self.size += size;
        for decay in &mut self.decays {
            let factor = step.phi[decay.at];
            decay.factor *= factor;
            let noise = decay.own.map_or(0.0, |own| step.own[own].q);
            decay.noise = factor * factor * decay.noise + noise;
        }
        let share = 1.0 + step.excess;
        noise.iter_mut().zip(&step.q).for_each(|(q, step)| *q += share * step);
        own.iter_mut().zip(&step.own).for_each(|(q, step)| *q += step.q);
        // the step after this one, if as large as this one, would be too much
        !self.complete || self.size + size > self.room
    }

    /// Returns `true` if there is no step.
    pub(crate) fn is_empty(&self) -> bool {
        self.steps == 0
    }

    /// Moves a covariance over the steps, and returns the transition of all of them, with their noise.
    pub(crate) fn take(&mut self, covariance: &mut Covariance) -> &mut Transition {
        self.products.multiply(&self.sum, &self.moment, f64::from(self.steps));
        let early = self.fill();
        self.part.add_share_of_noise(early, covariance);
        self.part.kernel.propagate(&self.part.phi, covariance);
        self.part.add_share_of_noise(1.0 - early, covariance);
        self.plan(covariance);
        self.clear();
        &mut self.part
    }

    fn clear(&mut self) {
        (self.steps, self.size) = (0, 0.0);
        let Self { sum, moment, noise, own, .. } = self;
        [sum, moment, noise, own].into_iter().for_each(|sum| sum.fill(0.0));
        self.decays.iter_mut().for_each(|decay| (decay.factor, decay.noise) = (1.0, 0.0));
    }

    /// Fills the transition. Returns the share of the noise that comes before it.
    fn fill(&mut self) -> f64 {
        let Self { products: p, part, decays, steps, .. } = self;
        let count = f64::from(*steps);
        let early = 0.5 * (count - 1.0) / count;
        // the products of a single step are those of a pool before it
        let turn = if *steps == 1 { 0.0 } else { 0.5 / count };
        let (s, twice, turned) =
            (p.s.as_flattened(), p.square.as_flattened(), p.turn.as_flattened());
        for (phi, (one, &at)) in part.phi.iter_mut().zip(p.identity.iter().zip(&p.dense)) {
            *phi = one + s[at] + early * twice[at] + turn * turned[at];
        }
        part.q.copy_from_slice(&self.noise);
        part.own.iter_mut().zip(&self.own).for_each(|(own, sum)| own.q = *sum);
        for decay in decays {
            let factor = decay.factor;
            part.phi[decay.place] = factor;
            if let Some(own) = decay.own {
                // the variance of a state that decays by itself is exact
                part.own[own].q = decay.noise / (1.0 - early + early * factor * factor);
            }
        }
        early
    }

    /// Plans the next pool: what this one neglects grows with the cube of the number of steps.
    fn plan(&mut self, covariance: &Covariance) {
        let Self { products, part, chain, noises, carried, decays, .. } = self;
        let (s, width) = (products.s.as_flattened(), 4 * products.lanes);
        for (i, sigma) in chain[0].iter_mut().enumerate() {
            *sigma = covariance.get(i, i).max(0.0).sqrt();
        }
        part.noise_variances(noises);
        carried.fill(0.0);
        for k in 1..4 {
            let (before, after) = chain.split_at_mut(k);
            let (before, after) = (&before[k - 1], &mut after[0]);
            after.fill(0.0);
            // an error of a state that no step changes has no further effect
            let own = if k == 1 { &products.own[..] } else { &products.own[..products.further] };
            for &(row, column) in own {
                let s = s[row * width + column].abs();
                after[row] += s * before[column];
                if k == 1 {
                    carried[row] += s * s * noises[column];
                }
            }
        }
        // the product of decays is exact
        for decay in decays {
            chain[3][decay.row] = 0.0;
            carried[decay.row] = 0.0;
        }
        let [sigma, once, twice, third] = &*chain;
        let mut largest = 0.0_f64;
        for (i, carried) in carried.iter().enumerate() {
            if third[i] > 0.0 {
                largest = largest.max(third[i] / 6.0 / (sigma[i] + once[i] + 0.5 * twice[i]));
            }
            if *carried > 0.0 {
                // half a sixth of the variance, since sigma is its root
                largest = largest.max(carried / 12.0 / (sigma[i] * sigma[i]));
            }
        }
        let ratio = if largest > 0.0 { (NEGLECTED / largest).cbrt() } else { GROWTH };
        self.room = if self.complete { self.size * ratio.min(GROWTH) } else { 0.0 };
    }
}

impl Products {
    /// Finds the places of the elements and of their products in a transition that has all.
    fn new(n: usize, step: &Transition, whole: &Transition) -> Self {
        let all = whole.places();
        let at = |place: &(usize, usize)| all.iter().position(|own| own == place);
        let places = step.places().iter().filter_map(at).collect();
        let mut own = step.places().to_vec();
        let changed = step.kernel.rows();
        let ends = |place: &(usize, usize)| changed.binary_search(&place.1).is_err();
        own.sort_unstable_by_key(|place| (ends(place), *place));
        own.dedup();
        let further = own.iter().filter(|place| !ends(place)).count();
        let lanes = n.div_ceil(4);
        let mut products = Self {
            places,
            own,
            further,
            identity: vec![0.0; all.len()],
            dense: all.iter().map(|(row, column)| row * 4 * lanes + column).collect(),
            lanes,
            s: vec![[0.0; 4]; n * lanes],
            w: vec![[0.0; 4]; n * lanes],
            square: vec![[0.0; 4]; n * lanes],
            turn: vec![[0.0; 4]; n * lanes],
        };
        let ones = products.places.iter().zip(step.identity());
        ones.for_each(|(place, one)| products.identity[*place] += one);
        for (one, (row, column)) in products.identity.iter_mut().zip(all) {
            if row == column && changed.binary_search(row).is_err() {
                *one = 1.0; // a row that no step changes, beside one of its block that some do
            }
        }
        products
    }

    /// Multiplies the sums of a number of steps: `S^2` and `W S - S W`.
    fn multiply(&mut self, sum: &[f64], moment: &[f64], count: f64) {
        let Self { places, own, further, dense, lanes, s, w, square, turn, .. } = self;
        let own = &own[..*further];
        let (flat, turned) = (s.as_flattened_mut(), w.as_flattened_mut());
        for &place in &*places {
            (flat[dense[place]], turned[dense[place]]) = (0.0, 0.0);
        }
        for (place, (sum, moment)) in places.iter().zip(sum.iter().zip(moment)) {
            flat[dense[*place]] += sum;
            turned[dense[*place]] += 2.0 * moment - (count + 1.0) * sum;
        }
        if count == 1.0 {
            return;
        }
        Arch::new().dispatch(Multiplied { lanes: *lanes, own, s, w, square, turn });
    }
}

/// The products of [`Products::multiply`], row by row.
struct Multiplied<'a> {
    lanes: usize,
    own: &'a [(usize, usize)],
    s: &'a [Lane],
    w: &'a [Lane],
    square: &'a mut [Lane],
    turn: &'a mut [Lane],
}

impl WithSimd for Multiplied<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { lanes, own, s, w, square, turn } = self;
        let mut begun = None;
        for &(row, column) in own {
            if begun.replace(row) != Some(row) {
                square[row * lanes..][..lanes].fill([0.0; 4]);
                turn[row * lanes..][..lanes].fill([0.0; 4]);
            }
            let element = row * lanes + column / 4;
            let left = simd.splat_f64s(s[element][column % 4]);
            let moved = simd.splat_f64s(w[element][column % 4]);
            let right = s[column * lanes..][..lanes].iter().zip(&w[column * lanes..][..lanes]);
            let out = square[row * lanes..][..lanes].iter_mut();
            let out = out.zip(&mut turn[row * lanes..][..lanes]);
            for ((square, turn), (s, w)) in out.zip(right) {
                let right = S::as_simd_f64s(s).0.iter().zip(S::as_simd_f64s(w).0);
                let out = S::as_mut_simd_f64s(square).0.iter_mut();
                for ((square, turn), (s, w)) in out.zip(S::as_mut_simd_f64s(turn).0).zip(right) {
                    *square = simd.add_f64s(*square, simd.mul_f64s(left, *s));
                    let change = simd.sub_f64s(simd.mul_f64s(moved, *s), simd.mul_f64s(left, *w));
                    *turn = simd.add_f64s(*turn, change);
                }
            }
        }
    }
}

/// A transition with the places of a step and of the product of two, which has its noise. The rows of a block of
/// three have the same columns, as the kernel takes them.
fn squared(layout: &Layout, step: &Transition) -> Transition {
    let n = layout.tangent;
    let mut once = DMatrix::from_element(n, n, false);
    step.places().iter().for_each(|place| once[*place] = true);
    let mut all = once.clone();
    for (i, k) in step.places() {
        (0..n).filter(|j| once[(*k, *j)]).for_each(|j| all[(*i, j)] = true);
    }
    let mut whole = Transition { noise: step.noise.clone(), ..Transition::default() };
    whole.q.resize(step.q.len(), 0.0);
    whole.own = step.own.iter().map(|own| own.without_decay()).collect();
    let mut row = 0;
    while row < n {
        let block = layout.blocks.iter().map(|b| b.tangent_range()).find(|r| r.contains(&row));
        let rows = block.map_or(row..row + 1, |range| row..range.end.min(row + 3));
        let own = rows.clone().all(|i| (0..n).all(|j| all[(i, j)] == (i == j)));
        let changed = rows.clone().any(|i| (0..n).any(|j| all[(i, j)]));
        let reads = |j: &usize| changed && rows.clone().any(|i| i == *j || all[(i, *j)]);
        if own {
            whole.places.extend(rows.clone().map(|i| (i, i)));
        } else {
            let columns = (0..n).filter(reads);
            whole.places.extend(columns.flat_map(|j| rows.clone().map(move |i| (i, j))));
        }
        row = rows.end;
    }
    whole.phi.resize(whole.places.len(), 0.0);
    whole.compile(layout);
    whole
}

#[cfg(test)]
mod tests;
