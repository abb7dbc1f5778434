//! Pseudo-measurements: knowledge about the motion, such as zero velocity, that holds at times which
//! a detector finds.

use crate::checkpoint::{Io, Saved};
use crate::model::error::ComposeError;
use crate::model::sensor::Sensor;
use crate::units::sample::Sample;

/// Decides when a pseudo-measurement holds.
///
/// A sensor type whose knowledge needs no instrument hands a detector to
/// [`Composer::detected_by`](crate::compose::Composer::detected_by). The detector sees the samples
/// that the filter uses. Where it returns `true`, the filter corrects the state with a sample in
/// which every channel is zero: `0 = h(x) + v`, `v ~ N(0, R)`. The update is gated, recorded and
/// counted under the name of the sensor.
///
/// Knowledge that holds all the time, applied once a second:
/// ```
/// use navfuse_core::checkpoint::Io;
/// use navfuse_core::model::sensor::detector::Detector;
/// use navfuse_core::prelude::*;
///
/// #[derive(Clone, Default)]
/// struct EverySecond {
///     last: Option<Time>,
/// }
///
/// impl Detector for EverySecond {
///     fn detects(&mut self, sample: &Sample) -> bool {
///         let due = self.last.is_none_or(|last| sample.time.since(last) >= 1.0);
///         if due {
///             self.last = Some(sample.time);
///         }
///         due
///     }
///     fn memory(&mut self, io: &mut Io<'_>) {
///         io.pass(&mut self.last);
///     }
///     fn boxed_clone(&self) -> Box<dyn Detector> {
///         Box::new(self.clone())
///     }
/// }
/// ```
pub trait Detector: Send {
    /// Looks up the sensors whose samples the detector needs. Called once, after all sensors are
    /// composed.
    ///
    /// # Errors
    /// When a sensor is missing or cannot serve.
    fn connect(&mut self, _sensors: &[Sensor]) -> Result<(), ComposeError> {
        Ok(())
    }

    /// Takes a sample that the running filter has used, of any sensor, in order of time. Returns
    /// `true` if the knowledge holds at the time of this sample.
    fn detects(&mut self, sample: &Sample) -> bool;

    /// Saves or restores what the detector remembers between its calls.
    /// Default: it remembers nothing.
    fn memory(&mut self, _io: &mut Io<'_>) {}

    /// Copies the detector for a snapshot of the filter.
    fn boxed_clone(&self) -> Box<dyn Detector>;
}

impl Saved for dyn Detector {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.part("detector", |io| self.memory(io));
    }
}

impl Clone for Box<dyn Detector> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}
