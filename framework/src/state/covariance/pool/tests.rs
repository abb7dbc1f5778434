//! Pooled steps against the same steps one by one.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use super::Pool;
use crate::compose::Composer;
use crate::model::simulate::Random;
use crate::state::covariance::{Covariance, NoiseSlot, PhiSlot, Transition};
use crate::state::dynamics::BlockDynamics;
use crate::state::manifold::Vector;
use crate::state::{BlockSpec, Display, Dynamics, Layout, Mode};
use nalgebra::{DMatrix, SMatrix};

/// A chain: each of four states is the integral of the next one, of which the last decays.
struct Chain {
    layout: Layout,
    step: Transition,
    dynamics: BlockDynamics,
    slots: [PhiSlot<1, 1>; 6],
    noise: NoiseSlot<1>,
}

const STATES: usize = 4;
/// Correlation time of the last state, s.
const TIME: f64 = 5.0;

impl Chain {
    fn new() -> Self {
        let mut composer = Composer::default();
        for k in 0..STATES {
            let dynamics = match k {
                3 => Dynamics::GaussMarkov { sigma: vec![0.3], time: TIME },
                _ => Dynamics::Constant,
            };
            let display = Display { unit: "", scale: 1.0, components: &[] };
            let (initial, sigma) = (vec![0.0], vec![1.0]);
            let mode = Mode::Estimate;
            let spec = BlockSpec { mode, initial, sigma, truth: None, dynamics, display };
            composer.block::<Vector<1>>(&format!("s{k}"), spec).unwrap();
        }
        let (layout, mut step, _) = composer.finish();
        let at = |k| Some(k);
        let mut slots = Vec::new();
        for k in 0..3 {
            slots.push(step.phi(at(k), at(k)));
            slots.push(step.phi(at(k), at(k + 1)));
        }
        let noise = step.noise(at(2));
        let dynamics = BlockDynamics::new(&layout, &mut step);
        let slots = slots.try_into().unwrap();
        Self { layout, step, dynamics, slots, noise }
    }

    /// The next step, with a factor of each integral.
    fn step(&mut self, dt: f64, factors: [f64; 3], density: f64) -> &mut Transition {
        let one = |value| SMatrix::<f64, 1, 1>::new(value);
        for (k, factor) in factors.iter().enumerate() {
            self.step.set(self.slots[2 * k], &one(1.0));
            self.step.set(self.slots[2 * k + 1], &one(factor * dt));
        }
        self.step.set_noise(self.noise, &one(density * dt));
        let mut state = self.layout.initial_state();
        self.dynamics.propagate(&self.layout, &mut state, dt, &mut self.step);
        &mut self.step
    }
}

fn covariance(sigmas: [f64; STATES]) -> Covariance {
    let mut p = Covariance::zero(STATES);
    for (i, a) in sigmas.iter().enumerate() {
        for (j, b) in sigmas.iter().enumerate().take(i + 1) {
            p.set(i, j, if i == j { a * b } else { 0.3 * a * b });
        }
    }
    p
}

/// Largest difference of two covariances, in the sigmas of the second.
fn apart(found: &Covariance, expected: &Covariance) -> f64 {
    let sigma = |i: usize| expected.get(i, i).sqrt();
    let pairs = (0..STATES).flat_map(|i| (0..STATES).map(move |j| (i, j)));
    let scaled = |(i, j)| (found.get(i, j) - expected.get(i, j)).abs() / (sigma(i) * sigma(j));
    pairs.map(scaled).fold(0.0, f64::max)
}

/// Takes steps one by one and pooled, and returns the difference at the end.
fn compare(steps: &[(f64, [f64; 3], f64)], sigmas: [f64; STATES]) -> f64 {
    let mut chain = Chain::new();
    let mut pool = Pool::new(&chain.layout, &chain.step);
    let (mut pooled, mut each) = (covariance(sigmas), covariance(sigmas));
    for &(dt, factors, density) in steps {
        let step = chain.step(dt, factors, density);
        pool.add(step, dt);
        step.propagate(&mut each);
    }
    pool.take(&mut pooled);
    apart(&pooled, &each)
}

/// 20 steps of 10 ms. The third order of a chain is `t^3 / 6` of the state three places on, 1.3e-3 of its sigma
/// here, and the variance changes by up to twice as much; a chain without the second order would be off
/// by `t^2 / 2`, 2e-2.
#[test]
fn equal_steps_are_their_product_to_the_third_order() {
    let steps = [(0.01, [1.0; 3], 0.5); 20];
    let whole = compare(&steps, [1.0; 4]);
    assert!((1e-8..2.7e-3).contains(&whole), "{whole:e}");
    // with half the steps the third order is an eighth
    let half = compare(&steps[..10], [1.0; 4]);
    assert!(whole / half > 7.0, "{whole:e} {half:e}");
}

/// A measurement between two samples splits a step: 7 ms and 3 ms count as what they are.
#[test]
fn the_lengths_of_steps_count_to_the_second_order() {
    let lengths = [0.003, 0.01, 0.01, 0.01, 0.007];
    let steps = lengths.map(|dt| (dt, [1.0, 1.0, 0.0], 0.0));
    // with the third factor zero there is no third order: what is left is rounding
    let difference = compare(&steps, [1.0; 4]);
    assert!(difference < 1e-14, "{difference:e}");
}

