//! Laser Doppler velocimeter: the velocity over the ground along one to four laser beams.
//!
//! `z_i = k u_i · C_b^d (C_n^b v^n + w_eb^b x l)`: Pan & Wu eq. (7), projected on the beams `u_i`.
//! A velocity towards the ground spot is positive.

use crate::beam::{Beam, PerBeam};
use crate::instrument::Instrument;
use crate::keys::doppler_sensor;
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{Jacobian, MeasurementModel};
use navfuse_core::model::sensor::mounting::{self, Reach};
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3, convert};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::View;
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Positive, Ratio, Sigma, Speed};
use schemars::JsonSchema;
use serde::Deserialize;

doppler_sensor! {
    /// Laser Doppler velocimeter: the velocity over the ground along each of its beams.
    pub struct LaserDoppler {
        /// One to four directions in which the beams leave the instrument, [forward, right, down]
        /// of any length, or { azimuth, elevation }, the elevation negative towards the ground. A
        /// velocity along the beam is positive.
        pub beams: Vec<Beam>,
        /// 1-sigma noise of one sample, one value or one per beam.
        pub noise: PerBeam<Sigma<Speed>>,
        /// Simulation: probability that a beam finds no echo, independently of the others, one
        /// value or one per beam.
        #[serde(default = "none_lost")]
        pub beam_dropout: PerBeam<Sigma<Ratio>>,
        /// Simulation: lowest speed along a beam, of either sign, that the instrument can read.
        /// Below it the beam is lost.
        #[serde(default = "no_speed")]
        pub min_speed: Sigma<Speed>,
        /// Simulation: highest speed along a beam, of either sign, that the instrument can read.
        /// Above it the beam is lost.
        pub max_speed: Option<Positive<Speed>>,
    }
}

fn none_lost() -> PerBeam<Sigma<Ratio>> {
    PerBeam::all(Sigma::from_si(0.0))
}

fn no_speed() -> Sigma<Speed> {
    Sigma::from_si(0.0)
}

/// Least angle between two beams, rad: closer beams read the same within 1e-5 of the velocity.
const SAME: f64 = 1e-5;

impl SensorType for LaserDoppler {
    const TYPE: &'static str = "laser-doppler";

    fn channels(&self) -> Vec<Channel> {
        ["beam_1", "beam_2", "beam_3", "beam_4"]
            .map(|name| Channel::new(name, "mps"))
            .into_iter()
            .take(self.beams.len())
            .collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        match self.beams.len() {
            1 => self.role::<1>(composer),
            2 => self.role::<2>(composer),
            3 => self.role::<3>(composer),
            4 => self.role::<4>(composer),
            n => Err(ComposeError::new("beams", format!("{n} beams; give one to four"))),
        }
    }
}

impl LaserDoppler {
    fn role<const N: usize>(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let beams: [Vector3<f64>; N] = std::array::from_fn(|i| self.beams[i].direction());
        let pairs = (0..N).flat_map(|i| (0..i).map(move |j| (j, i)));
        if let Some((j, i)) =
            pairs.into_iter().find(|&(j, i)| beams[i].cross(&beams[j]).norm() < SAME)
        {
            let message = format!(
                "beams {} and {} are on one line and read the same; remove one (two instruments \
                 are two sensors)",
                j + 1,
                i + 1
            );
            return Err(ComposeError::new("beams", message));
        }
        let count = |key: &str, n: usize| {
            ComposeError::new(key, format!("{n} values for {N} beams; give one, or one a beam"))
        };
        let sigma = self.noise.values::<N>().map_err(|n| count("noise", n))?.map(|s| s.si());
        let dropout =
            self.beam_dropout.values::<N>().map_err(|n| count("beam_dropout", n))?.map(|p| p.si());
        if let Some(p) = dropout.iter().find(|p| **p > 1.0) {
            return Err(ComposeError::new(
                "beam_dropout",
                format!("a probability is at most 1, found {p}"),
            ));
        }
        let (min, max) = (self.min_speed.si(), self.max_speed.map_or(f64::INFINITY, |s| s.si()));
        if min >= max {
            return Err(ComposeError::new(
                "max_speed",
                format!("{max} m/s is not above min_speed, {min} m/s"),
            ));
        }
        let instrument = self.instrument(composer)?;
        if N == 1 {
            note_unobservable(composer, &instrument, &beams[0]);
        }
        let drawn = beams.iter().enumerate().map(|(k, b)| mounting::Beam {
            direction: [b.x, b.y, b.z],
            channel: Some(k),
            reach: Reach::Unknown,
        });
        composer.mounted(instrument.mounting().with_beams(drawn));
        Ok(Role::measurement(LaserDopplerModel {
            instrument,
            beams,
            sigma,
            dropout,
            readable: min..=max,
        }))
    }
}

/// Notes the directions in which one beam observes neither misalignment nor lever arm: with
/// `z = k u . C_b^d v`, the derivative by a rotation `eta` is `(v x u) . eta`, zero for `eta` along
/// `u`, and the derivative by the lever arm is across `u`.
fn note_unobservable(composer: &mut Composer, instrument: &Instrument, beam: &Vector3<f64>) {
    if composer.tangent(instrument.c_b_d).is_some() {
        let [x, y, z] = <[f64; 3]>::from(*beam).map(|c| format!("{c:.3}"));
        composer.note(format!(
            "one beam does not see a rotation about itself: about [{x}, {y}, {z}] in the \
             instrument's axes the misalignment stays as uncertain as its prior, whatever the motion"
        ));
    }
    if composer.tangent(instrument.lever_arm).is_some() {
        composer.note(
            "one beam does not see a lever arm along itself: that part of it stays as uncertain \
             as its prior",
        );
    }
}

/// The measurement model of a [`LaserDoppler`] of `N` beams.
#[derive(Clone, Debug)]
pub struct LaserDopplerModel<const N: usize> {
    instrument: Instrument,
    /// Unit vectors in the instrument's axes.
    beams: [Vector3<f64>; N],
    sigma: [f64; N],
    dropout: [f64; N],
    /// Speeds along a beam, m/s, that it can read.
    readable: std::ops::RangeInclusive<f64>,
}

impl<const N: usize> MeasurementModel<N> for LaserDopplerModel<N> {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, N> {
        let v_d = self.instrument.velocity(x);
        SVector::from(self.beams.map(|u| u.map(convert::<f64, T>).dot(&v_d)))
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&SVector::from(self.sigma.map(|s| s * s)))
    }

    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, N>) -> bool {
        self.instrument.differentiate(x, &self.beams, h);
        true
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        // by the true speed: the noisy reading would select noise of one sign at the limits
        let truth = self.predict(&View::new(scene.layout, scene.truth));
        for i in 0..N {
            let lost = scene.random.uniform() < self.dropout[i];
            if lost || !self.readable.contains(&truth[i].abs()) {
                sample.clear(i);
            }
        }
    }
}
