//! The recipients of a run: its sinks, its statistics and its list of events.

use crate::checkpoint::saved;
use crate::model::record::finding::Finding;
use crate::model::record::verdict::Verdict;
use crate::model::record::{
    Corrected, Derived, Epoch, Event, InputRejection, Level, Observer, Record, Rejection,
    Repetition, UpdateRecord, Wants,
};
use crate::model::stream::{NamedSink, RunInfo, Sink, StreamError};
use crate::session::finished::RunError;
use crate::session::output_rate::OutputRate;
use crate::session::summary::{Recorded, Statistics};
use crate::session::verdict::Judge;
use crate::smooth::Smoother;
use crate::state::covariance::{Transition, Update};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::panic::resume_unwind;

/// Warnings that a run keeps in memory; the sinks receive all of them.
const WARNINGS: usize = 1000;

/// Findings that a run keeps in memory, beside the most severe one of each part.
const FINDINGS: usize = 1000;

/// A sink of the run, open until it fails.
struct Output {
    name: String,
    sink: Box<dyn Sink>,
    /// The records that the sink receives.
    wants: Wants,
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

saved!(Outputs {
    statistics, rate, recorded, judge, events, findings,
} except {
    sinks, smoother, repeating,
});

impl Outputs {
    pub(crate) fn new(
        sinks: Vec<NamedSink>,
        statistics: Statistics,
        rate: OutputRate,
        judge: Judge,
    ) -> Self {
        let output =
            |(name, sink): NamedSink| Output { wants: sink.wants(), name, sink, open: true };
        let sinks = sinks.into_iter().map(output);
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

    /// Passes on an estimate that the output rate asks for, unless the sinks have received it.
    pub(crate) fn record(&mut self, epoch: &Epoch<'_>) {
        let time = epoch.state.time;
        if self.recorded == Some(time) {
            return;
        }
        // the statistics and the sinks that compare may have received it with its truth
        let compared = self.statistics.last_epoch == Some(time);
        if !compared {
            self.judge.epoch(epoch);
            self.statistics.epoch(epoch);
        }
        if let Some(smoother) = &mut self.smoother {
            smoother.epoch_between(time);
        }
        self.show(epoch, |wants| !(compared && wants.contains(Wants::COMPARISONS)));
        self.recorded = Some(time);
    }

    /// Passes the filter's estimate on to some sinks.
    fn show(&mut self, epoch: &Epoch<'_>, to: impl Fn(Wants) -> bool) {
        let record = match self.smoother {
            Some(_) => Record::Filtered(epoch),
            None => Record::Epoch(epoch),
        };
        self.send_to(epoch.state.time, &record, to);
        self.derive(false);
    }

    /// Passes on what the sinks derive from the records so far.
    fn derive(&mut self, end: bool) {
        if !self.want(Wants::DERIVED) {
            return;
        }
        let open = self.sinks.iter_mut().filter(|o| o.open);
        let derived: Vec<Derived> = open.filter_map(|o| o.sink.derive(end)).collect();
        derived.iter().for_each(|derived| self.send(derived.time, &Record::Derived(derived)));
    }

    /// Passes a smoothed estimate on.
    pub(crate) fn smoothed(&mut self, epoch: &Epoch<'_>) {
        self.statistics.smoothed(epoch);
        self.send(epoch.state.time, &Record::Epoch(epoch));
    }

    /// Starts every sink.
    pub(crate) fn start(&mut self, run: &RunInfo) {
        self.each(Time::MIN, |output| output.sink.start(run));
    }

    /// Asks every sink to begin a new file.
    pub(crate) fn reopen(&mut self, time: Time) {
        self.each(time, |output| output.sink.reopen());
    }

    /// Passes a record on to every sink that wants its kind.
    pub(crate) fn send(&mut self, time: Time, record: &Record<'_>) {
        self.send_to(time, record, |_| true);
    }

    /// Passes a record on to the sinks that want its kind, and whose other wants suit.
    fn send_to(&mut self, time: Time, record: &Record<'_>, suit: impl Fn(Wants) -> bool) {
        let kind = record.kind();
        self.each(time, |output| match output.wants.contains(kind) && suit(output.wants) {
            true => output.sink.take(record),
            false => Ok(()),
        });
    }

    /// Calls every open sink. A sink that fails is closed and named in an error event.
    fn each(&mut self, time: Time, mut call: impl FnMut(&mut Output) -> Result<(), StreamError>) {
        let mut failed = Vec::new();
        for output in self.sinks.iter_mut().filter(|o| o.open) {
            if let Err(error) = call(output) {
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

    /// Passes a map of the error on, in a repetition only to the sinks that follow it.
    fn follow(&mut self, record: &Record<'_>) {
        let repeating = self.repeating;
        let follows = |wants: Wants| !repeating || wants.contains(Wants::REPETITIONS);
        self.send_to(Time::MIN, record, follows);
    }

    /// Returns `true` if an open sink wants these records.
    pub(crate) fn want(&self, kind: Wants) -> bool {
        self.sinks.iter().any(|o| o.open && o.wants.contains(kind))
    }

    /// Judges the run, which an `error` ended early, and passes the verdict on to the sinks.
    pub(crate) fn verdict(&mut self, time: Time, error: Option<&RunError>) -> Verdict {
        self.derive(true);
        let (compared, end) = (self.statistics.compared(), self.statistics.last_epoch());
        let verdict = self.judge.verdict(&self.findings, error, compared, end);
        self.send(time, &Record::Verdict(&verdict));
        verdict
    }

    /// Judges the run so far.
    pub(crate) fn health(&self) -> Verdict {
        let (compared, end) = (self.statistics.compared(), self.statistics.last_epoch());
        self.judge.clone().verdict(&self.findings, None, compared, end)
    }

    /// Passes on the fixed blocks that are estimated, closes the open sinks, all at the same time, and
    /// returns the places that they wrote to.
    pub(crate) fn close(&mut self, time: Time, corrected: &[Corrected]) -> Vec<Recorded> {
        let derived = corrected.iter().map(|corrected| corrected.derived(time));
        derived.for_each(|derived| self.send(time, &Record::Derived(&derived)));
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

    /// Keeps a warning or an error for the end of the run: there may be very many warnings; errors are
    /// few and always kept.
    fn keep_event(&mut self, event: Event) {
        if event.level == Level::Error
            || (event.level == Level::Warning && self.events.len() < WARNINGS)
        {
            self.events.push(event);
        }
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
        self.judge.epoch(epoch);
        self.statistics.epoch(epoch);
        let all = self.rate.records_comparison(time);
        if let Some(smoother) = &mut self.smoother {
            smoother.epoch(time, all);
        }
        self.show(epoch, |wants| all || wants.contains(Wants::COMPARISONS));
        if all {
            self.recorded = Some(time);
        }
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.statistics.update(update);
        self.judge.update(update);
        self.send(update.time, &Record::Update(update));
    }
    fn transition(&mut self, transition: &Transition) {
        if let Some(smoother) = &mut self.smoother {
            smoother.transition(transition);
        }
        self.follow(&Record::Transition(transition));
    }
    fn correction(&mut self, update: &Update) {
        if !self.repeating {
            self.judge.correction(update);
        }
        if let Some(smoother) = &mut self.smoother {
            smoother.correction(update);
        }
        self.follow(&Record::Correction(update));
    }
    fn repetition(&mut self, repetition: Repetition<'_>) {
        self.repeating = repetition == Repetition::Begins;
        self.send(Time::MIN, &Record::Repetition(repetition));
    }
    fn gated(&mut self, update: &Update) {
        if let Some(smoother) = &mut self.smoother {
            smoother.gated(update);
        }
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.statistics.input(sample, rejected);
        if let Some(reason) = rejected {
            let (time, sensor) = (sample.time, sample.sensor);
            let rejection = InputRejection { time, sensor, reason };
            self.send(time, &Record::InputRejection(&rejection));
        }
    }
    fn event(&mut self, event: Event) {
        self.send(event.time, &Record::Event(&event));
        self.keep_event(event);
    }
    fn finding(&mut self, finding: Finding) {
        self.send(finding.time, &Record::Finding(&finding));
        self.keep_event(finding.event());
        keep(&mut self.findings, finding);
    }
}

/// Keeps a finding: one of the first [`FINDINGS`], or a later one that is more severe than all
/// others of its part, since the verdict rests on the most severe finding of each part.
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
