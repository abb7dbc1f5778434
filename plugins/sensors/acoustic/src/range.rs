//! Two-way range to a transponder: `z = k (|p - q| + |p' - q|) / 2`, with the vehicle at `p` when it
//! hears the reply, at `p'` when it sent the ping, and the transponder at `q`.
//!
//! A long baseline is several of these sensors, one for each transponder (Whitcomb, Yoerger and Singh,
//! *Advances in Doppler-Based Navigation of Underwater Robotic Vehicles*, ICRA 1999).

use crate::place::{Displaced, Place};
use crate::sound::Ratio;
use navfuse_core::Real;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Acoustic range to one transponder, half the way of ping and reply without the delay of the
/// transponder. A long baseline has a table for each transponder; one alone is a beacon.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AcousticRange {
    /// 1-sigma noise of one range.
    pub noise: Sigma<Length>,
    /// Place of the transponder.
    pub transponder: Place,
    /// North, east and down of the true place from the given one: with a `sigma`, the place is a
    /// state. Default: zero.
    #[serde(default)]
    pub displacement: LeverArm,
    /// Speed of sound: the name of a `[process.NAME]` of type sound-speed. Default: the one that the
    /// instrument is set to.
    pub sound: Option<String>,
    /// Position of the transducer from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
    /// Keys that only a simulation needs.
    #[serde(default)]
    pub simulation: Simulated,
}

/// Simulation of a range.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Simulated {
    /// Range beyond which the transponder does not hear the vehicle. Default: none.
    pub reach: Option<Positive<Length>>,
}

impl SensorType for AcousticRange {
    const TYPE: &'static str = "acoustic-range";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m")]
    }

    fn limits(&self) -> Vec<Limit> {
        // no transponder is heard over more than some 10 km
        vec![Limit::range("range", 0.0, 30_000.0)]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let arm = self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        composer.mounted(Mounting::at(arm));
        Ok(Role::measurement(RangeModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            transponder: Displaced::new(composer, &self.transponder, self.displacement)?,
            ratio: Ratio::find(composer, self.sound.as_deref())?,
            lever_arm: arm,
            sigma: self.noise.value().si(),
            reach: self.simulation.reach.map_or(f64::INFINITY, |reach| reach.value().si()),
        }))
    }
}

/// Speed of sound that is accurate enough for the way of the vehicle during the travel of the sound,
/// m/s: an error of 3 % of the 2.7 m of a vehicle at 2 m/s and 1 km is 4 cm of half that way.
const SOUND: f64 = 1500.0;

/// The measurement model of an [`AcousticRange`].
#[derive(Clone, Debug)]
struct RangeModel {
    navigation: Navigation,
    transponder: Displaced,
    ratio: Ratio,
    lever_arm: Handle<Vector<3>>,
    /// 1-sigma, m.
    sigma: f64,
    /// Longest simulated range, m.
    reach: f64,
}

impl MeasurementModel<1> for RangeModel {
    /// The place of the ping is `p - v tau`, with the time `tau = 2 |p - q| / c` of the travel.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        // the lever arm is added as a vector, which metres resolve better than radians
        let reply = self.transponder.seen_from(x, &x.get(self.navigation.position))
            - x.get(self.navigation.attitude) * x.get(self.lever_arm);
        let travelled = reply.norm() * convert(2.0 / SOUND);
        let ping = reply + x.get(self.navigation.velocity) * travelled;
        let range = (reply.norm() + ping.norm()) * convert(0.5);
        SVector::from([range * self.ratio.get(x)])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        if sample.get(0).is_some_and(|range| range > self.reach) {
            sample.clear(0);
        }
    }
}
