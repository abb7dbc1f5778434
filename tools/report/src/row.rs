//! Estimates of a block at one time.

use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::thin::Merge;

/// Estimate of a block at one epoch, in display units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Time, s.
    pub time: f64,
    /// Estimate of each component.
    pub estimate: Vec<f64>,
    /// 1-sigma of each component.
    pub sigma: Vec<f64>,
    /// Estimate minus truth; empty if the truth is not known.
    pub error: Vec<f64>,
}

impl Merge for Row {
    /// Keeps the first row with an error, so that a slow reference remains visible.
    fn merge(&mut self, next: Self) {
        if self.error.is_empty() && !next.error.is_empty() {
            *self = next;
        }
    }
}

/// Returns the displacement between two positions in north, east and down, m; positions are
/// latitude and longitude in deg and height in m.
pub(crate) fn displacement(to: &[f64], from: &[f64]) -> [f64; 3] {
    let place = |p: &[f64]| match *p {
        [latitude, longitude, height] => Some(Geodetic {
            latitude: latitude.to_radians(),
            longitude: longitude.to_radians(),
            height,
        }),
        _ => None,
    };
    place(to).zip(place(from)).map_or([f64::NAN; 3], |(to, from)| to.ned_from(&from).into())
}
