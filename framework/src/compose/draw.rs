//! Differences between runs: initial errors and true values drawn from the priors.

use crate::model::simulate::Random;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Block, Dynamics, Layout};
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
    let past: Vec<bool> = (0..layout.blocks.len()).map(|slot| layout.is_past(slot)).collect();
    for ((block, moved), past) in layout.blocks.iter_mut().zip(moved).zip(past) {
        if block.tangent.is_none() || block.label.is_some() || past {
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

#[cfg(test)]
pub(super) mod tests {
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

    /// The layout of one scalar, with its start or its truth drawn.
    pub(in crate::compose) fn drawn(dynamics: Dynamics, truth: Option<f64>, seed: u64) -> Layout {
        let mut layout = layout(dynamics, truth);
        draw(&mut layout, &[false], seed);
        layout
    }

    /// Mean and standard deviation.
    pub(in crate::compose) fn moments(values: &[f64]) -> (f64, f64) {
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
}
