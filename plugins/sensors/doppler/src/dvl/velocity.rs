//! The velocity along the instrument's own three axes.

use super::altitude::{self, Altitude};
use super::geometry::{FASTEST, directions};
use super::sound::{Sound, SoundSpeed};
use crate::instrument::{Instrument, TrackingMode};
use crate::keys::doppler_sensor;
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::model::sensor::measurement::{Jacobian, MeasurementModel};
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::View;
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Ratio, Sigma, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

doppler_sensor! {
    /// Doppler velocity log that outputs the velocity over the bottom, or through the water, along
    /// its own three axes.
    pub struct Dvl {
        /// 1-sigma noise of one sample, one value or one per axis.
        pub noise: Sigma<Triple<Speed>>,
        /// Noise that grows with the speed: its 1-sigma as a share of the speed, such as "0.25 %",
        /// one value or one per axis. It adds to `noise` as a variance. Default: none.
        pub relative_noise: Option<Sigma<Triple<Ratio>>>,
    } tracks
}

impl SensorType for Dvl {
    const TYPE: &'static str = "dvl";

    fn channels(&self) -> Vec<Channel> {
        let axes = ["vel_x", "vel_y", "vel_z"].map(|name| Channel::new(name, "mps"));
        let sound = self.sound_speed.as_ref().map(|_| SoundSpeed::channel());
        axes.into_iter().chain(sound).chain(self.altitude.then(altitude::channel)).collect()
    }

    fn limits(&self) -> Vec<Limit> {
        ["vel_x", "vel_y", "vel_z"].map(|name| Limit::range(name, -FASTEST, FASTEST)).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let instrument = self.instrument(composer)?;
        let channel = 3 + usize::from(self.sound_speed.is_some());
        let altitude = Altitude::new(self.altitude, self.simulated_bottom, channel)?;
        // the usual four beams: the instrument does not give its own
        let beams = directions(None, None, None)?;
        let sound = self.sound_speed.as_ref().map(|sound| sound.build(composer, &beams, 3));
        let (sound, beam) = (sound.transpose()?, beams[0]);
        let beams = altitude::drawn(&beams, false, altitude.as_ref());
        composer.mounted(instrument.mounting().with_beams(beams));
        let sigma = self.noise.value().si();
        let relative = self.relative_noise.map(|share| share.value().si());
        Ok(Role::measurement(DvlModel { instrument, sigma, relative, sound, beam, altitude }))
    }
}

/// The measurement model of a [`Dvl`].
#[derive(Clone, Debug)]
pub struct DvlModel {
    instrument: Instrument,
    sigma: Vector3<f64>,
    /// Noise as a share of the speed.
    relative: Option<Vector3<f64>>,
    sound: Option<Sound>,
    /// A beam, with the slant of all.
    beam: Vector3<f64>,
    altitude: Option<Altitude>,
}

impl DvlModel {
    /// Gains of the three axes by the speed of sound, where it is known.
    fn gains<T: Real>(&self, x: &View<'_, T>) -> Option<Vector3<T>> {
        let sound = self.sound.as_ref()?;
        Some(sound.gains(&self.beam, sound.speed(&self.instrument, x)?))
    }
}

impl MeasurementModel<3> for DvlModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let velocity = self.instrument.velocity(x);
        match self.gains(x) {
            Some(gains) => velocity.component_mul(&gains),
            None => velocity,
        }
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        let mut variances = self.sigma.map(|s| s * s);
        if let Some(relative) = self.relative {
            let speed_squared = self.instrument.velocity(x).norm_squared();
            variances += relative.map(|share| share * share * speed_squared);
        }
        SMatrix::from_diagonal(&variances)
    }

    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, 3>) -> bool {
        if self.sound.as_ref().is_some_and(|sound| sound.follows_state(x)) {
            return false;
        }
        let gains = self.gains(x).unwrap_or_else(|| Vector3::repeat(1.0));
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()].map(|e| e.component_mul(&gains));
        self.instrument.differentiate(x, &axes, h);
        true
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        if let Some(sound) = &self.sound {
            sound.simulate(sample);
        }
        if let Some(altitude) = &self.altitude {
            altitude.simulate(&self.instrument, scene, sample);
        }
        scene.measure(self, sample);
    }
}
