//! The file of a recording. The viewer's library has such a sink, but its writer ends in silence
//! when the disk is full, and whoever waits for it then waits for ever.

use navfuse_core::files::WholeFile;
use re_sdk::external::re_log_encoding::{Encoder, EncodingOptions};
use re_sdk::log::LogMsg;
use re_sdk::sink::{LogSink, SinkFlushError};
use std::error::Error;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

type Cause = Box<dyn Error + Send + Sync>;

/// The state of the file.
enum State {
    Open(Box<Encoder<WholeFile>>),
    /// A message could not be written, for this reason.
    Failed(String),
    Finished,
}

/// A file that is written by the thread of its stream, and completed by its owner.
#[derive(Clone)]
pub struct RecordingFile(Arc<Mutex<State>>);

impl RecordingFile {
    /// Creates the part of the file; the file takes its name when it is whole.
    pub fn create(path: &Path) -> std::io::Result<Self> {
        let file = WholeFile::create(path)?;
        let options = EncodingOptions::PROTOBUF_COMPRESSED;
        let state = match Encoder::new_eager(re_sdk::build_info().version, options, file) {
            Ok(encoder) => State::Open(Box::new(encoder)),
            // the disk is full from the start: the run goes on, without its recording
            Err(error) => State::Failed(error.to_string()),
        };
        Ok(Self(Arc::new(Mutex::new(state))))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The reason for which a message could not be written, if one could not.
    pub fn check(&self) -> Result<(), Cause> {
        match &*self.state() {
            State::Failed(reason) => Err(reason.clone().into()),
            State::Open(_) | State::Finished => Ok(()),
        }
    }

    /// Completes the file. It needs all messages, so the stream has to be closed before.
    pub fn finish(&self) -> Result<(), Cause> {
        let mut encoder = match std::mem::replace(&mut *self.state(), State::Finished) {
            State::Open(encoder) => encoder,
            State::Failed(reason) => return Err(reason.into()),
            State::Finished => return Ok(()),
        };
        let finished = encoder.finish();
        let file = encoder.into_inner()?;
        finished?;
        Ok(file.finish()?)
    }
}

impl LogSink for RecordingFile {
    fn send(&self, message: LogMsg) {
        let mut state = self.state();
        let State::Open(encoder) = &mut *state else { return };
        if let Err(error) = encoder.append(&message) {
            let failed = State::Failed(error.to_string());
            if let State::Open(encoder) = std::mem::replace(&mut *state, failed) {
                // without its file, the encoder adds no end to a recording with a hole
                drop(encoder.into_inner());
            }
        }
    }

    fn flush_blocking(&self, _: Duration) -> Result<(), SinkFlushError> {
        self.check().map_err(|reason| SinkFlushError::failed(reason.to_string()))
    }
}
