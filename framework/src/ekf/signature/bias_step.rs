//! Test for a step of a constant bias of the driving sensor.
//!
//! A step of unit size puts a one into the row of the bias, and nothing into the innovations
//! directly. Where a step is likely, its size `a` widens the covariance by `(4 a^2 + var a) s s'`,
//! with the `s` of each sum and of a step at this moment, since the time of the step is not known.
//! The estimate then follows the samples that come, and is consistent with or without a step: in a
//! run without one, this costs accuracy. The estimate that moves away from where it was, by the
//! samples after the widening alone, confirms the step, and only that is reported.
//!
//! One sum runs from the start. The others begin at one minute, two, four and so on after it, since
//! a filter needs the longer to follow a step, the longer it has learnt the constant.

use super::SPAN;
use super::effect::{Effect, Found, SUMS, Whitened, name};
use crate::model::finding::{Basis, Finding, Severity};
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::time::Time;

/// Time from the start to the begin of the second sum, s; the next ones begin at twice the age.
const FIRST: f64 = 60.0;
/// Least age of a sum, s: a scatter of few spans is not known.
const LEAST: f64 = 60.0;
/// Score in sigma at which a step is likely. Of 220 runs without a step, 6 exceed it by chance.
const LIKELY: f64 = 4.25;
/// Root of the sum of the squares of the score and of the move of the estimate after it, in sigma, at
/// which a run is doubtful, and at which it is useless. The two are independent: after a likely step,
/// the first is passed by chance with a move of 2.1 sigma.
const DOUBTFUL: f64 = 4.75;
const USELESS: f64 = 5.5;

/// Ratio of the sigma of a step to its estimated size: a sum that began long before the step sees a
/// smaller one.
const ROOM: f64 = 2.0;

/// Test of one component.
#[derive(Clone)]
struct Axis {
    /// Row of the error state, and place of the value.
    row: usize,
    place: usize,
    effect: Effect,
}

impl Axis {
    fn begin(&mut self, time: Time) {
        self.effect.begin(time);
        self.effect.s.fill([0.0; SUMS]);
        self.effect.s[self.row] = [1.0; SUMS];
    }
}

/// Tests of the components of the biases of one driving sensor.
#[derive(Clone)]
pub(super) struct BiasSteps {
    /// Index of the sensor.
    pub(super) sensor: usize,
    axes: Vec<Axis>,
    /// Begin of the first sum, and the next sum to begin again.
    start: Time,
    next: usize,
    span: Time,
    likely: Option<Step>,
    severity: Option<Severity>,
}

/// A likely step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    found: Found,
    row: usize,
    place: usize,
    /// Time of the widening, the estimate at that time, and its variance before.
    time: Time,
    value: f64,
    variance: f64,
    /// Move of the estimate since, and that in sigma.
    moved: f64,
    sigmas: f64,
}

impl Step {
    /// Finding about the driving sensor.
    pub(super) fn finding(&self, time: Time, sensor: &str, layout: &Layout) -> Finding {
        let &Self { ref found, row, moved, sigmas, .. } = self;
        let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&row));
        let (unit, scale) =
            block.map_or(("", 1.0), |b| (b.spec.display.unit, b.spec.display.scale));
        Finding {
            time,
            about: sensor.to_owned(),
            severity: found.severity,
            basis: Basis::Comparison,
            text: format!(
                "{} has stepped by about {:+.3} {unit} after {}: the innovations until {} fit a step \
                 ({:.1} sigma), which had moved {}; the covariance contains it since, and the \
                 estimate has followed it ({sigmas:.1} sigma)",
                name(layout, row),
                moved / scale,
                found.score.since,
                self.time,
                found.score.sigmas().abs(),
                found.moved(layout),
            ),
            remedy: format!(
                "check {sensor} (temperature, supply, mounting); do not use the estimates before \
                 {}; let the bias wander (random_walk or correlation_time)",
                self.time
            ),
        }
    }

    /// Follows the estimate, and returns the severity of a confirmed step. Without a step, the error of
    /// the estimate has no more than the variance of the widened covariance.
    fn follow(&mut self, state: &State, covariance: &Covariance) -> Option<Severity> {
        self.moved = state.values[self.place] - self.value;
        let variance = self.variance + covariance.get(self.row, self.row);
        self.sigmas = self.moved.abs() / variance.sqrt();
        let severity = match self.found.score.sigmas().hypot(self.sigmas) {
            both if both >= USELESS => Severity::DoNotUse,
            both if both >= DOUBTFUL => Severity::Doubtful,
            _ => return None,
        };
        self.found.severity = severity.min(self.found.severity);
        Some(severity)
    }
}

