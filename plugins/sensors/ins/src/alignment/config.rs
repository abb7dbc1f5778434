//! The key `alignment` of a scenario.

use navfuse_core::units::{Angle, Duration, Positive, Speed};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// Source of attitude and velocity at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AlignmentMethod {
    /// Given by a reference, or by `initial`.
    #[default]
    Given,
    /// At rest: from gravity and Earth rate.
    Static,
    /// In motion: from gravity, Earth rate and a sensor that measures the velocity.
    InMotion,
    /// In motion, as of an aircraft: from gravity, Earth rate and GNSS.
    InFlight,
    /// In motion, for gyros that cannot find north: from the velocity of GNSS, or its successive
    /// positions, and the accelerometers, and from the course of a vehicle that moves forwards.
    Course,
}

impl AlignmentMethod {
    /// Name of the method in a scenario.
    pub fn name(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Static => "static",
            Self::InMotion => "in-motion",
            Self::InFlight => "in-flight",
            Self::Course => "course",
        }
    }

    /// Set if the alignment finds north by the rotation of the Earth while the vehicle moves.
    pub(crate) fn moving(self) -> bool {
        matches!(self, Self::InMotion | Self::InFlight)
    }
}

/// Method of the coarse attitude.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CoarseMethod {
    /// From the rotation of gravity in inertial axes over the whole time, which sway does not
    /// disturb.
    #[default]
    Optimisation,
    /// From the change of velocity by gravity in inertial axes, at the end and half way there (Silson
    /// 2011).
    VelocityLoci,
    /// At rest: from the means of specific force and angular rate, for a vehicle that stands still.
    Analytic,
}

/// Formula of an alignment by GNSS (Wu & Pan 2013).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Formula {
    /// Velocity integration formula: velocities of GNSS.
    Velocity,
    /// Position integration formula: successive positions of GNSS.
    Position,
}

/// Initial alignment of attitude and velocity. The filter starts at the beginning of the alignment,
/// which is the start of the run (`estimator.start`), at the position that the scenario or a
/// reference gives.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AlignmentConfig {
    /// Method: `given` (default), `static`, `in-motion`, `in-flight` or
    /// `course`.
    #[serde(default)]
    pub method: AlignmentMethod,
    /// Shortest duration. Default: 600 s at rest, 240 s in motion and in flight, 10 s by the course.
    pub duration: Option<Positive<Duration>>,
    /// 1-sigma of the heading at which the alignment may end. It continues until then, and a run
    /// that never reaches the gate fails. Default: 1 deg.
    pub heading_gate: Option<Positive<Angle>>,
    /// Method of the coarse attitude: `optimisation` (default), `velocity-loci`, or, at rest,
    /// `analytic`.
    pub coarse: Option<CoarseMethod>,
    /// At rest: duration of the coarse alignment. Default: a fifth of the duration, 20 s to 120 s.
    pub coarse_duration: Option<Positive<Duration>>,
    /// At rest: 1-sigma of the velocity of a vehicle that sways or shakes in its place. The filter
    /// applies a zero-velocity update with this sigma once a second. Default: 5 mm/s.
    pub rest_velocity: Option<Positive<Speed>>,
    /// In flight: `velocity`, or `position`. Default: the velocity, where the receiver measures it.
    pub formula: Option<Formula>,
    /// In motion: sensor that measures the velocity, such as a DVL. Default: the only one that can.
    /// In flight and by the course: GNSS receiver. Default: the first one with a velocity, else the first one.
    pub velocity: Option<String>,
    /// By the course: speed from which the direction of the velocity is used. Default: 2 m/s.
    pub min_speed: Option<Positive<Speed>>,
    /// In motion and in flight: longest time without a velocity. Default: 5 s.
    pub max_gap: Option<Positive<Duration>>,
}

/// The key `alignment`: in TOML the method alone, or a table.
#[derive(Clone, Debug, Default)]
pub struct Alignment(pub AlignmentConfig);

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
            "\"given\", \"static\", \"in-motion\", \"in-flight\", \"course\", or a table such as \
             { method = \"static\", duration = \"600 s\" }",
        )
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let method = AlignmentMethod::deserialize(text.into_deserializer())?;
        Ok(Alignment(AlignmentConfig { method, ..AlignmentConfig::default() }))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        AlignmentConfig::deserialize(MapAccessDeserializer::new(map)).map(Alignment)
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
        json_schema!({ "anyOf": [generator.subschema_for::<AlignmentMethod>(), generator.subschema_for::<AlignmentConfig>()] })
    }
}
