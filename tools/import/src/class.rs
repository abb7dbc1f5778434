//! The class of a receiver's fixes, and how good the fixes of a class can be.

/// The class of a fix, from the worst to the best.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FixClass {
    /// A position from the satellites alone.
    Single,
    /// Corrections of code ranges: SBAS, or a reference station.
    Differential,
    /// Carrier phases whose numbers of waves are real numbers.
    Float,
    /// Carrier phases whose numbers of waves are integers.
    Fixed,
}

/// Codes of a fix with their classes.
type Codes = &'static [(u32, FixClass)];

/// The codes of the quality in GGA of NMEA 0183, and of Q in solutions of RTKLIB.
pub const GGA: Codes = &[
    (1, FixClass::Single),
    (2, FixClass::Differential),
    (4, FixClass::Fixed),
    (5, FixClass::Float),
];
pub const RTKLIB: Codes = &[
    (1, FixClass::Fixed),
    (2, FixClass::Float),
    (3, FixClass::Differential),
    (4, FixClass::Differential),
    (5, FixClass::Single),
];
/// The codes of MAVLink, PX4 and ArduPilot.
const MAVLINK: Codes = &[
    (3, FixClass::Single),
    (4, FixClass::Differential),
    (5, FixClass::Float),
    (6, FixClass::Fixed),
];
/// The messages of logs of vehicles with the field of the code.
const MESSAGES: [(&str, &str, Codes); 10] = [
    ("sensor_gps", "fix_type", MAVLINK),
    ("vehicle_gps_position", "fix_type", MAVLINK),
    ("GPS_RAW_INT", "fix_type", MAVLINK),
    ("GPS2_RAW", "fix_type", MAVLINK),
    ("GPS", "Status", MAVLINK),
    (
        "PVTGeodetic",
        "Mode",
        &[
            (1, FixClass::Single),
            (2, FixClass::Differential),
            (4, FixClass::Fixed),
            (5, FixClass::Float),
            (6, FixClass::Differential),
        ],
    ),
    // the type of a solution of SBG: single, pseudoranges of a station, SBAS, OmniSTAR, float, integer
    (
        "GPS1_POS",
        "status",
        &[
            (2, FixClass::Single),
            (3, FixClass::Differential),
            (4, FixClass::Differential),
            (5, FixClass::Differential),
            (6, FixClass::Float),
            (7, FixClass::Fixed),
        ],
    ),
    (
        "VN-GPS",
        "fix_type",
        &[
            (3, FixClass::Single),
            (4, FixClass::Differential),
            (7, FixClass::Float),
            (8, FixClass::Fixed),
        ],
    ),
    (
        "MIP-GNSS",
        "type",
        &[
            (0, FixClass::Single),
            (5, FixClass::Float),
            (6, FixClass::Fixed),
            (7, FixClass::Differential),
        ],
    ),
    ("NAV-PVT", "carrier", &[(0, FixClass::Single), (1, FixClass::Float), (2, FixClass::Fixed)]),
];

/// The class of a code.
pub fn of(codes: Codes, code: f64) -> Option<FixClass> {
    codes.iter().find(|(known, _)| f64::from(*known) == code).map(|(_, class)| *class)
}

/// The field with the class of a message's fixes, and its codes.
pub fn of_message(message: &str) -> Option<(&'static str, Codes)> {
    let found = MESSAGES.iter().find(|(known, ..)| *known == message);
    found.map(|(_, field, codes)| (*field, *codes))
}

impl FixClass {
    /// Smallest 1-sigma of north or east, m, of the height, m, and of a velocity, m/s. Data sheets of
    /// receivers state the root mean square of the horizontal distance: NovAtel OEM7 1.2 m, 0.4 m with
    /// corrections of a station, 1 cm with integers; 2^-1/2 of it is the share of an axis. SBG states
    /// 20 cm for a float solution. Heights are half as good again; velocities 3 cm/s. An antenna that moves
    /// has twice the centimetre of integers, by its phase centre, its multipath and its clock.
    pub fn floor(self) -> [f64; 3] {
        let horizontal = match self {
            Self::Single => 0.8,
            Self::Differential => 0.3,
            Self::Float => 0.15,
            Self::Fixed => 0.02,
        };
        let vertical = if self == Self::Fixed { 0.04 } else { 1.5 * horizontal };
        [horizontal, vertical, 0.03]
    }

    /// The class in words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single point",
            Self::Differential => "differential or SBAS",
            Self::Float => "RTK float",
            Self::Fixed => "RTK fixed",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_have_their_classes_and_better_classes_lower_floors() {
        assert_eq!(of(GGA, 4.0), Some(FixClass::Fixed));
        assert_eq!(of(RTKLIB, 5.0), Some(FixClass::Single));
        assert_eq!(of(GGA, 0.0), None);
        let classes = [FixClass::Single, FixClass::Differential, FixClass::Float, FixClass::Fixed];
        assert!(classes.is_sorted());
        for pair in classes.windows(2) {
            let [worse, better] = [pair[0].floor(), pair[1].floor()];
            assert!(worse[0] > better[0] && worse[1] > better[1] && worse[2] >= better[2]);
        }
    }
}
