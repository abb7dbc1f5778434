//! Scenarios.

use crate::error::exception;
use crate::live::{Calling, Iterating};
use crate::process;
use crate::recorder::Recorder;
use crate::run::result;
use crate::samples::{self, Rows};
use crate::sensor::{self, Class};
use crate::table::{self, Recognised};
use crate::watch::{Failure, Watch, watched};
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::files::FolderLock;
use navfuse_core::model::sensor::{Purpose, Sensor, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::scenario::{Assembly, Scenario as Composed};
use navfuse_core::state::Block;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The types that a scenario may name.
fn registry(classes: &[Arc<Py<PyAny>>], failure: &Arc<Failure>) -> PyResult<Registry> {
    let mut registry = navfuse::standard_plugins();
    samples::register(&mut registry);
    for class in classes {
        let class: Class = Python::attach(|py| class.extract(py))?;
        let register = if class.moves { process::register } else { sensor::register };
        register(&mut registry, &class, failure)?;
    }
    registry.check().map_err(exception)?;
    Ok(registry)
}

/// A scenario: a document, the types that it may name, and samples that Python gives.
#[pyclass(frozen, module = "navfuse._navfuse")]
pub struct Scenario {
    pub(crate) registry: Arc<Registry>,
    pub(crate) document: Document,
    /// Samples in memory.
    samples: Vec<Arc<Rows>>,
    /// An iterable of samples.
    iterable: Option<Arc<Py<PyAny>>>,
    /// Types of sensors and processes in Python, and what went wrong in them.
    classes: Vec<Arc<Py<PyAny>>>,
    pub(crate) failure: Arc<Failure>,
}

impl Scenario {
    fn of(document: Document) -> PyResult<Self> {
        let failure = Arc::default();
        let registry = Arc::new(registry(&[], &failure)?);
        let (samples, iterable, classes) = Default::default();
        Ok(Self { registry, document, samples, iterable, classes, failure })
    }

    /// The same with another document.
    fn with(&self, document: Document) -> Self {
        let Self { registry, samples, iterable, classes, failure, document: _ } = self;
        Self {
            registry: Arc::clone(registry),
            document,
            samples: samples.clone(),
            iterable: iterable.clone(),
            classes: classes.clone(),
            failure: Arc::clone(failure),
        }
    }

    /// A registry of its own, and the kinds and names of the classes in it.
    pub(crate) fn types(&self) -> PyResult<(Registry, Vec<(Kind, String)>)> {
        let kind = |class: &Arc<Py<PyAny>>| {
            let class: Class = Python::attach(|py| class.extract(py))?;
            let kind = if class.moves { Kind::Process } else { Kind::Sensor };
            PyResult::Ok((kind, class.name))
        };
        let types = self.classes.iter().map(kind).collect::<PyResult<_>>()?;
        Ok((registry(&self.classes, &self.failure)?, types))
    }

    /// The document with other values.
    pub(crate) fn changed(&self, settings: &[String]) -> PyResult<Document> {
        let mut document = self.document.clone();
        settings.iter().try_for_each(|s| document.set(s)).map_err(exception)?;
        Ok(document)
    }

    pub(crate) fn composed(&self) -> PyResult<Composed<'_>> {
        Composed::new(&self.registry, self.document.clone(), &[]).map_err(exception)
    }

    /// Composes the scenario, and opens its sources and sinks.
    pub(crate) fn assemble(&self, out: Option<&Path>, watch: &Arc<Watch>) -> PyResult<Assembly> {
        let mut assembly = self.composed()?.assemble(out).map_err(exception)?;
        let composition = &assembly.composition;
        for rows in &self.samples {
            let source = rows.source(composition);
            assembly.sources.extend(source.map(|source| ("memory".to_owned(), source)));
        }
        if let Some(iterable) = &self.iterable {
            let source = Iterating::new(iterable, &composition.sensors, watch)?;
            assembly.sources.push(("iterator".to_owned(), Box::new(source)));
        }
        Ok(assembly)
    }
}

