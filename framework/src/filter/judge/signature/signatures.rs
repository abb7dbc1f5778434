//! All tests of a filter.

use super::bias_step::BiasSteps;
use super::contain::Containment;
use super::effect::Whitened;
use super::offset::{self, Offset};
use super::parameter::Parameters;
use super::score::leading;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::judge::measured::Measured;
use crate::model::record::finding::Finding;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::{Role, Sensor};
use crate::state::covariance::{Covariance, Transition, Update, backward, cholesky, forward};
use crate::state::{Dynamics, Layout, Mode, State};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Largest number of sensors that are tested. Every test follows the samples of all sensors, so that
/// without a bound a run of many sensors would cost the square of their number.
const TESTED: usize = 64;

/// What the filter does about an offset, and about a wrong parameter.
const TAKEN_OFF: &str = "; the filter takes it off from now on, and not before";
const CONTAINED: &str = "; the covariance contains it from now on, and not before";

/// Score tests of the sensors.
#[derive(Clone)]
pub(in crate::filter) struct Signatures {
    offsets: Vec<Option<Offset>>,
    steps: Option<BiasSteps>,
    parameters: Parameters,
    containment: Containment,
    /// Row and column of each element of `Phi`, and its value in the identity.
    places: Vec<(usize, usize, f64)>,
    /// Elements of `Phi - I` that are not zero.
    changes: Vec<(usize, usize, f64)>,
    /// Times up to which the sensitivities are carried, and up to which the state is, and the length
    /// of the last step, s.
    settled: Time,
    time: Time,
    step: f64,
}

saved!(Signatures {
    parameters, containment, settled, time, step,
} each {
    offsets, steps,
} except {
    places, changes,
});

/// True for a sensor whose samples can show an error that stays.
fn suits(sensor: &Sensor) -> bool {
    let Role::Measurement(model) = &sensor.role else { return false };
    let judged = !sensor.constraint && sensor.detector.is_none();
    judged && !sensor.is_noise_free() && model.observations() == 1
}

/// The sensors that are tested: the first ones that suit.
fn tested(sensors: &[Sensor]) -> Vec<bool> {
    let mut left = TESTED;
    let tested = |sensor| {
        let tested = left > 0 && suits(sensor);
        left -= usize::from(tested);
        tested
    };
    sensors.iter().map(tested).collect()
}

/// The note of a run with more sensors than are tested.
pub(crate) fn untested(sensors: &[Sensor]) -> Option<String> {
    let count = sensors.iter().filter(|sensor| suits(sensor)).count();
    (count > TESTED).then(|| {
        format!(
            "only the first {TESTED} of {count} sensors are tested for offsets and wrong parameters"
        )
    })
}

/// Test for steps of the constant biases of the first driving sensor.
fn bias_steps(composition: &Composition) -> Option<BiasSteps> {
    let layout = &*composition.layout;
    let process = composition.processes.iter().find(|process| process.input.is_some())?;
    let blocks = process.biases.iter().map(|slot| &layout.blocks[*slot]);
    let constant = blocks.filter(|b| b.estimated() && b.spec.dynamics == Dynamics::Constant);
    let rows = constant.flat_map(|b| b.tangent_range());
    BiasSteps::new(process.input?, rows, layout.tangent)
}

fn of(offset: &Option<Offset>) -> f64 {
    offset.as_ref().map_or(0.0, Offset::score)
}

/// Score of the most significant of some offsets.
fn best(offsets: &[Option<Offset>]) -> f64 {
    offsets.iter().map(of).fold(0.0, f64::max)
}

/// The offset of a sensor, and the score that it has to exceed: another error of the sensor has to be
/// less likely, and one of another sensor clearly so.
fn rivals<'a>(
    index: usize,
    offsets: &'a mut [Option<Offset>],
    steps: Option<&'a BiasSteps>,
    parameters: &'a Parameters,
) -> (Option<&'a mut Offset>, impl Fn() -> f64 + 'a) {
    let (before, rest) = offsets.split_at_mut(index);
    let (offset, after) = match rest.split_first_mut() {
        Some((offset, after)) => (offset.as_mut(), after),
        None => (None, Default::default()),
    };
    let (before, after) = (&*before, &*after);
    let rival = move || {
        let stepped = steps.map_or(0.0, BiasSteps::score);
        let others = stepped.max(best(before)).max(best(after));
        let others = others.max(parameters.score(true, |sensor| sensor != index));
        parameters.score(true, |sensor| sensor == index).max(leading(others))
    };
    (offset, rival)
}

