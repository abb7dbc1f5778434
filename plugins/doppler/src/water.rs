//! The current: a state of the water that sensors share.

use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::Calibration;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::motion::Motion;
use navfuse_core::model::process::BuiltProcess;
use navfuse_core::model::process::{Interval, ProcessError, ProcessModel};
use navfuse_core::plugin::ProcessType;
use navfuse_core::state::covariance::Transition;
use navfuse_core::state::display;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Layout, Mode, State};
use navfuse_core::units::{AccelerationNoise, Positive, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Correlation time of a current that the scenario says nothing of, s.
const HOUR: f64 = 3600.0;

/// The current of the water where the vehicle is: the velocity of the water over the bottom, a state that sensors name.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaterCurrent {
    /// North, east, down. With a sigma it is estimated, as a Gauss-Markov process about its initial value of that stationary
    /// sigma and a `correlation_time` of 1 h, or as a `random_walk` where that is given. Without a sigma it is known.
    pub current: Calibration<Triple<Speed>, Triple<AccelerationNoise>>,
}

impl ProcessType for WaterCurrent {
    const TYPE: &'static str = "water-current";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let mut current = self.current;
        let moves = current.sigma.is_some() && current.mode != Some(Mode::Fixed);
        if moves && current.random_walk.is_none() {
            current.correlation_time.get_or_insert(Positive::from_si(HOUR));
        }
        current.block::<Vector<3>>(composer, "current", &[0.0; 3], display::VELOCITY)?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

/// Moves nothing: the block moves by its own dynamics.
#[derive(Clone, Copy, Debug)]
struct OwnDynamics;

impl ProcessModel for OwnDynamics {
    fn propagate(
        &mut self,
        _: &Layout,
        _: &mut State,
        _: &Interval<'_>,
        _: &mut Transition,
    ) -> Result<(), ProcessError> {
        Ok(())
    }

    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(*self)
    }
}
