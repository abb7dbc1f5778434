//! Tables: the sensor of a file by its headings.

use crate::found::Found;
use crate::plain;
use navfuse_core::document::quoted;
use navfuse_core::units::{column_suffix, parse_unit, suffix_expression};
use std::fmt::Write;

/// The channels by which a sensor is recognised, with their SI units and other names for them.
type Known = (&'static str, &'static str, &'static [&'static str]);

const IMU: [Known; 6] = [
    ("gyro_x", "radps", &["wx", "gx", "omega_x", "angular_velocity_x"]),
    ("gyro_y", "radps", &["wy", "gy", "omega_y", "angular_velocity_y"]),
    ("gyro_z", "radps", &["wz", "gz", "omega_z", "angular_velocity_z"]),
    ("accel_x", "mps2", &["ax", "acc_x", "fx", "linear_acceleration_x"]),
    ("accel_y", "mps2", &["ay", "acc_y", "fy", "linear_acceleration_y"]),
    ("accel_z", "mps2", &["az", "acc_z", "fz", "linear_acceleration_z"]),
];
const INCREMENTS: [Known; 6] = [
    ("dtheta_x", "rad", &[]),
    ("dtheta_y", "rad", &[]),
    ("dtheta_z", "rad", &[]),
    ("dvel_x", "mps", &[]),
    ("dvel_y", "mps", &[]),
    ("dvel_z", "mps", &[]),
];
const DVL: [Known; 3] =
    [("vel_x", "mps", &["vx"]), ("vel_y", "mps", &["vy"]), ("vel_z", "mps", &["vz"])];
const DEPTH: [Known; 1] = [("depth", "m", &[])];
const POSITION: [Known; 3] = [
    ("lat", "rad", &["latitude"]),
    ("lon", "rad", &["longitude", "lng"]),
    ("height", "m", &["altitude", "alt"]),
];
const ATTITUDE: [Known; 3] =
    [("roll", "rad", &[]), ("pitch", "rad", &[]), ("yaw", "rad", &["heading"])];
const HEADING: [Known; 1] = [("heading", "rad", &[])];

/// Names of the column of the time, beside `time`.
const TIMES: [&str; 5] = ["timestamp", "stamp", "t", "gps_time", "utc"];

/// Largest number of rows by which a table without headings is recognised.
const PLAIN_ROWS: usize = 50;

/// The titles of RTKLIB with the headings of the channels. The deviation to the north stands for
/// both horizontal ones; `vu` points up and is turned.
const RTKLIB: [(&str, &str); 7] = [
    ("latitude(deg)", "lat_deg"),
    ("longitude(deg)", "lon_deg"),
    ("height(m)", "height_m"),
    ("sdn(m)", "h_acc_m"),
    ("sdu(m)", "v_acc_m"),
    ("vn(m/s)", "vel_n_mps"),
    ("ve(m/s)", "vel_e_mps"),
];

/// A column that was found for a channel.
struct Column<'a> {
    heading: &'a str,
    /// The unit; `None` if the heading has none.
    unit: Option<&'a str>,
    /// Set if the source finds the column by itself.
    usual: bool,
}

/// The unit after a name: `ax [m/s^2]`.
fn in_brackets(heading: &str) -> Option<&str> {
    let (_, rest) = heading.split_once(['[', '('])?;
    Some(rest.trim_end_matches([']', ')']).trim())
}

/// Finds the column of a channel.
fn column<'a>(headings: &'a [String], channel: &Known) -> Option<Column<'a>> {
    let (name, si, others) = *channel;
    let dimension = column_suffix(si).map(|u| u.exponents());
    let fits = |unit: &str| column_suffix(unit).map(|u| u.exponents()) == dimension;
    let of = |heading: &'a str, name: &str| {
        let plain = heading.split(['[', '(']).next().unwrap_or(heading).trim();
        let lower = plain.to_ascii_lowercase();
        let rest = lower.strip_prefix(name)?;
        let unit = match rest.strip_prefix('_') {
            Some(_) => Some(&plain[name.len() + 1..]).filter(|unit| fits(unit)),
            None if rest.is_empty() => in_brackets(heading)
                .filter(|unit| parse_unit(unit).is_ok_and(|u| Some(u.exponents()) == dimension)),
            None => return None,
        };
        (rest.is_empty() || unit.is_some()).then_some((unit, plain == heading))
    };
    headings
        .iter()
        .find_map(|heading| {
            let (unit, plain) = of(heading, name)?;
            Some(Column {
                heading,
                unit,
                usual: plain && unit.is_some() && heading.starts_with(name),
            })
        })
        .or_else(|| {
            others.iter().find_map(|other| {
                headings.iter().find_map(|heading| {
                    let (unit, _) = of(heading, other)?;
                    Some(Column { heading, unit, usual: false })
                })
            })
        })
}

