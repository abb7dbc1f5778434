//! What a wrong speed of sound makes of the velocity along a beam.

use navfuse_core::nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

/// How the transducer makes its beams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Array {
    /// One transducer a beam: the beams point where the transducers do.
    #[default]
    Piston,
    /// One flat face, normal to the down axis, that steers its beams by phase: the slant depends on the speed of sound.
    Phased,
}

/// The gain of the velocity across and along the down axis, in a beam that is read with the speed of sound `set` where it
/// is `c`. Not finite where a phased array has no such beam.
///
/// The Doppler shift is `2 f b.v / c`, and the instrument makes a velocity of it with `set`: `z = (set/c) b.v`. A phased
/// array keeps the delay between its elements, and with it `sin(slant)/c`, so that across the axis the two speeds cancel,
/// and along it `cos(slant)` changes with `c`.
pub(crate) fn gains(array: Array, beam: &Vector3<f64>, set: f64, c: f64) -> (f64, f64) {
    if c <= 0.0 {
        return (f64::NAN, f64::NAN);
    }
    let ratio = set / c;
    match array {
        Array::Piston => (ratio, ratio),
        Array::Phased => {
            let sin_squared = (beam.x * beam.x + beam.y * beam.y) / (ratio * ratio);
            (1.0, ratio * (1.0 - sin_squared).sqrt() / beam.z.abs())
        }
    }
}
