//! The recipients of a run: its sinks, its statistics and its list of events.

use crate::model::record::finding::Finding;
use crate::model::record::verdict::Verdict;
use crate::model::record::{Epoch, Event, Level, Observer, Rejection, Repetition, UpdateRecord};
use crate::model::stream::{NamedSink, Sink, StreamError};
use crate::run::output_rate::OutputRate;
use crate::run::summary::{Recorded, Statistics};
use crate::run::verdict::Judge;
use crate::smooth::Smoother;
use crate::state::covariance::{Transition, Update};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::panic::resume_unwind;

/// Warnings that a run keeps in memory; the sinks receive all of them.
const WARNINGS: usize = 1000;

/// Findings that a run keeps in memory, beside the heaviest one of each part.
const FINDINGS: usize = 1000;

/// A sink of the run, open until it fails.
struct Output {
    name: String,
    sink: Box<dyn Sink>,
    open: bool,
}

/// Passes everything that happens in a run on to its statistics and its sinks.
pub(crate) struct Outputs {
    sinks: Vec<Output>,
    pub(crate) statistics: Statistics,
    pub(crate) rate: OutputRate,
    /// Time of the last estimate that all sinks received.
    recorded: Option<Time>,
    pub(crate) judge: Judge,
    /// Smoother of a run that is smoothed.
    pub(crate) smoother: Option<Smoother>,
    /// Set while a filter takes its samples again.
    repeating: bool,
    pub(crate) events: Vec<Event>,
    /// Faults that the filter found: see [`keep`].
    pub(crate) findings: Vec<Finding>,
}

impl Outputs {
    pub(crate) fn new(
        sinks: Vec<NamedSink>,
        statistics: Statistics,
        rate: OutputRate,
        judge: Judge,
    ) -> Self {
        let sinks = sinks.into_iter().map(|(name, sink)| Output { name, sink, open: true });
        Self {
            sinks: sinks.collect(),
            statistics,
            rate,
            judge,
            smoother: None,
            repeating: false,
            recorded: None,
            events: Vec::new(),
            findings: Vec::new(),
        }
    }

    /// Passes an estimate on that the output rate asks for, unless the sinks have received it.
    pub(crate) fn record(&mut self, epoch: &Epoch<'_>) {
        let time = epoch.state.time;
        if self.recorded == Some(time) {
            return;
        }
        // the statistics and the sinks that compare may have received it with its truth
        let compared = self.statistics.last_epoch == Some(time);
        if !compared {
            self.statistics.epoch(epoch);
        }
        if let Some(smoother) = &mut self.smoother {
            smoother.epoch_between(time);
        }
        self.show(epoch, |sink| !(compared && sink.compares()));
        self.recorded = Some(time);
    }

    /// Passes the filter's estimate on to some sinks.
    fn show(&mut self, epoch: &Epoch<'_>, to: impl Fn(&dyn Sink) -> bool) {
        let smooths = self.smoother.is_some();
        self.each(epoch.state.time, |sink| match smooths {
            _ if !to(sink) => Ok(()),
            true => sink.filtered(epoch),
            false => sink.epoch(epoch),
        });
    }

    /// Passes a smoothed estimate on.
    pub(crate) fn smoothed(&mut self, epoch: &Epoch<'_>) {
        self.statistics.smoothed(epoch);
        self.each(epoch.state.time, |sink| sink.epoch(epoch));
    }

    /// Calls every open sink. A sink that fails is closed and named in an error event.
    pub(crate) fn each(
        &mut self,
        time: Time,
        mut call: impl FnMut(&mut dyn Sink) -> Result<(), StreamError>,
    ) {
        let mut failed = Vec::new();
        for output in self.sinks.iter_mut().filter(|o| o.open) {
            if let Err(error) = call(output.sink.as_mut()) {
                // the sink may still save what it has; a second failure adds nothing to the first
                output.sink.finish().ok();
                output.open = false;
                failed.push((output.name.clone(), error));
            }
        }
        for (about, error) in failed {
            let text = format!("{error}; the run goes on without this sink");
            self.event(Event { time, level: Level::Error, about, text });
        }
    }

    /// Passes a map of the error on; that of a repetition only to the sinks that follow it.
    fn follow(&mut self, mut call: impl FnMut(&mut dyn Sink) -> Result<(), StreamError>) {
        let repeating = self.repeating;
        self.each(Time::MIN, |sink| match repeating && !sink.repeats() {
            true => Ok(()),
            false => call(sink),
        });
    }

    /// Returns `true` if an open sink wants the newest estimates.
    pub(crate) fn wants_newest(&self) -> bool {
        self.sinks.iter().any(|o| o.open && o.sink.wants_newest())
    }

    /// Judges the run, which the error ended early, and passes the verdict on to the sinks.
    pub(crate) fn verdict(&mut self, time: Time, error: Option<String>) -> Verdict {
        let verdict = self.judge.verdict(&self.findings, error);
        self.each(time, |sink| sink.verdict(&verdict));
        verdict
    }

