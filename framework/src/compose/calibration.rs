//! Calibration states: scale, misalignment, lever arm, bias, each one line of TOML.
//!
//! ```toml
//! scale = { initial = 0.8, sigma = 0.2, truth = 0.9998 }               # estimated
//! lever_arm = ["-0.06 m", "0 m", "0.21 m"]                             # fixed
//! misalignment = { mode = "consider", sigma = "0.5 deg" }  # uncertainty carried, not reduced
//! bias = { sigma = "5 cm", correlation_time = "1 h" }                  # first-order Gauss-Markov
//! ```

use crate::compose::Composer;
use crate::model::error::ComposeError;
use crate::state::manifold::Manifold;
use crate::state::{BlockSpec, Display, Dynamics, Handle, Mode};
use crate::units::{
    Acceleration, AccelerationRandomWalk, Angle, AngularRate, AngularRateNoise,
    AngularRateRandomWalk, Components, Duration, DurationRandomWalk, Length, LengthRandomWalk,
    Positive, Ratio, RatioRandomWalk, Sigma, Triple,
};
use schemars::JsonSchema;
use serde::de::{IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;

/// A calibration state. A value alone is held fixed; a sigma makes it estimated unless `mode` gives
/// another mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration<V: Components, W: Components> {
    /// Estimate, fixed or consider. Default: `estimate` with a sigma, else `fixed`.
    pub mode: Option<Mode>,
    /// Initial value.
    pub initial: Option<V>,
    /// Prior 1-sigma.
    pub sigma: Option<Sigma<V>>,
    /// True value, for simulated sensors and for comparison with the estimate.
    pub truth: Option<V>,
    /// Random walk per square root of time.
    pub random_walk: Option<Sigma<W>>,
    /// Makes it a first-order Gauss-Markov process of stationary sigma `sigma`.
    pub correlation_time: Option<Positive<Duration>>,
}

impl<V: Components, W: Components> Default for Calibration<V, W> {
    fn default() -> Self {
        Self {
            mode: None,
            initial: None,
            sigma: None,
            truth: None,
            random_walk: None,
            correlation_time: None,
        }
    }
}

/// Scale factor.
pub type ScaleFactor = Calibration<Ratio, RatioRandomWalk>;
/// Misalignment angles roll, pitch, yaw.
pub type Misalignment = Calibration<Triple<Angle>, Triple<AngularRateNoise>>;
/// Lever arm in body axes.
pub type LeverArm = Calibration<Triple<Length>, Triple<LengthRandomWalk>>;
/// Bias of a length, such as a depth.
pub type LengthBias = Calibration<Length, LengthRandomWalk>;
/// Offset of a sensor's clock or output.
pub type TimeOffset = Calibration<Duration, DurationRandomWalk>;
/// Bias of three gyros.
pub type GyroBias = Calibration<Triple<AngularRate>, Triple<AngularRateRandomWalk>>;
/// Bias of three accelerometers.
pub type AccelBias = Calibration<Triple<Acceleration>, Triple<AccelerationRandomWalk>>;

/// The table form, which gives the schema.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound = "V: Components, W: Components")]
struct Keys<V: Components, W: Components> {
    /// `estimate`, `fixed`, or `consider`: held at its value, with its uncertainty carried by the
    /// other states. Default: `estimate` with a sigma, else `fixed`.
    mode: Option<Mode>,
    /// Initial value.
    initial: Option<V>,
    /// Prior 1-sigma.
    sigma: Option<Sigma<V>>,
    /// True value, for simulated sensors and for comparison with the estimate.
    truth: Option<V>,
    /// Random walk per square root of time.
    random_walk: Option<Sigma<W>>,
    /// Makes the state a first-order Gauss-Markov process with stationary sigma `sigma`.
    correlation_time: Option<Positive<Duration>>,
}

impl<'de, V: Components, W: Components> Deserialize<'de> for Calibration<V, W> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Form(PhantomData))
    }
}

struct Form<V, W>(PhantomData<(V, W)>);

impl<V: Components, W: Components> Form<V, W> {
    fn fixed<E>(value: V) -> Result<Calibration<V, W>, E> {
        Ok(Calibration { initial: Some(value), ..Calibration::default() })
    }
}

