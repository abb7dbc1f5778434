//! Positions on a map: easting and northing of UTM.
//!
//! Karney, *Transverse Mercator with an accuracy of a few nanometers*, J. Geodesy 85 (2011), equations 11, 15
//! and 36, to the third order of the third flattening: within a millimetre in a zone.

use navfuse_core::state::geodesy::{EQUATORIAL_RADIUS, FLATTENING};

/// Scale on the central meridian, easting of it, and northing of the equator in the south, m.
const SCALE: f64 = 0.9996;
const EASTING: f64 = 500_000.0;
const SOUTH: f64 = 10_000_000.0;

/// A zone of UTM.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zone {
    /// Longitude of the central meridian, rad.
    meridian: f64,
    south: bool,
}

impl Zone {
    /// A zone such as `32N`, `33 S` or `32U`: after its number the hemisphere, or the band of
    /// latitude. An `S` is the south.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let end = text.find(|c: char| !c.is_ascii_digit())?;
        let number = text[..end].parse::<u8>().ok().filter(|n| (1..=60).contains(n))?;
        let mut letters = text[end..].trim().chars();
        let letter = letters.next()?.to_ascii_uppercase();
        let south = letter == 'S' || ('C'..='M').contains(&letter);
        let known = south || ('N'..='X').contains(&letter);
        let whole = letters.next().is_none();
        let meridian = (6.0 * f64::from(number) - 183.0).to_radians();
        (known && whole).then_some(Self { meridian, south })
    }

    /// Latitude and longitude, rad, of easting and northing, m.
    pub fn position(&self, [easting, northing]: [f64; 2]) -> [f64; 2] {
        let n = FLATTENING / (2.0 - FLATTENING);
        let radius = EQUATORIAL_RADIUS / (1.0 + n) * (1.0 + n.powi(2) / 4.0 + n.powi(4) / 64.0);
        let beta = [
            n / 2.0 - 2.0 / 3.0 * n.powi(2) + 37.0 / 96.0 * n.powi(3),
            n.powi(2) / 48.0 + n.powi(3) / 15.0,
            17.0 / 480.0 * n.powi(3),
        ];
        let delta = [
            2.0 * n - 2.0 / 3.0 * n.powi(2) - 2.0 * n.powi(3),
            7.0 / 3.0 * n.powi(2) - 8.0 / 5.0 * n.powi(3),
            56.0 / 15.0 * n.powi(3),
        ];
        let north = if self.south { northing - SOUTH } else { northing };
        let (xi, eta) = (north / (SCALE * radius), (easting - EASTING) / (SCALE * radius));
        let (mut a, mut b) = (xi, eta);
        for (j, beta) in (1..).map(|j| 2.0 * f64::from(j)).zip(beta) {
            a -= beta * (j * xi).sin() * (j * eta).cosh();
            b -= beta * (j * xi).cos() * (j * eta).sinh();
        }
        let chi = (a.sin() / b.cosh()).asin();
        let terms = (1..).map(|j| 2.0 * f64::from(j)).zip(delta);
        let latitude = chi + terms.map(|(j, delta)| delta * (j * chi).sin()).sum::<f64>();
        [latitude, self.meridian + b.sinh().atan2(a.cos())]
    }
}

#[cfg(test)]
mod tests {
    use super::Zone;

    #[test]
    fn eastings_and_northings_of_proj_are_their_latitudes_and_longitudes() {
        // by pyproj 3.7.2: from EPSG:4326 to EPSG:326xx and 327xx
        for (zone, map, place) in [
            ("32N", [686121.7558, 5330438.1302], [48.100, 11.5]),
            ("33 S", [814420.3310, 6243724.8401], [-33.900, 18.4]),
            ("31T", [679321.5223, 4763163.3308], [43.000, 5.2]),
            ("1C", [456668.6195, 1675845.2729], [-75.000, -178.5]),
            ("60X", [548929.2851, 8871475.4281], [79.900, 179.5]),
            ("18n", [822836.1940, 110.6727], [0.001, -72.1]),
        ] {
            let zone = Zone::parse(zone).map(|zone| zone.position(map)).unwrap_or_default();
            for (found, known) in zone.iter().zip(place) {
                assert!((found.to_degrees() - known).abs() < 1e-8, "{zone:?}: {place:?}");
            }
        }
        for wrong in ["", "N", "32", "0N", "61N", "32O2", "32 NN", "a"] {
            assert_eq!(Zone::parse(wrong), None, "{wrong}");
        }
    }
}