    /// Closes the open sinks, all at the same time, and returns the places that they wrote to.
    pub(crate) fn close(&mut self, time: Time) -> Vec<Recorded> {
        let mut recorded = Vec::new();
        let open: Vec<&mut Output> = self.sinks.iter_mut().filter(|o| o.open).collect();
        for (sink, finished) in finish(open) {
            match finished {
                Ok(place) => recorded.extend(place.map(|place| Recorded { sink, place })),
                Err(error) => {
                    let (level, text) = (Level::Error, error.to_string());
                    self.events.push(Event { time, level, about: sink, text });
                }
            }
        }
        recorded
    }

    /// The events, and the sinks with their names.
    pub(crate) fn into_parts(self) -> (Vec<Event>, Vec<NamedSink>) {
        (self.events, self.sinks.into_iter().map(|o| (o.name, o.sink)).collect())
    }
}

/// The name of a sink, and the place that it wrote to.
type Closed = (String, Result<Option<String>, StreamError>);

/// Completes sinks, each in a thread of its own where there are several: one compresses while
/// another waits for the disk.
fn finish(sinks: Vec<&mut Output>) -> Vec<Closed> {
    let close = |output: &mut Output| {
        output.open = false;
        (output.name.clone(), output.sink.finish())
    };
    if sinks.len() < 2 {
        return sinks.into_iter().map(close).collect();
    }
    std::thread::scope(|scope| {
        let threads: Vec<_> =
            sinks.into_iter().map(|output| scope.spawn(move || close(output))).collect();
        // a sink that panics ends the run, as it would without a thread
        threads.into_iter().map(|t| t.join().unwrap_or_else(|p| resume_unwind(p))).collect()
    })
}

impl Observer for Outputs {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        let time = epoch.state.time;
        self.statistics.epoch(epoch);
        let all = self.rate.records_comparison(time);
        if let Some(smoother) = &mut self.smoother {
            smoother.epoch(time, all);
        }
        self.show(epoch, |sink| all || sink.compares());
        if all {
            self.recorded = Some(time);
        }
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.statistics.update(update);
        self.judge.update(update);
        self.each(update.time, |sink| sink.update(update));
    }
    fn transition(&mut self, transition: &Transition) {
        if let Some(smoother) = &mut self.smoother {
            smoother.transition(transition);
        }
        self.follow(|sink| sink.transition(transition));
    }
    fn correction(&mut self, update: &Update) {
        if !self.repeating {
            self.judge.correction(update);
        }
        if let Some(smoother) = &mut self.smoother {
            smoother.correction(update);
        }
        self.follow(|sink| sink.correction(update));
    }
    fn repetition(&mut self, repetition: Repetition<'_>) {
        self.repeating = repetition == Repetition::Begins;
        self.each(Time::MIN, |sink| sink.repetition(repetition));
    }
    fn gated(&mut self, update: &Update) {
        if let Some(smoother) = &mut self.smoother {
            smoother.gated(update);
        }
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.statistics.input(sample, rejected);
    }
    fn event(&mut self, event: Event) {
        self.each(event.time, |sink| sink.event(&event));
        // there may be very many warnings; errors are few and always kept
        if event.level == Level::Error
            || (event.level == Level::Warning && self.events.len() < WARNINGS)
        {
            self.events.push(event);
        }
    }
    fn finding(&mut self, finding: Finding) {
        let Finding { time, about, text, remedy, .. } = finding.clone();
        self.event(Event { time, level: Level::Warning, about, text: format!("{text}; {remedy}") });
        keep(&mut self.findings, finding);
    }
}

/// Keeps a finding: one of the first [`FINDINGS`], or a later one that is heavier than all of its
/// part, since the verdict rests on the heaviest finding of each part.
fn keep(findings: &mut Vec<Finding>, finding: Finding) {
    let outweighed = |f: &Finding| f.about == finding.about && f.weight() >= finding.weight();
    if findings.len() < FINDINGS || !findings.iter().any(outweighed) {
        findings.push(finding);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::record::finding::{Basis, Severity};

    /// A fault that is found after very many others decides the verdict as well.
    #[test]
    fn the_heaviest_finding_of_each_part_is_kept_however_many_came_before() {
        let finding = |about: &str, severity| Finding {
            time: Time::MIN,
            about: about.to_owned(),
            severity,
            basis: Basis::Comparison,
            text: String::new(),
            remedy: String::new(),
        };
        let mut findings = Vec::new();
        for _ in 0..10 * FINDINGS {
            keep(&mut findings, finding("dvl", Severity::Doubtful));
        }
        assert_eq!(findings.len(), FINDINGS);
        for _ in 0..2 {
            keep(&mut findings, finding("dvl", Severity::DoNotUse));
            keep(&mut findings, finding("depth", Severity::DoNotUse));
        }
        let late: Vec<&str> = findings[FINDINGS..].iter().map(|f| f.about.as_str()).collect();
        assert_eq!(late, ["dvl", "depth"]);
    }
}
