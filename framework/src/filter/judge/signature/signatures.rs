//! All tests of a filter.

use super::calibrations::Correction;
use super::contain::Containment;
use super::effect::Whitened;
use super::lag;
use super::lanes::{Changes, Jacobian};
use super::offset::Offset;
use super::parameter::Parameters;
use super::rivals::{Known, Refuses, of_a_constant, of_a_shift, of_an_offset};
use super::shifts::Shifts;
use super::spread::Spread;
use super::tested::tested;
use super::treatment::{Explained, Refusal, Treatment};
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::judge::measured::Measured;
use crate::model::record::Corrected;
use crate::model::record::finding::{Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::{Covariance, Transition, Update, backward, cholesky, forward};
use crate::state::{Layout, Mode, State};
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;

/// What the filter does about an offset, and about a wrong parameter.
const TAKEN_OFF: &str = "; the filter takes it off from now on, and not before";
const CONTAINED: &str = "; the covariance contains it from now on, and not before";
const ESTIMATED: &str = "; the filter estimates it from now on, and not before";
/// What the filter does about a step of a state.
const STEPPED: &str = "; the covariance contains it from now on";

/// Score tests of the sensors.
#[derive(Clone)]
pub(in crate::filter) struct Signatures {
    offsets: Vec<Option<Offset>>,
    shifts: Option<Shifts>,
    parameters: Parameters,
    containment: Containment,
    /// Row and column of each element of `Phi`, its value in the identity, and its number, by row.
    places: Vec<(usize, usize, f64, usize)>,
    /// Elements of `Phi`, and of `Phi - I` those that are not zero, by row.
    phi: Vec<f64>,
    elements: Vec<(usize, usize, f32)>,
    changes: Changes,
    /// Gain and `H` of a sample.
    gain: Vec<f32>,
    jacobian: Jacobian,
    /// Times up to which the sensitivities and the state are carried, and the length of the last step, s.
    settled: Time,
    time: Time,
    step: f64,
    /// Integral of the driving samples since the sensitivities were carried.
    input: [f64; MAX_CHANNELS],
    /// Noise of the innovations of each sensor.
    spread: Vec<Spread>,
    /// Sensor whose error makes the result useless: what others seem to have is its effect.
    culprit: Option<usize>,
    /// Set since a recovery: it is not known which side was wrong up to then.
    recovered: bool,
    /// Index of the driving sensor.
    driver: Option<usize>,
}

saved!(Signatures {
    parameters, containment, settled, time, step, input, culprit, recovered,
} each {
    offsets, shifts, spread,
} except {
    places, phi, elements, changes, gain, jacobian, driver,
});

impl Signatures {
    /// Tests of a composition for offsets that are not estimated and biases that are constant;
    /// `None` where the scenario asks for none, where the innovations of a consistent filter are not
    /// white, where blocks come and go, or where sensors read past states.
    pub(in crate::filter) fn new(
        composition: &Composition,
        transition: &Transition,
    ) -> Option<Self> {
        let layout = &*composition.layout;
        let considers = layout.blocks.iter().any(|b| b.spec.mode == Mode::Consider);
        let asked = composition.estimator.hidden_errors;
        if !asked || considers || layout.labels > 0 || !layout.clones.is_empty() {
            return None;
        }
        let tested = tested(&composition.sensors);
        let offsets = composition.sensors.iter().zip(&tested).map(|(sensor, tested)| {
            let tested = *tested && sensor.time_offset.is_none();
            tested.then(|| Offset::new(layout.tangent))
        });
        let offsets: Vec<_> = offsets.collect();
        let shifts = Shifts::new(composition, &tested);
        if !tested.contains(&true) && shifts.is_none() {
            return None;
        }
        let identity = transition.identity();
        let places = transition.places().iter().zip(identity);
        let places = places.enumerate();
        let mut places: Vec<_> = places.map(|(at, (&(i, j), one))| (i, j, one, at)).collect();
        places.sort_unstable_by_key(|&(i, j, _, at)| (i, j, at));
        let elements = Vec::with_capacity(places.len());
        let parameters = Parameters::new(tested, composition);
        let (settled, time) = (Time::MIN, Time::MIN);
        let containment = Containment::new(composition);
        Some(Self {
            offsets,
            shifts,
            parameters,
            containment,
            places,
            phi: Vec::new(),
            elements,
            changes: Changes::default(),
            gain: Vec::new(),
            jacobian: Jacobian::default(),
            settled,
            time,
            step: 0.0,
            input: [0.0; MAX_CHANNELS],
            spread: vec![Spread::default(); composition.sensors.len()],
            culprit: None,
            recovered: false,
            driver: composition.driver(),
        })
    }

    /// Records a propagation of the state to a time.
    #[inline]
    pub(in crate::filter) fn moved(&mut self, time: Time) {
        self.step = if self.time == Time::MIN { 0.0 } else { time.since(self.time) };
        self.time = time;
    }

    /// Takes a driving sample that holds for that time, s.
    #[inline]
    pub(in crate::filter) fn driven(&mut self, sample: &Sample, duration: f64) {
        for (k, sum) in self.input.iter_mut().enumerate() {
            *sum += duration * sample.get(k).unwrap_or_default();
        }
    }

    /// Carries the sensitivities to the present with the rate of the last step, which changes little
    /// between two corrections: `s := s + (Phi - I) s t / dt`.
    fn settle(&mut self, transition: &Transition) {
        let since = std::mem::replace(&mut self.settled, self.time);
        let input = std::mem::take(&mut self.input);
        if since == Time::MIN || self.step <= 0.0 || self.time <= since {
            return;
        }
        let duration = self.time.since(since);
        let (steps, input) = (duration / self.step, input.map(|sum| sum / duration));
        let Self { offsets, shifts, parameters, places, phi, elements, changes, .. } = self;
        phi.clear();
        phi.extend(transition.elements().map(|(.., value)| value));
        let all = places.iter().map(|&(i, j, one, at)| (i, j, (steps * (phi[at] - one)) as f32));
        elements.clear();
        elements.extend(all.filter(|change| change.2 != 0.0));
        changes.take(elements);
        let offsets = offsets.iter_mut().flatten().map(Offset::effect);
        offsets.for_each(|effect| effect.carry(changes));
        shifts.iter_mut().for_each(|shifts| shifts.carry(changes));
        parameters.carry(changes, &input, duration);
    }

    /// Takes a sample before the state is corrected. Call after [`Update::apply`].
    pub(in crate::filter) fn take(
        &mut self,
        (Measured { sensor: index, present }, treatment): (Measured, Treatment),
        (model, info): (&dyn AnyMeasurement, &SensorInfo),
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
        let known = self.spread[index].take(present, &y[..m]);
        backward(lower, m, &mut y[..m]);
        let Treatment { weight, used, calm, isolated } = treatment;
        let near = weight * self.spread[index].noise().sqrt();
        let Self { offsets, shifts, parameters, gain, jacobian, .. } = self;
        gain.clear();
        gain.extend(update.gain().iter().map(|gain| *gain as f32));
        jacobian.take(update);
        let sample = Whitened { update, lower, gain, jacobian, y, weight, used };
        let time = at.state.time;
        let scaled = Whitened { weight: weight * known, ..sample };
        for (k, offset) in offsets.iter_mut().enumerate() {
            let Some(offset) = offset else { continue };
            let own = k == index;
            if own {
                offset.follow(model, at);
            }
            // a sample that is refused is evidence on its own sensor
            if own || used {
                offset.take(&scaled, time, own.then_some(present));
            }
            if own && !used {
                offset.keep(at.state);
            }
            if calm && used {
                offset.calm(time);
            }
        }
        // the evidence has decided against a sensor that is isolated
        if isolated {
            return;
        }
        if let Some(shifts) = shifts {
            shifts.take(Measured { sensor: index, present }, (&scaled, near), (time, calm));
        }
        parameters.take(Measured { sensor: index, present }, &scaled, (model, info), at);
    }

    /// Restarts the tests for steps and offsets: the errors up to a recovery are those of another fault.
    pub(in crate::filter) fn recovered(&mut self) {
        let Self { offsets, shifts, time, recovered, .. } = self;
        *recovered = true;
        shifts.iter_mut().for_each(Shifts::restart);
        offsets.iter_mut().flatten().for_each(|offset| offset.restart(*time));
    }

    /// Begins the comparison again: the evidence has decided against a sensor that is isolated.
    pub(in crate::filter) fn isolated(&mut self) {
        self.shifts.iter_mut().for_each(Shifts::restart);
        self.parameters.isolated();
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
        let Self { offsets, shifts, parameters, time, .. } = self;
        let delta = offsets[index].as_mut()?.adopt(*time)?;
        let others = offsets.iter_mut().enumerate().filter(|(k, _)| *k != index);
        others.filter_map(|(_, offset)| offset.as_mut()).for_each(|offset| offset.restart(*time));
        shifts.iter_mut().for_each(Shifts::restart);
        parameters.restart();
        Some(delta)
    }

    /// Names an offset of a sensor of which the gate is about to refuse another sample, or an error of the driving
    /// sensor, if that explains those before. If the gate refuses many in a row, an offset that is taken off was none.
    pub(in crate::filter) fn explain<'a>(
        &mut self,
        Refusal { sensor: index, insists, shared }: Refusal,
        (layout, state): (&Layout, &State),
        (covariance, considered): (&mut Covariance, &[bool]),
        sensor: &dyn Fn(usize) -> &'a SensorInfo,
    ) -> Explained {
        let Self { offsets, shifts, parameters, containment, culprit, recovered, driver, .. } =
            self;
        let known = Known { parameters, culprit: *culprit, driver: *driver };
        containment.begin(state.time);
        let name = &sensor(index).name;
        let lag = {
            let of = (index, if shared { Refuses::Several } else { Refuses::One });
            let (offset, rival) = of_an_offset(of, offsets, shifts.as_ref(), known);
            offset.and_then(|offset| {
                let found = offset.refused((&*covariance, considered), containment, rival);
                if !offset.adopts() && insists && offset.withdraw() {
                    return Some(Some(lag::withdrawn(state.time, name)));
                }
                // these samples are too few to show which clock is wrong
                let finding = |lag| lag::finding(&lag, state.time, (name, None), layout);
                let finding = found.map(|lag| containment.noted(finding(lag), TAKEN_OFF));
                offset.adopts().then_some(finding)
            })
        };
        if let Some(finding) = lag {
            return Explained::Offset(finding);
        }
        let rival = |sensor| of_a_shift((sensor, true), offsets, known);
        let states = (covariance, considered);
        let decides = shared || !(*recovered || containment.is_off());
        let step = shifts.as_mut().filter(|_| decides).and_then(|shifts| {
            let alone = (!shared).then_some(index);
            let step = shifts.refused((state.time, alone), states, containment, rival)?;
            let about = shifts.sensor(&step);
            let finding = shifts.finding(&step, sensor(about), (layout, state));
            blame(culprit, about, &finding);
            Some(finding)
        });
        containment.widened = false;
        match step {
            Some(finding) => {
                Explained::Driver(Finding { text: finding.text + CONTAINED, ..finding })
            }
            None => Explained::Nothing,
        }
    }

    /// Follows a corrected state, and reports what it finds about the sensor, its parameters and the
    /// biases. The covariance contains what is found. Returns `true` if it was widened.
    pub(in crate::filter) fn corrected<'a>(
        &mut self,
        index: usize,
        (layout, state): (&Layout, &State),
        (covariance, considered): (&mut Covariance, &[bool]),
        sensor: &dyn Fn(usize) -> &'a SensorInfo,
        mut report: impl FnMut(Finding),
    ) -> bool {
        let time = state.time;
        let Self { offsets, shifts, parameters, containment, culprit, driver, .. } = self;
        let before = *culprit;
        let known = Known { parameters, culprit: before, driver: *driver };
        containment.begin(time);
        if let Some(shifts) = shifts {
            let states = (&mut *covariance, considered);
            let rival = |sensor| of_a_shift((sensor, false), offsets, known);
            if let Some(step) = shifts.corrected(time, states, containment, rival) {
                let mut finding =
                    shifts.finding(&step, sensor(shifts.sensor(&step)), (layout, state));
                if step.lasts {
                    finding = containment.noted(finding, CONTAINED);
                } else {
                    finding.text.push_str(STEPPED);
                }
                blame(culprit, shifts.sensor(&step), &finding);
                report(finding);
            }
        }
        let of_index = (index, Refuses::None);
        let (offset, rival) = of_an_offset(of_index, offsets, shifts.as_ref(), known);
        let states = (&mut *covariance, considered);
        let found = offset.and_then(|offset| offset.corrected(state, states, containment, rival));
        if let Some(found) = found {
            let names = (&*sensor(index).name, driver.map(|driver| &*sensor(driver).name));
            let finding = lag::finding(&found, time, names, layout);
            let late = driver.filter(|_| found.early).unwrap_or(index);
            blame(culprit, late, &finding);
            report(containment.noted(finding, TAKEN_OFF));
        }
        let rival = |sensor| of_a_constant(sensor, offsets, shifts.as_ref(), (before, *driver));
        let states = (covariance, considered);
        if let Some(wrong) = parameters.corrected(time, states, containment, rival) {
            let finding = parameters.finding(&wrong, state, sensor(wrong.sensor()), layout);
            blame(culprit, wrong.sensor(), &finding);
            let does = if wrong.is_fixed() { ESTIMATED } else { CONTAINED };
            report(containment.noted(finding, does));
            // what a step of the driving sensor seemed to explain is in part the effect of that
            shifts.iter_mut().filter(|_| wrong.is_fixed()).for_each(Shifts::restart);
        }
        std::mem::take(&mut containment.widened)
    }

    /// The fixed blocks that were found to be wrong, and are estimated since then.
    pub(in crate::filter) fn estimated(&self, state: &State, layout: &Layout) -> Vec<Corrected> {
        self.parameters.estimated(state, layout)
    }

    /// Corrects the fixed blocks that were found to be wrong; where that is news, the other tests begin again.
    pub(in crate::filter) fn correct(
        &mut self,
        state: &mut State,
        layout: &Layout,
    ) -> Option<Correction> {
        let Self { offsets, shifts, parameters, .. } = self;
        let correction = parameters.correct(state, layout)?;
        if correction.news {
            shifts.iter_mut().for_each(Shifts::restart);
            offsets.iter_mut().flatten().for_each(|offset| offset.restart(state.time));
        }
        Some(correction)
    }
}

/// Remembers the first sensor whose error makes the result useless.
fn blame(culprit: &mut Option<usize>, sensor: usize, finding: &Finding) {
    if finding.severity == Severity::DoNotUse {
        culprit.get_or_insert(sensor);
    }
}
