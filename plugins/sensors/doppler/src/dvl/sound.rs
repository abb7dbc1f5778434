//! Effect of a wrong speed of sound on the velocity of a DVL.

use crate::instrument::Instrument;
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::nalgebra::{Vector3, convert};
use navfuse_core::state::View;
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, Positive, Speed};
use navfuse_core::{Real, number};
use navfuse_seawater::{Column, WaterColumn};
use schemars::JsonSchema;
use serde::Deserialize;

/// Construction of the transducer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Array {
    /// One transducer per beam: each beam points where its transducer does.
    #[default]
    Piston,
    /// One flat face, normal to the down axis, that steers its beams by phase: the slant depends
    /// on the speed of sound.
    Phased,
}

/// Speed of sound of a DVL: the one that the instrument is set to, and the true one.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SoundSpeed {
    /// Speed of sound that the instrument is set to.
    pub set: Positive<Speed>,
    /// Construction of the transducer: `piston` (default) or `phased`, whose horizontal velocity is
    /// independent of the speed of sound. The beams of a phased array are given as they are at the
    /// speed that is set.
    #[serde(default)]
    pub array: Array,
    /// Water at the transducer, from which the true speed follows for a sample without the channel
    /// `sound_speed`. Default: the true speed is the one that is set.
    pub water: Option<WaterColumn>,
    /// Height of the surface above the ellipsoid, for the depth in `water`. Default: zero.
    pub surface: Option<Length>,
    /// Simulation: true speed of sound, as the channel `sound_speed`. Default: the one that is set, or
    /// with `water` samples without that channel.
    pub simulated: Option<Positive<Speed>>,
}

impl SoundSpeed {
    /// The channel of the true speed of sound.
    pub(super) fn channel() -> Channel {
        Channel::new("sound_speed", "mps")
    }

    /// The speed of sound for an instrument with these beams, measured by a channel.
    pub(super) fn build(
        &self,
        composer: &Composer,
        beams: &[Vector3<f64>],
        channel: usize,
    ) -> Result<Sound, ComposeError> {
        if self.array == Array::Phased && beams.iter().any(|b| b.z == 0.0) {
            let message = "a phased array normal to the down axis has no beam across that axis; \
                           give other `beams`";
            return Err(ComposeError::new("sound_speed.array", message));
        }
        let column = self.water.as_ref().map(|w| w.build(composer, "sound_speed.water"));
        let set = self.set.value().si();
        Ok(Sound {
            array: self.array,
            set,
            channel,
            column: column.transpose()?,
            surface: self.surface.map_or(0.0, Length::si),
            simulated: match (self.simulated, &self.water) {
                (Some(simulated), _) => Some(simulated.value().si()),
                (None, None) => Some(set),
                (None, Some(_)) => None,
            },
        })
    }
}

/// The speed of sound, m/s.
#[derive(Clone, Debug)]
pub(super) struct Sound {
    array: Array,
    set: f64,
    /// Channel of the true speed.
    channel: usize,
    column: Option<Column>,
    /// Height of the surface above the ellipsoid, m.
    surface: f64,
    /// True speed of simulated samples.
    simulated: Option<f64>,
}

impl Sound {
    /// True speed of sound at the instrument: of the sample, or of the water column to the first order
    /// of the height; `None` where neither is known.
    pub fn speed<T: Real>(&self, instrument: &Instrument, x: &View<'_, T>) -> Option<T> {
        if let Some(measured) = x.channel(self.channel) {
            return Some(convert(measured));
        }
        let column = self.column.as_ref()?;
        let place = instrument.place(x);
        let (height, latitude) = (number(place.height), number(place.latitude));
        let at = |height: f64| column.speed(self.surface - height, latitude);
        let slope: T = convert(at(height + 0.5) - at(height - 0.5));
        Some(convert::<f64, T>(at(height)) + (place.height - convert(height)) * slope)
    }

    /// Returns `true` if the speed follows from the state, whose derivatives the analytic Jacobian
    /// does not have.
    pub fn follows_state(&self, x: &View<'_, f64>) -> bool {
        self.column.is_some() && x.channel(self.channel).is_none()
    }

    /// Sets the channel of a simulated sample.
    pub fn simulate(&self, sample: &mut Sample) {
        if let Some(simulated) = self.simulated {
            sample.set(self.channel, simulated);
        }
    }

    /// Computes the gains of the velocity along the three axes, for a beam that is read with the speed
    /// of sound `set` while the true one is `c`. They are not finite where a phased array has no such
    /// beam.
    ///
    /// The Doppler shift is `2 f b.v / c`, and the instrument converts it with `set`:
    /// `z = (set/c) b.v`. A phased array keeps the delay between its elements, hence `sin(slant)/c`.
    /// The two speeds therefore cancel across the axis, and along it `cos(slant)` changes with `c`.
    pub fn gains<T: Real>(&self, beam: &Vector3<f64>, c: T) -> Vector3<T> {
        if c <= T::zero() {
            return Vector3::repeat(convert(f64::NAN));
        }
        let ratio = convert::<f64, T>(self.set) / c;
        match self.array {
            Array::Piston => Vector3::repeat(ratio),
            Array::Phased => {
                let sin: T = convert(beam.x.hypot(beam.y));
                let cos = (T::one() - sin * sin / (ratio * ratio)).sqrt();
                Vector3::new(T::one(), T::one(), ratio * cos / convert(beam.z.abs()))
            }
        }
    }
}
