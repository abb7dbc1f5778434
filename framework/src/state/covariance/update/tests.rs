//! The error that a sensor has measured, followed until its next sample, against dense matrices.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::super::reach::Reach;
use super::*;
use nalgebra::{DMatrix, DVector};

/// Dimension of the error state.
const N: usize = 7;
/// Columns of the sensor; the third one is considered.
const COLUMNS: [usize; 4] = [1, 3, 4, 6];
const CONSIDERED: [bool; N] = [false, false, false, false, true, false, false];
/// Channels 1, 2 and 4.
const PRESENT: u16 = 0b1_0110;
const M: usize = 3;

/// Numbers without a pattern, in -1..1: the fractions of multiples of the golden ratio.
fn numbers(seed: f64) -> impl FnMut() -> f64 {
    let mut k = 100.0 * seed;
    move || {
        k += 1.0;
        2.0 * (k * 0.618_033_988_749_895 + k * k * 0.171_572_875).fract() - 1.0
    }
}

fn definite(n: usize, next: &mut impl FnMut() -> f64) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |_, _| next());
    &a * a.transpose() + DMatrix::identity(n, n) * 0.5
}

/// A sample of the sensor, with its dense Jacobian.
struct Case {
    update: Update,
    covariance: Covariance,
    h: DMatrix<f64>,
    y: DVector<f64>,
}

impl Case {
    fn new(seed: f64) -> Self {
        let mut next = numbers(seed);
        let p = definite(N, &mut next);
        let mut covariance = Covariance::zero(N);
        (0..N * N).for_each(|k| covariance.set(k / N, k % N, p[(k / N, k % N)]));
        let mut update = Update::with_capacity(N, M);
        update.m = M;
        update.columns = COLUMNS.to_vec();
        update.h = (0..M * COLUMNS.len()).map(|_| next()).collect();
        update.r = definite(M, &mut next).as_slice().to_vec();
        update.innovation = (0..M).map(|_| 3.0 * next()).collect();
        update.innovate(&covariance).unwrap();
        let mut h = DMatrix::zeros(M, N);
        for (k, c) in COLUMNS.into_iter().enumerate() {
            (0..M).for_each(|a| h[(a, c)] = update.h[a * COLUMNS.len() + k]);
        }
        let y = DVector::from_column_slice(&update.innovation);
        Self { update, covariance, h, y }
    }

    fn s(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(M, M, &self.update.s)
    }

    /// The error that this sample has measured.
    fn reach(&mut self) -> Reach {
        let mut reach = Reach::with_capacity(N, M);
        self.update.begin(&self.covariance, &CONSIDERED, PRESENT, &mut reach);
        reach
    }
}

fn dense(reach: &Reach) -> DMatrix<f64> {
    DMatrix::from_fn(N, M, |i, a| reach.g[i * reach.stride + a])
}

/// Moves the followed error in any way.
fn move_on(reach: &mut Reach, seed: f64) -> DMatrix<f64> {
    let mut next = numbers(seed);
    let phi = DMatrix::identity(N, N) + DMatrix::from_fn(N, N, |_, _| 0.3 * next());
    let moved = phi * dense(reach);
    (0..N * M).for_each(|k| reach.g[k / M * reach.stride + k % M] = moved[(k / M, k % M)]);
    moved
}

fn near(found: &DMatrix<f64>, expected: &DMatrix<f64>, what: &str) {
    // sums of a few products, whose inverses have a condition of 1e3 at most
    let off = (found - expected).amax() / expected.amax().max(1.0);
    assert!(off < 1e-11, "{what}: {off:e}\n{found}{expected}");
}

