//! Sentences as they arrive: one stream for all sensors that it feeds.

use crate::config::Nmea;
use crate::epoch::Dates;
use crate::receiver::Receiver;
use crate::source::{RECORD, sentence_of};
use crate::target::{Target, targets};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::Sample;
use navfuse_frames::{Frames, Sentences};
use std::io::{ErrorKind, Read};
use std::path::PathBuf;

impl Nmea {
    /// The samples of instruments that are connected: `reader` has their bytes as they arrive, and
    /// `file` is the name of the port in messages. An error of `reader` with the kind `WouldBlock`
    /// means that no byte has arrived for a while, which ends an epoch; the next call goes on.
    ///
    /// # Errors
    /// When a sensor does not exist or does not fit.
    pub fn connected(
        self,
        reader: impl Read + Send + 'static,
        context: &OpenContext<'_>,
    ) -> Result<Box<dyn Source>, StreamError> {
        let receiver = |target| Receiver::new(target, &self, Dates::default());
        let receivers = targets(&self, context)?.into_iter().map(receiver);
        Ok(Box::new(Connected {
            receivers: receivers.collect::<Result<_, _>>()?,
            frames: Frames::new(reader, self.checksum.sentences()),
            framing: self.checksum.sentences(),
            talker: self.talker,
            port: self.file,
            ended: false,
        }))
    }
}

/// The samples of all sensors of a stream.
struct Connected<R> {
    port: PathBuf,
    frames: Frames<R, Sentences>,
    framing: Sentences,
    talker: Option<String>,
    receivers: Vec<Receiver>,
    ended: bool,
}

impl<R: Read> Connected<R> {
    /// Reads one sentence.
    fn advance(&mut self) -> Result<(), StreamError> {
        let receivers = &mut self.receivers;
        match self.frames.next() {
            Ok(Some(frame)) => {
                let content = self.framing.content(frame.bytes);
                let Some(sentence) = sentence_of(self.talker.as_deref(), content) else {
                    return Ok(());
                };
                receivers.iter_mut().try_for_each(|r| r.take(frame.offset, &sentence))
            }
            Ok(None) => {
                self.ended = true;
                receivers.iter_mut().try_for_each(Receiver::finish)
            }
            Err(e) => {
                if e.kind() == ErrorKind::WouldBlock {
                    receivers.iter_mut().try_for_each(Receiver::pause)?;
                }
                Err(StreamError::read(&self.port, e))
            }
        }
    }
}

impl<R: Read + Send> Source for Connected<R> {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            if let Some(next) = self.receivers.iter_mut().find_map(Receiver::pop) {
                *sample = next;
                return Ok(true);
            }
            if self.ended {
                return Ok(false);
            }
            self.advance()?;
        }
    }

    fn warning(&mut self) -> Option<String> {
        let mut parts: Vec<String> = self.frames.damage().describe(RECORD).into_iter().collect();
        for receiver in &self.receivers {
            let key = Target::key(receiver.target.part);
            parts.extend(receiver.warnings().into_iter().map(|text| format!("{key}: {text}")));
        }
        (!parts.is_empty()).then(|| format!("{}: {}", self.port.display(), parts.join("; ")))
    }
}
