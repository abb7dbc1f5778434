//! The framework of navfuse. Plugins provide state blocks, process models and measurement models; a
//! TOML scenario describes how the framework composes them into an error-state EKF.
//!
//! The framework contains no sensor, no file format and no viewer. A sensor is one generic function
//! of typed state blocks; dual numbers differentiate the function, and the framework gates, records
//! and simulates the sensor. This program estimates the level of a lake from a gauge:
//!
//! ```
//! use navfuse_core::document::Document;
//! use navfuse_core::prelude::*;
//! use navfuse_core::run::runner::run;
//! use navfuse_core::run::scenario::Scenario;
//!
//! /// A lake, whose level is a state with dynamics of its own.
//! #[derive(Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields)]
//! struct Lake {
//!     /// Level above the zero of the gauge.
//!     level: LengthBias,
//! }
//!
//! impl ProcessType for Lake {
//!     const TYPE: &'static str = "lake";
//!     fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
//!         self.level.block::<Scalar>(composer, "level", &[0.0], display::LENGTH)?;
//!         Ok(BuiltProcess::new(OwnDynamics))
//!     }
//! }
//!
//! /// A gauge that measures the level.
//! #[derive(Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields)]
//! struct Gauge {
//!     /// 1-sigma noise.
//!     noise: Sigma<Length>,
//! }
//!
//! struct GaugeModel {
//!     level: Handle<Scalar>,
//!     sigma: f64,
//! }
//!
//! impl SensorType for Gauge {
//!     const TYPE: &'static str = "gauge";
//!     fn channels(&self) -> Vec<Channel> {
//!         vec![Channel::new("level", "m")]
//!     }
//!     fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
//!         let level = composer.find("level", "lake.level")?;
//!         Ok(Role::measurement(GaugeModel { level, sigma: self.noise.value().si() }))
//!     }
//! }
//!
//! impl MeasurementModel<1> for GaugeModel {
//!     fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
//!         SVector::from([x.get(self.level)])
//!     }
//!     fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
//!         SMatrix::from([[self.sigma * self.sigma]])
//!     }
//! }
//!
//! /// Hourly readings of the gauge in metres.
//! #[derive(Deserialize, JsonSchema)]
//! #[serde(deny_unknown_fields)]
//! struct Readings {
//!     /// Level of each hour.
//!     levels: Vec<f64>,
//! }
//!
//! struct Hourly(std::vec::IntoIter<Sample>);
//!
//! impl SourceType for Readings {
//!     const TYPE: &'static str = "readings";
//!     fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
//!         let missing = || StreamError::new("the scenario has no [sensor.gauge]");
//!         let gauge = SensorId(context.composition.sensor("gauge").ok_or_else(missing)?);
//!         let hour = |k: i64| Time::from_nanos(3_600_000_000_000 * k);
//!         let samples = (0..).zip(&self.levels).map(|(k, z)| Sample::new(hour(k), gauge, &[*z]));
//!         Ok(vec![Box::new(Hourly(samples.collect::<Vec<_>>().into_iter()))])
//!     }
//! }
//!
//! impl Source for Hourly {
//!     fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
//!         let next = self.0.next();
//!         *sample = next.unwrap_or(*sample);
//!         Ok(next.is_some())
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let mut registry = Registry::new();
//! registry.process::<Lake>();
//! registry.sensor::<Gauge>();
//! registry.source::<Readings>();
//! let scenario = r#"
//!     [process.lake]
//!     level = { sigma = "10 m", random_walk = "1 mm/sqrt(s)" }
//!     [sensor.gauge]
//!     noise = "5 cm"
//!     [source.readings]
//!     levels = [4.02, 4.11, 4.23, 4.28]
//! "#;
//! let document = Document::parse("lake.toml", scenario)?;
//! let assembly = Scenario::new(&registry, document, &[])?.assemble(None)?;
//! let finished = run(assembly, &false.into(), |_progress| {});
//! let level = &finished.summary.rows[0];
//! println!("{} = {:.2} m, 1-sigma {:.2} m", level.name, level.estimate[0], level.sigma[0]);
//! # assert!((level.estimate[0] - 4.28).abs() < 0.05 && level.sigma[0] < 0.05);
//! # Ok(())
//! # }
//! ```
//!
//! The modules are rooms by concept, and each uses only the rooms below it:
//!
//! | room | concept |
//! |---|---|
//! | [`run`] | scenario, runner, JSON Schema |
//! | [`session`] | samples pushed in, records out: outputs, summary, verdict |
//! | [`filter`] | the error-state EKF |
//! | [`plugin`] | plugins, and the registry of the types that they provide |
//! | [`compose`] | composer, calibration states, draws from priors, settings of the estimator |
//! | [`model`] | process and measurement models, initial alignment, sensors, sources, sinks |
//! | [`state`] | blocks on manifolds, layout, view, error injection and reset, covariance |
//! | [`units`] | quantities with dimensions, time, samples |
//! | [`document`] | TOML with places, for errors that name file, line and key |
//! | [`checkpoint`] | the memory of a run as bytes, and its transfer |
//! | [`input`] | files that are read: regular, bounded, and never written over meanwhile |
//! | [`files`] | files that appear once they are whole, folders that keep earlier results |
//!
//! A plugin's author starts with [`prelude`]. The
//! [book](https://github.com/navfuse/navfuse/tree/main/docs/src) has tutorials and the equations.

pub mod calendar;
pub mod checkpoint;
pub mod compose;
pub mod document;
pub mod files;
pub mod filter;
pub mod input;
pub mod model;
pub mod plugin;
pub mod prelude;
pub mod run;
pub mod session;
pub mod smooth;
pub mod state;
pub mod units;

pub use nalgebra;

/// A real scalar that a model is generic over: `f64`, or a dual number that carries a derivative.
///
/// ```
/// use navfuse_core::Real;
/// use navfuse_core::nalgebra::convert;
/// /// Speed of sound in fresh water (m/s) at a temperature (deg C), to the second order.
/// fn speed_of_sound<T: Real>(temperature: T) -> T {
///     let [a, b, c] = [1402.4, 5.04, -0.058].map(convert::<f64, T>);
///     a + temperature * (b + temperature * c)
/// }
/// assert!((speed_of_sound(10.0_f64) - 1447.0).abs() < 1.0);
/// ```
pub trait Real: nalgebra::RealField + Copy {}
impl<T: nalgebra::RealField + Copy> Real for T {}

/// The value of a scalar without its derivative: the place in a table, from which a model continues
/// with the scalar itself.
///
/// ```
/// use navfuse_core::{Real, number};
/// use navfuse_core::nalgebra::convert;
/// /// Linear interpolation between the values of a table with a step of 1.
/// fn interpolate<T: Real>(table: &[f64], x: T) -> T {
///     let k = number(x).floor().clamp(0.0, table.len() as f64 - 2.0);
///     let [a, b] = [table[k as usize], table[k as usize + 1]].map(convert::<f64, T>);
///     a + (b - a) * (x - convert(k))
/// }
/// assert_eq!(interpolate(&[1.0, 3.0, 4.0], 1.5), 3.5);
/// ```
pub fn number<T: Real>(x: T) -> f64 {
    nalgebra::convert_unchecked(x)
}

/// The example in README.md is compiled with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
