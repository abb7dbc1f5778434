//! Steps of a filter, one by one, for tests that measure each of them.

use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Event, Observer, Outcome, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// Counts what a filter reports.
#[derive(Debug, Default)]
struct Counter {
    accepted: usize,
    reports: usize,
}

impl Observer for Counter {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.accepted += usize::from(update.outcome == Outcome::Accepted);
    }
    fn event(&mut self, _: Event) {
        self.reports += 1;
    }
    fn finding(&mut self, _: Finding) {
        self.reports += 1;
    }
}

/// Allocations of a run after `warm` seconds.
#[derive(Debug, Default)]
pub struct Allocations {
    /// Steps without an event, and their allocations.
    pub silent: (usize, u64),
    /// Number of steps with an event, whose text is allocated.
    pub reporting: usize,
    /// Number of accepted samples in all these steps.
    pub accepted: usize,
}

/// Runs a scenario step by step; `measure` runs a step and returns its number of allocations.
pub fn allocations(
    registry: &Registry,
    text: &str,
    warm: f64,
    measure: impl Fn(&mut dyn FnMut()) -> u64,
) -> Allocations {
    let document = Document::parse("scenario.toml", text).unwrap();
    let scenario = Scenario::new(registry, document, &[]).unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let mut samples = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() {
            samples.push(sample);
        }
    }
    let sensors = &assembly.composition.sensors;
    let reference = |s: &Sample| matches!(sensors[s.sensor.0].role, Role::Reference(_));
    samples.sort_by_key(|s| (s.time, reference(s)));
    let mut ekf = Ekf::new(assembly.composition);
    let (mut counter, mut found) = (Counter::default(), Allocations::default());
    for sample in &samples {
        let (reports, accepted) = (counter.reports, counter.accepted);
        let count = measure(&mut || ekf.process(sample, &mut counter).unwrap());
        if sample.time.seconds() < warm {
            continue;
        }
        found.accepted += counter.accepted - accepted;
        if counter.reports > reports {
            found.reporting += 1;
        } else {
            found.silent = (found.silent.0 + 1, found.silent.1 + count);
        }
    }
    found
}
