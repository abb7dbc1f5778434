//! Test for a wrong value of a fixed parameter of a sensor, such as its lever arm.
//!
//! A parameter that is off by the unit size is in the innovations of each sensor that reads it: `d
//! = dh/dp`. It is off from the start, so that one sum is enough. From a finding on, the covariance
//! contains its effect.

use super::contain::Containment;
use super::effect::{Effect, Found, SUMS, Whitened};
use super::score::{SPAN, leading};
use crate::checkpoint::saved;
use crate::filter::judge::measured::Measured;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::Covariance;
use crate::state::manifold::{MAX_TANGENT, Rotation};
use crate::state::{Block, Layout, State};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use std::any::TypeId;

/// Score in sigma at which an error is significant, as that of a time offset is.
const SIGNIFICANT: f64 = 6.0;
/// Largest turn of a rotation to which the test is linear, rad. A fault elsewhere fits a larger
/// turn.
const LINEAR: f64 = 0.2;

/// Component of a fixed block.
#[derive(Clone, Copy, Default)]
struct Component {
    block: usize,
    component: usize,
    /// Index of the first sensor that reads the block.
    sensor: usize,
}

saved!(Component { block, component, sensor });

/// Tests of the fixed blocks that sensors read.
#[derive(Clone)]
pub(super) struct Parameters {
    components: Vec<Component>,
    /// Tests of [`SUMS`] components each.
    effects: Vec<Effect>,
    /// Sensors whose blocks are tested, and those whose blocks are in `components`.
    tested: Vec<bool>,
    known: Vec<bool>,
    /// Rows of the error state that are rotations, and blocks that are.
    rotations: Vec<usize>,
    turning: Vec<bool>,
    span: Time,
    severity: Option<Severity>,
    /// Components that were found to be wrong.
    found: Vec<usize>,
}

saved!(Parameters {
    components, effects, span, severity, found,
} each {
    known,
} except {
    tested, rotations, turning,
});

/// A significant error of a parameter.
pub(super) struct Wrong {
    found: Found,
    index: usize,
    of: Component,
}

fn turns(block: &Block) -> bool {
    block.operations.kind == TypeId::of::<Rotation>()
}

impl Wrong {
    /// Index of the sensor.
    pub(super) fn sensor(&self) -> usize {
        self.of.sensor
    }

    /// Finding about the sensor.
    pub(super) fn finding(&self, state: &State, sensor: &str, layout: &Layout) -> Finding {
        let Self { ref found, of: Component { block, component, .. }, .. } = *self;
        let block = &layout.blocks[block];
        let n = block.operations.tangent;
        let shown = |delta: f64| {
            let (mut at, mut shown) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            at[component] = delta;
            let mut values = state.values.clone();
            (block.operations.retract)(&mut values[block.range()], &at[..n]);
            block.show(&values, &mut shown);
            shown[component]
        };
        let (display, size) = (&block.spec.display, found.score.size());
        let decimals = (1.5 - (size / display.scale).abs().log10()).clamp(0.0, 9.0) as usize;
        let with_unit = |value: f64| format!("{value:.decimals$} {}", display.unit);
        let axis = display.components.get(component).copied().unwrap_or_default();
        let name = format!("{} {axis}", block.name);
        let key = block.name.rsplit_once('.').map_or(&*block.name, |(_, key)| key);
        Finding {
            time: state.time,
            about: sensor.to_owned(),
            severity: found.severity,
            basis: Basis::Explanation,
            text: format!(
                "its samples fit {} for {}, which is fixed at {} ({:.1} sigma): this has moved {}",
                with_unit(shown(size)).trim_end(),
                name.trim_end(),
                with_unit(shown(0.0)).trim_end(),
                found.score.sigmas().abs(),
                found.moved(layout),
            ),
            remedy: format!(
                "measure it, or estimate it (not tried) with {key} = {{ sigma = \"{}\" }}",
                with_unit((2.0 * size / display.scale).abs()).trim_end(),
            ),
        }
    }
}

impl Parameters {
    /// Tests of the blocks of those sensors.
    pub(super) fn new(tested: Vec<bool>, layout: &Layout) -> Self {
        let known = vec![false; tested.len()];
        let rotations = layout.blocks.iter().filter(|block| turns(block));
        let rotations = rotations.flat_map(Block::tangent_range).collect();
        Self {
            components: Vec::new(),
            effects: Vec::new(),
            tested,
            known,
            rotations,
            turning: layout.blocks.iter().map(turns).collect(),
            span: Time::MIN,
            severity: None,
            found: Vec::new(),
        }
    }

