//! Samples: the measurements that sources provide.

use crate::units::time::Time;
use crate::units::{Unit, column_suffix, parse_unit};

/// The largest number of channels of one sensor.
pub const MAX_CHANNELS: usize = 16;

/// One channel of a sensor: a named number in an SI unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// The name of the channel, unique within the sensor: `vel_x`.
    pub name: &'static str,
    /// The SI unit as the suffix of a column: `mps`, so that the CSV column is `vel_x_mps`.
    pub unit: &'static str,
}

impl Channel {
    /// A channel of that name and SI unit.
    pub const fn new(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit }
    }

    /// The heading of a CSV column: name and unit.
    pub fn column(&self) -> String {
        format!("{}_{}", self.name, self.unit)
    }

    /// The unit; `None` if it is unknown. An author may have written `m/s` in the place of `mps`.
    pub fn parsed_unit(&self) -> Option<Unit> {
        column_suffix(self.unit).or_else(|| parse_unit(self.unit).ok())
    }
}

/// Index of a sensor in the composition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorId(pub usize);

/// The channels of a sensor at one time, in SI. Any of them may be missing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The time at which the sample is valid; the end of the interval of an integrating sensor.
    pub time: Time,
    /// The sensor.
    pub sensor: SensorId,
    values: [f64; MAX_CHANNELS],
    present: u16,
}

impl Sample {
    /// A sample without any channel.
    pub const fn empty(time: Time, sensor: SensorId) -> Self {
        Self { time, sensor, values: [0.0; MAX_CHANNELS], present: 0 }
    }

    /// A sample with the given channels, in the sensor's order.
    pub fn new(time: Time, sensor: SensorId, values: &[f64]) -> Self {
        let mut sample = Self::empty(time, sensor);
        for (i, v) in values.iter().enumerate().take(MAX_CHANNELS) {
            sample.set(i, *v);
        }
        sample
    }

    /// Sets a channel.
    pub fn set(&mut self, channel: usize, value: f64) {
        if channel < MAX_CHANNELS {
            self.values[channel] = value;
            self.present |= 1 << channel;
        }
    }

    /// Removes a channel.
    pub fn clear(&mut self, channel: usize) {
        if channel < MAX_CHANNELS {
            self.present &= !(1 << channel);
        }
    }

    /// The value of a channel, if it is present.
    pub fn get(&self, channel: usize) -> Option<f64> {
        (channel < MAX_CHANNELS && self.present & (1 << channel) != 0).then(|| self.values[channel])
    }

    /// `N` channels from `first` on, if all are present.
    pub fn array<const N: usize>(&self, first: usize) -> Option<[f64; N]> {
        let mask = ((1u32 << N) - 1) << first;
        (u32::from(self.present) & mask == mask)
            .then(|| std::array::from_fn(|i| self.values[first + i]))
    }

    /// The channels that are present, one bit for each.
    pub fn present(&self) -> u16 {
        self.present
    }

    /// All channels; those that are missing hold any value.
    pub(crate) fn values(&self) -> &[f64; MAX_CHANNELS] {
        &self.values
    }

    /// The first channel that is not finite.
    pub fn not_finite(&self) -> Option<usize> {
        // the usual case: a sum is finite only if its terms are; four sums do not wait for each other
        let [sums, rest @ ..] = self.values.as_chunks::<4>().0 else { return None };
        let mut sums = *sums;
        rest.iter().for_each(|four| (0..4).for_each(|k| sums[k] += four[k]));
        if sums.iter().sum::<f64>().is_finite() {
            return None;
        }
        (0..MAX_CHANNELS).find(|&i| self.get(i).is_some_and(|v| !v.is_finite()))
    }
}
