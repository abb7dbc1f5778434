//! Comparison of errors that begin at an unknown time: steps of constant states, and offsets and drifts of channels.
//!
//! A step of a constant state puts a one into its row, and nothing into the innovations directly. An
//! offset of a channel is in the innovations of its sensor.
//!
//! One sum runs from the start. Of two others the one in which less is found begins again every 40 s, so
//! that one begins near any step, and goes on while it finds something. The fourth begins again with each
//! sample while the cumulative sums of all channels are zero (Page 1954), so that it begins at a larger step,
//! and just before the gate begins to refuse samples; it takes the place of another one if it has found more.
//!
//! The filter follows an offset or a drift of a velocity log within seconds: a sum that begins a second before it does not fit.
//! Each of its channels therefore has sums of its own, and the newest one begins while the cumulative sum of that
//! channel is zero. The other errors share the begins of their sums.
//!
//! A step of a bias of the driving sensor that a filter follows slowly has four sums of its own, of which three
//! begin again at one minute, two, four and so on. One more begins again with each sample that is not far off: it shows
//! a step so large that the gate refuses what follows.
//!
//! An error is named if it leads each error of another sensor clearly, and the offsets of all channels
//! of another sensor together. A step of a state widens the covariance by `(4 a^2 + var a) s s'`, with
//! the `s` of each sum and of a step at this moment, since the time of the step is not known. The
//! estimate then follows the samples that come. Any other error goes on, and the covariance contains it
//! from then on.

mod evidence;
mod refusal;

