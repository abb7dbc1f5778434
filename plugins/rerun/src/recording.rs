//! Where a run is sent: always a file, and a viewer that watches while it goes on.

use crate::live::{self, Live};
use navfuse_core::model::stream::{StreamError, StreamErrorKind};
use rerun::external::re_log_types::BlueprintActivationCommand;
use rerun::log::{LogMsg, TimeColumn};
use rerun::sink::{FileSink, GrpcSink};
use rerun::{
    AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, SerializedComponentColumn,
    StoreId, TimeCell,
};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The application of every recording: the viewer keeps one layout for each.
pub const APPLICATION: &str = "navfuse";
/// The timeline: the run's clock.
pub const TIMELINE: &str = "t";

/// How long a viewer may keep a run waiting before it is let go.
const PATIENCE: Duration = Duration::from_secs(5);

/// A file and the viewers, each with its own queue: a viewer that is closed does not stop the file.
pub struct Recording {
    path: PathBuf,
    streams: Vec<RecordingStream>,
    served: Option<live::Served>,
}

impl Recording {
    /// Creates the file and reaches the viewers.
    ///
    /// # Errors
    /// When the file cannot be written, or a viewer is not there.
    pub fn open(path: PathBuf, live: &Live) -> Result<Self, StreamError> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| {
                let message = format!("cannot make the folder: {e}");
                StreamError::of(StreamErrorKind::Open, message).in_file(folder).with_source(e)
            })?;
        }
        let id = StoreId::random(rerun::StoreKind::Recording, APPLICATION);
        let sink = FileSink::new(&path).map_err(|e| StreamError::write(&path, e))?;
        let mut recording = Self { streams: vec![stream(&id, sink, &path)?], path, served: None };
        for viewer in live.viewers()? {
            recording.streams.push(stream(&id, GrpcSink::new(viewer), &recording.path)?);
        }
        if let Some((server, served)) = live.serve()? {
            recording.streams.push(stream(&id, server, &recording.path)?);
            recording.served = Some(served);
        }
        Ok(recording)
    }

    /// Whether someone watches.
    pub fn is_live(&self) -> bool {
        self.streams.len() > 1
    }

    /// An error that names the file.
    pub fn error(&self, cause: impl Into<Box<dyn Error + Send + Sync>>) -> StreamError {
        StreamError::write(&self.path, cause)
    }

    /// Names the recording.
    pub fn name(&self, name: &str) -> Result<(), StreamError> {
        self.streams.iter().try_for_each(|s| s.send_recording_name(name)).map_err(|e| self.error(e))
    }

    /// Logs what does not change.
    pub fn log_static(
        &self,
        path: &EntityPath,
        what: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        self.streams
            .iter()
            .try_for_each(|s| s.log_static(path.clone(), what))
            .map_err(|e| self.error(e))
    }

    /// Logs at one time.
    pub fn log(
        &self,
        path: &EntityPath,
        nanos: i64,
        what: &dyn AsComponents,
    ) -> Result<(), StreamError> {
        for stream in &self.streams {
            stream.set_time(TIMELINE, TimeCell::from_duration_nanos(nanos));
            stream.log(path.clone(), what).map_err(|e| self.error(e))?;
        }
        Ok(())
    }

    /// Sends a block of columns.
    pub fn columns(
        &self,
        path: &EntityPath,
        nanos: &[i64],
        columns: impl Iterator<Item = SerializedComponentColumn>,
    ) -> Result<(), StreamError> {
        let columns: Vec<_> = columns.collect();
        for stream in &self.streams {
            let times = TimeColumn::new_duration_nanos(TIMELINE, nanos.iter().copied());
            stream
                .send_columns(path.clone(), [times], columns.clone())
                .map_err(|e| self.error(e))?;
        }
        Ok(())
    }

    /// Sends a layout: to the file, and to the viewers as what is shown or as what a reset goes back to.
    pub fn layout(&self, messages: &[LogMsg], reset_only: bool) {
        let Some(blueprint_id) = messages.first().map(|m| m.store_id().clone()) else { return };
        for (k, stream) in self.streams.iter().enumerate() {
            let make_active = k == 0 || !reset_only;
            let blueprint_id = blueprint_id.clone();
            let activate =
                BlueprintActivationCommand { blueprint_id, make_active, make_default: true };
            stream.send_blueprint(messages.to_vec(), activate);
        }
    }

    /// Waits until everything is written; a viewer that has gone is forgotten.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> Result<(), StreamError> {
        let Some(file) = self.streams.first() else { return Ok(()) };
        file.flush_blocking().map_err(|e| self.error(e).with_remedy("is the disk full?"))?;
        let mut k = 0;
        self.streams.retain(|s| {
            k += 1;
            k == 1 || s.flush_with_timeout(PATIENCE).is_ok()
        });
        Ok(())
    }

    /// Completes the file, and keeps a server for the rest of the process; gives the address or the path.
    pub fn close(&mut self) -> String {
        let live = self.streams.split_off(self.streams.len().min(1));
        self.streams.clear(); // the writer ends the file and is joined
        let path = self.path.display().to_string();
        match self.served.take() {
            None => path,
            Some(served) => {
                let place = format!("{path}, shown at {}", served.url);
                live::keep(live, served);
                place
            }
        }
    }
}

/// A stream to one sink. It is enabled whatever the environment says: the scenario asks for it.
fn stream<S>(id: &StoreId, sink: S, path: &Path) -> Result<RecordingStream, StreamError>
where
    (S,): rerun::sink::IntoMultiSink,
{
    let stream = RecordingStreamBuilder::from_store_id(id)
        .enabled(true)
        .set_sinks((sink,))
        .map_err(|e| StreamError::write(path, e))?;
    stream.set_log_time_enabled(false);
    Ok(stream)
}