impl BiasSteps {
    /// Tests of the constant rows of the driving sensor of that index, each with the place of its
    /// value.
    pub(super) fn new(
        sensor: usize,
        rows: impl Iterator<Item = (usize, usize)>,
        n: usize,
    ) -> Option<Self> {
        let axis = |(row, place)| Axis { row, place, effect: Effect::new(n) };
        let axes: Vec<_> = rows.map(axis).collect();
        let (start, span, none) = (Time::MIN, Time::MIN, axes.is_empty());
        let steps = Self { sensor, axes, start, next: 1, span, likely: None, severity: None };
        (!none).then_some(steps)
    }

    pub(super) fn effects(&mut self) -> impl Iterator<Item = &mut Effect> {
        self.axes.iter_mut().map(|axis| &mut axis.effect)
    }

    fn begin(&mut self, time: Time) {
        (self.start, self.span, self.next) = (time, time, 1);
        self.axes.iter_mut().for_each(|axis| axis.begin(time));
    }

    pub(super) fn take(&mut self, sample: &Whitened<'_>, time: Time) {
        if self.start == Time::MIN {
            self.begin(time);
        }
        for Axis { effect, .. } in &mut self.axes {
            let g = effect.seen(sample.update);
            effect.take(sample, &g);
        }
    }

    /// Widens the covariance by a likely step, and returns a confirmed one that is more severe than
    /// those before.
    pub(super) fn corrected(
        &mut self,
        state: &State,
        covariance: &mut Covariance,
        considered: &[bool],
    ) -> Option<Step> {
        let time = state.time;
        if let Some(step) = &mut self.likely
            && let Some(severity) = step.follow(state, covariance)
            && self.severity < Some(severity)
        {
            self.severity = Some(severity);
            return self.likely;
        }
        if time.since(self.span) < SPAN {
            return None;
        }
        self.span = time;
        match self.likeliest(state, covariance, considered) {
            Some((step, axis)) => {
                let score = &step.found.score;
                let variance = (ROOM * score.size()).powi(2) + score.variance();
                let Axis { row, ref effect, .. } = self.axes[axis];
                for sum in 0..SUMS {
                    covariance.widen(variance, |i| effect.s[i][sum]);
                }
                covariance.widen(variance, |i| if i == row { 1.0 } else { 0.0 });
                self.likely = Some(step);
                self.begin(time);
            }
            None => self.renew(time),
        }
        None
    }

    /// Ends a span, and returns the likeliest step with its axis.
    fn likeliest(
        &mut self,
        state: &State,
        covariance: &Covariance,
        considered: &[bool],
    ) -> Option<(Step, usize)> {
        let time = state.time;
        let old = |since: Time| time.since(since) >= LEAST;
        let steps = self.axes.iter_mut().enumerate().filter_map(|(axis, tested)| {
            let &mut Axis { row, place, ref mut effect } = tested;
            effect.end_span();
            let found = effect.worst((LIKELY, old), covariance, considered)?;
            let (value, variance) = (state.values[place], covariance.get(row, row));
            let (moved, sigmas) = (0.0, 0.0);
            let step = Step { found, row, place, time, value, variance, moved, sigmas };
            Some((step, axis))
        });
        let weight = |step: &Step| step.found.score.sigmas().abs();
        steps.max_by(|a, b| weight(&a.0).total_cmp(&weight(&b.0)))
    }

    /// Begins a sum again at one minute after the start, at two, four and so on.
    fn renew(&mut self, time: Time) {
        let newest = self.axes[0].effect.newest();
        if time.since(self.start) < FIRST.max(2.0 * newest.since(self.start)) {
            return;
        }
        for Axis { row, effect, .. } in &mut self.axes {
            effect.renew(self.next, time);
            effect.s[*row][self.next] = 1.0;
        }
        self.next = 1 + self.next % (SUMS - 1);
    }
}
