//! Channels: names that can be headings of CSV columns, and finite simulated values for each.

use crate::lab::Lab;
use crate::{Failure, Report};
use navfuse_core::model::sensor::Role;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for part in lab.sensors() {
        let samples: Vec<&Sample> =
            lab.samples.iter().filter(|s| s.sensor.0 == part.index).collect();
        let sensor = &lab.composition.sensors[part.index];
        let measured = match &sensor.role {
            Role::Measurement(model) => model.channels(),
            Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
        };
        let names: Vec<(&str, &str)> =
            sensor.info.channels.iter().map(|c| (c.name, c.unit)).collect();
        report.add(
            "channels",
            part.about,
            names_fit(&names).and_then(|()| filled(&names, measured, &samples)),
        );
    }
}

fn names_fit(channels: &[(&str, &str)]) -> Result<(), Failure> {
    if channels.is_empty() {
        return Err("it has no channels; list the values of a sample in `channels`".into());
    }
    let plain = |text: &str, more: &str| {
        text.starts_with(|c: char| c.is_ascii_lowercase() || more.contains(c))
            && text
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || more.contains(c))
    };
    for (k, (name, unit)) in channels.iter().enumerate() {
        if !plain(name, "_") || !plain(unit, "1") {
            return Err(Failure::new(format!(
                "channel {name:?} with unit {unit:?} cannot be the heading of a column; use \
                 lower-case letters, digits and _, and an SI unit, as in vel_x_mps"
            )));
        }
        if channels[..k].iter().any(|(other, _)| other == name) {
            return Err(Failure::new(format!(
                "two channels are named {name:?}; give each its own name"
            )));
        }
    }
    Ok(())
}

fn filled(
    channels: &[(&str, &str)],
    measured: usize,
    samples: &[&Sample],
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
            let name = channels.get(i).map_or("beyond those declared", |c| c.0);
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
    if let Some(i) = (0..measured).find(|i| seen >> i & 1 == 0) {
        return Err(Failure::new(format!(
            "channel {} is in no simulated sample; set it in `simulate`, or remove its declaration",
            channels[i].0
        )));
    }
    Ok(format!("{} channels in {} samples", channels.len(), samples.len()))
}
