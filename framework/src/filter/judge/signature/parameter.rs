//! Test for a wrong constant of a sensor: a fixed parameter such as its lever arm, the factor of a channel,
//! and the scale factors and axes of the driving sensor.
//!
//! A parameter that is off by the unit size is in the innovations of each sensor that reads it: `d
//! = dh/dp`. A factor is in those of its channel, `d = h(x)`. A scale factor of the driving sensor acts on
//! the state as a bias that follows its samples. Each is off from the start, so that one sum is enough. From
//! a finding on, the covariance contains its effect, or the filter estimates it.
//!
//! The derivative by a lever arm has the noise of the gyros in it, and so has the innovation, times the lever arm.
//! The test looks for the derivative with an earlier angular rate, whose noise is another one (an instrumental
//! variable, Wright 1928): without it each lever arm would seem to be zero.

use super::calibration::Calibration;
use super::calibrations::{Calibrations, Correction, moved};
use super::constants::{Component, Inputs, Kind, inputs};
use super::constants::{measures, rotations, turns, usual};
use super::contain::Containment;
use super::earlier::Earlier;
use super::effect::{Effect, Found, WIDE, Whitened};
use super::lanes::Changes;
use super::refused::Gated;
use super::score::{SPAN, Score, leading};
use super::wrong::Wrong;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::judge::measured::Measured;
use crate::model::record::Corrected;
use crate::model::record::finding::{Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::Covariance;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Layout, State};
use crate::units::sample::{MAX_CHANNELS, channels};
use crate::units::time::Time;

/// Score in sigma at which an error is significant, as that of a time offset is: real errors are not Gaussian,
/// and the curvature of a track, which the linear test neglects, gives scores of 5.
const SIGNIFICANT: f64 = 6.0;
/// Largest turn of a rotation to which the test is linear, rad. A fault elsewhere fits a larger
/// turn.
pub(super) const LINEAR: f64 = 0.2;
/// Tests of the fixed blocks that sensors read.
#[derive(Clone)]
pub(super) struct Parameters {
    components: Vec<Component>,
    earlier: Earlier,
    /// Tests of [`WIDE`] components each.
    effects: Vec<Effect<WIDE>>,
    /// Sensors whose blocks are tested, and those whose blocks are in `components`.
    tested: Vec<bool>,
    known: Vec<bool>,
    /// What the gate refused of each sensor.
    refused: Vec<Gated>,
    /// Rows of the error state that are rotations, and blocks that are.
    rotations: Vec<usize>,
    turning: Vec<bool>,
    /// The errors of the driving sensor.
    inputs: Option<Inputs>,
    /// Sensitivities with the driving samples in them: row, sum, without and with.
    driven: Vec<(usize, usize, f32, f32)>,
    span: Time,
    severity: Option<Severity>,
    /// Components that were found to be wrong and go on.
    found: Vec<usize>,
    calibrations: Calibrations,
}

saved!(Parameters {
    components, effects, span, severity, found, calibrations,
} each {
    known, refused,
} except {
    tested, rotations, turning, inputs, driven, earlier,
});

impl Parameters {
    /// Tests of the constants of those sensors.
    pub(super) fn new(tested: Vec<bool>, composition: &Composition) -> Self {
        let layout = &*composition.layout;
        let (known, refused) = (vec![false; tested.len()], vec![Gated::default(); tested.len()]);
        Self {
            components: Vec::new(),
            earlier: Earlier::default(),
            effects: Vec::new(),
            tested,
            known,
            refused,
            rotations: rotations(layout),
            turning: layout.blocks.iter().map(turns).collect(),
            inputs: inputs(composition),
            driven: Vec::new(),
            span: Time::MIN,
            severity: None,
            found: Vec::new(),
            calibrations: Calibrations::default(),
        }
    }

    /// Begins all tests at the next sample.
    pub(super) fn restart(&mut self) {
        let Self { components, effects, known, refused, span, found, calibrations, .. } = self;
        calibrations.clear();
        components.clear();
        effects.clear();
        known.fill(false);
        refused.fill(Gated::default());
        found.clear();
        *span = Time::MIN;
    }

    /// Forgets the refused samples: the evidence has decided against their sensor.
    pub(super) fn isolated(&mut self) {
        self.effects.iter_mut().for_each(Effect::forget_refused);
        self.refused.fill(Gated::default());
    }

