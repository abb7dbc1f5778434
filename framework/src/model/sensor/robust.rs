//! Robust updates: a large innovation that passes the gate counts less.
//!
//! The noise of a channel is taken as heavier in its tails than a Gaussian. One step of iteratively
//! reweighted least squares divides its variance by a weight `w` of the normalised innovation
//! `e = y / sqrt(S)` (Huber 1964; Lange, Little & Taylor 1989):
//! ```text
//! huber      w = min(1, t / |e|)              t: threshold
//! student-t  w = min(1, (n + 1) / (n + e^2))  n: degrees of freedom
//! ```
//! Each channel has its own weight, so that one bad beam does not weaken the others. No weight is
//! above one: the stated noise is the smallest.

use schemars::JsonSchema;
use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Threshold of Huber's weight with 95 % of the efficiency where the noise is Gaussian.
const THRESHOLD: f64 = 1.345;

/// Degrees of freedom of a Student distribution that is usual for heavy tails.
const FREEDOM: f64 = 4.0;

/// Weight of the channels of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Robust {
    /// Every channel has the weight of its stated noise.
    #[default]
    Off,
    /// Huber's weight with this threshold, sigma.
    Huber(f64),
    /// The weight of a Student distribution with these degrees of freedom.
    StudentT(f64),
}

impl Robust {
    /// Weight of a channel with the normalised innovation `e`.
    pub fn weight(self, e: f64) -> f64 {
        match self {
            Self::Off => 1.0,
            Self::Huber(threshold) => (threshold / e.abs()).min(1.0),
            Self::StudentT(freedom) => ((freedom + 1.0) / (freedom + e * e)).min(1.0),
        }
    }
}

/// Kind of a robust update.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Huber,
    StudentT,
    Off,
}

/// The table form.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// `huber`, `student-t` or `off`.
    kind: Kind,
    /// Innovation in sigma from which on Huber's weight is below one. Default: 1.345.
    threshold: Option<f64>,
    /// Degrees of freedom of `student-t`. Default: 4.
    freedom: Option<f64>,
}

impl Keys {
    fn robust(self) -> Result<Robust, String> {
        let positive = |key: &str, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(value)
            } else {
                Err(format!("{key} = {value}: a number above zero is needed"))
            }
        };
        match (self.kind, self.threshold, self.freedom) {
            (Kind::Off, None, None) => Ok(Robust::Off),
            (Kind::Huber, threshold, None) => {
                positive("threshold", threshold.unwrap_or(THRESHOLD)).map(Robust::Huber)
            }
            (Kind::StudentT, None, freedom) => {
                positive("freedom", freedom.unwrap_or(FREEDOM)).map(Robust::StudentT)
            }
            _ => Err("huber takes threshold, student-t takes freedom, off takes neither".into()),
        }
    }
}

impl<'de> Deserialize<'de> for Robust {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl<'de> Visitor<'de> for Form {
            type Value = Robust;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("\"huber\", \"student-t\", \"off\", or a table with `kind`")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Robust, E> {
                let kind = Kind::deserialize(serde::de::value::StrDeserializer::new(text))?;
                Keys { kind, threshold: None, freedom: None }.robust().map_err(E::custom)
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Robust, A::Error> {
                Keys::deserialize(serde::de::value::MapAccessDeserializer::new(map))?
                    .robust()
                    .map_err(serde::de::Error::custom)
            }
        }
        deserializer.deserialize_any(Form)
    }
}

impl JsonSchema for Robust {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Robust".into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let (kind, keys) = (Kind::json_schema(generator), Keys::json_schema(generator));
        schemars::json_schema!({ "anyOf": [kind, keys] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both weights are one for a small innovation, and that of Huber keeps the product with the
    /// innovation at the threshold.
    #[test]
    fn weights_fall_beyond_their_thresholds_only() {
        assert_eq!(Robust::Off.weight(50.0), 1.0);
        for e in [-2.5_f64, 2.5] {
            let huber = Robust::Huber(1.5).weight(e);
            assert!((huber * e.abs() - 1.5).abs() < 1e-15, "{huber}");
            // (4 + 1) / (4 + 6.25)
            assert!((Robust::StudentT(4.0).weight(e) - 5.0 / 10.25).abs() < 1e-15);
        }
        assert_eq!((Robust::Huber(1.5).weight(1.4), Robust::StudentT(4.0).weight(0.9)), (1.0, 1.0));
    }

    #[test]
    fn each_kind_takes_its_own_key_and_a_number_above_zero() {
        let robust = |kind, threshold, freedom| Keys { kind, threshold, freedom }.robust();
        assert_eq!(robust(Kind::Huber, Some(2.0), None), Ok(Robust::Huber(2.0)));
        assert_eq!(robust(Kind::Huber, None, None), Ok(Robust::Huber(THRESHOLD)));
        assert_eq!(robust(Kind::StudentT, None, Some(3.0)), Ok(Robust::StudentT(3.0)));
        assert_eq!(robust(Kind::Off, None, None), Ok(Robust::Off));
        for wrong in [0.0, -1.0, f64::INFINITY, f64::NAN] {
            assert!(robust(Kind::Huber, Some(wrong), None).is_err());
            assert!(robust(Kind::StudentT, None, Some(wrong)).is_err());
        }
        assert!(robust(Kind::Huber, None, Some(3.0)).is_err());
        assert!(robust(Kind::StudentT, Some(2.0), None).is_err());
        assert!(robust(Kind::Off, Some(2.0), None).is_err());
    }
}
