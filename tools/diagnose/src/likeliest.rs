//! The likeliest of a few answers to a question.

use crate::DiagnoseError;
use crate::likelihood::Channels;
use crate::parallel;
use crate::patch::Patch;
use crate::recording::Recording;
use crate::scene::Scene;
use crate::search::{CLEAR, most};
use crate::trial::{Outcome, run};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Runs a scenario as it is and with each of some assignments `key.path=value`, and returns the one under
/// which the samples are likeliest, if it leads the scenario as it is by odds of 150 : 1. It
/// calls `progress` with the number of runs that are done, and of all.
///
/// # Errors
/// When the scenario does not compose, or its samples cannot be read.
pub fn likeliest<'a>(
    registry: &Registry,
    document: &Document,
    answers: &'a [String],
    threads: usize,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Option<&'a String>, DiagnoseError> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording = Recording::read(scenario.assemble(None)?)?;
    let composition = scenario.compose()?;
    let scene = Scene::new(registry, document, &composition, &recording);
    let (_, end) = recording.span();
    let unchanged = Patch::default();
    let scales = run(&scene, &unchanged, end, &Channels::new(), stop)?.scales;
    let patch = |answer: &String| Patch::new(answer.clone(), vec![answer.clone()]);
    let patches: Vec<Patch> = [unchanged].into_iter().chain(answers.iter().map(patch)).collect();
    let done = AtomicUsize::new(0);
    let runs: Vec<(usize, Outcome)> = parallel::each(patches.len(), threads, stop, |at| {
        let outcome = run(&scene, &patches[at], end, &scales, stop).ok();
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, patches.len());
        outcome.filter(|outcome| !outcome.interrupted).map(|outcome| (at, outcome))
    });
    let wanted = most(&scene, runs.iter().map(|(_, outcome)| outcome));
    let total = |outcome: &Outcome| 2.0 * outcome.densities.total(&wanted, &scales, false);
    let before = runs.iter().find(|(at, _)| *at == 0).map(|(_, outcome)| total(outcome));
    let best = runs.iter().map(|(at, outcome)| (*at, total(outcome)));
    let best = best.max_by(|a, b| a.1.total_cmp(&b.1));
    let clear = best.zip(before).filter(|((_, best), before)| best - before >= CLEAR);
    Ok(clear.and_then(|((at, _), _)| answers.get(at.checked_sub(1)?)))
}
