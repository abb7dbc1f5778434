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
/// The timeline: the clock of the run.
pub const TIMELINE: &str = "t";

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
        let mut recording = Self { streams: Vec::new(), path, file, served: None, gave_up: false };
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
        self.log_to(&self.streams, path, nanos, value)
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
        self.log_to(self.viewers(), path, nanos, value)
    }

    fn log_to(
        &self,
        streams: &[RecordingStream],
        path: &EntityPath,
        nanos: i64,
        value: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        for stream in streams {
            stream.set_time(TIMELINE, TimeCell::from_duration_nanos(nanos));
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
        self.columns_to(&self.streams, path, nanos, columns)
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
        self.columns_to(self.viewers(), path, nanos, columns)
    }

    fn columns_to(
        &self,
        streams: &[RecordingStream],
        path: &EntityPath,
        nanos: &[i64],
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<(), StreamError> {
        let columns: Vec<_> = columns.collect();
        for stream in streams {
            let times = TimeColumn::new_duration_nanos(TIMELINE, nanos.iter().copied());
            stream
                .send_columns(path.clone(), [times], columns.clone())
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
