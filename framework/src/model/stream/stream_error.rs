//! The error of sources and sinks: its kind, its place, its message and its cause.

use crate::document::{DocumentError, Node};
use crate::files::has_to_stay;
use std::error::Error;
use std::fmt;
use std::path::PathBuf;

/// A failure of a source or a sink. Its text names the place, what is wrong there and the remedy.
///
/// One line is enough where the message is all there is to report; the constructors and methods add
/// the rest:
/// ```
/// use navfuse_core::model::stream::{StreamError, StreamErrorKind};
///
/// let error = StreamError::new("the receiver sends no data");
/// assert_eq!(error.to_string(), "the receiver sends no data");
///
/// let cause = "12,5".parse::<f64>().unwrap_err();
/// let error = StreamError::format("depth = \"12,5\" is not a number")
///     .in_file("depth.csv")
///     .on_line(7)
///     .with_remedy("write a decimal point")
///     .with_source(cause);
/// assert_eq!(
///     error.to_string(),
///     "depth.csv:7: depth = \"12,5\" is not a number; write a decimal point"
/// );
/// assert_eq!(error.kind(), StreamErrorKind::Format);
///
/// let cause = std::io::Error::other("no space left");
/// let error = StreamError::write("run.log", cause);
/// assert_eq!(error.to_string(), "run.log: cannot be written: no space left");
/// ```
#[derive(Debug)]
pub struct StreamError(Box<Content>);

/// The content of an error, boxed: every sample passes a `Result` with it.
#[derive(Debug)]
struct Content {
    kind: StreamErrorKind,
    place: StreamPlace,
    message: String,
    source: Option<Box<dyn Error + Send + Sync>>,
}

/// The kind of a failure, for a program that reacts to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StreamErrorKind {
    /// A file or folder cannot be opened or created.
    Open,
    /// The bytes of an open file cannot be read.
    Read,
    /// The bytes of a result cannot be written.
    Write,
    /// The content does not follow its format, or a value in it is not usable.
    Format,
    /// The samples are not in order of time.
    Order,
    /// The parameters do not fit the scenario, its sensors or the recording.
    Scenario,
    /// An address is not usable, or nobody answers there.
    Network,
    /// None of the other kinds.
    Other,
}

/// The place of a failure; each part is empty where it does not apply.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StreamPlace {
    /// Sensor whose samples are concerned.
    pub sensor: Option<String>,
    /// Key below the table of the source or sink.
    pub key: Option<String>,
    /// File or folder.
    pub path: Option<PathBuf>,
    /// Line of the file, counted from 1.
    pub line: Option<u64>,
}

impl StreamPlace {
    /// Returns `true` if no part is given.
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for StreamPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        if let Some(sensor) = &self.sensor {
            write!(f, "[sensor.{sensor}]")?;
            separator = ": ";
        }
        if let Some(key) = &self.key {
            write!(f, "{separator}{key}")?;
            separator = ": ";
        }
        if let Some(path) = &self.path {
            write!(f, "{separator}{}", path.display())?;
            separator = ":";
        }
        match self.line {
            Some(line) if self.path.is_some() => write!(f, "{separator}{line}"),
            Some(line) => write!(f, "{separator}line {line}"),
            None => Ok(()),
        }
    }
}

impl StreamError {
    /// An error of the kind [`StreamErrorKind::Other`].
    pub fn new(message: impl Into<String>) -> Self {
        Self::of(StreamErrorKind::Other, message)
    }

    /// An error of any kind.
    pub fn of(kind: StreamErrorKind, message: impl Into<String>) -> Self {
        let (place, message) = (StreamPlace::default(), message.into());
        Self(Box::new(Content { kind, place, message, source: None }))
    }

    /// An error of the kind [`StreamErrorKind::Format`].
    pub fn format(message: impl Into<String>) -> Self {
        Self::of(StreamErrorKind::Format, message)
    }

    /// An error of the kind [`StreamErrorKind::Scenario`].
    pub fn scenario(message: impl Into<String>) -> Self {
        Self::of(StreamErrorKind::Scenario, message)
    }

    /// An error of the kind [`StreamErrorKind::Network`].
    pub fn network(message: impl Into<String>) -> Self {
        Self::of(StreamErrorKind::Network, message)
    }

