//! The measuring sensors over time: innovations with their bounds, gated samples, NIS with its
//! threshold, and samples.

use crate::columns::{Range, Series};
use crate::recording::Recording;
use crate::style::{AXES, BOUND, GATED, axis, label, path, unit};
use navfuse_core::model::record::{Outcome, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};

/// One channel of a measuring sensor, or its NIS.
pub struct Quantity {
    /// The name in a title.
    pub label: String,
    /// The series of accepted samples.
    pub accepted: Series,
    /// The series of gated samples.
    pub gated: Series,
    /// The range of both.
    pub range: Range,
}

/// The series of one sensor.
pub struct SensorSeries {
    /// The name of the sensor.
    pub name: String,
    /// Set for a sensor that corrects the state.
    pub measures: bool,
    /// The innovation of each channel, and the NIS as the last.
    pub quantities: Vec<Quantity>,
    /// Set once an update was recorded.
    pub updated: bool,
    /// The samples, where they are recorded.
    pub samples: Option<Series>,
    width: usize,
}

impl SensorSeries {
    /// The series of a sensor. The samples of a measuring sensor are recorded, those of other
    /// sensors only with `all_samples`.
    pub fn new(info: &SensorInfo, all_samples: bool) -> Self {
        let measures = info.purpose == Purpose::Measurement;
        let mut quantities = Vec::new();
        for (k, channel) in info.channels.iter().enumerate().filter(|_| measures) {
            let label = label(channel.name, &unit(channel.unit));
            let entity =
                |more: &[&str]| path(&[&["innovation", &info.name, channel.name], more].concat());
            quantities.push(Quantity {
                accepted: Series::bounded(entity(&[]), label.clone(), axis(k), 1.4),
                gated: Series::points(entity(&["gated"]), "gated", GATED, 4.5),
                range: Range::default(),
                label,
            });
        }
        if measures {
            let entity = |more: &[&str]| path(&[&["innovation", &info.name, "nis"], more].concat());
            let lines = [("NIS".to_owned(), AXES[2], 1.2), ("gate".to_owned(), BOUND, 1.6)];
            quantities.push(Quantity {
                label: format!("{} NIS", info.name),
                accepted: Series::lines(entity(&[]), &lines),
                gated: Series::points(entity(&["gated"]), "gated", GATED, 4.5),
                range: Range::default(),
            });
        }
        let lines: Vec<_> = (info.channels.iter().enumerate())
            .map(|(k, c)| (label(c.name, &unit(c.unit)), axis(k), 1.2))
            .collect();
        let samples = (measures || all_samples)
            .then(|| Series::lines(path(&["samples", &info.name]), &lines));
        Self {
            name: info.name.clone(),
            measures,
            quantities,
            updated: false,
            samples,
            width: lines.len(),
        }
    }

    /// Adds a sample; a missing channel is NaN.
    pub fn sample(&mut self, recording: &Recording, sample: &Sample) -> Result<(), StreamError> {
        let Some(series) = &mut self.samples else { return Ok(()) };
        let values: [f64; MAX_CHANNELS] =
            std::array::from_fn(|k| sample.get(k).unwrap_or(f64::NAN));
        series.push(recording, sample.time, &values[..self.width])
    }

    /// Adds an update.
    pub fn update(
        &mut self,
        recording: &Recording,
        update: &UpdateRecord<'_>,
    ) -> Result<(), StreamError> {
        let gated = match update.outcome {
            Outcome::Accepted => false,
            Outcome::Gated => true,
            Outcome::Rejected(_) => return Ok(()),
        };
        let Some((nis, channels)) = self.quantities.split_last_mut() else { return Ok(()) };
        self.updated = true;
        for (k, innovation, sigma) in update.channels() {
            let Some(channel) = channels.get_mut(k) else { continue };
            channel.range.include(innovation);
            if gated {
                channel.gated.push(recording, update.time, &[innovation])?;
            } else {
                let bound = 3.0 * sigma;
                channel.range.bound(-bound, bound);
                channel.accepted.push(recording, update.time, &[innovation, bound, -bound])?;
            }
        }
        nis.range.include(0.0);
        nis.range.include(update.nis);
        if gated {
            nis.gated.push(recording, update.time, &[update.nis])
        } else {
            // without a gate the threshold is infinite, and an infinite line would stretch the axis
            let threshold = if update.threshold.is_finite() { update.threshold } else { f64::NAN };
            nis.range.bound(0.0, threshold);
            nis.accepted.push(recording, update.time, &[update.nis, threshold])
        }
    }

    /// All series of the sensor.
    pub fn series(&mut self) -> impl Iterator<Item = &mut Series> {
        self.quantities
            .iter_mut()
            .flat_map(|q| [&mut q.accepted, &mut q.gated])
            .chain(&mut self.samples)
    }
}
