//! The framework of navfuse: state blocks, process and measurement models, plugins, scenarios, and
//! the error-state EKF that they compose into.
//!
//! It knows no sensor, no file format and no viewer: those are plugins. A sensor is one generic
//! function of typed state blocks ([`model::measurement::MeasurementModel`]), registered with its
//! parameters ([`plugin::SensorType`]); a scenario names it in TOML; the [`run::runner`] feeds the
//! [`ekf::Ekf`] from sources and tells sinks what comes of it.

pub mod compose;
pub mod document;
pub mod ekf;
pub mod model;
pub mod plugin;
pub mod prelude;
pub mod run;
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

/// The example in README.md is compiled with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
