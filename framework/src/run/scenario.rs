//! From a TOML document to a composition, its sources and its sinks.

use crate::compose::Composition;
use crate::compose::estimator::Creator;
use crate::document::{Document, DocumentError, key};
use crate::filter::Ekf;
use crate::model::stream::{NamedFeed, NamedSink, NamedSource};
use crate::plugin::{BuildError, Entry, Kind, Make, OpenContext, Registry, Shared};
use crate::run::building::{Building, Header};
pub use crate::run::parts::common_keys;
use crate::run::parts::{self, Part};
use crate::run::rules::Rules;
use crate::run::sinks;
use crate::session;
use std::path::{Path, PathBuf};

/// A scenario ready to run.
pub struct Assembly {
    /// The filter's parts.
    pub composition: Composition,
    /// The sources of samples, each with its name.
    pub sources: Vec<NamedSource>,
    /// The sinks of results, each with its name.
    pub sinks: Vec<NamedSink>,
}

/// A scenario ready to run on a vehicle.
pub struct LiveAssembly {
    /// The filter's parts.
    pub composition: Composition,
    /// The links through which samples arrive, each with its name.
    pub feeds: Vec<NamedFeed>,
    /// The sinks of results, each with its name.
    pub sinks: Vec<NamedSink>,
}

/// Keys at the top of a scenario.
pub const TOP_KEYS: [&str; 10] = [
    "include",
    "name",
    "description",
    "seed",
    "estimator",
    "process",
    "sensor",
    "source",
    "link",
    "sink",
];

/// Reads and composes scenarios.
pub struct Scenario<'a> {
    registry: &'a Registry,
    document: Document,
    shared: Option<Shared>,
}

