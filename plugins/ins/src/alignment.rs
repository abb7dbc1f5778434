//! Initial alignment: attitude and velocity at the start, found from samples.
//!
//! Coarse, then fine. The coarse one ([`inertial`], [`optimisation`]) finds an attitude from nothing. The fine one is the filter
//! itself: it starts where the coarse one began, at the attitude that it found, with a prior sigma about ten times its error, and takes
//! the same samples again. So what the filter knows is from the samples, used once, with the correlations of heading and gyro
//! bias, tilt and accelerometer bias that come of it; the coarse attitude only says where to linearise.

mod aligner;
pub mod inertial;
pub mod optimisation;
mod search;

pub(crate) use aligner::{Aligner, AtRest, NAME};

use navfuse_core::units::{Angle, Positive, Speed, Time as Duration};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// How attitude and velocity at the start are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// They are given: by a reference, or by `initial`.
    #[default]
    Given,
    /// At rest: from gravity and Earth rate.
    Static,
    /// On the move: from gravity, Earth rate and a sensor that measures the velocity.
    InMotion,
}

/// How the attitude is found at rest, coarsely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Coarse {
    /// From gravity as inertial axes see it turn, over the whole span: sway does not matter.
    #[default]
    Optimisation,
    /// From the means of specific force and angular rate: for a vehicle that is quite still.
    Analytic,
}

/// How attitude and velocity at the start are found. The filter starts at the beginning of the alignment, which is the start of
/// the run (`estimator.start`); where it is then, the position says, or a reference.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// `given` (default), `static` or `in-motion`.
    #[serde(default)]
    pub method: Method,
    /// How long it takes at least. Default: 600 s at rest, 240 s in motion.
    pub duration: Option<Positive<Duration>>,
    /// The 1-sigma of the heading that must be reached: until then it goes on, and a run that never gets there fails.
    /// Default: 1 deg.
    pub heading_gate: Option<Positive<Angle>>,
    /// At rest: how the coarse attitude is found, `optimisation` (default) or `analytic`.
    pub coarse: Option<Coarse>,
    /// At rest: from how much of the beginning the coarse attitude is found. Default: a fifth of the duration, 20 s to 120 s.
    pub coarse_duration: Option<Positive<Duration>>,
    /// At rest: 1-sigma of the velocity of a vehicle that sways or shakes in its place. Zero velocity is taken as measured to
    /// that once a second. Default: 5 mm/s.
    pub rest_velocity: Option<Positive<Speed>>,
    /// In motion: the sensor that measures the velocity, such as a DVL. Default: the only one that can.
    pub velocity: Option<String>,
    /// In motion: the longest time without a velocity. Default: 5 s.
    pub max_gap: Option<Positive<Duration>>,
}

/// The key `alignment`: in TOML the method alone, or a table.
#[derive(Clone, Debug, Default)]
pub struct Alignment(pub Config);

impl<'de> Deserialize<'de> for Alignment {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(MethodOrTable)
    }
}

struct MethodOrTable;

impl<'de> Visitor<'de> for MethodOrTable {
    type Value = Alignment;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "\"given\", \"static\", \"in-motion\", or a table such as { method = \"static\", duration = \"600 s\" }",
        )
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let method = Method::deserialize(text.into_deserializer())?;
        Ok(Alignment(Config { method, ..Config::default() }))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        Config::deserialize(MapAccessDeserializer::new(map)).map(Alignment)
    }
}

impl JsonSchema for Alignment {
    fn schema_name() -> Cow<'static, str> {
        "Alignment".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [generator.subschema_for::<Method>(), generator.subschema_for::<Config>()] })
    }
}
