//! Monitors: the rules of physics by which a process notices faults of its driving sensor.

use crate::checkpoint::{Io, Saved};
use crate::model::process::Input;
use crate::model::process::start::FilterView;
use crate::model::record::finding::Finding;

/// A velocity of the body that a sample measures, taken with the attitude of the estimate.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredVelocity<'a> {
    /// Name of the sensor.
    pub sensor: &'a str,
    /// North, east, down, m/s.
    pub velocity: [f64; 3],
    /// Set if the sensor measures in axes of its own, and not north, east and down.
    pub own_axes: bool,
}

/// Watches the driving sensor of a process while the filter runs, and reports its faults.
///
/// A process hands its monitor over when it is built
/// ([`BuiltProcess::watched_by`](crate::model::process::BuiltProcess::watched_by)). A monitor only
/// looks: it changes nothing in the filter.
///
/// A pedometer that counts no steps while the map moves:
/// ```
/// use navfuse_core::checkpoint::Io;
/// use navfuse_core::model::record::finding::{Basis, Finding, Severity};
/// use navfuse_core::model::process::monitor::Monitor;
/// use navfuse_core::model::process::Input;
/// use navfuse_core::model::process::start::FilterView;
/// use navfuse_core::prelude::*;
///
/// #[derive(Clone)]
/// struct Steps {
///     speed: Handle<Scalar>,
///     reported: bool,
/// }
///
/// impl Monitor for Steps {
///     fn input(&mut self, filter: &FilterView<'_>, input: &Input<'_>) -> Option<Finding> {
///         let resting = input.sample.get(0) == Some(0.0);
///         let speed = filter.state.get(filter.layout, self.speed);
///         if self.reported || !resting || speed < 1.0 {
///             return None;
///         }
///         self.reported = true;
///         Some(Finding {
///             time: input.sample.time,
///             about: "pedometer".into(),
///             severity: Severity::Doubtful,
///             basis: Basis::Comparison,
///             text: "no steps at more than 1 m/s".into(),
///             remedy: "check the batteries".into(),
///         })
///     }
///     fn memory(&mut self, io: &mut Io<'_>) {
///         io.pass(&mut self.reported);
///     }
///     fn boxed_clone(&self) -> Box<dyn Monitor> {
///         Box::new(self.clone())
///     }
/// }
/// ```
pub trait Monitor: Send {
    /// Sees a driving sample after the process has used it, with the estimate at its time.
    fn input(&mut self, filter: &FilterView<'_>, input: &Input<'_>) -> Option<Finding>;

    /// Sees that a measuring sensor has corrected the estimate, while the gate of every sensor passed
    /// its last sample.
    fn corrected(&mut self, _filter: &FilterView<'_>) {}

    /// Sees the velocity that a sample of a measuring sensor determines, whatever the gate makes of it.
    fn measured(&mut self, _filter: &FilterView<'_>, _velocity: &MeasuredVelocity<'_>) {}

    /// Sees that the filter has widened the covariance, after a recovery or for an error that it
    /// has found: the difference of two variances says nothing about a move of the estimate across
    /// it.
    fn widened(&mut self) {}

    /// Saves or restores what the monitor remembers between its calls.
    /// Default: it remembers nothing.
    fn memory(&mut self, _io: &mut Io<'_>) {}

    /// Copies the monitor for a snapshot of the filter.
    fn boxed_clone(&self) -> Box<dyn Monitor>;
}

impl Saved for dyn Monitor {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.part("monitor", |io| self.memory(io));
    }
}

impl Clone for Box<dyn Monitor> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}
