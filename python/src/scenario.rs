//! Scenarios.

use crate::error::exception;
use crate::recorder::Recorder;
use crate::run::result;
use crate::watch::Watch;
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::files::FolderLock;
use navfuse_core::model::sensor::{Purpose, Sensor};
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::{Assembly, Scenario as Composed};
use navfuse_core::state::Block;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;

/// A scenario: a document, and the types that it may name.
#[pyclass(frozen, module = "navfuse._navfuse")]
pub struct Scenario {
    registry: Arc<Registry>,
    document: Document,
}

impl Scenario {
    fn of(document: Document) -> Self {
        Self { registry: Arc::new(navfuse::standard_plugins()), document }
    }

    fn composed(&self) -> PyResult<Composed<'_>> {
        Composed::new(&self.registry, self.document.clone(), &[]).map_err(exception)
    }

    fn with(&self, settings: &[String]) -> PyResult<Document> {
        let mut document = self.document.clone();
        settings.iter().try_for_each(|s| document.set(s)).map_err(exception)?;
        Ok(document)
    }
}

#[pymethods]
impl Scenario {
    /// The scenario in a TOML file, or in the log of a run, whose samples it then takes.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let (mut document, settings) = navfuse::document_of(&path).map_err(exception)?;
        settings.iter().try_for_each(|s| document.set(s)).map_err(exception)?;
        Ok(Self::of(document))
    }

    /// The scenario in a text; `name` is the file of that text, from whose folder paths start.
    #[staticmethod]
    fn parse(name: String, text: String) -> PyResult<Self> {
        Document::parse_with_includes(name, text).map(Self::of).map_err(exception)
    }

    /// The scenario with other values, each as `key.path=value`.
    fn set(&self, settings: Vec<String>) -> PyResult<Self> {
        Ok(Self { registry: Arc::clone(&self.registry), document: self.with(&settings)? })
    }

    /// The name of the scenario.
    #[getter]
    fn name(&self) -> PyResult<String> {
        Ok(self.composed()?.name())
    }

    /// The scenario as TOML, with all values that were set.
    fn to_toml(&self) -> String {
        self.document.to_toml()
    }

    /// The mistakes, each as an exception, and the states and sensors in JSON where there are none.
    fn check(&self, py: Python<'_>) -> PyResult<(Vec<PyErr>, String)> {
        let scenario = self.composed()?;
        self.registry.check().map_err(exception)?;
        let mistakes = py.detach(|| scenario.mistakes());
        let text = match mistakes.is_empty() {
            true => describe(&scenario.assemble(None).map_err(exception)?).to_string(),
            false => String::new(),
        };
        Ok((mistakes.into_iter().map(exception).collect(), text))
    }

    /// Runs the scenario. It writes files only into the folder `out`.
    #[pyo3(signature = (out, covariance, progress))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        out: Option<PathBuf>,
        covariance: bool,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let mut watch = Watch::new(progress);
        let finished = py.detach(|| {
            let _lock = out.as_deref().map(FolderLock::take).transpose().map_err(exception)?;
            let mut assembly = self.composed()?.assemble(out.as_deref()).map_err(exception)?;
            let recorder = Recorder::new(covariance);
            assembly.sinks.push(("python".to_owned(), Box::new(recorder)));
            PyResult::Ok(watch.over(assembly))
        })?;
        watch.finish()?;
        result(py, finished)
    }
}

/// States, sensors, processes and sources, for Python.
fn describe(Assembly { composition, sources, .. }: &Assembly) -> Value {
    let Composition { layout, processes, sensors, .. } = composition;
    json!({
        "states": layout.blocks.iter().map(state).collect::<Vec<_>>(),
        "sensors": sensors.iter().map(sensor).collect::<Vec<_>>(),
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

fn sensor(sensor: &Sensor) -> Value {
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
