//! Channels: names that can be headings of CSV columns, and finite simulated values for each.

use crate::lab::{Lab, all_estimated};
use crate::{Failure, Report};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::At;
use navfuse_core::state::covariance::Update;
use navfuse_core::units::Unit;
use navfuse_core::units::sample::{Channel, MAX_CHANNELS, Sample};

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for part in lab.sensors() {
        let samples: Vec<&Sample> =
            lab.samples.iter().filter(|s| s.sensor.0 == part.index).collect();
        let sensor = &lab.composition.sensors[part.index];
        let measured = match &sensor.role {
            Role::Measurement(model) => model.channels(),
            Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
        };
        let channels = &sensor.info.channels;
        let names: Vec<&str> = channels.iter().map(|c| &*c.name).collect();
        let outcome = names_fit(&names)
            .and_then(|()| filled(&names, measured, &samples, |i| unused(lab, part.index, i)))
            .and_then(|found| angles_fit(channels, &samples).map(|()| found));
        report.add("channels", part.about, outcome);
    }
}

fn names_fit(channels: &[&str]) -> Result<(), Failure> {
    if channels.is_empty() {
        return Err("it has no channels; list the values of a sample in `channels`".into());
    }
    for (k, name) in channels.iter().enumerate() {
        let letter = |c: char| c.is_ascii_lowercase() || c == '_';
        if !name.starts_with(letter) || !name.chars().all(|c| letter(c) || c.is_ascii_digit()) {
            return Err(Failure::new(format!(
                "channel {name:?} cannot be the heading of a column; use lower-case letters, \
                 digits and _, as in vel_x"
            )));
        }
        if channels[..k].contains(name) {
            return Err(Failure::new(format!(
                "two channels are named {name:?}; give each its own name"
            )));
        }
    }
    Ok(())
}

/// Checks that angles are within one turn in rad; a model that emits degrees exceeds it.
fn angles_fit(channels: &[Channel], samples: &[&Sample]) -> Result<(), Failure> {
    for (i, channel) in channels.iter().enumerate().filter(|(_, c)| c.unit == Unit::RADIAN) {
        let beyond = |s: &&&Sample| s.get(i).is_some_and(|v| v.abs() > std::f64::consts::TAU);
        if let Some(sample) = samples.iter().find(beyond) {
            return Err(Failure::new(format!(
                "channel {} is an angle, and its simulated value at {} is {:.1} rad, more than a \
                 turn; give it in rad, and wrap it into +-pi with `difference`",
                channel.name,
                sample.time,
                sample.get(i).unwrap_or(f64::NAN)
            )));
        }
    }
    Ok(())
}

/// Tests whether a channel measures nothing with this configuration, such as the range to a beacon
/// that the scenario does not have: its prediction is not finite, or depends on no state.
fn unused(lab: &Lab<'_>, sensor: usize, channel: usize) -> bool {
    let layout = all_estimated(&lab.composition.layout);
    let Role::Measurement(model) = &lab.composition.sensors[sensor].role else { return false };
    let mut update = Update::with_capacity(layout.tangent, MAX_CHANNELS);
    let moments = lab.moments_of(sensor, &layout);
    !moments.is_empty()
        && moments.iter().all(|moment| {
            let mut sample = moment.sample;
            (0..model.channels()).filter(|&i| i != channel).for_each(|i| sample.clear(i));
            sample.set(channel, 0.0);
            let at = At { layout: &layout, state: &moment.state, sample: &sample };
            model.linearise(&at, &mut update);
            let row = &update.h[..update.columns.len().min(update.h.len())];
            update.innovation.first().is_none_or(|y| !y.is_finite())
                || row.iter().all(|h| *h == 0.0)
        })
}

fn filled(
    channels: &[&str],
    measured: usize,
    samples: &[&Sample],
    unused: impl Fn(usize) -> bool,
) -> Result<String, Failure> {
    if samples.is_empty() {
        return Err(
            "the scenario does not simulate it; add `simulation = { rate = \"1 Hz\" }` to its table"
                .into(),
        );
    }
    if measured == 0 {
        return Err("its model predicts no channel, so the filter never uses a sample; implement \
             MeasurementModel<N> with N above 0"
            .into());
    }
    let mut seen = 0_u16;
    for sample in samples {
        if let Some(i) = sample.not_finite() {
            let name = channels.get(i).copied().unwrap_or("beyond those declared");
            return Err(Failure::new(format!(
                "its simulated channel {name} is {} at {}; clear a missing channel with \
                 Sample::clear, and return finite values from predict",
                sample.get(i).unwrap_or(f64::NAN),
                sample.time
            )));
        }
        seen |= sample.present();
    }
    if let Some(i) = (channels.len()..MAX_CHANNELS).find(|i| seen >> i & 1 == 1) {
        return Err(Failure::new(format!(
            "its simulator sets channel number {}, but {} are declared in `channels`",
            i + 1,
            channels.len()
        )));
    }
    if let Some(i) = (0..measured).find(|i| seen >> i & 1 == 0 && !unused(*i)) {
        return Err(Failure::new(format!(
            "channel {} is in no simulated sample; set it in `simulate`, or remove its declaration",
            channels[i]
        )));
    }
    Ok(format!("{} channels in {} samples", channels.len(), samples.len()))
}
