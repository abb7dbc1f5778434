//! Linear propagation: the step of the state through all processes, with its `Phi` and `Q`.

use crate::compose::Composition;
use crate::filter::propagate::held::{Held, of_process};
use crate::filter::propagate::inputs::{Corrected, correct, couple, replace};
use crate::model::estimator_error::EstimatorError;
use crate::model::process::{Interval, ProcessModel};
use crate::state::State;
use crate::state::covariance::Transition;
use crate::state::dynamics::BlockDynamics;

/// Propagates a state through all processes, with driving samples corrected at this state, and the
/// other blocks by their own dynamics.
pub(in crate::filter) fn propagate(
    composition: &Composition,
    corrected: &mut [Corrected],
    (processes, dynamics): (&mut [Box<dyn ProcessModel>], &mut BlockDynamics),
    held: &[Held],
    state: &mut State,
    given: &Interval<'_>,
    transition: &mut Transition,
) -> Result<(), EstimatorError> {
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
