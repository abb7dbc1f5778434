//! The content of a sentence, in SI.

use crate::beacon::Beacon;
use crate::vessel::Axes;
use navfuse_core::units::calendar::{Calendar, decimal_seconds, time_of_day, with_century};
use navfuse_frames::validity::is_place;
use std::f64::consts::{FRAC_PI_2, PI};

/// Metres per second of a knot.
const KNOT: f64 = 1852.0 / 3600.0;
/// Metres per second of a kilometre per hour.
const KMH: f64 = 1.0 / 3.6;
/// Largest horizontal distance of a transponder from its vessel, m.
const FARTHEST: f64 = 1e5;

/// A sentence that the source uses. An angle is in radians, a time in nanoseconds since midnight, a
/// date in nanoseconds since 1970. An empty field is `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sentence {
    /// GGA and GGK of Trimble: position and quality.
    Fix {
        /// Time of the day.
        time: Option<i64>,
        /// Midnight of the date; GGA has none.
        date: Option<i64>,
        /// Latitude and longitude.
        position: Option<[f64; 2]>,
        /// Height above the ellipsoid, the sum of altitude and separation, m; without a separation
        /// the altitude.
        height: Option<f64>,
        /// Quality: 0 invalid, 1 to 5 from satellites, 6 estimated, 7 manual, 8 simulated.
        quality: u8,
    },
    /// RMC: position, velocity and date.
    Minimum {
        /// Time of the day.
        time: Option<i64>,
        /// Midnight of the date.
        date: Option<i64>,
        /// Latitude and longitude.
        position: Option<[f64; 2]>,
        /// Speed over ground, m/s, and course.
        velocity: Option<[f64; 2]>,
        /// False for the status V, a warning of the receiver.
        valid: bool,
        /// Set for the modes estimated, manual and simulated.
        estimated: bool,
    },
    /// VTG.
    Velocity {
        /// Speed over ground, m/s, and course.
        velocity: Option<[f64; 2]>,
        /// As for RMC.
        estimated: bool,
    },
    /// GST: time of the day, and 1-sigma of the position north, east, down, m.
    Accuracy {
        /// Time of the day.
        time: Option<i64>,
        /// 1-sigma of latitude, longitude and altitude, m.
        sigma: Option<[f64; 3]>,
    },
    /// ZDA: time of the day and midnight of the date.
    Date {
        /// Time of the day.
        time: Option<i64>,
        /// Midnight of the date.
        date: Option<i64>,
    },
    /// HDT and THS: true heading.
    Heading(f64),
    /// HDG and HDM: magnetic heading.
    Magnetic {
        /// Heading from magnetic north; for HDG the sum of reading and deviation.
        heading: f64,
        /// Variation: the direction of magnetic north from true north, east positive.
        variation: Option<f64>,
    },
    /// PTSAG, PSONLLD, and PSIMSSB with latitude and longitude: position of an acoustic transponder.
    Transponder {
        /// Time of the day.
        time: Option<i64>,
        /// Midnight of the date; PSONLLD has none.
        date: Option<i64>,
        /// The transponder.
        beacon: Beacon,
        /// Latitude and longitude.
        position: [f64; 2],
        /// Depth, m.
        depth: Option<f64>,
        /// Expected 1-sigma, m, of PSIMSSB.
        sigma: Option<f64>,
    },
    /// PSIMSSB with Cartesian coordinates: position of an acoustic transponder from the vessel.
    Relative {
        /// Time of the day.
        time: Option<i64>,
        /// The transponder.
        beacon: Beacon,
        /// The axes of the offset.
        axes: Axes,
        /// Offset from the vessel, m.
        offset: [f64; 2],
        /// Depth, m.
        depth: Option<f64>,
        /// Expected 1-sigma, m.
        sigma: Option<f64>,
    },
    /// PSXN 20: quality of position, height, heading, and roll and pitch. Each is true unless the
    /// sentence declares it invalid.
    Quality([bool; 4]),
    /// DPT and PRVAT: depth, m; for DPT the sum of depth and offset.
    Depth(f64),
    /// PASHR and PSXN 23: roll, pitch and heading.
    Attitude {
        /// Time of the day; PSXN has none.
        time: Option<i64>,
        /// Roll, pitch and heading.
        angles: [f64; 3],
    },
}

