//! The key `mechanisation` of a scenario, and the integrator that it names.

use crate::formulae::{Formulae, MAX_SAMPLES};
use crate::mechanisation::{Increments, Mechanisation, MechanisationError, NavState, StepRates};
use navfuse_core::checkpoint::{Io, Saved};
use navfuse_core::model::error::ComposeError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// Method of the mechanisation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MechanisationMethod {
    /// Coning and sculling of two samples, closed forms of the body's rotation, and the Earth at the
    /// middle of the step.
    #[default]
    TwoSample,
    /// Velocity and position integration formulae, in which the navigation axes rotate during the
    /// step (Wu & Pan 2013).
    IntegrationFormulae,
}

/// Mechanisation of the navigation equations.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MechanisationConfig {
    /// Method: `two-sample` (default), or `integration-formulae`.
    #[serde(default)]
    pub method: MechanisationMethod,
    /// Integration formulae: number of samples, from 1 to 4, through whose increments the polynomials
    /// of rate and force pass. Default: 2, linear in time.
    pub samples: Option<usize>,
}

/// The key `mechanisation`: in TOML the method alone, or a table.
#[derive(Clone, Copy, Debug, Default)]
pub struct MechanisationKey(pub MechanisationConfig);

impl MechanisationKey {
    /// Creates the integrator, in axes of north, east and down or in those of the wander azimuth.
    pub(crate) fn integrator(self, wanders: bool) -> Result<Integrator, ComposeError> {
        let MechanisationConfig { method, samples } = self.0;
        let wrong = |text: String| ComposeError::new("mechanisation.samples", text);
        match (method, samples) {
            (MechanisationMethod::TwoSample, None) if wanders => {
                Ok(Integrator::TwoSample(Mechanisation::wander_azimuth()))
            }
            (MechanisationMethod::TwoSample, None) => Ok(Integrator::default()),
            (MechanisationMethod::TwoSample, Some(_)) => Err(wrong(
                "two-sample has always two samples; remove the key, or choose method = \
                 \"integration-formulae\""
                    .to_owned(),
            )),
            (MechanisationMethod::IntegrationFormulae, _) if wanders => Err(ComposeError::new(
                "mechanisation",
                "the integration formulae are those of north-east-down axes: remove the key, or \
                 frame = \"wander-azimuth\"",
            )),
            (MechanisationMethod::IntegrationFormulae, samples) => {
                let samples = samples.unwrap_or(2);
                if !(1..=MAX_SAMPLES).contains(&samples) {
                    return Err(wrong(format!("found {samples}; give 1 to {MAX_SAMPLES}")));
                }
                Ok(Integrator::Formulae(Formulae::new(samples)))
            }
        }
    }
}

impl<'de> Deserialize<'de> for MechanisationKey {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(MethodOrTable)
    }
}

struct MethodOrTable;

impl<'de> Visitor<'de> for MethodOrTable {
    type Value = MechanisationKey;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "\"two-sample\", \"integration-formulae\", or a table such as { method = \
             \"integration-formulae\", samples = 4 }",
        )
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let method = MechanisationMethod::deserialize(text.into_deserializer())?;
        Ok(MechanisationKey(MechanisationConfig { method, samples: None }))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        MechanisationConfig::deserialize(MapAccessDeserializer::new(map)).map(MechanisationKey)
    }
}

impl JsonSchema for MechanisationKey {
    fn schema_name() -> Cow<'static, str> {
        "Mechanisation".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            generator.subschema_for::<MechanisationMethod>(),
            generator.subschema_for::<MechanisationConfig>(),
        ] })
    }
}

/// The integrator that a scenario names.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Integrator {
    TwoSample(Mechanisation),
    Formulae(Formulae),
}

impl Default for Integrator {
    fn default() -> Self {
        Self::TwoSample(Mechanisation::default())
    }
}

impl Saved for Integrator {
    fn saved(&mut self, io: &mut Io<'_>) {
        match self {
            Self::TwoSample(mechanisation) => io.pass(mechanisation),
            Self::Formulae(formulae) => io.pass(formulae),
        }
    }
}

impl Integrator {
    /// Forgets the samples so far, as after a gap.
    pub fn restart(&mut self) {
        match self {
            Self::TwoSample(mechanisation) => mechanisation.restart(),
            Self::Formulae(formulae) => formulae.restart(),
        }
    }

    /// Advances a state by a part of a sample: see [`Mechanisation::step_part`].
    #[inline(always)]
    pub fn step_part(
        &mut self,
        state: &NavState,
        inc: &Increments,
        sample_dt: f64,
    ) -> Result<(NavState, StepRates), MechanisationError> {
        match self {
            Self::TwoSample(mechanisation) => mechanisation.step_part(state, inc, sample_dt),
            Self::Formulae(formulae) => formulae.step_part(state, inc, sample_dt),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use crate::testing::{Bench, compose};
    use navfuse_core::model::process::{Input, Interval};
    use navfuse_core::units::sample::{Sample, SensorId};
    use navfuse_core::units::time::Time;

    /// A vehicle at rest at 45 deg, of which the IMU measures nothing but gravity: both forms turn it
    /// with the Earth, 0.05 rad/h, and agree to the 1e-9 of a step of 10 ms.
    #[test]
    fn the_process_uses_the_form_that_the_key_names() {
        let end = |settings: &[&str]| {
            let mut bench = Bench::new(settings);
            let (layout, mut state) = (bench.composition.layout.clone(), bench.state());
            let mut transition = bench.composition.transition.clone();
            let process = &mut bench.composition.processes[0].model;
            for k in 1..=100_i64 {
                let (from, to) = (10_000_000 * (k - 1), 10_000_000 * k);
                let turn = 0.1 * (k as f64 / 20.0).sin();
                let sample = Sample::new(
                    Time::from_nanos(to),
                    SensorId(0),
                    &[turn, 0.2, -turn, 1.0, 10.0 * turn, -9.8],
                );
                let input = Input { sample: &sample, duration: 0.01, usual: 0.01, spread: None };
                let (from, to) = (Time::from_nanos(from), Time::from_nanos(to));
                let interval = Interval { from, to, input: Some(input) };
                process.propagate(&layout, &mut state, &interval, &mut transition).unwrap();
            }
            state.get(&layout, bench.navigation.velocity)
        };
        let two = end(&[]);
        let same = end(&["process.ins.mechanisation='two-sample'"]);
        assert_eq!(two, same);
        let formulae = end(&["process.ins.mechanisation='integration-formulae'"]);
        let off = (formulae - two).norm();
        assert!(off > 0.0 && off < 1e-6, "{two} {formulae}");
        let constant =
            end(&["process.ins.mechanisation={method='integration-formulae',samples=1}"]);
        assert!((constant - two).norm() > 10.0 * off, "{two} {constant}");
    }

    #[test]
    fn a_number_of_samples_that_does_not_fit_is_rejected() {
        let error = |key: &str| {
            let text = format!("process.ins.mechanisation={key}");
            compose(crate::testing::SCENARIO, &[&text]).err().unwrap_or_default()
        };
        assert_eq!(error("{method='integration-formulae',samples=4}"), "");
        for samples in ["0", "5"] {
            let found = error(&format!("{{method='integration-formulae',samples={samples}}}"));
            assert!(found.contains("give 1 to 4"), "{found}");
        }
        assert!(error("{samples=2}").contains("always two samples"), "{}", error("{samples=2}"));
        assert!(error("'savage'").contains("integration-formulae"), "{}", error("'savage'"));
    }
}
