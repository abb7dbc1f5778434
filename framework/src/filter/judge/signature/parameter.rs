//! Test for a wrong constant of a sensor: a fixed parameter such as its lever arm, the factor of a channel,
//! and the scale factors and axes of the driving sensor.
//!
//! A parameter that is off by the unit size is in the innovations of each sensor that reads it: `d
//! = dh/dp`. A factor is in those of its channel, `d = h(x)`. A scale factor of the driving sensor acts on
//! the state as a bias that follows its samples. Each is off from the start, so that one sum is enough. From
//! a finding on, the covariance contains its effect.

use super::contain::Containment;
use super::effect::{Effect, WIDE, Whitened};
use super::refused::Gated;
use super::score::{SPAN, Score, leading};
use super::wrong::{Shares, Wrong};
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::judge::measured::Measured;
use crate::model::record::finding::{Finding, Severity};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::{Sensor, SensorInfo};
use crate::state::covariance::Covariance;
use crate::state::manifold::Rotation;
use crate::state::{Block, Layout, State};
use crate::units::sample::{Channel, MAX_CHANNELS, channels};
use crate::units::time::Time;
use std::any::TypeId;

/// Score in sigma at which an error is significant, as that of a time offset is: real errors are not Gaussian,
/// and the curvature of a track, which the linear test neglects, gives scores of 5.
const SIGNIFICANT: f64 = 6.0;
/// Largest turn of a rotation to which the test is linear, rad. A fault elsewhere fits a larger
/// turn.
pub(super) const LINEAR: f64 = 0.2;
/// Sigma of a scale factor of the driving sensor, and of the turn of its axes in rad, before any evidence: the
/// data sheets of MEMS state 1 %.
const USUAL: f64 = 0.01;

/// Kind of a constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    /// A component of a fixed block.
    #[default]
    Fixed,
    /// The factor of a channel.
    Factor,
    /// A scale factor or axes of the driving sensor.
    Input,
}

saved!(
    enum Kind {
        Fixed,
        Factor,
        Input,
    }
);

/// A constant that may be wrong.
#[derive(Clone, Copy, Default)]
pub(super) struct Component {
    pub(super) kind: Kind,
    /// Number of the block, of the channel, or of the error of the driving sensor.
    pub(super) of: usize,
    pub(super) component: usize,
    /// Index of the first sensor that reads the block, or of the sensor that has the error.
    pub(super) sensor: usize,
}

saved!(Component { kind, of, component, sensor });

/// Tests of the fixed blocks that sensors read.
#[derive(Clone)]
pub(super) struct Parameters {
    components: Vec<Component>,
    /// Tests of [`WIDE`] components each.
    effects: Vec<Effect<WIDE>>,
    /// Sensors whose blocks are tested, and those whose blocks are in `components`.
    tested: Vec<bool>,
    known: Vec<bool>,
    /// Sensors whose scale is a state.
    scaled: Vec<bool>,
    /// What the gate refused of each sensor.
    refused: Vec<Gated>,
    /// Rows of the error state that are rotations, and blocks that are.
    rotations: Vec<usize>,
    turning: Vec<bool>,
    /// Index of the driving sensor, and the shares of its channels in the rows of its biases, by error.
    inputs: Option<(usize, Vec<Shares>)>,
    /// Sensitivities with the driving samples in them: row, sum, without and with.
    driven: Vec<(usize, usize, f32, f32)>,
    span: Time,
    severity: Option<Severity>,
    /// Components that were found to be wrong.
    found: Vec<usize>,
}

saved!(Parameters {
    components, effects, span, severity, found,
} each {
    known, refused,
} except {
    tested, rotations, turning, inputs, driven, scaled,
});

/// Returns `true` for a channel of a length or a speed, which a wrong unit or scale multiplies.
fn measures(channel: &Channel) -> bool {
    ["m", "mps"].contains(&channel.unit.suffix().as_str())
}

fn turns(block: &Block) -> bool {
    block.operations.kind == TypeId::of::<Rotation>()
}

/// Rows of the error state that are rotations.
pub(super) fn rotations(layout: &Layout) -> Vec<usize> {
    layout.blocks.iter().filter(|block| turns(block)).flat_map(Block::tangent_range).collect()
}

/// Returns `true` if a sensor has an estimated block whose key ends with one of these words.
fn owns(layout: &Layout, sensor: &str, words: &[&str]) -> bool {
    let own = |block: &&Block| block.name.rsplit_once('.').is_some_and(|(part, _)| part == sensor);
    let named = |block: &Block| words.iter().any(|word| block.name.ends_with(word));
    layout.blocks.iter().filter(own).any(|block| block.estimated() && named(block))
}

