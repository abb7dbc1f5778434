//! The columns of the time and the channels of a sensor, and their conversion to SI.

use crate::config::{Column, FileConfig, Notation};
use crate::coordinates::coordinates;
use crate::headings::Wanted;
use crate::map::{Local, Map, Zone};
use crate::number::number;
use crate::stamp::TimeCell;
use csv::ByteRecord;
use nalgebra::Vector3;
use navfuse_core::document::did_you_mean;
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Unit, column_suffix, parse_unit};

/// The column of a channel.
pub struct ChannelCell {
    /// Index of the channel.
    pub channel: usize,
    /// Index of the column.
    pub column: usize,
    unit: Option<Unit>,
    scale: f64,
    notation: Notation,
    /// Latitude, longitude or height of Earth-fixed coordinates; north or east of a course.
    axis: usize,
    /// Column of the course.
    course: Option<usize>,
    /// Column that is added.
    plus: Option<usize>,
    /// Column of the side of a latitude or longitude.
    side: Option<usize>,
    /// Column of the northing of a position on a map.
    map: Option<(usize, Map)>,
    /// Numbers that stand for no measurement.
    missing: Vec<f64>,
    /// Pressure at the surface, Pa, and pascals of one metre of water, for a depth from a pressure.
    pressure: Option<[f64; 2]>,
}

/// Standard atmosphere, Pa; density of sea water, kg/m^3; standard gravity, m/s^2.
const ATMOSPHERE: f64 = 101_325.0;
const SEA_WATER: f64 = 1025.0;
const GRAVITY: f64 = 9.806_65;
/// Number that is no angle in degrees.
const PACKED: f64 = 1000.0;
/// Longest text of a cell in a notation of its own.
const LONGEST: usize = 64;

impl ChannelCell {
    /// The value of a row in SI: `None` for an empty cell, NaN for one that holds no number.
    pub fn value(&self, record: &ByteRecord) -> Option<f64> {
        let text = |k: usize| record.get(k).unwrap_or_default().trim_ascii();
        let cell = |k: usize| text(self.column + k);
        if cell(0).is_empty() {
            return None;
        }
        let parsed = |text: &[u8]| -> f64 { number(&crate::text::text(text)).unwrap_or(f64::NAN) };
        let value = |k: usize| parsed(cell(k));
        if self.missing.contains(&value(0)) {
            return None;
        }
        if let Some((north, map)) = self.map {
            let [east, north] = [value(0), parsed(text(north))];
            return Some(match map {
                // zero is a receiver without a fix
                Map::Utm(_) if east == 0.0 => f64::NAN,
                Map::Utm(zone) => zone.position([east, north])[self.axis.min(1)],
                Map::Local(local, up) => {
                    let up = up.map_or(0.0, |(column, sign)| sign * parsed(text(column)));
                    local.position([east, north, up])[self.axis]
                }
            });
        }
        let number = match self.notation {
            Notation::Decimal => {
                let plus = self.plus.map_or(0.0, |column| parsed(text(column)));
                (value(0) + plus) * self.along(record)
            }
            Notation::DegreesMinutes => {
                let degrees = (value(0) / 100.0).trunc();
                degrees + (value(0) - 100.0 * degrees) / 60.0
            }
            Notation::DegreesMinutesSeconds => {
                let one = value(0).is_nan() || value(0).abs() > PACKED;
                let cells = [cell(0), cell(1), cell(2)];
                // minutes with decimals have no seconds behind them
                let minutes = cells[1].rsplit(|b| *b == b'.').next();
                let two = cells[1].contains(&b'.') && minutes.is_some_and(|part| part.len() > 1);
                let count = if one { 1 } else { 3 - usize::from(two) };
                degrees(&cells[..count]).unwrap_or(f64::NAN)
            }
            Notation::LatitudeLongitude | Notation::LongitudeLatitude => {
                let reversed = self.notation == Notation::LongitudeLatitude;
                let pair = coordinates(&crate::text::text(cell(0)), reversed);
                pair.map_or(f64::NAN, |pair| pair[self.axis])
            }
            Notation::EarthFixed => {
                let point = Vector3::new(value(0), value(1), value(2)) * self.scale;
                let position = Geodetic::from_earth_fixed(&point);
                let [lat, lon, height] = [position.latitude, position.longitude, position.height];
                // a point near the centre is a receiver without a fix
                let far = point.norm() > 1e6;
                let si = [lat, lon, height][self.axis];
                return Some(if far { si } else { f64::NAN });
            }
        };
        let si = self.unit.map_or(number, |u| u.to_si(number));
        let south_or_west = self.side.is_some_and(|k| matches!(text(k), b"S" | b"W" | b"s" | b"w"));
        let si = if south_or_west { -si.abs() } else { si };
        Some(self.pressure.map_or(si, |[surface, metre]| (si - surface) / metre) * self.scale)
    }

    /// The share of a speed along north or east; one without a course.
    fn along(&self, record: &ByteRecord) -> f64 {
        let Some(column) = self.course else { return 1.0 };
        let cell = record.get(column).unwrap_or_default().trim_ascii();
        let degrees = std::str::from_utf8(cell).ok().and_then(number);
        let (sin, cos) = degrees.unwrap_or(f64::NAN).to_radians().sin_cos();
        [cos, sin][self.axis.min(1)]
    }
}

