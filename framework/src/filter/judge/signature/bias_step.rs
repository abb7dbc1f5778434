//! Test for a step of a constant bias of the driving sensor.
//!
//! A step of unit size puts a one into the row of the bias, and nothing into the innovations
//! directly. A significant one of the size `a` widens the covariance by `(4 a^2 + var a) s s'`, with
//! the `s` of each sum and of a step at this moment, since the time of the step is not known. The
//! estimate then follows the samples that come, and its sigma holds.
//!
//! One sum runs from the start. The others begin at one minute, two, four and so on after it, since
//! a filter that has learnt the constant for longer takes longer to follow a step.

use super::contain::Containment;
use super::effect::{Effect, Found, SUMS, Whitened, name};
use super::score::{SPAN, leading};
use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::state::Layout;
use crate::state::covariance::Covariance;
use crate::units::time::Time;

/// Time from the start to the begin of the second sum, s; the next ones begin at twice the age.
const FIRST: f64 = 60.0;
/// Least age of a sum, s: a scatter of few spans is not known.
const LEAST: f64 = 60.0;
/// Score in sigma that is significant. Of 600 runs without a step, 4 exceed 4.25 by chance, and none
/// 4.5.
const SIGNIFICANT: f64 = 4.75;
/// Ratio of the sigma of a step to its estimated size: a sum that began long before the step sees a
/// smaller one.
const ROOM: f64 = 2.0;

/// Test of one component.
#[derive(Clone)]
struct Axis {
    /// Row of the error state.
    row: usize,
    effect: Effect,
}

saved!(Axis { effect } except { row });

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
    severity: Option<Severity>,
}

saved!(BiasSteps { start, next, span, severity } each { axes } except { sensor });

/// A significant step of the bias of a row.
pub(super) struct Step {
    found: Found,
    row: usize,
}

impl Step {
    /// Finding about the driving sensor.
    pub(super) fn finding(&self, time: Time, sensor: &str, layout: &Layout) -> Finding {
        let Self { ref found, row } = *self;
        let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&row));
        let (unit, scale) =
            block.map_or(("", 1.0), |b| (b.spec.display.unit, b.spec.display.scale));
        Finding {
            time,
            about: sensor.to_owned(),
            severity: found.severity,
            basis: Basis::Explanation,
            text: format!(
                "{} has stepped after {}: the innovations fit a step of {:+.3} {unit} ({:.1} sigma), \
                 which has moved {}; the covariance contains it from now on",
                name(layout, row),
                found.score.since,
                found.score.size() / scale,
                found.score.sigmas().abs(),
                found.moved(layout),
            ),
            remedy: format!(
                "check {sensor} (temperature, supply, mounting); do not use the estimates before \
                 {time}; let the bias wander (random_walk or correlation_time)"
            ),
        }
    }
}

impl BiasSteps {
    /// Tests of the constant rows of the driving sensor of that index.
    pub(super) fn new(sensor: usize, rows: impl Iterator<Item = usize>, n: usize) -> Option<Self> {
        let axes: Vec<_> = rows.map(|row| Axis { row, effect: Effect::new(n) }).collect();
        let (start, span, none) = (Time::MIN, Time::MIN, axes.is_empty());
        (!none).then_some(Self { sensor, axes, start, next: 1, span, severity: None })
    }

    pub(super) fn effects(&mut self) -> impl Iterator<Item = &mut Effect> {
        self.axes.iter_mut().map(|axis| &mut axis.effect)
    }

    fn begin(&mut self, time: Time) {
        (self.start, self.span, self.next) = (time, time, 1);
        self.axes.iter_mut().for_each(|axis| axis.begin(time));
    }

    /// Begins all sums at the next sample.
    pub(super) fn restart(&mut self) {
        self.start = Time::MIN;
    }

    /// Score in sigma of the most significant step.
    pub(super) fn score(&self) -> f64 {
        let scores = self.axes.iter().flat_map(|axis| &axis.effect.scores);
        scores.fold(0.0, |most, score| most.max(score.sigmas().abs()))
    }

    pub(super) fn take(&mut self, sample: &Whitened<'_>, time: Time) {
        if self.start == Time::MIN {
            self.begin(time);
        }
        for effect in self.effects() {
            let g = effect.seen(sample.update);
            effect.take(sample, &g);
        }
    }

    /// Ends a span where one is due. A significant step widens the covariance, unless another
    /// explanation of the score `rival` leads it clearly, and is returned if it is more severe than
    /// those before.
    pub(super) fn corrected(
        &mut self,
        time: Time,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn() -> f64,
    ) -> Option<Step> {
        if time.since(self.span) < SPAN {
            return None;
        }
        self.span = time;
        self.effects().for_each(Effect::end_span);
        let worst = self.worst(time, covariance, considered);
        let leads = |(_, found): &(usize, Found)| rival() < leading(found.score.sigmas().abs());
        let Some((axis, found)) = worst.filter(leads) else {
            self.renew(time);
            return None;
        };
        let Axis { row, ref effect } = self.axes[axis];
        let variance = (ROOM * found.score.size()).powi(2) + found.score.variance();
        for sum in 0..SUMS {
            containment.widen(covariance, variance, |i| effect.s[i][sum]);
        }
        containment.widen(covariance, variance, |i| if i == row { 1.0 } else { 0.0 });
        self.begin(time);
        if self.severity >= Some(found.severity) {
            return None;
        }
        self.severity = Some(found.severity);
        Some(Step { found, row })
    }

    /// The most significant step, with its axis.
    fn worst(
        &self,
        time: Time,
        covariance: &Covariance,
        considered: &[bool],
    ) -> Option<(usize, Found)> {
        let of = |axis: &Axis| {
            let old = |sum: usize| time.since(axis.effect.scores[sum].since) >= LEAST;
            axis.effect.worst(
                &axis.effect.scores,
                (SIGNIFICANT, old),
                (covariance, considered),
                false,
            )
        };
        let found = self.axes.iter().enumerate().filter_map(|(k, axis)| Some((k, of(axis)?)));
        let weight = |(_, found): &(usize, Found)| found.score.sigmas().abs();
        found.max_by(|a, b| weight(a).total_cmp(&weight(b)))
    }

    /// Begins a sum again at one minute after the start, at two, four and so on.
    fn renew(&mut self, time: Time) {
        let newest = self.axes[0].effect.newest();
        if time.since(self.start) < FIRST.max(2.0 * newest.since(self.start)) {
            return;
        }
        for Axis { row, effect } in &mut self.axes {
            effect.renew(self.next, time);
            effect.s[*row][self.next] = 1.0;
        }
        self.next = 1 + self.next % (SUMS - 1);
    }
}
