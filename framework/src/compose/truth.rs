//! True states of a simulation: stated, drawn, and moved by dynamics and processes.

use crate::checkpoint::saved;
use crate::compose::draw::Draw;
use crate::compose::{Composition, Process};
use crate::model::process::{Interval, ProcessModel};
use crate::model::simulate::Random;
use crate::state::covariance::Transition;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Block, Dynamics, Layout, State};
use crate::units::time::{Span, Time};

/// Interval between draws of wandering truths, which are linear between draws.
const STEP: Span = Span::from_nanos(100_000_000);

/// True state of the blocks that the scenario states or a draw gives. Moves forward in time only.
#[derive(Clone, Debug)]
pub struct TrueState {
    /// The state; blocks without a known truth at their initial value.
    pub state: State,
    /// Set for each block whose truth is known, one entry per slot.
    pub known: Vec<bool>,
    wandering: Vec<Wandering>,
    /// Truths that processes move, one entry for each such process.
    moving: Vec<Moving>,
    /// Time of the next draw.
    next: Time,
}

// the wandering truths of a build follow again from their seeds
saved!(TrueState { state } each { known } except { wandering, moving, next });

/// Truth of one block that moves by its dynamics.
#[derive(Clone, Debug)]
struct Wandering {
    slot: usize,
    random: Random,
    /// Values at the previous and the next draw, the change between them, and the mean of a
    /// Gauss-Markov process.
    before: Vec<f64>,
    after: Vec<f64>,
    change: Vec<f64>,
    mean: Vec<f64>,
    /// Share of the deviation from the mean that a step takes off, and sigma of each draw.
    decay: f64,
    spread: Vec<f64>,
}

impl TrueState {
    /// Truth of a composition's blocks, which wander from `start` on.
    pub fn new(layout: &Layout, seed: u64, start: Time) -> Self {
        let (state, known) = layout.true_state();
        let initial = layout.initial_state();
        let own = |b: &Block| b.wanders && b.spec.dynamics != Dynamics::Constant;
        let wandering =
            layout.blocks.iter().enumerate().filter(|(_, b)| own(b)).map(|(slot, block)| {
                let random = Random::new(seed, &format!("truth of {}", block.name));
                let now = state.values[block.range()].to_vec();
                let (decay, spread) = of_step(&block.spec.dynamics, STEP.seconds());
                Wandering {
                    slot,
                    random,
                    before: now.clone(),
                    after: now,
                    change: vec![0.0; block.operations.tangent],
                    mean: initial.values[block.range()].to_vec(),
                    decay,
                    spread,
                }
            });
        let next = if start == Time::MIN { Time::default() } else { start };
        Self { wandering: wandering.collect(), moving: Vec::new(), next, state, known }
    }

    /// Truth of a composition, with the truths that its processes move.
    pub fn of(composition: &Composition) -> Self {
        let layout = &composition.layout;
        let mut truth = Self::new(layout, composition.seed, composition.start());
        let drawn = composition.estimator.draw == Draw::All;
        for process in composition.processes.iter().filter(|p| drawn || p.wanders) {
            let noise_free = (!drawn).then(|| composition.transition.clone());
            let moving = Moving::new(layout, process, composition.seed, &truth.state, noise_free);
            if !moving.slots.is_empty() {
                moving.slots.iter().for_each(|slot| truth.known[*slot] = true);
                truth.moving.push(moving);
            }
        }
        truth
    }

    /// Moves the wandering truths, and the state, to a time.
    pub fn advance(&mut self, layout: &Layout, to: Time) {
        self.state.time = to;
        if self.wandering.is_empty() && self.moving.is_empty() {
            return;
        }
        while self.next < to {
            self.wandering.iter_mut().for_each(|w| w.step(&layout.blocks[w.slot]));
            for moving in &mut self.moving {
                moving.step(layout, &self.wandering, STEP.seconds());
            }
            self.next = self.next + STEP;
        }
        let part = (1.0 - self.next.since(to) / STEP.seconds()).max(0.0);
        for w in &self.wandering {
            along(&layout.blocks[w.slot], &w.before, &w.change, part, &mut self.state);
        }
        for m in &self.moving {
            for block in m.slots.iter().map(|slot| &layout.blocks[*slot]) {
                let ends = [&m.before[block.range()], &m.after.values[block.range()]];
                between(block, ends, part, &mut self.state);
            }
        }
    }
}

/// Sets a block to the value between two, a `part` of the way along the manifold.
fn between(block: &Block, [before, after]: [&[f64]; 2], part: f64, state: &mut State) {
    let mut change = [0.0; MAX_TANGENT];
    let change = &mut change[..block.operations.tangent];
    (block.operations.local)(after, before, change);
    along(block, before, change, part, state);
}

