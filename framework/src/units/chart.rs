//! Latitudes and longitudes, as angles or as charts have them: `"43 deg 12.5' N"`.

use crate::units::error::UnitError;
use crate::units::quantity::split_number;
use crate::units::{Angle, pattern};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, IntoDeserializer, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;

/// Marks of minutes and of seconds.
const MARKS: [[char; 2]; 2] = [['\'', '′'], ['"', '″']];

/// Defines a coordinate: its doc comment, type, name, the letters of its two directions and an
/// example.
macro_rules! coordinate {
    ($(#[$doc:meta])* $name:ident, $word:literal, $letters:expr, $example:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name(Angle);

        impl $name {
            /// The angle.
            pub const fn angle(self) -> Angle {
                self.0
            }
        }

        impl From<Angle> for $name {
            fn from(angle: Angle) -> Self {
                Self(angle)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let form = Form { word: $word, letters: $letters, example: $example };
                deserializer.deserialize_any(form).map(Self)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                $word.into()
            }
            fn inline_schema() -> bool {
                true
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                let [positive, negative] = $letters;
                let chart = format!(
                    r#"^\s*[+-]?[0-9.]+\s*(deg|°)(\s*[0-9.]+\s*['′])?(\s*[0-9.]+\s*["″])?\s*[{positive}{negative}]?\s*$"#
                );
                let angle = pattern::pattern([0, 0, 0, 2, 0, 0]);
                json_schema!({
                    "type": "string", "title": $word, "pattern": format!("{angle}|{chart}"),
                    "description": format!("{} as an angle, or as {}", $word, $example),
                    "examples": [$example]
                })
            }
        }
    };
}

coordinate!(
    /// Geodetic latitude; north is positive.
    Latitude,
    "latitude",
    ['N', 'S'],
    "43 deg 12.5' N"
);
coordinate!(
    /// Longitude; east is positive.
    Longitude,
    "longitude",
    ['E', 'W'],
    "5 deg 30' E"
);

/// The way in which a coordinate is written.
struct Form {
    word: &'static str,
    /// Letters of the positive and of the negative direction.
    letters: [char; 2],
    example: &'static str,
}

impl Visitor<'_> for Form {
    type Value = Angle;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a {}, e.g. \"{}\"", self.word, self.example)
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Angle, E> {
        let marked = text.contains(|c| MARKS.as_flattened().contains(&c));
        if marked || text.trim_end().ends_with(['N', 'S', 'E', 'W']) {
            return self.chart(text).map(Angle::from_si).map_err(E::custom);
        }
        Angle::deserialize(text.into_deserializer())
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<Angle, E> {
        Angle::deserialize(number.into_deserializer())
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<Angle, E> {
        self.visit_f64(number as f64)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<Angle, E> {
        self.visit_f64(number as f64)
    }
}

impl Form {
    /// The angle of a text as charts have it, rad.
    fn chart(&self, text: &str) -> Result<f64, UnitError> {
        let refused = |reason: String| UnitError::Coordinate {
            text: text.to_owned(),
            reason,
            needed: self.word,
            example: self.example,
        };
        let [positive, negative] = self.letters;
        let mut rest = text.trim();
        let letter = rest.chars().next_back().filter(char::is_ascii_alphabetic);
        let letter = letter.filter(|_| !rest.ends_with("deg"));
        if let Some(letter) = letter {
            if !self.letters.contains(&letter) {
                return Err(refused(format!("its letter is {positive} or {negative}")));
            }
            rest = rest[..rest.len() - 1].trim_end();
        }
        let signed = rest.starts_with(['+', '-']);
        if signed && letter.is_some() {
            return Err(refused("it has a sign and a letter".to_owned()));
        }
        let unsigned = rest.trim_start_matches(['+', '-']);
        let (whole, after) = split_number(unsigned)
            .and_then(|(number, after)| Some((number, strip(after, &["deg", "°"])?)))
            .ok_or_else(|| refused("it begins with degrees".to_owned()))?;
        let (mut degrees, mut last, mut after) = (whole, whole, after);
        for (marks, (name, part)) in MARKS.iter().zip([("minutes", 60.0), ("seconds", 3600.0)]) {
            if after.is_empty() {
                break;
            }
            let marks = marks.map(String::from);
            let found = split_number(after)
                .and_then(|(number, after)| Some((number, strip(after, &[&marks[0], &marks[1]])?)));
            let Some((number, next)) = found else {
                return Err(refused(format!("\"{after}\" is no number of {name}")));
            };
            if !(0.0..60.0).contains(&number) || last.fract() != 0.0 {
                return Err(refused(format!("{name} are below 60, after a whole number")));
            }
            degrees += number / part;
            (last, after) = (number, next);
        }
        if !after.is_empty() {
            return Err(refused(format!("\"{after}\" stands behind it")));
        }
        let south = letter == Some(negative) || rest.starts_with('-');
        Ok(if south { -degrees.to_radians() } else { degrees.to_radians() })
    }
}

/// The text behind one of some marks, without spaces.
fn strip<'t>(text: &'t str, marks: &[&str]) -> Option<&'t str> {
    marks.iter().find_map(|mark| text.strip_prefix(mark)).map(str::trim_start)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use serde::de::value::{Error as ValueError, StrDeserializer};

    fn latitude(text: &str) -> Result<f64, String> {
        let text: StrDeserializer<'_, ValueError> = text.into_deserializer();
        let latitude = Latitude::deserialize(text).map_err(|e| e.to_string())?;
        Ok(latitude.angle().si().to_degrees())
    }

    #[test]
    fn the_forms_of_charts_and_angles_are_read() {
        let forms = [
            ("43 deg 12.5' N", 43.0 + 12.5 / 60.0),
            ("43°12′30″S", -(43.0 + 12.5 / 60.0)),
            ("-43 deg 12' 30\"", -(43.0 + 12.5 / 60.0)),
            ("43.25 deg N", 43.25),
            ("0 deg 30' S", -0.5),
            ("-0 deg 30'", -0.5),
            ("43.25 deg", 43.25),
            ("0.5 rad", 0.5_f64.to_degrees()),
        ];
        for (text, degrees) in forms {
            let found = latitude(text).unwrap();
            assert!((found - degrees).abs() < 1e-12, "{text}: {found}");
        }
    }

    #[test]
    fn a_mistaken_form_is_rejected_with_its_reason() {
        let forms = [
            ("43 deg 12.5' E", "N or S"),
            ("-43 deg 12.5' N", "a sign and a letter"),
            ("43 deg 60' N", "below 60"),
            ("43.5 deg 12' N", "whole number"),
            ("43 deg 12.5' 3\" N", "whole number"),
            ("43 12.5' N", "begins with degrees"),
            ("43 deg x' N", "no number of minutes"),
            ("43 deg 1' 2\" 3 N", "stands behind it"),
            ("N", "begins with degrees"),
            ("43 m", "an angle is needed"),
        ];
        for (text, reason) in forms {
            let error = latitude(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
