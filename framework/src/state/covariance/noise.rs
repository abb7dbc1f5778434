//! The process noise of a transition.

use super::{Covariance, Transition};

impl Transition {
    /// Adds the noise that comes before `Phi`.
    pub(super) fn add_early_noise(&self, covariance: &mut Covariance) {
        if self.carried.early > 0.0 {
            self.add_share_of_noise(self.carried.early, covariance);
        }
    }

    /// Adds the noise that comes after `Phi`: all of it, but for a pool of steps.
    pub(crate) fn add_noise(&self, covariance: &mut Covariance) {
        self.add_share_of_noise(1.0 - self.carried.early, covariance);
        let (stride, p) = (covariance.stride, &mut covariance.p);
        for (&(i, j), value) in self.carried.places.iter().zip(&self.carried.values) {
            p[i * stride + j] += value;
            p[j * stride + i] += value;
        }
    }

    /// Adds a share of `Q`.
    fn add_share_of_noise(&self, part: f64, covariance: &mut Covariance) {
        let (stride, p) = (covariance.stride, &mut covariance.p);
        let share = part * (1.0 + self.excess);
        for &(at, row, size) in &self.noise {
            let (q, p) = (&self.q[at..at + size * size], &mut p[row * stride..][..size * stride]);
            match (q.first_chunk::<9>(), size) {
                (Some(q), 3) => add_three(p, stride, row, q, share),
                _ => add_block(p, stride, row, size, q, share),
            }
        }
        for own in &self.own {
            p[own.row * stride + own.row] += part * own.q;
        }
    }

    /// Computes the density of the models' process noise in a step of `dt` seconds: for each error
    /// state, the variance divided by `dt`.
    pub(crate) fn noise_density(&self, dt: f64, density: &mut [f64]) {
        let rate = (1.0 + self.excess) / dt;
        for &(at, row, size) in &self.noise {
            for i in 0..size {
                density[row + i] = rate * self.q[at + i * size + i];
            }
        }
    }

    /// `(row, column)` of each value of the noise: those of the processes, then of the blocks' own dynamics.
    pub(super) fn noise_places(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let blocks = self.noise.iter().flat_map(|&(_, row, size)| {
            (0..size * size).map(move |k| (row + k / size, row + k % size))
        });
        blocks.chain(self.own.iter().map(|own| (own.row, own.row)))
    }

    /// `Q` as the models give it, as row, column and value.
    fn given_noise(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let share = 1.0 + self.excess;
        let values = self.q.iter().map(move |q| share * q).chain(self.own.iter().map(|own| own.q));
        self.noise_places().zip(values).map(|((i, j), q)| (i, j, q))
    }

    /// The noise that comes before `Phi`, as row, column and value: that of a step none, that of a pool of
    /// steps a share.
    pub fn noise_before(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let early = self.carried.early;
        let given = self.given_noise().filter(move |_| early > 0.0);
        given.map(move |(i, j, q)| (i, j, early * q))
    }

    /// The noise that comes after `Phi`, as row, column and value; several values of one place add up.
    pub fn noise_after(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let late = 1.0 - self.carried.early;
        let given = self.given_noise().map(move |(i, j, q)| (i, j, late * q));
        let further = self.carried.places.iter().zip(&self.carried.values);
        given.chain(further.flat_map(|(&(i, j), &q)| [(i, j, q), (j, i, q)]))
    }

    /// The elements of `Q`, as row, column and value; several values of one place add up.
    pub fn noise_elements(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.noise_after().chain(self.carried_noise())
    }

    /// `Phi Q Phi'` for the noise that comes before `Phi`.
    fn carried_noise(&self) -> impl Iterator<Item = (usize, usize, f64)> + use<> {
        let mut columns: Vec<Vec<(usize, f64)>> = Vec::new();
        let mut sums = Vec::new();
        if self.carried.early > 0.0 {
            let places = || self.places.iter().copied().chain(self.noise_places());
            let n = places().map(|(i, j)| i.max(j) + 1).max().unwrap_or(0);
            let rows = self.kernel.rows();
            // a row without declared elements is that of the identity
            let kept = |i: usize| rows.binary_search(&i).is_err().then_some((i, 1.0));
            columns.extend((0..n).map(|i| kept(i).into_iter().collect()));
            self.elements().for_each(|(i, j, value)| columns[j].push((i, value)));
            sums.resize(n * n, 0.0);
            for (a, b, q) in self.noise_before() {
                for (i, left) in &columns[a] {
                    columns[b].iter().for_each(|(j, right)| sums[i * n + j] += left * q * right);
                }
            }
        }
        let n = columns.len();
        let sums = sums.into_iter().enumerate().filter(|(_, q)| *q != 0.0);
        sums.map(move |(at, q)| (at / n, at % n, q))
    }

    /// `Q` as a dense matrix.
    pub fn noise_dense(&self, n: usize) -> nalgebra::DMatrix<f64> {
        let mut q = nalgebra::DMatrix::zeros(n, n);
        self.noise_elements().for_each(|(i, j, value)| q[(i, j)] += value);
        q
    }
}

/// As [`add_block`], for three axes.
#[inline(always)]
fn add_three(p: &mut [f64], stride: usize, column: usize, q: &[f64; 9], share: f64) {
    for (i, q) in q.as_chunks::<3>().0.iter().enumerate() {
        let p = &mut p[i * stride + column..][..3];
        p.iter_mut().zip(q).for_each(|(p, q)| *p += share * q);
    }
}

/// Adds `share` times a block of `size` rows to the rows of `p`, from that column on.
fn add_block(p: &mut [f64], stride: usize, column: usize, size: usize, q: &[f64], share: f64) {
    for (p, q) in p.chunks_exact_mut(stride).zip(q.chunks_exact(size.max(1))) {
        p[column..column + size].iter_mut().zip(q).for_each(|(p, q)| *p += share * q);
    }
}

#[cfg(test)]
mod tests {
    use super::super::NoiseSlot;
    use super::*;
    use nalgebra::SMatrix;

    /// Noise of a process on two states, and of the own dynamics of a third one.
    fn transition(own: f64) -> Transition {
        let mut transition = Transition::default();
        let slot: NoiseSlot<2> = transition.noise(Some(0));
        transition.set_noise(slot, &SMatrix::from([[4.0, 1.0], [1.0, 2.0]]));
        let first = transition.own_block(2, 1, false);
        transition.set_own(first, 0, None, own);
        transition
    }

    fn noise(transition: &Transition) -> [[f64; 3]; 3] {
        let mut p = Covariance::zero(3);
        transition.add_noise(&mut p);
        let dense = transition.noise_dense(3);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                assert_eq!(p.get(i, j), dense[(i, j)]);
                p.get(i, j)
            })
        })
    }

    /// Three times the standard deviation is nine times the variance.
    #[test]
    fn the_noise_of_the_processes_is_scaled_and_that_of_own_dynamics_stays() {
        let mut transition = transition(0.5);
        transition.scale_noise(3.0);
        assert_eq!(noise(&transition), [[36.0, 9.0, 0.0], [9.0, 18.0, 0.0], [0.0, 0.0, 0.5]]);
    }
}
