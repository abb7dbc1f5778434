//! An error of unit size that begins at an unknown time, and the finding about it.

use super::effect::{Found, name};
use super::lanes::Seen;
use crate::compose::{Composition, moved};
use crate::model::record::finding::{Basis, Finding};
use crate::model::sensor::{Role, Sensor, SensorInfo};
use crate::state::geodesy::radii_of_curvature;
use crate::state::{Dynamics, Layout, State};
use crate::units::Unit;
use crate::units::sample::{Channel, channels};
use std::borrow::Cow;
use std::ops::Range;

/// Where an error enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// A constant state steps, by its row. The filter follows the state, which is right again then.
    State(usize),
    /// The samples of a channel are off from then on.
    Channel(usize),
    /// The samples of a channel drift from then on, by so much per second.
    Drift(usize),
}

/// An error that is compared.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shift {
    /// Index of the sensor that has the error.
    pub(super) sensor: usize,
    pub(super) place: Place,
    /// Set if its sums begin at one minute, two, four and so on: a filter that has learnt a constant for
    /// longer takes longer to follow a step, and the evidence on it grows as slowly.
    pub(super) patient: bool,
    /// Set for an offset or a drift of a sensor that measures velocities alone, which the filter follows in seconds.
    pub(super) followed: bool,
    /// Size from which on the error is another one.
    pub(super) most: f64,
}

/// Largest step of a bias of the driving sensor, in sigmas of its prior: an instrument that is off by more has
/// its axes turned, or its unit is wrong. A gyro may be off by more: one of MEMS that is not calibrated is by 1 deg/s or 2.
const STEP: f64 = 300.0;
const GYRO: f64 = 2.0 * 1_f64.to_radians();

/// Largest drift of a velocity log, m/s^2: in a minute it is off by the speed of a slow vehicle. A larger one is an error
/// of the driving sensor, which accelerates by more than 1 mg.
const DRIFT: f64 = 0.01;

/// Index of the sensor that a block belongs to, by its name.
fn owner(sensors: &[Sensor], block: &str) -> Option<usize> {
    let (part, _) = block.rsplit_once('.')?;
    sensors.iter().position(|sensor| sensor.info.name == part)
}

/// The errors of a composition that are compared.
pub(super) fn places(composition: &Composition, tested: &[bool]) -> Vec<Shift> {
    let layout = &*composition.layout;
    let (sensors, moved) = (&composition.sensors, moved(layout, &composition.processes));
    let shift = |sensor, place| Shift {
        sensor,
        place,
        patient: false,
        followed: false,
        most: f64::INFINITY,
    };
    let mut all = Vec::new();
    let process = composition.processes.iter().find(|process| process.input.is_some());
    if let Some((process, input)) = process.and_then(|p| Some((p, p.input?))) {
        let blocks = process.biases.iter().map(|slot| &layout.blocks[*slot]);
        let rows = blocks.flat_map(|block| {
            let constant = block.estimated() && block.spec.dynamics == Dynamics::Constant;
            let sigmas = block.spec.sigma.iter().copied().chain(std::iter::repeat(f64::INFINITY));
            block.tangent_range().zip(sigmas).map(move |row| (constant, row))
        });
        for (k, (constant, (row, sigma))) in rows.enumerate() {
            let channel = sensors[input].info.channels.get(k);
            let gyro = channel.is_some_and(|channel| channel.unit.suffix() == "radps");
            let most = (STEP * sigma).max(if gyro { GYRO } else { 0.0 });
            all.extend(constant.then_some(Shift { most, ..shift(input, Place::State(row)) }));
        }
    }
    for (slot, block) in layout.blocks.iter().enumerate() {
        let constant = block.estimated() && block.spec.dynamics == Dynamics::Constant;
        if constant
            && !moved[slot]
            && let Some(sensor) = owner(sensors, &block.name)
        {
            all.extend(block.tangent_range().map(|row| shift(sensor, Place::State(row))));
        }
    }
    for (index, _) in sensors.iter().enumerate().filter(|(k, _)| tested[*k]) {
        let Role::Measurement(model) = &sensors[index].role else { continue };
        let named = &sensors[index].info.channels;
        let followed = named.iter().all(|channel| channel.unit.suffix() == "mps");
        let offsets = (0..model.channels()).map(|channel| shift(index, Place::Channel(channel)));
        all.extend(offsets.map(|offset| Shift { followed, ..offset }));
        let drifts = |unit: &str| followed || ["m", "rad"].contains(&unit);
        let drifting = named.iter().enumerate();
        let drifting = drifting.filter(|(_, channel)| drifts(&channel.unit.suffix()));
        let most = if followed { DRIFT } else { f64::INFINITY };
        let drift = |channel| Shift { followed, most, ..shift(index, Place::Drift(channel)) };
        all.extend(drifting.map(|(channel, _)| drift(channel)));
    }
    all
}

