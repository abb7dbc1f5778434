//! Where the beams point.

use navfuse_core::model::error::ComposeError;
use navfuse_core::nalgebra::Vector3;
use navfuse_core::units::Angle;
use std::f64::consts::FRAC_PI_2;

/// The largest number of beams: a Janus of four, and a vertical one.
pub(crate) const MAX_BEAMS: usize = 5;

/// An instrument with four beams in an X, 30 deg from the vertical.
const SLANT: f64 = 30.0;
const AZIMUTH: [f64; 4] = [45.0, 135.0, 225.0, 315.0];

/// Number of beams that the parameters say, before they are checked.
pub(crate) fn count(azimuth: Option<&[Angle]>, beams: Option<&[[f64; 3]]>) -> usize {
    beams.map(<[_]>::len).or(azimuth.map(<[_]>::len)).unwrap_or(AZIMUTH.len())
}

/// The unit vectors of the beams in the axes of the instrument, from one slant and azimuths, or given one by one.
pub(crate) fn directions(
    slant: Option<Angle>,
    azimuth: Option<&[Angle]>,
    beams: Option<&[[f64; 3]]>,
) -> Result<Vec<Vector3<f64>>, ComposeError> {
    let place = if beams.is_some() { "beams" } else { "azimuth" };
    let found = count(azimuth, beams);
    if !(1..=MAX_BEAMS).contains(&found) {
        return Err(ComposeError::new(
            place,
            format!("found {found} beams, 1 to {MAX_BEAMS} are possible"),
        ));
    }
    if let Some(beams) = beams {
        if let Some((key, _)) =
            [("slant", slant.is_some()), ("azimuth", azimuth.is_some())].iter().find(|k| k.1)
        {
            return Err(ComposeError::new(
                *key,
                "`beams` says already where the beams point; remove one of the two",
            ));
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
    let beam = |a: &Angle| Vector3::new(sin * a.si().cos(), sin * a.si().sin(), cos);
    Ok(azimuth.unwrap_or(&default).iter().map(beam).collect())
}

fn direction(axes: &[f64; 3]) -> Result<Vector3<f64>, ComposeError> {
    let v = Vector3::from(*axes);
    // scaled first, so that no square overflows or vanishes
    let unit = (v / v.amax()).normalize();
    if unit.iter().all(|x| x.is_finite()) {
        Ok(unit)
    } else {
        let message =
            format!("{axes:?} is no direction; give [forward, right, down], not all of them zero");
        Err(ComposeError::new("beams", message))
    }
}
