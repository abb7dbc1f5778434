//! Relative poses: the translation and the rotation of a sensor since its previous sample, as
//! visual odometry, lidar odometry and scan matching give them.
//!
//! With `'` for the past pose, `C_s^b` the mounting, `l` the lever arm and `k` the scale factor:
//! ```text
//! translation = k C_b^s C_n'^b' (p [-] p' + C_b^n l - C_b'^n' l)
//! rotation    = log(C_b^s C_n'^b' C_b^n C_s^b)
//! ```
//! The past pose is a clone of the state (Roumeliotis & Burdick, *Stochastic cloning*, ICRA 2002).

mod keys;
mod logarithm;
mod model;

pub use keys::RelativePose;
pub use model::RelativePoseModel;

use navfuse_core::plugin::{Need, Plugin, Registry};

/// Registers the sensor type `relative-pose`.
#[derive(Clone, Copy, Debug)]
pub struct RelativePosePlugin;

impl Plugin for RelativePosePlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<RelativePose>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
