//! The velocity along each beam of a DVL.

use super::altitude::{self, Altitude};
use super::geometry::{FASTEST, MAX_BEAMS, count, directions};
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
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3, convert};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::View;
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Angle, Ratio, Sigma, Speed};
use schemars::JsonSchema;
use serde::Deserialize;
use std::array;

doppler_sensor! {
    /// Doppler velocity log that outputs the velocity along each of its beams. The filter uses
    /// whichever beams are valid, even a single one.
    pub struct DvlBeams {
        /// 1-sigma noise of one beam of one sample.
        pub noise: Sigma<Speed>,
        /// Noise of a beam that grows with the speed of the vehicle: its 1-sigma as a share of the
        /// speed, such as "0.15 %". It adds to `noise` as a variance. Default: none.
        #[serde(default = "none")]
        pub relative_noise: Sigma<Ratio>,
        /// Angle between the beams and the instrument's down axis. Default: 30 deg.
        pub slant: Option<Angle>,
        /// Azimuths of the beams, from forward towards right, one to five. Default: an X of 45,
        /// 135, 225 and 315 deg.
        pub azimuth: Option<Vec<Angle>>,
        /// Direction of each beam in the instrument's axes [forward, right, down], of any length,
        /// in place of slant and azimuth.
        pub beams: Option<Vec<[f64; 3]>>,
        /// Simulation: probability that a beam is lost, independently of the others.
        #[serde(default = "none")]
        pub beam_dropout: Sigma<Ratio>,
    } tracks
}

fn none() -> Sigma<Ratio> {
    Sigma::from_si(0.0)
}

impl SensorType for DvlBeams {
    const TYPE: &'static str = "dvl-beams";

    fn channels(&self) -> Vec<Channel> {
        let names: [&str; MAX_BEAMS] = ["beam_1", "beam_2", "beam_3", "beam_4", "beam_5"];
        let beams = names.into_iter().take(count(self.azimuth.as_deref(), self.beams.as_deref()));
        let beams = beams.map(|name| Channel::new(name, "mps"));
        let sound = self.sound_speed.as_ref().map(|_| SoundSpeed::channel());
        beams.chain(sound).chain(self.altitude.then(altitude::channel)).collect()
    }

    fn limits(&self) -> Vec<Limit> {
        let beams = self.channels().into_iter().filter(|c| c.name.starts_with("beam"));
        beams.map(|c| Limit::range(c.name, -FASTEST, FASTEST)).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let beams = directions(self.slant, self.azimuth.as_deref(), self.beams.as_deref())?;
        match *beams.as_slice() {
            [a] => self.role(&[a], composer),
            [a, b] => self.role(&[a, b], composer),
            [a, b, c] => self.role(&[a, b, c], composer),
            [a, b, c, d] => self.role(&[a, b, c, d], composer),
            [a, b, c, d, e] => self.role(&[a, b, c, d, e], composer),
            _ => Err(ComposeError::new("", "the number of beams is not possible")),
        }
    }
}

impl DvlBeams {
    fn role<const N: usize>(
        &self,
        beams: &[Vector3<f64>; N],
        composer: &mut Composer,
    ) -> Result<Role, ComposeError> {
        let instrument = self.instrument(composer)?;
        let channel = N + usize::from(self.sound_speed.is_some());
        let altitude = Altitude::new(self.altitude, self.simulated_bottom, channel)?;
        let drawn = altitude::drawn(beams, true, altitude.as_ref());
        composer.mounted(instrument.mounting().with_beams(drawn));
        let sound = self.sound_speed.as_ref().map(|sound| sound.build(composer, beams, N));
        let sound = sound.transpose()?;
        Ok(Role::measurement(DvlBeamsModel {
            instrument,
            beams: *beams,
            sound,
            altitude,
            sigma: self.noise.value().si(),
            relative: self.relative_noise.value().si(),
            dropout: self.beam_dropout.value().si(),
        }))
    }
}

/// The measurement model of [`DvlBeams`] of `N` beams.
#[derive(Clone, Debug)]
pub struct DvlBeamsModel<const N: usize> {
    instrument: Instrument,
    /// Unit vectors in the instrument's axes.
    beams: [Vector3<f64>; N],
    sound: Option<Sound>,
    altitude: Option<Altitude>,
    sigma: f64,
    /// Noise as a share of the speed.
    relative: f64,
    dropout: f64,
}

impl<const N: usize> DvlBeamsModel<N> {
    /// True speed of sound, where the sample or the water column has it.
    fn sound<T: Real>(&self, x: &View<'_, T>) -> Option<T> {
        self.sound.as_ref()?.speed(&self.instrument, x)
    }

    /// Direction of a beam, with the gains that a true speed of sound gives it.
    fn beam<T: Real>(&self, i: usize, c: Option<T>) -> Vector3<T> {
        let beam = self.beams[i].map(convert::<f64, T>);
        match self.sound.as_ref().zip(c) {
            Some((sound, c)) => beam.component_mul(&sound.gains(&self.beams[i], c)),
            None => beam,
        }
    }
}

impl<const N: usize> MeasurementModel<N> for DvlBeamsModel<N> {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, N> {
        let (v, sound) = (self.instrument.velocity(x), self.sound(x));
        SVector::from_fn(|i, _| self.beam(i, sound).dot(&v))
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, N, N> {
        let mut variance = self.sigma * self.sigma;
        if self.relative > 0.0 {
            variance += self.relative.powi(2) * self.instrument.velocity(x).norm_squared();
        }
        SMatrix::from_diagonal_element(variance)
    }

    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, N>) -> bool {
        if self.sound.as_ref().is_some_and(|sound| sound.follows_state(x)) {
            return false;
        }
        let sound = self.sound(x);
        let beams = array::from_fn(|i| self.beam(i, sound));
        self.instrument.differentiate(x, &beams, h);
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
        if self.dropout > 0.0 {
            (0..N).for_each(|i| {
                if scene.random.uniform() < self.dropout {
                    sample.clear(i);
                }
            });
        }
    }
}
