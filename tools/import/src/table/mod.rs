//! Tables: the sensors of a file by its headings, or by its content where it has none.
//!
//! [`layout`] finds the rows, [`vocabulary`] the meaning of a heading, [`content`] the columns of a
//! table without headings, and [`units`] the units that the numbers show.

mod clock;
mod columns;
mod content;
mod imu;
mod layout;
mod plain;
mod units;
mod vocabulary;

use crate::found::Found;
use columns::Table;
use layout::Layout;
use navfuse_core::document::quoted;

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

/// The sensors of a table, by the beginning of its file.
///
/// # Errors
/// With the reason why no sensor is recognised.
pub fn recognise(beginning: &str) -> Result<Vec<Found>, String> {
    if beginning.trim().is_empty() {
        return Err("the file is empty".to_owned());
    }
    if beginning.starts_with('%') && beginning.contains("latitude(deg)") {
        return rtklib(beginning);
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
        return Table::new(&layout, vec![question]).sensors();
    }
    Table::new(&layout, Vec::new()).sensors()
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
    Ok(vec![Found { kind: "gnss", source, velocity, ..Found::default() }])
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
