//! How often the covariance is propagated.

use crate::units::{Frequency, Positive};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::de::{IntoDeserializer, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// How often the covariance is propagated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum CovarianceRate {
    /// As often as the terms that a pool of steps neglects demand.
    #[default]
    Bounded,
    /// As above, and at least at this rate.
    Least(Positive<Frequency>),
    /// With every sample of the driving sensor.
    EverySample,
}

impl<'de> Deserialize<'de> for CovarianceRate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;
        impl Visitor<'_> for Form {
            type Value = CovarianceRate;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a rate, such as \"5 Hz\", \"bounded\" or \"every sample\"")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<CovarianceRate, E> {
                match text {
                    "every sample" => Ok(CovarianceRate::EverySample),
                    "bounded" => Ok(CovarianceRate::Bounded),
                    rate => {
                        Positive::deserialize(rate.into_deserializer()).map(CovarianceRate::Least)
                    }
                }
            }
        }
        deserializer.deserialize_any(Form)
    }
}

impl JsonSchema for CovarianceRate {
    fn schema_name() -> Cow<'static, str> {
        "CovarianceRate".into()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let rate = Positive::<Frequency>::json_schema(generator);
        schemars::json_schema!({
            "description": "Least rate, \"bounded\" or \"every sample\"",
            "anyOf": [rate, { "enum": ["bounded", "every sample"] }]
        })
    }
}
