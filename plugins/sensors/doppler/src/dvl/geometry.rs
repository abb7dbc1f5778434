//! Directions of the beams of a DVL.

use crate::beam::unit_vector;
use navfuse_core::model::error::ComposeError;
use navfuse_core::nalgebra::Vector3;
use navfuse_core::units::Angle;
use std::f64::consts::FRAC_PI_2;

/// Largest plausible speed of a vehicle with a DVL, m/s.
pub(super) const FASTEST: f64 = 30.0;

/// The largest number of beams: a Janus of four, and a vertical one.
pub(super) const MAX_BEAMS: usize = 5;

/// Default slant from the vertical, deg.
const SLANT: f64 = 30.0;
/// Default azimuths of four beams in an X, deg.
const AZIMUTH: [f64; 4] = [45.0, 135.0, 225.0, 315.0];

/// Number of beams that the parameters give, before they are checked.
pub(super) fn count(azimuth: Option<&[Angle]>, beams: Option<&[[f64; 3]]>) -> usize {
    beams.map(<[_]>::len).or(azimuth.map(<[_]>::len)).unwrap_or(AZIMUTH.len())
}

/// Computes the unit vectors of the beams in the axes of the instrument, from one slant and
/// azimuths, or from a direction for each beam.
pub(super) fn directions(
    slant: Option<Angle>,
    azimuth: Option<&[Angle]>,
    beams: Option<&[[f64; 3]]>,
) -> Result<Vec<Vector3<f64>>, ComposeError> {
    let place = if beams.is_some() { "beams" } else { "azimuth" };
    let found = count(azimuth, beams);
    if !(1..=MAX_BEAMS).contains(&found) {
        let message = format!("found {found} beams, 1 to {MAX_BEAMS} are possible");
        return Err(ComposeError::new(place, message));
    }
    if let Some(beams) = beams {
        let given = [("slant", slant.is_some()), ("azimuth", azimuth.is_some())];
        if let Some((key, _)) = given.iter().find(|k| k.1) {
            let message = "`beams` already gives the directions; remove one of the two";
            return Err(ComposeError::new(*key, message));
        }
        return beams.iter().map(direction).collect();
    }
    let angle = slant.map_or(SLANT.to_radians(), Angle::si);
    if !(0.0..FRAC_PI_2).contains(&angle) {
        let message = "the angle between beams and vertical must be at least 0 and below 90 deg";
        return Err(ComposeError::new("slant", message));
    }
    let default = AZIMUTH.map(|a| Angle::from_si(a.to_radians()));
    let (sin, cos) = angle.sin_cos();
    // b = [sin s cos a, sin s sin a, cos s]: the azimuth turns from forward towards right
    let beam = |a: &Angle| Vector3::new(sin * a.si().cos(), sin * a.si().sin(), cos);
    Ok(azimuth.unwrap_or(&default).iter().map(beam).collect())
}

fn direction(axes: &[f64; 3]) -> Result<Vector3<f64>, ComposeError> {
    unit_vector(*axes).ok_or_else(|| {
        let message =
            format!("{axes:?} is no direction; give [forward, right, down], not all of them zero");
        ComposeError::new("beams", message)
    })
}
