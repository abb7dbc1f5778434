//! A run compared with its truth.

use navfuse_core::model::record::{Epoch, Outcome, Record, UpdateRecord};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::session::Finished;
use navfuse_core::state::manifold::MAX_TANGENT;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// Largest errors of a run in units of their sigma, by the name of the component.
#[derive(Default)]
pub struct Errors {
    /// Over the whole run.
    pub worst: BTreeMap<String, (f64, f64)>,
    /// At the end.
    pub last: BTreeMap<String, f64>,
    /// Outcomes of each sensor: accepted, gated, rejected by reason.
    pub outcomes: BTreeMap<String, u64>,
    names: Vec<String>,
}

impl Errors {
    /// Largest ratio over the run, with its component.
    pub fn largest(&self) -> (f64, String) {
        let of = self.worst.iter().map(|(name, (ratio, at))| (*ratio, format!("{name} at {at} s")));
        of.fold((0.0, String::new()), |a, b| if b.0 > a.0 { b } else { a })
    }

    /// Largest ratio at the end, with its component.
    pub fn final_largest(&self) -> (f64, String) {
        let of = self.last.iter().map(|(name, ratio)| (*ratio, name.clone()));
        of.fold((0.0, String::new()), |a, b| if b.0 > a.0 { b } else { a })
    }
}

impl Sink for Errors {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.names = run.sensors.iter().map(|s| s.name.clone()).collect();
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Update(update) => self.update(update),
            _ => Ok(()),
        }
    }
}

impl Errors {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let Some(truth) = epoch.truth else { return Ok(()) };
        let time = epoch.state.time.seconds();
        for (slot, block) in epoch.layout.blocks.iter().enumerate() {
            if !truth.known[slot] || block.tangent.is_none() {
                continue;
            }
            let (mut error, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
            block.show_error(&epoch.state.values, &truth.state.values, &mut error);
            for k in 0..block.operations.tangent {
                let (ratio, name) = ((error[k] / sigma[k]).abs(), format!("{}[{k}]", block.name));
                let worst = self.worst.entry(name.clone()).or_default();
                if ratio > worst.0 {
                    *worst = (ratio, time);
                }
                self.last.insert(name, ratio);
            }
        }
        Ok(())
    }
    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let outcome = match update.outcome {
            Outcome::Accepted => "accepted".to_owned(),
            Outcome::Placed => "placed".to_owned(),
            Outcome::Gated => "gated".to_owned(),
            Outcome::Rejected(why) => format!("{why:?}"),
        };
        let key = format!("{} {outcome}", self.names[update.sensor.0]);
        *self.outcomes.entry(key).or_default() += 1;
        Ok(())
    }
}

/// A run that ended, with its errors.
pub struct Trial {
    pub errors: Errors,
    pub finished: Finished,
}

/// Runs a scenario.
pub fn run(text: &str, settings: &[&str]) -> Trial {
    let mut assembly = navfuse_testing::scenario(text, settings, |scenario| {
        scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"))
    });
    assembly.sinks.push(("errors".into(), Box::new(Errors::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let errors = finished.take_sink::<Errors>().unwrap();
    Trial { errors, finished }
}
