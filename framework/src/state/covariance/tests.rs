//! The structured covariance equals the textbook's dense form, on random compositions.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use super::{
    BackwardStep, Covariance, NoiseSlot, PhiDiagonal, PhiSlot, Pool, Product, Transition, Update,
};
use crate::compose::Composer;
use crate::state::dynamics::BlockDynamics;
use crate::state::manifold::Vector;
use crate::state::{BlockSpec, Display, Dynamics, Layout, Mode};
use nalgebra::{DMatrix, DVector, SMatrix};
use proptest::prelude::*;
use pulp::Arch;

/// Double precision leaves 2^-53; a sum of k products of norm one is good to k 2^-53. The longest
/// chain here has k = 3 x 36 terms, so 1.2e-14 of the largest product; 1e-12 is what the framework
/// promises.
const RELATIVE: f64 = 1e-12;

/// Calls `f::<N>(...)`, or `f::<R, N>(...)`, for an `N` of 1 to 6.
macro_rules! sized {
    ($n:expr, $f:ident $arguments:tt) => { sized!($n, $f [] $arguments) };
    ($n:expr, $f:ident [$($r:ident)?] ($($a:expr),*)) => {
        match $n {
            1 => $f::<$($r,)? 1>($($a),*),
            2 => $f::<$($r,)? 2>($($a),*),
            3 => $f::<$($r,)? 3>($($a),*),
            4 => $f::<$($r,)? 4>($($a),*),
            5 => $f::<$($r,)? 5>($($a),*),
            _ => $f::<$($r,)? 6>($($a),*),
        }
    };
}

/// Numbers in -1..1, from a seed.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }

    /// Symmetric and positive definite.
    fn definite(&mut self, n: usize) -> DMatrix<f64> {
        let a = self.matrix(n, n);
        &a * a.transpose() + DMatrix::identity(n, n) * 0.1
    }
}

type Fill = Box<dyn Fn(&mut Transition, &mut Numbers)>;

fn add_block<const N: usize>(composer: &mut Composer, name: &str, mode: Mode, dynamics: Dynamics) {
    let display = Display { unit: "", scale: 1.0, components: &[] };
    let (initial, sigma) = (vec![0.0; N], vec![1.0; N]);
    composer
        .block::<Vector<N>>(
            name,
            BlockSpec { mode, initial, sigma, truth: None, dynamics, display },
        )
        .unwrap();
}

fn add_phi<const R: usize, const C: usize>(
    t: &mut Transition,
    row: Option<usize>,
    column: Option<usize>,
) -> Fill {
    let slot: PhiSlot<R, C> = t.phi(row, column);
    Box::new(move |t, u| {
        let block = SMatrix::<f64, R, C>::from_fn(|_, _| u.next());
        t.set(slot, &block);
    })
}

fn add_rows<const R: usize>(
    t: &mut Transition,
    row: Option<usize>,
    column: Option<usize>,
    width: usize,
) -> Fill {
    sized!(width, add_phi[R](t, row, column))
}

fn add_diagonal<const N: usize>(t: &mut Transition, row: Option<usize>) -> Fill {
    let slot: PhiDiagonal<N> = t.phi_diagonal(row, row);
    Box::new(move |t, u| t.set_diagonal(slot, &std::array::from_fn(|_| u.next())))
}

fn add_noise<const N: usize>(t: &mut Transition, row: Option<usize>) -> Fill {
    let slot: NoiseSlot<N> = t.noise(row);
    Box::new(move |t, u| {
        let a = SMatrix::<f64, N, N>::from_fn(|_, _| u.next());
        t.set_noise(slot, &(a * a.transpose()));
    })
}

/// One block of a random composition, and how a process model moves it, if one does.
#[derive(Clone, Debug)]
struct BlockCase {
    dimension: usize,
    mode: u8,
    dynamics: u8,
    driven: bool,
    /// Which blocks its rows of Phi depend on, one bit each.
    depends: u8,
    diagonal: bool,
    noisy: bool,
}

