//! The recording of a run: always a file, and streams to the viewers that watch it.

use crate::Rerun;
use crate::file::RecordingFile;
use crate::live::Live;
use crate::serve::{self, Served};
use navfuse_core::model::stream::{StreamError, StreamErrorKind};
use navfuse_core::plugin::SinkType;
use re_sdk::external::re_log_types::BlueprintActivationCommand;
use re_sdk::log::{LogMsg, TimeColumn};
use re_sdk::sink::{GrpcSink, LogSink};
use re_sdk::{
    AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, RecordingStreamResult,
    SerializedComponentColumn, StoreId, TimeCell,
};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The application of every recording: the viewer keeps one layout for each application.
pub const APPLICATION: &str = "navfuse";
/// The clock of the run: the timeline of a short run, and of one with every row.
pub const TIMELINE: &str = "t";
/// The whole seconds of the clock, which the viewer writes as `#600` where it writes `+10m` for the clock.
pub const SECONDS: &str = "seconds";
/// Length of a run from which on its plots have whole seconds, ns. In a longer run the minutes of the clock
/// are too close together for their labels; in a shorter one a second is several pixels, and its lines would
/// be stairs.
const LONG: i64 = 300_000_000_000;

/// The timeline of the plots and of the layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// Whole seconds.
    #[default]
    Seconds,
    /// The clock with its nanoseconds.
    Clock,
}

impl Axis {
    /// The axis of a run between those times, ns.
    pub fn of(span: Option<(i64, i64)>) -> Self {
        let long = span.is_none_or(|(first, last)| last.saturating_sub(first) >= LONG);
        if long { Self::Seconds } else { Self::Clock }
    }

    /// The name of the timeline.
    pub fn timeline(self) -> &'static str {
        match self {
            Self::Seconds => SECONDS,
            Self::Clock => TIMELINE,
        }
    }

    /// A time in the unit of the timeline, rounded down.
    pub fn time(self, nanos: i64) -> i64 {
        match self {
            Self::Seconds => whole(nanos),
            Self::Clock => nanos,
        }
    }

    /// The times of some rows.
    fn column(self, nanos: &[i64]) -> TimeColumn {
        let times = nanos.iter().map(|nanos| self.time(*nanos));
        match self {
            Self::Seconds => TimeColumn::new_sequence(SECONDS, times),
            Self::Clock => TimeColumn::new_duration_nanos(TIMELINE, times),
        }
    }
}

/// The multiple of the largest power of ten in the length of a run, at or before its begin, ns.
fn origin((first, last): (i64, i64)) -> i64 {
    let length = u64::try_from(whole(last.saturating_sub(first))).unwrap_or(1).max(1);
    let unit = 1_000_000_000 * 10_i64.pow(length.ilog10().min(9));
    first.div_euclid(unit) * unit
}

/// The whole seconds of a time, ns.
pub fn whole(nanos: i64) -> i64 {
    nanos.div_euclid(1_000_000_000)
}

/// The longest wait for a viewer, after which the recording drops it.
const PATIENCE: Duration = Duration::from_secs(5);

/// A file and the viewers, each with a queue of its own: a viewer that is closed does not stop the
/// file.
pub struct Recording {
    path: PathBuf,
    file: RecordingFile,
    /// The streams to the file and to the viewers.
    streams: Vec<RecordingStream>,
    served: Option<Served>,
    /// The timeline of columns; both until it is known.
    axis: Option<Axis>,
    /// The round time at or before the begin of the run, ns, from which the viewer counts its ticks.
    origin: Option<i64>,
    /// Set once a viewer has been given up.
    gave_up: bool,
}

