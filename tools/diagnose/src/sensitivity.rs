//! Changes of the result if each thing that the scenario does not model had its usual size.
//!
//! The same samples are run again with one of them in the model at a time, of the other sign: a bias of
//! a DVL of -1 cm/s, another lever arm. The innovations are then those of an instrument with a bias of
//! 1 cm/s and a model without, so that the difference of the two results is what the filter, with
//! its own gains and gates, makes of that bias. The axes of a thing are independent, so their squares
//! add up.

mod unmodelled;

use crate::parallel;
use crate::recording::Recording;
use crate::{DiagnoseError, Options};
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::session::RunError;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Block, Layout, State};
use serde::Serialize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use unmodelled::Thing;

/// Sensitivity of a component of the state to everything that the scenario does not model.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the state, such as `ins.attitude`.
    pub state: String,
    /// Name of the component, such as `yaw`.
    pub component: String,
    /// Unit of the numbers.
    pub unit: &'static str,
    /// 1-sigma at the end of the run.
    pub sigma: f64,
    /// Change by each thing, in the order of [`Sensitivity::things`].
    pub moves: Vec<f64>,
    /// Set if a change is larger than sigma.
    pub exceeds: bool,
}

/// The sensitivities of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Sensitivity {
    /// What the scenario does not model, with its usual size, such as `dvl: bias 1 cm/s`.
    pub things: Vec<String>,
    /// The components of the state.
    pub rows: Vec<Row>,
    /// Set if the runs were interrupted.
    pub interrupted: bool,
}

impl Sensitivity {
    /// Number of components that a thing would move by more than their sigma.
    pub fn exceeding(&self) -> usize {
        self.rows.iter().filter(|row| row.exceeds).count()
    }
}

/// Runs a scenario with each thing that it does not model, and calls `progress` with the number of
/// runs that are done, and of all.
///
/// # Errors
/// When the scenario does not compose, its samples cannot be read, or its own run ends early.
pub fn sensitivity(
    registry: &Registry,
    document: &Document,
    options: &Options,
    stop: &AtomicBool,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<Sensitivity, DiagnoseError> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording = Recording::read(scenario.assemble(None)?)?;
    let composition = scenario.compose()?;
    let things = unmodelled::things(document, &composition);
    let base = ended(composition, &recording, stop)?;
    let runs: Vec<(usize, &String)> = things
        .iter()
        .enumerate()
        .flat_map(|(k, thing)| thing.axes.iter().map(move |setting| (k, setting)))
        .collect();
    let done = AtomicUsize::new(0);
    let moved = parallel::each(runs.len(), options.threads, stop, |at| {
        let (thing, setting) = runs[at];
        let scenario = Scenario::new(registry, document.clone(), std::slice::from_ref(setting));
        let composition = scenario.ok().and_then(|scenario| scenario.compose().ok());
        // a run that ends early shows nothing, as a setting that does not fit
        let other = composition.and_then(|c| ended(c, &recording, stop).ok());
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, runs.len());
        other.map(|other| (thing, base.moved(&other)))
    });
    Ok(base.table(&things, &moved, stop.load(Ordering::Relaxed)))
}

/// The end of a run.
struct Ended {
    layout: Arc<Layout>,
    last: Last,
}

/// Runs the samples with a composition to their end.
fn ended(
    composition: Composition,
    recording: &Recording,
    stop: &AtomicBool,
) -> Result<Ended, RunError> {
    let layout = Arc::clone(&composition.layout);
    let sources = recording.sources(&composition, recording.span().1);
    let sinks = vec![("last".to_owned(), Box::<Last>::default() as _)];
    let mut finished = runner::run(Assembly { composition, sources, sinks }, stop, |_| {});
    let last = finished.take_sink().unwrap_or_default();
    finished.error.map_or(Ok(Ended { layout, last }), Err)
}

impl Ended {
    /// Difference of the estimate of another run, in the units of the table.
    fn moved(&self, other: &Self) -> Vec<f64> {
        let mut delta = vec![0.0; self.layout.tangent];
        if let Some(((before, _), (after, _))) = self.last.0.as_ref().zip(other.last.0.as_ref()) {
            let mut state = before.clone();
            for block in &self.layout.blocks {
                if let Some(same) = other.layout.find(&block.name) {
                    state.values[block.range()].copy_from_slice(&after.values[same.range()]);
                }
            }
            for block in self.uncertain() {
                block.show_error(&state.values, &before.values, &mut delta[block.tangent_range()]);
            }
        }
        delta
    }

    /// The blocks that have an uncertainty.
    fn uncertain(&self) -> impl Iterator<Item = &Block> {
        self.layout.blocks.iter().filter(|block| block.tangent.is_some())
    }

    /// 1-sigma of each error, in the units of the table.
    fn sigmas(&self) -> Vec<f64> {
        let mut sigmas = vec![f64::NAN; self.layout.tangent];
        if let Some((state, covariance)) = &self.last.0 {
            for block in self.uncertain() {
                block.show_sigma(&state.values, covariance, &mut sigmas[block.tangent_range()]);
            }
        }
        sigmas
    }

    /// The table of the changes.
    fn table(
        &self,
        things: &[Thing],
        moved: &[(usize, Vec<f64>)],
        interrupted: bool,
    ) -> Sensitivity {
        let of = |thing: usize| moved.iter().filter(move |(k, _)| *k == thing);
        let size =
            |thing: usize, i: usize| of(thing).map(|(_, d)| d[i].powi(2)).sum::<f64>().sqrt();
        // a thing that does not fit the scenario on every axis has no size
        let ran: Vec<usize> =
            (0..things.len()).filter(|k| of(*k).count() == things[*k].axes.len()).collect();
        let sigmas = self.sigmas();
        let row = |(block, k): (&Block, usize)| {
            let i = block.tangent_range().start + k;
            let moves: Vec<f64> = ran.iter().map(|thing| size(*thing, i)).collect();
            Row {
                state: block.name.clone(),
                component: block.component(k),
                unit: block.spec.display.unit,
                exceeds: moves.iter().any(|moved| *moved > sigmas[i]),
                sigma: sigmas[i],
                moves,
            }
        };
        let components =
            self.uncertain().flat_map(|b| (0..b.operations.tangent).map(move |k| (b, k)));
        let rows = components.map(row).collect();
        let things = ran.iter().map(|k| things[*k].text.clone()).collect();
        Sensitivity { things, rows, interrupted }
    }
}

/// The last estimate of a run.
#[derive(Default)]
struct Last(Option<(State, Covariance)>);

impl Sink for Last {
    fn wants(&self) -> Wants {
        Wants::EPOCHS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Epoch(epoch) = record
            && self.0.as_ref().is_none_or(|(state, _)| state.time <= epoch.state.time)
        {
            self.0 = Some((epoch.state.clone(), epoch.covariance.clone()));
        }
        Ok(())
    }
}
