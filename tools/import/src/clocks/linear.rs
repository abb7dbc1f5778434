//! The offset and the drift of a clock as parameters of a linear model, beside the errors of both sensors.
//!
//! Other errors look like an offset. An antenna ahead of the point about which a vehicle turns by a lever arm `L` has the
//! course `psi + L w / v`, as if its clock were `L / v` ahead. The model has these errors with their usual sizes as
//! priors, so that the sigma contains what the motion does not separate.
//!
//! The noise of the rows is correlated: changes share samples, receivers filter, tilts last. The sigma is that of the
//! sum of the rows' influences on the offset, with their covariances up to a lag (Newey and West, Econometrica 55, 1987).
//! Each residual is divided by one minus its leverage, because the fit makes residuals smaller than the noise.

use super::errors::OTHERS;
use super::inertial::Inertial;
use super::measured::{LEAST, Measured, Pair};
use navfuse_core::nalgebra::{SMatrix, SVector};

/// 1-sigma of a drift: beyond it, a clock is no quartz.
const DRIFT: f64 = 1e-3;
/// Step of the derivative by the offset, s.
const STEP: f64 = 0.05;
/// Number of linearisations, and the largest change of the offset by one, s.
const ROUNDS: usize = 4;
const CHANGE: f64 = 0.5;
/// Least share of its noise that a residual has.
const LEVERAGE: f64 = 0.1;
/// Ratio of a parameter that no row has to the others, in the normal matrix.
const NOTHING: f64 = 1e-12;

/// Constant errors: the means of both axes, and a tilt to the north and to the east.
const CONSTANT: usize = 4;
/// Offset, drift, other errors, and constant ones.
const COUNT: usize = 2 + OTHERS + CONSTANT;
type Parameters = SVector<f64, COUNT>;

/// The offset at the middle of the recording, the drift, and the 1-sigma of each.
pub struct Line {
    pub offset: [f64; 2],
    pub drift: [f64; 2],
}

/// The differences between the changes that two sensors measure.
pub struct Differences<'a> {
    imu: &'a Inertial,
    measured: &'a Measured,
    levelled: Vec<[f64; 3]>,
    times: Vec<f64>,
    pub pairs: Vec<Pair>,
}

/// A row of the linear model: the index of its pair, its coefficients, and the difference.
struct Row(usize, Parameters, f64);

/// The normal equations of some rows.
struct Normal<const N: usize> {
    matrix: SMatrix<f64, N, N>,
    right: SVector<f64, N>,
    square: f64,
}

impl<const N: usize> Normal<N> {
    fn of(rows: impl Iterator<Item = (SVector<f64, N>, f64)>) -> Self {
        let mut matrix = SMatrix::<f64, N, N>::zeros();
        let (mut right, mut square) = (SVector::<f64, N>::zeros(), 0.0);
        for (row, difference) in rows {
            matrix.syger(1.0, &row, &row, 1.0);
            right.axpy(difference, &row, 1.0);
            square += difference * difference;
        }
        matrix.fill_upper_triangle_with_lower_triangle();
        Self { matrix, right, square }
    }

    /// The inverse of the normal matrix with the information of priors.
    fn inverse(&self, prior: &SVector<f64, N>) -> Option<SMatrix<f64, N, N>> {
        let least = NOTHING * self.matrix.diagonal().max();
        let information = prior.map(|information| information.max(least));
        Some((self.matrix + SMatrix::from_diagonal(&information)).cholesky()?.inverse())
    }

    /// The sum of squares that a fit leaves.
    fn rest(&self) -> f64 {
        let fitted = self.inverse(&SVector::zeros()).map(|p| self.right.dot(&(p * self.right)));
        (self.square - fitted.unwrap_or(0.0)).max(0.0)
    }
}

impl<'a> Differences<'a> {
    /// The differences of samples `apart` places apart, with the levelling of the IMU at an offset.
    pub fn new(imu: &'a Inertial, measured: &'a Measured, apart: usize, offset: f64) -> Self {
        let (levelled, pairs) = (measured.levelled(imu, offset), measured.pairs(apart));
        Self { imu, measured, levelled, times: measured.times(), pairs }
    }

    /// Removes the pairs outside the recording of the IMU at one of two offsets.
    pub fn inside(mut self, range: [f64; 2]) -> Self {
        let pairs = std::mem::take(&mut self.pairs);
        let inside = |k: &Pair| range.iter().all(|tau| self.at(*k, *tau).is_some());
        self.pairs = pairs.into_iter().filter(inside).collect();
        self
    }

    /// The difference of a pair at an offset.
    fn at(&self, pair: Pair, tau: f64) -> Option<[f64; 2]> {
        self.measured.residual(self.imu, &self.levelled, pair, tau)
    }

    /// The coefficients of the constant errors in the rows of both axes. Slow levelling lets the rotation of the Earth
    /// tilt the IMU about the horizontal by a constant angle in space.
    fn constant(&self, pair: Pair, tau: f64) -> [[f64; CONSTANT]; 2] {
        if self.measured.axes() == 1 {
            return [[1.0, 0.0, 0.0, 0.0]; 2];
        }
        let [from, to] = pair.map(|k| self.times[k]);
        let heading = self.imu.at(0.5 * (from + to) - tau).map_or(0.0, |sums| sums[6]);
        let (sin, cos) = heading.sin_cos();
        [[1.0, 0.0, cos, sin], [0.0, 1.0, -sin, cos]]
    }

