//! Effect of a wrong speed of sound on the velocity along a beam.

use navfuse_core::nalgebra::Vector3;
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

/// Computes the gains of the velocity across and along the down axis, for a beam that is read with
/// the speed of sound `set` while the true one is `c`. They are not finite where a phased array has
/// no such beam.
///
/// The Doppler shift is `2 f b.v / c`, and the instrument converts it with `set`:
/// `z = (set/c) b.v`. A phased array keeps the delay between its elements, hence `sin(slant)/c`.
/// The two speeds therefore cancel across the axis, and along it `cos(slant)` changes with `c`.
pub(super) fn gains(array: Array, beam: &Vector3<f64>, set: f64, c: f64) -> (f64, f64) {
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
