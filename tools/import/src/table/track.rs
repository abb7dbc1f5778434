//! What positions show: the unit of the velocity beside them, and coordinates of the Earth without a name.

use super::angles::turned;
use super::columns::{Chosen, ECEF, Table};
use super::place::RADIAN;
use super::units::{self, AID_INTERVAL, Decided, Evidence, settle};
use super::vocabulary::Meaning;
use navfuse_core::document::quoted;
use std::ops::RangeInclusive;

/// A mile in an hour.
const MILES: &str = "5280*ft/h";
/// Units of a speed.
const SPEEDS: [&str; 7] = ["m/s", "km/h", "kn", "ft/s", MILES, "cm/s", "mm/s"];
/// Time over which a way is compared, s, and the least number of ways.
const SPAN: f64 = 5.0;
const LEAST: usize = 5;
/// Correlation of ways and velocities from which their ratio is a unit, and the largest error of its logarithm: half of
/// that between km/h and ft/s.
const CORRELATED: f64 = 0.9;
const NEAR: f64 = 0.046;
/// Share of what one unit of the positions leaves unexplained, from which another one is right.
const LESS: f64 = 0.5;
/// Largest latitude, deg.
const POLE: f64 = 90.0;
/// Distances from the centre of the Earth at which vehicles are, m.
const SURFACE: RangeInclusive<f64> = 6.33e6..=6.42e6;