fn block_case() -> impl Strategy<Value = BlockCase> {
    (1..=6_usize, 0..4_u8, 0..3_u8, any::<bool>(), any::<u8>(), any::<bool>(), any::<bool>())
        .prop_map(|(dimension, mode, dynamics, driven, depends, diagonal, noisy)| BlockCase {
            dimension,
            mode,
            dynamics,
            driven,
            depends,
            diagonal,
            noisy,
        })
}

/// The layout and transition of the blocks, with every declared place filled.
fn compose(cases: &[BlockCase], u: &mut Numbers) -> (Layout, Transition, BlockDynamics) {
    let mut composer = Composer::default();
    for (k, case) in cases.iter().enumerate() {
        let mode = match case.mode {
            0 => Mode::Fixed,
            1 => Mode::Consider,
            _ => Mode::Estimate,
        };
        let positive =
            |u: &mut Numbers| (0..case.dimension).map(|_| 1.1 + u.next()).collect::<Vec<f64>>();
        let dynamics = match case.dynamics {
            _ if case.driven => Dynamics::Constant,
            0 => Dynamics::Constant,
            1 => Dynamics::RandomWalk(positive(u)),
            _ => Dynamics::GaussMarkov { sigma: positive(u), time: 1.5 + u.next() },
        };
        sized!(case.dimension, add_block(&mut composer, &format!("b{k}"), mode, dynamics));
    }
    let (layout, mut transition, _) = composer.finish();
    let tangent: Vec<Option<usize>> = layout.blocks.iter().map(|b| b.tangent).collect();
    let mut fills: Vec<Fill> = Vec::new();
    for (k, case) in cases.iter().enumerate().filter(|(_, c)| c.driven) {
        for (j, other) in cases.iter().enumerate().filter(|(j, _)| case.depends >> j & 1 == 1) {
            let t = &mut transition;
            if j == k && case.diagonal {
                fills.push(sized!(case.dimension, add_diagonal(t, tangent[k])));
            } else {
                fills.push(sized!(
                    case.dimension,
                    add_rows(t, tangent[k], tangent[j], other.dimension)
                ));
            }
        }
        if case.noisy {
            fills.push(sized!(case.dimension, add_noise(&mut transition, tangent[k])));
        }
    }
    let dynamics = BlockDynamics::new(&layout, &mut transition);
    fills.iter().for_each(|fill| fill(&mut transition, u));
    (layout, transition, dynamics)
}

fn covariance_of(dense: &DMatrix<f64>) -> Covariance {
    let mut p = Covariance::zero(dense.nrows());
    (0..dense.nrows())
        .for_each(|i| (0..=i).for_each(|j| p.set(i, j, 0.5 * (dense[(i, j)] + dense[(j, i)]))));
    p
}

/// The elements to the bit: results must not depend on the instructions of the processor.
fn bits(p: &Covariance) -> Vec<u64> {
    p.p.iter().map(|x| x.to_bits()).collect()
}

fn largest(m: &DMatrix<f64>) -> f64 {
    m.iter().fold(0.0, |a, x| a.max(x.abs()))
}

