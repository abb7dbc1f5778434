//! The place of a built sensor in the composition: its purpose, channels and common keys.

use crate::compose::keys::SensorKeys;
use crate::compose::{Composer, Composition, correlated, time_offset};
use crate::document::DocumentError;
use crate::model::sensor::body::Ride;
use crate::model::sensor::limits;
use crate::model::sensor::{Purpose, Role, Sensor, SensorInfo};
use crate::model::simulate::fault::Injector;
use crate::plugin::BuiltSensor;
use crate::run::parts::Part;
use crate::run::rules::Rules;
use crate::state::Handle;
use crate::state::manifold::Scalar;
use crate::units::Duration;
use crate::units::time::{Span, Time};
use std::sync::Arc;

/// Largest value of the key `late`, s: an hour of an IMU at 400 Hz takes 200 MB.
const LATEST: f64 = 3600.0;

/// Puts a built sensor in its place: purpose, channels and common keys.
pub(super) fn place_sensor(
    part: &Part<'_>,
    keys: SensorKeys,
    mut built: BuiltSensor,
    rules: &Rules,
    composer: &mut Composer,
) -> Result<Sensor, DocumentError> {
    let purpose = match &mut built.role {
        Role::Input(config) => {
            composer.add_input(part.name, std::mem::replace(config, Box::new(())));
            Purpose::Input
        }
        Role::Measurement(_) => Purpose::Measurement,
        Role::Reference(_) => Purpose::Reference,
    };
    if purpose != Purpose::Measurement {
        reject_corrections(part)?;
    }
    if let (Some(error), Role::Measurement(model)) = (&keys.correlated_error, &mut built.role) {
        *model = correlated::wrap(error, Arc::clone(model), &built.channels, composer)
            .map_err(|e| e.at(&part.node))?;
    }
    let limits = limits::resolve(built.limits, &keys.limits, &built.channels)
        .map_err(|e| e.at(&part.node))?;
    let conversion = keys.samples.as_ref().map(|samples| samples.resolve(&built.channels));
    let conversion = conversion.transpose().map_err(|e| e.at(&part.node))?;
    let time_offset = time_offset_block(part, &keys, composer)?;
    let update = rules.of_sensor(part, keys.update.as_deref(), keys.time_offset.is_some())?;
    let exclude = excluded(part, &keys)?;
    let clones = composer.take_clones();
    if let (Some(node), false) = (part.node.get("time_offset"), clones.is_empty()) {
        let message = "a sensor that reads a past state cannot have a time offset: the past state is \
                       copied at the time of a sample, which the offset would not move; take a known \
                       lag off its stamps, samples = { clock = \"-0.2 s\" } with late = \"1 s\", \
                       and remove time_offset";
        return Err(node.error(message));
    }
    let late = longest_lateness(part, &keys)?;
    // a simulated pseudo-measurement has samples
    let detector = composer.take_detector().filter(|_| keys.simulation.is_none());
    let (name, kind) = (part.name.to_owned(), part.entry.name.to_string());
    let mounting = composer.take_mounting();
    let channels = built.channels;
    let info = SensorInfo { name, kind, channels, purpose, mounting };
    let unset = built.unset.iter().filter_map(|name| info.position(name));
    let unset = unset.fold(0, |mask, channel| mask | 1 << channel);
    Composition::check_channels(&info, &built.role).map_err(|e| e.at(&part.node))?;
    if let Some(simulation) = &keys.simulation {
        // a fault that does not fit the sensor is rejected here, with its place in the file
        Injector::new(&simulation.faults, &info, 0).map_err(|e| e.at(&part.node))?;
    }
    Ok(Sensor {
        gate: keys.gate,
        recovery: keys.recovery,
        robust: keys.robust,
        adaptive_noise: keys.adaptive_noise,
        update,
        limits,
        unset,
        timeout: keys.timeout.map(|t| t.value().si()),
        late,
        delay: keys.delay,
        conversion,
        clones,
        exclude,
        simulation: keys.simulation,
        time_offset,
        constraint: detector.is_some(),
        detector,
        ..Sensor::new(info, built.role)
    })
}

/// Puts a sensor on the body that it has named. Its samples may wait for the next pose of the body.
pub(super) fn ride(mut sensor: Sensor, composer: &mut Composer, parts: &[Part<'_>]) -> Sensor {
    if let Some((body, first)) = composer.take_ride()
        && let Some(index) = parts.iter().position(|part| part.name == body.sensor)
    {
        sensor.ride = Some(Ride { sensor: index, first, gap: body.max_gap });
        sensor.late = sensor.late.max(Some(body.max_gap));
    }
    sensor
}

/// Longest time from a sample to its arrival.
fn longest_lateness(part: &Part<'_>, keys: &SensorKeys) -> Result<Option<Span>, DocumentError> {
    let Some(late) = keys.late else { return Ok(None) };
    let seconds = late.value().si();
    if seconds > LATEST {
        let place = part.node.get("late").unwrap_or_else(|| part.node.clone());
        return Err(place.error(format!(
            "the filter keeps the samples of this span in memory, of all sensors; at most \
             {LATEST} s are possible"
        )));
    }
    Ok(Span::from_seconds(seconds))
}

/// The spans of time whose samples the filter does not use.
fn excluded(part: &Part<'_>, keys: &SensorKeys) -> Result<Vec<[Time; 2]>, DocumentError> {
    let span = |[from, to]: &[Duration; 2]| {
        let times = Time::from_seconds(from.si()).zip(Time::from_seconds(to.si()));
        let place = || part.node.get("exclude").unwrap_or_else(|| part.node.clone());
        match times {
            Some((a, b)) if a < b => Ok([a, b]),
            Some(_) => Err(place().error(format!(
                "[{from}, {to}]: a span ends after it begins, as [\"110 s\", \"125 s\"] does"
            ))),
            None => Err(place().error(format!(
                "[{from}, {to}] is beyond 73 years, the longest time that can be represented"
            ))),
        }
    };
    keys.exclude.iter().map(span).collect()
}

/// Rejects the keys that only a sensor that corrects the state can have.
fn reject_corrections(part: &Part<'_>) -> Result<(), DocumentError> {
    let keys = [
        ("gate", "a gate"),
        ("recovery", "a gate"),
        ("robust", "a robust update"),
        ("adaptive_noise", "noise that its innovations show"),
        ("update", "an update rule"),
        ("correlated_error", "a state of its error"),
        ("time_offset", "a time offset"),
    ];
    for (key, what) in keys {
        if let Some(node) = part.node.get(key) {
            let message = "only a sensor that corrects the state has";
            return Err(node.error(format!("{message} {what}; remove it here")));
        }
    }
    Ok(())
}

/// Adds the state of the sensor's time offset, where the table has one.
fn time_offset_block(
    part: &Part<'_>,
    keys: &SensorKeys,
    composer: &mut Composer,
) -> Result<Option<Handle<Scalar>>, DocumentError> {
    let block = keys.time_offset.map(|offset| time_offset::block(&offset, composer));
    block.transpose().map_err(|e| e.at(&part.node))
}
