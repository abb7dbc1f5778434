//! Differences between runs: initial errors and true values drawn from the priors, and truths that
//! wander.

use crate::model::simulate::Random;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Block, Dynamics, Layout, State};
use crate::units::time::Time;
use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Deserialize;

/// Random quantities of a simulation beside the sensors' noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Draw {
    /// Nothing: the filter starts from the values of the reference or the scenario.
    #[default]
    Nothing,
    /// Initial values from a reference are displaced by a draw from their prior.
    Start,
    /// Every uncertain value: as `start`, and a state with a `truth` starts from a draw about it,
    /// while the truth of any other state is drawn about its initial value. Both truths then move
    /// by the dynamics of the state; a stated truth holds at the start. A Gauss-Markov state always
    /// starts at its initial value, the mean to which its truth returns.
    All,
}

/// Draws an error of a block about a value from its prior, in the tangent there; `None` without a
/// prior.
pub(crate) fn displacement(
    block: &Block,
    values: &[f64],
    random: &mut Random,
) -> Option<[f64; MAX_TANGENT]> {
    let factor = block.prior(values).cholesky()?;
    let n = block.operations.tangent;
    let draw = factor.l() * DVector::from_fn(n, |_, _| random.normal());
    let mut delta = [0.0; MAX_TANGENT];
    delta[..n].copy_from_slice(draw.as_slice());
    Some(delta)
}

/// Draws the values of [`Draw::All`] for the blocks that no reference gives. `moved` marks the
/// blocks that processes move.
pub(crate) fn draw(layout: &mut Layout, moved: &[bool], seed: u64) {
    let (initial, truth) = (layout.initial_state(), layout.true_state().0);
    for (block, moved) in layout.blocks.iter_mut().zip(moved) {
        if block.tangent.is_none() {
            continue;
        }
        let stated = block.spec.truth.is_some();
        let wanders = !moved && block.spec.dynamics != Dynamics::Constant;
        if stated && matches!(block.spec.dynamics, Dynamics::GaussMarkov { .. }) {
            block.wanders = wanders;
            continue; // its initial value is the mean to which it returns
        }
        let mut state = if stated { truth.clone() } else { initial.clone() };
        let mut random = Random::new(seed, &format!("prior of {}", block.name));
        let Some(delta) = displacement(block, &state.values, &mut random) else { continue };
        block.wanders = wanders;
        let n = block.operations.tangent;
        (block.operations.retract)(&mut state.values[block.range()], &delta[..n]);
        let mut drawn = vec![0.0; n];
        (block.operations.coordinates)(&state.values[block.range()], &mut drawn);
        if stated || *moved {
            block.spec.initial = drawn;
        } else {
            block.spec.truth = Some(drawn);
        }
    }
}

/// Interval between draws of wandering truths, which are linear between draws.
const STEP: Time = Time::from_nanos(100_000_000);

/// True state of the blocks that the scenario states or a draw gives. Moves forward in time only.
#[derive(Clone, Debug)]
pub struct TrueState {
    /// The state; blocks without a known truth at their initial value.
    pub state: State,
    /// Set for each block whose truth is known, one entry per slot.
    pub known: Vec<bool>,
    wandering: Vec<Wandering>,
    /// Time of the next draw.
    next: Time,
}

/// Truth of one block that moves by its dynamics.
#[derive(Clone, Debug)]
struct Wandering {
    slot: usize,
    random: Random,
    /// Values at the previous and the next draw, and the mean of a Gauss-Markov process.
    before: Vec<f64>,
    after: Vec<f64>,
    mean: Vec<f64>,
}

impl TrueState {
    /// Truth of a composition's blocks, which wander from `start` on.
    pub fn new(layout: &Layout, seed: u64, start: Time) -> Self {
        let (state, known) = layout.true_state();
        let initial = layout.initial_state();
        let wandering =
            layout.blocks.iter().enumerate().filter(|(_, b)| b.wanders).map(|(slot, block)| {
                let random = Random::new(seed, &format!("truth of {}", block.name));
                let now = state.values[block.range()].to_vec();
                Wandering {
                    slot,
                    random,
                    before: now.clone(),
                    after: now,
                    mean: initial.values[block.range()].to_vec(),
                }
            });
        let next = if start == Time::MIN { Time::default() } else { start };
        Self { wandering: wandering.collect(), next, state, known }
    }