/// The sensors of a table, by the beginning of its file.
///
/// # Errors
/// With the reason why no sensor is recognised.
pub fn recognise(beginning: &str) -> Result<Vec<Found>, String> {
    let mut lines = beginning.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#'));
    let Some(header) = lines.next() else { return Err("the file is empty".to_owned()) };
    if header.starts_with('%') {
        return rtklib(beginning);
    }
    let count = |c: &char| header.matches(*c).count();
    let delimiter = [',', ';', '\t', '|'].into_iter().max_by_key(count).filter(|c| count(c) > 0);
    let split = |line: &str| -> Vec<String> {
        let clean = |cell: &str| cell.trim().trim_matches('"').trim().to_owned();
        match delimiter {
            Some(delimiter) => line.split(delimiter).map(clean).collect(),
            None => line.split_whitespace().map(clean).collect(),
        }
    };
    let headings = split(header);
    let delimiter_key = match delimiter {
        Some(',') => None,
        Some(c) => Some(format!("delimiter = {}", quoted(&c.to_string()))),
        None => Some("delimiter = \"whitespace\"".to_owned()),
    };
    let with_delimiter = |mut found: Found| {
        found.source.extend(delimiter_key.clone());
        Ok(vec![found])
    };
    if headings.iter().all(|h| h.parse::<f64>().is_ok()) {
        // the last line may be cut off
        let rows: Vec<&str> = beginning.lines().filter(|l| !l.trim().is_empty()).collect();
        let whole = rows.len().saturating_sub(1).clamp(1, PLAIN_ROWS);
        let rows: Vec<Vec<String>> = rows.iter().take(whole).map(|l| split(l)).collect();
        if let Some(found) = plain::without_headings(&rows) {
            return with_delimiter(found);
        }
        return Err("its first line holds numbers, not headings: write the headings with their \
                    units into the first line, or describe the columns with `headings` in a \
                    scenario"
            .to_owned());
    }
    let first = lines.next().map(split).unwrap_or_default();
    if let Some(found) = plain::sbg(&headings, &first) {
        return with_delimiter(found);
    }
    let mut shared: Vec<String> = delimiter_key.into_iter().collect();
    let mut questions = Vec::new();
    shared.extend(time(&headings, &first, &mut questions)?);
    let has = |known: &[Known]| known.iter().all(|k| column(&headings, k).is_some());
    let mut sensors: Vec<(&'static str, Vec<Known>, Vec<String>)> = Vec::new();
    if has(&IMU) {
        sensors.push(("imu", IMU.to_vec(), Vec::new()));
    } else if has(&INCREMENTS) {
        let keys = vec!["output = \"increments\"".to_owned()];
        sensors.push(("imu", INCREMENTS.to_vec(), keys));
    }
    if has(&DVL) {
        sensors.push(("dvl", DVL.to_vec(), Vec::new()));
    }
    if has(&DEPTH) {
        sensors.push(("depth", DEPTH.to_vec(), Vec::new()));
    }
    if has(&POSITION[..2]) && has(&ATTITUDE) {
        sensors.push(("reference", [POSITION, ATTITUDE].concat(), Vec::new()));
    } else if has(&POSITION[..2]) {
        sensors.push(("gnss", POSITION.to_vec(), Vec::new()));
    } else if has(&HEADING) {
        sensors.push(("dual-antenna", HEADING.to_vec(), Vec::new()));
    }
    if sensors.is_empty() {
        let list: Vec<&str> = headings.iter().take(20).map(String::as_str).collect();
        return Err(format!(
            "no sensor is recognised by its columns {}; rename them, such as gyro_x_radps, or map \
             them with `columns` in a scenario",
            list.join(", ")
        ));
    }
    Ok(sensors
        .into_iter()
        .map(|(kind, known, keys)| {
            let (mut source, mut questions) = (shared.clone(), questions.clone());
            for (name, si, others) in known {
                let Some(found) = column(&headings, &(name, si, others)) else { continue };
                if found.usual {
                    continue;
                }
                let unit = found.unit.unwrap_or(si);
                let unit = suffix_expression(unit).unwrap_or(unit.into());
                let mut text = format!("columns.{name} = {{ column = {}", quoted(found.heading));
                let _ = write!(text, ", unit = {} }}", quoted(&unit));
                if found.unit.is_none() {
                    questions.push(format!("the unit of {}: {unit} is assumed", found.heading));
                }
                source.push(text);
            }
            Found { kind, sensor: keys, source, questions, velocity: has_velocity(&headings) }
        })
        .collect())
}

fn has_velocity(headings: &[String]) -> bool {
    column(headings, &("vel_n", "mps", &[])).is_some()
}

/// The key of the time, unless the source finds its column by itself.
fn time(
    headings: &[String],
    first: &[String],
    questions: &mut Vec<String>,
) -> Result<Option<String>, String> {
    let known: Known = ("time", "s", &TIMES);
    let Some(found) = column(headings, &known) else {
        return Err(format!(
            "no column of the time among {}; name it time_s",
            headings.iter().take(20).cloned().collect::<Vec<_>>().join(", ")
        ));
    };
    if found.usual {
        return Ok(None);
    }
    let place = headings.iter().position(|h| h == found.heading).unwrap_or(0);
    let cell = first.get(place).map_or("", String::as_str);
    if cell.contains(['-', '/']) && cell.contains(':') {
        let heading = quoted(found.heading);
        return Ok(Some(format!("time = {{ column = {heading}, format = \"date-time\" }}")));
    }
    let unit = found.unit.map(str::to_owned).unwrap_or_else(|| {
        // a count since 1970 shows its unit by its size
        let unit = match cell.parse::<f64>().unwrap_or(0.0) {
            t if t > 1e17 => "ns",
            t if t > 1e14 => "us",
            t if t > 1e11 => "ms",
            _ => "s",
        };
        questions.push(format!("the unit of the time {}: {unit} is assumed", found.heading));
        unit.to_owned()
    });
    Ok(Some(format!("time = {{ column = {}, unit = {} }}", quoted(found.heading), quoted(&unit))))
}

/// A solution of RTKLIB with latitude and longitude in degrees and dates.
fn rtklib(beginning: &str) -> Result<Vec<Found>, String> {
    let comments = beginning.lines().take_while(|l| l.starts_with('%'));
    let titles = comments.filter(|l| l.contains("latitude(deg)")).last();
    let row = beginning.lines().find(|l| !l.starts_with('%')).unwrap_or("");
    let cells: Vec<&str> = row.split_whitespace().collect();
    let dated = cells.first().is_some_and(|c| c.contains('/'));
    let titles = titles.map(|l| l.trim_start_matches('%').split_whitespace().collect::<Vec<_>>());
    // one title, GPST or UTC, stands over date and time
    let Some(titles) = titles.filter(|titles| dated && titles.len() + 1 == cells.len()) else {
        return Err("it begins as a solution of RTKLIB, but has no latitude and longitude in \
                    degrees, or no dates: set them in the options of RTKLIB"
            .to_owned());
    };
    let scale = if titles[0] == "UTC" { "utc" } else { "gps" };
    let heading = |title: &&str| {
        let known = RTKLIB.iter().find(|(name, _)| name == title);
        quoted(known.map_or(title, |(_, heading)| heading))
    };
    let headings: Vec<String> = titles[1..].iter().map(heading).collect();
    let velocity = titles.contains(&"vn(m/s)");
    let mut source = vec![
        "delimiter = \"whitespace\"".to_owned(),
        "comment = \"%\"".to_owned(),
        format!("headings = [\"date\", \"time\", {}]", headings.join(", ")),
        format!("time = {{ column = \"time\", date = \"date\", scale = \"{scale}\" }}"),
    ];
    if titles.contains(&"vu(m/s)") {
        let column = "columns.vel_d = { column = \"vu(m/s)\", unit = \"m/s\", scale = -1 }";
        source.push(column.to_owned());
    }
    let (sensor, questions) = (Vec::new(), Vec::new());
    Ok(vec![Found { kind: "gnss", sensor, source, questions, velocity }])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_unit_after_the_name_or_in_brackets_is_used_and_another_is_asked_for() {
        let table =
            "timestamp [ms];GX (deg/s);gy_dps;wz;acc_x [g];ay (furlong);az\n1;2;3;4;5;6;7\n";
        let found = recognise(table).unwrap().remove(0);
        let keys = [
            "delimiter = \";\"",
            "time = { column = \"timestamp [ms]\", unit = \"ms\" }",
            "columns.gyro_x = { column = \"GX (deg/s)\", unit = \"deg/s\" }",
            "columns.gyro_y = { column = \"gy_dps\", unit = \"deg/s\" }",
            "columns.gyro_z = { column = \"wz\", unit = \"rad/s\" }",
            "columns.accel_x = { column = \"acc_x [g]\", unit = \"g\" }",
            "columns.accel_y = { column = \"ay (furlong)\", unit = \"m/s^2\" }",
            "columns.accel_z = { column = \"az\", unit = \"m/s^2\" }",
        ];
        assert_eq!((found.kind, found.source), ("imu", keys.map(str::to_owned).to_vec()));
        let asked = ["wz: rad/s", "ay (furlong): m/s^2", "az: m/s^2"];
        assert_eq!(found.questions, asked.map(|q| format!("the unit of {q} is assumed")));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_recognised_or_not(text in "(time|t|wx|lat|vx|%|#|\\[|\\(|_|,|;| |\n|\"|é|1|-)*") {
            if let Ok(found) = recognise(&text) {
                prop_assert!(!found.is_empty());
            }
        }
    }
}