/// The sensors whose scale is a state: a factor is a step of it, or a prior that does not contain it.
fn scaled(composition: &Composition) -> Vec<bool> {
    let owns = |sensor: &Sensor| owns(&composition.layout, &sensor.info.name, &["scale"]);
    composition.sensors.iter().map(owns).collect()
}

/// The scale factors and the turns of the axes of the driving sensor, whose channels have biases in rows.
fn inputs(composition: &Composition) -> Option<(usize, Vec<Shares>)> {
    let process = composition.processes.iter().find(|process| process.input.is_some())?;
    let sensor = process.input?;
    let blocks = process.biases.iter().map(|slot| &composition.layout.blocks[*slot]);
    let rows: Vec<usize> = blocks.flat_map(Block::tangent_range).collect();
    let Sensor { info, .. } = &composition.sensors[sensor];
    if owns(&composition.layout, &info.name, &["scale", "axes"]) {
        return None;
    }
    let channels = &info.channels;
    // a step in rates is one of the bias
    let rates = channels.iter().all(|c| ["radps", "mps2"].contains(&c.unit.suffix().as_str()));
    if rows.len() != channels.len() || rows.is_empty() || !rates {
        return None;
    }
    let scale = |k: usize| vec![(rows[k], k, 1.0)];
    let turn = |first: usize, axis: usize| {
        let [a, b] = [1, 2].map(|k| 3 * first + (axis + k) % 3);
        vec![(rows[a], b, -1.0), (rows[b], a, 1.0)]
    };
    let turns = (0..rows.len() / 3).flat_map(|first| (0..3).map(move |axis| (first, axis)));
    let all = (0..rows.len()).map(scale).chain(turns.map(|(first, axis)| turn(first, axis)));
    Some((sensor, all.collect()))
}

/// Factor of the score by which a size that is unusual is less likely: `b^2 / (i + 1 / USUAL^2)` is twice the
/// log-likelihood ratio of a size that is a sample of that sigma.
fn usual(kind: Kind, score: &Score) -> f64 {
    match kind {
        Kind::Input => (1.0 + score.variance() / (USUAL * USUAL)).sqrt().recip(),
        Kind::Fixed | Kind::Factor => 1.0,
    }
}

impl Parameters {
    /// Tests of the constants of those sensors.
    pub(super) fn new(tested: Vec<bool>, composition: &Composition) -> Self {
        let layout = &*composition.layout;
        let (known, refused) = (vec![false; tested.len()], vec![Gated::default(); tested.len()]);
        Self {
            components: Vec::new(),
            effects: Vec::new(),
            tested,
            known,
            refused,
            rotations: rotations(layout),
            turning: layout.blocks.iter().map(turns).collect(),
            inputs: inputs(composition),
            driven: Vec::new(),
            scaled: scaled(composition),
            span: Time::MIN,
            severity: None,
            found: Vec::new(),
        }
    }

    /// Begins all tests at the next sample.
    pub(super) fn restart(&mut self) {
        let Self { components, effects, known, refused, span, found, .. } = self;
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

    /// Carries the sensitivities to the present, with the mean of the driving samples.
    pub(super) fn carry(&mut self, changes: &[(usize, usize, f32)], input: &[f64]) {
        let Self { effects, components, inputs, driven, .. } = self;
        let inputs = inputs.as_ref().map_or(&[][..], |(_, inputs)| &inputs[..]);
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
        let shares = shares.map_or(&[][..], |(_, inputs)| &inputs[wrong.of.of]);
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
            Kind::Fixed => 0.0,
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
        let counts = |index: &usize| counts(self.components[*index].sensor) && self.linear(*index);
        let scores = (0..self.components.len()).filter(counts).map(of);
        scores.fold(0.0, f64::max)
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
            for component in 0..fixed.operations.tangent {
                self.add(Component { kind: Kind::Fixed, of: block, component, sensor }, at);
            }
        }
        let scaled = self.scaled[sensor];
        let lengths = info.channels.iter().enumerate();
        let lengths = lengths.filter(|(_, c)| measures(c) && !scaled);
        for (channel, _) in lengths {
            let (kind, component) = (Kind::Factor, 0);
            self.add(Component { kind, of: channel, component, sensor }, at);
        }
    }