    /// A file or folder that cannot be opened, and why.
    pub fn open(path: impl Into<PathBuf>, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::about_file(StreamErrorKind::Open, "opened", path.into(), cause.into())
    }

    /// A file that cannot be read, and why.
    pub fn read(path: impl Into<PathBuf>, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::about_file(StreamErrorKind::Read, "read", path.into(), cause.into())
    }

    /// A file that cannot be written, and why.
    pub fn write(path: impl Into<PathBuf>, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::about_file(StreamErrorKind::Write, "written", path.into(), cause.into())
    }

    /// A file of a sink that cannot be written, why, and what to do about it. An error that comes
    /// from [`check_output`](crate::files::check_output) has its own remedy.
    pub fn sink(
        kind: &str,
        path: impl Into<PathBuf>,
        cause: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        let error = Self::write(path, cause);
        if error.source().is_some_and(has_to_stay) {
            return error;
        }
        error.with_remedy(format!(
            "free space there, give another folder with --out, or set sink.{kind}.enabled=false"
        ))
    }

    fn about_file(
        kind: StreamErrorKind,
        done: &str,
        path: PathBuf,
        cause: Box<dyn Error + Send + Sync>,
    ) -> Self {
        Self::of(kind, format!("cannot be {done}: {cause}")).in_file(path).with_source(cause)
    }

    /// Adds the file.
    #[must_use]
    pub fn in_file(mut self, path: impl Into<PathBuf>) -> Self {
        self.0.place.path = Some(path.into());
        self
    }

    /// Adds the line of the file, counted from 1.
    #[must_use]
    pub fn on_line(mut self, line: u64) -> Self {
        self.0.place.line = Some(line);
        self
    }

    /// Adds the name of the sensor.
    #[must_use]
    pub fn of_sensor(mut self, name: impl Into<String>) -> Self {
        self.0.place.sensor = Some(name.into());
        self
    }

    /// Adds the key below the table of the source or sink.
    #[must_use]
    pub fn at_key(mut self, key: impl Into<String>) -> Self {
        self.0.place.key = Some(key.into());
        self
    }

    /// Appends the remedy to the message.
    #[must_use]
    pub fn with_remedy(mut self, remedy: impl fmt::Display) -> Self {
        self.0.message = format!("{}; {remedy}", self.0.message);
        self
    }

    /// Adds the cause, which [`Error::source`] returns.
    #[must_use]
    pub fn with_source(mut self, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        self.0.source = Some(cause.into());
        self
    }

    /// Adds the place in the document: that of the key where the error has one.
    pub(crate) fn at(&self, node: &Node<'_>) -> DocumentError {
        let StreamPlace { sensor, key, path, line } = self.place();
        match key.as_deref().map(|key| node.reach(key)) {
            Some((place, None)) if sensor.is_none() && path.is_none() && line.is_none() => {
                place.error(self.message())
            }
            Some((place, _)) => place.error(self),
            None => node.error(self),
        }
    }

    /// The kind.
    pub fn kind(&self) -> StreamErrorKind {
        self.0.kind
    }

    /// The place.
    pub fn place(&self) -> &StreamPlace {
        &self.0.place
    }

    /// The message with its remedy, without the place.
    pub fn message(&self) -> &str {
        &self.0.message
    }
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Content { place, message, .. } = &*self.0;
        if place.is_empty() { f.write_str(message) } else { write!(f, "{place}: {message}") }
    }
}

impl Error for StreamError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source.as_deref().map(|cause| cause as &(dyn Error + 'static))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_an_error_is_the_one_that_its_text_begins_with() {
        let error = StreamError::format("depth is not a number").in_file("depth.csv").on_line(7);
        assert_eq!(error.place().to_string(), "depth.csv:7");
        assert!(StreamError::new("the receiver sends no data").place().is_empty());
    }

    #[test]
    fn the_message_of_an_error_is_its_text_without_the_place() {
        let error = StreamError::format("depth is not a number").in_file("depth.csv").on_line(7);
        assert_eq!(error.message(), "depth is not a number");
        assert_eq!(error.to_string(), "depth.csv:7: depth is not a number");
    }
}
