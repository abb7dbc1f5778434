//! The current of the water, a state that sensors share.

use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::Calibration;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{BuiltProcess, OwnDynamics};
use navfuse_core::plugin::ProcessType;
use navfuse_core::state::Mode;
use navfuse_core::state::display;
use navfuse_core::state::manifold::Vector;
use navfuse_core::units::{AccelerationNoise, Positive, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Default correlation time of the current, s.
const HOUR: f64 = 3600.0;

/// Current of the water around the vehicle: the velocity of the water over the bottom, a state to
/// which sensors refer by name.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WaterCurrent {
    /// Velocity north, east, down. With a sigma it is estimated: as a Gauss-Markov process about
    /// its initial value, with that stationary sigma and a `correlation_time` of 1 h by default, or
    /// as a random walk where `random_walk` is given. Without a sigma it is known.
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
        // c' = -c/T + w of a Gauss-Markov process (Hegrenaes & Berglund 2009), or c' = w
        Ok(BuiltProcess::new(OwnDynamics))
    }
}