impl<'de, V: Components, W: Components> Visitor<'de> for Form<V, W> {
    type Value = Calibration<V, W>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value to hold fixed, or a table with `initial`, `sigma`, `truth`, `mode`")
    }
    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Self::Value, E> {
        Self::fixed(V::deserialize(text.into_deserializer())?)
    }
    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Self::Value, E> {
        Self::fixed(V::deserialize(value.into_deserializer())?)
    }
    fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Self::Value, E> {
        Self::fixed(V::deserialize(value.into_deserializer())?)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        Self::fixed(V::deserialize(serde::de::value::SeqAccessDeserializer::new(seq))?)
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        let keys = Keys::<V, W>::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
        Ok(Calibration {
            mode: keys.mode,
            initial: keys.initial,
            sigma: keys.sigma,
            truth: keys.truth,
            random_walk: keys.random_walk,
            correlation_time: keys.correlation_time,
        })
    }
}

impl<V: Components, W: Components> JsonSchema for Calibration<V, W> {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        format!("Calibration_{}", V::schema_name()).into()
    }
    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let value = generator.subschema_for::<V>();
        let keys = Keys::<V, W>::json_schema(generator);
        schemars::json_schema!({ "anyOf": [value, keys] })
    }
}

impl<V: Components, W: Components> Calibration<V, W> {
    /// Adds the state `name` of the part that is being composed; `default` is its value
    /// (coordinates, SI) where the scenario gives none.
    ///
    /// # Errors
    /// When an estimated or considered state has no positive sigma, or the number of components is
    /// wrong.
    pub fn block<M: Manifold>(
        &self,
        composer: &mut Composer,
        name: &str,
        default: &[f64],
        display: Display,
    ) -> Result<Handle<M>, ComposeError> {
        let sigma = self.sigma.map(|s| s.value().components());
        let mode = self.mode.unwrap_or(if sigma.is_some() { Mode::Estimate } else { Mode::Fixed });
        let moves = [
            ("random_walk", self.random_walk.is_some()),
            ("correlation_time", self.correlation_time.is_some()),
        ];
        if let Some((key, _)) = moves.iter().find(|(_, given)| *given && mode == Mode::Fixed) {
            let message = match self.mode {
                Some(_) => {
                    "a state that is fixed does not move; remove this key, or mode = \"fixed\""
                }
                None => "a state that moves needs a sigma; add `sigma`, or remove this key",
            };
            return Err(ComposeError::new(format!("{name}.{key}"), message));
        }
        if mode != Mode::Fixed {
            match &sigma {
                None => {
                    return Err(ComposeError::new(
                        name,
                        format!("mode {mode:?} needs a sigma").to_lowercase(),
                    ));
                }
                Some(s) if s.iter().any(|s| *s <= 0.0) => {
                    return Err(ComposeError::new(
                        format!("{name}.sigma"),
                        "a prior sigma of zero makes the covariance singular; give a positive sigma, or \
                         mode = \"fixed\" \
                         to hold the value",
                    ));
                }
                Some(_) => {}
            }
        }
        let dynamics = match (self.random_walk, self.correlation_time) {
            (Some(_), Some(_)) => {
                return Err(ComposeError::new(
                    format!("{name}.correlation_time"),
                    "a state is a random walk or a Gauss-Markov process, not both",
                ));
            }
            (Some(walk), None) => {
                Dynamics::RandomWalk(walk.value().components().iter().map(|w| w * w).collect())
            }
            (None, Some(time)) => Dynamics::GaussMarkov {
                sigma: sigma.clone().ok_or_else(|| {
                    ComposeError::new(name, "a correlation time needs a sigma, the stationary one")
                })?,
                time: time.value().si(),
            },
            (None, None) => Dynamics::Constant,
        };
        composer.block(
            name,
            BlockSpec {
                mode,
                initial: self.initial.map_or_else(|| default.to_vec(), |v| v.components()),
                sigma: sigma.unwrap_or_else(|| vec![0.0; default.len()]),
                truth: self.truth.map(|v| v.components()),
                dynamics,
                display,
            },
        )
    }
}
