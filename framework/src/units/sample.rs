//! Samples: the measurements that sources provide.

use crate::checkpoint::saved;
use crate::units::time::Time;
use crate::units::{Unit, UnitError};
use std::sync::Arc;

/// The largest number of channels of one sensor.
pub const MAX_CHANNELS: usize = 16;

/// Channels of a mask with one bit each, ascending.
pub(crate) fn channels(mask: u16) -> impl Iterator<Item = usize> + Clone + use<> {
    (0..MAX_CHANNELS).filter(move |channel| mask >> channel & 1 == 1)
}

/// One channel of a sensor: a named number in an SI unit.
///
/// ```
/// use navfuse_core::units::sample::Channel;
/// let speed = Channel::new("vel_x", "m/s");
/// assert_eq!(speed, Channel::new("vel_x", "mps"));
/// assert_eq!(speed.column(), "vel_x_mps");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The name of the channel, unique within the sensor: `vel_x`.
    pub name: Arc<str>,
    /// Its SI unit.
    pub unit: Unit,
    /// The reason why the declared unit is none, which the composer reports.
    wrong: Option<UnitError>,
}

impl Channel {
    /// A channel of that name and SI unit. The unit is an expression (`m/s`) or the suffix of a
    /// column (`mps`); `1` is a ratio. Composing a sensor reports a unit that is unknown or not SI.
    pub fn new(name: impl Into<Arc<str>>, unit: &str) -> Self {
        let (unit, wrong) = match Unit::si(unit) {
            Ok(unit) => (unit, None),
            Err(error) => (Unit::ONE, Some(error)),
        };
        Self { name: name.into(), unit, wrong }
    }

    /// The channels of those names and units.
    pub fn all<const N: usize>(channels: [(&str, &str); N]) -> [Self; N] {
        channels.map(|(name, unit)| Self::new(name, unit))
    }

    /// The heading of a CSV column: name and unit.
    pub fn column(&self) -> String {
        format!("{}_{}", self.name, self.unit.suffix())
    }

    /// The words for the channel: `velocity east` for `vel_e`.
    pub fn words(&self) -> String {
        words(&self.name)
    }

    /// The reason why the declared unit is unknown or not SI.
    pub(crate) fn wrong(&self) -> Option<&UnitError> {
        self.wrong.as_ref()
    }
}

/// Quantities that have axes, and the words for them.
const WITH_AXES: &[(&str, &str)] = &[
    ("vel", "velocity"),
    ("dvel", "velocity increment"),
    ("dtheta", "angle increment"),
    ("accel", "specific force"),
    ("gyro", "angular rate"),
    ("mag", "magnetic field"),
];
/// Axes to the north, and the words for them; others have the word of their letter.
const AXES: &[(&str, &str)] = &[("n", "north"), ("e", "east"), ("d", "down")];
/// Other abbreviations.
const NAMES: &[(&str, &str)] = &[
    ("lat", "latitude"),
    ("lon", "longitude"),
    ("ship_lat", "ship latitude"),
    ("ship_lon", "ship longitude"),
    ("h_acc", "horizontal accuracy"),
    ("v_acc", "vertical accuracy"),
    ("s_acc", "accuracy of the velocity"),
];

/// The words for the name of a channel: `velocity east` for `vel_e`. A name that is no known abbreviation
/// stays, with spaces in it.
pub fn words(name: &str) -> String {
    let find = |list: &[(&str, &'static str)], part: &str| {
        list.iter().find(|entry| entry.0 == part).map(|entry| entry.1)
    };
    if let Some(words) = find(NAMES, name) {
        return words.to_owned();
    }
    let axis = name.split_once('_').and_then(|(of, axis)| Some((find(WITH_AXES, of)?, axis)));
    match axis {
        Some((of, axis)) => format!("{of} {}", find(AXES, axis).unwrap_or(axis)),
        None => name.replace('_', " "),
    }
}

/// Index of a sensor in the composition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorId(pub usize);

saved!(SensorId(index));

/// The channels of a sensor at one time, in SI. Any of them may be missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// The time at which the sample is valid; the end of the interval of an integrating sensor.
    pub time: Time,
    /// The sensor.
    pub sensor: SensorId,
    values: [f64; MAX_CHANNELS],
    present: u16,
}

saved!(Sample { time, sensor, values, present });

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

    /// Returns `true` if every channel that is present is zero.
    pub(crate) fn is_zero(&self) -> bool {
        channels(self.present).all(|channel| self.values[channel] == 0.0)
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