impl Recording {
    /// Creates the file and connects the viewers.
    ///
    /// # Errors
    /// When the file cannot be written, or a viewer does not answer.
    pub fn open(path: PathBuf, live: &Live) -> Result<Self, StreamError> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| {
                let message = format!("cannot make the folder: {e}");
                StreamError::of(StreamErrorKind::Open, message).in_file(folder).with_source(e)
            })?;
        }
        let id = StoreId::random(re_sdk::StoreKind::Recording, APPLICATION);
        let file = RecordingFile::create(&path).map_err(|e| failure(&path, e))?;
        let (streams, served, axis, origin) = (Vec::new(), None, None, None);
        let mut recording = Self { streams, path, file, served, axis, origin, gave_up: false };
        let to_file = stream(&id, recording.file.clone()).map_err(|e| recording.error(e))?;
        recording.streams.push(to_file);
        for viewer in live.viewers()? {
            let viewer = stream(&id, GrpcSink::new(viewer)).map_err(|e| recording.error(e))?;
            recording.streams.push(viewer);
        }
        if let Some(address) = live.serve {
            let (server, served) = serve::start(&id, address)?;
            recording.streams.push(server);
            recording.served = Some(served);
        }
        Ok(recording)
    }

    /// Sets the timeline of columns from now on, in a run between those times, ns.
    pub fn settle(&mut self, axis: Axis, span: Option<(i64, i64)>) {
        self.axis = Some(axis);
        self.origin = span.filter(|_| axis == Axis::Seconds).map(origin);
    }

    /// The round time at or before the begin of a run in whole seconds, ns.
    pub(crate) fn origin(&self) -> Option<i64> {
        self.origin
    }

    /// Checks whether a viewer watches.
    pub fn is_live(&self) -> bool {
        self.streams.len() > 1
    }

    /// An error that names the file.
    pub fn error(&self, cause: impl Into<Box<dyn Error + Send + Sync>>) -> StreamError {
        failure(&self.path, cause)
    }

    /// Sets the name that the viewer shows.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn name(&self, name: &str) -> Result<(), StreamError> {
        self.streams.iter().try_for_each(|s| s.send_recording_name(name)).map_err(|e| self.error(e))
    }

    /// The streams to the viewers.
    fn viewers(&self) -> &[RecordingStream] {
        self.streams.get(1..).unwrap_or_default()
    }

    /// Logs a value that does not change over time.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn log_static(
        &self,
        path: &EntityPath,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.log_static_to(&self.streams, path, value)
    }

    /// Logs a value that does not change over time to the viewers that watch, and not to the file.
    ///
    /// # Errors
    /// When the value cannot be encoded.
    pub fn log_static_to_viewers(
        &self,
        path: &EntityPath,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.log_static_to(self.viewers(), path, value)
    }

    fn log_static_to(
        &self,
        streams: &[RecordingStream],
        path: &EntityPath,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        let mut streams = streams.iter();
        streams.try_for_each(|s| s.log_static(path.clone(), value)).map_err(|e| self.error(e))
    }

    /// Logs a value at one time.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn log(
        &self,
        path: &EntityPath,
        nanos: i64,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.log_to(&self.streams, path, (nanos, true), value)
    }

    /// Logs a value in place of an earlier one at the same time, where another value follows in the same
    /// second: it would replace that one, too.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn log_to_clock(
        &self,
        path: &EntityPath,
        nanos: i64,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.log_to(&self.streams, path, (nanos, false), value)
    }

    /// Logs a value at one time to the viewers that watch, and not to the file.
    ///
    /// # Errors
    /// When the value cannot be encoded.
    pub fn log_to_viewers(
        &self,
        path: &EntityPath,
        nanos: i64,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.log_to(self.viewers(), path, (nanos, true), value)
    }

    fn log_to(
        &self,
        streams: &[RecordingStream],
        path: &EntityPath,
        (nanos, seconds): (i64, bool),
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        for stream in streams {
            stream.reset_time();
            stream.set_time(TIMELINE, TimeCell::from_duration_nanos(nanos));
            if seconds {
                stream.set_time_sequence(SECONDS, whole(nanos));
            }
            stream.log(path.clone(), value).map_err(|e| self.error(e))?;
        }
        Ok(())
    }

    /// Sends a block of columns, one row for each time.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn columns(
        &self,
        path: &EntityPath,
        nanos: &[i64],
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<(), StreamError> {
        self.columns_to(&self.streams, path, (nanos, self.axis), columns)
    }

    /// Sends a block of columns to the viewers that watch, and not to the file.
    ///
    /// # Errors
    /// When the columns cannot be encoded.
    pub fn columns_to_viewers(
        &self,
        path: &EntityPath,
        nanos: &[i64],
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<(), StreamError> {
        self.columns_to(self.viewers(), path, (nanos, None), columns)
    }

    fn columns_to(
        &self,
        streams: &[RecordingStream],
        path: &EntityPath,
        (nanos, axis): (&[i64], Option<Axis>),
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<(), StreamError> {
        let columns: Vec<_> = columns.collect();
        let axes = axis.map_or_else(|| vec![Axis::Clock, Axis::Seconds], |axis| vec![axis]);
        let times: Vec<TimeColumn> = axes.into_iter().map(|axis| axis.column(nanos)).collect();
        for stream in streams {
            stream
                .send_columns(path.clone(), times.clone(), columns.clone())
                .map_err(|e| self.error(e))?;
        }
        Ok(())
    }

    /// Sends the layout of a run that begins. A viewer shows it at once, and while it loads the
    /// file; the file of a run that was killed has no other.
    pub fn first_layout(&self, messages: &[LogMsg]) {
        self.streams.iter().for_each(|s| send_layout(s, messages));
    }

    /// Sends the layout of a run that has ended. File and viewers show it: the plots of a run that
    /// goes on have no further data.
    pub fn last_layout(&self, messages: &[LogMsg]) {
        self.streams.iter().for_each(|s| send_layout(s, messages));
    }

    /// Waits until everything is written, and drops viewers that no longer answer.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> Result<(), StreamError> {
        let Some(file) = self.streams.first() else { return Ok(()) };
        let flushed = file.flush_blocking();
        self.file.check().map_err(|e| self.error(e))?;
        flushed.map_err(|e| self.error(e))?;
        let viewers = self.streams.split_off(1);
        let answers = |s: &RecordingStream| s.flush_with_timeout(PATIENCE).is_ok();
        let (kept, gone): (Vec<_>, Vec<_>) = viewers.into_iter().partition(answers);
        self.streams.extend(kept);
        self.gave_up |= !gone.is_empty();
        // a stream waits for its viewer before it ends
        gone.into_iter().for_each(|stream| drop(std::thread::spawn(|| drop(stream))));
        Ok(())
    }

    /// Completes the file, and keeps a server until the process ends; returns the path, with the
    /// address of the page where one is served.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn close(&mut self) -> Result<String, StreamError> {
        let live = self.streams.split_off(self.streams.len().min(1));
        self.streams.clear(); // ends the thread that writes
        let finished = self.file.finish().map_err(|e| self.error(e));
        let path = self.path.display().to_string();
        let place = match self.served.take() {
            None if self.gave_up => format!("{path}, but a viewer no longer answered"),
            None => path,
            Some(served) => {
                let place = format!("{path}, shown at {}", served.url);
                serve::keep(live, served);
                place
            }
        };
        finished.map(|()| place)
    }
}

