//! From a TOML document to a composition, its sources and its sinks.

use crate::compose;
use crate::compose::draw;
use crate::compose::draw::Draw;
use crate::compose::keys::SensorKeys;
use crate::compose::settings::EstimatorConfig;
use crate::compose::settings::Initial;
use crate::compose::time_offset;
use crate::compose::{Composer, Composition, Process};
use crate::document::{Document, DocumentError, Node, did_you_mean};
use crate::model::sensor::{Purpose, SensorInfo};
use crate::model::sensor::{Role, Sensor};
use crate::model::stream::{Sink, Source};
use crate::plugin::{BuildError, Entry, Kind, Make, OpenContext, Registry};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A scenario ready to run.
pub struct Assembly {
    /// The filter's parts.
    pub composition: Composition,
    /// Where samples come from, each with its name.
    pub sources: Vec<(String, Box<dyn Source>)>,
    /// Where results go, each with its name.
    pub sinks: Vec<(String, Box<dyn Sink>)>,
}

/// Keys at the top of a scenario.
pub const TOP_KEYS: [&str; 8] =
    ["name", "description", "seed", "estimator", "process", "sensor", "source", "sink"];

/// Keys that the framework takes from the tables of a kind, beside the type's own.
pub fn common_keys(kind: Kind) -> &'static [&'static str] {
    match kind {
        Kind::Sensor => {
            &["type", "enabled", "gate", "recovery", "timeout", "time_offset", "simulation"]
        }
        _ => &["type", "enabled"],
    }
}

/// One table of a kind: name, type and place.
struct Part<'a> {
    name: &'a str,
    entry: &'a Entry,
    node: Node<'a>,
}

/// Reads and composes scenarios.
pub struct Scenario<'a> {
    registry: &'a Registry,
    document: Document,
}

impl<'a> Scenario<'a> {
    /// Reads the scenario at a path and sets the given `key.path=value` overrides.
    ///
    /// # Errors
    /// When the file cannot be read or is not TOML.
    pub fn load(
        registry: &'a Registry,
        path: &Path,
        overrides: &[String],
    ) -> Result<Self, DocumentError> {
        Self::new(registry, Document::from_file(path)?, overrides)
    }

    /// The scenario in a document.
    ///
    /// # Errors
    /// When an override is not `key.path=value`.
    pub fn new(
        registry: &'a Registry,
        mut document: Document,
        overrides: &[String],
    ) -> Result<Self, DocumentError> {
        for o in overrides {
            document.set(o)?;
        }
        Ok(Self { registry, document })
    }

