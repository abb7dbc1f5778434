//! Tables: the sensors of a file by its headings, or by its content where it has none.
//!
//! [`layout`] finds the rows, [`vocabulary`] the meaning of a heading, [`content`] the columns of a
//! table without headings, and [`units`] the units that the numbers show.

mod alone;
mod angles;
mod beams;
mod clock;
mod columns;
mod complete;
mod content;
mod elements;
mod fields;
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
mod ramps;
mod rows;
mod rtklib;
mod sections;
mod sentinel;
mod stamps;
mod terminal;
mod track;
mod triples;
mod units;
mod unknown;
mod vbox;
mod vocabulary;
mod widths;

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
    of_text(beginning, name, true)
}

/// The inertial unit, the velocity log and the depth in rows of other kinds than the sentences of NMEA 0183 beside them.
pub fn other_kinds(text: &str) -> Vec<Found> {
    let wanted = |found: &Found| ["imu", "dvl", "depth"].contains(&found.kind);
    kinds::sensors(text, false).into_iter().filter(wanted).collect()
}

/// The same; with `stamps`, a terminal program may have written one before each line.
fn of_text(beginning: &str, name: &str, stamps: bool) -> Result<Vec<Found>, String> {
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
    if let Some((text, mark)) = terminal::without_stamps(beginning).filter(|_| stamps) {
        let mut found = of_text(&text, name, false)?;
        for sensor in &mut found {
            sensor.source.push(format!("stamps = \"{mark}\""));
        }
        return Ok(found);
    }
    if let Some((text, widths)) = widths::apart(beginning) {
        let mut found = of_text(&text, name, false)?;
        for sensor in &mut found {
            sensor.source.push(format!("widths = {widths:?}"));
        }
        return Ok(found);
    }
    if let Some(found) = sections::sensors(beginning, name) {
        return Ok(found);
    }
    let several = kinds::sensors(beginning, true);
    if !several.is_empty() {
        return Ok(several);
    }
    if let Some(why) = unknown::one_value(beginning).or_else(|| unknown::sentences(beginning)) {
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
        let named =
            |layout: &Layout| content::headings(layout).or_else(|| content::by_file(layout, name));
        let found = named(&layout).or_else(|| {
            layout = layout.reversed();
            named(&layout)
        });
        let Some((headings, question)) = found else {
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
    // beside a half that headings name, the content may show the other one
    let found = measured(layout.clone(), name, Vec::new());
    let whole = |found: &Vec<Found>| {
        !found
            .iter()
            .any(|half| ["gyros", "accels"].contains(&half.kind) && !half.sensor.is_empty())
    };
    match found {
        Ok(found) if whole(&found) => Ok(found),
        other => by_content(&layout).map_or(other, Ok),
    }
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
        let asked = [
            "the unit of wz: rad/s is assumed",
            "the unit of ay (furlong): furlong is no unit that is known, and m/s^2 is assumed: set the \
             unit of columns.accel_y",
            "the unit of az: m/s^2 is assumed",
        ];
        assert_eq!(found.questions, asked);
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

    /// The keys and questions of a table, and the reason why one is refused.
    fn told(text: &str) -> String {
        match recognise(text, "") {
            Ok(found) => {
                let of = |f: &Found| {
                    [vec![f.kind.to_owned()], f.source.clone(), f.questions.clone()].concat()
                };
                found.iter().flat_map(of).collect::<Vec<_>>().join("\n")
            }
            Err(why) => why,
        }
    }

    #[test]
    fn heights_beside_1e_7_degrees_are_millimetres_only_where_they_are_no_metres() {
        let table = |height: fn(i32) -> i32| {
            let row = |k: i32| {
                format!("{k},{},{},{}\n", 481_000_000 + 90 * k, 115_000_000 + 80 * k, height(k))
            };
            "time_s,latE7,lonE7,altitude\n".to_owned() + &(0..40).map(row).collect::<String>()
        };
        assert!(told(&table(|k| 500 + k % 3)).contains("altitude: m is assumed"));
        assert!(told(&table(|k| 500_000 + k % 3)).contains("altitude: mm"));
        // beside the sea, in mm
        assert!(told(&table(|k| 1500 + 400 * (k % 3))).contains("altitude: mm"));
    }

    #[test]
    fn a_height_that_counts_from_the_start_gives_way_to_another_one() {
        let table = |height: [f64; 2]| {
            let row = |k: usize| {
                let [a, b] = height.map(|h| h + 0.1 * k as f64);
                format!("{k},48.{k:04},11.5,{a:.1},{b:.1}\n")
            };
            "t,lat,lon,height,altitude\n".to_owned() + &(0..40).map(row).collect::<String>()
        };
        assert!(told(&table([0.0, 497.0])).contains("columns.height = { column = \"altitude\""));
        assert!(told(&table([512.0, 497.0])).contains("columns.height = { column = \"height\""));
    }

    #[test]
    fn the_increments_of_a_quaternion_with_indices_from_zero_are_angles() {
        let head =
            "PacketCounter,t,VelInc_X,VelInc_Y,VelInc_Z,OriInc_q0,OriInc_q1,OriInc_q2,OriInc_q3";
        let row = |k: usize| {
            let t = k as f64 / 100.0;
            format!("{k},{t:.2},0.001,0.002,0.098,0.99999,0.000{},0.0001,-0.0002\n", 1 + k % 3)
        };
        let text = told(&(head.to_owned() + "\n" + &(0..60).map(row).collect::<String>()));
        assert!(text.contains("columns.dtheta_x = { column = \"OriInc_q1\""), "{text}");
        assert!(text.contains("columns.dtheta_z = { column = \"OriInc_q3\""), "{text}");
    }

    #[test]
    fn a_clock_of_whole_seconds_gives_way_to_a_finer_one() {
        let row = |k: usize| {
            format!("2023-11-14 22:13:2{},{}.{k:02},1,2,3\n", k / 50, 1_700_000_000 + k / 100)
        };
        let text = "Timestamp,Unix Time,vel_x_mps,vel_y_mps,vel_z_mps\n".to_owned()
            + &(0..99).map(row).collect::<String>();
        assert!(told(&text).contains("time = { column = \"Unix Time\""), "{}", told(&text));
    }

    #[test]
    fn comments_that_describe_the_columns_one_by_one_are_headings() {
        let head = "* Sea-Bird SBE 49\n# name 0 = timeS: Time, Elapsed [seconds]\n# name 1 = prDM: Pressure, \
                    Digiquartz [db]\n# name 2 = t090C: Temperature [ITS-90, deg C]\n*END*\n";
        let row = |k: usize| {
            format!("{:11.3}{:11.4}{:11.4}\n", k as f64 / 2.0, 10.0 + k as f64 / 9.0, 8.1)
        };
        let text = told(&(head.to_owned() + &(0..40).map(row).collect::<String>()));
        assert!(
            text.contains("column = \"Sea Pressure [db]\", unit = \"dbar\", atmosphere = \"0 Pa\""),
            "{text}"
        );
    }

    #[test]
    fn a_table_with_one_value_in_each_row_and_no_known_time_is_refused() {
        let row = |k: usize| format!("{k},gyro_{},0.{k}\n", ["x", "y", "z"][k % 3]);
        let text = "cycle,signal,value\n".to_owned() + &(0..90).map(row).collect::<String>();
        assert!(told(&text).contains("each row has one value, which its cell signal names"));
    }

    #[test]
    fn a_heading_with_empty_cells_and_a_log_beside_a_receiver_are_sensors() {
        let row = |k: usize| {
            let t = k as f64 / 100.0;
            let full = k.is_multiple_of(10);
            let heading = if full { format!("{}.5", 90 + k / 100) } else { String::new() };
            let place = if full { format!("48.{k:05},11.5") } else { ",".to_owned() };
            let log = if full { "1,2,3" } else { ",," };
            let imu = format!("{t:.2},0.0{},0.01,0.02,0.1,0.2,-9.8{}", k % 7, k % 9);
            [format!("{imu},{heading},{log}\n"), format!("{imu},{log},{place}\n")]
        };
        let imu = "t,gx,gy,gz,ax,ay,az";
        let heads = ["ahrs/heading_deg,dvl/vx,dvl/vy,dvl/vz", "dvl/vx,dvl/vy,dvl/vz,lat,lon"];
        let kinds = heads.iter().enumerate().map(|(k, head)| {
            let rows: String = (0..200).map(|r| row(r)[k].clone()).collect();
            let found = recognise(&format!("{imu},{head}\n{rows}"), "").unwrap();
            found.iter().map(|f| f.kind).collect::<Vec<&str>>()
        });
        let expected = [vec!["imu", "dvl", "dual-antenna"], vec!["imu", "dvl", "gnss"]];
        assert!(kinds.eq(expected.clone()), "{expected:?}");
    }

    #[test]
    fn poses_are_a_receiver_and_an_attitude_too() {
        let row = |k: usize| format!("{k},{}.1,1.5,{},48.{k:04},11.5,500\n", k % 3, 90 + k % 5);
        let head = "t,Roll Angle (deg),Pitch Angle (deg),True Heading (deg),lat,lon,alt\n";
        let found =
            recognise(&(head.to_owned() + &(0..60).map(row).collect::<String>()), "").unwrap();
        let apart: Vec<&str> = found[0].apart.iter().map(|f| f.kind).collect();
        assert_eq!((found[0].kind, apart), ("reference", vec!["gnss", "attitude"]));
        assert!(found[0].apart.iter().all(|f| f.source.iter().any(|key| key.starts_with("time"))));
    }

    #[test]
    fn rows_that_are_counted_have_the_rate_above_the_table() {
        let row = |k: usize| format!("{k},0.0{},0.01,0.02,0.1,0.2,-9.8{}\n", k % 7, k % 9);
        let rows = (0..60).map(row).collect::<String>();
        let text = format!("Device: X-3\nSample Rate: 50.0Hz\n\nSample,gx,gy,gz,ax,ay,az\n{rows}");
        let key = "time = { column = \"Sample\", unit = \"20000*us\" }";
        assert!(told(&text).contains(key), "{}", told(&text));
        assert!(told(&text.replace("50.0Hz", "fast")).contains("Sample counts the rows"));
    }

    #[test]
    fn sentences_that_are_not_read_are_named() {
        let row = |k: usize| format!("2023-11-14T22:13:{k}Z,$PRDID,+1.2,-0.3,2{k}.0*5A\n");
        let why = told(&(10..50).map(row).collect::<String>());
        assert!(why.contains("($PRDID)"), "{why}");
    }

    #[test]
    fn an_even_clock_without_a_name_goes_before_a_time_that_rows_share() {
        let row = |k: usize| {
            let fix = 1_700_000_000 + k / 20;
            format!(
                "{k},{:.2},0.0{},0.01,0.02,0.1,0.2,-9.8{},48.1,11.5,{fix}\n",
                3.0 + k as f64 / 100.0,
                k % 7,
                k % 9
            )
        };
        let text = "frame,sinceStartup,gx,gy,gz,ax,ay,az,lat,lon,location.timestamp\n".to_owned()
            + &(0..200).map(row).collect::<String>();
        let key = "time = { column = \"sinceStartup\"";
        assert!(told(&text).contains(key), "{}", told(&text));
    }

    #[test]
    fn a_value_has_the_meaning_of_its_file() {
        let text = "time,entity,value (m)\n".to_owned()
            + &(0..40).map(|k| format!("{k},e,{}.5\n", k % 5)).collect::<String>();
        let found = recognise(&text, "Depth").unwrap().remove(0);
        assert_eq!(found.kind, "depth");
        assert!(recognise(&text, "Status").is_err());
    }

    #[test]
    fn coordinates_of_the_earth_in_kilometres_are_found_by_their_size() {
        let row = |k: usize| format!("{k},{:.6},{:.6},4728.0\n", 4177.0 + k as f64 / 1e3, 855.0);
        let text = "t,X (km),Y (km),Z (km)\n".to_owned() + &(0..20).map(row).collect::<String>();
        assert!(told(&text).contains("notation = \"earth-fixed\", scale = 1e3"), "{}", told(&text));
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
