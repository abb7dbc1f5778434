//! The samples since the start of a filter, and the passes over them.
//!
//! Passes take whole steps from the trajectory of the filter, then from that of a run without one, and
//! then short steps, which stay where the linear model holds.

use super::super::again::repeat_from;
use super::super::change::Change;
use super::super::means::{Points, Records};
use super::super::recording::{Pass, Recording};
use super::super::watch::{self, Due, Watch};
use crate::compose::estimator::Linearised;
use crate::compose::snapshot::Snapshot;
use crate::model::record::finding::{Basis, Finding};
use crate::model::record::{Observer, Repetition};
use crate::units::sample::Sample;
use crate::units::time::Span;
use std::sync::Arc;

/// Largest number of passes at one time.
const PASSES: u32 = 12;

/// Largest change of the estimate by a pass, in its sigma, at which the passes have converged, and
/// that at the last time. The error of the trajectory counts in the second order alone, and the next
/// time takes the same samples again.
pub(super) const CONVERGED: f64 = 0.1;
pub(super) const CONVERGED_LAST: f64 = 1e-3;

/// Change of the estimate by a pass, in its sigma, that may be larger than that of the pass before.
/// The trajectory then lies within the uncertainty, and passes that swing about the solution end at it.
const WITHIN: f64 = 1.0;

/// Part of a step by which short steps become longer while the passes converge.
const LONGER: f64 = 1.5;

/// Time from the start to the first short steps: before that the heading of a gyro that is off by 0.1 deg/s
/// has turned by less than 10 deg, and the linear model holds.
const TURNED: Span = Span::from_nanos(100_000_000_000);

/// The steps of passes from one trajectory to the next.
#[derive(Clone, Copy)]
struct Steps {
    /// Set if they begin from a run without a trajectory, in place of that of the filter.
    anew: bool,
    /// Part of the first step that is gone: a shorter one stays where the linear model holds.
    first: f64,
    passes: u32,
    /// Set if no gate refuses a sample, but in the pass after the last one.
    open: bool,
}

impl Steps {
    const FULL: Self = Self { anew: false, first: 1.0, passes: PASSES, open: false };
    const ANEW: Self = Self { anew: true, ..Self::FULL };
    const SHORT: Self = Self { first: 0.2, passes: 2 * PASSES, ..Self::ANEW };
    const OPEN: Self = Self { open: true, ..Self::SHORT };

    fn short(self) -> bool {
        self.first < 1.0
    }
}

/// Part by which the time since the start grows until the next passes.
const GROWTH: i64 = 4;

/// Part of the time since the start after which passes that failed are tried again, twice of it.
const RETRY: i64 = 128;

/// Number of samples that are kept before the filter starts.
const WAITING: usize = 256;

/// The samples since the start, until the last passes are made.
pub(super) struct Record {
    /// The filter before the first sample, which has not started.
    pub(super) first: Snapshot,
    pub(super) samples: Vec<Sample>,
    /// Time from the start to the next passes, and to the last ones.
    pub(super) next: Span,
    pub(super) span: Span,
    /// Number of times in a row at which the passes failed.
    pub(super) failures: u32,
    /// Set where the products of errors decide about the passes.
    pub(super) watch: Option<Watch>,
    /// Set once they have mattered.
    mattered: bool,
    /// Time from the start before which no passes are tried after some that failed.
    pub(super) retry: Span,
    /// Time from the start before which no short steps are tried, and none without gates: they take long,
    /// and where they did not help, they are tried at twice the time.
    pub(super) short: Span,
    pub(super) open: Span,
    /// Findings that compare samples with the estimate: of the run, and of the last pass.
    pub(super) findings: Vec<Finding>,
    pub(super) found: Vec<Finding>,
    /// Records of the filter, and of the last pass.
    pub(super) run: Records,
    pub(super) pass: Records,
}

