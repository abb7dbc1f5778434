//! The types that a scenario can name, and what registers them.

use crate::compose::{Composer, Composition};
use crate::document::{DocumentError, Node};
use crate::model::error::ComposeError;
use crate::model::process::BuiltProcess;
use crate::model::sensor::Role;
use crate::model::stream::{Sink, Source, StreamError};
use crate::units::sample::Channel;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use std::any::TypeId;
use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::plugin::plugin::Members;
pub use crate::plugin::{Plugin, PluginError};

/// A type of sensor. Its fields are the parameters in TOML: their documentation, units and defaults are the type's.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Height above the ellipsoid, by some means.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Altitude {
///     /// 1-sigma noise.
///     noise: Sigma<Length>,
/// }
///
/// struct Model(Altitude, Handle<Position>);
///
/// impl SensorType for Altitude {
///     const TYPE: &'static str = "altitude";
///     fn channels(&self) -> Vec<Channel> {
///         vec![Channel::new("height", "m")]
///     }
///     fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
///         let position = composer.find("position", "ins.position")?;
///         Ok(Role::measurement(Model(self, position)))
///     }
/// }
///
/// impl MeasurementModel<1> for Model {
///     fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
///         SVector::from([x.get(self.1).height])
///     }
///     fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
///         SMatrix::from_element(self.0.noise.value().si().powi(2))
///     }
/// }
///
/// let mut registry = Registry::new();
/// registry.sensor::<Altitude>(); // [sensor.altitude]
/// ```
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
///
/// One that moves nothing itself, and brings a state that wanders by the framework's own dynamics:
/// ```
/// use navfuse_core::prelude::*;
/// /// Height of the sea surface.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Tide {
///     /// Height above the ellipsoid, with `sigma` and `correlation_time`.
///     height: LengthBias,
/// }
///
/// impl ProcessType for Tide {
///     const TYPE: &'static str = "tide";
///     fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
///         self.height.block::<Scalar>(composer, "height", &[0.0], display::LENGTH)?; // others find it as tide.height
///         Ok(BuiltProcess::new(OwnDynamics))
///     }
/// }
/// let mut registry = Registry::new();
/// registry.process::<Tide>(); // [process.tide]
/// ```
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
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Nothing: a scenario that only composes.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// struct Silence {}
/// struct Silent;
/// impl SourceType for Silence {
///     const TYPE: &'static str = "silence";
///     fn open(self, _: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
///         Ok(vec![Box::new(Silent)])
///     }
/// }
/// impl Source for Silent {
///     fn next(&mut self, _: &mut Sample) -> Result<bool, StreamError> {
///         Ok(false)
///     }
/// }
/// let mut registry = Registry::new();
/// registry.source::<Silence>(); // [source.silence]
/// ```
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
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Prints every event to the terminal.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// struct Terminal {}
/// struct Printing;
/// impl SinkType for Terminal {
///     const TYPE: &'static str = "terminal";
///     const DEFAULT: bool = false; // only where the scenario has [sink.terminal]
///     fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
///         Ok(Box::new(Printing))
///     }
/// }
/// impl Sink for Printing {
///     fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
///         Ok(())
///     }
///     fn event(&mut self, event: &navfuse_core::model::record::Event) -> Result<(), StreamError> {
///         println!("{} {}: {}", event.time, event.about, event.text);
///         Ok(())
///     }
///     fn finish(&mut self) -> Result<Option<String>, StreamError> {
///         Ok(None)
///     }
/// }
/// let mut registry = Registry::new();
/// registry.sink::<Terminal>();
/// ```
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
    /// The scenario, also where a source or sink cannot be opened.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The plugins.
    #[error(transparent)]
    Plugin(#[from] PluginError),
}

type ForComposer<T> =
    Box<dyn for<'a, 'b> Fn(&Node<'a>, &'b mut Composer) -> Result<T, BuildError> + Send + Sync>;
type ForContext<T> =
    Box<dyn for<'a, 'b> Fn(&Node<'a>, &OpenContext<'b>) -> Result<T, BuildError> + Send + Sync>;

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
    /// The plugin that registered it, if a plugin did.
    owner: Option<TypeId>,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.kind.table(), self.name)
    }
}

