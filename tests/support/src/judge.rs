//! A sink that judges the estimate by the truth.

use navfuse_core::document::Document;
use navfuse_core::model::record::{Epoch, Event, Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use std::sync::atomic::AtomicBool;

/// Errors and innovations of a run.
#[derive(Debug, Default)]
pub struct Judge {
    /// Normalised estimation error squared of the last epoch, over the states with a truth; NaN if
    /// their covariance is not positive definite.
    pub nees: f64,
    /// Number of these states.
    pub freedom: usize,
    /// Time of the last epoch, s.
    pub last: f64,
    /// Time, s, and NIS of each update; NaN where there is none.
    pub nis: Vec<(f64, f64)>,
    /// Number of samples that were not used.
    pub refused: usize,
    /// Texts of all events.
    pub events: Vec<String>,
    /// Truth of the first value at each epoch.
    pub truths: Vec<f64>,
}

impl Sink for Judge {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::UPDATES | Wants::EVENTS | Wants::FINDINGS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Update(update) => self.update(update),
            Record::Event(event) => self.event(event),
            Record::Finding(finding) => self.event(&finding.event()),
            _ => Ok(()),
        }
    }
}

impl Judge {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let Some(truth) = epoch.truth else { return Ok(()) };
        let (layout, n) = (epoch.layout, epoch.layout.tangent);
        let mut error = vec![0.0; n];
        layout.error(truth.state, epoch.state, truth.known, &mut error);
        let known = layout.blocks.iter().zip(truth.known).filter(|(_, known)| **known);
        let rows: Vec<usize> = known.flat_map(|(block, _)| block.tangent_range()).collect();
        self.nees = epoch.covariance.nees(&error, &rows).unwrap_or(f64::NAN);
        (self.freedom, self.last) = (rows.len(), epoch.state.time.seconds());
        self.truths.push(truth.state.values[0]);
        Ok(())
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        self.nis.push((update.time.seconds(), update.nis));
        self.refused += usize::from(update.outcome != Outcome::Accepted);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        self.events.push(event.text.clone());
        Ok(())
    }
}

/// Runs a scenario under the eyes of a judge.
pub fn judged(registry: &Registry, text: &str, settings: &[String]) -> (Finished, Judge) {
    let document = Document::parse("scenario.toml", text).unwrap();
    let scenario = Scenario::new(registry, document, settings).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("judge".into(), Box::new(Judge::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    let judge = finished.take_sink().unwrap();
    (finished, judge)
}
