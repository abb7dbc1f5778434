//! Initial alignment: how a process finds the initial values of its blocks from samples.

use crate::checkpoint::{Io, Saved};
use crate::model::error::ComposeError;
use crate::model::process::ProcessError;
use crate::model::record::Level;
use crate::model::sensor::Sensor;
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::sample::Sample;
use crate::units::time::Time;

/// Progress of an initial alignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// More samples are needed.
    Searching,
    /// The initial values are good enough for a trial: the filter runs through all samples so far,
    /// unrecorded, and [`InitialAlignment::search_again`] sees the result. A trial helps where the
    /// prior is so wide that the filter would linearise in the wrong place.
    Trial,
    /// The initial values are found.
    Found,
}

/// The running filter, as an alignment sees it after each driving sample.
#[derive(Clone, Copy, Debug)]
pub struct FilterView<'a> {
    /// Layout of the state.
    pub layout: &'a Layout,
    /// Estimate.
    pub state: &'a State,
    /// Covariance of the estimate.
    pub covariance: &'a Covariance,
    /// Start and length of the current streak of gated constraint samples, if the last one was
    /// gated.
    pub gated: Option<(Time, u64)>,
}

/// Reaction of an alignment to the state of the filter.
#[derive(Clone, Debug, Default)]
pub struct Supervision {
    /// The process's constraint holds now, so the filter applies it.
    pub constrain: bool,
    /// Message for the log.
    pub message: Option<(Level, String)>,
    /// Doubt about the alignment, whose samples are linearised far from the truth: evidence and
    /// remedy. It is no finding where the samples are linearised again.
    pub doubt: Option<(String, String)>,
}

/// Result of an initial alignment.
#[derive(Clone, Debug)]
pub struct AlignmentReport {
    /// Summary in one line.
    pub text: String,
    /// The same as JSON.
    pub values: serde_json::Value,
}

/// Finds the initial values of a process's blocks from samples, and supervises the filter until
/// they are good enough.
///
/// A process hands its alignment over when it is built
/// ([`BuiltProcess::aligned_by`](crate::model::process::BuiltProcess::aligned_by)). The filter then
/// starts in three stages: [`search`](Self::search) sees every sample and sets the initial values;
/// the filter starts at the beginning of the search and processes the same samples; and
/// [`supervise`](Self::supervise) follows it until the alignment is complete.
///
/// The mean of ten samples as the initial level of a lake:
/// ```
/// use navfuse_core::checkpoint::Io;
/// use navfuse_core::model::process::start::{InitialAlignment, Progress};
/// use navfuse_core::prelude::*;
///
/// #[derive(Clone)]
/// struct MeanLevel {
///     level: Handle<Scalar>,
///     gauge: SensorId,
///     samples: Vec<f64>,
/// }
///
/// impl InitialAlignment for MeanLevel {
///     fn search(
///         &mut self,
///         layout: &Layout,
///         state: &mut State,
///         sample: &Sample,
///     ) -> Result<Progress, ProcessError> {
///         self.samples.extend(sample.get(0).filter(|_| sample.sensor == self.gauge));
///         if self.samples.len() < 10 {
///             return Ok(Progress::Searching);
///         }
///         let mean = self.samples.iter().sum::<f64>() / self.samples.len() as f64;
///         state.set(layout, self.level, &mean);
///         Ok(Progress::Found)
///     }
///     fn memory(&mut self, io: &mut Io<'_>) {
///         io.pass(&mut self.samples);
///     }
///     fn boxed_clone(&self) -> Box<dyn InitialAlignment> {
///         Box::new(self.clone())
///     }
/// }
/// ```
pub trait InitialAlignment: Send {
    /// Looks up the sensors that the alignment needs. Called once, after all sensors are composed.
    ///
    /// # Errors
    /// When a sensor is missing or cannot serve.
    fn connect(&mut self, _sensors: &[Sensor]) -> Result<(), ComposeError> {
        Ok(())
    }

    /// Takes the next sample of any sensor.
    ///
    /// On [`Progress::Found`] the process's blocks in `state` hold their values at the time at
    /// which the search began. The filter starts there with the prior covariance of the composition
    /// and processes the samples a second time, so the prior must be wide enough to carry no
    /// information from them.
    ///
    /// # Errors
    /// When the samples do not allow an alignment; the error names the reason and the remedy.
    fn search(
        &mut self,
        layout: &Layout,
        state: &mut State,
        sample: &Sample,
    ) -> Result<Progress, ProcessError>;

    /// Repeats the search after a trial, with the trial's estimates of the calibration states in
    /// `state`.
    ///
    /// # Errors
    /// As [`Self::search`].
    fn search_again(
        &mut self,
        _layout: &Layout,
        _state: &mut State,
    ) -> Result<Progress, ProcessError> {
        Ok(Progress::Found)
    }

    /// Follows the filter after every driving sample: decides whether the process's constraint
    /// ([`Composer::constraint`](crate::compose::Composer::constraint)) applies, and reports
    /// progress.
    ///
    /// # Errors
    /// When the alignment has failed and the rest of the run would be useless.
    fn supervise(&mut self, _filter: &FilterView<'_>) -> Result<Supervision, ProcessError> {
        Ok(Supervision::default())
    }

    /// Describes what is incomplete after the last sample; an error where the result is useless.
    fn unfinished(&self, _filter: &FilterView<'_>) -> Option<(Level, String)> {
        None
    }

    /// Reports the result, once there is one.
    fn report(&self) -> Option<AlignmentReport> {
        None
    }

    /// Saves or restores what the alignment remembers between its calls.
    /// Default: it remembers nothing.
    fn memory(&mut self, _io: &mut Io<'_>) {}

    /// Copies the alignment for a snapshot of the filter.
    fn boxed_clone(&self) -> Box<dyn InitialAlignment>;
}

impl Saved for dyn InitialAlignment {
    fn saved(&mut self, io: &mut Io<'_>) {
        io.part("alignment", |io| self.memory(io));
    }
}

impl Clone for Box<dyn InitialAlignment> {
    fn clone(&self) -> Self {
        self.boxed_clone()
    }
}
