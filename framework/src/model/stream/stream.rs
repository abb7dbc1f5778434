//! Sources of samples and sinks of results.

use crate::model::record::{Derived, Event, Record, Wants};
use crate::model::sensor::{Accuracy, SensorInfo};
use crate::model::stream::StreamError;
use crate::state::Layout;
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::any::Any;

/// Gives samples in order of time, or in the order of their arrival: see [`Self::arrival`].
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Samples in memory.
/// struct Recorded(std::vec::IntoIter<Sample>);
/// impl Source for Recorded {
///     fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
///         let next = self.0.next();
///         if let Some(next) = next {
///             *sample = next;
///         }
///         Ok(next.is_some())
///     }
/// }
/// ```
pub trait Source: Send {
    /// Writes the next sample; `false` at the end.
    ///
    /// # Errors
    /// When the source cannot read on. The run then ends, and everything recorded until then is
    /// kept.
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError>;

    /// Time at which the last sample of [`Self::next`] arrived, on the clock of the run, for a
    /// source that gives its samples in the order of their arrival: a live source, above all. The
    /// runner merges the sources by this time. Default: the time of the sample itself.
    fn arrival(&self) -> Option<Time> {
        None
    }

    /// The time of the last sample, where the source knows it: the end of the progress bar.
    fn end(&self) -> Option<Time> {
        None
    }

    /// Events that the source knows in advance, such as the segments of a simulated trajectory. The
    /// runner asks for them once, at the start. An event at [`Time::MIN`] concerns the whole source
    /// and is logged with the first sample; `navfuse check` prints it as a note.
    fn schedule(&self) -> Vec<Event> {
        Vec::new()
    }

    /// A warning after the last sample: a log that was cut off, rows that were skipped.
    fn warning(&mut self) -> Option<String> {
        None
    }
}

/// A source with its name in the scenario.
pub type NamedSource = (String, Box<dyn Source>);

/// A sink with its name in the scenario.
pub type NamedSink = (String, Box<dyn Sink>);

/// The facts about a run that are known when it begins.
#[derive(Clone, Debug)]
pub struct RunInfo {
    /// The scenario's name.
    pub name: String,
    /// Description of the scenario.
    pub description: Option<String>,
    /// The scenario in TOML, as it was run: with every override in place.
    pub scenario: String,
    /// Seed of every random number.
    pub seed: u64,
    /// True where every source simulates its samples, so that another seed gives another run.
    pub simulated: bool,
    /// True for a run that is smoothed: see [`Record::Filtered`].
    pub smoothed: bool,
    /// 1-sigma of the first reference, as its table states it or as the verdict assumes it; zero for a
    /// simulated one, which is the truth.
    pub reference: Option<Accuracy>,
    /// Version of the program.
    pub version: String,
    /// The blocks of the state.
    pub layout: Layout,
    /// The sensors, in the order of their ids.
    pub sensors: Vec<SensorInfo>,
}

/// Receives the records of a run that it wants. Only [`Sink::take`] has to be written.
/// After the run, [`crate::session::Finished::take_sink`] returns the sink.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Keeps the trace of the covariance over time.
/// #[derive(Default)]
/// struct Traces(Vec<(Time, f64)>);
/// impl Sink for Traces {
///     fn wants(&self) -> Wants {
///         Wants::EPOCHS
///     }
///     fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
///         if let Record::Epoch(epoch) = record {
///             let trace = (0..epoch.layout.tangent).map(|i| epoch.covariance.get(i, i)).sum();
///             self.0.push((epoch.state.time, trace));
///         }
///         Ok(())
///     }
/// }
/// ```
///
/// # Errors
/// A sink that fails is closed and named in an event; the run and the other sinks go on.
pub trait Sink: Any + Send {
    /// The records that the sink receives; the run asks once, before it starts.
    fn wants(&self) -> Wants {
        Wants::default()
    }
    /// The run is on a vehicle: from its start on, the sink never makes it wait for a disk or a viewer,
    /// and fails where it cannot keep up.
    fn never_wait(&mut self) {}
    /// The run begins.
    fn start(&mut self, _run: &RunInfo) -> Result<(), StreamError> {
        Ok(())
    }
    /// Takes a record.
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError>;
    /// Completes the file and begins a new one, for a sink that can: the signal SIGHUP asks for it.
    fn reopen(&mut self) -> Result<(), StreamError> {
        Ok(())
    }
    /// A quantity that the sink derives from the records so far, for the sinks that want
    /// [`Wants::DERIVED`]. The run asks after each estimate of the filter, and at its end.
    fn derive(&mut self, _end: bool) -> Option<Derived> {
        None
    }
    /// The run is over: writes the rest, and returns the place of the result, a path or an address.
    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        Ok(None)
    }
}
