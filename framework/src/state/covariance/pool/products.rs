//! Products of the sums of the steps of a pool, and what they neglect.

use super::super::bands::{Bands, Product};
use super::super::lanes::{Lane, Lanes, with_lanes};
use super::super::{Covariance, Transition};
use crate::state::{Layout, vectorised};
use nalgebra::DMatrix;
use pulp::Arch;

/// The sum `S` and the moment `M` as rows of the few columns that the steps read, and the second order of the
/// product of the steps.
#[derive(Clone, Debug)]
pub(super) struct Products {
    /// Number of lanes of a row, and the row at which `M` begins.
    lanes: usize,
    below: usize,
    /// Columns of the error state in the rows, ascending.
    columns: Vec<usize>,
    /// Elements of the steps, each with its place in the rows; first those with a place of their own.
    places: Vec<(usize, usize)>,
    own: usize,
    /// Elements whose column is a row that the steps change: these alone have products.
    further: Vec<usize>,
    /// `e S + M` and `-S` of these, as `bands` multiply them with `S` and `M`.
    factors: Vec<f64>,
    bands: Bands,
    /// `S`, a row of zeros, and `M`.
    rows: Vec<Lane>,
    /// `(e S + M) S - S M`, and a row of zeros.
    second: Vec<Lane>,
    /// For each element of the whole the share of the identity, and its place in the rows.
    identity: Vec<f64>,
    dense: Vec<usize>,
    /// Changed rows that are read, with their places among the columns; those that decay by themselves come
    /// after this number.
    changed: Vec<(usize, usize)>,
    coupled: usize,
    /// Errors, and what they become by each further `S`: work space.
    errors: [Vec<Lane>; 4],
    processor: Arch,
}

impl Products {
    /// Finds the places for steps like this one, and for a transition with all elements of their product.
    pub(super) fn new(
        n: usize,
        step: &Transition,
        whole: &Transition,
        decays: impl Fn(usize) -> bool,
    ) -> Self {
        let rows = step.kernel.rows();
        let reads = step.places().iter().filter(|place| !decays(place.0));
        let mut columns: Vec<usize> = reads.map(|place| place.1).collect();
        columns.sort_unstable();
        columns.dedup();
        let lanes = columns.len().max(1).div_ceil(4);
        // whole groups of four rows, and the one of zeros
        let below = n.next_multiple_of(4) + 1;
        let zero = 4 * (below - 1) * lanes;
        let column = |column: &usize| columns.binary_search(column).ok();
        let place = |(row, of): &(usize, usize)| column(of).map(|at| 4 * row * lanes + at);
        let elements = step.places().iter().enumerate();
        let mut places: Vec<(usize, usize)> =
            elements.filter_map(|(at, own)| Some((at, place(own)?))).collect();
        let again = |k: usize| places[..k].iter().any(|before| before.1 == places[k].1);
        let repeated: Vec<bool> = (0..places.len()).map(again).collect();
        let own = repeated.iter().filter(|again| !**again).count();
        let sorted = |again: bool| {
            let pairs = places.iter().zip(&repeated).filter(move |(_, repeats)| **repeats == again);
            pairs.map(|(place, _)| *place)
        };
        places = sorted(false).chain(sorted(true)).collect();
        let multiplies =
            |place: &(usize, usize)| !decays(place.0) && rows.binary_search(&place.1).is_ok();
        let all = step.places().iter().enumerate();
        let further: Vec<usize> =
            all.filter(|(_, place)| multiplies(place)).map(|(at, _)| at).collect();
        // the factors of the rows of S, and of those of M below them
        let factor = |from: usize| {
            further.iter().map(move |at| (step.places()[*at].0, step.places()[*at].1 + from))
        };
        let factors: Vec<(usize, usize)> = factor(0).chain(factor(below)).collect();
        let mut groups: Vec<usize> = factors.iter().map(|factor| factor.0 / 4).collect();
        groups.sort_unstable();
        groups.dedup();
        let mut identity = vec![0.0; whole.places().len()];
        for (own, one) in step.places().iter().zip(step.identity()) {
            if let Some(at) = whole.places().iter().position(|place| place == own) {
                identity[at] += one;
            }
        }
        for (one, (row, column)) in identity.iter_mut().zip(whole.places()) {
            if row == column && rows.binary_search(row).is_err() {
                *one = 1.0; // a row that no step changes, beside one of its block that some do
            }
        }
        let dense = whole.places().iter().map(|own| place(own).unwrap_or(zero)).collect();
        let read = rows.iter().filter_map(|row| Some((*row, column(row)?)));
        let mut changed: Vec<(usize, usize)> = read.collect();
        changed.sort_by_key(|(row, _)| decays(*row));
        let coupled = changed.iter().filter(|(row, _)| !decays(*row)).count();
        let square = |rows: usize| vec![[0.0; 4]; rows * lanes];
        Self {
            lanes,
            below,
            own,
            factors: vec![0.0; factors.len()],
            bands: Bands::new(&groups, &factors, &decays),
            rows: square(below + n),
            second: square(below),
            identity,
            dense,
            changed,
            coupled,
            errors: std::array::from_fn(|_| square(1)),
            processor: Arch::new(),
            places,
            further,
            columns,
        }
    }