/// One factor varies at random between the steps, as a specific force does. The order of the steps then matters
/// to the second order, `t^2` times a tenth of the variation, some 1e-3 here.
#[test]
fn the_order_of_steps_counts_to_the_second_order() {
    let mut random = Random::new(1, "steps");
    let steps: Vec<_> = (0..20).map(|_| (0.01, [1.0, random.normal(), 0.0], 0.0)).collect();
    // as above, rounding alone
    let difference = compare(&steps, [1.0; 4]);
    assert!(difference < 1e-14, "{difference:e}");
    let mut sorted = steps.clone();
    sorted.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
    let mut chain = Chain::new();
    let [a, b] = [&steps, &sorted].map(|steps| {
        let mut p = covariance([1.0; 4]);
        steps.iter().for_each(|(dt, f, q)| chain.step(*dt, *f, *q).propagate(&mut p));
        p
    });
    assert!(apart(&a, &b) > 1e-4, "the order of these steps does not matter");
}

/// A state that decays by itself over two correlation times, in steps of any length: `exp` and the variance of the
/// process (Groves eq. 3.3) hold to rounding, though the third order of that decay is large.
#[test]
fn a_decaying_state_has_its_exact_variance() {
    let steps: Vec<_> = (1..=20).map(|k| (0.05 * f64::from(k), [0.0; 3], 0.0)).collect();
    let difference = compare(&steps, [1.0; 4]);
    assert!(difference < 1e-14, "{difference:e}");
}

/// The noise of one state reaches the one before it: after steps of equal lengths by `q t^2 / 2`, with the variance `q t^3 / 3`, and
/// after others in the same way.
#[test]
fn the_noise_is_carried_to_the_second_order() {
    for split in [0.0, 0.7] {
        let mut chain = Chain::new();
        let mut pool = Pool::new(&chain.layout, &chain.step);
        let (mut pooled, mut each) = (Covariance::zero(STATES), Covariance::zero(STATES));
        for k in 0..16 {
            let dt = 0.01 - 0.01 * split * f64::from(u8::from(k % 4 == 3));
            let step = chain.step(dt, [1.0, 1.0, 0.0], 1.0);
            pool.add(step, dt);
            step.propagate(&mut each);
        }
        pool.take(&mut pooled);
        for (i, j) in [(2, 2), (2, 1), (1, 1)] {
            let (found, expected) = (pooled.get(i, j), each.get(i, j));
            assert!((found / expected - 1.0).abs() < 1e-12, "{i} {j}: {found:e} {expected:e}");
        }
    }
}

/// The noise of a step counts as often as the step widens it.
#[test]
fn noise_that_a_step_widens_is_summed_as_such() {
    let mut chain = Chain::new();
    let mut pool = Pool::new(&chain.layout, &chain.step);
    let (mut pooled, mut each) = (Covariance::zero(STATES), Covariance::zero(STATES));
    for factor in [1.0, 3.0] {
        let step = chain.step(0.01, [0.0; 3], 1.0);
        step.scale_noise(factor);
        pool.add(step, 0.01);
        step.propagate(&mut each);
    }
    pool.take(&mut pooled);
    assert!((pooled.get(2, 2) - 0.1).abs() < 1e-16, "{}", pooled.get(2, 2));
    assert!((each.get(2, 2) - 0.1).abs() < 1e-16, "{}", each.get(2, 2));
}

/// Pools as long as the bound allows: over 1000 steps they neglect less than their number times the bound, and a chain
/// whose third order is larger has shorter pools.
#[test]
fn a_pool_ends_before_it_neglects_a_millionth_of_a_sigma() {
    let lengths = [1.0, 30.0].map(|faster| {
        let mut chain = Chain::new();
        let mut pool = Pool::new(&chain.layout, &chain.step);
        let sigmas = [10.0, 1.0, 0.1, 0.001];
        let (mut pooled, mut each, mut pools) = (covariance(sigmas), covariance(sigmas), 0);
        for _ in 0..1000 {
            let step = chain.step(0.01, [faster; 3], 1e-8);
            step.propagate(&mut each);
            if pool.add(step, 0.01) {
                pool.take(&mut pooled);
                pools += 1;
            }
        }
        if !pool.is_empty() {
            pool.take(&mut pooled);
        }
        let difference = apart(&pooled, &each);
        // each pool changes a variance by at most twice the share of the sigma
        assert!(difference < 2e-6 * f64::from(pools), "{difference:e} in {pools}");
        pools
    });
    assert!(lengths[0] < 500 && lengths[1] > lengths[0], "{lengths:?}");
}

/// A row that a step replaces is no change of the identity that could add up.
#[test]
fn steps_that_replace_a_state_are_taken_one_by_one() {
    let layout = Chain::new().layout;
    let q = DMatrix::from_element(1, 1, 0.5);
    let step = Transition::replacing(&layout, 0..1, &[1], &[1.0], &q);
    let mut pool = Pool::new(&layout, &step);
    let (mut pooled, mut each) = (covariance([1.0; 4]), covariance([1.0; 4]));
    for _ in 0..3 {
        assert!(pool.add(&step, 0.01));
        pool.take(&mut pooled);
        step.clone().propagate(&mut each);
    }
    assert_eq!(pooled, each);
}
