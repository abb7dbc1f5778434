//! The types that a scenario can name, and their registry.

use crate::compose::Composer;
use crate::compose::estimator::{Creator, EstimatorType};
use crate::document::{DocumentError, Node, unknown};
use crate::files::FolderError;
use crate::model::error::ComposeError;
use crate::model::process::BuiltProcess;
use crate::model::sensor::Role;
use crate::model::sensor::limits::Limit;
use crate::model::sensor::rule::{RuleType, UpdateRule};
use crate::model::stream::{Feed, Sink, Source, StreamError};
use crate::units::sample::Channel;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::any::TypeId;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use crate::plugin::owned::Owned;
use crate::plugin::plugin::Members;
use crate::plugin::simulation_keys;
pub use crate::plugin::{OpenContext, Plugin, PluginError};

/// A type of sensor. Its fields are the parameters in TOML, with their documentation, units and
/// defaults.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Height above the ellipsoid.
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
    /// Set if the sensor drives a process model. Such sensors are composed before the processes.
    const INPUT: bool = false;
    /// Channels of its samples.
    fn channels(&self) -> Vec<Channel>;
    /// Plausible values of its channels. A sample beyond them is rejected; the key `limits`
    /// replaces them. Default: none.
    fn limits(&self) -> Vec<Limit> {
        Vec::new()
    }
    /// Adds its states and returns its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or a block that the sensor needs is missing.
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError>;
}

/// A type of process model.
///
/// A type that propagates nothing itself, but adds a state with the dynamics of the framework:
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
///         // other types find the state as tide.height
///         self.height.block::<Scalar>(composer, "height", &[0.0], display::LENGTH)?;
///         Ok(BuiltProcess::new(OwnDynamics))
///     }
/// }
/// let mut registry = Registry::new();
/// registry.process::<Tide>(); // [process.tide]
/// ```
pub trait ProcessType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Adds its states, declares its part of the transition and returns its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or its driving sensor is missing.
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError>;
}

/// A type of source.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// A source without samples, for a scenario that is only composed.
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
    /// Set if the samples are simulated, so that another seed gives another run.
    const SIMULATES: bool = false;
    /// Opens the source: one or several streams, which the runner merges.
    ///
    /// # Errors
    /// When a file is missing or malformed.
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
///     fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
///         if let Record::Event(event) = record {
///             println!("{} {}: {}", event.time, event.about, event.text);
///         }
///         Ok(())
///     }
/// }
/// let mut registry = Registry::new();
/// registry.sink::<Terminal>();
/// ```
pub trait SinkType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Set if the sink records every run, with its default parameters if the scenario does not
    /// mention it.
    const DEFAULT: bool = true;
    /// The files that it writes; relative paths start at the output folder of the run. Before any
    /// sink is opened, the framework rejects a scenario in which two sinks write the same file.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }
    /// Opens it.
    ///
    /// # Errors
    /// When the file cannot be created, or nobody answers at the address.
    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError>;
}

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

/// The reason why a part of a scenario cannot be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The scenario does not fit, or a source or sink cannot be opened.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The plugins do not fit together.
    #[error(transparent)]
    Plugin(#[from] PluginError),
    /// The folder of the results cannot be written into.
    #[error(transparent)]
    Folder(#[from] FolderError),
}

type ForComposer<T> =
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
    pub role: Role,
}

pub(crate) enum Make {
    Process(ForComposer<BuiltProcess>),
    Sensor { make: ForComposer<BuiltSensor>, input: bool },
    Source { prepare: Prepare<Open<Vec<Box<dyn Source>>>>, simulates: bool },
    Link { prepare: Prepare<Open<Box<dyn Feed>>> },
    Sink { prepare: Prepare<PreparedSink>, default: bool },
}

/// A value that is made when it is first read.
type Lazy<T> = LazyLock<T, Box<dyn FnOnce() -> T + Send>>;

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
    owner: Option<TypeId>,
}

impl std::fmt::Debug for Entry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.kind.table(), self.name)
    }
}

/// Every type that a scenario can name, with the plugins that registered them.
///
/// A plugin can be replaced, disabled, or added again with other settings.
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
    /// Two types of the same kind and name are an error, which [`Registry::check`] reports.
    entries: BTreeMap<(Kind, Arc<str>), Vec<Entry>>,
    /// Types of estimators, and of update rules.
    estimators: Owned<Creator>,
    rules: Owned<UpdateRule>,
    members: Members,
}

impl Registry {
    /// An empty registry.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a plugin, with the plugins that it adds itself.
    pub fn add(&mut self, plugin: &dyn Plugin) -> &mut Self {
        self.members.begin(plugin);
        plugin.build(self);
        self.members.end();
        self
    }

    /// Removes plugin `P` and the types that it registered.
    pub fn disable<P: Plugin>(&mut self) -> &mut Self {
        self.remove(TypeId::of::<P>(), std::any::type_name::<P>());
        self
    }

    /// Removes plugin `P` and adds another in its place, in the same group if there is one.
    pub fn replace<P: Plugin>(&mut self, by: &dyn Plugin) -> &mut Self {
        self.members.begin_beside(TypeId::of::<P>());
        self.disable::<P>().add(by);
        self.members.end();
        self
    }

    /// Adds a plugin again, with other settings.
    pub fn set<P: Plugin>(&mut self, plugin: &P) -> &mut Self {
        self.replace::<P>(plugin)
    }

