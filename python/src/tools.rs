//! The tools that ask of many runs. Each returns its result in JSON, as the command prints it.

use crate::error::exception;
use crate::scenario::Scenario;
use crate::watch::{Watch, watched};
use navfuse::CalibrationAttitude;
use navfuse_campaign::{
    Campaign, Extent, Folder, InitialErrors, JobCount, Options, Shard, execute,
};
use navfuse_conformance::{Finding, report_registered};
use navfuse_core::plugin::Kind;
use navfuse_diagnose::diagnose as search;
use navfuse_observability::{ObservabilityReport, TrackerSink};
use navfuse_segments::{Gatherer, SegmentError};
use pyo3::prelude::*;
use serde::Serialize;
use std::path::PathBuf;
use std::thread::available_parallelism;

/// Interval of the normalised sigmas of a report on observability, s.
const EVERY: f64 = 1.0;

/// Time for the runs of all changes of a diagnosis, s.
const SECONDS: f64 = 30.0;

fn threads(given: Option<usize>) -> usize {
    given.unwrap_or_else(|| available_parallelism().map_or(1, usize::from))
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(exception)
}

/// What is asked of a campaign: a dictionary of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Request {
    /// Number of runs; zero for the bound alone.
    runs: usize,
    seed: Option<u64>,
    /// Set if initial errors and true parameters are drawn.
    drawn: bool,
    /// Times, s.
    start: Option<f64>,
    every: Option<f64>,
    jobs: Option<usize>,
    out: Option<PathBuf>,
    /// A part of the campaign, from 1, and the number of parts.
    shard: Option<(usize, usize)>,
}

impl Request {
    fn options(&self) -> Options {
        let initial_errors = if self.drawn { InitialErrors::Drawn } else { InitialErrors::Given };
        let Self { runs, seed, every, start, .. } = *self;
        Options { runs, seed, every, from: start, initial_errors, vary: Vec::new() }
    }
}

/// Runs a campaign.
#[pyfunction]
pub fn campaign(
    py: Python<'_>,
    scenario: &Scenario,
    request: Request,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (options, out) = (request.options(), request.out);
    let shard = request.shard.map(|(index, count)| Shard { index, count });
    let extent = Extent { threads: threads(request.jobs), shard, ..Extent::default() };
    let work = |watch: &Watch| {
        let (registry, document) = (&scenario.registry, &scenario.document);
        let campaign = Campaign::new(registry, document, &options)?;
        let mut folder = Folder::create(out.as_deref(), &campaign, shard)?;
        let show = |JobCount { done, asked }| watch.done(done as f64, Some(asked as f64));
        let add = |record| folder.add(record);
        let done = execute(&campaign, registry, document, extent, &watch.stop, show, add)?;
        folder.finish(done)
    };
    let results = watched(py, progress.as_ref(), |watch| work(watch))?.map_err(exception)?;
    scenario.failure.take()?;
    json(&results.map(|results| results.report))
}

/// Merges the parts of a campaign, which are folders, into a folder.
#[pyfunction]
pub fn merge(py: Python<'_>, parts: Vec<PathBuf>, out: PathBuf) -> PyResult<String> {
    let merged = py.detach(|| navfuse_campaign::merge(&parts, &out));
    json(&merged.map_err(exception)?.report)
}

/// Calibrates the DVL by a method, with the attitude of the reference or of the gyros.
#[pyfunction]
pub fn calibrate(
    py: Python<'_>,
    scenario: &Scenario,
    method: &str,
    reference: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let attitude =
        if reference { CalibrationAttitude::Reference } else { CalibrationAttitude::Gyros };
    let result = watched(py, progress.as_ref(), |watch| {
        let show = |progress| watch.show(progress);
        let (registry, document) = (&scenario.registry, &scenario.document);
        navfuse::calibration(registry, document, method, attitude, &show).map_err(exception)
    })??;
    scenario.failure.take()?;
    json(&result)
}

/// Finds the change of a scenario that explains its samples.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    scenario: &Scenario,
    jobs: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let options = navfuse_diagnose::Options { threads: threads(jobs), seconds: SECONDS };
    let diagnosis = watched(py, progress.as_ref(), |watch| {
        let show = |done: usize, all: usize| watch.done(done as f64, Some(all as f64));
        let (registry, document) = (&scenario.registry, &scenario.document);
        search(registry, document, &options, &watch.stop, &show).map_err(exception)
    })??;
    scenario.failure.take()?;
    json(&diagnosis)
}

/// Checks the classes of a scenario as the conformance kit does. The findings are in JSON.
#[pyfunction]
pub fn conformance(
    py: Python<'_>,
    scenario: &Scenario,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let report = watched(py, progress.as_ref(), |_| {
        let (registry, types) = scenario.types()?;
        let checked: Vec<(Kind, &str)> =
            types.iter().map(|(kind, name)| (*kind, &**name)).collect();
        PyResult::Ok(report_registered(registry, &checked, &scenario.document.to_toml()))
    })??;
    scenario.failure.take()?;
    let finding = |finding: &Finding| {
        let text = finding.outcome.as_ref().map_or_else(ToString::to_string, Clone::clone);
        serde_json::json!({
            "check": finding.check, "about": finding.about, "text": text,
            "passed": finding.outcome.is_ok(),
        })
    };
    json(&report.findings.iter().map(finding).collect::<Vec<_>>())
}

/// Reports which states a scenario determines, and since when.
#[pyfunction]
pub fn observability(
    py: Python<'_>,
    scenario: &Scenario,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let report = watched(py, progress.as_ref(), |watch| {
        let mut assembly = scenario.assemble(None, watch)?;
        let gatherer = Gatherer::new(&assembly.composition);
        assembly.sinks.push(("observability".into(), Box::new(TrackerSink::new(EVERY))));
        assembly.sinks.push(("segments".into(), Box::new(gatherer)));
        let mut finished = watch.run(assembly, &scenario.failure);
        finished.error.take().map_or(Ok(()), |error| Err(exception(error)))?;
        let Some(tracker) = TrackerSink::take(&mut finished) else { return Ok(None) };
        let composed = scenario.composed()?;
        let mut report = ObservabilityReport::new(&composed.name(), &tracker);
        let composition = composed.compose().map_err(SegmentError::from);
        report.judge(composition.and_then(|c| Gatherer::take(&mut finished, &c)), &tracker);
        PyResult::Ok(Some(report))
    })??;
    scenario.failure.take()?;
    json(&report)
}
