//! The judge of a run: criteria that need no truth, so that recordings are judged like simulations.
//!
//! All tests of a run share one probability of a false alarm (Bonferroni). The page "The verdict of
//! a run" of the book derives the thresholds.

mod channel;
mod innovations;
mod linearisation;
mod nis;
mod reference;
mod report;
mod states;

use crate::checkpoint::{Io, Saved};
use crate::compose::{Composition, moved};
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::verdict::{Criterion, Reason, Verdict};
use crate::model::record::{Epoch, Outcome, UpdateRecord};
use crate::model::sensor::{Purpose, SensorInfo};
use crate::session::comparison::Compared;
use crate::session::finished::RunError;
use crate::state::Mode;
use crate::state::covariance::Update;
use crate::units::sample::Channel;
use crate::units::time::Time;
use innovations::SensorStatistics;
use linearisation::{WidePrior, wide_priors};
use reference::ReferenceStatistics;
pub(crate) use reference::accuracy;
use report::{FALSE_ALARM, Report, reason};
use states::StateStatistics;

/// Follows a run and judges it at its end. The memory does not grow with the run.
#[derive(Clone, Debug)]
pub(crate) struct Judge {
    infos: Vec<SensorInfo>,
    /// Statistics of the measuring sensors, one place per sensor.
    sensors: Vec<Option<SensorStatistics>>,
    states: StateStatistics,
    /// Set if no block is considered: the gain is then optimal, and the innovations of a consistent
    /// filter are white.
    white: bool,
    /// Sensor of the last accepted sample, whose correction follows.
    last: usize,
    /// Priors that are too wide.
    wide: Vec<WidePrior>,
    reference: Option<ReferenceStatistics>,
    /// Reasons that are known before the end.
    reasons: Vec<Reason>,
}

// the reasons before the end are those of a build
impl Saved for Judge {
    fn saved(&mut self, io: &mut Io<'_>) {
        let Self { infos: _, sensors, states, white: _, last, wide, reference: _, reasons: _ } =
            self;
        sensors.iter_mut().for_each(|sensor| io.each(sensor));
        io.pass(states);
        io.pass(last);
        io.each(wide);
    }
}

impl Judge {
    pub(crate) fn new(composition: &Composition) -> Self {
        let layout = &composition.layout;
        let moved = moved(layout, &composition.processes);
        let white = layout.blocks.iter().all(|b| b.spec.mode != Mode::Consider);
        let statistics = |s: &crate::model::sensor::Sensor| {
            (s.info.purpose == Purpose::Measurement).then(|| {
                let channels = s.info.channels.iter().map(Channel::words).collect();
                SensorStatistics::new(s.info.name.clone(), channels, s.constraint)
            })
        };
        let sensors: Vec<_> = composition.sensors.iter().map(statistics).collect();
        Self {
            infos: composition.sensors.iter().map(|s| s.info.clone()).collect(),
            states: StateStatistics::new(layout, &moved, white, sensors.len()),
            sensors,
            white,
            last: 0,
            wide: wide_priors(composition, &moved),
            reference: ReferenceStatistics::new(composition),
            reasons: Vec::new(),
        }
    }

    /// Takes the outcome of a sample.
    pub(crate) fn update(&mut self, update: &UpdateRecord<'_>) {
        if update.outcome == Outcome::Accepted {
            self.last = update.sensor.0;
        }
        if let Some(sensor) = &mut self.sensors[update.sensor.0] {
            sensor.update(update);
        }
    }

    /// Takes the correction by the sample that [`Self::update`] took last.
    pub(crate) fn correction(&mut self, update: &Update) {
        self.states.correction(self.last, update);
    }

