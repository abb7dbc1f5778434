//! A latitude and a longitude in one text: `57.1 N 11.9 E`, `57°06.0'N, 011°54.0'E`, `(57.1, 11.9)`, or
//! `POINT (11.9 57.1)`, which has the longitude first.

/// Longest text.
const LONGEST: usize = 96;
/// Most numbers: degrees, minutes and seconds of both.
const NUMBERS: usize = 6;

/// A part of the text.
enum Part {
    Number(f64),
    /// N, S, E or W.
    Side(char),
}

/// The numbers and the sides of a text, and set if it is a point, which has the longitude first.
fn parts(text: &str) -> Option<(Vec<Part>, bool)> {
    let (mut parts, mut point, mut rest) = (Vec::new(), false, text);
    // a hyphen after a digit separates degrees from minutes
    let mut after_digit = false;
    while let Some(c) = rest.chars().next() {
        let begins = c.is_ascii_digit() || (c == '-' && !after_digit);
        let inside = |k: char| k.is_ascii_digit() || k == '.';
        let length = if begins {
            let length = 1 + rest[1..].find(|k| !inside(k)).unwrap_or(rest.len() - 1);
            parts.push(Part::Number(rest[..length].parse().ok()?));
            length
        } else if c.is_ascii_alphabetic() {
            let length = rest.find(|k: char| !k.is_ascii_alphabetic()).unwrap_or(rest.len());
            match rest[..length].to_ascii_uppercase().as_str() {
                "N" | "S" | "E" | "W" => parts.push(Part::Side(c.to_ascii_uppercase())),
                "POINT" => point = true,
                // a point with a height
                "Z" if point => {}
                _ => return None,
            }
            length
        } else {
            c.len_utf8()
        };
        after_digit = begins;
        rest = &rest[length..];
    }
    Some((parts, point))
}

/// Degrees of one to three numbers.
fn degrees(numbers: &[f64]) -> Option<f64> {
    let (first, rest) = numbers.split_first()?;
    let parts = rest.len() <= 2 && rest.iter().all(|n| (0.0..60.0).contains(n));
    let valid = parts && (rest.is_empty() || first.fract() == 0.0) && *first >= 0.0;
    let part = |k: usize| rest.get(k).copied().unwrap_or_default();
    valid.then(|| first + (part(0) + part(1) / 60.0) / 60.0)
}

/// Latitude and longitude of a text, deg, and a third number, NaN where there is none. Without N, S, E and W the longitude comes first if `longitude_first`.
#[must_use]
pub fn coordinates(text: &str, longitude_first: bool) -> Option<[f64; 3]> {
    let (parts, point) = parts(text.get(..LONGEST).map_or(text, |_| ""))?;
    let count = parts.iter().filter(|part| matches!(part, Part::Number(_))).count();
    let mut sides: Vec<(char, Vec<f64>)> = Vec::new();
    let mut numbers = Vec::new();
    let before = matches!(parts.first(), Some(Part::Side(_)));
    for part in parts {
        match part {
            Part::Number(number) => match sides.last_mut().filter(|_| before) {
                Some((_, numbers)) => numbers.push(number),
                None => numbers.push(number),
            },
            Part::Side(side) => sides.push((side, std::mem::take(&mut numbers))),
        }
    }
    let height = numbers.get(2).copied().unwrap_or(f64::NAN);
    let [lat, lon] = match (sides.as_slice(), numbers.as_slice()) {
        // a third number is a height
        ([], [a, b] | [a, b, _]) if longitude_first || point => [*b, *a],
        ([], [a, b] | [a, b, _]) => [*a, *b],
        ([(a, first), (b, second)], []) if count <= NUMBERS => {
            let angle = |side: char, numbers: &[f64]| {
                let sign = if ['S', 'W'].contains(&side) { -1.0 } else { 1.0 };
                degrees(numbers).map(|angle| sign * angle)
            };
            let north = |side: &char| ['N', 'S'].contains(side);
            match (north(a), north(b)) {
                (true, false) => [angle(*a, first)?, angle(*b, second)?],
                (false, true) => [angle(*b, second)?, angle(*a, first)?],
                _ => return None,
            }
        }
        _ => return None,
    };
    (lat.abs() <= 90.0 && lon.abs() <= 360.0).then_some([lat, lon, height])
}

#[cfg(test)]
mod tests {
    use super::coordinates;
    use proptest::prelude::*;

    #[test]
    fn one_text_has_a_latitude_and_a_longitude() {
        for text in [
            "57.1 N 11.9 E",
            "N57.1 E11.9",
            "11.9E, 57.1N",
            "57.1, 11.9",
            "(57.1,11.9)",
            "[57.1; 11.9; 20.5]",
            "57°06.0'N 011°54.0'E",
            "57-06.0N 011-54.0E",
            "57 06 00.0 N, 011 54 00.0 E",
            "POINT (11.9 57.1)",
            "POINT Z (11.9 57.1 20)",
        ] {
            let near = coordinates(text, false)
                .is_some_and(|[a, b, _]| (a - 57.1).abs() < 1e-12 && (b - 11.9).abs() < 1e-12);
            assert!(near, "{text}: {:?}", coordinates(text, false));
        }
        for text in ["-70.5 -33.25", "33.25S 70.5W"] {
            let found =
                coordinates(text, true).map(|[lat, lon, height]| (lat, lon, height.is_nan()));
            assert_eq!(found, Some((-33.25, -70.5, true)));
        }
        assert_eq!(
            coordinates("POINT Z (-70.5 -33.25 520.5)", false),
            Some([-33.25, -70.5, 520.5])
        );
        for text in
            ["57.1", "57.1 N", "1 2 3 4", "57.1 N 11.9 N", "lat 57", "95, 11", "57 61 N 1 E", ""]
        {
            assert_eq!(coordinates(text, false), None, "{text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_has_coordinates_within_the_earth_or_none(text in "[0-9.NSEW°é'\" (),;POINT-]*") {
            if let Some([lat, lon, _]) = coordinates(&text, false) {
                prop_assert!(lat.abs() <= 90.0 && lon.abs() <= 360.0);
            }
        }
    }
}
