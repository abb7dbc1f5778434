//! The field of the Earth at a place and a date, by the World Magnetic Model.

mod coefficients;
mod synthesis;

use navfuse_core::calendar::{Calendar, DAY};
use navfuse_core::prelude::*;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::Date;
use synthesis::{VALID, field};

/// Place and date at which the World Magnetic Model 2025 gives the field of the Earth.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MagneticModel {
    /// Latitude.
    pub latitude: Angle,
    /// Longitude.
    pub longitude: Angle,
    /// Height above the ellipsoid. Default: zero.
    pub height: Option<Length>,
    /// Date, such as `"2026-06-01"`. The model is valid from 2025 to the end of 2029.
    pub date: Date,
}

/// Field of the Earth at a place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Earth {
    /// Horizontal and downward intensity, T.
    pub horizontal: f64,
    pub down: f64,
    /// Direction of magnetic north from true north, rad, east positive.
    declination: f64,
    /// 1-sigma of the declination of a model, rad.
    uncertainty: Option<f64>,
}

impl MagneticModel {
    /// Computes the field, and adds a note of it. `key` is the key of the declination.
    ///
    /// # Errors
    /// When the date is outside the validity of the model, and `declination` has no sigma.
    pub(crate) fn earth(
        &self,
        composer: &mut Composer,
        key: &str,
        declination: &Calibration<Angle, AngularRateNoise>,
    ) -> Result<Earth, ComposeError> {
        let year = year(self.date);
        let outside = !(VALID[0]..VALID[1]).contains(&year);
        if outside && declination.sigma.is_none() {
            let text = format!(
                "the World Magnetic Model 2025 is valid from {} to {}, and the date is {year:.2}: give \
                 the sigma with which you know the declination then",
                VALID[0], VALID[1]
            );
            return Err(ComposeError::new(key, text));
        }
        let height = self.height.map_or(0.0, Length::si);
        let (latitude, longitude) = (self.latitude.si(), self.longitude.si());
        let field = field(&Geodetic { latitude, longitude, height }, year);
        let horizontal = field.x.hypot(field.y);
        let earth = Earth {
            horizontal,
            down: field.z,
            declination: field.y.atan2(field.x),
            uncertainty: Some(uncertainty(horizontal)),
        };
        composer.note(format!(
            "the World Magnetic Model 2025 gives {:.2} uT, inclination {:.2} deg, declination {:.2} deg \
             (1-sigma {:.2} deg){}",
            field.norm() * 1e6,
            field.z.atan2(horizontal).to_degrees(),
            earth.declination.to_degrees(),
            uncertainty(horizontal).to_degrees(),
            if outside { ", extrapolated: the date is outside its validity" } else { "" }
        ));
        Ok(earth)
    }
}

/// 1-sigma of the declination, rad, for a horizontal intensity in T: 0.26 deg, and 5417 deg nT over
/// the intensity (technical report of 2025, section 3.4).
fn uncertainty(horizontal: f64) -> f64 {
    0.26_f64.hypot(5417e-9 / horizontal).to_radians()
}

/// A date in years: the middle of 2025 is 2025.5.
fn year(date: Date) -> f64 {
    let Calendar { year, .. } = Calendar::of_unix_nanos(date.nanos);
    let begins = |year| {
        let first = Calendar { year, month: 1, day: 1, hour: 0, minute: 0, second: 0, nanos: 0 };
        first.unix_nanos().unwrap_or(date.nanos)
    };
    let length = (begins(year + 1) - begins(year)).max(DAY);
    f64::from(year) + (date.nanos - begins(year)) as f64 / length as f64
}

impl Earth {
    /// A field of which the intensity and the inclination are given.
    pub(crate) fn given(strength: f64, inclination: f64) -> Self {
        let (sin, cos) = inclination.sin_cos();
        Self { horizontal: strength * cos, down: strength * sin, ..Self::default() }
    }

    /// Adds the state of the declination. One of the model has the uncertainty of the model, which the
    /// filter considers, unless the scenario states a sigma or a mode.
    pub(crate) fn declination(
        &self,
        mut stated: Calibration<Angle, AngularRateNoise>,
        composer: &mut Composer,
        display: Display,
    ) -> Result<Handle<Scalar>, ComposeError> {
        if let (Some(sigma), None, None) = (self.uncertainty, stated.sigma, stated.mode) {
            stated.sigma = Some(Sigma::from_si(sigma));
            stated.mode = Some(Mode::Consider);
        }
        stated.block(composer, "declination", &[self.declination], display)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    fn nanotesla(latitude: f64, longitude: f64, km: f64, year: f64) -> [f64; 3] {
        let (latitude, longitude) = (latitude.to_radians(), longitude.to_radians());
        let at = Geodetic { latitude, longitude, height: 1e3 * km };
        (field(&at, year) * 1e9).into()
    }

    /// Values of pygeomag, which reads `WMM.COF` and computes the sum in another way, to 0.1 nT; and
    /// the example of MathWorks for `wrldmagm` of 2028-07-04, to 1 nT.
    #[test]
    fn the_model_agrees_with_two_other_programs() {
        for (place, year, expected, rounding) in [
            ([80.0, 0.0, 0.0], 2025.0, [6521.6, 145.9, 54791.5], 0.06),
            ([0.0, 120.0, 0.0], 2025.0, [39677.8, -109.6, -10580.2], 0.06),
            ([-80.0, 240.0, 0.0], 2025.0, [6117.5, 15751.9, -52022.5], 0.06),
            ([80.0, 0.0, 100.0], 2027.5, [6196.7, 233.8, 52670.5], 0.06),
            ([42.283, -71.35, 1.0], 2028.5055, [20139.0, -4905.0, 46532.0], 0.7),
        ] {
            let found = nanotesla(place[0], place[1], place[2], year);
            let worst = (0..3).map(|k| f64::abs(found[k] - expected[k])).fold(0.0, f64::max);
            assert!(worst < rounding, "{place:?}: {found:?}");
        }
    }

    /// Dip poles of 2025 as they are published with the model, to 0.001 deg, where the horizontal field changes
    /// by less than 1 nT.
    #[test]
    fn the_field_is_vertical_at_the_dip_poles() {
        for (latitude, longitude) in [(85.762, 139.298), (-63.851, 135.078)] {
            let [north, east, _] = nanotesla(latitude, longitude, 0.0, 2025.0);
            assert!(north.hypot(east) < 1.0, "{north} {east}");
        }
    }

    /// The limit of the field along any meridian: the recursion has no division by the cosine.
    #[test]
    fn the_field_at_a_geographic_pole_is_that_beside_it() {
        for longitude in [0.0, 70.0, 250.0] {
            let at = nanotesla(90.0, longitude, 0.0, 2026.0);
            let beside = nanotesla(90.0 - 1e-6, longitude, 0.0, 2026.0);
            assert!((0..3).all(|k| f64::abs(at[k] - beside[k]) < 0.01), "{at:?} {beside:?}");
        }
    }

    #[test]
    fn a_date_is_a_part_of_its_year() {
        for (text, expected) in
            [("2025-01-01", 2025.0), ("2028-07-02", 2028.5), ("2029-12-31", 2030.0 - 1.0 / 365.0)]
        {
            assert!((year(text.parse().unwrap()) - expected).abs() < 1e-9, "{text}");
        }
    }
}