/// Degrees of a text such as `-48 06 00.1` or `48°06'00.1"S`, whose parts may stand in several cells.
fn degrees(cells: &[&[u8]]) -> Option<f64> {
    let mut parts = [0.0; 3];
    let (mut count, mut negative) = (0, false);
    for cell in cells {
        let text = crate::text::text(cell.get(..LONGEST).unwrap_or(cell));
        negative |= text.starts_with('-') || text.contains(['S', 'W', 's', 'w']);
        let number = |c: char| c.is_ascii_digit() || c == '.';
        for part in text.split(|c| !number(c)).filter(|part| !part.is_empty()) {
            *parts.get_mut(count)? = part.parse::<f64>().ok()?;
            count += 1;
        }
    }
    let [mut degrees, mut minutes, mut seconds] = parts;
    // ddmmss.s
    if count == 1 && degrees > PACKED {
        [degrees, minutes, seconds] =
            [(degrees / 1e4).trunc(), (degrees / 100.0).trunc() % 100.0, degrees % 100.0];
    }
    // a program that rounds seconds writes 60
    let valid = count > 0 && minutes <= 60.0 && seconds <= 60.0;
    let sign = if negative { -1.0 } else { 1.0 };
    valid.then_some(sign * (degrees + (minutes + seconds / 60.0) / 60.0))
}

/// The headings that a sensor needs by default.
pub fn usual_header(info: &SensorInfo) -> String {
    let channels = info.channels.iter().map(|c| c.column().trim_end_matches('_').to_owned());
    std::iter::once("time_s".to_owned()).chain(channels).collect::<Vec<_>>().join(",")
}

/// The pressure at the surface and the pascals of one metre of water, for a depth whose column has a
/// pressure.
fn water(channel: &str, column: &Column) -> Option<[f64; 2]> {
    let pressure = parse_unit("Pa").ok()?.exponents();
    let measured = column.unit.is_some_and(|unit| unit.0.exponents() == pressure);
    (channel == "depth" && measured).then(|| {
        let density = column.density.map_or(SEA_WATER, |d| d.si());
        [column.atmosphere.map_or(ATMOSPHERE, |p| p.si()), density * GRAVITY]
    })
}

/// Names of the channels of a position, and of a velocity that a course has.
const POSITION: [&str; 3] = ["lat", "lon", "height"];
const COURSE: [&str; 2] = ["vel_n", "vel_e"];

/// Finds the columns of the channels. A sensor that drives a process needs all of them, unless the
/// file is one of two; the file of another sensor may lack some.
///
/// # Errors
/// When a column that is needed is missing, no channel has a column, or a column is ambiguous or
/// has an unsuitable unit.
pub fn channel_cells(
    info: &SensorInfo,
    config: &FileConfig,
    headings: &[String],
    part: bool,
) -> Result<Vec<ChannelCell>, StreamError> {
    let (sensor, names) = (&info.name, || info.channels.iter().map(|c| &*c.name));
    if let Some(unknown) = config.columns.keys().find(|key| names().all(|c| c != key.as_str())) {
        let near = did_you_mean(unknown, names())
            .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let list = names().collect::<Vec<_>>().join(", ");
        return Err(StreamError::scenario(format!(
            "files.{sensor}.columns: [sensor.{sensor}] has no channel {unknown:?}{near} \
             (channels: {list})"
        )));
    }
    let mut cells = Vec::with_capacity(info.channels.len());
    for (channel, c) in info.channels.iter().enumerate() {
        let given = config.columns.get(&*c.name).map(|g| &g.0);
        let (column, unit) =
            (given.and_then(|g| g.column.as_deref()), given.and_then(|g| g.unit).map(|u| u.0));
        let key = format!("files.{sensor}.columns.{}", c.name);
        let mapped = config.columns.iter().filter(|(name, _)| **name != *c.name);
        let mapped = mapped.filter_map(|(_, other)| other.0.column.as_deref());
        let others = std::iter::once("time").chain(names().filter(|n| *n != &*c.name));
        let others: Vec<&str> = others.chain(mapped).collect();
        let (name, si) = (&*c.name, &*c.unit.suffix());
        let pressure = given.and_then(|g| water(name, g));
        let si = if pressure.is_some() { "Pa" } else { si };
        let notation = given.map_or_else(Notation::default, |g| g.notation);
        let earth_fixed = notation == Notation::EarthFixed;
        let pair = [Notation::LatitudeLongitude, Notation::LongitudeLatitude].contains(&notation);
        let zone = given.and_then(|g| g.zone.as_deref());
        let origin = given.and_then(|g| g.origin.as_ref());
        let mapped = earth_fixed || zone.is_some() || origin.is_some();
        let unit = unit.or(mapped.then_some(c.unit));
        let wanted = Wanted { name, si, column, unit, key: &key, others: &others };
        let last = channel + 1 == info.channels.len();
        let input = info.purpose == Purpose::Input && !part;
        let needed = input || given.is_some() || (last && cells.is_empty());
        let found = match needed {
            true => Some(wanted.find(headings)?),
            false => wanted.find_optional(headings)?,
        };
        let Some(found) = found else { continue };
        let scale = given.and_then(|g| g.scale).map_or(1.0, |s| s.si());
        let place = |names: &[&str]| names.iter().position(|name| *name == &*c.name);
        let course = given.and_then(|g| g.course.as_ref());
        let axis = match course {
            _ if zone.is_some() => place(&POSITION[..2]),
            _ if earth_fixed || origin.is_some() || pair => place(&POSITION),
            Some(_) => place(&COURSE),
            None => Some(0),
        };
        let Some(axis) = axis else {
            let message = "lat, lon and height may be earth-fixed, in one text or have an origin, lat and lon a \
                           zone, vel_n and vel_e a course";
            return Err(StreamError::scenario(format!("{key}: {message}")));
        };
        let index = |heading: &String| {
            let missing = || StreamError::format(format!("no column {heading:?}"));
            headings.iter().position(|h| h == heading).ok_or_else(missing)
        };
        let course = course.map(index).transpose()?;
        let north = given.and_then(|g| g.north.as_ref()).map(index).transpose()?;
        let plus = given.and_then(|g| g.plus.as_ref()).map(index).transpose()?;
        let up = given.and_then(|g| g.up.as_ref()).map(index).transpose()?;
        let down = given.and_then(|g| g.down.as_ref()).map(index).transpose()?;
        let up = up.map(|k| (k, 1.0)).or_else(|| down.map(|k| (k, -1.0)));
        let side = given.and_then(|g| g.side.as_ref()).map(index).transpose()?;
        let unknown = || {
            format!(
                "{key}: a zone such as \"32N\" or an origin needs `north`, `north` one of both, and `up` \
                 or `down` an origin"
            )
        };
        let map = match (north, zone.map(Zone::parse), origin) {
            (None, None, None) if up.is_none() => None,
            (Some(north), Some(Some(zone)), None) if up.is_none() => Some((north, Map::Utm(zone))),
            (Some(north), None, Some(origin)) => Some((north, Map::Local(Local::new(origin), up))),
            _ => return Err(StreamError::scenario(unknown())),
        };
        let (column, unit) = (found.index, found.unit);
        let cell = ChannelCell {
            channel,
            column,
            unit,
            scale,
            notation,
            axis,
            course,
            plus,
            side,
            map,
            missing: config.missing.clone(),
            pressure,
        };
        cells.push(cell);
    }
    Ok(cells)
}