impl Table<'_> {
    /// The unit of the velocity of a receiver by the way between its positions, whose angles have a factor to rad or are
    /// degrees with minutes; `None` where it is the stated one or the SI unit, or where the positions do not show it.
    pub(super) fn by_track(&self, factor: f64, minutes: bool) -> Option<Decided> {
        let (ratio, stated) = self.beside_track(factor, minutes)?;
        let (unit, distance) = nearest(ratio.size)?;
        let stated = stated.unwrap_or_else(|| "m/s".to_owned());
        (distance < NEAR && !units::same(unit, &stated)).then(|| Decided {
            unit: unit.to_owned(),
            why: "the positions move as fast".to_owned(),
            evidence: Evidence::Strong,
        })
    }

    /// Tests whether integers of latitude and longitude are semicircles rather than 1e-7 deg: by a heading or a unit, or
    /// by the velocity beside them.
    pub(super) fn in_semicircles(&self) -> bool {
        let columns = self.columns.iter().filter(|(_, m)| ["lat", "lon"].contains(&m.channel));
        let named = |text: &str| text.to_lowercase().contains("semicirc");
        let unit = |k: &usize| self.layout.units.get(*k).is_some_and(|unit| named(unit));
        if columns.into_iter().any(|(k, _)| named(self.heading(*k)) || unit(k)) {
            return true;
        }
        let ratio =
            |scale: f64| self.beside_track(scale.to_radians(), false).map(|(ratio, _)| ratio);
        let near = |ratio: &Ratio| nearest(ratio.size).is_some_and(|(_, distance)| distance < NEAR);
        let usual = ratio(units::E7).filter(near);
        // the wrong unit changes north and east by other factors
        let fits = |r: Ratio| usual.as_ref().is_none_or(|usual| r.rest < LESS * usual.rest);
        ratio(units::SEMICIRCLE).filter(near).is_some_and(fits)
    }

    /// Tests whether latitudes and longitudes that may be degrees with minutes are minutes of an arc: the velocity beside
    /// them shows how long a minute of the longitude is.
    pub(super) fn in_minutes(&self) -> bool {
        let rest = |factor: f64, minutes: bool| {
            self.beside_track(factor, minutes).map_or(1.0, |(ratio, _)| ratio.rest)
        };
        rest(units::factor("arcmin"), false) < LESS * rest(1.0, true)
    }

    /// Exchanges the columns of latitude and longitude where the latitudes are beyond the poles, or where the velocity
    /// beside them moves so.
    pub(super) fn exchange(&mut self) {
        if !self.has(&["lat", "lon"]) {
            return;
        }
        let [lat, lon] = ["lat", "lon"].map(|c| self.values(c));
        let finite = |values: &[f64]| values.iter().copied().filter(|v| v.is_finite()).collect();
        let [lat, lon]: [Vec<f64>; 2] = [finite(&lat), finite(&lon)];
        let all = |values: &[f64], range: RangeInclusive<f64>| {
            !values.is_empty() && values.iter().all(|v| range.contains(&v.abs()))
        };
        let plain = |c: &str| {
            let found = self.find(c);
            found.is_some_and(|(k, m)| {
                let unit = m.unit.as_deref().is_none_or(|unit| unit == "deg");
                unit && self.side(*k, c).is_empty() && self.sexagesimal(c).is_none()
            })
        };
        if !plain("lat") || !plain("lon") || !all(&lon, 0.0..=POLE) {
            return;
        }
        let found = if all(&lat, POLE + f64::MIN_POSITIVE..=180.0) {
            Some((["lat", "lon"], "the latitudes are beyond the poles"))
        } else if all(&lat, 0.0..=POLE) {
            self.exchanged().map(|pair| (pair, "positions and velocity move so"))
        } else {
            None
        };
        let Some(([first, second], why)) = found else { return };
        for (_, meaning) in &mut self.columns {
            meaning.channel = match meaning.channel {
                channel if channel == first => second,
                channel if channel == second => first,
                other => other,
            };
        }
        let text = format!("the columns of {first} and {second} are exchanged: {why}");
        self.questions.push(text);
    }

    /// The channels whose columns are exchanged, of positions in degrees that do not move as the velocity beside them.
    fn exchanged(&self) -> Option<[&'static str; 2]> {
        let degree = units::factor("deg");
        let rest = |[first, second]: [&str; 2], velocity: [&str; 2]| {
            let [lat, lon] =
                [first, second].map(|c| self.values(c).into_iter().map(|v| v * degree));
            let place: Vec<[f64; 2]> = lat.zip(lon).map(|(lat, lon)| [lat, lon]).collect();
            self.beside(&place, velocity).map(|(ratio, _)| ratio.rest)
        };
        let (place, velocity) = (["lat", "lon"], ["vel_n", "vel_e"]);
        if rest(place, velocity).is_some() {
            return None;
        }
        let positions = rest(["lon", "lat"], velocity).unwrap_or(1.0);
        let along = self.has(&velocity).then(|| rest(place, ["vel_e", "vel_n"])).flatten();
        let velocities = along.unwrap_or(1.0);
        match () {
            () if positions < LESS * velocities => Some(place),
            () if velocities < LESS * positions => Some(velocity),
            () => None,
        }
    }

    /// The ratio of the way between the positions to the velocity beside them, and the unit that its heading states.
    pub(super) fn beside_track(
        &self,
        factor: f64,
        minutes: bool,
    ) -> Option<(Ratio, Option<String>)> {
        let angle = |v: f64| match minutes {
            true => ((v / 100.0).trunc() + (v % 100.0) / 60.0).to_radians(),
            false => v * factor,
        };
        let [lat, lon] = ["lat", "lon"].map(|c| self.values(c).into_iter().map(angle));
        let place: Vec<[f64; 2]> = lat.zip(lon).map(|(lat, lon)| [lat, lon]).collect();
        self.beside(&place, ["vel_n", "vel_e"])
    }

    /// The same for positions in rad.
    fn beside(
        &self,
        place: &[[f64; 2]],
        [north, east]: [&str; 2],
    ) -> Option<(Ratio, Option<String>)> {
        let along = self.find(north).zip(self.find(east));
        let over = self.find("speed").zip(self.find("course"));
        let (velocity, meaning): (Vec<[f64; 2]>, _) = match (along, over) {
            (Some(((n, meaning), (e, other))), _) => {
                let column =
                    |k: usize, sign: f64| self.layout.column(k).into_iter().map(move |v| v * sign);
                let rows = column(*n, meaning.sign).zip(column(*e, other.sign));
                (rows.map(|(n, e)| [n, e]).collect(), meaning)
            }
            (None, Some(((speed, meaning), (course, _)))) => {
                let rows = self.layout.column(*speed).into_iter().zip(self.layout.column(*course));
                let components = |(v, course): (f64, f64)| {
                    let (sin, cos) = course.to_radians().sin_cos();
                    [v * cos, v * sin]
                };
                (rows.map(components).collect(), meaning)
            }
            (None, None) => return None,
        };
        let seconds = self.clock(AID_INTERVAL).ok()?.seconds;
        Some((ratio(&seconds, place, &velocity)?, meaning.unit.clone()))
    }

    /// The keys of a velocity that is a speed over ground with a course.
    pub(super) fn course(
        &self,
        by_track: Option<Decided>,
        questions: &mut Vec<String>,
    ) -> Vec<String> {
        let Some(((speed, meaning), (course, angle))) = self.find("speed").zip(self.find("course"))
        else {
            return Vec::new();
        };
        let degrees = angle.unit.as_deref().is_none_or(|unit| unit == "deg");
        if !degrees || turned(&self.layout.column(*course)) != "deg" {
            return Vec::new();
        }
        let (heading, stated) = (self.heading(*speed), meaning.unit.clone());
        let unit = match by_track {
            Some(shown) => Some(settle(heading, stated, shown, true, questions)),
            None => {
                if stated.is_none() {
                    questions.push(format!("the unit of {heading}: m/s is assumed"));
                }
                stated
            }
        };
        let more = format!(", course = {}", quoted(self.heading(*course)));
        let key = |channel: &str| {
            let unit = unit.clone().unwrap_or_else(|| "m/s".to_owned());
            let more = more.clone();
            Chosen { heading, unit, scale: 1.0, minutes: false, more, usual: false }.key(channel)
        };
        ["vel_n", "vel_e"].into_iter().filter_map(key).collect()
    }

    /// The keys of a position in Earth-fixed axes.
    pub(super) fn earth_fixed(&self) -> Vec<String> {
        let [x, y, z] = ECEF.map(|channel| self.find(channel).map_or(0, |(k, _)| *k));
        let unit = self.find(ECEF[0]).and_then(|(_, m)| m.unit.as_deref()).unwrap_or("m");
        let size = units::factor(unit);
        let scale = if size == 1.0 { String::new() } else { format!(", scale = {size:e}") };
        let key = |channel: &str| {
            let heading = quoted(self.heading(x));
            format!(
                "columns.{channel} = {{ column = {heading}, notation = \"earth-fixed\"{scale} }}"
            )
        };
        let beside = y == x + 1 && z == x + 2;
        if beside { ["lat", "lon", "height"].map(key).to_vec() } else { Vec::new() }
    }

    /// Names three columns in a row that are coordinates of the Earth by their distance from its centre, in a table
    /// without another position.
    pub(super) fn name_earth_fixed(&mut self) {
        let named = self.has(&ECEF);
        if self.has(&["lat", "lon"]) || (named && self.stated(ECEF).is_some()) {
            return;
        }
        let columns: Vec<Vec<f64>> =
            (0..self.layout.width()).map(|k| self.layout.column(k)).collect();
        let on_surface = |(first, size): (usize, f64)| {
            let far = |row: usize| {
                let point =
                    [0, 1, 2].map(|k| columns[first + k].get(row).copied().unwrap_or(f64::NAN));
                let norm = size * point.iter().map(|x| x * x).sum::<f64>().sqrt();
                norm.is_nan().then_some(false).or(Some(SURFACE.contains(&norm)))
            };
            let rows = self.layout.rows.len();
            let fits = (0..rows).filter(|row| far(*row) == Some(true)).count();
            // a receiver without a fix has zeros
            rows > 1 && fits as f64 > 0.5 * rows as f64
        };
        // integers of 1e-7 deg may be as large as centimetres
        let units: &[&str] = if named { &["m", "km", "cm", "mm"] } else { &["m", "km"] };
        let found = units.iter().copied().find_map(|unit| {
            let mut places = 0..columns.len().saturating_sub(2);
            Some((places.find(|k| on_surface((*k, units::factor(unit))))?, unit))
        });
        let Some((first, unit)) = found else { return };
        self.columns.retain(|(k, _)| !(first..first + 3).contains(k));
        let named = |(k, channel)| {
            (first + k, Meaning { channel, unit: Some(unit.to_owned()), sign: 1.0, rank: 0 })
        };
        self.columns.extend(ECEF.into_iter().enumerate().map(named));
    }
}