/// `G = D H' (H D H' + 1e-9 S)^-1` with the variances `D` of the states that are not considered.
#[test]
fn a_measured_error_is_shared_among_the_states_by_their_variance() {
    let mut case = Case::new(1.0);
    let reach = case.reach();
    let variance = |i: usize| if CONSIDERED[i] { 0.0 } else { case.covariance.get(i, i) };
    let d = DMatrix::from_diagonal(&DVector::from_fn(N, |i, _| variance(i)));
    let a = &case.h * &d * case.h.transpose() + case.s() * 1e-9;
    let expected = &d * case.h.transpose() * a.try_inverse().unwrap();
    near(&dense(&reach), &expected, "G");
    // beyond the channels, rows are filled up with zeros
    let padding = |row: &[f64]| row[M..].iter().all(|g| *g == 0.0);
    assert!(reach.g.chunks_exact(reach.stride).all(padding) && reach.stride == 4);
}

#[test]
fn what_is_left_of_an_error_is_measured_in_the_metric_of_the_next_sample() {
    let mut first = Case::new(1.0);
    let mut reach = first.reach();
    let explained = &first.h * dense(&reach) * &first.y;
    let left = first.update.remaining(PRESENT, &reach).unwrap();
    assert!((left - 1.0).abs() < 1e-9, "{left}");
    let g = move_on(&mut reach, 2.0);
    let next = Case::new(3.0);
    let inverse = next.s().try_inverse().unwrap();
    let nis = |y: &DVector<f64>| (y.transpose() * &inverse * y)[(0, 0)];
    let expected = nis(&(&next.h * &g * &first.y)) / nis(&explained);
    let found = next.update.remaining(PRESENT, &reach).unwrap();
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    // other channels cannot be compared
    assert_eq!(next.update.remaining(PRESENT << 1, &reach), None);
    reach.end();
    assert_eq!(next.update.remaining(PRESENT, &reach), None);
}

/// The second sample has the channels 2, 4 and 5, the first one 1, 2 and 4.
#[test]
fn the_share_of_an_error_counts_the_channels_that_both_samples_have() {
    let mut first = Case::new(1.0);
    let reach = first.reach();
    let next = Case::new(3.0);
    let [before, now] = [&first.y, &next.y];
    let variance = next.s().diagonal();
    let along =
        |y: &DVector<f64>, a, b| y[a] * before[1] / variance[0] + y[b] * before[2] / variance[1];
    let ratio = along(now, 0, 1) / along(before, 1, 2);
    let found = next.update.share(0b11_0100, &reach);
    assert!((found - ratio.max(0.0).powi(2)).abs() < 1e-12, "{found} {ratio}");
    assert_eq!(next.update.share(0b1100_1000, &reach), 0.0);
}

/// `K = G (H G)^-1` in the rows of the states that the sensor does not see; a column of zeros in its
/// Jacobian is none that it sees.
#[test]
fn the_states_that_a_sensor_does_not_see_follow_the_error_that_it_measures() {
    let mut first = Case::new(1.0);
    let mut reach = first.reach();
    let g = move_on(&mut reach, 2.0);
    // the first sample that measures enough of the error in all of its channels
    let usable = |case: &Case| {
        let back = (&case.h * &g).try_inverse().unwrap();
        let sigma = case.s().diagonal().map(f64::sqrt);
        (0..M * M).all(|k| back[(k / M, k % M)].abs() * sigma[k % M] < 9.0 * sigma[k / M])
    };
    let blind = |k: i32| {
        let mut case = Case::new(f64::from(k));
        (0..M).for_each(|a| case.update.h[a * COLUMNS.len() + 1] = 0.0);
        case.h.column_mut(3).fill(0.0);
        case
    };
    let next = (3..100).map(blind).find(usable).unwrap();
    let mut expected = &g * (&next.h * &g).try_inverse().unwrap();
    for seen in [1, 4, 6] {
        expected.row_mut(seen).fill(0.0);
    }
    let found = next.update.unseen(&CONSIDERED, PRESENT, &reach);
    near(&DMatrix::from_row_slice(N, M, &found), &expected, "N");
    assert!(next.update.unseen(&CONSIDERED, PRESENT << 1, &reach).is_empty());
    // P + c N (S - R) N'
    let mut inflated = next.covariance.clone();
    next.update.inflate_unseen(&mut inflated, &found, 2.5);
    let a = next.s() - DMatrix::from_row_slice(M, M, &next.update.r);
    let expected = next.covariance.to_dense() + &expected * a * expected.transpose() * 2.5;
    near(&inflated.to_dense(), &expected, "P");
    reach.end();
    assert!(next.update.unseen(&CONSIDERED, PRESENT, &reach).is_empty());
}