fn same(found: &Covariance, expected: &DMatrix<f64>) -> Result<(), TestCaseError> {
    let found = found.to_dense();
    prop_assert_eq!(&found, &found.transpose(), "it is symmetric to the bit");
    let (error, bound) =
        (largest(&(&found - expected)), RELATIVE * largest(expected).max(f64::MIN_POSITIVE));
    prop_assert!(error <= bound, "{:e} of {:e}", error, bound);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn propagation_is_phi_p_phi_transposed_plus_q(
        cases in prop::collection::vec(block_case(), 1..=8),
        seed in any::<u64>(),
        dt in 0.001..2.0_f64,
    ) {
        let mut u = Numbers(seed);
        let (layout, mut transition, mut dynamics) = compose(&cases, &mut u);
        let n = layout.tangent;
        prop_assume!(n > 0);
        let mut state = layout.initial_state();
        dynamics.propagate(&layout, &mut state, dt, &mut transition);
        let (phi, q) = (transition.phi_dense(n), transition.noise_dense(n));
        // what the dense form is made of is checked too: the own dynamics of a block, from their
        // definition
        for (block, _) in layout.blocks.iter().zip(&cases).filter(|(b, c)| b.tangent.is_some() && !c.driven) {
            for (axis, k) in block.tangent_range().enumerate() {
                let (f, noise) = match &block.spec.dynamics {
                    Dynamics::Constant => (1.0, 0.0),
                    Dynamics::RandomWalk(density) => (1.0, density[axis] * dt),
                    Dynamics::GaussMarkov { sigma, time } => {
                        let f = (-dt / time).exp();
                        (f, sigma[axis].powi(2) * (1.0 - f * f))
                    }
                };
                prop_assert!((phi[(k, k)] - f).abs() < 1e-15);
                // 1 - f^2 cancels to 2^-53 of one, times sigma^2 < 4.5
                prop_assert!((q[(k, k)] - noise).abs() < 1e-14, "{} {}", q[(k, k)], noise);
            }
        }
        let mut dense = u.definite(n);
        let mut p = covariance_of(&dense);
        dense = p.to_dense();
        let (mut portable, mut same_p) = (transition.clone(), p.clone());
        portable.kernel.processor = Arch::Scalar;
        let stride = n.next_multiple_of(4);
        let mut g: Vec<f64> = (0..n * stride).map(|_| u.next()).collect();
        let (mut same_g, mut work) = (g.clone(), Vec::new());
        let mut product = Product::default();
        for _ in 0..3 {
            transition.propagate(&mut p);
            portable.propagate(&mut same_p);
            prop_assert_eq!(bits(&p), bits(&same_p));
            dense = &phi * &dense * phi.transpose() + &q;
            same(&p, &dense)?;
            transition.carry(&mut g, stride, &mut work);
            portable.carry(&mut same_g, stride, &mut work);
            prop_assert_eq!(&g, &same_g);
            prop_assert!(product.append(&transition));
        }
        // the elements of the product are all that differ from the identity
        let values: Vec<f64> = product.values().collect();
        let whole = phi.pow(3);
        let expected = whole.transpose() * dense.clone() * &whole;
        let mut back = covariance_of(&dense);
        BackwardStep::new(n, product.places()).pass(&values, &mut back);
        let symmetric = 0.5 * (&expected + expected.transpose());
        same(&back, &symmetric)?;
        // the places of another transition may be others
        let mut other = transition.clone();
        other.compile(&layout);
        prop_assert!(!product.append(&other));
        product.restart();
        prop_assert!(product.append(&other) && !product.is_empty());
    }

    #[test]
    fn a_pool_of_steps_lacks_the_third_order_and_its_transition_moves_the_covariance(
        cases in prop::collection::vec(block_case(), 1..=8),
        seed in any::<u64>(),
        steps in 1..=4_i32,
    ) {
        let mut u = Numbers(seed);
        let (layout, mut step, _) = compose(&cases, &mut u);
        let n = layout.tangent;
        prop_assume!(n > 0);
        let identity = step.identity();
        step.phi.iter_mut().zip(&identity).for_each(|(phi, one)| *phi = one + 0.01 * *phi);
        let prior = u.definite(n);
        let mut pool = Pool::new(&layout, &step);
        let mut still = step.clone();
        still.q.fill(0.0);
        still.own.iter_mut().for_each(|own| own.q = 0.0);
        // a row without an element of its own does not keep its state: each step is one of its own
        let own = identity.iter().filter(|one| **one != 0.0).count();
        let complete = own == step.kernel.rows().len();
        let mut moved = covariance_of(&prior);
        for _ in 0..steps {
            if pool.add(&still, 0.5) && !complete {
                pool.take(&mut moved);
            }
        }
        if !pool.is_empty() {
            pool.take(&mut moved);
        }
        let phi = step.phi_dense(n);
        let change = &phi - DMatrix::identity(n, n);
        let mut lacking = match (complete, steps) {
            (true, 3) => change.pow(3),
            (true, 4) => change.pow(3) * 4.0 + change.pow(4),
            _ => DMatrix::zeros(n, n),
        };
        let alone = |i: &usize| step.places().iter().filter(|place| place.0 == *i).count() == 1;
        let decays = |i: &usize| alone(i) && step.places().contains(&(*i, *i));
        (0..n).filter(decays).for_each(|i| lacking.row_mut(i).fill(0.0));
        let whole = phi.pow(u32::try_from(steps).unwrap()) - lacking;
        same(&moved, &(&whole * &prior * whole.transpose()))?;
        // with noise, and steps of different lengths
        for k in 1..=steps {
            pool.add(&step, 0.3 * f64::from(k));
        }
        let mut moved = covariance_of(&prior);
        let whole = pool.take(&mut moved);
        let (phi, q) = (whole.phi_dense(n), whole.noise_dense(n));
        same(&moved, &(&phi * &prior * phi.transpose() + q))?;
    }

    #[test]
    fn the_update_is_josephs_form_with_the_gain_of_considered_states_zero(
        cases in prop::collection::vec(block_case(), 1..=6),
        seed in any::<u64>(),
        reads in any::<u8>(),
        m in 1..=6_usize,
    ) {
        let mut u = Numbers(seed);
        let (layout, _, _) = compose(&cases, &mut u);
        let n = layout.tangent;
        let columns: Vec<usize> = (layout.blocks.iter().enumerate())
            .filter(|(k, _)| reads >> k & 1 == 1)
            .flat_map(|(_, b)| b.tangent_range())
            .collect();
        prop_assume!(n > 0);
        let considered: Vec<bool> = (0..n)
            .map(|i| layout.blocks.iter().any(|b| b.spec.mode == Mode::Consider && b.tangent_range().contains(&i)))
            .collect();
        let (h, r) = (u.matrix(m, columns.len()), u.definite(m));
        let innovation = DVector::from_fn(m, |_, _| u.next());
        let mut p = covariance_of(&u.definite(n));
        let prior = p.to_dense();
        let mut full = DMatrix::zeros(m, n);
        columns.iter().enumerate().for_each(|(k, c)| full.set_column(*c, &h.column(k)));

        let mut update = Update::with_capacity(n, m);
        update.m = m;
        update.columns.clone_from(&columns);
        update.h = h.transpose().as_slice().to_vec();
        update.r = r.as_slice().to_vec();
        update.innovation = innovation.as_slice().to_vec();
        let (mut portable, mut same) = (update.clone(), p.clone());
        portable.processor = Arch::Scalar;
        let nis = update.innovate(&p).unwrap();
        update.apply(&mut p, &considered);
        prop_assert_eq!(portable.innovate(&same).map(f64::to_bits), Some(nis.to_bits()));
        portable.apply(&mut same, &considered);
        prop_assert_eq!(bits(&p), bits(&same));
        prop_assert_eq!(update.gain(), portable.gain());

        let s = &full * &prior * full.transpose() + &r;
        let inverse = s.clone().cholesky().unwrap().inverse();
        let mut gain = &prior * full.transpose() * &inverse;
        considered.iter().enumerate().filter(|(_, c)| **c).for_each(|(i, _)| gain.row_mut(i).fill(0.0));
        let a = DMatrix::identity(n, n) - &gain * &full;
        let posterior = &a * &prior * a.transpose() + &gain * &r * gain.transpose();
        // S is inverted: its condition number, at most 1e3 here, multiplies the rounding of S
        let condition = largest(&s) * largest(&inverse) * m as f64;
        let expected = (innovation.transpose() * &inverse * &innovation)[(0, 0)];
        prop_assert!((nis - expected).abs() <= RELATIVE * condition * expected.max(1.0));
        let delta = &gain * &innovation;
        for (found, expected) in update.delta.iter().zip(delta.iter()) {
            prop_assert!((found - expected).abs() <= RELATIVE * condition * largest(&gain).max(1.0));
        }
        let found = p.to_dense();
        prop_assert_eq!(&found, &found.transpose());
        let error = largest(&(&found - &posterior));
        prop_assert!(error <= RELATIVE * condition * largest(&prior), "{:e}", error);
        // a considered state keeps its variance to the bit, with every other considered state
        for i in (0..n).filter(|i| considered[*i]) {
            for j in (0..n).filter(|j| considered[*j]) {
                prop_assert_eq!(found[(i, j)].to_bits(), prior[(i, j)].to_bits());
            }
        }
    }

    #[test]
    fn an_update_changes_only_what_is_correlated_with_the_innovation(
        seed in any::<u64>(), groups in prop::collection::vec(1..=7_usize, 2..=8), reads in 1..=255_u8,
    ) {
        let mut u = Numbers(seed);
        // independent groups of states: the covariance is zero between them
        let n: usize = groups.iter().sum();
        let (mut dense, mut first) = (DMatrix::zeros(n, n), 0);
        let mut reached = vec![false; n];
        for (k, &size) in groups.iter().enumerate() {
            dense.view_mut((first, first), (size, size)).copy_from(&u.definite(size));
            reached[first..first + size].fill(reads >> k & 1 == 1);
            first += size;
        }
        prop_assume!(reached.contains(&true));
        let mut p = covariance_of(&dense);
        let prior = p.to_dense();
        let columns: Vec<usize> = (0..n).filter(|i| reached[*i]).collect();
        let (h, r) = (u.matrix(2, columns.len()), u.definite(2));
        let mut full = DMatrix::zeros(2, n);
        columns.iter().enumerate().for_each(|(k, c)| full.set_column(*c, &h.column(k)));
        let mut update = Update::with_capacity(n, 2);
        update.m = 2;
        update.columns = columns;
        update.h = h.transpose().as_slice().to_vec();
        update.r = r.as_slice().to_vec();
        update.innovation = vec![0.3, -0.2];
        update.innovate(&p).unwrap();
        update.apply(&mut p, &vec![false; n]);
        let found = p.to_dense();
        let s = &full * &prior * full.transpose() + &r;
        let inverse = s.clone().cholesky().unwrap().inverse();
        let gain = &prior * full.transpose() * &inverse;
        let a = DMatrix::identity(n, n) - &gain * &full;
        let posterior = &a * &prior * a.transpose() + &gain * &r * gain.transpose();
        let condition = largest(&s) * largest(&inverse) * 2.0;
        let error = largest(&(&found - &posterior));
        prop_assert!(error <= RELATIVE * condition * largest(&prior), "{:e}", error);
        prop_assert_eq!(&found, &found.transpose());
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if !reached[i] || !reached[j] {
                prop_assert_eq!(found[(i, j)].to_bits(), prior[(i, j)].to_bits());
            }
        }
    }

    /// Each element is a sum of two terms, so the rounding is that of numbers of their size.
    #[test]
    fn widening_adds_the_multiple_of_one_direction(
        seed in any::<u64>(), n in 1..=8_usize, a in 0.0..1e3_f64,
    ) {
        let mut u = Numbers(seed);
        let mut p = covariance_of(&u.definite(n));
        let (prior, s) = (p.to_dense(), u.matrix(n, 1));
        p.widen(a, |i| s[i]);
        let expected = prior + &s * s.transpose() * a;
        let off = p.to_dense() - &expected;
        prop_assert!(largest(&off) <= 1e-14 * largest(&expected), "{:e}", largest(&off));
        prop_assert_eq!(p.to_dense().transpose(), p.to_dense());
    }

    #[test]
    fn inflation_multiplies_what_the_sensor_sees_and_adds_only_positive_parts(
        seed in any::<u64>(), n in 1..=8_usize, m in 1..=4_usize, c in 0.1..1e4_f64,
    ) {
        let m = m.min(n);
        let mut u = Numbers(seed);
        let mut p = covariance_of(&u.definite(n));
        let (prior, h, r) = (p.to_dense(), u.matrix(m, n), u.definite(m));
        let seen = &h * &prior * h.transpose();
        prop_assume!(seen.clone().symmetric_eigenvalues().min() > 1e-3); // H of full rank
        let mut update = Update::with_capacity(n, m);
        update.m = m;
        update.columns = (0..n).collect();
        update.h = h.transpose().as_slice().to_vec();
        update.r = r.as_slice().to_vec();
        update.innovation = vec![1.0; m];
        update.innovate(&p).unwrap();
        prop_assert!(update.inflate(&mut p, &vec![false; n], c));
        let after = p.to_dense();
        let now = &h * &after * h.transpose();
        // H P' H' = (1 + c) H P H' but for the 1e-9 that keep A invertible, times |S| / |A| < 1e5
        prop_assert!(largest(&(now - &seen * (1.0 + c))) <= 2e-4 * largest(&seen) * (1.0 + c));
        let smallest = (&after - &prior).symmetric_eigenvalues().min();
        prop_assert!(smallest >= -1e-12 * largest(&after), "{:e}", smallest);
    }
}

