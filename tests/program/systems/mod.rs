//! Systems that Pan & Wu (2016) name beside their own, on the samples of our scenarios, and the filter
//! on the same samples. `docs/src/explanation/systems.md` has the tables, which the tests print with
//! `--nocapture`.

mod gap;
mod lever_arm;
mod long_baseline;

use navfuse_core::document::Document;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::nalgebra::Vector3;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{Manifold, Position};
use navfuse_core::units::sample::Sample;
use std::sync::atomic::AtomicBool;

/// The horizontal errors of the position over time: s, m.
pub type Errors = Vec<(f64, f64)>;

/// Root mean square from a time on, m.
pub fn rms(errors: &Errors, from: f64) -> f64 {
    let late: Vec<f64> = errors.iter().filter(|e| e.0 >= from).map(|e| e.1 * e.1).collect();
    (late.iter().sum::<f64>() / late.len() as f64).sqrt()
}

/// Time after which the error stays below a limit, s; `None` if it does not at the end.
pub fn settled(errors: &Errors, limit: f64) -> Option<f64> {
    let last = errors.iter().rposition(|e| e.1 >= limit);
    last.map_or(errors.first(), |k| errors.get(k + 1)).map(|e| e.0)
}

/// Follows the estimate of a run.
#[derive(Default)]
struct Watch(Errors);

impl Sink for Watch {
    fn wants(&self) -> Wants {
        Wants::EPOCHS
    }
    fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Epoch(epoch) = *record
            && let Some(truth) = epoch.truth
            && let Some(position) = epoch.layout.vehicle().position
        {
            let range = epoch.layout.block(position).range();
            let [here, there] = [&epoch.state.values, &truth.state.values]
                .map(|values| <Position as Manifold>::load::<f64>(&values[range.clone()]));
            self.0.push((epoch.state.time.seconds(), horizontal(&here, &there)));
        }
        Ok(())
    }
}

/// Horizontal distance, m.
pub fn horizontal(here: &Geodetic, there: &Geodetic) -> f64 {
    let off: Vector3<f64> = here.ned_from(there);
    off.x.hypot(off.y)
}

/// Runs a scenario of the repository, and returns the errors of the filter.
pub fn filter(name: &str, settings: &[String]) -> Errors {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(crate::common::scenario(name)).unwrap();
    let scenario = Scenario::new(&registry, document, settings).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("watch".into(), Box::new(Watch::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished.take_sink::<Watch>().unwrap().0
}

/// All samples of a scenario of the repository in order of time, and the names of their sensors.
pub fn samples(name: &str, settings: &[String]) -> (Vec<Sample>, Vec<String>) {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(crate::common::scenario(name)).unwrap();
    let scenario = Scenario::new(&registry, document, settings).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let (mut all, mut sample) = (Vec::new(), Sample::default());
    for (_, source) in &mut assembly.sources {
        while source.next(&mut sample).unwrap() {
            all.push(sample);
        }
    }
    all.sort_by_key(|s| (s.time, s.sensor));
    let names = assembly.composition.sensors.iter().map(|s| s.info.name.clone()).collect();
    (all, names)
}

/// Settings of a run from their lines.
pub fn settings(lines: &[&str], seed: u64) -> Vec<String> {
    lines.iter().map(|s| (*s).to_owned()).chain([format!("seed={seed}")]).collect()
}

/// Root mean square of the values of several runs.
pub fn over_runs(values: impl IntoIterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.into_iter().collect();
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}