impl Shift {
    /// Adds the unit error to the sensitivity of a sample, in the columns of its hypotheses, which have ages;
    /// `present` has the channels of a sample of its sensor.
    pub(super) fn enter<const W: usize>(
        &self,
        g: &mut Seen<W>,
        columns: Range<usize>,
        present: Option<u16>,
        age: impl Fn(usize) -> f64,
    ) {
        let Some(present) = present else { return };
        let row = |channel| channels(present).position(|c| c == channel);
        match self.place {
            Place::State(_) => {}
            Place::Channel(channel) => {
                let row = row(channel).map(|row| &mut g[row][columns]);
                row.into_iter().flatten().for_each(|g| *g += 1.0);
            }
            Place::Drift(channel) => {
                let Some(row) = row(channel) else { return };
                columns.for_each(|column| g[row][column] += age(column) as f32);
            }
        }
    }

    /// What a channel of the sensor does.
    fn off(
        &self,
        channel: usize,
        found: &Found,
        sensor: &SensorInfo,
        (layout, state): (&Layout, &State),
    ) -> String {
        let unit = sensor.channels.get(channel).map(|channel| unit(channel, layout, state));
        let (unit, scale) = unit.unwrap_or_default();
        let (verb, per) = match self.place {
            Place::Drift(_) => ("drifts", "/s"),
            _ => ("is off", ""),
        };
        let (words, score) = (sensor.words(channel), &found.score);
        let size = shown(score.size() * scale, &unit);
        format!("its {words} {verb} by {size}{per} since {}", score.since)
    }

    /// What an error of a channel does that explains the same samples as another one, in words.
    pub(super) fn alike(
        &self,
        found: &Found,
        sensor: &SensorInfo,
        (layout, state): (&Layout, &State),
    ) -> String {
        let (Place::Channel(channel) | Place::Drift(channel)) = self.place else {
            return String::new();
        };
        let off = self.off(channel, found, sensor, (layout, state));
        let moved = found.moved(layout);
        format!("; or {off}, which has moved {moved}")
    }

    /// The finding about the sensor; `prior` is set for an error from the start of the run.
    pub(super) fn finding(
        &self,
        (found, prior): (&Found, bool),
        sensor: &SensorInfo,
        (layout, state): (&Layout, &State),
    ) -> Finding {
        let time = state.time;
        let (score, about) = (&found.score, sensor.name.clone());
        let fit = format!("{:.1} sigma", score.sigmas().abs());
        let (text, remedy) = match self.place {
            Place::State(row) => {
                let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&row));
                let (unit, scale) =
                    block.map_or(("", 1.0), |b| (b.spec.display.unit, b.spec.display.scale));
                let key = block.map_or("", |b| b.name.rsplit('.').next().unwrap_or_default());
                let size = shown(score.size() / scale, unit);
                let state = name(layout, row);
                if prior {
                    (
                        format!(
                            "{state} is off its prior by {size}: the innovations fit this ({fit})"
                        ),
                        format!(
                            "correct the initial value of {key}, or widen its sigma (not tried)"
                        ),
                    )
                } else {
                    let text = format!(
                        "{state} has stepped after {}: the innovations fit a step of {size} ({fit})",
                        score.since,
                    );
                    let remedy = format!(
                        "check {about} (temperature, supply, mounting); do not use the estimates before \
                     {time}; let {key} wander (random_walk or correlation_time)"
                    );
                    (text, remedy)
                }
            }
            Place::Channel(channel) | Place::Drift(channel) => {
                let text = format!("{} ({fit})", self.off(channel, found, sensor, (layout, state)));
                let remedy =
                    "look at the sensor since then; if its error is known to last, give it a \
                              bias or correlated_error"
                        .to_owned();
                (text, remedy)
            }
        };
        let moved = found.moved(layout);
        Finding {
            time,
            about,
            severity: found.severity,
            basis: Basis::Explanation,
            text: format!("{text}, which has moved {moved}"),
            remedy,
        }
    }
}

/// The unit of an error of a channel, and its number in one of SI: metres for a latitude or a longitude.
fn unit(channel: &Channel, layout: &Layout, state: &State) -> (Cow<'static, str>, f64) {
    let latitude = layout.vehicle().position.map_or(0.0, |at| state.get(layout, at).latitude);
    let (north, east) = radii_of_curvature(latitude);
    match (&*channel.name, channel.unit) {
        ("lat", Unit::RADIAN) => ("m".into(), north),
        ("lon", Unit::RADIAN) => ("m".into(), east * latitude.cos()),
        (_, unit) => unit.shown(),
    }
}

/// A size with three significant digits, a sign and its unit.
pub(super) fn shown(size: f64, unit: &str) -> String {
    let decimals = (2.0 - size.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{size:+.decimals$} {unit}").trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::sample::MAX_CHANNELS;

    /// Channels 0 and 2 are present, so that the second row is that of channel 2.
    #[test]
    fn an_offset_is_the_same_in_each_sample_and_a_drift_grows_with_its_age() {
        let entered = |place| {
            let shift = Shift { sensor: 0, place, patient: false, followed: false, most: 1.0 };
            let mut g = [[0.0_f32; 4]; MAX_CHANNELS];
            shift.enter(&mut g, 1..3, Some(0b101), |column| 10.0 * column as f64);
            assert_eq!(g[0], [0.0; 4]);
            g[1]
        };
        assert_eq!(entered(Place::Channel(2)), [0.0, 1.0, 1.0, 0.0]);
        assert_eq!(entered(Place::Drift(2)), [0.0, 10.0, 20.0, 0.0]);
        assert_eq!(entered(Place::State(2)), [0.0; 4]);
    }
}