/// Reports the channels of a sensor that have no column, where there are any: as a warning if an
/// unused column has the unit of one of them, since that column may be meant.
pub fn without_column(
    info: &SensorInfo,
    time: &TimeCell,
    cells: &[ChannelCell],
    headings: &[String],
) -> Option<(Level, String)> {
    let has_column = |channel: usize| cells.iter().any(|cell| cell.channel == channel);
    let missing: Vec<&Channel> = (info.channels.iter().enumerate())
        .filter(|(channel, _)| !has_column(*channel))
        .map(|(_, c)| c)
        .collect();
    let unused = |column: usize| !time.uses(column) && cells.iter().all(|c| c.column != column);
    let of_unit = |heading: &str, wanted: Unit| {
        let mut units =
            heading.match_indices('_').filter_map(|(at, _)| column_suffix(&heading[at + 1..]));
        wanted != Unit::ONE && units.any(|u| u.exponents() == wanted.exponents())
    };
    let meant: Vec<&str> = (headings.iter().enumerate())
        .filter(|(column, h)| unused(*column) && missing.iter().any(|c| of_unit(h, c.unit)))
        .map(|(_, h)| h.as_str())
        .collect();
    let names: Vec<&str> = missing.iter().map(|c| &*c.name).collect();
    let names = names.join(", ");
    match (missing.is_empty(), meant.is_empty()) {
        (true, _) => None,
        (_, true) => Some((Level::Info, format!("no column for {names}: used without"))),
        (_, false) => Some((
            Level::Warning,
            format!(
                "no column for {names}: used without; if one of the unused columns {} is meant, \
                 set files.{}.columns",
                meant.join(", "),
                info.name
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::degrees;

    #[test]
    fn degrees_minutes_and_seconds_stand_in_several_cells_or_in_one_number() {
        let cells: [&[&[u8]]; 4] =
            [&[b"-48", b"06", b"36"], &[b"48-06-36S"], &[b"-480636.0"], &[b"480636S"]];
        for cells in cells {
            let found = degrees(cells).unwrap_or(f64::NAN);
            assert!((found + 48.11).abs() < 1e-12, "{cells:?}: {found}");
        }
        for (cells, expected) in
            [(&b"48\xb006'60.0\"N"[..], 48.0 + 7.0 / 60.0), (b"47 59 60.00", 48.0)]
        {
            let found = degrees(&[cells]).unwrap_or(f64::NAN);
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        // minutes and seconds are 60 at most
        for cells in [b"486136".as_slice(), b"480661", b"48 61"] {
            assert_eq!(degrees(&[cells]), None);
        }
    }
}