impl Sentence {
    /// The time of the day, if the sentence has one.
    pub fn time(&self) -> Option<i64> {
        match *self {
            Self::Fix { time, .. }
            | Self::Minimum { time, .. }
            | Self::Accuracy { time, .. }
            | Self::Date { time, .. }
            | Self::Transponder { time, .. }
            | Self::Relative { time, .. }
            | Self::Attitude { time, .. } => time,
            Self::Velocity { .. }
            | Self::Heading(_)
            | Self::Magnetic { .. }
            | Self::Quality(_)
            | Self::Depth(_) => None,
        }
    }

    /// Midnight of the date, if the sentence has one.
    pub fn date(&self) -> Option<i64> {
        match *self {
            Self::Fix { date, .. }
            | Self::Minimum { date, .. }
            | Self::Date { date, .. }
            | Self::Transponder { date, .. } => date,
            _ => None,
        }
    }
}

/// The talker of a sentence, `GP` in `GPGGA`; none for a proprietary one.
pub fn talker(content: &[u8]) -> Option<&[u8]> {
    let address = content.split(|b| *b == b',').next()?;
    (address.len() == 5 && address[0] != b'P').then(|| &address[..2])
}

/// The fields of a sentence after its address.
struct Fields<'a>(Vec<&'a str>);

impl Fields<'_> {
    fn text(&self, k: usize) -> &str {
        self.0.get(k).copied().unwrap_or("")
    }

    /// A number; `None` for an empty field or text.
    fn number(&self, k: usize) -> Option<f64> {
        let text = self.text(k);
        let plain = text.bytes().all(|b| b.is_ascii_digit() || b"+-.".contains(&b));
        text.parse().ok().filter(|n: &f64| plain && n.is_finite())
    }

    fn whole(&self, k: usize) -> Option<u8> {
        self.text(k).parse().ok()
    }

    /// `hhmmss.ss` as nanoseconds since midnight.
    fn time(&self, k: usize) -> Option<i64> {
        let text = self.text(k).as_bytes();
        let (hour, minute) = (two(text.get(..2)?)?, two(text.get(2..4)?)?);
        let (second, nanos) = decimal_seconds(text.get(4..)?)?;
        time_of_day(hour, minute, second, nanos)
    }

    /// `ddmm.mmmm,N` with this many digits of degrees.
    fn angle(&self, k: usize, digits: usize, signs: [&str; 2], most: f64) -> Option<f64> {
        let text = self.text(k);
        let degrees: u16 = text.get(..digits)?.parse().ok()?;
        let minutes: f64 = text
            .get(digits..)
            .filter(|t| t.starts_with(|c: char| c.is_ascii_digit()))?
            .parse()
            .ok()?;
        let angle = f64::from(degrees) + minutes / 60.0;
        let sign = match signs.iter().position(|s| *s == self.text(k + 1))? {
            0 => 1.0,
            _ => -1.0,
        };
        (minutes < 60.0 && angle <= most).then(|| (sign * angle).to_radians())
    }

    fn position(&self, k: usize) -> Option<[f64; 2]> {
        let lat = self.angle(k, 2, ["N", "S"], 90.0)?;
        let lon = self.angle(k + 2, 3, ["E", "W"], 180.0)?;
        is_place(lat, lon).then_some([lat, lon])
    }

    /// An angle in degrees with its direction, `7.5,W`, east positive; zero needs no direction.
    /// `None` for a direction that is neither, and `Some(None)` for an empty field.
    fn eastward(&self, k: usize) -> Option<Option<f64>> {
        if self.text(k).is_empty() {
            return Some(None);
        }
        let degrees = self.number(k)?;
        let sign = match self.text(k + 1) {
            "E" => 1.0,
            "W" => -1.0,
            "" if degrees == 0.0 => 0.0,
            _ => return None,
        };
        Some(Some((sign * degrees).to_radians()))
    }

    /// Decimal degrees.
    fn degrees(&self, k: usize, most: f64) -> Option<f64> {
        self.number(k).filter(|d| d.abs() <= most).map(f64::to_radians)
    }

    /// Speed and course; a vehicle at rest needs no course.
    fn velocity(&self, speed: Option<f64>, course: usize) -> Option<[f64; 2]> {
        let speed = speed.filter(|s| *s >= 0.0)?;
        match self.number(course) {
            Some(course) => Some([speed, course.to_radians()]),
            None => (speed == 0.0).then_some([0.0, 0.0]),
        }
    }
}

