//! The end of a run: its results, and the error that ended it early.

use crate::model::estimator_error::EstimatorError;
use crate::model::process::ProcessErrorKind;
use crate::model::record::Event;
use crate::model::record::finding::Finding;
use crate::model::stream::{NamedSink, Sink, StreamError};
use crate::session::summary::{Recorded, Summary};
use crate::smooth::SmoothError;
use crate::units::time::Time;
use std::any::Any;

/// The reason why a run ended early. Everything recorded until then is kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A source failed.
    #[error("source {source_name}: {error}")]
    Source {
        /// The source's name in the scenario.
        source_name: String,
        /// The reason.
        #[source]
        error: StreamError,
    },
    /// The filter cannot continue.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// The run cannot be smoothed.
    #[error("the run cannot be smoothed: {0}")]
    Smooth(#[from] SmoothError),
    /// The samples ended before a process had found its initial values.
    #[error("{0}")]
    Unfinished(String),
    /// The filter never started.
    #[error("{0}")]
    NeverStarted(String),
}

impl RunError {
    /// Returns `true` if samples of the driving sensor are missing or incomplete.
    pub(crate) fn is_of_the_input(&self) -> bool {
        matches!(
            self,
            Self::Estimator(EstimatorError::Process { error, .. }) if error.kind() == ProcessErrorKind::Input
        )
    }
}

/// The way in which the samples of a run ended.
#[derive(Debug)]
pub enum End {
    /// There are no more samples.
    Complete,
    /// Somebody ended the run before its last sample.
    Interrupted,
    /// An error ended the run.
    Failed(RunError),
}

impl From<Result<(), RunError>> for End {
    fn from(result: Result<(), RunError>) -> Self {
        result.map_or_else(Self::Failed, |()| Self::Complete)
    }
}

/// The end of a run. It has a summary even after an error.
pub struct Finished {
    /// Time of the last estimate.
    pub time: Time,
    /// The results in numbers.
    pub summary: Summary,
    /// The places that the sinks wrote to.
    pub recorded: Vec<Recorded>,
    /// Warnings and errors in order of time.
    pub events: Vec<Event>,
    /// Faults that the filter found, in order of time.
    pub findings: Vec<Finding>,
    /// The error that ended the run early.
    pub error: Option<RunError>,
    /// True for a run that was interrupted.
    pub interrupted: bool,
    /// The sinks that the assembly had, each with its name; a sink that failed is among them.
    pub sinks: Vec<NamedSink>,
}

impl Finished {
    /// Takes the first sink of type `T` out of the result.
    ///
    /// ```
    /// # use navfuse_core::prelude::*;
    /// # use navfuse_core::run::runner;
    /// # use navfuse_core::run::scenario::Assembly;
    /// # use std::sync::atomic::AtomicBool;
    /// /// Counts the estimates.
    /// #[derive(Default)]
    /// struct Epochs(usize);
    /// impl Sink for Epochs {
    ///     fn wants(&self) -> Wants {
    ///         Wants::EPOCHS
    ///     }
    ///     fn take(&mut self, _: &Record<'_>) -> Result<(), StreamError> {
    ///         self.0 += 1;
    ///         Ok(())
    ///     }
    /// }
    /// fn epochs(mut assembly: Assembly) -> Option<usize> {
    ///     assembly.sinks.push(("epochs".into(), Box::new(Epochs::default())));
    ///     let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    ///     finished.take_sink::<Epochs>().map(|epochs| epochs.0)
    /// }
    /// ```
    pub fn take_sink<T: Sink>(&mut self) -> Option<T> {
        let at = self.sinks.iter().position(|(_, sink)| (sink.as_ref() as &dyn Any).is::<T>())?;
        let (_, sink) = self.sinks.remove(at);
        let sink: Box<dyn Any> = sink;
        sink.downcast().ok().map(|sink| *sink)
    }
}

impl std::fmt::Debug for Finished {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Finished")
            .field("time", &self.time)
            .field("summary", &self.summary)
            .field("recorded", &self.recorded)
            .field("events", &self.events)
            .field("findings", &self.findings)
            .field("error", &self.error)
            .field("interrupted", &self.interrupted)
            .finish_non_exhaustive()
    }
}