    /// Adds the scale factors and axes of the driving sensor.
    fn add_inputs(&mut self, at: &At<'_>) {
        let Some((sensor, inputs)) = &self.inputs else { return };
        let (sensor, kind, component) = (*sensor, Kind::Input, 0);
        (0..inputs.len()).for_each(|of| self.add(Component { kind, of, component, sensor }, at));
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
            self.add_inputs(at);
        }
        let tested = self.tested[index];
        if tested && !self.known[index] {
            self.add_sensor(index, sample, info, at);
        }
        self.refused[index].take(sample);
        let rows = || channels(present).enumerate().take(sample.update.m);
        let mut g = [[0.0; WIDE]; MAX_CHANNELS];
        for (effect, components) in self.effects.iter_mut().zip(self.components.chunks(WIDE)) {
            effect.seen(sample.update, &mut g);
            for (sum, &Component { kind, of, component, sensor }) in components.iter().enumerate() {
                match kind {
                    Kind::Fixed if tested && sample.update.read.contains(of) => {
                        let mut d = [0.0; MAX_CHANNELS];
                        model.derivative(at, of, component, &mut d[..model.channels()]);
                        let known = rows().filter(|(_, channel)| d[*channel].is_finite());
                        known.for_each(|(row, channel)| g[row][sum] += d[channel] as f32);
                    }
                    Kind::Factor if sensor == index => {
                        if let Some((row, channel)) = rows().find(|(_, channel)| *channel == of) {
                            let measured = at.sample.get(channel).unwrap_or_default();
                            g[row][sum] += (measured - sample.update.innovation[row]) as f32;
                        }
                    }
                    _ => {}
                }
            }
            effect.take(sample, &g);
        }
    }

    /// Widens the covariance where it does not contain the errors that were found. Ends a span
    /// where one is due, and returns the most significant error that is more severe than those
    /// before. `rival` is the score that an error of a sensor has to exceed.
    pub(super) fn corrected(
        &mut self,
        time: Time,
        (covariance, considered): (&mut Covariance, &[bool]),
        containment: &mut Containment,
        rival: impl Fn(usize) -> f64,
    ) -> Option<Wrong> {
        let due = time.since(self.span) >= SPAN;
        let worst = due.then(|| self.worst(time, (covariance, considered), rival)).flatten();
        if let Some(worst) = &worst
            && !self.found.contains(&worst.index)
        {
            self.found.push(worst.index);
        }
        for index in &self.found {
            let (effect, sum) = (&self.effects[*index / WIDE], *index % WIDE);
            containment.contain((effect, &self.score_of(*index), sum), covariance);
        }
        let worst = worst.filter(|worst| self.severity < Some(worst.found.severity))?;
        self.severity = Some(worst.found.severity);
        Some(worst)
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
        let found = self.components.iter().enumerate().filter_map(|(index, of)| {
            let (effect, sum) = (&self.effects[index / WIDE], index % WIDE);
            let score = self.score_of(index);
            let counts = self.linear(index) && self.explains(index);
            let usual = self.usual(index, &score);
            // a larger noise competes with errors that may be in any sensor
            let significance = match of.kind {
                Kind::Fixed => score.sigmas().abs(),
                Kind::Factor | Kind::Input => score.significance(),
            };
            if !(usual * significance >= SIGNIFICANT && counts) {
                return None;
            }
            // the others count what the gate refused, and so does this one beside them
            if usual * effect.all(sum).sigmas().abs() <= rival(of.sensor) {
                return None;
            }
            let least = leading(self.score(false, |sensor| sensor != of.sensor));
            let found =
                effect.found((sum, score), least / usual, (covariance, considered), false)?;
            Some(Wrong { found, index, of: *of })
        });
        let score = |wrong: &Wrong| wrong.found.score.sigmas().abs();
        let weight = |w: &Wrong| score(w) * self.usual(w.index, &w.found.score);
        found.max_by(|a, b| weight(a).total_cmp(&weight(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A size of 7 % +- 1 % is 7 sigma. Beside a prior of 1 % it is `7 / sqrt(2)`: the prior explains half of it.
    #[test]
    fn a_scale_of_an_imu_that_is_unusual_needs_more_evidence() {
        let mut score = Score::new(Time::MIN);
        score.add(700.0, 1e4, 1e4);
        assert!((score.size() - 0.07).abs() < 1e-12 && (score.sigmas() - 7.0).abs() < 1e-12);
        assert!((usual(Kind::Input, &score) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(usual(Kind::Factor, &score), 1.0);
    }
}