impl Signatures {
    /// Tests of a composition for offsets that are not estimated and biases that are constant;
    /// `None` where the innovations of a consistent filter are not white, where blocks come and go,
    /// or where sensors read past states.
    pub(in crate::filter) fn new(
        composition: &Composition,
        transition: &Transition,
    ) -> Option<Self> {
        let layout = &*composition.layout;
        let considers = layout.blocks.iter().any(|b| b.spec.mode == Mode::Consider);
        if considers || layout.labels > 0 || !layout.clones.is_empty() {
            return None;
        }
        let tested = tested(&composition.sensors);
        let offsets = composition.sensors.iter().zip(&tested).map(|(sensor, tested)| {
            let tested = *tested && sensor.time_offset.is_none();
            tested.then(|| Offset::new(layout.tangent))
        });
        let offsets: Vec<_> = offsets.collect();
        let steps = bias_steps(composition);
        if !tested.contains(&true) && steps.is_none() {
            return None;
        }
        let identity = transition.identity();
        let places = transition.places().iter().zip(identity);
        let places: Vec<_> = places.map(|(&(i, j), one)| (i, j, one)).collect();
        let changes = Vec::with_capacity(places.len());
        let parameters = Parameters::new(tested, layout);
        let (settled, time) = (Time::MIN, Time::MIN);
        let containment = Containment::new(composition);
        Some(Self {
            offsets,
            steps,
            parameters,
            containment,
            places,
            changes,
            settled,
            time,
            step: 0.0,
        })
    }

    /// Records a propagation of the state to a time.
    #[inline]
    pub(in crate::filter) fn moved(&mut self, time: Time) {
        self.step = if self.time == Time::MIN { 0.0 } else { time.since(self.time) };
        self.time = time;
    }

    /// Carries the sensitivities to the present with the rate of the last step, which changes little
    /// between two corrections: `s := s + (Phi - I) s t / dt`.
    fn settle(&mut self, transition: &Transition) {
        let since = std::mem::replace(&mut self.settled, self.time);
        if since == Time::MIN || self.step <= 0.0 {
            return;
        }
        let steps = self.time.since(since) / self.step;
        let Self { offsets, steps: biases, parameters, places, changes, .. } = self;
        let all = places.iter().zip(transition.elements());
        let all = all.map(|(&(i, j, one), (.., phi))| (i, j, steps * (phi - one)));
        changes.clear();
        changes.extend(all.filter(|change| change.2 != 0.0));
        let offsets = offsets.iter_mut().flatten().map(Offset::effect);
        let effects = offsets.chain(biases.iter_mut().flat_map(BiasSteps::effects));
        let changes = &*changes;
        for effect in effects.chain(parameters.effects()) {
            effect.carry(changes);
        }
    }