    /// Carries the sensitivities to the present, with the means of the driving samples over a time, s.
    pub(super) fn carry(&mut self, changes: &Changes, means: &[f64; MAX_CHANNELS], time: f64) {
        let Self { effects, components, inputs, driven, .. } = self;
        let input = inputs.as_ref().map_or(*means, |inputs| inputs.above_noise(means, time));
        let inputs = inputs.as_ref().map_or(&[][..], |inputs| &inputs.shares[..]);
        for (effect, components) in effects.iter_mut().zip(components.chunks(WIDE)) {
            driven.clear();
            let errors = components.iter().enumerate().filter(|(_, c)| c.kind == Kind::Input);
            for (sum, c) in errors {
                for &(row, channel, share) in &inputs[c.of] {
                    let s = &mut effect.s[row][sum];
                    let before = *s;
                    *s += (share * input[channel]) as f32;
                    driven.push((row, sum, before, *s));
                }
            }
            effect.carry(changes);
            for &(row, sum, before, driven) in &*driven {
                let s = &mut effect.s[row][sum];
                *s = before + (*s - driven);
            }
        }
    }

    /// The finding about the sensor of a wrong constant.
    pub(super) fn finding(
        &self,
        wrong: &Wrong,
        state: &State,
        sensor: &SensorInfo,
        layout: &Layout,
    ) -> Finding {
        let shares = self.inputs.as_ref().filter(|_| wrong.of.kind == Kind::Input);
        let shares = shares.map_or(&[][..], |inputs| &inputs.shares[wrong.of.of]);
        wrong.finding(state, sensor, layout, shares)
    }

    fn score_of(&self, index: usize) -> Score {
        self.effects[index / WIDE].used(index % WIDE)
    }

    /// Returns `true` if an error of a sensor explains the samples that the gate refused, or these are few.
    fn explains(&self, index: usize) -> bool {
        let (effect, sum) = (&self.effects[index / WIDE], index % WIDE);
        let gated = &self.refused[self.components[index].sensor];
        gated.explained(&effect.all(sum), &effect.used(sum))
    }

    /// Returns `true` if the size of an error is within the range of the test.
    fn linear(&self, index: usize) -> bool {
        let (effect, sum) = (&self.effects[index / WIDE], index % WIDE);
        let size = self.score_of(index).size();
        let turned = self.rotations.iter().map(|row| (size * f64::from(effect.s[*row][sum])).abs());
        let Component { kind, of, .. } = self.components[index];
        let own = match kind {
            Kind::Fixed if self.turning[of] => size.abs(),
            Kind::Input | Kind::Factor => size.abs(),
            Kind::Fixed | Kind::Free => 0.0,
        };
        turned.fold(own, f64::max) < LINEAR
    }

    /// Score in sigma of the most significant error of the sensors that count, within the range of
    /// the test, by all samples or by those that the gate did not refuse.
    pub(super) fn score(&self, all: bool, counts: impl Fn(usize) -> bool) -> f64 {
        let of = |index: usize| {
            let effect = &self.effects[index / WIDE];
            let score = if all { effect.all(index % WIDE) } else { self.score_of(index) };
            score.sigmas().abs() * self.usual(index, &score)
        };
        let counts = |index: &usize| {
            counts(self.components[*index].sensor)
                && self.linear(*index)
                && !self.calibrations.corrects(*index)
        };
        let scores = (0..self.components.len()).filter(counts).map(of);
        let blocks = self.calibrations.blocks().iter();
        let blocks = blocks.map(|block| (block.components().start, block.score()));
        let blocks = blocks.filter(|(index, _)| counts(index)).map(|(_, score)| score);
        scores.chain(blocks).fold(0.0, f64::max)
    }

    fn usual(&self, index: usize, score: &Score) -> f64 {
        usual(self.components[index].kind, score)
    }

    fn add(&mut self, component: Component, at: &At<'_>) {
        let sum = self.components.len() % WIDE;
        if sum == 0 {
            self.effects.push(Effect::new(at.layout.tangent));
        }
        if let Some(effect) = self.effects.last_mut() {
            effect.renew(sum, at.state.time);
        }
        self.components.push(component);
    }

    /// Adds the constants of a sensor: the fixed blocks that it reads, and the factors of its channels.
    fn add_sensor(&mut self, sensor: usize, sample: &Whitened<'_>, info: &SensorInfo, at: &At<'_>) {
        self.known[sensor] = true;
        for block in sample.update.read.slots() {
            let fixed = &at.layout.blocks[block];
            let known = |c: &Component| c.kind == Kind::Fixed && c.of == block;
            if fixed.tangent.is_some() || self.components.iter().any(known) {
                continue;
            }
            let n = fixed.operations.tangent;
            while self.components.len() % WIDE + n > WIDE {
                self.add(Component { kind: Kind::Free, ..Component::default() }, at);
            }
            let first = self.components.len();
            let fixed = |component| Component { kind: Kind::Fixed, of: block, component, sensor };
            (0..n).for_each(|component| self.add(fixed(component), at));
            self.calibrations.add(first..first + n);
        }
        let lengths = info.channels.iter().enumerate().filter(|(_, c)| measures(c));
        for (channel, _) in lengths {
            let (kind, component) = (Kind::Factor, 0);
            self.add(Component { kind, of: channel, component, sensor }, at);
        }
    }