/// Two channels with a sigma of 2 and 10 see two of three states. The other state has both errors.
fn unseen_with([a, b, c, d]: [f64; 4]) -> Vec<f64> {
    let mut update = Update::with_capacity(3, 2);
    (update.m, update.columns) = (2, vec![0, 1]);
    update.h = vec![1.0, 0.0, 0.0, 1.0];
    update.s = vec![4.0, 0.0, 0.0, 100.0];
    let g = vec![a, b, 0.0, 0.0, c, d, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
    let reach = Reach { channels: 0b11, stride: 4, g, ..Reach::default() };
    update.unseen(&[false; 3], 0b11, &reach)
}

/// In units of sigma, `(H G)^-1` is at most 10: one of its elements is 10 or a little more.
#[test]
fn an_error_that_is_hardly_measured_any_more_is_not_passed_on() {
    for sign in [1.0, -1.0] {
        assert_eq!(unseen_with([sign / 8.0, 0.0, 0.0, 1.0])[4..], [8.0 * sign, 1.0]);
        assert!(unseen_with([sign / 10.1, 0.0, 0.0, 1.0]).is_empty());
        assert!(unseen_with([1.0, 0.0, 0.0, sign / 10.1]).is_empty());
        // the inverse of [1 b; 0 1] is [1 -b; 0 1]: 10 / 2 of b, and 2 / 10 of c
        assert_eq!(unseen_with([1.0, 2.0 * sign, 0.0, 1.0])[4..], [1.0, 1.0 - 2.0 * sign]);
        assert!(unseen_with([1.0, 2.1 * sign, 0.0, 1.0]).is_empty());
        assert_eq!(unseen_with([1.0, 0.0, 50.0 * sign, 1.0])[4..], [1.0 - 50.0 * sign, 1.0]);
        assert!(unseen_with([1.0, 0.0, 51.0 * sign, 1.0]).is_empty());
    }
    assert!(unseen_with([1.0, 1.0, 1.0, 1.0]).is_empty(), "one direction alone");
}

/// `G = (I - K H) G`.
#[test]
fn an_update_by_another_sensor_corrects_the_error() {
    let mut first = Case::new(1.0);
    let mut reach = first.reach();
    let g = move_on(&mut reach, 2.0);
    let mut other = Case::new(5.0);
    other.update.apply(&mut other.covariance, &CONSIDERED);
    other.update.correct(&mut reach);
    let gain = DMatrix::from_row_slice(N, M, other.update.gain());
    near(&dense(&reach), &(&g - gain * (&other.h * &g)), "G");
}

/// `P H'`, and the noise over the roots of the weights of its two channels.
#[test]
fn a_channel_gets_the_noise_of_its_weight() {
    let mut case = Case::new(7.0);
    let p = case.covariance.to_dense();
    let cross: Vec<f64> = case.update.cross_covariance().collect();
    near(&DMatrix::from_row_slice(N, M, &cross), &(p * case.h.transpose()), "P H'");
    let before = case.update.r.clone();
    assert!(!case.update.weigh(|_| 1.0) && case.update.r == before);
    let normal: Vec<f64> = (0..M).map(|a| case.y[a] / case.s()[(a, a)].sqrt()).collect();
    let weight = |nu: f64| 1.0 / (1.0 + nu * nu);
    assert!(case.update.weigh(weight));
    for k in 0..M * M {
        let expected = before[k] / (weight(normal[k / M]) * weight(normal[k % M])).sqrt();
        assert!((case.update.r[k] - expected).abs() < 1e-13, "{k}");
    }
}
