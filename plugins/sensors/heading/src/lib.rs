//! Sensors of the attitude.
//!
//! - [`MagneticHeading`]: a compass, with the declination of the place and its own deviation.
//! - [`DualAntenna`]: heading and elevation of the baseline between two GNSS antennas, with the
//!   mounting of the baseline.
//! - [`Magnetometer`]: the field of the Earth on three axes, with the iron of the vehicle.
//! - [`Inclinometer`]: roll and pitch.

mod dual_antenna;
mod inclinometer;
mod magnetic;
mod magnetometer;
mod wmm;

pub use dual_antenna::DualAntenna;
pub use inclinometer::Inclinometer;
pub use magnetic::MagneticHeading;
pub use magnetometer::{Field, Magnetometer};
pub use wmm::MagneticModel;

use navfuse_core::plugin::{Need, Plugin, Registry};
use std::f64::consts::TAU;

/// Registers the sensor types `magnetic-heading`, `dual-antenna`, `magnetometer` and `inclinometer`.
#[derive(Clone, Copy, Debug)]
pub struct HeadingPlugin;

impl Plugin for HeadingPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<MagneticHeading>();
        registry.sensor::<DualAntenna>();
        registry.sensor::<Magnetometer>();
        registry.sensor::<Inclinometer>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}

// ANCHOR: short_way
/// Difference of two angles within +-pi: 359 deg and 1 deg differ by 2 deg.
fn short_way(measured: f64, predicted: f64) -> f64 {
    let difference = measured - predicted;
    difference - TAU * (difference / TAU).round()
}
// ANCHOR_END: short_way

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_innovation_across_north_or_south_is_small() {
        for (measured, predicted, expected) in
            [(359.0, 1.0, -2.0), (1.0, 359.0, 2.0), (179.0, -179.0, -2.0), (10.0, 370.0, 0.0_f64)]
        {
            let found = short_way(f64::to_radians(measured), f64::to_radians(predicted));
            // the rounding of a few operations on angles of at most 7 rad
            assert!((found - expected.to_radians()).abs() < 1e-14, "{measured} {predicted}");
        }
    }
}