    /// Takes an estimate.
    pub(crate) fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.wide.iter_mut().for_each(|prior| prior.epoch(epoch));
    }

    /// Takes an initial alignment that is incomplete after the last sample.
    pub(crate) fn unfinished(&mut self, process: &str, text: &str) {
        self.reasons.push(reason(
            Criterion::Alignment,
            Severity::Doubtful,
            process,
            text.to_owned(),
            "",
        ));
    }

    /// Puts the driving sensor first if it was found useless and several sensors contradict the
    /// filter: its fault explains all contradictions, the fault of another sensor only one.
    fn blame_the_driver(&self, reasons: &mut [Reason]) {
        let drives = |r: &Reason| {
            let drivers = self.infos.iter().filter(|info| info.purpose == Purpose::Input);
            names_the_fault(r) && drivers.into_iter().any(|info| info.name == r.about)
        };
        let useless = reasons.iter().filter(|r| names_the_fault(r)).count();
        if let Some(at) = reasons.iter().position(drives).filter(|_| useless > 2) {
            reasons[..=at].rotate_right(1);
        }
    }

    /// Name of the only sensor of which nearly all samples were refused.
    fn the_refused_sensor(&self) -> Option<&str> {
        let mut refused = self.sensors.iter().flatten().filter(|s| s.is_refused());
        refused.next().filter(|_| refused.next().is_none()).map(SensorStatistics::name)
    }

    /// Name of the driving sensor, if there is one.
    fn driver(&self) -> Option<&str> {
        let mut drivers = self.infos.iter().filter(|info| info.purpose == Purpose::Input);
        drivers.next().map(|info| info.name.as_str())
    }

    /// Judges the run, with the findings of the filter, the error that ended it, and the comparisons
    /// with the reference.
    pub(crate) fn verdict(
        &mut self,
        findings: &[Finding],
        error: Option<&RunError>,
        references: &[Compared],
        end: Option<Time>,
    ) -> Verdict {
        let mut report = Report::default();
        let driver = self.driver().map(str::to_owned);
        let driver = driver.as_deref();
        let findings = &superseded(findings)[..];
        let parts = of_each_part(findings);
        let found_of = |basis: Basis| {
            let findings = parts.iter().filter(move |f| f.basis == basis);
            findings.map(move |finding| found(finding, driver))
        };
        let mut contradict_physics: Vec<Reason> = found_of(Basis::Samples).collect();
        // a finding about one part says more than one about either of two
        contradict_physics.sort_by_key(|reason| reason.about.contains(", "));
        // a driving sensor that is useless moves the estimate, so that healthy sensors seem to have errors
        let of_the_driver = |about: &str| driver == Some(about);
        let misled = (contradict_physics.iter())
            .any(|reason| names_the_fault(reason) && of_the_driver(&reason.about));
        report.reasons.append(&mut contradict_physics);
        let explanations = (parts.iter().filter(|f| f.basis == Basis::Explanation))
            .filter(|f| !misled || of_the_driver(&f.about));
        let refused = self.the_refused_sensor();
        let (late, mut timely): (Vec<&Finding>, Vec<&Finding>) =
            explanations.copied().partition(|explanation| {
                misses(explanation, refused, findings) || is_refuted(explanation, findings)
            });
        // an error that goes on makes the filter contradict healthy sensors too, later
        timely.sort_by_key(|explanation| explanation.time);
        report.reasons.extend(timely.into_iter().map(|f| found(f, driver)));
        report.reasons.extend(error.map(|error| {
            let about = driver.filter(|_| error.is_of_the_input()).unwrap_or("run");
            let text = format!("the run ended early: {error}");
            reason(Criterion::Ended, Severity::DoNotUse, about, text, "")
        }));
        let explained = report.reasons.iter().any(names_the_fault);
        if !explained {
            let mut compared: Vec<Reason> = found_of(Basis::Comparison).collect();
            self.blame_the_driver(&mut compared);
            report.reasons.append(&mut compared);
            report.reasons.extend(found_of(Basis::Silence));
        }
        report.reasons.extend(late.into_iter().map(|f| found(f, driver)));
        report.reasons.extend(self.wide.iter().map(|prior| prior.reason().clone()));
        report.reasons.append(&mut self.reasons);
        let sensors = || self.sensors.iter().flatten();
        let tests = sensors().map(|s| s.tests(self.white)).sum::<usize>() + self.states.tests();
        let alpha = FALSE_ALARM / tests.max(1) as f64;
        self.states.judge(alpha, &self.infos, &mut report);
        for sensor in self.sensors.iter_mut().flatten() {
            sensor.finish();
            sensor.judge(alpha, self.white, &mut report);
        }
        if let Some((reference, end)) = self.reference.as_ref().zip(end) {
            reference.judge(alpha, references, end, &mut report);
        }
        report.reasons.retain(|reason| !(explained && reason.criterion.compares()));
        contain(&mut report.reasons, findings);
        keep_noise(&mut report.reasons);
        self.wide.iter().for_each(|prior| prior.acquit(&mut report.reasons));
        Verdict::new(report.reasons, report.sensors)
    }
}

/// True for a fault of a part that makes the result useless: comparisons of sensors then contradict
/// the filter too, and name healthy sensors.
fn names_the_fault(reason: &Reason) -> bool {
    (reason.criterion, reason.severity) == (Criterion::Finding, Severity::DoNotUse)
}

