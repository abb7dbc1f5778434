//! Conversion of a sensor's samples: axes, units and signs, and the clock.

use crate::document::unknown;
use crate::model::error::ComposeError;
use crate::units::sample::{Channel, Sample, channels};
use crate::units::time::Span;
use crate::units::{Duration, Ratio};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// An axis of an instrument, with its direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[allow(missing_docs, reason = "each name is its axis")]
pub enum Axis {
    #[serde(rename = "x")]
    X,
    #[serde(rename = "y")]
    Y,
    #[serde(rename = "z")]
    Z,
    #[serde(rename = "-x")]
    MinusX,
    #[serde(rename = "-y")]
    MinusY,
    #[serde(rename = "-z")]
    MinusZ,
}

impl Axis {
    /// The index of the axis, and its sign.
    fn parts(self) -> (usize, f64) {
        match self {
            Self::X => (0, 1.0),
            Self::Y => (1, 1.0),
            Self::Z => (2, 1.0),
            Self::MinusX => (0, -1.0),
            Self::MinusY => (1, -1.0),
            Self::MinusZ => (2, -1.0),
        }
    }
}

/// Conversion of the samples of any source before the filter takes them.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Conversion {
    /// The axes of the instrument that point forward, right and down: `["y", "x", "-z"]` for an
    /// instrument whose x points right, y forward and z up. They apply to every three channels whose
    /// names end in `_x`, `_y`, `_z` or in `_n`, `_e`, `_d`; the latter are north, east, down.
    /// Default: `["x", "y", "z"]`.
    pub axes: Option<[Axis; 3]>,
    /// Factor on channels by name, after `axes`, such as `{ depth = -1 }`. Default: 1.
    pub factor: BTreeMap<String, Ratio>,
    /// What a sample is of which every value is zero: `"values"`, as any other, or `"missing"`, for an
    /// instrument or a driver that writes zeros where it has nothing. Default: `"values"`.
    pub zeros: Zeros,
    /// Time that is added to the stamps of the samples, such as "-18 s". Default: zero.
    pub clock: Option<Duration>,
}

/// What a sample is of which every value is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Zeros {
    /// A sample as any other.
    #[default]
    Values,
    /// A sample without values.
    Missing,
}

/// A conversion with the indices of its channels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Converter {
    /// Channel, the channel of the instrument that it comes from, and the factor.
    channels: Vec<(usize, usize, f64)>,
    zeros: Zeros,
    /// Time that is added.
    pub clock: Span,
}

/// Ends of the names of a vector's channels.
const VECTORS: [[&str; 3]; 2] = [["_x", "_y", "_z"], ["_n", "_e", "_d"]];

/// The vectors among the channels, by the indices of their components.
fn vectors(channels: &[Channel]) -> impl Iterator<Item = [usize; 3]> + '_ {
    let stems = channels.iter().flat_map(|first| {
        let ends =
            VECTORS.iter().filter_map(|ends| Some((first.name.strip_suffix(ends[0])?, ends)));
        ends.map(|(stem, ends)| ends.map(|end| format!("{stem}{end}")))
    });
    let index = |name: &String| channels.iter().position(|c| *c.name == **name);
    stems.filter_map(move |[x, y, z]| Some([index(&x)?, index(&y)?, index(&z)?]))
}

impl Conversion {
    /// Finds the channels of the conversion.
    ///
    /// # Errors
    /// When the axes are not three different ones, the sensor has no vector, a channel is unknown, a
    /// factor is zero, or the clock is out of range.
    pub(crate) fn resolve(&self, channels: &[Channel]) -> Result<Converter, ComposeError> {
        let mut moves: Vec<(usize, usize, f64)> = Vec::new();
        if let Some(axes) = self.axes {
            moves.extend(turned(axes, channels)?);
        }
        for (name, factor) in &self.factor {
            let key = || format!("samples.factor.{name}");
            let Some(channel) = channels.iter().position(|c| *c.name == **name) else {
                let names: Vec<&str> = channels.iter().map(|c| &*c.name).collect();
                return Err(ComposeError::new(key(), unknown("channel", name, &names)));
            };
            if factor.si() == 0.0 {
                return Err(ComposeError::new(key(), "a factor of zero removes the channel"));
            }
            match moves.iter_mut().find(|(to, ..)| *to == channel) {
                Some((.., sign)) => *sign *= factor.si(),
                None => moves.push((channel, channel, factor.si())),
            }
        }
        let clock = self.clock.map_or(Some(Span::ZERO), |c| Span::from_seconds(c.si()));
        let beyond = || ComposeError::new("samples.clock", "beyond the range of times");
        Ok(Converter { channels: moves, zeros: self.zeros, clock: clock.ok_or_else(beyond)? })
    }
}

