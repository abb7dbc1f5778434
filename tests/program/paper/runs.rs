//! Runs of the paper's scenarios: sigma and error of every state once a second.

use crate::common::{parallel, scenario};
use navfuse_core::document::Document;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::manifold::MAX_TANGENT;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

/// Seeds of the runs.
pub const SEEDS: std::ops::RangeInclusive<u64> = 1..=8;
/// Settings of all runs except the seed.
const SETTINGS: [&str; 2] = ["sensor.imu.simulation.rate=20 Hz", "estimator.output_rate=1 Hz"];

/// Result of a run.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Names of the components: `dvl.misalignment.roll` and so on.
    names: Vec<String>,
    /// Time (s), sigma and error of every component, in the units of the summary.
    rows: Vec<(f64, Vec<f64>, Vec<f64>)>,
}

impl Run {
    fn row(&self, time: f64) -> &(f64, Vec<f64>, Vec<f64>) {
        let row = self.rows.iter().find(|row| row.0 >= time - 1e-6);
        row.unwrap_or_else(|| panic!("no epoch from {time} s on"))
    }

    fn index(&self, name: &str) -> usize {
        self.names
            .iter()
            .position(|n| n == name)
            .unwrap_or_else(|| panic!("no state {name}: {:?}", self.names))
    }

    /// Returns the 1-sigma of a component at a time, in the unit of the summary.
    pub fn sigma(&self, name: &str, time: f64) -> f64 {
        self.row(time).1[self.index(name)]
    }

    /// Returns the error of a component at a time.
    pub fn error(&self, name: &str, time: f64) -> f64 {
        self.row(time).2[self.index(name)]
    }

    /// Returns the 1-sigma relative to that at the start: Figure 12.
    pub fn normalised(&self, name: &str, time: f64) -> f64 {
        self.sigma(name, time) / self.rows[0].1[self.index(name)]
    }
}

/// Returns the root mean square of the errors of a component at a time.
pub fn rms(runs: &[Run], name: &str, time: f64) -> f64 {
    let squares: f64 = runs.iter().map(|r| r.error(name, time).powi(2)).sum();
    (squares / runs.len() as f64).sqrt()
}

/// Returns the 3-D runs.
pub fn dives() -> &'static [Run] {
    static RUNS: LazyLock<Vec<Run>> = LazyLock::new(|| all("pan-wu-3d"));
    &RUNS
}

/// Returns the 2-D runs.
pub fn flat() -> &'static [Run] {
    static RUNS: LazyLock<Vec<Run>> = LazyLock::new(|| all("pan-wu-2d"));
    &RUNS
}

/// Runs a job on a scenario of the repository, with settings.
pub fn with<T>(name: &str, settings: &[String], job: impl FnOnce(&Scenario<'_>) -> T) -> T {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(scenario(name)).expect("the scenario is there");
    job(&Scenario::new(&registry, document, settings).expect("the settings fit"))
}

/// Runs a job for every seed, on all cores.
pub fn for_seeds<T: Send>(job: impl Fn(Vec<String>) -> T + Sync) -> Vec<T> {
    let settings = |seed: u64| {
        SETTINGS.iter().map(|s| (*s).to_owned()).chain([format!("seed={seed}")]).collect()
    };
    parallel(&SEEDS.collect::<Vec<u64>>(), |seed| job(settings(seed)))
}

fn all(name: &str) -> Vec<Run> {
    for_seeds(|settings| run(name, &settings))
}

fn run(name: &str, settings: &[String]) -> Run {
    let mut assembly = with(name, settings, |s| s.assemble(None)).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("errors".into(), Box::new(Run::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished.take_sink().expect("the run gives its sinks back")
}

impl Sink for Run {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS
    }

    fn start(&mut self, info: &RunInfo) -> Result<(), StreamError> {
        let names = info.layout.blocks.iter().flat_map(|block| {
            let components = block.spec.display.components.iter();
            components.map(|c| format!("{}.{c}", block.name))
        });
        self.names = names.collect();
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let Some(truth) = epoch.truth else { return Ok(()) };
        let (mut sigmas, mut errors) = (Vec::new(), Vec::new());
        for block in &epoch.layout.blocks {
            let (n, mut sigma, mut error) =
                (block.operations.tangent, [0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
            block.show_error(&epoch.state.values, &truth.state.values, &mut error);
            sigmas.extend_from_slice(&sigma[..n]);
            errors.extend_from_slice(&error[..n]);
        }
        self.rows.push((epoch.state.time.seconds(), sigmas, errors));
        Ok(())
    }
}
