//! Innovation gates, and recovery from lock-out.

use crate::units::sample::MAX_CHANNELS;
use crate::units::{Duration, Positive};
use schemars::JsonSchema;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::fmt;

/// Chi-square gate on the normalised innovation squared: the probability that a good sample passes,
/// or off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate(Option<f64>);

impl Default for Gate {
    /// Gates one good sample in ten thousand.
    fn default() -> Self {
        Self(Some(0.9999))
    }
}

impl Gate {
    /// Probability that a good sample passes; `None` when off.
    pub fn probability(self) -> Option<f64> {
        self.0
    }

    /// Threshold on the NIS for each number of channels; infinite when off.
    pub fn thresholds(self) -> [f64; MAX_CHANNELS + 1] {
        std::array::from_fn(|dof| match (self.0, ChiSquared::new(dof as f64)) {
            (Some(p), Ok(distribution)) => distribution.inverse_cdf(p),
            _ => f64::INFINITY,
        })
    }
}

impl<'de> Deserialize<'de> for Gate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl Visitor<'_> for Form {
            type Value = Gate;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a probability between 0 and 1, such as 0.9999, or \"off\"")
            }
            fn visit_f64<E: serde::de::Error>(self, p: f64) -> Result<Gate, E> {
                if p > 0.0 && p < 1.0 {
                    Ok(Gate(Some(p)))
                } else {
                    Err(E::custom(format!("{p} is not {ASK}")))
                }
            }
            fn visit_i64<E: serde::de::Error>(self, p: i64) -> Result<Gate, E> {
                Err(E::custom(format!("{p} is not {ASK}")))
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Gate, E> {
                if text == "off" {
                    Ok(Gate(None))
                } else {
                    Err(E::custom(format!("{text:?} is not {ASK}")))
                }
            }
        }
        const ASK: &str = "a probability between 0 and 1, such as 0.9999, or \"off\"";
        deserializer.deserialize_any(Form)
    }
}

impl JsonSchema for Gate {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Gate".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "Probability that a good sample passes, or \"off\"",
            "anyOf": [
                { "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 },
                { "const": "off" }
            ]
        })
    }
}

/// Action after a lock-out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// Inflate the covariance of the states that the sensor measures until the innovation is
    /// plausible, and use the sample; isolate the sensor where the evidence is against it.
    #[default]
    Inflate,
    /// Use the next sample whatever its innovation.
    Accept,
    /// Only report the lock-out.
    Report,
    /// Free the position of the vehicle at the first gated sample, and use the sample: for a position
    /// that an operator sets.
    Obey,
}

/// Recovery from lock-out.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Recovery {
    /// Duration for which every sample must have been gated; at least three samples.
    #[serde(default = "half_a_minute")]
    pub after: Positive<Duration>,
    /// Action: `inflate`, `accept`, `report` or `obey`.
    #[serde(default)]
    pub action: Action,
    /// Isolation of a sensor that no other sensor contradicts, before the covariance is inflated and the
    /// sensor used. One that others contradict is used after this time, once it passes the gate.
    #[serde(default = "five_minutes")]
    pub isolate: Positive<Duration>,
}

impl Default for Recovery {
    fn default() -> Self {
        Self { after: half_a_minute(), action: Action::default(), isolate: five_minutes() }
    }
}

fn five_minutes() -> Positive<Duration> {
    Positive::from_si(300.0)
}

fn half_a_minute() -> Positive<Duration> {
    Positive::from_si(30.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 1 no sample is gated, which `"off"` states, and at 0 every sample is.
    #[test]
    fn the_probability_of_a_gate_is_above_zero_and_below_one() {
        let read = |text: &str| {
            let table: Result<std::collections::BTreeMap<String, Gate>, _> =
                toml::from_str(&format!("gate = {text}"));
            table.map(|mut table| table.remove("gate")).map_err(|e| e.message().to_owned())
        };
        for text in ["1e-300", "0.5", "0.9999999999999999", "\"off\""] {
            assert!(read(text).is_ok(), "{text}");
        }
        let probability = |text| read(text).ok().flatten().and_then(Gate::probability);
        assert_eq!((probability("0.5"), probability("\"off\"")), (Some(0.5), None));
        for text in ["0.0", "-0.0", "1.0", "-0.5", "1.5", "0", "1", "nan"] {
            let message = read(text).err().unwrap_or_default();
            assert!(message.contains("a probability between 0 and 1"), "{text}: {message}");
        }
    }
}