/// The moves of the components of every vector.
fn turned(axes: [Axis; 3], channels: &[Channel]) -> Result<Vec<(usize, usize, f64)>, ComposeError> {
    let error = |message: &str| Err(ComposeError::new("samples.axes", message));
    let mut used = axes.map(|axis| axis.parts().0);
    used.sort_unstable();
    if used != [0, 1, 2] {
        return error("each of x, y and z is needed once, with or without a minus");
    }
    let moves: Vec<_> = vectors(channels)
        .flat_map(|vector| {
            (0..3).map(move |k| {
                let (from, sign) = axes[k].parts();
                (vector[k], vector[from], sign)
            })
        })
        .collect();
    match moves.is_empty() {
        true => error("the sensor has no vector along three axes; use `factor`"),
        false => Ok(moves),
    }
}

impl Converter {
    /// Converts a sample of the sensor.
    pub fn apply(&self, sample: &mut Sample) {
        if self.zeros == Zeros::Missing && sample.is_zero() {
            channels(sample.present()).for_each(|channel| sample.clear(channel));
        }
        let read = *sample;
        for (to, from, factor) in &self.channels {
            match read.get(*from) {
                Some(value) => sample.set(*to, factor * value),
                None => sample.clear(*to),
            }
        }
        sample.time = sample.time + self.clock;
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::units::sample::SensorId;
    use crate::units::time::Time;

    fn all() -> [Channel; 4] {
        Channel::all([("vel_x", "m/s"), ("vel_y", "m/s"), ("vel_z", "m/s"), ("depth", "m")])
    }

    fn conversion(text: &str) -> Conversion {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn axes_factors_and_clock_are_applied_to_the_samples_of_any_source() {
        let text =
            "axes = [\"y\", \"x\", \"-z\"]\nfactor = { depth = -1, vel_x = 0.5 }\nclock = \"-2 s\"";
        let converter = conversion(text).resolve(&all()).unwrap();
        let mut sample = Sample::new(Time::from_nanos(0), SensorId(0), &[1.0, 2.0, 3.0, 4.0]);
        sample.clear(0);
        converter.apply(&mut sample);
        let found: Vec<Option<f64>> = (0..4).map(|k| sample.get(k)).collect();
        assert_eq!(found, [Some(1.0), None, Some(-3.0), Some(-4.0)]);
        assert_eq!(sample.time.seconds(), -2.0);
    }

    #[test]
    fn a_sample_of_zeros_alone_has_no_values_where_zeros_are_missing() {
        let converter = conversion("zeros = \"missing\"").resolve(&all()).unwrap();
        for (values, present) in [([0.0; 4], 0), ([0.0, 0.0, 0.0, 1.0], 0b1111)] {
            let mut sample = Sample::new(Time::from_nanos(0), SensorId(0), &values);
            converter.apply(&mut sample);
            assert_eq!(sample.present(), present);
            conversion("").resolve(&all()).unwrap().apply(&mut sample);
            assert_eq!(sample.present(), present);
        }
    }

    #[test]
    fn a_conversion_that_does_not_fit_is_rejected_with_its_key() {
        for (text, key) in [
            ("axes = [\"x\", \"x\", \"z\"]", "samples.axes"),
            ("factor = { height = -1 }", "samples.factor.height"),
            ("factor = { depth = 0 }", "samples.factor.depth"),
        ] {
            let error = conversion(text).resolve(&all()).unwrap_err().to_string();
            assert!(error.starts_with(key), "{error}");
        }
        let error = conversion("axes = [\"y\", \"x\", \"z\"]").resolve(&all()[3..]);
        assert!(error.unwrap_err().to_string().contains("no vector"));
    }
}