#[pymethods]
impl Scenario {
    /// The scenario in a TOML file, or in the log of a run, whose samples it then takes.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let (document, settings) = navfuse::document_of(&path).map_err(exception)?;
        Self::of(document)?.set(settings)
    }

    /// The scenario in a text; `name` is the file of that text, from whose folder paths start.
    #[staticmethod]
    fn parse(name: String, text: String) -> PyResult<Self> {
        Self::of(Document::parse_with_includes(name, text).map_err(exception)?)
    }

    /// The scenario with other values, each as `key.path=value`.
    fn set(&self, settings: Vec<String>) -> PyResult<Self> {
        Ok(self.with(self.changed(&settings)?))
    }

    /// The scenario with samples of a sensor: times, headings of the columns, and their numbers one
    /// column after the other.
    fn with_rows(
        &self,
        sensor: &str,
        times: (&[u8], bool),
        headings: Vec<String>,
        columns: &[u8],
    ) -> PyResult<Self> {
        let mut scenario = self.with(self.document.clone());
        let composition = scenario.composed()?.compose().map_err(exception)?;
        let info = sensor_info(&composition, sensor)?;
        let times = samples::times(times.0, times.1)?;
        scenario.samples.push(Arc::new(Rows::new(info, times, &headings, columns)?));
        Ok(scenario)
    }

    /// The scenario with samples of a sensor in a table of text with other headings, and what was
    /// recognised: the channels that have samples, and the keys of their columns with the questions.
    fn with_table(
        &self,
        py: Python<'_>,
        sensor: &str,
        path: PathBuf,
    ) -> PyResult<(Self, Vec<String>, Vec<String>)> {
        let Recognised { rows, channels, notes } =
            py.detach(|| table::read(self, sensor, &path))?;
        let mut scenario = self.with(self.document.clone());
        scenario.samples.push(Arc::new(rows));
        Ok((scenario, channels, notes))
    }

    /// The scenario that may name further types of sensors and processes: `navfuse._sensor.Class`.
    fn with_classes(&self, classes: Vec<Py<PyAny>>) -> PyResult<Self> {
        let mut scenario = self.with(self.document.clone());
        scenario.classes.extend(classes.into_iter().map(Arc::new));
        scenario.failure = Arc::default();
        scenario.registry = Arc::new(registry(&scenario.classes, &scenario.failure)?);
        Ok(scenario)
    }

    /// The scenario without its sources, for samples that Python gives.
    fn without_samples(&self) -> PyResult<Self> {
        let scenario = self.with(self.changed(&[samples::SOURCE.to_owned()])?);
        Ok(Self { samples: Vec::new(), iterable: None, ..scenario })
    }

    /// States, sensors, processes and sources, in JSON.
    fn describe(&self) -> PyResult<String> {
        let assembly = self.composed()?.assemble(None).map_err(exception)?;
        Ok(describe(&assembly).to_string())
    }

    /// The scenario with the samples of an iterable in place of those of its sources: name of the
    /// sensor, time in s, and channels in SI.
    fn with_iterable(&self, iterable: Py<PyAny>) -> PyResult<Self> {
        Ok(Self { iterable: Some(Arc::new(iterable)), ..self.without_samples()? })
    }

    /// The name of the scenario.
    #[getter]
    fn name(&self) -> PyResult<String> {
        Ok(self.composed()?.name())
    }

    /// Set if Python gives the samples.
    #[getter]
    fn in_memory(&self) -> bool {
        self.iterable.is_some() || !self.samples.is_empty()
    }

    /// The scenario as TOML, with all values that were set.
    fn to_toml(&self) -> String {
        self.document.to_toml()
    }

    /// The mistakes, each as an exception, and the states and sensors in JSON where there are none.
    fn check(&self, py: Python<'_>) -> PyResult<(Vec<PyErr>, String)> {
        let scenario = self.composed()?;
        let mistakes = py.detach(|| scenario.mistakes());
        let text = if mistakes.is_empty() { self.describe()? } else { String::new() };
        Ok((mistakes.into_iter().map(exception).collect(), text))
    }

    /// Runs the scenario. It writes files only into the folder `out`.
    fn run<'py>(
        &self,
        py: Python<'py>,
        out: Option<PathBuf>,
        covariance: bool,
        progress: Option<Py<PyAny>>,
        on_epoch: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let finished = watched(py, progress.as_ref(), |watch| {
            let _lock = out.as_deref().map(FolderLock::take).transpose().map_err(exception)?;
            let mut assembly = self.assemble(out.as_deref(), watch)?;
            let recorder = Recorder::new(covariance);
            assembly.sinks.push(("python".to_owned(), Box::new(recorder)));
            if let Some(function) = on_epoch {
                let sink = Calling::new(function, watch);
                assembly.sinks.push(("on_epoch".to_owned(), Box::new(sink)));
            }
            PyResult::Ok(watch.run(assembly, &self.failure))
        })??;
        self.failure.take()?;
        result(py, finished)
    }
}

/// The sensor of a name.
pub fn sensor_info<'a>(composition: &'a Composition, name: &str) -> PyResult<&'a SensorInfo> {
    let found = composition.sensor(name).map(|k| &composition.sensors[k].info);
    found.ok_or_else(|| {
        let names: Vec<&str> = composition.sensors.iter().map(|s| s.info.name.as_str()).collect();
        let remedy = format!("the sensors are {}", names.join(", "));
        let message = format!("the scenario has no [sensor.{name}]");
        exception(StreamError::scenario(message).with_remedy(remedy))
    })
}

/// States, sensors, processes and sources, for Python.
fn describe(Assembly { composition, sources, .. }: &Assembly) -> Value {
    let Composition { layout, processes, sensors, .. } = composition;
    json!({
        "states": layout.blocks.iter().map(state).collect::<Vec<_>>(),
        "sensors": sensors.iter().map(of_sensor).collect::<Vec<_>>(),
        "processes": processes.iter().map(|p| [&p.name, &p.kind]).collect::<Vec<_>>(),
        "sources": sources.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "notes": composition.notes,
    })
}

fn state(block: &Block) -> Value {
    let display = &block.spec.display;
    let sigma: Vec<f64> = block.spec.sigma.iter().map(|s| s / display.scale).collect();
    json!({
        "name": block.name, "unit": display.unit, "components": display.components,
        "mode": block.spec.mode, "sigma": sigma,
    })
}

fn of_sensor(sensor: &Sensor) -> Value {
    let info = &sensor.info;
    let channels = info.channels.iter().map(|c| (c.name.to_string(), json!(c.unit.symbol())));
    json!({
        "name": info.name, "type": info.kind,
        "purpose": match info.purpose {
            Purpose::Input => "drives a process",
            Purpose::Measurement => "corrects the state",
            Purpose::Reference => "start and comparison",
        },
        "channels": channels.collect::<serde_json::Map<_, _>>(),
    })
}