impl Record {
    /// No samples yet of an estimator, of which passes are due after `next`, and the last ones after the span.
    pub(super) fn new(
        ekf: &dyn Linearised,
        (span, next): (Span, Span),
        watch: Option<Watch>,
    ) -> Self {
        let considers = ekf.considered().contains(&true);
        let records = || Records::new(&ekf.composition().layout, considers);
        Self {
            first: ekf.snapshot(),
            samples: Vec::new(),
            next,
            span,
            failures: 0,
            watch,
            mattered: false,
            retry: Span::ZERO,
            short: TURNED,
            open: TURNED,
            findings: Vec::new(),
            found: Vec::new(),
            run: records(),
            pass: records(),
        }
    }

    /// Decides whether passes are due this time after the start, and plans the next ones if not.
    pub(super) fn due(&mut self, ekf: &dyn Linearised, time: Span) -> Due {
        let planned = time >= self.next;
        let Some(watch) = self.watch else {
            return if planned { Due::Passes } else { Due::Nothing };
        };
        if time < self.retry {
            return Due::Nothing;
        }
        let weight = watch::weight(ekf);
        // an error that was found before is no product, and passes would not know it
        if !self.mattered && self.findings.iter().any(|f| f.basis == Basis::Explanation) {
            return Due::End;
        }
        let matters = watch.matters(weight, time.seconds());
        self.mattered |= matters;
        if matters && time >= self.open && self.run.gated.contradict() {
            return Due::Passes;
        }
        let due = watch.due(weight, time.seconds(), planned);
        if planned {
            self.plan(time);
        }
        due
    }

    /// Plans passes in place of some that failed, where the scenario does not plan them: soon, since
    /// the first samples of a drive may not suffice, and later after each failure.
    pub(super) fn plan_again(&mut self, time: Span) {
        let wait = (time.nanos() / RETRY) << self.failures.min(4);
        self.retry = Span::from_nanos(time.nanos().saturating_add(wait));
        if self.watch.is_some() {
            self.next = self.next.min(self.retry);
        }
    }

    /// Plans the next passes.
    pub(super) fn plan(&mut self, time: Span) {
        let time = time.nanos();
        self.next = Span::from_nanos(time.saturating_add(time / GROWTH)).min(self.span);
    }

    /// Observer of the run, which records it.
    pub(super) fn recording<'a>(&'a mut self, observer: &'a mut dyn Observer) -> Recording<'a> {
        Recording { records: &mut self.run, findings: &mut self.findings, observer }
    }

    /// Notes a sample that the filter takes next, from the first one on that may start it.
    pub(super) fn note(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        let first = self.samples.is_empty();
        // a search gives its samples back when it ends
        if ekf.searching() || first && sample.time < ekf.composition().start() {
            return;
        }
        if first || !ekf.running() && self.samples.len() == WAITING {
            self.begin(ekf);
        }
        self.samples.push(*sample);
    }

    /// Forgets the samples until now.
    pub(super) fn begin(&mut self, ekf: &dyn Linearised) {
        self.first = ekf.snapshot();
        self.samples.clear();
    }

    /// Makes the passes until one changes the estimate less, and leaves the filter at their result.
    /// Returns their report, or the reason why there is no result; the filter is then in any state.
    pub(super) fn relinearise(
        &mut self,
        ekf: &mut dyn Linearised,
        converged: f64,
        observer: &mut dyn Observer,
    ) -> Result<String, String> {
        let time = self.run.start.map_or(Span::ZERO, |start| ekf.time() - start);
        let (again, twice) = (Span::from_nanos(time.nanos() / 16 * 17), time + time);
        let mut steps = Steps::FULL;
        let mut made = self.passes(ekf, converged, steps, observer);
        // after passes that failed the filter may have left the region from which they converge
        if made.is_err() {
            steps = Steps::ANEW;
            made = self.passes(ekf, converged, steps, observer);
        }
        if made.is_err() && time >= self.short {
            steps = Steps::SHORT;
            made = self.passes(ekf, converged, steps, observer);
            self.short = if made.is_ok() { again } else { twice };
        }
        // the gate hides the samples that lead from a wrong trajectory to the right one
        if made.is_ok() && self.pass.gated.contradict() && time >= self.open {
            let others = self.passes(ekf, converged, Steps::OPEN, observer);
            let better = others.is_ok() && !self.pass.gated.contradict();
            self.open = if better { again } else { twice };
            made = if better { others } else { self.passes(ekf, converged, steps, observer) };
        }
        let report = made?;
        let injected = ekf.join_course();
        self.pass.joined(&injected);
        observer.repetition(Repetition::Ends(&injected));
        std::mem::swap(&mut self.run, &mut self.pass);
        std::mem::swap(&mut self.findings, &mut self.found);
        Ok(report)
    }

