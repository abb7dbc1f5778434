//! The types that a plugin registers: each reads its table of the scenario, and builds what it means.

use crate::compose::Composer;
use crate::model::error::ComposeError;
use crate::model::process::BuiltProcess;
use crate::model::sensor::Role;
use crate::model::sensor::limits::Limit;
use crate::model::stream::{Sink, Source, StreamError};
use crate::plugin::OpenContext;
use crate::units::sample::Channel;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// A type of sensor. Its fields are the parameters in TOML, with their documentation, units and
/// defaults.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Height above the ellipsoid.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Altitude {
///     /// 1-sigma noise.
///     noise: Sigma<Length>,
/// }
///
/// struct Model(Altitude, Handle<Position>);
///
/// impl SensorType for Altitude {
///     const TYPE: &'static str = "altitude";
///     fn channels(&self) -> Vec<Channel> {
///         vec![Channel::new("height", "m")]
///     }
///     fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
///         let position = composer.find("position", "ins.position")?;
///         Ok(Role::measurement(Model(self, position)))
///     }
/// }
///
/// impl MeasurementModel<1> for Model {
///     fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
///         SVector::from([x.get(self.1).height])
///     }
///     fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
///         SMatrix::from_element(self.0.noise.value().si().powi(2))
///     }
/// }
///
/// let mut registry = Registry::new();
/// registry.sensor::<Altitude>(); // [sensor.altitude]
/// ```
pub trait SensorType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Set if the sensor drives a process model. Such sensors are composed before the processes.
    const INPUT: bool = false;
    /// Channels of its samples.
    fn channels(&self) -> Vec<Channel>;
    /// Plausible values of its channels. A sample beyond them is rejected; the key `limits`
    /// replaces them. Default: none.
    fn limits(&self) -> Vec<Limit> {
        Vec::new()
    }
    /// Channels that are all exactly zero where the instrument has no measurement, such as latitude and
    /// longitude of a receiver without a fix. Such a sample is rejected. Default: none.
    fn unset(&self) -> &'static [&'static str] {
        &[]
    }
    /// Adds its states and returns its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or a block that the sensor needs is missing.
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError>;
}

/// A type of process model.
///
/// A type that propagates nothing itself, but adds a state with the dynamics of the framework:
/// ```
/// use navfuse_core::prelude::*;
/// /// Height of the sea surface.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Tide {
///     /// Height above the ellipsoid, with `sigma` and `correlation_time`.
///     height: LengthBias,
/// }
///
/// impl ProcessType for Tide {
///     const TYPE: &'static str = "tide";
///     fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
///         // other types find the state as tide.height
///         self.height.block::<Scalar>(composer, "height", &[0.0], display::LENGTH)?;
///         Ok(BuiltProcess::new(OwnDynamics))
///     }
/// }
/// let mut registry = Registry::new();
/// registry.process::<Tide>(); // [process.tide]
/// ```
pub trait ProcessType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Set if it moves a body beside the vehicle, such as a ship: it is built after the other
    /// processes, wherever its table stands, and its sensor never gives the pace.
    const BESIDE: bool = false;
    /// Adds its states, declares its part of the transition and returns its model.
    ///
    /// # Errors
    /// When a parameter does not fit, or its driving sensor is missing.
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError>;
}

/// A type of source.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// A source without samples, for a scenario that is only composed.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// struct Silence {}
/// struct Silent;
/// impl SourceType for Silence {
///     const TYPE: &'static str = "silence";
///     fn open(self, _: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
///         Ok(vec![Box::new(Silent)])
///     }
/// }
/// impl Source for Silent {
///     fn next(&mut self, _: &mut Sample) -> Result<bool, StreamError> {
///         Ok(false)
///     }
/// }
/// let mut registry = Registry::new();
/// registry.source::<Silence>(); // [source.silence]
/// ```
pub trait SourceType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Set if the samples are simulated, so that another seed gives another run.
    const SIMULATES: bool = false;
    /// Opens the source: one or several streams, which the runner merges.
    ///
    /// # Errors
    /// When a file is missing or malformed.
    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError>;
}

/// A type of sink.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// Prints every event to the terminal.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// struct Terminal {}
/// struct Printing;
/// impl SinkType for Terminal {
///     const TYPE: &'static str = "terminal";
///     const DEFAULT: bool = false; // only where the scenario has [sink.terminal]
///     fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
///         Ok(Box::new(Printing))
///     }
/// }
/// impl Sink for Printing {
///     fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
///         if let Record::Event(event) = record {
///             println!("{} {}: {}", event.time, event.about, event.text);
///         }
///         Ok(())
///     }
/// }
/// let mut registry = Registry::new();
/// registry.sink::<Terminal>();
/// ```
pub trait SinkType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Set if the sink records every run, with its default parameters if the scenario does not
    /// mention it.
    const DEFAULT: bool = true;
    /// The files that it writes; relative paths start at the output folder of the run. Before any
    /// sink is opened, the framework rejects a scenario in which two sinks write the same file.
    fn files(&self) -> Vec<PathBuf> {
        Vec::new()
    }
    /// Opens it.
    ///
    /// # Errors
    /// When the file cannot be created, or nobody answers at the address.
    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError>;
}