    /// Takes the sum of the steps.
    pub(super) fn take(&mut self, sum: &[f64]) {
        scatter(self.rows.as_flattened_mut(), &self.places, self.own, sum, 1.0);
    }

    /// Writes `I + S`.
    pub(super) fn write_sum(&self, phi: &mut [f64]) {
        let s = self.rows.as_flattened();
        for (phi, (one, at)) in phi.iter_mut().zip(self.identity.iter().zip(&self.dense)) {
            *phi = one + s[*at];
        }
    }

    /// Writes `I + S + e S^2 + M S - S M`, with `M` that share of the moment.
    pub(super) fn write(
        &mut self,
        phi: &mut [f64],
        sum: &[f64],
        moment: &[f64],
        e: f64,
        share: f64,
    ) {
        let m = &mut self.rows.as_flattened_mut()[4 * self.below * self.lanes..];
        scatter(m, &self.places, self.own, moment, share);
        let (left, right) = self.factors.split_at_mut(self.further.len());
        for ((left, right), at) in left.iter_mut().zip(right).zip(&self.further) {
            (*left, *right) = (e * sum[*at] + share * moment[*at], -sum[*at]);
        }
        with_lanes!(self.lanes, self.multiply());
        let (s, second) = (self.rows.as_flattened(), self.second.as_flattened());
        for (phi, (one, at)) in phi.iter_mut().zip(self.identity.iter().zip(&self.dense)) {
            *phi = one + s[*at] + second[*at];
        }
    }

    fn multiply<const L: usize, const ANY: bool>(&mut self, lanes: Lanes<L, ANY>) {
        let Self { bands, factors, rows, second, .. } = self;
        self.processor.dispatch(Product {
            bands,
            phi: factors,
            x: rows,
            lanes,
            out: second,
            lower: false,
        });
    }

    /// Largest share of a sigma that the third order of the last sum changes.
    pub(super) fn neglected(&mut self, covariance: &Covariance) -> f64 {
        let Self { columns, rows, errors, changed, coupled, lanes, .. } = self;
        let first = errors[0].as_flattened_mut();
        for (sigma, i) in first.iter_mut().zip(&*columns) {
            *sigma = covariance.get(*i, *i).max(0.0).sqrt();
        }
        vectorised(
            (&rows[..], &changed[..], *lanes, &mut *errors),
            #[inline(always)]
            |(rows, changed, lanes, errors): Chained<'_>| {
                for k in 1..4 {
                    let (before, after) = errors.split_at_mut(k);
                    let (before, after) = (&before[k - 1][..], after[0].as_flattened_mut());
                    for &(row, at) in changed {
                        let mut sums = [0.0; 4];
                        for (s, error) in rows[row * lanes..][..lanes].iter().zip(before) {
                            for i in 0..4 {
                                sums[i] += s[i].abs() * error[i];
                            }
                        }
                        after[at] = (sums[0] + sums[1]) + (sums[2] + sums[3]);
                    }
                }
            },
        );
        let [sigma, once, twice, third] = errors.each_ref().map(|error| error.as_flattened());
        let share = |at: usize| match third[at] > 0.0 {
            true => third[at] / 6.0 / (sigma[at] + once[at] + 0.5 * twice[at]),
            false => 0.0,
        };
        // the product of decays is exact
        changed[..*coupled].iter().map(|(_, at)| share(*at)).fold(0.0, f64::max)
    }
}

/// `S`, its changed rows, its lanes, and the errors that it changes again and again.
type Chained<'a> = (&'a [Lane], &'a [(usize, usize)], usize, &'a mut [Vec<Lane>; 4]);

/// Writes a share of each element to its place.
fn scatter(to: &mut [f64], places: &[(usize, usize)], own: usize, values: &[f64], share: f64) {
    let (own, again) = places.split_at(own);
    own.iter().for_each(|(from, at)| to[*at] = share * values[*from]);
    again.iter().for_each(|(from, at)| to[*at] += share * values[*from]);
}

/// A transition with the places of a step and of the product of two, which has its noise. The rows of a block of
/// three have the same columns, as the kernel takes them.
pub(super) fn squared(layout: &Layout, step: &Transition) -> Transition {
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
