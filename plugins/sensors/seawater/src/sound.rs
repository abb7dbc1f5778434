//! Speed of sound in sea water.

use crate::pressure::pressure_at;
use schemars::JsonSchema;
use serde::Deserialize;

/// Equation for the speed of sound in sea water, from temperature, salinity and depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SoundEquation {
    /// Chen & Millero (1977) as in UNESCO 44: 0 to 40 deg C, salinity 0 to 40, 0 to 10 000 dbar.
    #[default]
    ChenMillero,
    /// Del Grosso (1974): 0 to 30 deg C, salinity 30 to 40, 0 to 9 800 dbar.
    DelGrosso,
    /// Mackenzie (1981): 2 to 30 deg C, salinity 25 to 40, 0 to 8000 m.
    Mackenzie,
}

/// Pascals of one bar, and of one kgf/cm^2.
const BAR: f64 = 1e5;
const TECHNICAL_ATMOSPHERE: f64 = 98_066.5;

/// `c[0] + c[1] x + c[2] x^2 + ...`
fn polynomial(c: &[f64], x: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

impl SoundEquation {
    /// Speed of sound (m/s) at a temperature (deg C), a practical salinity, a depth (m) and a latitude
    /// (rad).
    pub fn speed(self, temperature: f64, salinity: f64, depth: f64, latitude: f64) -> f64 {
        let pressure = pressure_at(depth, latitude);
        match self {
            Self::ChenMillero => chen_millero(temperature, salinity, pressure / BAR),
            Self::DelGrosso => del_grosso(temperature, salinity, pressure / TECHNICAL_ATMOSPHERE),
            Self::Mackenzie => mackenzie(temperature, salinity, depth),
        }
    }
}

/// Chen & Millero, *Speed of sound in seawater at high pressures*, JASA 62 (1977) 1129-1135; its
/// coefficients as in Fofonoff & Millard, UNESCO Technical Papers in Marine Science 44 (1983). The
/// pressure is in bar.
fn chen_millero(t: f64, s: f64, p: f64) -> f64 {
    let pure = [
        polynomial(&[1402.388, 5.037_11, -5.808_52e-2, 3.3420e-4, -1.478e-6, 3.1464e-9], t),
        polynomial(&[0.153_563, 6.8982e-4, -8.1788e-6, 1.3621e-7, -6.1185e-10], t),
        polynomial(&[3.1260e-5, -1.7107e-6, 2.5974e-8, -2.5335e-10, 1.0405e-12], t),
        polynomial(&[-9.7729e-9, 3.8504e-10, -2.3643e-12], t),
    ];
    let a = [
        polynomial(&[1.389, -1.262e-2, 7.164e-5, 2.006e-6, -3.21e-8], t),
        polynomial(&[9.4742e-5, -1.2580e-5, -6.4885e-8, 1.0507e-8, -2.0122e-10], t),
        polynomial(&[-3.9064e-7, 9.1041e-9, -1.6002e-10, 7.988e-12], t),
        polynomial(&[1.100e-10, 6.649e-12, -3.389e-13], t),
    ];
    let b = -1.922e-2 - 4.42e-5 * t + (7.3637e-5 + 1.7945e-7 * t) * p;
    let d = 1.727e-3 - 7.9836e-6 * p;
    polynomial(&pure, p) + (polynomial(&a, p) + b * s.max(0.0).sqrt() + d * s) * s
}

/// Del Grosso, *New equation for the speed of sound in natural waters*, JASA 56 (1974) 1084-1091, eq.
/// for NRL II. The pressure is in kgf/cm^2.
fn del_grosso(t: f64, s: f64, p: f64) -> f64 {
    let by_temperature =
        polynomial(&[1402.392, 5.011_093_988_73, -0.055_094_684_317_2, 2.215_359_692_40e-4], t);
    let by_salinity = polynomial(&[0.0, 1.329_522_907_81, 1.289_557_568_44e-4], s);
    let by_pressure =
        polynomial(&[0.0, 0.156_059_257_041, 2.449_986_884_41e-5, -8.833_923_325_13e-9], p);
    let mixed = -1.275_627_834_26e-2 * t * s
        + 6.351_916_133_89e-3 * t * p
        + 2.654_847_166_08e-8 * t * t * p * p
        - 1.593_494_790_45e-6 * t * p * p
        + 5.221_164_372_35e-10 * t * p * p * p
        - 4.380_310_962_13e-7 * t * t * t * p
        - 1.616_744_959_09e-9 * s * s * p * p
        + 9.684_031_564_10e-5 * t * t * s
        + 4.856_396_200_15e-6 * t * s * s * p
        - 3.405_970_390_04e-4 * t * s * p;
    by_temperature + by_salinity + by_pressure + mixed
}

/// Mackenzie, *Nine-term equation for sound speed in the oceans*, JASA 70 (1981) 807-812.
fn mackenzie(t: f64, s: f64, depth: f64) -> f64 {
    polynomial(&[1448.96, 4.591, -5.304e-2, 2.374e-4], t)
        + 1.340 * (s - 35.0)
        + polynomial(&[0.0, 1.630e-2, 1.675e-7], depth)
        - 1.025e-2 * t * (s - 35.0)
        - 7.139e-13 * t * depth.powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of UNESCO 44: 40 deg C, salinity 40, 10 000 dbar.
    #[test]
    fn chen_and_millero_give_the_check_value_of_unesco() {
        let found = chen_millero(40.0, 40.0, 1000.0);
        assert!((found - 1731.995).abs() < 5e-4, "{found}");
    }

    /// The check value of the paper: 25 deg C, salinity 35, 1000 m.
    #[test]
    fn mackenzie_gives_the_check_value_of_the_paper() {
        let found = mackenzie(25.0, 35.0, 1000.0);
        assert!((found - 1550.744).abs() < 5e-4, "{found}");
    }

    /// Mackenzie fitted the data of Del Grosso with a standard error of 0.07 m/s; three of them.
    #[test]
    fn del_grosso_is_what_mackenzie_fitted() {
        for (t, s, depth) in [(2.0, 35.0, 0.0), (25.0, 35.0, 1000.0), (10.0, 34.0, 500.0)] {
            let latitude = 45_f64.to_radians();
            let found = SoundEquation::DelGrosso.speed(t, s, depth, latitude);
            assert!((found - mackenzie(t, s, depth)).abs() < 0.21, "{found}");
        }
    }
}
