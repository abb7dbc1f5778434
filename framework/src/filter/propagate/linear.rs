//! Linear propagation: the step of the state through all processes, with its `Phi` and `Q`.

use super::held::{Held, of_process};
use super::inputs::{Corrected, correct, couple, replace};
use crate::compose::Composition;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::{Interval, ProcessError, ProcessModel};
use crate::state::covariance::Transition;
use crate::state::dynamics::BlockDynamics;
use crate::state::{Layout, State};

/// What a step reads, and the transition that it fills.
pub(super) struct Linear<'a> {
    pub(super) composition: &'a Composition,
    pub(super) held: &'a [Held],
    pub(super) corrected: &'a mut [Corrected],
    pub(super) dynamics: &'a mut BlockDynamics,
    pub(super) transition: &'a mut Transition,
}

impl Linear<'_> {
    /// Propagates a state through all processes, with driving samples corrected at this state, and
    /// the other blocks by their own dynamics.
    pub(super) fn propagate(
        &mut self,
        processes: &mut [Box<dyn ProcessModel>],
        state: &mut State,
        given: &Interval<'_>,
    ) -> Result<(), EstimatorError> {
        let Self { composition, held, corrected, dynamics, transition } = self;
        let layout = &composition.layout;
        correct(corrected, layout, state, given.input.as_ref(), held);
        let input = given.input.map(|input| replace(corrected, input));
        let interval = Interval { input, ..*given };
        for (k, process) in processes.iter_mut().enumerate() {
            let own = of_process(held, corrected, k, &interval);
            let moved = process.propagate(layout, state, &own, transition);
            moved.and_then(|()| check_numbers(layout, state)).map_err(|error| {
                let process = composition.processes[k].name.clone();
                EstimatorError::Process { time: interval.to, process, error }
            })?;
        }
        couple(corrected, transition);
        dynamics.propagate(layout, state, interval.duration(), transition);
        Ok(())
    }
}

/// Checks that a process has left numbers in the state. A block that comes and goes has none while
/// it is absent.
fn check_numbers(layout: &Layout, state: &State) -> Result<(), ProcessError> {
    // a sum is a number only if all of its terms are
    let (fours, rest) = state.values.as_chunks::<4>();
    let mut sums = [rest.iter().sum::<f64>(), 0.0, 0.0, 0.0];
    for four in fours {
        sums.iter_mut().zip(four).for_each(|(sum, value)| *sum += value);
    }
    if sums.iter().all(|sum| sum.is_finite()) {
        return Ok(());
    }
    let lost = layout.blocks.iter().filter(|block| block.label.is_none());
    let lost = lost.filter(|block| !state.values[block.range()].iter().all(|v| v.is_finite()));
    match lost.map(|block| &block.name).next() {
        Some(name) => Err(ProcessError::domain(format!(
            "{name} is no longer a number; look in the equations of the process for a division by zero, \
             a root or a logarithm"
        ))),
        None => Ok(()),
    }
}