fn two(digits: &[u8]) -> Option<u8> {
    let [a, b] = digits else { return None };
    (a.is_ascii_digit() && b.is_ascii_digit()).then(|| 10 * (a - b'0') + (b - b'0'))
}

fn midnight(day: Option<u8>, month: Option<u8>, year: Option<i32>) -> Option<i64> {
    let (year, month, day) = (year?, month?, day?);
    Calendar { year, month, day, hour: 0, minute: 0, second: 0, nanos: 0 }.unix_nanos()
}

/// Parses the part of a sentence between `$` and `*`; `None` for a sentence that the source does
/// not use, and for one of a form that the standard does not have.
pub fn parse(content: &[u8]) -> Option<Sentence> {
    let text = std::str::from_utf8(content).ok()?;
    let (address, fields) = text.split_once(',')?;
    let f = Fields(fields.split(',').collect());
    match address {
        "PASHR" if f.text(2) == "T" => {
            return attitude(f.time(0), [f.number(3)?, f.number(4)?, f.number(1)?]);
        }
        "PSXN" if f.text(0) == "23" => {
            return attitude(None, [f.number(1)?, f.number(2)?, f.number(3)?]);
        }
        "PSXN" if f.text(0) == "20" => {
            // 0 normal, 1 reduced performance, 2 invalid
            let usable = |k: usize| Some(f.whole(k)? < 2);
            return Some(Sentence::Quality([usable(1)?, usable(2)?, usable(3)?, usable(4)?]));
        }
        "PTNL" if f.text(0) == "GGK" => return trimble(&f),
        "PTSAG" => return absolute(&f),
        "PSONLLD" if f.text(2) == "A" => {
            return Some(Sentence::Transponder {
                time: f.time(0),
                date: None,
                beacon: Beacon::new(f.text(1))?,
                position: [f.degrees(3, 90.0)?, f.degrees(4, 180.0)?],
                depth: f.number(5),
                sigma: None,
            });
        }
        "PSIMSSB" => return kongsberg(&f),
        "PRVAT" => return Some(Sentence::Depth(f.number(0)?)),
        _ => {}
    }
    if address.len() != 5 || address.starts_with('P') {
        return None;
    }
    Some(match address.get(2..)? {
        "GGA" => Sentence::Fix {
            time: f.time(0),
            date: None,
            position: f.position(1),
            height: f.number(8).map(|altitude| altitude + f.number(10).unwrap_or(0.0)),
            quality: f.whole(5)?,
        },
        "RMC" => {
            let date = f.text(8).as_bytes();
            let pair = |k: usize| date.get(k..k + 2).and_then(two);
            Sentence::Minimum {
                time: f.time(0),
                date: midnight(pair(0), pair(2), pair(4).map(with_century)),
                position: f.position(2),
                velocity: f.velocity(f.number(6).map(|knots| knots * KNOT), 7),
                // mode N: no fix
                valid: f.text(1) == "A" && f.text(11) != "N",
                estimated: estimated(f.text(11)),
            }
        }
        "VTG" => {
            let knots = f.number(4).map(|v| v * KNOT);
            let speed = knots.or_else(|| f.number(6).map(|v| v * KMH));
            let velocity = f.velocity(speed, 0).filter(|_| f.text(8) != "N");
            Sentence::Velocity { velocity, estimated: estimated(f.text(8)) }
        }
        "GST" => {
            let sigma = || Some([f.number(5)?, f.number(6)?, f.number(7)?]);
            Sentence::Accuracy { time: f.time(0), sigma: sigma() }
        }
        "ZDA" => Sentence::Date {
            time: f.time(0),
            date: midnight(f.whole(1), f.whole(2), f.text(3).parse().ok()),
        },
        "HDT" => Sentence::Heading(f.number(0)?.to_radians()),
        // modes of THS: A autonomous, E estimated, M manual, S simulator, V invalid
        "THS" if matches!(f.text(1), "A" | "E") => Sentence::Heading(f.number(0)?.to_radians()),
        "HDG" => {
            let deviation = f.eastward(1)?.unwrap_or(0.0);
            let heading = f.number(0)?.to_radians() + deviation;
            Sentence::Magnetic { heading, variation: f.eastward(3)? }
        }
        "HDM" => Sentence::Magnetic { heading: f.number(0)?.to_radians(), variation: None },
        "DPT" => Sentence::Depth(f.number(0)? + f.number(1).unwrap_or(0.0)),
        _ => return None,
    })
}