impl<'a> Scenario<'a> {
    /// Reads the scenario at a path and applies the given `key.path=value` overrides.
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
        Ok(Self { registry, document, shared: None })
    }

    /// Shares values with the other runs that have the same `shared`: runs of one scenario, which
    /// differ in seed and draw.
    #[must_use]
    pub fn sharing(self, shared: &Shared) -> Self {
        Self { shared: Some(shared.clone()), ..self }
    }

    /// Changes a value, as `key.path=value`.
    ///
    /// # Errors
    /// When it is not `key.path=value`.
    pub fn set(&mut self, assignment: &str) -> Result<(), DocumentError> {
        self.document.set(assignment)
    }

    /// The enabled tables of a kind, in the order of the file.
    fn parts<'s>(&'s self, kind: Kind) -> Result<Vec<Part<'s>>, DocumentError> {
        parts::parts(&self.document.root(), self.registry, kind)
    }

    /// Composes the filter: blocks, models, sensors.
    ///
    /// # Errors
    /// When a part of the scenario does not fit. The message names file, line, key, value and
    /// remedy.
    pub fn compose(&self) -> Result<Composition, BuildError> {
        let root = self.document.root();
        root.check_keys(&TOP_KEYS)?;
        // a file has been laid over those that it includes
        if let Some(include) = root.get("include") {
            let message = "only a scenario in a file includes others, not the scenario of a log";
            return Err(include.error(message).into());
        }
        self.registry.check()?;
        let header = Header::read(&root, self.name())?;
        let sensors = self.parts(Kind::Sensor)?;
        let rules = Rules::of(self.registry).with_default(&root, &header.estimator.update)?;
        let mut building = Building::new(root.clone(), self.document.folder(), sensors, rules);
        building.driving_sensors()?;
        building.processes(&self.parts(Kind::Process)?)?;
        building.other_sensors()?;
        building.connect_alignments()?;
        building.connect_detectors()?;
        building.constraints()?;
        let creator = session::find(self.registry, &root, &header.estimator.kind)?;
        let (text, simulates) = (self.text(), self.simulates()?);
        let mut composition = building.finish(header, creator, text, simulates)?;
        session::check(&composition, &root)?;
        session::settle(&mut composition);
        Ok(composition)
    }

    /// Composes the scenario and opens its sources and sinks. Sinks that are on by default are
    /// opened unless their table has `enabled = false`; without an `output` folder no sink is.
    ///
    /// # Errors
    /// As [`Self::compose`], and when a source or sink cannot be opened or two sinks write the same
    /// file.
    pub fn assemble(&self, output: Option<&Path>) -> Result<Assembly, BuildError> {
        self.open(self.compose()?, output)
    }

    /// The scenario without sinks, as the Cramer-Rao bound needs it: see [`Composition::at_truth`].
    ///
    /// # Errors
    /// As [`Self::assemble`].
    pub fn assemble_at_truth(&self) -> Result<Assembly, BuildError> {
        let mut composition = self.compose()?;
        composition.at_truth();
        // the bound is that of the model linearised at the truth
        composition.creator = Creator::of::<Ekf>();
        self.open(composition, None)
    }

    /// A copy that can be changed.
    pub(crate) fn copy(&self) -> Self {
        let (document, shared) = (self.document.clone(), self.shared.clone());
        Self { registry: self.registry, document, shared }
    }

    /// The document, with its overrides.
    pub(crate) fn document_mut(&mut self) -> &mut Document {
        &mut self.document
    }

    /// Reads the tables of sources and sinks. A run opens its sources once it is composed, and its sinks
    /// only with an output folder.
    pub(crate) fn check_streams(&self) -> Result<(), BuildError> {
        for part in self.parts(Kind::Source)? {
            if let Make::Source { prepare, .. } = &part.entry.make {
                drop(prepare(&part.own_keys())?);
            }
        }
        for part in self.parts(Kind::Link)? {
            if let Make::Link { prepare } = &part.entry.make {
                drop(prepare(&part.own_keys())?);
            }
        }
        let empty = Document::parse("default", "")?;
        sinks::prepare(&self.parts(Kind::Sink)?, &self.default_sinks()?, &empty).map(drop)
    }

    fn open(
        &self,
        composition: Composition,
        output: Option<&Path>,
    ) -> Result<Assembly, BuildError> {
        let sources = self.needed_parts(Kind::Source, "source of samples")?;
        let context = self.context(&composition, sources.len(), output)?;
        let sources = open_sources(&sources, &context)?;
        let sinks = self.open_sinks(&context, output)?;
        Ok(Assembly { composition, sources, sinks })
    }

    /// Composes the scenario and opens its links and sinks, for a run on the vehicle; the sources
    /// of the scenario stay closed.
    ///
    /// # Errors
    /// As [`Self::assemble`], and when a link cannot be opened.
    pub fn assemble_live(&self, output: Option<&Path>) -> Result<LiveAssembly, BuildError> {
        let links = self.needed_parts(Kind::Link, "link to the sensors")?;
        let mut composition = self.compose()?;
        composition.simulated = false;
        let context = self.context(&composition, links.len(), output)?;
        let mut feeds = Vec::new();
        for part in &links {
            let Make::Link { prepare } = &part.entry.make else { continue };
            let node = part.own_keys();
            let feed = prepare(&node)?(&context).map_err(|e| e.at(&node))?;
            feeds.push((part.name.to_owned(), feed));
        }
        let sinks = self.open_sinks(&context, output)?;
        Ok(LiveAssembly { composition, feeds, sinks })
    }

    fn context<'c>(
        &self,
        composition: &'c Composition,
        sources: usize,
        output: Option<&Path>,
    ) -> Result<OpenContext<'c>, DocumentError> {
        Ok(OpenContext {
            composition,
            base: self.document.folder().to_path_buf(),
            output: output.map_or_else(PathBuf::new, Into::into),
            disabled_sensors: parts::disabled(&self.document.root(), Kind::Sensor)?,
            sources,
            shared: self.shared.clone(),
        })
    }

    /// Opens the sinks, which need an output folder.
    fn open_sinks(
        &self,
        context: &OpenContext<'_>,
        output: Option<&Path>,
    ) -> Result<Vec<NamedSink>, BuildError> {
        if output.is_none() {
            return Ok(Vec::new());
        }
        let empty = Document::parse("default", "")?;
        let prepared = sinks::prepare(&self.parts(Kind::Sink)?, &self.default_sinks()?, &empty)?;
        sinks::check_files(&prepared, context)?;
        sinks::open(prepared, context)
    }

    /// The scenario as a log holds it. The samples in a log are converted, so that its scenario does
    /// not convert them again.
    fn text(&self) -> String {
        let sensors = self.document.root().get(Kind::Sensor.table());
        let names = sensors.and_then(|s| s.value().as_table().map(|t| t.keys().cloned()));
        let mut document = self.document.clone();
        for name in names.into_iter().flatten() {
            document.remove_path(&format!("{}.{}.samples", Kind::Sensor.table(), key(&name)));
        }
        document.to_toml()
    }

    /// The tables of a kind, of which there has to be one at least.
    fn needed_parts(&self, kind: Kind, what: &str) -> Result<Vec<Part<'_>>, DocumentError> {
        let (parts, table) = (self.parts(kind)?, kind.table());
        if parts.is_empty() {
            let entries = self.registry.entries().filter(|e| e.kind == kind);
            let names: Vec<&str> = entries.map(|e| &*e.name).collect();
            let names = names.join(&format!("], [{table}."));
            let message = format!("no {what}: add one of [{table}.{names}]");
            return Err(self.document.root().error(message));
        }
        Ok(parts)
    }

    /// True where every source simulates its samples, so that another seed gives another run.
    ///
    /// # Errors
    /// When a table of `[source]` does not fit.
    pub fn simulates(&self) -> Result<bool, DocumentError> {
        let parts = self.parts(Kind::Source)?;
        Ok(parts.iter().all(|p| matches!(p.entry.make, Make::Source { simulates: true, .. })))
    }

    /// The name of the scenario: the key `name`, or else the name of its file.
    pub fn name(&self) -> String {
        let given = self.document.root().get("name").and_then(|n| n.parse().ok());
        given.unwrap_or_else(|| self.document.stem())
    }

    /// The names of the sinks that a run with an output folder opens.
    ///
    /// # Errors
    /// When a table of `[sink]` does not fit.
    pub fn sinks(&self) -> Result<Vec<String>, DocumentError> {
        self.named_sinks(|_| true)
    }

    /// As [`Self::sinks`], of one registered type.
    ///
    /// # Errors
    /// As [`Self::sinks`].
    pub fn sinks_of_type(&self, name: &str) -> Result<Vec<String>, DocumentError> {
        self.named_sinks(|entry| &*entry.name == name)
    }

    fn named_sinks(&self, wanted: impl Fn(&Entry) -> bool) -> Result<Vec<String>, DocumentError> {
        let parts = self.parts(Kind::Sink)?;
        let given = parts.iter().filter(|p| wanted(p.entry)).map(|p| p.name.to_owned());
        let default = self.default_sinks()?;
        let default = default.into_iter().filter(|e| wanted(e)).map(|e| e.name.to_string());
        Ok(given.chain(default).collect())
    }

    /// The types of sink that are on by default and that the scenario does not mention.
    fn default_sinks(&self) -> Result<Vec<&'a Entry>, DocumentError> {
        let parts = self.parts(Kind::Sink)?;
        let named = self.document.root().get(Kind::Sink.table());
        let mentioned = |entry: &Entry| {
            named.as_ref().is_some_and(|n| n.get(&entry.name).is_some())
                || parts.iter().any(|p| p.entry.name == entry.name)
        };
        let default = |e: &&Entry| matches!(e.make, Make::Sink { default: true, .. });
        Ok(self.registry.entries().filter(default).filter(|e| !mentioned(e)).collect())
    }
}

fn open_sources(
    parts: &[Part<'_>],
    context: &OpenContext<'_>,
) -> Result<Vec<NamedSource>, BuildError> {
    let mut sources = Vec::new();
    for part in parts {
        let Make::Source { prepare, .. } = &part.entry.make else { continue };
        let node = part.own_keys();
        let streams = prepare(&node)?(context).map_err(|e| e.at(&node))?;
        sources.extend(streams.into_iter().map(|s| (part.name.to_owned(), s)));
    }
    Ok(sources)
}