/// Every type that a scenario can name, with the plugins that registered them.
///
/// Plugins are members: one can be replaced, disabled, or added anew with other settings.
/// ```
/// # use navfuse_core::plugin::{Plugin, Registry};
/// # struct Sonar;
/// # impl Plugin for Sonar { fn build(&self, _: &mut Registry) {} }
/// # struct Compass;
/// # impl Plugin for Compass { fn build(&self, _: &mut Registry) {} }
/// # struct MyCompass { declination: f64 }
/// # impl Plugin for MyCompass { fn build(&self, _: &mut Registry) {} }
/// let mut registry = Registry::new();
/// registry.add(&Sonar).add(&Compass);
/// registry.replace::<Compass>(&MyCompass { declination: 0.0 }); // another plugin in its place
/// registry.set(&MyCompass { declination: 0.1 });                // the same with other settings
/// registry.disable::<Sonar>();
/// assert!(registry.check().is_ok());
/// ```
#[derive(Debug, Default)]
pub struct Registry {
    /// More than one of a kind and name is an error, which [`Registry::check`] tells.
    entries: BTreeMap<(Kind, &'static str), Vec<Entry>>,
    members: Members,
}

impl Registry {
    /// An empty registry.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a plugin, and those that it adds itself.
    pub fn add(&mut self, plugin: &dyn Plugin) -> &mut Self {
        self.members.begin(plugin);
        plugin.build(self);
        self.members.end();
        self
    }

    /// Removes plugin `P`, and what it registered.
    pub fn disable<P: Plugin>(&mut self) -> &mut Self {
        self.remove(TypeId::of::<P>(), std::any::type_name::<P>());
        self
    }

    /// Removes plugin `P`, and adds another in its place: in its group, if it is in one.
    pub fn replace<P: Plugin>(&mut self, by: &dyn Plugin) -> &mut Self {
        self.members.begin_beside(TypeId::of::<P>());
        self.disable::<P>().add(by);
        self.members.end();
        self
    }

    /// Adds a plugin anew, with other settings than those with which it is there.
    pub fn set<P: Plugin>(&mut self, plugin: &P) -> &mut Self {
        self.replace::<P>(plugin)
    }

    fn remove(&mut self, plugin: TypeId, name: &'static str) {
        for gone in self.members.remove(plugin, name) {
            self.entries
                .values_mut()
                .for_each(|same| same.retain(|entry| entry.owner != Some(gone)));
        }
    }

    /// Whether the plugins fit together. [`crate::run::scenario::Scenario::compose`] asks it too.
    ///
    /// # Errors
    /// When one is added twice, two register the same type, one needs another that is not there or is there in another
    /// version, or one was to be replaced or disabled that is not there.
    pub fn check(&self) -> Result<(), PluginError> {
        let clashes = self.entries.values().filter_map(|same| match &same[..] {
            [first, second, ..] => Some((first, [first.owner, second.owner])),
            _ => None,
        });
        self.members.check(clashes)
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
        let make: ForComposer<BuiltProcess> = Box::new(|node, composer| {
            Ok(node.parse::<P>()?.build(composer).map_err(|e| e.at(node))?)
        });
        self.insert::<P>(Kind::Process, P::TYPE, Make::Process(make));
    }

    /// Registers a type of source.
    pub fn source<S: SourceType>(&mut self) {
        let make: ForContext<Vec<Box<dyn Source>>> = Box::new(|node, context| {
            Ok(node.parse::<S>()?.open(context).map_err(|e| node.error(e))?)
        });
        self.insert::<S>(Kind::Source, S::TYPE, Make::Source { make, simulates: S::SIMULATES });
    }

    /// Registers a type of sink.
    pub fn sink<S: SinkType>(&mut self) {
        let make: ForContext<Box<dyn Sink>> = Box::new(|node, context| {
            Ok(node.parse::<S>()?.open(context).map_err(|e| node.error(e))?)
        });
        self.insert::<S>(Kind::Sink, S::TYPE, Make::Sink { make, default: S::DEFAULT });
    }

    fn insert<T: JsonSchema>(&mut self, kind: Kind, name: &'static str, make: Make) {
        let schema = SchemaGenerator::default().into_root_schema_for::<T>();
        let owner = self.members.current();
        self.entries.entry((kind, name)).or_default().push(Entry {
            kind,
            name,
            schema,
            make,
            owner,
        });
    }

    /// The registered types, by kind and name.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.values().flatten()
    }

    /// The type of that kind and name.
    pub fn get(&self, kind: Kind, name: &str) -> Option<&Entry> {
        self.entries().find(|e| e.kind == kind && e.name == name)
    }
}
