//! Sources of samples and sinks of results.

use crate::model::record::verdict::Verdict;
use crate::model::record::{Epoch, Event, Repetition, UpdateRecord};
use crate::model::sensor::SensorInfo;
use crate::model::stream::StreamError;
use crate::state::Layout;
use crate::state::covariance::{Transition, Update};
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
    /// True for a run that is smoothed: see [`Sink::filtered`].
    pub smoothed: bool,
    /// Version of the program.
    pub version: String,
    /// The blocks of the state.
    pub layout: Layout,
    /// The sensors, in the order of their ids.
    pub sensors: Vec<SensorInfo>,
}

/// Receives the results of a run. Only [`Sink::start`] and [`Sink::finish`] have to be written.
/// After the run, [`crate::run::runner::Finished::take_sink`] returns the sink.
///
/// ```
/// use navfuse_core::prelude::*;
/// use navfuse_core::model::record::Epoch;
/// /// Keeps the trace of the covariance over time.
/// #[derive(Default)]
/// struct Traces(Vec<(Time, f64)>);
/// impl Sink for Traces {
///     fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
///         Ok(())
///     }
///     fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
///         let trace = (0..epoch.layout.tangent).map(|i| epoch.covariance.get(i, i)).sum();
///         self.0.push((epoch.state.time, trace));
///         Ok(())
///     }
///     fn finish(&mut self) -> Result<Option<String>, StreamError> {
///         Ok(None)
///     }
/// }
/// ```
///
/// # Errors
/// A sink that fails is closed and named in an event; the run and the other sinks go on.
pub trait Sink: Any + Send {
    /// The run begins.
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError>;
    /// A sample, in the order in which the estimator processes it.
    fn sample(&mut self, _sample: &Sample) -> Result<(), StreamError> {
        Ok(())
    }
    /// An estimate, at the output rate. In a run that is smoothed it is the smoothed one: all of
    /// them come after the last sample, update and event of the filter, or with a fixed lag once
    /// the filter is the lag ahead.
    fn epoch(&mut self, _epoch: &Epoch<'_>) -> Result<(), StreamError> {
        Ok(())
    }
    /// Set if the sink wants the newest estimates, as a display or a controller does.
    fn wants_newest(&self) -> bool {
        false
    }
    /// The estimate after all samples that have arrived, at the output rate, in a run where a
    /// sensor may be late (`late`). A late sample may still change it; [`Self::epoch`] gives the
    /// final estimate of that time once no late sample can. In other runs every estimate is final.
    fn newest(&mut self, _epoch: &Epoch<'_>) -> Result<(), StreamError> {
        Ok(())
    }
    /// The filter's own estimate in a run that is smoothed, when the filter makes it.
    fn filtered(&mut self, _epoch: &Epoch<'_>) -> Result<(), StreamError> {
        Ok(())
    }
    /// Set if the sink judges the estimates. It then receives an estimate at every sample of a
    /// reference, also where these come faster than the output rate.
    fn compares(&self) -> bool {
        false
    }
    /// A measurement was accepted, gated or rejected.
    fn update(&mut self, _update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        Ok(())
    }
    /// The error state moved: see [`crate::model::record::Observer::transition`].
    fn transition(&mut self, _transition: &Transition) -> Result<(), StreamError> {
        Ok(())
    }
    /// A measurement corrected the state: see [`crate::model::record::Observer::correction`].
    fn correction(&mut self, _update: &Update) -> Result<(), StreamError> {
        Ok(())
    }
    /// Set if the sink follows a filter through a repetition. It then receives the transitions and
    /// corrections of the repetition too.
    fn repeats(&self) -> bool {
        false
    }
    /// A filter took its samples again: see [`crate::model::record::Observer::repetition`].
    fn repetition(&mut self, _repetition: Repetition<'_>) -> Result<(), StreamError> {
        Ok(())
    }
    /// An event for the log.
    fn event(&mut self, _event: &Event) -> Result<(), StreamError> {
        Ok(())
    }
    /// The verdict of the run, after everything else.
    fn verdict(&mut self, _verdict: &Verdict) -> Result<(), StreamError> {
        Ok(())
    }
    /// The run is over: writes the rest, and returns the place of the result, a path or an address.
    fn finish(&mut self) -> Result<Option<String>, StreamError>;
}
