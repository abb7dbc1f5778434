//! A recording that was split by time into files of the same form.

use crate::bounded::beginning;
use crate::config::FileConfig;
use crate::number::number;
use crate::stream::Stream;
use crate::text::text;
use navfuse_core::model::record::Event;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use std::path::{Path, PathBuf};

/// Time by which a file may begin before the end of the one before it, in which a program wrote both.
const SHARED: Span = Span::from_nanos(1_000_000_000);

/// Bytes of the first line of a file that are looked at.
const LINE: u64 = 4096;

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
    /// Opens the files of a sensor; with `part`, they may lack channels of any sensor.
    ///
    /// # Errors
    /// When one cannot be read, or its columns do not fit.
    pub fn open(
        paths: Vec<PathBuf>,
        config: &FileConfig,
        about: (SensorId, &SensorInfo),
        part: bool,
    ) -> Result<Self, StreamError> {
        let mut files: Vec<Stream> = Vec::new();
        for path in &paths {
            // a program may write its headings into the first file alone
            let headless = |first: &Stream| {
                config.headings.is_none() && config.skip == 0 && begins_with_a_row(path, first)
            };
            let first = files.first().filter(|first| headless(first));
            let headings = first.map(|first| first.headings().to_vec());
            files.push(match headings {
                None => Stream::open(path, config, about, part)?,
                headings => {
                    Stream::open(path, &FileConfig { headings, ..config.clone() }, about, part)?
                }
            });
        }
        Ok(Self { files, at: 0, last: None, begins: true, repeated: 0 })
    }
}

/// One file, or files that go on where the one before ends.
pub enum Files {
    One(Box<Stream>),
    Several(Sequence),
}

impl Files {
    /// Opens a file and those that its configuration names.
    ///
    /// # Errors
    /// As for [`Sequence::open`].
    pub fn open(
        path: PathBuf,
        config: &FileConfig,
        about: (SensorId, &SensorInfo),
        part: bool,
    ) -> Result<Self, StreamError> {
        if config.then.is_empty() {
            return Ok(Self::One(Box::new(Stream::open(&path, config, about, part)?)));
        }
        let paths = std::iter::once(path).chain(config.then.iter().cloned()).collect();
        Sequence::open(paths, config, about, part).map(Self::Several)
    }

    /// The first file.
    pub fn first(&self) -> Option<&Stream> {
        match self {
            Self::One(file) => Some(file),
            Self::Several(sequence) => sequence.files.first(),
        }
    }

    fn source(&mut self) -> &mut dyn Source {
        match self {
            Self::One(file) => &mut **file,
            Self::Several(sequence) => sequence,
        }
    }
}

impl Source for Files {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        self.source().next(sample)
    }

    fn end(&self) -> Option<Time> {
        match self {
            Self::One(file) => file.end(),
            Self::Several(sequence) => sequence.end(),
        }
    }

    fn schedule(&self) -> Vec<Event> {
        self.first().map(Source::schedule).unwrap_or_default()
    }

    fn warning(&mut self) -> Option<String> {
        self.source().warning()
    }
}

/// Tests whether the first line of a file has a number for each heading of another one.
fn begins_with_a_row(path: &Path, other: &Stream) -> bool {
    let bytes = beginning(path, LINE).unwrap_or_default();
    let text = text(&bytes);
    let line = text.lines().next().unwrap_or_default();
    let cells = line.split([',', ';', '\t', '|']);
    let numbers = cells.clone().filter(|cell| number(cell.trim()).is_some()).count();
    let count = cells.count();
    count == other.headings().len() && 2 * numbers > count
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
