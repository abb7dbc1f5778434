//! A registered type: its kind, its name, its schema, and how it is made.

use crate::compose::Composer;
use crate::document::Node;
use crate::model::process::BuiltProcess;
use crate::model::sensor::Role;
use crate::model::sensor::limits::Limit;
use crate::model::stream::{Feed, Sink, Source, StreamError};
use crate::plugin::{BuildError, OpenContext};
use crate::units::sample::Channel;
use schemars::Schema;
use std::any::TypeId;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

/// The kind of a registered type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// `[process.NAME]`
    Process,
    /// `[sensor.NAME]`
    Sensor,
    /// `[source.NAME]`
    Source,
    /// `[link.NAME]`
    Link,
    /// `[sink.NAME]`
    Sink,
}

impl Kind {
    /// All kinds, in the order of a scenario.
    pub const ALL: [Self; 5] = [Self::Process, Self::Sensor, Self::Source, Self::Link, Self::Sink];

    /// Table of the kind in TOML.
    pub const fn table(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::Sensor => "sensor",
            Self::Source => "source",
            Self::Link => "link",
            Self::Sink => "sink",
        }
    }
}

pub(super) type ForComposer<T> =
    Box<dyn for<'a, 'b> Fn(&Node<'a>, &'b mut Composer) -> Result<T, BuildError> + Send + Sync>;
/// Reads the table of a source, link or sink, without opening anything.
pub(super) type Prepare<T> = Box<dyn for<'a> Fn(&Node<'a>) -> Result<T, BuildError> + Send + Sync>;
/// Opens a source, link or sink whose table is read.
pub(crate) type Open<T> =
    Box<dyn for<'a, 'b> FnOnce(&'a OpenContext<'b>) -> Result<T, StreamError>>;

/// A sink that is configured but not open.
pub(crate) struct PreparedSink {
    pub files: Vec<PathBuf>,
    pub open: Open<Box<dyn Sink>>,
}

pub(crate) struct BuiltSensor {
    pub channels: Vec<Channel>,
    pub limits: Vec<Limit>,
    /// Channels that are all zero where there is no measurement.
    pub unset: &'static [&'static str],
    pub role: Role,
}

pub(crate) enum Make {
    Process { make: ForComposer<BuiltProcess>, beside: bool },
    Sensor { make: ForComposer<BuiltSensor>, input: bool },
    Source { prepare: Prepare<Open<Vec<Box<dyn Source>>>>, simulates: bool },
    Link { prepare: Prepare<Open<Box<dyn Feed>>> },
    Sink { prepare: Prepare<PreparedSink>, default: bool },
}

/// A value that is made when it is first read.
pub(super) type Lazy<T> = LazyLock<T, Box<dyn FnOnce() -> T + Send>>;

/// A registered type.
pub struct Entry {
    /// Kind of the type.
    pub kind: Kind,
    /// Name of the type in TOML.
    pub name: Arc<str>,
    /// JSON Schema of its parameters, made when it is first read: most runs need few of them.
    pub schema: Lazy<Schema>,
    /// Keys by which a type of sensor extends the table `simulation`.
    pub(crate) simulation_keys: Lazy<Vec<String>>,
    pub(crate) make: Make,
    /// Plugin that registered the type, if a plugin did.
    pub(super) owner: Option<TypeId>,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.kind.table(), self.name)
    }
}
