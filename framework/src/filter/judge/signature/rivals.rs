//! What an error has to lead: the scores of the other ones.

use super::effect::{RECENT, SUMS};
use super::offset::Offset;
use super::parameter::Parameters;
use super::score::leading;
use super::shifts::Shifts;

/// What is known beside the offsets and the shifts.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    pub(super) parameters: &'a Parameters,
    /// Sensor whose error makes the result useless: no other one is named.
    pub(super) culprit: Option<usize>,
    pub(super) driver: Option<usize>,
}

/// Sensors of which the gate refuses samples.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Refuses {
    None,
    One,
    Several,
}

/// Score of the most significant offset of the clocks of some sensors. Where the samples of one are early, those of
/// the driving sensor are late.
fn clocks<'a>(
    offsets: impl Iterator<Item = (usize, &'a Option<Offset>)>,
    driver: Option<usize>,
    score: impl Fn(&Offset, bool) -> f64,
    counts: impl Fn(usize) -> bool,
) -> f64 {
    let mut most = 0.0_f64;
    for (index, offset) in offsets {
        let Some(offset) = offset else { continue };
        for (sensor, early) in [(index, false), (driver.unwrap_or(index), true)] {
            most = if counts(sensor) { most.max(score(offset, early)) } else { most };
        }
    }
    most
}

/// The offset of a sensor, and the score that it has to exceed where its samples are early or late: another error
/// of the sensor has to be less likely, and one of another sensor clearly so. Early samples are an error of the
/// driving sensor, which several sensors may show. No other sensor than the culprit is named. Where
/// the gate refuses samples, they are too few to tell an offset of the clock from one of a channel, and
/// the filter can go on with the former; a drift grows, where such an offset stays. Where it refuses those of
/// one sensor alone, they are no evidence on another sensor.
pub(super) fn of_an_offset<'a>(
    (index, refuses): (usize, Refuses),
    offsets: &'a mut [Option<Offset>],
    shifts: Option<&'a Shifts>,
    Known { parameters, culprit, driver }: Known<'a>,
) -> (Option<&'a mut Offset>, impl Fn(bool) -> f64 + 'a) {
    let (before, rest) = offsets.split_at_mut(index);
    let (offset, after) = match rest.split_first_mut() {
        Some((offset, after)) => (offset.as_mut(), after),
        None => (None, Default::default()),
    };
    let (before, after) = (&*before, &*after);
    let rival = move |early: bool| {
        let at_fault = if early { driver.unwrap_or(index) } else { index };
        if culprit.is_some_and(|culprit| culprit != at_fault) {
            return f64::INFINITY;
        }
        let sums = if refuses == Refuses::None { SUMS } else { RECENT };
        let of = (sums, refuses != Refuses::One);
        let own = |sensor: usize| sensor == index || sensor == at_fault;
        let shifted = |is_own: bool| shifts.map_or(0.0, |s| s.score(of, |k| own(k) == is_own));
        let rest = (index + 1..).zip(after);
        let clocks =
            clocks(before.iter().enumerate().chain(rest), driver, Offset::score, |k| k != at_fault);
        let others = shifted(false).max(clocks);
        let others = others.max(parameters.score(true, |sensor| !own(sensor)));
        let drift = || shifts.map_or(0.0, |shifts| shifts.drift(index));
        let shifted = if refuses == Refuses::None { shifted(true) } else { drift() };
        shifted.max(parameters.score(true, own)).max(leading(others))
    };
    (offset, rival)
}

/// Score that a shift of a sensor has to exceed.
pub(super) fn of_a_shift(
    (index, refuses): (usize, bool),
    offsets: &[Option<Offset>],
    Known { parameters, culprit, driver }: Known<'_>,
) -> f64 {
    if culprit.is_some_and(|culprit| culprit != index) {
        return f64::INFINITY;
    }
    let all = || offsets.iter().enumerate();
    let rival = if refuses { Offset::score } else { Offset::rival };
    let others = clocks(all(), driver, rival, |sensor| sensor != index);
    let others = others.max(parameters.score(true, |sensor| sensor != index));
    let own = clocks(all(), driver, Offset::score, |sensor| sensor == index);
    own.max(parameters.score(true, |sensor| sensor == index)).max(leading(others))
}

/// Score that a wrong constant of a sensor has to exceed.
pub(super) fn of_a_constant(
    index: usize,
    offsets: &[Option<Offset>],
    shifts: Option<&Shifts>,
    (culprit, driver): (Option<usize>, Option<usize>),
) -> f64 {
    if culprit.is_some_and(|culprit| culprit != index) {
        return f64::INFINITY;
    }
    let score = |own: bool| {
        let counts = |sensor: usize| (sensor == index) == own;
        let shifted = shifts.map_or(0.0, |shifts| shifts.score((SUMS, true), counts));
        clocks(offsets.iter().enumerate(), driver, Offset::score, counts).max(shifted)
    };
    score(true).max(leading(score(false)))
}
