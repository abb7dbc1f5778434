//! Finds the column of a channel, and its unit.

use navfuse_core::document::did_you_mean;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::{Unit, column_suffix};

/// Largest number of columns that a message lists.
const LISTED: usize = 30;

/// A column to find.
pub struct Wanted<'a> {
    /// Name of the channel: `vel_x`.
    pub name: &'a str,
    /// SI unit of the channel as in a heading: `mps`; empty for a ratio.
    pub si: &'a str,
    /// The heading, where the scenario gives it.
    pub column: Option<&'a str>,
    /// The unit, where the scenario gives it.
    pub unit: Option<Unit>,
    /// Key of the source that gives heading and unit: `files.dvl.columns.vel_x`.
    pub key: &'a str,
    /// Names of the other channels of the sensor, and the columns that they have; these are not suggested.
    pub others: &'a [&'a str],
}

/// A column that was found.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Index of the column.
    pub index: usize,
    /// Unit of the column; `None` for the unit of the channel itself.
    pub unit: Option<Unit>,
}

impl Wanted<'_> {
    /// Finds the column among the headings.
    ///
    /// # Errors
    /// When the column is missing, is ambiguous, or has an unsuitable unit.
    pub fn find(&self, headings: &[String]) -> Result<Found, StreamError> {
        let found = self.find_optional(headings)?;
        found.ok_or_else(|| self.missing(&self.usual(), headings))
    }

    /// Finds the column among the headings; `None` if the scenario does not name it and no heading
    /// is like that of the channel.
    ///
    /// # Errors
    /// When the column that the scenario names is missing, when a heading seems to be misspelt, or
    /// when the column is ambiguous or has an unsuitable unit.
    pub fn find_optional(&self, headings: &[String]) -> Result<Option<Found>, StreamError> {
        let needed = column_suffix(self.si);
        let heading = match self.column {
            Some(column) => column.to_owned(),
            None => self.heading(headings, needed)?,
        };
        let mut places = headings.iter().enumerate().filter(|(_, h)| **h == heading);
        let index = match (places.next(), places.next()) {
            (Some((index, _)), None) => index,
            (Some(_), Some(_)) => {
                let message = format!("two columns are {heading:?}: rename one of them");
                return Err(StreamError::format(message));
            }
            (None, _) if self.column.is_none() && self.near(&heading, headings).is_none() => {
                return Ok(None);
            }
            (None, _) => return Err(self.missing(&heading, headings)),
        };
        let unit = match (needed, self.unit) {
            (None, Some(_)) if self.si.is_empty() => {
                let message = format!("{} has no unit: remove {}.unit", self.name, self.key);
                return Err(StreamError::scenario(message));
            }
            (None, unit) => unit,
            (Some(needed), Some(unit)) if unit.exponents() == needed.exponents() => Some(unit),
            (Some(_), Some(unit)) => {
                let (key, found) = (self.key, unit.dimension());
                let message = format!("{key}.unit is of {found}, {}", self.need());
                return Err(StreamError::scenario(message));
            }
            (Some(needed), None) => Some(self.suffix(&heading, needed)?),
        };
        Ok(Some(Found { index, unit }))
    }

    /// The heading of the channel where the scenario gives none.
    fn heading(&self, headings: &[String], needed: Option<Unit>) -> Result<String, StreamError> {
        let usual = self.usual();
        let (Some(needed), false) = (needed, headings.contains(&usual)) else { return Ok(usual) };
        let suffix = |h: &str| column_suffix(h.strip_prefix(self.name)?.strip_prefix('_')?);
        let candidates = || headings.iter().filter_map(|h| Some((h, suffix(h)?)));
        let mut fitting = candidates().filter(|(_, unit)| unit.exponents() == needed.exponents());
        match (fitting.next(), fitting.next()) {
            (Some((heading, _)), None) => return Ok(heading.clone()),
            (Some((a, _)), Some((b, _))) => {
                let message = format!("{a:?} and {b:?} are both {}: set {}", self.name, self.key);
                return Err(StreamError::format(message));
            }
            _ => {}
        }
        // a heading with a wrong unit, or without any, is probably the one meant
        let meant = headings
            .iter()
            .find(|h| *h == self.name)
            .or_else(|| candidates().next().map(|(h, _)| h));
        Ok(meant.cloned().unwrap_or(usual))
    }

    /// The unit at the end of a heading: the longest suffix that is a unit, so that `v_m_s` is in
    /// m/s.
    fn suffix(&self, heading: &str, needed: Unit) -> Result<Unit, StreamError> {
        let ends =
            heading.char_indices().filter(|(_, c)| *c == '_').map(|(i, _)| &heading[i + 1..]);
        let units: Vec<(&str, Unit)> =
            ends.filter_map(|end| Some((end, column_suffix(end)?))).collect();
        let remedy = format!("rename it to {:?}, or set {}.unit", self.usual(), self.key);
        match units.first() {
            Some((_, unit)) if unit.exponents() == needed.exponents() => Ok(*unit),
            Some((end, unit)) => Err(StreamError::format(format!(
                "column {heading:?} ends with {end:?}, which is {}, {}",
                unit.dimension(),
                self.need()
            ))
            .with_remedy(remedy)),
            None => Err(StreamError::format(format!(
                "column {heading:?} does not end with a unit, {}",
                self.need()
            ))
            .with_remedy(remedy)),
        }
    }

    fn usual(&self) -> String {
        if self.si.is_empty() { self.name.to_owned() } else { format!("{}_{}", self.name, self.si) }
    }

    fn need(&self) -> String {
        let dimension = column_suffix(self.si).map_or_else(String::new, |u| u.dimension());
        format!("{} is {dimension}", self.name)
    }

    /// The heading that is most like a missing one, unless it belongs to another channel.
    fn near<'a>(&self, heading: &str, headings: &'a [String]) -> Option<&'a str> {
        let named = |h: &str, name: &str| {
            h.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
        };
        let free = |h: &&str| !self.others.iter().any(|other| named(h, other));
        did_you_mean(heading, headings.iter().map(String::as_str).filter(free))
    }

    fn missing(&self, heading: &str, headings: &[String]) -> StreamError {
        let near = self.near(heading, headings);
        let near = near.map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let mut list = headings.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
        if headings.len() > LISTED {
            list += &format!(" and {} more", headings.len() - LISTED);
        }
        StreamError::format(format!("no column {heading:?}{near} (columns: {list})"))
            .with_remedy(format!("rename the column, or set {}", self.key))
    }
}