/// True for an error of another part than a sensor that the filter refused from a contradiction before it nearly to the
/// end: whatever was found without that sensor does not explain what it contradicted.
fn misses(explanation: &Finding, refused: Option<&str>, findings: &[Finding]) -> bool {
    let contradicted = |before: &&Finding| {
        (before.basis, before.severity) == (Basis::Comparison, Severity::DoNotUse)
            && before.time < explanation.time
            && Some(before.about.as_str()) == refused
    };
    refused.is_some_and(|sensor| sensor != explanation.about)
        && findings.iter().any(|before| contradicted(&before))
}

/// True for an error of another part than a sensor that the evidence was against before, and that the filter
/// loses again after the explanation: an error that is contained ends the contradiction.
fn is_refuted(explanation: &Finding, findings: &[Finding]) -> bool {
    let compared = |severity: Severity| {
        let other = move |f: &&Finding| {
            (f.basis, f.severity) == (Basis::Comparison, severity) && f.about != explanation.about
        };
        findings.iter().filter(other)
    };
    let lost = |sensor: &str| {
        compared(Severity::DoNotUse).any(|f| f.about == sensor && f.time > explanation.time)
    };
    compared(Severity::Contained).any(|f| f.time < explanation.time && lost(&f.about))
}

/// The findings, without the doubt that an error of one sensor cast on others before it was explained and
/// contained: a noise that is stated too small moves the estimate as a fault of another sensor would.
fn superseded(findings: &[Finding]) -> Vec<Finding> {
    let explains = |later: &Finding, doubt: &Finding| {
        (later.basis, later.severity) == (Basis::Explanation, Severity::Contained)
            && later.about != doubt.about
            && later.time >= doubt.time
    };
    let mut all = findings.to_vec();
    let doubts =
        |f: &&mut Finding| (f.basis, f.severity) == (Basis::Comparison, Severity::Doubtful);
    for doubt in all.iter_mut().filter(doubts) {
        if findings.iter().any(|later| explains(later, doubt)) {
            doubt.severity = Severity::Contained;
        }
    }
    all
}

/// Counts gated or rejected samples as part of a fault of their sensor that was found and
/// contained, or of its silence.
fn contain(reasons: &mut [Reason], findings: &[Finding]) {
    let contained = (reasons.iter())
        .filter(|r| (r.criterion, r.severity) == (Criterion::Finding, Severity::Contained));
    let silent = findings.iter().filter(|finding| finding.basis == Basis::Silence);
    let faults = contained.map(|r| r.about.clone()).chain(silent.map(|f| f.about.clone()));
    let faults: Vec<String> = faults.collect();
    let of_fault = |r: &&mut Reason| {
        matches!(r.criterion, Criterion::Gated | Criterion::Rejected) && faults.contains(&r.about)
    };
    for reason in reasons.iter_mut().filter(of_fault) {
        reason.severity = reason.severity.min(Severity::Contained);
    }
}

/// Changes the remedy of a stated noise that is too large where successive innovations share an error:
/// less noise would follow this error more closely.
fn keep_noise(reasons: &mut [Reason]) {
    let slow = |r: &&Reason| {
        let shared = matches!(r.criterion, Criterion::Correlation | Criterion::Drift);
        shared && r.severity > Severity::Note
    };
    let slow: Vec<String> = reasons.iter().filter(slow).map(|r| r.about.clone()).collect();
    let quiet = |r: &&mut Reason| r.is_safe() && slow.contains(&r.about);
    for reason in reasons.iter_mut().filter(quiet) {
        reason.remedy =
            "do not lower its stated noise: its samples share a slow error, which scatters \
                         little from sample to sample"
                .to_owned();
    }
}

/// The most severe finding of each sensor or process; among equals the most specific one (see
/// [`Basis`]), and then the first: a fault may return.
fn of_each_part(findings: &[Finding]) -> Vec<&Finding> {
    let mut found: Vec<&Finding> = Vec::new();
    for finding in findings {
        match found.iter_mut().find(|before| before.about == finding.about) {
            Some(before) if before.weight() >= finding.weight() => {}
            Some(before) => *before = finding,
            None => found.push(finding),
        }
    }
    found
}

/// Reason of a finding. In a silence of its sensor the driving one carried the state.
fn found(finding: &Finding, driver: Option<&str>) -> Reason {
    let Finding { time, about, severity, basis, text, remedy } = finding;
    let (criterion, about) = match basis {
        Basis::Silence => (Criterion::Silence, driver.unwrap_or(about)),
        _ => (Criterion::Finding, about.as_str()),
    };
    reason(criterion, *severity, about, format!("at {time}: {text}"), remedy)
}

#[cfg(test)]
mod tests;