    /// Takes the samples from the start once more with the records of a pass, linearised at a
    /// trajectory or, without one, at the estimate, and without gates if they are open.
    fn take_all(
        &mut self,
        ekf: &mut dyn Linearised,
        course: Option<Points>,
        open: bool,
        observer: &mut dyn Observer,
    ) -> Result<(), String> {
        self.pass.clear();
        repeat_from(ekf, &self.first);
        if open {
            ekf.open_gates();
        }
        match course {
            Some(course) => ekf.follow_course(Box::new(course)),
            None => ekf.leave_course(),
        }
        observer.repetition(Repetition::Begins);
        self.found.clear();
        let mut pass = Pass { records: &mut self.pass, findings: &mut self.found, observer };
        let mut samples = self.samples.iter();
        let taken = samples.try_for_each(|sample| ekf.take(sample, &mut pass));
        ekf.settle(&mut pass);
        taken.map_err(|error| error.to_string())
    }

    /// Makes passes until one changes the estimate less.
    fn passes(
        &mut self,
        ekf: &mut dyn Linearised,
        converged: f64,
        steps: Steps,
        observer: &mut dyn Observer,
    ) -> Result<String, String> {
        let layout = Arc::clone(&ekf.composition().layout);
        if steps.anew {
            self.take_all(ekf, None, steps.open, observer)?;
        }
        let mut last = f64::INFINITY;
        let mut part = steps.first;
        let mut report = String::new();
        for number in 1..=steps.passes {
            let records = if number == 1 && !steps.anew { &mut self.run } else { &mut self.pass };
            let course = records.smooth(&layout, ekf.considered(), part);
            self.take_all(ekf, Some(course), steps.open, observer)
                .map_err(|error| format!("pass {number} failed: {error}"))?;
            // the trajectory ends at the estimate of the pass before, and the offset is the change
            let mut change = Change::default();
            for (i, d) in ekf.offset().iter().enumerate() {
                let variance = ekf.propagated().get(i, i);
                if variance > 0.0 {
                    change.take(d.abs() / variance.sqrt(), i, ekf.state().time);
                }
            }
            let words = change.words(&layout);
            // the linear run holds at a step that shrinks; short steps begin again where it grows
            let grows = change.size > last && !steps.short();
            if grows && change.size > WITHIN || change.size.is_nan() {
                return Err(format!(
                    "pass {number} diverges: it changed {words}, more than the pass before it; \
                     state a prior nearer to the truth"
                ));
            }
            let stays = steps.short() && change.size <= CONVERGED && change.size > 0.5 * last;
            part = if change.size > last { steps.first } else { (part * LONGER).min(1.0) };
            last = change.size;
            let ended = if last <= converged { "converged" } else { "not converged" };
            report = format!("{ended} after {number} passes: the last one changed {words}");
            if last <= converged || stays {
                break;
            }
        }
        if steps.short() && last > WITHIN {
            return Err(report);
        }
        if steps.open {
            let course = self.pass.smooth(&layout, ekf.considered(), 1.0);
            self.take_all(ekf, Some(course), false, observer)?;
        }
        Ok(report)
    }
}