    /// Takes a sample before the state is corrected, which counts with a weight: below one if the gate
    /// refused it, and the state is not corrected. Call after [`Update::apply`].
    pub(in crate::filter) fn take(
        &mut self,
        (Measured { sensor: index, present }, weight): (Measured, Option<f64>),
        model: &dyn AnyMeasurement,
        (at, transition): (&At<'_>, &Transition),
        update: &Update,
        lower: &mut Vec<f64>,
    ) {
        self.settle(transition);
        let m = update.m;
        if !cholesky(&update.s, m, lower) {
            return;
        }
        let mut y = [0.0; MAX_CHANNELS];
        y[..m].copy_from_slice(&update.innovation[..m]);
        forward(lower, m, &mut y[..m]);
        backward(lower, m, &mut y[..m]);
        let (used, weight) = (weight.is_none(), weight.unwrap_or(1.0));
        let (sample, time) = (Whitened { update, lower, y, weight, used }, at.state.time);
        for (k, offset) in self.offsets.iter_mut().enumerate() {
            let Some(offset) = offset else { continue };
            let own = k == index;
            if own {
                offset.follow(model, at);
            }
            // a sample that is refused is evidence on its own sensor
            if own || used {
                offset.take(&sample, time, own.then_some(present));
            }
            if own && !used {
                offset.keep(at.state);
            }
        }
        if let Some(steps) = self.steps.as_mut().filter(|_| used) {
            steps.take(&sample, time);
        }
        self.parameters.take(Measured { sensor: index, present }, &sample, model, at);
    }

    /// Restarts the tests for steps and offsets: the errors up to a recovery are those of another fault.
    pub(in crate::filter) fn recovered(&mut self) {
        let Self { offsets, steps, time, .. } = self;
        steps.iter_mut().for_each(BiasSteps::restart);
        offsets.iter_mut().flatten().for_each(|offset| offset.restart(*time));
    }

    /// Takes an offset that was found off a sample of its sensor.
    pub(in crate::filter) fn compensate(
        &self,
        index: usize,
        model: &dyn AnyMeasurement,
        at: &At<'_>,
        update: &mut Update,
        present: u16,
    ) {
        if let Some(offset) = self.offsets[index].as_ref().filter(|o| o.compensates()) {
            offset.compensate(model, at, update, present);
        }
    }

    /// Returns `true` if an offset is taken off the samples of a sensor.
    pub(in crate::filter) fn compensates(&self, index: usize) -> bool {
        self.offsets[index].as_ref().is_some_and(Offset::compensates)
    }

    /// Takes the offset of a sensor off that was just found, and returns what it has moved the state by.
    /// The other tests begin again, since they followed the innovations with that offset.
    pub(in crate::filter) fn adopt(&mut self, index: usize) -> Option<Vec<f64>> {
        let Self { offsets, steps, parameters, time, .. } = self;
        let delta = offsets[index].as_mut()?.adopt(*time)?;
        let others = offsets.iter_mut().enumerate().filter(|(k, _)| *k != index);
        others.filter_map(|(_, offset)| offset.as_mut()).for_each(|offset| offset.restart(*time));
        steps.iter_mut().for_each(BiasSteps::restart);
        parameters.restart();
        Some(delta)
    }

    /// Names an offset of a sensor of which the gate is about to refuse another sample, if that explains
    /// those before. If it refuses many in a row, an offset that is taken off was none. Returns what it
    /// finds, and whether the samples are explained.
    pub(in crate::filter) fn explain(
        &mut self,
        (index, sensor, insists): (usize, &str, bool),
        (layout, state): (&Layout, &State),
        (covariance, considered): (&Covariance, &[bool]),
    ) -> (Option<Finding>, bool) {
        let Self { offsets, steps, parameters, containment, .. } = self;
        containment.begin(state.time);
        let (offset, rival) = rivals(index, offsets, steps.as_ref(), parameters);
        let Some(offset) = offset else { return (None, false) };
        let found = offset.refused((covariance, considered), containment, rival);
        if !offset.adopts() && insists && offset.withdraw() {
            return (Some(offset::withdrawn(state.time, sensor)), true);
        }
        let finding = |lag| offset::finding(&lag, state.time, sensor, layout);
        let finding = found.map(|lag| containment.noted(finding(lag), TAKEN_OFF));
        (finding, offset.adopts())
    }

    /// Follows a corrected state, and reports what it finds about the sensor, its parameters and the
    /// biases. The covariance contains what is found. Returns `true` if it was widened.
    pub(in crate::filter) fn corrected<'a>(
        &mut self,
        index: usize,
        (layout, state): (&Layout, &State),
        (covariance, considered): (&mut Covariance, &[bool]),
        sensor: impl Fn(usize) -> &'a str,
        mut report: impl FnMut(Finding),
    ) -> bool {
        let time = state.time;
        let Self { offsets, steps, parameters, containment, .. } = self;
        containment.begin(time);
        if let Some(steps) = steps {
            let states = (&mut *covariance, considered);
            let rival = || best(offsets).max(parameters.score(false, |_| true));
            if let Some(step) = steps.corrected(time, states, containment, rival) {
                report(step.finding(time, sensor(steps.sensor), layout));
            }
        }
        let (offset, rival) = rivals(index, offsets, steps.as_ref(), parameters);
        let states = (&mut *covariance, considered);
        let found = offset.and_then(|offset| offset.corrected(state, states, containment, rival));
        if let Some(found) = found {
            let finding = offset::finding(&found, time, sensor(index), layout);
            report(containment.noted(finding, TAKEN_OFF));
        }
        let stepped = || steps.as_ref().map_or(0.0, BiasSteps::score);
        let rival = |sensor: usize| {
            let (before, rest) = offsets.split_at(sensor);
            let after = rest.get(1..).unwrap_or_default();
            let others = stepped().max(best(before)).max(best(after));
            of(&offsets[sensor]).max(leading(others))
        };
        let states = (covariance, considered);
        if let Some(wrong) = parameters.corrected(time, states, containment, rival) {
            let finding = wrong.finding(state, sensor(wrong.sensor()), layout);
            report(containment.noted(finding, CONTAINED));
        }
        std::mem::take(&mut containment.widened)
    }
}