    /// Moves the wandering truths, and the state, to a time.
    pub fn advance(&mut self, layout: &Layout, to: Time) {
        self.state.time = to;
        if self.wandering.is_empty() {
            return;
        }
        while self.next < to {
            self.wandering.iter_mut().for_each(|w| w.step(&layout.blocks[w.slot], STEP.seconds()));
            self.next = self.next + STEP;
        }
        let part = (1.0 - self.next.since(to) / STEP.seconds()).max(0.0);
        for w in &self.wandering {
            let block = &layout.blocks[w.slot];
            let mut delta = [0.0; MAX_TANGENT];
            let delta = &mut delta[..block.operations.tangent];
            (block.operations.local)(&w.after, &w.before, delta);
            delta.iter_mut().for_each(|d| *d *= part);
            let value = &mut self.state.values[block.range()];
            value.copy_from_slice(&w.before);
            (block.operations.retract)(value, delta);
        }
    }
}

impl Wandering {
    fn step(&mut self, block: &Block, dt: f64) {
        self.before.copy_from_slice(&self.after);
        let mut delta = [0.0; MAX_TANGENT];
        let delta = &mut delta[..block.operations.tangent];
        match &block.spec.dynamics {
            Dynamics::Constant => return,
            Dynamics::RandomWalk(density) => {
                for (d, q) in delta.iter_mut().zip(density) {
                    *d = (q * dt).sqrt() * self.random.normal();
                }
            }
            Dynamics::GaussMarkov { sigma, time } => {
                (block.operations.local)(&self.after, &self.mean, delta);
                for (d, s) in delta.iter_mut().zip(sigma) {
                    let spread = s * (-(-2.0 * dt / time).exp_m1()).sqrt();
                    *d = *d * (-dt / time).exp_m1() + spread * self.random.normal();
                }
            }
        }
        (block.operations.retract)(&mut self.after, delta);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::Composer;
    use crate::state::manifold::Scalar;
    use crate::state::{BlockSpec, Display, Mode};

    fn layout(dynamics: Dynamics, truth: Option<f64>) -> Layout {
        let mut composer = Composer::default();
        composer.begin("test");
        let display = Display { unit: "", scale: 1.0, components: &["x"] };
        let (initial, sigma, truth) = (vec![2.0], vec![0.5], truth.map(|t| vec![t]));
        let spec = BlockSpec { mode: Mode::Estimate, initial, sigma, truth, dynamics, display };
        composer.block::<Scalar>("x", spec).expect("one block");
        composer.finish().0
    }

    fn drawn(dynamics: Dynamics, truth: Option<f64>, seed: u64) -> Layout {
        let mut layout = layout(dynamics, truth);
        draw(&mut layout, &[false], seed);
        layout
    }

    /// Mean and standard deviation.
    fn moments(values: &[f64]) -> (f64, f64) {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
    }

    #[test]
    fn a_stated_truth_stays_and_the_start_is_drawn_about_it() {
        let layouts: Vec<Layout> =
            (0..4000).map(|seed| drawn(Dynamics::Constant, Some(1.0), seed)).collect();
        assert!(layouts.iter().all(|l| l.blocks[0].spec.truth == Some(vec![1.0])));
        let starts: Vec<f64> = layouts.iter().map(|l| l.blocks[0].spec.initial[0]).collect();
        let (mean, sigma) = moments(&starts);
        // 4 sigma of a mean of 4000 is 0.032; of their standard deviation 0.022
        assert!((mean - 1.0).abs() < 0.032 && (sigma - 0.5).abs() < 0.022, "{mean} {sigma}");
    }

    #[test]
    fn a_truth_that_is_not_stated_is_drawn_about_the_initial_value() {
        let layouts: Vec<Layout> =
            (0..4000).map(|seed| drawn(Dynamics::Constant, None, seed)).collect();
        assert!(layouts.iter().all(|l| l.blocks[0].spec.initial == [2.0]));
        let truths: Vec<f64> =
            layouts.iter().filter_map(|l| Some(l.blocks[0].spec.truth.as_ref()?[0])).collect();
        let (mean, sigma) = moments(&truths);
        assert!((mean - 2.0).abs() < 0.032 && (sigma - 0.5).abs() < 0.022, "{mean} {sigma}");
    }

    #[test]
    fn a_drawn_truth_wanders_as_its_dynamics_say() {
        let at = |dynamics: &Dynamics, seed: u64, seconds: i64| {
            let layout = drawn(dynamics.clone(), None, seed);
            let mut truth = TrueState::new(&layout, seed, Time::from_nanos(10_000_000_000));
            let start = truth.state.values[0];
            truth.advance(&layout, Time::from_nanos(5_000_000_000));
            assert_eq!(truth.state.values[0], start, "the prior holds at the start");
            truth.advance(&layout, Time::from_nanos((10 + seconds) * 1_000_000_000));
            (start, truth.state.values[0])
        };
        // a random walk of 0.01 /s has grown by sqrt(0.01 * 100 s) = 1 after 100 s
        let walk = Dynamics::RandomWalk(vec![0.01]);
        let moved: Vec<f64> = (0..2000).map(|s| at(&walk, s, 100)).map(|(a, b)| b - a).collect();
        let (mean, sigma) = moments(&moved);
        assert!(mean.abs() < 0.09 && (sigma - 1.0).abs() < 0.064, "{mean} {sigma}");
        // a Gauss-Markov process keeps its sigma, and after one correlation time exp(-1) of its
        // value
        let markov = Dynamics::GaussMarkov { sigma: vec![0.5], time: 20.0 };
        let pairs: Vec<(f64, f64)> = (0..2000).map(|s| at(&markov, s, 20)).collect();
        let (mean, sigma) = moments(&pairs.iter().map(|p| p.1).collect::<Vec<_>>());
        assert!((mean - 2.0).abs() < 0.045 && (sigma - 0.5).abs() < 0.032, "{mean} {sigma}");
        let correlation =
            pairs.iter().map(|(a, b)| (a - 2.0) * (b - 2.0)).sum::<f64>() / 2000.0 / 0.25;
        // 4 sigma of a correlation of 2000 pairs is 0.09
        assert!((correlation - (-1.0_f64).exp()).abs() < 0.09, "{correlation}");
    }

    /// From 4 about a mean of 2, with a sigma of 0.5 and 20 s: after a time `t` the mean is `2 + 2
    /// exp(-t/20)` and sigma `0.5 sqrt(1 - exp(-t/10))`. A random walk of 0.01 /s has a sigma of 1
    /// after 100 s, about the 4 where it started.
    #[test]
    fn a_stated_truth_is_that_of_the_start_and_wanders_from_there() {
        let at = |dynamics: &Dynamics, seed: u64, seconds: i64| {
            let layout = drawn(dynamics.clone(), Some(4.0), seed);
            let mut truth = TrueState::new(&layout, seed, Time::default());
            assert_eq!(truth.state.values[0], 4.0);
            truth.advance(&layout, Time::from_nanos(seconds * 1_000_000_000));
            (layout.blocks[0].spec.initial[0], truth.state.values[0])
        };
        let markov = Dynamics::GaussMarkov { sigma: vec![0.5], time: 20.0 };
        let walk = Dynamics::RandomWalk(vec![0.01]);
        let part = (-1.0_f64).exp();
        let cases = [
            (&markov, 20, 2.0 + 2.0 * part, 0.5 * (1.0 - part * part).sqrt()),
            (&markov, 400, 2.0, 0.5),
            (&walk, 100, 4.0, 1.0),
        ];
        for (dynamics, seconds, mean, sigma) in cases {
            let drawn: Vec<(f64, f64)> =
                (0..2000).map(|seed| at(dynamics, seed, seconds)).collect();
            let truths = moments(&drawn.iter().map(|d| d.1).collect::<Vec<_>>());
            // 4 sigma of a mean of 2000 is 0.09 of their sigma, of their standard deviation 0.064
            assert!((truths.0 - mean).abs() < 0.09 * sigma, "{dynamics:?} {seconds} s: {truths:?}");
            assert!((truths.1 / sigma - 1.0).abs() < 0.064, "{dynamics:?} {seconds} s: {truths:?}");
            // a Gauss-Markov state starts at its mean, a random walk from a draw of 0.5 about its
            // truth
            let starts = moments(&drawn.iter().map(|d| d.0).collect::<Vec<_>>());
            let expected = if dynamics == &walk { (4.0, 0.5) } else { (2.0, 0.0) };
            assert!(
                (starts.0 - expected.0).abs() < 0.045 && (starts.1 - expected.1).abs() < 0.032,
                "{starts:?}"
            );
        }
    }

    #[test]
    fn two_readers_of_a_wandering_truth_see_the_same() {
        let layout = drawn(Dynamics::RandomWalk(vec![0.01]), None, 1);
        let (mut a, mut b) =
            (TrueState::new(&layout, 1, Time::MIN), TrueState::new(&layout, 1, Time::MIN));
        (1..70).for_each(|k| a.advance(&layout, Time::from_nanos(k * 100_000_000)));
        a.advance(&layout, Time::from_nanos(7_030_000_000));
        b.advance(&layout, Time::from_nanos(7_030_000_000));
        assert_eq!(a.state, b.state);
    }
}