/// The ratio of ways to the integrals of velocities.
pub(super) struct Ratio {
    size: f64,
    /// Share of the ways that it does not explain.
    rest: f64,
}

/// The unit of a speed with the nearest size, and the distance of the logarithms.
fn nearest(size: f64) -> Option<(&'static str, f64)> {
    let distance = |unit: &'static str| (unit, (size / units::factor(unit)).ln().abs());
    SPEEDS.into_iter().map(distance).min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The ratio of the way between positions to the integral of a velocity beside them; `None` where they are not
/// proportional.
fn ratio(seconds: &[f64], place: &[[f64; 2]], velocity: &[[f64; 2]]) -> Option<Ratio> {
    let rows = seconds.iter().zip(place).zip(velocity);
    let finite = |((t, p), v): &((&f64, &[f64; 2]), &[f64; 2])| {
        t.is_finite() && p.iter().chain(*v).all(|x| x.is_finite())
    };
    let mut before: Option<(f64, [f64; 2])> = None;
    let (mut from, mut sum) = (None, [0.0; 2]);
    let (mut count, mut product, mut squares) = (0, 0.0, [0.0; 2]);
    for ((t, p), v) in rows.filter(finite) {
        // nothing shows the velocity in a gap
        if before.is_some_and(|(last, _)| t - last > SPAN) {
            (before, from, sum) = (None, None, [0.0; 2]);
        }
        let (last, old) = *before.get_or_insert((*t, *v));
        let (begin, [lat, lon]) = *from.get_or_insert((*t, *p));
        sum = [0, 1].map(|k| sum[k] + 0.5 * (old[k] + v[k]) * (t - last));
        before = Some((*t, *v));
        if t - begin < SPAN {
            continue;
        }
        let way = [RADIAN * (p[0] - lat), RADIAN * (p[1] - lon) * p[0].cos()];
        count += 1;
        for k in 0..2 {
            product += way[k] * sum[k];
            squares = [squares[0] + way[k] * way[k], squares[1] + sum[k] * sum[k]];
        }
        (from, sum) = (Some((*t, *p)), [0.0; 2]);
    }
    let correlation = product / (squares[0] * squares[1]).sqrt();
    let rest = 1.0 - correlation * correlation;
    (count >= LEAST && correlation > CORRELATED).then(|| Ratio { size: product / squares[1], rest })
}