    /// The sum of the squares of the differences at an offset, without constant errors.
    pub fn cost(&self, tau: f64) -> f64 {
        let rows = self.pairs.iter().filter_map(|pair| Some((pair, self.at(*pair, tau)?)));
        let rows = rows.flat_map(|(pair, differences)| {
            let rows = self.constant(*pair, tau).into_iter().zip(differences);
            rows.take(self.measured.axes()).map(|(row, r)| (SVector::from(row), r))
        });
        Normal::of(rows).rest()
    }

    /// The rows of the linear model at an offset and a drift, with the same differences for each of other errors.
    fn rows(&self, others: &[Self], middle: f64, [offset, drift]: [f64; 2]) -> Vec<Row> {
        let mut rows = Vec::with_capacity(self.pairs.len() * self.measured.axes());
        for (index, pair) in self.pairs.iter().enumerate() {
            let weight = self.measured.weight(*pair);
            let since = self.times[pair[0]] - middle;
            let tau = offset + drift * since;
            let Some(here) = self.at(*pair, tau) else { continue };
            let beside = self.at(*pair, tau - STEP).zip(self.at(*pair, tau + STEP));
            let Some((before, after)) = beside else { continue };
            let moved = others.iter().map(|other| other.at(*pair, tau).unwrap_or(here));
            let moved: Vec<[f64; 2]> = moved.collect();
            for (axis, constant) in self.constant(*pair, tau).iter().enumerate() {
                if axis == self.measured.axes() {
                    break;
                }
                let slope = (after[axis] - before[axis]) / (2.0 * STEP);
                let mut row = Parameters::zeros();
                [row[0], row[1]] = [slope, slope * since * DRIFT];
                for (k, moved) in moved.iter().enumerate() {
                    row[2 + k] = moved[axis] - here[axis];
                }
                row.fixed_rows_mut::<CONSTANT>(2 + OTHERS).copy_from_slice(constant);
                rows.push(Row(index, row * weight, here[axis] * weight));
            }
        }
        rows
    }

    /// Finds the offset and the drift, from a first offset on.
    pub fn line(&self, start: f64, apart: usize, shared: usize) -> Option<Line> {
        let middle = 0.5 * (self.times.first()? + self.times.last()?);
        let (mut at, mut line) = ([start, 0.0], None);
        for _ in 0..ROUNDS {
            let others = self.measured.others(self.imu, at[0]);
            let of = |other| Differences::new(self.imu, other, apart, start);
            let others: Vec<Differences<'_>> = others.iter().map(of).collect();
            let rows = self.rows(&others, middle, at);
            let found = self.solve(&rows, at, shared)?;
            let [offset, drift] = [found.offset[0], found.drift[0]];
            at = [offset.clamp(at[0] - CHANGE, at[0] + CHANGE), drift];
            line = Some(found);
        }
        line
    }

    /// Solves the linear model with the priors of drift and other errors.
    fn solve(&self, rows: &[Row], [offset, drift]: [f64; 2], shared: usize) -> Option<Line> {
        if self.pairs.len() < LEAST {
            return None;
        }
        let normal = Normal::of(rows.iter().map(|Row(_, row, r)| (*row, *r)));
        let variance = normal.rest() / rows.len().saturating_sub(COUNT).max(1) as f64;
        // unit sigma of the drift and of other errors, against the noise of the rows
        let known = |k: usize| if (1..2 + OTHERS).contains(&k) { variance } else { 0.0 };
        let prior = Parameters::from_fn(|k, _| known(k));
        let inverse = normal.inverse(&prior)?;
        let mut right = normal.right;
        // the prior of the drift counts from zero
        right[1] += prior[1] * drift / DRIFT;
        let found = inverse * right;
        let mut influences = vec![[0.0; 2]; self.pairs.len()];
        for Row(index, row, difference) in rows {
            let gain = inverse * row;
            let own = (1.0 - gain.dot(row)).max(LEVERAGE);
            let residual = (difference - row.dot(&found)) / own;
            for (sum, gain) in influences[*index].iter_mut().zip([gain[0], gain[1]]) {
                *sum += gain * residual;
            }
        }
        let lag = lag(influences.len(), shared);
        let sigma = |k: usize| {
            let of_priors = prior.map(|p| p * variance).dot(&inverse.column(k).map(|x| x * x));
            (long_run(&influences, k, lag) + of_priors).sqrt()
        };
        Some(Line {
            offset: [offset - found[0], sigma(0)],
            drift: [drift - DRIFT * found[1], DRIFT * sigma(1)],
        })
    }
}

/// The number of pairs over which noise is correlated: at least over those that share a sample.
fn lag(pairs: usize, shared: usize) -> usize {
    ((pairs as f64).sqrt() as usize).max(2 * shared + 1)
}

/// The variance of the sum of correlated numbers, with weights that keep it positive (Bartlett).
fn long_run(numbers: &[[f64; 2]], k: usize, lag: usize) -> f64 {
    let product =
        |l: usize| numbers.iter().zip(&numbers[l..]).map(|(a, b)| a[k] * b[k]).sum::<f64>();
    let lags = 1..=lag.min(numbers.len() - 1);
    let weighted = |l: usize| 2.0 * (1.0 - l as f64 / (lag + 1) as f64) * product(l);
    product(0) + lags.map(weighted).sum::<f64>()
}