    /// Takes the sample of a sensor, of which some channels are present.
    pub(super) fn take(
        &mut self,
        Measured { sensor: index, present }: Measured,
        sample: &Whitened<'_>,
        (model, info): (&dyn AnyMeasurement, &SensorInfo),
        at: &At<'_>,
    ) {
        if self.span == Time::MIN {
            self.span = at.state.time;
            let inputs: Vec<_> = self.inputs.iter().flat_map(Inputs::components).collect();
            inputs.into_iter().for_each(|component| self.add(component, at));
        }
        let tested = self.tested[index];
        if tested && !self.known[index] {
            self.add_sensor(index, sample, info, at);
        }
        self.refused[index].take(sample);
        let rows = || channels(present).enumerate().take(sample.update.m);
        let (m, [mut f, mut g]) = (sample.update.m, [[[0.0; WIDE]; MAX_CHANNELS]; 2]);
        let Self { components, earlier, effects, calibrations, .. } = self;
        let earlier = if tested { earlier.of(at) } else { None };
        let chunks = effects.iter_mut().zip(components.chunks(WIDE));
        for ((effect, components), first) in chunks.zip((0..).step_by(WIDE)) {
            effect.seen(sample, &mut g);
            f[..m].copy_from_slice(&g[..m]);
            let mut along = false;
            for (sum, &Component { kind, of, component, sensor }) in components.iter().enumerate() {
                match kind {
                    Kind::Fixed if tested && sample.update.read.contains(of) => {
                        along |= earlier.is_some();
                        let derivative = |at: &At<'_>| {
                            let mut d = [0.0; MAX_CHANNELS];
                            model.derivative(at, of, component, &mut d[..model.channels()]);
                            d
                        };
                        let d = derivative(at);
                        let before = earlier.map_or(d, |state| derivative(&At { state, ..*at }));
                        let known = |channel: usize| (d[channel] + before[channel]).is_finite();
                        for (row, channel) in rows().filter(|(_, channel)| known(*channel)) {
                            f[row][sum] += before[channel] as f32;
                            g[row][sum] += d[channel] as f32;
                        }
                    }
                    Kind::Factor if sensor == index => {
                        if let Some((row, channel)) = rows().find(|(_, channel)| *channel == of) {
                            let measured = at.sample.get(channel).unwrap_or_default();
                            let factor = (measured - sample.update.innovation[row]) as f32;
                            f[row][sum] += factor;
                            g[row][sum] += factor;
                        }
                    }
                    _ => {}
                }
            }
            match along {
                true => effect.take_along(sample, [&f, &g]),
                false => effect.take(sample, &g),
            }
            if sample.used {
                let chunk = first..first + components.len();
                calibrations.take(chunk, &f, effect.white(along), sample);
            }
        }
    }

    /// Widens the covariance where it does not contain the errors that were found. Ends a span
    /// where one is due, and returns the most significant error that is more severe than those
    /// before, or is estimated from now on. `rival` is the score that an error of a sensor has to exceed.
    pub(super) fn corrected(
        &mut self,
        time: Time,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn(usize) -> f64,
    ) -> Option<Wrong> {
        let due = time.since(self.span) >= SPAN;
        let worst = due.then(|| self.worst(time, (covariance, considered), rival)).flatten();
        let corrects = worst.as_ref().is_some_and(Wrong::is_fixed) && !containment.is_off();
        match &worst {
            Some(worst) if corrects => self.calibrate(worst, time),
            Some(worst) if !self.found.contains(&worst.index) => self.found.push(worst.index),
            _ => {}
        }
        for index in &self.found {
            let (effect, sum) = (&self.effects[*index / WIDE], *index % WIDE);
            containment.contain((effect, &self.score_of(*index), sum), covariance);
        }
        self.calibrations.contain(&self.effects, covariance, containment);
        let worst = worst.filter(|w| corrects || self.severity < Some(w.found.severity))?;
        self.severity = self.severity.max(Some(worst.found.severity));
        Some(worst)
    }

    /// Begins to correct the block of a wrong component, and the comparison with all else but what is contained, which
    /// goes on.
    fn calibrate(&mut self, wrong: &Wrong, time: Time) {
        self.calibrations.begin(wrong.index, wrong.found.score.size(), time);
        self.refused.fill(Gated::default());
        let others = (0..self.components.len()).filter(|index| !self.found.contains(index));
        for index in others {
            self.effects[index / WIDE].forget(index % WIDE, time);
        }
    }

    /// Corrects the fixed blocks that were found to be wrong, and returns what their errors have moved the state by.
    pub(super) fn correct(&mut self, state: &mut State, layout: &Layout) -> Option<Correction> {
        let (due, news) = self.calibrations.due()?;
        let mut delta = vec![0.0; layout.tangent];
        for (index, size) in due {
            let Component { of, component, .. } = self.components[index];
            let block = &layout.blocks[of];
            let mut change = [0.0; MAX_TANGENT];
            change[component] = size;
            let change = &change[..block.operations.tangent];
            (block.operations.retract)(&mut state.values[block.range()], change);
            for (row, delta) in delta.iter_mut().enumerate() {
                *delta += moved(&self.effects, index..index + 1, &[size], row);
            }
        }
        Some(Correction { delta, news })
    }

    /// The fixed blocks that are corrected.
    pub(super) fn estimated(&self, state: &State, layout: &Layout) -> Vec<Corrected> {
        self.calibrations.corrected(state, |index| &layout.blocks[self.components[index].of])
    }

    /// Ends a span, and returns the most significant error.
    fn worst(
        &mut self,
        time: Time,
        (covariance, considered): (&Covariance, &[bool]),
        rival: impl Fn(usize) -> f64,
    ) -> Option<Wrong> {
        self.span = time;
        self.effects.iter_mut().for_each(Effect::end_span);
        self.calibrations.measure();
        let states = (covariance, considered);
        let alone =
            (0..self.components.len()).filter_map(|index| self.alone(index, states, &rival));
        let blocks = self.calibrations.blocks().iter();
        let together = blocks.filter_map(|block| self.together(block, states, &rival));
        let found: Vec<Wrong> = alone.chain(together).collect();
        let score = |wrong: &Wrong| wrong.found.score.sigmas().abs();
        let weight = |w: &Wrong| score(w) * self.usual(w.index, &w.found.score);
        found.into_iter().max_by(|a, b| weight(a).total_cmp(&weight(b)))
    }

    /// An error that is significant alone, and leads all others.
    fn alone(
        &self,
        index: usize,
        states: (&Covariance, &[bool]),
        rival: impl Fn(usize) -> f64,
    ) -> Option<Wrong> {
        let of = self.components[index];
        let (effect, sum) = (&self.effects[index / WIDE], index % WIDE);
        let score = self.score_of(index);
        let counts =
            self.linear(index) && self.explains(index) && !self.calibrations.corrects(index);
        let usual = self.usual(index, &score);
        // a larger noise competes with errors that may be in any sensor
        let significance = match of.kind {
            Kind::Fixed => score.sigmas().abs(),
            Kind::Factor | Kind::Input | Kind::Free => score.significance(),
        };
        if !(usual * significance >= SIGNIFICANT && counts) {
            return None;
        }
        // the others count what the gate refused, and so does this one beside them
        if usual * effect.all(sum).sigmas().abs() <= rival(of.sensor) {
            return None;
        }
        let least = leading(self.score(false, |sensor| sensor != of.sensor));
        let found = effect.found((sum, score), least / usual, states, false)?;
        Some(Wrong { found, index, of })
    }

    /// An error of several components of a block that is significant, and leads all others.
    fn together(
        &self,
        block: &Calibration,
        (covariance, considered): (&Covariance, &[bool]),
        rival: impl Fn(usize) -> f64,
    ) -> Option<Wrong> {
        let components = block.components();
        let (score, sensor) = (block.score(), self.components[components.start].sensor);
        if block.corrects || components.len() < 2 || score < SIGNIFICANT {
            return None;
        }
        let gated = |index: usize| {
            let (effect, sum) = (&self.effects[index / WIDE], index % WIDE);
            effect.all(sum).sigmas().powi(2) - effect.used(sum).sigmas().powi(2)
        };
        let gated = components.clone().map(gated).fold(0.0, f64::max);
        let others = leading(self.score(false, |other| other != sensor));
        if score <= others || score.hypot(gated.sqrt()) <= rival(sensor) {
            return None;
        }
        let usual = block.usual(0.0);
        let a: Vec<f64> = usual.estimate().map(|(a, _)| a).collect();
        let moved = |row: usize| moved(&self.effects, components.clone(), &a, row);
        let turned = self.rotations.iter().map(|row| moved(*row).abs());
        let own = if self.turning[self.components[components.start].of] {
            a.iter().map(|a| a * a).sum::<f64>().sqrt()
        } else {
            0.0
        };
        let linear = turned.fold(own, f64::max) < LINEAR;
        if !linear || !components.clone().any(|index| self.explains(index)) {
            return None;
        }
        let largest = usual.estimate().zip(components.clone());
        let ((size, _), index) =
            largest.max_by(|((a, s), _), ((b, t), _)| (a / s).abs().total_cmp(&(b / t).abs()))?;
        let since = self.effects[index / WIDE].since(index % WIDE);
        let score = Score::of(size, score, since);
        let found = Found::new((index % WIDE, score), moved, (covariance, considered), false)?;
        Some(Wrong { found, index, of: self.components[index] })
    }
}