    fn remove(&mut self, plugin: TypeId, name: &'static str) {
        for gone in self.members.remove(plugin, name) {
            self.entries
                .values_mut()
                .for_each(|same| same.retain(|entry| entry.owner != Some(gone)));
            self.estimators.remove(gone);
            self.rules.remove(gone);
        }
    }

    /// Checks that the plugins fit together, as composing a scenario does.
    ///
    /// # Errors
    /// When a plugin was added twice, two plugins register the same type, a plugin needs another
    /// one that is missing or has another version, or a plugin to be replaced or disabled is
    /// missing.
    pub fn check(&self) -> Result<(), PluginError> {
        let clashes = self.entries.values().filter_map(|same| match &same[..] {
            [first, second, ..] => {
                Some((first.kind.table(), Arc::clone(&first.name), [first.owner, second.owner]))
            }
            _ => None,
        });
        let estimators = self.estimators.clashes("estimator", |creator| creator.name);
        let rules = self.rules.clashes("update rule", |rule| rule.name);
        self.members.check(clashes.chain(estimators).chain(rules))
    }

    /// Registers a type of sensor.
    pub fn sensor<S: SensorType>(&mut self) {
        let make: ForComposer<BuiltSensor> = Box::new(|node, composer| {
            let config: S = node.parse()?;
            let (channels, limits) = (config.channels(), config.limits());
            let role = config.build(composer).map_err(|e| e.at(node))?;
            Ok(BuiltSensor { channels, limits, role })
        });
        self.insert::<S>(Kind::Sensor, S::TYPE, Make::Sensor { make, input: S::INPUT });
    }

    /// Registers a type of sensor whose name, keys and channels are known at run time only, as those
    /// of a sensor that a script defines: see [`DynamicModel`] for an example. The schema lists the
    /// keys of its table; `build` receives them, and returns the channels and the role.
    ///
    /// [`DynamicModel`]: crate::model::sensor::dynamic::DynamicModel
    pub fn sensor_dyn<F>(&mut self, name: impl Into<Arc<str>>, schema: Schema, build: F)
    where
        F: Fn(&Value, &mut Composer) -> Result<(Vec<Channel>, Role), ComposeError>
            + Send
            + Sync
            + 'static,
    {
        let keys = schema.get("properties").and_then(Value::as_object);
        let keys: Vec<String> = keys.into_iter().flat_map(|keys| keys.keys().cloned()).collect();
        let make: ForComposer<BuiltSensor> = Box::new(move |node, composer| {
            let table: Value = node.parse()?;
            let given = table.as_object().into_iter().flat_map(|table| table.keys());
            if let Some(key) = given.into_iter().find(|key| !keys.contains(key)) {
                let known: Vec<&str> = keys.iter().map(String::as_str).collect();
                return Err(ComposeError::new(key, unknown("key", key, &known)).at(node).into());
            }
            let (channels, role) = build(&table, composer).map_err(|e| e.at(node))?;
            Ok(BuiltSensor { channels, limits: Vec::new(), role })
        });
        let make = Make::Sensor { make, input: false };
        self.insert_with(Kind::Sensor, name.into(), make, move || schema.clone());
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
        let prepare: Prepare<Open<Vec<Box<dyn Source>>>> = Box::new(|node| {
            let config = node.parse::<S>()?;
            Ok(Box::new(|context| config.open(context)))
        });
        self.insert::<S>(Kind::Source, S::TYPE, Make::Source { prepare, simulates: S::SIMULATES });
    }

    /// Registers a type of sink.
    pub fn sink<S: SinkType>(&mut self) {
        let prepare: Prepare<PreparedSink> = Box::new(|node| {
            let config = node.parse::<S>()?;
            let files = config.files();
            Ok(PreparedSink { files, open: Box::new(|context| config.open(context)) })
        });
        self.insert::<S>(Kind::Sink, S::TYPE, Make::Sink { prepare, default: S::DEFAULT });
    }

    /// Registers a type of estimator, beside `ekf` and `ukf` of the framework.
    pub fn estimator<E: EstimatorType>(&mut self) {
        self.estimators.push(Creator::of::<E>(), self.members.current());
    }

    /// Registers an update rule, beside `ekf`, `iekf` and `ukf` of the framework.
    pub fn rule<R: RuleType>(&mut self) {
        self.rules.push(UpdateRule::of::<R>(), self.members.current());
    }

    /// Registered update rules.
    pub(crate) fn rules(&self) -> impl Iterator<Item = UpdateRule> + '_ {
        self.rules.iter()
    }

    /// Registered types of estimators.
    pub(crate) fn estimators(&self) -> impl Iterator<Item = Creator> + '_ {
        self.estimators.iter()
    }

    pub(super) fn insert<T: JsonSchema>(&mut self, kind: Kind, name: &'static str, make: Make) {
        let schema = || SchemaGenerator::default().into_root_schema_for::<T>();
        self.insert_with(kind, name.into(), make, schema);
    }

    fn insert_with(
        &mut self,
        kind: Kind,
        name: Arc<str>,
        make: Make,
        schema: impl Fn() -> Schema + Clone + Send + 'static,
    ) {
        let again = schema.clone();
        let simulation_keys = move || simulation_keys::own(again().as_value());
        let owner = self.members.current();
        self.entries.entry((kind, Arc::clone(&name))).or_default().push(Entry {
            kind,
            name,
            schema: Lazy::new(Box::new(schema)),
            simulation_keys: Lazy::new(Box::new(simulation_keys)),
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
        self.entries().find(|e| e.kind == kind && *e.name == *name)
    }
}