/// An error that names the file.
fn failure(path: &Path, cause: impl Into<Box<dyn Error + Send + Sync>>) -> StreamError {
    StreamError::sink(Rerun::TYPE, path, cause)
}

/// A stream to one sink. The stream is enabled whatever the environment variable RERUN holds: the
/// scenario asks for it.
pub fn stream(id: &StoreId, sink: impl LogSink) -> RecordingStreamResult<RecordingStream> {
    let sinks: Vec<Box<dyn LogSink>> = vec![Box::new(sink)];
    let stream = RecordingStreamBuilder::from_store_id(id).enabled(true).set_sinks(sinks)?;
    stream.set_log_time_enabled(false);
    Ok(stream)
}

/// Sends a layout, which becomes the default and is shown at once.
fn send_layout(stream: &RecordingStream, messages: &[LogMsg]) {
    if let Some(blueprint_id) = messages.first().map(|m| m.store_id().clone()) {
        let activate =
            BlueprintActivationCommand { blueprint_id, make_active: true, make_default: true };
        stream.send_blueprint(messages.to_vec(), activate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The viewer puts its ticks at the first time of a plot, and at hundreds of seconds after it.
    #[test]
    fn ticks_are_counted_from_a_round_time_at_or_before_the_begin() {
        let second = 1_000_000_000;
        for (first, last, expected) in
            [(60, 630, 0), (600, 2060, 0), (1250, 1980, 1200), (-7, 200, -100)]
        {
            assert_eq!(origin((first * second, last * second)), expected * second, "{first}");
        }
    }

    #[test]
    fn a_short_run_has_the_clock_and_a_long_one_whole_seconds() {
        let axes = [299, 300].map(|s| Axis::of(Some((0, s * 1_000_000_000))));
        assert_eq!(axes, [Axis::Clock, Axis::Seconds]);
        assert_eq!([-1, 1_999_999_999].map(whole), [-1, 1]);
    }
}