/// Sets a block to a value moved by a `part` of a change along the manifold.
fn along(block: &Block, before: &[f64], change: &[f64], part: f64, state: &mut State) {
    let mut delta = [0.0; MAX_TANGENT];
    let delta = &mut delta[..change.len()];
    delta.iter_mut().zip(change).for_each(|(delta, change)| *delta = change * part);
    let value = &mut state.values[block.range()];
    value.copy_from_slice(before);
    (block.operations.retract)(value, delta);
}

/// Truth of the blocks that one process moves.
#[derive(Clone)]
struct Moving {
    process: Box<dyn ProcessModel>,
    /// Work space of a truth without noise.
    noise_free: Option<Transition>,
    random: Random,
    slots: Vec<usize>,
    /// Values at the previous draw, and the state at the next.
    before: Vec<f64>,
    after: State,
    known: Vec<bool>,
}

impl std::fmt::Debug for Moving {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Moving").field("slots", &self.slots).finish_non_exhaustive()
    }
}

impl Moving {
    fn new(
        layout: &Layout,
        process: &Process,
        seed: u64,
        truth: &State,
        noise_free: Option<Transition>,
    ) -> Self {
        Self {
            noise_free,
            slots: process.wandering(layout),
            process: process.model.boxed_clone(),
            random: Random::new(seed, &format!("truth of {}", process.name)),
            before: truth.values.clone(),
            after: truth.clone(),
            known: vec![false; layout.blocks.len()],
        }
    }

    fn step(&mut self, layout: &Layout, wandering: &[Wandering], dt: f64) {
        self.before.copy_from_slice(&self.after.values);
        // the blocks with dynamics of their own, as the process reads them
        for w in wandering {
            self.after.values[layout.blocks[w.slot].range()].copy_from_slice(&w.before);
        }
        let Self { process, noise_free, random, after, known, .. } = self;
        let Some(transition) = noise_free else {
            return process.wander(layout, after, known, dt, random);
        };
        let interval = Interval { from: Time::default(), to: Time::default() + STEP, input: None };
        if process.propagate(layout, after, &interval, transition).is_err() {
            after.values.fill(f64::NAN);
        }
    }
}

/// Marks the blocks whose truth a process moves, and removes the truth of blocks that a process
/// moves in the filter alone: a truth that stays where the state moves would judge it wrongly.
pub(crate) fn settle(
    layout: &mut Layout,
    transition: &Transition,
    moved: &[bool],
    processes: &[Process],
) {
    let mut wander = vec![false; layout.blocks.len()];
    for process in processes {
        process.wandering(layout).iter().for_each(|slot| wander[*slot] = true);
    }
    for (slot, block) in layout.blocks.iter_mut().enumerate() {
        block.wanders |= wander[slot];
        if !moved[slot] && !wander[slot] && transition.moves(&block.tangent_range()) {
            block.spec.truth = None;
        }
    }
}

/// Share of the deviation from the mean that a step of `dt` seconds takes off, and the sigma of
/// each of its draws.
fn of_step(dynamics: &Dynamics, dt: f64) -> (f64, Vec<f64>) {
    match dynamics {
        Dynamics::Constant => (0.0, Vec::new()),
        Dynamics::RandomWalk(density) => (0.0, density.iter().map(|q| (q * dt).sqrt()).collect()),
        Dynamics::GaussMarkov { sigma, time } => {
            let spread = (-(-2.0 * dt / time).exp_m1()).sqrt();
            ((-dt / time).exp_m1(), sigma.iter().map(|s| s * spread).collect())
        }
    }
}

impl Wandering {
    fn step(&mut self, block: &Block) {
        let Self { random, before, after, change, mean, decay, spread, .. } = self;
        before.copy_from_slice(after);
        let mut delta = [0.0; MAX_TANGENT];
        let delta = &mut delta[..block.operations.tangent];
        if let Dynamics::GaussMarkov { .. } = block.spec.dynamics {
            (block.operations.local)(after, mean, delta);
        }
        for (d, spread) in delta.iter_mut().zip(spread) {
            *d = *d * *decay + *spread * random.normal();
        }
        (block.operations.retract)(after, delta);
        (block.operations.local)(after, before, change);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::draw::tests::{drawn, moments};

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

    /// At 30 ms of the 100 ms between two draws, the truth has gone 0.3 of the way.
    #[test]
    fn a_truth_is_on_the_line_between_two_draws() {
        let layout = drawn(Dynamics::RandomWalk(vec![0.01]), None, 1);
        let mut truth = TrueState::new(&layout, 1, Time::MIN);
        let mut at = |ms: i64| {
            truth.advance(&layout, Time::from_nanos(ms * 1_000_000));
            truth.state.values[0]
        };
        let (before, between, after) = (at(100), at(130), at(200));
        let line = before + 0.3 * (after - before);
        // values of about one
        assert!(before != after && (between - line).abs() < 1e-14, "{before} {between} {after}");
    }
}
