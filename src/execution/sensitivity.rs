//! Sensitivities of a run, as `sensitivity`, `run` and `report` compute them.

use crate::error::Result;
use crate::execution::campaign::threads;
use crate::output::progress::Bar;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_diagnose::{Options, Sensitivity};
use std::sync::atomic::AtomicBool;

/// Runs the samples of a scenario with each thing that it does not model, on so many threads, or one
/// a core; `settings` are those of the scenario.
pub fn sensitivity(
    registry: &Registry,
    mut document: Document,
    settings: &[String],
    jobs: Option<usize>,
    stop: &AtomicBool,
    bar: &Bar,
) -> Result<Sensitivity> {
    settings.iter().try_for_each(|setting| document.set(setting))?;
    let options = Options { threads: threads(jobs)?, seconds: f64::INFINITY };
    let show = |done, all| bar.trials(done, all);
    let found = navfuse_diagnose::sensitivity(registry, &document, &options, stop, &show);
    bar.done();
    Ok(found?)
}