#[test]
fn an_infinite_innovation_is_told_and_a_singular_one_refused() {
    let mut p = Covariance::zero(1);
    p.set(0, 0, 1.0);
    let mut update = Update::with_capacity(1, 1);
    update.m = 1;
    update.columns = vec![0];
    update.h = vec![1.0];
    update.r = vec![0.0];
    update.innovation = vec![1e200];
    assert_eq!(update.innovate(&p), Some(f64::INFINITY));
    p.set(0, 0, 0.0);
    assert_eq!(update.innovate(&p), None);
}

/// Every width of the kernel's last columns, and more than one group.
#[test]
fn the_product_p_x_p_is_that_of_dense_matrices() {
    for n in 1..=45 {
        let mut u = Numbers(n as u64);
        let (p, x) = (u.definite(n), u.definite(n));
        let (mut work, mut out) = (Vec::new(), Covariance::zero(n));
        super::back::sandwich(&covariance_of(&p), &covariance_of(&x), &mut work, &mut out);
        // three factors of n terms each
        let (expected, found) = (&p * &x * &p, out.to_dense());
        let error = largest(&(found - &expected));
        assert!(error <= RELATIVE * largest(&expected), "{n}: {error:e}");
    }
}

#[test]
fn a_shear_and_the_one_of_the_information_are_those_of_a_dense_matrix() {
    for (n, rows, k) in [(4, 0..3, 3), (9, 3..6, 2), (9, 3..6, 8), (13, 10..13, 0)] {
        let mut u = Numbers(n as u64 + k as u64);
        let (p, g) = (u.definite(n), nalgebra::Vector3::from_fn(|_, _| u.next()));
        let mut whole = DMatrix::identity(n, n);
        rows.clone().zip(&g).for_each(|(row, g)| whole[(row, k)] = *g);
        let (mut forth, mut back) = (covariance_of(&p), covariance_of(&p));
        forth.shear(rows.clone(), k, &g);
        back.shear_back(rows, k, &g);
        same(&forth, &(&whole * &p * whole.transpose())).unwrap();
        same(&back, &(whole.transpose() * &p * &whole)).unwrap();
    }
}