use super::charts::Charts;
use super::constants::rotations;
use super::contain::Containment;
use super::effect::{Effect, Found, OFFSETS, RECENT, SUMS, WIDE, Whitened};
use super::lanes::Changes;
use super::refused::Gated;
use super::score::{SPAN, leading};
use super::shift::{Place, Shift, places};
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::judge::lockout::GONE;
use crate::filter::judge::measured::Measured;
use crate::model::record::finding::{Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use refusal::REFUSED;
use std::ops::Range;

/// Time from the begin of one sum to that of the next, s.
const TURN: f64 = 40.0;
/// Time from the start to the begin of the second sum of a slow step, s; the next ones begin at twice the age.
const FIRST: f64 = 60.0;
/// Least age of a sum, s: a scatter of few spans is not known.
const LEAST: f64 = 60.0;
/// Score in sigma with which the newest sum is kept, and the least age, s: by chance one of twenty errors
/// has a score of 3.5 in one of a hundred sums.
const PROMISING: f64 = 3.5;
const LASTS: f64 = 0.5;
/// Ratio of the sigma of a step to its estimated size: a sum that began long before the step sees a
/// smaller one.
const ROOM: f64 = 2.0;
/// Largest number of errors that are compared: every one follows the samples of all sensors.
const COMPARED: usize = 48;

/// An error that was found and goes on.
#[derive(Clone, Default)]
struct Lasting {
    axis: usize,
    effect: Effect<1>,
}

saved!(Lasting { axis, effect });

/// The errors of the sensors that are compared.
#[derive(Clone)]
pub(super) struct Shifts {
    axes: Vec<Shift>,
    /// Sums of the errors, [`WIDE`] together.
    effects: Vec<Effect<WIDE>>,
    /// Sums of the large steps of the biases of the driving sensor, which are the first errors.
    large: Effect<OFFSETS>,
    biases: usize,
    /// The errors whose sums begin together.
    groups: Vec<Range<usize>>,
    driver: Option<usize>,
    sensors: usize,
    /// Rows of the error state that are rotations.
    rotations: Vec<usize>,
    lasting: Vec<Lasting>,
    /// Begin of the run, and of the first sum, and the sum of the slow steps that begins next.
    run: Time,
    start: Time,
    next: usize,
    charts: Charts,
    span: Time,
    severity: Option<Severity>,
    /// Weighted squares of the refused innovations since the last sum began, and their number.
    refused: [f64; 2],
    /// Number of the refused samples since then, and the sum of the limit of the gate over their innovations.
    weights: [f64; 2],
    /// What the gate refused of each sensor since the first sum began.
    gated: Vec<Gated>,
}

saved!(Shifts {
    run, start, next, span, severity, refused, weights, lasting, charts, large,
} each { effects, gated } except { axes, biases, groups, driver, sensors, rotations });

/// A significant error, the worst one that explains the same samples, and whether it goes on.
pub(super) struct Step {
    found: Found,
    axis: usize,
    alike: Option<(usize, Found)>,
    pub(super) lasts: bool,
}

/// Size of the score of an error that was found, in sigma.
fn significance((_, found): &(usize, Found)) -> f64 {
    found.score.sigmas().abs()
}

/// Place of a sum of an error: its effect, and the column there.
fn at(axis: usize, sum: usize) -> (usize, usize) {
    let column = axis * SUMS + sum;
    (column / WIDE, column % WIDE)
}

impl Shifts {
    /// The errors of a composition of which the sensors are tested.
    pub(super) fn new(composition: &Composition, tested: &[bool]) -> Option<Self> {
        let n = composition.layout.tangent;
        let mut axes = places(composition, tested);
        axes.truncate(COMPARED);
        axes.sort_by_key(|axis| axis.followed);
        let shared = axes.iter().position(|axis| axis.followed).unwrap_or(axes.len());
        let single = (shared..axes.len()).map(|axis| axis..axis + 1);
        let groups =
            std::iter::once(0..shared).filter(|all| !all.is_empty()).chain(single).collect();
        let driver = composition.driver();
        let slow = axes.iter().filter(|axis| Some(axis.sensor) == driver);
        axes.extend(slow.map(|axis| Shift { patient: true, ..*axis }).collect::<Vec<_>>());
        let biases = axes.iter().take_while(|axis| Some(axis.sensor) == driver).count();
        let effects = vec![Effect::new(n); (axes.len() * SUMS).div_ceil(WIDE)];
        let charts = Charts::new(&axes);
        (!axes.is_empty()).then(|| Self {
            axes,
            effects,
            large: Effect::new(n),
            biases: biases.min(OFFSETS),
            groups,
            driver,
            sensors: composition.sensors.len(),
            rotations: rotations(&composition.layout),
            lasting: Vec::new(),
            run: Time::MIN,
            start: Time::MIN,
            next: 1,
            charts,
            span: Time::MIN,
            severity: None,
            refused: [0.0; 2],
            weights: [0.0; 2],
            gated: vec![Gated::default(); composition.sensors.len()],
        })
    }

    /// Index of the sensor of an error.
    pub(super) fn sensor(&self, step: &Step) -> usize {
        self.axes[step.axis].sensor
    }

    /// The finding about the sensor of an error.
    pub(super) fn finding(
        &self,
        step: &Step,
        sensor: &SensorInfo,
        (layout, state): (&Layout, &State),
    ) -> Finding {
        let prior = step.found.score.since == self.run;
        let mut finding =
            self.axes[step.axis].finding((&step.found, prior), sensor, (layout, state));
        if let Some((axis, found)) = &step.alike {
            finding.severity = finding.severity.max(found.severity);
            finding.text.push_str(&self.axes[*axis].alike(found, sensor, (layout, state)));
        }
        finding
    }

    /// Carries the sensitivities to the present.
    pub(super) fn carry(&mut self, changes: &Changes) {
        self.effects.iter_mut().for_each(|effect| effect.carry(changes));
        self.large.carry(changes);
        self.lasting.iter_mut().for_each(|lasting| lasting.effect.carry(changes));
    }

    fn begin(&mut self, time: Time) {
        if self.run == Time::MIN {
            self.run = time;
        }
        (self.start, self.span, self.next) = (time, time, 1);
        (self.refused, self.weights) = ([0.0; 2], [0.0; 2]);
        self.gated.fill(Gated::default());
        for sum in 0..SUMS {
            self.renew(0..self.axes.len(), sum, time);
        }
        self.renew_large(time);
    }

    /// Begins one sum of some errors again.
    fn renew(&mut self, axes: Range<usize>, sum: usize, time: Time) {
        for axis in axes {
            let (effect, column) = at(axis, sum);
            let effect = &mut self.effects[effect];
            effect.renew(column, time);
            if let Place::State(row) = self.axes[axis].place {
                effect.s[row][column] = 1.0;
            }
        }
    }

    /// The steps that a filter follows slowly, which come last.
    fn slow(&self) -> Range<usize> {
        self.groups.last().map_or(0, |axes| axes.end)..self.axes.len()
    }

    /// Time since which a sum of an error runs.
    fn since(&self, axis: usize, sum: usize) -> Time {
        self.all(axis, sum).since
    }

    /// Begins all sums at the next sample. What they have counts no more until then.
    pub(super) fn restart(&mut self) {
        self.start = Time::MIN;
        self.effects.iter_mut().for_each(|effect| effect.restart(Time::MIN));
        self.large.restart(Time::MIN);
    }

    /// Takes a sample of a sensor, and the limit of the gate over its innovation, as far as its noise explains it;
    /// `calm` is set while all sensors agree with the filter.
    pub(super) fn take(
        &mut self,
        Measured { sensor: index, present }: Measured,
        (sample, near): (&Whitened<'_>, f64),
        (time, calm): (Time, bool),
    ) {
        if self.start == Time::MIN {
            self.begin(time);
        }
        let own = |sensor: usize| (sensor == index).then_some(present);
        self.gated[index].take(sample);
        if !sample.used {
            let products = sample.update.innovation.iter().zip(&sample.y);
            self.refused[0] += sample.weight * products.map(|(y, white)| y * white).sum::<f64>();
            self.refused[1] += sample.update.m as f64;
            self.weights = [self.weights[0] + 1.0, self.weights[1] + near.min(1.0)];
        }
        let Self { axes, effects, lasting, .. } = self;
        for Lasting { axis, effect } in lasting {
            let mut g = [[0.0; 1]; MAX_CHANNELS];
            effect.seen(sample, &mut g);
            let age = |_| time.since(effect.since(0));
            axes[*axis].enter(&mut g, 0..1, own(axes[*axis].sensor), age);
            effect.take(sample, &g);
        }
        let mut g = [[0.0; WIDE]; MAX_CHANNELS];
        for (effect, axes) in effects.iter_mut().zip(axes.chunks(WIDE / SUMS)) {
            effect.seen(sample, &mut g);
            for (axis, first) in axes.iter().zip((0..WIDE).step_by(SUMS)) {
                let age = |column| time.since(effect.since(column));
                axis.enter(&mut g, first..first + SUMS, own(axis.sensor), age);
            }
            effect.take(sample, &g);
        }
        let mut g = [[0.0; OFFSETS]; MAX_CHANNELS];
        self.large.seen(sample, &mut g);
        self.large.take(sample, &g);
        if !(calm && sample.used) {
            return;
        }
        self.charts.take((index, present), sample);
        let quiet = self.charts.quiet();
        if quiet {
            (self.refused, self.weights) = ([0.0; 2], [0.0; 2]);
        }
        if self.charts.near() {
            self.renew_large(time);
        }
        for group in 0..self.groups.len() {
            let axes = self.groups[group].clone();
            let begins = match self.axes[axes.start] {
                Shift {
                    followed: true,
                    sensor,
                    place: Place::Channel(channel) | Place::Drift(channel),
                    ..
                } => self.charts.still((sensor, channel)),
                _ => quiet,
            };
            if begins {
                if time.since(self.since(axes.start, RECENT)) >= LASTS {
                    self.promote(axes.clone());
                }
                self.renew(axes, RECENT, time);
            }
        }
    }

    /// Keeps the newest sum of some errors in place of the one in which less is found.
    fn promote(&mut self, axes: Range<usize>) {
        let found = self.most(axes.clone(), RECENT);
        let (weakest, least) = self.weakest(axes.clone());
        if found >= PROMISING * PROMISING && found > least {
            for axis in axes {
                let (effect, from) = at(axis, RECENT);
                self.effects[effect].copy(from, at(axis, weakest).1);
            }
        }
    }

    /// Ends a span where one is due. A significant error that leads all others clearly is contained, and
    /// returned if it is more severe than those before. `rival` is the score of the errors that are
    /// tested elsewhere, of a sensor or of the others.
    pub(super) fn corrected(
        &mut self,
        time: Time,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn(usize) -> f64,
    ) -> Option<Step> {
        for Lasting { effect, .. } in &self.lasting {
            containment.contain((effect, &effect.all(0), 0), covariance);
        }
        if time.since(self.span) < SPAN {
            return None;
        }
        self.span = time;
        self.effects.iter_mut().for_each(Effect::end_span);
        self.large.end_span();
        self.lasting.iter_mut().for_each(|lasting| lasting.effect.end_span());
        let old = |axis: usize, sum: usize| {
            (sum != RECENT || self.axes[axis].patient)
                && time.since(self.since(axis, sum)) >= LEAST
                && self.explains(axis, sum)
        };
        let worst = self.worst(old, (covariance, considered), false);
        let Some(worst) = worst.filter(|worst| self.leads(worst, &rival)) else {
            self.turn(time);
            return None;
        };
        self.contain(worst, time, (covariance, considered), containment)
    }

    /// Returns `true` if an error leads those of other sensors.
    fn leads(&self, (axis, found): &(usize, Found), rival: impl Fn(usize) -> f64) -> bool {
        let sensor = self.axes[*axis].sensor;
        let others = self.score((SUMS, true), |other| other != sensor);
        found.score.sigmas().abs() > leading(others).max(rival(sensor))
    }

    /// Contains an error, with those of the same sensor that the samples do not tell from it, and returns it if one of them
    /// is more severe than those before.
    fn contain(
        &mut self,
        (axis, found): (usize, Found),
        time: Time,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
    ) -> Option<Step> {
        let place = self.axes[axis].place;
        let (lasts, mut alike) = (!matches!(place, Place::State(_)), Vec::new());
        if let Place::State(row) = place {
            let variance = (ROOM * found.score.size()).powi(2) + found.score.variance();
            for sum in 0..SUMS {
                let (effect, column) = at(axis, sum);
                containment
                    .widen(covariance, variance, |i| f64::from(self.effects[effect].s[i][column]));
            }
            if axis < self.biases {
                containment.widen(covariance, variance, |i| f64::from(self.large.s[i][axis]));
            }
            containment.widen(covariance, variance, |i| if i == row { 1.0 } else { 0.0 });
            self.begin(time);
        } else {
            alike = self.alike(axis, &found, (covariance, considered));
            for &(axis, Found { sum, .. }) in [(axis, found)].iter().chain(&alike) {
                if self.lasting.iter().all(|lasting| lasting.axis != axis) {
                    let effect = self.effects[at(axis, 0).0].alone(sum);
                    containment.contain((&effect, &effect.all(0), 0), covariance);
                    self.lasting.push(Lasting { axis, effect });
                }
            }
        }
        let alike = alike.into_iter().max_by_key(|(_, other)| other.severity);
        let alike = alike.filter(|(_, other)| other.severity > found.severity);
        let severity = alike.map_or(found.severity, |(_, other)| other.severity);
        if self.severity >= Some(severity) {
            return None;
        }
        self.severity = Some(severity);
        Some(Step { found, axis, alike, lasts })
    }

    /// The most significant error among the sums that count, with its index.
    fn worst(
        &self,
        counts: impl Fn(usize, usize) -> bool,
        states: (&Covariance, &[bool]),
        refused: bool,
    ) -> Option<(usize, Found)> {
        let of = |axis: usize| {
            let (effect, first) = at(axis, 0);
            let (effect, columns) = (&self.effects[effect], first..first + SUMS);
            let score = |column: usize| self.score_of(axis, column - first);
            let counts = |column: usize| {
                columns.contains(&column)
                    && (refused || self.noise_is_no_rival(axis, &score(column)))
                    && counts(axis, column - first)
                    && self.linear(axis, column - first)
                    && score(column).size().abs() < self.axes[axis].most
            };
            let significant = if refused { REFUSED } else { self.significant(axis) };
            let of = |counts: &dyn Fn(usize) -> bool| {
                effect.worst((significant, counts), score, states, refused)
            };
            let worst = of(&counts)?;
            // an error since the start has to lead the same one that begins later
            let later =
                (worst.sum == first).then(|| of(&|column| column != first && counts(column)));
            let clear = |later: &Found| worst.score.sigmas().abs() > leading(later.score.sigmas());
            Some(later.flatten().filter(|later| !clear(later)).unwrap_or(worst))
        };
        let found = (0..self.axes.len()).filter_map(|axis| Some((axis, of(axis)?)));
        found.max_by(|a, b| significance(a).total_cmp(&significance(b)))
    }

    /// Begins the sum again in which less is found, once the newest is old enough, and a sum of the slow steps
    /// at one minute after the start, at two, four and so on.
    fn turn(&mut self, time: Time) {
        for group in 0..self.groups.len() {
            let axes = self.groups[group].clone();
            let newest = (0..RECENT).map(|sum| self.since(axes.start, sum)).max();
            if newest.is_some_and(|newest| time.since(newest) >= TURN) {
                let (sum, _) = self.weakest(axes.clone());
                self.renew(axes, sum, time);
            }
        }
        let slow = self.slow();
        if slow.is_empty() {
            return;
        }
        let begun = (0..SUMS).map(|sum| self.since(slow.start, sum).since(self.start));
        if time.since(self.start) >= FIRST.max(2.0 * begun.fold(0.0, f64::max)) {
            self.renew(slow, self.next, time);
            self.next = 1 + self.next % (SUMS - 1);
        }
    }
}
