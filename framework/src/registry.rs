//! Plugins, and the types they register.

use crate::compose::{BuiltProcess, ComposeError, Composer, Composition, Role};
use crate::document::{DocumentError, Node};
use crate::sample::Channel;
use crate::stream::{Sink, Source, StreamError};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Adds types to the registry.
pub trait Plugin {
    /// Registers what the plugin brings.
    fn build(&self, registry: &mut Registry);
}

/// A type of sensor. Its fields are the parameters in TOML: their documentation, units and defaults are the type's.
pub trait SensorType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Whether it drives a process model; such sensors are composed before the processes.
    const INPUT: bool = false;
    /// The channels of its samples.
    fn channels(&self) -> Vec<Channel>;
    /// Adds its states and gives its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or a block that it needs is not there.
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError>;
}

/// A type of process model.
pub trait ProcessType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Adds its states, declares its part of the transition and gives its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or its driving sensor is not there.
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError>;
}

/// What a source or sink may know when it is opened.
#[derive(Debug)]
pub struct OpenContext<'a> {
    /// The composition that it feeds or records.
    pub composition: &'a Composition,
    /// Where relative paths of inputs start: the folder of the scenario.
    pub base: PathBuf,
    /// Where outputs go.
    pub output: PathBuf,
}

/// A type of source.
pub trait SourceType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Whether its samples are simulated, so that another seed gives another run.
    const SIMULATES: bool = false;
    /// Opens it: one stream or several, which the runner merges.
    ///
    /// # Errors
    /// When a file is missing or is not what it should be.
    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError>;
}

/// A type of sink.
pub trait SinkType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Whether it records every run, with its default parameters where the scenario does not mention it.
    const DEFAULT: bool = true;
    /// Opens it.
    ///
    /// # Errors
    /// When the file or address cannot be written to.
    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError>;
}

/// What a registered type is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// `[process.NAME]`
    Process,
    /// `[sensor.NAME]`
    Sensor,
    /// `[source.NAME]`
    Source,
    /// `[sink.NAME]`
    Sink,
}

impl Kind {
    /// All kinds, in the order of a scenario.
    pub const ALL: [Self; 4] = [Self::Process, Self::Sensor, Self::Source, Self::Sink];

    /// The table in TOML.
    pub const fn table(self) -> &'static str {
        match self {
            Self::Process => "process",
            Self::Sensor => "sensor",
            Self::Source => "source",
            Self::Sink => "sink",
        }
    }
}

/// Why a composed part could not be built: a place in the document, or a stream.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The scenario.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// A source or sink.
    #[error(transparent)]
    Stream(#[from] StreamError),
}

type ForComposer<T> = Box<dyn for<'a, 'b> Fn(&Node<'a>, &'b mut Composer) -> Result<T, BuildError> + Send + Sync>;
type ForContext<T> = Box<dyn for<'a, 'b> Fn(&Node<'a>, &OpenContext<'b>) -> Result<T, BuildError> + Send + Sync>;

pub(crate) struct BuiltSensor {
    pub channels: Vec<Channel>,
    pub role: Role,
}

pub(crate) enum Make {
    Process(ForComposer<BuiltProcess>),
    Sensor { make: ForComposer<BuiltSensor>, input: bool },
    Source { make: ForContext<Vec<Box<dyn Source>>>, simulates: bool },
    Sink { make: ForContext<Box<dyn Sink>>, default: bool },
}

/// A registered type.
pub struct Entry {
    /// What it is.
    pub kind: Kind,
    /// Its name in TOML.
    pub name: &'static str,
    /// The JSON Schema of its parameters.
    pub schema: Schema,
    pub(crate) make: Make,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.kind.table(), self.name)
    }
}

/// Every type that a scenario can name.
#[derive(Debug, Default)]
pub struct Registry {
    entries: BTreeMap<(Kind, &'static str), Entry>,
    twice: Vec<(Kind, &'static str)>,
}

impl Registry {
    /// An empty registry.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a plugin.
    pub fn add(&mut self, plugin: &dyn Plugin) -> &mut Self {
        plugin.build(self);
        self
    }

    /// Registers a type of sensor.
    pub fn sensor<S: SensorType>(&mut self) {
        let make: ForComposer<BuiltSensor> = Box::new(|node, composer| {
            let config: S = node.parse()?;
            let channels = config.channels();
            let role = config.build(composer).map_err(|e| e.at(node))?;
            Ok(BuiltSensor { channels, role })
        });
        self.insert::<S>(Kind::Sensor, S::TYPE, Make::Sensor { make, input: S::INPUT });
    }

    /// Registers a type of process model.
    pub fn process<P: ProcessType>(&mut self) {
        let make: ForComposer<BuiltProcess> =
            Box::new(|node, composer| Ok(node.parse::<P>()?.build(composer).map_err(|e| e.at(node))?));
        self.insert::<P>(Kind::Process, P::TYPE, Make::Process(make));
    }

    /// Registers a type of source.
    pub fn source<S: SourceType>(&mut self) {
        let make: ForContext<Vec<Box<dyn Source>>> = Box::new(|node, context| Ok(node.parse::<S>()?.open(context)?));
        self.insert::<S>(Kind::Source, S::TYPE, Make::Source { make, simulates: S::SIMULATES });
    }

    /// Registers a type of sink.
    pub fn sink<S: SinkType>(&mut self) {
        let make: ForContext<Box<dyn Sink>> = Box::new(|node, context| Ok(node.parse::<S>()?.open(context)?));
        self.insert::<S>(Kind::Sink, S::TYPE, Make::Sink { make, default: S::DEFAULT });
    }

    fn insert<T: JsonSchema>(&mut self, kind: Kind, name: &'static str, make: Make) {
        let schema = SchemaGenerator::default().into_root_schema_for::<T>();
        if self.entries.insert((kind, name), Entry { kind, name, schema, make }).is_some() {
            self.twice.push((kind, name));
        }
    }

    /// The registered types, by kind and name.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.values()
    }

    /// The type of that kind and name.
    pub fn get(&self, kind: Kind, name: &str) -> Option<&Entry> {
        self.entries.values().find(|e| e.kind == kind && e.name == name)
    }

    /// Names that two plugins registered: one of them would silently win.
    pub fn registered_twice(&self) -> &[(Kind, &'static str)] {
        &self.twice
    }
}