/// The position as GGK of Trimble has it, with the date in the order month, day, year.
fn trimble(f: &Fields<'_>) -> Option<Sentence> {
    let date = f.text(2).as_bytes();
    let pair = |k: usize| date.get(k..k + 2).and_then(two);
    // the quality as GGA has it: 4 with whole ambiguities, 5 with others, 2 differential
    let quality = match f.whole(7)? {
        alone @ 0..=1 => alone,
        3 | 7 | 9 => 4,
        2 | 6 | 8 => 5,
        _ => 2,
    };
    Some(Sentence::Fix {
        time: f.time(1),
        date: midnight(pair(2), pair(0), pair(4).map(with_century)),
        position: f.position(3),
        height: f.text(10).strip_prefix("EHT").and_then(|height| height.parse().ok()),
        quality,
    })
}

/// The position of a transponder as PTSAG has it.
fn absolute(f: &Fields<'_>) -> Option<Sentence> {
    // a bit for each hydrophone that received the transponder
    let hydrophones = u8::from_str_radix(f.text(10), 16).ok()?;
    // sources of the depth: 0 none, 1 computed, 2 the transponder's sensor
    let depth = f.number(11).filter(|_| matches!(f.text(12), "1" | "2"));
    (hydrophones != 0).then_some(Sentence::Transponder {
        time: f.time(1),
        date: midnight(f.whole(2), f.whole(3), f.text(4).parse().ok()),
        beacon: Beacon::new(f.text(5))?,
        position: f.position(6)?,
        depth,
        sigma: None,
    })
}

/// The position of a transponder as PSIMSSB has it: Cartesian from the vessel, or latitude and
/// longitude in radians. Polar coordinates and UTM, which lacks its zone, are not used, nor are
/// predictions, and fixes with an error code, whose coordinates may be zero.
fn kongsberg(f: &Fields<'_>) -> Option<Sentence> {
    if f.text(2) != "A" || !f.text(3).is_empty() || !matches!(f.text(6), "M" | "F") {
        return None;
    }
    let (time, beacon, depth) = (f.time(0), Beacon::new(f.text(1))?, f.number(9));
    // programs without an accuracy write zero
    let sigma = f.number(10).filter(|sigma| *sigma > 0.0);
    let place = [f.number(7)?, f.number(8)?];
    let axes = match (f.text(4), f.text(5)) {
        ("R", _) => {
            let [lat, lon] = place;
            let inside = lat.abs() <= FRAC_PI_2 && lon.abs() <= PI;
            let date = None;
            return inside.then_some(Sentence::Transponder {
                time,
                date,
                beacon,
                position: place,
                depth,
                sigma,
            });
        }
        ("C", "H") => Axes::HeadUp,
        ("C", "N") => Axes::NorthEast,
        ("C", "E") => Axes::EastNorth,
        _ => return None,
    };
    let near = place.iter().all(|x| x.abs() < FARTHEST);
    near.then_some(Sentence::Relative { time, beacon, axes, offset: place, depth, sigma })
}

/// Modes estimated, manual and simulated.
fn estimated(mode: &str) -> bool {
    matches!(mode, "E" | "M" | "S")
}

fn attitude(time: Option<i64>, degrees: [f64; 3]) -> Option<Sentence> {
    Some(Sentence::Attitude { time, angles: degrees.map(f64::to_radians) })
}
