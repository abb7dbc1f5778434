//! Inertial navigation: the IMU as a driving sensor, the strapdown process that it drives, and a
//! reference solution to start from and compare with.
//!
//! [`Navigation`] is what other plugins share: the navigation state that a sensor on the same body
//! is predicted from.

pub mod alignment;
mod coast;
pub mod earth;
pub mod error_model;
mod errors;
pub mod formulae;
mod grade;
mod imu;
mod initial;
mod integrator;
pub mod mechanisation;
mod monitor;
mod navigation;
mod places;
mod rates;
mod reference;
mod screening;
mod strapdown;
#[cfg(test)]
mod testing;
pub mod wander;

pub use coast::Coast;
pub use errors::{Axes, GSensitivities, Scales};
pub use grade::Grade;
pub use imu::{Imu, Output};
pub use initial::{InitialPosition, InitialValue};
pub use integrator::{MechanisationConfig, MechanisationKey, MechanisationMethod};
pub use navigation::{Navigation, VelocityDerivative, default_name};
pub use reference::ReferenceSolution;
pub use strapdown::Strapdown;
pub use wander::Frame;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the sensor types `imu` and `reference` and the process type `ins`.
#[derive(Clone, Copy, Debug)]
pub struct InsPlugin;

impl Plugin for InsPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Imu>();
        registry.process::<Strapdown>();
        registry.sensor::<ReferenceSolution>();
    }

    navfuse_core::named_after_crate!();
}
