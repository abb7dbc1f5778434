//! A recording that was split by time into files of the same form.

use crate::config::FileConfig;
use crate::stream::Stream;
use navfuse_core::model::record::Event;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use std::path::PathBuf;

/// Time by which a file may begin before the end of the one before it, in which a program wrote both.
const SHARED: Span = Span::from_nanos(1_000_000_000);

/// The files one after another.
pub struct Sequence {
    files: Vec<Stream>,
    /// Index of the file that is read.
    at: usize,
    /// Time of the last sample, and set while no sample of the file was given.
    last: Option<Time>,
    begins: bool,
    /// Number of rows that the file before has, too.
    repeated: u64,
}

impl Sequence {
    /// Opens the files of a sensor.
    ///
    /// # Errors
    /// When one cannot be read, or its columns do not fit.
    pub fn open(
        paths: Vec<PathBuf>,
        config: &FileConfig,
        about: (SensorId, &SensorInfo),
    ) -> Result<Self, StreamError> {
        let files = paths.iter().map(|path| Stream::open(path, config, about, false));
        let files = files.collect::<Result<Vec<Stream>, StreamError>>()?;
        Ok(Self { files, at: 0, last: None, begins: true, repeated: 0 })
    }
}

impl Source for Sequence {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        while let Some(file) = self.files.get_mut(self.at) {
            if !file.next(sample)? {
                (self.at, self.begins) = (self.at + 1, true);
                continue;
            }
            let before = self.last.filter(|last| sample.time <= *last);
            if let Some(last) = before {
                if self.begins && last - sample.time > SHARED {
                    let before = self.files[self.at - 1].path.display();
                    let (path, text) = (
                        self.files[self.at].path.clone(),
                        format!("it begins at {}, before {before} ends at {last}", sample.time),
                    );
                    let remedy = "name the files in the order of their times, and files of one \
                                  device alone";
                    return Err(StreamError::format(text).in_file(path).with_remedy(remedy));
                }
                self.repeated += 1;
                self.begins = false;
                continue;
            }
            (self.last, self.begins) = (Some(sample.time), false);
            return Ok(true);
        }
        Ok(false)
    }

    fn end(&self) -> Option<Time> {
        self.files.last().and_then(Stream::end)
    }

    fn schedule(&self) -> Vec<Event> {
        self.files.first().map(Stream::schedule).unwrap_or_default()
    }

    fn warning(&mut self) -> Option<String> {
        let repeated = std::mem::take(&mut self.repeated);
        let repeated = (repeated > 0).then(|| {
            format!(
                "{repeated} rows at the begins of files that the file before has, too, left out"
            )
        });
        let texts: Vec<String> =
            self.files.iter_mut().filter_map(Stream::warning).chain(repeated).collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}
