//! Positions on a map: easting and northing of UTM, or from a point.
//!
//! UTM: Karney, *Transverse Mercator with an accuracy of a few nanometers*, J. Geodesy 85 (2011), equations 11, 15
//! and 36, to the third order of the third flattening: within a millimetre in a zone.

use crate::config::Point;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::state::geodesy::{EQUATORIAL_RADIUS, FLATTENING, Geodetic};

/// Scale on the central meridian, easting of it, and northing of the equator in the south, m.
const SCALE: f64 = 0.9996;
const EASTING: f64 = 500_000.0;
const SOUTH: f64 = 10_000_000.0;

/// A map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Map {
    Utm(Zone),
    /// With the column of the height above the plane, and 1, or -1 for the depth below it.
    Local(Local, Option<(usize, f64)>),
}

/// The plane through a point along its east, north and up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local {
    point: Vector3<f64>,
    /// East, north and up along Earth-fixed axes, by column.
    axes: Matrix3<f64>,
}

impl Local {
    /// The plane through a point.
    pub fn new(origin: &Point) -> Self {
        let [latitude, longitude] = [origin.latitude.si(), origin.longitude.si()];
        let ((sin, cos), (s, c)) = (latitude.sin_cos(), longitude.sin_cos());
        let axes = Matrix3::new(-s, -sin * c, cos * c, c, -sin * s, cos * s, 0.0, cos, sin);
        let point = Geodetic { latitude, longitude, height: origin.height.si() }.earth_fixed();
        Self { point, axes }
    }

    /// Latitude and longitude, rad, and height, m, of east, north and up, m.
    pub fn position(&self, enu: [f64; 3]) -> [f64; 3] {
        let place = Geodetic::from_earth_fixed(&(self.point + self.axes * Vector3::from(enu)));
        [place.latitude, place.longitude, place.height]
    }
}

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
    use super::{Local, Zone};
    use crate::config::Point;
    use navfuse_core::units::{Angle, Length};

    /// By pymap3d 3.2.0: `enu2geodetic(e, n, u, lat, lon, h)`.
    #[test]
    fn metres_from_a_point_are_latitude_longitude_and_height() {
        for (origin, enu, place) in [
            (
                [48.1, 11.5, 500.0],
                [1234.5, -987.6, 12.3],
                [48.0911176001, 11.5165705088, 512.4957806921],
            ),
            (
                [-33.9, 18.4, -20.0],
                [-40000.0, 25000.0, -150.0],
                [-33.6738518437, 17.9686659729, 4.4739071938],
            ),
            (
                [0.0, -179.999, 0.0],
                [-500.0, 300.0, 7.0],
                [0.0027131054, 179.9965084285, 7.0267010708],
            ),
        ] {
            let [latitude, longitude] =
                [origin[0], origin[1]].map(|a: f64| Angle::from_si(a.to_radians()));
            let origin = Point { latitude, longitude, height: Length::from_si(origin[2]) };
            let found = Local::new(&origin).position(enu);
            // ten digits of a degree are 1e-5 m
            for (k, scale) in [6.4e6, 6.4e6, 1.0].into_iter().enumerate() {
                let known = if k < 2 { f64::to_radians(place[k]) } else { place[k] };
                assert!((found[k] - known).abs() * scale < 2e-5, "{found:?} {place:?}");
            }
        }
    }

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