#[cfg(test)]
mod tests {
    // a failed test may panic
    #![allow(clippy::unwrap_used)]
    use super::*;
    use navfuse_core::units::parse_unit;

    const SPEED: Wanted<'_> = Wanted {
        name: "vel_x",
        si: "mps",
        column: None,
        unit: None,
        key: "files.dvl.columns.vel_x",
        others: &[],
    };

    fn find(wanted: &Wanted<'_>, header: &str) -> Result<(usize, f64), String> {
        let headings: Vec<String> = header.split(',').map(str::to_owned).collect();
        let found = wanted.find(&headings).map_err(|e| e.to_string())?;
        Ok((found.index, found.unit.map_or(1.0, |u| u.to_si(1.0))))
    }

    #[test]
    fn a_heading_is_the_channel_and_any_unit_of_its_dimension() {
        let knot = 1852.0 / 3600.0;
        for (heading, factor) in [
            ("vel_x_mps", 1.0),
            ("vel_x_cmps", 0.01),
            ("vel_x_m_s", 1.0),
            ("vel_x_mm_s", 1e-3),
            ("vel_x_kn", knot),
        ] {
            assert_eq!(
                find(&SPEED, &format!("time_s,{heading},vel_y_mps")),
                Ok((1, factor)),
                "{heading}"
            );
        }
        // SI before others
        assert_eq!(find(&SPEED, "vel_x_cmps,vel_x_mps"), Ok((1, 1.0)));
        let time = Wanted { name: "time", si: "s", key: "files.dvl.time", ..SPEED };
        for (heading, factor) in
            [("time_s", 1.0), ("time_ms", 1e-3), ("time_us", 1e-6), ("time_ns", 1e-9)]
        {
            assert_eq!(find(&time, heading), Ok((0, factor)), "{heading}");
        }
    }

    #[test]
    fn a_mapped_column_has_the_unit_it_is_given_or_ends_with() {
        let mapped = |column, unit: Option<&str>| Wanted {
            column: Some(column),
            unit: unit.map(|u| parse_unit(u).unwrap()),
            ..SPEED
        };
        assert_eq!(find(&mapped("vx_cmps", None), "t,vx_cmps"), Ok((1, 0.01)));
        assert_eq!(find(&mapped("speed_x_m_s", None), "t,speed_x_m_s"), Ok((1, 1.0)));
        assert_eq!(find(&mapped("vx", Some("cm/s")), "t,vx"), Ok((1, 0.01)));
        // a unit in the scenario takes precedence over the end of the heading
        assert_eq!(find(&mapped("x_m", Some("m/s")), "t,x_m"), Ok((1, 1.0)));
        // a unit alone: the column is still found by the name of the channel
        assert_eq!(
            find(&Wanted { unit: parse_unit("cm/s").ok(), ..SPEED }, "t,vel_x"),
            Ok((1, 0.01))
        );
    }

    #[test]
    fn a_channel_may_lack_a_column_unless_a_heading_is_almost_its_own() {
        let found = |header: &str| {
            let headings: Vec<String> = header.split(',').map(str::to_owned).collect();
            SPEED.find_optional(&headings).map(|found| found.map(|f| f.index))
        };
        assert_eq!(found("time_s,depth_m").unwrap(), None);
        assert_eq!(found("time_s,vel_x_kn").unwrap(), Some(1));
        for misspelt in ["velx_mps", "vel_x", "vel_x_m"] {
            assert!(found(misspelt).is_err(), "{misspelt}");
        }
    }

    #[test]
    fn a_ratio_and_an_unknown_unit_have_their_own_heading_only() {
        assert_eq!(
            find(&Wanted { name: "quality", si: "", ..SPEED }, "time_s,quality"),
            Ok((1, 1.0))
        );
        assert_eq!(
            find(&Wanted { name: "field_x", si: "gauss", ..SPEED }, "time_s,field_x_gauss"),
            Ok((1, 1.0))
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_its_remedy() {
        let error = |wanted: &Wanted<'_>, header| find(wanted, header).unwrap_err();
        assert_eq!(
            error(&SPEED, "time_s,velx_mps,vy"),
            "no column \"vel_x_mps\"; did you mean \"velx_mps\"? (columns: time_s, velx_mps, vy); \
             rename the column, or set \
             files.dvl.columns.vel_x"
        );
        assert_eq!(
            error(&SPEED, "vel_x_m"),
            "column \"vel_x_m\" ends with \"m\", which is a length, vel_x is a speed; rename it \
             to \"vel_x_mps\", or set \
             files.dvl.columns.vel_x.unit"
        );
        assert_eq!(
            error(&SPEED, "vel_x"),
            "column \"vel_x\" does not end with a unit, vel_x is a speed; rename it to \
             \"vel_x_mps\", or set \
             files.dvl.columns.vel_x.unit"
        );
        assert_eq!(
            error(&SPEED, "vel_x_kn,vel_x_cmps"),
            "\"vel_x_kn\" and \"vel_x_cmps\" are both vel_x: set files.dvl.columns.vel_x"
        );
        assert_eq!(
            error(&SPEED, "vel_x_mps,vel_x_mps"),
            "two columns are \"vel_x_mps\": rename one of them"
        );
        assert_eq!(
            error(&Wanted { unit: parse_unit("deg").ok(), ..SPEED }, "vel_x"),
            "files.dvl.columns.vel_x.unit is of an angle, vel_x is a speed"
        );
    }
}
