//! A process whose truth moves by its own equations, and with no trajectory.

use crate::checkpoint::Io;
use crate::model::process::{Input, Interval, ProcessError, ProcessModel};
use crate::model::sensor::motion::Motion;
use crate::model::simulate::Random;
use crate::state::covariance::Transition;
use crate::state::{Layout, State};

/// A process that follows no motion, so that [`ProcessModel::wander`] gives the truth of all its
/// blocks: a draw of the process, of which its `Q` is the noise.
#[derive(Clone)]
pub(crate) struct Wanderer(pub Box<dyn ProcessModel>);

impl ProcessModel for Wanderer {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        self.0.propagate(layout, state, interval, transition)
    }

    fn prepare(&mut self, layout: &Layout, state: &mut State, input: &Input<'_>) {
        self.0.prepare(layout, state, input);
    }

    fn restart(&mut self) {
        self.0.restart();
    }

    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}

    fn wander(
        &mut self,
        layout: &Layout,
        truth: &mut State,
        known: &mut [bool],
        dt: f64,
        random: &mut Random,
    ) {
        self.0.wander(layout, truth, known, dt, random);
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        self.0.memory(io);
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}
