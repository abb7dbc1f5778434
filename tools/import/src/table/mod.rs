//! Tables: the sensors of a file by its headings, or by its content where it has none.
//!
//! [`layout`] finds the rows, [`vocabulary`] the meaning of a heading, [`content`] the columns of a
//! table without headings, and [`units`] the units that the numbers show.

mod alone;
mod angles;
mod beams;
mod clock;
mod columns;
mod content;
mod imu;
mod kinds;
mod labelled;
mod layout;
mod map;
mod measured;
mod oxts;
mod pair;
mod place;
mod plain;
mod rtklib;
mod sections;
mod sentinel;
mod stamps;
mod track;
mod triples;
mod units;
mod unknown;
mod vbox;
mod vocabulary;

use crate::found::Found;
pub use angles::IN_E7;
pub use clock::GUESSED;
use columns::Table;
pub use content::BY_CONTENT;
use layout::Layout;
use measured::measured;
pub use oxts::oxts;
pub use pair::{LATITUDE_FIRST, LONGITUDE_FIRST, ORDER};
pub use units::{E7, SEMICIRCLE, counted, factor, nearest_counts};
use vocabulary::meaning;

/// The sensors of a table, by the beginning of its file and the name of the file.
///
/// # Errors
/// With the reason why no sensor is recognised.
pub fn recognise(beginning: &str, name: &str) -> Result<Vec<Found>, String> {
    if beginning.trim().is_empty() {
        return Err("the file is empty".to_owned());
    }
    if let Some(found) = rtklib::solution(beginning) {
        return Ok(vec![found]);
    }
    if let Some(found) = vbox::sensors(beginning) {
        return found;
    }
    if let Some(found) = labelled::sensors(beginning, name) {
        return found;
    }
    if let Some(found) = sections::sensors(beginning, name) {
        return Ok(found);
    }
    let several = kinds::sensors(beginning);
    if !several.is_empty() {
        return Ok(several);
    }
    if let Some(why) = unknown::one_value(beginning) {
        return Err(why);
    }
    let Some(mut layout) = Layout::of(beginning) else {
        return Err("it is no table: no line holds numbers that a comma, semicolon, tab, bar or \
                    spaces separate"
            .to_owned());
    };
    if layout.headings.is_empty() {
        if let Some(found) = plain::without_headings(&layout) {
            return Ok(vec![found]);
        }
        let Some((headings, question)) = content::headings(&layout) else {
            return Err("its first line holds numbers, not headings, and no columns look like a \
                        time with a specific force and angular rates, or with positions: write \
                        the headings with their units into the first line, or describe the \
                        columns with `headings` in a scenario"
                .to_owned());
        };
        layout.headings = headings;
        layout.given = true;
        return measured(layout, name, vec![question]);
    }
    measured(layout.clone(), name, Vec::new()).or_else(|why| by_content(&layout).ok_or(why))
}

/// The sensors of messages with these fields, by their values.
///
/// # Errors
/// With the reason why no sensor is recognised.
pub fn of_fields(
    headings: Vec<String>,
    rows: Vec<Vec<String>>,
    name: &str,
) -> Result<Vec<Found>, String> {
    measured(Layout::labelled(headings, rows, Vec::new()), name, Vec::new())
}

/// Channels whose headings are right beside those of an inertial unit that mean nothing.
const KEPT: [&str; 6] = ["lat", "lon", "height", "vel_n", "vel_e", "vel_d"];

/// The inertial unit of a table whose headings mean nothing, by the content of its columns.
fn by_content(layout: &Layout) -> Option<Vec<Found>> {
    if layout.has_vectors() {
        return None;
    }
    let (mut headings, question) = content::headings(layout)?;
    for (name, own) in headings.iter_mut().zip(&layout.headings) {
        let placed = meaning(own).is_some_and(|m| KEPT.contains(&m.channel));
        let free = name.starts_with("column_") || KEPT.contains(&name.as_str());
        if placed && free {
            name.clone_from(own);
        }
    }
    let inertial = ["accel_x", "dvel_x"].iter().any(|name| headings.iter().any(|h| h == name));
    let layout = layout.renamed(headings);
    inertial.then(|| Table::new(&layout, "", vec![question]).sensors().ok())?
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
        let found = recognise(table, "").unwrap().remove(0);
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

    #[test]
    fn a_heading_beside_a_speed_is_the_course_where_positions_move_along_it() {
        // 10 m/s, which are 22.37 mi/h, to the east and to the north in turns of 30 s
        let mut place = [48.1_f64, 11.5];
        let mut text = "Time,Latitude,Longitude,Speed (mph),Heading\n".to_owned();
        for k in 0..100 {
            let east = k / 30 % 2 == 0;
            text += &format!(
                "{k},{:.7},{:.7},22.37,{}\n",
                place[0],
                place[1],
                if east { "90.0" } else { "0.5" }
            );
            let degrees = 10.0 / 111_194.9;
            match east {
                true => place[1] += degrees / place[0].to_radians().cos(),
                false => place[0] += degrees,
            }
        }
        let found = recognise(&text, "").unwrap().remove(0);
        let key = "columns.vel_n = { column = \"Speed (mph)\", unit = \"5280*ft/h\", course = \"Heading\" }";
        assert!(found.source.iter().any(|line| line == key), "{:?}", found.source);
        let found = recognise(&text.replace(" (mph)", ""), "").unwrap().remove(0);
        let key = key.replace(" (mph)", "");
        assert!(found.source.contains(&key), "{:?}", found.source);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_text_is_recognised_or_not(text in "(time|t|wx|lat|vx|%|#|\\[|\\(|_|,|;| |\n|\"|é|1|-)*") {
            if let Ok(found) = recognise(&text, "") {
                prop_assert!(!found.is_empty());
            }
        }
    }
}