    /// The tables of a kind, in the order of the file.
    fn parts<'s>(&'s self, kind: Kind) -> Result<Vec<Part<'s>>, DocumentError> {
        let Some(table) = self.document.root().get(kind.table()) else { return Ok(Vec::new()) };
        let mut parts = Vec::new();
        for (name, node) in table.entries()? {
            if !node.value().is_table() {
                return Err(node.error(format!("a table is needed: [{}.{name}]", kind.table())));
            }
            if let Some(enabled) = node.get("enabled")
                && !enabled.parse::<bool>()?
            {
                continue;
            }
            let (place, wanted) = match node.get("type") {
                Some(t) => (t.clone(), t.parse::<String>()?),
                None => (node.clone(), name.to_owned()),
            };
            let entry = self.registry.get(kind, &wanted).ok_or_else(|| {
                let names: Vec<&str> =
                    self.registry.entries().filter(|e| e.kind == kind).map(|e| e.name).collect();
                let hint = did_you_mean(&wanted, names.iter().copied());
                let hint = hint.map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
                let (table, names) = (kind.table(), names.join(", "));
                place.error(format!(
                    "unknown {table} type {wanted:?}{hint} (registered: {names}; or set `type`)"
                ))
            })?;
            parts.push(Part { name, entry, node });
        }
        Ok(parts)
    }

    /// Composes the filter: blocks, models, sensors.
    ///
    /// # Errors
    /// When anything in the scenario does not fit; the message names file, line, key, what was
    /// found and what to do.
    pub fn compose(&self) -> Result<Composition, BuildError> {
        let root = self.document.root();
        root.check_keys(&TOP_KEYS)?;
        self.registry.check()?;
        let mut estimator: EstimatorConfig =
            root.get("estimator").map_or_else(|| Ok(EstimatorConfig::default()), |n| n.parse())?;
        if let Some(key) = estimator.beyond_the_clock() {
            let place =
                root.get("estimator").and_then(|n| n.get(key)).unwrap_or_else(|| root.clone());
            return Err(place.error("beyond 73 years, which no clock here can show").into());
        }
        if let Some(name) = root.get("name") {
            name.parse::<String>()?;
        }
        let name = self.name();
        let seed = root.get("seed").map_or(Ok(1), |n| n.parse())?;
        if let Some(description) = root.get("description") {
            description.parse::<String>()?;
        }
        let mut composer = Composer::default();
        let parts = self.parts(Kind::Sensor)?;
        let mut sensors: Vec<Option<Sensor>> = parts.iter().map(|_| None).collect();
        self.build_sensors(&parts, true, &mut composer, &mut sensors)?;
        let mut processes = Vec::new();
        for part in self.parts(Kind::Process)? {
            let Make::Process(make) = &part.entry.make else { continue };
            composer.begin(part.name);
            let built = make(&part.node.without(common_keys(Kind::Process)), &mut composer)?;
            let input = match built.input {
                None => None,
                Some(driving) => {
                    let index = parts.iter().position(|p| p.name == driving.name);
                    if let Some(sensor) = index.and_then(|k| sensors[k].as_mut()) {
                        sensor.simulator = Some(driving.simulator);
                    }
                    index
                }
            };
            let (name, kind) = (part.name.to_owned(), part.entry.name.to_owned());
            let searches = built.alignment.is_some();
            processes.push(Process {
                name,
                kind,
                model: built.model,
                input,
                constraint: None,
                alignment: built.alignment,
                searches,
            });
        }
        if processes.iter().filter(|p| p.input.is_some()).count() > 1 {
            let message = "two process models are driven by sensors; at most one can be";
            return Err(root.get("process").unwrap_or(root).error(message).into());
        }
        self.build_sensors(&parts, false, &mut composer, &mut sensors)?;
        let mut sensors: Vec<Sensor> = sensors.into_iter().flatten().collect();
        let place = |name: &str| {
            root.get("process").and_then(|p| p.get(name)).unwrap_or_else(|| root.clone())
        };
        for process in &mut processes {
            if let Some(alignment) = &mut process.alignment {
                alignment.connect(&sensors).map_err(|e| e.at(&place(&process.name)))?;
            }
        }
        for (owner, (info, role)) in composer.take_constraints() {
            if sensors.iter().any(|s| s.info.name == info.name) {
                let message = format!(
                    "[sensor.{}] has the name of what this process knows; rename the sensor",
                    info.name
                );
                return Err(place(&owner).error(message).into());
            }
            if let Some(process) = processes.iter_mut().find(|p| p.name == owner) {
                process.constraint = Some(sensors.len());
            }
            sensors.push(Sensor::constraint(info, role));
        }
        let notes = composer.take_notes();
        let (layout, transition, needing) = composer.finish();
        if layout.tangent == 0 {
            return Err(root
                .error("nothing is estimated: add a process model, such as [process.ins]")
                .into());
        }
        let idle = |s: &Sensor| matches!(s.role, Role::Input(_)) && s.simulator.is_none();
        if let Some(part) = parts.iter().zip(&sensors).find_map(|(part, s)| idle(s).then_some(part))
        {
            let message = format!(
                "[sensor.{}] drives no process; remove it, or set enabled = false",
                part.name
            );
            return Err(part.node.error(message).into());
        }
        let has_reference = sensors.iter().any(|s| matches!(s.role, Role::Reference(_)));
        let initial = *estimator.initial.get_or_insert(if has_reference {
            Initial::Reference
        } else {
            Initial::Given
        });
        if initial == Initial::Given && !needing.is_empty() {
            let message = format!(
                "no initial value: give {}, or a reference to start from: [sensor.reference]",
                needing.join(", ")
            );
            return Err(root.get("process").unwrap_or(root).error(message).into());
        }
        if initial == Initial::Reference && !has_reference {
            let place = root.get("estimator").unwrap_or(root);
            return Err(place
                .error("initial = \"reference\" needs a sensor that is one: [sensor.reference]")
                .into());
        }
        let mut layout = layout;
        if estimator.draw == Draw::All {
            let moved = compose::moved(&layout, &processes);
            draw::draw(&mut layout, &moved, seed);
        }
        let text = self.document.to_toml();
        Ok(Composition {
            name,
            text,
            layout: Arc::new(layout),
            transition,
            processes,
            sensors,
            estimator,
            seed,
            notes,
        })
    }

    fn build_sensors(
        &self,
        parts: &[Part<'_>],
        inputs: bool,
        composer: &mut Composer,
        sensors: &mut [Option<Sensor>],
    ) -> Result<(), BuildError> {
        for (part, place) in parts.iter().zip(sensors) {
            let Make::Sensor { make, input } = &part.entry.make else { continue };
            if *input != inputs {
                continue;
            }
            composer.begin(part.name);
            let keys: SensorKeys = part
                .node
                .only(&["gate", "recovery", "timeout", "time_offset", "simulation"])
                .parse()?;
            let mut built = make(&part.node.without(common_keys(Kind::Sensor)), composer)?;
            let purpose = match &mut built.role {
                Role::Input(config) => {
                    composer.add_input(part.name, std::mem::replace(config, Box::new(())));
                    Purpose::Input
                }
                Role::Measurement(_) => Purpose::Measurement,
                Role::Reference(_) => Purpose::Reference,
            };
            if purpose != Purpose::Measurement
                && let Some(node) =
                    ["gate", "recovery"].into_iter().find_map(|key| part.node.get(key))
            {
                return Err(node
                    .error("only a sensor that corrects the state has a gate; remove it here")
                    .into());
            }
            let time_offset = match part.node.get("time_offset") {
                Some(node) if purpose != Purpose::Measurement => {
                    return Err(node
                        .error("only a sensor that corrects the state has a time offset; remove it here")
                        .into());
                }
                _ => {
                    keys.time_offset.map(|offset| time_offset::block(&offset, composer)).transpose()
                }
            };
            let time_offset = time_offset.map_err(|e| e.at(&part.node))?;
            let (name, kind) = (part.name.to_owned(), part.entry.name.to_owned());
            let info = SensorInfo { name, kind, channels: built.channels, purpose };
            Composition::check_channels(&info, &built.role).map_err(|m| part.node.error(m))?;
            *place = Some(Sensor {
                gate: keys.gate,
                recovery: keys.recovery,
                timeout: keys.timeout.map(|t| t.value().si()),
                simulation: keys.simulation,
                time_offset,
                ..Sensor::new(info, built.role)
            });
        }
        Ok(())
    }

    /// Composes the scenario and opens its sources and sinks. Sinks that are on by default are
    /// opened unless their table says `enabled = false`; with no `output` folder none is.
    ///
    /// # Errors
    /// As [`Self::compose`], and when a source or sink cannot be opened.
    pub fn assemble(&self, output: Option<&Path>) -> Result<Assembly, BuildError> {
        self.open(self.compose()?, output)
    }

    /// The scenario without sinks, as the Cramer-Rao bound runs on it: see
    /// [`Composition::at_truth`].
    ///
    /// # Errors
    /// As [`Self::assemble`].
    pub fn assemble_at_truth(&self) -> Result<Assembly, BuildError> {
        let mut composition = self.compose()?;
        composition.at_truth();
        self.open(composition, None)
    }

    fn open(
        &self,
        composition: Composition,
        output: Option<&Path>,
    ) -> Result<Assembly, BuildError> {
        let base = self.document.folder().to_path_buf();
        let context = OpenContext {
            composition: &composition,
            base,
            output: output.map_or_else(PathBuf::new, Into::into),
        };
        let mut sources = Vec::new();
        let parts = self.parts(Kind::Source)?;
        if parts.is_empty() {
            let names: Vec<&str> = self
                .registry
                .entries()
                .filter(|e| e.kind == Kind::Source)
                .map(|e| e.name)
                .collect();
            let message =
                format!("no source of samples: add one of [source.{}]", names.join("], [source."));
            return Err(self.document.root().error(message).into());
        }
        for part in parts {
            let Make::Source { make, .. } = &part.entry.make else { continue };
            let streams = make(&part.node.without(common_keys(Kind::Source)), &context)?;
            sources.extend(streams.into_iter().map(|s| (part.name.to_owned(), s)));
        }
        let mut sinks = Vec::new();
        if output.is_some() {
            for part in self.parts(Kind::Sink)? {
                let Make::Sink { make, .. } = &part.entry.make else { continue };
                sinks.push((
                    part.name.to_owned(),
                    make(&part.node.without(common_keys(Kind::Sink)), &context)?,
                ));
            }
            let empty = Document::parse("default", "")?;
            for entry in self.default_sinks()? {
                let Make::Sink { make, .. } = &entry.make else { continue };
                sinks.push((entry.name.to_owned(), make(&empty.root(), &context)?));
            }
        }
        Ok(Assembly { composition, sources, sinks })
    }

    /// Whether all samples are simulated, so that another seed gives another run.
    ///
    /// # Errors
    /// When a table of `[source]` does not fit.
    pub fn simulates(&self) -> Result<bool, DocumentError> {
        let parts = self.parts(Kind::Source)?;
        Ok(parts.iter().all(|p| matches!(p.entry.make, Make::Source { simulates: true, .. })))
    }

    /// The name of the scenario: what it says, or that of its file.
    pub fn name(&self) -> String {
        let given = self.document.root().get("name").and_then(|n| n.parse().ok());
        given.unwrap_or_else(|| self.document.stem())
    }

    /// The names of the sinks that a run with an output folder opens.
    ///
    /// # Errors
    /// When a table of `[sink]` does not fit.
    pub fn sinks(&self) -> Result<Vec<String>, DocumentError> {
        let mut names: Vec<String> =
            self.parts(Kind::Sink)?.iter().map(|p| p.name.to_owned()).collect();
        names.extend(self.default_sinks()?.iter().map(|e| e.name.to_owned()));
        Ok(names)
    }

    /// The types of sink that are on by default and that the scenario does not mention.
    fn default_sinks(&self) -> Result<Vec<&'a Entry>, DocumentError> {
        let parts = self.parts(Kind::Sink)?;
        let named = self.document.root().get(Kind::Sink.table());
        let mentioned = |entry: &Entry| {
            named.as_ref().is_some_and(|n| n.get(entry.name).is_some())
                || parts.iter().any(|p| p.entry.name == entry.name)
        };
        let default = |e: &&Entry| matches!(e.make, Make::Sink { default: true, .. });
        Ok(self.registry.entries().filter(default).filter(|e| !mentioned(e)).collect())
    }
}