    /// Begins all tests at the next sample.
    pub(super) fn restart(&mut self) {
        let Self { components, effects, known, span, found, .. } = self;
        components.clear();
        effects.clear();
        known.fill(false);
        found.clear();
        *span = Time::MIN;
    }

    pub(super) fn effects(&mut self) -> impl Iterator<Item = &mut Effect> {
        self.effects.iter_mut()
    }

    /// Returns `true` if the size of an error is within the range of the test.
    fn linear(&self, index: usize) -> bool {
        let (effect, sum) = (&self.effects[index / SUMS], index % SUMS);
        let size = effect.scores[sum].size();
        let turned = self.rotations.iter().map(|row| (size * effect.s[*row][sum]).abs());
        let own = if self.turning[self.components[index].block] { size.abs() } else { 0.0 };
        turned.fold(own, f64::max) < LINEAR
    }

    /// Score in sigma of the most significant error of the sensors that count, within the range of
    /// the test, by all samples or by those that the gate did not refuse.
    pub(super) fn score(&self, all: bool, counts: impl Fn(usize) -> bool) -> f64 {
        let of = |index: usize| {
            let effect = &self.effects[index / SUMS];
            let scores = if all { &effect.all } else { &effect.scores };
            scores[index % SUMS].sigmas().abs()
        };
        let counts = |index: &usize| counts(self.components[*index].sensor) && self.linear(*index);
        let scores = (0..self.components.len()).filter(counts).map(of);
        scores.fold(0.0, f64::max)
    }

    /// Adds the fixed blocks that a sensor reads.
    fn add(&mut self, sensor: usize, sample: &Whitened<'_>, at: &At<'_>) {
        self.known[sensor] = true;
        for block in sample.update.read.slots() {
            let fixed = &at.layout.blocks[block];
            if fixed.tangent.is_some() || self.components.iter().any(|c| c.block == block) {
                continue;
            }
            for component in 0..fixed.operations.tangent {
                let sum = self.components.len() % SUMS;
                if sum == 0 {
                    self.effects.push(Effect::new(at.layout.tangent));
                }
                if let Some(effect) = self.effects.last_mut() {
                    effect.renew(sum, at.state.time);
                }
                self.components.push(Component { block, component, sensor });
            }
        }
    }

    /// Takes the sample of a sensor, of which some channels are present.
    pub(super) fn take(
        &mut self,
        Measured { sensor: index, present }: Measured,
        sample: &Whitened<'_>,
        model: &dyn AnyMeasurement,
        at: &At<'_>,
    ) {
        if self.span == Time::MIN {
            self.span = at.state.time;
        }
        let tested = self.tested[index];
        if tested && !self.known[index] {
            self.add(index, sample, at);
        }
        for (effect, components) in self.effects.iter_mut().zip(self.components.chunks(SUMS)) {
            let mut g = effect.seen(sample.update);
            for (sum, &Component { block, component, .. }) in components.iter().enumerate() {
                if !tested || !sample.update.read.contains(block) {
                    continue;
                }
                let mut d = [0.0; MAX_CHANNELS];
                model.derivative(at, block, component, &mut d[..model.channels()]);
                let channels = (0..MAX_CHANNELS).filter(|channel| present >> channel & 1 == 1);
                for (g, channel) in g.iter_mut().zip(channels).take(sample.update.m) {
                    g[sum] += if d[channel].is_finite() { d[channel] } else { 0.0 };
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
            let (effect, sum) = (&self.effects[index / SUMS], index % SUMS);
            containment.contain((effect, &effect.scores[sum], sum), covariance);
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
        self.effects().for_each(Effect::end_span);
        let tests = self.effects.iter().zip(self.components.chunks(SUMS)).enumerate();
        let found = tests.filter_map(|(k, (effect, components))| {
            let counts = |sum: usize| {
                let Some(of) = components.get(sum) else { return false };
                let score = effect.scores[sum].sigmas().abs();
                let other = self.score(false, |sensor| sensor != of.sensor);
                self.linear(k * SUMS + sum) && score > rival(of.sensor).max(leading(other))
            };
            let found = effect.worst(
                &effect.scores,
                (SIGNIFICANT, counts),
                (covariance, considered),
                false,
            )?;
            Some(Wrong { found, index: k * SUMS + found.sum, of: components[found.sum] })
        });
        let weight = |wrong: &Wrong| wrong.found.score.sigmas().abs();
        found.max_by(|a, b| weight(a).total_cmp(&weight(b)))
    }
}
