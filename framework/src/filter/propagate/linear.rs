//! Linear propagation: the step of the state through all processes, with its `Phi` and `Q`.

use super::held::{Held, of_process};
use super::inputs::{Corrected, correct, couple, replace};
use crate::compose::Composition;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::{Interval, ProcessModel};
use crate::state::State;
use crate::state::covariance::Transition;
use crate::state::dynamics::BlockDynamics;

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
        correct(corrected, (layout, state), given.input.as_ref(), held);
        let input = given.input.map(|input| replace(corrected, input));
        let interval = Interval { input, ..*given };
        for (k, process) in processes.iter_mut().enumerate() {
            let own = of_process(held, corrected, k, &interval);
            process.propagate(layout, state, &own, transition).map_err(|error| {
                let process = composition.processes[k].name.clone();
                EstimatorError::Process { time: interval.to, process, error }
            })?;
        }
        couple(corrected, transition);
        dynamics.propagate(layout, state, interval.duration(), transition);
        Ok(())
    }
}
