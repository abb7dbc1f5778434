//! Own dynamics of blocks that no process model propagates: random walks and Gauss-Markov
//! processes.

use crate::state::covariance::Transition;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Dynamics, Layout, State};

/// Blocks with dynamics of their own, and their places in the transition.
#[derive(Clone, Debug, Default)]
pub struct BlockDynamics {
    moving: Vec<Moving>,
    /// Means of the Gauss-Markov processes.
    initial: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Moving {
    slot: usize,
    first: usize,
    /// Interval of the step before, s, and the transition over it.
    before: (f64, f64, f64),
}

impl BlockDynamics {
    /// Finds the blocks and compiles the transition with their places.
    pub fn new(layout: &Layout, transition: &mut Transition) -> Self {
        let mut moving = Vec::new();
        for (slot, block) in layout.blocks.iter().enumerate() {
            let Some(tangent) = block.tangent else { continue };
            if block.spec.dynamics == Dynamics::Constant {
                continue;
            }
            let gauss_markov = matches!(block.spec.dynamics, Dynamics::GaussMarkov { .. });
            let first = transition.own_block(tangent, block.operations.tangent, gauss_markov);
            moving.push(Moving { slot, first, before: (0.0, 1.0, 0.0) });
        }
        transition.compile(layout);
        Self { moving, initial: layout.initial_state().values }
    }

    /// Propagates the blocks over `dt` seconds and fills their part of the transition.
    pub fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        dt: f64,
        transition: &mut Transition,
    ) {
        for m in &mut self.moving {
            let block = &layout.blocks[m.slot];
            if layout.is_absent(state, m.slot) {
                (0..block.operations.tangent)
                    .for_each(|k| transition.set_own(m.first, k, None, 0.0));
                continue;
            }
            match &block.spec.dynamics {
                Dynamics::Constant => {}
                Dynamics::RandomWalk(density) => {
                    for (k, q) in density.iter().enumerate() {
                        transition.set_own(m.first, k, None, q * dt);
                    }
                }
                Dynamics::GaussMarkov { sigma, time } => {
                    // Groves eqs 3.3 and 14.81: x(t+dt) = x exp(-dt/T), Q = sigma^2 (1 - exp(-2
                    // dt/T))
                    if m.before.0 != dt {
                        m.before = (dt, (-dt / time).exp(), (-2.0 * dt / time).exp_m1());
                    }
                    let (_, decay, lost) = m.before;
                    for (k, s) in sigma.iter().enumerate() {
                        transition.set_own(m.first, k, Some(decay), -s * s * lost);
                    }
                    let mut delta = [0.0; MAX_TANGENT];
                    let delta = &mut delta[..sigma.len()];
                    let range = block.range();
                    (block.operations.local)(
                        &state.values[range.clone()],
                        &self.initial[range.clone()],
                        delta,
                    );
                    delta.iter_mut().for_each(|d| *d *= decay - 1.0);
                    (block.operations.retract)(&mut state.values[range], delta);
                }
            }
        }
    }
}
