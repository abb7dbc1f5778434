//! The registry of the types that a scenario can name.

use crate::compose::Composer;
use crate::compose::estimator::{Creator, EstimatorType};
use crate::document::{Node, unknown};
use crate::model::error::ComposeError;
use crate::model::process::BuiltProcess;
use crate::model::sensor::Role;
use crate::model::sensor::rule::{RuleType, UpdateRule};
use crate::model::stream::Source;
use crate::plugin::entry::{
    BuiltSensor, Entry, ForComposer, Kind, Lazy, Make, Open, Prepare, PreparedSink,
};
use crate::plugin::owned::Owned;
use crate::plugin::plugin::Members;
use crate::plugin::simulation_keys;
use crate::plugin::{
    BuildError, Plugin, PluginError, ProcessType, SensorType, SinkType, SourceType,
};
use crate::units::sample::Channel;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::any::{Any, TypeId};
use std::collections::BTreeMap;
use std::sync::Arc;

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
    pub fn sensor<S: SensorType>(&mut self) -> &mut Self {
        let make: ForComposer<BuiltSensor> = Box::new(|node, composer| {
            let config: S = node.parse()?;
            let (channels, limits, unset) = (config.channels(), config.limits(), config.unset());
            let role = config.build(composer).map_err(|e| e.at(node))?;
            Ok(BuiltSensor { channels, limits, unset, role })
        });
        self.insert::<S>(Kind::Sensor, S::TYPE, Make::Sensor { make, input: S::INPUT });
        self
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
        let keys = Keys::of(&schema);
        let make: ForComposer<BuiltSensor> = Box::new(move |node, composer| {
            let (channels, role) = build(&keys.table(node)?, composer).map_err(|e| e.at(node))?;
            Ok(BuiltSensor { channels, limits: Vec::new(), unset: &[], role })
        });
        let make = Make::Sensor { make, input: false };
        self.insert_with(Kind::Sensor, name.into(), make, (|| true, move || schema.clone()));
    }

    /// Registers a type of sensor that drives processes, whose name and channels are known at run
    /// time only. Its table has the common keys alone; [`Composer::input`] finds a `C` under the name
    /// of the sensor.
    pub fn input_dyn<C>(&mut self, name: impl Into<Arc<str>>, channels: Vec<Channel>, input: C)
    where
        C: Any + Clone + Send + Sync,
    {
        let schema = schemars::json_schema!({ "type": "object", "properties": {} });
        let keys = Keys::of(&schema);
        let make: ForComposer<BuiltSensor> = Box::new(move |node, _| {
            keys.table(node)?;
            let role = Role::Input(Box::new(input.clone()));
            Ok(BuiltSensor { channels: channels.clone(), limits: Vec::new(), unset: &[], role })
        });
        let make = Make::Sensor { make, input: true };
        self.insert_with(Kind::Sensor, name.into(), make, (|| true, move || schema.clone()));
    }

    /// Registers a type of process model whose name and keys are known at run time only, as
    /// [`Self::sensor_dyn`] does for sensors. [`Transition::dense`] declares its places.
    ///
    /// [`Transition::dense`]: crate::state::covariance::Transition::dense
    pub fn process_dyn<F>(&mut self, name: impl Into<Arc<str>>, schema: Schema, build: F)
    where
        F: Fn(&Value, &mut Composer) -> Result<BuiltProcess, ComposeError> + Send + Sync + 'static,
    {
        let keys = Keys::of(&schema);
        let make: ForComposer<BuiltProcess> = Box::new(move |node, composer| {
            Ok(build(&keys.table(node)?, composer).map_err(|e| e.at(node))?)
        });
        let make = Make::Process { make, beside: false };
        self.insert_with(Kind::Process, name.into(), make, (|| true, move || schema.clone()));
    }

    /// Registers a type of process model.
    pub fn process<P: ProcessType>(&mut self) -> &mut Self {
        let make: ForComposer<BuiltProcess> = Box::new(|node, composer| {
            Ok(node.parse::<P>()?.build(composer).map_err(|e| e.at(node))?)
        });
        self.insert::<P>(Kind::Process, P::TYPE, Make::Process { make, beside: P::BESIDE });
        self
    }

    /// Registers a type of source.
    pub fn source<S: SourceType>(&mut self) -> &mut Self {
        let prepare: Prepare<Open<Vec<Box<dyn Source>>>> = Box::new(|node| {
            let config = node.parse::<S>()?;
            Ok(Box::new(|context| config.open(context)))
        });
        self.insert::<S>(Kind::Source, S::TYPE, Make::Source { prepare, simulates: S::SIMULATES });
        self
    }

    /// Registers a type of sink.
    pub fn sink<S: SinkType>(&mut self) -> &mut Self {
        let prepare: Prepare<PreparedSink> = Box::new(|node| {
            let config = node.parse::<S>()?;
            let files = config.files();
            Ok(PreparedSink { files, open: Box::new(|context| config.open(context)) })
        });
        self.insert::<S>(Kind::Sink, S::TYPE, Make::Sink { prepare, default: S::DEFAULT });
        self
    }

    /// Registers a type of estimator, beside `ekf` and `ukf` of the framework.
    pub fn estimator<E: EstimatorType>(&mut self) -> &mut Self {
        self.estimators.push(Creator::of::<E>(), self.members.current());
        self
    }

    /// Registers an update rule, beside `ekf`, `iekf` and `ukf` of the framework.
    pub fn rule<R: RuleType>(&mut self) -> &mut Self {
        self.rules.push(UpdateRule::of::<R>(), self.members.current());
        self
    }

    /// Registered update rules.
    pub(crate) fn rules(&self) -> impl Iterator<Item = UpdateRule> + '_ {
        self.rules.iter()
    }

    /// Registered types of estimators.
    pub(crate) fn estimators(&self) -> impl Iterator<Item = Creator> + '_ {
        self.estimators.iter()
    }

    pub(super) fn insert<T: DeserializeOwned + JsonSchema + 'static>(
        &mut self,
        kind: Kind,
        name: &'static str,
        make: Make,
    ) {
        let schema = || SchemaGenerator::default().into_root_schema_for::<T>();
        self.insert_with(kind, name.into(), make, (simulation_keys::may_extend::<T>, schema));
    }

    /// `extends` answers whether the type may have keys in the table `simulation`: only then its schema has to
    /// be made for a run.
    fn insert_with(
        &mut self,
        kind: Kind,
        name: Arc<str>,
        make: Make,
        (extends, schema): (
            impl FnOnce() -> bool + Send + 'static,
            impl Fn() -> Schema + Clone + Send + 'static,
        ),
    ) {
        let again = schema.clone();
        let simulation_keys =
            move || if extends() { simulation_keys::own(again().as_value()) } else { Vec::new() };
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

/// The keys of a table that a schema lists.
struct Keys(Vec<String>);

impl Keys {
    fn of(schema: &Schema) -> Self {
        let keys = schema.get("properties").and_then(Value::as_object);
        Self(keys.into_iter().flat_map(|keys| keys.keys().cloned()).collect())
    }

    /// The table, unless it has another key.
    fn table(&self, node: &Node<'_>) -> Result<Value, BuildError> {
        let table: Value = node.parse()?;
        let given = table.as_object().into_iter().flat_map(|table| table.keys());
        if let Some(key) = given.into_iter().find(|key| !self.0.contains(key)) {
            let known: Vec<&str> = self.0.iter().map(String::as_str).collect();
            return Err(ComposeError::new(key, unknown("key", key, &known)).at(node).into());
        }
        Ok(table)
    }
}
